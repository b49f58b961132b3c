//! Voxelizes a fabric and writes the tile for OpenVDB, Mitsuba or organza.
//!
//! ```sh
//! cargo run --release --example volume_to_file -- scenes/fabrics/organza.toml organza.vdb
//! ```

// A program prints.
#![allow(clippy::print_stdout)]

use organza::{Context, Output, Request, Voxelize};
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (Some(fabric), Some(path)) = (arguments.next(), arguments.next()) else {
        return Err("expected a fabric file, and a volume to write".into());
    };
    let mut voxelize = Voxelize {
        fabric,
        ..Voxelize::default()
    };
    voxelize.prepare_for(&path)?;
    let volume = voxelize.run(&Context::default())?;
    for name in volume.write(&path)? {
        println!("{}", name.display());
    }
    Ok(())
}
