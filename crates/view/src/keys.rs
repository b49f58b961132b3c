//! The keys that a page may set, and what they hold. Other keys, and all names of files, are
//! out of its reach.

use crate::tables::{remove, set};
use organza_scene::InputError;
use toml_edit::{Array, DocumentMut, Value};

/// Pixels along an edge of a picture of the page at most.
pub const MAX_PIXELS: i64 = 4096;
/// Colours of a system of threads at most.
const MAX_COLOURS: usize = 256;
/// Characters of a text at most.
const MAX_CHARS: usize = 4096;
/// Words of a list at most.
const MAX_WORDS: usize = 8;

/// What a key holds.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Holds {
    /// A finite number.
    Number,
    /// A whole number of a range.
    Whole(i64, i64),
    /// So many finite numbers.
    Numbers(usize),
    /// Two whole numbers of a range.
    Size(i64, i64),
    /// Linear colours, or runs of threads by the names of colours.
    Colours,
    /// One of these words.
    Word(&'static [&'static str]),
    /// A list of these words, which may be empty.
    Words(&'static [&'static str]),
    /// `auto`, `volume`, `surface` or a level.
    Level,
}
use Holds::{Colours, Level, Number, Numbers, Size, Whole, Word, Words};

/// Keys of a scene: `#` stands for a number.
pub(crate) const SCENE_KEYS: &[(&[&str], Holds)] = &[
    (&["render", "spp"], Whole(1, 65_536)),
    (&["render", "exposure"], Number),
    (&["render", "exposure"], Word(&["auto"])),
    (&["render", "tone_mapping"], Word(&["plain", "agx", "aces"])),
    (&["render", "white_balance"], Number),
    (&["render", "white_balance"], Word(&["off", "auto"])),
    (&["render", "white_balance"], Numbers(2)),
    (&["render", "seed"], Whole(0, i64::MAX)),
    (&["render", "max_bounces"], Whole(0, 1_000_000)),
    (&["camera", "origin_mm"], Numbers(3)),
    (&["camera", "target_mm"], Numbers(3)),
    (&["camera", "up"], Numbers(3)),
    (&["camera", "width_mm"], Number),
    (&["camera", "fov_deg"], Number),
    (&["camera", "focus_mm"], Number),
    (&["camera", "f_number"], Number),
    (&["camera", "aperture_mm"], Number),
    (&["camera", "resolution"], Size(1, MAX_PIXELS)),
    (&["light", "#", "direction"], Numbers(3)),
    (&["light", "#", "irradiance"], Numbers(3)),
    (&["light", "#", "radiance"], Numbers(3)),
    (&["light", "#", "intensity"], Numbers(3)),
    (&["light", "#", "position_mm"], Numbers(3)),
    (&["light", "#", "half_angle_deg"], Number),
    (&["light", "#", "falloff_deg"], Number),
    (&["light", "#", "centre_mm"], Numbers(3)),
    (&["light", "#", "radius_mm"], Number),
    (&["light", "#", "corner_mm"], Numbers(3)),
    (&["light", "#", "edge_u_mm"], Numbers(3)),
    (&["light", "#", "edge_v_mm"], Numbers(3)),
    (&["light", "#", "scale"], Number),
    (&["light", "#", "rotation_deg"], Number),
    (
        &["light", "#", "hemisphere"],
        Word(&["all", "front", "back"]),
    ),
    (&["object", "#", "lod"], Level),
    (&["object", "#", "tolerance"], Number),
    (&["object", "#", "voxel_um"], Number),
];

const PRESETS: &[&str] = &organza_weave::preset::NAMES;

/// Keys of a fabric: `*` stands for the name of a yarn.
pub(crate) const FABRIC_KEYS: &[(&[&str], Holds)] = &[
    (&["warp", "per_cm"], Number),
    (&["weft", "per_cm"], Number),
    (&["warp", "colours"], Colours),
    (&["weft", "colours"], Colours),
    (&["draft", "wales_per_cm"], Number),
    (&["yarn", "*", "preset"], Word(PRESETS)),
    (&["yarn", "*", "tex"], Number),
    (&["yarn", "*", "plies"], Whole(1, 64)),
    (&["yarn", "*", "aspect"], Number),
    (&["yarn", "*", "fibre_radius_um"], Number),
    (&["yarn", "*", "twist", "direction"], Word(&["S", "Z"])),
    (&["yarn", "*", "twist", "turns_per_m"], Number),
    (&["yarn", "*", "twist", "angle_deg"], Number),
    (&["yarn", "*", "ply_twist", "direction"], Word(&["S", "Z"])),
    (&["yarn", "*", "ply_twist", "turns_per_m"], Number),
    (&["yarn", "*", "ply_twist", "angle_deg"], Number),
    (
        &["yarn", "*", "irregularity"],
        Word(&organza_weave::spinning::NAMES),
    ),
    (
        &["yarn", "*", "finish"],
        Words(&organza_weave::spinning::FINISHES),
    ),
    (&["pile", "height_mm"], Number),
    (&["pile", "height_cv_percent"], Number),
    (&["pile", "every"], Size(1, 1024)),
    (&["pile", "colours"], Colours),
    (&["pile", "lean_deg"], Number),
    (&["pile", "lean_direction_deg"], Number),
    (&["pile", "lean_deviation_deg"], Number),
    (&["pile", "wave"], Number),
    (&["pile", "splay"], Number),
    (&["pile", "turn_deg"], Number),
    (&["pile", "wales_per_cm"], Number),
    (&["print", "size_mm"], Numbers(2)),
    (&["print", "side"], Word(&["face", "back", "both"])),
    (
        &["print", "mode"],
        Word(&["multiply", "replace", "discharge"]),
    ),
    (&["print", "depth_um"], Number),
    (&["print", "colours"], Whole(2, 256)),
    (&["seed"], Whole(0, i64::MAX)),
    (&["tile", "repeats"], Size(1, 64)),
];

/// Keys that `null` takes out of a file: without them their default holds.
const OPTIONAL: &[&[&str]] = &[
    &["yarn", "*", "irregularity"],
    &["yarn", "*", "finish"],
    &["print", "size_mm"],
    &["print", "depth_um"],
];

/// Keys that a new value makes void: the same said in other terms.
const REPLACED: &[(&str, &str)] = &[
    ("per_cm", "spacing_mm"),
    ("turns_per_m", "angle_deg"),
    ("angle_deg", "turns_per_m"),
    ("f_number", "aperture_mm"),
    ("aperture_mm", "f_number"),
    ("tex", "fibres_per_ply"),
    ("every", "tufts_per_cm2"),
];

/// Sets one of the allowed keys, or takes out one that may be missing.
///
/// # Errors
/// Names the key, and what it holds.
pub(crate) fn set_allowed(
    document: &mut DocumentMut,
    allowed: &[(&[&str], Holds)],
    key: &[String],
    value: &serde_json::Value,
) -> Result<(), InputError> {
    let shown = key.join(".");
    let mut known = allowed.iter().filter(|(pattern, _)| matches(pattern, key));
    let Some((_, first)) = known.clone().next() else {
        let why = "this key cannot be set from the page";
        return Err(InputError::new(why).at_key(&shown));
    };
    let keys: Vec<&str> = key.iter().map(String::as_str).collect();
    if let (true, Some((last, folder))) = (value.is_null(), keys.split_last())
        && OPTIONAL.iter().any(|pattern| matches(pattern, key))
    {
        remove(document.as_table_mut(), folder, last);
        return Ok(());
    }
    let Some(value) = known.find_map(|(_, holds)| value_of(*holds, value)) else {
        let wanted = described(*first);
        return Err(InputError::new(format!("expected {wanted}, found {value}")).at_key(shown));
    };
    if let Some((last, folder)) = keys.split_last() {
        for (_, old) in REPLACED.iter().filter(|(new, _)| new == last) {
            remove(document.as_table_mut(), folder, old);
        }
    }
    set(document.as_table_mut(), &keys, value).map_err(|why| InputError::new(why).at_key(&shown))
}

fn matches(pattern: &[&str], key: &[String]) -> bool {
    let one = |(pattern, key): (&&str, &String)| match *pattern {
        "#" => key.len() < 6 && key.parse::<usize>().is_ok(),
        "*" => !key.is_empty() && key.len() <= 64,
        name => name == key,
    };
    pattern.len() == key.len() && pattern.iter().zip(key).all(one)
}

fn described(holds: Holds) -> String {
    match holds {
        Number => "a number".into(),
        Whole(least, most) => format!("a whole number from {least} to {most}"),
        Numbers(count) => format!("a list of {count} numbers"),
        Size(least, most) => format!("two whole numbers from {least} to {most}"),
        Colours => format!(
            "from 1 to {MAX_COLOURS} colours of three numbers, or text such as \"8 red, 8 blue\""
        ),
        Word(words) => format!("one of {}", words.join(", ")),
        Words(words) => format!("a list of {}", words.join(", ")),
        Level => "auto, volume, surface or a level from 0".into(),
    }
}

/// A value as TOML, if it is what a key holds.
fn value_of(holds: Holds, value: &serde_json::Value) -> Option<Value> {
    let number = |value: &serde_json::Value| value.as_f64().filter(|x| x.is_finite()).map(rounded);
    let whole = |value: &serde_json::Value, least, most| {
        value.as_i64().filter(|n| (least..=most).contains(n))
    };
    let numbers = |value: &serde_json::Value, count| {
        let list = value.as_array().filter(|list| list.len() == count)?;
        list.iter().map(number).collect::<Option<Array>>()
    };
    Some(match holds {
        Number => number(value)?.into(),
        Whole(least, most) => whole(value, least, most)?.into(),
        Numbers(count) => numbers(value, count)?.into(),
        Size(least, most) => {
            let list = value.as_array().filter(|list| list.len() == 2)?;
            let sizes = list.iter().map(|n| whole(n, least, most));
            sizes.collect::<Option<Array>>()?.into()
        }
        Colours => {
            if let Some(runs) = value.as_str() {
                let is_line = runs.len() <= MAX_CHARS && !runs.contains(char::is_control);
                return is_line.then(|| runs.into());
            }
            let list = value.as_array()?;
            if !(1..=MAX_COLOURS).contains(&list.len()) {
                return None;
            }
            let colours = list
                .iter()
                .map(|colour| Some(Value::from(numbers(colour, 3)?)));
            colours.collect::<Option<Array>>()?.into()
        }
        Word(words) => {
            let word = value.as_str().filter(|word| words.contains(word))?;
            word.into()
        }
        Words(words) => {
            let list = value.as_array().filter(|list| list.len() <= MAX_WORDS)?;
            let known = |word: &serde_json::Value| {
                let word = word.as_str().filter(|word| words.contains(word))?;
                Some(Value::from(word))
            };
            list.iter().map(known).collect::<Option<Array>>()?.into()
        }
        Level => match value.as_str() {
            Some(name @ ("auto" | "volume" | "surface")) => name.into(),
            Some(_) => return None,
            None => whole(value, 0, 255)?.into(),
        },
    })
}

/// Nine digits: what a person sets, without the noise of the page's arithmetic.
fn rounded(x: f64) -> f64 {
    format!("{x:.9e}").parse().unwrap_or(x)
}
