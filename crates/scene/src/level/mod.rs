//! Levels of detail: the key `lod` of objects, and the levels that a scene builds for
//! it. Which of them a path meets is drawn in `organza_transport`
//! ([`LevelSteps`](organza_transport::LevelSteps)).

mod level_choice;
mod lod_key;

pub use level_choice::Levels;
pub use lod_key::{Lod, LodName};
