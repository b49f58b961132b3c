//! What was measured.

use anyhow::Result;
use organza_scene::representation::ShownAs;
use organza_work::output::{self as files, SeekWrite};
use organza_work::{Error, Output, Results};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Measured values of one kind.
pub trait Values: Send + Sync {
    /// What they are, in figures.
    fn what(&self) -> &'static str;

    /// As arrays and figures, with the number of paths.
    fn results(&self, paths: u64) -> Results;

    /// Writes a file of an ending other than `.json`.
    ///
    /// # Errors
    /// The output fails.
    fn write(&self, ending: &str, out: &mut dyn SeekWrite) -> Result<()>;

    /// All of them as JSON.
    fn list(&self) -> Value {
        Value::Null
    }

    /// Single figures of them.
    fn extra(&self) -> Vec<(&'static str, Value)> {
        Vec::new()
    }

    /// What a person reads of them.
    fn line(&self) -> Option<String> {
        None
    }

    /// Pairs without light in any path, of how many.
    fn dark(&self, shown: Option<ShownAs>) -> [usize; 2] {
        let _ = shown;
        [0, 0]
    }
}

/// What was measured of a patch.
pub struct Measurement {
    /// The values.
    pub values: Box<dyn Values>,
    /// Paths traced.
    pub paths: u64,
    /// See [`organza_measure::Results::heavy_tails`].
    pub heavy_tails: usize,
    /// How many directions or pairs.
    pub count: usize,
    /// How long it took.
    pub seconds: f64,
    /// Pairs without light in any path, of how many.
    pub dark: [usize; 2],
    /// The file that was measured.
    pub file: PathBuf,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The representation that was measured.
    pub model: &'static str,
}

/// The ending of a path in lower case.
pub(super) fn ending_of(path: &Path) -> String {
    let ending = path.extension().unwrap_or_default();
    ending.to_string_lossy().to_lowercase()
}

impl Measurement {
    /// Everything as JSON.
    pub fn json(&self) -> Value {
        let mut map = Map::new();
        let mut put = |key: &str, value: Value| map.insert(key.into(), value);
        put("file", json!(self.file));
        put("model", json!(self.model));
        put("seed", json!(self.seed));
        put("paths", json!(self.paths));
        put("seconds", json!(self.seconds));
        put("heavy_tails", json!(self.heavy_tails));
        put(self.values.what(), self.values.list());
        for (key, value) in self.values.extra() {
            put(key, value);
        }
        Value::Object(map)
    }

    /// What a person reads of it.
    pub fn lines(&self) -> Vec<String> {
        let (count, paths, seconds) = (self.count, self.paths, self.seconds);
        let mut lines = vec![format!(
            "{}: {count} {}, {paths} paths in {seconds:.1} s ({:.2} M paths/s)",
            self.file.display(),
            match self.values.what() {
                "pairs" => "pairs",
                _ => "directions",
            },
            paths as f64 / seconds.max(1e-9) * 1e-6,
        )];
        lines.extend(self.values.line());
        lines
    }

    /// What makes its errors doubtful, without the file's name.
    pub fn warning(&self) -> Option<String> {
        (self.heavy_tails > 0).then(|| {
            format!(
                "{}: in {} of {} one path carries more than a quarter of the squares, so that \
                 standard errors are too small; more --spp helps",
                self.file.display(),
                self.heavy_tails,
                self.count
            )
        })
    }

    /// A line about pairs that are not known.
    pub fn dark_line(&self) -> Option<String> {
        let [dark, pairs] = self.dark;
        (dark > 0).then(|| {
            format!(
                "{dark} of {pairs} pairs met no light in any path: their value 0 +- 0 is not \
                 exact, its error is not known; more --spp helps"
            )
        })
    }
}

impl Output for Measurement {
    fn results(&self) -> Result<Results, Error> {
        Ok(self.values.results(self.paths))
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let ending = ending_of(path);
        files::write_file(path, |out| match &*ending {
            "json" => {
                let text = serde_json::to_string_pretty(&self.json())?;
                Ok(out.write_all(text.as_bytes())?)
            }
            _ => self.values.write(&ending, out),
        })?;
        Ok(vec![path.to_owned()])
    }
}
