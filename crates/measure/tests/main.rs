//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used)] // helpers outside test functions

mod adaptive;
mod appearance;
mod fit;
mod planted;
mod polynomial_map;
mod slab;
mod surface;
mod tensor_tree;
mod texels;
