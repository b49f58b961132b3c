//! A cache of radiance at fibres, which ends paths early.
//!
//! Most of the noise of a picture of fibres is the lottery of long paths, and most of the time
//! goes into them. Paths that begin at the camera therefore end at the second fibre that they
//! meet: there they add what they carry times the radiance that *learning paths*, which were
//! walked to their ends, found at such places. Of flat cloth the place is that in the tile, so
//! that all repeats learn for one another. A second table holds the radiance at the *first*
//! fibre, learned from paths that end in the first table: samples that see the same place of
//! the tile share their light.
//!
//! A bin keeps two sums over its learning paths, of the light `L` that they found after their
//! arrival and of what they carried on arrival, `T`; its radiance is the quotient. The sum of
//! `T q` over all arrivals is then the sum of `L`: within a bin light is only moved about, and no
//! lobe, light or geometry enters. Two conditions keep that true: a table learns only from
//! arrivals of the order at which it is read, and no light counts in two bins that are both
//! read (see [`tree`]).
//!
//! - [`place`]: where light meets a fibre, in bins of several sizes that nest.
//! - [`tree`]: bins that divide while they learn; [`table`]: what is read.
//! - [`learn`]: learning paths, and an estimate of the error of the cache.

pub(crate) mod learn;
pub(crate) mod place;
pub(crate) mod plan;
pub(crate) mod table;
pub(crate) mod tree;

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
    /// At the second one.
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
            notes_at: None,
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
    /// Tables that end paths at the first and at the second fibre.
    pub tables: [Option<&'a RadianceTable>; 2],
    /// The fibre, counted from zero, at which paths note where they are.
    pub notes_at: Option<u32>,
    /// Mean radiance of the picture: shadow rays are kept by what they add to it.
    pub picture_mean: Option<f32>,
}

/// Where a path was on its way, and what it carried and had found by then.
#[derive(Clone, Copy, Debug)]
pub struct Note {
    pub place: Place,
    pub carried: Vec3,
    pub found: Vec3,
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
        let table = self.tables.get(order as usize).copied().flatten();
        let is_noted = self.notes_at == Some(order);
        if table.is_none() && !is_noted {
            return None;
        }
        let place = places.of(matter, paths, slot);
        let carried = get(&paths.throughput, slot);
        if is_noted {
            let found = get(&paths.radiance, slot);
            paths.note[slot] = Some(Note {
                place,
                carried,
                found,
            });
        }
        let levels = places.levels(order);
        table?.radiance(&place, levels).map(|q| carried * q)
    }
}
