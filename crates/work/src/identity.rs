//! The identity of a picture, so that only samples of the same picture are put
//! together.

use crate::keys::listed;
use crate::sample_ranges::SampleRanges;
use organza_picture::Display;
use organza_scene::loader::Input;
use organza_transport::{Crop, ENGINES, Rendering};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

/// What takes the paths. Both estimate the same picture, with other random numbers. All
/// engines of the kernel draw the same numbers, so that samples of several make one
/// picture; those for processors give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// The general walk.
    Walk,
    /// The kernel.
    Kernel,
}

impl EngineKind {
    /// In words, after "of".
    pub fn description(self) -> &'static str {
        match self {
            EngineKind::Walk => "the general walk",
            EngineKind::Kernel => "the kernel",
        }
    }

    /// The engine of a back end, as pictures name it; parts of several are
    /// joined by `+`.
    pub fn of_backend(name: &str) -> EngineKind {
        match name {
            "walk" => EngineKind::Walk,
            _ => EngineKind::Kernel,
        }
    }
}

/// The engines of a picture of two parts. Those of the kernel draw the same random numbers,
/// so that parts of several may stand side by side, `avx512+gpu`; `None` for others that
/// differ.
pub fn joined_engines(a: &str, b: &str) -> Option<String> {
    if a == b {
        return Some(a.to_owned());
    }
    let names: BTreeSet<&str> = a.split('+').chain(b.split('+')).collect();
    let is_kernel = |name: &&str| ENGINES.iter().any(|engine| engine.name == *name);
    let joined = names.iter().copied().collect::<Vec<_>>().join("+");
    names.iter().all(is_kernel).then_some(joined)
}

/// An input file: its name beside the scene, and its digest in hexadecimal.
pub type NamedDigest = (String, String);

/// A picture but for its samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// The code that decides what a sample is, see [`code`](crate::version::code). In a
    /// checkpoint the head of the journal holds it.
    #[serde(skip, default = "crate::version::code")]
    pub code: String,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Pixels of the whole picture: left, top, right, bottom.
    pub crop: [u32; 4],
    /// What took the paths.
    pub engine: EngineKind,
    /// The engines that took the samples of a checkpoint, as pictures name them. They make
    /// no difference: samples of all engines of a kind make one picture.
    #[serde(default)]
    pub engines: String,
    /// The files that the scene names, in the order in which it names them.
    pub inputs: Vec<NamedDigest>,
    /// Digest of the scene, see [`scene_digest`].
    pub scene: String,
}

/// How two pictures differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Difference {
    /// Made by other code of the program.
    Code,
    /// Other random numbers.
    Seed,
    /// Other pixels.
    Crop,
    /// Another engine.
    Engine,
    /// The content of this file.
    Input(String),
    /// The scene itself.
    Scene,
}

impl Identity {
    /// The first difference, of those with the plainest words first.
    pub fn difference(&self, other: &Identity) -> Option<Difference> {
        let differ = |is_so: bool, what: Difference| is_so.then_some(what);
        differ(self.code != other.code, Difference::Code)
            .or_else(|| differ(self.seed != other.seed, Difference::Seed))
            .or_else(|| differ(self.crop != other.crop, Difference::Crop))
            .or_else(|| differ(self.engine != other.engine, Difference::Engine))
            .or_else(|| differ(self.scene != other.scene, Difference::Scene))
            .or_else(|| differing_input(&self.inputs, &other.inputs).map(Difference::Input))
    }

    /// The engines that took all samples of a rendering, those of the checkpoint that it
    /// was resumed from among them.
    pub fn all_engines(&self, rendering: &Rendering<'_>) -> String {
        let own = rendering.engine().map_or("walk", |engine| engine.name());
        match self.engines.as_str() {
            "" => own.to_owned(),
            before => joined_engines(before, own).unwrap_or_else(|| own.to_owned()),
        }
    }

    /// What a picture file records of itself.
    pub fn attributes(&self, samples: &SampleRanges) -> Vec<(&'static str, String)> {
        let inputs = serde_json::to_string(&self.inputs).unwrap_or_default();
        vec![
            ("code", self.code.clone()),
            ("identity", self.scene.clone()),
            ("inputs", inputs),
            ("seed", self.seed.to_string()),
            ("crop", listed(&self.crop)),
            ("spp", samples.count().to_string()),
            ("samples", samples.to_string()),
        ]
    }
}

/// The first file, by its place in the list, whose content differs; a list that
/// is longer differs by what it has more.
pub fn differing_input(a: &[NamedDigest], b: &[NamedDigest]) -> Option<String> {
    let pair = a.iter().zip(b).find(|(a, b)| a.1 != b.1).map(|(a, _)| a);
    let more = || a.get(b.len()).or_else(|| b.get(a.len()));
    pair.or_else(more).map(|(name, _)| name.clone())
}

/// The files that a scene or fabric names, in the order in which they were read:
/// each stands in its role, so that contents which change places are noticed.
pub fn named_inputs(file: &Path, read: &[Input]) -> Vec<NamedDigest> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let named = read.iter().filter(|input| input.path != file);
    let name = |path: &Path| {
        let beside = path.strip_prefix(folder).unwrap_or(path);
        beside.to_string_lossy().into_owned()
    };
    named.map(|i| (name(&i.path), hex(&i.digest))).collect()
}

/// Digest of everything in a scene file (after all overrides) that decides the
/// value of a sample besides the seed: all but the numbers that only say how many
/// samples to take and how to show them. `more` is what was decided elsewhere.
pub fn scene_digest(scene: &Table, more: &[String]) -> String {
    digest_without(scene, &[], more)
}

/// Digest of everything in a scene file that decides the light at its fibres: the camera and the
/// cache do not.
pub fn lit_digest(scene: &Table, more: &[String]) -> String {
    let mut scene = scene.clone();
    scene.remove("camera");
    let of_picture = [
        "clamp",
        "direct",
        "cache",
        "cache_learning",
        "cache_error",
        "cache_mib",
    ];
    digest_without(&scene, &of_picture, more)
}

/// Digest of a scene without these keys of `[render]`, nor those that decide no sample.
fn digest_without(scene: &Table, keys: &[&str], more: &[String]) -> String {
    let mut scene = scene.clone();
    if let Some(Value::Table(render)) = scene.get_mut("render") {
        let never = ["spp", "seed"].into_iter().chain(Display::KEYS);
        for key in keys.iter().copied().chain(never) {
            render.remove(key);
        }
    }
    let more = more.iter().cloned().map(Value::String).collect();
    digest(&Value::Array(vec![Value::Table(scene), Value::Array(more)]))
}

/// The digest of a scene whose samples use a cache of that digest.
pub fn with_cache(scene: &str, cache: u64) -> String {
    let both = [scene.to_owned(), format!("{cache:016x}")];
    digest(&Value::Array(both.map(Value::String).to_vec()))
}

/// Digest of a value in a form that does not depend on the order of keys or on
/// how numbers are spelled (1 or 1.0), in hexadecimal.
pub fn digest(value: &Value) -> String {
    let mut digest = Sha256::new();
    feed(value, &mut digest);
    hex(&digest.finalize())
}

fn feed(value: &Value, digest: &mut Sha256) {
    let mut text = |tag: &[u8], text: &str| {
        digest.update(tag);
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text);
    };
    match value {
        Value::String(s) => text(b"s", s),
        Value::Integer(i) if i.unsigned_abs() > 1 << 53 => text(b"i", &i.to_string()),
        Value::Integer(i) => text(b"n", &(*i as f64).to_string()),
        Value::Float(x) => text(b"n", &x.to_string()),
        Value::Boolean(b) => text(b"b", &b.to_string()),
        Value::Datetime(d) => text(b"d", &d.to_string()),
        Value::Array(list) => {
            digest.update(b"a");
            digest.update((list.len() as u64).to_le_bytes());
            list.iter().for_each(|v| feed(v, digest));
        }
        Value::Table(table) => {
            let mut keys: Vec<&String> = table.keys().collect();
            keys.sort_unstable();
            digest.update(b"t");
            digest.update((keys.len() as u64).to_le_bytes());
            for key in keys {
                digest.update((key.len() as u64).to_le_bytes());
                digest.update(key);
                feed(&table[key.as_str()], digest);
            }
        }
    }
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// The edges of a crop: left, top, right, bottom.
pub fn crop_edges(crop: Crop) -> [u32; 4] {
    let Crop { min, max } = crop;
    [min.x, min.y, max.x, max.y]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_scene_is_known_by_its_values_and_not_by_its_spelling() {
        let of = |text: &str| scene_digest(&table(text), &[]);
        let scene = "[render]\nspp = 4\nmax_bounces = 8\n[camera]\nwidth_mm = 1.0\n";
        assert_eq!(
            of(scene),
            of("[camera]\nwidth_mm = 1 # as before\n[render]\nmax_bounces = 8\nseed = 3\n")
        );
        for other in [
            "[render]\nmax_bounces = 9\n[camera]\nwidth_mm = 1.0\n",
            "[render]\nmax_bounces = 8\n[camera]\nwidth_mm = 1.5\n",
            "[render]\nmax_bounces = 8\n[camera]\nwidth_mm = '1'\n",
            "[render]\nmax_bounces = 8\n[[camera]]\nwidth_mm = 1\n",
        ] {
            assert_ne!(of(scene), of(other), "{other}");
        }
        let chosen = scene_digest(&table(scene), &["fibres".into()]);
        assert_ne!(of(scene), chosen);
    }

    #[test]
    fn contents_that_change_places_are_noticed_and_named() {
        let input = |name: &str, byte: u8| Input {
            path: format!("scenes/{name}").into(),
            digest: [byte; 32],
        };
        let scene = Path::new("scenes/a.toml");
        let of = |read: &[Input]| Identity {
            code: "0.1.0".into(),
            seed: 0,
            crop: [0, 0, 4, 4],
            engine: EngineKind::Kernel,
            engines: String::new(),
            inputs: named_inputs(scene, read),
            scene: "0".into(),
        };
        let a = of(&[input("a.toml", 9), input("x.toml", 1), input("y.toml", 2)]);
        let swapped = of(&[input("a.toml", 8), input("x.toml", 2), input("y.toml", 1)]);
        assert_eq!(a.inputs[0].0, "x.toml");
        let x = Difference::Input("x.toml".into());
        assert_eq!(a.difference(&swapped), Some(x));
        let longer = of(&[input("x.toml", 1), input("y.toml", 2), input("z.toml", 3)]);
        let z = Difference::Input("z.toml".into());
        assert_eq!(a.difference(&longer), Some(z));
        let mut walked = a.clone();
        walked.engine = EngineKind::Walk;
        walked.scene = "1".into();
        assert_eq!(a.difference(&walked), Some(Difference::Engine));
        assert_eq!(a.difference(&a.clone()), None);
    }

    #[test]
    fn parts_of_engines_of_the_kernel_join() {
        let joined = |a, b| joined_engines(a, b);
        assert_eq!(joined("walk", "walk").as_deref(), Some("walk"));
        assert_eq!(joined("avx512", "avx2").as_deref(), Some("avx2+avx512"));
        let three = joined("avx2+avx512", "scalar");
        assert_eq!(three.as_deref(), Some("avx2+avx512+scalar"));
        assert_eq!(joined("gpu+avx2", "gpu").as_deref(), Some("avx2+gpu"));
        assert_eq!(joined("walk", "avx2"), None);
        assert_eq!(joined("avx2", ""), None);
    }
}
