//! From a stream of curve segments to an octree.

use crate::clip::for_each_clip;
use crate::cluster::Lump;
use crate::gather::{Gather, Gathered, Shard};
use crate::lattice::{Lattice, bit_of, brick_index, bricks_across};
use crate::{Error, Octree};
use glam::{DVec2, DVec3, IVec3, UVec3};
use organza_basis::{Frame, Segment, SegmentSource};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::Mutex;

/// Where the length of a fibre goes that is thicker than a voxel (by more than
/// the tenth that fitting a period may take from it).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Footprint {
    /// Over the voxels that the fibre covers: right for extinction looked up
    /// where the light is.
    #[default]
    Covered,
    /// Into the voxels that its axis passes: for media that look the density
    /// up at the axis of the fibre they are about to hit.
    Axis,
}

/// How to voxelize.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelizeOptions {
    /// Edge of the finest voxels. Along x and y of a tile that repeats it is
    /// fitted to the period and may come out up to a tenth different.
    pub voxel_mm: f32,
    /// Number of levels, 1 to 8; without it as many as fit, at most six.
    pub levels: Option<u8>,
    /// Treatment of thick fibres.
    pub footprint: Footprint,
    /// Refuse to use more memory than this. Without it there is no limit.
    pub max_memory_bytes: Option<u64>,
}

impl Default for VoxelizeOptions {
    fn default() -> VoxelizeOptions {
        VoxelizeOptions {
            voxel_mm: 0.01,
            levels: None,
            footprint: Footprint::default(),
            max_memory_bytes: None,
        }
    }
}

/// Shards of the gathered bricks: enough to keep threads busy while folding.
const SHARDS: u32 = 32;

/// Longest segment, in voxels; more is a mistake in the source.
const MAX_SPAN: f64 = 1e6;

/// Most lines that stand for one thick segment; with them the lines are half
/// a voxel apart up to a radius of 64 voxels.
const MAX_LINES: f64 = 65_536.0;

/// Voxelizes all segments of a source.
///
/// Segments are clipped to voxels exactly, so that the sum of density times
/// volume is the length put in (within 1e-5, the quantisation of lengths). The
/// result is the same bit for bit on any number of threads. `progress` is
/// called with the share of the work done, in `[0, 1]`.
///
/// # Errors
/// For a voxel edge or tile that makes no sense, segments that are not finite
/// or lie outside a tile that does not repeat, and when more memory would be
/// needed than allowed.
pub fn voxelize(
    source: &dyn SegmentSource,
    options: &VoxelizeOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Octree, Error> {
    let lattice = Lattice::new(&source.tile(), options.voxel_mm, options.levels)?;
    if let Some(allowed) = options.max_memory_bytes {
        check_memory(memory_of(&lattice, 0), allowed)?;
        check_memory(estimate(source, &lattice, options)?, allowed)?;
    }
    let brick_count = bricks_across(lattice.dims).element_product();

    let idle: Mutex<Vec<Gather>> = Mutex::new(Vec::new());
    let mut shards: Vec<Shard> = (0..SHARDS).map(|_| Shard::default()).collect();
    let batches: Vec<usize> = (0..source.batch_count()).collect();
    let mut done = 0;
    for chunk in batches.chunks(4 * rayon::current_num_threads()) {
        let gathered: Vec<Gathered> = chunk
            .par_iter()
            .map(|&batch| {
                let spare = idle.lock().ok().and_then(|mut l| l.pop());
                let mut gather = spare.unwrap_or_else(|| Gather::new(brick_count as usize));
                let gathered = gather_batch(source, batch, &lattice, options, &mut gather);
                if let Ok(mut l) = idle.lock() {
                    l.push(gather);
                }
                gathered
            })
            .collect::<Result<_, Error>>()?;
        shards.par_iter_mut().enumerate().for_each(|(i, shard)| {
            gathered
                .iter()
                .for_each(|g| shard.fold(g, i as u32, SHARDS));
        });
        done += chunk.len();
        let lumps = shards.iter().map(|s| s.lump_count as u64).sum();
        check_memory(
            memory_of(&lattice, lumps),
            options.max_memory_bytes.unwrap_or(u64::MAX),
        )?;
        progress(0.9 * done as f32 / batches.len() as f32);
    }
    drop(idle);
    let mut bricks: Vec<_> = shards.into_iter().flat_map(|s| s.bricks).collect();
    bricks.par_sort_unstable_by_key(|b| b.0);
    let octree = Octree::build(lattice, source.material_count(), bricks)?;
    progress(1.0);
    Ok(octree)
}

/// Bytes that [`voxelize()`] will need at most at one time, judged by a sample
/// of the source's batches (a sixteenth of them).
///
/// # Errors
/// As [`voxelize()`], for what the sample meets.
pub fn estimate_memory_bytes(
    source: &dyn SegmentSource,
    options: &VoxelizeOptions,
) -> Result<u64, Error> {
    let lattice = Lattice::new(&source.tile(), options.voxel_mm, options.levels)?;
    estimate(source, &lattice, options)
}

fn estimate(
    source: &dyn SegmentSource,
    lattice: &Lattice,
    options: &VoxelizeOptions,
) -> Result<u64, Error> {
    let batches = source.batch_count();
    let sample = batches.div_ceil(16).min(8);
    let mut gather = Gather::new(bricks_across(lattice.dims).element_product() as usize);
    let mut found = 0;
    for i in 0..sample {
        // The middle of each equal part of the batches.
        let batch = (2 * i + 1) * batches / (2 * sample);
        found += gather_batch(source, batch, lattice, options, &mut gather)?
            .lumps
            .len();
    }
    let lumps = found as f64 * batches as f64 / sample.max(1) as f64;
    Ok(memory_of(lattice, lumps as u64))
}

/// Bytes needed to build an octree of so many populations.
fn memory_of(lattice: &Lattice, lumps: u64) -> u64 {
    // A table of bricks for each thread, each level's and what is in flight.
    let bricks = bricks_across(lattice.dims).as_u64vec3().element_product();
    let tables = 4 * bricks * (rayon::current_num_threads() as u64 + 2);
    // Populations live twice while a level is made from the one below, and
    // once more as records.
    tables + lumps * (2 * size_of::<Lump>() as u64 + 24)
}

fn check_memory(needed: u64, allowed: u64) -> Result<(), Error> {
    if needed > allowed {
        return Err(Error::Memory { needed, allowed });
    }
    Ok(())
}

/// Clips all segments of one batch.
fn gather_batch(
    source: &dyn SegmentSource,
    batch: usize,
    lattice: &Lattice,
    options: &VoxelizeOptions,
    gather: &mut Gather,
) -> Result<Gathered, Error> {
    let mut clipper = Clipper {
        lattice,
        grid: bricks_across(lattice.dims),
        footprint: options.footprint,
        gather,
        disk: Vec::new(),
        problem: None,
    };
    source.for_each_in_batch(batch, &mut |s| clipper.add(s));
    let problem = clipper.problem.take();
    let gathered = gather.take();
    problem.map_or(Ok(gathered), Err)
}

/// Cuts segments into pieces and hands them to a gather.
struct Clipper<'a> {
    lattice: &'a Lattice,
    grid: UVec3,
    footprint: Footprint,
    gather: &'a mut Gather,
    /// Places of lines in the cross-section of a thick fibre of radius one.
    disk: Vec<DVec2>,
    problem: Option<Error>,
}

impl Clipper<'_> {
    fn add(&mut self, s: &Segment) {
        if self.problem.is_none()
            && let Err(problem) = self.try_add(s)
        {
            self.problem = Some(Error::Segment {
                yarn: s.yarn,
                fibre: s.fibre,
                problem,
            });
        }
    }

    fn try_add(&mut self, s: &Segment) -> Result<(), String> {
        let (r0, r1) = (s.start_radius_mm, s.end_radius_mm);
        if !(s.start_mm.is_finite() && s.end_mm.is_finite()) {
            return Err(format!("runs from {} to {} mm", s.start_mm, s.end_mm));
        }
        if !(r0 >= 0.0 && r1 >= 0.0 && r0.is_finite() && r1.is_finite()) {
            return Err(format!("has radii {r0} and {r1} mm"));
        }
        let (a, b) = (
            self.lattice.grid_from_mm(s.start_mm),
            self.lattice.grid_from_mm(s.end_mm),
        );
        self.check_inside(s, a)?;
        self.check_inside(s, b)?;
        if (b - a).abs().max_element() > MAX_SPAN {
            return Err(format!("is longer than {MAX_SPAN} voxels"));
        }
        let chord_mm = (s.end_mm.as_dvec3() - s.start_mm.as_dvec3()).length();
        if chord_mm == 0.0 {
            return Ok(());
        }
        let radius = f64::from(r0.max(r1));
        let narrowest = self.lattice.voxel_mm.min_element();
        if self.footprint == Footprint::Axis || 2.0 * radius <= 1.1 * narrowest {
            self.add_line(s, a, b, chord_mm, 1.0);
            return Ok(());
        }
        // Lines spread over the cross-section, half a voxel apart or less,
        // share the length.
        let lines = 4.0 * PI * (radius / narrowest).powi(2);
        self.spread_disk(lines.ceil().min(MAX_LINES) as usize);
        let frame = Frame::from_normal(((s.end_mm - s.start_mm) / chord_mm as f32).normalize());
        let u = frame.s.as_dvec3() / self.lattice.voxel_mm;
        let v = frame.t.as_dvec3() / self.lattice.voxel_mm;
        let share = 1.0 / self.disk.len() as f64;
        for k in 0..self.disk.len() {
            let offset = self.disk[k].x * u + self.disk[k].y * v;
            let (a, b) = (a + f64::from(r0) * offset, b + f64::from(r1) * offset);
            self.add_line(s, a, b, chord_mm, share);
        }
        Ok(())
    }

    /// Spreads points evenly over the unit disk: a sunflower.
    fn spread_disk(&mut self, count: usize) {
        if self.disk.len() == count {
            return;
        }
        let golden = PI * (3.0 - 5f64.sqrt());
        let point = |k: usize| {
            let out = ((k as f64 + 0.5) / count as f64).sqrt();
            out * DVec2::from_angle(k as f64 * golden)
        };
        self.disk = (0..count).map(point).collect();
    }

    /// Positions in grid units must lie in the box where it does not repeat,
    /// and can be counted in 32 bits where it does.
    fn check_inside(&self, s: &Segment, p: DVec3) -> Result<(), String> {
        let slack = 0.5;
        let dims = self.lattice.dims.as_dvec3();
        let outside = p.cmplt(DVec3::splat(-slack)) | p.cmpgt(dims + slack);
        let wrong = if self.lattice.repeats {
            outside.z || p.truncate().abs().max_element() > 1e9
        } else {
            outside.any()
        };
        if wrong {
            let b = self.lattice.bounds_mm();
            return Err(format!(
                "runs from {} to {} mm, outside the tile from {} to {} mm",
                s.start_mm, s.end_mm, b.min, b.max
            ));
        }
        Ok(())
    }

    fn add_line(&mut self, s: &Segment, a: DVec3, b: DVec3, chord_mm: f64, share: f64) {
        let tangent = ((s.end_mm.as_dvec3() - s.start_mm.as_dvec3()) / chord_mm).as_vec3();
        let (r0, dr) = (
            f64::from(s.start_radius_mm),
            f64::from(s.end_radius_mm - s.start_radius_mm),
        );
        let dims = self.lattice.dims.as_ivec3();
        for_each_clip(a, b, |cell, t0, t1| {
            if t1 <= t0 {
                return;
            }
            let inside = cell.clamp(IVec3::ZERO, dims - 1);
            let cell = if self.lattice.repeats && inside != cell {
                let wrapped = cell.rem_euclid(dims);
                IVec3::new(wrapped.x, wrapped.y, inside.z)
            } else {
                inside
            };
            let cell = cell.as_uvec3();
            let brick = brick_index(cell >> 2u32, self.grid);
            let length = share * chord_mm * (t1 - t0);
            let radius = r0 + 0.5 * (t0 + t1) * dr;
            let key = Lump::key_of(bit_of(cell), s.yarn, s.material);
            let piece = Lump::new(key, length as f32, radius as f32, tangent);
            self.gather.add(brick, &piece);
        });
    }
}
