//! Blends whose colours lie in tufts.

use super::irregular::irregular;
use super::*;
use std::collections::BTreeMap;

const SEED: u64 = 7;

/// A blend of which a quarter is red.
fn blended(tufts: &str) -> Cloth {
    let parts = "{ share = 3 }, { share = 1, colour = [0.5, 0.1, 0.1] }";
    let mut fabric = irregular(6, &format!("blend = [{parts}]\n{tufts}"));
    fabric.warp.colours = vec![Rgb::new(0.1, 0.1, 0.5)];
    fabric.weft.colours = vec![Rgb::new(0.1, 0.1, 0.5)];
    Cloth::build(&fabric, &no_files, SEED).unwrap()
}

fn tufts(fibres: f64, length_mm: f64) -> String {
    format!("blend_tufts = {{ fibres = {fibres}, length_mm = {length_mm} }}")
}

/// The share of length that is red, the mean length of a red stretch of a fibre, and how often the
/// fibre next to a red one is red.
fn measured(cloth: &Cloth) -> [f64; 3] {
    let (mut red, mut all, mut stretches) = (0.0, 0.0, 0.0);
    let (mut pairs, mut both) = (0.0, 0.0);
    for_each_strand(cloth, |batch, strand| {
        let strand_fibres = strand.closure.fibres_per_ply();
        let mut before: Option<(u32, bool)> = None;
        // Places of fibres in thin slices across the thread, which lies along x or y.
        let axis = usize::from(batch < cloth.draft().unwrap().ends());
        let mut slices: BTreeMap<i32, Vec<(Vec3, bool)>> = BTreeMap::new();
        let fibres = segments_of(cloth, [batch]).into_iter();
        for s in fibres.filter(|s| s.fibre < strand_fibres) {
            let is_red = colour(cloth, &s).unwrap().0.x > 0.3;
            all += f64::from(s.length_mm());
            red += f64::from(s.length_mm()) * f64::from(u8::from(is_red));
            if is_red && before != Some((s.fibre, true)) {
                stretches += 1.0;
            }
            before = Some((s.fibre, is_red));
            let number = (s.start_mm[axis] / 0.05).floor() as i32;
            if number % 8 == 0 {
                let slice = slices.entry(number).or_default();
                slice.push((s.start_mm, is_red));
            }
        }
        for slice in slices.values() {
            for (i, (at, _)) in slice.iter().enumerate().filter(|(_, p)| p.1) {
                let others = slice.iter().enumerate().filter(|(j, _)| *j != i);
                let near = others.min_by(|a, b| {
                    let away = |p: &(Vec3, bool)| p.0.distance_squared(*at);
                    away(a.1).total_cmp(&away(b.1))
                });
                if let Some((_, (_, is_red))) = near {
                    pairs += 1.0;
                    both += f64::from(u8::from(*is_red));
                }
            }
        }
    });
    [
        red / all,
        red / f64::max(stretches, 1.0),
        both / f64::max(pairs, 1.0),
    ]
}

/// Colours keep their shares, and lie together across and along the yarn as far as is asked.
#[test]
fn colours_lie_together() {
    let [share, _, together] = measured(&blended(""));
    assert!((share - 0.25).abs() < 0.03, "seed {SEED}: {share}");
    assert!(
        (together - 0.25).abs() < 0.1,
        "seed {SEED}, the twin: {together}"
    );
    let [share, length_mm, together] = measured(&blended(&tufts(12.0, 0.8)));
    // Tufts of about 0.8 mm in 24 threads of 6 mm: some 1800, of which 0.25 +- 0.01 are red.
    assert!((share - 0.25).abs() < 0.06, "seed {SEED}: {share}");
    assert!(together > 0.5, "seed {SEED}: {together}");
    // Of tufts in a row that are red by a chance of 1/4, stretches of 4/3 tufts come.
    assert!(
        (length_mm / (0.8 * 4.0 / 3.0) - 1.0).abs() < 0.25,
        "seed {SEED}: {length_mm}"
    );
    let [_, longer_mm, _] = measured(&blended(&tufts(12.0, 1.6)));
    assert!(longer_mm > 1.4 * length_mm, "seed {SEED}: {longer_mm}");
}

#[test]
fn tufts_need_a_blend_of_colours() {
    let words = "blend_tufts: expected a blend whose parts differ by colour alone";
    assert_contains(&refusal(&irregular(1, &tufts(12.0, 1.0))), words);
}
