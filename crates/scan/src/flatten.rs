//! A bent sheet made flat, in the frame of the cloth.

use crate::resample::{Mapping, resampled};
use crate::{ClothFrame, ScannedField};
use glam::{DMat3, DVec2, DVec3, UVec3};
use nalgebra::{DMatrix, DVector};

/// Columns along the longer side of the sheet for which heights are averaged.
const COLUMNS: f64 = 64.0;

/// Greatest total degree of the polynomial of heights.
pub const MAX_DEGREE: u32 = 6;

/// Greatest slope of a sheet that can be flattened.
const MAX_SLOPE: f64 = 1.0;

/// Voxels of nothing that are left above and below the sheet.
const MARGIN: f64 = 1.0;

/// Share of the fibre that may be cut off on either side of the sheet: flyaway noise.
const CUT: f64 = 5e-4;

/// Why a sheet cannot be flattened.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FlattenError {
    /// Too little fibre.
    #[error("there is too little fibre for a sheet of cloth")]
    Empty,
    /// Heights that are no function of the place.
    #[error("the sheet is too steep to be flattened: a slope of {0:.2}; at most 1 is possible")]
    Steep(f64),
    /// No rectangle of the flat sheet lies in the scan.
    #[error(
        "no rectangle of the cloth lies inside the scan once it is turned; scan a larger piece"
    )]
    NoRectangle,
}

/// A flat sheet.
#[derive(Clone, Debug)]
pub struct FlatSheet {
    /// The field: x along the weft from 0, y along the warp from 0, z out of the face, zero in
    /// the middle.
    pub field: ScannedField,
    /// Range of heights that was removed, mm, after the plane was.
    pub bend_mm: f64,
    /// Share of the fibre of the scan that the rectangle has.
    pub kept: f64,
}

/// Turns a field into the frame of its cloth, subtracts the heights of the middle surface, a
/// polynomial of total degree `degree` (0 subtracts the plane alone), and cuts out the largest
/// rectangle of cloth that lies in the scan.
///
/// The flat point `(x, y, z)` is the point at distance z along the normal from the middle
/// surface above `(x, y)`: thickness is kept, and axes turn with the surface. Lengths along
/// the sheet are those of its projection, which is shorter by half of the squared slope.
///
/// # Errors
/// Too little fibre, a sheet that is too steep, or none that fills a rectangle.
pub fn flattened(
    field: &ScannedField,
    frame: &ClothFrame,
    degree: u32,
) -> Result<FlatSheet, FlattenError> {
    let sheet = Sheet::fitted(field, frame, degree.min(MAX_DEGREE))?;
    let voxel = DVec3::splat(field.voxel_mm.min_element());
    let [low, high] = sheet.range_mm;
    let count = ((high - low) / voxel.truncate()).floor().max(DVec2::ONE);
    let (nx, ny) = (count.x as usize, count.y as usize);
    let box_mm = field.dims().as_dvec3() * field.voxel_mm;
    let is_inside = |x: usize, y: usize| {
        let at = low + (DVec2::new(x as f64, y as f64) + 0.5) * voxel.truncate();
        let [bottom, top] = sheet.thickness_mm;
        [bottom, top].iter().all(|&z| {
            let p = sheet.map(at.extend(z)).0 - field.min_mm;
            // The thickness may reach out of the box; the sides of the sheet may not.
            let k = sheet.normal_axis;
            (0..3).all(|a| a == k || (p[a] >= 0.0 && p[a] <= box_mm[a]))
        })
    };
    let inside: Vec<bool> = (0..nx * ny).map(|k| is_inside(k % nx, k / nx)).collect();
    let [x0, y0, x1, y1] = largest_rectangle(&inside, nx).ok_or(FlattenError::NoRectangle)?;
    let [bottom, top] = sheet.thickness_mm;
    let layers = ((top - bottom) / voxel.z).ceil() + 2.0 * MARGIN;
    let dims = UVec3::new((x1 - x0) as u32, (y1 - y0) as u32, layers as u32);
    let corner = low + DVec2::new(x0 as f64, y0 as f64) * voxel.truncate();
    let min_z = 0.5 * (bottom + top) - 0.5 * layers * voxel.z;
    let grid = (dims, corner.extend(min_z), voxel);
    let mut flat = resampled(field, grid, &sheet);
    flat.min_mm = DVec3::new(0.0, 0.0, -0.5 * layers * voxel.z);
    let mass = |f: &ScannedField| {
        let mut sum = 0.0;
        f.for_each_filled(|_, v| sum += f64::from(v.fill));
        sum * f.voxel_mm.element_product()
    };
    let kept = mass(&flat) / mass(field);
    if kept.is_nan() || kept <= 0.0 {
        return Err(FlattenError::NoRectangle);
    }
    Ok(FlatSheet {
        field: flat,
        bend_mm: sheet.bend_mm,
        kept,
    })
}

/// The middle surface of a sheet in the frame of its cloth.
struct Sheet {
    frame: ClothFrame,
    /// The scan's axis that is nearest to the normal.
    normal_axis: usize,
    degree: u32,
    /// Coefficients of `x^i y^j` of the place in units of `unit_mm` from `middle_mm`.
    coefficients: Vec<f64>,
    middle_mm: DVec2,
    unit_mm: f64,
    /// Extent of the fibre along the sheet.
    range_mm: [DVec2; 2],
    /// Extent along the normal.
    thickness_mm: [f64; 2],
    bend_mm: f64,
}

/// The powers of x and y up to a total degree.
fn powers(degree: u32) -> impl Iterator<Item = (i32, i32)> {
    let degree = degree as i32;
    (0..=degree).flat_map(move |i| (0..=degree - i).map(move |j| (i, j)))
}

impl Sheet {
    fn fitted(
        field: &ScannedField,
        frame: &ClothFrame,
        degree: u32,
    ) -> Result<Sheet, FlattenError> {
        let cloth_from_scan = frame.scan_from_cloth.transpose();
        let place = |cell: UVec3| {
            let p = field.min_mm + (cell.as_dvec3() + 0.5) * field.voxel_mm;
            cloth_from_scan * (p - frame.origin_mm)
        };
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        field.for_each_filled(|cell, _| {
            let p = place(cell);
            (low, high) = (low.min(p), high.max(p));
        });
        if !(low.is_finite() && (high - low).truncate().min_element() > 0.0) {
            return Err(FlattenError::Empty);
        }
        let size = (high - low).truncate();
        let unit_mm = 0.5 * size.max_element();
        let cell_mm = size.max_element() / COLUMNS;
        let nx = (size.x / cell_mm).ceil() as usize + 1;
        let ny = (size.y / cell_mm).ceil() as usize + 1;
        let mut columns = vec![[0.0f64; 2]; nx * ny];
        field.for_each_filled(|cell, v| {
            let p = place(cell);
            let at = ((p - low).truncate() / cell_mm).as_uvec2();
            let column = &mut columns[at.y as usize * nx + at.x as usize];
            column[0] += f64::from(v.fill);
            column[1] += f64::from(v.fill) * p.z;
        });
        let mut sheet = Sheet {
            frame: *frame,
            normal_axis: frame.scan_from_cloth.z_axis.abs().max_position(),
            degree,
            coefficients: Vec::new(),
            middle_mm: 0.5 * (low + high).truncate(),
            unit_mm,
            range_mm: [low.truncate(), high.truncate()],
            thickness_mm: [0.0; 2],
            bend_mm: 0.0,
        };
        let typical = columns.iter().map(|c| c[0]).sum::<f64>() / columns.len() as f64;
        let points: Vec<(DVec2, f64)> = columns
            .iter()
            .enumerate()
            .filter(|(_, c)| c[0] > 0.2 * typical)
            .map(|(k, c)| {
                let at = DVec2::new((k % nx) as f64 + 0.5, (k / nx) as f64 + 0.5);
                (low.truncate() + at * cell_mm, c[1] / c[0])
            })
            .collect();
        sheet.fit(&points)?;
        let mut heights: Vec<(f64, f64)> = Vec::new();
        let mut steepest = 0.0f64;
        field.for_each_filled(|cell, v| {
            let p = place(cell);
            let (height, slope) = sheet.height(p.truncate());
            steepest = steepest.max(slope.length());
            // Distance along the normal, to first order.
            let off = (p.z - height) / (1.0 + slope.length_squared()).sqrt();
            heights.push((off, f64::from(v.fill)));
        });
        if steepest > MAX_SLOPE {
            return Err(FlattenError::Steep(steepest));
        }
        heights.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mass: f64 = heights.iter().map(|h| h.1).sum();
        let quantile = |share: f64| {
            let mut sum = 0.0;
            let found = heights.iter().find(|h| {
                sum += h.1;
                sum >= share * mass
            });
            found.map_or(0.0, |h| h.0)
        };
        let half = 0.5 * field.voxel_mm.max_element();
        sheet.thickness_mm = [quantile(CUT) - half, quantile(1.0 - CUT) + half];
        let surface = points.iter().map(|p| sheet.height(p.0).0);
        let (least, most) = surface.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| {
            (a.min(h), b.max(h))
        });
        sheet.bend_mm = (most - least).max(0.0);
        Ok(sheet)
    }

    /// Least squares of the heights, each column alike.
    fn fit(&mut self, points: &[(DVec2, f64)]) -> Result<(), FlattenError> {
        let count = powers(self.degree).count();
        if points.len() < 3 * count {
            return Err(FlattenError::Empty);
        }
        let mut matrix = DMatrix::<f64>::zeros(count, count);
        let mut right = DVector::<f64>::zeros(count);
        for (at, height) in points {
            let q = (*at - self.middle_mm) / self.unit_mm;
            let row: Vec<f64> = powers(self.degree)
                .map(|(i, j)| q.x.powi(i) * q.y.powi(j))
                .collect();
            for (i, a) in row.iter().enumerate() {
                right[i] += a * height;
                for (j, b) in row.iter().enumerate() {
                    matrix[(i, j)] += a * b;
                }
            }
        }
        // A little weight on no heights at all keeps narrow strips solvable.
        let ridge = 1e-9 * points.len() as f64;
        for k in 0..count {
            matrix[(k, k)] += ridge;
        }
        let solved = matrix.cholesky().ok_or(FlattenError::Empty)?.solve(&right);
        self.coefficients = solved.iter().copied().collect();
        Ok(())
    }

    /// Height of the middle surface and its slopes.
    fn height(&self, at_mm: DVec2) -> (f64, DVec2) {
        let q = (at_mm - self.middle_mm) / self.unit_mm;
        let (mut height, mut slope) = (0.0, DVec2::ZERO);
        for ((i, j), c) in powers(self.degree).zip(&self.coefficients) {
            height += c * q.x.powi(i) * q.y.powi(j);
            if i > 0 {
                slope.x += c * f64::from(i) * q.x.powi(i - 1) * q.y.powi(j);
            }
            if j > 0 {
                slope.y += c * f64::from(j) * q.x.powi(i) * q.y.powi(j - 1);
            }
        }
        (height, slope / self.unit_mm)
    }

    /// The bent point above a flat one, in the frame of the cloth.
    fn bent(&self, p: DVec3) -> DVec3 {
        let (height, slope) = self.height(p.truncate());
        let normal = DVec3::new(-slope.x, -slope.y, 1.0).normalize();
        p.truncate().extend(height) + normal * p.z
    }
}

impl Mapping for Sheet {
    fn map(&self, p_mm: DVec3) -> (DVec3, DMat3) {
        let rotation = self.frame.scan_from_cloth;
        let step = 1e-4 * self.unit_mm;
        let quotient =
            |e: DVec3| (self.bent(p_mm + e * step) - self.bent(p_mm - e * step)) / (2.0 * step);
        let slopes = DMat3::from_cols(quotient(DVec3::X), quotient(DVec3::Y), quotient(DVec3::Z));
        (
            self.frame.origin_mm + rotation * self.bent(p_mm),
            rotation * slopes,
        )
    }
}

/// The largest rectangle of true cells in rows of `width`: x and y of its least corner and past
/// its greatest.
fn largest_rectangle(cells: &[bool], width: usize) -> Option<[usize; 4]> {
    let mut heights = vec![0usize; width];
    let mut best: Option<(usize, [usize; 4])> = None;
    for (y, row) in cells.chunks_exact(width).enumerate() {
        for (h, &is_in) in heights.iter_mut().zip(row) {
            *h = if is_in { *h + 1 } else { 0 };
        }
        // Columns whose rectangles are still open: where each began, and its height.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for x in 0..=width {
            let height = heights.get(x).copied().unwrap_or(0);
            let mut began = x;
            while let Some(&(from, tall)) = open.last() {
                if tall < height {
                    break;
                }
                open.pop();
                let area = tall * (x - from);
                if area > 0 && best.is_none_or(|(most, _)| area > most) {
                    best = Some((area, [from, y + 1 - tall, x, y + 1]));
                }
                began = from;
            }
            open.push((began, height));
        }
    }
    best.map(|b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth_frame;
    use crate::woven::Weave;

    /// Tilted by 11 degrees about an oblique axis of the plane, turned by 17 in it.
    fn rotation() -> DMat3 {
        let tilt = DMat3::from_axis_angle(DVec3::new(0.8, -0.6, 0.0), 11f64.to_radians());
        tilt * DMat3::from_rotation_z(17f64.to_radians())
    }

    /// A saddle and a wave, with slopes up to 0.3.
    fn height(x: f64, y: f64) -> (f64, DVec2) {
        (
            0.25 * x * x - 0.15 * x * y + 0.3 * y * y * y,
            DVec2::new(0.5 * x - 0.15 * y, -0.15 * x + 0.9 * y * y),
        )
    }

    /// The flat place that a bent one shows.
    fn unbent(p: DVec3) -> DVec3 {
        let mut flat = p;
        for _ in 0..30 {
            let (h, slope) = height(flat.x, flat.y);
            let length = (1.0 + slope.length_squared()).sqrt();
            flat.z = (p.z - h) * length;
            flat.x = p.x + slope.x * flat.z / length;
            flat.y = p.y + slope.y * flat.z / length;
        }
        flat
    }

    #[test]
    fn a_tilted_sheet_is_turned_into_its_own_frame() {
        let turn = rotation();
        let field = Weave::default().field([110, 100, 40], 0.01, &|p| turn.transpose() * p);
        let frame = cloth_frame(&field).unwrap();
        let error =
            |found: DVec3, truth: DVec3| found.dot(truth).abs().min(1.0).acos().to_degrees();
        assert!(frame.has_systems() && frame.order > 0.7, "{frame:?}");
        assert!(
            (frame.tilt_deg() - 11.0).abs() < 0.3,
            "{}",
            frame.tilt_deg()
        );
        let off = error(frame.scan_from_cloth.z_axis, turn.z_axis);
        assert!(off < 0.3, "normal off by {off} degrees");
        let off = error(frame.scan_from_cloth.x_axis, turn.x_axis);
        assert!(off < 0.4, "weft off by {off} degrees");
        assert!((frame.scan_from_cloth.determinant() - 1.0).abs() < 4.0 * f64::EPSILON);
        // The known-bad twin has no weft to be found.
        let strewn = Weave::default().strewn([60, 60, 12], 0.01);
        assert!(!cloth_frame(&strewn).unwrap().has_systems());
        // A block is no sheet.
        let mut block = ScannedField::empty(UVec3::splat(16), DVec3::splat(0.01), 0.004);
        for k in 0..4096u32 {
            let v = crate::ScannedVoxel {
                fill: 0.5,
                ..Default::default()
            };
            block.set(UVec3::new(k % 16, k / 16 % 16, k / 256), &v);
        }
        assert!(cloth_frame(&block).is_none());
    }

    #[test]
    fn a_bent_sheet_comes_out_flat_with_its_axes() {
        let (weave, turn) = (Weave::default(), rotation());
        let field = weave.field([120, 110, 56], 0.01, &|p| unbent(turn.transpose() * p));
        let frame = cloth_frame(&field).unwrap();
        let sheet = flattened(&field, &frame, 4).unwrap();
        let rest = |flat: &ScannedField| {
            // Heights of columns of a pitch about their mean, mm.
            let dims = flat.dims();
            let (nx, ny) = (dims.x as usize / 20, dims.y as usize / 20);
            let mut sums = vec![[0.0f64; 2]; nx * ny];
            flat.for_each_filled(|cell, v| {
                let (i, j) = (cell.x as usize / 20, cell.y as usize / 20);
                if i < nx && j < ny {
                    let z = flat.min_mm.z + (f64::from(cell.z) + 0.5) * flat.voxel_mm.z;
                    sums[j * nx + i][0] += f64::from(v.fill);
                    sums[j * nx + i][1] += f64::from(v.fill) * z;
                }
            });
            let heights: Vec<f64> = sums.iter().map(|s| s[1] / s[0]).collect();
            let mean = heights.iter().sum::<f64>() / heights.len() as f64;
            let square: f64 = heights.iter().map(|h| (h - mean).powi(2)).sum();
            (square / heights.len() as f64).sqrt()
        };
        let flat = rest(&sheet.field);
        assert!(flat < 0.0025, "{flat} mm of bend are left; a voxel is 0.01");
        assert!(sheet.bend_mm > 0.05 && sheet.kept > 0.4, "{sheet:?}");
        // Without the polynomial the bend stays: the known-bad twin.
        let plane = flattened(&field, &frame, 0).unwrap();
        assert!(rest(&plane.field) > 3.0 * flat && rest(&plane.field) > 0.01);
        assert!(plane.field.dims().z > sheet.field.dims().z);
        // Thickness of the weave: waves and half heights of 0.02 mm each way, and margins.
        let layers = sheet.field.dims().z;
        assert!((9..=13).contains(&layers), "{layers} layers");
        // Axes of both systems are along x and y again, but for waves of 32 degrees.
        let (mut cos, mut all) = (0.0, 0.0);
        sheet.field.for_each_filled(|_, v| {
            cos += f64::from(v.fill * v.axis.x.abs().max(v.axis.y.abs()));
            all += f64::from(v.fill);
        });
        let flat_field = weave.field([100, 100, 12], 0.01, &|p| p);
        let (mut wanted, mut whole) = (0.0, 0.0);
        flat_field.for_each_filled(|_, v| {
            wanted += f64::from(v.fill * v.axis.x.abs().max(v.axis.y.abs()));
            whole += f64::from(v.fill);
        });
        assert!(
            (cos / all - wanted / whole).abs() < 0.02,
            "{} {}",
            cos / all,
            wanted / whole
        );
    }
}
