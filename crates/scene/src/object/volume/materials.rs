//! The materials of volumes: their names, which voxels have them, and what a scene says of them.

use super::{Content, VolumeObject, VolumeTable};
use crate::build_options::BuildOptions;
use crate::error::Result;
use crate::optics::{self, EVERY_YARN};
use crate::representation::{MICROFLAKE, ModelKey};
use crate::scan_file::ScanFile;
use crate::volume_file;
use organza_basis::{Budget, Rgb};
use organza_scatter::{FlakeFamily, FlakeOptics};
use organza_volume::format::Volume;
use std::collections::BTreeMap;

/// The materials of a volume by their names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VolumeMaterials {
    /// The names that `[object.optics.NAME]` may have, each once; none for grids and where the
    /// file knows none.
    pub names: Vec<String>,
    /// Index into the names, for each yarn of the tile.
    pub name_of_yarn: BTreeMap<u32, usize>,
}

impl VolumeTable {
    /// The materials of the volume that is object `index` of a scene.
    ///
    /// # Errors
    /// A file that cannot be read, or that does not go with the table.
    pub fn materials(
        &self,
        index: usize,
        options: &BuildOptions<'_>,
        budget: &mut Budget,
    ) -> Result<VolumeMaterials> {
        let object = VolumeObject::new(self, index, options);
        let format = super::format_of(&object.path).map_err(|why| object.fail(why))?;
        let volume = volume_file::read(&object.path, options.loader, |source| {
            (format.read)(source, budget)
        })?;
        let Volume::Octree(stored) = volume else {
            return Ok(VolumeMaterials::default());
        };
        let scan = ScanFile::find(&object.path, &stored.files)?;
        let materials: Vec<String> = match scan {
            Some(scan) => scan.material.into_iter().map(|m| m.name).collect(),
            None => match object.octree(stored.clone())? {
                Content::Cloth(fabric, ..) => {
                    let list = fabric.cloth.materials().iter();
                    list.map(|m| m.yarn.clone()).collect()
                }
                _ => Vec::new(),
            },
        };
        let mut names = materials.clone();
        names.sort();
        names.dedup();
        let of_yarn = stored.octree.materials_of_yarns();
        let number = |material: u16| {
            let name = materials.get(usize::from(material))?;
            names.iter().position(|n| n == name)
        };
        let name_of_yarn = of_yarn
            .into_iter()
            .filter_map(|(yarn, material)| Some((yarn, number(material)?)))
            .collect();
        Ok(VolumeMaterials {
            names,
            name_of_yarn,
        })
    }
}

impl VolumeObject<'_> {
    /// Refuses whatever is not micro-flakes of the usual family.
    pub(super) fn check_plain_flakes(&self, why: &str) -> Result<()> {
        let table = self.table;
        let is_flakes = table.model.is_none_or(|m| m == ModelKey::Is(&MICROFLAKE));
        let is_sggx = table.flake.is_none_or(|f| f == FlakeFamily::SGGX_SPECULAR);
        if is_flakes && is_sggx {
            return Ok(());
        }
        Err(self.fail(format!(
            ".model: expected \"microflake\" with flake = \"sggx-specular\"; {why}"
        )))
    }

    /// Optics for yarns that the file does not name.
    pub(super) fn check_optics(&self, materials: &[organza_weave::Material]) -> Result<()> {
        optics::check(&self.table.optics, materials, [].iter())
            .map_err(|why| self.fail(format!(".optics{why}")))
    }

    /// What the scene says of fibres whose material is not known; `own` albedo is the
    /// file's.
    pub(super) fn flakes(&self, own: Option<Rgb>) -> Result<FlakeOptics> {
        let given = self.every_yarn();
        let albedo = given.albedo.map(Rgb::from).or(own);
        let albedo = albedo.or(self.table.albedo.map(Rgb::from));
        let albedo =
            albedo.ok_or_else(|| self.fail(".albedo: is missing; the file has no materials"))?;
        Ok(FlakeOptics {
            albedo,
            ..given.flakes(None)
        })
    }

    pub(super) fn every_yarn(&self) -> optics::OpticsTable {
        let list = self.table.optics.get(EVERY_YARN);
        list.map(|list| list.of(None, None)).unwrap_or_default()
    }
}
