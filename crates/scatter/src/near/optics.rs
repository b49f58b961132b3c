//! How fibres scatter, laid out for lanes.

use super::LOBES;
use super::parts::{NearKind, NearParts};
use super::section_lobes::{SectionLobes, lay_out_section};
use crate::fibre::Fibre;
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints, Mask, word_of};
use std::f32::consts::PI;

/// Words of a material before its balance.
const HEAD: u32 = 32;
/// Words of a node of the balance: c per channel, its mean, norms of four lobes.
const NODE: u32 = 8;

/// All materials.
///
/// A material has 32 words, as bits of `f32` where nothing else is said:
///
/// ```text
/// 0        1 of a round dielectric, 2 of another dielectric, 0 of a fitted fibre (a whole number)
/// 1        refractive index
/// 2..5     absorption times radius of a dielectric; R at normal incidence of a fitted fibre
/// 5..8     what TT of a fitted fibre keeps
/// 8..12    longitudinal blurs of R, TT, TRT and the rest, radians
/// 12..16   one over them
/// 16..20   cosines of how near to an end folds of them matter
/// 20, 21   azimuthal blur, radians, and one over it
/// 22       square of the blur of R
/// 23       greatest value that drawing an inclination is accepted by
/// 24       nodes of the balance
/// 25       word of the first node (a whole number)
/// 26..28   of a dielectric that is not round: see [`SectionLobes`]
/// ```
///
/// Behind all materials stand the nodes of their balances, over even steps of the cosine
/// of the inclination from 0 to 1; eight words each: the scale c of red, green and blue,
/// their mean, and the norms of the four lobes.
#[derive(Debug)]
pub struct Optics {
    /// As above.
    pub words: Vec<u32>,
    /// Materials.
    pub count: u32,
    /// Whether some of them are not round.
    pub has_sections: bool,
    /// Of every material how dark its fibres are, by channel in three steps.
    shades: Vec<u8>,
}

/// One material in every lane.
#[derive(Clone, Copy)]
pub struct Material<F: Floats> {
    pub(super) is_dielectric: F::Mask,
    /// Fibres that are not round.
    pub(super) is_section: F::Mask,
    pub(super) section: SectionLobes<F>,
    pub(super) ior: F,
    /// Absorption times radius of a dielectric; of a fitted fibre R at normal
    /// incidence.
    pub(super) absorption: V3<F>,
    /// Of a fitted fibre what TT keeps.
    pub(super) colour_tt: V3<F>,
    pub(super) blurs: [F; LOBES],
    pub(super) inverse_blurs: [F; LOBES],
    /// Cosine of how near to an end folds matter.
    pub(super) fold_cosines: [F; LOBES],
    pub(super) azimuth_blur: F,
    pub(super) inverse_azimuth_blur: F,
    /// Square of the blur of R, by which c is kept finite near the axis.
    near_axis: F,
    pub(super) max_drawn: F,
    nodes: F,
    first_node: F::Ints,
}

/// See [`Optics::shade`].
fn shade(kind: &NearKind) -> u8 {
    /// Shares of light, let through by a fibre, that part the steps.
    const STEPS: [f32; 2] = [0.25, 0.7];
    let through = match kind {
        NearKind::Dielectric {
            absorption_radii, ..
        } => absorption_radii.0.to_array().map(|a| (-2.0 * a).exp()),
        NearKind::Fitted { colour_tt, .. } => colour_tt.0.to_array(),
    };
    let step = |share: f32| STEPS.iter().filter(|s| share > **s).count() as u8;
    through
        .into_iter()
        .fold(0, |shade, share| 3 * shade + step(share))
}

/// The balance at an inclination.
#[derive(Clone, Copy)]
pub struct Balanced<F: Floats> {
    pub(super) scale: V3<F>,
    pub(super) norms: [F; LOBES],
}

impl Optics {
    /// Lays fibres out in the order of their numbers.
    pub fn new(fibres: &[Fibre]) -> Optics {
        let parts: Vec<NearParts> = fibres.iter().map(|fibre| fibre.near_parts()).collect();
        Optics::of_parts(&parts)
    }

    /// The same of their parts.
    pub fn of_parts(fibres: &[NearParts]) -> Optics {
        let mut words = vec![0; fibres.len().max(1) * HEAD as usize];
        let mut has_sections = false;
        let mut shades = Vec::with_capacity(fibres.len());
        for (i, parts) in fibres.iter().enumerate() {
            shades.push(shade(&parts.kind));
            let first = words.len() as u32;
            for node in &parts.balance {
                let [r, g, b] = node.scale;
                let mean = (r + g + b) * (1.0 / 3.0);
                words.extend([r, g, b, mean].map(f32::to_bits));
                words.extend(node.norms.map(f32::to_bits));
            }
            let (kind, ior, colours) = match parts.kind {
                NearKind::Dielectric {
                    ior,
                    absorption_radii,
                } => (
                    1 + u32::from(parts.section.is_some()),
                    ior,
                    [absorption_radii, organza_basis::Rgb::BLACK],
                ),
                NearKind::Fitted {
                    colour_r,
                    colour_tt,
                } => (0, 1.0, [colour_r, colour_tt]),
            };
            let mut head = vec![kind, ior.to_bits()];
            for colour in colours {
                head.extend(colour.0.to_array().map(f32::to_bits));
            }
            head.extend(parts.blurs_rad.map(f32::to_bits));
            head.extend(parts.blurs_rad.map(|b| (1.0 / b).to_bits()));
            let fold = |b: f32| (6.0 * b).min(PI).cos();
            head.extend(parts.blurs_rad.map(|b| fold(b).to_bits()));
            head.push(parts.azimuthal_rad.to_bits());
            head.push((1.0 / parts.azimuthal_rad).to_bits());
            let blur = parts.blurs_rad[0];
            head.push((blur * blur).to_bits());
            head.push(parts.max_drawn.to_bits());
            head.push((parts.balance.len() as f32).to_bits());
            head.push(first);
            if let Some(table) = &parts.section {
                has_sections = true;
                head.extend(lay_out_section(table, &mut words));
            }
            words[i * HEAD as usize..][..head.len()].copy_from_slice(&head);
        }
        Optics {
            words,
            count: fibres.len() as u32,
            has_sections,
            shades,
        }
    }

    /// Names the shade of a material: of those whose fibres let about as much of each colour through.
    pub fn shade(&self, material: u32) -> u8 {
        self.shades.get(material as usize).copied().unwrap_or(0)
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        4 * self.words.len() as u64
    }

    /// The only material.
    pub(crate) fn material(&self) -> Material<f32> {
        self.materials(organza_lanes::one::Word(0))
    }

    /// Materials by their numbers.
    #[inline(always)]
    pub fn materials<F: Floats>(&self, number: F::Ints) -> Material<F> {
        let word = F::Ints::splat;
        let first = number * word(HEAD);
        let at = match self.count {
            1 => Place::Same(&self.words),
            _ => Place::Each(&self.words, first),
        };
        Material {
            is_dielectric: at.bits(0).equals(word(1)),
            is_section: at.bits(0).equals(word(2)),
            section: SectionLobes {
                first: at.bits(26),
                azimuths: at.bits(27),
            },
            ior: at.number(1),
            absorption: at.vector(2),
            colour_tt: at.vector(5),
            blurs: at.four(8),
            inverse_blurs: at.four(12),
            fold_cosines: at.four(16),
            azimuth_blur: at.number(20),
            inverse_azimuth_blur: at.number(21),
            near_axis: at.number(22),
            max_drawn: at.number(23),
            nodes: at.number(24),
            first_node: at.bits(25),
        }
    }

    /// The balance at inclinations of such cosines.
    #[inline(always)]
    pub fn balanced<F: Floats>(&self, m: &Material<F>, cos: F) -> Balanced<F> {
        let (place, share, near_axis) = m.node(cos);
        let words = &self.words[..];
        let per = F::splat(1.0) / near_axis;
        let scale = V3 {
            x: between::<F>(words, place, 0, share),
            y: between::<F>(words, place, 1, share),
            z: between::<F>(words, place, 2, share),
        };
        Balanced {
            scale: scale.scaled(per),
            norms: [
                between::<F>(words, place, 4, share) * near_axis,
                between::<F>(words, place, 5, share) * near_axis,
                between::<F>(words, place, 6, share) * near_axis,
                between::<F>(words, place, 7, share) * near_axis,
            ],
        }
    }

    /// The mean of c over channels at inclinations of such cosines.
    #[inline(always)]
    pub fn mean_scale<F: Floats>(&self, m: &Material<F>, cos: F) -> F {
        let (place, share, near_axis) = m.node(cos);
        between::<F>(&self.words, place, 3, share) / near_axis
    }
}

impl<F: Floats> Material<F> {
    /// Where the node before a cosine begins, how far it is to the next, and
    /// what c is kept finite by.
    #[inline(always)]
    fn node(&self, cos: F) -> (F::Ints, F, F) {
        let last = self.nodes - F::splat(1.0);
        let scaled = cos * last;
        let lower = scaled.floor().max(F::splat(0.0)).min(last - F::splat(1.0));
        let place = self.first_node + lower.to_ints() * F::Ints::splat(NODE);
        let near_axis = cos.mul_add(cos, self.near_axis).sqrt();
        (place, scaled - lower, near_axis)
    }

    /// Lanes of a mask with a round dielectric, and those without.
    #[inline(always)]
    pub fn kinds(&self, mask: F::Mask) -> (bool, bool) {
        (
            (mask & self.is_dielectric).any(),
            (mask & !self.is_dielectric).any(),
        )
    }
}

/// A word of a node and of the next, a share of the way between them.
#[inline(always)]
fn between<F: Floats>(words: &[u32], place: F::Ints, k: u32, share: F) -> F {
    let a = word_of::<F>(words, place, k);
    let b = word_of::<F>(words, place, k + NODE);
    (b - a).mul_add(share, a)
}

/// Where the words of materials begin: the same in all lanes, or not.
#[derive(Clone, Copy)]
enum Place<'a, U> {
    Same(&'a [u32]),
    Each(&'a [u32], U),
}

impl<U: Ints> Place<'_, U> {
    #[inline(always)]
    fn bits(&self, k: u32) -> U {
        match self {
            Place::Same(words) => U::splat(words[k as usize]),
            Place::Each(words, first) => (*first + U::splat(k)).gather(words),
        }
    }

    #[inline(always)]
    fn number(&self, k: u32) -> U::Floats {
        self.bits(k).as_floats()
    }

    #[inline(always)]
    fn vector(&self, k: u32) -> V3<U::Floats> {
        V3::new(self.number(k), self.number(k + 1), self.number(k + 2))
    }

    #[inline(always)]
    fn four(&self, k: u32) -> [U::Floats; LOBES] {
        [
            self.number(k),
            self.number(k + 1),
            self.number(k + 2),
            self.number(k + 3),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Rgb;

    /// Dyes that differ to the eye have shades of their own; those of one yarn that took up a little
    /// more share one.
    #[test]
    fn dyes_have_shades() {
        let of = |r: f32, g: f32, b: f32| {
            shade(&NearKind::Dielectric {
                ior: 1.55,
                absorption_radii: Rgb::new(r, g, b),
            })
        };
        let (white, wine, black) = (of(0.01, 0.01, 0.02), of(0.3, 1.5, 1.2), of(2.0, 2.0, 2.0));
        let gold = of(0.05, 0.15, 1.5);
        for (i, a) in [white, wine, black, gold].iter().enumerate() {
            for b in &[white, wine, black, gold][..i] {
                assert_ne!(a, b);
            }
        }
        assert_eq!(wine, of(0.33, 1.7, 1.4));
        assert_eq!(Optics::new(&[]).shade(3), 0);
    }
}
