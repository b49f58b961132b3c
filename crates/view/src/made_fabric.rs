//! A fabric for a draft that comes alone.

use crate::document::FabricDocument;
use organza_scene::InputError;
use organza_scene::bare_fabric::{self, DraftName};
use organza_weave::Draft;
use std::path::Path;
use toml_edit::DocumentMut;

/// The most bytes of a draft that is dropped on the page.
pub const MAX_DRAFT_BYTES: usize = 8 << 20;

/// A fabric of a draft that is called `wif` beside it. The fabric is on no disk.
///
/// # Errors
/// The bytes are no draft, or no cloth can be woven from it; names the draft.
pub fn of_draft(path: &Path, wif: &str, bytes: &[u8]) -> Result<FabricDocument, InputError> {
    let draft = Draft::from_wif(bytes).map_err(|e| InputError::of_file(wif, e))?;
    made(path, DraftName::Wif(wif), &draft)
}

/// The same for a draft that was read, or has a name.
///
/// # Errors
/// No cloth can be woven from it.
pub fn made(path: &Path, name: DraftName<'_>, draft: &Draft) -> Result<FabricDocument, InputError> {
    let text = bare_fabric::of_draft(name, draft, None)?;
    let text: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| InputError::of_file(path, e))?;
    Ok(FabricDocument {
        name: crate::document::file_name(path),
        path: path.to_owned(),
        text,
        dropped: None,
        is_changed: true,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_draft_is_refused_by_name() {
        let wrong = of_draft(Path::new("x.toml"), "cat.wif", b"\x89PNG").unwrap_err();
        assert!(wrong.to_string().starts_with("cat.wif: "), "{wrong}");
    }
}
