//! `[[object]]` of `kind = "cloth"`: a fabric, laid where a scene says.

use crate::cloth_levels::{Levels, Place};
use crate::drape;
use crate::error::{Result, input};
use crate::fabric_file::{Fabric, load, voxelize_planned};
use crate::fibre_optics;
use crate::memory::free_memory_bytes;
use crate::read;
use crate::scattering::ScatteringModel;
use crate::scene_build::BuildOptions;
use crate::scene_file::{ClothTable, Lod, LodName};
use organza_basis::SegmentSource;
use organza_transport::{AnyMedium, Camera, FibreEvent, LocalVisibility};
use organza_volume::Plan;
use std::sync::Arc;

/// Voxels to the spacing of threads that `lod = "auto"` keeps at least. Coarser
/// ones close the gaps between yarns, and save no time: see `docs/far_field.md`.
const VOXELS_ACROSS_THREAD: f32 = 12.0;

/// The fabric of the cloth that is a scene's object of this index, with the
/// object's optics, and what scatters light off it; `as_fibres` whatever its
/// model.
///
/// # Errors
/// Names the file and the key at fault.
fn fabric_and_model(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    options: &BuildOptions<'_>,
) -> Result<(Fabric, ScatteringModel)> {
    let scene_path = options.scene_path;
    let fail = |why: &str| input(format!("{}: object[{index}]{why}", scene_path.display()));
    let own_seed: Vec<String> = table.seed.iter().map(|s| format!("seed={s}")).collect();
    let mut fabric = load(
        &read::beside(scene_path, &table.fabric),
        &own_seed,
        options.loader,
    )?;
    fabric
        .override_optics(&table.optics)
        .map_err(|why| fail(&format!(".optics{why}")))?;
    let model = table
        .scattering()
        .over(fabric.file.scattering)
        .map_err(fail)?;
    if table.local_visibility && !matches!(model, ScatteringModel::Fibres(_)) {
        return Err(fail(
            ".local_visibility: belongs to model = \"virtual-scattering\"",
        ));
    }
    if as_fibres || model == ScatteringModel::Explicit {
        if table.mesh.is_some() {
            return Err(fail(
                ".mesh: fibres one by one lie flat; take another model",
            ));
        }
        return Ok((fabric, ScatteringModel::Explicit));
    }
    let is_named = |lod| matches!(lod, Lod::Name(LodName::Auto | LodName::Surface));
    if model == ScatteringModel::Surface && !is_named(table.lod) {
        return Err(fail(".lod: a surface has no levels; leave it out"));
    }
    Ok((fabric, model))
}

/// What voxelizing a scene's object will take.
///
/// # Errors
/// As [`Fabric::plan`]; a level that the cloth does not have, told before the
/// voxels are made, which takes its time.
fn plan<'a>(
    fabric: &'a Fabric,
    model: ScatteringModel,
    table: &ClothTable,
    index: usize,
    options: &BuildOptions<'_>,
) -> Result<Plan<'a>> {
    let plan = fabric.plan(
        &read::beside(options.scene_path, &table.fabric),
        model.footprint(),
        table.voxel_um,
        None,
        options.max_memory_bytes,
    )?;
    let level_count = plan.level_count();
    match table.lod {
        Lod::Level(level) if level >= level_count => Err(input(format!(
            "{}: object[{index}].lod: level {level} does not exist; the cloth has {level_count}, \
             from 0",
            options.scene_path.display()
        ))),
        _ => Ok(plan),
    }
}

/// Checks the cloth that is a scene's object of this index as far as that can be
/// without making voxels, and tells what scatters light off it.
///
/// # Errors
/// Those of [`medium`].
pub fn check(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    options: &BuildOptions<'_>,
) -> Result<ScatteringModel> {
    let (fabric, model) = fabric_and_model(table, index, as_fibres, options)?;
    drape::mesh(table, index, options)?;
    let path = read::beside(options.scene_path, &table.fabric);
    match model {
        ScatteringModel::Explicit => fabric.fibres(&path).map(|_| ())?,
        ScatteringModel::Surface => fabric.surface(&path).map(|_| ())?,
        _ if table.lod == Lod::Name(LodName::Surface) => fabric.surface(&path).map(|_| ())?,
        _ => plan(&fabric, model, table, index, options).map(|_| ())?,
    }
    Ok(model)
}

/// The cloth that is a scene's object of this index; `as_fibres` whatever its
/// model.
///
/// # Errors
/// Names the file and the key at fault.
pub fn medium(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    camera: &Camera,
    options: &BuildOptions<'_>,
) -> Result<AnyMedium> {
    let path = read::beside(options.scene_path, &table.fabric);
    let fail = |why: &str| {
        let scene = options.scene_path.display();
        input(format!("{scene}: object[{index}]{why}"))
    };
    let (fabric, model) = fabric_and_model(table, index, as_fibres, options)?;
    if model == ScatteringModel::Explicit {
        return fabric.explicit_fibres(&path, options.max_memory_bytes, options.loader);
    }
    let lod = match model {
        ScatteringModel::Surface => Lod::Name(LodName::Surface),
        _ => table.lod,
    };
    let mesh = drape::mesh(table, index, options)?;
    let mut place = Place {
        bounds_mm: fabric.cloth.tile().bounds_mm,
        mesh: mesh.as_ref(),
        max_memory_bytes: options.max_memory_bytes.unwrap_or_else(free_memory_bytes),
        loader: options.loader,
        scene_path: options.scene_path,
    };
    if lod == Lod::Name(LodName::Surface) {
        return place
            .sheet_alone(fabric.far_sheet(&path)?)?
            .ok_or_else(|| fail(".fabric: its tile has no volume"));
    }
    let plan = plan(&fabric, model, table, index, options)?;
    let octree = Arc::new(voxelize_planned(&path, &plan, options.loader)?);
    if mesh.is_some() && !octree.repeats() {
        return Err(fail(".mesh: wants a cloth that repeats, which this is not"));
    }
    place.bounds_mm = octree.bounds_mm();
    let sheet = match (&fabric.file.surface, lod) {
        (Some(_), Lod::Name(LodName::Auto)) => Some(fabric.far_sheet(&path)?),
        _ => None,
    };
    let (name, levels) = match lod {
        Lod::Level(level) => (format!("level {level}"), Levels::only(level)),
        Lod::Name(LodName::Auto) => {
            let finest = if model == ScatteringModel::Fibres(FibreEvent::Packed) {
                fibre_optics::level_for_packed(&octree, fabric.cloth.materials())
            } else {
                0
            };
            let repeat_mm = sheet.as_ref().map(|s| s.repeat_mm);
            let widths = place.footprints_mm(camera);
            let most_mm = fabric.thread_spacing_mm() / VOXELS_ACROSS_THREAD;
            let levels = Levels::for_footprints(&octree, finest, most_mm, repeat_mm, widths);
            ("auto".into(), levels)
        }
        Lod::Name(_) => ("volume".into(), Levels::only(0)),
    };
    let volume = |level| {
        let medium = model.medium(&fabric, &path, Arc::clone(&octree), level)?;
        let Some(AnyMedium::Fibres(medium)) = medium else {
            return Ok(medium);
        };
        if !table.local_visibility {
            return Ok(Some(AnyMedium::Fibres(medium)));
        }
        let (corner_mm, voxel_mm) = (octree.bounds_mm().min, octree.voxel_mm(level));
        let fibres = fabric.trace_fibres(&path, options.max_memory_bytes, options.loader)?;
        let (materials, seed) = (octree.material_count(), fabric.file.seed);
        let local = LocalVisibility::count(&fibres, materials, corner_mm, voxel_mm, seed)
            .map_err(|e| input(format!("{}: {e}", path.display())))?;
        Ok(Some(AnyMedium::Fibres(medium.with_local_visibility(local))))
    };
    levels.medium(&place, sheet, volume)?.ok_or_else(|| {
        let levels = octree.level_count();
        fail(&format!(
            ".lod: {name} does not exist; the cloth has {levels}, from 0"
        ))
    })
}
