//! Populations under construction, and the rule that merges them.

use glam::{DMat3, DVec3, Vec3};
use organza_basis::Sym3;

/// Fibre gathered in one voxel: sums over clipped pieces of curve.
///
/// All sums are additive, so merging populations loses nothing but the separation of their two
/// tensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GatheredPopulation {
    /// From the top: voxel in its block (15 bits), yarn (32), material (16), lobe (1). Sorting
    /// by this key sorts by voxel first.
    pub key: u64,
    /// Sum of lengths, mm. In double precision, because ten thousand equal pieces round in the
    /// same direction. Once rounded to whole quanta (a power of two), sums are exact.
    pub length_mm: f64,
    /// Sum of length times radius, mm^2.
    pub radius_length_mm2: f32,
    /// Sum of length times `t t^T`, mm.
    pub moment_mm: Sym3,
}

impl GatheredPopulation {
    /// A straight piece along the unit vector `tangent`.
    #[cfg(test)]
    pub fn new(key: u64, length_mm: f64, radius_mm: f32, tangent: Vec3) -> GatheredPopulation {
        let piece = GatheredPopulation::of_line(length_mm, radius_mm, Sym3::outer(tangent));
        GatheredPopulation { key, ..piece }
    }

    /// A straight piece, with `tensor` equal to `t t^T` of its unit tangent; it has no key yet.
    #[inline]
    pub fn of_line(length_mm: f64, radius_mm: f32, tensor: Sym3) -> GatheredPopulation {
        GatheredPopulation {
            key: 0,
            length_mm,
            radius_length_mm2: length_mm as f32 * radius_mm,
            moment_mm: tensor.scaled(length_mm as f32),
        }
    }

    /// The key of the first population of a group (yarn in the upper 32 of 48
    /// bits, material below).
    #[inline]
    pub fn key_of(voxel: u32, group: u64) -> u64 {
        u64::from(voxel) << 49 | group << 1
    }

    /// Number of the voxel in its block.
    #[inline]
    pub fn voxel(&self) -> u32 {
        (self.key >> 49) as u32
    }

    /// Bit number of the voxel in its brick.
    #[inline]
    pub fn bit(&self) -> u32 {
        self.voxel() & 63
    }

    /// The same population in another voxel of the block.
    #[inline]
    pub fn moved_to(&self, voxel: u32) -> GatheredPopulation {
        GatheredPopulation {
            key: u64::from(voxel) << 49 | (self.key << 15 >> 15),
            ..*self
        }
    }

    /// Yarn and material together.
    #[inline]
    pub fn group(&self) -> u64 {
        self.key << 15 >> 16
    }

    /// Adds the sums of another population and keeps the key.
    pub fn add(&mut self, o: &GatheredPopulation) {
        self.length_mm += o.length_mm;
        self.radius_length_mm2 += o.radius_length_mm2;
        self.moment_mm = self.moment_mm.plus(o.moment_mm);
    }

    /// Mean squared cosine between the tangents of the two, times both lengths.
    pub fn likeness(&self, o: &GatheredPopulation) -> f32 {
        contract(self.moment_mm, o.moment_mm)
    }

    /// True when the tangents of the two are less than 30 degrees apart in the
    /// mean square.
    pub fn is_like(&self, o: &GatheredPopulation) -> bool {
        f64::from(self.likeness(o)) >= 0.75 * self.length_mm * o.length_mm
    }

    /// Mean radius.
    pub fn radius_mm(&self) -> f32 {
        (f64::from(self.radius_length_mm2) / self.length_mm) as f32
    }

    /// Mean axis and the mean squared sine of the angle to it: the eigenvector of the tensor's
    /// greatest eigenvalue, and the trace less that eigenvalue.
    ///
    /// Squares the tensor until one eigenvector is left, which takes few steps for bundles;
    /// where it takes many, again in double precision. Two eigenvalues that differ by less than
    /// a part in 10^4 count as equal; then either axis is right.
    pub fn axis_and_sin_sq(&self) -> (Vec3, f32) {
        let trace = self.moment_mm.trace().max(f32::MIN_POSITIVE);
        let tensor = self.moment_mm.scaled(1.0 / trace);
        let mut power = tensor;
        for _ in 0..6 {
            let purity = contract(power, power);
            // The sum of squared eigenvalues, whose own sum is one.
            if purity > 1.0 - 1e-4 {
                // Any column is an eigenvector; the longest is the most accurate.
                let (d, o) = (power.diagonal, power.off_diagonal);
                let column = match d.max_position() {
                    0 => Vec3::new(d.x, o.x, o.y),
                    1 => Vec3::new(o.x, d.y, o.z),
                    _ => Vec3::new(o.y, o.z, d.z),
                };
                let axis = column.normalize_or(Vec3::Z);
                return (axis, (1.0 - tensor.quadratic(axis)).max(0.0));
            }
            power = square(power).scaled(1.0 / purity);
        }
        let (d, o) = (tensor.diagonal.as_dvec3(), tensor.off_diagonal.as_dvec3());
        let unit = 1.0 / (d.x + d.y + d.z).max(f64::MIN_POSITIVE);
        let m = DMat3::from_cols_array(&[d.x, o.x, o.y, o.x, d.y, o.z, o.y, o.z, d.z]) * unit;
        let mut power = m;
        for _ in 0..17 {
            let square = power * power;
            let trace = square.x_axis.x + square.y_axis.y + square.z_axis.z;
            power = square * (1.0 / trace);
            if trace > 1.0 - 1e-12 {
                break;
            }
        }
        let columns = [power.x_axis, power.y_axis, power.z_axis];
        let longest = columns.into_iter().fold(DVec3::ZERO, |a, b| {
            if b.length_squared() > a.length_squared() {
                b
            } else {
                a
            }
        });
        let axis = longest.normalize_or(DVec3::Z);
        let sin_sq = 1.0 - axis.dot(m * axis);
        (axis.as_vec3(), sin_sq.max(0.0) as f32)
    }

    /// Scales the length, and all other sums in proportion.
    pub fn rescale(&mut self, length_mm: f64) {
        let k = (length_mm / self.length_mm) as f32;
        self.length_mm = length_mm;
        self.radius_length_mm2 *= k;
        self.moment_mm = self.moment_mm.scaled(k);
    }

    /// The weight of the population in a comparison: its extinction, or its length where no
    /// radius is given.
    fn weight(&self) -> f32 {
        self.radius_length_mm2 + 1e-9 * self.length_mm as f32
    }
}

/// The matrix times itself; its trace is `contract(a, a)`.
#[inline]
fn square(a: Sym3) -> Sym3 {
    let (d, o) = (a.diagonal, a.off_diagonal);
    let (xy, xz, yz) = (o.x * o.x, o.y * o.y, o.z * o.z);
    Sym3 {
        diagonal: d * d + Vec3::new(xy + xz, xy + yz, xz + yz),
        off_diagonal: Vec3::new(
            o.x * (d.x + d.y) + o.y * o.z,
            o.y * (d.x + d.z) + o.x * o.z,
            o.z * (d.y + d.z) + o.x * o.y,
        ),
    }
}

#[inline]
fn contract(a: Sym3, b: Sym3) -> f32 {
    a.diagonal.dot(b.diagonal) + 2.0 * a.off_diagonal.dot(b.off_diagonal)
}

/// Which populations may be merged although the limit does not require it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeepApart {
    /// Only populations of one yarn and material.
    Yarns,
    /// Only populations of one material.
    Materials,
}

/// Working memory for comparing the populations of a voxel.
#[derive(Default)]
pub struct Merger(Vec<Candidate>);

impl Merger {
    /// Merges populations of one voxel until at most `limit` are left and no
    /// allowed merger is cheaper than `tolerance`.
    ///
    /// Ward's criterion on the tensors: the pair that is merged is the one that adds least to
    /// the extinction-weighted variance of `t t^T` about the means of the populations, `w_a w_b
    /// / (w_a + w_b) |T_a - T_b|^2`; in units of the total weight, so that two equal halves at
    /// right angles cost 1/2 and at an angle alpha `sin^2(alpha) / 2`. Pairs that should stay
    /// separate are merged last. The merged population keeps the key of the heavier one.
    pub fn merge_to(
        &mut self,
        populations: &mut Vec<GatheredPopulation>,
        limit: usize,
        tolerance: f32,
        apart: KeepApart,
    ) {
        let total: f32 = populations.iter().map(GatheredPopulation::weight).sum();
        let candidates = &mut self.0;
        candidates.clear();
        // Most neighbours are nearly parallel. Merging those first, at a sixteenth of the
        // tolerance, leaves few pairs to compare.
        for l in populations.iter() {
            let new = Candidate::new(*l);
            let near = |c: &&mut Candidate| {
                !c.should_part(&new, apart) && c.cost(&new) <= 0.0625 * tolerance * total
            };
            match candidates.iter_mut().find(near) {
                Some(c) => c.merge(&new),
                None => candidates.push(new),
            }
        }
        while candidates.len() > 1 {
            let must = candidates.len() > limit;
            let mut best = (f32::INFINITY, 0, 0);
            for (j, b) in candidates.iter().enumerate() {
                for (i, a) in candidates[..j].iter().enumerate() {
                    let mut cost = a.cost(b);
                    if a.should_part(b, apart) {
                        // More than any pair of one kind can cost.
                        cost += if must { 2.0 * total } else { f32::INFINITY };
                    }
                    if cost < best.0 {
                        best = (cost, i, j);
                    }
                }
            }
            let (cost, i, j) = best;
            if j == 0 || (!must && cost > tolerance * total) {
                break;
            }
            let other = candidates.remove(j);
            candidates[i].merge(&other);
        }
        populations.clear();
        populations.extend(candidates.iter().map(|c| c.population));
    }
}

/// A population with the values that its comparisons need.
struct Candidate {
    population: GatheredPopulation,
    weight: f32,
    /// Mean of `t t^T`, and its square.
    tensor: Sym3,
    square: f32,
}

impl Candidate {
    fn new(population: GatheredPopulation) -> Candidate {
        let tensor = population
            .moment_mm
            .scaled(1.0 / population.length_mm as f32);
        Candidate {
            population,
            weight: population.weight(),
            tensor,
            square: contract(tensor, tensor),
        }
    }

    fn cost(&self, o: &Candidate) -> f32 {
        let distance_sq = self.square + o.square - 2.0 * contract(self.tensor, o.tensor);
        self.weight * o.weight / (self.weight + o.weight) * distance_sq.max(0.0)
    }

    fn should_part(&self, o: &Candidate, apart: KeepApart) -> bool {
        let (a, b) = (self.population.group(), o.population.group());
        match apart {
            KeepApart::Yarns => a != b,
            KeepApart::Materials => a as u16 != b as u16,
        }
    }

    fn merge(&mut self, o: &Candidate) {
        let mut population = self.population;
        if o.weight > self.weight {
            population.key = o.population.key;
        }
        population.add(&o.population);
        *self = Candidate::new(population);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{PathRng, warp};

    fn population(angle_deg: f32, length: f64, yarn: u64) -> GatheredPopulation {
        let (s, c) = angle_deg.to_radians().sin_cos();
        GatheredPopulation::new(
            GatheredPopulation::key_of(0, yarn << 16),
            length,
            0.01,
            Vec3::new(c, s, 0.0),
        )
    }

    #[test]
    fn axes_agree_with_the_eigenvectors() {
        let mut rng = PathRng::from_seed(6);
        for _ in 0..2000 {
            let mut l = GatheredPopulation::new(0, 1.0, 1.0, warp::uniform_sphere(rng.unit2()));
            for _ in 0..rng.below(4) {
                l.add(&GatheredPopulation::new(
                    0,
                    rng.unit().into(),
                    1.0,
                    warp::uniform_sphere(rng.unit2()),
                ));
            }
            let (axis, sin_sq) = l.axis_and_sin_sq();
            let tensor = l.moment_mm.scaled(1.0 / l.length_mm as f32);
            let [(along, want), (next, _), _] = tensor.eigen();
            assert!((1.0 - sin_sq - along).abs() < 1e-6, "seed 6");
            if along - next > 1e-3 {
                assert!(axis.cross(want).length() < 1e-4, "seed 6");
            }
        }
    }

    #[test]
    fn axes_are_alike_below_thirty_degrees_whatever_the_lengths() {
        for (a, b) in [(1.0, 1.0), (2.0, 3.0), (0.2, 0.3), (5.0, 0.1)] {
            for angle in [0.0, 29.0, 31.0, 90.0] {
                let like = population(0.0, a, 0).is_like(&population(angle, b, 0));
                assert_eq!(like, angle < 30.0, "{a} mm, {b} mm, {angle} degrees");
            }
        }
    }

    #[test]
    fn near_axes_merge_and_far_ones_do_not() {
        let mut l = vec![
            population(0.0, 1.0, 0),
            population(90.0, 1.0, 0),
            population(4.0, 2.0, 0),
            population(86.0, 0.5, 0),
        ];
        Merger::default().merge_to(&mut l, 4, 0.02, KeepApart::Materials);
        assert_eq!(l.len(), 2);
        let lengths: Vec<f64> = l.iter().map(|x| x.length_mm).collect();
        assert_eq!(lengths, [3.0, 1.5]);
    }

    #[test]
    fn yarns_merge_only_when_there_is_no_room() {
        let mut l: Vec<GatheredPopulation> = (0..6)
            .map(|k| population(k as f32, 1.0, k as u64))
            .collect();
        Merger::default().merge_to(&mut l, 4, 1.0, KeepApart::Yarns);
        assert_eq!(l.len(), 4);
        let total: f64 = l.iter().map(|x| x.length_mm).sum();
        assert_eq!(total, 6.0);
    }
}
