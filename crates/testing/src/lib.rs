//! Helpers that the tests of several crates share. Only `[dev-dependencies]` name this
//! crate. It imports the lowest crates, so that it can make fibres, pictures and segments
//! for the tests of the crates above them.
//!
//! ```
//! let rows = organza_testing::csv_numbers("# a table\na,b\n1,2.5\n3,4\n");
//! assert_eq!(rows, [[1.0, 2.5], [3.0, 4.0]]);
//! ```
#![allow(clippy::disallowed_methods)] // lists folders for tests

mod effort;
mod fibre;
mod folder;
mod picture;
mod skipped;
mod table;
mod text;
mod weave;

pub use effort::{is_full, sized};
pub use fibre::{dielectric_fibre, fitted_fibre};
pub use folder::file_names;
pub use picture::environment_with_lamps;
pub use skipped::skipped;
pub use table::{csv_numbers, table_rows};
pub use text::assert_contains;
pub use weave::{little_weave, twisted_weave};
