//! The identity of a picture, so that only samples of the same picture are put
//! together.

use crate::sample_ranges::SampleRanges;
use organza_scene::scene_file::{RenderTable, SceneFile};
use organza_transport::Crop;
use sha2::{Digest, Sha256};

/// A picture but for its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// See [`scene_digest`].
    pub scene: [u8; 32],
    /// Seed of the random numbers.
    pub seed: u64,
    /// Pixels of the whole picture.
    pub crop: Crop,
}

/// Digest of everything that decides the value of a sample besides the seed:
/// the version of the program, the scene file after all overrides (but what
/// only says how many samples to take and how to show them), the bytes of all
/// files that it names, and whether the kernel walks the paths (all of whose
/// back ends give the same) or the general walk.
pub fn scene_digest(file: &SceneFile, inputs: &[[u8; 32]], by_kernel: bool) -> [u8; 32] {
    let render = RenderTable {
        spp: 0,
        seed: 0,
        exposure: 0.0,
        ..file.render.clone()
    };
    let SceneFile {
        render: _,
        camera,
        light,
        object,
    } = file;
    let mut digest = Sha256::new();
    digest.update(env!("CARGO_PKG_VERSION"));
    digest.update(format!("{render:?}{camera:?}{light:?}{object:?}"));
    digest.update([u8::from(by_kernel)]);
    for input in inputs {
        digest.update(input);
    }
    digest.finalize().into()
}

impl Identity {
    /// What a picture file records of itself.
    pub fn attributes(&self, samples: &SampleRanges) -> Vec<(&'static str, String)> {
        let hex: String = self.scene.iter().map(|b| format!("{b:02x}")).collect();
        vec![
            ("identity", hex),
            ("seed", self.seed.to_string()),
            ("crop", crop_words(self.crop)),
            ("spp", samples.count().to_string()),
            ("samples", samples.to_string()),
        ]
    }
}

/// A crop as `--crop` takes it.
pub fn crop_words(crop: Crop) -> String {
    let Crop { min, max } = crop;
    format!("{},{},{},{}", min.x, min.y, max.x, max.y)
}
