//! One render in a process of its own, as a user would run it: its picture, the
//! time it took and the most memory it had.

use crate::output;
use crate::picture;
use anyhow::{Context, Result, anyhow};
use organza_measure::NoisyPicture;
use organza_scene::read;
use serde::Deserialize;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The part of `render --json` that is needed here.
#[derive(Clone, Debug, Deserialize)]
pub struct Figures {
    pub backend: String,
    pub kernel_refused: Option<String>,
    pub setup_cpu_s: f64,
    pub render_cpu_s: f64,
    pub render_s: f64,
    pub peak_memory_bytes: Option<u64>,
}

/// How a render ended.
pub enum Outcome {
    /// With a picture.
    Picture(Box<NoisyPicture>, Figures),
    /// It was refused, or failed; why.
    Refused(String),
}

/// What to render.
pub struct Trial {
    /// Name of its files.
    pub name: String,
    pub scene: PathBuf,
    /// The fabric that the scene shows.
    pub fabric: PathBuf,
    pub overrides: Vec<String>,
    pub backend: &'static str,
    pub spp: u64,
    pub seed: u64,
}

/// Runs trials and keeps what they gave, so that a bench that was broken off
/// goes on where it was.
pub struct Laboratory {
    folder: PathBuf,
    program: PathBuf,
    /// Of the program's bytes: what another build made is made again.
    digest: [u8; 32],
    threads: Option<u16>,
    max_memory_bytes: Option<u64>,
}

impl Laboratory {
    /// Results are kept in `folder`, which exists.
    ///
    /// # Errors
    /// The program does not find itself.
    pub fn new(
        folder: PathBuf,
        threads: Option<u16>,
        max_memory_bytes: Option<u64>,
    ) -> Result<Laboratory> {
        let program = std::env::current_exe().context("cannot find the program itself")?;
        let bytes = fs::read(&program).context("cannot read the program itself")?;
        Ok(Laboratory {
            folder,
            program,
            digest: Sha256::digest(bytes).into(),
            threads,
            max_memory_bytes,
        })
    }

    /// Runs a trial on a number of threads that may differ from the usual, or
    /// takes what it gave before.
    ///
    /// # Errors
    /// Files that cannot be read or written, or a program that was interrupted.
    pub fn run(&self, trial: &Trial, threads: Option<u16>) -> Result<Outcome> {
        let threads = threads.or(self.threads);
        let picture = self.folder.join(format!("{}.exr", trial.name));
        let notes = self.folder.join(format!("{}.json", trial.name));
        let mut arguments = vec![
            "render".to_owned(),
            trial.scene.display().to_string(),
            "-o".to_owned(),
            picture.display().to_string(),
            format!("--spp={}", trial.spp),
            format!("--seed={}", trial.seed),
            format!("--backend={}", trial.backend),
            "--quiet".to_owned(),
            "--json".to_owned(),
        ];
        arguments.extend(threads.map(|n| format!("--threads={n}")));
        arguments.extend(self.max_memory_bytes.map(|n| format!("--max-memory={n}")));
        arguments.extend(trial.overrides.iter().map(|o| format!("--set={o}")));
        let key = self.key(&arguments, trial)?;
        if let Some(outcome) = kept(&notes, &picture, &key) {
            return Ok(outcome);
        }
        let run = Command::new(&self.program)
            .args(&arguments)
            .output()
            .with_context(|| format!("cannot run {}", self.program.display()))?;
        let note = if run.status.success() {
            let figures: Value = serde_json::from_slice(&run.stdout)
                .context("the figures of a render are not JSON")?;
            json!({ "key": key, "arguments": arguments, "figures": figures })
        } else if run.status.code().is_some_and(|code| code <= 2) {
            let words = String::from_utf8_lossy(&run.stderr);
            let why = words.trim().trim_start_matches("organza: ");
            json!({ "key": key, "arguments": arguments, "refused": why })
        } else {
            return Err(anyhow!("{}: ended with {}", trial.name, run.status));
        };
        let text = serde_json::to_string_pretty(&note)?;
        output::write_file(&notes, |out| Ok(out.write_all(text.as_bytes())?))?;
        kept(&notes, &picture, &key).ok_or_else(|| anyhow!("{}: left no result", trial.name))
    }

    fn key(&self, arguments: &[String], trial: &Trial) -> Result<String> {
        let mut digest = Sha256::new();
        digest.update(self.digest);
        digest.update(read::text(&trial.scene)?);
        digest.update(read::text(&trial.fabric)?);
        for argument in arguments {
            digest.update(argument);
            digest.update([0]);
        }
        Ok(digest
            .finalize()
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect())
    }
}

/// What a trial of that key gave before.
fn kept(notes: &Path, picture: &Path, key: &str) -> Option<Outcome> {
    let note: Value = serde_json::from_slice(&fs::read(notes).ok()?).ok()?;
    if note.get("key")?.as_str()? != key {
        return None;
    }
    if let Some(why) = note.get("refused") {
        return Some(Outcome::Refused(why.as_str()?.to_owned()));
    }
    let figures = serde_json::from_value(note.get("figures")?.clone()).ok()?;
    let (film, _) = picture::read_exr(picture, u64::MAX).ok()?;
    Some(Outcome::Picture(
        Box::new(NoisyPicture::from(&film)),
        figures,
    ))
}
