//! Irregular yarns: what was asked for comes out in the fibres.

use super::*;
use crate::protruding::Beside;
use glam::DVec2;

/// A plain weave of one kind of irregular cotton.
pub(super) fn irregular(repeats: u32, keys: &str) -> FabricGeometry {
    let mut f = fabric_of("plain", keys);
    f.tile.repeats = [repeats, repeats];
    f
}

pub(super) const ALL_KINDS: &str = "
evenness = { mass_cv_percent = 15, fibre_length_mm = 10 }
slubs = { per_m = 30, length_mm = [3, 1], mass = [1.5, 0.2] }
fibre_radius_cv_percent = 20
wander = { amplitude = 0.15, length_mm = 0.8 }
hairiness = { index = 4, length_mm = 0.8, reach_mm = 0.3, curl_mm = 0.4, returning = 0.3 }
";

#[test]
fn an_ideal_cloth_has_no_irregularity() {
    let mut f = irregular(1, ALL_KINDS);
    f.warp.spacing_cv_percent = Some(5.0);
    f.ideal = true;
    let [ideal, even] = [f, fabric("plain")].map(|f| build(&f));
    assert_eq!(segments(&ideal), segments(&even));
    let irregularity = even.irregularity();
    for system in [irregularity.warp.unwrap(), irregularity.weft.unwrap()] {
        assert_eq!(system.mass_cv_percent, 0.0);
        assert_eq!(system.twist_cv_percent, 0.0);
    }
}

/// Mass per length in short pieces of all threads, from the fibres; hairs left out.
fn masses(cloth: &Cloth) -> Vec<f64> {
    const PIECES: usize = 16;
    let mut out = Vec::new();
    for batch in 0..cloth.batch_count() {
        let axis = usize::from(batch < cloth.draft().unwrap().ends());
        let period = f64::from(cloth.tile().period_mm()[axis]);
        let mut pieces = [0.0; PIECES];
        cloth.for_each_in_batch(batch, &mut |s| {
            let middle = f64::from(0.5 * (s.start_mm[axis] + s.end_mm[axis])) / period;
            let piece = (middle.rem_euclid(1.0) * PIECES as f64) as usize;
            let radius = f64::from(0.5 * (s.start_radius_mm + s.end_radius_mm));
            pieces[piece.min(PIECES - 1)] += f64::from(s.length_mm()) * radius * radius;
        });
        out.extend(pieces);
    }
    out
}

fn cv(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    (square / n).sqrt() / mean
}

/// The mass of the fibres varies by as much as was asked for, and `figures` and `irregularity`
/// report it.
#[test]
fn the_mass_of_the_fibres_varies_as_asked() {
    let uneven = |percent: f64| {
        let evenness = format!("mass_cv_percent = {percent}, fibre_length_mm = 28");
        build(&irregular(
            10,
            &format!("{NO_FUZZ}evenness = {{ {evenness} }}"),
        ))
    };
    // 40 threads, which hardly vary along their 10 mm: the standard error of a coefficient of
    // variation over n values is its share 1 / sqrt(2 n), and four of them are allowed.
    let cloth = uneven(14.0);
    let from_fibres = 100.0 * cv(&masses(&cloth));
    let error = 4.0 * 14.0 / (2.0f64 * 40.0).sqrt();
    assert!(
        (from_fibres - 14.0).abs() < error,
        "{from_fibres} for 14; seed 7"
    );
    // The twin: yarn of a third of the variation.
    let twin = 100.0 * cv(&masses(&uneven(5.0)));
    assert!((twin - 14.0).abs() > error, "{twin}");
    let figures = cloth.irregularity();
    let reported = [figures.warp.unwrap(), figures.weft.unwrap()];
    let mean = 0.5 * (reported[0].mass_cv_percent + reported[1].mass_cv_percent);
    assert!(
        (mean / from_fibres - 1.0).abs() < 0.1,
        "{mean} {from_fibres}"
    );
    assert!(reported.iter().all(|r| r.twist_cv_percent > 5.0));
    let lengths = segments(&cloth).into_iter().map(|s| s.length_mm());
    let length: f64 = lengths.map(f64::from).sum();
    let counted = cloth.figures().fibre_length_mm;
    assert!((counted / length - 1.0).abs() < 0.02, "{counted} {length}");
}

/// Pieces of fibre end inside the yarn, tapered, or at the border, where others begin.
#[test]
fn irregular_fibres_continue_across_the_border_or_taper() {
    let cloth = build(&irregular(2, ALL_KINDS));
    let (mut ends, mut tapered) = (0, 0);
    for_each_strand(&cloth, |batch, strand| {
        let axis = usize::from(batch < cloth.draft().unwrap().ends());
        let period = cloth.tile().period_mm()[axis];
        let mut pieces: Vec<(Segment, Segment)> = Vec::new();
        strand.emit_fibres(&mut |s| match pieces.last_mut() {
            Some((_, last)) if last.fibre == s.fibre => {
                assert_eq!(last.end_mm, s.start_mm, "curves are unbroken");
                assert_eq!(last.end_radius_mm, s.start_radius_mm);
                *last = *s;
            }
            _ => pieces.push((*s, *s)),
        });
        let mut hairs = 0;
        strand.emit_hairs(0, &mut |s| hairs = s.fibre + 1);
        let fibres = pieces.len() - hairs as usize;
        assert!(hairs > 5 && fibres > 50);
        let border = strand.path.points.last().unwrap()[axis] as f32;
        let mut met = 0;
        for (_, last) in &pieces[..fibres] {
            if (last.end_mm[axis] - border).abs() < 0.02 && last.end_radius_mm > 0.004 {
                let wanted = last.end_mm - period * Vec3::AXES[axis];
                let meets = |p: &(Segment, Segment)| p.0.start_mm.distance(wanted) < 1e-5;
                let next = pieces.iter().find(|p| meets(p));
                let next = next.unwrap_or_else(|| panic!("{batch}: {last:?} goes nowhere"));
                assert_eq!(next.0.start_radius_mm, last.end_radius_mm);
                met += 1;
            } else {
                ends += 1;
                tapered += usize::from(last.end_radius_mm < 0.95 * last.start_radius_mm);
            }
        }
        assert!(met > 20, "{met}");
    });
    // Ends that are cut within their last step do not show that they taper.
    assert!(ends > 10 && 2 * tapered > ends, "{tapered} of {ends}");
}

#[test]
fn fibres_have_their_spread_of_radii_and_their_mass() {
    let cloth = build(&irregular(2, "fibre_radius_cv_percent = 20"));
    let mut radii = Vec::new();
    for_each_strand(&cloth, |batch, strand| {
        let pieces = strand.closure.fibres_per_ply() * strand.yarn.plies;
        let mut last = None;
        for s in segments_of(&cloth, [batch]) {
            if s.fibre < pieces && last.replace(s.fibre) != Some(s.fibre) {
                radii.push(f64::from(s.start_radius_mm));
            }
        }
    });
    // Windings share a fibre, so that of the pieces about a quarter are independent.
    let n = radii.len() as f64 / 4.0;
    let spread = 100.0 * cv(&radii);
    // Margin: four standard errors, and the steps of the radii.
    assert!(
        (spread - 20.0).abs() < 4.0 * 20.0 / (2.0 * n).sqrt() + 0.5,
        "{spread}"
    );
    let mean_square = radii.iter().map(|r| r * r).sum::<f64>() / radii.len() as f64;
    let error = 4.0 * 0.4 / n.sqrt();
    let root = mean_square.sqrt();
    assert!((root / 0.008 - 1.0).abs() < error, "{root}");
}

/// The length of fibre outside the yarn is the index times the yarn's length; the test measures
/// it by search over the whole centreline.
#[test]
fn protruding_fibres_have_their_length_outside_the_yarn_and_stay_in_reach() {
    let measured = |index: f64| {
        let fibres = "length_mm = 0.7, reach_mm = 0.25, curl_mm = 0.4, returning = 0.3";
        let hairiness = format!("hairiness = {{ index = {index}, {fibres} }}");
        let cloth = build(&irregular(4, &hairiness));
        let (mut outside, mut yarn_mm) = (0.0, 0.0);
        let mut lengths = Vec::new();
        for_each_strand(&cloth, |_, strand| {
            let path = strand.path;
            yarn_mm += path.length_mm();
            let steps = path.steps() as isize;
            let bounds = cloth.tile().bounds_mm;
            let mut last = u32::MAX;
            strand.emit_hairs(0, &mut |s| {
                assert!(s.bounds_mm().min.z >= bounds.min.z && s.bounds_mm().max.z <= bounds.max.z);
                let middle = 0.5 * (s.start_mm + s.end_mm).as_dvec3();
                let distance = |i: isize| path.offset(i, DVec2::ZERO).distance(middle);
                let by_distance = |a: &isize, b: &isize| distance(*a).total_cmp(&distance(*b));
                let nearest = (-steps..=2 * steps).min_by(by_distance).unwrap();
                let k = nearest.rem_euclid(steps) as usize;
                let from = middle - path.offset(nearest, DVec2::ZERO);
                let across = DVec2::new(from.dot(path.lateral[k]), from.dot(path.vertical[k]));
                if (across / strand.section.flatten).length() > strand.yarn.radius_mm() {
                    outside += f64::from(s.length_mm());
                    if last != s.fibre {
                        lengths.push(0.0);
                    }
                    last = s.fibre;
                    *lengths.last_mut().unwrap() += f64::from(s.length_mm());
                }
            });
        });
        let figures = cloth.irregularity();
        let reported = [figures.warp.unwrap(), figures.weft.unwrap()];
        let reported = 0.5 * (reported[0].hairiness + reported[1].hairiness);
        (outside / yarn_mm, reported, lengths)
    };
    let (index, reported, lengths) = measured(5.0);
    // Lengths are exponential: mean and deviation are equal, so the sum over n of them has the
    // relative error 1 / sqrt(n). Steps across the surface are counted to half a step.
    let error = 4.0 / (lengths.len() as f64).sqrt() + 0.03;
    assert!((index / 5.0 - 1.0).abs() < error, "{index} for 5; seed 7");
    assert!((reported / index - 1.0).abs() < 0.05, "{reported} {index}");
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    assert!((mean / 0.7 - 1.0).abs() < error, "{mean} for 0.7");
    let spread = cv(&lengths);
    // Margin: four standard errors; the deviation of exponential lengths has root two times that of their mean.
    assert!((spread - 1.0).abs() < 1.41 * error, "{spread}");
    // The twin: two fifths fewer hairs.
    let (twin, ..) = measured(3.0);
    assert!((twin / 5.0 - 1.0).abs() > error, "{twin}");
}

#[test]
fn ring_dye_leaves_the_core_pale_and_blends_have_their_shares() {
    let pale = "ring_dye = { core_colour = [0.6, 0.6, 0.5], depth = 0.4 }";
    let mut f = irregular(1, &format!("aspect = 1\n{pale}"));
    let blue = Rgb::new(0.02, 0.03, 0.1);
    f.warp.colours = vec![blue];
    let cloth = build(&f);
    let path = cloth.path(&cloth.threads[0], CurveLevel::Fibre);
    let strand = &cloth.strand(0, &path);
    let (mut core, mut rim) = (Vec::new(), Vec::new());
    let mut beside = Beside { strand, nearest: 0 };
    let fibres = strand.closure.fibres_per_ply();
    let segments_of_thread = segments_of(&cloth, [0]).into_iter();
    for s in segments_of_thread.filter(|s| s.fibre < fibres) {
        beside.search(s.start_mm.as_dvec3());
        let radii = beside.follow(s.start_mm.as_dvec3()).1;
        let colour = colour(&cloth, &s).unwrap();
        match radii {
            r if r < 0.3 => core.push(colour.0.x),
            r if r > 0.88 => rim.push(colour.0.x),
            _ => {}
        }
    }
    let counts = [core.len(), rim.len()];
    assert!(counts.iter().all(|n| *n > 50), "{counts:?}");
    assert!(core.iter().all(|&x| x > 0.55), "a core is dyed");
    assert!(rim.iter().all(|&x| x < 0.05));

    let red = Rgb::new(0.5, 0.1, 0.1);
    let blend = "blend = [{ share = 3 }, { share = 1, colour = [0.5, 0.1, 0.1] }]";
    let mut f = irregular(2, blend);
    f.warp.colours = vec![blue];
    let cloth = build(&f);
    let (mut of_red, mut all) = (0.0, 0.0);
    for s in segments(&cloth) {
        all += f64::from(s.length_mm());
        let is_red = colour(&cloth, &s) == Some(red);
        of_red += f64::from(s.length_mm()) * f64::from(u8::from(is_red));
    }
    // Four standard errors over some 8 x 40 independent fibres.
    let error = 4.0 * (0.25f64 * 0.75 / 320.0).sqrt();
    assert!((of_red / all - 0.25).abs() < error, "{}", of_red / all);
}

#[test]
fn threads_at_irregular_distances_fill_the_same_tile() {
    let mut f = fabric("plain");
    f.tile.repeats = [20, 20];
    let even = build(&f);
    f.warp.spacing_cv_percent = Some(8.0);
    let uneven = build(&f);
    assert_eq!(even.tile().period_mm(), uneven.tile().period_mm());
    let mut places: Vec<f64> = Vec::new();
    for batch in 0..40 {
        uneven
            .curves(CurveLevel::Yarn)
            .for_each_in_batch(batch, &mut |s| {
                if places.len() == batch {
                    places.push(f64::from(s.start_mm.x));
                }
            });
    }
    let gaps: Vec<f64> = places.windows(2).map(|w| w[1] - w[0]).collect();
    // Places lie in the middle of their distances, so a gap is the mean of two.
    let expected = 0.08 / 2f64.sqrt();
    assert!((cv(&gaps) / expected - 1.0).abs() < 4.0 / (2.0f64 * 39.0).sqrt());
}

const WRONG: &str = "
evenness = { mass_cv_percent = 60 } | yarn.cotton.evenness.mass_cv_percent: expected
evenness = {} | missing field `mass_cv_percent`
slubs = { per_m = 1, length_mm = [0, 1], mass = [1, 1] } | slubs.length_mm[0]
fibre_radius_cv_percent = -1 | fibre_radius_cv_percent: expected
wander = { amplitude = 2, length_mm = 1 } | wander.amplitude: expected
hairiness = { index = nan, length_mm = 1, reach_mm = 1 } | hairiness.index: expected
ring_dye = { core_colour = [2, 0, 0], depth = 0.5 } | ring_dye.core_colour: expected
blend = [{ share = 0 }] | blend[0].share: expected
";

#[test]
fn wrong_irregularity_names_its_key() {
    let check = |text: &str, expected: &str| {
        let threads = "draft.weave = 'plain'\nwarp.per_cm = 20\nweft.per_cm = 20";
        let error = match toml::from_str(&format!("{threads}\n[yarn.cotton]\n{text}")) {
            Ok(fabric) => refusal(&fabric),
            Err(e) => e.to_string(),
        };
        assert_contains(&error, expected);
    };
    table_rows(WRONG).for_each(|[text, expected]| check(text, expected));
    let hairs = "hairiness = { index = 4, length_mm = 1, reach_mm = 1 }\nhairs = { per_mm = 1 }";
    check(hairs, "hairs: give hairs or hairiness");
    let both = "blend = [{ share = 1 }]\nring_dye = { core_colour = [0, 0, 0], depth = 0.5 }";
    check(both, "ring_dye: give ring_dye or blend");
}
