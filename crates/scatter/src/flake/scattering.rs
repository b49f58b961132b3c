//! The interface of a family of micro-flakes, for the general walk and for lanes.

use super::DiffuseFlake;
use glam::Vec3;
use organza_basis::{PathRng, Rgb};

/// One population of fibres as flakes, of whatever family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakePopulation {
    /// Unit mean axis of the fibres.
    pub axis: Vec3,
    /// Ratio of the end-on to the broadside area.
    pub end_on: f32,
    /// Part of the light that an event keeps, each channel in `[0, 1]`.
    pub albedo: Rgb,
    /// Index into the cloth's table of materials.
    pub material: u16,
}

/// How lanes of the kernel take the events of a family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneEvent {
    /// As this trait says, one after the other.
    OneByOne,
    /// Side by side, as mirrors of the SGGX distribution ([`AxialFlake`](crate::AxialFlake)).
    SggxMirrors,
    /// Side by side, as diffuse flakes of the same.
    SggxDiffuse,
}

/// How populations scatter as micro-flakes of one family.
///
/// # Contract
/// Directions, measures and weights are those of [`Lobe`](crate::Lobe), given that
/// a collision happened. A family may draw one flake per collision, which then scatters
/// toward lights and walk alike; the others say where light goes.
pub trait FlakeScattering: Send + Sync {
    /// Area toward `w` over that across the axis: at most one, and a function of the end-on
    /// ratio and the angle between `w` and the axis.
    fn area(&self, flakes: &FlakePopulation, w: Vec3) -> f32;

    /// How lanes take its events.
    fn lane_event(&self) -> LaneEvent {
        LaneEvent::OneByOne
    }

    /// Whether a collision draws a flake.
    fn draws_flakes(&self) -> bool {
        false
    }

    /// Draws the flake that a walk meets, if the family does so.
    fn draw_flake(
        &self,
        _: &FlakePopulation,
        _w_out: Vec3,
        _: &mut PathRng,
    ) -> Option<DiffuseFlake> {
        None
    }

    /// Albedo times phase function, and the density of `sample`, both 1/sr. Nothing where
    /// flakes are drawn.
    fn eval(&self, _: &FlakePopulation, _w_out: Vec3, _w_in: Vec3) -> (Rgb, f32) {
        (Rgb::BLACK, 0.0)
    }

    /// Draws where light comes from.
    fn sample(&self, _: &FlakePopulation, _w_out: Vec3, _: &mut PathRng) -> Option<Vec3> {
        None
    }
}
