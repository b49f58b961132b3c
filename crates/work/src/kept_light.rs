//! Files of light that one picture has learned at fibres, for others of the same cloth and lights
//! (`--save-light`, `--load-light`).

use crate::error::of_file;
use crate::identity::NamedDigest;
use crate::{output, version};
use anyhow::Result;
use organza_cache::{Description, Key, decode, encode};
use organza_scene::loader::Loader;
use organza_transport::KeptLight;
use std::path::Path;

/// What light is of: the program, the scene but for its camera, and the files that it names.
pub fn key(scene: &str, inputs: &[NamedDigest]) -> Key {
    let digests = inputs.iter().map(|(_, digest)| digest.as_str());
    let code = version::code();
    let parts: Vec<&[u8]> = [code.as_str(), scene]
        .into_iter()
        .chain(digests)
        .map(str::as_bytes)
        .collect();
    Key::of("light", &parts)
}

/// Writes light of a scene.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, key: &Key, scene: &Path, light: &KeptLight) -> Result<()> {
    let about = Description {
        kind: "light".into(),
        name: scene.to_string_lossy().into_owned(),
        details: String::new(),
        program: format!("organza {}", version::build()),
    };
    output::write_file(path, |mut out| {
        let write = |out: &mut dyn std::io::Write| out.write_all(&light.to_bytes());
        Ok(encode(&mut out, key, &about, write)?)
    })
}

/// Reads light of a scene, which takes at most so many bytes.
///
/// # Errors
/// The file cannot be read, is damaged, too large, or of another scene or program.
pub fn read(
    path: &Path,
    key: &Key,
    scene: &Path,
    most_bytes: u64,
    loader: &Loader<'_>,
) -> Result<KeptLight> {
    let fail = |why: String| of_file(path, why);
    // What cannot be looked at cannot be read either, which says why.
    let size = loader.file_bytes(path).unwrap_or(0);
    if size > most_bytes {
        return Err(fail(format!(
            "holds {} MiB of light; an eighth of render.cache_mib may be loaded",
            size.div_ceil(1 << 20),
        )));
    }
    let bytes = loader.bytes(path)?;
    let bytes = decode(bytes, key).map_err(|why| match why {
        "belongs to another key" => fail(format!(
            "is light of another cloth, of other lights, or by another program than those of {}; \
             only the camera, samples, seed and cache may differ, and not what auto chooses by them",
            scene.display()
        )),
        why => fail(format!("{why}; expected a file of --save-light")),
    })?;
    KeptLight::from_bytes(&bytes).ok_or_else(|| fail("holds no light of --save-light".into()))
}
