//! Virtual fibres, which are met at a point, in the far field: one in every lane.
//!
//! Of the population there, a tangent is drawn as it is seen, and of that fibre's
//! [tables](super::fibre_tables) what light needs. See
//! [`organza_scatter::meet_fibre`] and [`organza_scatter::FarField`], which this
//! is in lanes.

use super::event::{Event, Meeting, Turn};
use super::fibre_tables::{CHANCES, FibreTables, HEAD, ROW_HEAD, area_squared, colour, scale_of};
use super::flat_scene::FlatScene;
use super::seen_tangent::{SeenTangent, SpreadFibres};
use super::voxel_words::VoxelWords;
use glam::Vec3;
use organza_lanes::math::{LaneRng, V3, exp2, minus_ln, positive, sin_cos_of_turns, turns_of};
use organza_lanes::{Floats, Ints, Mask};
use organza_scatter::{FAR_LOBES, FAR_ROWS, InclinationPair};
use std::f32::consts::{LOG2_E, TAU};

/// A fibre in every lane, and where in its tables to look.
pub struct VirtualFibres<F: Floats> {
    pub tangent: V3<F>,
    /// How much more of it is seen than it was drawn for.
    pub weight: F,
    /// Across the tangent: along the way, and beside it.
    forward: V3<F>,
    side: V3<F>,
    /// Of the inclination of the way.
    sin_out: F,
    pub cos_out: F,
    /// The scale c there.
    scale_out: V3<F>,
    head: Head<F>,
    /// Which nodes light from lights is looked up at: of the mean inclination, the
    /// azimuth and the scale.
    pub chances: [F; 3],
}

impl<F: Floats> Event<F> for VirtualFibres<F> {
    #[inline(always)]
    fn area_squared(_: &FlatScene, voxel: VoxelWords<F::Ints>, along: F, across: F) -> F {
        area_squared(along, across, voxel.end_on())
    }

    #[inline(always)]
    fn new(scene: &FlatScene, met: &Meeting<F>, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Self {
        let number = scene.medium.substance_at(met.place);
        Self::meet(&scene.fibres, number, met, rng, mask)
    }

    #[inline(always)]
    fn common(&self) -> V3<F> {
        self.scale_out.scaled(self.weight)
    }

    #[inline(always)]
    fn toward(&self, scene: &FlatScene, w_in: V3<F>) -> (F, V3<F>) {
        let value = self.value(&scene.fibres, w_in);
        (value.sum() * F::splat(1.0 / 3.0), value)
    }

    #[inline(always)]
    fn turn(&self, scene: &FlatScene, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Turn<F> {
        self.sample(&scene.fibres, rng, mask)
    }
}

/// Where the tables of a fibre are.
struct Head<F: Floats> {
    /// First word of the first row, words of a row, and azimuths in it.
    rows: F::Ints,
    stride: F::Ints,
    azimuths: F::Ints,
    /// One over the deviations of the lobes, 1/rad.
    inverse_blurs: [F; FAR_LOBES],
    /// First word of the scale, and its nodes less one.
    scale: F::Ints,
    scale_steps: F,
}

impl<F: Floats> Head<F> {
    #[inline(always)]
    fn new(tables: &FibreTables, number: F::Ints) -> Head<F> {
        let (words, step) = (&tables.words[..], F::Ints::splat(1));
        let rows = number * F::Ints::splat(HEAD);
        let stride = rows + step;
        let azimuths = stride + step;
        let first = azimuths + step;
        let (second, third) = (first + step, first + step + step);
        let scale = third + step;
        let nodes = (scale + step).gather(words).to_floats();
        Head {
            rows: rows.gather(words),
            stride: stride.gather(words),
            azimuths: azimuths.gather(words),
            inverse_blurs: [
                first.gather(words).as_floats(),
                second.gather(words).as_floats(),
                third.gather(words).as_floats(),
            ],
            scale: scale.gather(words),
            scale_steps: nodes - F::splat(1.0),
        }
    }
}

impl<F: Floats> VirtualFibres<F> {
    /// Draws the tangents of the fibres with these numbers, as their populations
    /// show them.
    #[inline(always)]
    pub fn meet(
        tables: &FibreTables,
        number: F::Ints,
        met: &Meeting<F>,
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> Self {
        let one = F::splat(1.0);
        let head = Head::new(tables, number);

        let axis = met.voxel.axis();
        let population = SpreadFibres {
            axis: axis.scaled(one / axis.dot(axis).sqrt()),
            end_on: met.voxel.end_on(),
            end_on_code: met.voxel.end_on_code(),
        };
        let w = met.w_out;
        let seen = population.seen_from(&tables.spreads, &tables.shown, w, rng, mask);
        let SeenTangent {
            tangent,
            cos_out,
            weight,
            u: u_scale,
        } = seen;
        let side = w.cross(tangent);
        let side = side.scaled(one / side.dot(side).max(F::splat(1e-20)).sqrt());
        let mut fibres = VirtualFibres {
            tangent,
            forward: side.cross(tangent),
            side,
            sin_out: tangent.dot(w).max(-one).min(one),
            cos_out,
            weight,
            scale_out: V3::splat(Vec3::ZERO),
            head,
            chances: rng.units(mask),
        };
        fibres.scale_out = fibres.scale_at(tables, cos_out, u_scale);
        fibres
    }

    /// The scale c at an inclination, at one of two nodes by chance.
    #[inline(always)]
    fn scale_at(&self, tables: &FibreTables, cos: F, chance: F) -> V3<F> {
        let node = cos
            .mul_add(self.head.scale_steps, chance)
            .min(self.head.scale_steps);
        let node = node.to_ints();
        let first = self.head.scale + node + node;
        let second = first + F::Ints::splat(1);
        scale_of([first.gather(&tables.words), second.gather(&tables.words)])
    }

    /// First word of the row of an inclination, one of two by chance.
    #[inline(always)]
    fn row(&self, cos: F, chance: F) -> F::Ints {
        let steps = F::splat((FAR_ROWS - 1) as f32);
        self.head.rows + self.head.stride * cos.mul_add(steps, chance).min(steps).to_ints()
    }

    /// The far field toward `w_in` over [`Event::common`].
    #[inline(always)]
    pub fn value(&self, tables: &FibreTables, w_in: V3<F>) -> V3<F> {
        let word = F::Ints::splat;
        let (x, y) = (w_in.dot(self.forward), w_in.dot(self.side));
        let (sin, cos) = (w_in.dot(self.tangent), x.mul_add(x, y * y).sqrt());
        let pair = InclinationPair::new([sin, cos], [self.sin_out, self.cos_out]);
        let [of_row, of_azimuth, of_scale] = self.chances;
        let steps = self.head.azimuths.to_floats() - F::splat(1.0);
        let half_turns = turns_of(y, x).abs() * F::splat(2.0);
        let node = half_turns.mul_add(steps, of_azimuth).min(steps).to_ints();
        let first = self.row(pair.mean_cos, of_row) + word(ROW_HEAD) + node;
        let kernels = self.kernels(&pair);
        let mut value = V3::splat(Vec3::ZERO);
        let mut at = first;
        for &kernel in &kernels {
            value = colour(at.gather(&tables.words)).scaled_add(kernel, value);
            at = at + self.head.azimuths;
        }
        let scale = self.scale_at(tables, cos, of_scale);
        value.times(scale).scaled(cos)
    }

    /// Densities of the inclination in each lobe, 1/rad.
    #[inline(always)]
    fn kernels(&self, pair: &InclinationPair<F>) -> [F; FAR_LOBES] {
        let [sin_sum, cos_sum] = pair.sum;
        let sum = turns_of(sin_sum, cos_sum) * F::splat(TAU);
        let [a, b, c] = self.head.inverse_blurs;
        let near = [gaussian(sum, a), gaussian(sum, b), gaussian(sum, c)];
        // Folds matter where some lobe reaches the end within five deviations.
        let widest = a.min(b).min(c);
        let [sin_folded, cos_folded] = pair.folded;
        let folded = turns_of(sin_folded, cos_folded) * F::splat(TAU);
        let folds = (folded * widest).below(F::splat(5.0));
        if !folds.any() {
            return near;
        }
        [
            (near[0] + gaussian(folded, a)).or_where_not(folds, near[0]),
            (near[1] + gaussian(folded, b)).or_where_not(folds, near[1]),
            (near[2] + gaussian(folded, c)).or_where_not(folds, near[2]),
        ]
    }

    /// Draws a direction; the weight is over [`Event::common`].
    #[inline(always)]
    pub fn sample(
        &self,
        tables: &FibreTables,
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> Turn<F> {
        let (word, one) = (F::Ints::splat, F::splat(1.0));
        let [of_chances, u_lobe, of_scale] = rng.units(mask);
        let [u_normal, v_normal, of_row] = rng.units(mask);
        let [u_node, u_tent, v_tent] = rng.units(mask);
        let [u_sign, u, _] = rng.units(mask);

        // The lobe, at the inclination of the way, kept from the end by the blur.
        let [r, tt, rest] = self.head.inverse_blurs;
        let blur = F::splat(0.5) / r;
        let blurred = blur.mul_add(blur, self.cos_out * self.cos_out);
        let drawing = blurred.min(one).sqrt();
        let chances = self.row(drawing, of_chances).gather(&tables.words);
        let first = (chances & word(0xffff)).to_floats();
        let two = chances.shr::<16>().to_floats();
        let x = u_lobe * F::splat(CHANCES);
        let (is_first, is_two) = (x.below(first), x.below(two));
        let lobe = word(0).or_where_not(is_first, word(1).or_where_not(is_two, word(2)));
        let after = (two - first).or_where_not(is_two, F::splat(CHANCES) - two);
        let chance = first.or_where_not(is_first, after);
        let inverse = r.or_where_not(is_first, tt.or_where_not(is_two, rest));

        // The inclination.
        let half_square = minus_ln(positive(u_normal));
        let (_, v_cos) = sin_cos_of_turns(v_normal);
        let normal = (half_square + half_square).sqrt() * v_cos;
        let (sin, cos) = sin_cos_of_turns(normal * F::splat(1.0 / TAU) / inverse);
        let sin_in = sin * self.cos_out - cos * self.sin_out;
        let cos_in = cos.mul_add(self.cos_out, sin * self.sin_out).abs();
        let pair = InclinationPair::new([sin_in, cos_in], [self.sin_out, self.cos_out]);

        // The azimuth: a node, then a place in its tent.
        let row = self.row(pair.mean_cos, of_row);
        let total = (row + word(1) + lobe).gather(&tables.words).as_floats();
        let colours = row + word(ROW_HEAD) + self.head.azimuths * lobe;
        let aliases = colours + self.head.azimuths * word(FAR_LOBES as u32);
        let azimuths = self.head.azimuths.to_floats();
        let u_node = u_node * azimuths;
        let slot = u_node.min(azimuths - one).to_ints();
        let alias = (aliases + slot).gather(&tables.words);
        let coin = (u_node - u_node.floor()) * F::splat(65_535.0);
        let own = coin.below(alias.shr::<16>().to_floats());
        let node = slot.or_where_not(own, alias & word(0xffff));
        let colour = colour((colours + node).gather(&tables.words));
        let place = node.to_floats() + (u_tent + v_tent - one);
        let (sin_azimuth, cos_azimuth) = sin_cos_of_turns(place * F::splat(0.5) / (azimuths - one));
        let left = u_sign.below(F::splat(0.5));
        let sin_azimuth = sin_azimuth.or_where_not(left, -sin_azimuth);

        let per_chance = total * F::splat(CHANCES) * cos_in * cos_in;
        let drawn = (colour.sum() * chance).max(F::splat(f32::MIN_POSITIVE));
        let scale = self.scale_at(tables, cos_in, of_scale);
        let across = self.forward.scaled(cos_azimuth * cos_in);
        let across = self.side.scaled_add(sin_azimuth * cos_in, across);
        let direction = self.tangent.scaled_add(sin_in, across);
        // One step toward unit length, against rounding along a path.
        let length = direction.dot(direction);
        Turn {
            direction: direction.scaled(length.mul_add(F::splat(-0.5), F::splat(1.5))),
            weight: colour.times(scale).scaled(per_chance / drawn),
            u,
        }
    }
}

/// Gaussian density of an angle for one over its deviation; never so small that
/// products of it are denormal numbers, which cost a hundred operations.
#[inline(always)]
fn gaussian<F: Floats>(angle: F, inverse: F) -> F {
    let deviations = angle * inverse;
    let exponent = deviations * deviations * F::splat(-0.5 * LOG2_E);
    exp2(exponent.max(F::splat(-48.0))) * inverse * F::splat(0.398_942_3)
}
