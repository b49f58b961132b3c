//! Requests by their names.

use crate::{Bake, Compare, Fit, Measure, Render, Scan, Table, Voxelize, Weave};
use organza_work::{Context, Error, InputError, Output, Request, Results};
use std::path::PathBuf;

/// A request by its name.
struct Registration {
    name: &'static str,
    read: fn(toml::Table) -> Result<Stated, Error>,
}

impl Registration {
    const fn of<R: Request + Send + Sync + 'static>() -> Registration {
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

/// What does the work of a request.
type Work = dyn Fn(&Context) -> Result<Results, Error> + Send + Sync;

/// A request that a table states.
pub struct Stated {
    /// What it will write, where its keys `outfile` or `outdir` name a place.
    pub outputs: Vec<PathBuf>,
    run: Box<Work>,
}

impl Stated {
    /// Reads the request of a name.
    ///
    /// # Errors
    /// No request of this name, a wrong key, or a place that cannot be written.
    pub fn read(name: &str, table: toml::Table) -> Result<Stated, Error> {
        let Some(found) = REQUESTS.iter().find(|r| r.name == name) else {
            let names: Vec<&str> = REQUESTS.iter().map(|r| r.name).collect();
            let why = format!("{name}: no such request; expected {}", names.join(", "));
            return Err(Error::from(organza_work::input(why)));
        };
        (found.read)(table)
    }

    /// Does the work, and writes its output.
    ///
    /// # Errors
    /// Those of the request.
    pub fn run(&self, context: &Context) -> Result<Results, Error> {
        (self.run)(&Context {
            outputs: self.outputs.clone(),
            ..context.clone()
        })
    }
}

/// Runs the request of a name that a table states, and writes its output where the keys `outfile` or
/// `outdir` name a place.
///
/// # Errors
/// No request of this name, and those of the request.
pub fn run_table(name: &str, table: toml::Table, context: &Context) -> Result<Results, Error> {
    Stated::read(name, table)?.run(context)
}

fn read<R: Request + Send + Sync + 'static>(mut table: toml::Table) -> Result<Stated, Error> {
    let named = OUTPUTS.iter().find_map(|key| table.remove(*key));
    let path = match named {
        Some(toml::Value::String(path)) => Some(PathBuf::from(path)),
        Some(_) => {
            let why = InputError::of_option(OUTPUTS[0], "expected the name of a file");
            return Err(Error::from(anyhow::Error::new(why)));
        }
        None => None,
    };
    let mut request = R::from_table(table)?;
    let outputs = path.as_deref().map(|path| request.prepare_for(path));
    Ok(Stated {
        outputs: outputs.transpose()?.unwrap_or_default(),
        run: Box::new(move |context| {
            let mut found = request.run(context)?;
            if let Some(path) = &path {
                found.settle(path);
                found.write(path)?;
            }
            found.results()
        }),
    })
}
