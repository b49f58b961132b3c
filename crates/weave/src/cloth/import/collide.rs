//! Imported yarns that push each other aside.

use crate::Error;
use crate::curve_file::PolyCurve;
use crate::path::Path;
use crate::separate::{Line, Room, crowding, separate};
use glam::{DVec2, DVec3};

/// Length of a piece of a yarn, in its radii, and the least number of pieces of a yarn.
const PIECE_RADII: f64 = 1.5;
const LEAST_PIECES: f64 = 4.0;
/// The largest number of points on the yarns: pushing them apart takes about 200 bytes for each.
const MAX_POINTS: f64 = (1u64 << 19) as f64;
/// The largest crowding of their pieces, at which the pairs of neighbours take some 800 MB.
const MAX_CROWDING: u64 = 1 << 25;
/// How much wider than the curves a room is that does not repeat, in the largest radius.
const MARGIN_RADII: f64 = 16.0;
/// How near the end of a curve is to the beginning of its next copy where the yarn goes on there,
/// in its radii.
const JOINED_RADII: f64 = 0.5;

/// By how much the last point lies higher than the first, in the radius: yarns at one height pass
/// over those before them, and are not pushed aside by rounding errors.
const LIFT_RADII: f64 = 1e-6;

const KEY: &str = "draft.curves_collide";

/// Pushes yarns along curves apart, each with its radius, in a tile where they repeat. Afterwards
/// the curves have points that are about as far apart as yarns are thick.
pub(super) fn push_apart(
    curves: &mut [PolyCurve],
    radii_mm: &[f64],
    tile_mm: Option<DVec2>,
) -> Result<(), Error> {
    let mut most = 0.0;
    for (curve, radius_mm) in curves.iter().zip(radii_mm) {
        let pieces = curve.points_mm.windows(2);
        let chords = pieces.map(|p| p[0].as_dvec3().distance(p[1].as_dvec3()));
        most += chords.sum::<f64>() / (PIECE_RADII * radius_mm) + LEAST_PIECES;
        check_points(most)?;
    }
    let mut lines = Vec::with_capacity(curves.len());
    let mut points = 0.0;
    for (curve, &radius_mm) in curves.iter().zip(radii_mm) {
        let line = line(curve, radius_mm, tile_mm);
        points += line.points.len() as f64;
        check_points(points)?;
        lines.push(line);
    }
    let room = Room {
        size_mm: tile_mm.unwrap_or_else(|| size_without_copies(&lines)),
        faces_mm: [f64::NEG_INFINITY, f64::INFINITY],
    };
    if crowding(&lines, room) > MAX_CROWDING {
        let message = "too many yarns lie within one another; expected thinner yarns, or curves \
                       that are farther apart (draft.curve_unit_mm)";
        return Err(Error::spec(KEY, message));
    }
    let all = lines.iter_mut().flat_map(|l| {
        let radius_mm = l.radius_mm;
        l.points.iter_mut().map(move |p| (p, radius_mm))
    });
    for (i, (point, radius_mm)) in all.enumerate() {
        point.z += LIFT_RADII * radius_mm * i as f64 / points;
    }
    separate(&mut lines, room);
    for (curve, line) in curves.iter_mut().zip(lines) {
        let last = match line.period {
            Some(p) if !curve.closed => Some(line.points[0] + p),
            _ => None,
        };
        let points = line.points.into_iter().chain(last);
        curve.points_mm = points.map(|p| p.as_vec3()).collect();
        curve.radii_mm = vec![line.radius_mm as f32; curve.points_mm.len()];
    }
    Ok(())
}

fn check_points(points: f64) -> Result<(), Error> {
    if points <= MAX_POINTS {
        return Ok(());
    }
    let message = format!(
        "expected at most {MAX_POINTS} pieces of yarn, each {PIECE_RADII} radii long; shorter \
         curves or thicker yarns have fewer"
    );
    Err(Error::spec(KEY, message))
}

/// The smooth line through the points of a curve, in equal pieces.
fn line(curve: &PolyCurve, radius_mm: f64, tile_mm: Option<DVec2>) -> Line {
    let mut points: Vec<DVec3> = curve.points_mm.iter().map(|p| p.as_dvec3()).collect();
    let apart = points[points.len() - 1] - points[0];
    let to_copy = tile_mm.map(|size| ((apart.truncate() / size).round() * size).extend(0.0));
    let period = match to_copy {
        _ if curve.closed => Some(DVec3::ZERO),
        // A yarn that goes on in its next copy gives way alike on both sides.
        Some(to_copy) if to_copy != DVec3::ZERO => {
            (apart.distance(to_copy) <= JOINED_RADII * radius_mm).then_some(to_copy)
        }
        _ => None,
    };
    if period.is_some() && !curve.closed {
        points.pop();
    }
    let path = Path::through(&points, period, PIECE_RADII * radius_mm);
    let length_mm = path.length_mm();
    // More pieces than these are refused.
    let pieces = (length_mm / (PIECE_RADII * radius_mm)).ceil();
    let pieces = pieces.clamp(LEAST_PIECES, 2.0 * MAX_POINTS) as usize;
    let count = match period {
        Some(_) => pieces,
        None => pieces + 1,
    };
    let at = |i: usize| path.at_arc(length_mm * i as f64 / pieces as f64, DVec2::ZERO);
    Line {
        points: (0..count).map(at).collect(),
        radius_mm,
        period,
        held: Vec::new(),
    }
}

/// The size of a room so large that no line meets a copy of another.
fn size_without_copies(lines: &[Line]) -> DVec2 {
    let points = || lines.iter().flat_map(|l| &l.points).map(|p| p.truncate());
    let low = points().fold(DVec2::INFINITY, DVec2::min);
    let high = points().fold(DVec2::NEG_INFINITY, DVec2::max);
    let thickest = lines.iter().map(|l| l.radius_mm).fold(0.0, f64::max);
    high - low + MARGIN_RADII * thickest
}
