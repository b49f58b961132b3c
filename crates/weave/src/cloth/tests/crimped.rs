//! Crimp of fibres in the cloth: its number and size, the length that it takes, and that fibres
//! stay in their yarn and hardly overlap.

use super::*;
use glam::DVec2;

/// A loose plain weave of round, even, bulky yarn without hairs, loops and migration.
fn cloth(crimp: &str) -> Cloth {
    build(&geometry(crimp))
}

fn geometry(crimp: &str) -> FabricGeometry {
    parsed(&format!(
        "[draft]\nweave = \"plain\"\n[warp]\nyarn = \"y\"\nper_cm = 8\n[weft]\nyarn = \"y\"\nper_cm \
         = 8\n[tile]\nrepeats = [3, 3]\n[yarn.y]\npreset = \"wool\"\ntex = 50\naspect = 1\nfibre_volume_fraction = 0.3\n{NO_FUZZ}migration = \
         {{ min_fraction = 1, cycles_per_turn = 0 }}\n{crimp}\n"
    ))
}

/// Places of all pieces of fibre of a thread across it, at the samples of its path, in the round
/// section, mm.
fn places(cloth: &Cloth, batch: usize) -> Vec<Vec<DVec2>> {
    let path = cloth.path(&cloth.threads[batch], CurveLevel::Fibre);
    let strand = cloth.strand(batch, &path);
    let mut pieces: Vec<Vec<DVec2>> = Vec::new();
    let across = |i: usize, at: Vec3| {
        let k = i % path.steps();
        let from = at.as_dvec3() - path.offset(i as isize, DVec2::ZERO);
        let section = strand
            .section
            .at(path.arc_at(i as isize) / path.length_mm());
        DVec2::new(from.dot(path.lateral[k]), from.dot(path.vertical[k])) / section
    };
    let mut last = None;
    strand.emit_fibres(&mut |s| {
        if last.replace(s.fibre) != Some(s.fibre) {
            pieces.push(vec![across(0, s.start_mm)]);
        }
        let piece = pieces.last_mut().unwrap();
        piece.push(across(piece.len(), s.end_mm));
    });
    pieces
}

/// How often the distance of fibres from the yarn's axis swings to either side of its mean, per
/// centimetre, and the root mean square of the swing, mm.
fn swings(cloth: &Cloth) -> [f64; 2] {
    let (mut changes, mut along_mm, mut square, mut samples) = (0.0, 0.0, 0.0, 0.0);
    for batch in 0..cloth.batch_count() {
        let path = cloth.path(&cloth.threads[batch], CurveLevel::Fibre);
        for piece in places(cloth, batch) {
            let out: Vec<f64> = piece.iter().map(|p| p.length()).collect();
            let mean = out.iter().sum::<f64>() / out.len() as f64;
            // A swing across the axis would count twice.
            if mean < 0.4 * cloth.yarns()[0].ply_radius_mm {
                continue;
            }
            let crosses = |w: &&[f64]| (w[0] - mean) * (w[1] - mean) < 0.0;
            changes += out.windows(2).filter(crosses).count() as f64;
            square += out.iter().map(|r| (r - mean).powi(2)).sum::<f64>();
            samples += out.len() as f64;
            along_mm += path.length_mm();
        }
    }
    [5.0 * changes / along_mm, (square / samples).sqrt()]
}

/// Area that pairs of fibres share over the area of all, in the cross-sections.
fn overlap(cloth: &Cloth) -> f64 {
    let radius_mm = cloth.yarns()[0].fibre_radius_mm;
    let (mut shared, mut all) = (0.0, 0.0);
    for batch in 0..cloth.batch_count() {
        let pieces = places(cloth, batch);
        for i in (0..pieces[0].len()).step_by(5) {
            all += pieces.len() as f64;
            for (k, a) in pieces.iter().enumerate() {
                for b in &pieces[k + 1..] {
                    let half = 0.5 * a[i].distance(b[i]) / radius_mm;
                    if half < 1.0 {
                        let lens = half.acos() - half * (1.0 - half * half).sqrt();
                        shared += 2.0 * lens / std::f64::consts::PI;
                    }
                }
            }
        }
    }
    shared / all
}

const HELIX: &str = "crimp = { per_cm = 12, amplitude_um = 20 }";
const WAVE: &str = "crimp = { per_cm = 12, amplitude_um = 20, shape = \"planar\" }";

#[test]
fn fibres_have_their_crimps_inside_the_yarn() {
    let [none, helix, wave] = ["", HELIX, WAVE].map(cloth);
    for (name, cloth) in [("helix", &helix), ("wave", &wave)] {
        let [per_cm, rms_mm] = swings(cloth);
        let [.., still_mm] = swings(&none);
        println!("{name}: {per_cm:.2} per cm, {rms_mm:.4} mm, without {still_mm:.4} mm");
        // Some 25 independent fibres in each of 12 threads vary by a fifth; pushing fibres apart
        // adds and takes swings.
        assert!(
            (per_cm / 12.0 - 1.0).abs() < 0.15,
            "{name}: {per_cm}; seed 7"
        );
        // The part of the helix that points away from the axis, and its half in a wave of any
        // plane; fibres that are pushed apart, and the limit of the ply, take some of it.
        let parts = if name == "helix" { 2.0f64 } else { 4.0 };
        let expected_mm = 0.02 / parts.sqrt();
        assert!(still_mm < 4.0 * f64::from(f32::EPSILON), "{still_mm}");
        assert!(
            (rms_mm / expected_mm - 1.0).abs() < 0.2,
            "{name}: {rms_mm} for {expected_mm}"
        );
        // The twin: half as many crimps.
        let fewer = self::cloth(&HELIX.replace("12", "6"));
        assert!((swings(&fewer)[0] / 12.0 - 1.0).abs() > 0.15);
        let yarn = &cloth.yarns()[0];
        for batch in 0..cloth.batch_count() {
            let places = places(cloth, batch).into_iter().flatten();
            let out = places.map(DVec2::length);
            let most = out.fold(0.0, f64::max) + yarn.fibre_radius_mm;
            assert!(most < 1.03 * yarn.ply_radius_mm, "{name}: {most}");
        }
    }
}

/// Crimped fibres are longer, so that a yarn of the same tex has fewer; the figures say so.
#[test]
fn crimp_takes_length_that_the_figures_count() {
    let mut percents = Vec::new();
    for crimp in ["", HELIX, WAVE] {
        let cloth = cloth(crimp);
        let lengths = segments(&cloth).into_iter().map(|s| s.length_mm());
        let length: f64 = lengths.map(f64::from).sum();
        let figures = cloth.figures();
        let counted = figures.fibre_length_mm;
        println!("{crimp}: {counted} counted, {length} built");
        assert!(
            (counted / length - 1.0).abs() < 0.01,
            "{counted} {length}; seed 7"
        );
        let yarn = &cloth.yarns()[0];
        percents.push(yarn.crimp_percent());
        assert!((yarn.tex() / 50.0 - 1.0).abs() < 0.01, "{}", yarn.tex());
    }
    // A helix of 20 um and 12 turns a centimetre rises by 0.151: half of its square is 1.1 %, and
    // a variation of a fifth of both adds a twelfth; a wave has half of it.
    assert_eq!(percents[0], 0.0);
    assert!((percents[1] - 1.2).abs() < 0.15, "{percents:?}");
    assert!((percents[2] - 0.6).abs() < 0.1, "{percents:?}");
}

/// Fibres of a bulky yarn have room for crimp. In a dense one, a crimp of more than the gaps
/// between fibres makes them share room, which the page on fabrics states.
#[test]
fn crimped_fibres_hardly_overlap() {
    let [none, helix, wave] = ["", HELIX, WAVE].map(|c| overlap(&cloth(c)));
    let dense = |um: f64| {
        let keys = format!("crimp = {{ per_cm = 12, amplitude_um = {um} }}");
        let mut dense = geometry(&keys);
        let yarn = dense.yarn.get_mut("y").unwrap();
        yarn.fibre_volume_fraction = Some(0.45);
        overlap(&build(&dense))
    };
    let [fitting, excessive] = [12.0, 30.0].map(dense);
    println!(
        "overlap {none:.4} without, {helix:.4} helical, {wave:.4} planar; dense {fitting:.4}, \
         {excessive:.4}"
    );
    assert!(helix < 0.025 && wave < 0.025, "{none} {helix} {wave}");
    assert!(fitting < 0.02, "{fitting}");
    // The twin: more than there is room for.
    assert!(excessive > 0.05, "{excessive}");
}

#[test]
fn crimped_fibres_close_over_the_tile() {
    assert_closed(&cloth(HELIX), CurveLevel::Fibre);
}

const WRONG: &str = "
{ per_cm = 0, amplitude_um = 1 } | crimp.per_cm: expected a number from 0.1 to 200
{ per_cm = 5, amplitude_um = 500 } | yarn.y.crimp.amplitude_um: expected at most
{ per_cm = 5, amplitude_um = -1 } | crimp.amplitude_um: expected a number
{ per_cm = 5, amplitude_um = 1, cv_percent = 50 } | crimp.cv_percent: expected
";

#[test]
fn wrong_crimp_names_its_key() {
    for [crimp, expected] in table_rows(WRONG) {
        let error = refusal(&geometry(&format!("crimp = {crimp}")));
        assert_contains(&error, expected);
    }
    let ideal = FabricGeometry {
        ideal: true,
        ..geometry(HELIX)
    };
    assert!(build(&ideal).yarns()[0].crimp.is_none());
}
