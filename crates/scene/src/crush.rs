//! `[object.crush]`: pile that was crushed, as in panne, by a map of its lean or in patches at random.

use crate::error::{InputError, Result};
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::read;
use glam::{UVec2, Vec2};
use organza_basis::{PathRng, Rgb};
use serde::Deserialize;
use std::f32::consts::TAU;
use std::path::Path;

/// How sharply patches end: weights fall by this exponent at the size of a patch (estimated).
const SHARPNESS: f32 = 8.0;
/// Patches on either side that are looked at; others weigh less than 1e-13.
const REACH: i64 = 2;
/// Length of a mesh's edges, in sizes of a patch, and in pixels of a map. A patch fades into the next
/// over about a quarter of its size: between corners as far apart, the lean is wrong by 2 % of the
/// largest in the median and by 7 % in one place of ten (a test below measures it).
const FINE_PATCH: f32 = 0.25;
const FINE_PIXELS: f32 = 2.0;

/// How the pile of a cloth that lies on a mesh was crushed.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Crush {
    /// The largest lean, beside the pile's own: 0 to 60 degrees.
    pub lean_deg: f32,
    /// Distance of patches, or the width of the map on the cloth, mm.
    pub size_mm: f32,
    /// A picture that repeats: red is the lean along the weft, green that along the warp, 0.5 none.
    pub map: Option<String>,
    /// Seed of the patches.
    pub seed: Option<u64>,
}

/// The lean of crushed pile.
pub(crate) enum CrushedLean {
    /// Patches at random.
    Patches {
        tangent: f32,
        size_mm: f32,
        seed: u64,
    },
    /// Tangents of a picture, in rows from the top.
    Map {
        size: UVec2,
        tangents: Vec<Vec2>,
        pixel_mm: f32,
    },
}

impl Crush {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn check(&self) -> std::result::Result<(), String> {
        for (key, found, [low, high]) in [
            ("lean_deg", self.lean_deg, [0.0, 60.0]),
            ("size_mm", self.size_mm, [0.1, 1e6]),
        ] {
            if !(low..=high).contains(&found) {
                return Err(format!(".{key}: expected {low} to {high}, found {found}"));
            }
        }
        match (&self.map, self.seed) {
            (Some(_), Some(_)) => Err(".seed: belongs to patches, which a map replaces".into()),
            _ => Ok(()),
        }
    }

    /// The lean that it gives, with its map.
    ///
    /// # Errors
    /// Names the map and what is wrong with it.
    pub(crate) fn lean(
        &self,
        scene_path: &Path,
        max_bytes: Option<u64>,
        loader: &Loader<'_>,
    ) -> Result<CrushedLean> {
        let tangent = self.lean_deg.to_radians().tan();
        let Some(name) = &self.map else {
            return Ok(CrushedLean::Patches {
                tangent,
                size_mm: self.size_mm,
                seed: self.seed.unwrap_or(0),
            });
        };
        let path = read::beside(scene_path, name);
        let bytes = loader.bytes(&path)?;
        let allowed = max_bytes.unwrap_or_else(free_memory_bytes);
        let decoded = organza_picture::decode(&bytes, allowed);
        let (picture, format) = decoded.map_err(|e| InputError::of_file(&path, e))?;
        // Pictures for the eye hold directions as they are written.
        let is_linear = format.reader.is_some_and(|r| (r.holds_radiance)(&bytes));
        let written = |x: f32| match is_linear {
            true => x.clamp(0.0, 1.0),
            false => f32::from(Rgb::srgb8(x)) / 255.0,
        };
        // Of eight bits, 127 and 128 both stand for upright.
        let signed = |x: f32| match 2.0 * written(x) - 1.0 {
            x if x.abs() < 1.0 / 254.0 => 0.0,
            x if x.is_finite() => x,
            _ => 0.0,
        };
        let of = |p: &Rgb| tangent * Vec2::new(signed(p.0.x), signed(p.0.y));
        Ok(CrushedLean::Map {
            size: picture.size,
            tangents: picture.pixels.iter().map(of).collect(),
            pixel_mm: self.size_mm / picture.size.x.max(1) as f32,
        })
    }
}

impl CrushedLean {
    /// How long the edges of a mesh may be so that it shows.
    pub fn longest_edge_mm(&self) -> f32 {
        match self {
            CrushedLean::Patches { size_mm, .. } => FINE_PATCH * size_mm,
            CrushedLean::Map { pixel_mm, .. } => FINE_PIXELS * pixel_mm,
        }
    }

    /// The lean at a place of the cloth, as tangents along weft and warp.
    pub fn tangent_at(&self, at_mm: Vec2) -> Vec2 {
        match self {
            CrushedLean::Patches {
                tangent,
                size_mm,
                seed,
            } => *tangent * patches(at_mm / *size_mm, *seed),
            CrushedLean::Map {
                size,
                tangents,
                pixel_mm,
            } => {
                // The picture stands upright: its last row lies at the beginning of the warp.
                let place = at_mm / *pixel_mm - 0.5;
                let first = place.floor();
                let share = place - first;
                let [width, height] = size.to_array().map(|n| i64::from(n.max(1)));
                let pixel = |dx: i64, dy: i64| {
                    let x = (first.x as i64 + dx).rem_euclid(width);
                    let y = height - 1 - (first.y as i64 + dy).rem_euclid(height);
                    let tangent = tangents.get((y * width + x) as usize);
                    tangent.copied().unwrap_or_default()
                };
                let row = |dy| pixel(0, dy).lerp(pixel(1, dy), share.x);
                row(0).lerp(row(1), share.y)
            }
        }
    }
}

/// The lean in units of the largest, at a place in distances of patches: around points that are
/// scattered one to a cell, each with a lean of its own, in which the nearest one counts most.
fn patches(place: Vec2, seed: u64) -> Vec2 {
    let cell = place.floor();
    let mut points = Vec::with_capacity(25);
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            let [x, y] = [cell.x as i64 + dx, cell.y as i64 + dy];
            let mut rng = PathRng::new(seed, x as u64, y as u64);
            let point = Vec2::new(x as f32, y as f32) + rng.unit2();
            let lean = rng.unit().sqrt() * Vec2::from_angle(TAU * rng.unit());
            points.push((place.distance_squared(point), lean));
        }
    }
    let nearest = points.iter().map(|p| p.0).fold(f32::INFINITY, f32::min);
    let weighed = points.iter().map(|(d, lean)| {
        let weight = (SHARPNESS * (nearest - d)).exp();
        (weight, weight * *lean)
    });
    let (weights, sum) = weighed.fold((0.0, Vec2::ZERO), |(w, s), (a, b)| (w + a, s + b));
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_picture::PngBits;
    use organza_picture::png::write_shown;

    const CRUSH: Crush = Crush {
        lean_deg: 40.0,
        size_mm: 5.0,
        map: None,
        seed: Some(3),
    };

    fn lean(crush: &Crush) -> CrushedLean {
        crush
            .lean(Path::new("s.toml"), None, &Loader::new())
            .unwrap()
    }

    /// Patches lean in all directions, no farther than they may, without jumps. The twin is a step
    /// as long as a patch.
    #[test]
    fn patches_lean_within_their_limit_and_without_jumps() {
        let lean = lean(&CRUSH);
        let most = 40f32.to_radians().tan();
        let (mut near, mut far, mut sum, mut count) = (0.0f32, 0.0f32, Vec2::ZERO, 0.0);
        for i in 0..4000 {
            let at = Vec2::new((i % 64) as f32, (i / 64) as f32) * 1.7 - 30.0;
            let here = lean.tangent_at(at);
            assert!(here.length() <= 1.0001 * most, "{at}: {here}");
            near = near.max(here.distance(lean.tangent_at(at + 0.01)));
            far = far.max(here.distance(lean.tangent_at(at + 5.0)));
            (sum, count) = (sum + here, count + 1.0);
        }
        assert!(near < 0.1 && far > most, "{near}, {far}");
        // Some 440 patches of deviation `most / 2` along either axis: 0.02 is a standard error.
        // Margin: four standard errors.
        assert!(
            (sum / count).abs().max_element() < 0.08,
            "seed 3: {}",
            sum / count
        );
    }

    /// The lean between the corners of a mesh is nearly that of the patches. The twin has edges of
    /// more than half a patch.
    #[test]
    fn leans_between_the_corners_of_a_mesh_are_those_of_patches() {
        let lean = lean(&CRUSH);
        let most = 40f32.to_radians().tan();
        let errors = |edge_mm: f32| {
            let mut rng = PathRng::from_seed(4);
            let mut error = || {
                // A right triangle whose longest edge is the limit, turned at random.
                let across = Vec2::from_angle(TAU * rng.unit()) * edge_mm / 2f32.sqrt();
                let first = 100.0 * rng.unit2();
                let corners = [first, first + across, first + across.perp()];
                let [a, b] = [rng.unit(), rng.unit()];
                let [a, b] = if a + b > 1.0 {
                    [1.0 - a, 1.0 - b]
                } else {
                    [a, b]
                };
                let shares = [1.0 - a - b, a, b];
                let at: Vec2 = corners.iter().zip(shares).map(|(c, w)| *c * w).sum();
                let between = corners
                    .iter()
                    .zip(shares)
                    .map(|(c, w)| lean.tangent_at(*c) * w);
                between.sum::<Vec2>().distance(lean.tangent_at(at)) / most
            };
            let mut errors: Vec<f32> = (0..2000).map(|_| error()).collect();
            errors.sort_by(f32::total_cmp);
            [errors[1000], errors[1800]]
        };
        let [median, ninth] = errors(lean.longest_edge_mm());
        assert!(median < 0.03 && ninth < 0.1, "seed 4: {median}, {ninth}");
        let [median, _] = errors(0.6 * CRUSH.size_mm);
        assert!(median > 0.05, "seed 4: {median}");
    }

    /// Red and green of a picture are the lean along weft and warp, from its lower left corner, and
    /// of pictures for the eye as written.
    #[test]
    fn a_map_tells_the_lean() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("crush.png");
        // The upper pixel leans along the warp, the lower against the weft.
        let pixels = [[127.0, 255.0, 0.0], [0.0, 128.0, 0.0]];
        let pixels = pixels.map(|p| p.map(|byte: f32| Rgb::linear_from_srgb(byte / 255.0)));
        let mut png = std::io::Cursor::new(Vec::new());
        write_shown(
            UVec2::new(1, 2),
            pixels.into_iter(),
            PngBits::Eight,
            &mut png,
        )
        .unwrap();
        std::fs::write(&path, png.get_ref()).unwrap();
        let crush = Crush {
            size_mm: 2.0,
            map: Some(path.display().to_string()),
            seed: None,
            ..CRUSH
        };
        let lean = lean(&crush);
        let most = 40f32.to_radians().tan();
        let at = |x, y| lean.tangent_at(Vec2::new(x, y));
        assert!(
            at(1.0, 1.0).abs_diff_eq(-most * Vec2::X, 1e-6),
            "{}",
            at(1.0, 1.0)
        );
        assert!(
            at(1.0, 3.0).abs_diff_eq(most * Vec2::Y, 1e-6),
            "{}",
            at(1.0, 3.0)
        );
        assert!(at(-5.0, 5.0).abs_diff_eq(-most * Vec2::X, 1e-6));
        let wrong = Crush {
            seed: Some(1),
            ..crush
        };
        assert!(wrong.check().unwrap_err().starts_with(".seed: "));
    }
}
