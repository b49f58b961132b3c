//! A scene laid out for any engine.

use crate::engine::{EngineRecord, MadeEngine};
use crate::fibres::fibre_scene::FibreScene;
use crate::refusal::Refusal;
use crate::voxels::flat_scene::FlatScene;
use std::sync::Arc;

/// A scene as data. Laying out takes longer than making an engine, so several engines may
/// be tried for one scene.
pub enum LaidOut {
    /// Micro-flakes or virtual fibres in voxels.
    Voxels(Arc<FlatScene>),
    /// Explicit fibres in cells.
    Fibres(Arc<FibreScene>),
}

impl LaidOut {
    /// The engine of that record for this scene.
    ///
    /// # Errors
    /// When this computer does not have the engine, or the engine cannot hold the scene.
    pub fn engine(&self, record: &EngineRecord) -> MadeEngine {
        record.check()?;
        match self {
            LaidOut::Voxels(scene) => (record.for_voxels)(Arc::clone(scene)),
            LaidOut::Fibres(scene) => (record.for_fibres)(Arc::clone(scene)),
        }
    }

    /// The fastest of some engines, which are listed slowest first, that may be chosen and
    /// that takes the scene.
    ///
    /// # Errors
    /// When none does: why the fastest does not.
    pub fn fastest_engine(&self, engines: &[EngineRecord]) -> MadeEngine {
        let mut why = None;
        for record in engines.iter().rev().filter(|e| (e.is_automatic)()) {
            match self.engine(record) {
                Ok(engine) => return Ok(engine),
                Err(refusal) => why = why.or(Some(refusal)),
            }
        }
        Err(why.unwrap_or(Refusal::NoEngine))
    }
}
