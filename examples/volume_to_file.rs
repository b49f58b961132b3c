//! Voxelizes a fabric and writes the tile for OpenVDB, Mitsuba or organza.
//!
//! ```sh
//! cargo run --release --example volume_to_file -- scenes/fabrics/organza.toml organza.vdb
//! ```

// A program prints, and writes its files as it likes.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use organza::scatter::FlakeMaterials;
use organza::scene::{fabric_file, loader::Loader};
use organza::volume::FibreFootprint;
use organza::volume::format::{self, Voxels};
use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (Some(path), Some(volume)) = (arguments.next(), arguments.next()) else {
        return Err("expected a fabric file, and a volume to write".into());
    };
    let format =
        format::by_name(&volume.to_string_lossy()).ok_or("expected .vdb, .vol or .ovox")?;
    let loader = Loader::new();
    let fabric = fabric_file::load(&path, &[], &loader)?;
    let octree = fabric.voxelize(&path, FibreFootprint::Covered, None, None, None, &loader)?;
    let materials = FlakeMaterials::new(fabric.flake_optics());
    let voxels = Voxels {
        octree: &octree,
        level: 0,
        half: false,
        raw: false,
        files: fabric.sources(),
        merge: &|mixture| materials.merged(mixture),
    };
    for part in (format.write)(&voxels)? {
        let name = match part.infix {
            Some(infix) => volume.with_extension(format!("{infix}.{}", format.ending)),
            None => volume.clone(),
        };
        (part.write)(&mut BufWriter::new(File::create(&name)?))?;
        println!("{}", name.display());
    }
    Ok(())
}
