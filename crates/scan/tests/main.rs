//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::disallowed_methods)] // helpers outside test functions

mod fabrics;
mod inputs;
mod known_answers;
