//! The frame of the cloth in a scan: z out of the sheet, x along the weft `[Zhao2012]`.

use crate::ScannedField;
use glam::{DMat3, DVec3, UVec3};

/// Columns of the scan along its longer side for which heights are averaged.
const COLUMNS: u32 = 64;

/// Least strength of two thread systems at right angles, see [`ClothFrame::order`].
const MIN_ORDER: f64 = 0.15;

/// How a sheet of cloth lies in a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClothFrame {
    /// A point of the middle plane of the sheet, mm in the scan.
    pub origin_mm: DVec3,
    /// Columns are weft, warp and normal of the sheet in the scan: a rotation.
    pub scan_from_cloth: DMat3,
    /// Strength of two directions of fibre at right angles, in `[0, 1]`: the modulus of the mean
    /// of `exp(4 i phi)` over fibres, phi their azimuth in the sheet. 0 for fibres in all
    /// directions, `exp(-8 s^2)` for two bundles of deviation s (rad).
    pub order: f64,
}

impl ClothFrame {
    /// Angle between the normal and the axis of the scan that is nearest to it, degrees.
    pub fn tilt_deg(&self) -> f64 {
        let most = self.scan_from_cloth.z_axis.abs().max_element();
        most.min(1.0).acos().to_degrees()
    }

    /// Whether weft and warp could be told: if not, x is the scan's own in the plane.
    pub fn has_systems(&self) -> bool {
        self.order >= MIN_ORDER
    }
}

/// Finds the sheet in a field: a plane through the middle of the fibre of every column, and in
/// it the direction of the thread system that is nearest to the scan's first axis, which is
/// taken for the weft. The face is the side that looks up the scan's own axis.
///
/// `None` where there is no sheet: too little fibre, or a block as thick as it is wide.
pub fn cloth_frame(field: &ScannedField) -> Option<ClothFrame> {
    let normal_axis = thinnest_axis(field)?;
    // Right-handed: the two others follow the normal's axis.
    let [u, v] = [(normal_axis + 1) % 3, (normal_axis + 2) % 3];
    let columns = Columns::of(field, u, v, normal_axis);
    let (origin_mm, slope) = columns.plane(field)?;
    let mut normal = DVec3::ZERO;
    (normal[u], normal[v], normal[normal_axis]) = (-slope[0], -slope[1], 1.0);
    let normal = normal.normalize();
    // Of the scan's axes in the sheet, x goes first, and y where the sheet stands on x.
    let first = if normal_axis == 0 { DVec3::Y } else { DVec3::X };
    let across = (first - normal * first.dot(normal)).normalize();
    let plane = [across, normal.cross(across)];
    let (turn, order) = turn_of_fibres(field, &plane);
    let turn = if order >= MIN_ORDER { turn } else { 0.0 };
    let weft = plane[0] * turn.cos() + plane[1] * turn.sin();
    Some(ClothFrame {
        origin_mm,
        scan_from_cloth: DMat3::from_cols(weft, normal.cross(weft), normal),
        order,
    })
}

/// Centre of a voxel, mm.
fn place_mm(field: &ScannedField, cell: UVec3) -> DVec3 {
    field.min_mm + (cell.as_dvec3() + 0.5) * field.voxel_mm
}

/// The axis along which the fibre is least extended.
fn thinnest_axis(field: &ScannedField) -> Option<usize> {
    let (mut mass, mut sum, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO);
    field.for_each_filled(|cell, v| {
        let (p, w) = (place_mm(field, cell), f64::from(v.fill));
        mass += w;
        sum += w * p;
        squares += w * p * p;
    });
    if mass <= 0.0 {
        return None;
    }
    let variance = squares / mass - (sum / mass) * (sum / mass);
    let list = variance.to_array();
    let least = (0..3).min_by(|&a, &b| list[a].total_cmp(&list[b]))?;
    let others = (0..3).filter(|&k| k != least).map(|k| list[k]);
    // A tilt of 40 degrees spreads a sheet by 0.84 of its width.
    (list[least] < 0.8 * others.fold(0.0, f64::max)).then_some(least)
}

/// Fibre in columns along one axis.
struct Columns {
    axes: [usize; 3],
    count: [u32; 2],
    /// Mass, and sum of heights times mass.
    sums: Vec<[f64; 2]>,
}

impl Columns {
    fn of(field: &ScannedField, u: usize, v: usize, w: usize) -> Columns {
        let dims = field.dims();
        let longer = dims[u].max(dims[v]);
        let count = [u, v].map(|k| (dims[k] * COLUMNS).div_ceil(longer).min(dims[k]).max(1));
        let mut sums = vec![[0.0; 2]; (count[0] * count[1]) as usize];
        field.for_each_filled(|cell, voxel| {
            let i = (u64::from(cell[u]) * u64::from(count[0]) / u64::from(dims[u])) as u32;
            let j = (u64::from(cell[v]) * u64::from(count[1]) / u64::from(dims[v])) as u32;
            let sum = &mut sums[(j * count[0] + i) as usize];
            let mass = f64::from(voxel.fill);
            sum[0] += mass;
            sum[1] += mass * place_mm(field, cell)[w];
        });
        Columns {
            axes: [u, v, w],
            count,
            sums,
        }
    }

    /// A point of the plane through the mean heights, and its slopes. Columns count alike if
    /// they have fibre at all, so that thick places do not pull the plane.
    fn plane(&self, field: &ScannedField) -> Option<(DVec3, [f64; 2])> {
        let [u, v, w] = self.axes;
        let size = field.dims().as_dvec3() * field.voxel_mm;
        let typical = self.sums.iter().map(|s| s[0]).sum::<f64>() / self.sums.len() as f64;
        let points: Vec<[f64; 3]> = self
            .sums
            .iter()
            .enumerate()
            .filter(|(_, s)| s[0] > 0.1 * typical)
            .map(|(k, s)| {
                let (i, j) = (k as u32 % self.count[0], k as u32 / self.count[0]);
                let x = field.min_mm[u] + (f64::from(i) + 0.5) / f64::from(self.count[0]) * size[u];
                let y = field.min_mm[v] + (f64::from(j) + 0.5) / f64::from(self.count[1]) * size[v];
                [x, y, s[1] / s[0]]
            })
            .collect();
        if points.len() < 9 {
            return None;
        }
        let n = points.len() as f64;
        let mean = [0, 1, 2].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
        let moment = |a: usize, b: usize| -> f64 {
            let both = points.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b]));
            both.sum::<f64>() / n
        };
        let (xx, xy, yy, xz, yz) = (
            moment(0, 0),
            moment(0, 1),
            moment(1, 1),
            moment(0, 2),
            moment(1, 2),
        );
        let determinant = xx * yy - xy * xy;
        if determinant <= 0.0 {
            return None;
        }
        let slope = [
            (xz * yy - yz * xy) / determinant,
            (yz * xx - xz * xy) / determinant,
        ];
        let mut origin = DVec3::ZERO;
        (origin[u], origin[v], origin[w]) = (mean[0], mean[1], mean[2]);
        Some((origin, slope))
    }
}

/// Azimuth of the thread system nearest to the first direction of a plane, and the strength of
/// two systems at right angles.
fn turn_of_fibres(field: &ScannedField, plane: &[DVec3; 2]) -> (f64, f64) {
    let azimuth = |axis: DVec3| axis.dot(plane[1]).atan2(axis.dot(plane[0]));
    let in_plane = |axis: DVec3| axis.dot(plane[0]).powi(2) + axis.dot(plane[1]).powi(2);
    let (mut mass, mut re, mut im) = (0.0, 0.0, 0.0);
    field.for_each_filled(|_, v| {
        let axis = v.axis.as_dvec3();
        let weight = f64::from(v.fill * v.confidence) * in_plane(axis);
        let angle = 4.0 * azimuth(axis);
        mass += weight;
        re += weight * angle.cos();
        im += weight * angle.sin();
    });
    if mass <= 0.0 {
        return (0.0, 0.0);
    }
    let order = re.hypot(im) / mass;
    // Both systems at once, up to a quarter turn; then the weft alone, in case they are not at
    // right angles.
    let both = im.atan2(re) / 4.0;
    let (mut re, mut im) = (0.0, 0.0);
    field.for_each_filled(|_, v| {
        let axis = v.axis.as_dvec3();
        let off = azimuth(axis) - both;
        // Fibres of the other system have a negative cosine of twice the angle.
        let nearness = (2.0 * off).cos().max(0.0);
        let weight = f64::from(v.fill * v.confidence) * in_plane(axis) * nearness;
        re += weight * (2.0 * off).cos();
        im += weight * (2.0 * off).sin();
    });
    (both + 0.5 * im.atan2(re), order)
}
