//! What a scanned volume keeps of itself: how it was made, its materials and their optics, as
//! TOML in the file [`organza_volume::ovox::SCAN_FILE`] of an `.ovox`.

use crate::error::{InputError, Result};
use crate::optics::{self, OpticsFile};
use organza_basis::Rgb;
use organza_scatter::FlakeOptics;
use organza_volume::ovox::{SCAN_FILE, SourceFile};
use organza_weave::Material;
use serde::Deserialize;
use std::path::Path;
use toml::Table;

/// The contents of the file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScanFile {
    /// How the scan was made and what it found: for readers and `organza info`.
    pub scan: Table,
    /// The materials of the voxels, in their order.
    pub material: Vec<ScanMaterial>,
    /// `[optics.NAME]`: how the fibres of a material scatter, `*` for all.
    pub optics: OpticsFile,
}

/// `[[material]]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScanMaterial {
    /// Its name, to which `[optics.NAME]` refers.
    pub name: String,
    /// Colour of a thick heap of its fibres; that of undyed cloth if none.
    pub colour: Option<[f32; 3]>,
}

impl ScanFile {
    /// The scan among the files of a volume; `None` for a volume of a fabric. `path` is that of
    /// the volume, for messages.
    ///
    /// # Errors
    /// A text that is no such file.
    pub fn find(path: &Path, files: &[SourceFile]) -> Result<Option<ScanFile>> {
        let Some(file) = files.first().filter(|f| f.name == SCAN_FILE) else {
            return Ok(None);
        };
        let fail = |why: String| InputError::of_file(path, format!("its {SCAN_FILE}: {why}"));
        let text = std::str::from_utf8(&file.bytes).map_err(|e| fail(e.to_string()))?;
        let scan: ScanFile = toml::from_str(text).map_err(|e| fail(e.message().to_owned()))?;
        optics::check(&scan.optics, &scan.materials(), [].iter())
            .map_err(|why| fail(format!("optics{why}")))?;
        Ok(Some(scan))
    }

    /// The materials, as those of a cloth.
    pub fn materials(&self) -> Vec<Material> {
        let material = |m: &ScanMaterial| Material {
            yarn: m.name.clone(),
            fibre: None,
            colour: m.colour.map(Rgb::from),
            fibre_radius_mm: 0.0,
        };
        self.material.iter().map(material).collect()
    }

    /// The flakes of `count` materials, where the tables of a scene come before those of the
    /// scan.
    ///
    /// # Errors
    /// `.key: what was expected` of a scene's table; fewer materials than `count`.
    pub fn flakes(
        &self,
        scene: &OpticsFile,
        count: usize,
    ) -> std::result::Result<Vec<FlakeOptics>, String> {
        let materials = self.materials();
        if materials.len() < count {
            return Err(format!(
                ": the voxels have {count} materials, the scan names {}",
                materials.len()
            ));
        }
        optics::check(scene, &materials, [].iter())?;
        let files = [scene.clone(), self.optics.clone()];
        let flakes = materials
            .iter()
            .map(|m| optics::of_material(&files, m).flakes(m.colour));
        Ok(flakes.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> Vec<SourceFile> {
        vec![SourceFile {
            name: SCAN_FILE.into(),
            bytes: text.into(),
        }]
    }

    #[test]
    fn materials_have_the_optics_of_the_scan_unless_the_scene_has_others() {
        let text = "[scan]\nthreshold = 3.5\n[[material]]\nname = 'warp'\n[[material]]\nname = \
                    'weft'\ncolour = [0.8, 0.1, 0.1]\n[optics.warp]\nalbedo = [0.5, 0.6, 0.7]\n\
                    ['optics'.'*']\nend_on_ratio = 0.3\n";
        let path = Path::new("a.ovox");
        let scan = ScanFile::find(path, &file(text)).unwrap().unwrap();
        let flakes = scan.flakes(&OpticsFile::default(), 2).unwrap();
        assert_eq!(flakes[0].albedo, Rgb::from([0.5, 0.6, 0.7]));
        assert_eq!(flakes[1].end_on_ratio, 0.3);
        assert!(flakes[1].albedo.0.x > 0.9 && flakes[1].albedo.0.y < 0.6);
        let scene: OpticsFile = toml::from_str("[weft]\nend_on_ratio = 0.5\n").unwrap();
        assert_eq!(scan.flakes(&scene, 2).unwrap()[1].end_on_ratio, 0.5);
        let wrong: OpticsFile = toml::from_str("[wefft]\n").unwrap();
        let why = scan.flakes(&wrong, 2).unwrap_err();
        assert!(why.ends_with("did you mean `weft`?"), "{why}");
        assert!(scan.flakes(&scene, 3).is_err());
    }

    #[test]
    fn other_files_are_no_scan_and_mistakes_are_reported() {
        let path = Path::new("a.ovox");
        assert!(ScanFile::find(path, &[]).unwrap().is_none());
        let mut fabric = file("");
        fabric[0].name = "plain.toml".into();
        assert!(ScanFile::find(path, &fabric).unwrap().is_none());
        let e = ScanFile::find(path, &file("[scann]\n")).unwrap_err();
        assert!(e.to_string().starts_with("a.ovox: its scan.toml: "), "{e}");
    }
}
