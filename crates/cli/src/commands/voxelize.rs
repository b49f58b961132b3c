//! `organza voxelize`

use super::with_threads;
use crate::building::watched;
use crate::error::{InputError, after_option, of_file};
use crate::flags::values::{parse_level, whole};
use crate::flags::{CacheArgs, CommonArgs, MemoryArgs, VoxelArgs};
use crate::interrupt::{self, Interruptible};
use crate::output;
use crate::output::note;
use crate::results::Results;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use organza_scatter::{FlakeFamily, FlakeMaterials};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_scene::memory::free_memory_bytes;
use organza_scene::scattering::ScatteringTable;
use organza_volume::format::{self, FORMATS, Format, Part, Voxels, WriteOption};
use organza_volume::{FibreFootprint, Octree};
use std::path::PathBuf;

/// `organza voxelize`
#[derive(Debug, Args)]
#[command(
    about = "Turn one tile of a fabric into a volume file",
    after_help = "Example:\n  organza voxelize scenes/fabrics/organza.toml -o organza.ovox --voxel-um 10",
    mut_arg("outfile", |a| a.help(outfile_help()))
)]
pub struct VoxelizeArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Volume to write
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Level of detail, for formats that keep one; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
    /// Store 16-bit floats, where the format has them
    #[arg(long)]
    pub half: bool,
    /// Do not compress, where the format does
    #[arg(long)]
    pub raw: bool,
    /// Where the length of thick fibres lies, for formats that keep populations [default: as the fabric's [scattering] wants it]
    #[arg(long, value_name = "WHERE")]
    pub footprint: Option<FootprintName>,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    /// Number of levels of detail, 1 to 8 [default: as many as fit, at most 6]
    #[arg(long, value_name = "N", value_parser = whole::<u8>(1..=8))]
    pub levels: Option<u8>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// `--footprint`
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FootprintName {
    /// In the voxels that a fibre covers: micro-flakes and plain events
    Covered,
    /// In the voxels that its axis passes: packed fibres
    Axis,
}

command!(VoxelizeArgs, "voxelize", "volume.ovox");

/// Runs the command.
pub fn run(args: &VoxelizeArgs) -> Result<()> {
    let name = args.outfile.to_string_lossy();
    let format = format::by_name(&name).ok_or_else(|| {
        let endings: Vec<String> = FORMATS.iter().map(|f| format!(".{}", f.ending)).collect();
        of_file(
            &args.outfile,
            format!("expected a name that ends in {}", or_list(&endings)),
        )
    })?;
    check_flags(args, format)?;
    output::check_writable(&args.outfile)?;
    with_threads(&args.common, || voxelize(args, format))
}

/// Every format that can be written, and what it keeps.
fn outfile_help() -> String {
    let one = |f: &&Format| format!(".{} ({})", f.ending, f.keeps);
    let formats: Vec<String> = FORMATS.iter().map(one).collect();
    format!("Volume to write: {}", formats.join("; "))
}

/// Names with "or" before the last.
fn or_list(names: &[String]) -> String {
    match names {
        [before @ .., last] if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        names => names.join(", "),
    }
}

/// Refuses flags that the format would silently ignore.
fn check_flags(args: &VoxelizeArgs, format: &Format) -> Result<()> {
    for (flag, given, option) in [
        ("--level", args.level > 0, WriteOption::Level),
        ("--half", args.half, WriteOption::Half),
        ("--raw", args.raw, WriteOption::Raw),
        (
            "--footprint",
            args.footprint.is_some(),
            WriteOption::Footprint,
        ),
    ] {
        if given && !format.options.contains(&option) {
            let takers = FORMATS.iter().filter(|f| f.options.contains(&option));
            let takers: Vec<String> = takers.map(|f| format!(".{}", f.ending)).collect();
            return Err(InputError::after_option(
                flag,
                format!(
                    "is for {}; .{} keeps {}",
                    or_list(&takers),
                    format.ending,
                    format.keeps
                ),
            )
            .in_file(&args.outfile)
            .into());
        }
    }
    Ok(())
}

fn voxelize(args: &VoxelizeArgs, format: &Format) -> Result<()> {
    let started = std::time::Instant::now();
    let (fabric, octree) = watched(&args.common, &args.cache, |loader| {
        octree(args, format, loader)
    })?;
    let host = &args.common.host;
    host.try_give(|| in_memory(args, format, &fabric, &octree))?;
    if !host.writes() {
        return Ok(());
    }
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
        if loses_transmission(format, &fabric) {
            note!(
                "note: .{} keeps flakes that reflect as mirrors: light that flakes transmit is \
                 lost. .ovox keeps it",
                format.ending
            );
        }
    }
    Ok(())
}

/// Whether the fabric shows flakes that transmit, and the format has no populations whose
/// fibres could.
fn loses_transmission(format: &Format, fabric: &Fabric) -> bool {
    let own = ScatteringTable::default().over(fabric.file.scattering);
    let transmits = own.is_ok_and(|shown| {
        shown.representation.has_key("flake")
            && shown.settings.flake == FlakeFamily::SGGX_TRANSMITTING
    });
    transmits && !format.options.contains(&WriteOption::Footprint)
}

fn octree(args: &VoxelizeArgs, format: &Format, loader: &Loader<'_>) -> Result<(Fabric, Octree)> {
    let fabric = fabric_file::load(&args.fabric, &args.common.set, loader)?;
    output::check_not_an_input(&args.outfile, loader.inputs().iter().map(|i| &i.path))?;
    let plan = fabric.plan(
        &args.fabric,
        footprint(args, format, &fabric),
        args.voxel.voxel_um,
        args.levels,
        args.memory.max_memory,
    )?;
    let levels = plan.level_count();
    if args.level >= levels {
        return Err(after_option(
            "level",
            format!("{}: the octree has {levels} levels, from 0", args.level),
        ));
    }
    let limit = args.memory.max_memory;
    let octree = fabric.voxelize_planned(&args.fabric, &plan, limit, loader)?;
    Ok((fabric, octree))
}

/// What was asked for; else what the fabric's own model wants, where the format keeps
/// populations to show it by.
fn footprint(args: &VoxelizeArgs, format: &Format, fabric: &Fabric) -> FibreFootprint {
    match args.footprint {
        Some(FootprintName::Covered) => FibreFootprint::Covered,
        Some(FootprintName::Axis) => FibreFootprint::Axis,
        None if format.options.contains(&WriteOption::Footprint) => {
            let own = ScatteringTable::default().over(fabric.file.scattering);
            let voxels = own.ok().and_then(|shown| shown.representation.voxels());
            voxels.map_or(FibreFootprint::Covered, |v| v.footprint)
        }
        None => FibreFootprint::Covered,
    }
}

fn write(
    args: &VoxelizeArgs,
    format: &Format,
    fabric: &Fabric,
    octree: &Octree,
) -> Result<Vec<PathBuf>> {
    with_parts(args, format, fabric, octree, |parts| {
        // Large files take minutes: an interrupt must not leave a part of one behind.
        interrupt::watch()?;
        let files = parts.into_iter().map(|(path, part)| {
            let write = move |out: &mut dyn output::SeekWrite| {
                (part.write)(&mut Interruptible(out)).context("writing the volume failed")
            };
            (path, Box::new(write) as output::WriteFile<'_>)
        });
        output::write_files(files.collect())
    })
}

/// The bytes of the files.
fn in_memory(
    args: &VoxelizeArgs,
    format: &Format,
    fabric: &Fabric,
    octree: &Octree,
) -> Result<Results> {
    with_parts(args, format, fabric, octree, |parts| {
        let files = parts.into_iter().map(|(path, part)| {
            let mut bytes = Vec::new();
            (part.write)(&mut bytes).context("writing the volume failed")?;
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            Ok((name.into_owned(), bytes))
        });
        Ok(Results {
            files: files.collect::<Result<_>>()?,
            ..Results::default()
        })
    })
}

/// Refuses a file whose grids do not fit in memory, before they are made.
fn check_memory(args: &VoxelizeArgs, format: &Format, octree: &Octree) -> Result<()> {
    let needed = (format.write_memory_bytes)(octree, args.level);
    let allowed = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    if needed <= allowed {
        return Ok(());
    }
    let dims = octree.dims(args.level);
    Err(of_file(
        &args.outfile,
        format!(
            "{} x {} x {} voxels need about {needed} bytes of memory, {allowed} are allowed: use \
             larger voxels, a coarser --level or a smaller tile, allow more, or write .ovox",
            dims.x, dims.y, dims.z
        ),
    ))
}

/// What `use_parts` makes of the files of the volume, by their paths.
fn with_parts<T>(
    args: &VoxelizeArgs,
    format: &Format,
    fabric: &Fabric,
    octree: &Octree,
    use_parts: impl FnOnce(Vec<(PathBuf, Part<'_>)>) -> Result<T>,
) -> Result<T> {
    check_memory(args, format, octree)?;
    let materials = FlakeMaterials::new(fabric.flake_optics());
    let voxels = Voxels {
        octree,
        level: args.level,
        half: args.half,
        raw: args.raw,
        files: fabric.sources(),
        merge: &|mixture| materials.merged(mixture),
    };
    let parts = (format.write)(&voxels).context("writing the volume failed")?;
    let named = parts.into_iter().map(|part| {
        let path = match part.infix {
            Some(infix) => args
                .outfile
                .with_extension(format!("{infix}.{}", format.ending)),
            None => args.outfile.clone(),
        };
        (path, part)
    });
    use_parts(named.collect())
}
