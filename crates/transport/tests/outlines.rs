//! Coarse cells that keep the outline of their matter: gaps stay open, and nothing of the
//! fibre is lost.

use crate::scenes::octree;
use glam::{DVec3, UVec3, Vec3};
use organza_basis::hypothesis::{t_test, welch_test};
use organza_basis::{FibrePopulation, Mixture, Moments, PathRng, Ray, Rgb, unwatched};
use organza_testing::{fitted_fibre, little_weave};
use organza_transport::{
    FlakeFamily, FlakeOctreeMedium, FlakeOptics, Medium, Stats, VirtualFibreEvent,
    VirtualFibreMedium, exact_transmittance, transmittance,
};
use organza_volume::{
    FibreFootprint, MixtureGrid, MixtureSource, Octree, VoxelizeOptions, octree_of_mixtures,
    voxelize,
};
use std::sync::Arc;

const VOXEL_MM: f32 = 0.01;
const DIMS: UVec3 = UVec3::new(32, 32, 32);
/// Layers of voxels that hold the slab.
const SLAB: std::ops::Range<u32> = 8..16;

/// A slab of stripes two voxels wide, with gaps as wide between them.
struct Stripes;

impl MixtureSource for Stripes {
    fn grid(&self) -> MixtureGrid {
        MixtureGrid {
            min_mm: DVec3::ZERO,
            voxel_mm: DVec3::splat(f64::from(VOXEL_MM)),
            dims: DIMS,
            repeats: true,
        }
    }

    fn material_count(&self) -> usize {
        1
    }

    fn mixture(&self, cell: UVec3) -> Mixture {
        let mut mixture = Mixture::EMPTY;
        if SLAB.contains(&cell.z) && (cell.x / 2).is_multiple_of(2) {
            mixture.push(FibrePopulation {
                length_density_per_mm2: 6000.0,
                axis: Vec3::Y,
                spread_rad: 0.0,
                radius_mm: 0.002,
                material: 0,
                yarn: 0,
            });
        }
        mixture
    }
}

fn medium(octree: &Arc<Octree>, level: u8) -> FlakeOctreeMedium {
    let optics = FlakeOptics::new(Rgb::splat(0.9), 0.1);
    let family = FlakeFamily::SGGX_SPECULAR;
    FlakeOctreeMedium::new(Arc::clone(octree), level, vec![optics], family).unwrap()
}

/// Straight through the slab, rays meet a stripe or a gap with the same chance:
/// `T = 1/2 + exp(-sigma d) / 2`, at every level whose sub-cells are no wider than a stripe.
/// A coarse cell that spreads its fibres evenly gives the square root of `exp(-sigma d)`.
#[test]
fn gaps_of_a_slab_stay_open() {
    let octree = Arc::new(octree_of_mixtures(&Stripes, None, None, &unwatched).unwrap());
    assert_eq!(octree.level_count(), 5);
    let down = Vec3::NEG_Z;
    let finest = medium(&octree, 0);
    let site = finest.site(Vec3::new(0.5, 0.5, 10.5));
    let depth = f64::from(finest.sigma_t(&site, down) * SLAB.len() as f32 * VOXEL_MM);
    let (want, even) = (0.5 + 0.5 * (-depth).exp(), (-0.5 * depth).exp());
    assert!(want - even > 0.1, "{want} {even}");
    let ray = |x: f32, y: f32| Ray::new(Vec3::new(x, y, 1.0), down);
    let width = DIMS.x as f32 * VOXEL_MM;
    for level in 0..octree.level_count() {
        let medium = medium(&octree, level);
        let mut stats = Stats::default();
        let columns: f64 = (0..DIMS.x)
            .map(|x| {
                let ray = ray((x as f32 + 0.5) * VOXEL_MM, 0.117);
                let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
                f64::from(exact_transmittance(&medium, &local, &mut stats))
            })
            .sum();
        let exact = columns / f64::from(DIMS.x);
        let mut rng = PathRng::new(71, u64::from(level), 0);
        let tracked: Moments = (0..20_000)
            .map(|_| {
                let ray = ray(rng.unit() * width, rng.unit() * width);
                let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
                f64::from(transmittance(&medium, &local, &mut rng, &mut stats))
            })
            .collect();
        let words = format!("seed 71, level {level}: {exact} {tracked:?} for {want} or {even}");
        assert_eq!(stats.majorant_violations, 0, "{words}");
        let p_value = |mean| t_test(&tracked, mean).p_value;
        // Octrees keep directions to 0.0006 rad and lengths to a part of 2^31.
        let near = |mean: f64| (exact / mean - 1.0).abs() < 1e-3;
        if level <= 3 {
            assert!(near(want) && p_value(want) > 1e-4, "{words}");
            let is_seen = !near(even) && p_value(even) < 1e-6;
            assert!(is_seen, "{words}: the twin passed");
        } else {
            // Stripes are narrower than sub-cells: the twin.
            assert!(near(even) && p_value(even) > 1e-4, "{words}");
            assert!(p_value(want) < 1e-6, "{words}: the twin passed");
        }
    }
}

fn fibres(octree: &Arc<Octree>, level: u8, event: VirtualFibreEvent) -> VirtualFibreMedium {
    let fibres = vec![fitted_fibre("gabardine"); octree.material_count()];
    VirtualFibreMedium::new(Arc::clone(octree), level, fibres, event).unwrap()
}

/// Virtual fibres of a coarse level pass as much light straight through the stripes as those of
/// the finest, as long as sub-cells are no wider than a stripe.
#[test]
fn gaps_stay_open_to_virtual_fibres() {
    let octree = Arc::new(octree_of_mixtures(&Stripes, None, None, &unwatched).unwrap());
    let width = DIMS.x as f32 * VOXEL_MM;
    for event in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed] {
        let through = |level: u8| -> Moments {
            let medium = fibres(&octree, level, event);
            let mut rng = PathRng::new(72, u64::from(level), 0);
            let mut stats = Stats::default();
            let found = (0..20_000)
                .map(|_| {
                    let at = Vec3::new(rng.unit() * width, rng.unit() * width, 1.0);
                    let ray = Ray::new(at, Vec3::NEG_Z);
                    let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
                    f64::from(transmittance(&medium, &local, &mut rng, &mut stats))
                })
                .collect();
            assert_eq!(stats.majorant_violations, 0, "{event:?} {level}");
            found
        };
        let finest = through(0);
        for level in 1..octree.level_count() {
            let coarse = through(level);
            let p_value = welch_test(&finest, &coarse).p_value;
            let words = format!("seed 72, {event:?}, level {level}: {finest:?} {coarse:?}");
            if level <= 3 {
                assert!(p_value > 1e-4, "{words}");
            } else {
                // Stripes are narrower than sub-cells: the twin.
                assert!(p_value < 1e-6, "{words}: the twin passed");
            }
        }
    }
}

/// Virtual fibres find in every cell what the octree has there.
#[test]
fn virtual_fibres_are_where_the_outline_has_them() {
    let octree = Arc::new(octree(&little_weave(0.0, 0), 0.01, 4));
    for level in 0..octree.level_count() {
        let medium = fibres(&octree, level, VirtualFibreEvent::Plain);
        let dims = medium.cell_grid().dims();
        assert_eq!(dims, octree.dims(octree.outline_level(level)));
        for i in 0..dims.element_product() {
            let rest = i / dims.x;
            let cell = UVec3::new(i % dims.x, rest % dims.y, rest / dims.y);
            let expected = octree.outlined_mixture(level, cell);
            let found = medium.populations_of(cell);
            assert_eq!(found.len(), expected.as_slice().len(), "{level} {cell}");
            for (a, b) in found.iter().zip(expected.iter()) {
                let share = a.length_density_per_mm2 / b.length_density_per_mm2;
                // Two products of three numbers may be rounded in another order.
                let off = (share - 1.0).abs();
                assert!(off < 4.0 * f32::EPSILON, "{level} {cell}: {share}");
                assert_eq!((a.axis, a.yarn, a.material), (b.axis, b.yarn, b.material));
            }
        }
    }
}

/// Sub-cells of every level hold the same length of fibre together.
#[test]
fn outlines_keep_all_fibre() {
    let options = VoxelizeOptions {
        voxel_mm: 0.01,
        levels: Some(4),
        footprint: FibreFootprint::Covered,
        max_memory_bytes: None,
    };
    let octree = voxelize(&little_weave(0.0, 0), &options, &unwatched).unwrap();
    octree.assert_well_formed();
    for level in 0..octree.level_count() {
        let outline = octree.outline_level(level);
        let dims = octree.dims(outline);
        let (mut length_mm, mut occupied) = (0.0f64, 0);
        for i in 0..dims.element_product() {
            let rest = i / dims.x;
            let cell = UVec3::new(i % dims.x, rest % dims.y, rest / dims.y);
            let mixture = octree.outlined_mixture(level, cell);
            let density: f32 = mixture.iter().map(|c| c.length_density_per_mm2).sum();
            let volume_mm3 = octree.voxel_mm(outline).element_product();
            length_mm += f64::from(density * volume_mm3);
            occupied += u64::from(!mixture.is_empty());
            let bound = octree.outlined_majorant_per_mm(level, cell >> u32::from(level - outline));
            let dense = mixture.broadside_per_mm();
            assert!(dense <= bound * (1.0 + 1e-6), "{level} {cell}");
        }
        let all_mm = octree.fibre_length_mm(level);
        let is_whole = (length_mm / all_mm - 1.0).abs() < 4.0 * f64::from(f32::EPSILON);
        assert!(is_whole, "{level}: {length_mm} {all_mm}");
        assert_eq!(occupied, octree.occupied_cells(outline), "level {level}");
    }
}
