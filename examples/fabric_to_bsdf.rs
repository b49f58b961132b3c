//! Measures how much light the fibres of a fabric reflect and transmit, by the angle from which it comes.
//!
//! ```sh
//! cargo run --release --example fabric_to_bsdf -- scenes/fabrics/organza.toml
//! ```

// A program prints.
#![allow(clippy::print_stdout)]

use organza::toml::toml;
use organza::{Context, Measure, Request};
use std::error::Error;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("expected a fabric file")?;
    let table = toml! {
        pairs = "directions.csv"
        albedo = true
        model = "fibres"
        spp = 4096
        seed = 1
    };
    let measure = Measure {
        file: file.into(),
        ..Measure::from_table(table)?
    };
    // In place of a file on the disk.
    let directions = [("directions.csv", "theta_i,phi_i\n0,0\n30,0\n60,0\n")];
    let context = Context {
        given: Arc::new(directions.into_iter().collect()),
        ..Context::default()
    };
    let found = measure.run(&context)?;
    println!("{}", found.json()["albedo"]);
    Ok(())
}
