//! A homogeneous slab of SGGX fibres, run as a scene of grid files, against the
//! BSDF that an independent renderer (Mitsuba 3.9.1, its SGGX sampler mended) and
//! a walk in double precision (`tests/peers/slab_f64.py`) computed for it: every
//! pair within 4 combined standard errors.

use crate::in_process::picture;
use crate::program::{folder, write_vol};
use std::path::Path;

const SCENE: &str = r#"
[render]
spp = 16
[camera]
kind = "orthographic"
origin_mm = [0.0, 0.0, 3.0]
target_mm = [0.0, 0.0, 0.15]
width_mm = 0.1
resolution = [48, 48]
[[light]]
kind = "directional"
direction = [0.0, 0.0, -1.0]
irradiance = [1.0, 1.0, 1.0]
[[object]]
kind = "grid"
extinction = "sigma_t.vol"
sggx = "sggx.vol"
albedo = [0.95, 0.8, 0.5]
repeat_xy = true
"#;

/// Writes the slab's grids: a few voxels, so that rays cross faces.
pub fn write_slab(folder: &Path) {
    let bounds = [-0.2, -0.2, -0.15, 0.2, 0.2, 0.15];
    write_vol(
        &folder.join("sigma_t.vol"),
        [3, 2, 12],
        1,
        bounds,
        &[20.0; 72],
    );
    let s = [0.04, 1.0, 1.0, 0.0, 0.0, 0.0];
    write_vol(&folder.join("sggx.vol"), [1, 1, 1], 6, bounds, &s);
    std::fs::write(folder.join("slab.toml"), SCENE).unwrap();
}

fn direction(theta_deg: f64, phi_deg: f64) -> [f64; 3] {
    let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
    [
        theta.sin() * phi.cos(),
        theta.sin() * phi.sin(),
        theta.cos(),
    ]
}

/// Renders the slab for one pair; the BSDF with its standard error.
fn bsdf(folder: &Path, pair: &[f64], seed: usize, integrator: &str) -> [(f64, f64); 3] {
    let w_in = direction(pair[0], pair[1]);
    let w_out = direction(pair[2], pair[3]);
    let face = 0.15f64.copysign(w_out[2]);
    let list = |v: [f64; 3]| format!("[{:.17}, {:.17}, {:.17}]", v[0], v[1], v[2]);
    let set = [
        format!("light.0.direction={}", list(w_in.map(|x| -x))),
        format!(
            "camera.origin_mm={}",
            list([3.0 * w_out[0], 3.0 * w_out[1], face + 3.0 * w_out[2]])
        ),
        format!("camera.target_mm={}", list([0.0, 0.0, face])),
        format!("render.seed={seed}"),
        format!("render.integrator={integrator}"),
    ];
    let film = picture(folder, SCENE, &set).film;
    let cos_i = w_in[2].abs();
    film.mean().map(|(mean, se)| (mean / cos_i, se / cos_i))
}

/// Rows of 16 pairs: four angles, three values, three standard errors.
fn table(text: &str) -> Vec<Vec<f64>> {
    let rows = organza_testing::csv_numbers(text);
    assert_eq!(rows.len(), 16);
    rows
}

#[test]
fn agrees_with_independent_walks_at_every_pair() {
    let folder = folder("slab");
    write_slab(&folder);
    let mitsuba = table(include_str!("data/slab_mitsuba.csv"));
    let double = table(include_str!("data/slab_f64.csv"));
    let mut twin_rejected = 0;
    for (k, (row, other)) in mitsuba.iter().zip(&double).enumerate() {
        assert_eq!(row[..4], other[..4]);
        let got = bsdf(&folder, row, 100 + k, ["woodcock", "regular"][k % 2]);
        for (row, c) in [row, other]
            .into_iter()
            .flat_map(|r| [0, 1, 2].map(|c| (r, c)))
        {
            let (value, se) = got[c];
            let distance = (value - row[4 + c]).abs() / se.hypot(row[7 + c]);
            assert!(
                distance < 4.0,
                "seed {}, pair {:?}, channel {c}: {value} +- {se} against {} ({distance:.1} standard errors)",
                100 + k,
                &row[..4],
                row[4 + c]
            );
            // The twin forgets the cosine of the incident direction.
            let forgotten = value * row[0].to_radians().cos();
            let distance = (forgotten - row[4 + c]).abs() / se.hypot(row[7 + c]);
            twin_rejected += usize::from(row[0] > 0.0 && distance > 4.0);
        }
    }
    assert!(
        twin_rejected >= 60,
        "the wrong normalisation was rejected only {twin_rejected} times"
    );
}
