//! Fibres as lobes: the far field for media, the near field for one fibre met at
//! a known offset.

use crate::cylinder::{Crossing, LOBES};
use crate::dielectric::DielectricFibre;
use crate::fibre_frame::{FibreAngles, FibreFrame};
use crate::fitted::FittedFibre;
use crate::lobe::{Lobe, LobeSample};
use crate::longitudinal::{Balance, Balanced, Blur, Inclinations, wrap};
use glam::{Vec3, Vec4};
use organza_basis::{PathRng, Rgb};
use std::f32::consts::PI;

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

    /// Draws the inclination of what lobe `p` scatters; the azimuth is left open.
    fn inclination_sample(&self, frame: &FibreFrame, p: usize, rng: &mut PathRng) -> FibreAngles {
        let out = [frame.sin_out, frame.cos_out];
        let [sin, cos] = self.balance().sample(out, &self.blurs()[p], rng);
        FibreAngles {
            sin,
            cos,
            azimuth_rad: 0.0,
        }
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
        self.near_field_of(NearEvent::new(self, frame, h))
    }

    /// The near field of an event of this fibre again.
    pub fn near_field_of(&self, event: NearEvent) -> NearField<'_> {
        NearField { fibre: self, event }
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
    /// Value and density together, which share most of their work.
    fn value(&self, event: &FarEvent, a: &FibreAngles, pair: &Inclinations) -> (Rgb, f32) {
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        match self.fibre {
            Fibre::Dielectric(f) => {
                let lobes = f.far(pair.mean_cos, a.azimuth_rad);
                let kernels = f.densities(pair);
                for p in 0..LOBES {
                    value += kernels[p] * lobes[p].truncate();
                    pdf += kernels[p] * event.draws[p] * lobes[p].w;
                }
            }
            Fibre::Fitted(f) => {
                let energies = f.energies(pair.mean_cos);
                for (p, energy) in energies.iter().enumerate() {
                    let k = pair.density(&f.blurs()[p]) * f.azimuth(p, a.azimuth_rad);
                    value += k * energy.0;
                    pdf += k * event.draws[p];
                }
            }
        }
        weigh(self.fibre, &event.out, a, value, pdf)
    }

    fn event(&self, w_out: Vec3) -> FarEvent {
        let frame = FibreFrame::new(self.tangent, w_out);
        let cos = self.fibre.drawing_cosine(&frame);
        let lobes = match self.fibre {
            Fibre::Dielectric(f) => f.far_lobes(cos),
            Fibre::Fitted(f) => grey(f.energies(cos)),
        };
        let out = self.fibre.balance().at(frame.cos_out);
        let shares = shares(lobes, &out);
        FarEvent {
            frame,
            shares,
            draws: draws(shares, &out),
            out,
        }
    }

    fn toward(&self, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        let event = self.event(w_out);
        let a = event.frame.angles(w_in);
        self.value(&event, &a, &inclinations(&event.frame, &a))
    }
}

/// What a far field knows about the incoming direction of a walk.
struct FarEvent {
    frame: FibreFrame,
    out: Balanced,
    /// Probability with which each lobe is drawn.
    shares: [f32; LOBES],
    /// The same over the norm of its inclinations.
    draws: [f32; LOBES],
}

/// Value and density from their sums over lobes: the balance and the cosines that
/// all lobes have in common.
fn weigh(fibre: &Fibre, out: &Balanced, a: &FibreAngles, value: Vec3, pdf: f32) -> (Rgb, f32) {
    let balanced = fibre.balance().at(a.cos);
    (
        Rgb(value * out.scale * balanced.scale * a.cos),
        pdf * balanced.mean_scale() * a.cos,
    )
}

impl Lobe for FarField<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.toward(w_out, w_in).0
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.toward(w_out, w_in).1
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let event = self.event(w_out);
        let frame = &event.frame;
        let p = pick(&event.shares, rng);
        let mut a = self.fibre.inclination_sample(frame, p, rng);
        let pair = inclinations(frame, &a);
        let azimuth = match self.fibre {
            Fibre::Dielectric(f) => f.far_azimuth_sample(p, pair.mean_cos, rng),
            Fibre::Fitted(f) => f.azimuth_sample(p, rng),
        };
        a.azimuth_rad = wrap(azimuth);
        let w_in = frame.direction(&a);
        let (value, pdf) = self.value(&event, &a, &pair);
        finish(w_in, value, pdf)
    }
}

/// Means over channels.
fn grey<const N: usize>(energies: [Rgb; N]) -> [f32; LOBES] {
    let mut grey = [0.0; LOBES];
    for (grey, e) in grey.iter_mut().zip(energies) {
        *grey = e.mean().max(0.0);
    }
    grey
}

/// Probabilities in proportion to what lobes of some energies send anywhere.
fn shares(energies: [f32; LOBES], out: &Balanced) -> [f32; LOBES] {
    let sent = Vec4::from_array(energies) * out.norms;
    let total = sent.element_sum();
    // Nothing scatters: any choice will do, and its value is zero.
    if total > 0.0 {
        (sent / total).to_array()
    } else {
        [1.0, 0.0, 0.0, 0.0]
    }
}

/// Shares over the norms of their inclinations' densities.
fn draws(shares: [f32; LOBES], out: &Balanced) -> [f32; LOBES] {
    let norms = out.norms.max(Vec4::splat(f32::MIN_POSITIVE));
    (Vec4::from_array(shares) / norms).to_array()
}

/// An index with the given probabilities, which sum to one.
fn pick(shares: &[f32; LOBES], rng: &mut PathRng) -> usize {
    pick_below(shares, rng.unit())
}

/// An index in proportion to numbers that are not negative.
fn pick_among(parts: &[f32; LOBES], rng: &mut PathRng) -> usize {
    pick_below(parts, rng.unit() * parts.iter().sum::<f32>())
}

/// Where the sum of what comes before first exceeds `left`; never a zero, unless
/// there is nothing else.
fn pick_below(parts: &[f32; LOBES], mut left: f32) -> usize {
    let mut chosen = 0;
    for (i, &part) in parts.iter().enumerate() {
        if part > 0.0 {
            chosen = i;
            left -= part;
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

/// A near field without its fibre: what a tracker keeps of an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearEvent {
    frame: FibreFrame,
    out: Balanced,
    h: f32,
    /// At which lobes are drawn; of a dielectric.
    crossing: Crossing,
    /// Probability of each lobe; one for the chosen.
    shares: [f32; LOBES],
    /// What a chosen lobe's values are multiplied by: one over its probability.
    boost: f32,
    chosen: Option<usize>,
}

/// The lobes of a fibre at one offset: all of them, or one drawn by
/// [`NearField::choose_lobe`].
///
/// A [`Lobe`] that is conditional on the event: pass the `w_out` that its frame
/// was made for.
#[derive(Clone, Copy, Debug)]
pub struct NearField<'a> {
    fibre: &'a Fibre,
    event: NearEvent,
}

impl NearEvent {
    fn new(fibre: &Fibre, frame: FibreFrame, h: f32) -> NearEvent {
        let cos = fibre.drawing_cosine(&frame);
        let (crossing, energies) = match fibre {
            Fibre::Dielectric(f) if f.section().is_some() => (f.crossing(cos, h), f.far_lobes(cos)),
            Fibre::Dielectric(f) => {
                let crossing = f.crossing(cos, h);
                (crossing, grey(f.attenuations(&crossing)))
            }
            Fibre::Fitted(f) => (Crossing::default(), grey(f.energies(cos))),
        };
        let out = fibre.balance().at(frame.cos_out);
        NearEvent {
            frame,
            out,
            h,
            crossing,
            shares: shares(energies, &out),
            boost: 1.0,
            chosen: None,
        }
    }

    /// The frame of the event.
    pub fn frame(&self) -> &FibreFrame {
        &self.frame
    }

    /// The offset of the event.
    pub fn offset(&self) -> f32 {
        self.h
    }
}

impl<'a> NearField<'a> {
    /// The event, from which [`Fibre::near_field_of`] makes this again.
    pub fn event(&self) -> &NearEvent {
        &self.event
    }

    /// Draws one of the lobes: a rival of drawing it where light leaves, see
    /// [`NearField::exit_normal`], that shares no more with it than the lobes. Use
    /// it for the light and for the next direction alike. Its values are divided
    /// by the probability of the choice.
    pub fn choose_lobe(&self, rng: &mut PathRng) -> NearField<'a> {
        let p = pick(&self.event.shares, rng);
        let mut only = [0.0; LOBES];
        only[p] = 1.0;
        NearField {
            fibre: self.fibre,
            event: NearEvent {
                shares: only,
                boost: self.event.boost / self.event.shares[p].max(f32::MIN_POSITIVE),
                chosen: Some(p),
                ..self.event
            },
        }
    }

    /// The chosen lobe: 0 for R, 1 for TT, 2 for TRT, 3 for the rest.
    pub fn chosen(&self) -> Option<usize> {
        self.event.chosen
    }

    /// Unit outward normal of the surface point, on the fibre's cross-section
    /// through the event, where light leaves toward `w_in`: of the chosen lobe, or
    /// of one drawn in proportion to what it sends there, so that the mean over
    /// draws is that over lobes.
    ///
    /// R, TT and TRT of a round dielectric leave where a smooth cylinder sends them,
    /// and so does R of another section; lobes whose paths are not resolved leave evenly over the width that faces
    /// `w_in`. Where blur turns light into the fibre it leaves from the nearest
    /// point of the outline instead, so that no ray starts into its own fibre.
    pub fn exit_normal(&self, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let event = &self.event;
        let a = event.frame.angles(w_in);
        let p = event.chosen.unwrap_or_else(|| {
            let pair = inclinations(&event.frame, &a);
            let sent = self.lobes(&a, &pair).map(|(k, colour)| k * colour.mean());
            pick_among(&sent, rng)
        });
        let angle = match self.fibre {
            Fibre::Dielectric(f) if p < f.resolved_lobes() => {
                f.crossing(event.frame.cos_out, event.h).exit_normal_rad(p)
            }
            _ => a.azimuth_rad + (2.0 * rng.unit() - 1.0).asin(),
        };
        let aside = wrap(angle - a.azimuth_rad);
        event
            .frame
            .across(a.azimuth_rad + aside.clamp(-0.5 * PI, 0.5 * PI))
    }

    /// Density of the directions of each lobe, but for the balance, and what the
    /// lobe keeps of the light.
    fn lobes(&self, a: &FibreAngles, pair: &Inclinations) -> [(f32, Rgb); LOBES] {
        match self.fibre {
            Fibre::Dielectric(f) if f.section().is_some() => {
                let kernels = f.densities(pair);
                let far = f.far(pair.mean_cos, a.azimuth_rad);
                std::array::from_fn(|p| {
                    let colour = far[p].truncate() / far[p].w.max(f32::MIN_POSITIVE);
                    (kernels[p] * far[p].w, Rgb(colour))
                })
            }
            Fibre::Dielectric(f) => {
                let mid = self.turned(f, pair);
                let attenuations = f.attenuations(&mid);
                let kernels = f.densities(pair);
                std::array::from_fn(|p| {
                    let k = kernels[p] * f.near_azimuth(&mid, p, a.azimuth_rad);
                    (k, attenuations[p])
                })
            }
            Fibre::Fitted(f) => {
                let energies = f.energies(pair.mean_cos);
                let mut lobes = [(0.0, Rgb::BLACK); LOBES];
                for (p, blur) in f.blurs().iter().enumerate() {
                    let k = pair.density(blur) * f.azimuth(p, a.azimuth_rad);
                    lobes[p] = (k, energies[p]);
                }
                lobes
            }
        }
    }

    fn value(&self, a: &FibreAngles, pair: &Inclinations) -> (Rgb, f32) {
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        let event = &self.event;
        let draws = draws(event.shares, &event.out);
        for (p, (k, colour)) in self.lobes(a, pair).into_iter().enumerate() {
            if event.chosen.is_none_or(|chosen| chosen == p) {
                value += k * colour.0;
                pdf += k * draws[p];
            }
        }
        weigh(self.fibre, &event.out, a, event.boost * value, pdf)
    }

    /// The crossing at the mean inclination.
    fn turned(&self, f: &DielectricFibre, pair: &Inclinations) -> Crossing {
        let ior = f.parameters().ior;
        self.event.crossing.turned(ior, pair.mean_cos, self.event.h)
    }

    fn toward(&self, w_in: Vec3) -> (Rgb, f32) {
        let a = self.event.frame.angles(w_in);
        self.value(&a, &inclinations(&self.event.frame, &a))
    }
}

impl Lobe for NearField<'_> {
    fn eval(&self, _w_out: Vec3, w_in: Vec3) -> Rgb {
        self.toward(w_in).0
    }

    fn pdf(&self, _w_out: Vec3, w_in: Vec3) -> f32 {
        self.toward(w_in).1
    }

    fn sample(&self, _w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let frame = &self.event.frame;
        let p = pick(&self.event.shares, rng);
        let mut a = self.fibre.inclination_sample(frame, p, rng);
        let pair = inclinations(frame, &a);
        let azimuth = match self.fibre {
            Fibre::Dielectric(f) if f.section().is_some() => {
                f.far_azimuth_sample(p, pair.mean_cos, rng)
            }
            Fibre::Dielectric(f) => f.near_azimuth_sample(&self.turned(f, &pair), p, rng),
            Fibre::Fitted(f) => f.azimuth_sample(p, rng),
        };
        a.azimuth_rad = wrap(azimuth);
        let w_in = frame.direction(&a);
        let (value, pdf) = self.value(&a, &pair);
        finish(w_in, value, pdf)
    }
}
