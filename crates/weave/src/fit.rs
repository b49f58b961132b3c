//! Cross-sections that fit: neighbouring yarns press each other narrow, and crossing yarns need
//! room between them.

use crate::layers::Layers;
use crate::yarn::{MAX_FIBRE_VOLUME_FRACTION, Yarn};
use crate::{Draft, Error};
use glam::DVec2;
use std::sync::Arc;

/// Narrowest cross-section that neighbours can press a yarn into, as width
/// over height (estimated).
const MIN_ASPECT: f64 = 0.5;

/// The threads of one system before the cloth is formed.
pub(crate) struct Threads {
    /// `warp` or `weft`.
    pub name: &'static str,
    /// The space that each thread takes up along the system, millimetres.
    pub spacing_mm: Vec<f64>,
    /// The yarn of each thread.
    pub yarns: Vec<Arc<Yarn>>,
    /// The layer of each thread.
    pub layers: Layers,
    /// Middle of each thread across the system, growing, millimetres.
    pub position_mm: Vec<f64>,
    /// The widest that each thread can be beside the others of its layer, millimetres.
    pub room_mm: Vec<f64>,
}

impl Threads {
    /// Threads in their places.
    pub fn new(
        name: &'static str,
        spacing_mm: Vec<f64>,
        yarns: Vec<Arc<Yarn>>,
        layers: Layers,
    ) -> Threads {
        let position_mm = layers.positions_mm(&spacing_mm);
        Threads {
            name,
            yarns,
            room_mm: layers.rooms_mm(&spacing_mm, &position_mm),
            position_mm,
            spacing_mm,
            layers,
        }
    }

    /// The same so many times farther apart.
    fn spaced(&self, factor: f64) -> Threads {
        let all = |lengths: &[f64]| lengths.iter().map(|s| s * factor).collect();
        Threads {
            name: self.name,
            spacing_mm: all(&self.spacing_mm),
            yarns: self.yarns.clone(),
            layers: self.layers.clone(),
            position_mm: all(&self.position_mm),
            room_mm: all(&self.room_mm),
        }
    }

    /// Length after which the system repeats, millimetres.
    pub fn period_mm(&self) -> f64 {
        self.spacing_mm.iter().sum()
    }
}

/// Factors on the round cross-section's width and height.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub warp: Vec<DVec2>,
    pub weft: Vec<DVec2>,
    /// Linear factor by which all cross-sections had to shrink; 1 when none.
    pub compaction: f64,
}

/// Presses threads into the space that they have.
///
/// A thread that is wider than its spacing becomes as narrow as the spacing and correspondingly
/// higher. Where threads interlace, Peirce's limit holds [Peirce1937]: with `p` the spacing of
/// interlacing threads in units of the two thicknesses, a cloth exists while the sum of `sqrt(1
/// - p^2)` over warp and weft is at most 1. Flat threads leave as much room as circles of their
///   height would, after their straight part is subtracted from the spacing [Kemp1958]; floats
///   lie side by side [Love1954]. Threads that miss the limit shrink until it is met or their
///   fibres are packed as densely as circles can be.
///
/// # Errors [`Error::Jammed`], which names the threads, the counts of yarn that would fit and the
/// threads per centimetre that would fit, when even that is not enough.
pub(crate) fn fit(draft: &Draft, warp: &Threads, weft: &Threads) -> Result<Fit, Error> {
    let changes = Changes::of_layers(draft, &warp.layers, &weft.layers);
    fit_at(&changes, warp, weft).map_err(|why| {
        let way_out = room_factor(&changes, warp, weft).map_or_else(String::new, |factor| {
            format!("; {}", way_out(factor, warp, weft))
        });
        Error::Jammed(why + &way_out)
    })
}

/// See [`room_factor`].
pub(crate) fn needed_room(draft: &Draft, warp: &Threads, weft: &Threads) -> Option<f64> {
    let changes = Changes::of_layers(draft, &warp.layers, &weft.layers);
    room_factor(&changes, warp, weft)
}

/// How many times farther apart all threads must lie for their yarns to fit, rounded up to a
/// thousandth; `None` where a hundred times is not enough.
pub(crate) fn room_factor(changes: &[Changes], warp: &Threads, weft: &Threads) -> Option<f64> {
    let fits = |factor: f64| {
        let [warp, weft] = [warp, weft].map(|t| t.spaced(factor));
        fit_at(changes, &warp, &weft).is_ok()
    };
    if fits(1.0) {
        return Some(1.0);
    }
    let (mut low, mut high) = (1.0f64, 100.0f64);
    if !fits(high) {
        return None;
    }
    while high / low > 1.0005 {
        let middle = (low * high).sqrt();
        if fits(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some((high * 1000.0).ceil() / 1000.0)
}

/// What to change for threads that lack room by a factor.
fn way_out(factor: f64, warp: &Threads, weft: &Threads) -> String {
    let floor1 = |x: f64| match x {
        x if x >= 10.0 => (10.0 * x).floor() / 10.0,
        x => (100.0 * x).floor() / 100.0,
    };
    let mut yarns: Vec<&Yarn> = Vec::new();
    for yarn in warp.yarns.iter().chain(&weft.yarns) {
        if !yarns.iter().any(|y| y.name == yarn.name) {
            yarns.push(yarn);
        }
    }
    let finer: Vec<String> = yarns
        .iter()
        .map(|y| {
            let tex = floor1(y.tex() / (factor * factor));
            format!("tex {tex} for yarn {} (now {:.1})", y.name, y.tex())
        })
        .collect();
    let [ends, picks] = [warp, weft].map(|t| {
        let mean_mm = t.period_mm() / t.spacing_mm.len() as f64;
        floor1(10.0 / (factor * mean_mm))
    });
    format!(
        "what fits: {}, which --fit-yarn takes; or {ends} warp and {picks} weft threads per cm",
        finer.join(" and ")
    )
}

/// The cross-sections of threads that fit; the error says which do not.
fn fit_at(changes: &[Changes], warp: &Threads, weft: &Threads) -> Result<Fit, String> {
    let (warp_flat, weft_flat) = (side_by_side(warp)?, side_by_side(weft)?);
    let shrunk = |k: f64| {
        let all = |v: &[DVec2]| v.iter().map(|f| *f * k).collect::<Vec<_>>();
        Fit {
            warp: all(&warp_flat),
            weft: all(&weft_flat),
            compaction: k,
        }
    };
    // The layers that need the most room.
    let tightest = |k: f64| {
        let fit = shrunk(k);
        let each = changes.iter().map(|c| Peirce::new(c, warp, weft, &fit));
        each.max_by(|a, b| a.excess().total_cmp(&b.excess()))
    };
    let overfull = |k: f64| tightest(k).is_some_and(|p| p.excess() > 0.0);
    if !overfull(1.0) {
        return Ok(shrunk(1.0));
    }
    let yarns = warp
        .yarns
        .iter()
        .zip(&warp_flat)
        .chain(weft.yarns.iter().zip(&weft_flat));
    let densest = yarns
        .map(|(y, f)| min_scale(y) / (f.x * f.y).sqrt())
        .fold(0.0, f64::max);
    if densest >= 1.0 || overfull(densest) {
        let is_warp = tightest(densest.min(1.0)).is_some_and(|p| p.warp < p.weft);
        let crowded = if is_warp { warp } else { weft };
        let count = crowded.spacing_mm.len() as f64;
        return Err(format!(
            "{} {} threads per cm (yarn {}) leave the crossing threads no room, even with fibres \
             packed to {MAX_FIBRE_VOLUME_FRACTION}; give the {} fewer per cm or finer yarn",
            (1000.0 * count / crowded.period_mm()).round() / 100.0,
            crowded.name,
            crowded.yarns.first().map_or("", |y| y.name.as_str()),
            crowded.name,
        ));
    }
    let (mut low, mut high) = (densest, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if overfull(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(shrunk(low))
}

/// How often neighbouring threads of a layer of ends and of a layer of picks lie on different
/// sides of the threads of the other.
pub(crate) struct Changes {
    ends: Vec<usize>,
    picks: Vec<usize>,
    /// Of each end and the next.
    warp: Vec<usize>,
    /// Of each pick and the next.
    weft: Vec<usize>,
}

impl Changes {
    /// Those of every layer of ends with every layer of picks.
    pub fn of_layers(draft: &Draft, warp: &Layers, weft: &Layers) -> Vec<Changes> {
        let weft: Vec<Vec<usize>> = (0..weft.count).map(|layer| weft.threads(layer)).collect();
        let of_ends = |layer| {
            let ends = warp.threads(layer);
            let each = weft.iter().cloned();
            each.map(move |picks| Changes::new(draft, ends.clone(), picks))
        };
        (0..warp.count).flat_map(of_ends).collect()
    }

    fn new(draft: &Draft, ends: Vec<usize>, picks: Vec<usize>) -> Changes {
        let (mut warp, mut weft) = (vec![0; ends.len()], vec![0; picks.len()]);
        for (j, &p) in picks.iter().enumerate() {
            let next_pick = picks[(j + 1) % picks.len()];
            for (i, &e) in ends.iter().enumerate() {
                let up = draft.warp_up(e, p);
                let next_end = ends[(i + 1) % ends.len()];
                warp[i] += usize::from(up != draft.warp_up(next_end, p));
                weft[j] += usize::from(up != draft.warp_up(e, next_pick));
            }
        }
        Changes {
            ends,
            picks,
            warp,
            weft,
        }
    }

    /// The mean shares of the crossing threads that pass between two neighbouring ends, and
    /// between two neighbouring picks, of the layers that interlace most.
    pub fn mean_shares(all: &[Changes]) -> [f64; 2] {
        let shares = all.iter().map(|changes| {
            let crossings = (changes.warp.len() * changes.weft.len()) as f64;
            [&changes.warp, &changes.weft].map(|c| c.iter().sum::<usize>() as f64 / crossings)
        });
        shares.fold([0.0; 2], |a: [f64; 2], b| [a[0].max(b[0]), a[1].max(b[1])])
    }
}

/// The linear factor at which a yarn's plies are packed most densely.
fn min_scale(yarn: &Yarn) -> f64 {
    (yarn.fibre_volume_fraction() / MAX_FIBRE_VOLUME_FRACTION)
        .sqrt()
        .min(1.0)
}

/// Presses each thread into its own spacing.
fn side_by_side(threads: &Threads) -> Result<Vec<DVec2>, String> {
    let each = threads.yarns.iter().zip(&threads.room_mm).enumerate();
    each.map(|(i, (yarn, &spacing))| {
        let diameter = 2.0 * yarn.radius_mm();
        let root = yarn.aspect.sqrt();
        let widest = spacing / diameter;
        if root <= widest {
            return Ok(DVec2::new(root, 1.0 / root));
        }
        let highest = widest / MIN_ASPECT;
        let flat = DVec2::new(widest, (1.0 / widest).min(highest));
        if (flat.x * flat.y).sqrt() >= min_scale(yarn) {
            return Ok(flat);
        }
        Err(format!(
            "{} thread {} (yarn {}, {diameter:.3} mm thick) has only {spacing:.3} mm of room, too \
             little even with fibres packed to {MAX_FIBRE_VOLUME_FRACTION}",
            threads.name,
            i + 1,
            yarn.name,
        ))
    })
    .collect()
}

/// Mean spacing of interlacing threads in units of both thicknesses.
struct Peirce {
    warp: f64,
    weft: f64,
}

impl Peirce {
    fn new(changes: &Changes, warp: &Threads, weft: &Threads, fit: &Fit) -> Peirce {
        let thickness = |t: &Threads, f: &[DVec2], of: &[usize]| {
            let heights = of.iter().map(|&i| 2.0 * t.yarns[i].radius_mm() * f[i].y);
            heights.sum::<f64>() / of.len() as f64
        };
        let Changes { ends, picks, .. } = changes;
        let reach = thickness(warp, &fit.warp, ends) + thickness(weft, &fit.weft, picks);
        Peirce {
            warp: room(warp, &fit.warp, ends, picks.len(), &changes.warp) / reach,
            weft: room(weft, &fit.weft, picks, ends.len(), &changes.weft) / reach,
        }
    }

    /// Greater than zero when the threads cannot interlace.
    fn excess(&self) -> f64 {
        let height = |p: f64| (1.0 - p.clamp(0.0, 1.0).powi(2)).sqrt();
        height(self.warp) + height(self.weft) - 1.0
    }
}

/// Mean space per interlacing between some threads of a system, less the width of floating
/// neighbours and the straight part of flat threads; infinite when nothing interlaces.
fn room(
    threads: &Threads,
    fit: &[DVec2],
    of: &[usize],
    crossings: usize,
    changes: &[usize],
) -> f64 {
    let n = of.len();
    let size = |i: usize| 2.0 * threads.yarns[of[i]].radius_mm() * fit[of[i]];
    let (mut left, mut interlacings) = (crossings as f64 * threads.period_mm(), 0usize);
    for i in 0..n {
        let (a, b) = (size(i), size((i + 1) % n));
        let changes = changes[i];
        interlacings += changes;
        left -= (crossings - changes) as f64 * 0.5 * (a.x + b.x);
        left -= changes as f64 * 0.5 * (a.x - a.y + b.x - b.y);
    }
    if interlacings == 0 {
        f64::INFINITY
    } else {
        left / interlacings as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::YarnSpec;
    use organza_testing::assert_contains;

    /// A round yarn of the given diameter, packed to `fraction`.
    fn yarn(diameter_mm: f64, fraction: f64) -> Yarn {
        let fibres = fraction * (0.5 * diameter_mm / 0.008).powi(2);
        let spec = YarnSpec {
            fibres_per_ply: Some(fibres.round() as u32),
            ply_radius_mm: Some(0.5 * diameter_mm),
            aspect: Some(1.0),
            ..YarnSpec::default()
        };
        Yarn::new("cotton", &spec).unwrap()
    }

    fn fit_of(weave: &str, yarn: &Yarn, warp_mm: f64, weft_mm: f64) -> Result<Fit, Error> {
        let draft = Draft::named(weave).unwrap();
        let threads = |name, n, spacing| {
            let yarns = (0..n).map(|_| Arc::new(yarn.clone())).collect();
            Threads::new(name, vec![spacing; n], yarns, Layers::single(n))
        };
        fit(
            &draft,
            &threads("warp", draft.ends(), warp_mm),
            &threads("weft", draft.picks(), weft_mm),
        )
    }

    fn refusal(weave: &str, yarn: &Yarn, warp_mm: f64, weft_mm: f64) -> String {
        let refused = fit_of(weave, yarn, warp_mm, weft_mm);
        refused.unwrap_err().to_string()
    }

    #[test]
    fn the_square_plain_weave_jams_where_peirce_says() {
        // Two equal terms of one half: p / D = sqrt(3) / 2, D two diameters.
        let (yarn, limit) = (yarn(0.2, 0.9), 0.2 * 3f64.sqrt());
        let fit = fit_of("plain", &yarn, limit * 1.001, limit * 1.001);
        assert_eq!(fit.unwrap().compaction, 1.0);
        let error = refusal("plain", &yarn, limit * 0.97, limit * 0.97);
        assert_contains(&error, "jammed");
        assert_contains(&error, "per cm");
        assert_contains(&refusal("plain", &yarn, 0.21, 0.34), "warp");
    }

    #[test]
    fn soft_yarns_shrink_until_they_fit_and_satins_fit_where_plain_does_not() {
        let soft = yarn(0.2, 0.45);
        let fit = fit_of("plain", &soft, 0.3, 0.3).unwrap();
        assert!((fit.compaction - 0.3 / (0.2 * 3f64.sqrt())).abs() < 4.0 * f64::from(f32::EPSILON));
        let hard = yarn(0.2, 0.9);
        assert!(fit_of("plain", &hard, 0.24, 0.24).is_err());
        let satin = fit_of("satin-8-3", &hard, 0.24, 0.24).unwrap();
        assert_eq!(satin.compaction, 1.0);
    }

    #[test]
    fn threads_wider_than_their_spacing_become_narrow_and_high() {
        let mut flat = yarn(0.2, 0.6);
        flat.aspect = 4.0;
        let fit = fit_of("satin-8-3", &flat, 0.25, 0.8).unwrap();
        assert!((fit.warp[0].x * 0.2 - 0.25).abs() < 4.0 * f64::EPSILON);
        assert!(
            (fit.warp[0].x * fit.warp[0].y - 1.0).abs() < 4.0 * f64::EPSILON,
            "area is kept"
        );
        assert!((fit.weft[0].x / fit.weft[0].y - 4.0).abs() < 4.0 * f64::EPSILON);
        let error = refusal("satin-8-3", &flat, 0.08, 0.8);
        assert_contains(&error, "warp thread 1 (yarn cotton, 0.200 mm thick)");
    }
}
