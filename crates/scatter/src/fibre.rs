//! Fibres as lobes: the far field for media, the near field for one fibre met at
//! a known offset.

use crate::cylinder::{Crossing, LOBES};
use crate::dielectric::DielectricFibre;
use crate::fibre_frame::{FibreAngles, FibreFrame};
use crate::fitted::FittedFibre;
use crate::lobe::{Lobe, LobeSample};
use crate::longitudinal::{Balance, Blur, Inclinations, folded_gaussian_sample, wrap};
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use std::f32::consts::PI;

/// Least cosine by which a density per angle becomes one per solid angle: keeps
/// it finite exactly along the fibre.
const MIN_COS: f32 = 1e-6;

/// How a fibre scatters light: every model there is.
#[derive(Clone, Debug)]
pub enum Fibre {
    /// From index of refraction, absorption and roughness.
    Dielectric(DielectricFibre),
    /// From fitted colours and widths.
    Fitted(FittedFibre),
}

impl Fibre {
    pub(crate) fn blurs(&self) -> &[Blur] {
        match self {
            Fibre::Dielectric(f) => f.blurs(),
            Fibre::Fitted(f) => f.blurs(),
        }
    }

    /// Cosine of the inclination at which lobes are drawn: that of `w_out`, kept
    /// as far from zero as blur moves the mean inclination. Exactly along the
    /// fibre a smooth one only reflects, while a rough one also transmits.
    fn drawing_cosine(&self, frame: &FibreFrame) -> f32 {
        let blur = self.blurs()[0].deviation_rad;
        (frame.cos_out * frame.cos_out + 0.25 * blur * blur)
            .min(1.0)
            .sqrt()
    }

    pub(crate) fn balance(&self) -> &Balance {
        match self {
            Fibre::Dielectric(f) => f.balance(),
            Fibre::Fitted(f) => f.balance(),
        }
    }

    /// c(theta_o) c(theta_i) cos(theta_i), per channel.
    fn scales(&self, frame: &FibreFrame, a: &FibreAngles) -> Vec3 {
        let balance = self.balance();
        balance.at(frame.cos_out) * balance.at(a.cos) * a.cos
    }

    /// The lobe of a whole fibre of unit tangent `tangent`, averaged over where
    /// across its width light meets it.
    pub fn far_field(&self, tangent: Vec3) -> FarField<'_> {
        FarField {
            fibre: self,
            tangent,
        }
    }

    /// The lobe of a fibre met at offset `h` in `[-1, 1]` by a walk that came from
    /// `w_out`, with everything that depends on those prepared.
    pub fn near_field(&self, frame: FibreFrame, h: f32) -> NearField<'_> {
        NearField::new(self, frame, h)
    }
}

fn inclinations(frame: &FibreFrame, a: &FibreAngles) -> Inclinations {
    Inclinations::new([a.sin, a.cos], [frame.sin_out, frame.cos_out])
}

/// See [`Fibre::far_field`].
#[derive(Clone, Copy, Debug)]
pub struct FarField<'a> {
    fibre: &'a Fibre,
    tangent: Vec3,
}

impl FarField<'_> {
    /// Value and density together, which share most of their work, for lobes
    /// drawn with the probabilities `shares`.
    fn value(
        &self,
        frame: &FibreFrame,
        a: &FibreAngles,
        pair: &Inclinations,
        shares: &[f32; LOBES],
    ) -> (Rgb, f32) {
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        match self.fibre {
            Fibre::Dielectric(f) => {
                let lobes = f.far(pair.mean_cos, a.azimuth_rad);
                let kernels = f.densities(pair);
                for p in 0..LOBES {
                    value += kernels[p] * lobes[p].truncate();
                    pdf += kernels[p] * shares[p] * lobes[p].w;
                }
            }
            Fibre::Fitted(f) => {
                let energies = f.energies(pair.mean_cos);
                for p in 0..energies.len() {
                    let k = pair.density(&f.blurs()[p]) * f.azimuth(p, a.azimuth_rad);
                    value += k * energies[p].0;
                    pdf += k * shares[p];
                }
            }
        }
        value *= self.fibre.scales(frame, a);
        (Rgb(value), pdf / a.cos.max(MIN_COS))
    }

    fn toward(&self, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        let frame = FibreFrame::new(self.tangent, w_out);
        let a = frame.angles(w_in);
        let shares = self.lobe_shares(&frame);
        self.value(&frame, &a, &inclinations(&frame, &a), &shares)
    }

    /// Probability with which each lobe is drawn.
    fn lobe_shares(&self, frame: &FibreFrame) -> [f32; LOBES] {
        let cos = self.fibre.drawing_cosine(frame);
        match self.fibre {
            Fibre::Dielectric(f) => f.far_lobes(cos),
            Fibre::Fitted(f) => {
                let [r, tt] = shares(f.energies(cos));
                [r, tt, 0.0, 0.0]
            }
        }
    }
}

impl Lobe for FarField<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.toward(w_out, w_in).0
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.toward(w_out, w_in).1
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let frame = FibreFrame::new(self.tangent, w_out);
        let normals = rng.normal2();
        let shares = self.lobe_shares(&frame);
        let p = pick(&shares, rng);
        let blur = &self.fibre.blurs()[p];
        let [sin, cos] = folded_gaussian_sample([frame.sin_out, frame.cos_out], blur, normals.x);
        let mut a = FibreAngles {
            sin,
            cos,
            azimuth_rad: 0.0,
        };
        let pair = inclinations(&frame, &a);
        let azimuth = match self.fibre {
            Fibre::Dielectric(f) => f.far_azimuth_sample(p, pair.mean_cos, rng),
            Fibre::Fitted(f) => f.azimuth_sample(p, rng.unit(), normals.y),
        };
        a.azimuth_rad = wrap(azimuth);
        let w_in = frame.direction(&a);
        let (value, pdf) = self.value(&frame, &a, &pair, &shares);
        finish(w_in, value, pdf)
    }
}

/// Probabilities in proportion to the mean over channels.
fn shares<const N: usize>(energies: [Rgb; N]) -> [f32; N] {
    let grey = energies.map(|e| e.mean().max(0.0));
    let total: f32 = grey.iter().sum();
    // Nothing scatters: any choice will do, and its value is zero.
    if total > 0.0 {
        grey.map(|g| g / total)
    } else {
        [1.0 / N as f32; N]
    }
}

/// An index with the given probabilities, which sum to one.
fn pick(shares: &[f32], rng: &mut PathRng) -> usize {
    let mut left = rng.unit();
    let mut chosen = 0;
    for (i, &share) in shares.iter().enumerate() {
        if share > 0.0 {
            chosen = i;
            left -= share;
            if left < 0.0 {
                break;
            }
        }
    }
    chosen
}

fn finish(w_in: Vec3, value: Rgb, pdf: f32) -> Option<LobeSample> {
    (pdf > 0.0).then(|| LobeSample {
        w_in,
        weight: value / pdf,
        pdf,
    })
}

/// Everything a near-field lobe may be.
const MAX_LOBES: usize = LOBES;

/// The lobes of a fibre at one offset: all of them, or one drawn by
/// [`NearField::choose_lobe`].
///
/// A [`Lobe`] that is conditional on the event: pass the `w_out` that its frame
/// was made for.
#[derive(Clone, Copy, Debug)]
pub struct NearField<'a> {
    fibre: &'a Fibre,
    frame: FibreFrame,
    h: f32,
    /// At which lobes are drawn; of a dielectric.
    crossing: Crossing,
    /// Probability of each lobe; one for the chosen.
    shares: [f32; MAX_LOBES],
    /// What a chosen lobe's values are multiplied by: one over its probability.
    boost: f32,
    chosen: Option<usize>,
}

impl<'a> NearField<'a> {
    fn new(fibre: &'a Fibre, frame: FibreFrame, h: f32) -> NearField<'a> {
        let cos = fibre.drawing_cosine(&frame);
        let (crossing, shares) = match fibre {
            Fibre::Dielectric(f) => {
                let crossing = f.crossing(cos, h);
                (crossing, shares(f.attenuations(&crossing)))
            }
            Fibre::Fitted(f) => {
                let [r, tt] = shares(f.energies(cos));
                (Crossing::default(), [r, tt, 0.0, 0.0])
            }
        };
        NearField {
            fibre,
            frame,
            h,
            crossing,
            shares,
            boost: 1.0,
            chosen: None,
        }
    }

    /// Draws one of the lobes, for integrators that need to know where light
    /// leaves: use it for the light and for the next direction alike. Its values
    /// are divided by the probability of the choice.
    pub fn choose_lobe(&self, rng: &mut PathRng) -> NearField<'a> {
        self.only(pick(&self.shares, rng))
    }

    /// The same for a lobe that [`NearField::choose_lobe`] drew before, of this
    /// fibre at this offset: for trackers that keep no more than its number.
    pub fn with_lobe(&self, chosen: usize) -> NearField<'a> {
        self.only(chosen.min(MAX_LOBES - 1))
    }

    fn only(&self, p: usize) -> NearField<'a> {
        let mut only = [0.0; MAX_LOBES];
        only[p] = 1.0;
        NearField {
            shares: only,
            boost: self.boost / self.shares[p].max(f32::MIN_POSITIVE),
            chosen: Some(p),
            ..*self
        }
    }

    /// The chosen lobe: 0 for R, 1 for TT, 2 for TRT, 3 for the rest.
    pub fn chosen(&self) -> Option<usize> {
        self.chosen
    }

    /// The frame of the event.
    pub fn frame(&self) -> &FibreFrame {
        &self.frame
    }

    /// The offset of the event.
    pub fn offset(&self) -> f32 {
        self.h
    }

    /// Unit outward normal of the surface point, on the fibre's cross-section
    /// through the event, where light of the chosen lobe leaves toward `w_in`.
    ///
    /// R, TT and TRT of a dielectric leave where a smooth cylinder sends them;
    /// lobes whose paths are not resolved leave evenly over the width that faces
    /// `w_in`. Where blur turns light into the fibre it leaves from the nearest
    /// point of the outline instead, so that no ray starts into its own fibre.
    pub fn exit_normal(&self, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let azimuth = self.frame.angles(w_in).azimuth_rad;
        let angle = match (self.fibre, self.chosen) {
            (Fibre::Dielectric(f), Some(p)) if p < LOBES - 1 => {
                f.crossing(self.frame.cos_out, self.h).exit_normal_rad(p)
            }
            _ => azimuth + (2.0 * rng.unit() - 1.0).asin(),
        };
        let aside = wrap(angle - azimuth);
        self.frame
            .across(azimuth + aside.clamp(-0.5 * PI, 0.5 * PI))
    }

    fn value(&self, a: &FibreAngles) -> (Rgb, f32) {
        let frame = &self.frame;
        let blurs = self.fibre.blurs();
        let pair = inclinations(frame, a);
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        let active = (0..blurs.len()).filter(|&p| self.shares[p] > 0.0);
        match self.fibre {
            Fibre::Dielectric(f) => {
                let mid = self
                    .crossing
                    .turned(f.parameters().ior, pair.mean_cos, self.h);
                let attenuations = f.attenuations(&mid);
                let kernels = f.densities(&pair);
                for p in active {
                    let k = kernels[p];
                    value += k * f.near_azimuth(&mid, p, a.azimuth_rad) * attenuations[p].0;
                    pdf += self.shares[p] * k * f.near_azimuth(&self.crossing, p, a.azimuth_rad);
                }
            }
            Fibre::Fitted(f) => {
                let energies = f.energies(pair.mean_cos);
                for p in active {
                    let k = pair.density(&blurs[p]) * f.azimuth(p, a.azimuth_rad);
                    value += k * energies[p].0;
                    pdf += self.shares[p] * k;
                }
            }
        }
        value *= self.boost * self.fibre.scales(frame, a);
        (Rgb(value), pdf / a.cos.max(MIN_COS))
    }
}

impl Lobe for NearField<'_> {
    fn eval(&self, _w_out: Vec3, w_in: Vec3) -> Rgb {
        self.value(&self.frame.angles(w_in)).0
    }

    fn pdf(&self, _w_out: Vec3, w_in: Vec3) -> f32 {
        self.value(&self.frame.angles(w_in)).1
    }

    fn sample(&self, _w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let frame = &self.frame;
        let normals = rng.normal2();
        let p = self.chosen.unwrap_or_else(|| pick(&self.shares, rng));
        let azimuth = match self.fibre {
            Fibre::Dielectric(f) => f.near_azimuth_sample(&self.crossing, p, normals.y, rng),
            Fibre::Fitted(f) => f.azimuth_sample(p, rng.unit(), normals.y),
        };
        let blur = &self.fibre.blurs()[p];
        let [sin, cos] = folded_gaussian_sample([frame.sin_out, frame.cos_out], blur, normals.x);
        let a = FibreAngles {
            sin,
            cos,
            azimuth_rad: wrap(azimuth),
        };
        let w_in = frame.direction(&a);
        let (value, pdf) = self.value(&a);
        finish(w_in, value, pdf)
    }
}
