//! The mean of a cloth, split into the parts that its colours multiply, for callers that fit
//! colours or evaluate many shapes.

use crate::error::Error;
use crate::face::Face;
use crate::parameters::WovenParameters;
use crate::transmission::Transmission;
use crate::weave::{Tiling, Yarn};
use crate::woven_surface::behind;
use glam::Vec3;
use organza_basis::Rgb;
use std::f32::consts::FRAC_1_PI;

/// The value of a pair of directions due to each colour, for colours of one, 1/sr.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// Diffuse light of warp and weft.
    pub diffuse: [f32; 2],
    /// Highlights of warp and weft, to be multiplied by
    /// [`Components::specular_gain`].
    pub specular: [f32; 2],
    /// Diffuse light of warp and weft as round yarns.
    pub round: [f32; 2],
    /// Transmitted light, diffuse and forward.
    pub transmitted: [f32; 2],
}

/// A woven surface without colours, and without the tables for sampling that
/// take most of the time to build.
#[derive(Debug)]
pub struct Components {
    faces: [Face; 2],
    transmission: Option<Transmission>,
}

impl Components {
    /// Takes the shape of the yarns and of the transmission from parameters, and ignores their
    /// colours.
    ///
    /// # Errors
    /// Names the parameter that is out of range.
    pub fn new(p: &WovenParameters) -> Result<Components, Error> {
        Ok(Components {
            faces: [
                Face::new(p, Tiling::new(&p.weave)?)?,
                Face::new(p, Tiling::seen_from_behind(&p.weave)?)?,
            ],
            transmission: p.transmission.as_ref().map(|t| t.with_colours(Rgb::WHITE)),
        })
    }

    /// The parts of the mean value, without the energy bound.
    pub fn eval(&self, w_in: Vec3, w_out: Vec3) -> Parts {
        let [front, back] = &self.faces;
        let (face, w_in, w_out) = if w_out.z > 0.0 {
            (front, w_in, w_out)
        } else {
            (back, behind(w_in), behind(w_out))
        };
        let mut parts = Parts::default();
        let transmission = self.transmission.as_ref();
        let covered = transmission.map_or(1.0, |t| t.covered(w_in, w_out));
        if w_in.z > 0.0 {
            face.for_each_type(w_in, w_out, |yarn: Yarn, lobe, area| {
                parts.specular[yarn as usize] += lobe * covered;
                parts.diffuse[yarn as usize] += area * FRAC_1_PI * covered;
            });
            for yarn in [Yarn::Warp, Yarn::Weft] {
                let flat = parts.diffuse[yarn as usize];
                parts.round[yarn as usize] = flat * Face::round(yarn, w_in, w_out);
            }
        } else if let Some(t) = &self.transmission {
            parts.transmitted = t.lobes(w_in, w_out).map(|x| x * covered);
        }
        parts
    }

    /// See [`WovenSurface::specular_gain`](crate::WovenSurface::specular_gain).
    pub fn specular_gain(&self) -> f32 {
        self.faces[0].specular_gain()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceSpec;
    use crate::spec::TransmissionSpec;
    use organza_basis::{PathRng, warp};
    use organza_scatter::{Footprint, Surface};

    #[test]
    fn parts_add_up_to_the_whole() {
        let mut spec = SurfaceSpec::preset("cotton-twill").unwrap();
        spec.transmission = Some(TransmissionSpec {
            warp_cover: 0.8,
            weft_cover: 0.7,
            diffuse: Rgb::new(0.1, 0.2, 0.05),
            forward: Rgb::new(0.05, 0.02, 0.1),
            concentration: 5.0,
        });
        spec.weft.round = Some(Rgb::new(0.1, 0.3, 0.2));
        let p = spec.parameters().unwrap();
        let whole = crate::WovenSurface::new(&p).unwrap();
        let parts = Components::new(&p).unwrap();
        let gain = parts.specular_gain();
        assert_eq!(gain, whole.specular_gain());
        let mut rng = PathRng::from_seed(3);
        for k in 0..200 {
            let mut turn = |sign: f32| warp::cosine_hemisphere(rng.unit2()) * sign;
            let w_in = turn(if k % 2 == 0 { 1.0 } else { -1.0 });
            let w_out = turn(if k % 3 == 0 { 1.0 } else { -1.0 });
            let x = parts.eval(w_in, w_out);
            let t = p.transmission.as_ref().unwrap();
            let mut sum = t.diffuse() * x.transmitted[0] + t.forward() * x.transmitted[1];
            for (k, yarn) in [&p.warp, &p.weft].into_iter().enumerate() {
                sum += yarn.diffuse * x.diffuse[k] + yarn.round * x.round[k];
                sum += yarn.specular * (gain * x.specular[k]);
            }
            let value = whole.eval(w_out, w_in, Footprint::FAR);
            let error = (sum + value * -1.0).0.abs().max_element();
            let most = 4.0 * f32::EPSILON * (1.0 + value.max_component());
            assert!(error < most, "{sum:?} {value:?}");
        }
    }
}
