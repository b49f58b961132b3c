//! Micro-flakes about the fibres of a voxel, one population in every lane.

use super::event::{Event, Meeting, Turn};
use super::flat_scene::FlatScene;
use super::voxel_words::VoxelWords;
use glam::Vec3;
use organza_lanes::math::{LaneRng, V3, sin_cos_of_turns};
use organza_lanes::{Floats, Ints, Mask};
use std::f32::consts::FRAC_1_PI;

/// A flake population in every lane.
#[derive(Clone, Copy)]
pub struct Flakes<F: Floats> {
    scaled_axis: V3<F>,
    end_on: F,
}

/// A flake population that reflects what came along `-w_out`.
pub struct Mirrors<F: Floats> {
    flakes: Flakes<F>,
    w_out: V3<F>,
    per_area: F,
    albedo: V3<F>,
}

impl<F: Floats> Event<F> for Mirrors<F> {
    #[inline(always)]
    fn area_squared(along: F, across: F, end_on: F) -> F {
        (end_on * end_on).mul_add(along, across)
    }

    #[inline(always)]
    fn new(
        scene: &FlatScene,
        met: &Meeting<F>,
        _rng: &mut LaneRng<F::Ints>,
        _mask: <F::Ints as Ints>::Mask,
    ) -> Self {
        let flakes = Flakes::of(met.voxel);
        Mirrors {
            flakes,
            w_out: met.w_out,
            per_area: F::splat(1.0) / flakes.area(met.w_out),
            albedo: albedo(scene, met.place),
        }
    }

    #[inline(always)]
    fn common(&self) -> V3<F> {
        self.albedo
    }

    #[inline(always)]
    fn toward(&self, _scene: &FlatScene, w_in: V3<F>) -> (F, V3<F>) {
        let phase = self.flakes.phase(self.w_out, self.per_area, w_in);
        let (x, y, z) = (phase, phase, phase);
        (phase, V3 { x, y, z })
    }

    #[inline(always)]
    fn turn(
        &self,
        _scene: &FlatScene,
        rng: &mut LaneRng<F::Ints>,
        mask: <F::Ints as Ints>::Mask,
    ) -> Turn<F> {
        let [turns, height, u] = rng.units(mask);
        Turn {
            direction: self
                .flakes
                .scatter(self.w_out, self.per_area, turns, height),
            weight: V3::splat(Vec3::ONE),
            u,
        }
    }
}

/// Albedos of the populations at these places.
#[inline(always)]
fn albedo<F: Floats>(scene: &FlatScene, place: F::Ints) -> V3<F> {
    let (medium, word) = (&scene.medium, F::Ints::splat);
    if medium.materials.is_empty() {
        return V3::splat(medium.only_albedo());
    }
    let substances = &medium.substances[..];
    let first = place.gather(&medium.materials).shl::<2>();
    V3 {
        x: first.gather(substances).as_floats(),
        y: (first + word(1)).gather(substances).as_floats(),
        z: (first + word(2)).gather(substances).as_floats(),
    }
}

impl<F: Floats> Flakes<F> {
    /// Those of a voxel.
    #[inline(always)]
    pub fn of(voxel: VoxelWords<F::Ints>) -> Flakes<F> {
        let (axis, end_on) = (voxel.axis(), voxel.end_on());
        let square = (-end_on).mul_add(end_on, F::splat(1.0));
        let length = (square.max(F::splat(0.0)) / axis.dot(axis)).sqrt();
        Flakes {
            scaled_axis: axis.scaled(length),
            end_on,
        }
    }

    /// `sqrt(e^2 + |t' x w|^2)`, exact when looking along the fibre.
    #[inline(always)]
    pub fn area(&self, w: V3<F>) -> F {
        let across = self.scaled_axis.cross(w);
        self.end_on.mul_add(self.end_on, across.dot(across)).sqrt()
    }

    /// S^1/2 v, given one over 1 + e.
    #[inline(always)]
    fn root(&self, v: V3<F>, per_one_and_end_on: F) -> V3<F> {
        let along = self.scaled_axis.dot(v) * per_one_and_end_on;
        self.scaled_axis.scaled_add(-along, v)
    }

    /// Mirror phase function toward `w_in`, given one over the area that
    /// `w_out` sees; see `MicroFlake::eval`. Quadratic forms are times e^2, so
    /// that there is one division.
    #[inline(always)]
    pub fn phase(&self, w_out: V3<F>, per_area: F, w_in: V3<F>) -> F {
        let h = w_out + w_in;
        let squared = h.dot(h);
        let along = self.scaled_axis.dot(h);
        let e2 = self.end_on * self.end_on;
        let q = along.mul_add(along, squared * e2);
        let scale = F::splat(0.25 * FRAC_1_PI) * e2 * self.end_on * per_area;
        let value = scale * squared * squared / (q * q).max(F::splat(f32::MIN_POSITIVE));
        // Half vector undefined: the mean over the circle of possible ones.
        let opposite = squared.below(F::splat(1e-10));
        if opposite.any() {
            let per_square = per_area * per_area;
            let sum = e2.mul_add(per_square, F::splat(1.0)) * per_square;
            let mean = F::splat(0.125 * FRAC_1_PI) * sum;
            return mean.or_where_not(opposite, value);
        }
        value
    }

    /// Draws where a mirror flake sends `w_out`; see `MicroFlake::sample`.
    #[inline(always)]
    pub fn scatter(&self, w_out: V3<F>, per_area: F, turns: F, height: F) -> V3<F> {
        let one = F::splat(1.0);
        let (sin, cos) = sin_cos_of_turns(turns);
        let r = (F::splat(4.0) * height * (one - height)).sqrt();
        let on_sphere = V3 {
            x: r * cos,
            y: r * sin,
            z: height.mul_add(F::splat(-2.0), one),
        };
        let per_one_and_end_on = one / (one + self.end_on);
        let seen = self
            .root(w_out, per_one_and_end_on)
            .scaled_add(per_area, on_sphere);
        let m = self.root(seen, per_one_and_end_on);
        let across = w_out.dot(m) / m.dot(m).max(F::splat(f32::MIN_POSITIVE));
        let w_in = m.scaled(across + across) - w_out;
        // One step toward unit length, against rounding along a path.
        w_in.scaled(w_in.dot(w_in).mul_add(F::splat(-0.5), F::splat(1.5)))
    }
}
