//! The crate from outside. Each module describes itself.

mod comparison;
