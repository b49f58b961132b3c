//! The kind of a file, for messages about files of the wrong kind.

use crate::error::{InputError, Result};
use std::path::Path;
use toml::{Table, Value};

/// What a command takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// A fabric file.
    Fabric,
    /// A scene file.
    Scene,
    /// A fabric or a scene file.
    Either,
    /// Any text.
    Text,
}

impl Wanted {
    /// In words, after "expected".
    pub fn description(self) -> &'static str {
        match self {
            Wanted::Fabric => "a fabric file (TOML with [draft])",
            Wanted::Scene => "a scene file (TOML with [camera])",
            Wanted::Either => "a fabric file (TOML with [draft]) or a scene file (with [camera])",
            Wanted::Text => "a text file",
        }
    }

    /// Refuses a text that is clearly something else; what is only wrong is left
    /// to whoever reads it.
    ///
    /// # Errors
    /// Says what the file is.
    pub fn check(self, path: &Path, text: &str) -> Result<()> {
        let refuse = |what: &str, more: &str| {
            let words = self.description();
            Err(InputError::of_file(
                path,
                format!("is {what}; expected {words}{more}"),
            ))
        };
        if self == Wanted::Text {
            return Ok(());
        }
        if is_wif(text) {
            let more = match self {
                Wanted::Fabric | Wanted::Either => ", whose draft.wif names it",
                _ => " with a fabric whose draft.wif names it",
            };
            return refuse("a draft (WIF)", more);
        }
        let Ok(table) = toml::from_str::<Table>(text) else {
            // A mistake in TOML is reported with its place.
            let is_named_toml = path
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
            let has_header = text.lines().any(|l| l.trim_start().starts_with('['));
            return match is_named_toml || has_header {
                true => Ok(()),
                false => refuse("not TOML", ""),
            };
        };
        let scene = ["camera", "object"]
            .iter()
            .find(|k| table.contains_key(**k));
        let fabric = ["draft", "nonwoven"]
            .iter()
            .find(|k| table.contains_key(**k));
        match (self, fabric, scene) {
            _ if table.is_empty() => refuse("empty", ""),
            (Wanted::Scene, Some(key), None) => refuse(
                &format!("a fabric file, it has [{key}]"),
                " with an object whose `fabric` names it",
            ),
            (Wanted::Fabric, None, Some(key)) => refuse(
                &format!("a scene file, it has `{key}`"),
                &fabric_of(&table).map_or(String::new(), |f| format!(" such as its {f}")),
            ),
            _ => Ok(()),
        }
    }
}

/// The first fabric that a scene names.
fn fabric_of(scene: &Table) -> Option<&str> {
    let objects = scene.get("object").and_then(Value::as_array)?;
    objects.iter().find_map(|o| o.get("fabric")?.as_str())
}

/// Whether a text has the section that every WIF file begins with.
pub(crate) fn is_wif(text: &str) -> bool {
    let mut lines = text.lines().map(str::trim);
    lines.any(|l| l.eq_ignore_ascii_case("[wif]"))
}

/// What bytes are by how they begin, in words.
pub fn of_bytes(bytes: &[u8]) -> Option<&'static str> {
    const STARTS: [(&[u8], &str); 9] = [
        (b"\x89PNG", "a PNG picture"),
        (b"\xff\xd8\xff", "a JPEG picture"),
        (b"\x76\x2f\x31\x01", "an OpenEXR picture"),
        (b"#?RADIANCE", "a Radiance picture"),
        (b"#?RGBE", "a Radiance picture"),
        (b"BCC", "a file of curves (.bcc)"),
        (b"organzaR", "a checkpoint of a render"),
        (b"glTF", "a mesh (.glb)"),
        (b"ply\n", "a mesh (.ply)"),
    ];
    let start = STARTS.iter().find(|(start, _)| bytes.starts_with(start));
    let volume = || organza_volume::format::by_magic(bytes).map(|f| f.noun);
    start.map(|(_, words)| *words).or_else(volume)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_kinds_are_reported_and_wrong_files_left_to_their_readers() {
        let (fabric, scene) = (
            "[draft]\nweave = 'plain'\n",
            "[camera]\n[[object]]\nfabric = 'a.toml'\n",
        );
        let say = |wanted: Wanted, text: &str| {
            let checked = wanted.check(Path::new("x.toml"), text);
            checked.map_or_else(|e| e.to_string(), |()| String::new())
        };
        for (wanted, text, words) in [
            (Wanted::Fabric, fabric, ""),
            (Wanted::Scene, scene, ""),
            (
                Wanted::Scene,
                fabric,
                "x.toml: is a fabric file, it has [draft]; expected a scene file",
            ),
            (
                Wanted::Fabric,
                scene,
                "x.toml: is a scene file, it has `camera`; expected a fabric file",
            ),
            (
                Wanted::Fabric,
                "# nothing\n",
                "x.toml: is empty; expected a fabric file",
            ),
            (
                Wanted::Scene,
                "[WIF]\nVersion=1.1\n[TEXT]\nTitle=a b\n",
                "x.toml: is a draft (WIF)",
            ),
            (Wanted::Scene, "[camera\n", ""),
            (Wanted::Either, fabric, ""),
            (Wanted::Either, scene, ""),
            (
                Wanted::Either,
                "[WIF]\nVersion=1.1\n",
                "x.toml: is a draft (WIF); expected a fabric file",
            ),
            (Wanted::Fabric, "[drafd]\n", ""),
        ] {
            let said = say(wanted, text);
            assert!(
                said.starts_with(words) && said.is_empty() == words.is_empty(),
                "{said}"
            );
        }
        assert!(say(Wanted::Fabric, scene).ends_with("such as its a.toml"));
        let pairs = Wanted::Either.check(Path::new("pairs.csv"), "theta_i,phi_i\n0,0\n");
        let words = pairs.unwrap_err().to_string();
        assert!(
            words.starts_with("pairs.csv: is not TOML; expected"),
            "{words}"
        );
        assert_eq!(of_bytes(b"\x89PNG\r\n"), Some("a PNG picture"));
        assert_eq!(of_bytes(b"[draft]"), None);
    }
}
