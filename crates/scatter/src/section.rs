//! Cross-sections of fibres: their names and outlines.

use crate::error::{Error, in_range};
use glam::DVec2;
use organza_basis::nearest_name;
use std::f64::consts::TAU;
use std::fmt;

/// The outline of a fibre's cross-section. Its size is that of the round fibre which is as
/// wide on average over all views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Section {
    /// A kidney, 1.8 times as wide as high: cotton, whose hollow fibres collapse
    /// [MortonHearle2008].
    Bean,
    /// Three rounded lobes, 1.7 times as far out as the hollows between them: the polyester
    /// and nylon of glossy cloth.
    Trilobal,
    /// A rounded triangle: degummed silk [MortonHearle2008].
    Triangle,
    /// A flat band with rounded corners, four times as wide as high: tape yarns and lurex.
    Ribbon,
    /// An ellipse of this ratio of its axes, 1 to 20.
    Ellipse(f32),
}

/// Names of the sections without numbers, in the order of the documentation.
pub const SECTIONS: [&str; 4] = ["bean", "trilobal", "triangle", "ribbon"];

/// Facets of the polygon that is traced.
const FACETS: usize = 240;
/// Places on the smooth outline from which its corners are chosen.
const FINE: usize = 8192;
/// Greatest ratio of the axes of an ellipse.
const MAX_RATIO: f32 = 20.0;

impl Section {
    /// The section of a name: one of [`SECTIONS`], or `ellipse:RATIO`.
    ///
    /// # Errors
    /// What was expected, with the nearest name.
    pub fn from_name(name: &str) -> Result<Section, String> {
        if let Some(ratio) = name.strip_prefix("ellipse:") {
            let ratio = ratio.trim().parse().ok();
            return match ratio.filter(|r| (1.0..=MAX_RATIO).contains(r)) {
                Some(ratio) => Ok(Section::Ellipse(ratio)),
                None => Err(format!(
                    "expected a ratio from 1 to 20 after `ellipse:`, found `{name}`"
                )),
            };
        }
        match name {
            "bean" => Ok(Section::Bean),
            "trilobal" => Ok(Section::Trilobal),
            "triangle" => Ok(Section::Triangle),
            "ribbon" => Ok(Section::Ribbon),
            _ => {
                let near = nearest_name(name, SECTIONS)
                    .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
                Err(format!(
                    "expected one of round, {} or ellipse:RATIO, found `{name}`{near}",
                    SECTIONS.join(", ")
                ))
            }
        }
    }

    /// Checks the ratio of an ellipse.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if let Section::Ellipse(ratio) = self {
            in_range("ellipse", *ratio, [1.0, MAX_RATIO], "1 to 20")?;
        }
        Ok(())
    }

    /// A point of the outline, of any size, at a parameter from 0 to 2 pi, anticlockwise.
    fn point(&self, t: f64) -> DVec2 {
        let (sin, cos) = t.sin_cos();
        match self {
            Section::Bean => {
                // An ellipse, bent.
                let x = 1.5 * cos;
                DVec2::new(x, 0.8 * sin - 0.28 * x * x)
            }
            Section::Trilobal => DVec2::new(cos, sin) * (1.0 + 0.25 * (3.0 * t).cos()),
            // From 0.1 the sides would be hollow.
            Section::Triangle => DVec2::new(cos, sin) * (1.0 + 0.09 * (3.0 * t).cos()),
            Section::Ribbon => {
                let size = (cos / 4.0).powi(4) + sin.powi(4);
                DVec2::new(cos, sin) * size.powf(-0.25)
            }
            Section::Ellipse(ratio) => DVec2::new(f64::from(*ratio) * cos, sin),
        }
    }

    /// The corners of the outline as a polygon, anticlockwise, in mean radii: its width is 2
    /// on average over all views. Facets turn by similar angles.
    pub fn outline(&self) -> Vec<DVec2> {
        let fine: Vec<DVec2> = (0..FINE)
            .map(|i| self.point(TAU * i as f64 / FINE as f64))
            .collect();
        let edge = |i: usize| fine[(i + 1) % FINE] - fine[i % FINE];
        let around: f64 = (0..FINE).map(|i| edge(i).length()).sum();
        // Most corners by how far the outline turns, some by its length.
        let mut passed = Vec::with_capacity(FINE + 1);
        passed.push(0.0);
        for i in 0..FINE {
            let turn = edge(i).angle_to(edge(i + 1)).abs();
            let own = turn + TAU / 4.0 * edge(i).length() / around;
            passed.push(passed[i] + own);
        }
        let all = passed[FINE];
        let mut corners: Vec<DVec2> = (0..FACETS)
            .map(|k| {
                let goal = all * k as f64 / FACETS as f64;
                let i = passed.partition_point(|p| *p <= goal).clamp(1, FINE);
                fine[i - 1]
            })
            .collect();
        corners.dedup();
        let scale = 2.0 / mean_width(&corners);
        corners.iter_mut().for_each(|c| *c *= scale);
        corners
    }

    /// Area of the section over that of the round fibre of the same mean width.
    pub fn area_share(&self) -> f64 {
        let corners = self.outline();
        let next = corners.iter().cycle().skip(1);
        let doubled: f64 = corners.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum();
        doubled / TAU
    }
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Section::Bean => f.write_str("bean"),
            Section::Trilobal => f.write_str("trilobal"),
            Section::Triangle => f.write_str("triangle"),
            Section::Ribbon => f.write_str("ribbon"),
            Section::Ellipse(ratio) => write!(f, "ellipse:{ratio}"),
        }
    }
}

/// Width of a polygon seen from within its plane, averaged over all views.
fn mean_width(corners: &[DVec2]) -> f64 {
    const VIEWS: usize = 720;
    let width = |i: usize| {
        let across = DVec2::from_angle(TAU * i as f64 / VIEWS as f64);
        let (low, high) = extent(corners, across);
        high - low
    };
    (0..VIEWS).map(width).sum::<f64>() / VIEWS as f64
}

/// From where to where a polygon reaches along a unit direction.
pub(crate) fn extent(corners: &[DVec2], along: DVec2) -> (f64, f64) {
    corners
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| {
            let x = c.dot(along);
            (low.min(x), high.max(x))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_mistakes_answered() {
        for name in SECTIONS {
            assert_eq!(Section::from_name(name).unwrap().to_string(), name);
        }
        assert_eq!(Section::from_name("ellipse:2.5"), Ok(Section::Ellipse(2.5)));
        let said = Section::from_name("trilobel").unwrap_err();
        let hint = "found `trilobel`; did you mean `trilobal`?";
        assert!(said.ends_with(hint), "{said}");
        for wrong in ["ellipse:0.5", "ellipse:nan", "ellipse:", "ellipse:1e9"] {
            assert!(Section::from_name(wrong).unwrap_err().contains("1 to 20"));
        }
    }

    #[test]
    fn outlines_are_two_wide_on_average() {
        for section in [
            Section::Bean,
            Section::Trilobal,
            Section::Triangle,
            Section::Ribbon,
            Section::Ellipse(1.0),
            Section::Ellipse(20.0),
        ] {
            let corners = section.outline();
            assert!((mean_width(&corners) - 2.0).abs() < 1e-9);
            // No facet turns by more than a few degrees.
            let n = corners.len();
            let edge = |i: usize| corners[(i + 1) % n] - corners[i % n];
            let most = (0..n).map(|i| edge(i).angle_to(edge(i + 1)).abs());
            let most = most.fold(0.0, f64::max).to_degrees();
            assert!(most < 6.0, "{section}: {most} degrees");
            let share = section.area_share();
            assert!(share > 0.1 && share < 1.0, "{section}: {share}");
        }
        assert!((Section::Ellipse(1.0).area_share() - 1.0).abs() < 1e-3);
    }
}
