//! Compares what the surface model of a fabric reflects with what its fibres do, with error bars.
//!
//! ```sh
//! cargo run --release --example models_compared -- scenes/fabrics/denim.toml
//! ```

// A program prints, and writes its files as it likes.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use organza::basis::unwatched;
use organza::measure::{
    Effort, PatchResponse, SurfacePatch, VolumePatch, measure_albedos, parse_incident,
};
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
    let patches: [(&str, Box<dyn PatchResponse>); 2] = [
        (
            "fibres",
            Box::new(VolumePatch::of_media(media, Integrator::Woodcock)?),
        ),
        (
            "surface",
            Box::new(SurfacePatch(fabric.surface(&path)?.surface)),
        ),
    ];
    let effort = Effort {
        paths: 8192,
        seed: 1,
        target_error: None,
    };
    let incident = parse_incident("theta_i,phi_i\n0,0\n60,0\n")?;
    for (name, patch) in &patches {
        for found in measure_albedos(patch, &incident, &effort, &unwatched)?.list {
            let reflected = found.reflected;
            println!(
                "{name}: {:?} {:.3?} +- {:.3?}",
                found.incident, reflected.mean, reflected.se
            );
        }
    }
    Ok(())
}
