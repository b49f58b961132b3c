//! The fibres of the shipped fabrics are what they were when they were measured: records in
//! `benches/runs` hold as long as this test passes.
#![allow(clippy::disallowed_methods)]

use super::*;
use std::path::Path;

/// Number of fibre segments, their length in mm, and the mean of `x + 2 y + 3 z + 4 z^2` over
/// their starts: of commit `66e07b1`.
const FIBRES: [(&str, usize, f64, f64); 13] = [
    ("basket", 41_921, 1_943.140_644, 4.220_890_98),
    ("charmeuse", 10_500, 165.045_246, 1.440_242_95),
    ("cotton_twill", 58_724, 1_297.336_871, 2.656_380_84),
    ("denim", 68_993, 1_715.386_019, 2.545_601_26),
    ("first_light", 169_728, 3_022.483_723, 5.329_288_01),
    ("jersey", 24_070, 770.273_292, 1.789_330_03),
    ("linen", 54_841, 1_899.346_326, 3.487_151_73),
    ("organza", 39_936, 812.721_193, 2.957_139_15),
    ("polyester_lining", 46_080, 1_240.786_885, 3.337_315_45),
    ("silk_shantung", 56_896, 1_305.098_721, 2.532_248_69),
    ("towel", 111_101, 3_427.792_166, 3.705_230_12),
    ("wool_gabardine", 20_317, 474.715_662, 1.867_994_78),
    ("wool_tweed", 317_997, 18_843.023_848, 11.737_320_71),
];

#[test]
fn the_fibres_of_the_shipped_fabrics_have_not_changed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/fabrics");
    for (name, count, length_mm, place) in FIBRES {
        let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
        let mut table: toml::Table = text.parse().unwrap();
        let seed = table.get("seed").map_or(0, |s| s.as_integer().unwrap());
        const GEOMETRY: [&str; 6] = ["draft", "warp", "weft", "yarn", "relaxation", "tile"];
        table.retain(|key, _| GEOMETRY.contains(&key));
        let fabric: FabricGeometry = table.try_into().unwrap();
        let load = |file: &str| std::fs::read(folder.join(file));
        let cloth = Cloth::build(&fabric, &load, seed as u64).unwrap();
        let (all, mut length, mut sum) = (segments(&cloth), 0.0, 0.0);
        for s in &all {
            let at = s.start_mm.as_dvec3();
            length += f64::from(s.length_mm());
            sum += at.dot(DVec3::new(1.0, 2.0, 3.0)) + 4.0 * at.z * at.z;
        }
        let mean = sum / all.len() as f64;
        assert_eq!(all.len(), count, "{name}");
        // Summing and the functions of the platform differ by less.
        assert!(
            (length / length_mm - 1.0).abs() < 4.0 * f64::from(f32::EPSILON),
            "{name}: {length}"
        );
        assert!(
            (mean - place).abs() < 4.0 * f64::from(f32::EPSILON),
            "{name}: {mean}"
        );
    }
}
