//! The fabric file: one cloth, its geometry, its optics and its voxels.

use crate::draft_picture;
use crate::error::{InputError, Result};
pub use crate::fabric_table::{FabricFile, VoxelTable};
use crate::fibre_model;
use crate::file_kind::Wanted;
use crate::finish_optics;
use crate::large_design;
use crate::loader::{Loader, Task};
use crate::memory::free_memory_bytes;
use crate::optics::{self, Band, OpticsFile, OpticsTable};
use crate::ply_table;
use crate::print_file;
use crate::read;
use crate::woven_volume::{self, WovenVolume};
use glam::Vec2;
use organza_basis::{Rgb, SegmentSource};
use organza_scatter::{ClearFibre, Fibre};
use organza_surface::{ClothSurface, SurfaceSpec, SurfaceTable};
use organza_transport::{ExplicitFibres, FlakeOptics};
use organza_volume::ovox::SourceFile;
use organza_weave::spec::{DraftSpec, ThreadSetSpec};
use organza_weave::{Cloth, Draft, FabricGeometry, Material, Synthesis, ThreadSystem};
use rayon::prelude::*;
use std::cell::RefCell;
use std::path::Path;

/// A fabric file with the cloth it describes.
pub struct Fabric {
    /// The file.
    pub file: FabricFile,
    /// The cloth; of a cloth of blocks the exemplar.
    pub cloth: Cloth,
    /// The design of a cloth of blocks.
    pub synthesis: Option<Synthesis>,
    /// Its exemplars that are volumes, in the order of all exemplars.
    pub(crate) volumes: Vec<Option<WovenVolume>>,
    /// Optics tables, highest precedence first.
    pub(crate) optics: Vec<OpticsFile>,
    /// The band in which the fibres are seen.
    pub(crate) band: Band,
    /// The file with all overrides, and those that it names.
    pub(crate) sources: Vec<SourceFile>,
}

/// Reads a fabric file and relaxes its yarns.
///
/// # Errors
/// Names the file and the key at fault.
pub fn load(path: &Path, overrides: &[String], loader: &Loader<'_>) -> Result<Fabric> {
    load_changed(path, &[], overrides, loader)
}

/// The same without some keys, which are removed after the `overrides` are set.
///
/// # Errors
/// As [`load`].
pub fn load_changed(
    path: &Path,
    removed: &[String],
    overrides: &[String],
    loader: &Loader<'_>,
) -> Result<Fabric> {
    let source = loader.text_of(path, Wanted::Fabric)?;
    let wanted = Wanted::Fabric;
    let file: FabricFile = loader.parse_changed(path, &source, removed, overrides, wanted)?;
    let table: toml::Table = loader.parse_changed(path, &source, removed, overrides, wanted)?;
    let text = toml::to_string(&table).map_err(|e| InputError::of_file(path, e))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let sources = RefCell::new(vec![SourceFile {
        name: name.into_owned(),
        bytes: text.into_bytes(),
    }]);
    let open = |name: &str| {
        let bytes = loader.bytes_or_why(&read::beside(path, name))?;
        let mut sources = sources.borrow_mut();
        if !sources.iter().any(|s| s.name == name) {
            sources.push(SourceFile {
                name: name.to_owned(),
                bytes: bytes.clone(),
            });
        }
        Ok(bytes)
    };
    let (cloth, synthesis, volumes, optics) = build(path, &file, &open)?;
    for warning in cloth.warnings() {
        loader.warn(path, warning.to_string());
    }
    if let (Some(synthesis), None) = (&synthesis, &file.synthesis) {
        loader.warn(path, large_design::warning(synthesis));
    }
    // Pills alone recolour nothing.
    let is_rubbed = file.wear.as_ref().is_some_and(|w| w.amount.is_some());
    if file.print.is_some() || is_rubbed {
        for warning in print_file::warnings(&file.optics) {
            loader.warn(path, warning);
        }
    }
    Ok(Fabric {
        file,
        cloth,
        synthesis,
        volumes,
        optics,
        band: Band::default(),
        sources: sources.into_inner(),
    })
}

/// The fabric of a volume file, from the [files](Fabric::sources) that it keeps.
///
/// # Errors
/// Names the volume file, and in it the key at fault; there is no file to make a
/// fabric of.
pub fn from_sources(path: &Path, sources: &[SourceFile]) -> Result<Fabric> {
    let fail = |why: String| InputError::of_file(path, format!("its fabric: {why}"));
    let [first, ..] = sources else {
        return Err(fail("it keeps none".into()));
    };
    let text = std::str::from_utf8(&first.bytes).map_err(|e| fail(e.to_string()))?;
    let file: FabricFile = read::toml_changed(path, text, &[], &[], Wanted::Fabric)?;
    let open = |name: &str| {
        let found = sources.iter().skip(1).find(|s| s.name == name);
        found
            .map(|s| s.bytes.clone())
            .ok_or_else(|| std::io::ErrorKind::NotFound.into())
    };
    let (cloth, synthesis, volumes, optics) = build(path, &file, &open)?;
    Ok(Fabric {
        file,
        cloth,
        synthesis,
        volumes,
        optics,
        band: Band::default(),
        sources: sources.to_vec(),
    })
}

/// Cloth, design and volumes of a fabric, and its optics.
type Parts = (
    Cloth,
    Option<Synthesis>,
    Vec<Option<WovenVolume>>,
    Vec<OpticsFile>,
);

/// The cloth of a fabric file, and its optics.
fn build(
    path: &Path,
    file: &FabricFile,
    open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
) -> Result<Parts> {
    file.check()
        .map_err(|why| InputError::keyed(why).in_file(path))?;
    let draft = draft_picture::resolved(&file.draft, open).map_err(|e| e.in_file(path))?;
    let geometry = FabricGeometry {
        draft,
        warp: file.warp.clone(),
        weft: file.weft.clone(),
        yarn: file.yarn.clone(),
        nonwoven: file.nonwoven.clone(),
        pile: file.pile.clone(),
        relaxation: file.relaxation,
        tile: file.tile,
        ideal: file.ideal,
        fit_yarn: file.fit_yarn,
    };
    let failed = |e: organza_weave::Error| InputError::from(e).in_file(path);
    let mut geometry = geometry;
    let automatic = match &file.synthesis {
        None if file.print.is_none() && file.wear.is_none() => {
            large_design::blocks(&mut geometry, open)
        }
        _ => None,
    };
    let (mut cloth, synthesis, volumes) = match file.synthesis.as_ref().or(automatic.as_ref()) {
        None => {
            let cloth = Cloth::build(&geometry, open, file.seed).map_err(failed)?;
            (cloth, None, Vec::new())
        }
        Some(spec) => {
            let fail = |why: String| InputError::keyed(why).in_file(path);
            let volumes = woven_volume::read_all(&spec.exemplars, open);
            let volumes = volumes.map_err(|e| e.in_file(path))?;
            let named = spec.exemplars.iter().zip(&volumes);
            let named =
                named.filter_map(|(name, v)| Some((name.clone(), v.as_ref()?.exemplar.clone())));
            let named = named.collect();
            let mut spec = spec.clone();
            let built = loop {
                let built = Cloth::build_exemplar(&geometry, &spec, &named, open, file.seed);
                let is_automatic = automatic.is_some();
                match built {
                    Err(e) if is_automatic && large_design::enlarge(&mut spec, &e) => {}
                    built => break built,
                }
            };
            let (exemplar, synthesis) = built.map_err(failed)?;
            woven_volume::check_spacing(&exemplar, &synthesis, &spec.exemplars, &volumes)
                .map_err(fail)?;
            (exemplar, Some(synthesis), volumes)
        }
    };
    if let Some(spec) = &file.print {
        let image = print_file::image(spec, open).map_err(|e| e.in_file(path))?;
        cloth.print(spec, &image).map_err(failed)?;
    }
    if let Some(spec) = &file.wear {
        cloth.wear(spec).map_err(failed)?;
    }
    let optics = match file.ideal {
        true => vec![file.optics.clone()],
        false => finish_optics::finished(&file.optics, &file.yarn),
    };
    optics::check(&file.optics, cloth.materials(), file.yarn.keys())
        .map_err(|why| InputError::keyed(format!("optics{why}")).in_file(path))?;
    let yarns = cloth.materials().iter().map(|m| m.yarn.as_str());
    ply_table::check(&file.plies, yarns)
        .map_err(|why| InputError::keyed(format!("plies{why}")).in_file(path))?;
    Ok((cloth, synthesis, volumes, optics))
}

impl Fabric {
    /// What the fabric was made from: its file with all overrides, then those that it
    /// names. [`from_sources`] makes the same fabric of them.
    pub fn sources(&self) -> &[SourceFile] {
        &self.sources
    }

    /// Shows the fibres in a band, as `[optics.YARN.BAND]` says.
    ///
    /// # Errors
    /// A yarn without such a table, by its name.
    pub fn show_in(&mut self, band: Band) -> std::result::Result<(), String> {
        let lacks = |m: &&Material| {
            let table = optics::of_material(&self.optics, m);
            band != Band::Visible && table.band(band).is_none()
        };
        if let Some(material) = self.cloth.materials().iter().find(lacks) {
            return Err(material.yarn.clone());
        }
        self.band = band;
        Ok(())
    }

    /// What holds for a material in the band that is shown.
    fn seen(&self, optics: &[OpticsFile], material: &Material) -> OpticsTable {
        optics::of_material(optics, material).in_band(self.band)
    }

    /// How each material of the cloth scatters.
    pub fn flake_optics(&self) -> Vec<FlakeOptics> {
        self.cloth
            .materials()
            .iter()
            .map(|m| self.seen(&self.optics, m).flakes(m.colour))
            .collect()
    }

    /// The clear fibre behind the transmitting flakes of each material.
    ///
    /// # Errors
    /// What is wrong with the optics of a material.
    pub fn clear_fibres(&self, path: &Path) -> Result<Vec<ClearFibre>> {
        self.cloth
            .materials()
            .iter()
            .map(|m| {
                let table = self.seen(&self.optics, m);
                fibre_model::clear_fibre(&table, m)
                    .map_err(|why| InputError::of_key(path, format!("optics.{}", m.yarn), why))
            })
            .collect()
    }

    /// The surface model of the cloth. Draft and spacing of a woven model are the
    /// cloth's own unless `[surface.weave]` gives others; a preset supplies the
    /// yarns. The system that covers more hides all but the threads of the other.
    ///
    /// # Errors
    /// No `[surface]` section, or the key in it that is at fault.
    pub fn surface(&self, path: &Path) -> Result<ClothSurface> {
        self.surface_table(path)?
            .of_cloth(&self.cloth)
            .map_err(|e| InputError::of_key(path, "surface", e))
    }

    /// The longer side of one repeat of its surface model, mm, without the model.
    ///
    /// # Errors
    /// As [`Fabric::surface`], as far as no model is needed to find them.
    pub(crate) fn surface_repeat_mm(&self, path: &Path) -> Result<f32> {
        self.surface_table(path)?
            .repeat_mm(&self.cloth)
            .map_err(|e| InputError::of_key(path, "surface", e))
    }

    /// Refuses what needs every thread of a cloth, if it is made of blocks.
    pub(crate) fn whole(&self, path: &Path, what: &str) -> Result<()> {
        if self.synthesis.is_none() {
            return Ok(());
        }
        Err(InputError::of_file(
            path,
            format!(
                "{what} need the whole cloth, and it is made of blocks, as [synthesis] and large \
                 designs are; choose model = \"microflake\" or \"plain\", or a part of the design, \
                 such as draft.part = [0, 0, 64, 64]"
            ),
        ))
    }

    fn surface_table(&self, path: &Path) -> Result<&SurfaceTable> {
        self.whole(path, "surface models")?;
        self.file.surface.as_ref().ok_or_else(|| {
            InputError::of_file(
                path,
                "has no [surface] section, which the surface model needs",
            )
        })
    }

    /// The `[surface]` section of Irawan's model, with draft and spacing.
    ///
    /// # Errors
    /// No such section, another model, or a weave that is none.
    pub fn surface_spec(&self, path: &Path) -> Result<SurfaceSpec> {
        let fail = |why: String| InputError::keyed(format!("surface{why}")).in_file(path);
        let table = self.surface_table(path)?;
        let Some(spec) = table.described_as::<SurfaceSpec>() else {
            return Err(fail(format!(
                ".model: expected \"irawan\", the one that can be fitted, found \"{}\"",
                table.name()
            )));
        };
        spec.clone()
            .for_cloth(&self.cloth)
            .map_err(|e| fail(format!(": {e}")))
    }

    /// Gives the optics of a scene precedence over the fabric's own.
    ///
    /// # Errors
    /// As [`optics::check`].
    pub fn override_optics(&mut self, scene: &OpticsFile) -> Result<(), String> {
        optics::check(scene, self.cloth.materials(), self.file.yarn.keys())?;
        self.optics.insert(0, scene.clone());
        Ok(())
    }

    /// Threads beside the cloth, of one of its yarns or of a preset, along the centrelines in a text
    /// file of curves.
    ///
    /// # Errors
    /// What is wrong with the yarn or with the curves.
    pub(crate) fn threads(
        &self,
        yarn: &str,
        colour: Rgb,
        curves: Vec<u8>,
    ) -> std::result::Result<Cloth, organza_weave::Error> {
        let geometry = FabricGeometry {
            draft: DraftSpec {
                curves: Some("threads".into()),
                ..DraftSpec::default()
            },
            weft: ThreadSetSpec {
                yarn: vec![yarn.to_owned()],
                colours: vec![colour],
                ..ThreadSetSpec::default()
            },
            yarn: self.file.yarn.clone(),
            ideal: self.file.ideal,
            ..FabricGeometry::default()
        };
        Cloth::build(&geometry, &|_: &str| Ok(curves.clone()), self.file.seed)
    }

    /// Width and height of what repeats: of the cloth's tile, or of the whole design.
    pub fn tile_mm(&self) -> Vec2 {
        let tile_mm = self.cloth.tile().bounds_mm.size().truncate();
        self.synthesis.as_ref().map_or(tile_mm, |synthesis| {
            let crossings = |d: &Draft| Vec2::new(d.ends() as f32, d.picks() as f32);
            tile_mm / crossings(&synthesis.exemplar) * crossings(&synthesis.design)
        })
    }

    /// The narrower spacing of threads; infinite for cloth that has no draft.
    pub fn thread_spacing_mm(&self) -> f32 {
        let tile_mm = self.cloth.tile().bounds_mm.size();
        self.cloth.draft().map_or(f32::INFINITY, |draft| {
            (tile_mm.x / draft.ends() as f32).min(tile_mm.y / draft.picks() as f32)
        })
    }

    /// The fibres of each material of the cloth.
    ///
    /// # Errors
    /// Names the yarn at fault.
    pub fn fibre_models(&self, path: &Path) -> Result<Vec<Fibre>> {
        self.fibre_models_of(&self.cloth, &self.optics, path)
    }

    /// The same of a cloth of its yarns, with other optics tables.
    fn fibre_models_of(
        &self,
        cloth: &Cloth,
        optics: &[OpticsFile],
        path: &Path,
    ) -> Result<Vec<Fibre>> {
        let fibre = |m: &Material| {
            fibre_model::of_optics(&self.seen(optics, m), m)
                .map_err(|why| InputError::of_key(path, format!("optics.{}", m.yarn), why))
        };
        // Each solves for the absorption of its colour; the first that is wrong is named.
        let all: Vec<Result<Fibre>> = cloth.materials().par_iter().map(fibre).collect();
        all.into_iter().collect()
    }

    /// Every fibre of the cloth, to be traced.
    ///
    /// # Errors
    /// A cloth without fibres, optics that make no sense, or more memory needed
    /// than allowed.
    pub fn explicit_fibres(
        &self,
        path: &Path,
        max_memory_bytes: Option<u64>,
        loader: &Loader<'_>,
    ) -> Result<ExplicitFibres> {
        let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
        self.explicit_fibres_of(&self.optics, path, allowed, loader)
    }

    /// The same with other optics tables.
    pub(crate) fn explicit_fibres_of(
        &self,
        optics: &[OpticsFile],
        path: &Path,
        allowed: u64,
        loader: &Loader<'_>,
    ) -> Result<ExplicitFibres> {
        self.whole(path, "explicit fibres")?;
        self.traced(&self.cloth, &self.cloth, optics, path, allowed, loader)
    }

    /// Every fibre of [`Fabric::threads`], to be traced.
    ///
    /// # Errors
    /// As [`Fabric::explicit_fibres`].
    pub(crate) fn explicit_threads(
        &self,
        threads: &Cloth,
        path: &Path,
        allowed: u64,
        loader: &Loader<'_>,
    ) -> Result<ExplicitFibres> {
        self.traced(threads, threads, &self.optics, path, allowed, loader)
    }

    /// Every fibre of one system of threads, to be traced.
    ///
    /// # Errors
    /// As [`Fabric::explicit_fibres`]; cloth that has no such threads.
    pub(crate) fn explicit_system(
        &self,
        keep: ThreadSystem,
        path: &Path,
        allowed: u64,
        loader: &Loader<'_>,
    ) -> Result<ExplicitFibres> {
        let left = self.cloth.unravelled(keep);
        let left = left.ok_or_else(|| InputError::of_file(path, "has no warp and weft"))?;
        self.traced(&self.cloth, &left, &self.optics, path, allowed, loader)
    }

    /// Fibres of a cloth's materials, to be traced.
    fn traced(
        &self,
        cloth: &Cloth,
        source: &dyn SegmentSource,
        optics: &[OpticsFile],
        path: &Path,
        allowed: u64,
        loader: &Loader<'_>,
    ) -> Result<ExplicitFibres> {
        let fibres = self.fibre_models_of(cloth, optics, path)?;
        let task = Task::GatheringFibres {
            fabric: path.to_owned(),
        };
        loader
            .run(&task, |done| {
                ExplicitFibres::new(source, fibres, Some(allowed), done)
            })
            .map_err(|e| InputError::of_file(path, e))
    }
}
