//! Means with standard errors: the goniometer itself.

use crate::{Angles, Exit, Pair, PatchResponse, PathNames, PathRun};
use organza_basis::{Moments, Rgb, Stopped, Watch};
use organza_transport::Stats;
use rayon::prelude::*;
use std::ops::Range;

/// The number of paths for every pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Paths per pair; with a target error, the maximum.
    pub paths: u64,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Stop when the standard error of every channel is at most this: as a share of its value
    /// for a BSDF, as a share of the incident light for albedos. It is evaluated after 1024
    /// paths and whenever their number has doubled, so that stopping hardly depends on single
    /// paths.
    pub target_error: Option<f64>,
}

impl Effort {
    /// So many paths for every pair, whatever the error.
    pub const fn new(paths: u64, seed: u64) -> Effort {
        Effort {
            paths,
            seed,
            target_error: None,
        }
    }
}

/// Value and standard error per channel.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Measured {
    /// Mean of the estimates.
    pub mean: [f64; 3],
    /// Standard error of the mean; zero for a value without noise.
    pub se: [f64; 3],
}

impl Measured {
    /// A mean and its standard error.
    pub const fn new(mean: [f64; 3], se: [f64; 3]) -> Measured {
        Measured { mean, se }
    }

    pub(crate) fn of(moments: &[Moments; 3]) -> Measured {
        Measured::new(moments.map(|m| m.mean), moments.map(|m| m.standard_error()))
    }
}

/// The BSDF of one pair.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PairValue {
    /// The directions.
    pub pair: Pair,
    /// Value, 1/sr.
    pub bsdf: Measured,
    /// Paths traced.
    pub paths: u64,
}

/// The shares of the light from one direction, which add to one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Albedo {
    /// Toward the light.
    pub incident: Angles,
    /// Directional-hemispherical reflectance.
    pub reflected: Measured,
    /// Directional-hemispherical transmittance of what was scattered.
    pub transmitted: Measured,
    /// Direct transmittance: light that met nothing.
    pub direct: Measured,
    /// Absorptance.
    pub absorbed: Measured,
    /// Sum of the four, estimated path by path.
    pub sum: Measured,
    /// Paths traced.
    pub paths: u64,
}

/// Measured values, with the counts of the trackers.
#[derive(Clone, Debug, PartialEq)]
pub struct Results<T> {
    /// One entry per pair or direction, in order.
    pub list: Vec<T>,
    /// Sums over all of them.
    pub stats: Stats,
    /// Entries whose standard errors are too small to be trusted: one path carries so much of
    /// the squared deviations that others as bright may not have been met.
    pub heavy_tails: usize,
}

/// Why a measurement failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeasureError {
    /// Too few paths for a standard error.
    #[error("{0} paths per pair give no standard error; expected at least 2")]
    TooFewPaths(u64),
    /// Rows that the list of directions does not have.
    #[error("rows {}..{} of a list of {count}; expected rows within 0..{count}", rows.start, rows.end)]
    NoSuchRows {
        /// The rows asked for.
        rows: Range<usize>,
        /// How many rows the list has.
        count: usize,
    },
    /// Extinctions exceeded their bounds, so the values would be biased.
    #[error("{violations} of {lookups} look-ups exceeded their majorant; values would be biased")]
    MajorantViolations {
        /// Number of violations.
        violations: u64,
        /// Number of look-ups.
        lookups: u64,
    },
    /// Estimates that are not finite; leaving them out would bias the mean.
    #[error("{0} estimates were not finite")]
    NotFinite(u64),
    /// Whoever watched the measurement stopped it.
    #[error("{0}")]
    Stopped(#[from] Stopped),
}

impl MeasureError {
    /// Checks that the counts of a measurement exclude a bias.
    pub(crate) fn check(stats: &Stats) -> Result<(), MeasureError> {
        if stats.majorant_violations > 0 {
            return Err(MeasureError::MajorantViolations {
                violations: stats.majorant_violations,
                lookups: stats.tentative + stats.shadow_steps,
            });
        }
        if stats.rejected > 0 {
            return Err(MeasureError::NotFinite(stats.rejected));
        }
        Ok(())
    }
}

/// Paths that one thread traces at a time, and before the first evaluation of the error. The
/// number is fixed, so that the order of sums does not depend on the threads.
const CHUNK: u64 = 1024;

/// Paths of one item between two sums over its chunks; this bounds the memory of the chunks.
const MAX_AT_ONCE: u64 = 1 << 22;

/// Streams of random numbers that belong to directions, not to pairs.
const DIRECTION_STREAMS: u64 = 1 << 63;

/// Measures the BSDF at pairs. `watch` is called with the number of paths of a piece of the work,
/// before it, from any thread.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_pairs(
    patch: &impl PatchResponse,
    pairs: &[Pair],
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<Results<PairValue>, MeasureError> {
    measure_pair_rows(patch, pairs, 0..pairs.len(), effort, watch)
}

/// Measures the BSDF at the pairs of some rows of a list, counted from 0. Their values are those
/// that a measurement of the whole list gives these rows, bit for bit.
///
/// # Errors
/// See [`MeasureError`]; rows beyond the list are [`MeasureError::NoSuchRows`].
pub fn measure_pair_rows(
    patch: &impl PatchResponse,
    pairs: &[Pair],
    rows: Range<usize>,
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<Results<PairValue>, MeasureError> {
    let (pairs, first) = rows_of(pairs, rows)?;
    gather_pairs(patch, pairs, first, effort, watch)
}

/// Measures pairs, each with the random numbers of a stream; the first has `first_stream`.
///
/// # Errors
/// See [`MeasureError`].
pub(crate) fn gather_pairs(
    patch: &impl PatchResponse,
    pairs: &[Pair],
    first_stream: u64,
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<Results<PairValue>, MeasureError> {
    let effort = if patch.is_exact() {
        Effort {
            paths: 1,
            target_error: None,
            ..*effort
        }
    } else if effort.paths < 2 {
        return Err(MeasureError::TooFewPaths(effort.paths));
    } else {
        *effort
    };
    // A value of zero has not converged, whatever its error.
    let enough =
        |m: &Moments, target: f64| m.mean != 0.0 && m.standard_error() <= target * m.mean.abs();
    gather(
        pairs,
        first_stream,
        &effort,
        &enough,
        watch,
        &|pair: &Pair| {
            let (w_in, w_out) = (pair.incident.direction(), pair.exitant.direction());
            move |names: &PathNames, stats: &mut Stats, found: &mut dyn FnMut([Rgb; 1])| {
                let found = &mut |value| found([value]);
                let run = PathRun::new(names, stats, found);
                patch.each_bsdf((w_in, w_out), run);
            }
        },
    )
    .map(|found| Results {
        list: pairs
            .iter()
            .zip(found.list)
            .map(|(&pair, [moments])| PairValue {
                pair,
                bsdf: if patch.is_exact() {
                    Measured::new(moments.map(|m| m.mean), [0.0; 3])
                } else {
                    Measured::of(&moments)
                },
                paths: moments[0].count,
            })
            .collect(),
        stats: found.stats,
        heavy_tails: found.heavy_tails,
    })
}

/// Measures the shares of the light from each direction.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_albedos(
    patch: &impl PatchResponse,
    incident: &[Angles],
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<Results<Albedo>, MeasureError> {
    measure_albedo_rows(patch, incident, 0..incident.len(), effort, watch)
}

/// Measures the shares of the light from the directions of some rows of a list, counted from 0.
/// Their values are those that a measurement of the whole list gives these rows, bit for bit.
///
/// # Errors
/// See [`MeasureError`]; rows beyond the list are [`MeasureError::NoSuchRows`].
pub fn measure_albedo_rows(
    patch: &impl PatchResponse,
    incident: &[Angles],
    rows: Range<usize>,
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<Results<Albedo>, MeasureError> {
    let (incident, first) = rows_of(incident, rows)?;
    if effort.paths < 2 {
        return Err(MeasureError::TooFewPaths(effort.paths));
    }
    gather(
        incident,
        DIRECTION_STREAMS + first,
        effort,
        &|m: &Moments, target: f64| m.standard_error() <= target,
        watch,
        &|from: &Angles| {
            let w = from.direction();
            move |names: &PathNames, stats: &mut Stats, found: &mut dyn FnMut([Rgb; 5])| {
                let found = &mut |exit: Exit| {
                    let e = exit.energy(w);
                    found([e.reflected, e.transmitted, e.direct, e.absorbed, e.sum()]);
                };
                patch.each_exit(&|_| w, PathRun::new(names, stats, found));
            }
        },
    )
    .map(|found| Results {
        list: incident
            .iter()
            .zip(found.list)
            .map(|(&incident, moments)| {
                let [reflected, transmitted, direct, absorbed, sum] =
                    moments.each_ref().map(Measured::of);
                Albedo {
                    incident,
                    reflected,
                    transmitted,
                    direct,
                    absorbed,
                    sum,
                    paths: moments[0][0].count,
                }
            })
            .collect(),
        stats: found.stats,
        heavy_tails: found.heavy_tails,
    })
}

/// Some rows of a list, and the number of the first among the streams of the whole list.
fn rows_of<T>(list: &[T], rows: Range<usize>) -> Result<(&[T], u64), MeasureError> {
    let first = rows.start as u64;
    match list.get(rows.clone()) {
        Some(part) => Ok((part, first)),
        None => Err(MeasureError::NoSuchRows {
            rows,
            count: list.len(),
        }),
    }
}

/// The openness of the cloth, with its standard error: the share of light along the normal that
/// meets nothing. The cover factor is one minus the openness.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_openness(
    patch: &impl PatchResponse,
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<(f64, f64), MeasureError> {
    let normal = Angles::NORMAL;
    let effort = Effort {
        target_error: None,
        ..*effort
    };
    let results = measure_albedos(patch, &[normal], &effort, watch)?;
    let direct = results.list.first().map(|a| a.direct);
    Ok(direct.map_or((0.0, f64::INFINITY), |d| (d.mean[0], d.se[0])))
}

/// What was gathered of `N` colours.
pub(crate) struct Gathered<const N: usize> {
    /// Means and standard errors for every item, in order.
    pub list: Vec<[[Moments; 3]; N]>,
    /// Sums over all of them.
    pub stats: Stats,
    /// See [`Results::heavy_tails`].
    pub heavy_tails: usize,
}

/// A tail is heavy if one path has more than this share of the squared deviations. Where values
/// have no variance, the largest has a good part however many there are.
const HEAVY: f64 = 0.25;
/// Of fewer paths nobody expects a good error.
const ENOUGH_PATHS: u64 = 256;

/// Sums of the paths of an item.
#[derive(Clone)]
struct Sums<const N: usize> {
    moments: [[Moments; 3]; N],
    /// The largest values.
    largest: [[f64; 3]; N],
    stats: Stats,
}

impl<const N: usize> Sums<N> {
    fn new() -> Self {
        Sums {
            moments: [[Moments::default(); 3]; N],
            largest: [[f64::NEG_INFINITY; 3]; N],
            stats: Stats::default(),
        }
    }

    fn merge(&mut self, other: &Sums<N>) {
        let moments = self.moments.iter_mut().flatten();
        for (sum, more) in moments.zip(other.moments.iter().flatten()) {
            sum.merge(more);
        }
        let largest = self.largest.iter_mut().flatten();
        for (most, more) in largest.zip(other.largest.iter().flatten()) {
            *most = most.max(*more);
        }
        self.stats.merge(&other.stats);
    }

    fn has_heavy_tail(&self) -> bool {
        let all = self.moments.iter().flatten();
        let mut all = all.zip(self.largest.iter().flatten());
        all.any(|(m, largest)| {
            let square = (largest - m.mean).powi(2);
            m.count >= ENOUGH_PATHS && square > HEAVY * m.sum_sq_dev && m.sum_sq_dev > 0.0
        })
    }
}

/// Measures every item. An estimate gives the values of all given paths, in order.
pub(crate) fn gather<T: Sync, const N: usize, E>(
    items: &[T],
    first_stream: u64,
    effort: &Effort,
    enough: &(dyn Fn(&Moments, f64) -> bool + Sync),
    watch: Watch<'_>,
    estimate: &(impl Fn(&T) -> E + Sync),
) -> Result<Gathered<N>, MeasureError>
where
    E: Fn(&PathNames, &mut Stats, &mut dyn FnMut([Rgb; N])) + Sync,
{
    let one = |(stream, item): (usize, &T)| -> Result<Sums<N>, Stopped> {
        let estimate = estimate(item);
        let stream = first_stream + stream as u64;
        let mut sums = Sums::<N>::new();
        let mut done = 0;
        while done < effort.paths {
            let round = match effort.target_error {
                Some(_) => done.clamp(CHUNK, MAX_AT_ONCE),
                None => MAX_AT_ONCE,
            };
            let end = (done + round).min(effort.paths);
            let chunks = (done.div_ceil(CHUNK)..end.div_ceil(CHUNK))
                .into_par_iter()
                .map(|c| {
                    let paths = c * CHUNK..((c + 1) * CHUNK).min(end);
                    Stopped::check(watch(paths.end - paths.start))?;
                    let names = PathNames::new(effort.seed, stream, paths);
                    Ok(chunk(&estimate, &names))
                })
                .collect::<Result<Vec<Sums<N>>, Stopped>>()?;
            for part in &chunks {
                sums.merge(part);
            }
            done = end;
            let reached = |e| sums.moments.iter().flatten().all(|m| enough(m, e));
            if effort.target_error.is_some_and(reached) {
                break;
            }
        }
        Ok(sums)
    };
    let all = items.par_iter().enumerate().map(one);
    let all: Vec<_> = all.collect::<Result<_, _>>()?;
    let mut stats = Stats::default();
    for sums in &all {
        stats.merge(&sums.stats);
    }
    MeasureError::check(&stats)?;
    Ok(Gathered {
        list: all.iter().map(|sums| sums.moments).collect(),
        stats,
        heavy_tails: all.iter().filter(|sums| sums.has_heavy_tail()).count(),
    })
}

fn chunk<const N: usize>(
    estimate: &impl Fn(&PathNames, &mut Stats, &mut dyn FnMut([Rgb; N])),
    names: &PathNames,
) -> Sums<N> {
    let Sums {
        mut moments,
        mut largest,
        mut stats,
    } = Sums::new();
    let mut rejected = 0;
    estimate(names, &mut stats, &mut |values| {
        if !values.iter().all(|v| v.0.is_finite()) {
            rejected += 1;
            return;
        }
        let sums = moments.iter_mut().zip(&mut largest);
        for ((sums, largest), value) in sums.zip(values) {
            let channels = sums.iter_mut().zip(largest);
            for ((sum, most), x) in channels.zip(value.0.to_array().map(f64::from)) {
                sum.add(x);
                *most = most.max(x);
            }
        }
    });
    stats.rejected += rejected;
    Sums {
        moments,
        largest,
        stats,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{KlemsBasis, TexelGrid, gather_looks, measure_klems, measure_texture};
    use glam::{UVec2, Vec2, Vec3};
    use organza_basis::{PathRng, unwatched};
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// A patch whose values are powers of a uniform number.
    struct Powers(f32);

    impl PatchResponse for Powers {
        fn estimate_bsdf(&self, _: Vec3, _: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
            stats.paths += 1;
            Rgb::splat((1.0 - rng.unit()).powf(self.0))
        }

        fn estimate_exit(&self, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Exit {
            Exit::default()
        }
    }

    /// A watch that breaks from its tenth call on, and counts them all.
    fn stopping(calls: &AtomicU64) -> impl Fn(u64) -> ControlFlow<()> + Sync {
        |_| match calls.fetch_add(1, Ordering::Relaxed) {
            0..10 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }

    #[test]
    fn a_stop_ends_measurements_early() {
        let normal = Angles::NORMAL;
        let pair = Pair::new(normal, normal);
        let effort = Effort::new(64 * CHUNK, 7);
        let grid = TexelGrid {
            low_mm: Vec2::ZERO,
            size_mm: Vec2::ONE,
            texels: UVec2::new(1, 1024),
        };
        let patch = &Powers(0.5);
        type Run<'a> = &'a dyn Fn(Watch<'_>) -> Result<(), MeasureError>;
        let of = |name: &str, run: Run<'_>| {
            let calls = AtomicU64::new(0);
            let count = |_| unwatched(calls.fetch_add(1, Ordering::Relaxed));
            run(&count).unwrap();
            let all = calls.swap(0, Ordering::Relaxed);
            let stopped = run(&stopping(&calls)).unwrap_err();
            assert_eq!(stopped, MeasureError::Stopped(Stopped), "{name}");
            assert_eq!(stopped.to_string(), "stopped");
            // Every thread may finish its piece.
            let made = calls.into_inner();
            let most = 11 + 4 * rayon::current_num_threads() as u64;
            assert!(made <= most && 2 * made < all, "{name}: {made} of {all}");
        };
        let pairs = [pair; 64];
        of("pairs", &|w| {
            measure_pairs(patch, &pairs, &effort, w).map(drop)
        });
        of("albedos", &|w| {
            measure_albedos(patch, &[normal; 64], &effort, w).map(drop)
        });
        of("texture", &|w| {
            measure_texture(patch, pair, &grid, 2, 7, w).map(drop)
        });
        of("looks", &|w| gather_looks(patch, &grid, 2, 7, w).map(drop));
        of("klems", &|w| {
            measure_klems(patch, KlemsBasis::Full, 2, 7, w).map(drop)
        });
    }

    /// A uniform number to the power of -0.9 has a mean and no variance: the largest of many has
    /// more than a quarter of the squares nearly always. To the power of -0.2 it has a variance.
    #[test]
    fn values_without_a_variance_have_heavy_tails() {
        let normal = Angles::NORMAL;
        let pairs = [Pair::new(normal, normal); 64];
        for paths in [1024, 16_384] {
            let effort = Effort::new(paths, 7);
            let heavy = |power: f32| {
                let found = measure_pairs(&Powers(power), &pairs, &effort, &unwatched);
                found.unwrap().heavy_tails
            };
            assert!(heavy(-0.9) > 32, "{paths}: {}", heavy(-0.9));
            // Now and then one of so many is far above the others.
            assert!(heavy(-0.2) < 4, "{paths}: {}", heavy(-0.2));
            assert_eq!(heavy(1.0), 0, "{paths}");
        }
    }
}
