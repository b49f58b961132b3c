//! Yarns told apart in a field: warp and weft by the direction of fibres, and each yarn by what
//! is connected `[Zhao2012]`.

use crate::{ScannedField, ScannedVoxel, ScannedYarn};
use glam::{IVec3, UVec3};

/// Voxels on either side over which directions are averaged.
const REACH: i32 = 2;

/// Least strength of two thread systems along x and y, see [`Segmented::order`].
const MIN_ORDER: f64 = 0.15;

/// Least part of the fibre that a system has.
const MIN_SHARE: f64 = 0.05;

/// Least depth of the valley between two yarns, as a share of the lower peak.
const MIN_VALLEY: f64 = 0.08;

/// Pieces smaller than this part of a yarn are given to the yarn around them.
const CRUMB: f64 = 0.02;

/// The systems of a woven sheet, in the order of their materials.
pub const SYSTEMS: [&str; 2] = ["weft", "warp"];

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segmented {
    /// Yarns of weft and warp.
    pub yarns: [usize; 2],
    /// Share of the fibre that each system has.
    pub share: [f64; 2],
    /// Mean of `cos(4 phi)`, phi the azimuth of fibres from the x axis: 1 for fibres along x
    /// and y alone, 0 for all directions.
    pub order: f64,
    /// Share of the fibre in pieces that were given to the yarn around them.
    pub corrected: f64,
}

/// Why a field has no yarns.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SegmentError {
    /// The directions of fibres show no two systems.
    #[error(
        "no warp and weft: the fibres do not run in two directions at right angles (order {0:.2}; \
         at least 0.15 is needed)"
    )]
    NoSystems(f64),
    /// One system has nearly all of the fibre.
    #[error("no warp and weft: one of them has {0:.1} % of the fibre; at least 5 % are needed")]
    OneSystem(f64),
}

/// Tells the yarns of a flat sheet apart, whose weft runs along x and whose warp along y. Voxels
/// get the number of their yarn; yarns get the name and the material of their system: `weft` and
/// 0, `warp` and 1.
///
/// # Errors
/// Fibres that do not show two systems; the field is unchanged then.
pub fn segment_yarns(field: &mut ScannedField) -> Result<Segmented, SegmentError> {
    let dims = field.dims();
    let order = order(field);
    if order < MIN_ORDER {
        return Err(SegmentError::NoSystems(order));
    }
    let mut labels = Labels::new(dims);
    field.for_each_filled(|cell, _| {
        labels.set(cell, Some(u16::from(leaning(field, cell) < 0.0)));
    });
    let mass = |labels: &Labels, label: u16| {
        let mut sum = 0.0;
        field.for_each_filled(|cell, v| {
            if labels.get(cell) == Some(label) {
                sum += f64::from(v.fill);
            }
        });
        sum
    };
    let all = mass(&labels, 0) + mass(&labels, 1);
    let crumbs = clear_crumbs(field, &mut labels, CRUMB * all / 20.0);
    let share = [mass(&labels, 0) / all, mass(&labels, 1) / all];
    let least = share[0].min(share[1]);
    if least < MIN_SHARE {
        return Err(SegmentError::OneSystem(100.0 * least));
    }
    // Yarns of a system lie side by side across its direction.
    let lanes = [lanes(field, &labels, 0, 1), lanes(field, &labels, 1, 0)];
    let mut yarns = Vec::new();
    for (material, (name, lanes)) in (0u16..).zip(SYSTEMS.iter().zip(&lanes)) {
        let yarn = ScannedYarn {
            name: (*name).into(),
            material,
        };
        yarns.extend(std::iter::repeat_n(yarn, lanes.count()));
    }
    let mut voxels: Vec<(UVec3, ScannedVoxel)> = Vec::new();
    field.for_each_filled(|cell, v| {
        let system = usize::from(labels.get(cell).unwrap_or(0));
        let across = [cell.y, cell.x][system];
        let first = if system == 0 { 0 } else { lanes[0].count() };
        let yarn = (first + lanes[system].of(across)) as u16;
        voxels.push((cell, ScannedVoxel { yarn, ..v }));
    });
    for (cell, v) in voxels {
        field.set(cell, &v);
    }
    field.yarns = yarns;
    Ok(Segmented {
        yarns: [lanes[0].count(), lanes[1].count()],
        share,
        order,
        corrected: crumbs / all,
    })
}

fn order(field: &ScannedField) -> f64 {
    let (mut sum, mut all) = (0.0, 0.0);
    field.for_each_filled(|_, v| {
        let weight = f64::from(v.fill * v.confidence * v.axis.truncate().length_squared());
        let azimuth = f64::from(v.axis.y).atan2(f64::from(v.axis.x));
        sum += weight * (4.0 * azimuth).cos();
        all += weight;
    });
    if all > 0.0 { sum / all } else { 0.0 }
}

/// Above zero where the fibres about a voxel run along x, below where along y.
fn leaning(field: &ScannedField, cell: UVec3) -> f32 {
    let mut sum = 0.0;
    each_near(field.dims(), cell, REACH, |near| {
        let v = field.voxel(near);
        if v.fill > 0.0 {
            // The voxel itself counts most; fibres across the border of yarns count little.
            let off = (near.as_vec3() - cell.as_vec3()).length_squared();
            let weight = v.fill * (0.1 + v.confidence) / (1.0 + off);
            sum += weight * (v.axis.x * v.axis.x - v.axis.y * v.axis.y);
        }
    });
    sum
}

/// Calls `visit` with the cells of a cube about a cell, as far as they exist.
fn each_near(dims: UVec3, cell: UVec3, reach: i32, mut visit: impl FnMut(UVec3)) {
    let low = (cell.as_ivec3() - reach).max(IVec3::ZERO).as_uvec3();
    let high = (cell + reach as u32).min(dims - 1);
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                visit(UVec3::new(x, y, z));
            }
        }
    }
}

/// A small number for every cell, or none.
struct Labels {
    dims: UVec3,
    list: Vec<u16>,
}

impl Labels {
    const NONE: u16 = u16::MAX;

    fn new(dims: UVec3) -> Labels {
        Labels {
            dims,
            list: vec![Labels::NONE; dims.as_usizevec3().element_product()],
        }
    }

    fn index(&self, cell: UVec3) -> usize {
        let (c, n) = (cell.as_usizevec3(), self.dims.as_usizevec3());
        (c.z * n.y + c.y) * n.x + c.x
    }

    fn get(&self, cell: UVec3) -> Option<u16> {
        let label = self.list[self.index(cell)];
        (label != Labels::NONE).then_some(label)
    }

    fn set(&mut self, cell: UVec3, label: Option<u16>) {
        let at = self.index(cell);
        self.list[at] = label.unwrap_or(Labels::NONE);
    }
}

/// Gives connected pieces of one label with less fibre than `least` to the label that most of
/// their neighbours have; the fibre of those pieces.
fn clear_crumbs(field: &ScannedField, labels: &mut Labels, least: f64) -> f64 {
    let dims = labels.dims;
    let mut seen = vec![false; labels.list.len()];
    let mut cells = Vec::new();
    field.for_each_filled(|cell, _| cells.push(cell));
    let mut cleared = 0.0;
    for start in cells {
        if std::mem::replace(&mut seen[labels.index(start)], true) {
            continue;
        }
        let label = labels.get(start);
        let (mut piece, mut mass, mut others) = (vec![start], 0.0, 0u64);
        let mut next = 0;
        while let Some(&cell) = piece.get(next) {
            next += 1;
            mass += f64::from(field.voxel(cell).fill);
            each_near(dims, cell, 1, |near| {
                let found = labels.get(near);
                if found.is_some() && found != label {
                    others += 1;
                } else if found.is_some() && !std::mem::replace(&mut seen[labels.index(near)], true)
                {
                    piece.push(near);
                }
            });
        }
        if mass < least && others > 0 {
            cleared += mass;
            for cell in piece {
                labels.set(cell, label.map(|l| 1 - l));
            }
        }
    }
    cleared
}

/// Yarns that lie side by side: where each ends.
struct Lanes {
    /// First cell past each yarn but the last.
    ends: Vec<u32>,
}

impl Lanes {
    fn count(&self) -> usize {
        self.ends.len() + 1
    }

    fn of(&self, cell: u32) -> usize {
        self.ends.iter().filter(|&&end| cell >= end).count()
    }
}

/// Yarns of a system along an axis: the fibre of its voxels is summed across it, and the valleys
/// between the peaks part the yarns.
fn lanes(field: &ScannedField, labels: &Labels, label: u16, axis: usize) -> Lanes {
    let count = labels.dims[axis] as usize;
    let mut profile = vec![0.0f64; count];
    field.for_each_filled(|cell, v| {
        if labels.get(cell) == Some(label) {
            profile[cell[axis] as usize] += f64::from(v.fill);
        }
    });
    // Single fibres are no yarns: smooth until the number of peaks no longer depends on it.
    let mut width = 1.0;
    let mut best: Vec<u32> = valleys(&smooth(&profile, width));
    while width < count as f64 / 8.0 {
        width *= 1.3;
        let next = valleys(&smooth(&profile, width));
        if next.len() == best.len() && width > 3.0 {
            break;
        }
        best = next;
    }
    Lanes { ends: best }
}

fn smooth(profile: &[f64], width: f64) -> Vec<f64> {
    let reach = (3.0 * width).ceil() as i64;
    let n = profile.len() as i64;
    (0..n)
        .map(|i| {
            let near = (i - reach).max(0)..=(i + reach).min(n - 1);
            let (mut sum, mut all) = (0.0, 0.0);
            for k in near {
                let weight = (-0.5 * ((k - i) as f64 / width).powi(2)).exp();
                sum += weight * profile[k as usize];
                all += weight;
            }
            sum / all
        })
        .collect()
}

/// Places of the valleys that are deep enough.
fn valleys(profile: &[f64]) -> Vec<u32> {
    let mut list: Vec<u32> = Vec::new();
    // The last peak, and the lowest place since.
    let (mut peak, mut low) = (0.0f64, (f64::INFINITY, 0u32));
    for (k, &v) in (0u32..).zip(profile) {
        if v < low.0 {
            low = (v, k);
        }
        let is_deep = |top: f64| low.0 < (1.0 - MIN_VALLEY) * top;
        if is_deep(peak) && is_deep(v) && v - low.0 > 0.25 * (peak - low.0).min(peak) {
            list.push(low.1);
            (peak, low) = (v, (v, k));
        }
        if v > peak {
            (peak, low) = (v, (v, k));
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::woven::Weave;
    use glam::DVec3;

    #[test]
    fn yarns_of_a_weave_are_told_apart() {
        let weave = Weave::default();
        // Ten yarns of 10 voxels each way, their edges at the edges of the box.
        let mut field = weave.field([100, 100, 12], 0.01, &|p| p);
        let found = segment_yarns(&mut field).unwrap();
        assert_eq!(found.yarns, [10, 10], "{found:?}");
        assert!(
            (found.share[0] - 0.5).abs() < 0.02 && found.order > 0.7,
            "{found:?}"
        );
        assert_eq!(field.yarns.len(), 20);
        assert_eq!(
            (field.yarns[0].name.as_str(), field.yarns[0].material),
            ("weft", 0)
        );
        assert_eq!(
            (field.yarns[19].name.as_str(), field.yarns[19].material),
            ("warp", 1)
        );
        let (mut wrong_system, mut wrong_yarn, mut all) = (0.0, 0.0, 0.0);
        field.for_each_filled(|cell, v| {
            let p = (cell.as_dvec3() + 0.5) * 0.01 - DVec3::new(0.5, 0.5, 0.06);
            let truth = weave.at(p).unwrap();
            let mass = f64::from(v.fill);
            let material = field.yarns[usize::from(v.yarn)].material;
            all += mass;
            if usize::from(material) != truth.system {
                wrong_system += mass;
            } else if i64::from(v.yarn) % 10 != truth.number + 5 {
                wrong_yarn += mass;
            }
        });
        assert!(wrong_system < 0.003 * all, "{}", wrong_system / all);
        assert!(
            wrong_yarn < 4.0 * f64::from(f32::EPSILON) * all,
            "{}",
            wrong_yarn / all
        );
    }

    #[test]
    fn fibre_in_all_directions_has_no_systems() {
        let mut field = Weave::default().strewn([60, 60, 12], 0.01);
        let before: Vec<String> = field.yarns.iter().map(|y| y.name.clone()).collect();
        let refused = segment_yarns(&mut field).unwrap_err();
        assert!(matches!(refused, SegmentError::NoSystems(order) if order < 0.1));
        assert_eq!(before, ["fibre"]);
        assert_eq!(field.yarns.len(), 1);
        // One system alone.
        let weave = Weave::default();
        let whole = weave.field([60, 60, 12], 0.01, &|p| p);
        let mut one = ScannedField::empty(whole.dims(), whole.voxel_mm, 0.004);
        whole.for_each_filled(|cell, v| {
            if v.axis.x.abs() > v.axis.y.abs() {
                one.set(cell, &v);
            }
        });
        let refused = segment_yarns(&mut one).unwrap_err();
        assert!(
            matches!(refused, SegmentError::OneSystem(share) if share < 1.0),
            "{refused:?}"
        );
    }
}
