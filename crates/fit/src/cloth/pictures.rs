//! Computed photographs of a trial cloth, folded as the real ones are.

use super::model::{ClothModel, Purpose, Trial};
use super::sides::{Side, View, direction};
use anyhow::Result;
use glam::{DVec2, DVec3, UVec2};
use organza_photograph::{Folding, Shading, ShadingSums};
use organza_scene::loader::Loader;
use organza_transport::{
    Camera, EngineChoice, Film, Integrator, Pixel, Projection, RenderSettings, Rendering, Scene,
    engine,
};
use organza_weave::Draft;
use organza_work::input;
use serde_json::json;

/// Pixels of a computed photograph along a texel, where that is not too many.
const PIXELS: f64 = 2.0;
/// Fine texels along a texel.
const FINE: usize = 4;
/// Pixels at most.
const MAX_PIXELS: f64 = (1 << 20) as f64;
/// Distance from which parallel rays look, mm.
const FAR_MM: f64 = 1e3;
/// Scattering events of a path at most.
const MAX_BOUNCES: u32 = 1000;

/// The size of a computed photograph.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Threads of each system of the trial cloth, at least.
    pub threads: usize,
    /// Paths per texel of that cloth.
    pub paths: u64,
    /// Most fibres of its yarns; where more are due, they are thicker.
    pub most_fibres: f64,
    /// Lays the fibres and draws the paths.
    pub seed: u64,
}

/// A computed photograph, folded on texels so fine that it can be moved.
#[derive(Clone, Debug)]
pub struct Computed {
    texels: [usize; 2],
    fine: Folding,
    /// What is known besides where light and view differ from place to place.
    uneven: Option<Uneven>,
}

/// A computed photograph of places that are lit and seen from different directions.
#[derive(Clone, Debug)]
struct Uneven {
    shading: Shading,
    /// Upright and level strips, as many as of the real one.
    strips: [Vec<Folding>; 2],
}

impl Computed {
    /// Its mean repeat in the units of the photographs, moved right and up by so many texels; rows
    /// from the bottom.
    pub fn folded(&self, shift: [f64; 2]) -> Vec<[f64; 3]> {
        self.moved(&self.fine, shift)
    }

    /// The same without a strip; where light and view are the same everywhere, a strip changes nothing.
    pub fn folded_without(&self, (axis, strip): (usize, usize), shift: [f64; 2]) -> Vec<[f64; 3]> {
        match &self.uneven {
            None => self.folded(shift),
            Some(uneven) => {
                let rest = self.fine.without(&uneven.strips[axis][strip]);
                self.moved(&rest, shift)
            }
        }
    }

    fn moved(&self, fine: &Folding, shift: [f64; 2]) -> Vec<[f64; 3]> {
        let size = DVec2::new(self.texels[0] as f64, self.texels[1] as f64);
        let moved = fine.moved(self.texels, DVec2::from_array(shift) / size);
        moved.mean(|_| [0.0; 3])
    }

    /// How light and view shade it, where they differ from place to place.
    pub fn shading(&self) -> Option<Shading> {
        self.uneven.as_ref().map(|u| u.shading)
    }
}

/// A computed photograph for each side.
///
/// # Errors
/// Yarns that do not fit into their spacing; those of the scene.
pub fn pictures(
    model: &ClothModel<'_>,
    draft: &Draft,
    trial: &Trial,
    sides: &[Side],
    effort: Effort,
) -> Result<Vec<Computed>> {
    let purpose = Purpose::Picture {
        threads: effort.threads,
        seed: effort.seed,
        most_fibres: effort.most_fibres,
    };
    let loader = model.loader(draft, trial, purpose)?;
    let mut cloth: Option<Scene> = None;
    let mut all = Vec::new();
    for side in sides {
        let light_deg = trial.lights_deg[side.index];
        let film = Frame::new(model, draft, side, effort);
        // The cloth is built once; of the other sides only camera and lamp.
        let with_cloth = cloth.is_none();
        let mut scene = scene(model, &film, &side.view, light_deg, &loader, with_cloth)?;
        if let Some(first) = cloth.take() {
            scene.media = first.media;
        }
        let mut fine = Folding::new(side.fold.repeat, side.fold.texels.map(|n| FINE * n));
        let (mut sums, mut strips) = (ShadingSums::default(), None);
        if !side.view.is_parallel() {
            let counts = side.fold.without_strip.each_ref().map(Vec::len);
            strips = Some(counts.map(|n| vec![fine.clone(); n]));
        }
        let pixels = film.render(model, &scene, effort)?;
        for (place, place_mm, colour) in pixels {
            let colour = colour.map(|v| trial.exposure * v);
            let shading = side.shot.shading.at(place);
            let flat = std::array::from_fn(|c| colour[c] / shading[c]);
            let thread = place_mm / DVec2::from_array(model.spacing_mm);
            fine.add(thread, flat);
            if let Some(strips) = &mut strips {
                sums.add(place, colour);
                let share = film.share(place);
                for (list, share) in strips.iter_mut().zip(share) {
                    let strip = (share * list.len() as f64) as usize;
                    let last = list.len() - 1;
                    list[strip.min(last)].add(thread, flat);
                }
            }
        }
        cloth = Some(scene);
        all.push(Computed {
            texels: side.fold.texels,
            fine,
            uneven: strips.map(|strips| Uneven {
                shading: sums.shading(),
                strips,
            }),
        });
    }
    Ok(all)
}

/// The part of the cloth that a computed photograph shows, and its pixels.
struct Frame {
    size_mm: DVec2,
    resolution: UVec2,
    /// Paths in all.
    paths: f64,
}

impl Frame {
    fn new(model: &ClothModel<'_>, draft: &Draft, side: &Side, effort: Effort) -> Frame {
        let spacing = DVec2::from_array(model.spacing_mm);
        // Where all is seen from one direction, one tile says as much as all of them.
        let size_mm = if side.view.is_parallel() {
            let threads = [draft.ends(), draft.picks()];
            let threads = threads.map(|n| (effort.threads.div_ceil(n) * n) as f64);
            DVec2::from_array(threads) * spacing
        } else {
            side.view.size_mm
        };
        let texel_mm = spacing / DVec2::from_array(side.fold.texels.map(|n| n as f64));
        // As many paths for a whole photograph as for a tile.
        let threads = (effort.threads * effort.threads) as f64;
        let texels: usize = side.fold.texels.iter().product();
        let fine = texel_mm.min_element() / PIXELS;
        let coarse = (size_mm.x * size_mm.y / MAX_PIXELS).sqrt();
        let resolution = (size_mm / fine.max(coarse)).ceil().max(DVec2::ONE);
        Frame {
            size_mm,
            resolution: resolution.as_uvec2(),
            paths: effort.paths as f64 * threads * texels as f64,
        }
    }

    /// How far to the right and upwards a place is, from 0 to 1.
    fn share(&self, place: DVec2) -> [f64; 2] {
        let size = self.resolution.as_dvec2();
        (0.5 + place * (0.5 * size.length()) / size).to_array()
    }

    /// Renders it: places in the photograph, on the cloth, and colours.
    fn render(
        &self,
        model: &ClothModel<'_>,
        scene: &Scene,
        effort: Effort,
    ) -> Result<Vec<(DVec2, DVec2, [f64; 3])>> {
        let allowed = model.args.context.memory_bytes();
        let film_bytes = Film::memory_bytes(self.resolution);
        if film_bytes > allowed {
            return Err(input(format!(
                "a computed photograph of {} x {} pixels needs {film_bytes} bytes of memory and \
                 {allowed} are allowed",
                self.resolution.x, self.resolution.y
            )));
        }
        let pixels = f64::from(self.resolution.x) * f64::from(self.resolution.y);
        let samples = (self.paths / pixels).round().max(1.0) as u64;
        let settings = RenderSettings {
            integrator: Integrator::Woodcock,
            samples: 0..samples,
            max_bounces: MAX_BOUNCES,
            seed: effort.seed,
            crop: None,
        };
        let rendering = Rendering::new(scene, settings.clone())?;
        // The same answer on every computer: no engine off the processor.
        let made = engine(
            scene,
            &settings,
            EngineChoice::Processor,
            allowed - film_bytes,
        );
        let rendering = match made {
            Ok(engine) => rendering.with_engine(engine),
            Err(_) => rendering,
        };
        let (film, _) = rendering
            .take(samples, &|_| model.args.context.flow())?
            .into_parts();
        let size = self.resolution.as_dvec2();
        let pixel = |(i, pixel): (usize, &Pixel)| {
            let width = self.resolution.x as usize;
            let at = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let place = DVec2::new(at.x - 0.5 * size.x, 0.5 * size.y - at.y);
            let colour = [0, 1, 2].map(|c| pixel.moments(c).mean);
            let place_mm = seen(&scene.camera, at)?;
            Some((place / (0.5 * size.length()), place_mm, colour))
        };
        Ok(film.pixels().iter().enumerate().filter_map(pixel).collect())
    }
}

/// The place in the middle plane of the cloth that a point of the film shows, in pixels from the
/// upper left; `None` beyond the horizon.
fn seen(camera: &Camera, at: DVec2) -> Option<DVec2> {
    let parts = camera.parts();
    let size = camera.resolution().as_dvec2();
    let from_middle = DVec2::new(at.x - 0.5 * size.x, 0.5 * size.y - at.y);
    let offset = from_middle * (parts.film_width / size.x);
    let offset = offset.x * parts.right + offset.y * parts.up;
    let (origin, direction) = match parts.projection {
        Projection::Orthographic { .. } => (parts.origin_mm + offset, parts.forward),
        _ => (parts.origin_mm, parts.forward + offset),
    };
    let distance = -origin.z / direction.z;
    (distance > 0.0).then(|| (origin + distance * direction).truncate())
}

/// The scene of a photograph; without its cloth, where another scene has it.
fn scene(
    model: &ClothModel<'_>,
    frame: &Frame,
    view: &View,
    light_deg: [f64; 2],
    loader: &Loader<'_>,
    with_cloth: bool,
) -> Result<Scene> {
    let list = |v: DVec3| v.to_array();
    let towards_camera = direction(view.camera_deg);
    let distance_mm = view.camera_mm.unwrap_or(FAR_MM);
    // What is to the right in the photograph is to the right here.
    let right = direction([90.0, view.right_deg]);
    let mut camera = json!({
        "kind": "orthographic",
        "origin_mm": list(towards_camera * distance_mm),
        "target_mm": [0.0, 0.0, 0.0],
        "up": list(towards_camera.cross(right)),
        "width_mm": frame.size_mm.x,
        "resolution": frame.resolution.to_array(),
        "filter": "box",
    });
    if view.camera_mm.is_some() {
        let fov = 2.0 * (0.5 * frame.size_mm.x / distance_mm).atan();
        camera["kind"] = json!("perspective");
        camera["fov_deg"] = json!(fov.to_degrees());
        camera.as_object_mut().map(|c| c.remove("width_mm"));
    }
    let strength = [view.strength(light_deg); 3];
    let towards_light = direction(light_deg);
    let light = match view.light_mm {
        None => json!({
            "kind": "directional",
            "direction": list(-towards_light),
            "irradiance": strength,
        }),
        Some(distance_mm) => json!({
            "kind": "spot",
            "position_mm": list(towards_light * distance_mm),
            "intensity": strength,
        }),
    };
    let mut file = json!({ "camera": camera, "light": [light] });
    if with_cloth {
        let mut cloth = json!({
            "kind": "cloth",
            "fabric": model.path.file_name().unwrap_or_default().to_string_lossy(),
            "model": model.shown.representation.name,
        });
        if let Some(voxel_um) = model.args.voxel_um {
            cloth["voxel_um"] = json!(voxel_um);
        }
        file["object"] = json!([cloth]);
    }
    let text = toml::to_string(&file)?;
    let path = model.path.with_file_name("photograph.toml");
    let loaded = organza_scene::from_str(&text, &path, &[], loader)?;
    Ok(loaded.build(model.args.context.max_memory_bytes, loader)?)
}
