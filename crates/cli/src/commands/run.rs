//! `organza run`

use super::Command;
use crate::flags::WorkArgs;
use crate::interrupt;
use anyhow::Result;
use clap::Args;
use organza_requests::{Error, ErrorKind};
use organza_scene::file_kind::Wanted;
use organza_scene::read;
use organza_work::{InputError, input, of_file, of_key, output};
use std::path::PathBuf;
use toml::Value;
use toml_edit::{Document, Item, Table};

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

/// A request of the file.
struct Stated<'a> {
    /// The name of the command.
    name: &'a str,
    /// Its table, which knows its places in the text.
    table: &'a Table,
    request: organza_requests::Stated,
}

impl Command for RunArgs {
    const NAME: &'static str = "run";

    fn run(&self) -> Result<()> {
        let context = self.work.context();
        let text = context.loader().text_of(&self.file, Wanted::Text)?;
        let values = read::toml_changed(&self.file, &text, &[], &[], Wanted::Text)?;
        let document = Document::parse(text.as_str());
        let document = document.map_err(|e| of_file(&self.file, e.message()))?;
        // All are read and checked before the first begins.
        let stated = self.stated(&document, &values)?;
        let mut written: Vec<&PathBuf> = Vec::new();
        for one in &stated {
            let fail = |e: Error| self.at((&text, one.name, one.table), e);
            if one.request.outputs.is_empty() {
                let why = "expected the key outfile (or outdir), where the result is written";
                return Err(fail(input(why).into()));
            }
            for path in &one.request.outputs {
                output::check_not_an_input(path, [&self.file])?;
                let same = |other: &&PathBuf| output::is_same_file(path, other);
                if written.iter().copied().any(|other| same(&other)) {
                    let why = format!("{} is written twice", path.display());
                    return Err(fail(input(why).into()));
                }
                written.push(path);
            }
            one.request.check(&context).map_err(fail)?;
        }
        interrupt::watch();
        for one in &stated {
            let done = one.request.run(&context);
            drop(done.map_err(|e| self.at((&text, one.name, one.table), e))?);
        }
        Ok(())
    }
}

impl RunArgs {
    /// The requests of the file, in order.
    fn stated<'a>(
        &self,
        document: &'a Document<&str>,
        values: &toml::Table,
    ) -> Result<Vec<Stated<'a>>> {
        // By their places: lists of tables may stand between others.
        let mut tables = Vec::new();
        for (name, item) in document.iter() {
            match (item, values.get(name)) {
                (Item::Table(one), Some(Value::Table(value))) => {
                    tables.push((name, one, value.clone()))
                }
                (Item::ArrayOfTables(list), Some(Value::Array(values))) => {
                    let each = list.iter().zip(values);
                    let each = each.filter_map(|(one, v)| Some((name, one, v.as_table()?.clone())));
                    tables.extend(each);
                }
                _ => return Err(of_key(&self.file, name, "expected a table or [[tables]]")),
            }
        }
        if tables.is_empty() {
            return Err(of_file(&self.file, "states no request"));
        }
        tables.sort_by_key(|(_, table, _)| table.position());
        let read = tables.into_iter().map(|(name, table, value)| {
            let request = organza_requests::Stated::read(name, value);
            let fail = |e| self.at((document.raw(), name, table), e);
            Ok(Stated {
                name,
                table,
                request: request.map_err(fail)?,
            })
        });
        read.collect()
    }

    /// An error of a request, at its key's place in the text if it has no file of its own.
    fn at(&self, (text, name, table): (&str, &str, &Table), error: Error) -> anyhow::Error {
        if error.kind != ErrorKind::Input || error.file.is_some() {
            return error.into();
        }
        let key = error.key.as_deref();
        let stated = key.and_then(|key| table.get_key_value(key)?.0.span());
        let span = stated.or_else(|| table.span());
        let place = span.map(|span| read::line_and_column(text, span.start));
        let number = |n| u32::try_from(n).ok();
        let key = key.map_or(name.to_owned(), |key| format!("{name}.{key}"));
        let error = InputError {
            line: place.and_then(|(line, _)| number(line)),
            column: place.and_then(|(_, column)| number(column)),
            ..InputError::of_key(&self.file, key, error.message)
        };
        error.into()
    }
}
