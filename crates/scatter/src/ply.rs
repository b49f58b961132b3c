//! A ply: a bundle of fibres as one cylinder, after the ply model of [Montazeri2020].
//!
//! # The event
//! A ply is a round cylinder evenly filled with fibres that wind about its axis. Light
//! enters where a ray meets the cylinder, goes straight until it meets a fibre and leaves
//! in one of three ways:
//!
//! - **Straight on**: no fibre was met along the chord. The tracker draws this
//!   ([`Ply::first_fibre`]) and asks shadow rays for it ([`Ply::transmittance`]).
//! - **Once scattered**: by the near field of the fibre that was met, about its own
//!   direction, dimmed along the chord to where the light leaves. The fibre's R lobe is
//!   the reflection of a rough dielectric about the fibre, its TT lobe the transmission.
//! - **The body**: what is scattered again before it leaves. It leaves at another place of
//!   the circumference than where it came in, so that reflection and transmission are one
//!   term, with the inclinations that it keeps from the fibres ([`body`]).
//!
//! # What differs from the printed model
//! - Its equation 8 refracts light into the ply as into a solid. The ply has no such
//!   surface; the fibres do, and the dielectric here is theirs. So the printed equation's
//!   defects (no factor for the measure of transmitted directions on one side only, cases
//!   that distinguish sides by `w_i . w_o` instead of by the normal, a half vector with one
//!   sign in the numerator and another in the norm) do not arise.
//! - Its equation 12 adds Lommel-Seeliger's single scattering and a dipole with an undefined
//!   `A`. Lommel-Seeliger is the mean over depth of what is done here for each drawn depth;
//!   the multiple scattering is computed, not a dipole.
//! - Its equations 12 to 14 share out the body's energy by free parameters. Here it is what
//!   random walks in the ply leave.
//!
//! # What holds
//! - Energy: without absorption, all light leaves, in the mean over offsets, to the
//!   noise of the tables and the energy of the fibre's near field.
//! - Nothing is fitted by default. The extinction is that of packed fibres
//!   ([`void_multiplier`]), the tables follow from the fibre's scattering. A
//!   [`PlyCorrection`] changes what the fibres do not settle.
//! - Not reciprocal pair by pair: the body's exit depends on where light came in, but not
//!   in the same way on where it leaves.

mod body;
mod correction;
mod sent;
#[cfg(test)]
mod tests;

use crate::fibre::{Fibre, NearEvent, NearField};
use crate::fibre_frame::FibreFrame;
use crate::lobe::{Lobe, LobeSample};
use crate::packed_fibre::{packing_fraction, void_multiplier};
use body::{Body, BodyEvent};
pub use correction::PlyCorrection;
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use std::f32::consts::PI;

/// What a ply is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyParameters {
    /// Radius of the ply, mm.
    pub radius_mm: f32,
    /// Radius of its fibres, mm.
    pub fibre_radius_mm: f32,
    /// Fibres in its section, at least one; need not be a whole number.
    pub fibres: f32,
    /// Twist of the fibres about the ply's axis, radians per mm; positive is Z.
    pub twist_rad_per_mm: f32,
    /// What the fibres do not settle.
    pub correction: PlyCorrection,
}

impl PlyParameters {
    /// Whether a ply can have them: all finite, radii and fibres positive.
    pub fn are_valid(&self) -> bool {
        let positive = |x: f32| x.is_finite() && x > 0.0;
        positive(self.radius_mm)
            && positive(self.fibre_radius_mm)
            && positive(self.fibres)
            && self.twist_rad_per_mm.is_finite()
            && self.correction.is_valid()
    }

    /// Fibre length per volume, mm^-2.
    pub fn length_density_per_mm2(&self) -> f32 {
        self.fibres / (PI * self.radius_mm * self.radius_mm)
    }

    /// The share of its volume that fibres fill.
    pub fn packing(&self) -> f32 {
        packing_fraction(self.length_density_per_mm2(), self.fibre_radius_mm)
    }

    /// Extinction across the fibres, 1/mm, of fibres that cannot overlap.
    pub fn broadside_per_mm(&self) -> f32 {
        let strewn = 2.0 * self.fibre_radius_mm * self.length_density_per_mm2();
        strewn * void_multiplier(self.packing()) * self.correction.extinction
    }

    /// Unit direction of the fibres at `out_mm` from the axis of unit tangent `axis`.
    pub fn fibre_direction(&self, axis: Vec3, out_mm: Vec3) -> Vec3 {
        (axis + self.twist_rad_per_mm * axis.cross(out_mm)).normalize()
    }
}

/// A ply with its fibres' scattering.
#[derive(Clone, Debug)]
pub struct Ply {
    parameters: PlyParameters,
    fibre: Fibre,
    broadside_per_mm: f32,
    body: Body,
}

/// A place in a ply: the ply's unit tangent there, and from its axis to the place, mm,
/// across the tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyPlace {
    /// Unit tangent of the ply.
    pub axis: Vec3,
    /// From the axis to the place, mm.
    pub out_mm: Vec3,
    /// Radius of the ply there, mm.
    pub radius_mm: f32,
}

impl PlyPlace {
    /// Distance to where a ray along the unit direction `w` leaves the ply; 0 outside.
    pub fn chord_mm(&self, w: Vec3) -> f32 {
        let across = w - self.axis * self.axis.dot(w);
        let a = across.length_squared().max(1e-12);
        let b = self.out_mm.dot(across);
        let c = self.out_mm.length_squared() - self.radius_mm * self.radius_mm;
        let discriminant = b * b - a * c;
        if discriminant <= 0.0 {
            return 0.0;
        }
        let root = discriminant.sqrt();
        // Without cancellation for places on the circumference.
        let t = if b > 0.0 {
            -c / (b + root)
        } else {
            (root - b) / a
        };
        t.clamp(0.0, MAX_CHORD_RADII * self.radius_mm)
    }

    /// The place `t_mm` on along `w`.
    pub fn moved(&self, w: Vec3, t_mm: f32) -> PlyPlace {
        let across = w - self.axis * self.axis.dot(w);
        PlyPlace {
            out_mm: self.out_mm + t_mm * across,
            ..*self
        }
    }
}

/// Light along a ply goes so far in it at most, in its radii: plies bend.
const MAX_CHORD_RADII: f32 = 16.0;

impl Ply {
    /// A ply of such fibres; its tables follow from random walks that depend on nothing
    /// else. `None` where the parameters are not valid.
    pub fn new(parameters: PlyParameters, fibre: Fibre) -> Option<Ply> {
        parameters.are_valid().then(|| Ply {
            broadside_per_mm: parameters.broadside_per_mm(),
            body: Body::walked(&parameters, &fibre),
            parameters,
            fibre,
        })
    }

    /// What it is made of.
    pub fn parameters(&self) -> &PlyParameters {
        &self.parameters
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        self.body.memory_bytes() + size_of::<Ply>() as u64
    }

    fn extinction_per_mm(&self, place: &PlyPlace, w: Vec3) -> f32 {
        let fibre = self.parameters.fibre_direction(place.axis, place.out_mm);
        self.broadside_per_mm * self.parameters.correction.sine(fibre, w)
    }

    /// The share of light that passes a ply straight, from `place` out of it along `w`.
    pub fn transmittance(&self, place: &PlyPlace, w: Vec3) -> f32 {
        let chord = place.chord_mm(w);
        // Simpson's rule: the twist turns fibres along the way.
        let at = |share: f32| self.extinction_per_mm(&place.moved(w, share * chord), w);
        let mean = (at(0.0) + 4.0 * at(0.5) + at(1.0)) / 6.0;
        (-mean * chord).exp()
    }

    /// Draws how far light along `travel` goes from `place` until it meets a fibre, mm;
    /// `None` where it passes.
    pub fn first_fibre(&self, place: &PlyPlace, travel: Vec3, rng: &mut PathRng) -> Option<f32> {
        first_fibre(&self.parameters, place, travel, rng)
    }

    /// The event of light that came along `-w_out`, entered at `entry` and met a fibre
    /// `t_mm` on along `way`: along the light unless a map of places turns rays otherwise.
    pub fn event(
        &self,
        entry: &PlyPlace,
        t_mm: f32,
        way: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> PlyEvent {
        let met = entry.moved(way, t_mm);
        let fibre = self.parameters.fibre_direction(met.axis, met.out_mm);
        let fibre = self.parameters.correction.met(fibre, w_out, rng);
        let offset = 2.0 * rng.unit() - 1.0;
        let near = self.fibre.near_field(FibreFrame::new(fibre, w_out), offset);
        let frame = FibreFrame::new(entry.axis, w_out);
        let normal = entry.out_mm.try_normalize().unwrap_or(-frame.forward);
        let depth = self.broadside_per_mm * t_mm * frame.cos_out;
        PlyEvent {
            place: met,
            near: *near.event(),
            exit_seed: (u64::from(rng.bits()) << 32) | u64::from(rng.bits()),
            body: self.body.event(frame, frame.offset(normal), depth, rng),
        }
    }

    /// The lobe of an event.
    pub fn lobe<'a>(&'a self, event: &'a PlyEvent) -> PlyLobe<'a> {
        PlyLobe { ply: self, event }
    }
}

/// Where light met the first fibre of a ply, and what was drawn of what follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyEvent {
    place: PlyPlace,
    near: NearEvent,
    /// Of the drawing of exit points of the fibre.
    exit_seed: u64,
    body: BodyEvent,
}

/// The lobe of a [`PlyEvent`]: conditional on it; pass the `w_out` that it was made for.
#[derive(Clone, Copy, Debug)]
pub struct PlyLobe<'a> {
    ply: &'a Ply,
    event: &'a PlyEvent,
}

impl PlyLobe<'_> {
    fn near(&self) -> NearField<'_> {
        self.ply.fibre.near_field_of(self.event.near)
    }

    /// From where light met the fibre to where it leaves the fibre toward `w_in`, mm.
    fn off_fibre_mm(&self, w_in: Vec3) -> Vec3 {
        let mut rng = PathRng::from_seed(self.event.exit_seed);
        let radius_mm = self.ply.parameters.fibre_radius_mm;
        self.near().exit_mm(radius_mm, w_in, &mut rng)
    }

    fn once(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        let value = self.near().eval(w_out, w_in);
        if value == Rgb::BLACK {
            return value;
        }
        let event = self.event;
        let place = event.place.moved(self.off_fibre_mm(w_in), 1.0);
        value * self.ply.transmittance(&place, w_in)
    }

    /// From where light met the fibre to where a ray toward `w_in` starts, mm: by the part
    /// that sends it there, drawn in proportion.
    pub fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let once = self.once(w_out, w_in).mean();
        let body = self.event.body.value(&self.ply.body, w_in).mean();
        if rng.unit() * (once + body) < once {
            // Where it was met: the place lies in the ply, which it leaves freely.
            Vec3::ZERO
        } else {
            let place = &self.event.place;
            INSIDE * place.radius_mm * self.event.body.exit_normal() - place.out_mm
        }
    }
}

/// See [`Ply::first_fibre`].
fn first_fibre(
    parameters: &PlyParameters,
    place: &PlyPlace,
    travel: Vec3,
    rng: &mut PathRng,
) -> Option<f32> {
    let (chord, broadside_per_mm) = (place.chord_mm(travel), parameters.broadside_per_mm());
    let mut t = 0.0;
    loop {
        t += rng.exponential() / broadside_per_mm;
        // Neither beyond the chord nor a NaN.
        if t.partial_cmp(&chord) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        let here = place.moved(travel, t);
        let fibre = parameters.fibre_direction(here.axis, here.out_mm);
        if rng.unit() < parameters.correction.sine(fibre, travel) {
            return Some(t);
        }
    }
}

/// Light of the body starts a little inside of the surface, so that at a bend it does not
/// meet the ply that it leaves, as a share of the radius.
const INSIDE: f32 = 0.98;

impl Lobe for PlyLobe<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.once(w_out, w_in) + self.event.body.value(&self.ply.body, w_in)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let body = &self.event.body;
        let share = body.share();
        (1.0 - share) * self.near().pdf(w_out, w_in) + share * body.pdf(&self.ply.body, w_in)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let body = &self.event.body;
        let w_in = if rng.unit() < body.share() {
            body.sample(&self.ply.body, rng)
        } else {
            self.near().sample(w_out, rng)?.w_in
        };
        let pdf = self.pdf(w_out, w_in);
        (pdf > 0.0).then(|| LobeSample::new(w_in, self.eval(w_out, w_in) / pdf, pdf))
    }
}
