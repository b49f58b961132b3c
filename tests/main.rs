//! Claims that cross crates and the program as its users run it, in one test
//! binary.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers outside test functions

mod appearance; // optics of volumes found from pictures and pairs
mod bake; // materials for other programs
mod bench; // speed against error, and what it chooses
mod block_files; // cloths of blocks: files and levels of detail
mod cache; // volumes that are kept from run to run
mod checkpoints; // renders that are killed or interrupted, and resumed
mod cli; // commands, exit codes and messages
mod control_groups; // limits of memory that they set
mod corpora; // readers on damaged files
mod denoise; // renders without noise
mod development; // exposure, curves and white balance of pictures
mod display; // renders on a display server
mod documents; // commands and links of README and pages
mod fabrics; // cloths that several of them weave
mod failing_disk; // every write that fails in turn
mod far; // surface models, meshes and levels of detail in scenes
mod far_table; // tables of the far field
mod farm; // templates and scripts for render farms
mod faults; // full disks, little memory, special files
mod fireflies; // the brightest samples, and the clamp
mod flags; // wrong flags and command lines
mod flake_families; // micro-flakes that only the general walk renders
#[cfg(feature = "gpu")]
mod gpu; // graphics adapters, and pictures by several engines
mod hard_cases; // degenerate geometry, views and lights through every tracker
mod in_process; // scenes that tests build and render themselves
mod invalid; // the message for every kind of wrong input
mod kills; // commands killed at random moments
mod lenses; // thin lenses in scenes
mod library; // libraries of fabrics to browse
mod light_layers; // direct light, errors of the cache, and light that is kept
mod lights_and_export; // lights of scene files, scenes for another renderer
mod measure; // the virtual goniometer
mod merging; // sample ranges, and merging of the parts
mod other_cloths; // pile, nonwovens and nets through every stage
mod photographs; // cloth that is fitted to photographs
mod planted_photographs; // pictures of a cloth, as a camera takes them
mod ply_fits; // corrections of plies found from values, pictures and fibres
mod program; // how the others run the program
mod refusals; // what is refused before it begins, and left as it was
mod requests; // as values, tables and commands
mod scan; // volumes from micro-CT slices
mod scan_cloth; // flat tiles of tilted scans
mod scan_slices; // slices in files of PNG
mod shades; // bands beyond light, the sheet of a shade, and fits to measured ones
mod slab; // the tracker against an independent renderer's slab
mod stopping; // time limits and target errors
mod studios; // cloths that come without a scene
mod tidy; // the repository itself
mod view; // the live page as a process
mod volumes; // volume files: what they keep, and what is refused
mod wanted_colours; // colours of fibres for a wanted colour of the cloth
mod wrong_tables; // felt, pile, nets and prints that make no sense
