//! `organza denoise`

use super::Command;
use crate::flags::display::DisplayArgs;
use crate::flags::{CommonArgs, MemoryArgs};
use crate::terminal::note;
use anyhow::Result;
use clap::Args;
use organza_picture::{Display, Rendered};
use organza_scene::memory::free_memory_bytes;
use organza_work::denoising::Denoiser;
use organza_work::values::whole;
use organza_work::{output, picture};
use std::path::PathBuf;
use std::time::Instant;

/// `organza denoise`
#[derive(Debug, Args)]
#[command(
    about = "Remove the noise of a render by Open Image Denoise, where that is installed",
    after_help = "Example:\n  organza render scenes/first_light.toml -o noisy.exr --spp 16\n  organza denoise noisy.exr -o clean.exr"
)]
pub struct DenoiseArgs {
    /// Picture of `organza render` (.exr)
    pub picture: PathBuf,
    /// Picture to write: .exr, which keeps the noisy colours beside the others, or .png, with the noisy picture in NAME.noisy.png
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Pass on what the picture knows of the fibres (directions and numbers of scattering events), too; this helps at few samples only, if at all
    #[arg(long)]
    pub guides: bool,
    #[command(flatten)]
    pub display: DisplayArgs,
    /// Threads to use [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=u64::from(u16::MAX)))]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print only errors
    #[arg(long)]
    pub quiet: bool,
}

impl Command for DenoiseArgs {
    const NAME: &'static str = "denoise";

    fn run(&self) -> Result<()> {
        for path in picture::files_of_denoised(&self.outfile)? {
            output::check_writable(&path)?;
            output::check_not_an_input(&path, [&self.picture])?;
        }
        let denoiser = Denoiser::find(self.guides)?;
        let started = Instant::now();
        let allowed = self.memory.max_memory.unwrap_or_else(free_memory_bytes);
        let stored = picture::read_exr(&self.picture, allowed)?;
        let film = &stored.film;
        let display = self.display.over(Display::default());
        let common = CommonArgs {
            threads: self.threads,
            quiet: self.quiet,
        };
        let context = common.context();
        let display = picture::resolved(&self.outfile, film, display, &context);
        let rendered = Rendered {
            layers: stored.layers(),
            ..Rendered::new(film, display, &stored.attributes)
        };
        let left = allowed.saturating_sub(stored.memory_bytes());
        let written = denoiser.write(&self.outfile, &rendered, self.threads, left)?;
        if !self.quiet {
            let names: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
            note!(
                "{}: {} ({}), {:.1} s",
                names.join(", "),
                denoiser.description(),
                denoiser.path().display(),
                started.elapsed().as_secs_f64()
            );
        }
        Ok(())
    }
}
