//! Requests by their names.

use crate::{Bake, Compare, Fit, Measure, Render, Scan, Table, Voxelize, Weave};
use organza_basis::nearest_name;
use organza_work::output::or_list;
use organza_work::{Context, Error, InputError, Output, Place, PlaceKind, Request, Results};
use std::path::PathBuf;

/// A request by its name.
struct Registration {
    name: &'static str,
    read: fn(toml::Table) -> Result<Stated, Error>,
}

impl Registration {
    const fn of<R: Request<Output: 'static> + 'static>() -> Registration {
        Registration {
            name: R::NAME,
            read: read::<R>,
        }
    }
}

/// Every request that a table can state.
const REQUESTS: &[Registration] = &[
    Registration::of::<Render>(),
    Registration::of::<Measure>(),
    Registration::of::<Table>(),
    Registration::of::<Voxelize>(),
    Registration::of::<Scan>(),
    Registration::of::<Compare>(),
    Registration::of::<Bake>(),
    Registration::of::<Weave>(),
    Registration::of::<Fit>(),
];

/// Keys of a table that name where the output is written.
const OUTPUTS: [&str; 2] = ["outfile", "outdir"];

/// A request with the file or folder that it is for.
struct Prepared<R> {
    request: R,
    path: Option<PathBuf>,
}

/// What can be asked of every [`Prepared`] request.
trait Work: Send + Sync {
    fn check(&self, context: &Context) -> Result<(), Error>;
    fn run(&self, context: &Context) -> Result<Box<dyn Output>, Error>;
}

impl<R: Request<Output: 'static>> Prepared<R> {
    fn check_outputs(context: &Context) -> Result<(), Error> {
        if R::OUTPUT == PlaceKind::File {
            for path in &context.outputs {
                context.check_writable(path)?;
            }
        }
        Ok(())
    }
}

impl<R: Request<Output: 'static>> Work for Prepared<R> {
    fn check(&self, context: &Context) -> Result<(), Error> {
        Self::check_outputs(context)?;
        Ok(self.request.check(context)?)
    }

    fn run(&self, context: &Context) -> Result<Box<dyn Output>, Error> {
        Self::check_outputs(context)?;
        let mut found = self.request.run(context)?;
        if let Some(path) = &self.path {
            found.settle(path);
            found.write(path)?;
        }
        match found.failure() {
            Some(failure) => Err(failure),
            None => Ok(Box::new(found)),
        }
    }
}

/// A request that a table states.
pub struct Stated {
    /// What it will write, where its keys `outfile` or `outdir` name a place.
    pub outputs: Vec<PathBuf>,
    /// All places where it writes: the outputs, and what further keys name.
    pub places: Vec<Place>,
    work: Box<dyn Work>,
}

impl Stated {
    /// Reads the request of a name.
    ///
    /// # Errors
    /// No request of this name, a wrong key, or an output whose ending does not fit.
    pub fn read(name: &str, table: toml::Table) -> Result<Stated, Error> {
        let Some(found) = REQUESTS.iter().find(|r| r.name == name) else {
            let names: Vec<&str> = REQUESTS.iter().map(|r| r.name).collect();
            let near = nearest_name(name, names.iter().copied());
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            let why = format!("no such request; expected {}{near}", or_list(&names));
            let e = InputError::new(why).at_key(name);
            return Err(Error::from(anyhow::Error::new(e)));
        };
        (found.read)(table)
    }

    /// Refuses what is wrong whatever the input files hold, before any work is done.
    ///
    /// # Errors
    /// An output that cannot be written, and those of [`Request::check`].
    pub fn check(&self, context: &Context) -> Result<(), Error> {
        self.work.check(&self.context(context))
    }

    /// Checks the request, does its work and writes its output.
    ///
    /// # Errors
    /// Those of the request.
    pub fn run(&self, context: &Context) -> Result<Box<dyn Output>, Error> {
        self.work.run(&self.context(context))
    }

    fn context(&self, context: &Context) -> Context {
        Context {
            outputs: self.outputs.clone(),
            ..context.clone()
        }
    }
}

/// Runs the request of a name that a table states, and writes its output where the keys `outfile` or
/// `outdir` name a place.
///
/// # Errors
/// No request of this name, and those of the request.
pub fn run_table(name: &str, table: toml::Table, context: &Context) -> Result<Results, Error> {
    Stated::read(name, table)?.run(context)?.results()
}

fn read<R: Request<Output: 'static> + 'static>(mut table: toml::Table) -> Result<Stated, Error> {
    let named = OUTPUTS
        .iter()
        .find_map(|key| Some((key, table.remove(*key)?)));
    let path = match named {
        Some((_, toml::Value::String(path))) => Some(PathBuf::from(path)),
        Some((key, _)) => {
            let why = InputError::of_option(key, "expected the name of a file or folder");
            return Err(Error::from(anyhow::Error::new(why)));
        }
        None => None,
    };
    let mut request = R::from_table(table)?;
    let outputs = path.as_deref().map(|path| request.adapt_to(path));
    let outputs = outputs.transpose()?.unwrap_or_default();
    let place = |path: &PathBuf| Place {
        path: path.clone(),
        kind: R::OUTPUT,
    };
    let mut places: Vec<Place> = outputs.iter().map(place).collect();
    places.extend(request.further_places());
    Ok(Stated {
        outputs,
        places,
        work: Box::new(Prepared { request, path }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bench;
    use clap::{Arg, Args, Command};
    use std::fmt::Debug;

    /// What flags give where none is stated, beside what a table gives.
    fn same<R: Args + Default + Debug>(required: &[&str], complete: impl FnOnce(&mut R)) {
        let mut command = R::augment_args(Command::new("organza").no_binary_name(true));
        if !command.get_arguments().any(|a| a.get_id() == "outfile") {
            // Commands add it, and flags name it.
            command = command.arg(Arg::new("outfile").long("outfile"));
        }
        let found = command.try_get_matches_from(required).unwrap();
        let flags = R::from_arg_matches(&found).unwrap();
        let mut table = R::default();
        complete(&mut table);
        assert_eq!(format!("{flags:?}"), format!("{table:?}"));
    }

    #[test]
    fn flags_and_tables_have_the_same_defaults() {
        same::<Render>(&["a"], |r| r.scene = "a".into());
        same::<Measure>(&["a", "--pairs", "b"], |r| {
            (r.file, r.pairs) = ("a".into(), Some("b".into()));
        });
        same::<Table>(&["a"], |r| r.fabric = "a".into());
        same::<Voxelize>(&["a"], |r| r.fabric = "a".into());
        same::<Scan>(&["a"], |r| r.files = vec!["a".into()]);
        same::<Compare>(&["a"], |r| r.fabric = "a".into());
        same::<Bake>(&["a"], |r| r.fabrics = vec!["a".into()]);
        same::<Weave>(&["a"], |r| r.draft = "a".into());
        same::<Fit>(&["a"], |r| r.fabric = Some("a".into()));
        same::<Bench>(&["--outfile", "a"], |r| r.outfile = "a".into());
    }
}
