//! `organza export`

use super::Command;
use crate::flags::{CommonArgs, MemoryArgs, SetArgs, WorkArgs, set_help};
use crate::terminal::note;
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use glam::{DVec3, UVec2};
use organza_mesh::{Mesh, Placement};
use organza_picture::{Picture, exr};
use organza_requests::weave::CurveLevelName;
use organza_scene::drape::{NoMesh, read_mesh, usual_mm_per_unit};
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_scene::memory::free_memory_bytes;
use organza_scene::mitsuba::{self, Tiling};
use organza_scene::usd_curves::UsdCurves;
use organza_work::building::watched;
use organza_work::output::{self, WriteFile};
use organza_work::values::{parse_positive, parse_repeats};
use organza_work::{InputError, Waiting, of_file};
use std::path::PathBuf;

/// `organza export`
#[derive(Debug, Args)]
#[command(about = "Write a scene or a fabric's fibres for another renderer")]
pub struct ExportArgs {
    /// Which renderer
    #[command(subcommand)]
    pub to: ExportTo,
}

impl Command for ExportArgs {
    const NAME: &'static str = "export";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// The renderers that scenes are written for.
#[derive(Debug, Subcommand)]
pub enum ExportTo {
    /// Mitsuba 3: scene.xml with .vol grids
    Mitsuba(MitsubaArgs),
    /// USD: the fibres or yarns of a fabric as curves with hair materials
    Usd(UsdArgs),
}

/// `organza export mitsuba`
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  organza export mitsuba scenes/first_light.toml -o mitsuba --repeats 4,4\n  mitsuba -m scalar_rgb mitsuba/scene.xml\n\nMitsuba 3.9.1 samples its sggx phase function in a wrong frame (its issue 1728), so its pictures are too dark. benches/peers/mitsuba_values.py loads a scene with the frame corrected.", mut_arg("set", |a| a.help(set_help::SCENE)))]
pub struct MitsubaArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Folder to write to; created if missing
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Periods in x and y to write of an unbounded cloth, around the camera's target
    #[arg(long, value_name = "NX,NY", allow_hyphen_values = true, value_parser = parse_repeats)]
    pub repeats: Option<UVec2>,
    #[command(flatten)]
    pub set: SetArgs,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// `organza export usd`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza export usd scenes/fabrics/denim.toml -o denim.usda --repeats 10,10"
)]
pub struct UsdArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// File to write (.usda)
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Which curves
    #[arg(long, value_enum, default_value = "fibre")]
    pub level: CurveLevelName,
    /// Tiles in x and y, instances of one
    #[arg(long, value_name = "NX,NY", default_value = "1,1", allow_hyphen_values = true, value_parser = parse_repeats)]
    pub repeats: UVec2,
    /// Lay the cloth over a mesh with texture coordinates (.obj, .ply, .gltf, .glb)
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with = "repeats",
        requires = "mm_per_uv"
    )]
    pub mesh: Option<PathBuf>,
    /// Length of the mesh's units, mm [default: 1000 for glTF, else 1]
    #[arg(long, value_name = "MM", requires = "mesh", value_parser = parse_positive)]
    pub mm_per_unit: Option<f64>,
    /// Cloth to a unit of the mesh's texture coordinates, mm
    #[arg(long, value_name = "MM", requires = "mesh", value_parser = parse_positive)]
    pub mm_per_uv: Option<f64>,
    #[command(flatten)]
    pub set: SetArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> Result<()> {
    match &args.to {
        ExportTo::Mitsuba(args) => args.work.context().run(|| to_mitsuba(args))?,
        ExportTo::Usd(args) => args.common.context().run(|| to_usd(args))?,
    }
    Ok(())
}

fn to_usd(args: &UsdArgs) -> Result<()> {
    let path = &args.outfile;
    output::check_ending(path, &["usda"])?;
    output::check_writable(path)?;
    let max_memory_bytes = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    let context = args.common.context();
    let (fabric, mesh, inputs) = watched(&context, |loader| {
        let fabric = fabric_file::load(&args.fabric, &args.set.set, loader)?;
        let mesh = mesh(args, max_memory_bytes, loader)?;
        Ok((fabric, mesh, loader.inputs()))
    })?;
    let _waiting = Waiting::new("gathering curves", &context);
    let curves = UsdCurves {
        fabric: &fabric,
        path: &args.fabric,
        level: args.level.of_cloth(),
        repeats: args.repeats,
        mesh: mesh.as_ref(),
        max_memory_bytes,
    };
    let file = curves.gather()?;
    output::check_not_an_input(path, inputs.iter().map(|i| &i.path))?;
    output::write_file(path, |mut out| {
        file.write(&mut out).context("writing the curves failed")
    })?;
    if !args.common.quiet {
        let counts = file.counts();
        note!(
            "{}: {} curves, {} points",
            path.display(),
            counts.curves,
            counts.points
        );
    }
    Ok(())
}

/// The mesh that the cloth is laid over.
fn mesh(args: &UsdArgs, max_bytes: u64, loader: &Loader<'_>) -> Result<Option<Mesh>> {
    let (Some(path), Some(mm_per_uv)) = (&args.mesh, args.mm_per_uv) else {
        return Ok(None);
    };
    let usual = usual_mm_per_unit(path);
    let placement = Placement {
        mm_per_unit: args.mm_per_unit.map_or(usual, |mm| mm as f32),
        mm_per_uv: mm_per_uv as f32,
    };
    let mesh = read_mesh(path, placement, max_bytes, loader);
    let mesh = mesh.map_err(|why| match why {
        NoMesh::File(e) => e,
        NoMesh::Key(key, why) => InputError::of_option(key, why).in_file(path),
    })?;
    Ok(Some(mesh))
}

fn to_mitsuba(args: &MitsubaArgs) -> Result<()> {
    let folder = &args.outfile;
    if folder.exists() && !folder.is_dir() {
        return Err(of_file(folder, "is a file; expected a folder"));
    }
    let scene_path = folder.join("scene.xml");
    if folder.exists() {
        output::check_writable(&scene_path)?;
    }
    let context = args.work.context();
    let (file, scene, read) = watched(&context, |loader| {
        let loaded = organza_scene::load(&args.scene, &args.set.set, loader)?;
        loaded.file.camera(&args.scene)?;
        let scene = loaded.build(context.max_memory_bytes, loader)?;
        Ok((loaded.file, scene, loader.inputs()))
    })?;
    let _waiting = Waiting::new("writing", &context);
    let tiling = Tiling {
        repeats: args.repeats,
        around_mm: DVec3::from(file.camera(&args.scene)?.target_mm),
        max_bytes: context.memory_bytes(),
    };
    let export = mitsuba::export(&scene, file.render.spp, file.render.max_bounces, &tiling)
        .map_err(|why| of_file(&args.scene, why))?;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
    // The scene first: it stands for all, and a folder with one is whole.
    let mut files: Vec<(PathBuf, WriteFile<'_>)> = vec![(
        scene_path.clone(),
        Box::new(|out| Ok(out.write_all(export.xml.as_bytes())?)),
    )];
    for (name, grid) in &export.grids {
        let write: WriteFile<'_> =
            Box::new(|out| grid.write(out).context("writing the grid failed"));
        files.push((folder.join(name), write));
    }
    for (name, size, pixels) in &export.pictures {
        let picture = Picture::new(*size, pixels.clone());
        let write: WriteFile<'_> =
            Box::new(move |mut out| Ok(exr::write_colours(&picture, &mut out)?));
        files.push((folder.join(name), write));
    }
    for (path, _) in &files {
        output::check_not_an_input(path, read.iter().map(|i| &i.path))?;
    }
    output::write_files(files)?;
    if !args.work.common.quiet {
        for note in &export.notes {
            note!("note: {note}");
        }
        note!(
            "{}: {} grids, {} pictures",
            scene_path.display(),
            export.grids.len(),
            export.pictures.len()
        );
    }
    Ok(())
}
