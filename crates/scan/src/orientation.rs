//! Fibre orientation by the structure tensor `[Weickert1999]`, block by block.
//!
//! Gradients of a Gaussian scale are multiplied with each other and averaged over a second
//! Gaussian. Grey values change least along a fibre, so the eigenvector of the least eigenvalue is
//! its axis. Both scales are proportional to the fibre radius.
//!
//! Near the outline of a fibre the outlines of its neighbours are as close as its own. Every voxel
//! therefore climbs on the smoothed filling to the middle of its fibre and takes the axis there.

use crate::field::ScannedVoxel;
use crate::levels::Levels;
use crate::smooth::{ValueBox, gaussian, reach};
use crate::window::Window;
use glam::{DVec3, UVec3, Vec3};
use organza_basis::Sym3;

/// Edge of the blocks that threads work on, in voxels.
pub(crate) const CORE: usize = 64;

/// Deviation of the Gaussian for the filling that voxels climb on, in fibre radii.
const RIDGE_RADII: f32 = 0.4;

/// Greatest cosine between a step of the climb and the voxel's own axis: fibres are thickest
/// where they touch others, and voxels must not climb there.
const ALONG: f32 = 0.45;

/// Least squared cosine between the axis that a voxel climbs to and its own: 25 degrees.
const SAME_FIBRE: f32 = 0.82;

/// Voxels around one of fibre whose partial filling counts: the width of a blurred edge.
const EDGE: usize = 2;

/// Voxels that a fourth-order difference reaches.
const DIFFERENCE: usize = 2;

/// The scales of a scan, ready for use.
#[derive(Clone, Debug)]
pub(crate) struct Scales {
    gradient: [Vec<f32>; 3],
    tensor: [Vec<f32>; 3],
    /// Smooths the filling that voxels climb on.
    ridge: [Vec<f32>; 3],
    /// Voxels that a voxel may climb.
    climb: usize,
    /// Voxels between the axes that are compared with each other.
    step: [usize; 3],
    per_mm: Vec3,
}

impl Scales {
    pub fn new(
        voxel_mm: DVec3,
        fibre_radius_mm: f32,
        gradient_radii: f32,
        tensor_radii: f32,
    ) -> Scales {
        let per_mm = (1.0 / voxel_mm).as_vec3();
        // Below 0.6 voxels a Gaussian is no longer one, above 12 a block has no core.
        let kernels = |radii: f32, most: f32| {
            let sigma = |axis: usize| (radii * fibre_radius_mm * per_mm[axis]).clamp(0.6, most);
            [0, 1, 2].map(|axis| gaussian(sigma(axis)))
        };
        let step = (0.5 * fibre_radius_mm * per_mm).round();
        let climb = (1.2 * fibre_radius_mm * per_mm.max_element()).ceil();
        Scales {
            gradient: kernels(gradient_radii, 6.0),
            tensor: kernels(tensor_radii, 12.0),
            ridge: kernels(RIDGE_RADII, 6.0),
            climb: (climb as usize).clamp(1, 16),
            step: [step.x, step.y, step.z].map(|s| (s as usize).clamp(1, 8)),
            per_mm,
        }
    }

    /// Voxels around a core whose axes its voxels may take.
    fn margin(&self) -> [usize; 3] {
        self.step.map(|s| s + self.climb)
    }

    /// Voxels that one voxel's result depends on, to either side.
    pub fn reach(&self) -> [usize; 3] {
        let margin = self.margin();
        [0, 1, 2].map(|a| {
            let tensor = reach(&self.tensor[a]) + reach(&self.gradient[a]) + DIFFERENCE;
            margin[a] + tensor.max(reach(&self.ridge[a]) + 1).max(EDGE)
        })
    }

    /// Bytes that a thread takes for a block of this many slices.
    pub fn block_bytes(&self, slices: usize) -> u64 {
        let r = self.reach();
        let edge = |axis: usize, core: usize| (core + 2 * r[axis]) as u64;
        // The block, its gradients, and what smoothing them takes at a time.
        let whole = edge(0, CORE) * edge(1, CORE) * edge(2, slices);
        4 * whole * 14
    }
}

/// What the tensors of a block say, besides the voxels.
pub(crate) struct Analysed {
    /// Every voxel of the core with fibre, and its place in the core.
    pub voxels: Vec<(UVec3, ScannedVoxel)>,
    /// Least eigenvalue over the trace, of each of these voxels.
    pub residues: Vec<f32>,
}

/// A box of a volume that is analysed at a time: its first voxel and its size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Core {
    pub x: usize,
    pub y: usize,
    pub z: i64,
    pub size: [usize; 3],
}

/// An axis with what is known of it.
#[derive(Clone, Copy, Debug, Default)]
struct Axis {
    axis: Vec3,
    confidence: f32,
    /// Mean squared sine of tangents about the axis, from the eigenvalues.
    sin_sq: f32,
    residue: f32,
    /// Fill of the voxel; zero where it holds no fibre.
    fill: f32,
}

/// Finds the voxels of a core. `residue` is the share of the trace that noise leaves to the
/// least eigenvalue even of straight fibres.
pub(crate) fn analyse(
    window: &Window,
    core: Core,
    levels: &Levels,
    scales: &Scales,
    residue: f32,
) -> Analysed {
    let empty = Analysed {
        voxels: Vec::new(),
        residues: Vec::new(),
    };
    let (step, margin) = (scales.step, scales.margin());
    // Axes are also needed around the core.
    let wide: [usize; 3] = std::array::from_fn(|a| core.size[a] + 2 * margin[a]);
    let fill = fills(window, core, wide, margin, levels);
    let near_core = |i: usize, by: [usize; 3]| {
        let at = place(i, wide);
        let inside =
            |a: usize| at[a] + by[a] >= margin[a] && at[a] < margin[a] + core.size[a] + by[a];
        (0..3).all(inside)
    };
    if !(0..fill.data.len()).any(|i| fill.data[i] > 0.0 && near_core(i, [0; 3])) {
        return empty;
    }
    let ridge = ridge(window, core, wide, scales, levels);
    let tensors = tensors(window, core, scales, levels);
    let mut at_place: Vec<Option<Axis>> = vec![None; fill.data.len()];
    let axes: Vec<Axis> = (0..fill.data.len())
        .map(|i| match fill.data[i] {
            own if own > 0.0 && near_core(i, step) => {
                let mut at = |i: usize| {
                    *at_place[i].get_or_insert_with(|| {
                        axis_of(std::array::from_fn(|k| tensors[k].data[i]), residue)
                    })
                };
                let below = at(i);
                let found = at(climb(&ridge, i, wide, below.axis, scales));
                let found = match found.axis.dot(below.axis).powi(2) >= SAME_FIBRE {
                    true => found,
                    false => below,
                };
                Axis { fill: own, ..found }
            }
            _ => Axis::default(),
        })
        .collect();
    let mut found = empty;
    let strides = [1, wide[0], wide[0] * wide[1]];
    for (i, own) in axes.iter().enumerate() {
        if own.fill <= 0.0 || !near_core(i, [0; 3]) {
            continue;
        }
        let dispersion = dispersion(&axes, i, strides, step);
        let voxel = ScannedVoxel {
            fill: own.fill,
            axis: own.axis,
            mean_sin_sq: own.sin_sq.max(dispersion).min(0.5),
            confidence: own.confidence,
            yarn: 0,
        };
        let at = place(i, wide);
        let at: [usize; 3] = std::array::from_fn(|a| at[a] - margin[a]);
        found
            .voxels
            .push((UVec3::from(at.map(|n| n as u32)), voxel));
        found.residues.push(own.residue);
    }
    found
}

/// The index that a voxel climbs to, across its axis, from neighbour to highest neighbour.
fn climb(ridge: &ValueBox, from: usize, wide: [usize; 3], axis: Vec3, scales: &Scales) -> usize {
    // The block of heights is one voxel larger on each side.
    let strides = [1, ridge.dims[0], ridge.dims[0] * ridge.dims[1]];
    let mm = 1.0 / scales.per_mm;
    let mut steps = [(0isize, [0isize; 3]); 26];
    let mut count = 0;
    for i in (0..27).filter(|i| *i != 13) {
        let d = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
        let along = Vec3::new(d[0] as f32, d[1] as f32, d[2] as f32) * mm;
        if along.dot(axis).abs() <= ALONG * along.length() {
            let offset = (0..3).map(|a| d[a] * strides[a] as isize).sum();
            steps[count] = (offset, d);
            count += 1;
        }
    }
    let mut at = place(from, wide);
    for _ in 0..scales.climb {
        let here = ridge.index(at[0] + 1, at[1] + 1, at[2] + 1);
        let mut best = (ridge.data[here], [0; 3]);
        for (offset, d) in &steps[..count] {
            let height = ridge.data[here.wrapping_add_signed(*offset)];
            if height > best.0 {
                best = (height, *d);
            }
        }
        let next: [usize; 3] = std::array::from_fn(|a| at[a].wrapping_add_signed(best.1[a]));
        // Beyond the axes that were found there is nothing to take.
        if next == at || (0..3).any(|a| next[a] >= wide[a]) {
            break;
        }
        at = next;
    }
    at[0] + wide[0] * (at[1] + wide[1] * at[2])
}

/// The smoothed filling of a box and of one voxel around it.
fn ridge(
    window: &Window,
    core: Core,
    wide: [usize; 3],
    scales: &Scales,
    levels: &Levels,
) -> ValueBox {
    let margin = scales.margin();
    let around: [usize; 3] = std::array::from_fn(|a| reach(&scales.ridge[a]) + 1);
    let dims = std::array::from_fn(|a| wide[a] + 2 * around[a]);
    let before = std::array::from_fn(|a| margin[a] + around[a]);
    let mut grey = copy(window, core, dims, before);
    for v in &mut grey.data {
        *v = levels.fill(*v).clamp(-0.5, 1.5);
    }
    let [x, y, z] = &scales.ridge;
    grey.smoothed([x, y, z])
}

/// Place of an index in a box.
fn place(i: usize, dims: [usize; 3]) -> [usize; 3] {
    [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]]
}

/// Mean squared sine about their common axis of the axes of a voxel and its neighbours one step
/// away: half of that between pairs.
fn dispersion(axes: &[Axis], i: usize, strides: [usize; 3], step: [usize; 3]) -> f32 {
    let own = &axes[i];
    let (mut sum, mut weight) = (0.0, 0.0);
    for a in 0..3 {
        for other in [i - step[a] * strides[a], i + step[a] * strides[a]] {
            let n = &axes[other];
            let w = n.fill * n.confidence;
            sum += w * own.axis.cross(n.axis).length_squared();
            weight += w;
        }
    }
    if weight > 0.0 {
        0.5 * sum / weight
    } else {
        0.0
    }
}

/// Axis, confidence and dispersion from a tensor.
///
/// Gradients are perpendicular to the tangents; where tangents have a mean squared sine q about
/// the axis, evenly around it, the least eigenvalue is q / 2 of the trace.
fn axis_of(tensor: [f32; 6], residue: f32) -> Axis {
    let sym = Sym3::from_array(tensor);
    let trace = sym.trace();
    if trace <= 0.0 {
        return Axis {
            axis: Vec3::Z,
            ..Axis::default()
        };
    }
    let [(l1, _), (l2, _), (l3, axis)] = sym.scaled(1.0 / trace).eigen();
    // Noise gives every eigenvalue the same.
    let (own, whole) = (l3 - residue, 1.0 - 3.0 * residue);
    Axis {
        axis,
        confidence: ((l2 - l3) / l1.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0),
        sin_sq: (2.0 * own / whole.max(1e-3)).clamp(0.0, 0.5),
        residue: l3,
        fill: 0.0,
    }
}

/// A copy of a window's box that begins `before` voxels ahead of the core; values beyond an edge
/// of the volume equal those at the edge.
fn copy(window: &Window, core: Core, dims: [usize; 3], before: [usize; 3]) -> ValueBox {
    let mut block = ValueBox::zeros(dims);
    let from = |at: usize, before: usize, i: usize, most: usize| {
        (at + i).saturating_sub(before).min(most - 1)
    };
    for z in 0..dims[2] {
        let slice = core.z - before[2] as i64 + z as i64 - window.first;
        let slice = slice.clamp(0, window.count() as i64 - 1) as usize;
        for y in 0..dims[1] {
            let row = from(core.y, before[1], y, window.ny);
            let row = &window.data[(slice * window.ny + row) * window.nx..][..window.nx];
            let start = block.index(0, y, z);
            for (x, o) in block.data[start..start + dims[0]].iter_mut().enumerate() {
                *o = row[from(core.x, before[0], x, window.nx)];
            }
        }
    }
    block
}

/// Share of fibre in the voxels of a box, zero where no voxel near exceeds the threshold.
fn fills(
    window: &Window,
    core: Core,
    wide: [usize; 3],
    margin: [usize; 3],
    levels: &Levels,
) -> ValueBox {
    let dims = wide.map(|n| n + 2 * EDGE);
    let grey = copy(window, core, dims, margin.map(|m| m + EDGE));
    let mut near: Vec<u8> = grey
        .data
        .iter()
        .map(|&v| u8::from(v >= levels.threshold))
        .collect();
    let strides = [1, dims[0], dims[0] * dims[1]];
    for (a, &stride) in strides.iter().enumerate() {
        let before = near.clone();
        for (i, n) in near.iter_mut().enumerate() {
            let at = place(i, dims)[a];
            let low = at.min(EDGE);
            let high = (dims[a] - 1 - at).min(EDGE);
            *n |= (i - low * stride..=i + high * stride)
                .step_by(stride)
                .fold(0, |m, j| m | before[j]);
        }
    }
    let mut out = ValueBox::zeros(wide);
    for i in 0..out.data.len() {
        let [x, y, z] = place(i, wide);
        let j = grey.index(x + EDGE, y + EDGE, z + EDGE);
        if near[j] == 1 {
            out.data[i] = levels.fill(grey.data[j]).clamp(0.0, 1.0);
        }
    }
    out
}

/// The six averaged products of gradients in the core and its margin.
fn tensors(window: &Window, core: Core, scales: &Scales, levels: &Levels) -> [ValueBox; 6] {
    let r = scales.reach();
    let tensor = [0, 1, 2].map(|a| reach(&scales.tensor[a]));
    let gradient = [0, 1, 2].map(|a| reach(&scales.gradient[a]));
    let margin = scales.margin();
    let before: [usize; 3] =
        std::array::from_fn(|a| margin[a] + tensor[a] + gradient[a] + DIFFERENCE);
    debug_assert!((0..3).all(|a| before[a] <= r[a]));
    let dims = std::array::from_fn(|a| core.size[a] + 2 * before[a]);
    let mut grey = copy(window, core, dims, before);
    // Foreign bodies brighter than fibre must not outweigh it.
    for v in &mut grey.data {
        *v = levels.fill(*v).clamp(-0.5, 1.5);
    }
    let [gx, gy, gz] = &scales.gradient;
    let smooth = grey.smoothed([gx, gy, gz]);
    drop(grey);
    let mut gradients = [0, 1, 2].map(|a| difference(&smooth, a, scales.per_mm[a]));
    drop(smooth);
    let first = std::array::from_fn(|a| {
        let start = [core.x as i64, core.y as i64, core.z][a];
        start - (margin[a] + tensor[a]) as i64
    });
    let size = [window.nx, window.ny, window.nz];
    clear_border(&mut gradients, first, size);
    let [tx, ty, tz] = &scales.tensor;
    [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|(i, j)| {
        let (a, b) = (&gradients[i], &gradients[j]);
        let data = a.data.iter().zip(&b.data).map(|(a, b)| a * b).collect();
        let product = ValueBox { dims: a.dims, data };
        product.smoothed([tx, ty, tz])
    })
}

/// Clears gradients beyond the faces of the volume and beside them: values that equal those at the
/// face would have fibres seem to run into it. `first` is the voxel that the blocks begin with.
fn clear_border(gradients: &mut [ValueBox; 3], first: [i64; 3], size: [usize; 3]) {
    let dims = gradients[0].dims;
    let inside = |i: usize, a: usize| {
        let at = first[a] + i as i64;
        // A volume of few slices keeps those in its middle.
        let border = (DIFFERENCE as i64).min((size[a] as i64 - 1) / 4);
        at >= border && at < size[a] as i64 - border
    };
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            let row_inside = inside(z, 2) && inside(y, 1);
            for x in 0..dims[0] {
                if !(row_inside && inside(x, 0)) {
                    let i = gradients[0].index(x, y, z);
                    gradients.iter_mut().for_each(|g| g.data[i] = 0.0);
                }
            }
        }
    }
}

/// The derivative along an axis, by differences of fourth order; two voxels are lost at each end
/// of every axis.
fn difference(block: &ValueBox, axis: usize, per_mm: f32) -> ValueBox {
    let dims = block.dims.map(|n| n - 2 * DIFFERENCE);
    let mut out = ValueBox::zeros(dims);
    let stride = [1, block.dims[0], block.dims[0] * block.dims[1]][axis];
    let (near, far) = (8.0 / 12.0 * per_mm, -1.0 / 12.0 * per_mm);
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            let from = block.index(DIFFERENCE, y + DIFFERENCE, z + DIFFERENCE);
            let start = out.index(0, y, z);
            let row = |offset: usize| &block.data[offset..offset + dims[0]];
            let [a, b, c, d] = [
                row(from - 2 * stride),
                row(from - stride),
                row(from + stride),
                row(from + 2 * stride),
            ];
            for (x, o) in out.data[start..start + dims[0]].iter_mut().enumerate() {
                *o = near * (c[x] - b[x]) + far * (d[x] - a[x]);
            }
        }
    }
    out
}
