//! Where light meets a fibre, in bins of several sizes that nest.

use super::super::body::Body;
use super::super::matter::FibreMatter;
use super::super::paths::{Paths, get};
use super::super::trip::TripEnd;
use glam::{DVec3, Vec3};
use organza_basis::mix64;

/// Finest steps of a place in a cell of the grid of fibres, as a power of two: eighths.
const CELL_BITS: i32 = 3;
/// Finest steps of a direction along each axis of its octahedral map, as a power of two.
const TOWARD_BITS: i32 = 6;
/// Finest steps of the widest bin of draped cloth, as a power of two.
const PATCH_BITS: i32 = 5;

/// Finest steps along a piece of fibre, and about a fibre, as powers of two.
const PIECE_BITS: i32 = 4;
const ABOUT_BITS: i32 = 3;

/// A place at a fibre and the way of the light there, in whole numbers of the finest steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// In the tile of flat cloth, or in the world; along a fibre, pieces on.
    at: [i32; 3],
    /// Of flat cloth the patch of the world; of other cloth the layer of cells across it; of
    /// a fibre which repeat, or the patch.
    beside: [i32; 2],
    /// The way of the path in an octahedral map, of the cloth where that is draped.
    toward: [u8; 2],
    /// The side of a fibre.
    about: u8,
    /// Which body, along which of its axes the fibre runs, and its shade; or which fibre.
    what: u32,
}

/// Bins of one size: how many bits of a place are left out.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    at: u8,
    beside: u8,
    toward: u8,
    about: u8,
}

const fn level(at: u8, beside: u8, toward: u8) -> Level {
    Level {
        at,
        beside,
        toward,
        about: ABOUT_BITS as u8,
    }
}

const fn on_fibre(at: u8, toward: u8, about: u8) -> Level {
    Level {
        at,
        beside: 0,
        toward,
        about,
    }
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

/// Bins on a fibre, where its width fills a pixel: from 32 of its pieces to a sixteenth of one
/// and an eighth of the way about it. Directions of view are 6 to 3 degrees apart.
const ON_FIBRE: &[Level] = &[
    on_fibre(9, 2, 3),
    on_fibre(8, 2, 3),
    on_fibre(7, 2, 3),
    on_fibre(6, 2, 3),
    on_fibre(5, 1, 3),
    on_fibre(4, 1, 3),
    on_fibre(3, 1, 2),
    on_fibre(2, 1, 2),
    on_fibre(2, 0, 1),
    on_fibre(1, 0, 1),
    on_fibre(0, 0, 0),
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
        Place::across_a_line(x, [0; 2])
    }

    /// In the bin of 512 steps beside that of the line.
    pub fn across_a_line(x: i32, [y, z]: [i32; 2]) -> Place {
        Place {
            at: [x, 512 * y, 512 * z],
            ..Place::default()
        }
    }
}

/// How the places of a scene are counted.
#[derive(Clone, Copy, Debug)]
pub struct Places {
    at_second: Frame,
    at_first: First,
}

/// What places are counted in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frame {
    /// The tile of one flat cloth, all repeats of which see the same light within patches
    /// of so many mm, if not everywhere.
    Tile { patch_mm: Option<f64> },
    /// The world: of draped cloth and of several bodies, in steps of so many mm.
    World { step_mm: f64 },
}

/// What samples share at their first fibres.
#[derive(Clone, Copy, Debug)]
enum First {
    /// Nothing.
    Alone,
    /// The light of a place in the tile.
    InTile,
    /// The light of a stretch of a fibre, in bins from that size on.
    OnFibre(usize),
}

impl Places {
    /// Of matter in a picture whose pixels are so wide where the matter is. `light_mm` is the
    /// distance over which the light changes, if it does.
    pub fn new(
        matter: &FibreMatter,
        (pixel_mm, columns): (f64, u32),
        light_mm: Option<f64>,
    ) -> Places {
        /// Widest bins in a picture's width.
        const PATCHES: f64 = 16.0;
        let at_second = if matter.is_one_body() {
            Frame::Tile { patch_mm: light_mm }
        } else {
            let widest_mm = (pixel_mm * f64::from(columns) / PATCHES).clamp(1e-6, 1e6);
            let step_mm = widest_mm / f64::from(1 << PATCH_BITS);
            Frame::World { step_mm }
        };
        let at_first = match (widest_on_fibre(matter, pixel_mm), at_second) {
            _ if matter.has_packed() => First::Alone,
            (Some(from), _) => First::OnFibre(from),
            (None, Frame::Tile { .. }) => First::InTile,
            (None, Frame::World { .. }) => First::Alone,
        };
        Places {
            at_second,
            at_first,
        }
    }

    /// What places at later fibres are counted in.
    pub fn later(&self) -> Frame {
        self.at_second
    }

    /// The same places, but for those at later fibres, which are counted as another picture of the
    /// same matter counted them.
    pub fn with_later(self, at_second: Frame) -> Places {
        Places { at_second, ..self }
    }

    /// Whether what is read at a path's fibre of that number is interpolated between bins: where
    /// they are cubes in the world, whose borders smooth cloth would show.
    pub fn are_blended(&self, order: u32) -> bool {
        order > 0 && matches!(self.at_second, Frame::World { .. })
    }

    /// Whether samples may share the light at their first fibres.
    pub fn are_shared_at_first(&self) -> bool {
        !matches!(self.at_first, First::Alone)
    }

    /// The sizes of bins at a path's fibre of that number, counted from zero; coarse to fine.
    pub fn levels(&self, order: u32) -> &'static [Level] {
        match (order, self.at_first, self.at_second) {
            (0, First::OnFibre(from), _) => &ON_FIBRE[from..],
            (0, First::InTile, _) => TILE_FIRST,
            (_, _, Frame::Tile { .. }) => TILE_SECOND,
            (_, _, Frame::World { .. }) => WORLD_SECOND,
        }
    }

    /// Where the path of a slot has met its fibre of that number.
    pub fn of(&self, matter: &FibreMatter, paths: &Paths, slot: usize, order: u32) -> Place {
        match (order, self.at_first, self.at_second) {
            (0, First::OnFibre(_), frame) => on_its_fibre(matter, paths, slot, frame),
            (_, _, Frame::Tile { patch_mm }) => in_tile(matter, paths, slot, patch_mm),
            (_, _, Frame::World { step_mm }) => in_world(matter, paths, slot, step_mm),
        }
    }
}

/// Which bins on fibres are the widest that do not blur a picture: the number of their size.
/// None where fibres are thinner than pixels.
fn widest_on_fibre(matter: &FibreMatter, pixel_mm: f64) -> Option<usize> {
    /// Most pixels along a bin, and most widths of a fibre.
    const PIXELS: f64 = 16.0;
    const WIDTHS: f64 = 16.0;
    /// Narrowest fibres that share their light, in pixels.
    const THIN: f64 = 0.6;
    let joints = &matter.joints;
    let stride = (joints.count() / 4096).max(1) as usize;
    let some = (0..joints.count()).step_by(stride);
    let lengths: Vec<f64> = some.filter_map(|joint| joints.length_mm(joint)).collect();
    let piece_mm = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    let radius_mm = |body: &Body| body.cells.mean_radius_mm;
    let radii_mm = matter.bodies.iter().map(radius_mm);
    let width_mm = 2.0 * radii_mm.fold(f64::INFINITY, f64::min);
    let most_mm = (PIXELS * pixel_mm).min(WIDTHS * width_mm);
    let length_mm = |level: &Level| piece_mm * f64::from(level.at as i32 - PIECE_BITS).exp2();
    let is_seen = lengths.len() > 1 && width_mm > THIN * pixel_mm;
    is_seen.then(|| {
        let fits = ON_FIBRE
            .iter()
            .position(|level| length_mm(level) <= most_mm);
        fits.unwrap_or(ON_FIBRE.len() - 1)
    })
}

fn on_its_fibre(matter: &FibreMatter, paths: &Paths, slot: usize, frame: Frame) -> Place {
    let joints = &matter.joints;
    let (piece, along_mm) = (paths.met.piece[slot], paths.met.along[slot]);
    let steps = f32::from(1u8 << PIECE_BITS);
    let within = (joints.share_along(piece, along_mm) * steps).min(steps - 1.0);
    let out = get(&paths.met.out, slot);
    let tangent = joints.tangent(piece, along_mm);
    let (u, v) = tangent.any_orthonormal_pair();
    let turn = out.dot(v).atan2(out.dot(u)) / std::f32::consts::TAU + 0.5;
    let sides = f32::from(1u8 << ABOUT_BITS);
    let (beside, toward) = match frame {
        Frame::Tile { patch_mm } => (
            patch(matter, paths, slot, patch_mm),
            get(&paths.direction, slot),
        ),
        Frame::World { .. } => (paths.met.period[slot].to_array(), get(&paths.met.way, slot)),
    };
    Place {
        at: [(piece << PIECE_BITS) as i32 + within as i32, 0, 0],
        beside,
        toward: octahedral(toward),
        about: (turn * sides).clamp(0.0, sides - 1.0) as u8,
        what: joints.strand(piece),
    }
}

/// The patch of the world in which a slot's path has met a fibre.
fn patch(matter: &FibreMatter, paths: &Paths, slot: usize, patch_mm: Option<f64>) -> [i32; 2] {
    patch_mm.map_or([0; 2], |patch_mm| {
        let place = super::super::shade::place_mm(matter, paths, slot).as_dvec3();
        let patch = (place / patch_mm).floor().as_ivec3();
        [patch.x, patch.y]
    })
}

fn in_tile(matter: &FibreMatter, paths: &Paths, slot: usize, patch_mm: Option<f64>) -> Place {
    let steps = (1 << CELL_BITS) as f32;
    let grid = &matter.bodies[0].cells.grid;
    let direction = get(&paths.direction, slot);
    let packed = matter.packed.as_ref().filter(|_| paths.in_volume[slot]);
    let (at, what) = if packed.is_some() {
        let ray = &paths.volume_rays[slot];
        ((ray.at() * steps).floor().as_ivec3(), 0)
    } else {
        let from_centre = get(&paths.met.axis_at, slot) + get(&paths.met.out, slot);
        let within = (from_centre / grid.cell_mm().as_vec3() + 0.5) * steps;
        let within = within.floor().clamp(Vec3::ZERO, Vec3::splat(steps - 1.0));
        ((paths.met.cell[slot] << CELL_BITS) + within.as_ivec3(), 1)
    };
    let what = what + 2 * super::super::met_fibres::yarn(matter, paths, slot);
    Place {
        at: at.to_array(),
        beside: patch(matter, paths, slot, patch_mm),
        toward: octahedral(direction),
        about: 0,
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
    let piece = paths.met.piece[slot];
    let tangent = matter.joints.tangent(piece, along).abs();
    let shade = matter.optics.shade(matter.joints.material(piece));
    let axis = match tangent.max_element() {
        most if most == tangent.x => 0,
        most if most == tangent.y => 1,
        _ => 2,
    };
    Place {
        at: at.as_ivec3().to_array(),
        beside: [paths.met.cell[slot].z, 0],
        toward: octahedral(get(&paths.met.way, slot)),
        about: 0,
        what: u32::from(body) * 4 + axis + (u32::from(shade) << 18),
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
    /// A place at random in a cube of that size about this one, by 63 random bits.
    #[inline]
    pub fn moved(&self, level: Level, bits: u64) -> Place {
        let moved = |k: usize| {
            let even = (bits >> (21 * k) & ((1 << 21) - 1)) as i32;
            self.at[k] + (even >> (21 - level.at)) - (1 << level.at >> 1)
        };
        Place {
            at: [0, 1, 2].map(moved),
            ..*self
        }
    }

    /// Names the bin of that size, among all sizes; never zero.
    #[inline]
    pub fn key(&self, number: usize, level: Level) -> u64 {
        const MASK: u64 = (1 << 21) - 1;
        let low = |v: i32, bits: u8| (v >> bits) as u64 & MASK;
        let [x, y, z] = self.at.map(|v| low(v, level.at));
        let place = x | y << 21 | z << 42;
        let [u, v] = self.toward.map(|t| u64::from(t >> level.toward));
        let [b, c] = self.beside.map(|v| low(v, level.beside));
        let about = u64::from(self.about >> level.about);
        let rest = b | c << 21 | (u | v << 6) << 42 | (number as u64) << 54 | about << 60;
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
            about: (k % 8) as u8,
            what: 0,
        };
        let places: Vec<Place> = (0..600).map(place).collect();
        for levels in [TILE_FIRST, TILE_SECOND, WORLD_SECOND, ON_FIBRE] {
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
