use super::*;
use crate::Thread;
use organza_testing::assert_contains;
use std::collections::HashSet;

/// A picture of a disk: warp satin inside, weft satin outside.
fn disk(n: usize) -> Draft {
    let satin = Draft::named("satin-5").unwrap();
    let r = n as f64 / 3.0;
    Draft::from_fn(n, n, |e, p| {
        let (x, y) = (e as f64 - n as f64 / 2.0, p as f64 - n as f64 / 2.0);
        satin.warp_up(e, p) == (x.hypot(y) < r)
    })
    .unwrap()
}

#[test]
fn every_crossing_shows_its_own_window() {
    for window in [3, 5] {
        let spec = SynthesisSpec {
            window,
            ..SynthesisSpec::default()
        };
        let made = Synthesis::new(disk(60), &spec, Vec::new(), 1).unwrap();
        assert_eq!(made.index.len(), 3600);
        assert_eq!(made.figures().replaced_crossings, 0);
        let (mut most, radius) = (HashMap::<_, HashSet<_>>::new(), spec.radius());
        for (i, &number) in made.index.iter().enumerate() {
            let [e, p] = made.blocks[number as usize].place;
            let own = Window::around(&made.design, i % 60, i / 60, radius);
            assert_eq!(Window::around(&made.exemplar, e, p, radius), own);
            most.entry(own).or_default().insert(number);
        }
        let variants = most.values().map(HashSet::len).max();
        assert_eq!(variants, Some(spec.variants as usize));
        let again = Synthesis::new(disk(60), &spec, Vec::new(), 1).unwrap();
        assert_eq!(again.index, made.index);
        let other = Synthesis::new(disk(60), &spec, Vec::new(), 2).unwrap();
        assert_ne!(other.index, made.index);
    }
}

#[test]
fn a_small_exemplar_falls_back_to_the_inner_crossings() {
    let spec = SynthesisSpec {
        exemplar_crossings: 14 * 256,
        ..SynthesisSpec::default()
    };
    let made = Synthesis::new(disk(120), &spec, Vec::new(), 1).unwrap();
    let figures = made.figures();
    assert!(figures.replaced_windows > 0 && figures.replaced_windows < figures.windows);
    for (i, &number) in made.index.iter().enumerate() {
        let [e, p] = made.blocks[number as usize].place;
        let own = Window::around(&made.design, i % 120, i / 120, 1);
        assert_eq!(Window::around(&made.exemplar, e, p, 1), own);
    }
}

#[test]
fn windows_that_no_exemplar_has_are_drawn() {
    let spec = SynthesisSpec::default();
    let given = ["plain", "satin-5"].map(|name| Exemplar {
        draft: Draft::named(name).unwrap(),
        heights: None,
    });
    let twill = Draft::named("twill-2-1-z").unwrap();
    let refused = Synthesis::new(twill, &spec, given.to_vec(), 1);
    let why = refused.unwrap_err().to_string();
    let start = "synthesis.exemplars: no exemplar has 3 of the design's";
    assert!(why.starts_with(start), "{why}");
    assert_contains(&why, "at 3 crossings, the first at end ");
    let is_drawn = |line: &&str| line.contains('X') && line.contains('.');
    assert!(why.lines().filter(is_drawn).count() >= 9, "{why}");
    let satin = Draft::named("satin-5").unwrap();
    let made = Synthesis::new(satin, &spec, given.to_vec(), 1).unwrap();
    assert_eq!(made.figures().replaced_windows, 0);
}

#[test]
fn crossings_of_volumes_are_known() {
    let twill = Draft::named("twill-2-1-z").unwrap().tiled(6, 3);
    let numbered = |n: usize| (0..n).map(|i| (i as f64, -(i as f64))).collect();
    let given = vec![
        Exemplar {
            draft: Draft::named("plain").unwrap(),
            heights: None,
        },
        Exemplar {
            draft: twill.clone(),
            heights: Some(YarnHeights {
                warp: numbered(18),
                weft: numbered(18),
            }),
        },
    ];
    let made = Synthesis::new(twill, &SynthesisSpec::default(), given, 1).unwrap();
    assert_eq!(made.figures().replaced_crossings, 0);
    for block in &made.blocks {
        let (volume, [end, pick]) = made.volume_at(block.place).unwrap();
        assert_eq!(volume, 1);
        let up = made.exemplars[1].draft.warp_up(end, pick);
        let [e, p] = block.place;
        assert_eq!(made.exemplar.warp_up(e, p), up);
        let (left, below) = ((end + 5) % 6, (pick + 2) % 3);
        for (is_warp, is_after, [end, pick]) in [
            (true, true, [end, pick]),
            (true, false, [end, below]),
            (false, false, [left, pick]),
        ] {
            let number = (pick * 6 + end) as f64;
            let height = made.volume_height(block.place, is_warp, is_after);
            assert_eq!(height, Some((number, -number)));
        }
    }
    assert_eq!(made.volume_at([2, 2]), None);
}

#[test]
fn blocks_are_kept_apart_by_colour() {
    let mut striped = Draft::named("plain").unwrap().tiled(8, 2);
    for (i, thread) in striped.warp.iter_mut().enumerate() {
        *thread = Thread {
            colour: Some(Rgb::splat(if i < 4 { 0.2 } else { 0.8 })),
            ..Thread::default()
        };
    }
    let spec = SynthesisSpec {
        variants: 1,
        ..SynthesisSpec::default()
    };
    let made = Synthesis::new(striped, &spec, Vec::new(), 1).unwrap();
    assert_eq!(made.warp_colours.len(), 2);
    assert_eq!(made.weft_colours.len(), 1);
    // Two windows; inside each stripe and on either side of either border.
    assert_eq!(made.blocks.len(), 2 * 6);
    for (i, &number) in made.index.iter().enumerate() {
        let colours = made.blocks[number as usize].colours.warp;
        assert_eq!(colours[1], u16::from(i % 8 >= 4));
        assert_eq!(colours[0], u16::from((i + 7) % 8 >= 4));
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    for (key, value) in [("window", 4), ("variants", 0), ("exemplar_crossings", 8)] {
        let spec = toml::from_str(&format!("{key} = {value}")).unwrap();
        let refused = Synthesis::new(disk(20), &spec, Vec::new(), 1);
        let why = refused.unwrap_err().to_string();
        assert!(why.starts_with(&format!("synthesis.{key}")), "{why}");
    }
}
