//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used)] // helpers outside test functions

mod packed_fibres;
mod packed_precision;
mod ply_precision;
mod slabs;
