//! Radiance by place, to be read.

use super::place::{Level, Place};
use glam::{BVec3, Vec3};

/// In which channels arrivals that carried so much, all together, tell of light: not where it is next
/// to nothing beside the brightest. What such a path still found is lost in the roundings of what it
/// had found before, and over that little they would be bright.
pub fn is_known(carried: Vec3) -> BVec3 {
    const LEAST: f32 = 1e-5;
    carried.cmpgt(Vec3::splat((LEAST * carried.max_element()).max(1e-30)))
}

/// What a bin holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Entry {
    /// See [`Place::key`]; zero where there is none.
    pub key: u64,
    pub radiance: [f32; 3],
    /// See [`Entry::state`].
    pub state: u32,
}

impl Entry {
    const READ: u32 = 1;
    const SPLIT: u32 = 2;

    /// Whether a bin has a radiance, for the places in it that have no finer bin; whether there
    /// may be finer ones; and the radiance's standard error as a share of it, whose lowest bits
    /// make room.
    pub fn state(is_read: bool, is_split: bool, noise: f32) -> u32 {
        let known = u32::from(is_read) * Entry::READ + u32::from(is_split) * Entry::SPLIT;
        known | noise.to_bits() & !(Entry::READ | Entry::SPLIT)
    }
}

/// Bins in an open hash table.
pub struct RadianceTable {
    entries: Vec<Entry>,
    count: usize,
}

impl RadianceTable {
    /// Of bins with different keys.
    pub fn new(bins: &[Entry]) -> RadianceTable {
        let room = RadianceTable::room_for(bins.len());
        let mut entries = vec![Entry::default(); room];
        for bin in bins {
            let mut at = home(bin.key, room);
            while entries[at].key != 0 {
                at = next(at, room);
            }
            entries[at] = *bin;
        }
        RadianceTable {
            entries,
            count: bins.len(),
        }
    }

    /// Entries of a table of so many bins.
    pub fn room_for(bins: usize) -> usize {
        bins * 3 / 2 + 2
    }

    /// How many bins there are.
    pub fn count(&self) -> usize {
        self.count
    }

    pub fn memory_bytes(&self) -> u64 {
        size_of_val(&self.entries[..]) as u64
    }

    /// Numbers of bins are below this.
    pub fn room(&self) -> usize {
        self.entries.len()
    }

    /// All bins.
    pub fn bins(&self) -> impl Iterator<Item = Entry> + '_ {
        self.entries.iter().filter(|e| e.key != 0).copied()
    }

    /// The radiance of every number, zero where there is no bin.
    pub fn radiances(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.entries.iter().map(|e| Vec3::from_array(e.radiance))
    }

    /// Gives the bin of a number another radiance.
    pub fn set_radiance(&mut self, number: usize, radiance: Vec3) {
        self.entries[number].radiance = radiance.to_array();
    }

    /// Multiplies the radiance of every bin.
    pub fn scale(&mut self, factor: f32) {
        for entry in &mut self.entries {
            entry.radiance = entry.radiance.map(|c| factor * c);
        }
    }

    /// The radiance in the finest bin at a place.
    #[cfg(test)]
    pub fn radiance(&self, place: &Place, levels: &[Level]) -> Option<Vec3> {
        Some(self.radiance_of(self.find(place, levels)?))
    }

    /// The radiance of a bin.
    pub fn radiance_of(&self, number: usize) -> Vec3 {
        Vec3::from_array(self.entries[number].radiance)
    }

    /// Its standard error as a share of it.
    pub fn noise_of(&self, number: usize) -> f32 {
        f32::from_bits(self.entries[number].state & !(Entry::READ | Entry::SPLIT))
    }

    /// The number of the finest bin at a place.
    #[inline]
    pub fn find(&self, place: &Place, levels: &[Level]) -> Option<usize> {
        Some(self.find_sized(place, levels)?.0)
    }

    /// The number of the finest bin where the place lies after it is moved at random by up to half
    /// the width of its bin, or else of its own: the mean of what is read is interpolated between
    /// bins. A place without a bin is moved by the widest: cloth that barely enters a bin leaves it
    /// empty.
    #[inline]
    pub fn find_beside(&self, place: &Place, levels: &[Level], bits: u64) -> Option<usize> {
        let own = self.find_sized(place, levels);
        let level = own.map_or(levels[0], |(_, level)| level);
        let beside = self.find(&place.moved(level, bits), levels);
        beside.or(own.map(|(number, _)| number))
    }

    #[inline]
    fn find_sized(&self, place: &Place, levels: &[Level]) -> Option<(usize, Level)> {
        let mut found = None;
        for (number, level) in levels.iter().enumerate() {
            let Some(at) = self.number(place.key(number, *level)) else {
                break;
            };
            let entry = &self.entries[at];
            if entry.state & Entry::READ != 0 {
                found = Some((at, *level));
            }
            if entry.state & Entry::SPLIT == 0 {
                break;
            }
        }
        found
    }

    #[inline]
    fn number(&self, key: u64) -> Option<usize> {
        let room = self.entries.len();
        let mut at = home(key, room);
        loop {
            let entry = &self.entries[at];
            if entry.key == key {
                return Some(at);
            }
            if entry.key == 0 {
                return None;
            }
            at = next(at, room);
        }
    }

    /// A number that another table hardly has.
    pub fn digest(&self) -> u64 {
        let bits = |e: &Entry| {
            let colours = e.radiance.iter().fold(e.key, |h, c| {
                organza_basis::mix64(h ^ u64::from(c.to_bits()))
            });
            organza_basis::mix64(colours ^ u64::from(e.state))
        };
        self.entries
            .iter()
            .fold(0, |sum: u64, e| sum.wrapping_add(bits(e)))
    }
}

/// Where a key is looked for first, in proportion to its size: it has 64 random bits.
#[inline]
pub(super) fn home(key: u64, room: usize) -> usize {
    ((u128::from(key) * room as u128) >> 64) as usize
}

/// The place after one, round the table.
#[inline]
fn next(at: usize, room: usize) -> usize {
    if at + 1 == room { 0 } else { at + 1 }
}

#[cfg(test)]
mod tests {
    use super::super::place::LINE;
    use super::*;
    use organza_basis::mix64;

    /// Between the middles of two bins the mean of what is read goes over from one to the other;
    /// a place without a bin reads the one beside it as often as it is that near.
    #[test]
    fn bins_are_blended_where_they_are_read_beside() {
        const WIDTH: i32 = 512;
        let levels = &LINE[..1];
        let bin = |x: i32, radiance: f32| Entry {
            key: Place::on_a_line(x * WIDTH).key(0, levels[0]),
            radiance: [radiance; 3],
            state: Entry::state(true, false, 0.0),
        };
        // The line is one step thick, and places move across it as well.
        let everywhere = |x: i32, radiance: f32| {
            [[0, 0], [0, -1], [-1, 0], [-1, -1]].map(|across| Entry {
                key: Place::across_a_line(x * WIDTH, across).key(0, levels[0]),
                ..bin(x, radiance)
            })
        };
        let table = RadianceTable::new(&[everywhere(0, 1.0), everywhere(1, 3.0)].concat());
        let count = 1 << 14;
        let read = |x: i32| -> Vec<usize> {
            let place = Place::on_a_line(x);
            let find = |n| table.find_beside(&place, levels, mix64(n));
            (1..=count).filter_map(find).collect()
        };
        // Five deviations of a share, at most, of so many.
        let error = 5.0 * 0.5 / (count as f32).sqrt();
        for eighths in 4..=12 {
            let found = read(eighths * WIDTH / 8);
            assert_eq!(found.len(), count as usize);
            let sum: f32 = found.iter().map(|bin| table.radiance_of(*bin).x).sum();
            let (mean, share) = (sum / count as f32, (eighths as f32 - 4.0) / 8.0);
            let expected = 1.0 + 2.0 * share;
            assert!((mean - expected).abs() < 2.0 * error, "{eighths}: {mean}");
            // The twin: what is read without moving jumps from bin to bin.
            let own = table.radiance(&Place::on_a_line(eighths * WIDTH / 8), levels);
            let is_between = ![4, 12].contains(&eighths);
            assert_eq!((own.unwrap().x - expected).abs() > 2.0 * error, is_between);
        }
        let share = read(-WIDTH / 4).len() as f32 / count as f32;
        assert!((share - 0.25).abs() < error, "{share}");
        assert_eq!(table.find(&Place::on_a_line(-WIDTH / 4), levels), None);
    }
}
