//! `organza bench`

use super::Command;
use crate::flags::{CommonArgs, MemoryArgs};
use crate::program;
use anyhow::Result;
use clap::Args;
use organza_requests::Bench;
use organza_work::Context;

/// `organza bench`
#[derive(Debug, Args)]
#[command(
    about = "Measure speed against error for every way to represent a cloth",
    after_help = "Examples:\n  organza bench -o report --quick\n  organza bench denim my_fabric.toml -o report\n\nResults are saved in the folder as they arrive: the same command resumes an interrupted bench."
)]
pub struct BenchArgs {
    #[command(flatten)]
    pub bench: Bench,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for BenchArgs {
    const NAME: &'static str = "bench";

    fn run(&self) -> Result<()> {
        let bench = Bench {
            program: Some(program::started()?),
            ..self.bench.clone()
        };
        let context = Context {
            max_memory_bytes: self.memory.max_memory,
            ..self.common.context()
        };
        let lines = bench.run(&context)?;
        self.common.note(lines);
        Ok(())
    }
}
