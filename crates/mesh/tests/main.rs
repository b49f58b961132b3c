//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used)] // helpers outside test functions

mod mesh;
mod shell;
