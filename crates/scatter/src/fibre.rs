//! Fibres as lobes: the far field for media, the near field for one fibre met at
//! a known offset.

use crate::fibre_frame::{FibreAngles, FibreFrame};
use crate::lobe::{Lobe, LobeSample};
use crate::longitudinal::{Balance, Balanced, Blur, Inclinations};
use crate::near::event::{Event, Scattered, drawing_cosine, pick};
use crate::near::parts::NearParts;
use crate::near::{LOBES, Optics};
use glam::{Vec3, Vec4};
use organza_basis::{PathRng, Rgb};
use organza_lanes::V3;
use organza_lanes::math::wrap;
use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

/// A model of how a fibre scatters light.
///
/// Its far field is `c(theta_o) c(theta_i) cos(theta_i) sum_p K_p(theta_i, theta_o)
/// A_p(theta_d, azimuth)` with the scale c of its balance, the folded Gaussians K of its blurs,
/// and A even in the azimuth. Reciprocity follows. A is at most what the balance was made for.
pub trait FibreModel: fmt::Debug + Send + Sync {
    /// Blurs of the lobes; lobes beyond the last have that of the first. Where there are four,
    /// the last two are alike.
    fn blurs(&self) -> &[Blur];

    /// What keeps the energy of its lobes.
    fn balance(&self) -> &Balance;

    /// The numbers of its near field.
    fn near_parts(&self) -> NearParts;

    /// Density of the inclinations in each lobe.
    fn densities(&self, pair: &Inclinations) -> [f32; LOBES] {
        let blurs = self.blurs();
        std::array::from_fn(|p| pair.density(blurs.get(p).unwrap_or(&blurs[0])))
    }

    /// In which proportion lobes are drawn at a mean inclination.
    fn far_lobes(&self, mean_cos: f32) -> [f32; LOBES];

    /// A of each lobe in x, y, z, per radian of azimuth; the density of drawing the azimuth,
    /// given the lobe, in w.
    fn far(&self, mean_cos: f32, azimuth_rad: f32) -> [Vec4; LOBES];

    /// Draws the azimuth of a lobe with that density; it may lie beyond pi.
    fn far_azimuth_sample(&self, lobe: usize, mean_cos: f32, rng: &mut PathRng) -> f32;

    /// Even steps from 0 to pi, so many nodes with both ends, between which A is nearly linear.
    fn azimuth_nodes(&self) -> usize;
}

/// How a fibre scatters light, by any model.
#[derive(Clone, Debug)]
pub struct Fibre {
    model: Arc<dyn FibreModel>,
    /// The numbers of its near field as a table, once they were asked for.
    optics: Arc<OnceLock<Optics>>,
}

impl<M: FibreModel + 'static> From<M> for Fibre {
    fn from(model: M) -> Fibre {
        Fibre {
            model: Arc::new(model),
            optics: Arc::default(),
        }
    }
}

impl Deref for Fibre {
    type Target = dyn FibreModel;

    fn deref(&self) -> &(dyn FibreModel + 'static) {
        &*self.model
    }
}

impl Fibre {
    fn optics(&self) -> &Optics {
        self.optics
            .get_or_init(|| Optics::of_parts(&[self.near_parts()]))
    }

    /// Draws the inclination of what lobe `p` scatters; the azimuth is left open.
    fn inclination_sample(&self, frame: &FibreFrame, p: usize, rng: &mut PathRng) -> FibreAngles {
        let out = [frame.sin_out, frame.cos_out];
        let [sin, cos] = {
            let blurs = self.blurs();
            self.balance()
                .sample(out, blurs.get(p).unwrap_or(&blurs[0]), rng)
        };
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
        let optics = self.optics();
        let material = optics.material();
        let met = (frame.lanes(), h.clamp(-1.0, 1.0));
        self.near_field_of(NearEvent(Event::new(optics, material, met, true)))
    }

    /// The near field of an event of this fibre again.
    pub fn near_field_of(&self, event: NearEvent) -> NearField<'_> {
        NearField {
            optics: self.optics(),
            event,
        }
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
        let lobes = self.fibre.far(pair.mean_cos, a.azimuth_rad);
        let kernels = self.fibre.densities(pair);
        for p in 0..LOBES {
            value += kernels[p] * lobes[p].truncate();
            pdf += kernels[p] * event.draws[p] * lobes[p].w;
        }
        weigh(self.fibre, &event.out, a, value, pdf)
    }

    fn event(&self, w_out: Vec3) -> FarEvent {
        let frame = FibreFrame::new(self.tangent, w_out);
        let cos = drawing_cosine(frame.cos_out, self.fibre.blurs()[0].deviation_rad);
        let lobes = self.fibre.far_lobes(cos);
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
        let p = pick(&event.shares, rng.unit()).0 as usize;
        let mut a = self.fibre.inclination_sample(frame, p, rng);
        let pair = inclinations(frame, &a);
        let azimuth = self.fibre.far_azimuth_sample(p, pair.mean_cos, rng);
        a.azimuth_rad = wrap(azimuth);
        let w_in = frame.direction(&a);
        let (value, pdf) = self.value(&event, &a, &pair);
        finish(w_in, value, pdf)
    }
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

fn finish(w_in: Vec3, value: Rgb, pdf: f32) -> Option<LobeSample> {
    (pdf > 0.0).then(|| LobeSample::new(w_in, value / pdf, pdf))
}

/// A near field without its fibre: what a tracker keeps of an event.
#[derive(Clone, Copy)]
pub struct NearEvent(Event<f32>);

impl PartialEq for NearEvent {
    fn eq(&self, other: &NearEvent) -> bool {
        (self.0.frame, self.0.offset) == (other.0.frame, other.0.offset)
    }
}

impl fmt::Debug for NearEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("NearEvent");
        shown.field("frame", &self.0.frame);
        shown.field("offset", &self.0.offset).finish()
    }
}

/// The lobes of a fibre at one offset, computed as the kernel does.
///
/// A [`Lobe`] that is conditional on the event: pass the `w_out` that its frame
/// was made for.
#[derive(Clone, Copy)]
pub struct NearField<'a> {
    optics: &'a Optics,
    event: NearEvent,
}

impl NearField<'_> {
    /// The event, from which [`Fibre::near_field_of`] makes this again.
    pub fn event(&self) -> &NearEvent {
        &self.event
    }

    fn toward(&self, w_in: Vec3) -> Scattered<f32> {
        self.event.0.toward(self.optics, V3::splat(w_in), true)
    }

    /// Unit outward normal of the surface point where light leaves toward `w_in`: see
    /// [`exit_normal`](Event::exit_normal).
    pub fn exit_normal(&self, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let units = [rng.unit(), rng.unit()];
        self.event.0.exit_normal(&self.toward(w_in), units).into()
    }

    /// From where the surface of a fibre of that radius was met to where light leaves it toward
    /// `w_in`, mm. Places along the fibre are not resolved.
    pub fn exit_mm(&self, radius_mm: f32, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let event = &self.event.0;
        let met: Vec3 = event.frame.surface(event.offset).into();
        radius_mm * (self.exit_normal(w_in, rng) - met)
    }
}

impl Lobe for NearField<'_> {
    fn eval(&self, _w_out: Vec3, w_in: Vec3) -> Rgb {
        Rgb(self.toward(w_in).value.into())
    }

    fn pdf(&self, _w_out: Vec3, w_in: Vec3) -> f32 {
        self.toward(w_in).pdf
    }

    fn sample(&self, _w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let turn = self.event.0.turn(self.optics, rng, true);
        let pdf = turn.scattered.pdf;
        (pdf > 0.0).then(|| LobeSample::new(turn.direction.into(), Rgb(turn.weight.into()), pdf))
    }
}
