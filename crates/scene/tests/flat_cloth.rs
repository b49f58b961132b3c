//! Flat cloth where it is hard: seen and lit along its plane, cut by a lamp, far from the
//! origin.

use crate::sameness::LITTLE;
use organza_basis::hypothesis::z_test;
use organza_kernel::{CPU_ENGINES, EngineRecord};
use organza_scene::from_str;
use organza_scene::loader::Loader;
use organza_testing::sized;
use organza_transport::{
    EngineChoice, Film, Integrator, RenderSettings, Rendering, Scene, Stats, engine,
};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

const SEED: u64 = 0x1e7e1;

/// Of matter.
const MODELS: [&str; 4] = ["microflake", "plain", "packed", "fibres"];

/// A long time for what takes a second: work without end fails a test and does not hold it up.
const PATIENCE: Duration = Duration::from_secs(120);

/// Look-ups of a ray: it may pass 256 periods with 200 borders of voxels or cells each.
const MOST_LOOK_UPS: f64 = 256.0 * 200.0;

/// The little cloth under camera and lights, and warnings on the way to it.
pub(crate) fn build(model: &str, rest: &str) -> (Scene, Vec<String>) {
    let folder = PathBuf::from("nowhere");
    let given = [(folder.join("fabric.toml"), LITTLE.to_owned())];
    let loader = Loader::new().with_given(Arc::new(given.into_iter().collect()));
    let text = format!(
        "{rest}\n[[object]]\nkind = \"cloth\"\nfabric = \"fabric.toml\"\nmodel = \"{model}\"\nlod = 0\n"
    );
    let loaded = from_str(&text, &folder.join("scene.toml"), &[], &loader)
        .unwrap_or_else(|e| panic!("{e}\n{text}"));
    let scene = loaded.build(None, &loader).unwrap();
    let warnings = loader.warnings();
    (scene, warnings.iter().map(ToString::to_string).collect())
}

/// The general walk, and every engine for processors that this computer has.
fn engines() -> Vec<Option<&'static EngineRecord>> {
    let here = CPU_ENGINES.iter().filter(|e| (e.is_available)());
    [None].into_iter().chain(here.map(Some)).collect()
}

pub(crate) fn settings(samples: u64) -> RenderSettings {
    RenderSettings {
        integrator: Integrator::Woodcock,
        samples: 0..samples,
        max_bounces: u32::MAX,
        seed: SEED,
        crop: None,
    }
}

fn picture(scene: &Scene, by: Option<&'static EngineRecord>, samples: u64) -> (Film, Stats) {
    let settings = settings(samples);
    let mut rendering = Rendering::new(scene, settings.clone()).unwrap();
    if let Some(record) = by {
        let engine = engine(scene, &settings, EngineChoice::Named(record), u64::MAX);
        rendering = rendering.with_engine(engine.unwrap());
    }
    let rendering = rendering.take(u64::MAX, &|_| ControlFlow::Continue(()));
    rendering.unwrap().into_parts()
}

/// What `work` gives, which has an end.
fn in_time<T: Send + 'static>(what: &str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (sender, receiver) = channel();
    std::thread::spawn(move || sender.send(work()));
    receiver
        .recv_timeout(PATIENCE)
        .unwrap_or_else(|why| match why {
            RecvTimeoutError::Timeout => panic!("{what}: no end"),
            RecvTimeoutError::Disconnected => panic!("{what}: failed"),
        })
}

/// Renders every model by every engine, and bounds the look-ups of a ray on the way.
fn look(what: &'static str, rest: &'static str, samples: u64) {
    for model in MODELS {
        let lines = in_time(model, move || {
            let (scene, _) = build(model, rest);
            let one = |by: Option<&'static EngineRecord>| {
                let (film, stats) = picture(&scene, by, samples);
                let name = by.map_or("walk", |e| e.name);
                let walk = stats.tentative as f64 / stats.paths as f64;
                let shadow = stats.shadow_steps as f64 / stats.shadow_rays.max(1) as f64;
                let line = format!(
                    "{what}, {model} by {name}: {walk:.1} look-ups a path, {shadow:.1} a shadow \
                     ray"
                );
                let [(mean, _), ..] = film.mean();
                assert!(mean.is_finite(), "{line}: {mean}");
                assert!(walk < MOST_LOOK_UPS && shadow < MOST_LOOK_UPS, "{line}");
                line
            };
            engines().into_iter().map(one).collect::<Vec<_>>()
        });
        println!("{}", lines.join("\n"));
    }
}

#[test]
fn every_ray_along_the_cloth_ends() {
    // Rows at all heights of the cloth, above and between the threads.
    look(
        "seen from the edge",
        "[camera]\norigin_mm = [10.0, 0.1, 0.0]\ntarget_mm = [0.0, 0.1, 0.0]\n\
         up = [0.0, 0.0, 1.0]\nwidth_mm = 0.012\nresolution = [2, 40]\n\
         [[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n\
         [[light]]\nkind = \"directional\"\ndirection = [-0.8, -0.6, 0.0]\n\
         irradiance = [2.0, 2.0, 2.0]\n",
        sized(1, 16),
    );
}

#[test]
fn kernel_and_walk_agree_on_a_lamp_that_cuts_the_cloth() {
    // What was counted of lamps that rays never met.
    const OLD_GAIN: f64 = 0.026;
    let rest = "[camera]\norigin_mm = [0.1, 0.1, 10.0]\ntarget_mm = [0.1, 0.1, 0.0]\n\
         up = [0.0, 1.0, 0.0]\nwidth_mm = 1.0\nresolution = [16, 16]\n\
         [[light]]\nkind = \"rectangle\"\ncorner_mm = [-5.0, -5.0, 0.0]\n\
         edge_u_mm = [10.0, 0.0, 0.0]\nedge_v_mm = [0.0, 10.0, 0.0]\n\
         radiance = [1.0, 1.0, 1.0]\ntwo_sided = true\n";
    for model in ["fibres", "packed"] {
        let (scene, _) = build(model, rest);
        let widest = *engines().last().unwrap();
        let samples = |times: u64| times * sized(128, 1024);
        let walk = picture(&scene, None, samples(1)).0.mean()[1];
        let kernel = picture(&scene, widest, samples(4)).0.mean()[1];
        let error = walk.1.hypot(kernel.1);
        let line = format!("{model}, seed {SEED}: {walk:?} by the walk, {kernel:?} by the kernel");
        println!("{line}");
        assert!(z_test(kernel.0, walk.0, error).p_value > 1e-3, "{line}");
        let old = (1.0 + OLD_GAIN) * kernel.0;
        assert!(z_test(old, walk.0, error).p_value < 1e-3, "{line}");
    }
}

#[test]
fn flat_cloth_far_from_the_origin_gives_a_warning() {
    let far_warnings = |model: &str, at_mm: f64| {
        let rest = format!(
            "[camera]\norigin_mm = [{at_mm:.1}, 0.0, 10.0]\ntarget_mm = [{at_mm:.1}, 0.0, 0.0]\n\
             up = [0.0, 1.0, 0.0]\nwidth_mm = 1.0\nresolution = [2, 2]\n\
             [[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n"
        );
        let (_, mut warnings) = build(model, &rest);
        warnings.retain(|w| w.contains("1000000 mm from the origin"));
        warnings.len()
    };
    for model in ["microflake", "packed"] {
        assert_eq!(far_warnings(model, 1e6), 1, "{model}");
        assert_eq!(far_warnings(model, 1e4), 0, "{model}");
    }
    // Places of explicit fibres are in double precision.
    assert_eq!(far_warnings("fibres", 1e6), 0);
}
