//! Errors of cloths.

/// Why a draft, a yarn or a cloth could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A key of a fabric description has a value that cannot be used.
    #[error("{key}: {message}")]
    Spec {
        /// The key, dotted as in the file (`warp.per_cm`).
        key: String,
        /// What is wrong and what was expected.
        message: String,
    },
    /// A WIF file cannot be read.
    #[error("[{section}]{}: {message}", key_suffix(.key))]
    Wif {
        /// Section without its brackets.
        section: String,
        /// Key inside the section; empty when the section itself is missing.
        key: String,
        /// What is wrong and what was expected.
        message: String,
    },
    /// The threads do not fit into their spacing.
    #[error("the fabric is jammed: {0}")]
    Jammed(String),
    /// A curve file cannot be read.
    #[error("{place}: {message}")]
    Curves {
        /// Line or byte offset.
        place: String,
        /// What is wrong and what was expected.
        message: String,
    },
    /// The relaxation did not converge.
    #[error("yarn relaxation failed: {0}")]
    Relaxation(String),
    /// A draft named in the description cannot be used.
    #[error("{key}: {name}: {why}")]
    Draft {
        /// The key that names it.
        key: String,
        /// The name as written.
        name: String,
        /// What is wrong with it.
        why: Box<Error>,
    },
    /// A file named in the description could not be loaded.
    #[error("{key}: {name}: {source}")]
    Load {
        /// The key that names it.
        key: String,
        /// The name as written.
        name: String,
        /// The error of the loader.
        source: std::io::Error,
    },
    /// Writing failed.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

fn key_suffix(key: &str) -> String {
    if key.is_empty() {
        String::new()
    } else {
        format!(" {key}")
    }
}

impl Error {
    /// The key of the fabric description that is at fault, if it is known.
    pub fn key(&self) -> Option<&str> {
        match self {
            Error::Spec { key, .. } | Error::Draft { key, .. } | Error::Load { key, .. } => {
                Some(key)
            }
            _ => None,
        }
    }

    /// The text without the key.
    pub fn message(&self) -> String {
        match self {
            Error::Spec { message, .. } => message.clone(),
            Error::Draft { name, why, .. } => format!("{name}: {why}"),
            Error::Load { name, source, .. } => format!("{name}: {source}"),
            _ => self.to_string(),
        }
    }

    /// A wrong value under `key`.
    pub(crate) fn spec(key: impl Into<String>, message: impl Into<String>) -> Error {
        Error::Spec {
            key: key.into(),
            message: message.into(),
        }
    }
}

/// The suffix `; did you mean "x"?` when some candidate is near.
pub(crate) fn did_you_mean<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> String {
    organza_basis::nearest_name(name, candidates)
        .map(|n| format!("; did you mean \"{n}\"?"))
        .unwrap_or_default()
}
