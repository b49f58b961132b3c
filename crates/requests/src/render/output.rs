//! A finished picture.

use super::scene::Built;
use super::summary::{self, Times};
use super::{RenderJob, results};
use organza_film::Film;
use organza_picture::{Attributes, Display, Layers, Rendered};
use organza_transport::{KernelRefusal, Rendering};
use organza_work::denoising::Denoiser;
use organza_work::identity::Identity;
use organza_work::schedule::Stop;
use organza_work::{Context, Error, ErrorKind, Output, Results, picture};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What a render found.
pub struct Picture {
    /// The film.
    pub film: Film,
    /// Light that comes straight to the camera or by one event, where the scene asks for it.
    pub direct: Option<Film>,
    /// The error of a cache of radiance about every pixel, in units of radiance.
    pub cache_error: Option<Vec<f32>>,
    /// What a file records of how the picture was made.
    pub attributes: Attributes,
    /// How formats of display values show it.
    pub display: Display,
    /// Times, counts, means and errors.
    figures: Value,
    /// What went wrong although the picture holds samples: it was interrupted, its checkpoint cannot be
    /// saved, or samples were rejected.
    pub failure: Option<Error>,
    pub(super) context: Context,
    denoiser: Option<Denoiser>,
    max_memory_bytes: u64,
    paths: u64,
    render_s: f64,
    started: Instant,
    lines: Vec<String>,
    details: Vec<String>,
    reason: String,
}

/// What a render knows when its last sample is taken.
pub(super) struct Finished<'a> {
    pub args: &'a RenderJob,
    pub built: &'a Built,
    pub identity: &'a Identity,
    pub why_walk: Option<&'a KernelRefusal>,
    pub times: Times,
    pub stop: Stop,
    pub paths_before: u64,
    pub started: Instant,
}

impl Finished<'_> {
    /// The picture; `saved` is what became of the checkpoint.
    pub fn picture(
        self,
        rendering: Rendering<'_>,
        denoiser: Option<Denoiser>,
        saved: anyhow::Result<()>,
    ) -> Picture {
        let (args, file) = (self.args, &self.built.file);
        summary::warn_of_tail(args, file, &rendering);
        let name = match args.context.outputs.first() {
            Some(path) => path.display().to_string(),
            None => "the picture".to_owned(),
        };
        let taken = summary::describe_samples_taken(&rendering);
        let failure = match (self.stop, saved) {
            (Stop::Interrupted, _) => {
                let text = format!("interrupted with {taken}; {name} holds the picture so far");
                Some(Error::new(ErrorKind::Stopped, text))
            }
            (_, Err(e)) => Some(Error::from(e.context(match args.context.outputs.first() {
                Some(_) => {
                    format!("the picture {name} with {taken} is written, but not the checkpoint")
                }
                None => format!("the checkpoint of {name} with {taken} is not written"),
            }))),
            _ => summary::describe_rejected(&rendering, &name)
                .map(|text| Error::new(ErrorKind::Work, text)),
        };
        let figures = summary::figures(&rendering, self.why_walk, &self.built.chosen, &self.times);
        let cache_error = summary::cache_errors(&rendering);
        let attributes = summary::attributes(args, file, self.identity, &rendering);
        let paths = rendering.stats().paths - self.paths_before;
        let lines = summary::cache_line(&rendering).into_iter().collect();
        let details = summary::details(file, &rendering, self.why_walk);
        let reason = summary::reason(&rendering, self.stop, args.targets());
        let (film, direct) = rendering.into_films();
        Picture {
            film,
            direct,
            cache_error,
            attributes,
            display: file.render.display(),
            figures,
            failure,
            context: args.context.clone(),
            denoiser,
            max_memory_bytes: self.built.max_bytes,
            paths,
            render_s: self.times.render_s,
            started: self.started,
            lines,
            details,
            reason,
        }
    }
}

impl Picture {
    /// Films and layers, as formats write them.
    pub fn rendered(&self) -> Rendered<'_> {
        Rendered {
            layers: self.layers(),
            ..Rendered::new(&self.film, self.display, &self.attributes)
        }
    }

    fn layers(&self) -> Layers<'_> {
        Layers {
            direct: self.direct.as_ref(),
            cache_error: self.cache_error.as_deref(),
        }
    }

    /// The display with numbers where it says `auto`, if a file of this name holds display values.
    fn resolve_display(&mut self, path: &Path) {
        self.display = picture::resolved(path, &self.film, self.display, &self.context);
        if !picture::is_linear(path) {
            self.figures["display"] = json!({
                "exposure": self.display.exposure.to_string(),
                "tone_mapping": self.display.tone_mapping.name(),
                "white_balance": self.display.white_balance.to_string(),
            });
        }
    }

    /// Figures by their names: counts, times, means.
    pub fn figures(&self) -> Value {
        let mut figures = self.figures.clone();
        figures["total_s"] = self.total_s().into();
        figures
    }

    /// Seconds since the render began.
    pub fn total_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// What a person reads of the picture of this name; with `details` the counts, too.
    pub fn lines(&self, name: &str, details: bool) -> Vec<String> {
        let (size, paths, render_s) = (self.film.size(), self.paths, self.render_s);
        let mut lines = vec![format!(
            "{name}: {} x {}, {paths} paths in {:.1} s ({render_s:.1} s tracing, {:.2} M paths/s)",
            size.x,
            size.y,
            self.total_s(),
            paths as f64 / render_s.max(1e-9) * 1e-6,
        )];
        lines.extend_from_slice(&self.lines);
        if details {
            lines.extend_from_slice(&self.details);
        }
        lines.push(self.reason.clone());
        lines
    }
}

impl Output for Picture {
    fn results(&self) -> Result<Results, Error> {
        match &self.failure {
            Some(failure) => Err(failure.clone()),
            None => Ok(results::of(&self.film, self.layers(), self.figures())),
        }
    }

    fn failure(&self) -> Option<Error> {
        self.failure.clone()
    }

    fn settle(&mut self, path: &Path) {
        self.resolve_display(path);
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let rendered = self.rendered();
        match &self.denoiser {
            Some(denoiser) => {
                let threads = self.context.threads;
                Ok(denoiser.write(path, &rendered, threads, self.max_memory_bytes)?)
            }
            None => {
                picture::write(path, &rendered)?;
                Ok(vec![path.to_owned()])
            }
        }
    }
}
