//! One render in a separate process, as a user would run it: its picture, its time and its peak
//! memory.

use crate::ReportError;
use crate::write_file::WriteFile;
use organza_measure::NoisyPicture;
use organza_picture::exr;
use organza_scene::read;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The part of the output of `render --json` that is needed here.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Figures {
    pub backend: String,
    pub kernel_refused: Option<String>,
    pub setup_cpu_s: f64,
    /// Of `render_cpu_s`, before the first sample.
    pub prepare_cpu_s: f64,
    pub render_cpu_s: f64,
    pub render_s: f64,
    pub peak_memory_bytes: Option<u64>,
}

/// How a render ended.
pub(super) enum Outcome {
    /// It made a picture.
    Picture(Box<NoisyPicture>, Figures),
    /// It was refused or failed, with the reason.
    Refused(String),
}

/// What to render.
pub(super) struct Trial {
    /// Base name of its files.
    pub name: String,
    pub scene: PathBuf,
    /// The fabric that the scene shows.
    pub fabric: PathBuf,
    pub overrides: Vec<String>,
    /// The part of the picture that is rendered, if not all of it: left, top, right, bottom.
    pub crop: Option<[u32; 4]>,
    pub backend: &'static str,
    pub spp: u64,
    pub seed: u64,
}

/// The program that renders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    /// What is started.
    pub path: PathBuf,
    /// The file that its code is in, if that is another one.
    pub code: PathBuf,
}

impl Program {
    /// The program that runs.
    ///
    /// # Errors
    /// When it cannot find its own file.
    pub fn this() -> Result<Program, ReportError> {
        let path = std::env::current_exe().map_err(unreadable)?;
        let code = path.clone();
        Ok(Program { path, code })
    }
}

fn unreadable(e: std::io::Error) -> ReportError {
    ReportError::Run(format!("cannot read the program: {e}"))
}

/// Runs trials and keeps their results, so that an interrupted bench can be resumed.
pub struct Laboratory<'a> {
    write_file: WriteFile<'a>,
    folder: PathBuf,
    program: PathBuf,
    /// Digest of the program: results of another build are not used.
    digest: [u8; 32],
    threads: Option<u16>,
    max_memory_bytes: Option<u64>,
}

/// The stored result of a trial.
#[derive(Serialize, Deserialize)]
struct Note {
    arguments: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    figures: Option<Value>,
    /// Digest of everything that the result depends on.
    key: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

impl<'a> Laboratory<'a> {
    /// Results are kept in `folder`, which must exist.
    ///
    /// # Errors
    /// When the file of the program cannot be read.
    pub fn new(
        write_file: WriteFile<'a>,
        folder: PathBuf,
        program: Program,
        threads: Option<u16>,
        max_memory_bytes: Option<u64>,
    ) -> Result<Laboratory<'a>, ReportError> {
        let bytes = fs::read(&program.code).map_err(unreadable)?;
        Ok(Laboratory {
            write_file,
            folder,
            program: program.path,
            digest: Sha256::digest(bytes).into(),
            threads,
            max_memory_bytes,
        })
    }

    /// Writes a file of the bench.
    ///
    /// # Errors
    /// Names the file.
    pub(super) fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
        (self.write_file)(path, bytes).map_err(ReportError::Write)
    }

    /// Runs a trial on a number of threads that may differ from the usual one, or reads
    /// its earlier result.
    ///
    /// # Errors
    /// Files that cannot be read or written, or a program that was interrupted.
    pub(super) fn run(&self, trial: &Trial, threads: Option<u16>) -> Result<Outcome, ReportError> {
        let picture = self.folder.join(format!("{}.exr", trial.name));
        let notes = self.folder.join(format!("{}.json", trial.name));
        let arguments = self.arguments(trial, &picture, threads.or(self.threads));
        let key = self.key(&arguments, trial)?;
        if let Some(outcome) = kept(&notes, &picture, &key) {
            return Ok(outcome);
        }
        let run = Command::new(&self.program)
            .args(&arguments)
            .env_remove("ORGANZA_CACHE") // building counts
            .output()
            .map_err(|e| ReportError::Run(format!("cannot run {}: {e}", self.program.display())))?;
        let mut note = Note {
            arguments,
            figures: None,
            key,
            refused: None,
        };
        if run.status.success() {
            note.figures = Some(serde_json::from_slice(&run.stdout)?);
        } else if run.status.code().is_some_and(|code| code <= 2) {
            let words = String::from_utf8_lossy(&run.stderr);
            let why = words.trim().trim_start_matches("organza: ");
            note.refused = Some(why.to_owned());
        } else {
            let how = run.status;
            return Err(ReportError::Run(format!(
                "{}: ended with {how}",
                trial.name
            )));
        }
        self.write(&notes, serde_json::to_string_pretty(&note)?.as_bytes())?;
        kept(&notes, &picture, &note.key)
            .ok_or_else(|| ReportError::Run(format!("{}: left no result", trial.name)))
    }

    fn arguments(&self, trial: &Trial, picture: &Path, threads: Option<u16>) -> Vec<String> {
        let mut arguments = vec![
            "render".to_owned(),
            trial.scene.display().to_string(),
            "-o".to_owned(),
            picture.display().to_string(),
            format!("--spp={}", trial.spp),
            format!("--seed={}", trial.seed),
            format!("--engine={}", trial.backend),
            "--quiet".to_owned(),
            "--json".to_owned(),
        ];
        arguments.extend(trial.crop.map(|c| {
            let [left, top, right, bottom] = c;
            format!("--crop={left},{top},{right},{bottom}")
        }));
        arguments.extend(threads.map(|n| format!("--threads={n}")));
        arguments.extend(self.max_memory_bytes.map(|n| format!("--max-memory={n}")));
        arguments.extend(trial.overrides.iter().map(|o| format!("--set={o}")));
        arguments
    }

    fn key(&self, arguments: &[String], trial: &Trial) -> Result<String, ReportError> {
        let mut digest = Sha256::new();
        digest.update(self.digest);
        digest.update(read::text(&trial.scene)?);
        digest.update(read::text(&trial.fabric)?);
        for argument in arguments {
            digest.update(argument);
            digest.update([0]);
        }
        let mut key = String::new();
        for byte in digest.finalize() {
            let _ = write!(key, "{byte:02x}");
        }
        Ok(key)
    }
}

/// The earlier result of a trial with that key.
fn kept(notes: &Path, picture: &Path, key: &str) -> Option<Outcome> {
    let note: Note = serde_json::from_slice(&fs::read(notes).ok()?).ok()?;
    if note.key != key {
        return None;
    }
    if let Some(why) = note.refused {
        return Some(Outcome::Refused(why));
    }
    let figures = serde_json::from_value(note.figures?).ok()?;
    let (film, _) = exr::read_film(&fs::read(picture).ok()?, u64::MAX).ok()?;
    let picture = NoisyPicture::from(&film);
    Some(Outcome::Picture(Box::new(picture), figures))
}
