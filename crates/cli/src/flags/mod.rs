//! Flags that several commands share. Those of a request stand beside it, in `organza-requests`; the
//! flags of one command alone in its own file below `commands`.

pub mod display;
pub mod set_help;

use crate::interrupt;
use crate::terminal::Terminal;
use clap::Args;
use organza_work::Context;
use organza_work::values::{parse_bytes, whole};
use std::ffi::OsString;
use std::sync::Arc;

/// Flags that every command takes.
#[derive(Clone, Debug, Args)]
pub struct CommonArgs {
    /// Threads to use [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=u64::from(u16::MAX)))]
    pub threads: Option<u16>,
    /// Print only errors
    #[arg(long)]
    pub quiet: bool,
}

/// Overrides of keys, of commands that are no requests.
#[derive(Clone, Debug, Args)]
pub struct SetArgs {
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// How much memory may be used.
#[derive(Clone, Debug, Default, Args)]
pub struct MemoryArgs {
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true, value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
}

/// Where results are kept from run to run.
#[derive(Clone, Debug, Default, Args)]
pub struct CacheArgs {
    /// Keep built volumes in this folder, and take them from there: a folder, "auto" (the user's cache folder) or "off" [default: the variable ORGANZA_CACHE, off without it]; see `organza cache`
    #[arg(long, value_name = "FOLDER")]
    pub cache: Option<OsString>,
}

/// What a request runs in.
#[derive(Clone, Debug, Args)]
pub struct WorkArgs {
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// The command line, for files that record how they were made.
fn command_line() -> String {
    let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    words.collect::<Vec<_>>().join(" ")
}

impl CommonArgs {
    /// Prints lines for people, unless they want none.
    pub fn note(&self, lines: impl IntoIterator<Item = impl AsRef<str>>) {
        if !self.quiet {
            for line in lines {
                crate::terminal::note!("{}", line.as_ref());
            }
        }
    }

    /// The context of the flags.
    pub fn context(&self) -> Context {
        Context {
            threads: self.threads,
            listener: Arc::new(Terminal::new(self.quiet)),
            stop: interrupt::flag(),
            keeps_stopped: true,
            command: command_line(),
            ..Context::default()
        }
    }
}

impl WorkArgs {
    /// The context of the flags.
    pub fn context(&self) -> Context {
        Context {
            max_memory_bytes: self.memory.max_memory,
            cache: self.cache.cache.clone(),
            ..self.common.context()
        }
    }

    /// See [`CommonArgs::note`].
    pub fn note(&self, lines: impl IntoIterator<Item = impl AsRef<str>>) {
        self.common.note(lines);
    }
}
