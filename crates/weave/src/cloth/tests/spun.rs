//! Yarns that are irregular by name, and finished.

use super::*;
use crate::spec::HairinessSpec;
use crate::spinning::{FINISHES, NAMES};
use crate::yarn::Yarn;

fn spun(way: &str, tex: f64, finish: &[&str]) -> YarnSpec {
    let finish = match finish {
        [] => String::new(),
        _ => format!("finish = {finish:?}"),
    };
    parsed(&format!("tex = {tex}\nirregularity = '{way}'\n{finish}"))
}

/// A loose plain weave of a yarn.
fn woven(yarn: YarnSpec, repeats: u32) -> Cloth {
    let mut f = fabric("plain");
    let per_cm = 60.0 / yarn.tex.unwrap().sqrt();
    (f.warp.per_cm, f.weft.per_cm) = (Some(per_cm), Some(per_cm));
    f.yarn.insert("cotton".to_owned(), yarn);
    f.tile.repeats = [repeats; 2];
    build(&f)
}

/// The index H of the generated fibres is that of the preset over the counts at which such yarn
/// is spun; [`super::irregular`] holds how it is measured to a search over the whole yarn.
#[test]
fn hairiness_is_that_of_the_preset_over_the_counts() {
    for (way, at_20_tex, range) in [
        ("ring-spun cotton", 5.5, 3.0..11.5),
        ("open-end cotton", 4.2, 2.5..9.0),
    ] {
        for tex in [10.0, 20.0, 40.0, 80.0] {
            let yarn = spun(way, tex, &[]);
            let expected = at_20_tex * (tex / 20.0).sqrt();
            let asked = Yarn::new("cotton", &yarn).unwrap().hairiness.unwrap();
            assert!((asked.index / expected - 1.0).abs() < 4.0 * f64::EPSILON);
            let cloth = woven(yarn, 12);
            let irregularity = cloth.irregularity();
            let systems = [irregularity.warp.unwrap(), irregularity.weft.unwrap()];
            let index = 0.5 * (systems[0].hairiness + systems[1].hairiness);
            // Lengths are exponential, so that the sum of n has the relative error 1 / sqrt(n);
            // and steps across the surface are counted by halves.
            let hairs = expected * cloth.figures().yarn_length_mm / asked.length_mm;
            let error = 4.0 / hairs.sqrt() + 0.03;
            println!("{way} {tex}: {index:.2} for {expected:.2} within {error:.3}");
            assert!((index / expected - 1.0).abs() < error, "{index} {expected}");
            // The twin: the index of half the count.
            assert!((index * 2f64.sqrt() / expected - 1.0).abs() > error);
            assert!(range.contains(&index), "{way} {tex}: {index}");
        }
    }
}

/// Evenness is that of fibres at random, times the index of irregularity: finer yarn is less
/// even. Cottons come out within the published 10 to 16 % at usual counts.
#[test]
fn evenness_follows_the_number_of_fibres() {
    let cv = |way: &str, tex: f64| {
        let yarn = Yarn::new("cotton", &spun(way, tex, &[])).unwrap();
        (yarn.evenness.unwrap().mass_cv_percent, yarn.fibres_per_ply)
    };
    for tex in [15.0, 30.0, 60.0] {
        let (percent, fibres) = cv("ring-spun cotton", tex);
        let random = 100.0 * ((1.0 + 4.0 * 0.18 * 0.18) / f64::from(fibres)).sqrt();
        // Fibres are counted after twist shortens the yarn, by some per cent.
        assert!(
            (percent / (1.3 * random) - 1.0).abs() < 0.04,
            "{tex}: {percent}"
        );
    }
    assert!((10.0..16.0).contains(&cv("ring-spun cotton", 30.0).0));
    assert!(cv("combed cotton", 30.0).0 < cv("ring-spun cotton", 30.0).0);
    assert_eq!(cv("filament", 8.0).0, 1.0);
}

#[test]
fn every_name_makes_a_cloth_and_own_keys_win() {
    for way in NAMES {
        for finish in FINISHES {
            let yarn = Yarn::new("cotton", &spun(way, 30.0, &[finish])).unwrap();
            assert!(yarn.evenness.is_some(), "{way} {finish}");
        }
    }
    let own: HairinessSpec = parsed("index = 1.5\nlength_mm = 0.5\nreach_mm = 0.2");
    let finish = ["raised", "calendered", "mercerised"];
    let spec = YarnSpec {
        hairiness: Some(own),
        fibre_radius_cv_percent: Some(7.0),
        aspect: Some(1.1),
        ..spun("ring-spun cotton", 30.0, &finish)
    };
    let yarn = Yarn::new("cotton", &spec).unwrap();
    assert_eq!(yarn.hairiness, Some(own));
    assert_eq!((yarn.fibre_radius_cv, yarn.aspect), (0.07, 1.1));
    let hairs = YarnSpec {
        hairs: Some(Default::default()),
        ..spun("ring-spun cotton", 30.0, &["brushed"])
    };
    assert!(Yarn::new("cotton", &hairs).unwrap().hairiness.is_none());
    for (key, near, spec) in [
        (
            "irregularity",
            "ring-spun cotton",
            spun("ringspun coton", 30.0, &[]),
        ),
        ("finish", "mercerised", spun("flax", 30.0, &["mercerized"])),
    ] {
        let error = Yarn::new("x", &spec).unwrap_err().to_string();
        let words = format!("yarn.x.{key}: no {key}");
        assert!(error.starts_with(&words), "{error}");
        assert_contains(&error, &format!("did you mean \"{near}\""));
    }
    let woollen = "irregularity = 'woollen'\nfinish = ['raised', 'calendered']";
    let mut f = fabric_of("plain", woollen);
    f.ideal = true;
    let [ideal, even] = [f, fabric("plain")].map(|f| segments_of(&build(&f), [0]));
    assert_eq!(ideal, even);
}

/// Length of protruding fibre per length of yarn, its mean height outside the yarn, and the mean
/// of the fibres' steps along y: 0 where they lean nowhere.
fn fuzz(finish: &[&str]) -> [f64; 3] {
    let cloth = woven(spun("ring-spun cotton", 30.0, finish), 6);
    let (mut length, mut height, mut along) = (0.0, 0.0, 0.0);
    let mut yarn_mm = 0.0;
    for_each_strand(&cloth, |_, strand| {
        yarn_mm += strand.path.length_mm();
        strand.emit_hairs(0, &mut |s| {
            length += f64::from(s.length_mm());
            height += f64::from(s.length_mm() * s.start_mm.z.abs());
            along += f64::from(s.end_mm.y - s.start_mm.y);
        });
    });
    [length / yarn_mm, height / length, along / length]
}

#[test]
fn finishes_do_what_they_are_called_after() {
    let [plain, singed, raised, brushed] =
        [&[][..], &["singed"], &["raised"], &["brushed"]].map(fuzz);
    assert!(singed[0] < 0.5 * plain[0], "{singed:?} {plain:?}");
    assert!(
        raised[0] > 2.5 * plain[0] && raised[1] > 1.15 * plain[1],
        "{raised:?} {plain:?}"
    );
    assert!(brushed[0] > 1.5 * plain[0], "{brushed:?}");
    // Without a lean the mean of some thousand fibres that go either way is near 0.
    assert!(plain[2].abs() < 0.05, "{plain:?}");
    assert!(
        raised[2] > 0.05 && brushed[2] > 0.3,
        "{raised:?} {brushed:?}"
    );
    let of = |finish: &[&str]| Yarn::new("cotton", &spun("flax", 30.0, finish)).unwrap();
    let (plain, pressed, round) = (of(&[]), of(&["calendered"]), of(&["mercerised"]));
    assert!(pressed.aspect > plain.aspect && pressed.flattening.is_some());
    assert!(round.fibre_radius_cv < plain.fibre_radius_cv);
}
