//! Shows any cloth: a WIF draft, a fabric file or a named weave becomes a picture.
//!
//! ```sh
//! cargo run --release --example draft_to_picture -- scenes/drafts/first_light.wif draft.png
//! ```

// A program prints, and writes its files as it likes.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use organza::picture::{Attributes, Display, Rendered, format_of_ending};
use organza::scene::{self, loader::Loader, studio::Studio, subject};
use organza::transport::{self, EngineChoice, Integrator, RenderSettings, Rendering};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(word), Some(picture)) = (arguments.next(), arguments.next()) else {
        return Err("expected a draft, fabric or weave, and a picture to write".into());
    };
    let ending = Path::new(&picture).extension().unwrap_or_default();
    let format = format_of_ending(&ending.to_string_lossy()).and_then(|f| f.writer);
    let write = format.ok_or("expected a picture that ends in .png or .exr")?;
    let making = subject::Making {
        studio: Some(Studio::Swatch),
        overrides: &[],
    };
    let made = subject::scene_for(Path::new(&word), making, &Loader::new())?;
    let made = made.ok_or("expected a cloth, found a scene")?;
    let loader = Loader::new().with_given(Arc::new(made.given()));
    let loaded = scene::load(&made.scene_path, &[], &loader)?;
    for warning in loader.warnings() {
        println!("{warning}");
    }
    let built = loaded.build(None, &loader)?;
    let settings = RenderSettings {
        integrator: Integrator::Woodcock,
        samples: 0..16,
        max_bounces: u32::MAX,
        seed: loaded.file.render.seed,
        crop: None,
    };
    let engine = transport::engine(&built, &settings, EngineChoice::Fastest, 8 << 30)?;
    let rendering = Rendering::new(&built, settings)?.with_engine(engine);
    let rendering = rendering.take(16, &|_| ControlFlow::Continue(()))?;
    let attributes = Attributes::default();
    let shown = Rendered::new(rendering.film(), Display::default(), &attributes);
    write(&shown, &mut std::fs::File::create(&picture)?)?;
    println!(
        "{picture}: error {:.3} of the mean",
        rendering.relative_error()
    );
    Ok(())
}
