//! What a text says.

/// Demands that a text holds some words.
///
/// # Panics
/// When it does not, with the text.
#[track_caller]
pub fn assert_contains(text: &str, words: &str) {
    assert!(text.contains(words), "expected {words:?} in: {text}");
}
