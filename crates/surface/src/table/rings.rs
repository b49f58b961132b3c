//! Directions at which a table holds values: nodes on rings of equal polar angle, and the hat
//! functions between them.
//!
//! A hat is one at its node, falls linearly with the polar angle to the neighbouring rings and
//! linearly with the azimuth to the neighbours on its own ring. The hats of all nodes add up
//! to one in every direction, so a table never gives more light between its nodes than at
//! them.

use glam::Vec3;
use organza_basis::PathRng;
use std::f32::consts::{FRAC_PI_2 as QUARTER, TAU as TURN};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Most rings of a hemisphere.
pub const MAX_RINGS: usize = 64;
/// Most nodes of a ring.
pub const MAX_ON_RING: u32 = 512;
/// Most nodes of a hemisphere.
pub const MAX_NODES: usize = 1024;

/// Rings of nodes over a hemisphere. The nodes of the front come first, then those of the
/// back, which have the same tangential components.
#[derive(Clone, Debug, PartialEq)]
pub struct Rings {
    rings: Vec<Ring>,
    /// Nodes of a hemisphere.
    nodes: usize,
    /// The ring of every node of a hemisphere.
    ring_of: Vec<u8>,
}

#[derive(Clone, Debug, PartialEq)]
struct Ring {
    theta: f32,
    count: u32,
    /// Its first node.
    first: usize,
    /// Integrals over the polar angle of its hat times sine and cosine: inside, outside.
    sides: [f64; 2],
}

/// The nodes whose hats are not zero in a direction, and their values there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hats {
    /// Nodes.
    pub nodes: [u32; 4],
    /// Values; their sum is one.
    pub values: [f32; 4],
}

impl Rings {
    /// Rings at polar angles, radians, with so many nodes each. `None` unless the angles rise
    /// from 0 to a quarter turn, the first ring has one node and the others an even number
    /// from 4 to [`MAX_ON_RING`].
    pub fn new(rings: &[(f32, u32)]) -> Option<Rings> {
        let (first, last) = (rings.first()?, rings.last()?);
        let rises = rings.windows(2).all(|w| w[0].0 + 1e-4 < w[1].0);
        let counts = rings[1..]
            .iter()
            .all(|r| (4..=MAX_ON_RING).contains(&r.1) && r.1.is_multiple_of(2));
        let ends = first.0 == 0.0 && first.1 == 1 && (last.0 - QUARTER).abs() < 1e-6;
        if !(rises && counts && ends && (2..=MAX_RINGS).contains(&rings.len())) {
            return None;
        }
        let mut nodes = 0;
        let mut ring_of = Vec::new();
        let mut made = Vec::with_capacity(rings.len());
        for (index, &(theta, count)) in rings.iter().enumerate() {
            let at = |k: usize| rings.get(k).map_or(FRAC_PI_2, |r| f64::from(r.0));
            let inside = match index {
                0 => 0.0,
                _ => rising(at(index - 1), at(index)),
            };
            let outside = match index + 1 == rings.len() {
                true => 0.0,
                false => falling(at(index), at(index + 1)),
            };
            made.push(Ring {
                theta: if index + 1 == rings.len() {
                    QUARTER
                } else {
                    theta
                },
                count,
                first: nodes,
                sides: [inside, outside],
            });
            nodes += count as usize;
            ring_of.extend((0..count).map(|_| index as u8));
        }
        (nodes <= MAX_NODES).then_some(Rings {
            rings: made,
            nodes,
            ring_of,
        })
    }

    /// The rings of tables that `organza` makes: finer toward grazing directions.
    pub fn usual() -> Rings {
        let degrees: [(f32, u32); 13] = [
            (0.0, 1),
            (9.0, 8),
            (18.0, 16),
            (27.0, 22),
            (36.0, 28),
            (45.0, 34),
            (54.0, 38),
            (63.0, 42),
            (71.0, 44),
            (78.0, 44),
            (83.5, 40),
            (87.5, 32),
            (90.0, 20),
        ];
        let rings = degrees.map(|(theta, count)| (theta.to_radians(), count));
        Rings::new(&rings).unwrap_or(Rings {
            rings: Vec::new(),
            nodes: 0,
            ring_of: Vec::new(),
        })
    }

    /// Polar angle, radians, and number of nodes of every ring.
    pub fn list(&self) -> impl ExactSizeIterator<Item = (f32, u32)> {
        self.rings.iter().map(|r| (r.theta, r.count))
    }

    /// Nodes of a hemisphere.
    pub fn hemisphere(&self) -> usize {
        self.nodes
    }

    /// Nodes of the sphere.
    pub fn sphere(&self) -> usize {
        2 * self.nodes
    }

    /// The node opposite to a node.
    pub fn opposite(&self, node: usize) -> usize {
        let (back, k) = (node >= self.nodes, node % self.nodes.max(1));
        let ring = &self.rings[usize::from(self.ring_of[k])];
        let turned = match ring.count {
            1 => 0,
            n => (k - ring.first + n as usize / 2) % n as usize,
        };
        let other = ring.first + turned;
        if back { other } else { other + self.nodes }
    }

    /// The hats that are not zero in a direction.
    pub fn hats(&self, w: Vec3) -> Hats {
        let theta = w.z.abs().min(1.0).acos();
        let turn = w.y.atan2(w.x) / TURN;
        let turn = if turn < 0.0 { turn + 1.0 } else { turn };
        let mut outer = 1;
        while outer + 1 < self.rings.len() && self.rings[outer].theta <= theta {
            outer += 1;
        }
        let [low, high] = [&self.rings[outer - 1], &self.rings[outer]];
        let along = ((theta - low.theta) / (high.theta - low.theta)).clamp(0.0, 1.0);
        let base = if w.z < 0.0 { self.nodes as u32 } else { 0 };
        let on = |ring: &Ring| {
            let place = turn * ring.count as f32;
            let before = (place as u32).min(ring.count - 1);
            let is_last = before + 1 == ring.count;
            let after = if is_last { 0 } else { before + 1 };
            let first = base + ring.first as u32;
            let share = (place - before as f32).clamp(0.0, 1.0);
            ([first + before, first + after], [1.0 - share, share])
        };
        let ([a, b], [u, v]) = on(low);
        let ([c, d], [x, y]) = on(high);
        Hats {
            nodes: [a, b, c, d],
            values: [u * (1.0 - along), v * (1.0 - along), x * along, y * along],
        }
    }

    /// Integral of a node's hat times the cosine over its hemisphere, sr.
    pub fn weight(&self, node: usize) -> f64 {
        let ring = &self.rings[usize::from(self.ring_of[node % self.nodes.max(1)])];
        let [inside, outside] = ring.sides;
        (inside + outside) * TAU / f64::from(ring.count)
    }

    /// Draws a direction with a density proportional to a node's hat times the cosine.
    pub fn draw(&self, node: usize, rng: &mut PathRng) -> Vec3 {
        let k = node % self.nodes.max(1);
        let index = usize::from(self.ring_of[k]);
        let ring = &self.rings[index];
        let [inside, outside] = ring.sides;
        let inward = f64::from(rng.unit()) * (inside + outside) < inside;
        let neighbour = if inward {
            index.wrapping_sub(1)
        } else {
            index + 1
        };
        let far = self.rings.get(neighbour).map_or(ring.theta, |r| r.theta);
        let near = ring.theta;
        // The largest sine of twice an angle between both.
        let top = if (near.min(far)..=near.max(far)).contains(&(0.5 * QUARTER)) {
            1.0
        } else {
            (2.0 * near).sin().max((2.0 * far).sin())
        };
        let mut theta = 0.5 * (near + far);
        // By rejection; a hundred refusals in a row have a chance below 1e-17.
        for _ in 0..100 {
            let tried = far + (near - far) * rng.unit().sqrt();
            if rng.unit() * top < (2.0 * tried).sin() {
                theta = tried;
                break;
            }
        }
        let phi = match ring.count {
            1 => TURN * rng.unit(),
            n => {
                // A sum of two uniform numbers has the density of a hat.
                let place = (k - ring.first) as f32 + rng.unit() + rng.unit() - 1.0;
                TURN * place / n as f32
            }
        };
        // Not in the plane of the cloth itself.
        let z = theta.cos().max(1e-6);
        let r = (1.0 - z * z).sqrt();
        let z_of_side = if node < self.nodes { z } else { -z };
        Vec3::new(r * phi.cos(), r * phi.sin(), z_of_side)
    }

    /// For every node, the nodes whose hats overlap its own and the integrals of the products
    /// with the cosine, as shares of the node's [`weight`](Rings::weight): each list adds up to
    /// one.
    pub fn overlaps(&self) -> Vec<Vec<(u32, f64)>> {
        const POLAR: usize = 12;
        let azimuths = 8 * self.rings.iter().map(|r| r.count).max().unwrap_or(1) as usize;
        let mut sums = vec![std::collections::BTreeMap::<u32, f64>::new(); self.nodes];
        for pair in self.rings.windows(2) {
            let [low, high] = [pair[0].theta, pair[1].theta].map(f64::from);
            for i in 0..POLAR {
                let theta = low + (high - low) * (i as f64 + 0.5) / POLAR as f64;
                let share = theta.sin() * theta.cos() * (high - low);
                for j in 0..azimuths {
                    let phi = TAU * (j as f64 + 0.5) / azimuths as f64;
                    let sin = theta.sin();
                    let w = glam::DVec3::new(sin * phi.cos(), sin * phi.sin(), theta.cos());
                    let hats = self.hats(w.as_vec3());
                    for (&a, &x) in hats.nodes.iter().zip(&hats.values) {
                        for (&b, &y) in hats.nodes.iter().zip(&hats.values) {
                            let product = f64::from(x) * f64::from(y) * share;
                            if let Some(list) = sums.get_mut(a as usize) {
                                *list.entry(b).or_default() += product;
                            }
                        }
                    }
                }
            }
        }
        let lists = sums.into_iter().map(|list| {
            let total: f64 = list.values().sum();
            list.into_iter().map(|(b, v)| (b, v / total)).collect()
        });
        let front: Vec<Vec<(u32, f64)>> = lists.collect();
        let to_back = |list: &Vec<(u32, f64)>| {
            let moved = list.iter().map(|&(b, v)| (b + self.nodes as u32, v));
            moved.collect()
        };
        let back: Vec<Vec<(u32, f64)>> = front.iter().map(to_back).collect();
        front.into_iter().chain(back).collect()
    }
}

/// Integral from `a` to `b` of a line that rises from 0 to 1 there, times sine and cosine.
fn rising(a: f64, b: f64) -> f64 {
    (((2.0 * b).sin() - (2.0 * a).sin()) / 4.0 - (b - a) * (2.0 * b).cos() / 2.0) / (2.0 * (b - a))
}

/// The same of a line that falls from 1 to 0.
fn falling(a: f64, b: f64) -> f64 {
    ((b - a) * (2.0 * a).cos() / 2.0 - ((2.0 * b).sin() - (2.0 * a).sin()) / 4.0) / (2.0 * (b - a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{Moments, warp};

    #[test]
    fn hats_add_up_to_one_and_their_weights_to_the_cosine() {
        let rings = Rings::usual();
        let mut rng = PathRng::from_seed(11);
        let total: f64 = (0..rings.hemisphere()).map(|k| rings.weight(k)).sum();
        assert!((total - std::f64::consts::PI).abs() < 1e-9, "{total}");
        let mut sums = vec![Moments::default(); rings.sphere()];
        for _ in 0..200_000 {
            let w = warp::uniform_sphere(rng.unit2());
            let hats = rings.hats(w);
            assert!((hats.values.iter().sum::<f32>() - 1.0).abs() < 4.0 * f32::EPSILON);
            let far = rings.hats(-w);
            for (node, value) in hats.nodes.iter().zip(hats.values) {
                let other = rings.opposite(*node as usize);
                assert_eq!(rings.opposite(other), *node as usize);
                let sum = |hats: &Hats, wanted: usize| {
                    let pairs = hats.nodes.iter().zip(hats.values);
                    let own = pairs.filter(|(n, _)| **n as usize == wanted);
                    own.map(|(_, v)| v).sum::<f32>()
                };
                let (there, here) = (sum(&far, other), sum(&hats, *node as usize));
                assert!((there - here).abs() < 2e-3, "{w}: {there} for {here}");
                let at = &mut sums[*node as usize];
                at.add(f64::from(value * w.z.abs() / warp::UNIFORM_SPHERE_PDF));
            }
        }
        for (node, found) in sums.iter().enumerate() {
            let mean = found.mean * found.count as f64 / 200_000.0;
            let weight = rings.weight(node);
            // The relative error of a mean over the few draws that meet a hat.
            let error = 6.0 / (found.count as f64).sqrt() * weight;
            assert!((mean - weight).abs() < error, "seed 11: node {node}");
        }
    }

    #[test]
    fn drawn_directions_have_the_density_of_the_hat() {
        let rings = Rings::usual();
        let lists = rings.overlaps();
        for node in [
            0,
            3,
            40,
            200,
            rings.hemisphere() - 1,
            rings.hemisphere() + 70,
        ] {
            let mut rng = PathRng::new(5, 0, node as u64);
            let mut sums = vec![Moments::default(); rings.sphere()];
            const DRAWS: usize = 20_000;
            for _ in 0..DRAWS {
                let hats = rings.hats(rings.draw(node, &mut rng));
                let mut here = vec![0.0; rings.sphere()];
                for (n, v) in hats.nodes.iter().zip(hats.values) {
                    here[*n as usize] += f64::from(v);
                }
                sums.iter_mut().zip(here).for_each(|(s, v)| s.add(v));
            }
            for &(other, share) in &lists[node] {
                let found = &sums[other as usize];
                let z = (found.mean - share) / found.standard_error().max(1e-4);
                let mean = found.mean;
                assert!(z.abs() < 5.0, "seed 5: {node}, {other}: {mean} for {share}");
            }
            // A hat that is a tenth too large is detected.
            let own = lists[node].iter().find(|o| o.0 as usize == node).unwrap().1;
            let found = &sums[node];
            assert!((found.mean - 1.1 * own).abs() > 5.0 * found.standard_error());
        }
    }

    #[test]
    fn impossible_rings_are_refused() {
        let good = [(0.0, 1), (0.8, 8), (QUARTER, 8)];
        assert!(Rings::new(&good).is_some());
        for bad in [
            vec![],
            vec![(0.0, 1)],
            vec![(0.0, 1), (0.8, 7), (QUARTER, 8)],
            vec![(0.0, 2), (0.8, 8), (QUARTER, 8)],
            vec![(0.0, 1), (f32::NAN, 8), (QUARTER, 8)],
            vec![(0.0, 1), (1.0, 8), (0.8, 8), (QUARTER, 8)],
            vec![(0.0, 1), (1.0, 8), (1.2, 8)],
            vec![(0.0, 1), (1.0, 1000), (QUARTER, 8)],
        ] {
            assert!(Rings::new(&bad).is_none(), "{bad:?}");
        }
    }
}
