//! Distributions of normals about fibres, and families of flakes that are no more than one of
//! them: mirrors and diffuse flakes.

use super::band::{BandFlakes, BandProfile};
use super::{DiffuseFlake, FlakePopulation, FlakeScattering, LaneEvent, MicroFlake};
use crate::AxialFlake;
use glam::Vec3;
use organza_basis::{PathRng, Rgb};

/// How the normals of flakes lie about fibres, for every end-on ratio.
pub(super) trait Distribution: Send + Sync {
    /// The flakes of a population.
    type Flakes: MicroFlake;

    /// Whether they are [`AxialFlake`]s.
    const IS_SGGX: bool = false;

    /// Those about a unit axis, at any scale.
    fn flakes(&self, axis: Vec3, end_on: f32) -> Self::Flakes;

    /// See [`FlakeScattering::area`].
    fn area(&self, axis: Vec3, end_on: f32, w: Vec3) -> f32;
}

/// As the normals of an ellipsoid.
pub(super) struct Ellipsoids;

impl Distribution for Ellipsoids {
    type Flakes = AxialFlake;

    const IS_SGGX: bool = true;

    fn flakes(&self, axis: Vec3, end_on: f32) -> AxialFlake {
        AxialFlake::new(axis, end_on)
    }

    fn area(&self, axis: Vec3, end_on: f32, w: Vec3) -> f32 {
        AxialFlake::new(axis, end_on).projected_area(w).min(1.0)
    }
}

/// With a band profile.
pub(super) struct Bands<P> {
    /// Profiles of end-on ratios whose roots are in even steps from zero to one, and one over
    /// the areas that they show across the axis.
    rows: Vec<(P, f32)>,
}

/// Steps of the root of the end-on ratio e: e is then off by less than `sqrt(e) / 1000`, as
/// much as by the eight bits of a voxel's spread.
const STEPS: usize = 1024;

impl<P: BandProfile> Bands<P> {
    pub(super) fn new() -> Bands<P> {
        let row = |i| {
            let root = i as f32 / STEPS as f32;
            let profile = P::with_end_on_ratio(root * root);
            let per_broadside = 1.0 / profile.projected_area(1.0);
            (profile, per_broadside)
        };
        Bands {
            rows: (0..=STEPS).map(row).collect(),
        }
    }

    /// Rows are taken whole, not mixed, so that sampler and density stay those of one profile.
    fn row(&self, end_on: f32) -> &(P, f32) {
        &self.rows[((end_on.sqrt() * STEPS as f32 + 0.5) as usize).min(STEPS)]
    }
}

impl<P: BandProfile + Copy + Send + Sync> Distribution for Bands<P> {
    type Flakes = BandFlakes<P>;

    fn flakes(&self, axis: Vec3, end_on: f32) -> BandFlakes<P> {
        BandFlakes::new(axis, self.row(end_on).0)
    }

    fn area(&self, axis: Vec3, end_on: f32, w: Vec3) -> f32 {
        let (profile, per_broadside) = self.row(end_on);
        let sine = axis.cross(w).length().min(1.0);
        // The bound holds but for the thousandth of the profile's table.
        (per_broadside * profile.projected_area(sine)).min(1.0)
    }
}

/// Mirrors.
pub(super) struct Mirrors<D>(pub D);

impl<D: Distribution> FlakeScattering for Mirrors<D> {
    fn area(&self, flakes: &FlakePopulation, w: Vec3) -> f32 {
        self.0.area(flakes.axis, flakes.end_on, w)
    }

    fn lane_event(&self) -> LaneEvent {
        if D::IS_SGGX {
            LaneEvent::SggxMirrors
        } else {
            LaneEvent::OneByOne
        }
    }

    fn eval(&self, flakes: &FlakePopulation, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        let own = self.0.flakes(flakes.axis, flakes.end_on);
        let phase = own.eval(w_out, w_in);
        (flakes.albedo * phase, phase)
    }

    fn sample(&self, flakes: &FlakePopulation, w_out: Vec3, rng: &mut PathRng) -> Option<Vec3> {
        let own = self.0.flakes(flakes.axis, flakes.end_on);
        Some(own.sample(w_out, rng))
    }
}

/// Diffuse flakes.
pub(super) struct Diffuse<D>(pub D);

impl<D: Distribution> FlakeScattering for Diffuse<D> {
    fn area(&self, flakes: &FlakePopulation, w: Vec3) -> f32 {
        self.0.area(flakes.axis, flakes.end_on, w)
    }

    fn lane_event(&self) -> LaneEvent {
        if D::IS_SGGX {
            LaneEvent::SggxDiffuse
        } else {
            LaneEvent::OneByOne
        }
    }

    fn draws_flakes(&self) -> bool {
        true
    }

    fn draw_flake(
        &self,
        flakes: &FlakePopulation,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<DiffuseFlake> {
        let own = self.0.flakes(flakes.axis, flakes.end_on);
        Some(DiffuseFlake::meet(&own, flakes.albedo, w_out, rng))
    }
}
