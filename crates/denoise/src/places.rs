//! Where the library may be.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// The variable that names the library, or the folder that it is in.
pub const VARIABLE: &str = "ORGANZA_OIDN";

/// Names in a folder that are looked through.
const MAX_NAMES: usize = 100_000;

/// The environment of the process: the value of a variable.
pub type Variables<'a> = &'a dyn Fn(&str) -> Option<OsString>;

/// The file names of the library, the newest version first.
const NAMES: &[&str] = if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &[
        "libOpenImageDenoise.so.2",
        "libOpenImageDenoise.so.1",
        "libOpenImageDenoise.so",
    ]
};

/// Folders of wheels that hold the library, below `site-packages`: pyoidn, and oidn.
const IN_WHEELS: &[&str] = &[
    "pyoidn/oidn/lib",
    "pyoidn/oidn/bin",
    "oidn/lib.linux.x64",
    "oidn/lib.macos.aarch64",
    "oidn/lib.win.x64",
];

/// What to try to load, in this order: what the variable `ORGANZA_OIDN` names, and nothing
/// else if it is set; the system's library; the wheels of the active Python environment
/// (`VIRTUAL_ENV`, `CONDA_PREFIX`), of that of the first `python3` on the `PATH`, and of the
/// user.
pub fn places(variables: Variables<'_>) -> Vec<PathBuf> {
    let named = variables(VARIABLE).filter(|value| !value.is_empty());
    if let Some(named) = named {
        let path = PathBuf::from(named);
        return match path.is_dir() {
            true => libraries(&path),
            false => vec![path],
        };
    }
    let mut places: Vec<PathBuf> = NAMES.iter().map(PathBuf::from).collect();
    for environment in environments(variables) {
        for packages in site_packages(&environment) {
            for folder in IN_WHEELS {
                places.extend(libraries(&packages.join(folder)));
            }
        }
    }
    places
}

/// The folders of Python environments.
fn environments(variables: Variables<'_>) -> Vec<PathBuf> {
    let named = ["VIRTUAL_ENV", "CONDA_PREFIX"].map(variables);
    let mut found: Vec<PathBuf> = named.into_iter().flatten().map(PathBuf::from).collect();
    let path = variables("PATH").unwrap_or_default();
    let python = if cfg!(windows) {
        "python.exe"
    } else {
        "python3"
    };
    let mut folders = std::env::split_paths(&path);
    let first = folders.find(|folder| folder.join(python).is_file());
    // `bin/python3` lies in its environment, and on Windows `python.exe` in its root.
    found.extend(first.and_then(|folder| match cfg!(windows) {
        true => Some(folder),
        false => folder.parent().map(Path::to_owned),
    }));
    let home = variables("HOME").map(|home| Path::new(&home).join(".local"));
    found.extend(home);
    found.retain(|path| path.is_absolute());
    found
}

/// The folders of packages of an environment.
fn site_packages(environment: &Path) -> Vec<PathBuf> {
    let lib = environment.join("lib");
    let is_python = |name: &OsStr| name.to_string_lossy().starts_with("python");
    let mut found = vec![environment.join("Lib/site-packages")];
    for python in names(&lib).into_iter().filter(|name| is_python(name)) {
        for packages in ["site-packages", "dist-packages"] {
            found.push(lib.join(&python).join(packages));
        }
    }
    found
}

/// The libraries in a folder: under the names above, otherwise with a longer version.
fn libraries(folder: &Path) -> Vec<PathBuf> {
    let known = NAMES.iter().map(|name| folder.join(name));
    let mut found: Vec<PathBuf> = known.filter(|path| path.is_file()).collect();
    if found.is_empty() {
        let is_longer = |name: &OsStr| {
            let name = name.to_string_lossy();
            name.starts_with("libOpenImageDenoise.so.")
                || (name.starts_with("libOpenImageDenoise.") && name.ends_with(".dylib"))
        };
        let longer = names(folder).into_iter().filter(|name| is_longer(name));
        found = longer.map(|name| folder.join(name)).collect();
    }
    found
}

/// The names in a folder, sorted; none if it cannot be read.
fn names(folder: &Path) -> Vec<OsString> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let entries = entries.take(MAX_NAMES).flatten();
    let mut names: Vec<OsString> = entries.map(|entry| entry.file_name()).collect();
    names.sort();
    names
}

/// The libraries beside one that it needs and may not find by itself: wheels of version 1
/// hold the one for threads under a name that the system does not look for.
pub fn needed_beside(library: &Path) -> Vec<PathBuf> {
    let Some(folder) = library.parent().filter(|f| !f.as_os_str().is_empty()) else {
        return Vec::new();
    };
    let is_needed = |name: &OsStr| name.to_string_lossy().starts_with("libtbb.so.12");
    let needed = names(folder).into_iter().filter(|name| is_needed(name));
    needed.take(1).map(|name| folder.join(name)).collect()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_variable_excludes_all_else_and_environments_come_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let touch = |path: &Path| {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        };
        let at = |name: &str| folder.path().join(name);
        let new = at("venv/lib/python3.11/site-packages/pyoidn/oidn/lib/libOpenImageDenoise.so.2");
        let old =
            at("other/lib/python3.9/site-packages/oidn/lib.linux.x64/libOpenImageDenoise.so.1.4.3");
        touch(&new);
        touch(&new.with_file_name("libOpenImageDenoise_core.so.2.5.1"));
        touch(&old);
        touch(&old.with_file_name("libtbb.so.12.5"));
        touch(&at("other/bin/python3"));
        let both = |name: &str| match name {
            "VIRTUAL_ENV" => Some(at("venv").into_os_string()),
            "PATH" => Some(at("other/bin").into_os_string()),
            _ => None,
        };
        let found = places(&both);
        let (system, wheels) = found.split_at(NAMES.len());
        assert!(
            system
                .iter()
                .all(|path| path.parent() == Some(Path::new("")))
        );
        assert_eq!(wheels, [new.clone(), old.clone()]);
        assert_eq!(needed_beside(&old), [old.with_file_name("libtbb.so.12.5")]);
        assert!(needed_beside(&system[0]).is_empty());
        let with = |value: PathBuf| {
            places(&move |name| match name {
                VARIABLE => Some(value.clone().into_os_string()),
                name => both(name),
            })
        };
        assert_eq!(with(at("mine.so")), [at("mine.so")]);
        assert_eq!(with(new.parent().unwrap().into()), [new]);
        assert!(with(at("venv")).is_empty(), "a folder without the library");
    }
}
