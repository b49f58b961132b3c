//! Cloth that was unravelled: the threads of one system, where they lie in the cloth.

use super::{Centreline, Cloth};
use organza_basis::{Segment, SegmentSource, Tile};
use serde::Deserialize;

/// The threads of a woven cloth that run in one direction.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum ThreadSystem {
    /// Along y.
    Warp,
    /// Along x.
    Weft,
}

/// Fibres of the threads of one system.
#[derive(Clone, Debug)]
pub struct Unravelled<'a> {
    cloth: &'a Cloth,
    batches: Vec<usize>,
}

impl Cloth {
    /// The fibres of one system of threads, where they lie in the cloth; without pile and pills.
    /// None where there are no such threads, as in knits.
    pub fn unravelled(&self, keep: ThreadSystem) -> Option<Unravelled<'_>> {
        let batches: Vec<usize> = self.places_mm(keep).map(|(batch, _)| batch).collect();
        let cloth = self;
        (!batches.is_empty()).then_some(Unravelled { cloth, batches })
    }

    /// The middle between two neighbouring threads of a system that is nearest to a place across
    /// them, mm; the place itself where there are no such threads.
    pub fn gap_near_mm(&self, system: ThreadSystem, at_mm: f64) -> f64 {
        let (gaps, period_mm) = self.gaps_mm(system);
        let gaps = gaps
            .iter()
            .map(|gap| gap + ((at_mm - gap) / period_mm).round() * period_mm);
        let nearer = |a: &f64, b: &f64| (a - at_mm).abs().total_cmp(&(b - at_mm).abs());
        gaps.min_by(nearer).unwrap_or(at_mm)
    }

    /// The middles between neighbouring threads of a system from one place across them to another,
    /// mm, in order, at most `most` of them.
    pub fn gaps_between_mm(
        &self,
        system: ThreadSystem,
        [from_mm, to_mm]: [f64; 2],
        most: usize,
    ) -> Vec<f64> {
        let (gaps, period_mm) = self.gaps_mm(system);
        let Some(first) = gaps.first() else {
            return Vec::new();
        };
        let tile = ((from_mm - first) / period_mm).floor() - 1.0;
        let all = (0i32..).flat_map(|k| {
            let shift_mm = (tile + f64::from(k)) * period_mm;
            gaps.iter().map(move |gap| gap + shift_mm)
        });
        let inside = all.skip_while(|gap| *gap < from_mm);
        inside.take_while(|gap| *gap <= to_mm).take(most).collect()
    }

    /// The middles between neighbouring threads of a system in a tile, in order, and the size of the
    /// tile across them, mm.
    fn gaps_mm(&self, system: ThreadSystem) -> (Vec<f64>, f64) {
        let period = self.tile.period_mm().as_dvec2();
        let period_mm = match system {
            ThreadSystem::Warp => period.x,
            ThreadSystem::Weft => period.y,
        };
        let mut places: Vec<f64> = self.places_mm(system).map(|p| p.1).collect();
        places.sort_by(f64::total_cmp);
        places.extend(places.first().map(|first| first + period_mm));
        let gaps = places.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        (gaps.collect(), period_mm)
    }

    /// The threads of a system: batch, and place across the threads, mm.
    fn places_mm(&self, system: ThreadSystem) -> impl Iterator<Item = (usize, f64)> {
        let place = move |line: &Centreline| match (line, system) {
            (Centreline::Woven { axis, origin, .. }, ThreadSystem::Warp) if axis.y != 0.0 => {
                Some(origin.x)
            }
            (Centreline::Woven { axis, origin, .. }, ThreadSystem::Weft) if axis.x != 0.0 => {
                Some(origin.y)
            }
            _ => None,
        };
        let threads = self.threads.iter().enumerate();
        threads.filter_map(move |(batch, thread)| Some((batch, place(&thread.line)?)))
    }
}

impl SegmentSource for Unravelled<'_> {
    fn tile(&self) -> Tile {
        self.cloth.tile()
    }

    fn batch_count(&self) -> usize {
        self.batches.len()
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        self.cloth.for_each_in_batch(self.batches[batch], emit);
    }

    fn material_count(&self) -> usize {
        self.cloth.material_count()
    }
}
