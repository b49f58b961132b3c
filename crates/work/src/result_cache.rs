//! Which cache is in use: the flag `--cache`, or the variables `ORGANZA_CACHE` and
//! `ORGANZA_CACHE_LIMIT`.

use crate::error::{input, of_option};
use crate::values::parse_bytes;
use crate::version;
use anyhow::Result;
use organza_cache::Cache;
use organza_scene::ResultCache;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// The variable that names the folder.
const FOLDER: &str = "ORGANZA_CACHE";

/// The variable that gives the limit.
const LIMIT: &str = "ORGANZA_CACHE_LIMIT";

/// The limit without that variable, bytes.
const DEFAULT_LIMIT: u64 = 10 << 30;

/// The cache that is in use, with the program that uses it; `None` where it is off.
///
/// # Errors
/// A folder that cannot be made or read, or a wrong limit.
pub fn in_use(named_place: Option<&OsStr>) -> Result<Option<ResultCache>> {
    let Some((source, place)) = place(named_place) else {
        return Ok(None);
    };
    let Some(cache) = named(source, &place)? else {
        return Ok(None);
    };
    let made = cache.make();
    made.map_err(|e| wrong(source, &format!("{}: {e}", name(&cache))))?;
    let program = format!("organza {}", version::build());
    Ok(Some(ResultCache { cache, program }))
}

/// The cache to look at: the user's folder if nothing else is named.
///
/// # Errors
/// "off", or a wrong limit.
pub fn to_look_at(named_place: Option<&OsStr>) -> Result<Cache> {
    let (source, place) = place(named_place).unwrap_or((FOLDER, "auto".into()));
    named(source, &place)?.ok_or_else(|| wrong(source, "\"off\" names no cache; expected a folder"))
}

/// What names the cache, and its name.
fn place(named_place: Option<&OsStr>) -> Option<(&'static str, OsString)> {
    let flag = named_place.map(|place| ("--cache", place.to_owned()));
    let variable = std::env::var_os(FOLDER).map(|place| (FOLDER, place));
    flag.or(variable.filter(|(_, place)| !place.is_empty()))
}

/// A mistake in what names the cache: the option, or the variable.
fn wrong(source: &str, why: &str) -> anyhow::Error {
    match source.starts_with('-') {
        true => of_option(source, why),
        false => input(format!("{source}: {why}")),
    }
}

/// The cache of a name, whose folder need not exist; `None` for "off".
fn named(source: &str, place: &OsStr) -> Result<Option<Cache>> {
    let folder = match place.to_str() {
        Some("off") => return Ok(None),
        Some("auto") => user_folder(&|name| std::env::var_os(name)).ok_or_else(|| {
            wrong(
                source,
                "this computer names no folder for caches; expected a folder",
            )
        })?,
        _ => PathBuf::from(place),
    };
    Ok(Some(Cache::new(&folder, limit(std::env::var_os(LIMIT))?)))
}

fn limit(text: Option<OsString>) -> Result<u64> {
    let Some(text) = text.filter(|text| !text.is_empty()) else {
        return Ok(DEFAULT_LIMIT);
    };
    let text = text.to_string_lossy();
    parse_bytes(&text).map_err(|why| input(format!("{LIMIT}={text}: {why}")))
}

/// The folder for caches of the user, where `variable` gives the environment.
fn user_folder(variable: &dyn Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    // A relative path would depend on where the program runs.
    let absolute = |name: &str| {
        let path = variable(name).map(PathBuf::from);
        path.filter(|path| path.is_absolute())
    };
    let (own, home) = match () {
        () if cfg!(windows) => (absolute("LOCALAPPDATA"), None),
        () if cfg!(target_os = "macos") => {
            (None, absolute("HOME").map(|h| h.join("Library/Caches")))
        }
        () => (
            absolute("XDG_CACHE_HOME"),
            absolute("HOME").map(|h| h.join(".cache")),
        ),
    };
    own.or(home).map(|folder| folder.join("organza"))
}

/// The folder of a cache, for messages.
pub fn name(cache: &Cache) -> String {
    Path::display(cache.folder()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(all(unix, not(target_os = "macos")))]
    #[test]
    fn the_users_folder_follows_the_variables() {
        let folder = |list: &[(&str, &str)]| {
            user_folder(&|name| {
                let found = list.iter().find(|(n, _)| *n == name);
                found.map(|(_, value)| value.into())
            })
        };
        let both = [("XDG_CACHE_HOME", "/fast"), ("HOME", "/home/a")];
        assert_eq!(folder(&both), Some("/fast/organza".into()));
        let home = Some("/home/a/.cache/organza".into());
        assert_eq!(folder(&both[1..]), home);
        assert_eq!(folder(&[("XDG_CACHE_HOME", "here"), both[1]]), home);
        assert_eq!(folder(&[]), None);
    }

    #[test]
    fn limits_are_sizes() {
        assert_eq!(limit(None).unwrap(), DEFAULT_LIMIT);
        assert_eq!(limit(Some("2GiB".into())).unwrap(), 2 << 30);
        let wrong = limit(Some("much".into())).unwrap_err().to_string();
        assert!(
            wrong.contains("ORGANZA_CACHE_LIMIT=much: expected a size"),
            "{wrong}"
        );
    }
}
