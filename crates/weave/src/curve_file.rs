//! Curves in files: text, `.bcc` and `.obj`.

mod write;

pub use write::{SourceCurve, for_each_curve, write_bcc, write_obj, write_text};

use crate::Error;
use glam::Vec3;
use organza_basis::curve::SegmentList;
use organza_basis::{Aabb, Segment, Tile};

/// A curve through points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PolyCurve {
    /// Its points; a closed curve does not repeat the first.
    pub points_mm: Vec<Vec3>,
    /// Radius at each point.
    pub radii_mm: Vec<f32>,
    /// True when the last point is joined to the first.
    pub closed: bool,
}

/// The curves of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveSet {
    /// In the order of the file.
    pub curves: Vec<PolyCurve>,
}

/// Size of a `.bcc` header, bytes.
const BCC_HEADER: usize = 64;
/// Number of points on each span of a Catmull-Rom curve.
const SPAN_POINTS: usize = 8;

impl CurveSet {
    /// Reads lines of `x y z r`, a blank line between curves; `#` starts a
    /// comment. Numbers are in units of `unit_mm`.
    ///
    /// # Errors
    /// [`Error::Curves`] with the line where four finite numbers are missing
    /// or a radius is below zero.
    pub fn read_text(text: &str, unit_mm: f32) -> Result<CurveSet, Error> {
        let mut set = CurveSet::default();
        let mut curve = PolyCurve::default();
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or("").trim();
            if line.is_empty() {
                set.push(std::mem::take(&mut curve));
                continue;
            }
            let values: Vec<f32> = line
                .split_whitespace()
                .map_while(|w| w.parse().ok().filter(|v: &f32| v.is_finite()))
                .collect();
            match values.as_slice() {
                &[x, y, z, r] if r >= 0.0 && line.split_whitespace().count() == 4 => {
                    curve.points_mm.push(unit_mm * Vec3::new(x, y, z));
                    curve.radii_mm.push(unit_mm * r);
                }
                _ => {
                    return Err(wrong(
                        format!("line {}", number + 1),
                        format!("expected \"x y z r\" with finite numbers, found \"{line}\""),
                    ));
                }
            }
        }
        set.push(curve);
        set.some()
    }

    /// Reads a binary curve collection `[Yuksel2012]`: polylines (`PL`) as they are, uniform
    /// Catmull-Rom curves (`C0`) with eight points a span. The format stores neither unit nor
    /// radius: `unit_mm` and `radius_mm` give them.
    ///
    /// # Errors [`Error::Curves`] with the byte at which the file contradicts its header or is
    /// of another kind.
    pub fn read_bcc(bytes: &[u8], unit_mm: f32, radius_mm: f32) -> Result<CurveSet, Error> {
        let at = |offset: usize| format!("byte {offset}");
        let header = bytes
            .get(..BCC_HEADER)
            .filter(|h| h.starts_with(b"BCC"))
            .ok_or_else(|| wrong(at(0), "not a BCC file"))?;
        if header[3] != 0x44 || header[6] != 3 {
            let message = "only 4-byte integers and floats in 3 dimensions are read";
            return Err(wrong(at(3), message));
        }
        let smooth = match &header[4..6] {
            b"PL" => false,
            b"C0" => true,
            kind => {
                let kind = String::from_utf8_lossy(kind).into_owned();
                return Err(wrong(
                    at(4),
                    format!("expected curves PL or C0, found {kind}"),
                ));
            }
        };
        let count = u64::from_le_bytes(bytes[8..16].try_into().unwrap_or_default());
        let mut place = BCC_HEADER;
        let mut word = || {
            let word = bytes.get(place..place + 4).and_then(|b| b.try_into().ok());
            place += 4;
            word.ok_or_else(|| wrong(format!("byte {}", place - 4), "the file ends here"))
        };
        let mut set = CurveSet::default();
        for _ in 0..count {
            let points = i32::from_le_bytes(word()?);
            let mut curve = PolyCurve {
                closed: points < 0,
                ..PolyCurve::default()
            };
            for _ in 0..points.unsigned_abs() {
                let [x, y, z] = [word()?, word()?, word()?].map(f32::from_le_bytes);
                let point = unit_mm * Vec3::new(x, y, z);
                if !point.is_finite() {
                    return Err(wrong("a point", "has a coordinate that is not finite"));
                }
                curve.points_mm.push(point);
            }
            if smooth {
                curve.points_mm = catmull_rom(&curve.points_mm, curve.closed);
            }
            curve.radii_mm = vec![radius_mm; curve.points_mm.len()];
            set.push(curve);
        }
        set.some()
    }

    fn push(&mut self, curve: PolyCurve) {
        if curve.points_mm.len() > 1 {
            self.curves.push(curve);
        }
    }

    fn some(self) -> Result<CurveSet, Error> {
        if self.curves.is_empty() {
            return Err(wrong("the file", "holds no curve of two points or more"));
        }
        Ok(self)
    }

    /// The box around all points with their radii.
    pub fn bounds_mm(&self) -> Aabb {
        let all = self
            .curves
            .iter()
            .flat_map(|c| c.points_mm.iter().zip(&c.radii_mm));
        all.fold(Aabb::EMPTY, |b, (p, r)| {
            b.with_point(*p - Vec3::splat(*r))
                .with_point(*p + Vec3::splat(*r))
        })
    }

    /// The curves as segments in a tile that does not repeat. Each curve is a yarn.
    pub fn segments(&self) -> SegmentList {
        let mut segments = Vec::new();
        for (i, curve) in self.curves.iter().enumerate() {
            curve.for_each_segment(&mut |s| {
                segments.push(Segment {
                    yarn: i as u32,
                    ..*s
                });
            });
        }
        SegmentList {
            tile: Tile {
                bounds_mm: self.bounds_mm(),
                repeats: false,
            },
            segments,
        }
    }
}

impl PolyCurve {
    /// The pieces of the curve; tangents are those of the chord between a
    /// point's neighbours.
    pub fn for_each_segment(&self, emit: &mut dyn FnMut(&Segment)) {
        let n = self.points_mm.len();
        let last = if self.closed { n } else { n.saturating_sub(1) };
        let tangent = |i: usize| {
            let (a, b) = match (self.closed, i) {
                (true, i) => ((i + n - 1) % n, (i + 1) % n),
                (false, 0) => (0, 1),
                (false, i) => (i - 1, (i + 1).min(n - 1)),
            };
            (self.points_mm[b] - self.points_mm[a]).normalize_or(Vec3::X)
        };
        for i in 0..last {
            let j = (i + 1) % n;
            emit(&Segment {
                start_radius_mm: self.radii_mm[i],
                end_radius_mm: self.radii_mm[j],
                start_tangent: tangent(i),
                end_tangent: tangent(j),
                ..Segment::straight(self.points_mm[i], self.points_mm[j], 0.0)
            });
        }
    }
}

/// Points on the uniform Catmull-Rom spline; ends of an open one are repeated
/// by reflection.
pub(crate) fn catmull_rom(points: &[Vec3], closed: bool) -> Vec<Vec3> {
    let n = points.len() as isize;
    if n < 3 {
        return points.to_vec();
    }
    let at = |i: isize| match i {
        i if closed => points[i.rem_euclid(n) as usize],
        -1 => 2.0 * points[0] - points[1],
        i if i == n => 2.0 * points[i as usize - 1] - points[i as usize - 2],
        i => points[i as usize],
    };
    let spans = if closed { n } else { n - 1 };
    let mut curve = Vec::with_capacity(spans as usize * SPAN_POINTS + 1);
    for i in 0..spans {
        let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        curve.extend((0..SPAN_POINTS).map(|k| {
            let t = k as f32 / SPAN_POINTS as f32;
            let linear = 0.5 * (c - a);
            let square = a - 2.5 * b + 2.0 * c - 0.5 * d;
            let cubic = 1.5 * (b - c) + 0.5 * (d - a);
            b + t * (linear + t * (square + t * cubic))
        }));
    }
    if !closed {
        curve.push(points[points.len() - 1]);
    }
    curve
}

fn wrong(place: impl Into<String>, message: impl Into<String>) -> Error {
    Error::Curves {
        place: place.into(),
        message: message.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cloth, CurveLevel, FabricGeometry};
    use organza_basis::SegmentSource;

    fn cloth() -> Cloth {
        let fabric: FabricGeometry = toml::from_str(
            "draft.weave = 'twill-2-1'\nwarp.per_cm = 15\nweft.per_cm = 15\nyarn.cotton.plies = 2",
        )
        .unwrap();
        let none = |_: &str| Err(std::io::Error::other("no files"));
        Cloth::build(&fabric, &none, 3).unwrap()
    }

    type Written = (Vec<(Vec3, Vec3)>, Vec<u32>);

    /// Ends of all segments, and how many each curve has.
    fn all(source: &dyn SegmentSource) -> Written {
        let (mut ends, mut sizes, mut last) = (Vec::new(), Vec::new(), None);
        for batch in 0..source.batch_count() {
            source.for_each_in_batch(batch, &mut |s| {
                ends.push((s.start_mm, s.end_mm));
                if last != Some((s.yarn, s.fibre)) {
                    sizes.push(0);
                }
                *sizes.last_mut().unwrap() += 1;
                last = Some((s.yarn, s.fibre));
            });
        }
        (ends, sizes)
    }

    #[test]
    fn round_trips_are_exact_at_every_level() {
        let cloth = cloth();
        for level in [CurveLevel::Yarn, CurveLevel::Ply, CurveLevel::Fibre] {
            let source = cloth.curves(level);
            let mut text = Vec::new();
            write_text(&source, &mut text).unwrap();
            let text = String::from_utf8(text).unwrap();
            let from_text = CurveSet::read_text(&text, 1.0).unwrap();
            assert_eq!(all(&from_text.segments()), all(&source));
            let mut again = Vec::new();
            write_text(&from_text.segments(), &mut again).unwrap();
            assert_eq!(again, text.as_bytes(), "radii too");

            let mut bcc = Vec::new();
            write_bcc(&source, &mut bcc).unwrap();
            let from_bcc = CurveSet::read_bcc(&bcc, 1.0, 0.1).unwrap();
            assert_eq!(all(&from_bcc.segments()), all(&source));
            let mut again = Vec::new();
            write_bcc(&from_bcc.segments(), &mut again).unwrap();
            assert_eq!(again, bcc);

            let mut obj = Vec::new();
            write_obj(&source, &mut obj).unwrap();
            let obj = String::from_utf8(obj).unwrap();
            let lines = |start: &str| obj.lines().filter(|l| l.starts_with(start)).count();
            let (segments, curves) = all(&source);
            assert_eq!(
                (lines("v "), lines("l ")),
                (segments.len() + curves.len(), curves.len())
            );
        }
    }

    #[test]
    fn units_scale_and_closed_curves_close() {
        let set = CurveSet::read_text("0 0 0 1\n1 0 0 2 # a comment\n\n\n5 5 5 1\n", 10.0).unwrap();
        assert_eq!(set.curves.len(), 1, "a single point is no curve");
        assert_eq!(set.curves[0].points_mm[1], Vec3::new(10.0, 0.0, 0.0));
        assert_eq!(set.curves[0].radii_mm, [10.0, 20.0]);
        let mut bytes = b"BCC\x44C0\x03\x02".to_vec();
        bytes.extend(1u64.to_le_bytes());
        bytes.extend(4u64.to_le_bytes());
        bytes.resize(BCC_HEADER, 0);
        bytes.extend((-4i32).to_le_bytes());
        for v in [
            0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0,
        ] {
            bytes.extend(v.to_le_bytes());
        }
        let set = CurveSet::read_bcc(&bytes, 1.0, 0.1).unwrap();
        let segments = set.segments().segments;
        assert_eq!(segments.len(), 4 * SPAN_POINTS);
        assert_eq!(segments[4 * SPAN_POINTS - 1].end_mm, segments[0].start_mm);
        assert_eq!(
            segments[SPAN_POINTS].start_mm,
            Vec3::X,
            "control points lie on the curve"
        );
        for cut in [0, 10, BCC_HEADER, BCC_HEADER + 3, bytes.len() - 1] {
            assert!(CurveSet::read_bcc(&bytes[..cut], 1.0, 0.1).is_err());
        }
        bytes[8..16].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(
            CurveSet::read_bcc(&bytes, 1.0, 0.1).is_err(),
            "absurd counts end with the file"
        );
    }

    #[test]
    fn wrong_lines_are_named() {
        for (text, expected) in [
            ("0 0 0 1\n0 0 1\n", "line 2: expected"),
            ("0 0 0 1 7\n", "line 1"),
            ("0 0 nan 1\n", "line 1"),
            ("0 0 0 -1\n", "line 1"),
            ("\n\n", "the file: holds no curve"),
        ] {
            let error = CurveSet::read_text(text, 1.0).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
