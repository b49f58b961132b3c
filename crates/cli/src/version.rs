//! What `organza --version --verbose` prints: which build of the program this is.

use organza_transport::ENGINES;

/// The commit that the program was built from: the variable `ORGANZA_COMMIT` of the build.
const COMMIT: Option<&str> = option_env!("ORGANZA_COMMIT");

/// Digest of the sources, the compiler and its options, see `build.rs`.
const SOURCES: &str = env!("ORGANZA_SOURCES");

/// What distinguishes this build from others, of the same version or not.
pub fn build() -> String {
    let version = env!("CARGO_PKG_VERSION");
    match COMMIT {
        Some(commit) => format!("{version}, commit {commit}, sources {SOURCES}"),
        None => format!("{version}, sources {SOURCES}"),
    }
}

/// Optional features that the program was built with.
const FEATURES: &[&str] = if cfg!(feature = "gpu") { &["gpu"] } else { &[] };

/// Version, commit, digest of the sources, target, features and engines, one a line.
pub fn description() -> String {
    let (version, commit) = (env!("CARGO_PKG_VERSION"), COMMIT.unwrap_or("unknown"));
    let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
    let features = listed(FEATURES);
    let engines = |is_here: bool| {
        let engines = ENGINES.iter().filter(|e| (e.is_available)() == is_here);
        engines.map(|e| e.name).collect::<Vec<_>>()
    };
    let here = listed(&[&["walk"], &engines(true)[..]].concat());
    let absent = listed(&engines(false));
    format!(
        "organza {version}\ncommit: {commit}\nsources: {SOURCES}\nbuilt for: {os}, {arch}\nfeatures: {features}\n\
         engines on this computer: {here}\nengines it lacks: {absent}\n"
    )
}

fn listed(names: &[&str]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}
