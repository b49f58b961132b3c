//! The first fibre along a ray by trying every piece, in double precision: what
//! cells are held against.

use super::copies::mitre_mm;
use super::matter::FibreEntry;
use super::strands::Strands;
use glam::{DVec2, DVec3, IVec2};

/// A piece, moved by whole periods, that may be met.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    piece: u32,
    shift: IVec2,
}

/// What a hit in cells is beside what trying finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// Both found nothing, or places less than a thousandth of a radius apart, seen along
    /// the normal.
    Same,
    /// The ray grazes a fibre: rounding decides.
    Grazing,
    /// They differ.
    Wrong,
}

/// Pieces near a place.
pub struct Exhaustive<'a> {
    strands: Strands<'a>,
    /// What joints are counted from, in the world.
    origin_mm: DVec3,
    /// Zero where nothing repeats.
    period_mm: DVec2,
    near: Vec<Candidate>,
}

/// An entry found by trying.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriedEntry {
    /// Number of the piece.
    pub piece: u32,
    /// From the ray's origin, mm.
    pub distance_mm: f64,
    /// Cosine between the ray and the surface's normal there.
    pub cosine: f64,
    /// Radius of the piece, mm.
    pub radius_mm: f64,
}

impl<'a> Exhaustive<'a> {
    /// All pieces that reach within `around_mm` of a place of the world;
    /// `period_mm` is zero where nothing repeats.
    pub fn near(
        strands: Strands<'a>,
        origin_mm: DVec3,
        period_mm: DVec2,
        place_mm: DVec3,
        around_mm: f64,
    ) -> Exhaustive<'a> {
        let mut near = Vec::new();
        for piece in strands.pieces() {
            let [a, b] = [piece, piece + 1].map(|i| &strands.joints[i as usize]);
            let middle = 0.5 * (a.position + b.position).as_dvec3() + origin_mm;
            let half = 0.5 * f64::from(a.position.distance(b.position));
            // Mitres reach a little beyond the ends.
            let reach = around_mm + half + 5.0 * f64::from(a.radius_mm.max(b.radius_mm));
            let (mut from, mut to) = (IVec2::ZERO, IVec2::ZERO);
            if period_mm.x > 0.0 {
                let apart = (place_mm - middle).truncate();
                from = ((apart - reach) / period_mm).ceil().as_ivec2();
                to = ((apart + reach) / period_mm).floor().as_ivec2();
            }
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    let shift = IVec2::new(x, y);
                    let by = (shift.as_dvec2() * period_mm).extend(0.0);
                    if (middle + by).distance(place_mm) <= reach {
                        near.push(Candidate { piece, shift });
                    }
                }
            }
        }
        Exhaustive {
            strands,
            origin_mm,
            period_mm,
            near,
        }
    }

    /// The first entry of a ray beyond `min_mm` and up to `max_mm`.
    pub fn first(
        &self,
        origin_mm: DVec3,
        direction: DVec3,
        (min_mm, max_mm): (f64, f64),
    ) -> Option<TriedEntry> {
        let mut best: Option<TriedEntry> = None;
        for candidate in &self.near {
            let most = best.map_or(max_mm, |b| b.distance_mm);
            if let Some(found) = self.entry(candidate, origin_mm, direction)
                && found.distance_mm > min_mm
                && found.distance_mm < most
            {
                best = Some(found);
            }
        }
        best
    }

    /// How many strands, copies counted apart, hold a place of the world.
    pub fn holding(&self, place_mm: DVec3) -> usize {
        let mut found: Vec<(u32, IVec2)> = Vec::new();
        for candidate in &self.near {
            let [a, b] = [0, 1].map(|i| &self.strands.joints[(candidate.piece + i) as usize]);
            let by = (candidate.shift.as_dvec2() * self.period_mm).extend(0.0) + self.origin_mm;
            let [from_a, from_b] = [a, b].map(|j| place_mm - (j.position.as_dvec3() + by));
            let along = from_a - from_b;
            let share = (from_a.dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
            let radius = f64::from(a.radius_mm + share as f32 * (b.radius_mm - a.radius_mm));
            let is_kept = (!a.cut || from_a.dot(a.tangent.as_dvec3()) >= 0.0)
                && (!b.cut || from_b.dot(b.tangent.as_dvec3()) < 0.0);
            let key = (a.strand, candidate.shift);
            let is_inside = is_kept && (from_a - share * along).length() < radius;
            if is_inside && !found.contains(&key) {
                found.push(key);
            }
        }
        found.len()
    }

    /// Compares what was found for a ray between two distances. A ray that rounding decides
    /// finds either a `hair_mm` aside.
    pub fn compare(
        &self,
        own: Option<&FibreEntry>,
        (origin_mm, direction): (DVec3, DVec3),
        ends_mm: (f64, f64),
        hair_mm: f64,
    ) -> Compared {
        let is_same = |tried: &Option<TriedEntry>| match (own, tried) {
            (None, None) => true,
            (Some(own), Some(tried)) => {
                let apart = (own.distance_mm - tried.distance_mm).abs();
                apart * tried.cosine.max(1e-3) < 1e-3 * tried.radius_mm
            }
            _ => false,
        };
        let found = self.first(origin_mm, direction, ends_mm);
        if is_same(&found) {
            return Compared::Same;
        }
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut aside = axes.iter().flat_map(|&e| [hair_mm * e, -hair_mm * e]);
        let grazes = found.is_some_and(|f| f.cosine < 0.02)
            || aside.any(|by| is_same(&self.first(origin_mm + by, direction, ends_mm)));
        if grazes {
            Compared::Grazing
        } else {
            Compared::Wrong
        }
    }

    fn entry(&self, candidate: &Candidate, o: DVec3, d: DVec3) -> Option<TriedEntry> {
        let piece = candidate.piece;
        let [a, b] = [piece, piece + 1].map(|i| &self.strands.joints[i as usize]);
        let by = (candidate.shift.as_dvec2() * self.period_mm).extend(0.0) + self.origin_mm;
        let [pa, pb] = [a, b].map(|j| j.position.as_dvec3() + by);
        let [ra, rb] = [a, b].map(|j| f64::from(j.radius_mm));
        let axis = (pb - pa).try_normalize();
        let length = pa.distance(pb);
        let narrowing = ra - rb;
        let found = |t: f64, normal: DVec3, radius_mm: f64| TriedEntry {
            piece,
            distance_mm: t,
            cosine: -d.dot(normal.normalize_or_zero()),
            radius_mm,
        };
        let Some(u) = axis.filter(|_| length > narrowing.abs()) else {
            let (centre, radius) = if narrowing > 0.0 { (pa, ra) } else { (pb, rb) };
            let t = sphere(o - centre, d, radius)?;
            return Some(found(t, o + t * d - centre, radius));
        };
        let s = narrowing / length;
        let c = 1.0 - s * s;
        let from = o - pa;
        let (v, y) = (d.dot(u), from.dot(u));
        let (q, p) = (d - u * v, from - u * y);
        let wide = ra - s * y;
        let (aa, bb) = (
            c * q.length_squared() - s * s * v * v,
            c * p.dot(q) + s * v * wide,
        );
        let cc = c * p.length_squared() - wide * wide;
        let root = bb * bb - aa * cc;
        let normal_of = |j: &super::strands::Joint| j.tangent.as_dvec3();
        let low = match a.cut {
            true => -mitre_mm(normal_of(a), u, ra),
            false => s * ra,
        };
        let high = match b.cut {
            true => length + mitre_mm(normal_of(b), u, rb),
            false => length + s * rb,
        };
        if root >= 0.0 {
            let t = (-bb - root.sqrt()) / aa;
            let at = y + t * v;
            if low <= at && at <= high {
                let place = o + t * d;
                let kept = (!a.cut || (place - pa).dot(normal_of(a)) >= 0.0)
                    && (!b.cut || (place - pb).dot(normal_of(b)) <= 0.0);
                return kept.then(|| found(t, p + t * q + s * u * ra, ra.max(rb)));
            }
        }
        let ball = |centre: DVec3, radius: f64, cut: bool, is_end: &dyn Fn(f64) -> bool| {
            let t = sphere(o - centre, d, radius).filter(|_| !cut)?;
            is_end(y + t * v).then(|| found(t, o + t * d - centre, radius))
        };
        let first = ball(pa, ra, a.cut, &|at| at <= s * ra);
        let last = ball(pb, rb, b.cut, &|at| at >= length + s * rb);
        match (first, last) {
            (Some(x), Some(y)) if y.distance_mm < x.distance_mm => Some(y),
            (x, y) => x.or(y),
        }
    }
}

/// Where a ray enters a sphere about the origin.
fn sphere(o: DVec3, d: DVec3, radius: f64) -> Option<f64> {
    let along = o.dot(d);
    let root = radius * radius - (o - along * d).length_squared();
    (root >= 0.0).then(|| -along - root.sqrt())
}
