use super::*;
use crate::relax::{System, relax};
use organza_basis::PathRng;

fn layers(draft: &Draft) -> [Layers; 2] {
    [Sheds::Warp(draft), Sheds::Weft(draft)].map(Layers::new)
}

fn named(name: &str) -> [Vec<usize>; 2] {
    layers(&Draft::named(name).unwrap()).map(|l| l.of)
}

#[test]
fn double_and_backed_cloths_have_the_layers_of_their_threads() {
    assert_eq!(named("double-plain"), [[0, 1, 0, 1]; 2]);
    // Where the cloths change places, the threads of the other one go on in their layer.
    for name in ["double-plain-4", "double-plain-5-4"] {
        for of in named(name) {
            let half = of.len() / 2;
            let expected = |i: usize| (i + i / half) % 2;
            assert!(
                (0..of.len()).all(|i| of[i] == expected(i)),
                "{name}: {of:?}"
            );
        }
    }
    let [warp, weft] = named("weft-backed-8-3");
    assert_eq!(warp, [0; 8]);
    assert!(
        weft.iter().enumerate().all(|(i, l)| *l == i % 2),
        "{weft:?}"
    );
    // Three plain cloths, and two face threads to one of the back.
    let stack = |of: &'static [usize], n: usize| {
        Draft::from_fn(n, n, move |e, p| {
            let (a, b) = (of[e % of.len()], of[p % of.len()]);
            let own = |t: usize, layer: usize| (0..t).filter(|i| of[i % of.len()] == layer).count();
            if a == b {
                (own(e, a) + own(p, a)).is_multiple_of(2)
            } else {
                a < b
            }
        })
        .unwrap()
    };
    for of in [&[0, 1, 2][..], &[0, 0, 1], &[0, 1, 1, 0], &[0, 0, 1, 1]] {
        let n = 2 * of.len();
        let expected: Vec<usize> = of.iter().copied().cycle().take(n).collect();
        let found = layers(&stack(of, n)).map(|l| l.of);
        assert_eq!(found, [expected.clone(), expected], "{of:?}");
    }
}

#[test]
fn cloths_side_by_side_are_no_layers() {
    // Eight ends of a cloth that lies over that of the next eight, if they could lie there.
    let of = |t: usize| t / 8 % 2;
    let draft = Draft::from_fn(16, 16, |e, p| match of(e) == of(p) {
        true => (e + p).is_multiple_of(2),
        false => of(e) < of(p),
    });
    assert_eq!(layers(&draft.unwrap()).map(|l| l.count), [1, 1]);
}

#[test]
fn a_stitch_keeps_the_layers_and_a_figure_of_extra_weft_lies_on_the_ground() {
    // Every thirty-second crossing binds an end of the back under a pick of the face.
    let double = Draft::named("double-plain").unwrap();
    let stitched = Draft::from_fn(16, 16, |e, p| {
        double.warp_up(e, p) || (e == 3 && p == 4) || (e == 11 && p == 12)
    });
    let [warp, weft] = layers(&stitched.unwrap());
    assert_eq!([warp.count, weft.count], [2, 2]);
    // Extra picks float over twelve ends and under twelve.
    let figured = Draft::from_fn(24, 8, |e, p| match p % 2 {
        0 => (e + p / 2).is_multiple_of(2),
        _ => e >= 12,
    });
    let [warp, weft] = layers(&figured.unwrap());
    assert_eq!(warp.count, 1);
    assert_eq!(weft.of, [0, 1, 0, 1, 0, 1, 0, 1]);
}

#[test]
fn weaves_of_one_layer_have_one() {
    for name in [
        "plain",
        "twill-2-2",
        "twill-3-1",
        "twill-2-1-1-2",
        "twill-5-1-1-1",
        "twill-4-4",
        "satin-5",
        "satin-8-3",
        "sateen-12",
        "basket-2-2",
        "basket-4-1",
        "herringbone-4-4-16",
        "warp-rib-8",
        "weft-rib-6",
    ] {
        let draft = Draft::named(name).unwrap();
        assert_eq!(layers(&draft).map(|l| l.count), [1, 1], "{name}");
    }
    // Of interlacings at random a few have layers by chance.
    let is_layered = |seed: &u64| {
        let mut rng = PathRng::from_seed(*seed);
        let draft = Draft::from_fn(16, 16, |_, _| rng.unit() < 0.5).unwrap();
        layers(&draft).map(|l| l.count) != [1, 1]
    };
    let layered: Vec<u64> = (0..100).filter(is_layered).collect();
    assert!(layered.len() <= 3, "seeds {layered:?}");
}

#[test]
fn layers_spread_out_as_far_as_the_others_let_them() {
    let of = |of: &[usize]| Layers {
        of: of.to_vec(),
        count: 1 + of.iter().copied().max().unwrap(),
        stay: true,
    };
    let alternate = of(&[0, 1, 0, 1]);
    let spacing = [1.0; 4];
    let even = alternate.positions_mm(&spacing);
    assert_eq!(even, [0.5, 1.5, 2.5, 3.5]);
    assert_eq!(alternate.rooms_mm(&spacing, &even), [2.0; 4]);
    // Two to one: the face is even, the back as it was.
    let two_to_one = of(&[0, 0, 1, 0, 0, 1]);
    let spacing = [1.0; 6];
    let at = two_to_one.positions_mm(&spacing);
    let rooms = two_to_one.rooms_mm(&spacing, &at);
    for (room, expected) in rooms.iter().zip([1.5, 1.5, 3.0, 1.5, 1.5, 3.0]) {
        assert!((room - expected).abs() < 3.0 * UNEVEN, "{rooms:?}");
    }
    // Two and two: what their order allows.
    let at = of(&[0, 0, 1, 1]).positions_mm(&[1.0; 4]);
    assert!(at.windows(2).all(|w| w[1] - w[0] > 0.5 * MIN_GAP), "{at:?}");
    assert!(at[1] - at[0] > 1.5, "{at:?}");
}

/// How far the nearest stacked threads are apart, over their distance at rest.
fn least_gap(draft: &Draft, stack: bool) -> f64 {
    const RADIUS_MM: f64 = 0.1;
    let sheds = [Sheds::Warp(draft), Sheds::Weft(draft)];
    // Threads of a layer nearly touch.
    let systems = sheds.map(|sheds| {
        let layers = Layers::new(sheds);
        let spacing_mm = vec![2.3 * RADIUS_MM / layers.count as f64; sheds.threads()];
        let position_mm = layers.positions_mm(&spacing_mm);
        let period_mm = spacing_mm.iter().sum();
        let half = |_: usize, _: usize| DVec2::splat(RADIUS_MM);
        System {
            half_height_mm: vec![RADIUS_MM; sheds.threads()],
            stiffness: vec![1.0; sheds.threads()],
            stacked: layers.stacked(sheds, &position_mm, period_mm, &half),
            position_mm,
            period_mm,
        }
    });
    let [mut warp, mut weft] = systems.clone();
    if !stack {
        warp.stacked.clear();
        weft.stacked.clear();
    }
    let rest = relax(draft, &warp, &weft, None, 2000).unwrap();
    let mut least = f64::INFINITY;
    for (system, curves) in systems.iter().zip([&rest.warp, &rest.weft]) {
        for pair in &system.stacked {
            let [a, b] = pair.threads.map(|t| &curves[t].height_mm);
            for (c, apart_mm) in pair.apart_mm.iter().enumerate().filter(|(_, t)| **t > 0.0) {
                // Knots lie at crossings and between.
                let gap_mm = f64::from(pair.order[c]) * (a[2 * c] - b[2 * c]);
                if pair.order[c] != 0 {
                    least = least.min(gap_mm / apart_mm);
                }
            }
        }
    }
    least
}

#[test]
fn stacked_threads_rest_on_each_other() {
    for name in ["double-plain", "double-plain-6", "weft-backed-8-3"] {
        let draft = Draft::named(name).unwrap();
        let gap = least_gap(&draft, true);
        println!("{name}: {gap:.3}");
        assert!(gap > 0.95, "{name}: {gap}");
    }
    // The twin: only crossing threads keep apart.
    let twin = least_gap(&Draft::named("double-plain").unwrap(), false);
    assert!(twin < 0.8, "{twin}");
}
