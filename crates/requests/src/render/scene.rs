//! The scene of a render, read, checked and built.

use super::RenderJob;
use anyhow::Result;
use glam::UVec2;
use organza_scene::auto::Chosen;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::scene_file::{self, SceneFile};
use organza_scene::{LoadedScene, scene_build};
use organza_transport::{Crop, Film, Integrator, RenderSettings, Scene};
use organza_work::identity::{self, NamedDigest, crop_edges};
use organza_work::{InputError, after_option, checkpoint, of_key, output};
use std::ops::Range;

/// A scene that is ready to be rendered.
pub struct Built {
    /// Its file.
    pub file: SceneFile,
    /// The scene.
    pub scene: Scene,
    /// What was chosen where the file says `auto`.
    pub chosen: Vec<Chosen>,
    /// Memory that the film leaves, bytes.
    pub max_bytes: u64,
    /// The files that the scene names.
    pub inputs: Vec<NamedDigest>,
    /// See [`identity::scene_digest`].
    pub digest: String,
    /// See [`identity::lit_digest`].
    pub lit: String,
}

/// Samples that are taken at most for a target error, if no others are asked for.
const MOST_SAMPLES: u32 = 65_536;

/// Builds the scene of a request.
///
/// # Errors
/// A wrong scene, or one that needs more memory than allowed; an output that is
/// one of its files.
pub fn build(args: &RenderJob, loader: &Loader<'_>) -> Result<Built> {
    let mut file = scene_file::load(&args.scene, &args.set, loader)?;
    let table: toml::Table = loader.toml_of(&args.scene, &args.set, Wanted::Scene)?;
    let until_reached = || args.targets().are_given().then_some(MOST_SAMPLES);
    if let Some(spp) = args.spp.or_else(until_reached) {
        file.render.spp = spp;
    }
    if let Some(seed) = args.seed {
        file.render.seed = seed;
    }
    if let Some(clamp) = args.clamp {
        file.render.clamp = Some(clamp as f32);
    }
    check(args, &file, loader)?;
    let max_bytes = memory_beside_film(args, &file)?;
    let loaded = LoadedScene::new(file, &args.scene, loader)?;
    for chosen in &loaded.chosen {
        args.context
            .note(format!("{}: {chosen}", args.scene.display()));
    }
    let scene = loaded.build(Some(max_bytes), loader)?;
    let LoadedScene { file, chosen, .. } = loaded;
    let read = loader.inputs();
    args.context.check_outputs(loader)?;
    for path in args.checkpoint.iter().chain(&args.save_light) {
        output::check_not_an_input(path, read.iter().map(|i| &i.path))?;
    }
    let mut decided: Vec<String> = chosen
        .iter()
        .map(|c| format!("object {}: {}", c.object, c.what))
        .collect();
    let lit = identity::lit_digest(&table, &decided);
    decided.extend(file.render.clamp.map(|limit| format!("clamp {limit}")));
    Ok(Built {
        digest: identity::scene_digest(&table, &decided),
        lit,
        inputs: identity::named_inputs(&args.scene, &read),
        file,
        scene,
        chosen,
        max_bytes,
    })
}

/// The size of the picture of a scene that is read and checked.
pub fn resolution(args: &RenderJob) -> Result<[u32; 2]> {
    let loader = args.context.loader();
    let file = scene_file::load(&args.scene, &args.set, &loader)?;
    scene_build::check(&file, &args.scene, &loader)?;
    Ok(file.camera(&args.scene)?.resolution)
}

/// Refuses before anything is voxelized what can be checked by then.
fn check(args: &RenderJob, file: &SceneFile, loader: &Loader<'_>) -> Result<()> {
    let fail = |why| InputError::keyed(format!("render.{why}")).in_file(&args.scene);
    file.render.check().map_err(fail)?;
    scene_build::check(file, &args.scene, loader)?;
    let size = UVec2::from(file.camera(&args.scene)?.resolution);
    let crop = args.crop.unwrap_or(Crop::new(UVec2::ZERO, size));
    if let Some(why) = crop_fault(crop, size) {
        return Err(after_option(
            "crop",
            format!("{}: {why}", organza_work::keys::listed(&crop_edges(crop))),
        ));
    }
    if let Some(path) = args.checkpoint.as_deref().filter(|_| args.resume) {
        checkpoint::check(path, file.render.seed, crop, &samples(args, file))?;
    }
    scene_build::warn_of_emptiness(file, &args.scene, loader);
    Ok(())
}

/// Which edge of a crop is where it cannot be.
fn crop_fault(crop: Crop, size: UVec2) -> Option<String> {
    let Crop { min, max } = crop;
    for (near, first, far, last, pixels, extent) in [
        ("left", min.x, "right", max.x, size.x, "wide"),
        ("top", min.y, "bottom", max.y, size.y, "high"),
    ] {
        if last > pixels {
            return Some(format!(
                "its {far} edge {last} lies beyond the picture, which is {pixels} pixels {extent}"
            ));
        }
        if first >= last {
            return Some(format!(
                "its {near} edge {first} is not before its {far} edge {last}; no pixel is left"
            ));
        }
    }
    None
}

/// The samples of every pixel that are asked for.
fn samples(args: &RenderJob, file: &SceneFile) -> Range<u64> {
    let all = || 0..u64::from(file.render.spp);
    args.samples.clone().unwrap_or_else(all)
}

/// Memory that the film leaves to the scene. The film is held twice when it is
/// written or resumed.
fn memory_beside_film(args: &RenderJob, file: &SceneFile) -> Result<u64> {
    let whole = UVec2::from(file.camera(&args.scene)?.resolution);
    let size = args
        .crop
        .map_or(whole, |c| c.max.min(whole).saturating_sub(c.min));
    let most = args.context.memory_bytes();
    let shown = args.context.listener.picture_bytes(size.x, size.y);
    let films = if file.render.direct { 2 } else { 1 };
    let needed = Film::memory_bytes(size).saturating_mul(2 * films) + shown;
    most.checked_sub(needed).ok_or_else(|| {
        of_key(
            &args.scene,
            "camera.resolution",
            format!(
                "a film of {} x {} pixels needs {needed} bytes of memory, {most} are allowed: \
                 render fewer pixels, or parts of them with --crop",
                size.x, size.y
            ),
        )
    })
}

/// How the scene is to be rendered.
///
/// # Errors
/// An integrator that cannot take this scene.
pub fn settings(args: &RenderJob, file: &SceneFile, scene: &Scene) -> Result<RenderSettings> {
    let integrator = Integrator::from(file.render.integrator);
    if integrator == Integrator::Regular && !scene.media.iter().all(|m| m.is_piecewise_constant()) {
        return Err(of_key(
            &args.scene,
            "render.integrator",
            "\"regular\" steps through constant voxels; use interpolation = \"nearest\" and grids \
             of one resolution, model = \"plain\" in place of \"packed\", or \"woodcock\"",
        ));
    }
    Ok(RenderSettings {
        integrator,
        samples: samples(args, file),
        max_bounces: file.render.max_bounces.unwrap_or(u32::MAX),
        seed: file.render.seed,
        crop: args.crop,
    })
}
