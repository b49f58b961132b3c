//! Bins that divide while they learn.
//!
//! A path adds to one bin only: the finest that there is at its place. A bin that has taken
//! enough paths divides, and later paths go to the bins of the next size within it, so that
//! bins are small where there are many paths. What a bin took before it divided counts no
//! more. Where noise matters more than size, bins divide only at first, and then fill. In the end, bins that took fewer than half as many are taken together in the bin
//! around them, which then speaks for just those; where they are too few even together, the
//! poorest of their neighbours joins them. So every path that counts is in exactly
//! one bin that is read.

use super::Note;
use super::place::{Level, Place};
use super::table::{Entry, RadianceTable, is_known};
use glam::Vec3;
use rayon::prelude::*;

/// Parts of the tree that learn at the same time.
const SHARDS: usize = 16;
/// Bytes of a bin with its place in the index, at most.
const BIN_BYTES: u64 = (size_of::<Bin>() + 2 * size_of::<u32>()) as u64;
const NONE: u32 = u32::MAX;

/// What a learning path found after it came to a place.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    pub place: Place,
    pub carried: Vec3,
    pub found: Vec3,
}

impl Record {
    /// Of a path that noted a place and found so much light to its end.
    pub fn new(note: &Note, light: Vec3) -> Record {
        Record {
            place: note.place,
            carried: note.carried,
            found: note.light_until(light),
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    found: Vec3,
    carried: Vec3,
    /// Of the light found, summed over channels, the squares.
    squares: f32,
    count: u32,
}

impl Sums {
    fn add(&mut self, o: &Sums) {
        self.found += o.found;
        self.carried += o.carried;
        self.squares += o.squares;
        self.count += o.count;
    }

    fn of(record: &Record) -> Sums {
        let sum = record.found.element_sum();
        Sums {
            found: record.found,
            carried: record.carried,
            squares: sum * sum,
            count: 1,
        }
    }

    /// Variance of the radiance as a share of its square.
    fn noise_squared(&self) -> f32 {
        let (sum, n) = (self.found.element_sum(), self.count as f32);
        if sum > 0.0 {
            (self.squares / sum / sum - 1.0 / n).max(0.0)
        } else {
            0.0
        }
    }

    /// Which share of the differences between the parts of these sums is more than noise. All
    /// parts are taken to have the variance of the whole: of few paths with rare bright ones,
    /// those that met none would look certain.
    fn kept_difference<'a>(&self, parts: impl Iterator<Item = &'a Sums>) -> f32 {
        let (n, mean) = (f64::from(self.count), f64::from(self.found.element_sum()));
        let mean = mean / n;
        let (mut count, mut between) = (0.0, 0.0);
        for part in parts.filter(|part| part.count > 0) {
            let m = f64::from(part.count);
            let difference = f64::from(part.found.element_sum()) / m - mean;
            between += m * difference * difference;
            count += 1.0;
        }
        let within = (f64::from(self.squares) - n * mean * mean - between) / (n - count);
        if n > count && between > 0.0 {
            (1.0 - (count - 1.0) * within.max(0.0) / between).max(0.0) as f32
        } else {
            1.0
        }
    }

    fn radiance(&self) -> Vec3 {
        let q = self.found / self.carried;
        Vec3::select(is_known(self.carried), q, Vec3::ZERO)
    }
}

struct Bin {
    key: u64,
    sums: Sums,
    parent: u32,
    is_split: bool,
}

impl Bin {
    /// What it alone is read with.
    fn own(&self) -> Sums {
        if self.is_split {
            Sums::default()
        } else {
            self.sums
        }
    }
}

#[derive(Default)]
struct Shard {
    bins: Vec<Bin>,
    /// Numbers of bins by their keys, in an open hash table that is at most half full;
    /// [`NONE`] where it is empty.
    index: Vec<u32>,
}

/// Where a key is looked for first in an index whose length is a power of two. The keys' low bit is
/// set, and their high bits are those of a shard.
fn home(key: u64, length: usize) -> usize {
    (key >> 8) as usize & (length - 1)
}

/// Bins that learn.
pub struct RadianceTree {
    levels: &'static [Level],
    shards: Vec<Shard>,
    /// Most bins of a shard.
    room: usize,
    /// Paths after which a bin divides, and those that it must have to be read.
    split: u32,
    least: u32,
}

impl RadianceTree {
    /// Without bins, which divide after so many paths and of which there may be so many bytes.
    pub fn new(levels: &'static [Level], split: u32, bytes: u64) -> RadianceTree {
        RadianceTree {
            levels,
            shards: (0..SHARDS).map(|_| Shard::default()).collect(),
            room: (bytes / BIN_BYTES / SHARDS as u64).max(1) as usize,
            split,
            least: split / 2,
        }
    }

    /// From now on no bin divides.
    pub fn divide_no_more(&mut self) {
        self.split = u32::MAX;
    }

    /// Takes the records of many paths, in their order.
    pub fn learn(&mut self, records: &[Option<Record>]) {
        let (levels, room, split) = (self.levels, self.room, self.split);
        let of: Vec<u8> = records
            .iter()
            .map(|record| match record {
                Some(r) => (r.place.key(0, levels[0]) >> 60) as u8,
                None => u8::MAX,
            })
            .collect();
        self.shards
            .par_iter_mut()
            .enumerate()
            .for_each(|(n, shard)| {
                for (record, _) in records
                    .iter()
                    .zip(&of)
                    .filter(|(_, of)| usize::from(**of) == n)
                {
                    if let Some(record) = record {
                        shard.take(record, levels, room, split);
                    }
                }
            });
    }

    /// What is read.
    pub fn table(&self) -> RadianceTable {
        let entries = self.shards.par_iter().map(|s| s.entries(self.least));
        let entries: Vec<Vec<Entry>> = entries.collect();
        RadianceTable::new(&entries.concat())
    }
}

impl Shard {
    /// The number of the bin of that key; none where there is none and no room for it.
    fn find_or_make(&mut self, key: u64, parent: u32, room: usize) -> Option<u32> {
        if self.index.is_empty() {
            self.index = vec![NONE; 1024];
        }
        let mut at = home(key, self.index.len());
        while self.index[at] != NONE {
            if self.bins[self.index[at] as usize].key == key {
                return Some(self.index[at]);
            }
            at = (at + 1) & (self.index.len() - 1);
        }
        if self.bins.len() >= room {
            return None;
        }
        let number = self.bins.len() as u32;
        self.index[at] = number;
        self.bins.push(Bin {
            key,
            sums: Sums::default(),
            parent,
            is_split: false,
        });
        if 2 * self.bins.len() > self.index.len() {
            self.grow();
        }
        Some(number)
    }

    fn grow(&mut self) {
        let length = 2 * self.index.len();
        self.index = vec![NONE; length];
        for (number, bin) in self.bins.iter().enumerate() {
            let mut at = home(bin.key, length);
            while self.index[at] != NONE {
                at = (at + 1) & (length - 1);
            }
            self.index[at] = number as u32;
        }
    }

    fn take(&mut self, record: &Record, levels: &[Level], room: usize, split: u32) {
        // Some room is left for places where nothing is known yet.
        let may_divide = 4 * self.bins.len() < 3 * room;
        let mut parent = NONE;
        for (number, level) in levels.iter().enumerate() {
            let key = record.place.key(number, *level);
            let Some(at) = self.find_or_make(key, parent, room) else {
                break;
            };
            let bin = &mut self.bins[at as usize];
            if !bin.is_split {
                bin.sums.add(&Sums::of(record));
                bin.is_split = bin.sums.count >= split && number + 1 < levels.len() && may_divide;
                return;
            }
            parent = at;
        }
        // There is no room for a bin of its own: the one around it learns on.
        if let Some(bin) = self.bins.get_mut(parent as usize) {
            bin.sums.add(&Sums::of(record));
        }
    }

    fn entries(&self, least: u32) -> Vec<Entry> {
        // The bins right within every bin, as lists.
        let (mut inner, mut next) = (vec![NONE; self.bins.len()], vec![NONE; self.bins.len()]);
        for (at, bin) in self.bins.iter().enumerate() {
            if let Some(first) = inner.get_mut(bin.parent as usize) {
                next[at] = std::mem::replace(first, at as u32);
            }
        }
        // What a bin is read with: all that it took, or what no bin within it is read with.
        // Bins are made after those around them, so that this goes from the finest up.
        let mut read: Vec<Sums> = self.bins.iter().map(Bin::own).collect();
        for (at, bin) in self.bins.iter().enumerate().rev() {
            while bin.is_split && (1..least).contains(&read[at].count) {
                // The poorest of those within it is given up for it.
                let within =
                    std::iter::successors(Some(inner[at]), |i| next.get(*i as usize).copied());
                let within = within.take_while(|i| *i != NONE).map(|i| i as usize);
                let whole = within.filter(|i| !self.bins[*i].is_split && read[*i].count > 0);
                let Some(poorest) = whole.min_by_key(|i| read[*i].count) else {
                    break;
                };
                let given = std::mem::take(&mut read[poorest]);
                read[at].add(&given);
            }
            if bin.parent != NONE && read[at].count < least {
                let poor = std::mem::take(&mut read[at]);
                read[bin.parent as usize].add(&poor);
            }
        }
        let estimates = self.estimates(&read, (&inner, &next));
        let entry = |((bin, sums), estimate): ((&Bin, &Sums), &Estimate)| {
            let is_read = sums.count >= least;
            (is_read || bin.is_split).then(|| Entry {
                key: bin.key,
                radiance: estimate.radiance.to_array(),
                state: Entry::state(is_read, bin.is_split, estimate.noise_squared.sqrt()),
            })
        };
        let bins = self.bins.iter().zip(&read).zip(&estimates);
        bins.filter_map(entry).collect()
    }

    /// The radiance of every bin, from what bins are `read` with and the lists of those within
    /// them. Bins within one that differ by no more than their noise take their common radiance,
    /// and others keep the share of the difference that is surely there (\[JamesStein1961\]); the
    /// light of all of them together stays what it was.
    fn estimates(&self, read: &[Sums], (inner, next): (&[u32], &[u32])) -> Vec<Estimate> {
        let mut all = read.to_vec();
        for (at, bin) in self.bins.iter().enumerate().rev() {
            let own = all[at];
            if let Some(around) = all.get_mut(bin.parent as usize) {
                around.add(&own);
            }
        }
        let mut estimates: Vec<Estimate> = all.iter().map(Estimate::alone).collect();
        for (at, bin) in self.bins.iter().enumerate().filter(|(_, b)| b.is_split) {
            debug_assert!(bin.parent == NONE || (bin.parent as usize) < at);
            let (whole, around) = (all[at], estimates[at]);
            let first = inner[at];
            let within = || {
                let list = std::iter::successors(Some(first), |i| next.get(*i as usize).copied());
                list.take_while(|i| *i != NONE).map(|i| i as usize)
            };
            let parts = within().map(|i| &all[i]).chain([&read[at]]);
            let kept = whole.kept_difference(parts);
            for i in within() {
                estimates[i] = around.of_part(&all[i], &whole, kept);
            }
            estimates[at] = around.of_part(&read[at], &whole, kept);
        }
        estimates
    }
}

/// The radiance of a bin.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    radiance: Vec3,
    /// Variance of the radiance, as a share of its square.
    noise_squared: f32,
}

impl Estimate {
    /// Without a look at others.
    fn alone(sums: &Sums) -> Estimate {
        Estimate {
            radiance: sums.radiance(),
            noise_squared: sums.noise_squared(),
        }
    }

    /// Of a part of a bin with this estimate, which keeps a share of its difference from the
    /// `whole` bin. All parts together have the light of the whole.
    fn of_part(&self, part: &Sums, whole: &Sums, kept: f32) -> Estimate {
        if part.count == 0 {
            return *self;
        }
        // Where nearly nothing is carried or found, there is no difference to speak of.
        let ratio = (part.found / whole.found) * (whole.carried / part.carried);
        let has_ratio = is_known(part.carried) & ratio.is_finite_mask();
        let ratio = Vec3::select(has_ratio, ratio, Vec3::ONE);
        let radiance = self.radiance * (1.0 + kept * (ratio - 1.0));
        let further = (part.noise_squared() - whole.noise_squared()).max(0.0);
        Estimate {
            radiance: Vec3::select(radiance.is_finite_mask(), radiance, self.radiance),
            noise_squared: self.noise_squared + kept * kept * further,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{Moments, PathRng};

    const SEED: u64 = 41;
    const SPLIT: u32 = 32;

    /// An arrival somewhere, what it carries, and the light that it finds. In each of a few
    /// regions most paths come to one dark spot, whose bins divide, and the others to bright
    /// places around it, whose bins are too many to be filled.
    fn arrival(rng: &mut PathRng) -> Record {
        let region = (rng.unit() * 8.0) as i32 * 512;
        let is_dark = rng.unit() < 0.9;
        let x = region + (rng.unit() * if is_dark { 2.0 } else { 512.0 }) as i32;
        let carried = Vec3::splat(0.2 + 0.8 * rng.unit());
        let bright = if is_dark { 0.2 } else { 2.0 };
        Record {
            place: Place::on_a_line(x),
            carried,
            found: carried * bright * 2.0 * rng.unit(),
        }
    }

    /// Light that readers of a table get over that which they would find.
    fn gain(learned: u64, seed: u64, read: impl Fn(&RadianceTree, &Place) -> Option<Vec3>) -> f64 {
        let levels = super::super::place::LINE;
        let mut rng = PathRng::from_seed(seed);
        let mut tree = RadianceTree::new(levels, SPLIT, 64 << 20);
        for _ in 0..learned / 512 {
            let some: Vec<_> = (0..512).map(|_| Some(arrival(&mut rng))).collect();
            tree.learn(&some);
        }
        let (mut got, mut there) = (0.0, 0.0);
        for _ in 0..40_000 {
            let record = arrival(&mut rng);
            if let Some(q) = read(&tree, &record.place) {
                got += f64::from((record.carried * q).x);
                there += f64::from(record.found.x);
            }
        }
        got / there - 1.0
    }

    /// Mean and deviation of the gain over seeds.
    fn gains(read: impl Fn(&RadianceTree) -> Box<dyn Fn(&Place) -> Option<Vec3>>) -> Moments {
        let mut gains = Moments::default();
        for seed in 0..48 {
            let by_tree = std::cell::OnceCell::new();
            gains.add(gain(20_000, SEED + seed, |tree, place| {
                by_tree.get_or_init(|| read(tree))(place)
            }));
        }
        gains
    }

    /// All light that learning paths found is given out again; not so if bins that have
    /// divided speak with all that they took, also for the bins within them.
    #[test]
    fn light_is_neither_gained_nor_lost() {
        let levels = super::super::place::LINE;
        let right = gains(|tree| {
            let table = tree.table();
            Box::new(move |place| table.radiance(place, levels))
        });
        let error = right.standard_error();
        let mean = right.mean;
        assert!(mean.abs() < 4.0 * error, "seed {SEED}: {mean} +- {error}");
        assert!(error < 0.004, "{error}");
        let twin = gains(|tree| {
            let table = tree.table_of_all();
            Box::new(move |place| table.radiance(place, levels))
        });
        let error = twin.standard_error();
        let is_seen = twin.mean.abs() > 4.0 * error;
        assert!(is_seen, "seed {SEED}, twin: {} +- {error}", twin.mean);
    }

    /// Bins between which there is only noise agree, and a bright place next to them stays bright.
    /// The twin, which keeps all differences, has more than twice the error.
    #[test]
    fn differences_that_are_noise_go() {
        let levels = super::super::place::LINE;
        let mut rng = PathRng::from_seed(SEED);
        let mut tree = RadianceTree::new(levels, SPLIT, 64 << 20);
        let bright = |x: i32| if x < 64 { 9.0 } else { 1.0 };
        for _ in 0..100 {
            let mut arrival = || {
                let x = (rng.unit() * 512.0) as i32;
                // One path in ten finds light.
                let light = bright(x) * if rng.unit() < 0.1 { 10.0 } else { 0.0 };
                Record {
                    place: Place::on_a_line(x),
                    carried: Vec3::ONE,
                    found: Vec3::splat(light),
                }
            };
            let some: Vec<_> = (0..512).map(|_| Some(arrival())).collect();
            tree.learn(&some);
        }
        let error = |radiance: &dyn Fn(i32) -> f32| {
            let square = |x: i32| f64::from(radiance(x) / bright(x) - 1.0).powi(2);
            ((0..512).map(square).sum::<f64>() / 512.0).sqrt()
        };
        let table = tree.table();
        let own = error(&|x| table.radiance(&Place::on_a_line(x), levels).unwrap().x);
        let all = tree.table_of_all();
        let twin = error(&|x| all.radiance(&Place::on_a_line(x), levels).unwrap().x);
        assert!(own < 0.5 * twin, "seed {SEED}: {own}, twin {twin}");
    }

    /// What paths found before is taken from their light, which leaves roundings of either sign;
    /// bins divide by these no more than by nothing.
    #[test]
    fn roundings_in_the_dark_are_no_light() {
        let levels = super::super::place::LINE;
        let mut rng = PathRng::from_seed(SEED);
        let mut tree = RadianceTree::new(levels, 4, 64 << 20);
        let some: Vec<_> = (0..16_384)
            .map(|_| {
                let light = Vec3::splat(1.0 + rng.unit());
                let note = Note {
                    place: Place::on_a_line((rng.unit() * 512.0) as i32),
                    carried: Vec3::ONE,
                    found: light * (1.0 + f32::EPSILON * ((3.0 * rng.unit()).floor() - 1.0)),
                };
                Some(Record::new(&note, light))
            })
            .collect();
        tree.learn(&some);
        let table = tree.table();
        for x in 0..512 {
            let bin = table.find(&Place::on_a_line(x), levels).unwrap();
            let (radiance, noise) = (table.radiance_of(bin), table.noise_of(bin));
            let is_dark = radiance == Vec3::ZERO && noise == 0.0;
            assert!(is_dark, "seed {SEED}, {x}: {radiance} {noise}");
        }
    }

    /// A colour of which arrivals brought next to nothing is that of what lies around, or dark,
    /// whatever the roundings of their light say.
    #[test]
    fn next_to_nothing_of_a_colour_tells_no_light() {
        let levels = super::super::place::LINE;
        let mut rng = PathRng::from_seed(SEED);
        let mut tree = RadianceTree::new(levels, 64, 64 << 20);
        for _ in 0..100 {
            let some: Vec<_> = (0..512)
                .map(|_| {
                    let x = (rng.unit() * 1024.0) as i32;
                    // Dyed deeply in a part of one region, and in all of the other.
                    let green = if (64..512).contains(&x) { 1.0 } else { 1e-27 };
                    Some(Record {
                        place: Place::on_a_line(x),
                        carried: Vec3::new(1.0, green, 1.0),
                        found: Vec3::new(0.5, 0.5 * green + 1e-7, 0.5),
                    })
                })
                .collect();
            tree.learn(&some);
        }
        let table = tree.table();
        for x in 0..1024 {
            let q = table.radiance(&Place::on_a_line(x), levels).unwrap();
            assert!(q.y < 0.6, "seed {SEED}, {x}: {q}");
        }
    }

    /// Where there is no room for bins, those around learn on.
    #[test]
    fn bins_keep_to_their_bytes() {
        let mut rng = PathRng::from_seed(SEED);
        let some: Vec<_> = (0..50_000).map(|_| Some(arrival(&mut rng))).collect();
        let most = 40 * SHARDS as u64 * BIN_BYTES;
        let mut tree = RadianceTree::new(super::super::place::LINE, SPLIT, most);
        tree.learn(&some);
        let bins: usize = tree.shards.iter().map(|s| s.bins.len()).sum();
        assert!(bins <= 40 * SHARDS && bins > 40, "{bins}");
        let bins = tree.shards.iter().flat_map(|s| &s.bins);
        let taken: u32 = bins.map(|b| b.sums.count).sum();
        assert_eq!(taken, 50_000);
    }

    impl RadianceTree {
        /// The known-bad twin: a bin that has divided is read with all that came through it.
        fn table_of_all(&self) -> RadianceTable {
            let of = |shard: &Shard| {
                let mut all: Vec<Sums> = shard.bins.iter().map(|b| b.sums).collect();
                for (at, bin) in shard.bins.iter().enumerate().rev() {
                    if bin.parent != NONE {
                        let own = all[at];
                        all[bin.parent as usize].add(&own);
                    }
                }
                let read = all.iter().zip(&shard.bins);
                let read = read.filter(|(sums, _)| sums.count >= SPLIT / 2);
                read.map(|(sums, bin)| Entry {
                    key: bin.key,
                    radiance: sums.radiance().to_array(),
                    state: Entry::state(true, bin.is_split, 0.0),
                })
                .collect::<Vec<_>>()
            };
            let entries: Vec<_> = self.shards.iter().map(of).collect();
            RadianceTable::new(&entries.concat())
        }
    }
}
