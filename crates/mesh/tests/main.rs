//! The crate from outside. Each module describes itself.

mod mesh;
mod shell;
