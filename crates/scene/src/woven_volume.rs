//! A volume of woven cloth as an exemplar: its threads, how they interlace, and where they run.

use crate::error::InputError;
use crate::memory::free_memory_bytes;
use glam::{UVec2, Vec3};
use organza_basis::{Budget, FibrePopulation, SegmentSource};
use organza_volume::{Octree, ovox};
use organza_weave::{Cloth, Draft, Exemplar, Synthesis, YarnHeights};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Yarns with a smaller share of the fibre of a typical one are loose fibres.
const LEAST_SHARE: f64 = 0.05;
/// Most crossings of a volume.
const MAX_CROSSINGS: usize = 1 << 16;
/// Half the width, in threads, of the stretches along a yarn that heights are taken from.
const HALF_STRETCH: f64 = 0.25;
/// By how much volumes are stretched to the fabric's threads, at most.
const MOST_STRETCH: f64 = 1.1;

/// A tile of woven cloth in voxels. Ends run along y, picks along x.
#[derive(Clone, Debug)]
pub struct WovenVolume {
    /// The voxels.
    pub octree: Octree,
    /// How the threads interlace and where they run; heights are counted from their mean.
    pub exemplar: Exemplar,
    /// The mean height of its threads, mm.
    pub mean_height_mm: f32,
    /// Ends along x, then picks along y.
    threads: [Threads; 2],
}

/// The threads of a system.
#[derive(Clone, Debug)]
struct Threads {
    /// Where the middles of the threads lie, rising; the first is in the first period.
    at_mm: Vec<f64>,
    period_mm: f64,
}

impl Threads {
    /// The place of a thread; numbers go on beyond the period.
    fn place_mm(&self, thread: i64) -> f64 {
        let n = self.at_mm.len() as i64;
        self.at_mm[thread.rem_euclid(n) as usize] + thread.div_euclid(n) as f64 * self.period_mm
    }

    /// A place, counted in threads from the middle of the first: halves lie between two.
    fn number(&self, at_mm: f64) -> f64 {
        let n = self.at_mm.len() as i64;
        let behind = self.at_mm.partition_point(|&t| t <= at_mm) as i64 - 1;
        let behind = behind.clamp(-1, n - 1);
        let (low, high) = (self.place_mm(behind), self.place_mm(behind + 1));
        behind as f64 + (at_mm - low) / (high - low)
    }

    /// The reverse of [`Threads::number`].
    fn at_mm(&self, number: f64) -> f64 {
        let behind = number.floor();
        let (low, high) = (
            self.place_mm(behind as i64),
            self.place_mm(behind as i64 + 1),
        );
        low + (number - behind) * (high - low)
    }

    fn spacing_mm(&self) -> f64 {
        self.period_mm / self.at_mm.len() as f64
    }
}

/// Which system a population belongs to: 0 for ends, 1 for picks.
pub fn system_of(population: &FibrePopulation) -> usize {
    usize::from(population.axis.x.abs() > population.axis.y.abs())
}

/// Sums over the fibre of a stretch of a thread: of weights, distances, heights and products.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    weight: f64,
    distance: f64,
    height: f64,
    distance_squared: f64,
    product: f64,
}

impl Stretch {
    fn add(&mut self, weight: f64, distance_mm: f64, height_mm: f64) {
        self.weight += weight;
        self.distance += weight * distance_mm;
        self.height += weight * height_mm;
        self.distance_squared += weight * distance_mm * distance_mm;
        self.product += weight * distance_mm * height_mm;
    }

    fn mean_height_mm(&self) -> f64 {
        self.height / self.weight
    }

    /// Height at distance zero and slope of the line through the fibre.
    fn line(&self) -> (f64, f64) {
        let (d, h) = (self.distance / self.weight, self.height / self.weight);
        let variance = self.distance_squared / self.weight - d * d;
        let covariance = self.product / self.weight - d * h;
        let slope = if variance > 0.0 {
            covariance / variance
        } else {
            0.0
        };
        (h - slope * d, slope)
    }
}

impl WovenVolume {
    /// The volume in the bytes of an `.ovox`.
    ///
    /// # Errors
    /// Bytes that are no such file, and a volume in which no woven threads are found.
    pub fn read(bytes: &[u8], allowed_bytes: u64) -> Result<WovenVolume, String> {
        let mut budget = Budget::new(allowed_bytes);
        let stored = ovox::read(&mut &bytes[..], &mut budget).map_err(|e| e.to_string())?;
        WovenVolume::of(stored.octree)
    }

    fn of(octree: Octree) -> Result<WovenVolume, String> {
        if octree.blocks().is_some() {
            return Err("it is itself made of blocks; name its exemplars instead".into());
        }
        if !octree.repeats() {
            return Err(
                "it does not repeat; make it with \"organza voxelize\" or \"organza scan --tile\""
                    .into(),
            );
        }
        let (numbers, threads) = threads(&octree)?;
        let [ends, picks] = [0, 1].map(|s: usize| threads[s].at_mm.len());
        if ends * picks > MAX_CROSSINGS {
            return Err(format!(
                "it has {ends} ends x {picks} picks; expected at most {MAX_CROSSINGS} crossings"
            ));
        }
        // By system and crossing: at the crossing, and halfway to the next.
        let mut here = [0, 1].map(|_| vec![Stretch::default(); ends * picks]);
        let mut beyond = here.clone();
        for_each_population(&octree, |at, c| {
            let Some(&(system, thread)) = numbers.get(&c.yarn) else {
                return;
            };
            let along = &threads[1 - system];
            let place = [at.y, at.x][system];
            let number = along.number(f64::from(place));
            let weight = f64::from(c.length_density_per_mm2);
            let add = |all: &mut [Vec<Stretch>; 2], middle: f64, crossing: f64| {
                let n = along.at_mm.len() as i64;
                let other = (crossing as i64).rem_euclid(n) as usize;
                let (end, pick) = if system == 0 {
                    (thread, other)
                } else {
                    (other, thread)
                };
                let distance = f64::from(place) - along.at_mm(middle);
                if (number - middle).abs() <= HALF_STRETCH {
                    all[system][pick * ends + end].add(weight, distance, f64::from(at.z));
                }
            };
            add(&mut here, number.round(), number.round());
            add(&mut beyond, number.floor() + 0.5, number.floor());
        });
        for (of, what) in [(&here, "at"), (&beyond, "behind")] {
            for (system, name) in ["end", "pick"].into_iter().enumerate() {
                if let Some(i) = of[system].iter().position(|s| s.weight <= 0.0) {
                    return Err(format!(
                        "no {name} is found {what} end {}, pick {}",
                        i % ends + 1,
                        i / ends + 1
                    ));
                }
            }
        }
        let draft = Draft::from_fn(ends, picks, |e, p| {
            let [end, pick] = [0, 1].map(|s: usize| here[s][p * ends + e].mean_height_mm());
            end > pick
        });
        let draft = draft.map_err(|e| e.to_string())?;
        let all = here.iter().chain(&beyond).flatten();
        let mean = all.clone().map(Stretch::mean_height_mm).sum::<f64>() / all.count() as f64;
        let [warp, weft] = beyond.map(|of| {
            let lines = of.iter().map(Stretch::line);
            lines
                .map(|(height, slope)| (height - mean, slope))
                .collect()
        });
        Ok(WovenVolume {
            octree,
            exemplar: Exemplar {
                draft,
                heights: Some(YarnHeights { warp, weft }),
            },
            mean_height_mm: mean as f32,
            threads,
        })
    }

    /// Distances of ends and of picks, mm.
    pub fn spacing_mm(&self) -> [f64; 2] {
        [0, 1].map(|s: usize| self.threads[s].spacing_mm())
    }

    /// The place in the volume that lies `share` of a crossing behind the least corner of this
    /// one, along x and y.
    pub fn place_mm(&self, crossing: UVec2, share: glam::DVec2) -> glam::DVec2 {
        let number = crossing.as_dvec2() + share - 0.5;
        glam::DVec2::new(
            self.threads[0].at_mm(number.x),
            self.threads[1].at_mm(number.y),
        )
    }
}

/// The exemplars that are volumes, `None` for others.
///
/// # Errors
/// Names the key and the exemplar at fault.
pub fn read_all(
    names: &[String],
    open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
) -> Result<Vec<Option<WovenVolume>>, InputError> {
    let is_volume = |name: &str| name.to_ascii_lowercase().ends_with(".ovox");
    let read = |name: &String| {
        if !is_volume(name) {
            return Ok(None);
        }
        let at = |e: InputError| e.at_key("synthesis.exemplars");
        let bytes = open(name).map_err(|e| at(InputError::of_io(name, &e)))?;
        let volume = WovenVolume::read(&bytes, free_memory_bytes())
            .map_err(|why| at(InputError::of_file(name, why)))?;
        Ok(Some(volume))
    };
    names.iter().map(read).collect()
}

/// Refuses volumes whose threads lie at other distances than those of the fabric. Smaller
/// differences are stretched.
///
/// # Errors
/// Names the key, the exemplar at fault, and the distance that it has.
pub fn check_spacing(
    cloth: &Cloth,
    synthesis: &Synthesis,
    names: &[String],
    volumes: &[Option<WovenVolume>],
) -> Result<(), String> {
    let size = cloth.tile().bounds_mm.size();
    let exemplar = &synthesis.exemplar;
    let own = [
        f64::from(size.x) / exemplar.ends() as f64,
        f64::from(size.y) / exemplar.picks() as f64,
    ];
    for (name, volume) in names.iter().zip(volumes) {
        let Some(volume) = volume else { continue };
        for (system, table) in ["warp", "weft"].into_iter().enumerate() {
            let found = volume.spacing_mm()[system];
            if (found / own[system]).ln().abs() > MOST_STRETCH.ln() {
                return Err(format!(
                    "synthesis.exemplars: {name}: its threads of the {table} are {found:.4} mm \
                     apart, those of the fabric {:.4} mm; expected nearly the same, such as \
                     {table}.per_cm = {:.2}",
                    own[system],
                    10.0 / found
                ));
            }
        }
    }
    Ok(())
}

/// Calls `visit` with the middle of every voxel that holds fibre, from the least corner along x
/// and y, and each of its populations.
fn for_each_population(octree: &Octree, mut visit: impl FnMut(Vec3, &FibrePopulation)) {
    let (voxel_mm, min) = (octree.voxel_mm(0), octree.bounds_mm().min);
    octree.for_each_stored(0, |cell| {
        let at = (cell.as_vec3() + 0.5) * voxel_mm + min.with_x(0.0).with_y(0.0);
        for c in octree.mixture(0, cell).iter() {
            visit(at, c);
        }
    });
}

/// The system and the number in it of every yarn.
type Numbers = BTreeMap<u32, (usize, usize)>;

/// The threads of both systems.
fn threads(octree: &Octree) -> Result<(Numbers, [Threads; 2]), String> {
    #[derive(Clone, Copy, Default)]
    struct Yarn {
        /// Fibre of either system.
        weight: [f64; 2],
        /// Sums of cosine and sine of the place across the period, of either system.
        turn: [[f64; 2]; 2],
    }
    let size = octree.bounds_mm().size();
    let period_mm = [f64::from(size.x), f64::from(size.y)];
    let mut yarns: BTreeMap<u32, Yarn> = BTreeMap::new();
    for_each_population(octree, |at, c| {
        let yarn = yarns.entry(c.yarn).or_default();
        let system = system_of(c);
        let weight = f64::from(c.length_density_per_mm2);
        let angle = TAU * f64::from([at.x, at.y][system]) / period_mm[system];
        yarn.weight[system] += weight;
        yarn.turn[system][0] += weight * angle.cos();
        yarn.turn[system][1] += weight * angle.sin();
    });
    let mut found: [Vec<(f64, u32, f64)>; 2] = [Vec::new(), Vec::new()];
    for (&number, yarn) in &yarns {
        let system = usize::from(yarn.weight[1] > yarn.weight[0]);
        let [cos, sin] = yarn.turn[system];
        let at_mm = sin.atan2(cos).rem_euclid(TAU) / TAU * period_mm[system];
        found[system].push((at_mm, number, yarn.weight[system]));
    }
    let mut numbers = Numbers::new();
    let mut systems = Vec::new();
    for (system, name) in ["ends", "picks"].into_iter().enumerate() {
        let all = &mut found[system];
        let most = all.iter().map(|y| y.2).fold(0.0, f64::max);
        all.retain(|y| y.2 > LEAST_SHARE * most);
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        if all.len() < 2 {
            return Err(format!(
                "expected at least two {name}, each a yarn of its own, found {}; a scan needs \
                 \"organza scan --flatten --yarns --tile\"",
                all.len()
            ));
        }
        for (thread, &(_, number, _)) in all.iter().enumerate() {
            numbers.insert(number, (system, thread));
        }
        let threads = Threads {
            at_mm: all.iter().map(|y| y.0).collect(),
            period_mm: period_mm[system],
        };
        let n = threads.at_mm.len() as i64;
        let closest = (0..n).map(|i| threads.place_mm(i + 1) - threads.place_mm(i));
        if closest.fold(f64::INFINITY, f64::min) < 0.25 * threads.spacing_mm() {
            return Err(format!(
                "its {name} lie on top of each other; expected woven cloth of one layer"
            ));
        }
        systems.push(threads);
    }
    let threads: [Threads; 2] = systems.try_into().map_err(|_| "two systems".to_owned())?;
    Ok((numbers, threads))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_numbers_of_threads_are_each_others_reverse() {
        let threads = Threads {
            at_mm: vec![0.2, 0.5, 0.9],
            period_mm: 1.2,
        };
        assert!((threads.number(0.35) - 0.5).abs() < 4.0 * f64::EPSILON);
        assert!((threads.number(1.15) - 2.5).abs() < 4.0 * f64::EPSILON);
        for i in 0..24 {
            let at = 0.05 * f64::from(i);
            assert!((threads.at_mm(threads.number(at)) - at).abs() < 4.0 * f64::EPSILON);
        }
        assert!((threads.at_mm(3.0) - 1.4).abs() < 4.0 * f64::EPSILON);
    }
}
