//! Compares what the surface model of a fabric reflects with what its fibres do, with error bars.
//!
//! ```sh
//! cargo run --release --example models_compared -- scenes/fabrics/denim.toml report
//! ```

// A program prints.
#![allow(clippy::print_stdout)]

use organza::{Compare, Context, Output, Request};
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (Some(fabric), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err("expected a fabric file, and a folder for the report".into());
    };
    let compare = Compare {
        fabric,
        spp: 256,
        ..Compare::default()
    };
    let comparison = compare.run(&Context::default())?;
    for line in comparison.0.summary() {
        println!("{line}");
    }
    comparison.write(&folder)?;
    Ok(())
}
