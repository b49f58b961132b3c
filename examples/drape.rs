//! Lays a fabric over a mesh, both written here, and writes a picture with the variance of every pixel.
//!
//! ```sh
//! cargo run --release --example drape -- drape.exr
//! ```

// A program prints, and writes its files as it likes.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use organza::picture::{Attributes, Display, Rendered, exr};
use organza::scene::{self, loader::Loader};
use organza::transport::{self, CachePlan, EngineChoice, Integrator, RenderSettings, Rendering};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

const FABRIC: &str = r#"
draft = { weave = "twill-2-2-z" }
warp = { per_cm = 20.0, colours = "4 navy, 2 white" }
weft = { per_cm = 18.0, colours = "4 navy, 2 white" }
yarn.wool = { tex = 40.0 }
tile = { repeats = [3, 3] }
"#;

const SCENE: &str = r#"
[camera]
kind = "perspective"
origin_mm = [0.0, -40.0, 45.0]
target_mm = [0.0, 0.0, 0.0]
fov_deg = 25.0
resolution = [256, 256]
[[light]]
kind = "environment"
radiance = [1.0, 1.0, 1.0]
hemisphere = "front"
[[object]]
kind = "cloth"
fabric = "wool.toml"
model = "fibres"
mesh = "waves.obj"
mm_per_uv = 10.0
"#;

/// A sheet of 30 x 30 mm in waves, with texture coordinates in centimetres.
fn waves() -> String {
    let edge = 31;
    let mut text = String::new();
    for (j, i) in (0..edge).flat_map(|j| (0..edge).map(move |i| (j, i))) {
        let [x, y] = [i, j].map(|n| n as f32 - 15.0);
        text += &format!("v {x} {y} {}\n", 1.5 * (0.4 * x + 0.1 * y).sin());
        text += &format!("vt {} {}\n", 0.1 * x, 0.1 * y);
    }
    for (j, i) in (1..edge).flat_map(|j| (1..edge).map(move |i| (j, i))) {
        let a = (j - 1) * edge + i;
        let [b, c, d] = [a + 1, a + edge + 1, a + edge];
        text += &format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n");
    }
    text
}

fn main() -> Result<(), Box<dyn Error>> {
    let picture = std::env::args()
        .nth(1)
        .ok_or("expected a picture to write")?;
    let mut loader = Loader::new();
    loader.give("wool.toml", FABRIC);
    loader.give("waves.obj", waves());
    let loaded = scene::from_str(SCENE, Path::new("scene.toml"), &[], &loader)?;
    let built = loaded.build(None, &loader)?;
    let settings = RenderSettings {
        integrator: Integrator::Woodcock,
        samples: 0..16,
        max_bounces: u32::MAX,
        seed: 1,
        crop: None,
    };
    let engine = transport::engine(&built, &settings, EngineChoice::Processor, 8 << 30)?;
    let mut rendering = Rendering::new(&built, settings)?.with_engine(engine);
    // What `organza render` learns of a picture of this size before its first sample.
    let plan: Option<CachePlan> = loaded.file.render.cache_plan([256, 256]);
    if let Some(plan) = plan {
        rendering = rendering.with_cache(&plan, &|_| ControlFlow::Continue(()))?;
    }
    let rendering = rendering.take(16, &|_| ControlFlow::Continue(()))?;
    let attributes = Attributes::default();
    let shown = Rendered::new(rendering.film(), Display::default(), &attributes);
    let write = exr::FORMAT.writer.ok_or("no writer")?;
    write(&shown, &mut std::fs::File::create(&picture)?)?;
    Ok(())
}
