//! One side of the cloth: its segments, their scattering, their mean.

use crate::cone::Fibres;
use crate::error::Error;
use crate::filament::Ring;
use crate::local::{Local, segment_from_face};
use crate::noise::{self, TensionNoise};
use crate::parameters::{WovenParameters, YarnParameters};
use crate::quadrature::Rule;
use crate::round::round_yarns;
use crate::segment::{Pair, SegmentParameters, YarnSegment};
use crate::sequence::sequence;
use crate::shadowing::Shadowing;
use crate::weave::{Spot, Tiling, Yarn};
use glam::{Vec2, Vec3};
use organza_basis::{Rgb, warp};
use std::f32::consts::{FRAC_1_PI, PI};

/// Steps that the inclination of noisy yarn is quantised to. Texture and mean use the same
/// steps, so that they agree.
const NOISE_STEPS: usize = 16;

/// All segments of the repeat with the same yarn, width and length.
#[derive(Debug)]
struct SegmentType {
    yarn: Yarn,
    /// One segment per step of the inclination, with its frequency.
    steps: Vec<YarnSegment<f32>>,
    shares: Vec<f32>,
    /// Segments per area of cloth, 1/mm^2.
    per_mm2: f32,
    width_mm: f32,
    length_mm: f32,
}

/// Colours and noise of one system of yarn.
#[derive(Debug)]
struct Thread {
    diffuse: Rgb,
    round: Rgb,
    specular: Rgb,
    u_noise_own_rad: f32,
    u_noise_cross_rad: f32,
}

/// One side of the cloth, in its own frame with z outward.
#[derive(Debug)]
pub(crate) struct Face {
    tiling: Tiling,
    types: Vec<SegmentType>,
    type_of: Vec<u32>,
    /// Warp and weft.
    threads: [Thread; 2],
    shadowing: Option<Shadowing>,
    seed: u64,
    grains_per_mm: f32,
    noise: Option<TensionNoise>,
    rule: Rule<f32>,
    /// Factor that makes the specular albedo equal to `specular`.
    gain: f32,
}

impl Face {
    pub fn new(p: &WovenParameters, tiling: Tiling) -> Result<Face, Error> {
        let period = tiling.period_mm();
        let mut types: Vec<SegmentType> = Vec::new();
        let mut type_of = Vec::with_capacity(tiling.segments().len());
        for s in tiling.segments() {
            let same = |t: &SegmentType| {
                t.yarn == s.yarn
                    && t.width_mm == s.width_mm
                    && (t.length_mm - s.length_mm).abs() < 1e-4 * s.length_mm
            };
            let index = match types.iter().position(same) {
                Some(i) => i,
                None => {
                    let (yarn, name) = match s.yarn {
                        Yarn::Warp => (&p.warp, "warp"),
                        Yarn::Weft => (&p.weft, "weft"),
                    };
                    let (steps, shares) =
                        segments_of(yarn, s.width_mm, s.length_mm).map_err(|e| e.in_table(name))?;
                    types.push(SegmentType {
                        yarn: s.yarn,
                        steps,
                        shares,
                        per_mm2: 0.0,
                        width_mm: s.width_mm,
                        length_mm: s.length_mm,
                    });
                    types.len() - 1
                }
            };
            types[index].per_mm2 += 1.0 / (period.x * period.y);
            type_of.push(index as u32);
        }
        let thread = |y: &YarnParameters| Thread {
            diffuse: y.diffuse * FRAC_1_PI,
            round: y.round * FRAC_1_PI,
            specular: y.specular,
            u_noise_own_rad: y.u_noise_own_rad,
            u_noise_cross_rad: y.u_noise_cross_rad,
        };
        let is_noisy = types.iter().any(|t| t.steps.len() > 1);
        let pitch_mm = Vec2::new(tiling.yarns(Yarn::Warp).1, tiling.yarns(Yarn::Weft).1);
        Ok(Face {
            tiling,
            types,
            type_of,
            threads: [thread(&p.warp), thread(&p.weft)],
            shadowing: p.shadowing,
            seed: p.seed,
            grains_per_mm: if p.grain_mm > 0.0 {
                1.0 / p.grain_mm
            } else {
                0.0
            },
            noise: is_noisy.then(|| TensionNoise::new(p.seed, p.noise_period_mm, pitch_mm)),
            rule: Rule::for_accuracy(p.accuracy),
            gain: 1.0,
        })
    }

    /// The inverse of the bihemispherical albedo of highlights of colour one.
    pub fn specular_gain(&self) -> f32 {
        let pairs = 1 << 13;
        let mean: f64 = sequence::<4>(pairs)
            .map(|[a, b, c, d]| {
                let w_in = warp::cosine_hemisphere(Vec2::new(a, b));
                let w_out = warp::cosine_hemisphere(Vec2::new(c, d));
                f64::from(self.specular_shape(w_in, w_out))
            })
            .sum::<f64>()
            / pairs as f64;
        let albedo = mean as f32 * PI;
        if albedo > 0.0 { 1.0 / albedo } else { 0.0 }
    }

    pub fn set_gain(&mut self, gain: f32) {
        self.gain = gain;
    }

    pub fn tiling(&self) -> &Tiling {
        &self.tiling
    }

    fn thread(&self, yarn: Yarn) -> &Thread {
        &self.threads[yarn as usize]
    }

    /// Visible share of a segment that may lie lower than its neighbours.
    #[inline]
    fn visible_share(&self, yarn: Yarn, size_mm: [f32; 2], pair: &Pair<f32>) -> f32 {
        let Some(shadowing) = self.shadowing else {
            return 1.0;
        };
        let depth = match yarn {
            Yarn::Warp => -shadowing.warp_above_weft_mm,
            Yarn::Weft => shadowing.warp_above_weft_mm,
        };
        if depth <= 0.0 {
            return 1.0;
        }
        let [w_in, w_out] = [pair.w_in, pair.w_out].map(|w| Vec3::new(w.x, w.y, w.z));
        Shadowing::visible_share(w_in, w_out, size_mm[0], size_mm[1], depth)
    }

    /// Visits every segment type with its mean scattering per area of cloth (without gain and
    /// colour) and its share of the cloth, both without the parts that the other system hides.
    /// Directions must be above the face.
    pub fn for_each_type(&self, w_in: Vec3, w_out: Vec3, mut visit: impl FnMut(Yarn, f32, f32)) {
        for yarn in [Yarn::Warp, Yarn::Weft] {
            let [a, b] = [w_in, w_out].map(|w| segment_from_face(yarn, w));
            let pair = Pair::new(a, b);
            // The values that all segments of a filament yarn share.
            let ring = Ring::new(&pair);
            let mut integrals = None;
            for t in self.types.iter().filter(|t| t.yarn == yarn) {
                let mut lobe = 0.0;
                for (segment, share) in t.steps.iter().zip(&t.shares) {
                    lobe += share * self.segment_lobe(segment, &pair, &ring, &mut integrals);
                }
                let phase = t.steps[0].phase.eval(w_in.dot(w_out));
                let seen = self.visible_share(yarn, [t.width_mm, t.length_mm], &pair);
                let area = t.width_mm * t.length_mm * t.per_mm2;
                visit(yarn, lobe * phase * t.per_mm2 * seen, area * seen);
            }
        }
    }

    /// Scattering of one segment without its phase function, mm^2. The integrals of the ring
    /// are computed when they are first needed.
    fn segment_lobe(
        &self,
        segment: &YarnSegment<f32>,
        pair: &Pair<f32>,
        ring: &Ring<f32>,
        integrals: &mut Option<(f32, f32)>,
    ) -> f32 {
        if !segment.is_filament() {
            segment.staple_reflectance(pair, &self.rule)
        } else {
            let integrals = integrals.get_or_insert_with(|| ring.attenuation_integrals(pair));
            segment.filament_reflectance(ring, *integrals)
        }
    }

    /// The uncoloured specular part, 1/sr.
    fn specular_shape(&self, w_in: Vec3, w_out: Vec3) -> f32 {
        let mut sum = 0.0;
        self.for_each_type(w_in, w_out, |_, lobe, _| sum += lobe);
        sum
    }

    /// Mean value over the cloth, 1/sr; both directions above the face.
    pub fn reflectance(&self, w_in: Vec3, w_out: Vec3) -> Rgb {
        let mut sum = Rgb::BLACK;
        self.for_each_type(w_in, w_out, |yarn, lobe, area| {
            let thread = self.thread(yarn);
            let diffuse = self.diffuse(yarn, w_in, w_out);
            sum += thread.specular * (lobe * self.gain) + diffuse * area;
        });
        sum
    }

    /// The diffuse light of a yarn, flat and round, 1/sr.
    #[inline]
    fn diffuse(&self, yarn: Yarn, w_in: Vec3, w_out: Vec3) -> Rgb {
        let thread = self.thread(yarn);
        if thread.round.is_black() {
            return thread.diffuse;
        }
        thread.diffuse + thread.round * Face::round(yarn, w_in, w_out)
    }

    /// See [`round_yarns`].
    #[inline]
    pub fn round(yarn: Yarn, w_in: Vec3, w_out: Vec3) -> f32 {
        let [a, b] = [w_in, w_out].map(|w| segment_from_face(yarn, w));
        round_yarns(a, b)
    }

    /// Share of the light from `w` that is returned, estimated with `count` quasi-random
    /// directions.
    pub fn albedo(&self, w: Vec3, count: usize) -> Rgb {
        let mut sum = Rgb::BLACK;
        for [a, b] in sequence::<2>(count) {
            let w_in = warp::cosine_hemisphere(Vec2::new(a, b));
            if w_in.z > 0.0 {
                sum += self.reflectance(w_in, w);
            }
        }
        sum * (PI / count as f32)
    }

    /// The specular part of [`reflectance`](Self::reflectance).
    pub fn specular_reflectance(&self, w_in: Vec3, w_out: Vec3) -> Rgb {
        let mut sum = Rgb::BLACK;
        self.for_each_type(w_in, w_out, |yarn, lobe, _| {
            sum += self.thread(yarn).specular * (lobe * self.gain);
        });
        sum
    }

    /// The segment under a point.
    #[inline]
    pub fn local(&self, position_mm: Vec2) -> Local<'_> {
        let spot = self.tiling.locate(position_mm);
        let placed = &self.tiling.segments()[spot.segment];
        let t = &self.types[self.type_of[spot.segment] as usize];
        let step = match &self.noise {
            Some(noise) if t.steps.len() > 1 => self.noise_step(placed.yarn, &spot, noise),
            _ => 0,
        };
        Local {
            segment: &t.steps[step],
            yarn: placed.yarn,
            spot,
            placed,
        }
    }

    /// Brightness of the fibre grain at a place.
    #[inline]
    fn grain(&self, local: &Local<'_>) -> f32 {
        if self.grains_per_mm <= 0.0 {
            return 1.0;
        }
        // Counted from the corner, so that no grain is cut at the segment's edge.
        let cell = |x: f32| i64::from((x * self.grains_per_mm) as i32);
        let (spot, placed) = (&local.spot, local.placed);
        let segment = noise::name(
            self.seed,
            [
                spot.segment as i64,
                i64::from(spot.copy[0]),
                i64::from(spot.copy[1]),
            ],
        );
        let across = cell(spot.across_mm + 0.5 * placed.width_mm);
        let along = cell(spot.along_mm + 0.5 * placed.length_mm);
        noise::exponential(noise::name(segment, [across, along, 2]))
    }

    /// Inclination step of a segment: noise along its own yarn and along the
    /// one that crosses under its middle.
    #[inline]
    fn noise_step(&self, yarn: Yarn, spot: &Spot, noise: &TensionNoise) -> usize {
        let copy = Vec2::new(spot.copy[0] as f32, spot.copy[1] as f32);
        let middle = self.tiling.middle_mm(spot.segment) + copy * self.tiling.period_mm();
        let along = noise.at(middle);
        let thread = self.thread(yarn);
        let (own, cross) = (thread.u_noise_own_rad, thread.u_noise_cross_rad);
        let delta = own * along[yarn as usize] + cross * along[1 - yarn as usize];
        noise::nearest_step(delta, own + cross, NOISE_STEPS)
    }

    /// Value at a place that was already looked up, 1/sr; both directions must be above the
    /// face.
    #[inline]
    pub fn texture_at(&self, local: &Local<'_>, w_in: Vec3, w_out: Vec3) -> Rgb {
        let thread = self.thread(local.yarn);
        let pair = Pair::new(
            segment_from_face(local.yarn, w_in),
            segment_from_face(local.yarn, w_out),
        );
        let s = local.segment;
        let drawn = s.texture(&pair, local.spot.across_mm, local.spot.along_mm);
        let seen = self.visible_share(local.yarn, [s.width_mm, s.length_mm], &pair);
        let mut value = self.diffuse(local.yarn, w_in, w_out);
        if drawn > 0.0 {
            value += thread.specular * (drawn * self.grain(local) * self.gain);
        }
        value * seen
    }

    /// The same at a place; the specular part is an estimate.
    #[inline]
    pub fn specular_and_diffuse_at(&self, local: &Local<'_>, fibres: &Fibres) -> (f32, f32) {
        let (specular, diffuse) = self.specular_and_diffuse(Some(local.yarn));
        let shape = fibres.albedo() * self.grain(local) * self.gain;
        (specular * shape, diffuse)
    }

    /// Weights of the specular and the diffuse part for choosing between them.
    pub fn specular_and_diffuse(&self, yarn: Option<Yarn>) -> (f32, f32) {
        let of = |t: &Thread| (t.specular.mean(), (t.diffuse + t.round).mean() * PI);
        match yarn {
            Some(yarn) => of(self.thread(yarn)),
            None => {
                let mut sum = (0.0, 0.0);
                for t in &self.types {
                    let area = t.width_mm * t.length_mm * t.per_mm2;
                    let (s, d) = of(self.thread(t.yarn));
                    sum = (sum.0 + s * area, sum.1 + d * area);
                }
                sum
            }
        }
    }
}

/// Segments of a yarn at every inclination that noise produces.
fn segments_of(
    yarn: &YarnParameters,
    width_mm: f32,
    length_mm: f32,
) -> Result<(Vec<YarnSegment<f32>>, Vec<f32>), Error> {
    let at = |u_max_rad: f64| SegmentParameters {
        u_max_rad,
        width_mm: f64::from(width_mm),
        length_mm: f64::from(length_mm),
        ..yarn.segment
    };
    let middle = yarn.segment.u_max_rad;
    let nominal = YarnSegment::new(&at(middle))?;
    let (own, cross) = (yarn.u_noise_own_rad, yarn.u_noise_cross_rad);
    let reach = f64::from(own + cross);
    if reach <= 0.0 {
        return Ok((vec![nominal], vec![1.0]));
    }
    let mut steps = Vec::with_capacity(NOISE_STEPS);
    for i in 0..NOISE_STEPS {
        let x = 2.0 * i as f64 / (NOISE_STEPS - 1) as f64 - 1.0;
        // Noise stops short of flat yarn and of upright yarn.
        let u = (middle + reach * x).clamp(0.25 * middle, 0.5 * (middle + 1.5));
        // Where noise alone makes a segment too steep to fit, it becomes a bead.
        let bead = SegmentParameters {
            fit: crate::segment::Fit::Narrow,
            ..at(u)
        };
        steps.push(YarnSegment::new(&bead)?);
    }
    Ok((steps, noise::step_shares(own, cross, NOISE_STEPS)))
}
