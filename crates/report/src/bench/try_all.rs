//! All choices in all views of a fabric.

use super::peer::Peer;
use super::stage::{Sample, View};
use super::trial::{Figures, Laboratory, Outcome, Trial};
use crate::ReportError;
use organza_basis::Stopped;
use organza_measure::{Cost, NoisyPicture, PICTURE_PIXELS, PictureError, picture_error};
use organza_scene::auto::choice::Choice;
use organza_scene::auto::lit::Lit;
use organza_scene::auto::table::{Row, Traits};
use organza_scene::loader::Loader;
use organza_scene::representation::{EXPLICIT_FIBRES, Tracker};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// The extent of a bench.
pub struct BenchPlan {
    /// Fewer choices.
    pub quick: bool,
    /// All trackers of a representation; otherwise its usual one, for the reference, too.
    pub every_tracker: bool,
    /// Widths of a pixel at the cloth.
    pub pixels_mm: Vec<f64>,
    /// Pixels along an edge.
    pub resolution: u32,
    /// Samples per pixel of every choice.
    pub spp: u64,
    /// Samples per pixel of explicit fibres.
    pub truth_spp: u64,
    /// Values of `--set` for every render.
    pub set: Vec<String>,
    /// Folder to which scenes are written.
    pub scenes: PathBuf,
}

/// Seeds: the noise of the reference must be independent of that of the other pictures.
const TRUTH_SEED: u64 = 1;
const SEED: u64 = 2;

/// The result of one choice in a view.
pub struct Tried {
    /// Its cost and its error.
    pub row: Row,
    /// Noise of the picture, which is subtracted from the error.
    pub noise: f64,
    /// The engine that rendered it.
    pub backend: String,
    /// Its picture.
    pub picture: NoisyPicture,
}

/// A choice that gave no picture.
pub struct Refusal {
    /// The choice.
    pub choice: Choice,
    /// The reason.
    pub why: String,
}

/// Another program's picture of a view.
pub struct PeerResult {
    /// Name and version of the program.
    pub program: String,
    /// Its difference from the reference.
    pub error: PictureError,
    /// Its cost.
    pub cost: Cost,
    /// Its picture.
    pub picture: NoisyPicture,
}

/// The results of a view of a fabric; the reference is the first.
pub struct ViewResult {
    /// The view.
    pub view: View,
    /// Choices that gave a picture.
    pub results: Vec<Tried>,
    /// Choices that gave none.
    pub refusals: Vec<Refusal>,
    /// Pictures of other programs.
    pub peers: Vec<PeerResult>,
}

impl BenchPlan {
    /// The views of every fabric.
    pub fn views(&self) -> Vec<View> {
        let lights = |&pixel_mm: &f64| Lit::ALL.map(|lit| View { pixel_mm, lit });
        self.pixels_mm.iter().flat_map(lights).collect()
    }

    /// The choices for a fabric, without the reference.
    pub fn choices(&self, sample: &Sample) -> Vec<Choice> {
        let loader = Loader::new();
        Choice::all(self.truth(), self.quick, self.every_tracker, &|model| {
            (model.is_ready)(&sample.fabric, &sample.path, &loader)
        })
    }

    /// Pixels along an edge of the picture for which a cache learns, whose middle is rendered:
    /// costs are those of such a picture, and a smaller one would learn more of what it shows.
    fn whole(&self) -> u32 {
        let least = (PICTURE_PIXELS as f64).sqrt().ceil() as u32;
        // Its middle has the same pixels.
        let odd = |n: u32| n % 2;
        (least + (odd(least) ^ odd(self.resolution))).max(self.resolution)
    }

    /// The reference. Where only usual trackers are tried, it has the usual one, too.
    fn truth(&self) -> Choice {
        match self.every_tracker {
            true => Choice::EXPLICIT_FIBRES,
            false => Choice::usual(&EXPLICIT_FIBRES),
        }
    }

    /// Tries every choice in a view; `done` is called after every render.
    ///
    /// # Errors Files that cannot be written, a reference that cannot be rendered, or an
    /// interruption.
    pub(super) fn try_all(
        &self,
        laboratory: &Laboratory<'_>,
        sample: &Sample,
        view: View,
        peers: &[Peer],
        done: &dyn Fn() -> ControlFlow<()>,
    ) -> Result<ViewResult, ReportError> {
        let slug = view.slug(&sample.name);
        let scene = self.scenes.join(format!("{slug}.toml"));
        let text = view.scene(&sample.path.display().to_string(), self.resolution);
        laboratory.write(&scene, text.as_bytes())?;
        let own_um = sample.fabric.file.voxel.size_um;
        let run = |choice: &Choice, spp: u64, seed: u64| {
            // The name of a choice overrides all other settings.
            let mut overrides = self.set.clone();
            overrides.extend(choice.overrides(own_um));
            let is_cached = choice.tracker == Tracker::Cached;
            let whole = is_cached.then(|| self.whole());
            overrides.extend(whole.iter().flat_map(|edge| {
                let width_mm = view.pixel_mm * f64::from(*edge);
                [
                    format!("camera.width_mm={width_mm}"),
                    format!("camera.resolution=[{edge},{edge}]"),
                ]
            }));
            let trial = Trial {
                name: format!("{slug}-{}", choice.slug()),
                scene: scene.clone(),
                fabric: sample.path.clone(),
                overrides,
                crop: whole.map(|edge| {
                    let low = (edge - self.resolution) / 2;
                    [low, low, low + self.resolution, low + self.resolution]
                }),
                backend: choice.backend(),
                spp,
                seed,
            };
            let outcome = laboratory.run(&trial, None);
            Stopped::check(done())?;
            outcome
        };
        let traits = Traits::of(&sample.fabric);
        let judge =
            |choice: Choice, picture: NoisyPicture, figures: &Figures, truth: &NoisyPicture| {
                let error = picture_error(&picture, truth)?;
                Some(Tried {
                    row: Row {
                        fabric: sample.name.clone(),
                        traits,
                        pixel_mm: view.pixel_mm,
                        lit: view.lit,
                        choice,
                        rmse: error.rmse,
                        bias: error.bias,
                        cost: cost(figures, self.resolution, error.noise),
                    },
                    noise: error.noise,
                    backend: figures.backend.clone(),
                    picture,
                })
            };
        let (truth, figures) = match run(&self.truth(), self.truth_spp, TRUTH_SEED)? {
            Outcome::Picture(picture, figures) => (*picture, figures),
            Outcome::Refused(why) => {
                return Err(ReportError::Run(format!("{slug}, explicit fibres: {why}")));
            }
        };
        // A near view of a gap shows no fibre; the other views are still worth their time.
        let Some(mut first) = judge(self.truth(), truth.clone(), &figures, &truth) else {
            let refusal = Refusal {
                choice: self.truth(),
                why: "is black in this view; there is nothing to compare with".into(),
            };
            return Ok(ViewResult {
                view,
                results: Vec::new(),
                refusals: vec![refusal],
                peers: Vec::new(),
            });
        };
        // The reference has no error against itself, and its noise does not add one.
        for figure in [&mut first.row.rmse, &mut first.row.bias] {
            (figure.value, figure.low, figure.high) = (0.0, 0.0, 0.0);
        }
        let (mut results, mut refusals) = (vec![first], Vec::new());
        for choice in self.choices(sample) {
            match run(&choice, self.spp, SEED)? {
                Outcome::Refused(why) => refusals.push(Refusal { choice, why }),
                Outcome::Picture(picture, figures) => match &figures.kernel_refused {
                    Some(why) if matches!(choice.tracker, Tracker::Kernel | Tracker::Cached) => {
                        refusals.push(Refusal {
                            choice,
                            why: why.clone(),
                        });
                    }
                    _ => results.extend(judge(choice, *picture, &figures, &truth)),
                },
            }
        }
        let of_view = peers.iter().filter(|p| p.scene == slug);
        let peers = of_view
            .filter_map(|p| {
                let picture = p.picture();
                let error = picture_error(&picture, &truth)?;
                Some(PeerResult {
                    program: p.program.clone(),
                    cost: p.cost(self.resolution, error.noise),
                    error,
                    picture,
                })
            })
            .collect();
        Ok(ViewResult {
            view,
            results,
            refusals,
            peers,
        })
    }
}

fn cost(figures: &Figures, resolution: u32, noise: f64) -> Cost {
    Cost::of_picture(
        u64::from(resolution).pow(2),
        figures.setup_cpu_s + figures.prepare_cpu_s,
        figures.render_cpu_s - figures.prepare_cpu_s,
        noise,
        figures.peak_memory_bytes.unwrap_or(0),
    )
}
