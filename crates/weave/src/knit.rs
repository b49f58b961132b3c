//! Weft knits from a closed-form loop.
//!
//! A course runs along x. With `t` increasing by 2 pi per loop, `x = W t / 2 pi + a sin 2t`, `y
//! = -b cos t`, `z = -s c cos 2t`: feet behind, legs in front and head behind for a face stitch
//! (`s = 1`), the opposite for a back stitch. The sign is that of the stitch that made the
//! bend: the foot belongs to the loop itself, the head to the loop that the next course draws
//! through it. The depth `c` is the smallest at which neighbouring courses touch.

use crate::path::Path;
use crate::{Error, error::did_you_mean};
use glam::DVec3;
use std::f64::consts::TAU;

/// The knits that have a name.
pub const NAMES: [&str; 4] = ["stockinette", "garter", "rib-1-1", "rib-2-2"];

/// Sideways swing of the legs as a share of the loop's width, and height of a
/// loop as a share of the course spacing: proportions of a relaxed plain knit
/// (estimated).
const SWING: f64 = 0.235;
const HEIGHT: f64 = 1.75;
/// Share of the loop over which the sign of a rib's foot changes, on each side.
const TURN_OVER: f64 = 0.08;

/// A repeat of stitches.
#[derive(Clone, Debug)]
pub(crate) struct Knit {
    /// Loops of a repeat across the knit and upward.
    pub wales: usize,
    pub courses: usize,
    /// Distance of loops and of courses, millimetres.
    pub wale_mm: f64,
    pub course_mm: f64,
    depth_mm: f64,
    /// 1 for face stitches, -1 for back stitches; `course * wales + wale`.
    sides: Vec<f64>,
}

impl Knit {
    /// The named knit at a yarn radius.
    ///
    /// # Errors When the name is unknown, or no depth keeps the courses apart.
    pub fn named(name: &str, wale_mm: f64, course_mm: f64, radius_mm: f64) -> Result<Knit, Error> {
        let (wales, courses, sides): (_, _, &[f64]) = match name.trim().to_lowercase().as_str() {
            "stockinette" => (1, 1, &[1.0]),
            "garter" => (1, 2, &[1.0, -1.0]),
            "rib-1-1" => (2, 1, &[1.0, -1.0]),
            "rib-2-2" => (4, 1, &[1.0, 1.0, -1.0, -1.0]),
            other => {
                let hint = did_you_mean(other, NAMES);
                let message = format!(
                    "no knit is called \"{name}\"{hint}; expected {}",
                    NAMES.join(", ")
                );
                return Err(Error::spec("draft.knit", message));
            }
        };
        let mut knit = Knit {
            wales,
            courses,
            wale_mm,
            course_mm,
            depth_mm: 0.0,
            sides: sides.to_vec(),
        };
        knit.depth_mm = knit.touching_depth_mm(radius_mm)?;
        Ok(knit)
    }

    /// Several copies of the repeat.
    pub fn tiled(&self, across: usize, up: usize) -> Knit {
        let (wales, courses) = (self.wales * across, self.courses * up);
        let sides = (0..courses)
            .flat_map(|c| (0..wales).map(move |w| (c, w)))
            .map(|(c, w)| self.sides[(c % self.courses) * self.wales + w % self.wales])
            .collect();
        Knit {
            wales,
            courses,
            sides,
            ..*self
        }
    }

    /// 1 where the stitch shows its face.
    fn side(&self, course: i64, wale: i64) -> f64 {
        let c = course.rem_euclid(self.courses as i64) as usize;
        let w = wale.rem_euclid(self.wales as i64) as usize;
        self.sides[c * self.wales + w]
    }

    /// The point of a course at loop `u` (one per wale, whole at feet).
    pub fn point(&self, course: i64, u: f64) -> DVec3 {
        let t = TAU * u;
        let wale = u.floor();
        // Around a foot between different stitches the sign changes.
        let own = |course: i64| {
            let near = u - u.round();
            let blend = (0.5 + 0.5 * near / TURN_OVER).clamp(0.0, 1.0);
            let blend = blend * blend * (3.0 - 2.0 * blend);
            let (before, after) = if near < 0.0 {
                (wale as i64, wale as i64 + 1)
            } else {
                (wale as i64 - 1, wale as i64)
            };
            self.side(course, before) * (1.0 - blend) + self.side(course, after) * blend
        };
        let foot = 0.5 * (1.0 + t.cos());
        let side = foot * own(course) + (1.0 - foot) * own(course + 1);
        DVec3::new(
            self.wale_mm * (u + SWING * (2.0 * t).sin()),
            self.course_mm * (course as f64 + 0.5 - 0.5 * HEIGHT * t.cos()),
            -self.depth_mm * side * (2.0 * t).cos(),
        )
    }

    /// One period of a course in steps of about `longest_mm`.
    pub fn path(&self, course: usize, longest_mm: f64) -> Path {
        let at = |u: f64| self.point(course as i64, u);
        let rough = 64 * self.wales;
        let length: f64 = (0..rough)
            .map(|i| {
                let [a, b] = [i, i + 1].map(|i| i as f64 * self.wales as f64 / rough as f64);
                at(a).distance(at(b))
            })
            .sum();
        let steps =
            ((length / longest_mm).ceil() as usize).clamp(32 * self.wales, 4096 * self.wales);
        let u = |i: usize| i as f64 * self.wales as f64 / steps as f64;
        let points: Vec<DVec3> = (0..=steps).map(|i| at(u(i))).collect();
        let h = 1e-4;
        let (mut lateral, mut vertical) = (Vec::new(), Vec::new());
        for i in 0..=steps {
            let tangent = (at(u(i) + h) - at(u(i) - h)).normalize_or(DVec3::X);
            let across = DVec3::Z.cross(tangent).normalize_or(DVec3::Y);
            lateral.push(across);
            vertical.push(tangent.cross(across));
        }
        let period = self.wales as f64 * self.wale_mm * DVec3::X;
        Path::new(points, lateral, vertical, period)
    }

    /// Smallest distance between points of any two neighbouring courses.
    fn clearance_mm(&self) -> f64 {
        const STEPS: usize = 48;
        let mut least = f64::INFINITY;
        for course in 0..self.courses as i64 {
            let loops = |course: i64, from: i64, to: i64| -> Vec<DVec3> {
                (from * STEPS as i64..to * STEPS as i64)
                    .map(|i| self.point(course, i as f64 / STEPS as f64))
                    .collect()
            };
            let wales = self.wales as i64;
            let (lower, upper) = (loops(course, 0, wales), loops(course + 1, -1, wales + 1));
            for a in &lower {
                for b in &upper {
                    least = least.min(a.distance_squared(*b));
                }
            }
        }
        least.sqrt()
    }

    fn touching_depth_mm(&mut self, radius_mm: f64) -> Result<f64, Error> {
        let (mut low, mut high) = (0.0, 8.0 * radius_mm);
        let mut apart = |depth: f64| {
            self.depth_mm = depth;
            self.clearance_mm() >= 2.0 * radius_mm
        };
        if !apart(high) {
            return Err(Error::Jammed(format!(
                "loops of {:.3} x {:.3} mm leave no room for a yarn {:.3} mm thick",
                self.wale_mm,
                self.course_mm,
                2.0 * radius_mm
            )));
        }
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if apart(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Ok(high)
    }

    /// Largest distance of a course from the middle plane, millimetres.
    pub fn depth_mm(&self) -> f64 {
        self.depth_mm
    }

    /// Largest curvature of a course, per millimetre.
    pub fn bend_per_mm(&self, course: usize) -> f64 {
        const STEPS: usize = 128;
        let h = 1.0 / STEPS as f64;
        let bend = |i: usize| {
            let u = i as f64 * h;
            let [a, b, c] = [u - h, u, u + h].map(|u| self.point(course as i64, u));
            let speed = 0.5 * (c - a);
            speed.cross(c - 2.0 * b + a).length() / speed.length().powi(3).max(1e-12)
        };
        (0..STEPS * self.wales).map(bend).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_testing::assert_contains;

    fn knit(name: &str) -> Knit {
        Knit::named(name, 1.0, 0.75, 0.1).unwrap()
    }

    #[test]
    fn courses_touch_and_do_not_overlap() {
        for name in NAMES {
            let k = knit(name);
            let clearance = k.clearance_mm() / 0.2;
            assert!((0.999..1.2).contains(&clearance), "{name}: {clearance}");
        }
    }

    /// Where the legs of the upper loop cross the head of the lower one, a
    /// face stitch lies in front of it and a back stitch behind; where its
    /// foot crosses the lower legs, the other way.
    #[test]
    fn loops_are_drawn_through_from_the_side_that_the_stitch_says() {
        for name in ["stockinette", "garter"] {
            let k = knit(name);
            for course in 0..2 {
                let mut seen = [0, 0];
                let n = 400;
                let point = |course, i: i64| k.point(course, i as f64 / n as f64);
                for i in 0..n {
                    for j in -n..2 * n {
                        let (a, b) = (point(course, i), point(course, i + 1));
                        let (c, d) = (point(course + 1, j), point(course + 1, j + 1));
                        let (r, s) = ((b - a).truncate(), (d - c).truncate());
                        let cross = r.perp_dot(s);
                        let gap = (c - a).truncate();
                        let (t, u) = (gap.perp_dot(s) / cross, gap.perp_dot(r) / cross);
                        if !(0.0..1.0).contains(&t) || !(0.0..1.0).contains(&u) {
                            continue;
                        }
                        // Nearer to the lower loop's head or to its legs?
                        let head = (i as f64 / n as f64 - 0.5).abs();
                        let foot = (j as f64 / n as f64).rem_euclid(1.0);
                        let foot = foot.min(1.0 - foot);
                        let leg_over_head = head < foot;
                        let upper_in_front = c.z > a.z;
                        let face = k.side(course + 1, 0) > 0.0;
                        assert_eq!(upper_in_front == face, leg_over_head, "{name} {i} {j}");
                        seen[usize::from(leg_over_head)] += 1;
                    }
                }
                assert_eq!(seen, [2, 2], "{name}: four crossings a loop");
            }
        }
    }

    #[test]
    fn wrong_knits_are_refused() {
        for (name, radius_mm, expected) in [
            ("stockinet", 0.1, "did you mean \"stockinette\""),
            ("stockinette", 0.4, "jammed"),
        ] {
            let error = Knit::named(name, 1.0, 0.7, radius_mm).unwrap_err();
            assert_contains(&error.to_string(), expected);
        }
    }
}
