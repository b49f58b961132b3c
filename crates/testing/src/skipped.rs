//! Parts of tests that a machine cannot run.

/// Says that this machine cannot run a part of a test. The gate (`.ci/run`) counts these
/// lines, and prints them; there are none on a machine that has all that the tests use.
#[allow(clippy::print_stdout)] // the gate reads it
pub fn skipped(what: &str, why: &str) {
    println!("skipped: {what}: {why}");
}
