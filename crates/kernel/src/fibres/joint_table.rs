//! What is asked of a piece of fibre once it is met.

use super::copies::mitre_mm;
use super::strands::{Joint, Strand, Strands};
use glam::Vec3;
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints, prefetch, vector_of, word_of};
use rayon::prelude::*;

/// Words of a joint.
pub const JOINT: u32 = 8;

/// For every joint eight words: the unit tangent, how far the sides of the piece
/// that ends there and of the one that begins go on beyond it, one over the
/// length of the piece that begins, the material, and the curve with a bit that
/// is set where pieces are cut.
#[derive(Default)]
pub struct JointTable {
    pub words: Vec<u32>,
    strands: Vec<Strand>,
}

const CUT: u32 = 1 << 31;

impl JointTable {
    /// Joints so far.
    pub fn count(&self) -> u32 {
        self.words.len() as u32 / JOINT
    }

    /// Adds the joints of one body, whose materials are numbered from `first_material` on.
    pub fn add(&mut self, strands: Strands<'_>, first_material: u16) {
        let first_strand = self.strands.len() as u32;
        let joints = strands.joints.par_iter().enumerate();
        let words: Vec<[u32; JOINT as usize]> = joints
            .map(|(k, joint)| {
                let place = (strands.joints, k);
                let material = strands.strands[joint.strand as usize].material;
                let material = u32::from(first_material) + u32::from(material);
                words_of(place, material, first_strand + joint.strand)
            })
            .collect();
        let words = words.into_flattened();
        match self.words.is_empty() {
            true => self.words = words,
            false => self.words.extend_from_slice(&words),
        }
        self.strands.extend_from_slice(strands.strands);
    }

    /// Bytes that the joints of one body take.
    pub fn bytes_of(strands: Strands<'_>) -> u64 {
        let words = strands.joints.len() * size_of::<[u32; JOINT as usize]>();
        (words + size_of_val(strands.strands)) as u64
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        (4 * self.words.len() + self.strands.len() * size_of::<Strand>()) as u64
    }

    /// Asks for the words of a piece's two joints.
    #[inline(always)]
    pub fn prefetch(&self, piece: u32) {
        let first = (piece * JOINT) as usize;
        prefetch(&self.words, first);
        prefetch(&self.words, first + 2 * JOINT as usize - 1);
    }

    /// The yarns of all strands.
    #[cfg(feature = "gpu")] // others ask for one at a time
    pub fn yarns(&self) -> Vec<u32> {
        self.strands.iter().map(|strand| strand.yarn).collect()
    }

    /// The yarn of a piece.
    pub fn yarn(&self, piece: u32) -> u32 {
        self.strands[self.strand(piece) as usize].yarn
    }

    /// The material of a piece.
    pub fn material(&self, piece: u32) -> u32 {
        self.words[(piece * JOINT) as usize + 6]
    }

    /// Which of all strands a piece belongs to.
    #[inline]
    pub fn strand(&self, piece: u32) -> u32 {
        self.words[(piece * JOINT + 7) as usize] & !CUT
    }

    /// The length of the piece that begins at a joint, if one does.
    pub fn length_mm(&self, joint: u32) -> Option<f64> {
        let per_length = f64::from(self.float(joint, 5));
        (per_length > 0.0).then(|| 1.0 / per_length)
    }

    /// What share of a piece lies before a point that is so far from the mitre before its
    /// first joint.
    #[inline]
    pub fn share_along(&self, piece: u32, along_mm: f32) -> f32 {
        let beyond_mitre = along_mm - self.float(piece, 4);
        (beyond_mitre * self.float(piece, 5)).clamp(0.0, 1.0)
    }

    #[inline(always)]
    fn float(&self, joint: u32, word: u32) -> f32 {
        f32::from_bits(self.words[(joint * JOINT + word) as usize])
    }

    /// How far the side of a piece goes on beyond its two joints.
    #[inline(always)]
    pub fn mitres_mm(&self, piece: u32) -> [f32; 2] {
        [self.float(piece, 4), self.float(piece + 1, 3)]
    }

    /// Normals of the planes that cut a piece, along the curve.
    #[inline]
    pub fn planes(&self, piece: u32) -> (Option<Vec3>, Option<Vec3>) {
        let plane = |joint: u32| {
            let cut = self.words[(joint * JOINT + 7) as usize] & CUT != 0;
            cut.then(|| Vec3::from_array([0, 1, 2].map(|k| self.float(joint, k))))
        };
        (plane(piece), plane(piece + 1))
    }

    /// The unit tangent of a piece so far from the mitre before its first joint.
    pub fn tangent(&self, piece: u32, along_mm: f32) -> Vec3 {
        let one = organza_lanes::one::F(along_mm);
        let t = self.tangents(<organza_lanes::one::U as Ints>::splat(piece), one);
        Vec3::new(t.x.0, t.y.0, t.z.0)
    }

    /// Unit tangents of pieces so far from the mitres before their first joints.
    #[inline(always)]
    pub fn tangents<F: Floats>(&self, piece: F::Ints, along_mm: F) -> V3<F> {
        let word = F::Ints::splat;
        let first = piece * word(JOINT);
        let words = &self.words[..];
        let per_length = word_of::<F>(words, first, 5);
        let mitre = word_of::<F>(words, first, 4);
        let share = ((along_mm - mitre) * per_length)
            .max(F::splat(0.0))
            .min(F::splat(1.0));
        let start = vector_of::<F>(words, first, 0);
        let end = vector_of::<F>(words, first, JOINT);
        let middle = (end - start).scaled_add(share, start);
        let square = middle.dot(middle);
        let long = F::splat(1e-12).below(square);
        let length = square.max(F::splat(1e-12)).sqrt();
        middle
            .scaled(F::splat(1.0) / length)
            .or_where_not(long, start)
    }

    /// Materials of pieces.
    #[inline(always)]
    pub fn materials<F: Floats>(&self, piece: F::Ints) -> F::Ints {
        (piece * F::Ints::splat(JOINT) + F::Ints::splat(6)).gather(&self.words)
    }
}

/// The words of a joint.
fn words_of((joints, k): (&[Joint], usize), material: u32, strand: u32) -> [u32; JOINT as usize] {
    let joint = &joints[k];
    let normal = joint.tangent.as_dvec3();
    let along = |i: usize, j: usize| {
        let (a, b) = (joints.get(i)?, joints.get(j)?);
        (a.strand == b.strand).then(|| (b.position - a.position).as_dvec3())
    };
    let (before, after) = (along(k.wrapping_sub(1), k), along(k, k + 1));
    let mitre = |way: Option<glam::DVec3>| {
        let axis = way.and_then(glam::DVec3::try_normalize);
        let axis = axis.filter(|_| joint.cut)?;
        Some(mitre_mm(normal, axis, f64::from(joint.radius_mm)) as f32)
    };
    let length = after.map_or(0.0, |w| w.length());
    let per_length = if length > 0.0 { 1.0 / length } else { 0.0 };
    let [x, y, z] = joint.tangent.to_array().map(f32::to_bits);
    let [before, after] = [before, after].map(|way| mitre(way).unwrap_or(0.0).to_bits());
    let cut = if joint.cut { CUT } else { 0 };
    let per_length = (per_length as f32).to_bits();
    [x, y, z, before, after, per_length, material, strand | cut]
}
