//! The parts of a far field, for other tabulations.

use crate::fibre::Fibre;
use glam::Vec3;
use organza_basis::Rgb;

/// The factors of a [`FarField`](crate::FarField), which is
///
/// `c(theta_o) c(theta_i) cos(theta_i) sum_p K_p(theta_i, theta_o) A_p(theta_d, azimuth)`
///
/// with the scale c of [`Balance`](crate::longitudinal::Balance), the folded
/// Gaussians K of [`Inclinations`](crate::longitudinal::Inclinations), the mean
/// inclination `theta_d = (theta_o - theta_i) / 2` and the azimuth of
/// [`FibreFrame`](crate::FibreFrame).
#[derive(Clone, Copy, Debug)]
pub struct FarParts<'a>(&'a Fibre);

/// Lobes of a far field: R, TT, and all that comes after, which has one blur.
/// Fitted fibres leave the last one dark.
pub const FAR_LOBES: usize = 3;

/// Between even steps of the cosine of the mean inclination, so many nodes with
/// both ends, A of a dielectric is linear; that of a fitted fibre is within
/// 0.003 of it.
pub const FAR_ROWS: usize = crate::lobe_table::ROWS;

impl Fibre {
    /// The factors of its far field.
    pub fn far_parts(&self) -> FarParts<'_> {
        FarParts(self)
    }
}

impl FarParts<'_> {
    /// Deviations of the Gaussians K, radians; that of R also serves a lobe
    /// which is dark.
    pub fn blurs_rad(&self) -> [f32; FAR_LOBES] {
        let blurs = self.0.blurs();
        let of = |p: usize| blurs.get(p).unwrap_or(&blurs[0]).deviation_rad;
        [0, 1, 2].map(of)
    }

    /// c at an inclination, per channel.
    pub fn scale(&self, cos_theta: f32) -> Vec3 {
        self.0.balance().at(cos_theta).scale
    }

    /// Even steps of the cosine, so many nodes with both ends, between which c
    /// is linear to 3e-4.
    pub fn scale_nodes(&self) -> usize {
        self.0.balance().nodes()
    }

    /// A of a lobe, per radian of azimuth, which is even in the azimuth.
    pub fn azimuthal(&self, lobe: usize, mean_cos: f32, azimuth_rad: f32) -> Rgb {
        let lobes = self.0.far(mean_cos, azimuth_rad);
        let own = match lobe {
            0 | 1 => lobes[lobe],
            _ => lobes[2] + lobes[3],
        };
        Rgb(own.truncate())
    }

    /// Even steps from 0 to pi, so many nodes with both ends, between which A of
    /// a dielectric is linear and that of a fitted fibre nearly so.
    pub fn azimuth_nodes(&self) -> usize {
        self.0.azimuth_nodes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fibre_tests::{dielectric, fitted};
    use crate::longitudinal::{Blur, Inclinations};
    use crate::proofs::{hard_directions, oblique};
    use crate::{FibreFrame, Lobe};

    #[test]
    fn parts_make_the_whole() {
        for fibre in [dielectric(1.55, 0.1, 6.0, 10.0), fitted("gabardine")] {
            let parts = fibre.far_parts();
            let blurs = parts.blurs_rad().map(Blur::new);
            for t in oblique() {
                let whole = fibre.far_field(t);
                for w_out in oblique() {
                    let frame = FibreFrame::new(t, w_out);
                    for w_in in hard_directions(t) {
                        let a = frame.angles(w_in);
                        let pair =
                            Inclinations::new([a.sin, a.cos], [frame.sin_out, frame.cos_out]);
                        let lobe = |p: usize| {
                            let own = parts.azimuthal(p, pair.mean_cos, a.azimuth_rad);
                            own.0 * pair.density(&blurs[p])
                        };
                        let sum: Vec3 = (0..FAR_LOBES).map(lobe).sum();
                        let scales = parts.scale(frame.cos_out) * parts.scale(a.cos);
                        let (made, value) = (scales * a.cos * sum, whole.eval(w_out, w_in).0);
                        let apart = (made - value).abs().max_element();
                        assert!(apart <= 3e-4 * value.max_element() + 1e-6, "{made} {value}");
                    }
                }
            }
        }
    }
}
