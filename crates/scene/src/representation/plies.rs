//! Plies: every ply of the cloth as a cylinder full of fibres.

use super::{Build, Representation, Tracker};
use crate::error::{InputError, Result};
use crate::fabric_file::Fabric;
use crate::loader::{Loader, Task};
use crate::memory::free_memory_bytes;
use crate::ply_table;
use organza_scatter::{Fibre, PlyParameters};
use organza_transport::Plies;
use organza_weave::{Material, PlyStrand};
use std::collections::BTreeMap;
use std::path::Path;

/// Plies.
pub static PLIES: Representation = Representation {
    name: "plies",
    title: "plies",
    about: "Every ply of the fabric, a cylinder that scatters as its fibres do",
    colour: [0x2b, 0x6c, 0xb8],
    keys: &[],
    trackers: &[Tracker::Woodcock],
    drapes: true,
    is_ready: |fabric, path, _| can_be_plies(fabric, path).is_ok(),
    check: |fabric, path, _| {
        can_be_plies(fabric, path)?;
        fabric.fibre_models(path).map(|_| ())
    },
    build: Build::Plies(plies),
    fitted: Some(&super::virtual_fibres::FITTED_FIBRES),
};

/// The fibres of each material, for plies, and again, for hairs.
pub(crate) fn fibres_and_hairs(fabric: &Fabric, path: &Path) -> Result<Vec<Fibre>> {
    let fibres = fabric.fibre_models(path)?;
    Ok([fibres.clone(), fibres].concat())
}

/// Factors of the radius of plies, by the yarn.
pub(crate) fn radius_scales(fabric: &Fabric) -> BTreeMap<String, f64> {
    let materials = fabric.cloth.materials().iter();
    let scale = |m: &Material| {
        let table = ply_table::of_yarn(&fabric.file.plies, &m.yarn);
        (m.yarn.clone(), table.radius_scale.unwrap_or(1.0))
    };
    materials.map(scale).collect()
}

/// What the plies of each material are made of.
pub(crate) fn parameters(fabric: &Fabric) -> Vec<Option<PlyParameters>> {
    let scales = radius_scales(fabric);
    let strands = fabric.cloth.plies().scaled(&scales).strands();
    let of_strand = |(strand, m): (&Option<PlyStrand>, &Material)| {
        strand.map(|s| PlyParameters {
            radius_mm: s.radius_mm as f32,
            fibre_radius_mm: s.fibre_radius_mm as f32,
            fibres: s.fibres as f32,
            twist_rad_per_mm: s.twist_rad_per_mm as f32,
            correction: ply_table::of_yarn(&fabric.file.plies, &m.yarn).correction(),
        })
    };
    let materials = fabric.cloth.materials();
    strands.iter().zip(materials).map(of_strand).collect()
}

fn can_be_plies(fabric: &Fabric, path: &Path) -> Result<()> {
    fabric.whole(path, "plies")?;
    match fabric.cloth.plies().unfit() {
        Some(part) => Err(InputError::of_file(
            path,
            format!("model = \"plies\" shows no {part}; choose \"fibres\""),
        )),
        None => Ok(()),
    }
}

fn plies(
    fabric: &Fabric,
    path: &Path,
    max_memory_bytes: Option<u64>,
    loader: &Loader<'_>,
) -> Result<Plies> {
    can_be_plies(fabric, path)?;
    let fibres = fibres_and_hairs(fabric, path)?;
    let scales = radius_scales(fabric);
    let source = fabric.cloth.plies().scaled(&scales);
    let parameters = parameters(fabric);
    let task = Task::GatheringFibres {
        fabric: path.to_owned(),
    };
    let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
    loader
        .run(&task, |done| {
            Plies::new(&source, &parameters, fibres, Some(allowed), done)
        })
        .map_err(|e| InputError::of_file(path, e))
}
