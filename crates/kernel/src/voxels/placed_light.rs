//! Lights with a place, found by shadow rays: rectangles far from the matter in lanes, others
//! lane by lane.
//!
//! The table of such a light is that of parallel light from its middle to that of the matter:
//! a guess, which the exact rays set right.

use super::panel::Panel;
use super::walk::stored;
use crate::drawn_light::DrawnLight;
use crate::fibres::fibre_scene::brightness;
use crate::refusal::Refusal;
use glam::{DVec3, Vec3};
use organza_basis::{CellGrid, Ray};
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, MAX_LANES, Mask, SetBits};
use organza_light::{KernelLight, Light, LightSearch};

/// A light with a place.
pub struct PlacedLight {
    light: Light,
    /// Of a rectangle far from the matter, which lanes draw points of.
    pub panel: Option<Panel>,
    /// Where light from its middle to that of the first period travels.
    pub direction: Vec3,
    /// The brightest that it can make a pixel, roughly.
    pub brightness: f32,
    /// Edges of a voxel, mm, and the corner of the first period in the world, mm.
    voxel_mm: Vec3,
    min_mm: Vec3,
}

/// Directions toward a light, and what of it arrives across them.
pub struct Toward<F: Floats> {
    /// Unit.
    pub toward: V3<F>,
    /// To the light, mm.
    pub distance_mm: F,
    /// Radiance over density; zero where nothing of the light is seen.
    pub irradiance: V3<F>,
    /// Where something is.
    pub seen: F::Mask,
}

impl PlacedLight {
    /// A light in a box.
    ///
    /// # Errors
    /// One that rays meet within the matter, or that only walks look for.
    pub fn new(
        light: &Light,
        [low, high]: [Vec3; 2],
        cell_grid: &CellGrid,
    ) -> Result<PlacedLight, Refusal> {
        let kind = light.for_kernel();
        let matter = cell_grid.reach_mm();
        let apart_mm = (low - matter.max).max(matter.min - high).max_element();
        let has_area = !matches!(kind, KernelLight::Spot(_));
        if has_area && apart_mm <= 0.0 {
            return Err(Refusal::LightInMatter);
        }
        if light.search() == LightSearch::Walk {
            return Err(Refusal::LightOfWalks);
        }
        let panel = match kind {
            KernelLight::Panel(rectangle) => Panel::new(rectangle, apart_mm, cell_grid),
            _ => None,
        };
        let brightness = match &panel {
            Some(panel) => panel.brightness(),
            None => brightness(light),
        };
        let middle_mm = cell_grid.bounds_mm().centre();
        Ok(PlacedLight {
            light: light.clone(),
            panel,
            direction: (middle_mm - 0.5 * (low + high)).normalize_or(Vec3::NEG_Z),
            brightness,
            voxel_mm: cell_grid.voxel_mm(),
            min_mm: cell_grid.bounds_mm().min,
        })
    }

    /// Draws directions from places in voxels, for the lanes of a mask.
    #[inline(always)]
    pub fn toward<F: Floats>(
        &self,
        at: V3<F>,
        beyond: [F; 2],
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> Toward<F> {
        match &self.panel {
            Some(panel) => {
                let [u, v, _] = rng.units(mask);
                panel.toward(at, beyond, u, v, mask)
            }
            None => self.drawn(at, beyond, rng, mask),
        }
    }

    /// One direction after the other.
    fn drawn<F: Floats>(
        &self,
        at: V3<F>,
        beyond: [F; 2],
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> Toward<F> {
        let places = stored(V3::new(at.x + beyond[0], at.y + beyond[1], at.z));
        let from_mm = |lane: usize| {
            let place = Vec3::from_array(places.map(|x| x[lane]));
            place * self.voxel_mm + self.min_mm
        };
        let drawn = DrawnLight::<F>::new(&self.light, from_mm, rng, mask);
        let mut distance_mm = [0.0; MAX_LANES];
        let ways = stored(drawn.toward);
        let mut seen = 0;
        for lane in SetBits(drawn.seen.bits()) {
            let ray = Ray::new(from_mm(lane), Vec3::from_array(ways.map(|x| x[lane])));
            if let Some(reach) = self.light.distance_along(&ray) {
                distance_mm[lane] = reach as f32;
                seen |= 1 << lane;
            }
        }
        let seen = F::Mask::from_bits(seen);
        Toward {
            toward: drawn.toward,
            distance_mm: F::load(&distance_mm),
            irradiance: drawn.irradiance.or_where_not(seen, V3::splat(Vec3::ZERO)),
            seen,
        }
    }

    /// What a ray from the camera sees of it before the matter, or behind; from
    /// a place in voxels, so many mm from the camera.
    pub fn in_sight(
        &self,
        cell_grid: &CellGrid,
        at: Vec3,
        direction: Vec3,
        depth_mm: f32,
        behind: bool,
    ) -> Vec3 {
        let (at, direction_f64) = (at * self.voxel_mm + self.min_mm, direction.as_dvec3());
        let origin: DVec3 = at.as_dvec3() - f64::from(depth_mm) * direction_f64;
        let matter_mm = cell_grid.distance_mm(origin, direction_f64);
        match self.light.distance_mm(origin, direction_f64) {
            Some(t) if (t > matter_mm) == behind => self.light.radiance_toward(direction).0,
            _ => Vec3::ZERO,
        }
    }
}
