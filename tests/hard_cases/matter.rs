//! A geometry as every kind of matter.

use super::{SIZE_MM, VOXEL_MM};
use glam::{UVec3, Vec3};
use organza_basis::curve::SegmentList;
use organza_basis::hypothesis::SphereGrid;
use organza_basis::{Aabb, Rgb, Sym3, unwatched};
use organza_scatter::{Fibre, FittedFibre, FittedParameters, Lobe};
use organza_testing::dielectric_fibre;
use organza_transport::{
    AnyMedium, ExplicitFibres, FlakeFamily, FlakeOctreeMedium, FlakeOptics, Grid, GridMedium,
    Interpolation, VirtualFibreEvent, VirtualFibreMedium,
};
use organza_volume::{FibreFootprint, Octree, VoxelizeOptions, voxelize};
use std::fmt::Write as _;
use std::sync::{Arc, LazyLock};

pub fn octree(source: &SegmentList, footprint: FibreFootprint) -> Arc<Octree> {
    let options = VoxelizeOptions {
        voxel_mm: VOXEL_MM,
        levels: None,
        footprint,
        max_memory_bytes: None,
    };
    Arc::new(voxelize(source, &options, &unwatched).unwrap())
}

fn clear(longitudinal_rad: f32) -> Fibre {
    dielectric_fibre(Rgb::BLACK, longitudinal_rad, 2.0 * longitudinal_rad)
}

fn black() -> Fibre {
    let parameters = FittedParameters {
        colour_r: Rgb::BLACK,
        colour_tt: Rgb::BLACK,
        ..FittedParameters::preset("silk").unwrap()
    };
    Fibre::from(FittedFibre::new(parameters).unwrap())
}

/// Fibres, and whether they absorb nothing. Their tables take longer than the pictures.
static FIBRES: LazyLock<[(&str, Fibre, bool); 3]> = LazyLock::new(|| {
    [
        ("clear smooth", clear(0.0), true),
        ("clear rough", clear(0.6), true),
        ("black", black(), false),
    ]
});

/// Share of light that black fibres along x reflect toward `view`, by quadrature.
pub fn gloss(view: Vec3) -> f64 {
    let lobe = FIBRES[2].1.far_field(Vec3::X);
    SphereGrid::new(Vec3::X, 60, 24).integrate(|w| f64::from(lobe.eval(view, w).0.x))
}

/// Matter, what a furnace of one shows of it at most and at least, per event.
pub struct Matter {
    pub name: String,
    pub medium: AnyMedium,
    /// Absorbs nothing; otherwise everything.
    pub is_white: bool,
    /// What an event may gain or lose.
    pub slack: f64,
}

/// A geometry as every kind of matter; refusals are added to `log`.
pub fn matters(source: &SegmentList, log: &mut String) -> Vec<Matter> {
    let mut list = Vec::new();
    type Made = Result<AnyMedium, String>;
    let mut put = |name: String, made: Made, is_white, slack| match made {
        Ok(medium) => list.push(Matter {
            name,
            medium,
            is_white,
            slack,
        }),
        Err(why) => {
            let _ = writeln!(log, "    {name}: refused: {why}");
        }
    };
    let covered = octree(source, FibreFootprint::Covered);
    let axes = octree(source, FibreFootprint::Axis);
    for (albedo, end_on_ratio) in [(1.0, 0.0), (1.0, 1.0), (0.0, 0.3)] {
        let optics = vec![FlakeOptics::new(Rgb::splat(albedo), end_on_ratio)];
        let make = || covered.clone();
        let white = albedo == 1.0;
        for family in FlakeFamily::all() {
            let name = family.name();
            let words = format!("{name}, albedo {albedo}, ratio {end_on_ratio}");
            let medium = FlakeOctreeMedium::new(make(), 0, optics.clone(), family);
            let medium = medium.map(AnyMedium::FlakeOctree).ok_or_else(String::new);
            put(words, medium, white, 1e-5);
        }
    }
    for (name, fibre, white) in &*FIBRES {
        let white = *white;
        for event in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed] {
            let tree = axes.clone();
            let medium = VirtualFibreMedium::new(tree, 0, vec![fibre.clone()], event);
            let words = format!("{name} fibres, {event:?}");
            let medium = medium.map(AnyMedium::VirtualFibres).ok_or_else(String::new);
            put(words, medium, white, 2e-3);
        }
        let explicit = ExplicitFibres::new(source, vec![fibre.clone()], None, &unwatched);
        let words = format!("{name} fibres, explicit");
        let explicit = explicit
            .map(AnyMedium::ExplicitFibres)
            .map_err(|e| e.to_string());
        put(words, explicit, white, 5e-3);
    }
    list
}

/// Grids at every extinction, from nothing to more than any cloth has.
pub fn grids() -> Vec<Matter> {
    let mut list = Vec::new();
    for sigma in [0.0, 1e-6, 10.0, 1e6f32] {
        // As thick as keeps the number of events of white matter bounded.
        let thick_mm = (40.0 / sigma.max(1.0)).min(SIZE_MM.z);
        let dims = UVec3::new(3, 2, 4);
        let bounds = Aabb::new(Vec3::ZERO, Vec3::new(0.12, 0.12, thick_mm));
        for (albedo, end_on) in [(1.0, 0.0f32), (1.0, 1.0), (0.0, 0.3)] {
            for interpolation in [Interpolation::Nearest, Interpolation::Trilinear] {
                let cells = vec![[sigma]; dims.element_product() as usize];
                let s = Sym3::axial(Vec3::X, 1.0, end_on * end_on).to_array();
                let medium = GridMedium::new(
                    bounds,
                    false,
                    interpolation,
                    Grid::new(dims, cells).unwrap(),
                    Grid::constant(s),
                    Grid::constant([albedo; 3]),
                );
                list.push(Matter {
                    name: format!(
                        "grid {interpolation:?}, {sigma} per mm, albedo {albedo}, ratio {end_on}"
                    ),
                    medium: AnyMedium::Grid(medium.unwrap()),
                    is_white: albedo == 1.0,
                    slack: 1e-5,
                });
            }
        }
    }
    list
}
