//! Light through a cross-section of any outline, by rays.
//!
//! Fibres twist, so that their rotation about the axis is random, and what light finds is the
//! mean over rotations and offsets. Seen along the axis rays refract with the index of
//! [`cylinder`](crate::cylinder), which keeps the inclination [Marschner2003]; [Khungurn2017]
//! traces ellipses and [Aliaga2017] any outline in the same way. At every facet a ray is
//! split by Fresnel's reflectance, so that no light is lost.

use crate::near::LOBES;
use crate::near::crossing::{MIN_COS, fresnel};
use crate::section::extent;
use glam::DVec2;
use organza_basis::Rgb;
use std::f64::consts::TAU;

/// Part of a ray below which it is no longer followed.
const FAINT: f64 = 1e-3;
/// Facets after which a ray is no longer followed.
const MAX_FACETS: u32 = 40;
/// One over the golden ratio: rotations and offsets of rays form a lattice.
const LATTICE: f64 = 0.618_033_988_749_894_9;

/// What leaves a fibre.
#[derive(Clone, Copy, Debug)]
struct Exit {
    /// R, TT, what comes later, and what was not followed to its end.
    lobe: u8,
    /// Part of the light.
    weight: f32,
    /// Length of the way inside, in mean radii.
    path_radii: f32,
    /// From straight on.
    azimuth_rad: f32,
}

/// All that leaves a section at one inclination.
#[derive(Clone, Debug)]
pub(crate) struct Traced(Vec<Exit>);

#[derive(Clone, Copy)]
struct Ray {
    origin: DVec2,
    direction: DVec2,
    inside: bool,
    /// The facet that it comes from.
    from: usize,
    lobe: u8,
    weight: f64,
    path: f64,
    facets: u32,
}

impl Traced {
    /// `rays` rays through a polygon of [`Section::outline`](crate::Section::outline), at the
    /// cosine of an inclination.
    pub fn new(corners: &[DVec2], ior: f32, cos_theta: f32, rays: usize) -> Traced {
        let eta = f64::from(ior);
        let cos = f64::from(cos_theta.clamp(MIN_COS, 1.0));
        let index = (eta * eta - 1.0 + cos * cos).sqrt() / cos;
        let cos_inside = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(1e-8).sqrt();
        let reflectance = |cos_outside: f64| f64::from(fresnel((cos * cos_outside) as f32, ior));
        let mut exits = Vec::with_capacity(6 * rays);
        let mut sides = vec![0.0; corners.len()];
        let normals = Normals::of(corners);
        let mut waiting = Vec::new();
        let mut light = 0.0;
        for i in 0..rays {
            let rotation = TAU * (i as f64 + 0.5) / rays as f64;
            let direction = DVec2::from_angle(rotation);
            let across = direction.perp();
            let (low, high) = extent(corners, across);
            let offset = low + (high - low) * (i as f64 * LATTICE + 0.25).fract();
            waiting.push(Ray {
                origin: across * offset - direction * 100.0,
                direction,
                inside: false,
                from: usize::MAX,
                lobe: 0,
                weight: high - low,
                path: 0.0,
                facets: 0,
            });
            light += high - low;
            let faint = FAINT * (high - low);
            while let Some(ray) = waiting.pop() {
                let exit = |lobe| Exit {
                    lobe,
                    weight: ray.weight as f32,
                    path_radii: (ray.path / cos_inside) as f32,
                    azimuth_rad: (direction.angle_to(ray.direction)) as f32,
                };
                if ray.weight < faint || ray.facets > MAX_FACETS {
                    exits.push(exit(3));
                    continue;
                }
                let Some((facet, distance)) = nearest(corners, &ray, &mut sides) else {
                    exits.push(exit(ray.lobe));
                    continue;
                };
                let at = ray.origin + ray.direction * distance;
                // Toward the side where the ray is.
                let side = if ray.inside { 1.0 } else { -1.0 };
                let (flat, normal) = normals.at(corners, facet, at);
                let (flat, normal) = (flat * side, normal * side);
                let cos_i = -normal.dot(ray.direction).clamp(-1.0, 0.0);
                let sin_i = (1.0 - cos_i * cos_i).max(0.0).sqrt();
                let ratio = if ray.inside { index } else { 1.0 / index };
                let sin_t = ratio * sin_i;
                let cos_t = (1.0 - sin_t * sin_t).max(0.0).sqrt();
                let back = match (ray.inside, sin_t < 1.0) {
                    (true, false) => 1.0,
                    (true, true) => reflectance(cos_t),
                    (false, _) => reflectance(cos_i),
                };
                let met = Ray {
                    origin: at,
                    from: facet,
                    path: ray.path + if ray.inside { distance } else { 0.0 },
                    facets: ray.facets + 1,
                    ..ray
                };
                if back > 0.0 {
                    waiting.push(Ray {
                        direction: kept_on(flat, ray.direction + normal * (2.0 * cos_i)),
                        weight: ray.weight * back,
                        lobe: if ray.inside { 2 } else { ray.lobe },
                        ..met
                    });
                }
                if back < 1.0 {
                    let through = ray.direction * ratio + normal * (ratio * cos_i - cos_t);
                    let lobe = match (ray.inside, ray.lobe) {
                        (true, lobe) => lobe,
                        (false, 0) => 1,
                        // It enters once more.
                        (false, _) => 2,
                    };
                    waiting.push(Ray {
                        direction: kept_on(-flat, through),
                        inside: !ray.inside,
                        weight: ray.weight * (1.0 - back),
                        lobe,
                        ..met
                    });
                }
            }
        }
        let scale = (1.0 / light) as f32;
        exits.iter_mut().for_each(|exit| exit.weight *= scale);
        Traced(exits)
    }

    /// Part of the light in R, TT, what is later, and what is spread evenly because it was
    /// not followed; for absorption times mean radius.
    pub fn energies(&self, absorption_radii: Rgb) -> [Rgb; LOBES] {
        let mut sums = [glam::DVec3::ZERO; LOBES];
        for exit in &self.0 {
            sums[usize::from(exit.lobe)] += exit.colour(absorption_radii).as_dvec3();
        }
        sums.map(|s| Rgb(s.as_vec3()))
    }

    /// Calls `visit` with lobe, azimuth and light of everything that was followed.
    pub fn visit(&self, absorption_radii: Rgb, mut visit: impl FnMut(usize, f32, glam::Vec3)) {
        for exit in &self.0 {
            let colour = exit.colour(absorption_radii);
            visit(usize::from(exit.lobe), exit.azimuth_rad, colour);
        }
    }

    /// Light that leaves, and the same times the cosine of the turn about the fibre, for one
    /// absorption.
    pub fn albedo_and_turn(&self, absorption_radii: f32) -> [f32; 2] {
        self.0.iter().fold([0.0; 2], |[albedo, turn], exit| {
            let light = exit.weight * (-absorption_radii * exit.path_radii).exp();
            let turned = exit.azimuth_rad.cos();
            let cos = if exit.lobe == 3 { 0.0 } else { turned };
            [albedo + light, turn + light * cos]
        })
    }
}

impl Exit {
    fn colour(&self, absorption_radii: Rgb) -> glam::Vec3 {
        (absorption_radii.0 * -self.path_radii).exp() * self.weight
    }
}

/// Inward normals at the corners. Between them they turn evenly, as those of the smooth outline
/// do: flat facets would keep light inside that grazes.
struct Normals(Vec<DVec2>);

impl Normals {
    fn of(corners: &[DVec2]) -> Normals {
        let n = corners.len();
        let flat = |i: usize| (corners[(i + 1) % n] - corners[i % n]).perp().normalize();
        let normals = (0..n).map(|i| (flat(i + n - 1) + flat(i)).normalize());
        Normals(normals.collect())
    }

    /// The normal of a facet, and that of the smooth outline at a point of it.
    fn at(&self, corners: &[DVec2], facet: usize, point: DVec2) -> (DVec2, DVec2) {
        let next = (facet + 1) % corners.len();
        let edge = corners[next] - corners[facet];
        let share = (point - corners[facet]).dot(edge) / edge.length_squared();
        let between = self.0[facet].lerp(self.0[next], share.clamp(0.0, 1.0));
        (edge.perp().normalize(), between.normalize())
    }
}

/// A unit direction, on the side of a facet where it belongs.
fn kept_on(flat: DVec2, direction: DVec2) -> DVec2 {
    let below = flat.dot(direction).min(0.0);
    (direction - flat * (2.0 * below)).normalize()
}

/// The facet that a ray meets first, and its distance. `sides` is room for a number per
/// corner.
fn nearest(corners: &[DVec2], ray: &Ray, sides: &mut [f64]) -> Option<(usize, f64)> {
    let [x, y] = [ray.direction.x, ray.direction.y];
    let offset = x * ray.origin.y - y * ray.origin.x;
    for (side, c) in sides.iter_mut().zip(corners) {
        *side = x * c.y - y * c.x - offset;
    }
    let mut best = None;
    let mut before = sides[sides.len() - 1];
    for (k, &side) in sides.iter().enumerate() {
        if (before < 0.0) != (side < 0.0) {
            let facet = if k == 0 { sides.len() - 1 } else { k - 1 };
            let (a, b) = (corners[facet], corners[k]);
            let share = before / (before - side);
            let distance = (a.lerp(b, share) - ray.origin).dot(ray.direction);
            if facet != ray.from
                && distance > -1e-9
                && best.is_none_or(|(_, nearest)| distance < nearest)
            {
                best = Some((facet, distance));
            }
        }
        before = side;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Section;
    use crate::cylinder::mean_attenuations;
    use std::f64::consts::PI;

    const ALL: [Section; 5] = [
        Section::Bean,
        Section::Trilobal,
        Section::Triangle,
        Section::Ribbon,
        Section::Ellipse(3.0),
    ];

    fn total(energies: [Rgb; LOBES]) -> f32 {
        energies.iter().map(|e| e.0.x).sum()
    }

    #[test]
    fn no_light_is_lost() {
        for section in ALL {
            let corners = section.outline();
            for cos in [1e-3, 0.3, 0.8, 1.0] {
                let traced = Traced::new(&corners, 1.55, cos, 512);
                let energies = traced.energies(Rgb::BLACK);
                let sum = total(energies);
                let off = (sum - 1.0).abs();
                assert!(off < 4.0 * f32::EPSILON, "{section}, {cos}: {sum}");
                assert!(energies[3].0.x < 0.029, "{section}, {cos}: {energies:?}");
                // The twin absorbs a little.
                let dim = total(traced.energies(Rgb::splat(0.01)));
                assert!(dim < 1.0 - 2e-3 || cos < 0.01, "{section}, {cos}: {dim}");
            }
        }
    }

    /// A circle by the tracer against the closed forms of the round fibre.
    #[test]
    fn a_circle_has_the_energies_of_the_round_fibre() {
        let corners = Section::Ellipse(1.0).outline();
        for cos in [0.2, 0.7, 1.0] {
            for absorption in [0.0, 0.3] {
                let traced = Traced::new(&corners, 1.55, cos, 4096);
                let got = traced.energies(Rgb::splat(absorption));
                let want = mean_attenuations(1.55, Rgb::splat(absorption), cos, 256);
                // What is left is of flat facets; it is 2.4e-5 at most.
                for p in 0..2 {
                    let off = (got[p].0.x - want[p].0.x).abs();
                    assert!(off < 4e-3, "{cos}, {absorption}: {got:?} {want:?}");
                }
                let later = [&got, &want].map(|e| e[2].0.x + e[3].0.x);
                assert!((later[0] - later[1]).abs() < 4e-3, "{got:?} {want:?}");
            }
        }
    }

    /// Cauchy's theorem: seen from all sides every convex outline shows its facets under the
    /// same angles, so that all reflect alike.
    #[test]
    fn convex_outlines_reflect_as_the_circle_does() {
        let want = mean_attenuations(1.55, Rgb::BLACK, 0.9, 256)[0].0.x;
        let of = |section: Section| {
            let traced = Traced::new(&section.outline(), 1.55, 0.9, 8192);
            traced.energies(Rgb::BLACK)[0].0.x
        };
        for section in [Section::Triangle, Section::Ribbon, Section::Ellipse(3.0)] {
            let got = of(section);
            assert!((got / want - 1.0).abs() < 0.02, "{section}: {got} {want}");
        }
        // Hollows let some of the light in that was reflected first.
        let hollow = of(Section::Trilobal);
        assert!(hollow < 0.95 * want, "{hollow} {want}");
    }

    /// Over all rotations light is exchanged in both directions alike: what turns left and
    /// what turns right is the same even of an outline that is not its own mirror image.
    #[test]
    fn lopsided_outlines_turn_light_evenly() {
        let corners: Vec<DVec2> = (0..200)
            .map(|i| {
                let t = TAU * f64::from(i) / 200.0;
                let r = 1.0 + 0.2 * (3.0 * t).cos() + 0.12 * (2.0 * t + 0.7).sin();
                DVec2::from_angle(t) * r
            })
            .collect();
        let traced = Traced::new(&corners, 1.55, 0.9, 60_000);
        // Light by azimuth in 24 parts, left against right.
        let mut parts = [[0.0f32; 12]; 2];
        let mut twin = [[0.0f32; 12]; 2];
        traced.visit(Rgb::BLACK, |lobe, azimuth, light| {
            if lobe == 3 {
                return;
            }
            let at = |a: f32| {
                let part = (a.abs() / PI as f32 * 12.0) as usize;
                (usize::from(a < 0.0), part.min(11))
            };
            let (side, part) = at(azimuth);
            parts[side][part] += light.x;
            // The twin's fibres all stand a little turned.
            let (side, part) = at((azimuth + 0.1).rem_euclid(TAU as f32) - PI as f32);
            twin[side][part] += light.x;
        });
        let off = |p: &[[f32; 12]; 2]| {
            let differences = p[0].iter().zip(p[1]).map(|(a, b)| (a - b).abs());
            differences.fold(0.0f32, f32::max) / p.iter().flatten().sum::<f32>()
        };
        assert!(off(&parts) < 2e-3, "{}: {parts:?}", off(&parts));
        assert!(off(&twin) > 1e-2, "{}", off(&twin));
    }
}
