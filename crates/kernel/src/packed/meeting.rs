//! What is met where a ray meets a packed fibre: its place, tangent and material, as of an
//! explicit one.

use super::fibre_volume::FibreVolume;
use super::volume_ray::VolumeRay;
use crate::fibres::met_fibres::Met;
use crate::voxels::population_tables::populations;
use crate::voxels::seen_tangent::SpreadFibres;
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, MAX_LANES, Mask, SetBits};
use organza_scatter::near::Frame;

/// Packed fibres that lanes met.
pub struct PackedMeeting<F: Floats> {
    pub met: Met<F>,
    /// The nearest point of the axis, from the least corner of the ray's period, mm.
    pub axis_at_mm: V3<F>,
    pub material: F::Ints,
    /// How much more of the fibre is seen than it was drawn for.
    pub weight: F,
}

impl FibreVolume {
    /// What rays have met, for the lanes of a mask.
    #[inline(always)]
    pub fn meeting<F: Floats>(
        &self,
        rays: &[VolumeRay],
        w_out: V3<F>,
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> PackedMeeting<F> {
        let mut columns = [[0.0; MAX_LANES]; 4];
        let mut places = [0; MAX_LANES];
        for lane in SetBits(mask.bits()) {
            let VolumeRay {
                at, offset, place, ..
            } = rays[lane];
            let numbers = [at[0], at[1], at[2], offset];
            for (column, number) in columns.iter_mut().zip(numbers) {
                column[lane] = number;
            }
            places[lane] = place;
        }
        let one = F::splat(1.0);
        let [x, y, z, offset] = columns.map(|c| F::load(&c));
        let population = self.populations::<F>(organza_lanes::Ints::load(&places));
        let axis = population.axis();
        let fibres = SpreadFibres {
            axis: axis.scaled(one / axis.dot(axis).sqrt()),
            end_on: population.end_on(),
            end_on_code: population.end_on_code(),
        };
        let tables = populations();
        let seen = fibres.seen_from(&tables.spreads, &tables.shown, w_out, rng, mask);
        let tangent = seen.tangent;
        let tangent = tangent.scaled(one / tangent.dot(tangent).sqrt());

        let frame = Frame::new(tangent, w_out);
        let out_mm = frame.surface(offset).scaled(population.radius_mm());
        let voxel_mm = V3::splat(self.cell_grid.voxel_mm());
        let at_mm = V3 { x, y, z }.times(voxel_mm);
        PackedMeeting {
            met: Met {
                frame,
                out_mm,
                offset,
            },
            axis_at_mm: at_mm - out_mm,
            material: population.material(),
            weight: seen.weight,
        }
    }
}
