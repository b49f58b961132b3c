//! Measured values as arrays. The angles are those of tables, in degrees.

use organza_measure::{
    Albedo, Angles, KlemsBsdf, KlemsMatrix, LampAxis, Measured, PairValue, SweepValue, TensorTree,
    TexelGrid, Texture,
};
use organza_work::Results;

/// Adds polar angles and azimuths of `list` as `theta_END`, `phi_END`.
fn with_angles<T>(results: Results, end: &str, list: &[T], of: fn(&T) -> Angles) -> Results {
    let thetas = list.iter().map(|v| of(v).theta_deg).collect();
    let phis = list.iter().map(|v| of(v).phi_deg).collect();
    results
        .with_f64(&format!("theta_{end}"), &[list.len()], thetas)
        .with_f64(&format!("phi_{end}"), &[list.len()], phis)
}

/// Adds values of three channels as `name` and their standard errors as `se_NAME`.
fn with_values<T>(results: Results, name: &str, list: &[T], of: fn(&T) -> &Measured) -> Results {
    let shape = [list.len(), 3];
    let errors = format!("se_{name}");
    let means = list.iter().flat_map(|v| of(v).mean).collect();
    let ses = list.iter().flat_map(|v| of(v).se).collect();
    results
        .with_f64(name, &shape, means)
        .with_f64(&errors, &shape, ses)
}

/// Pairs of directions.
pub fn pairs(list: &[PairValue], paths: u64) -> Results {
    let results = with_angles(Results::default(), "i", list, |v| v.pair.incident);
    let results = with_angles(results, "o", list, |v| v.pair.exitant);
    with_values(results, "rgb", list, |v| &v.bsdf).with_figure("paths", paths)
}

/// Where light of single directions goes, and the openness with its standard error.
pub fn albedos(list: &[Albedo], [open, se]: [f64; 2], paths: u64) -> Results {
    let results = with_angles(Results::default(), "i", list, |v| v.incident);
    let results = with_values(results, "reflected", list, |v| &v.reflected);
    let results = with_values(results, "transmitted", list, |v| &v.transmitted);
    let results = with_values(results, "direct", list, |v| &v.direct);
    with_values(results, "absorbed", list, |v| &v.absorbed)
        .with_figure("openness", open)
        .with_figure("se_openness", se)
        .with_figure("paths", paths)
}

/// Pictures of the tile: pairs, rows, texels, channels.
pub fn textures(list: &[Texture], grid: &TexelGrid) -> Results {
    let [columns, rows] = grid.texels.to_array().map(|n| n as usize);
    let shape = [list.len(), rows, columns, 3];
    let results = with_angles(Results::default(), "i", list, |v| v.pair.incident);
    let results = with_angles(results, "o", list, |v| v.pair.exitant);
    let means = list.iter().flat_map(|t| t.mean.iter().flatten().copied());
    let ses = list.iter().flat_map(|t| t.se.iter().flatten().copied());
    results
        .with_f32("rgb", &shape, means.collect())
        .with_f32("se_rgb", &shape, ses.collect())
}

/// The matrices of the Klems basis: where light leaves, where it arrives, channels.
pub fn klems(bsdf: &KlemsBsdf, paths: u64) -> Results {
    let n = bsdf.basis.len();
    let mut results = Results::default();
    let mut add = |name: &str, matrix: &KlemsMatrix| {
        let numbers = |list: &[[f64; 3]]| list.iter().flatten().copied().collect();
        let with_means =
            std::mem::take(&mut results).with_f64(name, &[n, n, 3], numbers(&matrix.values));
        results = with_means.with_f64(&format!("se_{name}"), &[n, n, 3], numbers(&matrix.se));
    };
    let [front, back] = &bsdf.reflection;
    add("reflection_front", front);
    add("reflection_back", back);
    let [front, back] = &bsdf.transmission;
    add("transmission_front", front);
    add("transmission_back", back);
    let pairs = pairs(&bsdf.pairs(), paths);
    results.arrays.extend(pairs.arrays);
    results
        .with_figure("basis", bsdf.basis.name())
        .with_figure("paths", paths)
}

/// The cells of a tensor tree: where light arrives, where it leaves, channels.
pub fn tensor_tree(tree: &TensorTree, paths: u64) -> Results {
    let shape = [tree.layout.incident_cells(), tree.layout.exitant_cells(), 3];
    let [reflected, reflected_back] = &tree.reflection;
    let [transmitted, transmitted_back] = &tree.transmission;
    let matrices = [
        ("reflection_front", reflected),
        ("reflection_back", reflected_back),
        ("transmission_front", transmitted),
        ("transmission_back", transmitted_back),
    ];
    let mut results = Results::default();
    for (name, cells) in matrices {
        let means = cells.iter().flat_map(|cell| cell.mean).collect();
        results = results.with_f32(name, &shape, means);
    }
    results.with_figure("paths", paths)
}

/// A lamp that moves around the cloth; axis 0 is the weft, 1 the warp.
pub fn sweep(list: &[SweepValue], [front, back]: [[f64; 3]; 2]) -> Results {
    let axis = |v: &SweepValue| i32::from(v.lamp.axis == LampAxis::Warp);
    let angles = list.iter().map(|v| v.lamp.angle_deg).collect();
    let results = Results::default()
        .with_i32("axis", &[list.len()], list.iter().map(axis).collect())
        .with_f64("angle", &[list.len()], angles);
    with_values(results, "rgb", list, |v| &v.intensity)
        .with_figure("front_lit", front.to_vec())
        .with_figure("back_lit", back.to_vec())
}
