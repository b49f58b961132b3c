//! Writers of curve files.

use super::BCC_HEADER;
use crate::Error;
use glam::Vec3;
use organza_basis::SegmentSource;
use std::io::Write;

/// Hands over each curve of a source as points with radii. Segments belong to
/// one curve while they share yarn and fibre and continue each other.
fn for_each_curve(
    source: &dyn SegmentSource,
    mut take: impl FnMut(&[(Vec3, f32)]) -> std::io::Result<()>,
) -> Result<(), Error> {
    let mut curve: Vec<(Vec3, f32)> = Vec::new();
    let mut ids = (0, 0);
    let mut result = Ok(());
    for batch in 0..source.batch_count() {
        source.for_each_in_batch(batch, &mut |s| {
            let continues =
                ids == (s.yarn, s.fibre) && curve.last() == Some(&(s.start_mm, s.start_radius_mm));
            if !continues {
                if !curve.is_empty() && result.is_ok() {
                    result = take(&curve);
                }
                curve.clear();
                curve.push((s.start_mm, s.start_radius_mm));
                ids = (s.yarn, s.fibre);
            }
            curve.push((s.end_mm, s.end_radius_mm));
        });
        // An error ends the export at the next batch.
        if result.is_err() {
            break;
        }
    }
    if !curve.is_empty() && result.is_ok() {
        result = take(&curve);
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
        curve
            .iter()
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
        points += curve.len() as u64;
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
        let count = i32::try_from(curve.len()).map_err(std::io::Error::other)?;
        out.write_all(&count.to_le_bytes())?;
        for (p, _) in curve {
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
        for (p, _) in curve {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        write!(out, "l")?;
        for i in first..first + curve.len() {
            write!(out, " {i}")?;
        }
        first += curve.len();
        writeln!(out)
    })
}
