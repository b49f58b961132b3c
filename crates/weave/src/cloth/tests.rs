use super::*;
use crate::FabricGeometry;
use crate::spec::{DraftSpec, ThreadSetSpec, TileSpec, YarnSpec};
use crate::wif::example_drafts::{EXAMPLES, damask};

fn no_files(name: &str) -> std::io::Result<Vec<u8>> {
    Err(std::io::Error::new(
        std::io::ErrorKind::NotFound,
        name.to_owned(),
    ))
}

fn fabric(weave: &str) -> FabricGeometry {
    FabricGeometry {
        draft: DraftSpec {
            weave: Some(weave.to_owned()),
            ..DraftSpec::default()
        },
        warp: ThreadSetSpec {
            per_cm: Some(20.0),
            ..ThreadSetSpec::default()
        },
        weft: ThreadSetSpec {
            per_cm: Some(18.0),
            ..ThreadSetSpec::default()
        },
        ..FabricGeometry::default()
    }
}

fn build(fabric: &FabricGeometry) -> Cloth {
    Cloth::build(fabric, &no_files, 7).unwrap()
}

/// Heights of warp and weft where end `e` crosses pick `p`, from the curves.
fn heights(cloth: &Cloth, e: usize, p: usize) -> (f32, f32) {
    let at = |batch: usize, axis: usize, place: f32| {
        let mut best = (f32::INFINITY, 0.0);
        let source = cloth.curves(Level::Yarn);
        let period = source.tile().period_mm()[axis];
        source.for_each_in_batch(batch, &mut |s| {
            let away = (s.start_mm[axis] - place).rem_euclid(period);
            let away = away.min(period - away);
            if away < best.0 {
                best = (away, s.start_mm.z);
            }
        });
        best.1
    };
    let ends = cloth.draft().unwrap().ends();
    let across = |batch, axis| {
        let mut place = 0.0;
        cloth
            .curves(Level::Yarn)
            .for_each_in_batch(batch, &mut |s| place = s.start_mm[axis]);
        place
    };
    (at(e, 1, across(ends + p, 1)), at(ends + p, 0, across(e, 0)))
}

#[test]
fn a_planted_draft_is_read_back_from_the_heights_of_the_curves() {
    for weave in [
        "plain",
        "twill-3-1-s",
        "satin-8-3",
        "basket-2-2",
        "herringbone",
    ] {
        let cloth = build(&fabric(weave));
        let planted = Draft::named(weave).unwrap();
        let (ends, picks) = (
            cloth.draft().unwrap().ends(),
            cloth.draft().unwrap().picks(),
        );
        for i in 0..ends * picks {
            let (e, p) = (i % ends, i / ends);
            let (warp, weft) = heights(&cloth, e, p);
            assert_eq!(warp > weft, planted.warp_up(e, p), "{weave} {e} {p}");
        }
    }
}

/// Every curve's end must be another's (or its own) start, one period on.
fn assert_closed(cloth: &Cloth, level: Level) {
    let source = cloth.curves(level);
    for batch in 0..source.batch_count() {
        let mut ends: Vec<(Segment, Segment)> = Vec::new();
        let path = cloth.path(&cloth.threads[batch], level);
        let strand = cloth.strand(batch, &path);
        let pieces = match level {
            Level::Fibre => strand.closure.fibres_per_ply() * strand.yarn.plies,
            _ => u32::MAX,
        };
        source.for_each_in_batch(batch, &mut |s| match ends.last_mut() {
            // Hairs come last and end where they like.
            _ if s.fibre >= pieces => {}
            Some((first, last)) if first.fibre == s.fibre => {
                assert_eq!(last.end_mm, s.start_mm, "curves are unbroken");
                assert_eq!(last.end_tangent, s.start_tangent);
                *last = *s;
            }
            _ => ends.push((*s, *s)),
        });
        let period = source.tile().period_mm().extend(0.0);
        let warps = cloth.draft().map_or(0, Draft::ends);
        let along = if batch < warps { Vec3::Y } else { Vec3::X };
        // Single precision of the largest coordinate.
        let near = 2e-6 + 2e-7 * period.max_element();
        let mut starts = vec![0u32; ends.len()];
        for (_, last) in &ends {
            let wanted = last.end_mm - along * period;
            let matches = |first: &Segment| {
                first.start_mm.distance(wanted) < near
                    && first.start_tangent.distance(last.end_tangent) < 1e-4
            };
            let next = ends.iter().position(|(first, _)| matches(first));
            starts[next.unwrap_or_else(|| panic!("{level:?} {batch}: {last:?} goes nowhere"))] += 1;
        }
        assert!(
            starts.iter().all(|&n| n == 1),
            "each start continues one end"
        );
    }
}

#[test]
fn every_curve_continues_across_the_border_of_the_tile() {
    let mut f = fabric("twill-2-1-s");
    f.weft.yarn = vec!["two".to_owned(), "wool".to_owned()];
    let two = YarnSpec {
        plies: Some(2),
        ..YarnSpec::default()
    };
    f.yarn.insert("two".to_owned(), two);
    f.tile = TileSpec { repeats: [1, 2] };
    let cloth = build(&f);
    for level in [Level::Yarn, Level::Ply, Level::Fibre] {
        assert_closed(&cloth, level);
    }
}

#[test]
fn the_tile_holds_every_height() {
    let cloth = build(&fabric("satin-5-2"));
    let bounds = cloth.tile().bounds_mm;
    for batch in 0..cloth.batch_count() {
        cloth.for_each_in_batch(batch, &mut |s| {
            let b = s.bounds_mm();
            let inside = b.min.z >= bounds.min.z - 1e-6 && b.max.z <= bounds.max.z + 1e-6;
            assert!(inside, "{s:?} leaves {bounds:?}");
        });
    }
}

/// Streams everything: number of segments and length without hairs.
fn poured(cloth: &Cloth) -> (usize, f64) {
    let (mut count, mut length) = (0, 0.0);
    for batch in 0..cloth.batch_count() {
        let path = cloth.path(&cloth.threads[batch], Level::Fibre);
        let strand = cloth.strand(batch, &path);
        let pieces = strand.closure.fibres_per_ply() * strand.yarn.plies;
        cloth.for_each_in_batch(batch, &mut |s| {
            count += 1;
            if s.fibre < pieces {
                length += f64::from(s.length_mm());
            }
        });
    }
    (count, length)
}

#[test]
fn figures_agree_with_the_fibres_and_with_closed_forms() {
    let mut f = fabric("twill-2-2");
    f.yarn.insert(
        "cotton".to_owned(),
        YarnSpec {
            plies: Some(2),
            aspect: Some(1.0),
            loops: Some(crate::spec::LoopSpec {
                per_mm: Some(0.0),
                peak: None,
            }),
            ..YarnSpec::default()
        },
    );
    let cloth = build(&f);
    let figures = cloth.figures();
    let (_, length) = poured(&cloth);
    assert!(
        (figures.fibre_length_mm / length - 1.0).abs() < 0.01,
        "{figures:?} {length}"
    );
    let (warp, weft) = (figures.warp.clone().unwrap(), figures.weft.clone().unwrap());
    assert!((warp.threads_per_cm - 20.0).abs() < 1e-4);
    assert!((weft.threads_per_cm - 18.0).abs() < 1e-4);
    assert!((warp.tex / 30.0 - 1.0).abs() < 0.02);
    // tex (g/km) x ends/cm x (1 + crimp) x 0.1 is g/m^2 of one system.
    let mass = |s: &SystemFigures| 0.1 * s.tex * s.threads_per_cm * (1.0 + s.crimp_percent / 100.0);
    let textbook = mass(&warp) + mass(&weft);
    assert!(
        (figures.areal_density_g_per_m2 / textbook - 1.0).abs() < 0.03,
        "{figures:?} {textbook}"
    );
    let yarn = &cloth.yarns()[0];
    let cover = 2.0 * yarn.radius_mm() / 0.5;
    assert!((warp.cover_factor - cover).abs() < 1e-6);
    let both = 1.0 - (1.0 - cover) * (1.0 - 2.0 * yarn.radius_mm() * 1.8);
    assert!((figures.cover_factor - both).abs() < 1e-6);
    let volume = figures.areal_density_g_per_m2 / (1000.0 * 1.52 * figures.thickness_mm);
    assert!((figures.fibre_volume_fraction / volume - 1.0).abs() < 1e-6);
    // Two threads on top of each other at least, four at most.
    assert!(
        (3.9..8.0).contains(&(figures.thickness_mm / yarn.radius_mm())),
        "{figures:?}"
    );
}

#[test]
fn crimp_of_a_plain_weave_follows_its_curve() {
    let cloth = build(&fabric("plain"));
    let figures = cloth.figures();
    let warp = figures.warp.unwrap();
    let Centreline::Woven { curve, .. } = &cloth.threads[0].line else {
        panic!("woven");
    };
    // Quadrature of the arc length.
    let n = 2000;
    let length: f64 = (0..curve.height_mm.len())
        .flat_map(|k| (0..n).map(move |i| (k, (f64::from(i) + 0.5) / f64::from(n))))
        .map(|(k, t)| curve.interval(k).0 / f64::from(n) * curve.at(k, t).1.hypot(1.0))
        .sum();
    let crimp = 100.0 * (length / curve.period_mm() - 1.0);
    assert!(
        (warp.crimp_percent / crimp - 1.0).abs() < 0.01,
        "{} {crimp}",
        warp.crimp_percent
    );
}

#[test]
fn twist_turns_the_way_of_its_letter() {
    for (direction, sign) in [
        (crate::spec::TwistDirection::Z, 1.0),
        (crate::spec::TwistDirection::S, -1.0),
    ] {
        let mut f = fabric("plain");
        f.yarn.insert(
            "cotton".to_owned(),
            YarnSpec {
                twist: Some(crate::spec::TwistSpec {
                    direction,
                    turns_per_m: None,
                    angle_deg: Some(30.0),
                }),
                ..YarnSpec::default()
            },
        );
        let cloth = build(&f);
        // On the face of a warp yarn, seen with y up, Z runs like `/`.
        let mut slope = 0.0;
        cloth.for_each_in_batch(0, &mut |s| {
            slope += f64::from(s.start_tangent.x * s.start_tangent.y.signum() * s.start_mm.z);
        });
        assert!(slope * sign > 0.0, "{direction:?}: {slope}");
    }
}

#[test]
fn seeds_make_cloths_and_yarns_differ_and_equal_seeds_do_not() {
    let f = fabric("plain");
    let collect = |seed, batch| {
        let cloth = Cloth::build(&f, &no_files, seed).unwrap();
        let mut all = Vec::new();
        cloth.for_each_in_batch(batch, &mut |s| all.push(s.start_tangent));
        all
    };
    assert_eq!(collect(1, 0), collect(1, 0));
    assert_ne!(collect(1, 0), collect(2, 0));
    assert_ne!(collect(1, 0)[..50], collect(1, 1)[..50]);
}

#[test]
fn knits_are_closed_and_weigh_what_their_loops_do() {
    for name in crate::knit::NAMES {
        let f = knit(name);
        let cloth = build(&f);
        assert!(cloth.draft().is_none());
        for level in [Level::Yarn, Level::Fibre] {
            assert_closed(&cloth, level);
        }
        let figures = cloth.figures();
        assert!((figures.wales_per_cm.unwrap() - 8.0).abs() < 1e-5);
        let (_, length) = poured(&cloth);
        assert!(
            (figures.fibre_length_mm / length - 1.0).abs() < 0.03,
            "{name}"
        );
        let bounds = cloth.tile().bounds_mm;
        cloth.for_each_in_batch(0, &mut |s| {
            let b = s.bounds_mm();
            assert!(b.min.z >= bounds.min.z && b.max.z <= bounds.max.z);
        });
    }
}

fn knit(name: &str) -> FabricGeometry {
    let mut f = fabric("plain");
    f.draft = DraftSpec {
        knit: Some(name.to_owned()),
        wales_per_cm: Some(8.0),
        ..DraftSpec::default()
    };
    f.weft.per_cm = Some(11.0);
    f
}

#[test]
fn a_fabric_reads_from_toml_and_wrong_keys_are_named() {
    let text = r#"
        [draft]
        drawdown = ["X.", ".X"]
        [warp]
        yarn = ["a", "wool"]
        colours = [[0.1, 0.2, 0.3]]
        per_cm = 12
        [weft]
        yarn = "a"
        spacing_mm = 1.0
        [yarn.a]
        preset = "cotton"
        twist = { direction = "S", angle_deg = 15 }
    "#;
    let f: FabricGeometry = toml::from_str(text).unwrap();
    let cloth = build(&f);
    assert_eq!(cloth.materials().len(), 3);
    assert_eq!(cloth.materials()[0].colour, Some(Rgb::new(0.1, 0.2, 0.3)));
    let error = toml::from_str::<FabricGeometry>(&text.replace("per_cm", "per_inch")).unwrap_err();
    assert!(
        error.to_string().contains("unknown field `per_inch`"),
        "{error}"
    );
    for (from, to, expected) in [
        (
            "yarn = \"a\"",
            "yarn = \"b\"",
            "weft.yarn: there is no [yarn.b]",
        ),
        (
            "per_cm = 12",
            "per_cm = -1",
            "warp.per_cm: expected 0.01 to 10000 threads per cm, found -1",
        ),
        (
            "per_cm = 12",
            "per_cm = 12\nspacing_mm = 1",
            "warp: expected per_cm or spacing_mm",
        ),
        ("per_cm = 12", "", "warp: thread 1 has no spacing"),
        (
            "drawdown =",
            "weave = \"plain\"\ndrawdown =",
            "draft: expected exactly one",
        ),
        (
            "drawdown = [\"X.\", \".X\"]",
            "wif = \"x.wif\"",
            "draft.wif: x.wif: ",
        ),
        (
            "drawdown = [\"X.\", \".X\"]",
            "knit = \"garter\"",
            "draft.wales_per_cm",
        ),
        (
            "[yarn.a]",
            "[tile]\nrepeats = [0, 1]\n[yarn.a]",
            "tile.repeats",
        ),
        (
            "[yarn.a]",
            "[tile]\nrepeats = [1, 4000000000]\n[yarn.a]",
            "tile.repeats",
        ),
    ] {
        let f: FabricGeometry = toml::from_str(&text.replacen(from, to, 1)).unwrap();
        let error = Cloth::build(&f, &no_files, 1).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{expected}: {error}");
    }
}

#[test]
fn imported_yarns_get_fibres_and_imported_fibres_stay_as_they_are() {
    let text = "0 0 0 0.1\n1 0 0.2 0.1\n2 0.3 0 0.1\n3 0 0 0.1\n\n0 1 0 0.1\n3 1 0 0.2\n";
    let load = |name: &str| match name {
        "lines.txt" => Ok(text.as_bytes().to_vec()),
        _ => no_files(name),
    };
    let mut f = fabric("plain");
    f.draft = DraftSpec {
        curves: Some("lines.txt".to_owned()),
        curve_unit_mm: Some(2.0),
        ..DraftSpec::default()
    };
    let yarns = Cloth::build(&f, &load, 1).unwrap();
    assert!(!yarns.tile().repeats);
    let bounds = yarns.tile().bounds_mm;
    let (mut count, mut low, mut high) = (0, f32::INFINITY, f32::NEG_INFINITY);
    for batch in 0..yarns.batch_count() {
        yarns.for_each_in_batch(batch, &mut |s| {
            assert!(bounds.contains(s.bounds_mm().min) && bounds.contains(s.bounds_mm().max));
            assert!((s.start_tangent.length() - 1.0).abs() < 1e-5);
            count += 1;
            (low, high) = (low.min(s.start_mm.x), high.max(s.end_mm.x));
        });
    }
    assert!(
        count > 1000 && low < 0.1 && high > 5.9,
        "{count} {low} {high}"
    );
    let figures = yarns.figures();
    let (_, length) = poured(&yarns);
    assert!(
        (figures.fibre_length_mm / length - 1.0).abs() < 0.02,
        "{figures:?} {length}"
    );

    f.draft.curves_are = crate::spec::CurveKind::Fibres;
    let fibres = Cloth::build(&f, &load, 1).unwrap();
    let mut segments = Vec::new();
    (0..2).for_each(|b| fibres.for_each_in_batch(b, &mut |s| segments.push(*s)));
    assert_eq!(segments.len(), 4);
    assert_eq!(segments[3].end_mm, Vec3::new(6.0, 2.0, 0.0));
    assert_eq!(
        (segments[3].start_radius_mm, segments[3].end_radius_mm),
        (0.2, 0.4)
    );
    let volume = 6.0 * std::f64::consts::PI * 0.3 * 0.3;
    assert!(fibres.figures().fibre_volume_fraction > 0.0 && volume > 0.0);
}

#[test]
fn closed_imported_yarns_close() {
    let ring: String = (0..12)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 12.0).sin_cos();
            format!("{cos} {sin} {} 0.1\n", 0.3 * (2.0 * cos).sin())
        })
        .collect();
    let set = crate::curve_file::CurveSet::read_text(&ring, 1.0).unwrap();
    let points: Vec<DVec3> = set.curves[0]
        .points_mm
        .iter()
        .map(|p| p.as_dvec3())
        .collect();
    let path = Path::through(&points, true, 0.05);
    let last = path.steps();
    assert!(path.points[0].distance(path.points[last]) < 1e-12);
    assert!(path.lateral[0].distance(path.lateral[last]) < 1e-9);
    for i in 0..=last {
        assert!((path.lateral[i].dot(path.vertical[i])).abs() < 1e-9);
        assert!((path.lateral[i].length() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn hairs_are_as_many_as_asked_for_and_stand_out() {
    let mut f = fabric("plain");
    let (mut hairs, mut expected, mut threads) = (0.0, 0.0, 0.0);
    f.yarn.insert(
        "cotton".to_owned(),
        YarnSpec {
            hairs: Some(crate::spec::HairSpec {
                per_mm: Some(2.3),
                ..crate::spec::HairSpec::default()
            }),
            ..YarnSpec::default()
        },
    );
    for seed in 0..40 {
        let cloth = Cloth::build(&f, &no_files, seed).unwrap();
        for batch in 0..cloth.batch_count() {
            let path = cloth.path(&cloth.threads[batch], Level::Fibre);
            let mut last = None;
            let mut ends = 0.0;
            cloth.strand(batch, &path).emit_hairs(0, &mut |s| {
                if last != Some(s.fibre) {
                    ends += 1.0;
                }
                last = Some(s.fibre);
            });
            hairs += ends;
            expected += 2.3 * path.length_mm();
            threads += 1.0;
        }
    }
    // Each thread rounds its number up or down: variance a quarter at most.
    let deviation = (0.25f64 * threads).sqrt();
    assert!(
        (hairs - expected).abs() < 4.0 * deviation,
        "seeds 0 to 39: {hairs} {expected}"
    );
    assert!(
        (hairs - 1.1 * expected).abs() > 4.0 * deviation,
        "a tenth more would be seen"
    );
}

#[test]
fn crossing_yarns_stay_apart_between_crossings_too() {
    for (weave, least) in [("plain", 0.9), ("twill-2-2", 0.9), ("satin-5-2", 0.9)] {
        let mut f = fabric(weave);
        let round = YarnSpec {
            aspect: Some(1.0),
            ..YarnSpec::default()
        };
        f.yarn.insert("cotton".to_owned(), round);
        let cloth = build(&f);
        let ends = cloth.draft().unwrap().ends();
        let period = cloth.tile().period_mm();
        let points = |batch: usize| {
            let path = cloth.path(&cloth.threads[batch], Level::Ply);
            path.points.iter().map(|p| p.as_vec3()).collect::<Vec<_>>()
        };
        let mut nearest = f32::INFINITY;
        for e in 0..ends {
            for p in ends..cloth.batch_count() {
                for a in points(e) {
                    for b in points(p) {
                        let mut d = a - b;
                        d.x -= period.x * (d.x / period.x).round();
                        d.y -= period.y * (d.y / period.y).round();
                        nearest = nearest.min(d.length());
                    }
                }
            }
        }
        let share = f64::from(nearest) / (2.0 * cloth.yarns()[0].radius_mm());
        println!("{weave}: nearest {share:.3} of touching");
        assert!(share > least, "{weave}: {share}");
    }
}

/// Drafts in many dialects and a damask all become cloth that closes. The damask has 96
/// threads a side, with `ORGANZA_FULL=1` 641.
#[test]
fn drafts_of_every_dialect_become_cloth() {
    let full = std::env::var("ORGANZA_FULL").is_ok_and(|v| v == "1");
    let large = damask(if full { 641 } else { 96 });
    let drafts = EXAMPLES.into_iter();
    for (name, bytes) in drafts.chain([("damask", large.as_bytes())]) {
        let draft = Draft::from_wif(bytes).unwrap();
        let mut f = fabric("plain");
        f.draft = DraftSpec {
            wif: Some(name.to_owned()),
            ..DraftSpec::default()
        };
        let cloth =
            Cloth::build(&f, &|_| Ok(bytes.to_vec()), 1).unwrap_or_else(|e| panic!("{name}: {e}"));
        let tiled = cloth.draft().unwrap();
        let figures = cloth.figures();
        assert!(figures.compression < 0.1, "{name}: {figures:?}");
        assert!(figures.warp.unwrap().crimp_percent < 40.0, "{name}");
        for (e, p) in [(0, 0), (tiled.ends() - 1, tiled.picks() / 2)] {
            let (warp, weft) = heights(&cloth, e, p);
            assert_eq!(warp > weft, draft.warp_up(e, p), "{name} {e} {p}");
        }
        assert_closed(&cloth, Level::Yarn);
    }
}

#[test]
fn a_yarn_with_too_many_fibres_to_push_apart_is_warned_of() {
    let warnings = |plies: u32, fibres: u32| {
        let mut fabric = fabric("plain");
        let tow = YarnSpec {
            plies: Some(plies),
            fibres_per_ply: Some(fibres),
            ..YarnSpec::default()
        };
        fabric.yarn.insert("cotton".to_owned(), tow);
        // Yarns of a few hundred thousand fibres are a centimetre thick.
        for system in [&mut fabric.warp, &mut fabric.weft] {
            system.per_cm = Some(0.2);
        }
        build(&fabric).warnings
    };
    let warns = |plies, fibres| {
        let mut list = warnings(plies, fibres).into_iter();
        list.any(|w| w.starts_with("yarn.cotton: too many fibres"))
    };
    assert!(warns(8, 50_000));
    assert!(!warns(1, 4_000));
}
