//! Threads that are flat where others press on them and fuller in floats.

use super::*;
use crate::protruding::Beside;

const FLATTENED: &str = "flattening = { crossing = 1.3, float = 0.9 }";
/// Flattened yarn for weaves whose threads float over three others.
const FLOATING: &str = "aspect = 1.2\nflattening = { crossing = 1.4, float = 0.8 }";

fn woven(weave: &str, flattening: &str) -> FabricGeometry {
    fabric_of(weave, &format!("aspect = 1.5\n{flattening}"))
}

/// Share of the volume inside threads that lies inside two of them, on a grid of points.
fn shared(cloth: &Cloth) -> f64 {
    let tile = cloth.tile();
    let [low, size] = [tile.bounds_mm.min, tile.bounds_mm.size()].map(|v| v.as_dvec3());
    let counts = [96, 96, 32];
    let step = size / DVec3::new(96.0, 96.0, 32.0);
    let mut inside = vec![0u8; counts.iter().product()];
    let ends = cloth.draft().unwrap().ends();
    for (batch, thread) in cloth.threads.iter().enumerate() {
        let across = usize::from(batch >= ends);
        let path = cloth.path(thread, CurveLevel::Yarn);
        let strand = &cloth.strand(batch, &path);
        let mut beside = Beside { strand, nearest: 0 };
        for (i, inside) in inside.iter_mut().enumerate() {
            let [x, y, z] = [i / (96 * 32), i / 32 % 96, i % 32].map(|k| k as f64 + 0.5);
            let mut at = low + DVec3::new(x, y, z) * step;
            let away = at[across] - path.points[0][across];
            at[across] -= size[across] * (away / size[across]).round();
            if i % 32 == 0 {
                // The sample at the same place along the axis is near.
                let along = at[1 - across] - path.points[0][1 - across];
                let share = along / path.period.length();
                beside.nearest = (share * path.steps() as f64).round() as isize;
            }
            *inside += u8::from(beside.follow(at).1 < 1.0);
        }
    }
    let any = inside.iter().filter(|n| **n > 0).count();
    let two = inside.iter().filter(|n| **n > 1).count();
    two as f64 / any as f64
}

/// A dense twill, as denim is, and a dense plain weave.
fn dense(weave: &str, per_cm: [f64; 2], tex: f64, flattening: &str) -> FabricGeometry {
    let mut f = woven(weave, &format!("tex = {tex}\n{flattening}"));
    (f.warp.per_cm, f.weft.per_cm) = (Some(per_cm[0]), Some(per_cm[1]));
    f
}

/// Threads of constant section share up to seven per cent of their room in dense weaves.
/// Flattened ones rest on each other's surfaces: at most half of that remains.
#[test]
fn flattened_threads_share_less_room_than_threads_of_constant_section() {
    for (weave, per_cm, tex) in [
        ("twill-2-1-z", [28.0, 19.0], 59.0),
        ("plain", [24.0, 22.0], 30.0),
        ("twill-2-2", [9.0, 8.5], 230.0),
        ("satin-5-2", [60.0, 30.0], 12.0),
    ] {
        let share = |keys| shared(&build(&dense(weave, per_cm, tex, keys)));
        let (constant, flattened) = (share(""), share(FLATTENED));
        println!("{weave}: {constant:.4} of constant section, {flattened:.4} flattened");
        assert!(
            flattened < 0.5 * constant,
            "{weave}: {flattened} {constant}"
        );
    }
}

#[test]
fn flattened_threads_keep_their_area_close_and_stay_in_the_tile() {
    let mut f = fabric_of("twill-3-1", FLOATING);
    let two = format!("{FLOATING}\nplies = 2");
    f.yarn.insert("two".to_owned(), parsed(&two));
    f.weft.yarn = vec!["two".to_owned()];
    let cloth = build(&f);
    for level in [CurveLevel::Yarn, CurveLevel::Ply, CurveLevel::Fibre] {
        assert_closed(&cloth, level);
    }
    for thread in &cloth.threads {
        let (mut widest, mut narrowest) = (0.0f64, f64::INFINITY);
        for i in -50..250 {
            let s = f64::from(i) / 100.0;
            let [here, on, next] = [s, s + 1e-6, s + 1.0].map(|s| thread.section.at(s));
            assert!((here.x * here.y / thread.section.area() - 1.0).abs() < 4.0 * f64::EPSILON);
            assert!(here.distance(next) < 32.0 * f64::EPSILON, "sections repeat");
            assert!(here.distance(on) < 1e-4, "sections have no steps");
            let factor = here.x / thread.section.flatten.x;
            (widest, narrowest) = (widest.max(factor), narrowest.min(factor));
        }
        // A float of three crossings is free in its middle.
        assert!((widest - 1.4).abs() < 0.02, "{widest}");
        assert!((narrowest - 0.8).abs() < 0.02, "{narrowest}");
        let [flattest, highest] = thread.section.range();
        assert!(flattest.x >= widest * thread.section.flatten.x - 1e-12);
        assert!(highest.x <= narrowest * thread.section.flatten.x + 1e-12);
    }
    let bounds = cloth.tile().bounds_mm;
    for s in segments(&cloth) {
        let b = s.bounds_mm();
        assert!(b.min.z >= bounds.min.z && b.max.z <= bounds.max.z, "{s:?}");
    }
}

/// Fibres fill the section that the figures report: everywhere some lie at its edge and none
/// outside it.
#[test]
fn fibres_fill_the_section_of_their_place() {
    let cloth = build(&fabric_of("twill-3-1", &format!("{FLOATING}\n{NO_FUZZ}")));
    let path = cloth.path(&cloth.threads[0], CurveLevel::Fibre);
    let strand = &cloth.strand(0, &path);
    const PARTS: usize = 8;
    let mut farthest = [0.0f64; PARTS];
    let mut beside = Beside { strand, nearest: 0 };
    let mut last = None;
    strand.emit_fibres(&mut |s| {
        let at = s.start_mm.as_dvec3();
        if last.replace(s.fibre) != Some(s.fibre) {
            beside.search(at);
        }
        let radii = beside.follow(at).1;
        let share = path.arc_at(beside.nearest) / path.length_mm();
        let part = (share.rem_euclid(1.0) * PARTS as f64) as usize % PARTS;
        farthest[part] = farthest[part].max(radii);
    });
    for (part, radii) in farthest.iter().enumerate() {
        assert!((0.85..1.02).contains(radii), "{part}: {radii}");
    }
    let figures = cloth.irregularity().warp.unwrap();
    assert!(
        figures.width_mm[1] > 1.5 * figures.width_mm[0],
        "{figures:?}"
    );
    let areas = [0, 1].map(|i| figures.width_mm[i] * figures.height_mm[1 - i]);
    assert!(
        (areas[0] / areas[1] - 1.0).abs() < 4.0 * f64::EPSILON,
        "{figures:?}"
    );
}

#[test]
fn flattening_is_left_out_of_ideal_cloth_and_named_where_it_has_no_effect() {
    let mut f = woven("plain", FLATTENED);
    f.ideal = true;
    let [ideal, even] = [f, woven("plain", "")].map(|f| segments(&build(&f)));
    assert_eq!(ideal, even);
    let mut f = knit("garter");
    f.yarn = woven("plain", FLATTENED).yarn;
    assert_contains(&build(&f).warnings().join("; "), "yarn.cotton.flattening");
    let narrow = woven("plain", "flattening.crossing = 0.9\nflattening.float = 0.9");
    let expected = "yarn.cotton.flattening.crossing: expected a number from 1 to 3, found 0.9";
    assert_eq!(refusal(&narrow), expected);
}
