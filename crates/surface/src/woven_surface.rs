//! The whole cloth: two faces, gaps, transmission, and their sampling.

use crate::cone::Fibres;
use crate::energy::EnergyBound;
use crate::error::Error;
use crate::face::Face;
use crate::half_vector::HalfVectorTable;
use crate::local::Local;
use crate::parameters::WovenParameters;
use crate::sequence::sequence;
use crate::transmission::Transmission;
use crate::weave::{Tiling, Yarn};
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb, warp};
use organza_scatter::{Footprint, LobeSample, Passage, Surface};
use std::f32::consts::FRAC_1_PI;

/// Irawan's model of a woven cloth \[Irawan2008], two-sided.
///
/// Samples follow the highlights: cones of the fibres at a point, each with its phase function
/// and chosen as often as its highlight is bright; half vectors of the whole cloth in the mean. The table gives the number of cosine-weighted samples with the variance
/// of one such sample (albedo estimates, mean over views; `tests/woven_surface`):
///
/// | fabric | mean | texture |
/// |---|---|---|
/// | denim | 1.5 | 4.4 |
/// | cotton twill | 2.1 | 12.3 |
/// | wool gabardine | 1.9 | 11.8 |
/// | polyester lining | 2.3 | 25.3 |
/// | silk charmeuse | 5.3 | 8.5 |
/// | silk shantung | 1.4 | 13.1 |
#[derive(Debug)]
pub struct WovenSurface {
    sides: [Side; 2],
    transmission: Option<Transmission>,
    /// Mean share of the light that is transmitted.
    transmitted: f32,
    gain: f32,
    /// True without gaps and where no direction needs the energy bound.
    is_plain: bool,
    /// Two over the longer side of the repeat, 1/mm.
    far_slope: f32,
}

#[derive(Debug)]
struct Side {
    face: Face,
    half_vectors: HalfVectorTable,
    /// Probabilities of the specular, diffuse and transmitted part of the mean.
    far_choices: [f32; 3],
    bound: EnergyBound,
}

/// The surface under a footprint: the weight of the mean, and the segment at its middle unless
/// the mean has the full weight.
struct Under<'a> {
    far: f32,
    local: Option<(Local<'a>, Fibres)>,
    /// Probabilities of the specular, diffuse and transmitted part.
    choices: [f32; 3],
}

/// Probabilities of the specular, diffuse and transmitted part by their weights.
fn choices((specular, diffuse): (f32, f32), transmitted: f32) -> [f32; 3] {
    // The diffuse part also covers directions that the half vectors miss.
    let diffuse = diffuse.max(0.1 * specular);
    let total = specular + diffuse + transmitted;
    if total > 0.0 {
        [specular / total, diffuse / total, transmitted / total]
    } else {
        [0.0; 3]
    }
}

impl WovenSurface {
    /// Builds the model: segments of both faces, the specular gain, tables for sampling. This
    /// takes tens of milliseconds.
    ///
    /// # Errors
    /// Names the parameter that is out of range, and refuses cloth that would return more
    /// light in total than it receives. Where the yarns return too much from some directions
    /// only, the energy bound scales them down.
    pub fn new(p: &WovenParameters) -> Result<WovenSurface, Error> {
        p.check()?;
        let mut front = Face::new(p, Tiling::new(&p.weave)?)?;
        let mut back = Face::new(p, Tiling::seen_from_behind(&p.weave)?)?;
        let gain = front.specular_gain();
        front.set_gain(gain);
        back.set_gain(gain);
        let repeat_mm = front.tiling().period_mm().max_element();
        let views: Vec<Vec3> = sequence::<2>(24)
            .map(|[a, b]| warp::cosine_hemisphere(Vec2::new(a, b)))
            .collect();
        let passed = p.transmission.as_ref().map_or(Rgb::BLACK, |t| t.albedo());
        let side = |face: Face| {
            let returned = |w: Vec3, count| (face.albedo(w, count) + passed).max_component();
            let mean = views.iter().map(|&w| returned(w, 256)).sum::<f32>() / views.len() as f32;
            if mean > 1.0 + 1e-3 {
                return Err(Error::Energy {
                    albedo: mean.into(),
                });
            }
            Ok(Side {
                half_vectors: HalfVectorTable::new(&views, |w_in, w_out| {
                    face.specular_reflectance(w_in, w_out).mean()
                }),
                far_choices: choices(face.specular_and_diffuse(None), passed.mean()),
                bound: EnergyBound::new(returned),
                face,
            })
        };
        let sides = [side(front)?, side(back)?];
        let is_bounded = sides.iter().any(|s| s.bound.largest() > 1.0);
        Ok(WovenSurface {
            is_plain: !is_bounded && p.transmission.is_none(),
            sides,
            transmitted: passed.mean(),
            transmission: p.transmission.clone(),
            gain,
            far_slope: 2.0 / repeat_mm,
        })
    }

    /// Factor from the scattering function of the segments, in mm^2 per mm^2
    /// of cloth, to the specular albedos of the parameters.
    pub fn specular_gain(&self) -> f32 {
        self.gain
    }

    /// Size of one repeat of the weave, mm.
    pub fn period_mm(&self) -> Vec2 {
        self.sides[0].face.tiling().period_mm()
    }

    /// Segments and lookup of the front.
    pub fn tiling(&self) -> &Tiling {
        self.sides[0].face.tiling()
    }

    /// Position in the pattern of the surface of a cloth whose first threads begin at
    /// `tile_min_mm`. In a volume yarns lie in the middle of their pitch, in the pattern at its
    /// beginning.
    pub fn origin_mm(&self, tile_min_mm: Vec2) -> Vec2 {
        let tiling = self.tiling();
        let before = |yarn: Yarn| {
            let (_, pitch) = tiling.yarns(yarn);
            let segments = tiling.segments();
            let placed = segments.iter().find(|s| s.yarn == yarn);
            let width = placed.map_or(pitch, |s| s.width_mm);
            0.5 * (pitch - width)
        };
        -tile_min_mm - Vec2::new(before(Yarn::Warp), before(Yarn::Weft))
    }

    /// The side that faces `w`, with direction and place in that side's frame.
    #[inline]
    fn side(&self, w: Vec3, position_mm: Vec2) -> (&Side, Vec3, Vec2) {
        if w.z > 0.0 {
            (&self.sides[0], w, position_mm)
        } else {
            (
                &self.sides[1],
                behind(w),
                Vec2::new(-position_mm.x, position_mm.y),
            )
        }
    }

    fn other(&self, side: &Side) -> &Side {
        let [front, back] = &self.sides;
        let is_front = std::ptr::eq(side, front);
        if is_front { back } else { front }
    }

    /// The weight of the mean against the texture: from 0 at a footprint of half a repeat to 1
    /// at a whole repeat.
    #[inline]
    fn far_share(&self, width_mm: f32) -> f32 {
        let x = (width_mm * self.far_slope - 1.0).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }

    /// Density of scattered directions given what lies under the footprint;
    /// `cone` is that of the texture's highlight, when it is known already.
    #[inline]
    fn scattered_pdf(
        &self,
        side: &Side,
        under: &Under<'_>,
        w_in: Vec3,
        w_out: Vec3,
        cone: Option<f32>,
    ) -> f32 {
        let [specular, diffuse, transmitted] = under.choices;
        if w_in.z < 0.0 {
            return match &self.transmission {
                Some(t) => transmitted * t.pdf(w_in, w_out),
                None => 0.0,
            };
        }
        let mut highlight = 0.0;
        if under.far > 0.0 {
            highlight += under.far * side.half_vectors.pdf(w_in, w_out);
        }
        if let Some((local, fibres)) = &under.local {
            let cone = cone.unwrap_or_else(|| local.cone_pdf(fibres, w_in, w_out));
            highlight += (1.0 - under.far) * cone;
        }
        specular * highlight + diffuse * w_in.z * FRAC_1_PI
    }

    /// Draws a direction, with its density, for light that leaves along `w_out`, above the
    /// side; the share `gap` of the light passed straight through.
    #[inline]
    fn draw_scattered(
        &self,
        side: &Side,
        under: &Under<'_>,
        w_out: Vec3,
        choice: f32,
        rng: &mut PathRng,
    ) -> Option<(Vec3, f32)> {
        let [specular, diffuse, _] = under.choices;
        let mut cone = None;
        let w_in = if choice < specular {
            match &under.local {
                Some((local, fibres)) if under.far <= 0.0 || rng.unit() >= under.far => {
                    let drawn = local.sample_cone(fibres, w_out, rng)?;
                    // Draws outside the density's support carry no highlight.
                    let pdf = local.cone_pdf(fibres, drawn, w_out);
                    if pdf <= 0.0 {
                        return None;
                    }
                    cone = Some(pdf);
                    drawn
                }
                _ => side.half_vectors.sample(w_out, rng),
            }
        } else if choice < specular + diffuse {
            warp::cosine_hemisphere(rng.unit2())
        } else {
            self.transmission.as_ref()?.sample(w_out, rng)
        };
        // Reflected light stays above, transmitted light goes below.
        if (w_in.z > 0.0) != (choice < specular + diffuse) || w_in.z == 0.0 {
            return None;
        }
        let pdf = self.scattered_pdf(side, under, w_in, w_out, cone);
        (pdf > 0.0 && pdf.is_finite()).then_some((w_in, pdf))
    }

    /// The surface under a footprint, for light that leaves along `w_out`.
    #[inline]
    fn under<'a>(
        &self,
        side: &'a Side,
        w_out: Vec3,
        width_mm: f32,
        position_mm: Vec2,
    ) -> Under<'a> {
        let far = self.far_share(width_mm);
        if far >= 1.0 {
            return Under {
                far,
                local: None,
                choices: side.far_choices,
            };
        }
        let (local, fibres) = side.face.local(position_mm).with_fibres(w_out);
        let weights = side.face.specular_and_diffuse_at(&local, &fibres);
        let near = choices(weights, self.transmitted);
        Under {
            far,
            choices: std::array::from_fn(|k| near[k] + far * (side.far_choices[k] - near[k])),
            local: Some((local, fibres)),
        }
    }

    /// Value in the frame of a side, whose `w_out` is above it.
    #[inline]
    fn scattered(
        &self,
        side: &Side,
        far: f32,
        local: Option<&Local<'_>>,
        w_in: Vec3,
        w_out: Vec3,
    ) -> Rgb {
        let mut value = Rgb::BLACK;
        if w_in.z > 0.0 {
            if far > 0.0 {
                value += side.face.reflectance(w_in, w_out) * far;
            }
            if let Some(local) = local {
                value += side.face.texture_at(local, w_in, w_out) * (1.0 - far);
            }
        } else if let Some(t) = &self.transmission {
            value = t.eval(w_in, w_out);
        }
        if self.is_plain {
            return value;
        }
        let bound = if w_in.z > 0.0 {
            side.bound.divisor(w_in)
        } else {
            self.other(side).bound.divisor(behind(w_in))
        };
        let transmission = self.transmission.as_ref();
        let covered = transmission.map_or(1.0, |t| t.covered(w_in, w_out));
        value * (covered / bound.max(side.bound.divisor(w_out)))
    }
}

/// A direction in the frame of the other side: turned about the y axis.
pub(crate) fn behind(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, w.y, -w.z)
}

/// True for a direction for which the surface is defined.
fn is_usable(w: Vec3) -> bool {
    w.is_finite() && w.z != 0.0
}

impl Surface for WovenSurface {
    fn gap(&self, w: Vec3, _: Footprint) -> f32 {
        self.transmission.as_ref().map_or(0.0, |t| t.gap(w))
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        if !(is_usable(w_in) && is_usable(w_out)) {
            return Rgb::BLACK;
        }
        let is_front = w_out.z > 0.0;
        let (side, w_out, position) = self.side(w_out, at.position_mm);
        let w_in = if is_front { w_in } else { behind(w_in) };
        let far = self.far_share(at.width_mm);
        let local = (far < 1.0 && w_in.z > 0.0).then(|| side.face.local(position));
        self.scattered(side, far, local.as_ref(), w_in, w_out)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> f32 {
        if !(is_usable(w_in) && is_usable(w_out)) {
            return 0.0;
        }
        let gap = self.gap(w_out, at);
        let (side, w, position) = self.side(w_out, at.position_mm);
        let w_in = if w_out.z > 0.0 { w_in } else { behind(w_in) };
        let under = self.under(side, w, at.width_mm, position);
        let pdf = (1.0 - gap) * self.scattered_pdf(side, &under, w_in, w, None);
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// Draws until the ray meets yarn. Only the share 1 - gap of the arriving rays calls this
    /// function, and each call takes 1 / (1 - gap) draws on average, so the mean number of
    /// draws per arriving ray is one.
    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample> {
        if self.gap(w_out, at) >= 1.0 {
            return None;
        }
        loop {
            if let Passage::Scattered(sample) = self.pass_or_sample(w_out, at, rng)? {
                return Some(sample);
            }
        }
    }

    /// One random number chooses both the gap and the part that scatters.
    fn pass_or_sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<Passage> {
        if !is_usable(w_out) {
            return None;
        }
        let gap = self.gap(w_out, at);
        let choice = rng.unit();
        if choice < gap {
            return Some(Passage::Straight);
        }
        let is_front = w_out.z > 0.0;
        let (side, w_out, position) = self.side(w_out, at.position_mm);
        let under = self.under(side, w_out, at.width_mm, position);
        let choice = (choice - gap) / (1.0 - gap);
        let (w_in, pdf) = self.draw_scattered(side, &under, w_out, choice, rng)?;
        let pdf = (1.0 - gap) * pdf;
        let local = under.local.as_ref().map(|(local, _)| local);
        let value = self.scattered(side, under.far, local, w_in, w_out);
        let weight = value * (w_in.z.abs() / pdf);
        let w_in = if is_front { w_in } else { behind(w_in) };
        (weight.is_valid() && !weight.is_black())
            .then_some(Passage::Scattered(LobeSample::new(w_in, weight, pdf)))
    }

    fn axis(&self, at: Footprint) -> Vec3 {
        let tiling = self.tiling();
        let spot = tiling.locate(at.position_mm);
        match tiling.segments().get(spot.segment).map(|s| s.yarn) {
            Some(Yarn::Warp) => Vec3::Y,
            Some(Yarn::Weft) => Vec3::X,
            None => Vec3::ZERO,
        }
    }
}
