//! How much work a statistical test does.

/// Whether the environment variable `ORGANZA_FULL` asks for tests at full size.
pub fn is_full() -> bool {
    std::env::var_os("ORGANZA_FULL").is_some()
}

/// The size of a test: `full` with `ORGANZA_FULL=1`, otherwise `reduced`.
pub fn sized<T>(reduced: T, full: T) -> T {
    if is_full() { full } else { reduced }
}
