//! Worn cloth: what lost its dye.

use super::*;
use crate::{PrintSide, WearSpec};

const PALE: Rgb = Rgb::new(0.9, 0.9, 0.9);

fn spec() -> WearSpec {
    WearSpec {
        amount: Some(1.0),
        depth_um: Some(60.0),
        colour: PALE,
        side: PrintSide::Face,
        pills: None,
    }
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
    let mut all = Vec::new();
    for batch in 0..cloth.batch_count() {
        cloth.for_each_in_batch(batch, &mut |s| {
            let colour = cloth.materials()[usize::from(s.material)].colour.unwrap();
            let height = 0.5 * (s.start_mm + s.end_mm).z;
            all.push((colour.0.x, height, s.length_mm()));
        });
    }
    all
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
    fabric.pile = Some(toml::from_str(pile).unwrap());
    fabric.tile.repeats = [4, 4];
    let mut cloth = build(&fabric);
    cloth.wear(&spec()).unwrap();
    let tufts = cloth.threads.len()..cloth.batch_count();
    assert!(!tufts.is_empty());
    let (mut pale, mut dark) = (Vec::new(), Vec::new());
    for batch in tufts {
        cloth.for_each_in_batch(batch, &mut |s| {
            let colour = cloth.materials()[usize::from(s.material)].colour.unwrap();
            let height = 0.5 * (s.start_mm + s.end_mm).z;
            if colour.0.x > 0.85 {
                pale.push(height);
            } else if colour.0.x < 0.11 {
                dark.push(height);
            }
        });
    }
    let counts = [pale.len(), dark.len()];
    assert!(counts.iter().all(|n| *n > 100), "{counts:?}");
    let lowest_pale = pale.into_iter().fold(f32::INFINITY, f32::min);
    let highest_dark = dark.into_iter().fold(f32::NEG_INFINITY, f32::max);
    assert!(lowest_pale > highest_dark, "{lowest_pale} {highest_dark}");
}

#[test]
fn wear_that_is_none_is_refused() {
    let refused = |spec: WearSpec| {
        let mut cloth = build(&fabric("plain"));
        cloth.wear(&spec).unwrap_err().to_string()
    };
    let much = refused(WearSpec {
        amount: Some(1.5),
        ..spec()
    });
    assert!(
        much.contains("wear.amount: expected a number from 0 to 1"),
        "{much}"
    );
    let shallow = refused(WearSpec {
        depth_um: Some(0.0),
        ..spec()
    });
    assert!(shallow.contains("wear.depth_um: expected"), "{shallow}");
}
