//! Shades before windows: bands beyond light, the sheet of EN 14501, and fits to what a laboratory
//! measured.

use crate::program::{argv, complaint, folder, succeed};
use organza_testing::{assert_contains, sized};
use serde_json::Value;
use std::path::Path;

/// A small tile of the shipped screen.
const SCREEN: [&str; 3] = [
    concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fabrics/screen.toml"),
    "--model",
    "fibres",
];

fn json(folder: &Path, words: &[&str]) -> Value {
    let words = [words, &["--set", "tile.repeats=[1,1]", "--json", "--quiet"]].concat();
    serde_json::from_str(&succeed(folder, &words)).unwrap()
}

/// A figure of the sheet, with its standard error.
fn figure(sheet: &Value, band: &str, side: &str, quantity: &str) -> [f64; 2] {
    let rows = sheet["sheet"].as_array().unwrap();
    let found = rows
        .iter()
        .find(|r| r["band"] == band && r["side"] == side && r["quantity"] == quantity);
    let found = found.unwrap_or_else(|| panic!("{band} {side} {quantity}"));
    [&found["value"], &found["se"]].map(|v| v.as_f64().unwrap())
}

/// Under the sun a cloth is the weighted sum of what it is in light and in the near infrared; a
/// brightness of its own goes before both. The twin: light alone is neither.
#[test]
fn the_sun_is_light_and_near_infrared() {
    let folder = folder("shade-bands");
    let spp = sized(4096, 32768).to_string();
    let sheet = |more: &str| {
        let more = format!("--layout en14501 --spp {spp} {more}");
        json(&folder, &[&["measure"], &SCREEN[..], &argv(&more)].concat())
    };
    let both = sheet("--bands visible,solar");
    let nir = sheet("--bands nir --seed 5");
    let [r, se] = figure(&both, "solar", "face", "normal_reflectance");
    let [light, light_se] = figure(&both, "visible", "face", "normal_reflectance");
    let [infrared, infrared_se] = figure(&nir, "nir", "face", "normal_reflectance");
    let expected = 0.59 * light + 0.41 * infrared;
    let noise = se.hypot(0.59 * light_se).hypot(0.41 * infrared_se);
    // Grey screens have nearly the same in all channels, a hundredth apart.
    let limit = 4.0 * noise + 0.003;
    assert!(
        (r - expected).abs() < limit,
        "{r} {expected} +- {noise} (seeds 0, 5)"
    );
    assert!((r - light).abs() > limit);
    for side in ["face", "back"] {
        let of = |quantity| figure(&both, "visible", side, quantity)[0];
        let sum = of("normal_normal") + of("normal_diffuse");
        assert!((sum - of("normal_hemispherical")).abs() < 1e-6);
    }
    let classes = &both["classes"]["face"];
    for name in ["glare_control", "night_privacy", "view_out", "daylight"] {
        assert!(classes[name]["class"].as_u64().unwrap() <= 4, "{classes}");
    }
    let own = sheet("--bands solar --set optics.coated.solar.colour=0.9");
    let [bright, _] = figure(&own, "solar", "face", "normal_reflectance");
    assert!(bright > r + 0.1, "{bright} {r}");
}

#[test]
fn bands_that_cannot_be_seen_are_refused() {
    let folder = folder("shade-refusals");
    let refuse = |of: &[&str], more: &str, expected: &str| {
        let words = [&["measure"], of, &argv(more), &["-o", "no.csv", "--quiet"]].concat();
        assert_contains(&complaint(&folder, &words), expected);
        assert!(!folder.join("no.csv").exists());
    };
    let linen = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fabrics/linen.toml");
    refuse(
        &[linen],
        "--layout en14501 --bands solar",
        "--bands solar: optics.flax.solar, and optics.flax.nir as well, is missing",
    );
    refuse(
        &[linen],
        "--layout en14501 --bands nir",
        "--bands nir: optics.flax.nir is missing",
    );
    refuse(
        &[linen],
        "--layout irawan --bands visible,solar",
        "--bands: expected one band",
    );
    refuse(
        &[linen],
        "--model surface --layout irawan --bands nir",
        "has colours only",
    );
    refuse(
        &SCREEN,
        "--layout en14501 --bands nir --set optics.coated.nir.colour=2",
        ".nir.colour: expected a number from 0 to 1, found 2",
    );
}

/// A screen of other yarns is found from its reflection and transmission in light and under the
/// sun. The twin: a file whose back is half as bright again, which no plain weave has, is reported.
#[test]
#[ignore = "takes half a minute: .ci/full runs it"]
fn a_shade_is_fitted_or_the_reason_is_given() {
    let folder = folder("shade-fit");
    let spp = sized(8192, 32768).to_string();
    let share_noise = |value: f64| (value / spp.parse::<f64>().unwrap()).sqrt();
    let planted = "--set optics.coated.colour=[0.5,0.4,0.3] --set optics.coated.nir.colour=0.75 \
        --set yarn.coated.aspect=2.0 --set tile.repeats=[1,1]";
    let klems = format!("--layout klems --bands visible,solar --klems-basis quarter --spp {spp}");
    let more = format!("{klems} {planted} --seed 9 -o values.xml --quiet");
    succeed(&folder, &[&["measure"], &SCREEN[..], &argv(&more)].concat());
    let paths = sized(4096, 32768).to_string();
    let fit = |file: &str| {
        let fit = format!("fit shade --data {file} --spp {paths} -o out.toml");
        json(&folder, &[&argv(&fit)[..], &SCREEN].concat())
    };
    let answer = fit("values.xml");
    for band in answer["shade"].as_array().unwrap() {
        for value in band["beam"].as_array().unwrap() {
            let [was, is, se] = ["measured", "found", "se"].map(|k| value[k].as_f64().unwrap());
            let limit = 0.05 * was + 3.0 * se.hypot(share_noise(was));
            assert!((was - is).abs() < limit, "{band}");
        }
        let straight = &band["straight"];
        let [was, is, se] = [0, 1, 2].map(|k| straight[k].as_f64().unwrap());
        let limit = 0.05 * was + 3.0 * se.hypot(share_noise(was));
        assert!((was - is).abs() < limit, "{band}");
    }
    assert_eq!(
        answer["shade"].as_array().unwrap().len(),
        2,
        "light and sun"
    );
    let text = std::fs::read_to_string(folder.join("out.toml")).unwrap();
    assert_contains(&text, "[optics.coated_weft.solar]");

    let text = std::fs::read_to_string(folder.join("values.xml")).unwrap();
    let [before, back] = two_parts(&text, "<WavelengthDataDirection>Reflection Back<");
    let (numbers, rest) = back.split_once("</ScatteringData>").unwrap();
    let (head, numbers) = numbers.split_once("<ScatteringData>").unwrap();
    let brighter: Vec<String> = numbers
        .split(',')
        .filter_map(|v| v.trim().parse::<f64>().ok())
        .map(|v| format!("{:.6e}", 1.5 * v))
        .collect();
    let brighter = brighter.join(", ");
    let twin = format!("{before}{head}<ScatteringData>{brighter}</ScatteringData>{rest}");
    std::fs::write(folder.join("twin.xml"), twin).unwrap();
    let answer = fit("twin.xml");
    let light = &answer["shade"][0];
    assert_eq!(light["good"], false);
    let causes = light["causes"].to_string();
    assert_contains(&causes, "the sides were measured as");
}

/// A text before a mark, and the rest with it.
fn two_parts<'a>(text: &'a str, mark: &str) -> [&'a str; 2] {
    let at = text.find(mark).unwrap();
    [&text[..at], &text[at..]]
}
