//! The format of the figures of a bench.

use super::scaling::Series;
use super::stage::{Sample, View, describe_distance};
use organza_measure::{Cost, Figure, Growth};
use organza_scene::auto::choice::Choice;
use organza_scene::auto::table::Recommendation;
use organza_scene::representation::EXPLICIT_FIBRES;

/// Relative noise at which times are compared.
pub(super) const NOISE: f64 = 0.02;

/// Seconds until the noise of a picture is [`NOISE`].
pub(super) fn seconds_to_noise(cost: &Cost) -> f64 {
    cost.setup_s + cost.noise_s / (NOISE * NOISE)
}

/// "2.5 %" or "25 %"
pub(super) fn percent(share: f64) -> String {
    let p = 100.0 * share;
    if p.abs() < 9.95 {
        format!("{p:.1} %")
    } else {
        format!("{p:.0} %")
    }
}

/// "2.5 % (2.4 % to 2.6 %)"
pub(super) fn interval(f: &Figure) -> String {
    format!(
        "{} ({} to {})",
        percent(f.value),
        percent(f.low),
        percent(f.high)
    )
}

/// "3.1 s", "31 s" or "3.1 h"
pub(super) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 5940.0 => format!("{s:.0} s"),
        s => format!("{:.1} h", s / 3600.0),
    }
}

pub(super) fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// At most two digits after the point, without trailing zeros.
pub(super) fn plain(x: f64) -> String {
    if x >= 100.0 || x == x.round() {
        format!("{x:.0}")
    } else {
        format!("{}", (x * 100.0).round() / 100.0)
    }
}

/// "denim, 0.1 mm (34 cm), front"
pub(super) fn short(sample: &Sample, view: &View) -> String {
    format!(
        "{}, {} mm ({}), {}",
        sample.name,
        view.pixel_mm,
        describe_distance(view.pixel_mm),
        view.lit.name()
    )
}

pub(super) fn describe_choice(choice: &Choice, sample: &Sample) -> String {
    choice.description(sample.fabric.file.voxel.size_um)
}

/// "micro-flakes, 20 um, level 1: 3.1 s (fibres 40 s); error 2.0 %, at most 2.1 %"
pub(super) fn recommended(r: &Recommendation, sample: &Sample) -> String {
    let words = describe_choice(&r.taken.choice, sample);
    match (r.seconds, r.fibres_s) {
        (Some(own), _) if r.taken.choice.model == &EXPLICIT_FIBRES => {
            format!("{words}: {}", time(own))
        }
        (Some(own), Some(fibres)) => format!(
            "{words}: {} (fibres {}); error {}, at most {}",
            time(own),
            time(fibres),
            percent(r.taken.rmse.value),
            percent(r.taken.rmse.high)
        ),
        _ => format!(
            "none; {words} is closest with {}",
            percent(r.taken.rmse.value)
        ),
    }
}

/// "1 to 16"
pub(super) fn ends(s: &Series) -> String {
    match (s.points.first(), s.points.last()) {
        (Some(a), Some(b)) => format!("{} to {}", plain(a.size), plain(b.size)),
        _ => String::new(),
    }
}

/// The exponent, in brackets its standard error, and the last exponent.
pub(super) fn exponent(g: Option<Growth>) -> String {
    g.map_or("-".into(), |g| {
        let error = g.standard_error;
        let error = error.map_or("two points".into(), |e| format!("{e:.2}"));
        format!("{:.2} ({error}), {:.2}", g.exponent, g.last_exponent)
    })
}
