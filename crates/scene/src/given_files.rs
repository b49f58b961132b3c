//! Files that a caller gives in memory.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Bytes that stand for the files at certain paths. Such a path need not exist; names in the
/// file are relative to its folder, as in any other file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GivenFiles(HashMap<PathBuf, Vec<u8>>);

impl GivenFiles {
    /// The bytes for a path, exactly as it is spelled.
    pub fn get(&self, path: &Path) -> Option<&[u8]> {
        self.0.get(path).map(Vec::as_slice)
    }

    /// Gives one more file, or another one of the same path.
    pub fn insert(&mut self, path: PathBuf, bytes: Vec<u8>) {
        self.0.insert(path, bytes);
    }

    /// Gives the files of others, too; theirs take the place of those of the same path.
    pub fn extend(&mut self, others: GivenFiles) {
        self.0.extend(others.0);
    }
}

impl<P: Into<PathBuf>, B: Into<Vec<u8>>> FromIterator<(P, B)> for GivenFiles {
    fn from_iter<I: IntoIterator<Item = (P, B)>>(files: I) -> GivenFiles {
        let files = files.into_iter();
        GivenFiles(
            files
                .map(|(path, bytes)| (path.into(), bytes.into()))
                .collect(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load;
    use crate::loader::Loader;
    use std::sync::Arc;

    const SCENE: &str = "[camera]\norigin_mm = [0.0, 0.0, 5.0]\ntarget_mm = [0.0, 0.0, 0.0]\n\
                         width_mm = 1.0\n[[object]]\nkind = 'cloth'\nfabric = 'given.toml'\n\
                         voxel_um = 40.0\n";

    fn folder() -> PathBuf {
        PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics"))
    }

    fn loaded(scene: &str, fabric: &str) -> Result<usize, String> {
        let path = folder().join("no_such_scene.toml");
        let fabric = (folder().join("given.toml"), fabric.to_owned());
        let given = [(path.clone(), scene.to_owned()), fabric]
            .into_iter()
            .collect();
        let loader = Loader::new().with_given(Arc::new(given));
        let loaded = load(&path, &[], &loader).map_err(|e| e.to_string())?;
        let scene = loaded.build(None, &loader).map_err(|e| e.to_string())?;
        assert_eq!(loader.inputs()[0].path, path);
        Ok(scene.media.len())
    }

    #[test]
    fn a_scene_and_its_fabric_are_read_from_memory() {
        let fabric = std::fs::read_to_string(folder().join("organza.toml")).unwrap();
        assert_eq!(loaded(SCENE, &fabric), Ok(1));
        // Nobody has seen the lines of these texts.
        let words = loaded(&SCENE.replace("width_mm", "widht_mm"), &fabric).unwrap_err();
        assert!(words.contains("no_such_scene.toml: camera"), "{words}");
        let words = loaded(
            SCENE,
            &fabric.replace("[draft]", "[draft]\nweaev = 'plain'"),
        );
        let words = words.unwrap_err();
        assert!(
            words.contains("given.toml: draft.weaev: unknown"),
            "{words}"
        );
        // The known-bad twin: without the fabric in memory there is none.
        let words = loaded(&SCENE.replace("given", "other"), &fabric).unwrap_err();
        assert!(words.contains("no such file"), "{words}");
    }

    #[test]
    fn a_file_that_a_key_names_is_known_to_be_missing() {
        let fabric = |draft: &str, more: &str| {
            format!(
                "[draft]\n{draft}\n[warp]\nyarn = 'a'\nper_cm = 24.0\n[weft]\nyarn = 'a'\n\
                 per_cm = 22.0\n[yarn.a]\npreset = 'cotton'\ntex = 30.0\n{more}"
            )
        };
        let plain = fabric("weave = 'plain'", "");
        let with = |more: &str| format!("{SCENE}{more}");
        let print = "[print]\nimage = 'none.png'\n";
        let sky = "[[light]]\nkind = 'environment'\nfile = 'none.exr'\n";
        let volume = "[[object]]\nkind = 'volume'\nfile = 'none.ovox'\n";
        for (scene, fabric, key) in [
            (
                SCENE.to_owned(),
                fabric("picture = 'none.png'", ""),
                "draft.picture",
            ),
            (
                SCENE.to_owned(),
                fabric("wif = 'none.wif'", ""),
                "draft.wif",
            ),
            (
                SCENE.to_owned(),
                fabric("weave = 'plain'", print),
                "print.image",
            ),
            (with(sky), plain.clone(), "light[0]"),
            (
                with("mesh = 'none.obj'\nmm_per_uv = 10.0\n"),
                plain.clone(),
                "none.obj",
            ),
            (with(volume), plain.clone(), "none.ovox"),
            (SCENE.replace("given", "none"), plain.clone(), "object[0]"),
        ] {
            let path = folder().join("no_such_scene.toml");
            let texts = [(path.clone(), scene), (folder().join("given.toml"), fabric)];
            let loader = Loader::new().with_given(Arc::new(texts.into_iter().collect()));
            let built = load(&path, &[], &loader).and_then(|l| l.build(None, &loader));
            let why = built.err().unwrap();
            assert!(why.is_missing && why.to_string().contains(key), "{why:?}");
        }
    }
}
