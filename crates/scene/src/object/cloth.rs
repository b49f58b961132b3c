//! `kind = "cloth"`: a fabric, laid where a scene says.

use super::laying::Laying;
use super::{At, ObjectKind};
use crate::build_options::BuildOptions;
use crate::cloth_place::{ClothPlace, FarSheet};
use crate::crease::Crease;
use crate::crush::{Crush, CrushedLean};
use crate::drape::{self, MeshKeys};
use crate::error::{InputError, Result};
use crate::fabric_file::{Fabric, load};
use crate::far_table::far_table;
use crate::fringe::{self, Fringe};
use crate::level::{Levels, Lod, LodName};
use crate::memory::free_memory_bytes;
use crate::optics::OpticsFile;
use crate::read;
use crate::representation::{Build, EXPLICIT_FIBRES, ModelKey, ShownAs, VoxelBuild, owners};
use crate::scattering::ScatteringTable;
use crate::stitch::{self, Row, Stitch};
use crate::stroke::{HandPath, Stroke};
use crate::volume_cache::VolumePlan;
use glam::DVec3;
use organza_basis::{Budget, CellGrid, SegmentSource};
use organza_mesh::{Mesh, Shell};
use organza_scatter::FlakeFamily;
use organza_transport::{AnyMedium, Camera};
use organza_weave::ThreadSystem;
use serde::Deserialize;
use serde_json::{Value, json};

/// Places farther from the origin are too coarse in single precision, in which voxels and
/// surfaces are looked up in flat cloth: at 1e6 mm pictures of both were seen to be off by 10
/// to 20 %.
const FAR_MM: f64 = 1e5;

/// The most faces that a mesh is divided into, so that strokes, crushed pile, creases and stitches
/// show.
const MAX_FACES: u64 = 4 << 20;

/// A cloth: a fabric, laid where the scene says.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClothTable {
    /// A fabric file.
    pub fabric: String,
    /// How it is shown; as the fabric's `[scattering]` states if none.
    pub model: Option<ModelKey>,
    /// Micro-flakes: their family.
    pub flake: Option<FlakeFamily>,
    /// Virtual scattering: direct light of the first event sees what stands in
    /// its way within two voxels as tables counted from the fibres tell.
    #[serde(default)]
    pub local_visibility: bool,
    /// Packed fibres: so many events of a path are with explicit fibres.
    pub first_events: Option<u32>,
    /// Packed fibres: events are with explicit fibres while the path carries at least this
    /// share of what it began with.
    pub while_weight: Option<f32>,
    /// How fibres scatter, before what the fabric says of it.
    #[serde(default)]
    pub optics: OpticsFile,
    /// Level of detail.
    #[serde(default)]
    pub lod: Lod,
    /// With model = "auto": error of a pixel, a share of the picture's mean, that
    /// is tolerated.
    pub tolerance: Option<f64>,
    /// A mesh with texture coordinates to lay the cloth over.
    pub mesh: Option<String>,
    /// With `mesh`: length of its units; 1000 for glTF and else 1, if none.
    pub mm_per_unit: Option<f32>,
    /// With `mesh`: cloth to a unit of texture coordinate.
    pub mm_per_uv: Option<f32>,
    /// With `mesh`: strokes over the pile, one after the other.
    #[serde(default)]
    pub stroke: Vec<Stroke>,
    /// With `mesh`: pile that was crushed before the strokes.
    pub crush: Option<Crush>,
    /// With `mesh`: pressed creases.
    #[serde(default)]
    pub crease: Vec<Crease>,
    /// With `mesh` and explicit fibres: where it is unravelled.
    #[serde(default)]
    pub fringe: Vec<Fringe>,
    /// With `mesh`: rows of stitches.
    #[serde(default)]
    pub stitch: Vec<Stitch>,
    /// Overrides the fabric's own voxel size.
    pub voxel_um: Option<f32>,
    /// Overrides the fabric's own seed.
    pub seed: Option<u64>,
    /// Where the cloth is: x and y of two corners; without end if none.
    pub extent_mm: Option<[f32; 4]>,
}

impl ClothTable {
    /// The keys that name its mesh.
    pub fn mesh_keys(&self) -> MeshKeys<'_> {
        MeshKeys {
            mesh: self.mesh.as_deref(),
            mm_per_unit: self.mm_per_unit,
            mm_per_uv: self.mm_per_uv,
        }
    }

    /// Its keys of a [`ScatteringTable`].
    pub fn scattering(&self) -> ScatteringTable {
        ScatteringTable {
            model: self.model,
            flake: self.flake,
            first_events: self.first_events,
            while_weight: self.while_weight,
        }
    }
}

impl ObjectKind for ClothTable {
    fn check(&self, at: &At<'_>) -> Result<()> {
        let fabric = read::beside(at.scene_path, &self.fabric);
        if let Some(why) = at.loader.unreachable(&fabric) {
            return Err(InputError {
                is_missing: why.is_missing,
                ..at.fail(format!(".fabric: {why}"))
            });
        }
        if self.extent_mm.is_some() && self.mesh.is_some() {
            return Err(at.fail(": extent_mm is for flat cloth and does not go with mesh"));
        }
        for (key, is_given) in [
            ("stroke", !self.stroke.is_empty()),
            ("crush", self.crush.is_some()),
            ("crease", !self.crease.is_empty()),
            ("fringe", !self.fringe.is_empty()),
            ("stitch", !self.stitch.is_empty()),
        ] {
            if is_given && self.mesh.is_none() {
                return Err(at.fail(format!(".{key}: belongs to a `mesh`, which is not given")));
            }
        }
        for (i, stitch) in self.stitch.iter().enumerate() {
            let checked = stitch.check();
            checked.map_err(|why| at.fail(format!(".stitch[{i}]{why}")))?;
        }
        for (i, stroke) in self.stroke.iter().enumerate() {
            let checked = stroke.check();
            checked.map_err(|why| at.fail(format!(".stroke[{i}]{why}")))?;
        }
        if let Some(crush) = &self.crush {
            let checked = crush.check();
            checked.map_err(|why| at.fail(format!(".crush{why}")))?;
        }
        for (i, crease) in self.crease.iter().enumerate() {
            let checked = crease.check();
            checked.map_err(|why| at.fail(format!(".crease[{i}]{why}")))?;
        }
        for (i, fringe) in self.fringe.iter().enumerate() {
            let checked = fringe.check();
            checked.map_err(|why| at.fail(format!(".fringe[{i}]{why}")))?;
        }
        if let Some(found) = self.voxel_um.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(at.fail(format!(
                ".voxel_um: expected a positive number of micrometres, found {found}"
            )));
        }
        Ok(())
    }

    fn extent_mm(&self) -> Option<[f32; 4]> {
        self.extent_mm
    }

    fn describe(&self, at: &At<'_>, options: &BuildOptions<'_>) -> Result<Value> {
        let shown = check(self, at.index, at.as_fibres, options)?;
        let mut about = json!({ "fabric": self.fabric, "model": shown.to_string() });
        if let Some(mesh) = &self.mesh {
            about["mesh"] = json!(mesh);
        }
        Ok(about)
    }

    fn media(
        &self,
        at: &At<'_>,
        camera: &Camera,
        options: &BuildOptions<'_>,
        _: &mut Budget,
    ) -> Result<Vec<AnyMedium>> {
        media(self, at.index, at.as_fibres, camera, options)
    }
}

/// The fabric of the cloth that is a scene's object of this index, with the
/// object's optics, and how it is shown; `as_fibres` whatever its model.
///
/// # Errors
/// Names the file and the key at fault.
fn fabric_and_showing(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    options: &BuildOptions<'_>,
) -> Result<(Fabric, ShownAs)> {
    let scene_path = options.scene_path;
    let fail = |why: &str| InputError::keyed(format!("object[{index}]{why}")).in_file(scene_path);
    let own_seed: Vec<String> = table.seed.iter().map(|s| format!("seed={s}")).collect();
    let mut fabric = load(
        &read::beside(scene_path, &table.fabric),
        &own_seed,
        options.loader,
    )?;
    fabric
        .override_optics(&table.optics)
        .map_err(|why| fail(&format!(".optics{why}")))?;
    let shown = table.scattering().over(fabric.file.scattering);
    let mut shown = shown.map_err(|why| fail(&why))?;
    shown.settings.local_visibility = table.local_visibility;
    if table.local_visibility && !shown.representation.has_key("local_visibility") {
        let why = format!(
            ".local_visibility: belongs to {}",
            owners("local_visibility")
        );
        return Err(fail(&why));
    }
    if shown.settings.packed_from.switch().is_some() {
        let refused = [
            ("mesh", table.mesh.is_some(), "a flat cloth"),
            (
                "lod",
                table.lod == Lod::Name(LodName::Auto),
                "one level, such as 0",
            ),
            (
                "local_visibility",
                table.local_visibility,
                "a volume without tables",
            ),
        ];
        if let Some((key, _, needed)) = refused.iter().find(|r| r.1) {
            return Err(fail(&format!(
                ".{key}: first_events and while_weight need {needed}; leave them out or this key"
            )));
        }
    }
    for (key, is_given) in [
        ("stroke", !table.stroke.is_empty()),
        ("crush", table.crush.is_some()),
    ] {
        if is_given && fabric.file.pile.is_none() {
            return Err(fail(&format!(".{key}: the fabric has no [pile]")));
        }
    }
    if as_fibres {
        shown = ShownAs::usual(&EXPLICIT_FIBRES);
    }
    let representation = shown.representation;
    if table.mesh.is_some() && !representation.drapes {
        return Err(fail(&format!(
            ".mesh: model = {:?} needs a flat cloth; choose another model",
            representation.name
        )));
    }
    if !table.fringe.is_empty() && !matches!(representation.build, Build::ExplicitFibres(_)) {
        return Err(fail(".fringe: needs model = \"fibres\""));
    }
    if let Some(i) = fringe::without_threads(&table.fringe, &fabric.cloth) {
        return Err(fail(&format!(
            ".fringe[{i}]: needs a fabric with warp and weft"
        )));
    }
    let is_named = |lod| matches!(lod, Lod::Name(LodName::Auto | LodName::Surface));
    if matches!(representation.build, Build::Surface(_)) && !is_named(table.lod) {
        return Err(fail(".lod: a surface has no levels; leave it out"));
    }
    Ok((fabric, shown))
}

/// What voxelizing a scene's object will take.
///
/// # Errors
/// As [`Fabric::plan`]; a level that the cloth does not have, reported before the
/// voxels are made, which takes its time.
fn plan<'a>(
    fabric: &'a Fabric,
    voxels: &VoxelBuild,
    table: &ClothTable,
    index: usize,
    options: &BuildOptions<'_>,
) -> Result<VolumePlan<'a>> {
    let plan = fabric
        .plan(
            &read::beside(options.scene_path, &table.fabric),
            voxels.footprint,
            table.voxel_um,
            None,
            options.max_memory_bytes,
        )
        .map_err(|e| match table.voxel_um {
            // Voxels that the scene asked for are no fault of the fabric.
            Some(um) => InputError {
                runs_on: true,
                ..InputError::of_key(
                    options.scene_path,
                    format!("object[{index}].voxel_um"),
                    format!("= {um}: {e}"),
                )
            },
            None => e,
        })?;
    let level_count = plan.level_count();
    match table.lod {
        Lod::Level(level) if level >= level_count => Err(InputError::of_key(
            options.scene_path,
            format!("object[{index}].lod"),
            format!("level {level} does not exist; the cloth has {level_count}, from 0"),
        )),
        _ => Ok(plan),
    }
}

/// Checks the cloth that is a scene's object of this index as far as that can be
/// without making voxels, and returns how it is shown.
///
/// # Errors
/// Those of [`medium`].
fn check(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    options: &BuildOptions<'_>,
) -> Result<ShownAs> {
    let (fabric, shown) = fabric_and_showing(table, index, as_fibres, options)?;
    drape::mesh(table.mesh_keys(), index, options)?;
    rows(table, &fabric, index, options)?;
    crushed_lean(table, index, options)?;
    let path = read::beside(options.scene_path, &table.fabric);
    match shown.representation.voxels() {
        Some(_) if table.lod == Lod::Name(LodName::Surface) => fabric.surface(&path).map(|_| ())?,
        Some(voxels) => plan(&fabric, voxels, table, index, options).map(|_| ())?,
        None => (shown.representation.check)(&fabric, &path, options.loader)?,
    }
    Ok(shown)
}

/// How far from the origin, along x or y, flat cloth is looked at: where the camera's axis meets
/// its plane, or where the camera is, if that is nearer.
fn looked_at_mm(camera: &Camera) -> f64 {
    let parts = camera.parts();
    let (from, ahead) = (parts.origin_mm, parts.forward);
    let to_plane_mm = -from.z / ahead.z;
    let ahead_mm = if to_plane_mm.is_finite() {
        to_plane_mm
    } else {
        0.0
    };
    let along = |p: DVec3| p.truncate().abs().max_element();
    along(from).min(along(from + ahead_mm * ahead))
}

/// The rows of stitches on the cloth that is a scene's object of this index, and the thickness of the
/// cloth.
///
/// # Errors
/// Names the key at fault.
fn rows<'a>(
    table: &'a ClothTable,
    fabric: &Fabric,
    index: usize,
    options: &BuildOptions<'_>,
) -> Result<(Vec<Row<'a>>, f64)> {
    if table.stitch.is_empty() {
        return Ok((Vec::new(), 0.0));
    }
    let thickness_mm = fabric.cloth.figures().thickness_mm;
    let seed = fabric.file.seed;
    let row = |(i, stitch): (usize, &'a Stitch)| {
        Row::new(stitch, fabric, thickness_mm, seed ^ i as u64).map_err(|why| {
            let key = format!("object[{index}].stitch[{i}]{why}");
            InputError::keyed(key).in_file(options.scene_path)
        })
    };
    let rows = table.stitch.iter().enumerate().map(row);
    Ok((rows.collect::<Result<_>>()?, thickness_mm))
}

/// The lean of the crushed pile of the cloth that is a scene's object of this index.
///
/// # Errors
/// Names the key at fault.
fn crushed_lean(
    table: &ClothTable,
    index: usize,
    options: &BuildOptions<'_>,
) -> Result<Option<CrushedLean>> {
    let lean =
        |crush: &Crush| crush.lean(options.scene_path, options.max_memory_bytes, options.loader);
    let lean = table.crush.as_ref().map(lean).transpose();
    lean.map_err(|e| {
        e.at_key(format!("object[{index}].crush.map"))
            .in_file(options.scene_path)
    })
}

/// The cloth that is a scene's object of this index, and the threads that it is sewn with; `as_fibres`
/// whatever its model.
///
/// # Errors
/// Names the file and the key at fault.
fn media(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    camera: &Camera,
    options: &BuildOptions<'_>,
) -> Result<Vec<AnyMedium>> {
    let (fabric, shown) = fabric_and_showing(table, index, as_fibres, options)?;
    let fail = |why: String| {
        InputError::keyed(format!("object[{index}].{why}")).in_file(options.scene_path)
    };
    let max_bytes = || options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
    let mut mesh = drape::mesh(table.mesh_keys(), index, options)?;
    let (rows, thickness_mm) = rows(table, &fabric, index, options)?;
    let (mut threads, mut fringes) = (Vec::new(), Vec::new());
    if let Some(mesh) = &mut mesh {
        threads = stitch::threads(&rows, mesh, &fabric, max_bytes())
            .map_err(|why| fail(format!("stitch{why}")))?;
        let crush = crushed_lean(table, index, options)?;
        let paths: Vec<HandPath> = table.stroke.iter().map(Stroke::path).collect();
        let crushed_mm = crush
            .as_ref()
            .map_or(f32::INFINITY, CrushedLean::longest_edge_mm);
        let longest = |at_mm| {
            let strokes = paths.iter().map(|path| path.longest_edge_mm(at_mm));
            let creases = table.crease.iter().map(|c| c.longest_edge_mm(at_mm));
            let rows = stitch::longest_edge_mm(&rows, at_mm).min(crushed_mm);
            strokes.chain(creases).fold(rows, f32::min)
        };
        // Faces are counted with the shell that they become.
        let most_faces = (max_bytes() / Shell::memory_bytes(1)).min(MAX_FACES) as usize;
        fringe::cut(&table.fringe, &fabric.cloth, mesh, most_faces)
            .map_err(|e| fail(format!("fringe: {e}")))?;
        mesh.refine(longest, most_faces).map_err(|e| {
            fail(format!(
                "mesh: with short edges at strokes, crushed pile, creases and stitches: {e}"
            ))
        })?;
        stitch::pierce(&rows, mesh).map_err(|why| fail(format!("stitch{why}")))?;
        stitch::press(&rows, mesh, thickness_mm);
        Crease::flatten(&table.crease, mesh);
        if crush.is_some() || !paths.is_empty() {
            mesh.lean(|at_mm| {
                let crushed = crush.as_ref().map(|c| c.tangent_at(at_mm));
                HandPath::tangent_after(&paths, at_mm, crushed.unwrap_or_default())
            });
        }
        fringes = fringe::take(&table.fringe, &fabric, mesh, most_faces)
            .map_err(|why| fail(format!("fringe{why}")))?;
    }
    let laid = (mesh, fringes);
    let mut media = on_mesh(
        table, index, as_fibres, camera, options, &fabric, shown, laid,
    )?;
    let path = read::beside(options.scene_path, &table.fabric);
    for cloth in &threads {
        let fibres = fabric.explicit_threads(cloth, &path, max_bytes(), options.loader)?;
        let place = ClothPlace {
            bounds_mm: cloth.tile().bounds_mm,
            mesh: None,
            max_memory_bytes: max_bytes(),
            loader: options.loader,
            scene_path: options.scene_path,
        };
        let mut once = Some(AnyMedium::ExplicitFibres(fibres));
        let laid = Levels::only(0).medium(&place, None, |_| Ok(once.take()))?;
        media.extend(laid);
    }
    Ok(media)
}

/// The cloth that is a scene's object of this index, on its mesh, and its fringes on
/// theirs; `as_fibres` whatever its model.
///
/// # Errors
/// Names the file and the key at fault.
fn on_mesh(
    table: &ClothTable,
    index: usize,
    as_fibres: bool,
    camera: &Camera,
    options: &BuildOptions<'_>,
    fabric: &Fabric,
    shown: ShownAs,
    (mesh, fringes): (Option<Mesh>, Vec<(ThreadSystem, Mesh)>),
) -> Result<Vec<AnyMedium>> {
    let path = read::beside(options.scene_path, &table.fabric);
    let fail =
        |why: &str| InputError::keyed(format!("object[{index}]{why}")).in_file(options.scene_path);
    let is_curves = matches!(
        shown.representation.build,
        Build::ExplicitFibres(_) | Build::Plies(_)
    );
    let looked_at_mm = looked_at_mm(camera);
    if mesh.is_none() && !is_curves && looked_at_mm > FAR_MM {
        let why = format!(
            "object[{index}]: the camera looks at a place {looked_at_mm:.0} mm from the origin; \
             beyond {FAR_MM:e} mm flat cloth is inexact unless its model is \"fibres\" or \
             \"plies\": move camera and lights towards the origin"
        );
        options.loader.warn(options.scene_path, why);
    }
    let place = ClothPlace {
        bounds_mm: fabric.cloth.tile().bounds_mm,
        mesh: mesh.as_ref(),
        max_memory_bytes: options.max_memory_bytes.unwrap_or_else(free_memory_bytes),
        loader: options.loader,
        scene_path: options.scene_path,
    };
    let alone = |sheet: FarSheet<'_>| {
        let laid = place.sheet_alone(sheet)?;
        let laid = laid.ok_or_else(|| fail(".fabric: its tile has no volume"))?;
        Ok(vec![laid])
    };
    let lod = table.lod;
    // Beyond curves, which have no levels of their own, a far-field table is seen.
    let build = &shown.representation.build;
    let has_curves = matches!(build, Build::ExplicitFibres(_) | Build::Plies(_));
    let far = match lod {
        Lod::Name(LodName::Auto) if has_curves && !as_fibres => {
            far_table(fabric, &path, options.loader)?.map(FarSheet::from)
        }
        _ => None,
    };
    let (nearest, farthest) = place.footprints_mm(camera);
    let is_far = |sheet: &FarSheet<'_>| nearest >= sheet.repeat_mm;
    let beyond = match far {
        // A fringe has no table.
        Some(sheet) if is_far(&sheet) && fringes.is_empty() => return alone(sheet),
        beyond => beyond,
    };
    // Curves that rays meet, with the box that they take.
    let traced = |curves: AnyMedium, mut place: ClothPlace<'_>| {
        let reach = curves.cell_grid();
        let repeats = reach.is_some_and(CellGrid::repeats);
        if place.mesh.is_some() && !repeats {
            return Err(fail(".mesh: needs a cloth that repeats; this one does not"));
        }
        place.bounds_mm = reach.map_or(place.bounds_mm, CellGrid::bounds_mm);
        let sheet = beyond.filter(|_| repeats);
        let levels = match &sheet {
            Some(sheet) => Levels::near_and_far(sheet.repeat_mm, farthest),
            None => Levels::only(0),
        };
        let mut once = Some(curves);
        let laid = levels.medium(&place, sheet, |_| Ok(once.take()))?;
        let laid = laid.ok_or_else(|| fail(".mesh: the cloth cannot be laid over it"))?;
        let mut media = fringe::media(&fringes, fabric, &path, &place, options)?;
        media.insert(0, laid);
        Ok(media)
    };
    let voxels = match &shown.representation.build {
        Build::ExplicitFibres(trace) => {
            let fibres = trace(fabric, &path, options.max_memory_bytes, options.loader)?;
            return traced(AnyMedium::ExplicitFibres(fibres), place);
        }
        Build::Plies(trace) => {
            let plies = trace(fabric, &path, options.max_memory_bytes, options.loader)?;
            return traced(AnyMedium::Plies(plies), place);
        }
        Build::Surface(surface) => return alone(surface(fabric, &path, options.loader)?.into()),
        Build::Voxels(_) if lod == Lod::Name(LodName::Surface) => {
            return alone(fabric.surface(&path)?.into());
        }
        Build::Voxels(voxels) => voxels,
    };
    let plan = plan(fabric, voxels, table, index, options)?;
    let limit = options.max_memory_bytes;
    let octree = fabric.voxelize_planned(&path, &plan, limit, options.loader)?;
    let laying = Laying {
        fabric,
        path: &path,
        voxels,
        settings: shown.settings,
        lod,
        scale: 1.0,
        index,
        camera,
        options,
    };
    Ok(vec![laying.medium(place, octree)?])
}
