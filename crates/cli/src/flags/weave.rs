//! Flags of looking at drafts and files.

use super::CommonArgs;
use super::values::whole;
use clap::Args;
use std::path::PathBuf;

/// `organza weave`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza weave satin-8-3 -o satin.png\n  organza weave draft.wif --json"
)]
pub struct WeaveArgs {
    /// A draft (.wif), a fabric file (.toml) or the name of a weave (plain, twill-3-1-s, satin-8-3, basket-2-2, herringbone)
    pub draft: String,
    /// What to write: the drawdown or the curves as a picture (.png), the curves as polylines (.obj), text (.txt) or .bcc [default: print the drawdown]
    #[arg(short, long)]
    pub outfile: Option<PathBuf>,
    /// Which curves of a fabric to write or draw
    #[arg(long, value_enum, requires = "outfile")]
    pub level: Option<CurveLevel>,
    /// Pixels per crossing of a drawdown, 1 to 1024; fewer where the picture would be wider than 8192
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = whole::<u32>(1..=1024), requires = "outfile")]
    pub cell_px: u32,
    /// Print repeat, floats and cover as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// How far a fabric is taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CurveLevel {
    /// One curve per yarn
    Yarn,
    /// One curve per ply
    Ply,
    /// Every fibre
    Fibre,
}

/// `organza info`
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  organza info scenes/fabrics/organza.toml --json")]
pub struct InfoArgs {
    /// A draft (.wif), fabric or scene (.toml), volume (.ovox, .vdb, .vol), curves (.bcc, .txt) or picture that `render` wrote (.exr)
    pub file: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}
