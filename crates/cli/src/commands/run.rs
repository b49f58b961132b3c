//! `organza run`

use super::Command;
use crate::flags::WorkArgs;
use crate::interrupt;
use anyhow::Result;
use clap::Args;
use organza_requests::{Error, ErrorKind};
use organza_scene::file_kind::Wanted;
use organza_scene::read;
use organza_work::{Context, InputError, Place, PlaceKind, input, of_file, of_key, output};
use std::path::{Path, PathBuf};
use toml::Value;
use toml_edit::{Document, Item, Table};

/// `organza run`
#[derive(Debug, Args)]
#[command(
    about = "Do what a file of requests says: tables with the names of commands, whose keys are their flags",
    after_help = "Example:\n  organza run requests.toml\n\nwith requests.toml:\n  [render]\n  scene = \"scenes/first_light.toml\"\n  spp = 64\n  outfile = \"first_light.exr\"\n\n  [[measure]]\n  file = \"scenes/fabrics/organza.toml\"\n  albedo = true\n  outfile = \"organza.csv\""
)]
pub struct RunArgs {
    /// File of requests (TOML), which are done in their order. Names of files in it begin at the working folder; the folder of an output file has to be there, or an earlier request makes it (outdir)
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
        self.check(&text, &stated, &context)?;
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
            let fail = |e| self.at_key((document.raw(), name, table), e);
            Ok(Stated {
                name,
                table,
                request: request.map_err(fail)?,
            })
        });
        read.collect()
    }

    /// Refuses what is wrong with the requests one by one, and what several of them would write.
    fn check(&self, text: &str, stated: &[Stated<'_>], context: &Context) -> Result<()> {
        let mut written: Vec<&Place> = Vec::new();
        for one in stated {
            let fail = |e: Error| self.at_key((text, one.name, one.table), e);
            if one.request.outputs.is_empty() {
                let why = "expected the key outfile (or outdir), where the result is written";
                return Err(fail(input(why).into()));
            }
            let folders = written.iter().filter(|w| w.kind == PlaceKind::Folder);
            let context = Context {
                coming_folders: folders.map(|folder| folder.path.clone()).collect(),
                ..context.clone()
            };
            let before = written.len();
            for place in &one.request.places {
                let path = &place.path;
                let own = output::check_not_an_input(path, [&self.file]);
                own.map_err(|e| fail(e.into()))?;
                let lost = |other: &&Place| {
                    let is_continued = |p: &Place| p.kind == PlaceKind::Continued;
                    let both = is_continued(place) && is_continued(other);
                    !both && output::is_same_file(path, &other.path)
                };
                // What one request writes is compared by its own check.
                if written[..before].iter().any(lost) {
                    let why = format!("{} is written twice", path.display());
                    return Err(fail(input(why).into()));
                }
                written.push(place);
            }
            one.request.check(&context).map_err(fail)?;
        }
        Ok(())
    }

    /// An error of a request that was not begun, at its key's place in the text: one that has another
    /// file is the fault of the key that names this file, and is quoted.
    fn at_key(&self, at: (&str, &str, &Table), error: Error) -> anyhow::Error {
        let (_, _, table) = at;
        if error.kind != ErrorKind::Input {
            return error.into();
        }
        let Some(file) = &error.file else {
            return self.at(at, error);
        };
        let stated = error.key.clone().filter(|key| table.contains_key(key));
        let key = stated.or_else(|| key_of(table, file));
        let mut quoted = Error::new(ErrorKind::Input, error.to_string());
        (quoted.key, quoted.is_missing) = (key, error.is_missing);
        self.at(at, quoted)
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
        let key = match key {
            // An unknown request is itself the key.
            Some(key) if key != name => format!("{name}.{key}"),
            _ => name.to_owned(),
        };
        let error = InputError {
            is_missing: error.is_missing,
            line: place.and_then(|(line, _)| number(line)),
            column: place.and_then(|(_, column)| number(column)),
            ..InputError::of_key(&self.file, key, error.message)
        };
        error.into()
    }
}

/// The key of a request that names a file; that of the output if none does, such as of a second file
/// beside it.
fn key_of(table: &Table, file: &Path) -> Option<String> {
    let is_file = |name: &toml_edit::Value| name.as_str().is_some_and(|n| Path::new(n) == file);
    let names = |key: &&str| match table.get(key) {
        Some(Item::Value(toml_edit::Value::Array(list))) => list.iter().any(is_file),
        Some(Item::Value(one)) => is_file(one),
        _ => false,
    };
    let outputs = ["outfile", "outdir"];
    let all = || outputs.into_iter().chain(table.iter().map(|(key, _)| key));
    let output = || outputs.into_iter().find(|key| table.contains_key(key));
    all().find(names).or_else(output).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::FromArgMatches;
    use organza_testing::table_rows;
    use std::fs;

    /// What is wrong with a file of requests in this folder, which `@` stands for.
    fn why(folder: &Path, text: &str) -> String {
        let place = folder.display().to_string();
        let text = text.replace('@', &place);
        let file = folder.join("requests.toml");
        fs::write(&file, &text).unwrap();
        let command = RunArgs::augment_args(clap::Command::new("run"));
        let found = command.get_matches_from(["run".as_ref(), file.as_os_str()]);
        let args = RunArgs::from_arg_matches(&found).unwrap();
        let document = Document::parse(text.as_str()).unwrap();
        let values = toml::from_str(&text).unwrap();
        let stated = args.stated(&document, &values);
        let checked = stated.and_then(|all| args.check(&text, &all, &Context::default()));
        let why = checked.map_or_else(|e| format!("{e:#}"), |()| String::new());
        why.replace(&place, "@")
    }

    #[test]
    fn folders_of_earlier_requests_count_as_there() {
        let folder = tempfile::tempdir().unwrap();
        let bake = "[bake]\nfabrics = ['a.toml']\noutdir = '@/new/out'\n";
        let render = "[render]\nscene = 'a.toml'\n";
        let inside = "outfile = '@/new/out/a.exr'\nsave_light = '@/new/a.light'\n\
                      checkpoint = '@/new/out/a.state'\n";
        assert_eq!(why(folder.path(), &format!("{bake}{render}{inside}")), "");
        // The known-bad twins: made later, or by none.
        let later = why(folder.path(), &format!("{render}{inside}{bake}"));
        let missing = "@/new/out/a.exr: the folder @/new/out does not exist";
        assert_eq!(
            later,
            format!("@/requests.toml:3:1: render.outfile: {missing}")
        );
        let light = "outfile = '@/a.exr'\nsave_light = '@/other/a.light'\n";
        let other = why(folder.path(), &format!("{bake}{render}{light}"));
        let missing = "@/other/a.light: the folder @/other does not exist";
        assert_eq!(
            other,
            format!("@/requests.toml:7:1: render.save_light: {missing}")
        );
        assert!(!folder.path().join("new").exists());
    }

    #[test]
    fn nothing_that_a_request_writes_is_lost_to_another() {
        let folder = tempfile::tempdir().unwrap();
        let twice = |first: &str, second: &str| {
            let text = format!(
                "[[render]]\nscene = 'a.toml'\n{first}\n[[render]]\nscene = 'a.toml'\n{second}\n"
            );
            why(folder.path(), &text)
        };
        for key in ["save_light", "checkpoint"] {
            let both = format!("outfile = '@/b.exr'\n{key} = '@/a.exr'");
            for (first, second) in [
                ("outfile = '@/a.exr'", &*both),
                (&both, "outfile = '@/a.exr'"),
            ] {
                let why = twice(first, second);
                assert!(why.ends_with(": render: @/a.exr is written twice"), "{why}");
            }
        }
        // A later render may go on with the checkpoint of an earlier one.
        let kept =
            |name: &str| format!("outfile = '@/{name}'\ncheckpoint = '@/state'\nresume = true");
        assert_eq!(twice(&kept("a.exr"), &kept("b.exr")), "");
        let bake = "[[bake]]\nfabrics = ['a.toml']\noutdir = '@/new/out'\n";
        let why = why(folder.path(), &bake.repeat(2));
        assert_eq!(why, "@/requests.toml:4:1: bake: @/new/out is written twice");
    }

    /// The lines of a file, and a part of the message.
    const MISTAKES: &str = "
[rendr] | 1:1: rendr: no such request; expected render,
[rendr] | bake, weave or fit; did you mean `render`?
[weave]; draft = 'plain'; outfile = 'a.jpg' | 3:1: weave.outfile: a.jpg: expected a name that ends in .png
[weave]; outfile = 'a.obj' | 1:1: weave.draft: expected a draft, a fabric or a weave
[weave]; draft = 'a.toml'; outfile = '@/b.toml' | 2:1: weave.draft: a.toml: is a fabric file already
[weave]; draft = '@/p.png'; outfile = '@/p.png' | 3:1: weave.outfile: @/p.png: is also an input
[weave]; draft = 'plain'; outfile = '@/requests.toml' | 3:1: weave.outfile: @/requests.toml: is also an input
[scan]; files = ['@/slces']; outfile = '@/x.ovox' | 2:1: scan.files: @/slces: no such file; did you mean @/slices?
";

    #[test]
    fn mistakes_are_reported_at_the_key_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("p.png"), "").unwrap();
        fs::create_dir(folder.path().join("slices")).unwrap();
        for [text, expected] in table_rows(MISTAKES) {
            let why = why(folder.path(), &text.replace("; ", "\n"));
            assert!(why.contains(expected), "{why}");
        }
    }
}
