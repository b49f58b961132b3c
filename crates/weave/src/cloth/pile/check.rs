//! Which `[pile]` tables make sense.

use crate::Error;
use crate::cloth::ranges::check_ranges;
use crate::spec::{FabricGeometry, PileKind, PileSides, PileSpec};

/// Ends and picks after which the pile repeats.
pub(in crate::cloth) fn repeat(fabric: &FabricGeometry) -> [usize; 2] {
    let Some(pile) = &fabric.pile else {
        return [1, 1];
    };
    let Some([ends, picks]) = pile.every else {
        return [1, 1];
    };
    let [ends, picks] = [ends as usize, (picks as usize).max(1)];
    if pile.kind == PileKind::Wale {
        return [1, picks];
    }
    let sides = if pile.sides == Some(PileSides::Both) {
        2
    } else {
        1
    };
    let columns = sides * pile.colours.len().max(1);
    [ends.saturating_mul(columns).max(1), picks]
}

/// Refuses values out of range, and keys of another kind of pile.
pub(in crate::cloth) fn check(pile: &PileSpec) -> Result<(), Error> {
    let wrong = |key: &str, message: String| Err(Error::spec(format!("pile.{key}"), message));
    check_ranges(
        "pile",
        &[
            ("height_mm", Some(pile.height_mm), [0.05, 30.0], "mm"),
            (
                "height_cv_percent",
                pile.height_cv_percent,
                [0.0, 30.0],
                "%",
            ),
            ("tufts_per_cm2", pile.tufts_per_cm2, [1.0, 1e5], ""),
            ("lean_deg", pile.lean_deg, [0.0, 70.0], "degrees"),
            (
                "lean_direction_deg",
                pile.lean_direction_deg,
                [-360.0, 360.0],
                "degrees",
            ),
            (
                "lean_deviation_deg",
                pile.lean_deviation_deg,
                [0.0, 30.0],
                "degrees",
            ),
            ("ruffle_deg", pile.ruffle_deg, [0.0, 45.0], "degrees"),
            ("ruffle_mm", pile.ruffle_mm, [0.2, 100.0], "mm"),
            ("splay", pile.splay, [0.05, 4.0], ""),
            ("wave", pile.wave, [0.0, 0.3], ""),
            ("turn_deg", pile.turn_deg, [0.0, 90.0], "degrees"),
            ("wales_per_cm", pile.wales_per_cm, [0.5, 30.0], ""),
            ("wale_width", pile.wale_width, [0.2, 1.0], ""),
        ],
    )?;
    use PileKind::{Cut, Loop, Wale};
    for (key, is_given, kinds, of) in [
        (
            "tufts_per_cm2",
            pile.tufts_per_cm2.is_some(),
            &[Cut][..],
            "\"cut\"",
        ),
        (
            "splay",
            pile.splay.is_some(),
            &[Cut, Wale],
            "\"cut\" or \"wale\"",
        ),
        (
            "wave",
            pile.wave.is_some(),
            &[Cut, Wale],
            "\"cut\" or \"wale\"",
        ),
        (
            "turn_deg",
            pile.turn_deg.is_some_and(|t| t != 0.0),
            &[Loop],
            "\"loop\"",
        ),
        ("sides", pile.sides.is_some(), &[Loop], "\"loop\""),
        ("collide", pile.collide, &[Cut, Loop], "\"cut\" or \"loop\""),
        (
            "wales_per_cm",
            pile.wales_per_cm.is_some(),
            &[Wale],
            "\"wale\"",
        ),
        ("wale_width", pile.wale_width.is_some(), &[Wale], "\"wale\""),
    ] {
        if is_given && !kinds.contains(&pile.kind) {
            return wrong(key, format!("belongs to pile of kind {of}"));
        }
    }
    if pile.ruffle_mm.is_some() && pile.ruffle_deg.is_none() {
        return wrong("ruffle_mm", "needs pile.ruffle_deg".into());
    }
    match (pile.every, pile.tufts_per_cm2) {
        (None, None) if pile.kind == Cut => wrong(
            "every",
            "expected [ends, picks] between tufts, such as [1, 2], or pile.tufts_per_cm2".into(),
        ),
        (None, _) if pile.kind != Cut => wrong(
            "every",
            "expected [ends, picks] between tufts or loops, such as [1, 3]".into(),
        ),
        (Some(_), Some(_)) => wrong(
            "tufts_per_cm2",
            "pile.every gives the density already; expected one of them".into(),
        ),
        (Some(every), _) if every.iter().any(|n| !(1..=1024).contains(n)) => wrong(
            "every",
            format!("expected two numbers from 1 to 1024, found {every:?}"),
        ),
        _ if pile.kind == Wale && pile.wales_per_cm.is_none() => wrong(
            "wales_per_cm",
            "pile of kind \"wale\" needs the number of ridges per centimetre, 0.5 to 30".into(),
        ),
        _ => Ok(()),
    }
}
