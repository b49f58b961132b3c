//! The error of wrong input.

use crate::read::io_message;
use std::fmt;
use std::path::{Path, PathBuf};

/// A file, or a value of the command line, is wrong: where, and what was expected.
///
/// Its text is `FILE:LINE:COLUMN: KEY: MESSAGE`, each part where it is known; an option, with its
/// dashes, stands where a key does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InputError {
    /// The file at fault.
    pub file: Option<PathBuf>,
    /// Line in it, from 1.
    pub line: Option<u32>,
    /// Column in the line, in characters from 1.
    pub column: Option<u32>,
    /// The key of the file, dotted: `object[0].fabric`, `render.spp`.
    pub key: Option<String>,
    /// The option of a command, by its name with underscores: `voxel_um`.
    pub option: Option<String>,
    /// Whether a file is not there: [`InputError::file`], or one that the key names.
    pub is_missing: bool,
    /// Whether the message runs on from the key or option without a colon, as that of
    /// `--level 9: the octree has 6` does.
    pub runs_on: bool,
    /// What is wrong, and what was expected.
    pub message: String,
}

/// What everything here returns: only input can be wrong.
pub type Result<T, E = InputError> = std::result::Result<T, E>;

impl InputError {
    /// An error at no known place.
    pub fn new(message: impl fmt::Display) -> InputError {
        InputError {
            message: message.to_string(),
            ..InputError::default()
        }
    }

    /// An error of a file as a whole.
    pub fn of_file(path: impl AsRef<Path>, message: impl fmt::Display) -> InputError {
        InputError::new(message).in_file(path)
    }

    /// An error of a key of a file.
    pub fn of_key(
        path: impl AsRef<Path>,
        key: impl Into<String>,
        message: impl fmt::Display,
    ) -> InputError {
        InputError::new(message).at_key(key).in_file(path)
    }

    /// An error of an option of a command, whose name may have its dashes.
    pub fn of_option(name: &str, message: impl fmt::Display) -> InputError {
        InputError {
            option: Some(name.trim_start_matches('-').replace('-', "_")),
            ..InputError::new(message)
        }
    }

    /// The same where the message runs on from the option's name: `--level 9: the octree has 6`.
    pub fn after_option(name: &str, message: impl fmt::Display) -> InputError {
        InputError {
            runs_on: true,
            ..InputError::of_option(name, message)
        }
    }

    /// A file that cannot be read, listed or made.
    pub fn of_io(path: impl AsRef<Path>, e: &std::io::Error) -> InputError {
        InputError {
            is_missing: e.kind() == std::io::ErrorKind::NotFound,
            ..InputError::of_file(path, io_message(e))
        }
    }

    /// An error in the words of code that knows keys but not where their table stands: `KEY: WHY`.
    /// The text begins with the key, up to the first `: `; one that begins with words, which have
    /// spaces, is the message as a whole.
    pub fn keyed(text: impl fmt::Display) -> InputError {
        let text = text.to_string();
        match text.split_once(": ") {
            Some((key, why)) if !key.is_empty() && !key.contains(' ') => {
                InputError::new(why).at_key(key)
            }
            _ => InputError::new(text),
        }
    }

    /// The same error in a file. One that has a file already is the fault of what this file says:
    /// its text is the message.
    #[must_use]
    pub fn in_file(self, path: impl AsRef<Path>) -> InputError {
        let mut error = match self.file {
            None => self,
            Some(_) => self.quoted(),
        };
        error.file = Some(path.as_ref().to_owned());
        error
    }

    /// The same error at a key. One that has a place already is the fault of the key's value: its
    /// text is the message.
    #[must_use]
    pub fn at_key(self, key: impl Into<String>) -> InputError {
        let mut error = match (&self.file, &self.key, &self.option) {
            (None, None, None) => self,
            _ => self.quoted(),
        };
        error.key = Some(key.into());
        error
    }

    /// The error as the message of another.
    fn quoted(self) -> InputError {
        InputError {
            is_missing: self.is_missing,
            ..InputError::new(self)
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}", file.display())?;
            for number in [self.line, self.column].into_iter().flatten() {
                write!(f, ":{number}")?;
            }
            f.write_str(": ")?;
        }
        let after = if self.runs_on { " " } else { ": " };
        match (&self.option, &self.key) {
            (Some(option), _) => write!(f, "--{}{after}", option.replace('_', "-"))?,
            (None, Some(key)) => write!(f, "{key}{after}")?,
            (None, None) => {}
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for InputError {}

/// The key is that of the fabric file.
impl From<organza_weave::Error> for InputError {
    fn from(e: organza_weave::Error) -> InputError {
        use organza_weave::Error::Load;
        let is_missing =
            matches!(&e, Load { source, .. } if source.kind() == std::io::ErrorKind::NotFound);
        InputError {
            key: e.key().map(str::to_owned),
            is_missing,
            ..InputError::new(e.message())
        }
    }
}

/// The key is the column of the table.
impl From<organza_measure::PairsError> for InputError {
    fn from(e: organza_measure::PairsError) -> InputError {
        use organza_measure::PairsErrorKind::Number;
        let error = match e.kind {
            Number {
                column,
                expected,
                found,
            } => InputError::new(format!("expected {expected}, found `{found}`")).at_key(column),
            kind => InputError::new(kind),
        };
        InputError {
            line: u32::try_from(e.line).ok(),
            column: u32::try_from(e.column).ok(),
            ..error
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_other_files_are_messages_and_keys_are_told_from_words() {
        let missing = InputError::of_io("x.toml", &std::io::ErrorKind::NotFound.into());
        let e = missing.at_key("object[0].fabric").in_file("<scene>");
        let text = "<scene>: object[0].fabric: x.toml: no such file";
        assert_eq!(e.to_string(), text);
        assert_eq!(e.message, "x.toml: no such file");
        assert!(e.is_missing);
        let outer = e.in_file("a.toml");
        assert_eq!((outer.key, outer.message), (None, text.to_owned()));
        let e = InputError::keyed("warp.per_cm: expected 2: found 3");
        assert_eq!(e.key.as_deref(), Some("warp.per_cm"));
        assert_eq!(e.message, "expected 2: found 3");
        assert_eq!(InputError::keyed("no cloth: none").key, None);
        let e = InputError::from(organza_measure::parse_pairs("theta_i\n").unwrap_err());
        let e = e.in_file("pairs.csv");
        assert_eq!(e.line, Some(1));
        assert!(
            e.to_string().starts_with("pairs.csv:1:1: the header"),
            "{e}"
        );
    }
}
