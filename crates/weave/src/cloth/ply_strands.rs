//! The plies of a cloth as round strands.
//!
//! The section of a thread in cloth is an ellipse. A ply whose section stays nearly round is
//! one strand; a flatter one is several, in a hexagon that winds with its fibres, so that
//! strands of a round section fill the ellipse and none has to be flat itself.

use super::{Cloth, CurveLevel, ThreadAtRest};
use crate::strand::Strand;
use crate::yarn::Yarn;
use glam::DVec2;
use organza_basis::{Segment, SegmentSource, Tile};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

/// What the plies of a material are, on average over its threads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyStrand {
    /// Radius of a strand, mm.
    pub radius_mm: f64,
    /// Radius of its fibres, mm.
    pub fibre_radius_mm: f64,
    /// Fibres in its section, not rounded.
    pub fibres: f64,
    /// Twist of the fibres, radians per mm; positive is Z.
    pub twist_rad_per_mm: f64,
}

/// The plies of a cloth as segments: see [`Cloth::plies`].
#[derive(Clone, Copy, Debug)]
pub struct Plies<'a> {
    cloth: &'a Cloth,
    radius_scales: Option<&'a BTreeMap<String, f64>>,
}

/// A section that is wider than this many heights is filled by 7 strands.
const ROUND_ASPECT: f64 = 1.15;
/// And beyond this by 19.
const FLAT_ASPECT: f64 = 2.5;
/// Strands of each ring of a hexagon and the ring's radius, in radii of the ply: as far out as
/// gives all strands together the second moment of an even disc.
const SEVEN: [(u32, f64); 2] = [(1, 0.0), (6, FRAC_1_SQRT_2)];
const NINETEEN: [(u32, f64); 3] = [(1, 0.0), (6, 0.434), (12, 0.810)];
const ONE: [(u32, f64); 1] = [(1, 0.0)];

/// The rings of strands that fill a section of an aspect.
fn rings(aspect: f64) -> &'static [(u32, f64)] {
    if aspect < ROUND_ASPECT {
        &ONE
    } else if aspect < FLAT_ASPECT {
        &SEVEN
    } else {
        &NINETEEN
    }
}

fn count(rings: &[(u32, f64)]) -> u32 {
    rings.iter().map(|r| r.0).sum()
}

/// See [`Plies::ply_radius_mm`]; of a yarn at rest.
fn covering_radius_mm(yarn: &Yarn) -> f64 {
    const STEPS: usize = 48;
    let share = |i: usize| (i as f64 + 0.5) / STEPS as f64;
    let (r, n) = (yarn.fibre_radius_mm, f64::from(yarn.fibres_per_ply));
    // Where fibres lie, by the distance from the axis.
    let distances: Vec<f64> = (0..STEPS)
        .flat_map(|i| (0..8).map(move |k| (i, k)))
        .map(|(i, k)| yarn.radius_at(share(i)) * yarn.migrated(TAU * f64::from(k) / 8.0))
        .collect();
    let mean_square = distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64;
    let even = (2.0 * mean_square + r * r).sqrt();
    // Fibres that cannot overlap stop more light than fibres strewn at random.
    let crowding = |radius: f64| 1.0 / (1.0 - (n * (r / radius).powi(2)).min(0.7));
    let reach = yarn.ply_radius_mm + r;
    let place = |i: usize| reach * share(i);
    // Fibres that a line at a distance from the axis crosses, on average.
    let below = |x: f64, d: f64| {
        if d <= 0.0 {
            f64::from(u8::from(x > 0.0))
        } else {
            0.5 + (x / d).clamp(-1.0, 1.0).asin() / PI
        }
    };
    let crossed = |x: f64| {
        let share = distances.iter().map(|&d| below(x + r, d) - below(x - r, d));
        n * share.sum::<f64>() / distances.len() as f64
    };
    let stop = crowding(even);
    let covered: f64 = (0..STEPS)
        .map(|i| 1.0 - (-stop * crossed(place(i))).exp())
        .sum();
    let covered_by = |radius: f64| {
        let chord = |x: f64| 2.0 * (radius * radius - x * x).max(0.0).sqrt();
        let density = 2.0 * r * n / (PI * radius * radius);
        let stop = crowding(radius) * density;
        (0..STEPS)
            .map(|i| 1.0 - (-stop * chord(place(i))).exp())
            .sum::<f64>()
    };
    // What it covers grows with the disc.
    let (mut low, mut high) = (0.7 * even, reach);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if covered_by(middle) < covered {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

impl Cloth {
    /// The plies as round strands. Hairs are curves beside them, of the
    /// materials behind those of the plies. Loops, piles, single fibres and what colours the
    /// fibres of a ply differently are left out.
    pub fn plies(&self) -> Plies<'_> {
        Plies {
            cloth: self,
            radius_scales: None,
        }
    }
}

impl<'a> Plies<'a> {
    /// The same with plies that are so many times as thick, by the yarn.
    pub fn scaled(self, radius_scales: &'a BTreeMap<String, f64>) -> Plies<'a> {
        Plies {
            radius_scales: Some(radius_scales),
            ..self
        }
    }
}

impl Plies<'_> {
    /// What the strands of each material are; `None` for a material that no thread has.
    pub fn strands(&self) -> Vec<Option<PlyStrand>> {
        let of_material = |name: &str| {
            let mut threads = self.cloth.threads.iter();
            let thread = threads.find(|t| t.spun.yarn.name == name)?;
            Some(self.strand_of(thread))
        };
        let materials = self.cloth.materials.iter();
        materials.map(|m| of_material(&m.yarn)).collect()
    }

    fn rings_of(&self, thread: &ThreadAtRest) -> &'static [(u32, f64)] {
        let mean = thread.section.mean();
        rings(mean.max_element() / mean.min_element())
    }

    fn strand_of(&self, thread: &ThreadAtRest) -> PlyStrand {
        let yarn = &*thread.spun.yarn;
        let strands = f64::from(count(self.rings_of(thread)));
        PlyStrand {
            radius_mm: self.ply_radius_mm(thread) / strands.sqrt(),
            fibre_radius_mm: yarn.fibre_radius_mm,
            fibres: f64::from(yarn.fibres_per_ply) / strands,
            twist_rad_per_mm: yarn.twist_rad_per_mm,
        }
    }

    /// Radius of the even disc that covers, seen from the side, as much of the width as the
    /// ply's fibres do where they lie between core and rim.
    fn ply_radius_mm(&self, thread: &ThreadAtRest) -> f64 {
        let yarn = &*thread.spun.yarn;
        let scale = self.radius_scales.and_then(|all| all.get(&yarn.name));
        covering_radius_mm(yarn) * thread.section.area().sqrt() * scale.unwrap_or(&1.0)
    }

    fn emit_thread(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let thread = &self.cloth.threads[batch];
        let rings = self.rings_of(thread);
        let level = if rings.len() == 1 {
            CurveLevel::Ply
        } else {
            CurveLevel::Fibre
        };
        let path = self.cloth.path(thread, level);
        let strand = self.cloth.strand(batch, &path);
        let whole_mm = self.ply_radius_mm(thread);
        let first = strand.emit_rings(rings, whole_mm, thread.section.area().sqrt(), emit);
        // Hairs of a thread have colours of its dye; straight ones that of the template.
        let plies = self.cloth.materials.len() as u16;
        let mut emit_hair = |s: &Segment| {
            emit(&Segment {
                material: s.material + plies,
                ..*s
            });
        };
        let first = strand.emit_hairs(first, &mut emit_hair);
        strand.emit_neps(first, &mut emit_hair);
    }
}

impl Strand<'_> {
    /// Strands in rings within each ply of a radius in the cloth, which is `pressed` times
    /// that of the yarn at rest.
    fn emit_rings(
        &self,
        rings: &[(u32, f64)],
        ply_mm: f64,
        pressed: f64,
        emit: &mut dyn FnMut(&Segment),
    ) -> u32 {
        let turned = self.ply_phase();
        let radius_mm = ply_mm / f64::from(count(rings)).sqrt();
        let c = self.closure;
        // Whole sixths of a turn over the period: the hexagon then meets itself.
        let turns = (6.0 * c.turns as f64 / f64::from(c.windings())).round() / 6.0;
        let look = |s: f64, _| self.whole(self.scale(s) * radius_mm);
        let mut id = 0;
        for ply in 0..self.yarn.plies {
            for &(count, ring) in rings {
                for k in 0..count {
                    let place = |s: f64| {
                        let angle = TAU * (f64::from(k) / f64::from(count) + turns * s);
                        let aside = ring * ply_mm / pressed * DVec2::from_angle(angle);
                        self.scale(s) * (self.ply_centre(ply, turned, s) + aside)
                    };
                    id = self.emit_period(id, place, look, emit);
                }
            }
        }
        id
    }
}

impl SegmentSource for Plies<'_> {
    fn tile(&self) -> Tile {
        self.cloth.tile
    }

    fn batch_count(&self) -> usize {
        self.cloth.threads.len()
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        if !self.cloth.is_recoloured() {
            return self.emit_thread(batch, emit);
        }
        let plies = self.cloth.materials.len() as u16;
        self.emit_thread(batch, &mut |s| {
            // Print and wear know no materials of hairs.
            let hair = if s.material < plies { 0 } else { plies };
            let plain = Segment {
                material: s.material - hair,
                ..*s
            };
            self.cloth.emit_recoloured(&plain, &mut |dyed| {
                let material = dyed.material + hair;
                emit(&Segment { material, ..*dyed });
            });
        });
    }

    /// Those of the cloth, for plies, and the same again, for hairs.
    fn material_count(&self) -> usize {
        2 * self.cloth.materials.len()
    }
}

impl Plies<'_> {
    /// The first part of the cloth that is no ply; `None` when all of it is.
    pub fn unfit(&self) -> Option<&'static str> {
        if self.cloth.pile.is_some() {
            return Some("pile");
        }
        if !self.cloth.pills.is_empty() {
            return Some("pills");
        }
        if self.cloth.openings.is_some() {
            return Some("fulled yarns");
        }
        if self.cloth.yarns.iter().any(|y| y.blends_materials) {
            return Some("blends of fibre materials");
        }
        let bare = |t: &ThreadAtRest| matches!(t.line, super::Centreline::Bare(_));
        self.cloth
            .threads
            .iter()
            .any(bare)
            .then_some("single fibres")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// The even disc of radius 1 has the second moment 1 / 2.
    #[test]
    fn rings_have_the_second_moment_of_a_disc() {
        for rings in [&ONE[..], &SEVEN[..], &NINETEEN[..]] {
            let n = f64::from(count(rings));
            let squares: f64 = rings.iter().map(|&(k, r)| f64::from(k) * r * r).sum();
            let moment = squares / n + 0.5 / n;
            assert!((moment - 0.5).abs() < 2e-3, "{n}: {moment}");
        }
    }

    /// Whatever is no ply has a material of hairs, whether the yarn or the nep gives its colour.
    #[test]
    fn hairs_and_neps_have_the_materials_of_hairs() {
        let text = "draft = { weave = \"plain\" }\nwarp = { per_cm = 14.0 }\n\
                    weft = { per_cm = 14.0 }\ntile = { repeats = [4, 4] }\n[yarn.cotton]\n\
                    hairiness = { index = 4.0, length_mm = 1.0, reach_mm = 0.3 }\n\
                    neps = { per_m = 900.0, size_mm = [0.3, 0.0], colours = [[0.5, 0.1, 0.1]] }";
        let geometry = toml::from_str(text).unwrap();
        let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        let cloth = Cloth::build(&geometry, &no_files, 1).unwrap();
        let plies = cloth.plies();
        let strand_mm = plies.strands()[0].unwrap().radius_mm as f32;
        let fibre_mm = cloth.yarns()[0].fibre_radius_mm as f32;
        let count = cloth.materials().len();
        let mut seen = vec![0; plies.material_count()];
        for batch in 0..plies.batch_count() {
            plies.for_each_in_batch(batch, &mut |s| {
                let is_ply = usize::from(s.material) < count;
                let near = if is_ply { strand_mm } else { fibre_mm };
                assert!((s.start_radius_mm / near - 1.0).abs() < 0.7, "{s:?}");
                seen[usize::from(s.material)] += 1;
            });
        }
        // Plies of the yarn's colour, hairs of it, and neps of theirs.
        assert!(count == 2 && seen[0] > 0 && seen[2] > 0 && seen[3] > 0);
        assert_eq!(seen[1], 0, "no ply is a nep");
    }

    #[test]
    fn plies_fill_what_their_fibres_fill_and_close_over_the_tile() {
        for yarn in [
            "{ preset = \"cotton\", tex = 30.0, plies = 2 }",
            "{ preset = \"cotton\", tex = 30.0, aspect = 1.6 }",
            "{ preset = \"silk\", tex = 6.0, aspect = 3.5 }",
        ] {
            let text = format!(
                "draft = {{ weave = \"plain\" }}\nwarp = {{ yarn = \"y\", per_cm = 24.0 }}\n\
                 weft = {{ yarn = \"y\", per_cm = 18.0 }}\nyarn.y = {yarn}"
            );
            let geometry = toml::from_str(&text).unwrap();
            let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
            let cloth = Cloth::build(&geometry, &no_files, 1).unwrap();
            let plies = cloth.plies();
            let strand = plies.strands()[0].unwrap();
            let wider = [("y".to_owned(), 1.25)].into();
            let wide = plies.scaled(&wider).strands()[0].unwrap();
            assert!((wide.radius_mm / strand.radius_mm - 1.25).abs() < 4.0 * f64::EPSILON);
            let (mut starts, mut ends) = (Vec::new(), Vec::new());
            let tile = plies.tile();
            let (mut last, mut volume) = (None, 0.0);
            for batch in 0..plies.batch_count() {
                plies.for_each_in_batch(batch, &mut |s| {
                    if usize::from(s.material) >= cloth.materials().len() {
                        return;
                    }
                    volume += f64::from(s.length_mm() * s.start_radius_mm.powi(2));
                    let end = last.take();
                    if end.is_none_or(|e: Segment| e.end_mm != s.start_mm) {
                        starts.push(s.start_mm);
                        ends.extend(end.map(|e| e.end_mm));
                    }
                    last = Some(*s);
                });
            }
            ends.extend(last.map(|s| s.end_mm));
            assert_eq!(starts.len(), ends.len());
            // Every end is a start, one period on.
            let size = tile.bounds_mm.size();
            let apart = |a: Vec3, b: Vec3| {
                let d = a - b;
                let whole = Vec3::new((d.x / size.x).round(), (d.y / size.y).round(), 0.0);
                (d - whole * size).length()
            };
            for end in &ends {
                let near = starts.iter().map(|&s| apart(*end, s));
                let near = near.fold(f32::INFINITY, f32::min);
                assert!(
                    near < 4.0 * f32::EPSILON,
                    "{yarn}: {end} is {near} from a start"
                );
            }
            let packing = strand.fibres * (strand.fibre_radius_mm / strand.radius_mm).powi(2);
            assert!((0.2..0.91).contains(&packing), "{yarn}: {packing}");
            // As much fibre as the cloth has, within what twist adds.
            let mut fibre = 0.0;
            for batch in 0..cloth.batch_count() {
                cloth.for_each_in_batch(batch, &mut |s| {
                    fibre += f64::from(s.length_mm() * s.start_radius_mm.powi(2));
                });
            }
            let ratio = volume * packing / fibre;
            assert!((0.75..1.1).contains(&ratio), "{yarn}: {ratio}");
        }
    }
}
