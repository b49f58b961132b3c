//! Measures how much light the fibres of a fabric reflect and transmit, by the angle from which it comes.
//!
//! ```sh
//! cargo run --release --example fabric_to_bsdf -- scenes/fabrics/organza.toml
//! ```

// A program prints, and writes its files as it likes.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use organza::basis::unwatched;
use organza::measure::{Effort, VolumePatch, measure_albedos, parse_incident};
use organza::scene::{fabric_file, loader::Loader};
use organza::transport::{AnyMedium, Integrator};
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let path: PathBuf = std::env::args()
        .nth(1)
        .ok_or("expected a fabric file")?
        .into();
    let loader = Loader::new();
    let fabric = fabric_file::load(&path, &[], &loader)?;
    let fibres = fabric.explicit_fibres(&path, None, &loader)?;
    let media = vec![AnyMedium::ExplicitFibres(fibres)];
    let patch = VolumePatch::of_media(media, Integrator::Woodcock)?;
    let effort = Effort {
        paths: 4096,
        seed: 1,
        target_error: None,
    };
    let incident = parse_incident("theta_i,phi_i\n0,0\n30,0\n60,0\n")?;
    let results = measure_albedos(&patch, &incident, &effort, &unwatched)?;
    for found in results.list {
        let [reflected, transmitted] = [found.reflected, found.transmitted];
        println!(
            "from {:?}: reflects {:.3?} +- {:.3?}, transmits {:.3?} +- {:.3?}",
            found.incident, reflected.mean, reflected.se, transmitted.mean, transmitted.se
        );
    }
    Ok(())
}
