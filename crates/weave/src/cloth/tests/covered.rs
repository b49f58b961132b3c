//! The share of the surface that threads cover: the figures against the fibres.

use super::*;

fn cloth(threads: &str, yarn: &str) -> Cloth {
    let text = format!(
        "[draft]\nweave = \"plain\"\n[tile]\nrepeats = [5, 5]\n[warp]\nyarn = \"y\"\nper_cm = 36\n\
         {threads}\n[weft]\nyarn = \"y\"\nper_cm = 28\n{threads}\n[yarn.y]\npreset = \"cotton\"\ntex = \
         16\n{NO_FUZZ}{yarn}\n"
    );
    build(&parsed(&text))
}

/// Cells along an edge of the tile.
const CELLS: usize = 600;

/// Share of the tile that some fibre of the batches hides, seen along its normal.
fn hidden(cloth: &Cloth, batches: std::ops::Range<usize>) -> f64 {
    let size = cloth.tile().period_mm().as_dvec2();
    let cell = size / CELLS as f64;
    let mut is_hidden = vec![false; CELLS * CELLS];
    for s in segments_of(cloth, batches) {
        let [a, b] = [s.start_mm, s.end_mm].map(|p| p.truncate().as_dvec2());
        let radius = f64::from(s.start_radius_mm);
        let low = ((a.min(b) - radius) / cell).floor();
        let high = ((a.max(b) + radius) / cell).ceil();
        let along = b - a;
        for j in low.y as i64..=high.y as i64 {
            for i in low.x as i64..=high.x as i64 {
                let at = glam::DVec2::new(i as f64 + 0.5, j as f64 + 0.5) * cell;
                let t = (at - a).dot(along) / along.length_squared().max(1e-12);
                if at.distance(a + t.clamp(0.0, 1.0) * along) < radius {
                    let wrap = |k: i64| k.rem_euclid(CELLS as i64) as usize;
                    is_hidden[wrap(j) * CELLS + wrap(i)] = true;
                }
            }
        }
    }
    is_hidden.iter().filter(|h| **h).count() as f64 / (CELLS * CELLS) as f64
}

/// Cover of warp, weft and both by the fibres, and by the figures.
fn covers(cloth: &Cloth) -> [[f64; 3]; 2] {
    let ends = cloth.draft().unwrap().ends();
    let all = cloth.batch_count();
    let fibres = [0..ends, ends..all, 0..all].map(|batches| hidden(cloth, batches));
    let figures = cloth.figures();
    let [warp, weft] = [figures.warp.unwrap(), figures.weft.unwrap()].map(|s| s.cover_factor);
    [fibres, [warp, weft, figures.cover_factor]]
}

const UNEVEN: &str = "evenness = { mass_cv_percent = 25, fibre_length_mm = 6 }\nflattening = { crossing = \
                      1.3, float = 0.9 }";
const SPACED: &str = "spacing_cv_percent = 15\nwander = { amplitude_um = 40, length_mm = 2 }";

/// Fibres hide less than the outline of their yarn, whose rim they do not fill, and the figures
/// are of outlines. By how much is the same in even and in uneven cloth, so the figures see the
/// width, the variation and the places of uneven, flattened threads.
#[test]
fn cover_is_that_of_the_fibres_but_for_the_rim_of_the_yarn() {
    let even = covers(&cloth("", ""));
    let uneven = covers(&cloth(SPACED, UNEVEN));
    println!("fibres, figures: even {even:.4?}, uneven {uneven:.4?}");
    assert!((0.85..1.0).contains(&(even[0][0] / even[1][0])), "{even:?}");
    let rim = |[fibres, figures]: [[f64; 3]; 2], k: usize| fibres[k] / figures[k];
    // Fibres are not flattened with their yarn, so the rim of wide threads is wider: 0.035 of the
    // weft's cover, whose flattened threads are the widest. Over both systems, rims that lie on
    // other threads do not count.
    for (k, error) in [0.04, 0.04, 0.01].into_iter().enumerate() {
        let off = |figure: f64| (uneven[0][k] / figure / rim(even, k) - 1.0).abs();
        let own = off(uneven[1][k]);
        assert!(own < error, "{k}: off by {own} of {error}; seed 7");
        // The twins: threads of one thickness, and gaps of warp and weft that do not know of each
        // other.
        let one_thickness = off(even[1][k]);
        assert!(one_thickness > 1.5 * error, "{k}: {one_thickness}");
        let apart = off(1.0 - (1.0 - uneven[1][0]) * (1.0 - uneven[1][1]));
        assert!(k < 2 || apart > 2.0 * error, "{apart}");
    }
}
