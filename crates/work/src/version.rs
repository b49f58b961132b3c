//! Which code and which build of it this program is.

use organza_transport::ENGINES;

/// The commit that the program was built from: the variable `ORGANZA_COMMIT` of the build.
const COMMIT: Option<&str> = option_env!("ORGANZA_COMMIT");

/// Digest of the sources, see `build.rs`.
const SOURCES: &str = env!("ORGANZA_SOURCES");

/// Digest of the sources, the compiler and its options, see `build.rs`.
const BUILD: &str = env!("ORGANZA_BUILD");

/// The version of this program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What distinguishes this code from other code: samples, journals and checkpoints of two codes do
/// not belong together. Builds of one code on all systems share it.
pub fn code() -> String {
    format!("{VERSION} (sources {SOURCES})")
}

/// What distinguishes this build from others, of the same code or not.
pub fn build() -> String {
    format!("{}, build {BUILD}", code())
}

/// Optional features that the program was built with.
const FEATURES: &[&str] = if cfg!(feature = "gpu") { &["gpu"] } else { &[] };

/// What `organza --version --verbose` prints: version, commit, digest of the sources, target,
/// features and engines, one a line.
pub fn description() -> String {
    let commit = COMMIT.unwrap_or("unknown");
    let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
    let features = listed(FEATURES);
    let engines = |is_here: bool| {
        let engines = ENGINES.iter().filter(|e| (e.is_available)() == is_here);
        engines.map(|e| e.name).collect::<Vec<_>>()
    };
    let here = listed(&[&["walk"], &engines(true)[..]].concat());
    let absent = listed(&engines(false));
    format!(
        "organza {VERSION}\ncommit: {commit}\nsources: {SOURCES}\nbuild: {BUILD}\nbuilt for: {os}, {arch}\n\
         features: {features}\nengines on this computer: {here}\nengines it lacks: {absent}\n"
    )
}

fn listed(names: &[&str]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}
