//! A cache of radiance at fibres, which ends paths early.
//!
//! Most of the noise of a picture of fibres is the lottery of long paths, and most of the time
//! goes into them. Paths that begin at the camera therefore end at the second fibre that they
//! meet: there they add what they carry times the radiance that *learning paths*, which were
//! walked to their ends, found at such places; if nothing is known there, they go on to the next
//! one. Of flat cloth the place is that in the tile, so that all repeats learn for one another.
//! A second table holds the radiance at the *first* fibre, learned from paths that end in the
//! first table: samples that see the same stretch of a fibre share its light.
//!
//! A bin keeps two sums over its learning paths, of the light `L` that they found after their
//! arrival and of what they carried on arrival, `T`; its radiance is the quotient. The sum of
//! `T q` over all arrivals is then the sum of `L`: within a bin light is only moved about, and no
//! lobe, light or geometry enters. Bins at the first fibre take the light to the ends of paths,
//! and none counts in two bins that are both read (see [`tree`]). Bins at later fibres take the
//! light up to the next bin, and what flows on from there (see [`flow`]).
//!
//! - [`place`]: where light meets a fibre, in bins of several sizes that nest.
//! - [`tree`]: bins that divide while they learn; [`table`]: what is read.
//! - [`flow`]: the radiances of bins between which paths go, solved together.
//! - [`learn`]: learning paths; [`error_of_blocks`] and [`error_map`]: the error of the cache, and where
//!   it is.
//! - [`kept`]: what one picture keeps for others.

pub(crate) mod error_map;
pub(crate) mod error_of_blocks;
pub(crate) mod flow;
pub(crate) mod kept;
pub(crate) mod learn;
pub(crate) mod place;
pub(crate) mod plan;
pub(crate) mod table;
pub(crate) mod tree;

pub use error_map::ErrorMap;
pub use kept::KeptLight;
pub use plan::{CacheMode, CachePlan, CacheReport, LearnWatch, Stopped};

use super::matter::FibreMatter;
use super::paths::{Paths, get};
use glam::Vec3;
use place::{Place, Places};
use table::RadianceTable;

/// What was learned of a scene.
pub struct RadianceCache {
    pub places: Places,
    /// Radiance at the first fibre of a path from the camera, if samples share it.
    pub first: Option<RadianceTable>,
    /// At later ones.
    pub second: RadianceTable,
    /// Mean radiance of the picture, over pixels and channels.
    pub picture_mean: f32,
    pub report: CacheReport,
}

impl RadianceCache {
    /// What paths of a picture do with it.
    pub fn to_read(&self) -> CacheUse<'_> {
        CacheUse {
            places: Some(&self.places),
            tables: [self.first.as_ref(), Some(&self.second)],
            notes: Notes::None,
            picture_mean: Some(self.picture_mean).filter(|mean| *mean > 0.0),
        }
    }

    /// Bytes of the tables.
    pub fn memory_bytes(&self) -> u64 {
        let first = self.first.as_ref().map_or(0, RadianceTable::memory_bytes);
        first + self.second.memory_bytes()
    }
}

/// What a walk does with places at fibres; nothing by default.
#[derive(Clone, Copy, Default)]
pub struct CacheUse<'a> {
    /// How places are found; none where neither happens.
    pub places: Option<&'a Places>,
    /// Tables that end paths at the first fibre and at later ones.
    pub tables: [Option<&'a RadianceTable>; 2],
    /// Where paths note where they are.
    pub notes: Notes,
    /// Mean radiance of the picture: shadow rays are kept by what they add to it.
    pub picture_mean: Option<f32>,
}

/// At which fibres, counted from zero, paths note where they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Notes {
    #[default]
    None,
    /// At one.
    At(u32),
    /// At one and at all later ones.
    From(u32),
}

/// Where a path was on its way, and what it carried and had found by then.
#[derive(Clone, Copy, Debug)]
pub struct Note {
    pub place: Place,
    pub carried: Vec3,
    pub found: Vec3,
}

impl Note {
    /// Light of a path that was found from here to a point where it had found `light` in all.
    /// What is left by roundings alone is none: over the little that a path may carry in a
    /// channel it would be bright.
    pub fn light_until(&self, light: Vec3) -> Vec3 {
        const ROUNDINGS: f32 = 4.0 * f32::EPSILON;
        let further = light - self.found;
        Vec3::select(further.cmpgt(ROUNDINGS * light), further, Vec3::ZERO)
    }
}

/// Random bits from the random numbers that a path has not drawn yet: where they are used, it ends,
/// or walks on without a bin.
fn random_bits(paths: &Paths, slot: usize) -> u64 {
    let [a, b, c] = [0, 1, 2].map(|k| u64::from(paths.rng[k][slot]));
    organza_basis::mix64(organza_basis::mix64(a | b << 32) ^ c)
}

impl CacheUse<'_> {
    /// For a path that has met its fibre number `order`, counted from zero: what the rest of
    /// it adds, if that is known. Notes the place where that is asked for.
    #[inline]
    pub fn at_fibre(
        &self,
        matter: &FibreMatter,
        paths: &mut Paths,
        slot: usize,
        order: u32,
    ) -> Option<Vec3> {
        let places = self.places?;
        let table = self.tables[order.min(1) as usize];
        let is_noted = match self.notes {
            Notes::None => false,
            Notes::At(noted) => order == noted,
            Notes::From(first) => order >= first,
        };
        if table.is_none() && !is_noted {
            return None;
        }
        let place = places.of(matter, paths, slot, order);
        let carried = get(&paths.throughput, slot);
        if is_noted {
            let found = get(&paths.radiance, slot);
            paths.notes[slot].push(Note {
                place,
                carried,
                found,
            });
        }
        let (table, levels) = (table?, places.levels(order));
        let bin = match places.are_blended(order) {
            true => table.find_beside(&place, levels, random_bits(paths, slot)),
            false => table.find(&place, levels),
        };
        bin.map(|bin| carried * table.radiance_of(bin))
    }
}
