//! Where light meets a fibre, in bins of several sizes that nest.

use super::super::matter::FibreMatter;
use super::super::paths::{Paths, get};
use super::super::trip::TripEnd;
use glam::{DVec3, IVec3, Vec3};
use organza_basis::mix64;

/// Finest steps of a place in a cell of the grid of fibres, as a power of two: eighths.
const CELL_BITS: i32 = 3;
/// Finest steps of a direction along each axis of its octahedral map, as a power of two.
const TOWARD_BITS: i32 = 6;
/// Finest steps of the widest bin of draped cloth, as a power of two.
const PATCH_BITS: i32 = 5;

/// A place at a fibre and the way of the light there, in whole numbers of the finest steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// In the tile of flat cloth, or in the world.
    at: [i32; 3],
    /// Of flat cloth the patch of the world; of other cloth the layer of cells across it.
    beside: [i32; 2],
    /// The way of the path in an octahedral map, of the cloth where that is draped.
    toward: [u8; 2],
    /// Which body, and along which of its axes the fibre runs.
    what: u16,
}

/// Bins of one size: how many bits of a place are left out.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    at: u8,
    beside: u8,
    toward: u8,
}

const fn level(at: u8, beside: u8, toward: u8) -> Level {
    Level { at, beside, toward }
}

/// Bins in the tile at the second fibre: from two cells and 64 directions to an eighth of a
/// cell and 256 directions. Where not even the first is filled, paths go on: wider ones would
/// move light from yarn to yarn.
const TILE_SECOND: &[Level] = &[
    level(4, 0, 3),
    level(3, 0, 3),
    level(2, 0, 3),
    level(1, 0, 3),
    level(1, 0, 2),
    level(0, 0, 2),
];

/// Bins in the tile at the first fibre: from a cell to an eighth of one, and from 256
/// directions of view to 4096, about 3 degrees each.
const TILE_FIRST: &[Level] = &[
    level(3, 0, 2),
    level(2, 0, 2),
    level(2, 0, 1),
    level(1, 0, 1),
    level(1, 0, 0),
    level(0, 0, 0),
];

/// Bins in the world at the second fibre. Nothing is wider than the first: where that is not
/// filled, paths go on.
const WORLD_SECOND: &[Level] = &[
    level(5, 2, 3),
    level(4, 2, 3),
    level(3, 1, 3),
    level(2, 1, 3),
    level(2, 0, 2),
    level(1, 0, 2),
    level(0, 0, 2),
];

/// Bins on a line, for tests.
#[cfg(test)]
pub const LINE: &[Level] = &[
    level(9, 0, 6),
    level(7, 0, 6),
    level(5, 0, 6),
    level(3, 0, 6),
    level(1, 0, 6),
];

#[cfg(test)]
impl Place {
    pub fn on_a_line(x: i32) -> Place {
        Place {
            at: [x, 0, 0],
            ..Place::default()
        }
    }
}

/// How the places of a scene are counted.
#[derive(Clone, Copy, Debug)]
pub enum Places {
    /// In the tile of one flat cloth, all repeats of which see the same light within patches
    /// of so many mm, if not everywhere.
    Tile { patch_mm: Option<f64> },
    /// In the world: of draped cloth and of several bodies, in steps of so many mm.
    World { step_mm: f64 },
}

impl Places {
    /// Of matter in a picture that is so wide where the matter is. `light_mm` is the distance
    /// over which the light changes, if it does.
    pub fn new(matter: &FibreMatter, picture_mm: f64, light_mm: Option<f64>) -> Places {
        /// Widest bins in a picture's width.
        const PATCHES: f64 = 16.0;
        if matter.is_one_body() {
            return Places::Tile { patch_mm: light_mm };
        }
        let widest_mm = (picture_mm / PATCHES).clamp(1e-6, 1e6);
        let step_mm = widest_mm / f64::from(1 << PATCH_BITS);
        Places::World { step_mm }
    }

    /// Whether samples may share the light at their first fibres.
    pub fn are_shared_at_first(&self) -> bool {
        matches!(self, Places::Tile { .. })
    }

    /// The sizes of bins at a path's fibre of that number, counted from zero; coarse to fine.
    pub fn levels(&self, order: u32) -> &'static [Level] {
        match (self, order) {
            (Places::Tile { .. }, 0) => TILE_FIRST,
            (Places::Tile { .. }, _) => TILE_SECOND,
            (Places::World { .. }, _) => WORLD_SECOND,
        }
    }

    /// Where the path of a slot has met a fibre.
    pub fn of(&self, matter: &FibreMatter, paths: &Paths, slot: usize) -> Place {
        match *self {
            Places::Tile { patch_mm } => in_tile(matter, paths, slot, patch_mm),
            Places::World { step_mm } => in_world(matter, paths, slot, step_mm),
        }
    }
}

fn in_tile(matter: &FibreMatter, paths: &Paths, slot: usize, patch_mm: Option<f64>) -> Place {
    let steps = (1 << CELL_BITS) as f32;
    let grid = &matter.bodies[0].cells.grid;
    let direction = get(&paths.direction, slot);
    let packed = matter.packed.as_ref().filter(|_| paths.in_volume[slot]);
    let (at, what) = if packed.is_some() {
        let ray = &paths.volume_rays[slot];
        ((ray.at() * steps).floor().as_ivec3(), 1)
    } else {
        let from_centre = get(&paths.met.axis_at, slot) + get(&paths.met.out, slot);
        let within = (from_centre / grid.cell_mm().as_vec3() + 0.5) * steps;
        let within = within.floor().clamp(Vec3::ZERO, Vec3::splat(steps - 1.0));
        ((paths.met.cell[slot] << CELL_BITS) + within.as_ivec3(), 0)
    };
    let patch = |patch_mm: f64| {
        let place = super::super::shade::place_mm(matter, paths, slot).as_dvec3();
        (place / patch_mm).floor().as_ivec3()
    };
    let patch = patch_mm.map_or(IVec3::ZERO, patch);
    Place {
        at: at.to_array(),
        beside: [patch.x, patch.y],
        toward: octahedral(direction),
        what,
    }
}

fn in_world(matter: &FibreMatter, paths: &Paths, slot: usize, step_mm: f64) -> Place {
    let trip = &paths.trips[slot];
    let body = match trip.met() {
        TripEnd::Fibre(met) => met.body,
        _ => 0,
    };
    let at: DVec3 = (trip.end_mm() / step_mm).floor();
    let along = paths.met.along[slot];
    let tangent = matter.joints.tangent(paths.met.piece[slot], along).abs();
    let axis = match tangent.max_element() {
        most if most == tangent.x => 0,
        most if most == tangent.y => 1,
        _ => 2,
    };
    Place {
        at: at.as_ivec3().to_array(),
        beside: [paths.met.cell[slot].z, 0],
        toward: octahedral(get(&paths.met.way, slot)),
        what: body * 4 + axis,
    }
}

/// A unit direction in a square that nests when it is halved \[Meyer2010].
fn octahedral(d: Vec3) -> [u8; 2] {
    let most = (1 << TOWARD_BITS) as f32;
    let flat = d / d.abs().element_sum();
    let (mut x, mut y) = (flat.x, flat.y);
    if flat.z < 0.0 {
        (x, y) = (
            (1.0 - flat.y.abs()).copysign(flat.x),
            (1.0 - flat.x.abs()).copysign(flat.y),
        );
    }
    [x, y].map(|v| (v.mul_add(0.5, 0.5) * most).clamp(0.0, most - 1.0) as u8)
}

impl Place {
    /// Names the bin of that size, among all sizes; never zero.
    #[inline]
    pub fn key(&self, number: usize, level: Level) -> u64 {
        const MASK: u64 = (1 << 21) - 1;
        let low = |v: i32, bits: u8| (v >> bits) as u64 & MASK;
        let [x, y, z] = self.at.map(|v| low(v, level.at));
        let place = x | y << 21 | z << 42;
        let [u, v] = self.toward.map(|t| u64::from(t >> level.toward));
        let [b, c] = self.beside.map(|v| low(v, level.beside));
        let rest = b | c << 21 | (u | v << 6) << 42 | (number as u64) << 54;
        let what = u64::from(self.what).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mix64(place ^ mix64(rest ^ what)) | 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two places of one bin are of one bin at every coarser size.
    #[test]
    fn bins_nest() {
        let place = |k: i32| Place {
            at: [k * 7 % 32 - 16, k * 3 % 16 - 8, k % 4],
            beside: [k % 5 - 2, k % 3 - 1],
            toward: octahedral(Vec3::new(
                0.3 * (k as f32).sin(),
                0.3 * (1.7 * k as f32).cos(),
                (0.3 * k as f32).sin() + 0.01,
            )),
            what: 0,
        };
        let places: Vec<Place> = (0..600).map(place).collect();
        for levels in [TILE_FIRST, TILE_SECOND, WORLD_SECOND] {
            let mut shared = 0;
            for (i, a) in places.iter().enumerate() {
                for b in &places[..i] {
                    let same: Vec<bool> = (0..levels.len())
                        .map(|n| a.key(n, levels[n]) == b.key(n, levels[n]))
                        .collect();
                    assert!(same.windows(2).all(|w| w[0] || !w[1]), "{a:?} {b:?}");
                    shared += usize::from(same[0]);
                }
            }
            assert!(shared > 0);
        }
    }

    #[test]
    fn opposite_ways_are_of_two_bins() {
        let up = octahedral(Vec3::new(0.1, 0.2, 1.0).normalize());
        let down = octahedral(Vec3::new(0.1, 0.2, -1.0).normalize());
        assert_ne!(up.map(|t| t >> 4), down.map(|t| t >> 4));
    }
}
