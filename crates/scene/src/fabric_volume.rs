//! The voxels of a fabric.

use crate::blocks;
use crate::error::{InputError, Result};
use crate::exemplar_voxels::with_volumes;
use crate::fabric_file::Fabric;
use crate::loader::{Loader, Task};
use crate::memory::free_memory_bytes;
use crate::volume_cache::{self, VolumePlan};
use organza_basis::SegmentSource;
use organza_transport::{PackingStudy, measure_packing};
use organza_volume::{FibreFootprint, Octree, VoxelizeOptions, VoxelizePlan};
use std::path::Path;
use std::sync::Arc;

/// Voxels of packed fibres in the box of a cloth at most, unless the user gives their size:
/// thick pile has more at one fibre radius, most of them empty.
const MOST_VOXELS_BY_DEFAULT: f64 = 128e6;

/// Bytes that tables of packed fibres take for every voxel, empty or not, and about as much for
/// what lies in those that are not. The kernel takes more, and checks that itself.
const PACKED_BYTES: f64 = 10.0;

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
        if let Some(wanted_um) = plan.wanted_um() {
            let used_um = plan.voxel_mm() * 1e3;
            let message = format!(
                "voxels for packed fibres are {used_um:.1} um wide: with voxels of one fibre radius \
                 ({wanted_um:.1} um) more than {:.0} million would fill the tile; voxel.packed_um \
                 sets their size",
                1e-6 * MOST_VOXELS_BY_DEFAULT
            );
            loader.warn(path, message);
        }
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
            .map_err(|e| InputError::of_file(path, e))?;
        if let Some(synthesis) = &self.synthesis {
            let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
            let octree = match self.volumes.iter().all(Option::is_none) {
                true => octree,
                false => loader
                    .run(&task, |done| {
                        let crossings = blocks::crossings(synthesis);
                        let volumes = &self.volumes;
                        with_volumes(&octree, synthesis, volumes, crossings, (allowed, done))
                    })
                    .map_err(|e| InputError::of_file(path, e))?,
            };
            let cloth = blocks::cut(&octree, &self.cloth, synthesis, allowed);
            let cloth = cloth.map_err(|e| InputError::of_file(path, e))?;
            return Ok((cloth, true));
        }
        if octree.footprint() == FibreFootprint::Covered {
            return Ok((octree, true));
        }
        let octree = self.with_measured_packing(octree, path, max_memory_bytes, loader)?;
        let is_measured = octree.packing().is_some();
        Ok((octree, is_measured))
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
        // The voxels stay while paths go through the fibres.
        let allowed = match max_memory_bytes {
            Some(bytes) => bytes.saturating_sub(octree.memory_bytes()),
            None => free_memory_bytes(),
        };
        let own = &self.optics[self.optics.len() - 1..];
        let fibres = self.explicit_fibres_of(own, path, allowed, loader);
        let fibres = fibres.and_then(|fibres| {
            let checked = fibres.check_walk(allowed);
            checked.map_err(|e| InputError::of_file(path, e))?;
            Ok(fibres)
        });
        let fibres = match fibres {
            Ok(fibres) => fibres,
            Err(why) if loader.is_stopped() => return Err(why),
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
        let packing = loader
            .run(&task, |done| measure_packing(&fibres, &octree, study, done))
            .map_err(|e| InputError::of_file(path, e))?;
        Arc::unwrap_or_clone(octree)
            .with_packing(packing)
            .ok_or_else(|| InputError::of_file(path, "packing factors are not finite"))
    }

    /// Edge of the finest voxels unless something else is asked for, um; and where they had to
    /// be larger, the edge that the fibres want.
    fn voxel_um(&self, footprint: FibreFootprint) -> (f32, Option<f32>) {
        let voxel = &self.file.voxel;
        match (footprint, voxel.packed_um) {
            (FibreFootprint::Covered, _) => (voxel.size_um, None),
            (FibreFootprint::Axis, Some(packed_um)) => (packed_um, None),
            (FibreFootprint::Axis, None) => {
                let materials = self.cloth.materials();
                let radii: f32 = materials.iter().map(|m| m.fibre_radius_mm).sum();
                let radius_um = 1e3 * radii / materials.len().max(1) as f32;
                let least_um = self.voxel_um_of(MOST_VOXELS_BY_DEFAULT);
                if radius_um < least_um {
                    return (least_um, Some(radius_um));
                }
                (radius_um, None)
            }
        }
    }

    /// Edge of voxels of which so many fill the box of the cloth, um.
    fn voxel_um_of(&self, count: f64) -> f32 {
        let volume_mm3 = self
            .cloth
            .tile()
            .bounds_mm
            .size()
            .as_dvec3()
            .element_product();
        (1e3 * (volume_mm3 / count).cbrt()) as f32
    }

    /// Refuses voxels of packed fibres whose tables do not fit in memory.
    fn check_packed(&self, path: &Path, size_um: f32, allowed_bytes: u64) -> Result<()> {
        let most = allowed_bytes as f64 / PACKED_BYTES;
        let least_um = self.voxel_um_of(most);
        if size_um >= least_um {
            return Ok(());
        }
        let count = most * f64::from(least_um / size_um).powi(3);
        Err(InputError::of_file(
            path,
            format!(
                "{:.2e} voxels of {size_um} um for packed fibres need about {:.0} bytes of memory, \
                 {allowed_bytes} are allowed: use voxels of at least {:.0} um (voxel.packed_um, \
                 --voxel-um) or a smaller tile",
                count,
                count * PACKED_BYTES,
                least_um.ceil()
            ),
        ))
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
        let (size_um, wanted_um) =
            voxel_um.map_or_else(|| self.voxel_um(footprint), |um| (um, None));
        if !(size_um.is_finite() && size_um > 0.0) {
            return Err(InputError::of_file(
                path,
                format!("voxel size: expected a positive number of micrometres, found {size_um}"),
            ));
        }
        let allowed_bytes = max_memory_bytes.unwrap_or_else(free_memory_bytes);
        let options = VoxelizeOptions {
            voxel_mm: size_um * 1e-3,
            levels,
            footprint,
            max_memory_bytes: Some(allowed_bytes),
        };
        if footprint == FibreFootprint::Axis {
            self.check_packed(path, size_um, allowed_bytes)?;
        }
        let plan = match &self.synthesis {
            None => VoxelizePlan::new(&self.cloth, &options),
            Some(synthesis) => {
                if footprint == FibreFootprint::Axis {
                    self.whole(path, "packed fibres")?;
                }
                VoxelizePlan::of_parts(&self.cloth, blocks::parts(synthesis), &options)
            }
        };
        let plan = plan.map_err(|e| InputError::of_file(path, e))?;
        Ok(VolumePlan::new(plan, &options, wanted_um))
    }
}
