//! The crate from outside. Each module describes itself.

mod adaptive;
mod appearance;
mod fit;
mod planted;
mod polynomial_map;
mod slab;
mod surface;
mod tensor_tree;
mod texels;
