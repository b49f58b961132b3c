//! Writers of curve files.

use super::BCC_HEADER;
use crate::Error;
use glam::Vec3;
use organza_basis::SegmentSource;
use std::io::Write;

/// One curve of a source.
#[derive(Clone, Copy, Debug)]
pub struct SourceCurve<'a> {
    /// Points and radii, millimetres; at least two.
    pub points_mm: &'a [(Vec3, f32)],
    /// Which yarn of the tile it belongs to.
    pub yarn: u32,
    /// Index into the cloth's materials.
    pub material: u16,
}

/// Hands over each curve of a source. Segments belong to one curve while they share yarn, fibre
/// and material and continue each other.
///
/// # Errors
/// The first of `take`, with which it ends.
pub fn for_each_curve(
    source: &dyn SegmentSource,
    mut take: impl FnMut(&SourceCurve<'_>) -> std::io::Result<()>,
) -> Result<(), Error> {
    let mut points: Vec<(Vec3, f32)> = Vec::new();
    let mut ids = (0, 0, 0);
    let mut result = Ok(());
    let mut hand_over = |points: &[(Vec3, f32)], (yarn, _, material): (u32, u32, u16)| {
        take(&SourceCurve {
            points_mm: points,
            yarn,
            material,
        })
    };
    for batch in 0..source.batch_count() {
        source.for_each_in_batch(batch, &mut |s| {
            let own = (s.yarn, s.fibre, s.material);
            let continues = ids == own && points.last() == Some(&(s.start_mm, s.start_radius_mm));
            if !continues {
                if !points.is_empty() && result.is_ok() {
                    result = hand_over(&points, ids);
                }
                points.clear();
                points.push((s.start_mm, s.start_radius_mm));
                ids = own;
            }
            points.push((s.end_mm, s.end_radius_mm));
        });
        // An error ends the export at the next batch.
        if result.is_err() {
            break;
        }
    }
    if !points.is_empty() && result.is_ok() {
        result = hand_over(&points, ids);
    }
    Ok(result?)
}

/// Writes `x y z r` per point in millimetres, a blank line between curves.
/// Numbers have as many digits as it takes to read them back exactly.
///
/// # Errors
/// When writing fails.
pub fn write_text(source: &dyn SegmentSource, out: &mut impl Write) -> Result<(), Error> {
    let mut first = true;
    for_each_curve(source, |curve| {
        if !std::mem::take(&mut first) {
            writeln!(out)?;
        }
        let points = curve.points_mm.iter();
        points
            .copied()
            .try_for_each(|(p, r)| writeln!(out, "{} {} {} {r}", p.x, p.y, p.z))
    })
}

/// Writes a binary curve collection of polylines, millimetres, z up. The
/// format holds no radii. Curves are generated twice: once to count them.
///
/// # Errors
/// When writing fails or a curve is too long for the format.
pub fn write_bcc(source: &dyn SegmentSource, out: &mut impl Write) -> Result<(), Error> {
    let (mut curves, mut points) = (0u64, 0u64);
    for_each_curve(source, |curve| {
        curves += 1;
        points += curve.points_mm.len() as u64;
        Ok(())
    })?;
    let mut header = Vec::with_capacity(BCC_HEADER);
    header.extend(b"BCC\x44PL\x03\x02");
    header.extend(curves.to_le_bytes());
    header.extend(points.to_le_bytes());
    header.extend(b"organza, millimetres");
    header.resize(BCC_HEADER, 0);
    out.write_all(&header)?;
    for_each_curve(source, |curve| {
        let count = i32::try_from(curve.points_mm.len()).map_err(std::io::Error::other)?;
        out.write_all(&count.to_le_bytes())?;
        for (p, _) in curve.points_mm {
            for v in p.to_array() {
                out.write_all(&v.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

/// Writes Wavefront OBJ polylines (`v` and `l`) in millimetres.
///
/// # Errors
/// When writing fails.
pub fn write_obj(source: &dyn SegmentSource, out: &mut impl Write) -> Result<(), Error> {
    writeln!(out, "# organza, millimetres")?;
    let mut first = 1;
    for_each_curve(source, |curve| {
        for (p, _) in curve.points_mm {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        write!(out, "l")?;
        for i in first..first + curve.points_mm.len() {
            write!(out, " {i}")?;
        }
        first += curve.points_mm.len();
        writeln!(out)
    })
}
