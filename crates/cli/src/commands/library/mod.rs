//! `organza library`

mod page;

use super::Command;
use crate::flags::{SetArgs, WorkArgs};
use crate::program;
use crate::terminal::note;
use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;
use organza_basis::Stopped;
use organza_scene::fabric_file;
use organza_scene::loader::Input;
use organza_work::building::watched;
use organza_work::{Waiting, input, of_file, of_io, output, version};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Instant;

/// `organza library`
#[derive(Debug, Args)]
#[command(
    about = "Make a library of fabrics to browse: picture, data sheet, tables and materials of each",
    after_help = "Example:\n  organza library scenes/fabrics/denim.toml scenes/fabrics/organza.toml -o library\n  organza library -o library --only swatch,sheet"
)]
pub struct LibraryArgs {
    /// Fabric files (TOML), and folders of them
    #[arg(value_name = "FABRIC", default_value = "scenes/fabrics")]
    pub fabrics: Vec<PathBuf>,
    /// Folder to write: index.html to open in a browser, and a folder for each fabric. What is there and up to date is kept
    #[arg(short, long, visible_alias = "outfile")]
    pub outdir: PathBuf,
    /// Make these parts alone
    #[arg(long, value_name = "PARTS", value_delimiter = ',', value_parser = PossibleValuesParser::new(PARTS.iter().map(|p| p.name)))]
    pub only: Vec<String>,
    /// Take few paths and texels: for a first look
    #[arg(long)]
    pub quick: bool,
    #[command(flatten)]
    pub set: SetArgs,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for LibraryArgs {
    const NAME: &'static str = "library";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// Something that is made of every fabric by another command.
struct Part {
    name: &'static str,
    /// What a reader of the page is offered.
    title: &'static str,
    /// What is made, by the place of the fabric's copy: a file or a folder.
    output: fn(&Path) -> PathBuf,
    /// The command and its flags but for fabric, output and shared flags.
    command: &'static [&'static str],
    /// Further flags, for few paths.
    quick: &'static [&'static str],
}

const PARTS: [Part; 5] = [
    Part {
        name: "sheet",
        title: "data sheet",
        output: |_| "sheet.json".into(),
        command: &["info", "--json"],
        quick: &[],
    },
    Part {
        name: "swatch",
        title: "picture",
        output: |_| "swatch.png".into(),
        command: &["render"],
        quick: &["--spp", "8", "--set", "render.cache_learning=0.2"],
    },
    Part {
        name: "table",
        title: "far-field table",
        output: |copy| copy.with_extension("bsdf"),
        command: &["table"],
        quick: &["--spp", "1024", "--held-out", "16", "--texels", "64"],
    },
    Part {
        name: "klems",
        title: "Klems matrices",
        output: |copy| Path::new(copy.file_name().unwrap_or_default()).with_extension("xml"),
        command: &["measure", "--layout", "klems"],
        quick: &["--spp", "64"],
    },
    Part {
        name: "material",
        title: "material",
        output: |_| "material".into(),
        command: &["bake"],
        quick: &["--resolution", "64", "--pairs", "64", "--spp", "256"],
    },
];

/// The data sheet is what its command prints.
const PRINTED: &str = "sheet";

/// Files of a folder that are looked at, with those below it.
const MAX_FILES: usize = 10_000;

/// A fabric of the library.
struct Entry {
    /// Its folder in the library.
    id: String,
    path: PathBuf,
    inputs: Vec<Input>,
    /// The folder that holds all its files.
    root: PathBuf,
    /// The fabric file below that folder, and in that of the library.
    copy: PathBuf,
    /// Its text where flags change it.
    changed: Option<Vec<u8>>,
}

impl Entry {
    /// A fabric that can be read.
    fn new(args: &LibraryArgs, id: String, path: PathBuf) -> Result<Entry> {
        let (fabric, inputs) = watched(&args.work.context(), |loader| {
            let fabric = fabric_file::load(&path, &args.set.set, loader)?;
            Ok((fabric, loader.inputs()))
        })?;
        let inside = |i: &&Input| i.path.starts_with(&args.outdir);
        if let Some(own) = inputs.iter().find(inside) {
            return Err(of_file(
                &own.path,
                format!(
                    "lies in the folder of the library, {}",
                    args.outdir.display()
                ),
            ));
        }
        let own = absolute(&path)?;
        let mut root = own.as_path();
        for input in &inputs {
            let place = absolute(&input.path)?;
            root = root
                .ancestors()
                .find(|a| *a != own && place.starts_with(a))
                .unwrap_or(root);
        }
        let is_changed = !args.set.set.is_empty();
        let text = fabric.sources().first().filter(|_| is_changed);
        Ok(Entry {
            copy: own.strip_prefix(root)?.to_path_buf(),
            root: root.to_path_buf(),
            changed: text.map(|t| t.bytes.clone()),
            id,
            path,
            inputs,
        })
    }
}

/// The place of a file, with the links to its folder followed.
fn absolute(path: &Path) -> Result<PathBuf> {
    let path = std::path::absolute(path)?;
    let folder = std::fs::canonicalize(path.parent().unwrap_or(&path))?;
    Ok(folder.join(path.file_name().unwrap_or_default()))
}

/// What was made of a part: `made.json` of a fabric's folder.
#[derive(Clone, Serialize, Deserialize)]
struct Made {
    /// Digest of all that it depends on.
    key: String,
    /// Why the fabric has no such part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

type Record = BTreeMap<String, Made>;

/// Runs the command.
pub fn run(args: &LibraryArgs) -> Result<()> {
    let other = ("choices.csv", "the report of a bench");
    output::check_report_folder(&args.outdir, other)?;
    let context = args.work.context();
    context.run(|| {
        let entries = entries(args)?;
        let program = program::started()?.path;
        let parts: Vec<&Part> = PARTS.iter().filter(|p| is_wanted(args, p)).collect();
        let mut failed = Vec::new();
        for (at, entry) in entries.iter().enumerate() {
            copy(args, entry)?;
            for part in &parts {
                Stopped::check(context.flow())?;
                let label = format!("{} of {}: {}", at + 1, entries.len(), entry.id);
                match make(args, &program, entry, part, &label) {
                    Ok(()) => {}
                    Err(why) => {
                        note!("organza: {}, {}: {why:#}", entry.id, part.title);
                        failed.push(format!("{} of {}", part.title, entry.id));
                    }
                }
            }
            page::write(&args.outdir, &entries)?;
        }
        if !args.work.common.quiet {
            let page = args.outdir.join("index.html");
            note!("{}: {} fabrics", page.display(), entries.len());
        }
        match failed.len() {
            0 => Ok(()),
            n => bail!("{n} parts were not made: {}", failed.join(", ")),
        }
    })?;
    Ok(())
}

fn is_wanted(args: &LibraryArgs, part: &Part) -> bool {
    args.only.is_empty() || args.only.iter().any(|name| name == part.name)
}

/// The fabrics, all of which can be read.
fn entries(args: &LibraryArgs) -> Result<Vec<Entry>> {
    let mut list: Vec<Entry> = Vec::new();
    for named in &args.fabrics {
        let found = if named.is_dir() {
            let found = fabrics_in(named)?;
            if found.is_empty() {
                let why = "holds no fabric; expected files that end in .toml";
                return Err(of_file(named, why));
            }
            found
        } else {
            let stem = named.file_stem().unwrap_or_default();
            vec![(stem.to_string_lossy().into_owned(), named.clone())]
        };
        for (id, path) in found {
            if let Some(same) = list.iter().find(|e| e.id == id) {
                return Err(input(format!(
                    "{} and {}: both would be called {id} in the library; rename one",
                    same.path.display(),
                    path.display()
                )));
            }
            list.push(Entry::new(args, id, path)?);
        }
    }
    Ok(list)
}

/// The fabric files in a folder and below, with the names that they get.
fn fabrics_in(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let fail = |path: &Path, e| of_io(path, &e);
    let (mut found, mut folders, mut count) = (Vec::new(), vec![folder.to_path_buf()], 0);
    while let Some(here) = folders.pop() {
        for entry in std::fs::read_dir(&here).map_err(|e| fail(&here, e))? {
            let path = entry.map_err(|e| fail(&here, e))?.path();
            count += 1;
            if count > MAX_FILES {
                let why = format!("holds more than {MAX_FILES} files; name a smaller folder");
                return Err(of_file(folder, why));
            }
            if path.is_dir() && !path.is_symlink() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                let below = path
                    .strip_prefix(folder)
                    .unwrap_or(&path)
                    .with_extension("");
                let words: Vec<_> = below.iter().map(|w| w.to_string_lossy()).collect();
                found.push((words.join("_"), path));
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Copies a fabric and the files that it names into the library.
fn copy(args: &LibraryArgs, entry: &Entry) -> Result<()> {
    for file in &entry.inputs {
        let below = absolute(&file.path)?;
        let below = below.strip_prefix(&entry.root)?;
        let place = args.outdir.join(&entry.id).join(below);
        let folder = place.parent().unwrap_or(&place);
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        let bytes = match &entry.changed {
            Some(text) if below == entry.copy => text.clone(),
            _ => std::fs::read(&file.path).with_context(|| file.path.display().to_string())?,
        };
        output::write_bytes(&place, &bytes)?;
    }
    Ok(())
}

/// Makes a part of a fabric, unless it is there and of the same fabric, flags and program.
fn make(args: &LibraryArgs, program: &Path, entry: &Entry, part: &Part, label: &str) -> Result<()> {
    let folder = args.outdir.join(&entry.id);
    let outfile = folder.join((part.output)(&entry.copy));
    let arguments = arguments(args, entry, part);
    let key = key(entry, &arguments);
    let mut record = read_record(&folder);
    // What was refused is tried again: memory may have been short.
    let is_there = |made: &Made| made.key == key && made.refused.is_none() && outfile.exists();
    if record.get(part.name).is_some_and(is_there) {
        return Ok(());
    }
    let started = Instant::now();
    let waiting = Waiting::new(format!("{label}: {}", part.title), &args.work.context());
    let mut child = std::process::Command::new(program);
    child.args(&arguments).arg("--quiet");
    if part.name != PRINTED {
        child.arg("-o").arg(&outfile);
    }
    // Of this key alone: a journal of other work would be refused.
    let journal = folder.join(format!("{}.journal", key.get(..16).unwrap_or(&key)));
    if part.name == "table" {
        child.arg("--journal").arg(&journal);
    }
    let ended = child
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {}", program.display()))?;
    drop(waiting);
    let said = String::from_utf8_lossy(&ended.stderr);
    let said = said.trim().trim_start_matches("organza: ").to_owned();
    let refused = match ended.status.code() {
        Some(0) => None,
        // The command does not take this fabric.
        Some(2) => Some(said),
        _ => bail!("{said}"),
    };
    if part.name == PRINTED && refused.is_none() {
        output::write_bytes(&outfile, &ended.stdout)?;
    }
    if journal.exists() && refused.is_none() {
        std::fs::remove_file(&journal)
            .with_context(|| format!("cannot remove {}", journal.display()))?;
    }
    if !args.work.common.quiet {
        let seconds = started.elapsed().as_secs_f64();
        match &refused {
            None => note!("{label}: {}, {seconds:.1} s", part.title),
            Some(why) => note!("{label}: no {}: {why}", part.title),
        }
    }
    record.insert(part.name.into(), Made { key, refused });
    let text = serde_json::to_string_pretty(&record)? + "\n";
    output::write_bytes(&record_path(&folder), text.as_bytes())
}

/// The command line of a part, without program and output.
fn arguments(args: &LibraryArgs, entry: &Entry, part: &Part) -> Vec<OsString> {
    let mut list: Vec<OsString> = part.command.iter().map(Into::into).collect();
    list.insert(1, entry.path.clone().into());
    if args.quick {
        list.extend(part.quick.iter().map(Into::into));
    }
    let mut flag = |name: &str, value: Option<OsString>| {
        if let Some(value) = value {
            list.extend([name.into(), value]);
        }
    };
    let takes_memory = part.name != PRINTED;
    let memory = args.work.memory.max_memory.filter(|_| takes_memory);
    flag("--max-memory", memory.map(|m| m.to_string().into()));
    let cache = args.work.cache.cache.clone().filter(|_| takes_memory);
    flag("--cache", cache);
    let threads = args.work.common.threads;
    flag("--threads", threads.map(|n| n.to_string().into()));
    for set in &args.set.set {
        flag("--set", Some(set.into()));
    }
    list
}

/// Digest of all that a part depends on.
fn key(entry: &Entry, arguments: &[OsString]) -> String {
    let mut digest = Sha256::new();
    digest.update(version::code());
    for argument in arguments {
        let bytes = argument.as_encoded_bytes();
        digest.update((bytes.len() as u64).to_le_bytes());
        digest.update(bytes);
    }
    for input in &entry.inputs {
        digest.update(input.digest);
    }
    let bytes = digest.finalize();
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn record_path(folder: &Path) -> PathBuf {
    folder.join("made.json")
}

/// What was made of a fabric; nothing where there is no record that can be read.
fn read_record(folder: &Path) -> Record {
    let bytes = std::fs::read(record_path(folder)).unwrap_or_default();
    serde_json::from_slice(&bytes).unwrap_or_default()
}
