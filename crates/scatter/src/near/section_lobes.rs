//! Azimuthal lobes of fibres that are not round, in lanes: a table, and how to draw from it.
//!
//! Between nodes the lobes are linear in the cosine of the mean inclination and in the
//! azimuth. An azimuth is drawn from one of the two rows: a node by an alias table
//! [Walker1977], then a place in the tent that interpolation spreads it over.
// Loops over lobes go by index: the compiler may leave iterators of vectors without
// the back end's instructions.
#![allow(clippy::needless_range_loop)]

use super::LOBES;
use super::optics::Optics;
use super::parts::{SectionRow, SectionTable};
use crate::FAR_ROWS;
use crate::lobe_table::SHAPED;
use organza_basis::AliasTable;
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints, vector_of, word_of};
use std::f32::consts::{FRAC_1_PI, PI};

/// Words of a row before its nodes: light of the remainder, one of room, chances of lobes.
const ROW_HEAD: u32 = 8;
/// Words of a node: per lobe light of three channels and the density of drawing, then per
/// lobe what of its slot is its own, and who has the rest (a whole number).
const NODE: u32 = 6 * SHAPED as u32;

/// The table of one material in every lane.
#[derive(Clone, Copy)]
pub struct SectionLobes<F: Floats> {
    /// Word of the first row.
    pub first: F::Ints,
    /// Nodes of a row.
    pub azimuths: F::Ints,
}

/// Appends a table to the words of the materials and gives what heads say of it.
pub fn lay_out_section(table: &SectionTable, words: &mut Vec<u32>) -> [u32; 2] {
    let rows = &table.rows;
    let is_whole = |row: &SectionRow| {
        let count = row.nodes[0].len();
        count >= 2 && row.nodes.iter().all(|n| n.len() == rows[0].nodes[0].len())
    };
    assert!(
        rows.len() == FAR_ROWS && rows.iter().all(is_whole),
        "a table of lobes needs {FAR_ROWS} rows of equally many nodes"
    );
    let first = words.len() as u32;
    let azimuths = table.rows.first().map_or(0, |row| row.nodes[0].len());
    for row in &table.rows {
        words.extend(row.rest.map(f32::to_bits));
        words.push(0);
        words.extend(row.lobes.map(f32::to_bits));
        let slots: Vec<Vec<(f32, u32)>> = row.nodes.iter().map(|nodes| slots(nodes)).collect();
        for k in 0..azimuths {
            for nodes in &row.nodes {
                words.extend(nodes[k].map(f32::to_bits));
            }
            for slots in &slots {
                words.extend([slots[k].0.to_bits(), slots[k].1]);
            }
        }
    }
    // The next material's nodes begin here, and adapters read four of their words at once, at
    // multiples of four.
    words.resize(words.len().next_multiple_of(4), 0);
    [first, azimuths as u32]
}

/// How a lobe draws its nodes: those at the ends have half a tent.
fn slots(nodes: &[[f32; 4]]) -> Vec<(f32, u32)> {
    let mut weights: Vec<f64> = nodes.iter().map(|n| f64::from(n[3])).collect();
    if let [first, .., last] = &mut weights[..] {
        *first *= 0.5;
        *last *= 0.5;
    }
    match AliasTable::new(&weights) {
        Some(table) => table.slots().to_vec(),
        None => (0..nodes.len() as u32).map(|k| (1.0, k)).collect(),
    }
}

impl<F: Floats> SectionLobes<F> {
    /// The row before a cosine, and how far it is to the next.
    #[inline(always)]
    fn row(&self, mean_cos: F) -> (F::Ints, F) {
        let last = F::splat((FAR_ROWS - 1) as f32);
        let scaled = mean_cos * last;
        let row = scaled.floor().max(F::splat(0.0)).min(last - F::splat(1.0));
        (self.first + row.to_ints() * self.stride(), scaled - row)
    }

    /// Words of a row.
    #[inline(always)]
    fn stride(&self) -> F::Ints {
        let word = F::Ints::splat;
        self.azimuths * word(NODE) + word(ROW_HEAD)
    }

    /// Chances of the lobes at the cosine of an inclination.
    #[inline(always)]
    pub fn lobes(&self, optics: &Optics, cos: F) -> [F; LOBES] {
        let (row, share) = self.row(cos);
        let next = row + self.stride();
        let mut all = [F::splat(0.0); LOBES];
        for p in 0..LOBES {
            let a = word_of::<F>(&optics.words, row, 4 + p as u32);
            let b = word_of::<F>(&optics.words, next, 4 + p as u32);
            all[p] = (b - a).mul_add(share, a);
        }
        all
    }

    /// Per lobe light over the density of drawing an azimuth, and that density, per radian.
    #[inline(always)]
    pub fn at(&self, optics: &Optics, mean_cos: F, azimuth: F) -> [(V3<F>, F); LOBES] {
        let words = &optics.words[..];
        let word = F::Ints::splat;
        let (row, down) = self.row(mean_cos);
        let next = row + self.stride();
        let last = self.azimuths.to_floats() - F::splat(1.0);
        let scaled = azimuth.abs().min(F::splat(PI)) * F::splat(FRAC_1_PI) * last;
        let left = scaled.floor().min(last - F::splat(1.0));
        let along = scaled - left;
        let offset = left.to_ints() * word(NODE) + word(ROW_HEAD);
        let even = F::splat(0.5 * FRAC_1_PI);
        let [a, b] = [
            vector_of::<F>(words, row, 0),
            vector_of::<F>(words, next, 0),
        ];
        let rest = mixed(a, b, down).scaled(F::splat(2.0 * PI));
        let mut all = [(rest, even); LOBES];
        for p in 0..SHAPED {
            let k = 4 * p as u32;
            let (a, c) = between::<F>(words, row + offset, k, along);
            let (b, d) = between::<F>(words, next + offset, k, along);
            let density = (d - c).mul_add(down, c).max(F::splat(f32::MIN_POSITIVE));
            let light = mixed(a, b, down);
            all[p] = (light.scaled(F::splat(1.0) / density), density);
        }
        all
    }

    /// Draws the azimuth of a lobe with that density.
    #[inline(always)]
    pub fn azimuth(
        &self,
        optics: &Optics,
        lobe: F::Ints,
        mean_cos: F,
        [[u_row, u_slot, u_keep], [u_place, v_place, u_sign]]: [[F; 3]; 2],
    ) -> F {
        let words = &optics.words[..];
        let word = F::Ints::splat;
        let (one, two) = (F::splat(1.0), F::splat(2.0));
        let (row, down) = self.row(mean_cos);
        let row = (row + self.stride()).or_where_not(u_row.below(down), row);
        let count = self.azimuths.to_floats();
        let slot = (u_slot * count).floor().min(count - one).to_ints();
        let pair = row + slot * word(NODE) + lobe.shl::<1>() + word(ROW_HEAD + 4 * SHAPED as u32);
        let own = word_of::<F>(words, pair, 0);
        let other = (pair + word(1)).gather(words);
        let node = slot.or_where_not(u_keep.below(own), other).to_floats();
        // Folded at the ends.
        let place = (node + (u_place + v_place - one)).abs();
        let last = count - one;
        let place = place.min(two * last - place);
        let azimuth = place * F::splat(PI) / last;
        azimuth.or_where_not(u_sign.below(F::splat(0.5)), -azimuth)
    }
}

/// Light and density of a lobe between two nodes.
#[inline(always)]
fn between<F: Floats>(words: &[u32], place: F::Ints, k: u32, along: F) -> (V3<F>, F) {
    let a = vector_of::<F>(words, place, k);
    let b = vector_of::<F>(words, place, k + NODE);
    let c = word_of::<F>(words, place, k + 3);
    let d = word_of::<F>(words, place, k + 3 + NODE);
    (mixed(a, b, along), (d - c).mul_add(along, c))
}

#[inline(always)]
fn mixed<F: Floats>(a: V3<F>, b: V3<F>, share: F) -> V3<F> {
    a.scaled_add(F::splat(1.0) - share, b.scaled(share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DielectricFibre, DielectricParameters, Fibre, FibreFrame, Lobe, Section};
    use organza_basis::hypothesis::LineGrid;
    use organza_basis::{PathRng, Rgb, warp};
    use organza_lanes::one::Word;

    fn fibre(section: Option<Section>) -> Fibre {
        let parameters = DielectricParameters {
            ior: 1.55,
            absorption_radii: Rgb::new(0.02, 0.2, 1.0),
            longitudinal_rad: 0.1,
            azimuthal_rad: 0.2,
        };
        Fibre::from(DielectricFibre::with_section(parameters, section).unwrap())
    }

    /// At every offset value and density are those of the far field, which looks them up in its
    /// own way.
    #[test]
    fn near_fields_are_the_far_field() {
        let section = fibre(Some(Section::Trilobal));
        let off = |fibre: &Fibre| {
            let mut rng = PathRng::from_seed(72);
            let mut worst = 0.0f32;
            for _ in 0..400 {
                let [t, w_out, w_in] = [(); 3].map(|()| warp::uniform_sphere(rng.unit2()));
                let h = 1.8 * rng.unit() - 0.9;
                let near = fibre.near_field(FibreFrame::new(t, w_out), h);
                let far = section.far_field(t);
                let (value, pdf) = (far.eval(w_out, w_in).0, far.pdf(w_out, w_in));
                let apart = (near.eval(w_out, w_in).0 - value).abs().max_element()
                    + (near.pdf(w_out, w_in) - pdf).abs();
                worst = worst.max(apart / (value.max_element() + pdf + 1e-3));
            }
            worst
        };
        assert!(off(&section) < 2e-3, "seed 72: {}", off(&section));
        // The twin is round.
        assert!(off(&fibre(None)) > 0.1, "seed 72");
    }

    #[test]
    fn azimuths_are_drawn_with_their_density() {
        let optics = Optics::new(&[fibre(Some(Section::Ribbon))]);
        let table = optics.material().section;
        let cos = 0.77f32;
        let mut rng = PathRng::from_seed(73);
        for lobe in 0..3 {
            let line = LineGrid {
                from: -f64::from(PI),
                to: f64::from(PI),
                cells: 48,
            };
            let density = |azimuth: f64| {
                let at = table.at(&optics, cos, azimuth as f32);
                f64::from(at[lobe].1)
            };
            let mut draw = || {
                let u = [(); 2].map(|()| [(); 3].map(|()| rng.unit()));
                let own = Word(lobe as u32);
                Some(f64::from(table.azimuth(&optics, own, cos, u)))
            };
            let verdict = line.chi_square(20_000, &mut draw, density);
            assert!(verdict.p_value > 1e-4, "seed 73, {lobe}: {verdict:?}");
            // Turns light to one side; lobes are even in azimuth.
            let lopsided = |a: f64| (1.0 + 0.2 * a.signum()) * density(a);
            let twin = line.chi_square(20_000, &mut draw, lopsided);
            assert!(twin.p_value < 1e-6, "seed 73, {lobe}: {twin:?}");
        }
    }
}
