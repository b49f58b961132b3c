//! Worn cloth: what lost its dye.

use super::*;
use crate::{PrintSide, WearSpec};

fn spec() -> WearSpec {
    parsed("amount = 1\ndepth_um = 60\ncolour = [0.9, 0.9, 0.9]")
}

fn worn(spec: &WearSpec) -> Cloth {
    let mut fabric = fabric("twill-3-1-s");
    fabric.warp.colours = vec![Rgb::new(0.1, 0.1, 0.1)];
    fabric.weft.colours = vec![Rgb::new(0.1, 0.1, 0.1)];
    let mut cloth = build(&fabric);
    cloth.wear(spec).unwrap();
    cloth
}

/// Red of all pieces of fibre, with their heights and lengths.
fn pieces(cloth: &Cloth) -> Vec<(f32, f32, f32)> {
    pieces_of(cloth, 0..cloth.batch_count())
}

fn pieces_of(cloth: &Cloth, batches: std::ops::Range<usize>) -> Vec<(f32, f32, f32)> {
    let piece = |s: Segment| {
        let red = colour(cloth, &s).unwrap().0.x;
        (red, 0.5 * (s.start_mm + s.end_mm).z, s.length_mm())
    };
    segments_of(cloth, batches).into_iter().map(piece).collect()
}

/// The highest fibres are palest, those a depth below them are as they were, and between them
/// dye is lost by height.
#[test]
fn crowns_lose_their_dye() {
    let all = pieces(&worn(&spec()));
    let pale = all.iter().filter(|p| p.0 > 0.85);
    let lowest_pale = pale.map(|p| p.1).fold(f32::INFINITY, f32::min);
    let dark = all.iter().filter(|p| p.0 < 0.15);
    let highest_dark = dark.map(|p| p.1).fold(f32::NEG_INFINITY, f32::max);
    // Six shades over the depth: the palest ends a twelfth of it below the crowns, and what is
    // dyed begins a twelfth above its end; pieces are 15 um long at the least.
    let between_um = 1e3 * (lowest_pale - highest_dark);
    assert!((between_um - 50.0).abs() < 8.0, "{between_um}");
    assert!(all.iter().any(|p| (0.3..0.7).contains(&p.0)));
    // As much fibre as before.
    let length = |all: &[(f32, f32, f32)]| all.iter().map(|p| p.2).sum::<f32>();
    let none = pieces(&worn(&WearSpec {
        amount: Some(0.0),
        ..spec()
    }));
    assert!((length(&all) / length(&none) - 1.0).abs() < 1e-3);
    assert!(none.iter().all(|p| p.0 < 0.11), "nothing was rubbed off");
    // The twin: the back, which is another side.
    let back = pieces(&worn(&WearSpec {
        side: PrintSide::Back,
        ..spec()
    }));
    assert!(back.iter().all(|p| p.0 < 0.85 || p.1 < 0.0));
    assert!(back.iter().any(|p| p.0 > 0.85));
}

/// Cut pile loses its dye by height, as threads do.
#[test]
fn cut_pile_is_rubbed() {
    let mut fabric = fabric("plain");
    let pile = "kind = 'cut'\nyarn = 'rayon'\nheight_mm = 1.5\nevery = [2, 2]\ncolours = [[0.1, 0.1, \
                0.1]]";
    fabric.pile = parsed(pile);
    fabric.tile.repeats = [4, 4];
    let mut cloth = build(&fabric);
    cloth.wear(&spec()).unwrap();
    let tufts = cloth.threads.len()..cloth.batch_count();
    assert!(!tufts.is_empty());
    let (mut pale, mut dark) = (Vec::new(), Vec::new());
    for (red, height, _) in pieces_of(&cloth, tufts) {
        if red > 0.85 {
            pale.push(height);
        } else if red < 0.11 {
            dark.push(height);
        }
    }
    let counts = [pale.len(), dark.len()];
    assert!(counts.iter().all(|n| *n > 100), "{counts:?}");
    let lowest_pale = pale.into_iter().fold(f32::INFINITY, f32::min);
    let highest_dark = dark.into_iter().fold(f32::NEG_INFINITY, f32::max);
    assert!(lowest_pale > highest_dark, "{lowest_pale} {highest_dark}");
}

#[test]
fn wear_that_is_none_is_refused() {
    for (amount, depth_um, expected) in [
        (1.5, 60.0, "wear.amount: expected a number from 0 to 1"),
        (1.0, 0.0, "wear.depth_um: expected"),
    ] {
        let wear = WearSpec {
            amount: Some(amount),
            depth_um: Some(depth_um),
            ..spec()
        };
        let refused = build(&fabric("plain")).wear(&wear);
        assert_contains(&refused.unwrap_err().to_string(), expected);
    }
}
