//! The growth of cost with size.

use super::stage::{Sample, View};
use super::trial::{Figures, Laboratory, Outcome, Trial};
use crate::ReportError;
use organza_basis::Stopped;
use organza_measure::{Growth, growth};
use organza_scene::auto::choice::Choice;
use organza_scene::auto::lit::Lit;
use organza_scene::representation::{MICROFLAKE, PACKED, Tracker};
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::Path;

/// The size that grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    /// Area of the tile that is voxelized.
    Tile,
    /// Voxels along an edge of it.
    Resolution,
    /// Pixels of the picture.
    Pixels,
    /// Area of cloth that the picture shows.
    Area,
    /// Number of lights.
    Lights,
    /// Number of threads.
    Threads,
}

impl Size {
    /// All of them.
    pub const ALL: [Size; 6] = [
        Size::Tile,
        Size::Resolution,
        Size::Pixels,
        Size::Area,
        Size::Lights,
        Size::Threads,
    ];

    /// A description.
    pub fn description(self) -> &'static str {
        match self {
            Size::Tile => "tile, repeats of the weave",
            Size::Resolution => "voxels to a millimetre",
            Size::Pixels => "pixels of the picture",
            Size::Area => "cloth in the picture, mm2",
            Size::Lights => "parallel lights",
            Size::Threads => "threads",
        }
    }

    /// The sizes to measure; for threads, up to their number in the machine.
    fn steps(self, quick: bool) -> Vec<u32> {
        let (some, many): (&[u32], &[u32]) = match self {
            Size::Tile => (&[1, 2, 4], &[1, 2, 4, 8]),
            Size::Resolution => (&[1, 2, 4], &[1, 2, 4, 8]),
            Size::Pixels => (&[16, 32, 64], &[16, 32, 64, 128]),
            Size::Area => (&[1, 4, 16], &[1, 4, 16, 64]),
            Size::Lights => (&[1, 4, 16], &[1, 2, 4, 8, 16]),
            Size::Threads => {
                let cores = std::thread::available_parallelism().map_or(1, usize::from) as u32;
                let doubled = std::iter::successors(Some(1u32), |n| n.checked_mul(2));
                return doubled.take_while(|n| *n <= cores).collect();
            }
        };
        if quick { some.to_vec() } else { many.to_vec() }
    }
}

/// One measurement.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// The size.
    pub size: f64,
    /// Processor seconds before the first path.
    pub setup_s: f64,
    /// Processor seconds of tracing; for threads, seconds of elapsed time.
    pub trace_s: f64,
    /// Peak memory.
    pub memory_bytes: u64,
}

/// One choice along one size.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// The size that grows.
    pub grows: Size,
    /// Description of the choice.
    pub what: String,
    /// Measurements in order of size.
    pub points: Vec<Point>,
    /// The growth of the setup time.
    pub setup: Option<Growth>,
    /// The growth of the tracing time.
    pub trace: Option<Growth>,
    /// The growth of the memory.
    pub memory: Option<Growth>,
}

/// The models that are measured: the fastest and the most accurate volume.
const MODELS: [Choice; 2] = [
    Choice::of(&MICROFLAKE, Tracker::Kernel),
    Choice::of(&PACKED, Tracker::Woodcock),
];

/// Renders that [`measure`] makes at most.
pub(super) fn max_trials(quick: bool) -> usize {
    let steps: usize = Size::ALL.iter().map(|s| s.steps(quick).len()).sum();
    MODELS.len() * steps
}

/// Measures along every size. Fabrics are written to `folder`.
///
/// # Errors
/// Files that cannot be written, or renders that fail.
pub(super) fn measure(
    laboratory: &Laboratory<'_>,
    sample: &Sample,
    folder: &Path,
    quick: bool,
    done: &dyn Fn() -> ControlFlow<()>,
) -> Result<Vec<Series>, ReportError> {
    let mut list = Vec::new();
    for grows in Size::ALL {
        for choice in MODELS {
            let mut points = Vec::new();
            for step in grows.steps(quick) {
                let (trial, size) = trial(laboratory, sample, folder, grows, choice, step)?;
                let threads = if grows == Size::Threads { step } else { 1 };
                let outcome = laboratory.run(&trial, u16::try_from(threads).ok())?;
                Stopped::check(done())?;
                let figures = match outcome {
                    Outcome::Picture(_, figures) => figures,
                    Outcome::Refused(why) => {
                        return Err(ReportError::Run(format!("{}: {why}", trial.name)));
                    }
                };
                points.push(point(grows, size, &figures));
            }
            let fit = |of: fn(&Point) -> f64| {
                growth(&points.iter().map(|p| (p.size, of(p))).collect::<Vec<_>>())
            };
            list.push(Series {
                grows,
                what: choice.model.title.to_owned(),
                setup: fit(|p| p.setup_s),
                trace: fit(|p| p.trace_s),
                memory: fit(|p| p.memory_bytes as f64),
                points,
            });
        }
    }
    Ok(list)
}

fn point(grows: Size, size: f64, figures: &Figures) -> Point {
    Point {
        size,
        setup_s: figures.setup_cpu_s,
        trace_s: if grows == Size::Threads {
            figures.render_s
        } else {
            figures.render_cpu_s
        },
        memory_bytes: figures.peak_memory_bytes.unwrap_or(0),
    }
}

/// Pixels along an edge, and their width, where they do not grow.
const RESOLUTION: u32 = 32;
const PIXEL_MM: f64 = 0.1;

/// A render at one step, and the size there.
fn trial(
    laboratory: &Laboratory<'_>,
    sample: &Sample,
    folder: &Path,
    grows: Size,
    choice: Choice,
    step: u32,
) -> Result<(Trial, f64), ReportError> {
    let own_um = sample.fabric.file.voxel.size_um;
    let name = format!(
        "scaling-{}-{}-{step}",
        format!("{grows:?}").to_lowercase(),
        choice.slug()
    );
    let mut fabric = sample.path.clone();
    let mut overrides = choice.overrides(own_um);
    let (mut resolution, mut lights, mut width_factor) = (RESOLUTION, 2, 1.0);
    let view = View {
        pixel_mm: PIXEL_MM,
        lit: Lit::Front,
    };
    let size = match grows {
        Size::Tile => {
            fabric = folder.join(format!("{name}.fabric.toml"));
            laboratory.write(&fabric, with_repeats(sample, step)?.as_bytes())?;
            f64::from(step * step)
        }
        Size::Resolution => {
            let voxel_um = 4.0 * own_um / step as f32;
            overrides.push(format!("object.0.voxel_um={voxel_um}"));
            1e3 / f64::from(voxel_um)
        }
        Size::Pixels => {
            resolution = step;
            width_factor = f64::from(RESOLUTION) / f64::from(step);
            f64::from(step * step)
        }
        Size::Area => {
            width_factor = f64::from(step);
            (PIXEL_MM * f64::from(step * RESOLUTION)).powi(2)
        }
        Size::Lights => {
            lights = step;
            f64::from(step)
        }
        Size::Threads => f64::from(step),
    };
    let width_mm = PIXEL_MM * width_factor * f64::from(resolution);
    overrides.push(format!("camera.width_mm={width_mm}"));
    let text = view.scene(&fabric.display().to_string(), resolution);
    let scene = folder.join(format!("{name}.toml"));
    let text = with_parallel_lights(&text, lights);
    laboratory.write(&scene, text.as_bytes())?;
    // About a second of each.
    let by_kernel = choice.tracker == Tracker::Kernel;
    let spp = if by_kernel { 1024 } else { 24 };
    Ok((
        Trial {
            name,
            scene,
            fabric,
            overrides,
            crop: None,
            backend: choice.backend(),
            spp,
            seed: 3,
        },
        size,
    ))
}

/// The scene with a fan of parallel lights instead of its own lights.
fn with_parallel_lights(scene: &str, count: u32) -> String {
    let before = scene.split("[[light]]").next().unwrap_or_default();
    let after = scene.split("[[object]]").nth(1).unwrap_or_default();
    let mut text = before.to_owned();
    for i in 0..count {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(count);
        text += &format!(
            "[[light]]\nkind = \"directional\"\ndirection = [{:.4}, {:.4}, -1.0]\n\
             irradiance = [1.0, 1.0, 1.0]\n\n",
            0.7 * turn.cos(),
            0.7 * turn.sin()
        );
    }
    text + "[[object]]" + after
}

/// The text of a fabric with a tile of more repeats.
fn with_repeats(sample: &Sample, repeats: u32) -> Result<String, ReportError> {
    let text = organza_scene::read::text(&sample.path)?;
    let fail = |why: String| ReportError::of_file(&sample.path, why);
    let mut table: toml::Table = toml::from_str(&text).map_err(|e| fail(e.to_string()))?;
    let mut tile = toml::Table::new();
    let both = [i64::from(repeats); 2].map(toml::Value::Integer);
    tile.insert("repeats".into(), toml::Value::Array(both.to_vec()));
    table.insert("tile".into(), toml::Value::Table(tile));
    toml::to_string(&table).map_err(|e| fail(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_light::LightTable;
    use organza_scene::scene_file::SceneFile;

    #[test]
    fn lights_are_put_in_the_place_of_others() {
        let view = View {
            pixel_mm: 0.1,
            lit: Lit::Front,
        };
        let text = with_parallel_lights(&view.scene("denim.toml", 16), 5);
        let scene: SceneFile = toml::from_str(&text).unwrap();
        assert_eq!((scene.light.len(), scene.object.len()), (5, 1), "{text}");
        let parallel = |l: &LightTable| l.kind() == "directional";
        assert!(scene.light.iter().all(parallel));
    }
}
