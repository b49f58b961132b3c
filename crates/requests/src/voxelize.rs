//! Volumes of fabrics.

use anyhow::{Context as _, Result};
use clap::{Args, ValueEnum};
use organza_scatter::{FlakeFamily, FlakeMaterials};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_scene::scattering::ScatteringTable;
use organza_volume::format::{self, FORMATS, Format, Part, Voxels, WriteOption};
use organza_volume::{FibreFootprint, Octree};
use organza_work::building::watched;
use organza_work::output::{self, SeekWrite, WriteFile};
use organza_work::values::{parse_level, parse_micrometres, whole};
use organza_work::{
    Context, Error, Job, Output, Request, Results, after_option, keys, of_file, of_option,
};
use serde::Deserialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// One tile of a fabric as a volume.
#[derive(Clone, Debug, Default, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Voxelize {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
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
    #[serde(deserialize_with = "keys::some_name")]
    pub footprint: Option<FootprintName>,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
    /// Number of levels of detail, 1 to 8 [default: as many as fit, at most 6]
    #[arg(long, value_name = "N", value_parser = whole::<u8>(1..=8))]
    pub levels: Option<u8>,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
    /// The file that it is for, see [`Request::adapt_to`].
    #[arg(skip)]
    #[serde(skip)]
    pub file: Option<PathBuf>,
}

/// Where the length of thick fibres lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FootprintName {
    /// In the voxels that a fibre covers: micro-flakes and plain events
    Covered,
    /// In the voxels that its axis passes: packed fibres
    Axis,
}

impl Request for Voxelize {
    const NAME: &'static str = "voxelize";
    type Output = Volume;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        self.check_options(path, format_of(path)?)?;
        self.file = Some(path.to_owned());
        Ok(vec![path.to_owned()])
    }

    fn check(&self, _: &Context) -> Result<()> {
        keys::check("voxel_um", self.voxel_um, parse_micrometres)?;
        keys::check("levels", self.levels, whole::<u8>(1..=8))?;
        if self.fabric.as_os_str().is_empty() {
            return Err(of_option("fabric", "expected a fabric file"));
        }
        self.check_options(self.file(), format_of(self.file())?)
    }

    fn work(job: &Job<Voxelize>) -> Result<Volume> {
        let started = Instant::now();
        let (fabric, octree) = watched(&job.context, |loader| octree(job, loader))?;
        let volume = Volume {
            file: job.file().to_owned(),
            level: job.level,
            half: job.half,
            raw: job.raw,
            started,
            context: job.context.clone(),
            fabric,
            octree,
        };
        volume.check_memory(format_of(&volume.file)?)?;
        Ok(volume)
    }
}

/// The format of a file.
fn format_of(path: &Path) -> Result<&'static Format> {
    let name = path.to_string_lossy();
    format::by_name(&name).ok_or_else(|| {
        let endings: Vec<String> = FORMATS.iter().map(|f| format!(".{}", f.ending)).collect();
        let why = format!("expected a name that ends in {}", output::or_list(&endings));
        of_file(path, why)
    })
}

impl Voxelize {
    fn file(&self) -> &Path {
        self.file.as_deref().unwrap_or(Path::new("volume.ovox"))
    }

    /// Refuses options that the format would silently ignore.
    fn check_options(&self, path: &Path, format: &Format) -> Result<()> {
        for (flag, given, option) in [
            ("--level", self.level > 0, WriteOption::Level),
            ("--half", self.half, WriteOption::Half),
            ("--raw", self.raw, WriteOption::Raw),
            (
                "--footprint",
                self.footprint.is_some(),
                WriteOption::Footprint,
            ),
        ] {
            if given && !format.options.contains(&option) {
                let takers = FORMATS.iter().filter(|f| f.options.contains(&option));
                let takers: Vec<String> = takers.map(|f| format!(".{}", f.ending)).collect();
                let (takers, ending, keeps) =
                    (output::or_list(&takers), format.ending, format.keeps);
                let why = format!("{flag} is for {takers}; .{ending} keeps {keeps}");
                return Err(of_file(path, why));
            }
        }
        Ok(())
    }
}

fn octree(job: &Job<Voxelize>, loader: &Loader<'_>) -> Result<(Fabric, Octree)> {
    let fabric = fabric_file::load(&job.fabric, &job.set, loader)?;
    job.context.check_outputs(loader)?;
    let limit = job.context.max_memory_bytes;
    let footprint = footprint(job, format_of(job.file())?, &fabric);
    let plan = fabric.plan(&job.fabric, footprint, job.voxel_um, job.levels, limit)?;
    let levels = plan.level_count();
    if job.level >= levels {
        let level = job.level;
        let why = format!("{level}: the octree has {levels} levels, from 0");
        return Err(after_option("level", why));
    }
    let octree = fabric.voxelize_planned(&job.fabric, &plan, limit, loader)?;
    Ok((fabric, octree))
}

/// What was asked for; else what the fabric's own model wants, where the format keeps
/// populations to show it by.
fn footprint(job: &Voxelize, format: &Format, fabric: &Fabric) -> FibreFootprint {
    match job.footprint {
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

/// One tile of a fabric in voxels.
pub struct Volume {
    /// The fabric.
    pub fabric: Fabric,
    /// Its voxels.
    pub octree: Octree,
    file: PathBuf,
    level: u8,
    half: bool,
    raw: bool,
    started: Instant,
    context: Context,
}

impl Volume {
    /// What a person reads of it and of the files that were written.
    pub fn lines(&self, written: &[PathBuf]) -> Vec<String> {
        let names: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
        let names = names.join(", ");
        let octree = &self.octree;
        let mut lines = vec![format!(
            "{names}: {} voxels with fibre of {} at {:.1} um, {:.1} MiB in memory, {:.1} s",
            octree.occupied_voxels(),
            octree.dims(0).as_u64vec3().element_product(),
            octree.voxel_mm(0).max_element() * 1e3,
            octree.memory_bytes() as f64 / f64::from(1 << 20),
            self.started.elapsed().as_secs_f64(),
        )];
        if let Ok(format) = format_of(&self.file)
            && loses_transmission(format, &self.fabric)
        {
            lines.push(format!(
                "note: .{} keeps flakes that reflect as mirrors: light that flakes transmit is \
                 lost. .ovox keeps it",
                format.ending
            ));
        }
        lines
    }

    /// Refuses a file whose grids do not fit in memory, before they are made.
    fn check_memory(&self, format: &Format) -> Result<()> {
        let needed = (format.write_memory_bytes)(&self.octree, self.level);
        let allowed = self.context.memory_bytes();
        if needed <= allowed {
            return Ok(());
        }
        let dims = self.octree.dims(self.level);
        let why = format!(
            "{} x {} x {} voxels need about {needed} bytes of memory, {allowed} are allowed: use \
             larger voxels, a coarser --level or a smaller tile, allow more, or write .ovox",
            dims.x, dims.y, dims.z
        );
        Err(of_file(&self.file, why))
    }

    /// What `use_parts` makes of the files of the volume, by their paths.
    fn with_parts<T>(
        &self,
        path: &Path,
        use_parts: impl FnOnce(Vec<(PathBuf, Part<'_>)>) -> Result<T>,
    ) -> Result<T> {
        let format = format_of(path)?;
        let materials = FlakeMaterials::new(self.fabric.flake_optics());
        let voxels = Voxels {
            octree: &self.octree,
            level: self.level,
            half: self.half,
            raw: self.raw,
            files: self.fabric.sources(),
            merge: &|mixture| materials.merged(mixture),
        };
        let parts = (format.write)(&voxels).context("writing the volume failed")?;
        let named = parts.into_iter().map(|part| {
            let path = match part.infix {
                Some(infix) => path.with_extension(format!("{infix}.{}", format.ending)),
                None => path.to_owned(),
            };
            (path, part)
        });
        use_parts(named.collect())
    }
}

impl Output for Volume {
    fn results(&self) -> Result<Results, Error> {
        let encode = || {
            self.with_parts(&self.file, |parts| {
                let files = parts.into_iter().map(|(path, part)| {
                    let mut bytes = Vec::new();
                    (part.write)(&mut bytes).context("writing the volume failed")?;
                    let name = path.file_name().unwrap_or_default().to_string_lossy();
                    Ok((name.into_owned(), bytes))
                });
                files.collect::<Result<_>>()
            })
        };
        Ok(Results {
            files: self.context.run(encode)?,
            ..Results::default()
        })
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let write = || {
            self.with_parts(path, |parts| {
                // Large files take minutes: an interrupt must not leave a part of one behind.
                let files = parts.into_iter().map(|(path, part)| {
                    let stop = &self.context.stop;
                    let write = move |out: &mut dyn SeekWrite| {
                        (part.write)(&mut Stoppable { out, stop })
                            .context("writing the volume failed")
                    };
                    (path, Box::new(write) as WriteFile<'_>)
                });
                output::write_files(files.collect())
            })
        };
        self.context.run(write)
    }
}

/// A file whose writing ends when a stop is asked for.
struct Stoppable<'a> {
    out: &'a mut dyn SeekWrite,
    stop: &'a organza_work::StopFlag,
}

impl Write for Stoppable<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.stop.is_asked() {
            return Err(std::io::Error::other("interrupted"));
        }
        self.out.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
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

/// Every format that can be written, and what it keeps.
pub fn formats_help() -> String {
    let one = |f: &&Format| format!(".{} ({})", f.ending, f.keeps);
    let formats: Vec<String> = FORMATS.iter().map(one).collect();
    format!("Volume to write: {}", formats.join("; "))
}
