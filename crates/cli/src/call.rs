//! Commands run by other programs.

use crate::commands;
use crate::error::{self, InputError};
use crate::host::{Caller, Host};
use clap::error::{ContextKind, ContextValue};
use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
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

/// What went wrong, and where if that is known. Its names are boxed to keep results small.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct Failure {
    /// Why.
    pub kind: FailureKind,
    /// The whole message, which includes all parts below.
    pub text: String,
    /// The file at fault.
    pub file: Option<Box<str>>,
    /// Line in it, from 1.
    pub line: Option<u32>,
    /// Column in it, in characters from 1.
    pub column: Option<u32>,
    /// The key of the file.
    pub key: Option<Box<str>>,
    /// The option of the command, by its name with underscores.
    pub option: Option<Box<str>>,
    /// Whether a file is not there.
    pub is_missing: bool,
    /// The rest of the message.
    pub message: String,
}

impl Failure {
    /// A failure at no known place.
    pub fn new(kind: FailureKind, text: String) -> Failure {
        Failure {
            kind,
            ..Failure::from(&InputError::new(text))
        }
    }
}

impl From<&InputError> for Failure {
    fn from(e: &InputError) -> Failure {
        Failure {
            kind: FailureKind::Input,
            text: e.to_string(),
            file: e
                .file
                .as_ref()
                .map(|file| file.display().to_string().into()),
            line: e.line,
            column: e.column,
            key: e.key.as_deref().map(Into::into),
            option: e.option.as_deref().map(Into::into),
            is_missing: e.is_missing,
            message: e.message.clone(),
        }
    }
}

impl From<&anyhow::Error> for Failure {
    fn from(e: &anyhow::Error) -> Failure {
        let text = error::message(e);
        match error::wrong_input(e) {
            Some(wrong) => Failure {
                text,
                ..Failure::from(wrong)
            },
            None => Failure::new(FailureKind::Running, text),
        }
    }
}

/// A command line that clap refuses.
impl From<&clap::Error> for Failure {
    fn from(e: &clap::Error) -> Failure {
        Failure {
            option: option_of(e),
            ..Failure::new(FailureKind::Input, usage_message(e))
        }
    }
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
    let matches = commands::definition()
        .try_get_matches_from(all)
        .map_err(|e| Failure::from(&e))?;
    let host = Host::program(Arc::clone(&caller), command_line, has_output);
    let run = || commands::run_for(&matches, host);
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(Ok(()))) => Ok(()),
        // Whatever the error says, the caller asked for it.
        Ok(Ok(Err(_))) if caller.is_stopped() => {
            Err(Failure::new(FailureKind::Stopped, "stopped".into()))
        }
        Ok(Ok(Err(e))) => Err(Failure::from(&e)),
        Ok(Err(e)) => Err(Failure::from(&e)),
        Err(payload) => Err(of_panic(payload.as_ref())),
    }
}

/// Whether an argument names an output.
fn is_output(argument: &str) -> bool {
    let long = ["--outfile", "--outdir"];
    (argument.starts_with("-o") && !argument.starts_with("--"))
        || long.contains(&argument.split('=').next().unwrap_or(argument))
}

/// The option that clap names, by its name with underscores: that of `--voxel-um <UM>`.
fn option_of(e: &clap::Error) -> Option<Box<str>> {
    let shown = match e.get(ContextKind::InvalidArg)? {
        ContextValue::String(one) => one,
        ContextValue::Strings(several) => several.first()?,
        _ => return None,
    };
    let name = shown.split([' ', '=']).next()?.strip_prefix("--")?;
    Some(name.replace('-', "_").into())
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
    use crate::error::{after_option, input, of_file, of_io, of_key, of_option};
    use std::io::ErrorKind;

    #[test]
    fn failures_have_the_parts_of_their_errors() {
        let has = |e: anyhow::Error, text: &str, place: [&str; 4]| {
            let f = Failure::from(&e);
            assert_eq!((f.kind, &*f.text), (FailureKind::Input, text));
            let [file, key, option] = [f.file, f.key, f.option].map(Option::unwrap_or_default);
            assert_eq!([&*file, &*key, &*option, &*f.message], place, "{text}");
            f.is_missing
        };
        has(input("no"), "no", ["", "", "", "no"]);
        has(of_file("a.exr", "no"), "a.exr: no", ["a.exr", "", "", "no"]);
        let e = of_key("<scene>", "object[0].fabric", "x.toml: no such file");
        let place = ["<scene>", "object[0].fabric", "", "x.toml: no such file"];
        has(e, "<scene>: object[0].fabric: x.toml: no such file", place);
        let place = ["", "", "voxel_um", "no"];
        has(of_option("voxel_um", "no"), "--voxel-um: no", place);
        has(of_option("--voxel-um", "no"), "--voxel-um: no", place);
        let e = after_option("level", "9: the octree has 6");
        let place = ["", "", "level", "9: the octree has 6"];
        has(e, "--level 9: the octree has 6", place);
        let e = of_file("a.exr", "no").context("rendering failed");
        let text = "rendering failed: a.exr: no";
        assert!(!has(e, text, ["a.exr", "", "", "no"]));
        let place = ["a.exr", "", "", "no such file"];
        let e = of_io("a.exr", &ErrorKind::NotFound.into());
        assert!(has(e, "a.exr: no such file", place));
        let f = Failure::from(&anyhow::anyhow!("a.exr: the disk is full"));
        assert_eq!((f.kind, f.file), (FailureKind::Running, None));
    }
}
