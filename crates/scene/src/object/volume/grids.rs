//! Volumes of plain grids: density, and with it matrices, axes or colours.

use super::VolumeObject;
use crate::error::{InputError, Result};
use crate::level::{Lod, LodName};
use crate::object::grid::channels;
use glam::Vec3;
use organza_basis::{Aabb, FibrePopulation, Mixture, Rgb};
use organza_scatter::{FlakeMaterials, FlakeOptics};
use organza_transport::{Grid, GridMedium, Interpolation};
use organza_volume::{GridSet, VolGrid};

impl VolumeObject<'_> {
    /// Refuses keys of the table that grids cannot follow.
    ///
    /// # Errors
    /// Names the scene and the key at fault.
    pub(super) fn check_grids(&self, set: &GridSet) -> Result<()> {
        let table = self.table;
        self.check_optics(&[])?;
        if !matches!(
            table.lod,
            Lod::Level(0) | Lod::Name(LodName::Auto | LodName::Volume)
        ) {
            return Err(self.no_level(1));
        }
        self.check_plain_flakes("grids hold no fibres")?;
        if table.extent_mm.is_some() && table.repeat_xy != Some(true) {
            return Err(self.fail(": extent_mm belongs to repeat_xy = true"));
        }
        if table.mesh.is_some() && table.repeat_xy != Some(true) {
            return Err(self.fail(".mesh: belongs to repeat_xy = true"));
        }
        if set.albedo.is_none() {
            self.flakes(None)?;
        }
        Ok(())
    }

    /// Grids as a medium: matrices of the file, or made of its axes where it has none
    /// or the scene gives the roughness of fibres.
    ///
    /// # Errors
    /// Names the file, or the key at fault.
    pub(super) fn grids(&self, set: GridSet) -> Result<GridMedium> {
        let table = self.table;
        let given = self.every_yarn();
        let has_width =
            given.end_on_ratio.is_some() || given.gamma.is_some() || given.sin_power.is_some();
        let matrices = match (set.sggx, set.axes) {
            (Some(sggx), None) => Some(channels::<6>(&self.path, &sggx, "sggx")?),
            (Some(sggx), Some(_)) if !has_width => Some(channels::<6>(&self.path, &sggx, "sggx")?),
            (_, Some(axes)) => {
                let optics = FlakeOptics {
                    albedo: Rgb::WHITE,
                    ..given.flakes(None)
                };
                Some(self.matrices(&axes, optics)?)
            }
            (None, None) => None,
        };
        let isotropic = Grid::constant([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let albedo = match (given.albedo, set.albedo) {
            (None, Some(grid)) => channels::<3>(&self.path, &grid, "albedo")?,
            _ => Grid::constant(self.flakes(None)?.albedo.0.to_array()),
        };
        let scale = table.scale.unwrap_or(1.0);
        let bounds_mm = Aabb::new(
            set.sigma_t.bounds_mm.min * scale,
            set.sigma_t.bounds_mm.max * scale,
        );
        let mut sigma_t = set.sigma_t;
        let per_value = table.density_scale.unwrap_or(1.0) / scale;
        if per_value != 1.0 {
            sigma_t.data.iter_mut().for_each(|v| *v *= per_value);
        }
        GridMedium::new(
            bounds_mm,
            table.repeat_xy.unwrap_or(false),
            Interpolation::Nearest,
            channels::<1>(&self.path, &sigma_t, "density")?,
            matrices.unwrap_or(isotropic),
            albedo,
        )
        .map_err(|e| InputError::of_file(&self.path, e))
    }

    /// The matrices of fibres that run along axes; isotropic where there is none.
    fn matrices(&self, axes: &VolGrid, optics: FlakeOptics) -> Result<Grid<6>> {
        let materials = FlakeMaterials::new(vec![optics]);
        let samples = axes.data.chunks_exact(4).map(|a| {
            let mut mixture = Mixture::EMPTY;
            if let Some(axis) = Vec3::new(a[0], a[1], a[2]).try_normalize() {
                mixture.push(FibrePopulation {
                    length_density_per_mm2: 1.0,
                    radius_mm: 1.0,
                    axis,
                    spread_rad: a[3],
                    ..FibrePopulation::default()
                });
            }
            materials.merged(&mixture).sggx.to_array()
        });
        Grid::new(axes.dims, samples.collect())
            .ok_or_else(|| InputError::of_file(&self.path, "holds no samples"))
    }
}
