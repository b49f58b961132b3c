//! `organza render`

use super::{Command, contact_sheet};
use crate::display_server::Address;
use crate::flags::WorkArgs;
use crate::flags::display::DisplayArgs;
use crate::interrupt;
use crate::terminal::{self, Terminal};
use anyhow::Result;
use clap::Args;
use clap::builder::ArgPredicate;
use organza_picture::{FORMATS, Format};
use organza_requests::{Output, Picture, Render, Request};
use organza_work::values::whole;
use organza_work::{Context, input};
use std::path::PathBuf;
use std::sync::Arc;

/// `organza render`
#[derive(Clone, Debug, Args)]
#[command(about = "Path-trace a scene, or any cloth in a studio, to .exr (linear, with variance and AOVs) or .png", after_help = "Examples:\n  organza render twill-3-1-s -o twill.png\n  organza render my_draft.wif -o my_draft.png --studio macro\n  organza render scenes/fabrics/denim.toml -o denim.png --spp 128\n  organza render scenes/first_light.toml -o first_light.exr --spp 256 --stats\n\nA cloth in a studio takes up to a minute on two cores; Ctrl-C keeps the picture so far.",
    mut_arg("outfile", |a| a.help(outfile_help())))]
pub struct RenderArgs {
    #[command(flatten)]
    pub render: Render,
    /// Further ones, with --contact-sheet
    pub more_scenes: Vec<PathBuf>,
    /// Picture to write; its ending chooses the format
    #[arg(
        short,
        long,
        required = false,
        required_unless_present = "contact_sheet",
        default_value_if("contact_sheet", ArgPredicate::IsPresent, "sheet.png")
    )]
    pub outfile: PathBuf,
    /// Render all scenes at a small size to one labelled picture instead (.png)
    #[arg(long, value_name = "SHEET.png", conflicts_with_all = contact_sheet::CONFLICTS)]
    pub contact_sheet: Option<PathBuf>,
    /// Longer edge of a picture on a contact sheet, pixels [default: 256]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(16..=2048))]
    pub cell_px: Option<u32>,
    /// Show the picture while it renders, in a viewer with tev's protocol that listens there, e.g. 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT", value_parser = Address::parse)]
    pub display_server: Option<Address>,
    /// Print counts of collisions, shadow steps and rejected samples, fireflies and memory
    #[arg(long)]
    pub stats: bool,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub display: DisplayArgs,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// Every format that can be written.
fn outfile_help() -> String {
    let written = FORMATS.iter().filter(|f| f.writer.is_some());
    let one = |f: &&&Format| format!(".{} ({})", f.endings[0], f.keeps);
    let formats: Vec<String> = written.map(|f| one(&f)).collect();
    format!("Picture to write: {}", formats.join("; "))
}

impl Command for RenderArgs {
    const NAME: &'static str = "render";

    fn run(&self) -> Result<()> {
        if let Some(path) = &self.contact_sheet {
            return contact_sheet::run(self, path);
        }
        if let Some(more) = self.more_scenes.first() {
            let why = "expected one scene; several are rendered with --contact-sheet";
            return Err(organza_work::of_file(more, why));
        }
        if self.cell_px.is_some() {
            return Err(input("--cell-px belongs to --contact-sheet"));
        }
        self.write()
    }
}

impl RenderArgs {
    fn write(&self) -> Result<()> {
        let mut render = self.render.clone();
        let outputs = render.prepare_for(&self.outfile)?;
        let mut terminal = Terminal::new(self.work.common.quiet);
        if let Some(address) = &self.display_server {
            let name = self.outfile.to_string_lossy().into_owned();
            terminal = terminal.showing(address.clone(), name);
        }
        let terminal = Arc::new(terminal);
        let context = Context {
            outputs,
            listener: terminal.clone(),
            ..self.work.context()
        };
        if render.checkpoint.is_some() {
            interrupt::watch();
        }
        let mut picture: Picture = render.run(&context)?;
        picture.display = self.display.over(picture.display);
        picture.settle(&self.outfile);
        picture.write(&self.outfile)?;
        let name = self.outfile.display().to_string();
        self.work.note(picture.lines(&name, self.stats));
        if self.json {
            terminal::print_json(&picture.figures())?;
        }
        terminal.finish(&picture.film);
        match picture.failure {
            Some(failure) => Err(failure.into()),
            None => Ok(()),
        }
    }
}
