//! A table that was made.

use super::Made;
use organza_scene::far_table;
use organza_scene::representation::ShownAs;
use organza_work::{Error, Output, Results, output};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A far-field table.
pub struct MadeTable {
    /// The file.
    pub bytes: Vec<u8>,
    /// What it was made of, and how far it is off.
    pub about: Value,
    /// Paths traced.
    pub paths: u64,
    /// How long that took.
    pub seconds: f64,
    pub(super) fabric: PathBuf,
    pub(super) shown: ShownAs,
    pub(super) made: Made,
}

impl MadeTable {
    /// Its figures, written to a file of this name.
    pub fn json(&self, path: &Path) -> Value {
        json!({
            "file": path,
            "bytes": self.bytes.len(),
            "memory_bytes": self.made.table.memory_bytes(),
            "nodes": self.made.table.rings().sphere(),
            "largest_row_error": self.made.residual,
            "paths": self.paths,
            "seconds": self.seconds,
            "about": self.about,
        })
    }

    /// What a person reads of it, written to a file of this name.
    pub fn lines(&self, path: &Path) -> Vec<String> {
        let made = &self.made;
        let mut lines = vec![
            format!(
                "{}: {} nodes, {} kB, from {} paths through {} in {:.1} s",
                path.display(),
                made.table.rings().sphere(),
                self.bytes.len() / 1000,
                self.paths,
                self.shown,
                self.seconds,
            ),
            format!(
                "{} steps of sharpening; misfit of the means {:.2} of their noise",
                made.sharpened.steps, made.sharpened.misfit
            ),
        ];
        lines.extend(made.errors.iter().map(|e| {
            let kind = json!(e.kind);
            format!(
                "{}: {} held-out pairs, error {:.1} % rms (noise taken out), {:+.1} % in sum",
                kind.as_str().unwrap_or_default().replace('_', ", "),
                e.pairs,
                100.0 * e.rms,
                100.0 * e.bias
            )
        }));
        let beside = far_table::beside(&self.fabric);
        if beside != path {
            let beside = beside.display();
            lines.push(format!("model = \"table\" looks for it as {beside}"));
        }
        lines
    }
}

impl Output for MadeTable {
    fn results(&self) -> Result<Results, Error> {
        Ok(Results {
            files: vec![("table.bsdf".to_owned(), self.bytes.clone())],
            figures: vec![("about".into(), self.about.clone())],
            ..Results::default()
        })
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        output::write_bytes(path, &self.bytes)?;
        Ok(vec![path.to_owned()])
    }
}
