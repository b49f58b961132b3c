//! The blocks of voxels that each segment touches.
//!
//! Segments are sorted by block and kept until their block processes all of them at once: they
//! are far fewer than the voxels that they fill.

use crate::Error;
use crate::footprint::FibreFootprint;
use crate::lattice::{BLOCK, Lattice};
use crate::parts::Parts;
use glam::{DVec3, IVec3};
use organza_basis::{Segment, SegmentSource};
use std::collections::HashMap;

/// Longest segment, in voxels; a longer one is an error of the source.
const MAX_SPAN: f64 = 1e6;

/// Longer segments are cut, so that a block never follows a segment far outside.
const LONGEST_PIECE: f64 = 16.0;

/// A segment or a part of one, in one period of the tile. Ends are in voxels
/// from the least corner.
#[derive(Clone, Copy)]
pub struct RoutePiece {
    pub start: DVec3,
    pub end: DVec3,
    pub start_radius_mm: f32,
    pub end_radius_mm: f32,
    /// Index into [`Routed::groups`].
    pub group: u32,
}

/// The pieces of a batch that concern one block.
pub struct Run {
    pub block: u32,
    /// Range of [`Routed::ids`].
    pub start: u32,
    pub end: u32,
    /// An upper bound of the length inside the block.
    pub max_length_mm: f64,
}

/// One batch of the source.
pub struct Routed {
    pub pieces: Vec<RoutePiece>,
    /// Indices of pieces, block by block.
    pub ids: Vec<u32>,
    /// Sorted by block.
    pub runs: Vec<Run>,
    /// Yarn and material, as in a key.
    pub groups: Vec<u64>,
    /// Least and greatest radius.
    pub radii_mm: [f32; 2],
}

impl Routed {
    /// Allocated bytes.
    pub fn bytes(&self) -> u64 {
        (self.pieces.capacity() * size_of::<RoutePiece>()
            + self.ids.capacity() * 4
            + self.runs.capacity() * size_of::<Run>()) as u64
    }
}

/// Sorts all segments of a batch, whose pieces may take `max_bytes`. Pieces outside the needed
/// parts of the tile are left out.
pub fn route(
    source: &dyn SegmentSource,
    batch: usize,
    (lattice, parts): (&Lattice, Option<&Parts>),
    footprint: FibreFootprint,
    max_bytes: u64,
) -> Result<Routed, Error> {
    let mut router = Router {
        lattice,
        parts,
        footprint,
        max_bytes,
        pieces: Vec::new(),
        targets: Vec::new(),
        groups: Vec::new(),
        group_of: HashMap::new(),
        last: (u64::MAX, 0),
        radii_mm: [f32::INFINITY, 0.0],
        problem: None,
    };
    source.for_each_in_batch(batch, &mut |s| router.add(s));
    router.finish()
}

struct Router<'a> {
    lattice: &'a Lattice,
    parts: Option<&'a Parts>,
    footprint: FibreFootprint,
    max_bytes: u64,
    pieces: Vec<RoutePiece>,
    /// Block (high half) and piece (low half).
    targets: Vec<u64>,
    groups: Vec<u64>,
    group_of: HashMap<u64, u32>,
    last: (u64, u32),
    radii_mm: [f32; 2],
    problem: Option<Error>,
}

impl Router<'_> {
    fn add(&mut self, s: &Segment) {
        let needed = (size_of_val(&self.pieces[..]) + size_of_val(&self.targets[..])) as u64;
        if needed > self.max_bytes && self.problem.is_none() {
            // The rest of the batch is emitted for nothing.
            (self.pieces, self.targets) = (Vec::new(), Vec::new());
            self.problem = Some(Error::Memory {
                needed,
                allowed: self.max_bytes,
            });
        }
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
        let span = (b - a).abs().max_element();
        if span > MAX_SPAN {
            return Err(format!("is longer than {MAX_SPAN} voxels"));
        }
        if a == b {
            return Ok(());
        }
        if u32::try_from(self.pieces.len()).is_err() {
            return Err("is one of more than 4294967295 in its batch".into());
        }
        self.radii_mm = [
            self.radii_mm[0].min(r0.min(r1)),
            self.radii_mm[1].max(r0.max(r1)),
        ];
        let group = self.group(u64::from(s.yarn) << 16 | u64::from(s.material));
        let radius = r0.max(r1);
        let reach = if self.footprint.is_line(radius, self.lattice) {
            DVec3::ZERO
        } else {
            // Slid along the fibre onto a face across it.
            let straight = f64::from(radius) / self.lattice.voxel_mm;
            let d = (b - a).abs();
            let axis = d.max_position();
            straight + d / d[axis] * straight[axis]
        };
        let parts = (span / LONGEST_PIECE).ceil().max(1.0) as u32;
        let mut from = (a, r0);
        for i in 1..=parts {
            let t = f64::from(i) / f64::from(parts);
            let to = if i == parts {
                (b, r1)
            } else {
                (a + t * (b - a), r0 + t as f32 * (r1 - r0))
            };
            self.place(
                &RoutePiece {
                    start: from.0,
                    end: to.0,
                    start_radius_mm: from.1,
                    end_radius_mm: to.1,
                    group,
                },
                reach,
            );
            from = to;
        }
        Ok(())
    }

    fn group(&mut self, group: u64) -> u32 {
        if self.last.0 != group {
            let next = self.groups.len() as u32;
            let at = *self.group_of.entry(group).or_insert(next);
            if at == next {
                self.groups.push(group);
            }
            self.last = (group, at);
        }
        self.last.1
    }

    /// Assigns it to each block that it touches, once for each period.
    fn place(&mut self, p: &RoutePiece, reach: DVec3) {
        let dims = self.lattice.dims.as_ivec3();
        let low = (p.start.min(p.end) - reach).floor().as_ivec3();
        let high = (p.start.max(p.end) + reach).floor().as_ivec3();
        let (mut first, mut last) = (IVec3::ZERO, IVec3::ZERO);
        if self.lattice.repeats {
            (first, last) = (low.div_euclid(dims), high.div_euclid(dims));
        }
        let across = self.lattice.blocks_across();
        for y in first.y..=last.y {
            for x in first.x..=last.x {
                let shift = IVec3::new(x, y, 0) * dims;
                if let Some(parts) = self.parts
                    && !parts.needs(self.lattice.dims, low - shift, high - shift)
                {
                    continue;
                }
                let id = self.pieces.len() as u64;
                self.pieces.push(RoutePiece {
                    start: p.start - shift.as_dvec3(),
                    end: p.end - shift.as_dvec3(),
                    ..*p
                });
                let block_of =
                    |c: IVec3| (c - shift).clamp(IVec3::ZERO, dims - 1).as_uvec3() / BLOCK;
                let (from, to) = (block_of(low), block_of(high));
                for bz in from.z..=to.z {
                    for by in from.y..=to.y {
                        for bx in from.x..=to.x {
                            let block = bx + across.x * (by + across.y * bz);
                            self.targets.push(u64::from(block) << 32 | id);
                        }
                    }
                }
            }
        }
    }

    /// Positions in grid units must lie in the box if it does not repeat, and must fit into 32
    /// bits if it does.
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

    fn finish(mut self) -> Result<Routed, Error> {
        if let Some(problem) = self.problem {
            return Err(problem);
        }
        self.targets.sort_unstable();
        let ids: Vec<u32> = self.targets.iter().map(|&t| t as u32).collect();
        let mut runs = Vec::new();
        let mut start = 0;
        for part in self.targets.chunk_by(|a, b| a >> 32 == b >> 32) {
            let end = start + part.len();
            let length = |&id: &u32| {
                let p = &self.pieces[id as usize];
                ((p.end - p.start) * self.lattice.voxel_mm).length()
            };
            runs.push(Run {
                block: (part[0] >> 32) as u32,
                start: start as u32,
                end: end as u32,
                max_length_mm: ids[start..end].iter().map(length).sum(),
            });
            start = end;
        }
        self.pieces.shrink_to_fit();
        Ok(Routed {
            pieces: self.pieces,
            ids,
            runs,
            groups: self.groups,
            radii_mm: self.radii_mm,
        })
    }
}
