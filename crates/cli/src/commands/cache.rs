//! `organza cache`

use super::Command;
use crate::terminal;
use anyhow::{Context, Result};
use clap::{ArgGroup, Args, Subcommand};
use organza_cache::{Cache, Entry, Removed};
use organza_work::result_cache;
use organza_work::values::{parse_bytes, parse_duration};
use serde_json::json;
use std::time::{Duration, SystemTime};

/// `organza cache`
#[derive(Debug, Args)]
#[command(
    about = "List the results that are kept from run to run, or remove them",
    after_help = "Examples:\n  organza cache\n  organza cache clean --older-than 30d",
    args_conflicts_with_subcommands = true
)]
pub struct CacheCommand {
    #[command(subcommand)]
    clean: Option<Action>,
    #[command(flatten)]
    list: ListArgs,
}

#[derive(Debug, Args)]
struct ListArgs {
    /// Print the entries as JSON
    #[arg(long)]
    json: bool,
    /// The cache: a folder, or "auto" (the user's cache folder) [default: the variable ORGANZA_CACHE, auto without it]
    #[arg(long, value_name = "FOLDER")]
    cache: Option<std::ffi::OsString>,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Remove entries
    Clean(CleanArgs),
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza cache clean --older-than 30d --cache /tmp/organza_cache",
    group = ArgGroup::new("which").required(true)
)]
struct CleanArgs {
    /// Remove the entries that were not used for this time, e.g. 30d, 12h
    #[arg(long, group = "which", value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration)]
    older_than: Option<Duration>,
    /// Remove entries until the others take at most this size, e.g. 2GiB; those first that were not used for the longest time
    #[arg(long, group = "which", value_name = "SIZE", allow_hyphen_values = true, value_parser = parse_bytes)]
    to: Option<u64>,
    /// Remove all entries
    #[arg(long, group = "which")]
    all: bool,
    /// The cache: a folder, or "auto" (the user's cache folder) [default: the variable ORGANZA_CACHE, auto without it]
    #[arg(long, value_name = "FOLDER")]
    cache: Option<std::ffi::OsString>,
}

impl Command for CacheCommand {
    const NAME: &'static str = "cache";

    fn run(&self) -> Result<()> {
        match &self.clean {
            Some(Action::Clean(args)) => clean(args),
            None => list(&self.list),
        }
    }
}

/// The cache that a flag or the environment names.
fn cache(flag: Option<&std::ffi::OsString>) -> Result<Cache> {
    result_cache::to_look_at(flag.map(std::ffi::OsString::as_os_str))
}

fn list(args: &ListArgs) -> Result<()> {
    let cache = cache(args.cache.as_ref())?;
    let entries = entries(&cache)?;
    let now = SystemTime::now();
    match args.json {
        true => terminal::print_json(&as_json(&cache, &entries, now)),
        false => terminal::print(&as_table(&cache, &entries, now)),
    }
}

fn entries(cache: &Cache) -> Result<Vec<Entry>> {
    let name = || format!("cannot read {}", result_cache::name(cache));
    cache.entries().with_context(name)
}

/// Seconds since the last use; 0 where the clock was set back.
fn age_s(entry: &Entry, now: SystemTime) -> u64 {
    now.duration_since(entry.used).unwrap_or_default().as_secs()
}

fn as_json(cache: &Cache, entries: &[Entry], now: SystemTime) -> serde_json::Value {
    let list: Vec<_> = entries
        .iter()
        .map(|entry| {
            json!({
                "key": entry.key.to_string(),
                "bytes": entry.bytes,
                "unused_s": age_s(entry, now),
                "about": entry.description(),
            })
        })
        .collect();
    json!({
        "folder": result_cache::name(cache),
        "bytes": entries.iter().map(|e| e.bytes).sum::<u64>(),
        "limit_bytes": cache.limit_bytes(),
        "entries": list,
    })
}

fn as_table(cache: &Cache, entries: &[Entry], now: SystemTime) -> String {
    let bytes = entries.iter().map(|e| e.bytes).sum();
    let mut text = format!(
        "{}: {}, {} of at most {}\n",
        result_cache::name(cache),
        count(entries.len()),
        size(bytes),
        size(cache.limit_bytes())
    );
    for entry in entries {
        let (size, age) = (size(entry.bytes), age(age_s(entry, now)));
        text += &match entry.description() {
            Some(about) => format!(
                "{size:>10}  used {age:<12}  {}  {} ({})\n",
                about.kind, about.name, about.details
            ),
            None => format!("{size:>10}  used {age:<12}  damaged\n"),
        };
    }
    text
}

fn clean(args: &CleanArgs) -> Result<()> {
    let cache = cache(args.cache.as_ref())?;
    let removed = match (args.older_than, args.to, args.all) {
        (Some(time), ..) => {
            let since = SystemTime::now().checked_sub(time);
            cache.remove_older(since.unwrap_or(SystemTime::UNIX_EPOCH))
        }
        (None, Some(bytes), _) => cache.remove_above(bytes),
        (None, None, true) => cache.remove_above(0),
        (None, None, false) => Ok(Removed::default()),
    };
    let name = || format!("cannot clean {}", result_cache::name(&cache));
    let removed = removed.with_context(name)?;
    let left = entries(&cache)?;
    terminal::print(&format!(
        "{}: removed {} of {}; {} of {} left\n",
        result_cache::name(&cache),
        count(removed.entries),
        size(removed.bytes),
        count(left.len()),
        size(left.iter().map(|e| e.bytes).sum())
    ))
}

fn count(entries: usize) -> String {
    match entries {
        0 => "no entries".into(),
        1 => "1 entry".into(),
        n => format!("{n} entries"),
    }
}

/// Bytes in the unit that fits.
fn size(bytes: u64) -> String {
    let units = [(1u64 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
    let unit = units.iter().find(|(unit, _)| bytes >= *unit);
    match unit {
        Some((unit, name)) => format!("{:.1} {name}", bytes as f64 / *unit as f64),
        None => format!("{bytes} B"),
    }
}

/// A time in the unit that fits.
fn age(seconds: u64) -> String {
    let units = [(86400, "d"), (3600, "h"), (60, "min")];
    match units.iter().find(|(unit, _)| seconds >= *unit) {
        Some((unit, name)) => format!("{} {name} ago", seconds / unit),
        None => "just now".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_have_the_unit_that_fits() {
        let sizes = [0, 1023, 1024, 5 << 20, 10 << 30].map(size);
        assert_eq!(sizes, ["0 B", "1023 B", "1.0 KiB", "5.0 MiB", "10.0 GiB"]);
        let ages = [0, 59, 60, 7300, 200_000].map(age);
        assert_eq!(
            ages,
            ["just now", "just now", "1 min ago", "2 h ago", "2 d ago"]
        );
    }
}
