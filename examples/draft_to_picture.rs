//! Shows any cloth: a WIF draft, a fabric file or a named weave becomes a picture.
//!
//! ```sh
//! cargo run --release --example draft_to_picture -- scenes/drafts/first_light.wif draft.png
//! ```

// A program prints.
#![allow(clippy::print_stdout)]

use organza::{Context, Listener, Output, Render, Request};
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

/// Prints warnings.
struct Printer;

impl Listener for Printer {
    fn warn(&self, warning: &str) {
        println!("{warning}");
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (Some(scene), Some(path)) = (arguments.next(), arguments.next()) else {
        return Err("expected a draft, fabric or weave, and a picture to write".into());
    };
    let mut render = Render {
        scene,
        spp: Some(16),
        ..Render::default()
    };
    render.prepare_for(&path)?;
    let context = Context {
        listener: Arc::new(Printer),
        ..Context::default()
    };
    let picture = render.run(&context)?;
    picture.write(&path)?;
    println!(
        "{}: error {} of the mean",
        path.display(),
        picture.figures()["relative_error"]
    );
    Ok(())
}
