//! The render of a session: one thread that shows the newest document, coarse first.

use crate::document::{Document, FabricDocument};
use crate::matter::{Built, Matter};
use crate::news::Phase;
use crate::saving::{self, WriteFiles};
use crate::session::{Save, Session, Task, Work};
use crate::tracing::{PicturePlan, Stop, Tracing};
use glam::UVec2;
use hyper::body::Bytes;
use organza_picture::{Attributes, Display, Exposure, Rendered, png};
use organza_scene::file_kind::Wanted;
use organza_scene::loader::{self, Event};
use organza_scene::memory::free_memory_bytes;
use organza_scene::scene_file::SceneFile;
use organza_scene::{ResultCache, fabric_file, read};
use organza_transport::Film;
use serde_json::Value;
use std::any::Any;
use std::io::Cursor;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

/// One in so many columns and rows of the first pictures after a change.
const COARSE: [u32; 3] = [8, 4, 2];
/// Seconds that the later of them may take, as estimated from the one before.
const MAX_COARSE_S: f64 = 0.8;
/// The same where light is learned for many seconds before the full picture.
const MAX_COARSE_BEFORE_LEARNING_S: f64 = 4.0;

/// What a render may use.
pub struct Limits {
    /// Memory for everything; what is free if none.
    pub max_memory_bytes: Option<u64>,
    /// Threads; as many as there are cores if none.
    pub threads: Option<usize>,
    /// Where built volumes are kept.
    pub cache: Option<ResultCache>,
}

/// Renders until the session ends. Files are saved through `write`.
///
/// # Errors
/// Threads cannot be started.
pub fn run(session: &Session, limits: &Limits, write: &WriteFiles) -> Result<(), String> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(limits.threads.unwrap_or(0))
        .build()
        .map_err(|e| format!("cannot start the threads: {e}"))?;
    pool.install(|| {
        let mut render = Render {
            session,
            limits,
            write,
            built: Built::default(),
            settings_revision: 0,
            figures_of: String::new(),
        };
        let mut done = 0;
        loop {
            match session.next_work(done, false) {
                Work::End => return,
                Work::Save(save) => drop(save),
                Work::Show(task) => {
                    done = task.revision;
                    render.show_guarded(&task);
                }
            }
        }
    });
    Ok(())
}

struct Render<'a> {
    session: &'a Session,
    limits: &'a Limits,
    write: &'a WriteFiles<'a>,
    built: Built,
    /// Of the picture that was shown last.
    settings_revision: u64,
    /// The matter whose textile figures the pages know.
    figures_of: String,
}

impl Render<'_> {
    /// Shows a document, and reports errors to the pages.
    fn show_guarded(&mut self, task: &Task) {
        let outcome = catch_unwind(AssertUnwindSafe(|| self.show(task)));
        let why = match outcome {
            Ok(Ok(())) | Ok(Err(Stop::Unwanted)) => return,
            Ok(Err(Stop::Failed(why))) => task.document.in_words(&why),
            Err(thrown) => {
                self.built = Built::default();
                format!("this is a defect of organza: {}", message(&*thrown))
            }
        };
        self.session.tell(|news| {
            news.revision = task.revision;
            news.phase = Phase::Failed;
            (news.task, news.share) = (None, None);
            news.error = Some(why);
        });
    }

    fn show(&mut self, task: &Task) -> Result<(), Stop> {
        let began = Instant::now();
        let (session, document) = (self.session, &task.document);
        let is_wanted = || session.is_wanted(task.revision);
        if task.settings_revision != self.settings_revision {
            self.settings_revision = task.settings_revision;
            session.tell(|news| {
                if news.cost.samples > 0 {
                    news.previous = Some(std::mem::take(&mut news.cost));
                }
            });
        }
        session.tell(|news| {
            news.revision = task.revision;
            news.phase = Phase::Building;
            (news.task, news.share, news.error) = (None, None, None);
        });
        let on_event = |event: Event<'_>| {
            if !is_wanted() {
                return ControlFlow::Break(());
            }
            tell_event(session, event);
            ControlFlow::Continue(())
        };
        let loader = document.loader(Some(&on_event));
        let loader = loader.with_cache(self.limits.cache.clone());
        let failed = |e: organza_scene::InputError| match is_wanted() {
            true => Stop::Failed(e.to_string()),
            // Whatever it says, nobody waits for it.
            false => Stop::Unwanted,
        };
        let read = || -> Result<SceneFile, Stop> {
            let (path, text) = (&document.scene_path, document.scene.to_string());
            read::toml_changed(path, &text, &[], &[], Wanted::Scene).map_err(failed)
        };
        let file = read()?;
        let mut is_coarse_shown = false;
        let nearly = self.built.nearly(document, &file, &loader);
        if let Some(matter) = nearly.map_err(failed)? {
            coarse(session, task, &file, matter, &is_wanted)?;
            is_coarse_shown = true;
        }
        let limit_bytes = memory_beside_film(&file, self.limits)?;
        let matter = self
            .built
            .exactly(
                document,
                read()?,
                self.limits.max_memory_bytes,
                limit_bytes,
                &loader,
            )
            .map_err(failed)?;
        let (shown, warnings) = (matter.shown.clone(), matter.warnings.clone());
        session.tell(|news| {
            (news.task, news.share) = (None, None);
            (news.shown, news.warnings) = (shown, warnings);
        });
        if !is_wanted() {
            return Err(Stop::Unwanted);
        }
        if !is_coarse_shown {
            coarse(session, task, &file, matter, &is_wanted)?;
        }
        session.tell(|news| news.task = Some("laying out the scene".into()));
        let plan = PicturePlan {
            file: &matter.file,
            samples: None,
            max_bytes: limit_bytes,
            is_walked: false,
        };
        let tracing = Tracing::new(&matter.scene, &plan)?;
        let tracer = Tracer {
            session,
            task,
            file: &matter.file,
            build_s: began.elapsed().as_secs_f64(),
            write: self.write,
            is_wanted: &is_wanted,
        };
        let tracing = learned(&tracer, tracing)?;
        let tracing = pass(&tracer, tracing)?;
        let matter_text = document.matter_text();
        if self.figures_of != matter_text {
            let figures = figures(document);
            session.tell(|news| news.figures = figures);
            self.figures_of = matter_text;
        }
        trace(&tracer, tracing)
    }
}

/// What the passes of a picture need.
struct Tracer<'a> {
    session: &'a Session,
    task: &'a Task,
    file: &'a SceneFile,
    build_s: f64,
    write: &'a WriteFiles<'a>,
    is_wanted: &'a (dyn Fn() -> bool + Sync),
}

/// Learns what samples look up, and shows how far it is.
fn learned<'a>(tracer: &Tracer<'_>, tracing: Tracing<'a>) -> Result<Tracing<'a>, Stop> {
    if !tracing.learns() {
        return Ok(tracing);
    }
    tell_task(tracer.session, "learning light".into());
    tracing.learn(&|share| {
        tell_share(tracer.session, share as f32);
        match (tracer.is_wanted)() {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    })
}

/// Takes samples for one pass and shows the picture.
fn pass<'a>(tracer: &Tracer<'_>, tracing: Tracing<'a>) -> Result<Tracing<'a>, Stop> {
    let Tracer {
        session,
        task,
        file,
        ..
    } = tracer;
    // The first pictures come soon, whatever a pass could hold.
    let most = tracing.taken().max(1);
    let tracing = tracing.pass(most, tracer.is_wanted)?;
    let cost = tracing.cost(tracer.build_s);
    let film = tracing.film();
    let (png, exposure_stops) = encoded(film, file.render.display())?;
    session.publish(png, |news| {
        news.exposure_stops = exposure_stops;
        news.phase = match tracing.left() {
            0 => Phase::Done,
            _ => Phase::Rendering,
        };
        (news.task, news.share) = (None, None);
        news.picture_revision = task.revision;
        (news.size, news.coarseness) = (film.size().to_array(), 1);
        news.spp = u64::from(file.render.spp);
        news.cost = cost;
        news.memory_bytes = memory_bytes();
    });
    Ok(tracing)
}

/// Takes all samples of a picture, and stays with it until another one is wanted: saves are
/// answered with its film.
fn trace(tracer: &Tracer<'_>, mut tracing: Tracing<'_>) -> Result<(), Stop> {
    while tracing.left() > 0 {
        tracing = pass(tracer, tracing)?;
        while let Some(save) = tracer.session.next_save() {
            answer(tracer, save, tracing.film());
        }
    }
    while let Work::Save(save) = tracer.session.next_work(tracer.task.revision, true) {
        answer(tracer, save, tracing.film());
    }
    Ok(())
}

/// Saves what is shown, and answers the page that asked.
fn answer(tracer: &Tracer<'_>, save: Save, film: &Film) {
    let display = tracer.file.render.display();
    let (session, document) = (tracer.session, &tracer.task.document);
    let own = |path: &Path| session.has_saved(path);
    let saved = saving::save(document, &save.name, film, display, &own, tracer.write);
    if let Ok(names) = &saved {
        session.note_saved(names.iter().map(|name| document.folder.join(name)));
    }
    let _ = save.reply.send(saved);
}

/// Shows coarse pictures, by the general walk where that needs nothing laid out.
fn coarse(
    session: &Session,
    task: &Task,
    file: &SceneFile,
    matter: &mut Matter,
    is_wanted: &(dyn Fn() -> bool + Sync),
) -> Result<(), Stop> {
    let Some(table) = &file.camera else {
        return Ok(());
    };
    let is_walked = matter.scene.hierarchy_bytes() == 0;
    let own = matter.scene.camera;
    // Of a picture as coarse as the next one.
    let learns = file.render.cache_plan(table.resolution).is_some();
    let (mut seconds, mut patience_s) = (0.0, MAX_COARSE_S);
    for coarseness in COARSE {
        if seconds > patience_s {
            break;
        }
        let mut table = table.clone();
        table.resolution = table.resolution.map(|n| n.div_ceil(coarseness));
        let Ok(camera) = table.build() else { break };
        let began = Instant::now();
        matter.scene.camera = camera;
        let plan = PicturePlan {
            file,
            samples: Some(1),
            max_bytes: free_memory_bytes(),
            is_walked,
        };
        let tracing = Tracing::new(&matter.scene, &plan);
        if learns && tracing.as_ref().is_ok_and(Tracing::can_learn) {
            patience_s = MAX_COARSE_BEFORE_LEARNING_S;
        }
        let traced = tracing.and_then(|t| t.pass(1, is_wanted));
        let png =
            traced.and_then(|t| Ok((t.film().size(), encoded(t.film(), file.render.display())?)));
        matter.scene.camera = own;
        let (size, (png, exposure_stops)) = png?;
        // Each has four times the pixels of the one before.
        seconds = 4.0 * began.elapsed().as_secs_f64();
        session.publish(png, |news| {
            news.picture_revision = task.revision;
            news.exposure_stops = exposure_stops;
            (news.size, news.coarseness) = (size.to_array(), coarseness);
        });
    }
    matter.scene.camera = own;
    Ok(())
}

/// A film as PNG, and the stops of exposure that it got where `display` leaves them to it.
fn encoded(film: &Film, display: Display) -> Result<(Bytes, Option<f32>), Stop> {
    let attributes = Attributes::default();
    let mut rendered = Rendered::new(film, display, &attributes);
    let mut stops = None;
    if display.exposure == Exposure::Auto {
        rendered.display = display.resolve(&rendered.colours());
        if let Exposure::Stops(found) = rendered.display.exposure {
            stops = Some(found);
        }
    }
    let mut out = Cursor::new(Vec::new());
    let Some(write) = png::FORMAT.writer else {
        return Err(Stop::Failed("PNG cannot be written".into()));
    };
    write(&rendered, &mut out).map_err(|e| Stop::Failed(e.to_string()))?;
    Ok((out.into_inner().into(), stops))
}

/// Memory that the film leaves to the scene, bytes. The film is held twice when it is saved.
fn memory_beside_film(file: &SceneFile, limits: &Limits) -> Result<u64, Stop> {
    let size = file.camera.as_ref().map_or([1, 1], |c| c.resolution);
    let needed = Film::memory_bytes(UVec2::from(size)).saturating_mul(2);
    let free = free_memory_bytes();
    let most = limits.max_memory_bytes.map_or(free, |most| most.min(free));
    most.checked_sub(needed).ok_or_else(|| {
        Stop::Failed(format!(
            "camera.resolution: a film of {} x {} pixels needs {needed} bytes of memory, {most} \
             are allowed",
            size[0], size[1]
        ))
    })
}

/// Reports a step of building to the pages.
fn tell_event(session: &Session, event: Event<'_>) {
    match event {
        Event::Begin(task) => {
            let name = match task {
                loader::Task::Voxelizing { .. } => "making voxels",
                loader::Task::GatheringFibres { .. } => "gathering fibres",
                loader::Task::MeasuringPacking { .. } => "measuring packing",
            };
            tell_task(session, name.into());
        }
        Event::Done(share) => tell_share(session, share),
        Event::End => session.tell(|news| (news.task, news.share) = (None, None)),
        Event::Warning(_) => {}
    }
}

fn tell_task(session: &Session, task: String) {
    session.tell(|news| (news.task, news.share) = (Some(task), Some(0.0)));
}

/// Reports how far a task is, in steps of a fiftieth: no smaller one can be seen.
fn tell_share(session: &Session, share: f32) {
    let known = session.news().share.unwrap_or(0.0);
    if share >= known + 0.02 {
        session.tell(|news| news.share = Some(share));
    }
}

/// Textile figures of each fabric; null where it cannot be woven.
fn figures(document: &Document) -> Vec<Value> {
    let loader = document.loader(None);
    let of = |fabric: &FabricDocument| {
        let woven = fabric_file::load(&fabric.path, &[], &loader).ok()?;
        serde_json::to_value(woven.cloth.figures()).ok()
    };
    let each = document.fabrics.iter().map(|f| of(f).unwrap_or_default());
    each.collect()
}

/// What a panic said.
fn message(thrown: &(dyn Any + Send)) -> String {
    let text = thrown.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| thrown.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "it stopped without a message".into())
}

/// Memory of this process, bytes, where the system says it.
fn memory_bytes() -> Option<u64> {
    organza_scene::memory::resident_memory_bytes()
}
