//! `organza voxelize`

use super::{Command, with_threads};
use crate::error::input;
use crate::fabric_file::{self, Fabric};
use crate::flags::values::{parse_level, whole};
use crate::flags::{CommonArgs, MemoryArgs, VoxelArgs};
use crate::output;
use crate::output::note;
use anyhow::{Context, Result};
use clap::Args;
use organza_basis::Rgb;
use organza_volume::{Footprint, Octree, VolGrid, export, ovox, vdb};
use std::path::{Path, PathBuf};

/// `organza voxelize`
#[derive(Debug, Args)]
#[command(
    about = "Turn one tile of a fabric into a volume file",
    after_help = "Example:\n  organza voxelize scenes/fabrics/organza.toml -o organza.ovox --voxel-um 10"
)]
pub struct VoxelizeArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Volume to write: .ovox (the whole octree), .vdb (OpenVDB) or .vol (Mitsuba: three files, .sigma_t.vol, .sggx.vol and .albedo.vol)
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Level of detail that .vdb and .vol hold (an .ovox holds all); 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
    /// Store 16-bit floats (.vdb)
    #[arg(long)]
    pub half: bool,
    /// Do not compress (.vdb)
    #[arg(long)]
    pub raw: bool,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    /// Number of levels of detail, 1 to 8 [default: as many as fit, at most 6]
    #[arg(long, value_name = "N", value_parser = whole::<u8>(1..=8))]
    pub levels: Option<u8>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for VoxelizeArgs {
    const NAME: &'static str = "voxelize";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// The formats that a volume can be written in.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Ovox,
    Vdb,
    Vol,
}

/// Runs the command.
pub fn run(args: &VoxelizeArgs) -> Result<()> {
    let ending = args.outfile.extension().map(|e| e.to_ascii_lowercase());
    let format = match ending.as_ref().and_then(|e| e.to_str()) {
        Some("ovox") => Format::Ovox,
        Some("vdb") => Format::Vdb,
        Some("vol") => Format::Vol,
        _ => {
            return Err(input(format!(
                "{}: expected a name that ends in .ovox, .vdb or .vol",
                args.outfile.display()
            )));
        }
    };
    check_flags(args, format)?;
    output::check_writable(&args.outfile)?;
    with_threads(&args.common, || voxelize(args, format))
}

/// Refuses flags that the format would silently pass over.
fn check_flags(args: &VoxelizeArgs, format: Format) -> Result<()> {
    for (flag, given, formats, belongs) in [
        (
            "--level",
            args.level > 0,
            &[Format::Vdb, Format::Vol][..],
            ".vdb and .vol; an .ovox holds all levels",
        ),
        ("--half", args.half, &[Format::Vdb], ".vdb"),
        ("--raw", args.raw, &[Format::Vdb], ".vdb"),
    ] {
        if given && !formats.contains(&format) {
            return Err(input(format!(
                "{}: {flag} belongs to {belongs}",
                args.outfile.display()
            )));
        }
    }
    Ok(())
}

fn voxelize(args: &VoxelizeArgs, format: Format) -> Result<()> {
    let started = std::time::Instant::now();
    let fabric = fabric_file::load(&args.fabric, &args.common.set)?;
    fabric.tell_warnings(&args.fabric, args.common.quiet);
    let plan = fabric.plan(
        &args.fabric,
        Footprint::Covered,
        args.voxel.voxel_um,
        args.levels,
        args.memory.max_memory,
    )?;
    let levels = plan.level_count();
    if args.level >= levels {
        return Err(input(format!(
            "--level {}: the octree has {levels} levels, from 0",
            args.level
        )));
    }
    let octree = fabric_file::voxelize_planned(&args.fabric, &plan, args.common.quiet)?;
    let written = write(args, format, &fabric, &octree)?;
    if !args.common.quiet {
        let names: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        note!(
            "{}: {} voxels with fibre of {} at {:.1} um, {:.1} MiB in memory, {:.1} s",
            names.join(", "),
            octree.occupied_voxels(),
            octree.dims(0).as_u64vec3().element_product(),
            octree.voxel_mm(0).max_element() * 1e3,
            octree.memory_bytes() as f64 / f64::from(1 << 20),
            started.elapsed().as_secs_f64(),
        );
    }
    Ok(())
}

fn write(
    args: &VoxelizeArgs,
    format: Format,
    fabric: &Fabric,
    octree: &Octree,
) -> Result<Vec<PathBuf>> {
    let path = args.outfile.clone();
    match format {
        Format::Ovox => {
            output::write_file(&path, |out| {
                ovox::write(octree, out).context("writing the octree failed")
            })?;
            Ok(vec![path])
        }
        Format::Vdb => {
            let grids = vdb::grids_from_octree(octree, args.level, args.half);
            let codec = if args.raw {
                vdb::Codec::Raw
            } else {
                vdb::Codec::Zip
            };
            output::write_file(&path, |out| {
                vdb::write(&grids, codec, out).context("writing the grids failed")
            })?;
            Ok(vec![path])
        }
        Format::Vol => {
            let optics = fabric.optics();
            let albedo = |material: u16| {
                optics
                    .get(usize::from(material))
                    .map_or(Rgb::BLACK, |o| o.albedo)
            };
            let triple = export::vol_triple(octree, args.level, &albedo);
            let named = |part: &str| path.with_extension(format!("{part}.vol"));
            let parts: [(PathBuf, &VolGrid); 3] = [
                (named("sigma_t"), &triple.sigma_t),
                (named("sggx"), &triple.sggx),
                (named("albedo"), &triple.albedo),
            ];
            for (path, grid) in &parts {
                write_vol(path, grid)?;
            }
            Ok(parts.map(|(path, _)| path).to_vec())
        }
    }
}

fn write_vol(path: &Path, grid: &VolGrid) -> Result<()> {
    output::write_file(path, |out| {
        grid.write(out).context("writing the grid failed")
    })
}
