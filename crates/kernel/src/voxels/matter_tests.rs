//! Matter as laid out for lanes against what was described, and tables against
//! exact rays.

use super::flat_medium::FlatMedium;
use super::optical_depth_table::{self, Nodes, OpticalDepthTable, extinctions};
use super::{shadow_ray, voxel_words};
use crate::matter::{Matter, NO_YARN, Population, Scatterers, Substance, Unsuited};
use glam::{IVec3, UVec3, Vec3};
use organza_basis::{Aabb, CellGrid, PathRng, Rgb, warp};
use organza_lanes::{Ints, one};
use organza_scatter::{AxialFlake, FlakeFamily, MicroFlake};

/// Populations of every voxel.
pub struct Described {
    cell_grid: CellGrid,
    populations: Vec<Vec<Population>>,
}

impl Matter for Described {
    fn cell_grid(&self) -> &CellGrid {
        &self.cell_grid
    }

    fn scatterers(&self) -> Scatterers<'_> {
        Scatterers::Flakes(FlakeFamily::SGGX_SPECULAR.scattering(&[]))
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        out.extend(&self.populations[self.voxel(cell)]);
        Ok(())
    }
}

impl Described {
    fn voxel(&self, c: UVec3) -> usize {
        let dims = self.cell_grid.dims();
        ((c.z * dims.y + c.y) * dims.x + c.x) as usize
    }

    fn new(repeats: bool, of: impl Fn(Vec3, &mut PathRng) -> Vec<Population>) -> Described {
        // No multiple of anything, not cubic.
        let dims = UVec3::new(13, 11, 9);
        let min = Vec3::new(0.1, -0.2, 0.0);
        let bounds = Aabb::new(min, min + Vec3::new(0.26, 0.2, 0.16));
        let mut rng = PathRng::from_seed(77);
        let populations = (0..dims.element_product()).map(|i| {
            let c = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
            of((c.as_vec3() + 0.5) / dims.as_vec3() - 0.5, &mut rng)
        });
        Described {
            populations: populations.collect(),
            cell_grid: CellGrid::new(bounds, dims, repeats).unwrap(),
        }
    }
}

fn population(axis: Vec3, broadside_per_mm: f32, albedo: [f32; 3], yarn: u32) -> Population {
    Population {
        broadside_per_mm,
        flake: AxialFlake::new(axis.normalize(), 0.06),
        substance: Substance::Flakes(Rgb::from(albedo), 0),
        yarn,
    }
}

/// Whether a place is in one of two crossing bundles.
fn bundles_at(p: Vec3) -> [bool; 2] {
    [
        (p.y * 2.5).powi(2) + (p.z * 6.0 + 1.2).powi(2) < 1.0,
        (p.x * 2.5).powi(2) + (p.z * 6.0 - 1.2).powi(2) < 1.0,
    ]
}

/// Two crossing bundles of fibres with air around them; density varies from
/// voxel to voxel.
pub fn bundles(repeats: bool) -> Described {
    Described::new(repeats, |p, rng| {
        let dense = 5.0 + 60.0 * rng.unit() * rng.unit();
        let of = |axis, albedo| vec![population(axis, dense, albedo, NO_YARN)];
        match bundles_at(p) {
            [true, _] => of(Vec3::new(1.0, 0.2, 0.3), [0.95, 0.8, 0.6]),
            [_, true] => of(Vec3::new(0.1, 1.0, -0.2), [0.5, 0.9, 0.99]),
            _ => vec![],
        }
    })
}

/// The same with both in some voxels.
fn mixtures() -> Described {
    Described::new(true, |p, rng| {
        let dense = 5.0 + 60.0 * rng.unit() * rng.unit();
        let low = population(Vec3::new(1.0, 0.2, 0.3), dense, [0.9, 0.7, 0.5], 3);
        let high = population(Vec3::new(0.1, 1.0, -0.2), 0.6 * dense, [0.9, 0.7, 0.5], 5);
        let [in_low, in_high] = bundles_at(0.7 * p);
        let mut found = vec![];
        found.extend(in_low.then_some(low));
        found.extend((in_high || in_low && dense > 20.0).then_some(high));
        found
    })
}

/// Laid out and described, everywhere and toward many directions.
#[test]
fn laid_out_matter_is_what_was_described() {
    let mut rng = PathRng::from_seed(4);
    for (described, has_mixtures) in [(bundles(false), false), (mixtures(), true)] {
        let flat = FlatMedium::new(&described).unwrap();
        let mut several = 0;
        for (i, own) in described.populations.iter().enumerate() {
            let w = warp::uniform_sphere(rng.unit2());
            let extinction = |p: &Population| p.broadside_per_mm * p.flake.projected_area(w);
            let (a, b) = (
                own.iter().map(extinction).sum::<f32>(),
                flat.populations_of(i)
                    .map(|p| p.extinction_per_mm(w))
                    .sum::<f32>(),
            );
            // The axis is off by at most 1e-3 rad, which matters most where it
            // is seen nearly end-on: at an end-on ratio e, by 1/(2 e) of it.
            assert!((a - b).abs() <= 8e-3 * a, "seed 4: {a}, {b} in voxel {i}");
            let densest = own
                .iter()
                .max_by(|a, b| a.broadside_per_mm.total_cmp(&b.broadside_per_mm));
            if let Some(densest) = densest {
                let first = flat.place(i).0 as u32;
                let shown = flat.first_event(first, 1.0).unwrap().info;
                let axis = densest.flake.scaled_axis().normalize();
                assert!(shown.axis.dot(axis).abs() > 0.9999, "seed 4: voxel {i}");
                assert_eq!(shown.yarn, Some(densest.yarn).filter(|&y| y != NO_YARN));
            }
            several += usize::from(flat.populations_of(i).count() > 1);
        }
        assert_eq!(several > 20, has_mixtures, "{several} mixtures");
        assert_eq!(flat.places.is_empty(), !has_mixtures);
    }
}

/// Words give back what was packed, to the errors that they state.
#[test]
fn words_of_voxels_keep_what_they_state() {
    use super::voxel_words::{MOST, bound_code, bound_of, pack};
    let mut rng = PathRng::from_seed(5);
    let (mut turned, mut off) = (0.0f32, 0.0f32);
    for _ in 0..20_000 {
        let axis = warp::uniform_sphere(rng.unit2());
        let broadside = MOST * 10f32.powf(-4.0 * rng.unit());
        let end_on = 0.01 + 0.99 * rng.unit();
        let words = pack(broadside, axis, end_on).map(one::U::splat);
        let words = voxel_words::VoxelWords(words);
        let stored = words.axis();
        let stored = Vec3::new(stored.x.0, stored.y.0, stored.z.0);
        assert!(stored.length() > 0.57 && stored.length() < 1.0005);
        turned = turned.max(stored.normalize().cross(axis).length());
        let apart = (words.broadside().0 - broadside).abs();
        off = off.max(apart / (broadside + 1.0 / 32_768.0));
        assert!((words.end_on().0 / end_on - 1.0).abs() < 2.5e-3);
        let bound = bound_of(bound_code(broadside));
        assert!(bound >= broadside && bound < 1.07 * broadside + 1e-6);
    }
    assert!(turned < 1.2e-3, "seed 5: {turned}");
    assert!(off < 1.0 / 8192.0 + 1e-6, "seed 5: {off}");
    assert_eq!(bound_of(bound_code(0.0)), 0.0);
    assert_eq!(bound_of(255), MOST);
    assert_eq!(voxel_words::VoxelWords::<one::U>::unknown().bound().0, MOST);
}

/// Every voxel within the reach of another is below its bound.
#[test]
fn reaches_bound_what_they_hold() {
    for medium in [
        FlatMedium::new(&bundles(false)).unwrap(),
        FlatMedium::new(&bundles(true)).unwrap(),
    ] {
        let cell_grid = medium.cell_grid;
        let dims = cell_grid.dims();
        let number = |c: UVec3| ((c.z * dims.y + c.y) * dims.x + c.x) as usize;
        let mut widest = 0;
        for i in 0..dims.element_product() {
            let c = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
            let words = medium.words_at(medium.place(number(c)).0);
            let bound = words.bound().0 * medium.scale_per_mm;
            let reach = words.reach().0;
            let around = reach as i32 - 1;
            widest = widest.max(around);
            for dz in -around..=around {
                for dy in -around..=around {
                    for dx in -around..=around {
                        let n = c.as_ivec3() + IVec3::new(dx, dy, dz);
                        let inside = cell_grid.wrap(n, dims);
                        let beyond = inside.as_ivec3() != n;
                        let is_matter = inside.z as i32 == n.z && (cell_grid.repeats() || !beyond);
                        if is_matter {
                            let own = medium.populations_of(number(inside));
                            let own: f32 = own.map(|p| p.broadside_per_mm).sum();
                            assert!(own <= bound, "{own} > {bound} at {n} from {c}");
                        }
                    }
                }
            }
        }
        assert!(widest > 1, "no voxel reaches beyond its neighbours");
    }
}

/// The nodes of a table against exact rays from the same places.
#[test]
fn tables_hold_exact_depths() {
    for repeats in [false, true] {
        let medium = FlatMedium::new(&bundles(repeats)).unwrap();
        for direction in [Vec3::new(0.5, 0.3, -0.8), Vec3::new(-0.4, 0.2, 0.9)] {
            let (direction, irradiance) = (direction.normalize(), Rgb::WHITE);
            let extinctions = extinctions(&medium, -direction);
            let nodes = Nodes::new(&medium.cell_grid, 1, std::iter::once(&extinctions[..]));
            let matter = (medium.cell_grid, None);
            let table = OpticalDepthTable::new(matter, nodes, direction, irradiance, extinctions);
            let n = table.nodes.dims;
            for (i, &word) in table.depths.iter().enumerate() {
                let i = i as u32;
                let c = UVec3::new(i / n.z % n.x, i / (n.z * n.x), i % n.z);
                let p = (c.as_vec3() + 0.5) / table.nodes.per_voxel as f32;
                let mut ray = shadow_ray::ShadowRay {
                    blocks: None,
                    cell_grid: &medium.cell_grid,
                    at: p,
                    toward: table.to_light,
                    reach_mm: f32::INFINITY,
                    sure_depth: f32::INFINITY,
                    chance: 0.0,
                };
                let exact = -table.transmittance(&medium, &ray).0.ln();
                if i.is_multiple_of(97) {
                    // Stopped by chance, it is that on average; and so without
                    // the extinctions of the table.
                    ray.sure_depth = 0.5;
                    let mut stopped = |k: u32| {
                        ray.chance = (k as f32 + 0.5) / 500.0;
                        let own = |voxel| medium.extinction_per_mm(voxel, ray.toward);
                        ray.transmittance(own).0
                    };
                    let mean = (0..500).map(&mut stopped).sum::<f32>() / 500.0;
                    assert!((mean - (-exact).exp()).abs() < 2e-3, "{mean}, {exact}");
                }
                let depth = (word & 0xff) as f32 * (optical_depth_table::MAX_DEPTH / 255.0);
                let least = exact.min(optical_depth_table::MAX_DEPTH);
                assert!((depth - least).abs() < 0.025, "{depth}, {exact} at {p}");
            }
        }
    }
}
