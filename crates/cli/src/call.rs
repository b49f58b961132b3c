//! Commands run by other programs.

use crate::commands;
use crate::error::InputError;
use crate::host::{Caller, Host};
use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

/// Why a call failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// A file, a key or a flag is wrong.
    Input,
    /// Something failed while running.
    Running,
    /// The caller stopped it.
    Stopped,
}

/// What went wrong, and where if that is known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct Failure {
    /// Why.
    pub kind: FailureKind,
    /// The whole message, which includes all parts below.
    pub text: String,
    /// The file at fault.
    pub file: Option<String>,
    /// Line in it, from 1.
    pub line: Option<u32>,
    /// Column in it, in characters from 1.
    pub column: Option<u32>,
    /// The key, or the flag with its dashes.
    pub key: Option<String>,
    /// The rest of the message.
    pub message: String,
}

impl Failure {
    /// Takes a message apart: `FILE:LINE:COLUMN: KEY: MESSAGE`, each part where it is there.
    pub fn new(kind: FailureKind, text: String) -> Failure {
        let mut failure = Failure {
            kind,
            message: text.clone(),
            text,
            file: None,
            line: None,
            column: None,
            key: None,
        };
        if kind != FailureKind::Input {
            return failure;
        }
        let mut rest = failure.text.as_str();
        if let Some((first, more)) = rest.split_once(": ")
            && !first.starts_with('-')
            && looks_like_file(first)
        {
            let (file, line, column) = without_place(first);
            failure.file = Some(file.to_owned());
            (failure.line, failure.column) = (line, column);
            rest = more;
        }
        if let Some((first, more)) = rest.split_once(": ")
            && looks_like_key(first)
        {
            failure.key = Some(first.to_owned());
            rest = more;
        }
        failure.message = rest.to_owned();
        failure
    }
}

/// The file, line and column of `FILE:LINE:COLUMN`, or of `FILE` alone.
fn without_place(place: &str) -> (&str, Option<u32>, Option<u32>) {
    let cut = |text| -> Option<(&str, u32)> {
        let (before, number) = str::rsplit_once(text, ':')?;
        Some((before, number.parse().ok()?))
    };
    match cut(place) {
        Some((before, last)) => match cut(before) {
            Some((file, line)) => (file, Some(line), Some(last)),
            None => (before, Some(last), None),
        },
        None => (place, None, None),
    }
}

/// Messages begin with a file, if they are about one: a path with an ending or a folder, a
/// dictionary's name in angle brackets, or whatever exists.
fn looks_like_file(text: &str) -> bool {
    let (file, line, _) = without_place(text);
    let path = Path::new(file);
    line.is_some()
        || path.extension().is_some()
        || (file.starts_with('<') && file.ends_with('>'))
        || path.components().count() > 1
        || path.exists()
}

/// `object[0].fabric`, `render.spp` or `--spp`.
fn looks_like_key(text: &str) -> bool {
    let mut chars = text.chars();
    let starts = chars
        .next()
        .is_some_and(|c| c.is_ascii_alphabetic() || c == '-');
    starts
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "_-.[]*".contains(c))
}

/// Runs a command for another program: `arguments` are the words of a command line after
/// `organza`. Its results go to [`Caller::take`]; files are written only where the arguments
/// name an output. Nothing is printed but by commands that print when they are quiet.
///
/// # Errors
/// What is wrong, see [`Failure`]. A panic, which is a defect of the program, is one as well.
pub fn call(arguments: &[OsString], caller: Arc<dyn Caller>) -> Result<(), Failure> {
    let words: Vec<_> = arguments.iter().map(|a| a.to_string_lossy()).collect();
    let command_line = format!("organza {}", words.join(" "));
    let has_output = arguments.iter().any(|a| is_output(&a.to_string_lossy()));
    // Without an output nothing is written here; but the command checks that it could be.
    let nowhere = tempfile::tempdir().map_err(|e| {
        let text = format!("cannot make a temporary folder: {e}");
        Failure::new(FailureKind::Running, text)
    })?;
    let mut all = vec![OsString::from("organza")];
    all.extend(arguments.iter().take(1).cloned());
    if let Some(name) = arguments.first().and_then(|c| commands::output_name(c))
        && !has_output
    {
        all.extend(["-o".into(), nowhere.path().join(name).into_os_string()]);
    }
    all.extend(arguments.iter().skip(1).cloned());
    let usage = |e: clap::Error| Failure::new(FailureKind::Input, usage_message(&e));
    let matches = commands::definition()
        .try_get_matches_from(all)
        .map_err(usage)?;
    let host = Host::program(Arc::clone(&caller), command_line, has_output);
    let run = || commands::run_for(&matches, host);
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(Ok(()))) => Ok(()),
        // Whatever the error says, the caller asked for it.
        Ok(Ok(Err(_))) if caller.is_stopped() => {
            Err(Failure::new(FailureKind::Stopped, "stopped".into()))
        }
        Ok(Ok(Err(e))) => {
            let is_input = e.chain().any(|cause| cause.is::<InputError>());
            let kind = match is_input {
                true => FailureKind::Input,
                false => FailureKind::Running,
            };
            Err(Failure::new(kind, crate::error::message(&e)))
        }
        Ok(Err(e)) => Err(usage(e)),
        Err(payload) => Err(of_panic(payload.as_ref())),
    }
}

/// Whether an argument names an output.
fn is_output(argument: &str) -> bool {
    let long = ["--outfile", "--outdir"];
    (argument.starts_with("-o") && !argument.starts_with("--"))
        || long.contains(&argument.split('=').next().unwrap_or(argument))
}

/// What clap says, without the word "error" and the usage of the command line.
fn usage_message(e: &clap::Error) -> String {
    let text = e.render().to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let kept = text.split("\n\nUsage:").next().unwrap_or(text);
    let kept = kept
        .split("\n\nFor more information")
        .next()
        .unwrap_or(kept);
    kept.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn of_panic(payload: &(dyn Any + Send)) -> Failure {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
    let text = text.unwrap_or("no message");
    Failure::new(FailureKind::Running, format!("a defect of organza: {text}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_taken_apart() {
        let of = |text: &str| {
            let f = Failure::new(FailureKind::Input, text.to_owned());
            assert_eq!(f.text, text);
            let place = f.line.map(|l| (l, f.column));
            (
                f.file.unwrap_or_default(),
                place,
                f.key.unwrap_or_default(),
                f.message,
            )
        };
        let expected = |file: &str, place, key: &str, message: &str| {
            (file.to_owned(), place, key.to_owned(), message.to_owned())
        };
        assert_eq!(
            of("a/b.toml:3:1: render.sp: unknown field `sp`: did you mean `spp`?"),
            expected(
                "a/b.toml",
                Some((3, Some(1))),
                "render.sp",
                "unknown field `sp`: did you mean `spp`?"
            )
        );
        assert_eq!(
            of("<scene>: object[0].fabric: x.toml: no such file"),
            expected("<scene>", None, "object[0].fabric", "x.toml: no such file")
        );
        assert_eq!(
            of("--level 9: the octree has 6"),
            expected("", None, "", "--level 9: the octree has 6")
        );
        assert_eq!(of("--crop: empty"), expected("", None, "--crop", "empty"));
        assert_eq!(
            of("pairs.csv:2:5: theta_i: expected a number"),
            expected(
                "pairs.csv",
                Some((2, Some(5))),
                "theta_i",
                "expected a number"
            )
        );
    }
}
