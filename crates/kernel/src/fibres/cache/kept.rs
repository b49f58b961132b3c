//! Light at later fibres that one picture has learned, kept for others of the same cloth.

use super::super::matter::FibreMatter;
use super::RadianceCache;
use super::place::Frame;
use super::table::{Entry, RadianceTable, home};

/// Bytes of what stands before the bins, and of a bin.
const HEAD: usize = 32;
const BIN: usize = 24;
/// Places that a bin may lie behind the one where it is looked for first. Keys are random
/// numbers, which stay far below.
const MOST_BEHIND: usize = 4096;

/// The radiances at all fibres but the first: they are of a cloth and its lights, whichever camera
/// looks at them.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptLight {
    /// See [`FibreMatter::fingerprint`].
    matter: u64,
    /// What places are counted in.
    pub(super) frame: Frame,
    /// Mean radiance of the picture that learned it.
    pub(super) picture_mean: f32,
    bins: Vec<Entry>,
}

impl KeptLight {
    /// What a picture of some matter has learned.
    pub(crate) fn of(cache: &RadianceCache, matter: &FibreMatter) -> KeptLight {
        KeptLight {
            matter: matter.fingerprint(),
            frame: cache.places.later(),
            picture_mean: cache.picture_mean,
            bins: cache.second.bins().collect(),
        }
    }

    /// Whether it was learned in matter that is laid out like this.
    pub(crate) fn is_of(&self, matter: &FibreMatter) -> bool {
        let is_tile = matches!(self.frame, Frame::Tile { .. });
        self.matter == matter.fingerprint() && is_tile == matter.is_one_body()
    }

    pub(super) fn table(&self) -> RadianceTable {
        RadianceTable::new(&self.bins)
    }

    /// In little endian: the fingerprint of the matter (`u64`), which kind of frame (`u32`), the mean
    /// radiance (`f32`), the size of the frame, mm (`f64`), how many bins there are (`u64`), and of
    /// every bin its key (`u64`), radiance (three `f32`) and state (`u32`).
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEAD + BIN * self.bins.len());
        bytes.extend(self.matter.to_le_bytes());
        let (kind, size_mm) = match self.frame {
            Frame::Tile { patch_mm: None } => (0u32, 0.0),
            Frame::Tile {
                patch_mm: Some(patch_mm),
            } => (1, patch_mm),
            Frame::World { step_mm } => (2, step_mm),
        };
        bytes.extend(kind.to_le_bytes());
        bytes.extend(self.picture_mean.to_le_bytes());
        bytes.extend(size_mm.to_le_bytes());
        bytes.extend((self.bins.len() as u64).to_le_bytes());
        for bin in &self.bins {
            bytes.extend(bin.key.to_le_bytes());
            for channel in bin.radiance {
                bytes.extend(channel.to_le_bytes());
            }
            bytes.extend(bin.state.to_le_bytes());
        }
        bytes
    }

    /// What [`KeptLight::to_bytes`] wrote; none of other bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<KeptLight> {
        let (matter, rest) = bytes.split_first_chunk::<8>()?;
        let (kind, rest) = rest.split_first_chunk::<4>()?;
        let (mean, rest) = rest.split_first_chunk::<4>()?;
        let (size_mm, rest) = rest.split_first_chunk::<8>()?;
        let (count, rest) = rest.split_first_chunk::<8>()?;
        let (mean, size_mm) = (f32::from_le_bytes(*mean), f64::from_le_bytes(*size_mm));
        let is_size = size_mm > 0.0 && size_mm.is_finite();
        let frame = match u32::from_le_bytes(*kind) {
            0 => Frame::Tile { patch_mm: None },
            1 if is_size => Frame::Tile {
                patch_mm: Some(size_mm),
            },
            2 if is_size => Frame::World { step_mm: size_mm },
            _ => return None,
        };
        let bins = rest.chunks_exact(BIN);
        let is_whole = bins.remainder().is_empty()
            && bins.len() as u64 == u64::from_le_bytes(*count)
            && (0.0..=f32::MAX).contains(&mean);
        let bins: Option<Vec<Entry>> = bins.map(entry).collect();
        let bins = bins.filter(|bins| is_whole && are_spread(bins))?;
        Some(KeptLight {
            matter: u64::from_le_bytes(*matter),
            frame,
            picture_mean: mean,
            bins,
        })
    }
}

/// Whether keys differ, and crowd nowhere in a table.
fn are_spread(bins: &[Entry]) -> bool {
    let mut keys: Vec<u64> = bins.iter().map(|bin| bin.key).collect();
    keys.sort_unstable();
    let (room, mut next) = (RadianceTable::room_for(bins.len()), 0);
    keys.windows(2).all(|pair| pair[0] != pair[1])
        && keys.iter().all(|key| {
            let home = home(*key, room);
            let at = home.max(next);
            next = at + 1;
            at - home <= MOST_BEHIND
        })
}

/// A bin; none that a table could not hold.
fn entry(bytes: &[u8]) -> Option<Entry> {
    let (key, rest) = bytes.split_first_chunk::<8>()?;
    let mut words = rest
        .chunks_exact(4)
        .map(|word| word.try_into().map_or(0, u32::from_le_bytes));
    let mut channel = || f32::from_bits(words.next().unwrap_or(0));
    let entry = Entry {
        key: u64::from_le_bytes(*key),
        radiance: [channel(), channel(), channel()],
        state: channel().to_bits(),
    };
    let is_light = |c: &f32| *c >= 0.0 && c.is_finite();
    (entry.key != 0 && entry.radiance.iter().all(is_light)).then_some(entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(frame: Frame) -> KeptLight {
        let bin = |k: u64| Entry {
            key: organza_basis::mix64(k) | 1,
            radiance: [k as f32, 0.5, 1e-9],
            state: Entry::state(true, k.is_multiple_of(2), 0.25),
        };
        KeptLight {
            matter: 77,
            frame,
            picture_mean: 0.3,
            bins: (0..20).map(bin).collect(),
        }
    }

    #[test]
    fn bytes_hold_everything_and_others_are_refused() {
        for frame in [
            Frame::Tile { patch_mm: None },
            Frame::Tile {
                patch_mm: Some(2.5),
            },
            Frame::World { step_mm: 0.125 },
        ] {
            let kept = kept(frame);
            let bytes = kept.to_bytes();
            assert_eq!(bytes.len(), HEAD + 20 * BIN);
            assert_eq!(KeptLight::from_bytes(&bytes), Some(kept));
            for end in 0..bytes.len() {
                assert_eq!(KeptLight::from_bytes(&bytes[..end]), None, "{end}");
            }
            let with = |at: usize, word: [u8; 4]| {
                let mut wrong = bytes.clone();
                wrong[at..at + 4].copy_from_slice(&word);
                KeptLight::from_bytes(&wrong)
            };
            assert_eq!(with(8, 7u32.to_le_bytes()), None);
            assert_eq!(with(12, (-1f32).to_le_bytes()), None);
            assert_eq!(with(HEAD + 8, f32::NAN.to_le_bytes()), None);
            assert_eq!(with(HEAD + 8, (-1f32).to_le_bytes()), None);
            let mut keyless = bytes.clone();
            keyless[HEAD..HEAD + 8].fill(0);
            assert_eq!(KeptLight::from_bytes(&keyless), None);
            let mut twice = bytes.clone();
            twice.copy_within(HEAD..HEAD + 8, HEAD + BIN);
            assert_eq!(KeptLight::from_bytes(&twice), None);
        }
        let crowded = |step: u64| {
            let bins = (1..=10_000).map(|k| Entry {
                key: k * step,
                ..Entry::default()
            });
            are_spread(&bins.collect::<Vec<_>>())
        };
        assert!(crowded(u64::MAX / 10_001) && !crowded(1));
    }
}
