//! The fibres of one tile as chains of joints.

use glam::Vec3;
use organza_basis::{Aabb, Segment, SegmentSource, Stopped, Tile};
use organza_kernel::fibres::{Joint, Strand, Strands};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

/// All curves of a tile, one after the other. Piece `k` lies between joints `k`
/// and `k + 1` when both are of one curve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Curves {
    pub joints: Vec<Joint>,
    pub curves: Vec<Strand>,
}

/// Longer pieces, in radii, are divided: the boxes of long oblique ones would
/// be mostly empty.
const LONGEST_RADII: f32 = 12.0;

/// Ends of curves this near to the tile's faces, in radii, go on in the next
/// copy.
const ON_FACE_RADII: f32 = 0.01;

/// Joints of a batch that are added to those of the others together.
const COUNTED_TOGETHER: usize = 1 << 16;

/// Pieces that a segment is divided into; none for what is no matter.
fn division(s: &Segment) -> u32 {
    let radius = s.start_radius_mm.max(s.end_radius_mm);
    let finite = s.start_mm.is_finite() && s.end_mm.is_finite() && radius.is_finite();
    if !finite || radius.is_nan() || radius <= 0.0 {
        return 0;
    }
    (s.length_mm() / (LONGEST_RADII * radius))
        .ceil()
        .clamp(1.0, 65_536.0) as u32
}

/// Joints that a source needs.
pub(crate) fn count_joints(source: &dyn SegmentSource) -> u64 {
    let in_batch = |batch| {
        let (mut joints, mut last) = (0u64, None);
        source.for_each_in_batch(batch, &mut |s| {
            let pieces = division(s);
            if pieces > 0 {
                let goes_on = last == Some((s.yarn, s.fibre, s.material, s.start_mm));
                joints += u64::from(pieces) + u64::from(!goes_on);
                last = Some((s.yarn, s.fibre, s.material, s.end_mm));
            }
        });
        joints
    };
    let batches = (0..source.batch_count()).into_par_iter();
    batches.map(in_batch).sum()
}

impl Curves {
    /// The box of the tile, with all its fibres: beyond its faces only where it does
    /// not repeat.
    pub fn bounds_mm(&self, tile: &Tile) -> Aabb {
        let mut box_mm = tile.bounds_mm;
        for j in &self.joints {
            let at = j.position + tile.bounds_mm.min;
            let (low, high) = (at - j.radius_mm, at + j.radius_mm);
            if tile.repeats {
                box_mm.min.z = box_mm.min.z.min(low.z);
                box_mm.max.z = box_mm.max.z.max(high.z);
            } else {
                box_mm = box_mm.with_point(low).with_point(high);
            }
        }
        box_mm
    }

    /// All curves of a source; `None` where they have more joints than `most`. `done` is called
    /// after every finished batch.
    ///
    /// # Errors
    /// When `done` broke.
    pub fn gather(
        source: &dyn SegmentSource,
        most: u64,
        done: &(dyn Fn() -> ControlFlow<()> + Sync),
    ) -> Result<Option<Curves>, Stopped> {
        let (tile, joints) = (source.tile(), AtomicU64::new(0));
        // Either way of ending early leaves the other batches alone.
        let gathered: Result<Vec<Curves>, Option<Stopped>> = (0..source.batch_count())
            .into_par_iter()
            .map(|batch| {
                let curves = Curves::of_batch(source, batch, &tile, (&joints, most));
                Stopped::check(done())?;
                curves.ok_or(None)
            })
            .collect();
        let gathered = match gathered {
            Ok(gathered) => gathered,
            Err(stopped) => return stopped.map_or(Ok(None), Err),
        };
        let mut all = Curves::default();
        all.joints.reserve_exact(joints.into_inner() as usize);
        for mut one in gathered {
            let before = all.curves.len() as u32;
            one.joints.iter_mut().for_each(|j| j.strand += before);
            all.joints.append(&mut one.joints);
            all.curves.append(&mut one.curves);
        }
        Ok(Some(all))
    }

    /// The curves of a batch, whose joints are added to a sum; `None` once that is too large.
    fn of_batch(
        source: &dyn SegmentSource,
        batch: usize,
        tile: &Tile,
        (sum, most): (&AtomicU64, u64),
    ) -> Option<Curves> {
        // Adds what is new; true where all are too many.
        let is_too_much = |counted: &mut usize, joints: usize| {
            let new = (joints - *counted) as u64;
            *counted = joints;
            sum.fetch_add(new, Ordering::Relaxed) + new > most
        };
        let (mut counted, mut is_full) = (0, false);
        let mut curves = Curves::default();
        let mut last = None;
        // Joints of the last curve at which its material changes, and to which.
        let mut changes: Vec<(usize, u16)> = Vec::new();
        let mut material = 0;
        let origin = tile.bounds_mm.min;
        source.for_each_in_batch(batch, &mut |s| {
            let pieces = division(s);
            if pieces == 0 || is_full {
                return;
            }
            if curves.joints.len() - counted >= COUNTED_TOGETHER {
                is_full = is_too_much(&mut counted, curves.joints.len());
            }
            let joint = |share: f32, tangent: Vec3, curve: usize| Joint {
                position: s.start_mm.lerp(s.end_mm, share) - origin,
                radius_mm: s.start_radius_mm + share * (s.end_radius_mm - s.start_radius_mm),
                tangent,
                strand: curve as u32,
                cut: false,
            };
            if last != Some((s.yarn, s.fibre, s.start_mm)) {
                curves.close(tile, &mut changes);
                curves.curves.push(Strand {
                    yarn: s.yarn,
                    fibre: s.fibre,
                    material: s.material,
                });
                let first = joint(0.0, s.start_tangent, curves.curves.len() - 1);
                curves.joints.push(first);
            } else if material != s.material {
                changes.push((curves.joints.len() - 1, s.material));
            }
            material = s.material;
            last = Some((s.yarn, s.fibre, s.end_mm));
            for i in 1..=pieces {
                let share = i as f32 / pieces as f32;
                let next = joint(share, s.end_tangent, curves.curves.len() - 1);
                curves.joints.push(next);
            }
        });
        curves.close(tile, &mut changes);
        (!is_too_much(&mut counted, curves.joints.len())).then_some(curves)
    }

    /// Settles tangents and cuts of the last curve, and divides it where its material changes.
    fn close(&mut self, tile: &Tile, changes: &mut Vec<(usize, u16)>) {
        let Some(curve) = self.curves.len().checked_sub(1) else {
            return;
        };
        let start = self.joints.partition_point(|j| (j.strand as usize) < curve);
        let joints = &mut self.joints[start..];
        for i in 1..joints.len().saturating_sub(1) {
            let [before, here, after] = [joints[i - 1], joints[i], joints[i + 1]];
            let way = |a: &Joint, b: &Joint| (b.position - a.position).as_dvec3();
            let (back, ahead) = (way(&before, &here), way(&here, &after));
            let (Some(u), Some(v)) = (back.try_normalize(), ahead.try_normalize()) else {
                continue;
            };
            let Some(middle) = (u + v).try_normalize() else {
                continue;
            };
            // Tangent of half the bend.
            let half = (1.0 - u.dot(v)).max(0.0) / u.cross(v).length().max(1e-12);
            let room = 0.5 * back.length().min(ahead.length());
            let even = before.radius_mm == here.radius_mm && here.radius_mm == after.radius_mm;
            joints[i].tangent = middle.as_vec3();
            joints[i].cut = even && half * f64::from(here.radius_mm) < room;
        }
        let last = joints.len() - 1;
        for i in [0, last] {
            let end = &mut joints[i];
            let size = tile.bounds_mm.size();
            let near = |p: f32, face: f32| (p - face).abs() < ON_FACE_RADII * end.radius_mm;
            let on_face =
                (0..2).any(|a| near(end.position[a], 0.0) || near(end.position[a], size[a]));
            end.cut = tile.repeats && on_face;
            // Tangents at ends are the source's own, which may be any.
            end.tangent = end.tangent.try_normalize().unwrap_or(Vec3::X);
        }
        self.divide(changes);
    }

    /// Makes a curve of each stretch of the last one that has a material of its own: a fibre
    /// that is printed, say. Both sides of a change keep the joint between them as it is, so
    /// that the pieces have the same shapes as before.
    fn divide(&mut self, changes: &mut Vec<(usize, u16)>) {
        let Some(&(first, _)) = changes.first() else {
            return;
        };
        let undivided = self.joints.split_off(first);
        let mut next = changes.drain(..).peekable();
        for (i, mut joint) in (first..).zip(undivided) {
            joint.strand = (self.curves.len() - 1) as u32;
            self.joints.push(joint);
            if let Some((_, material)) = next.next_if(|(at, _)| *at == i) {
                let before = self.curves[joint.strand as usize];
                self.curves.push(Strand { material, ..before });
                joint.strand += 1;
                self.joints.push(joint);
            }
        }
    }

    /// As the kernel takes them.
    pub fn strands(&self) -> Strands<'_> {
        Strands {
            joints: &self.joints,
            strands: &self.curves,
        }
    }

    /// Unit tangent at a share of a piece's length.
    pub fn tangent(&self, index: u32, share: f32) -> Vec3 {
        let [a, b] = [self.joints[index as usize], self.joints[index as usize + 1]];
        let middle = a.tangent.lerp(b.tangent, share);
        middle.try_normalize().unwrap_or(a.tangent)
    }

    /// The curve of a piece.
    pub fn curve_of(&self, index: u32) -> &Strand {
        &self.curves[self.joints[index as usize].strand as usize]
    }
}
