//! The side that a cloth is lit from.

use serde::{Deserialize, Serialize};

/// From which side of the cloth, seen from the camera, light comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lit {
    /// From the camera's side.
    Front,
    /// From behind.
    Back,
}

impl Lit {
    /// Both.
    pub const ALL: [Lit; 2] = [Lit::Front, Lit::Back];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Lit::Front => "front",
            Lit::Back => "back",
        }
    }
}
