//! The voxels of a fabric.

use crate::error::{Result, input};
use crate::fabric_file::Fabric;
use crate::loader::{Loader, Task};
use crate::memory::free_memory_bytes;
use crate::volume_cache::{self, VolumePlan};
use crate::{blocks, exemplar_voxels};
use organza_transport::{PackingStudy, measure_packing};
use organza_volume::{FibreFootprint, Octree, Plan, VoxelizeOptions};
use organza_weave::Synthesis;
use std::path::Path;
use std::sync::Arc;

impl Fabric {
    /// The octree of the cloth's fibres, with the length of thick ones where
    /// `footprint` says.
    ///
    /// # Errors
    /// A voxel size out of range, or more memory needed than allowed.
    pub fn voxelize(
        &self,
        path: &Path,
        footprint: FibreFootprint,
        voxel_um: Option<f32>,
        levels: Option<u8>,
        max_memory_bytes: Option<u64>,
        loader: &Loader<'_>,
    ) -> Result<Octree> {
        let plan = self.plan(path, footprint, voxel_um, levels, max_memory_bytes)?;
        self.voxelize_planned(path, &plan, max_memory_bytes, loader)
    }

    /// Voxelizes as planned, or takes the result from the loader's cache. Packing factors
    /// are measured if the voxels are for packed fibres. If memory does not suffice for
    /// that, the loader warns.
    ///
    /// # Errors
    /// Segments that cannot be placed.
    pub fn voxelize_planned(
        &self,
        path: &Path,
        plan: &VolumePlan<'_>,
        max_memory_bytes: Option<u64>,
        loader: &Loader<'_>,
    ) -> Result<Octree> {
        let build = || self.build_volume(path, plan, max_memory_bytes, loader);
        volume_cache::cached(&self.sources, path, plan, max_memory_bytes, loader, build)
    }

    /// Voxelizes as planned. False if something is left out for want of memory.
    fn build_volume(
        &self,
        path: &Path,
        plan: &VolumePlan<'_>,
        max_memory_bytes: Option<u64>,
        loader: &Loader<'_>,
    ) -> Result<(Octree, bool)> {
        let task = Task::Voxelizing {
            fabric: path.to_owned(),
            memory_bytes: plan.memory_bytes(),
        };
        let octree = loader
            .run(&task, |done| plan.run(done))
            .map_err(|e| input(format!("{}: {e}", path.display())))?;
        if let Some(synthesis) = &self.synthesis {
            let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
            let octree = self.with_volumes(octree, synthesis, allowed);
            let octree = octree.map_err(|e| input(format!("{}: {e}", path.display())))?;
            let cloth = blocks::cut(&octree, &self.cloth, synthesis, allowed);
            let cloth = cloth.map_err(|e| input(format!("{}: {e}", path.display())))?;
            return Ok((cloth, true));
        }
        if octree.footprint() == FibreFootprint::Covered {
            return Ok((octree, true));
        }
        let octree = self.with_measured_packing(octree, path, max_memory_bytes, loader)?;
        let is_measured = octree.packing().is_some();
        Ok((octree, is_measured))
    }

    /// The octree of an exemplar cloth with the voxels of volumes where they stand.
    fn with_volumes(
        &self,
        woven: Octree,
        synthesis: &Synthesis,
        allowed: u64,
    ) -> Result<Octree, organza_volume::Error> {
        if self.volumes.iter().all(Option::is_none) {
            return Ok(woven);
        }
        let crossings = blocks::crossings(synthesis);
        exemplar_voxels::with_volumes(&woven, synthesis, &self.volumes, crossings, allowed)
    }

    /// The octree of this cloth with packing factors that are measured under the optics
    /// of the fabric file, whatever a scene overrides: they belong to the voxels.
    fn with_measured_packing(
        &self,
        octree: Octree,
        path: &Path,
        max_memory_bytes: Option<u64>,
        loader: &Loader<'_>,
    ) -> Result<Octree> {
        let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
        let own = &self.optics[self.optics.len() - 1..];
        let fibres = self.explicit_fibres_of(own, path, allowed, loader);
        let fibres = fibres.and_then(|fibres| {
            let checked = fibres.check_hierarchy(allowed);
            checked.map_err(|e| input(format!("{}: {e}", path.display())))?;
            Ok(fibres)
        });
        let fibres = match fibres {
            Ok(fibres) => fibres,
            Err(why) => {
                loader.warn(
                    path,
                    format!("packing factors are derived, not measured: {why}"),
                );
                return Ok(octree);
            }
        };
        let task = Task::MeasuringPacking {
            fabric: path.to_owned(),
        };
        let study = PackingStudy {
            seed: self.file.seed,
            ..PackingStudy::default()
        };
        let octree = Arc::new(octree);
        let packing = loader.run(&task, |done| measure_packing(&fibres, &octree, study, done));
        Arc::unwrap_or_clone(octree)
            .with_packing(packing)
            .ok_or_else(|| {
                input(format!(
                    "{}: packing factors are not finite",
                    path.display()
                ))
            })
    }

    /// Edge of the finest voxels unless something else is asked for.
    fn voxel_um(&self, footprint: FibreFootprint) -> f32 {
        let voxel = &self.file.voxel;
        match footprint {
            FibreFootprint::Covered => voxel.size_um,
            FibreFootprint::Axis => voxel.packed_um.unwrap_or_else(|| {
                let materials = self.cloth.materials();
                let radii: f32 = materials.iter().map(|m| m.fibre_radius_mm).sum();
                1e3 * radii / materials.len().max(1) as f32
            }),
        }
    }

    /// What voxelizing will take.
    ///
    /// # Errors
    /// As [`Fabric::voxelize`].
    pub fn plan(
        &self,
        path: &Path,
        footprint: FibreFootprint,
        voxel_um: Option<f32>,
        levels: Option<u8>,
        max_memory_bytes: Option<u64>,
    ) -> Result<VolumePlan<'_>> {
        let size_um = voxel_um.unwrap_or_else(|| self.voxel_um(footprint));
        if !(size_um.is_finite() && size_um > 0.0) {
            return Err(input(format!(
                "{}: voxel size: expected a positive number of micrometres, found {size_um}",
                path.display()
            )));
        }
        let options = VoxelizeOptions {
            voxel_mm: size_um * 1e-3,
            levels,
            footprint,
            max_memory_bytes: Some(max_memory_bytes.unwrap_or_else(free_memory_bytes)),
        };
        let plan = match &self.synthesis {
            None => Plan::new(&self.cloth, &options),
            Some(synthesis) => {
                if footprint == FibreFootprint::Axis {
                    self.whole(path, "packed fibres")?;
                }
                Plan::of_parts(&self.cloth, blocks::parts(synthesis), &options)
            }
        };
        let plan = plan.map_err(|e| input(format!("{}: {e}", path.display())))?;
        Ok(VolumePlan::new(plan, &options))
    }
}
