//! `organza run`

use super::Command;
use crate::flags::WorkArgs;
use crate::interrupt;
use anyhow::Result;
use clap::Args;
use organza_requests::{Error, ErrorKind, Stated};
use organza_scene::file_kind::Wanted;
use organza_work::{InputError, of_file, of_key, output};
use std::path::PathBuf;
use toml_edit::{DocumentMut, Item};

/// `organza run`
#[derive(Debug, Args)]
#[command(
    about = "Do what a file of requests says: tables with the names of commands, whose keys are their flags",
    after_help = "Example:\n  organza run requests.toml\n\nwith requests.toml:\n  [render]\n  scene = \"scenes/first_light.toml\"\n  spp = 64\n  outfile = \"first_light.exr\"\n\n  [[measure]]\n  file = \"scenes/fabrics/organza.toml\"\n  albedo = true\n  outfile = \"organza.csv\""
)]
pub struct RunArgs {
    /// File of requests (TOML), which are done in their order. Names of files in it begin at the working folder
    pub file: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for RunArgs {
    const NAME: &'static str = "run";

    fn run(&self) -> Result<()> {
        let context = self.work.context();
        let text = context.loader().text_of(&self.file, Wanted::Text)?;
        // All are read before the first begins.
        let requests = self.requests(&text)?;
        let mut written: Vec<PathBuf> = Vec::new();
        for (name, request) in &requests {
            if request.outputs.is_empty() {
                let why = "expected the key outfile (or outdir), where the result is written";
                return Err(of_key(&self.file, name, why));
            }
            for path in &request.outputs {
                output::check_not_an_input(path, [&self.file])?;
                if written
                    .iter()
                    .any(|other| output::is_same_file(path, other))
                {
                    let why = format!("{} is written twice", path.display());
                    return Err(of_key(&self.file, name, why));
                }
                written.push(path.clone());
            }
        }
        interrupt::watch();
        for (name, request) in &requests {
            let done = request.run(&context);
            drop(done.map_err(|e| self.at(name, e))?);
        }
        Ok(())
    }
}

impl RunArgs {
    /// The requests of the file, with their names.
    fn requests(&self, text: &str) -> Result<Vec<(String, Stated)>> {
        let document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| {
            let why = e.message().to_owned();
            of_file(&self.file, why)
        })?;
        // By their places: lists of tables may stand between others.
        let mut tables = Vec::new();
        for (name, item) in document.iter() {
            match item {
                Item::Table(one) => tables.push((one.position(), name, one)),
                Item::ArrayOfTables(list) => {
                    tables.extend(list.iter().map(|one| (one.position(), name, one)));
                }
                _ => return Err(of_key(&self.file, name, "expected a table or [[tables]]")),
            }
        }
        if tables.is_empty() {
            return Err(of_file(&self.file, "states no request"));
        }
        tables.sort_by_key(|(position, ..)| *position);
        let read = tables.into_iter().map(|(_, name, table)| {
            let mut alone = DocumentMut::new();
            *alone.as_table_mut() = table.clone();
            let request = Stated::read(name, toml::from_str(&alone.to_string())?);
            Ok((name.to_owned(), request.map_err(|e| self.at(name, e))?))
        });
        read.collect()
    }

    /// An error of a request, at its place in the file if it has no file of its own.
    fn at(&self, name: &str, error: Error) -> anyhow::Error {
        match error.kind {
            ErrorKind::Input if error.file.is_none() => {
                InputError::of_key(&self.file, name, error).into()
            }
            _ => error.into(),
        }
    }
}
