//! The data sheet of a cloth or draft, as a mill would print it: units beside figures, three digits.

use organza_basis::Rgb;
use serde_json::Value;
use std::fmt::Write;

/// A line: its label, where its figures stand in the part of the listing that its section shows, or in
/// the listing, their unit, and what they are multiplied by.
type Line = (&'static str, &'static str, &'static str, f64);

const CLOTH: &[Line] = &[
    ("weight", "areal_density_g_per_m2", "g/m2", 1.0),
    ("thickness", "thickness_mm", "mm", 1.0),
    ("covered by threads", "cover_factor", "% of the area", 100.0),
    ("open", "openness", "% of the area", 100.0),
    ("fibres", "fibre_volume_fraction", "% of the volume", 100.0),
    ("tile", "tile_mm.0 tile_mm.1", "mm", 1.0),
    ("wales", "wales_per_cm", "per cm", 1.0),
    ("loop length", "loop_length_mm", "mm", 1.0),
];

const NET: &[Line] = &[
    ("ends", "ends_per_cm", "per cm", 1.0),
    ("rows", "rows_per_cm", "per cm", 1.0),
    ("holes", "holes_per_cm2", "per cm2", 1.0),
    ("thread around a hole", "thread_per_hole_mm", "mm", 1.0),
];

const NONWOVEN: &[Line] = &[
    ("mean length of fibres", "mean_length_mm", "mm", 1.0),
    ("anisotropy", "anisotropy", "", 1.0),
    ("punches", "punches_per_cm2", "per cm2", 1.0),
    ("bonding points", "bonding_points_per_cm2", "per cm2", 1.0),
];

const PILE: &[Line] = &[
    ("weight", "areal_density_g_per_m2", "g/m2", 1.0),
    ("height", "height_mm", "mm", 1.0),
    ("tufts or loops", "tufts_per_cm2", "per cm2", 1.0),
    ("yarn in each", "yarn_per_tuft_mm", "mm", 1.0),
    ("pile ratio", "pile_ratio", "", 1.0),
];

const DRAFT: &[Line] = &[
    ("size", "ends picks", "ends x picks", 1.0),
    ("repeat", "repeat_ends repeat_picks", "ends x picks", 1.0),
    (
        "warp on the face",
        "floats.warp_share",
        "% of the crossings",
        100.0,
    ),
    (
        "longest floats on the face",
        "floats.warp_face floats.weft_face",
        "warp x weft",
        1.0,
    ),
    (
        "on the back",
        "floats.warp_back floats.weft_back",
        "warp x weft",
        1.0,
    ),
    (
        "ends and picks that bind nowhere",
        "floats.loose_ends floats.loose_picks",
        "",
        1.0,
    ),
    ("covered by threads", "cover", "% of the area", 100.0),
];

const SYNTHESIS: &[Line] = &[
    ("tile", "tile_mm.0 tile_mm.1", "mm", 1.0),
    ("size", "design.ends design.picks", "ends x picks", 1.0),
];

/// Of warp and weft, side by side: label, part of the listing, key in each, factor.
const SYSTEM: &[Line] = &[
    ("threads per cm", "figures", "threads_per_cm", 1.0),
    ("yarn count, tex", "figures", "tex", 1.0),
    ("crimp, %", "figures", "crimp_percent", 1.0),
    ("width, mm", "figures", "width_mm", 1.0),
    ("height, mm", "figures", "height_mm", 1.0),
    ("cover, %", "figures", "cover_factor", 100.0),
    (
        "bending rigidity, uN m",
        "figures",
        "bending_rigidity_un_m",
        1.0,
    ),
    ("bending length, mm", "figures", "bending_length_mm", 1.0),
    ("hairiness index", "irregularity", "hairiness", 1.0),
    (
        "variation of mass, %",
        "irregularity",
        "mass_cv_percent",
        1.0,
    ),
    (
        "variation of twist, %",
        "irregularity",
        "twist_cv_percent",
        1.0,
    ),
];

/// The sheet of what `organza info --json` says of a fabric or draft.
pub fn text(listing: &Value) -> String {
    let mut sheet = String::new();
    let name = ["name", "draft.title"].map(|path| at(listing, path).and_then(Value::as_str));
    if let Some(name) = name.into_iter().flatten().find(|name| !name.is_empty()) {
        _ = writeln!(sheet, "{name}\n");
    }
    section(&mut sheet, "Cloth", CLOTH, listing, "figures");
    systems(&mut sheet, listing);
    section(&mut sheet, "Draft", DRAFT, listing, "draft");
    section(&mut sheet, "Net", NET, listing, "figures.openwork");
    section(
        &mut sheet,
        "Nonwoven",
        NONWOVEN,
        listing,
        "figures.nonwoven",
    );
    section(&mut sheet, "Pile", PILE, listing, "figures.pile");
    yarns(&mut sheet, listing);
    section(&mut sheet, "Synthesis", SYNTHESIS, listing, "synthesis");
    for path in ["warnings", "draft.warnings"] {
        let all = at(listing, path).and_then(Value::as_array);
        let all: Vec<&str> = all.into_iter().flatten().flat_map(Value::as_str).collect();
        if !all.is_empty() {
            _ = writeln!(sheet, "Warnings\n  {}\n", all.join("\n  "));
        }
    }
    sheet.truncate(sheet.trim_end().len());
    sheet + "\n"
}

/// The value at a path of keys and numbers of elements.
fn at<'a>(value: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('.').try_fold(value, |v, key| match v {
        Value::Array(all) => all.get(key.parse::<usize>().ok()?),
        v => v.get(key),
    })
}

/// Three digits, or all of a larger whole number.
fn figure(x: f64) -> String {
    let places = match x.abs() {
        0.0 => 0,
        a => (2 - a.log10().floor() as i32).clamp(0, 9) as usize,
    };
    let text = format!("{x:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// The figures at paths; none where one is absent or all round to zero.
fn figures(
    paths: &str,
    factor: f64,
    value_at: impl Fn(&str) -> Option<f64>,
) -> Option<Vec<String>> {
    let of = |path| Some(value_at(path)? * factor);
    let all = paths.split(' ').map(of).collect::<Option<Vec<f64>>>()?;
    let is_seen = all.iter().any(|x| x.abs() > 5e-4);
    is_seen.then(|| all.into_iter().map(figure).collect())
}

fn section(sheet: &mut String, heading: &str, lines: &[Line], listing: &Value, part: &str) {
    let shown = at(listing, part).unwrap_or(&Value::Null);
    let value_at = |path: &str| at(shown, path).or_else(|| at(listing, path))?.as_f64();
    let known = lines.iter().filter_map(|(label, paths, unit, factor)| {
        let all = figures(paths, *factor, value_at)?;
        Some(format!("  {label:34}{} {unit}", all.join(" x ")))
    });
    let known: Vec<String> = known.map(|line| line.trim_end().to_string()).collect();
    if !known.is_empty() {
        _ = writeln!(sheet, "{heading}\n{}\n", known.join("\n"));
    }
}

fn systems(sheet: &mut String, listing: &Value) {
    let lines = SYSTEM.iter().filter_map(|(label, part, key, factor)| {
        let all = ["warp", "weft"].map(|system| {
            let value_at = |key: &str| at(listing, &format!("{part}.{system}.{key}"))?.as_f64();
            figures(key, *factor, value_at)
        });
        if all.iter().all(Option::is_none) {
            return None;
        }
        let [warp, weft] = all.map(|f| f.map_or("-".into(), |f| f.concat()));
        Some(format!("  {label:34}{warp:10}{weft}"))
    });
    let lines: Vec<String> = lines.collect();
    if !lines.is_empty() {
        _ = writeln!(
            sheet,
            "{:36}{:10}weft\n{}\n",
            "Threads",
            "warp",
            lines.join("\n")
        );
    }
}

/// Yarns with what they are spun from.
fn yarns(sheet: &mut String, listing: &Value) {
    let all = |key: &str| listing[key].as_array().cloned().unwrap_or_default();
    let materials = all("materials");
    for (n, yarn) in all("yarns").iter().enumerate() {
        let number = |key: &str| yarn.get(key).and_then(Value::as_f64);
        let text = |value: &Value, key: &str| value[key].as_str().unwrap_or_default().to_string();
        let name = text(yarn, "name");
        if n == 0 {
            sheet.push_str("Yarns\n");
        }
        if let Some(tex) = number("tex").filter(|tex| *tex > 0.0) {
            // English cotton count: hanks of 840 yards in a pound.
            let count = 590.54 / tex;
            let (tex, count) = (figure(tex), figure(count));
            _ = write!(sheet, "  {name:34}{tex} tex (Ne {count})");
        } else {
            _ = write!(sheet, "  {name:34}");
        }
        if let Some(radius) = number("radius_mm") {
            _ = write!(sheet, ", {} mm thick", figure(2.0 * radius));
        }
        if let Some(packing) = number("fibre_volume_fraction") {
            _ = write!(sheet, ", {} % fibres", figure(100.0 * packing));
        }
        sheet.push('\n');
        for material in materials.iter().filter(|m| text(m, "yarn") == name) {
            let radius = material.get("fibre_radius_um").and_then(Value::as_f64);
            let colour: Vec<f64> = (0..3)
                .filter_map(|c| at(material, &format!("colour.{c}"))?.as_f64())
                .collect();
            let fibre = text(material, "fibre");
            let fibre = if fibre.is_empty() { "fibres" } else { &fibre };
            _ = write!(sheet, "    {fibre}");
            if let Some(radius) = radius {
                _ = write!(sheet, " {} um thick", figure(2.0 * radius));
            }
            if colour.len() == 3 {
                let code = |x: &f64| format!("{:02x}", Rgb::srgb8(*x as f32));
                _ = write!(
                    sheet,
                    ", dyed #{}",
                    colour.iter().map(code).collect::<String>()
                );
            }
            sheet.push('\n');
        }
    }
    if !all("yarns").is_empty() {
        sheet.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn figures_have_three_digits_and_units() {
        let rounded = [
            0.0,
            0.000_123_4,
            0.520_737,
            9.358_8,
            58.893,
            302.69,
            12_345.6,
        ]
        .map(figure);
        assert_eq!(
            rounded,
            ["0", "0.000123", "0.521", "9.36", "58.9", "303", "12346"]
        );
        let sheet = text(&json!({
            "name": "twill",
            "openness": 0.0,
            "figures": {
                "areal_density_g_per_m2": 302.69,
                "tile_mm": [1.0714, 1.579],
                "warp": { "tex": 58.9 },
            },
            "yarns": [{ "name": "warp", "tex": 59.054, "radius_mm": 0.14 }],
            "materials": [{ "yarn": "warp", "fibre_radius_um": 8.0, "colour": [0.0, 1.0, 0.5] }],
        }));
        for line in [
            "twill\n",
            "  weight                            303 g/m2\n",
            "  tile                              1.07 x 1.58 mm\n",
            "  yarn count, tex                   58.9      -\n",
            "59.1 tex (Ne 10), 0.28 mm thick\n",
            "    fibres 16 um thick, dyed #00ffbc\n",
        ] {
            assert!(sheet.contains(line), "{line}\n{sheet}");
        }
        assert!(!sheet.contains("open"), "{sheet}");
    }
}
