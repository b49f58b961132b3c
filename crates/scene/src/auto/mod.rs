//! `model = "auto"`: the choice that a scene needs of a cloth, by what `organza
//! bench` has measured.

pub mod choice;
pub mod lit;
pub mod own_rows;
pub mod table;
pub mod table_file;

use crate::build_options::BuildOptions;
use crate::cloth_place::ClothPlace;
use crate::error::{InputError, Result};
use crate::fabric_file;
use crate::level::{Lod, LodName};
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::object::{ClothTable, ObjectTable};
use crate::representation::{Build, EXPLICIT_FIBRES, ModelKey, Representation, Tracker};
use crate::scene_build;
use crate::scene_file::{CacheName, IntegratorName, SceneFile};
use crate::{drape, read};
use lit::Lit;
use organza_basis::SegmentSource;
use organza_light::LightTable;
use organza_measure::{Cost, PICTURE_PIXELS};
use serde::Serialize;
use std::fmt;
use std::path::Path;
use table::{Candidate, Recommendation, Traits, candidates, nearest, recommend};

/// Error of a pixel, of model and noise together, that is tolerated unless a
/// cloth says otherwise: a share of the picture's mean.
const TOLERANCE: f64 = 0.1;

/// The greatest error that can be tolerated: at ten times the picture's brightness
/// every choice is within.
const MAX_TOLERANCE: f64 = 10.0;

/// What was chosen for a cloth, and why.
#[derive(Clone, Debug, Serialize)]
pub struct Chosen {
    /// Which of the scene's objects.
    pub object: usize,
    /// What was chosen, in words.
    pub what: String,
    /// Why, in words.
    pub why: String,
    /// Width of the narrowest pixel on the cloth.
    pub pixel_mm: f64,
    /// From where light comes.
    pub lit: Vec<Lit>,
    /// Error of a pixel that is tolerated, a share of the picture's mean.
    pub tolerance: f64,
    /// The fabric whose measurements were taken, and at which pixels.
    pub measured_on: String,
    /// Width of the pixels of those measurements.
    pub measured_pixel_mm: f64,
    /// What the table recommends.
    pub recommendation: Recommendation,
    #[serde(skip)]
    /// Whether explicit fibres were taken without the cache that the picture would have.
    walks_to_the_end: bool,
}

/// Puts what is chosen in the place of every `model = "auto"` of a scene. With
/// `integrator = "fibres"` nothing is left to choose.
///
/// # Errors
/// Keys that contradict the choice, and those of the camera and the fabrics.
pub fn resolve(
    file: &mut SceneFile,
    scene_path: &Path,
    loader: &Loader<'_>,
) -> Result<Vec<Chosen>> {
    let mut list = Vec::new();
    for i in 0..file.object.len() {
        let Some(ObjectTable::Cloth(table)) = file.object.get(i) else {
            continue;
        };
        let fail = |why: &str| InputError::keyed(format!("object[{i}]{why}")).in_file(scene_path);
        if table.model != Some(ModelKey::Auto) {
            if table.tolerance.is_some() {
                return Err(fail(".tolerance: belongs to model = \"auto\""));
            }
            continue;
        }
        check(table).map_err(|why| fail(&why))?;
        let mut table = table.clone();
        if file.render.integrator == IntegratorName::Fibres {
            table.model = Some(ModelKey::Is(&EXPLICIT_FIBRES));
        } else {
            let chosen = choose(file, i, &mut table, scene_path, loader)?;
            // The error of a cache would be above the tolerance, or its time longer.
            if chosen.walks_to_the_end && file.render.cache.is_none() {
                file.render.cache = Some(CacheName::Off);
            }
            list.push(chosen);
        }
        table.tolerance = None;
        if let Some(slot) = file.object.get_mut(i) {
            *slot = ObjectTable::Cloth(table);
        }
    }
    Ok(list)
}

impl fmt::Display for Chosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Chosen {
            object, what, why, ..
        } = self;
        write!(f, "object[{object}]: auto takes {what}: {why}")
    }
}

fn check(table: &ClothTable) -> Result<(), String> {
    let decided = [
        ("flake", table.flake.is_some()),
        ("local_visibility", table.local_visibility),
        ("first_events", table.first_events.is_some()),
        ("while_weight", table.while_weight.is_some()),
        ("lod", table.lod != Lod::Name(LodName::Auto)),
        ("voxel_um", table.voxel_um.is_some()),
    ];
    if let Some((key, _)) = decided.iter().find(|d| d.1) {
        return Err(format!(".{key}: model = \"auto\" decides it; leave it out"));
    }
    match table.tolerance {
        Some(t) if t > MAX_TOLERANCE => Err(format!(
            ".tolerance: expected at most {MAX_TOLERANCE}, ten times the picture's brightness, found {t:e}"
        )),
        Some(t) if t.is_nan() || t <= 0.0 => Err(format!(
            ".tolerance: expected a positive share of the picture's brightness such as 0.1, found {t}"
        )),
        _ => Ok(()),
    }
}

fn choose(
    file: &SceneFile,
    index: usize,
    table: &mut ClothTable,
    scene_path: &Path,
    loader: &Loader<'_>,
) -> Result<Chosen> {
    let fail = |why: &str| InputError::keyed(why).in_file(scene_path);
    let options = BuildOptions {
        scene_path,
        loader,
        max_memory_bytes: None,
    };
    let Some(seen) = &file.camera else {
        return Err(fail(&format!(
            "object[{index}].model: \"auto\" chooses by the camera's pixels; name a \
             representation, or add a [camera]"
        )));
    };
    let camera = scene_build::camera(file, scene_path)?;
    let path = read::beside(scene_path, &table.fabric);
    let mut fabric = fabric_file::load(&path, &[], loader)?;
    fabric
        .override_optics(&table.optics)
        .map_err(|why| fail(&format!("object[{index}].optics{why}")))?;
    let mesh = drape::mesh(table.mesh_keys(), index, &options)?;
    let place = ClothPlace {
        bounds_mm: fabric.cloth.tile().bounds_mm,
        mesh: mesh.as_ref(),
        max_memory_bytes: free_memory_bytes(),
        loader,
        scene_path,
    };
    let pixel_mm = f64::from(place.footprints_mm(&camera).0);
    let lit = if mesh.is_some() {
        Lit::ALL.to_vec()
    } else {
        let middle = f64::from(place.bounds_mm.centre().z);
        lit_sides(&file.light, seen.origin_mm[2], middle)
    };
    let traits = Traits::of(&fabric);
    let own = own_rows::own_rows(&path, &traits, loader)?;
    let is_own = own.is_some();
    let rows = own.unwrap_or_else(table_file::measured);
    let like = nearest(&rows, &traits, pixel_mm)
        .ok_or_else(|| fail("model = \"auto\": this build contains no measurements"))?;
    let by_kernel = file.object.len() == 1 && mesh.is_none();
    let regular = file.render.integrator == IntegratorName::Regular;
    let possible = |model: &Representation| match &model.build {
        _ if mesh.is_some() && !model.drapes => false,
        Build::ExplicitFibres(_) => !regular,
        // They neither keep all light nor are reciprocal.
        Build::Plies(_) => false,
        Build::Surface(_) => (model.is_ready)(&fabric, &path, loader),
        Build::Voxels(_) => true,
    };
    // A picture that learns its light takes the cache where it is within the tolerance.
    let learns = file.render.cache_plan(seen.resolution).is_some();
    let may_do_without = file.render.cache.is_none();
    // The tracker that the scene will have without a cache; rows of others stand in where the
    // table lacks it.
    let tracker = |model: &Representation| match &model.build {
        Build::Voxels(_) if regular => Tracker::Regular,
        Build::ExplicitFibres(_) | Build::Voxels(_) if !by_kernel => Tracker::Woodcock,
        _ => model.trackers.first().copied().unwrap_or(Tracker::Woodcock),
    };
    let of_view: Vec<&table::Row> = rows
        .iter()
        .filter(|r| r.fabric == like.fabric && r.pixel_mm == like.pixel_mm)
        .collect();
    let is_measured = |model: &Representation, tracker: Tracker| {
        let mut all = of_view.iter();
        all.any(|r| r.choice.model == model && r.choice.tracker == tracker)
    };
    let usable = of_view.iter().copied().filter(|r| {
        let (model, own) = (r.choice.model, r.choice.tracker);
        let is_cache_measured = is_measured(model, Tracker::Cached);
        if own == Tracker::Cached {
            return learns && possible(model);
        }
        if learns && is_cache_measured && !may_do_without {
            return false;
        }
        let wanted = tracker(model);
        let is_used = own == wanted || !is_measured(model, wanted);
        is_used && possible(model)
    });
    let pixels = seen.resolution.iter().map(|n| u64::from(*n)).product();
    let of_picture = candidates(usable, &lit).into_iter().map(|one| Candidate {
        cost: cost_of_picture(&one, pixels),
        ..one
    });
    let tolerance = table.tolerance.unwrap_or(TOLERANCE);
    let recommendation =
        recommend(&of_picture.collect::<Vec<_>>(), tolerance).ok_or_else(|| {
            fail("model = \"auto\": no measurement applies to this cloth; set a model")
        })?;
    let choice = recommendation.taken.choice;
    let own_um = fabric.file.voxel.size_um;
    set(table, &recommendation, own_um);
    let whose = if is_own {
        format!("measured in {}", own_rows::beside(&path).display())
    } else if like.traits.is_of(&traits) {
        format!("measured on {}", like.fabric)
    } else {
        format!("measured on {}, the fabric most like it", like.fabric)
    };
    Ok(Chosen {
        object: index,
        what: choice.description(own_um),
        why: why(&recommendation, pixel_mm, &lit, tolerance, like, &whose),
        pixel_mm,
        lit,
        tolerance,
        measured_on: like.fabric.clone(),
        measured_pixel_mm: like.pixel_mm,
        walks_to_the_end: learns
            && is_measured(&EXPLICIT_FIBRES, Tracker::Cached)
            && choice.model == &EXPLICIT_FIBRES
            && choice.tracker != Tracker::Cached,
        recommendation,
    })
}

/// What a candidate costs for a picture of so many pixels: a larger one has more samples, and
/// learns more light.
fn cost_of_picture(one: &Candidate, pixels: u64) -> Cost {
    let cost = one.cost.for_pixels(pixels);
    match one.choice.tracker {
        Tracker::Cached if pixels > PICTURE_PIXELS => Cost {
            setup_s: cost.setup_s * pixels as f64 / PICTURE_PIXELS as f64,
            ..cost
        },
        _ => cost,
    }
}

/// The keys of a cloth that make it what was chosen.
fn set(table: &mut ClothTable, recommendation: &Recommendation, own_um: f32) {
    let choice = recommendation.taken.choice;
    table.model = Some(ModelKey::Is(choice.model));
    if choice.model.voxels().is_some() {
        table.lod = Lod::Level(choice.level);
        table.voxel_um = Some(choice.voxel_scale * own_um);
    } else if choice.keeps_its_model() {
        table.lod = Lod::Name(LodName::Volume);
    }
}

fn why(
    r: &Recommendation,
    pixel_mm: f64,
    lit: &[Lit],
    tolerance: f64,
    like: &table::Row,
    whose: &str,
) -> String {
    let percent = |x: f64| format!("{:.1} %", 100.0 * x);
    let rmse = &r.taken.rmse;
    let is_fibres = r.taken.choice.model == &EXPLICIT_FIBRES;
    let fibres_are_fastest = is_fibres && r.taken.choice.tracker != Tracker::Cached;
    let error = if fibres_are_fastest && r.taken.choice.tracker == Tracker::Kernel {
        "the reference itself, and the fastest within".to_owned()
    } else if fibres_are_fastest {
        "no other choice is known to be within".to_owned()
    } else {
        let sides = format!(
            "error {} ({} to {})",
            percent(rmse.value),
            percent(rmse.low),
            percent(rmse.high)
        );
        match r.seconds {
            Some(_) => format!("{sides}, the fastest within"),
            None => format!("{sides}, the smallest error; no choice is within"),
        }
    };
    let gain = match (r.seconds, r.fibres_s) {
        (Some(own), Some(fibres)) if r.taken.choice.model != &EXPLICIT_FIBRES => {
            format!(", {:.1} times as fast as explicit fibres", fibres / own)
        }
        _ => String::new(),
    };
    let sides: Vec<&str> = lit.iter().map(|l| l.name()).collect();
    format!(
        "{error} {} for pixels of {pixel_mm:.3} mm lit from {}{gain}; {whose}, at pixels of {} mm",
        percent(tolerance),
        sides.join(" and "),
        like.pixel_mm
    )
}

/// From which sides of a flat cloth at height `middle`, seen from a camera at
/// height `camera`, light comes; from both when that is unknown.
fn lit_sides(lights: &[LightTable], camera: f64, middle: f64) -> Vec<Lit> {
    // Above, below.
    let mut from = [false; 2];
    for light in lights {
        let [above, below] = light.sides(middle);
        from = [from[0] || above, from[1] || below];
    }
    let [front, back] = if camera >= middle {
        from
    } else {
        [from[1], from[0]]
    };
    match (front, back) {
        (true, false) => vec![Lit::Front],
        (false, true) => vec![Lit::Back],
        _ => Lit::ALL.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lights(text: &str) -> Vec<LightTable> {
        #[derive(serde::Deserialize)]
        struct File {
            light: Vec<LightTable>,
        }
        toml::from_str::<File>(text).unwrap().light
    }

    #[test]
    fn lights_have_a_side() {
        let sun = lights(
            "[[light]]\nkind='directional'\ndirection=[0.0, 0.1, -1.0]\nirradiance=[1.0, 1.0, 1.0]",
        );
        assert_eq!(lit_sides(&sun, 5.0, 0.0), [Lit::Front]);
        assert_eq!(lit_sides(&sun, -5.0, 0.0), [Lit::Back]);
        let sky = lights("[[light]]\nkind='environment'\nradiance=[1.0, 1.0, 1.0]");
        assert_eq!(lit_sides(&sky, 5.0, 0.0), Lit::ALL);
        let half =
            lights("[[light]]\nkind='environment'\nradiance=[1.0, 1.0, 1.0]\nhemisphere='back'");
        assert_eq!(lit_sides(&half, 5.0, 0.0), [Lit::Back]);
        let panel = |z: f32| {
            lights(&format!(
                "[[light]]\nkind='rectangle'\ncorner_mm=[0.0, 0.0, {z:.1}]\nedge_u_mm=[0.0, 1.0, 0.0]\n\
                 edge_v_mm=[1.0, 0.0, 1.0]\nradiance=[1.0, 1.0, 1.0]"
            ))
        };
        assert_eq!(lit_sides(&panel(2.0), 5.0, 0.0), [Lit::Front]);
        assert_eq!(lit_sides(&panel(-0.5), 5.0, 0.0), Lit::ALL);
        assert_eq!(lit_sides(&[], 5.0, 0.0), Lit::ALL);
    }
}
