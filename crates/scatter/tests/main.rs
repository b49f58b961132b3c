//! The crate from outside. Each module describes itself.

mod packed_fibres;
mod packed_precision;
mod ply_precision;
mod slabs;
