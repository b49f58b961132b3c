//! `organza view`

use super::Command;
use crate::flags::{CacheArgs, CommonArgs, MemoryArgs, SetArgs, set_help};
use crate::interrupt;
use crate::terminal::{self, note};
use anyhow::{Context, Result, anyhow};
use clap::Args;
use organza_view::{Answering, Guard, Limits, Patience, SavedFile, Session, Waits};
use organza_work::output::{SeekWrite, WriteFile};
use organza_work::{after_option, output, result_cache};
use std::path::PathBuf;
use std::sync::Arc;

/// `organza view`
#[derive(Debug, Args)]
#[command(
    about = "Show a scene, fabric or draft in the browser, rendered while you change it",
    after_help = "Example:\n  organza view scenes/fabrics/denim.toml\n\nOpen the address that it prints in a browser of this computer; Ctrl-C ends it.",
    mut_arg("set", |a| a.help(set_help::FABRIC_OR_SCENE))
)]
pub struct ViewArgs {
    /// Scene or fabric file (TOML), draft (.wif), or the name of a weave
    #[arg(default_value = "twill-2-1-z")]
    pub file: PathBuf,
    /// Port of this computer to serve on [default: any that is free]
    #[arg(
        long,
        value_name = "PORT",
        default_value_t = 0,
        hide_default_value = true
    )]
    pub port: u16,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub set: SetArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for ViewArgs {
    const NAME: &'static str = "view";

    fn run(&self) -> Result<()> {
        let document = organza_view::open(&self.file, &self.set.set)?;
        let cache = result_cache::in_use(self.cache.cache.as_deref())?;
        let port = self.port;
        let listener = organza_view::listen(port).map_err(|e| match port {
            0 => anyhow!("cannot serve on this computer: {e}"),
            _ => after_option(
                "port",
                format!("{port}: {e}; choose another, or leave it out"),
            ),
        })?;
        let port = listener
            .local_addr()
            .context("the port is not known")?
            .port();
        let guard = Guard::new(port).map_err(|why| anyhow!(why))?;
        interrupt::watch();
        terminal::print(&format!("{}\n", guard.address()))?;
        if !self.common.quiet {
            note!("organza: open this address in a browser of this computer; Ctrl-C ends it");
        }
        let session = Arc::new(Session::new(document));
        let limits = Limits {
            max_memory_bytes: self.memory.max_memory,
            threads: self.common.threads.map(usize::from),
            cache,
        };
        std::thread::scope(|scope| {
            let render = scope.spawn(|| organza_view::render(&session, &limits, &write));
            let answering = Answering::new(Arc::clone(&session), guard, Patience::default());
            let is_over = || interrupt::came() || render.is_finished();
            let served = organza_view::serve(listener, answering, Waits::default(), &is_over);
            session.end();
            let rendered = render.join().map_err(|_| anyhow!("the render stopped"))?;
            rendered.map_err(|why| anyhow!(why))?;
            served.context("cannot serve")
        })
    }
}

/// Writes files that are saved together.
fn write(files: Vec<SavedFile<'_>>) -> Result<(), String> {
    let written = output::write_files(files.into_iter().map(to_be_written).collect());
    written.map(|_| ()).map_err(|e| format!("{e:#}"))
}

fn to_be_written(file: SavedFile<'_>) -> (PathBuf, WriteFile<'_>) {
    let SavedFile { path, write } = file;
    let write = move |mut out: &mut dyn SeekWrite| write(&mut out).map_err(|why| anyhow!(why));
    (path, Box::new(write))
}
