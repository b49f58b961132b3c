//! A near field taken apart: what tables of it are made from.

use super::LOBES;
use crate::longitudinal::{Balance, Blur};
use organza_basis::Rgb;

/// The numbers that a [`NearField`](crate::NearField) is computed from.
///
/// `f = c(theta_o) c(theta_i) cos(theta_i) sum_p K_p(theta_i, theta_o) A_p N_p(azimuth)`
/// with the scale c of [`Balance`], the folded
/// Gaussians K of the inclinations, and per kind of fibre the attenuations A and
/// the densities N of the azimuth.
#[derive(Clone, Debug)]
pub struct NearParts {
    /// Deviations of the Gaussians K, radians, of R, TT, TRT and the rest. The
    /// last two of a fitted fibre are unused.
    pub blurs_rad: [f32; LOBES],
    /// Deviation of the azimuth of the lobes that have one of their own, radians.
    pub azimuthal_rad: f32,
    /// What scatters.
    pub kind: NearKind,
    /// Of even steps of the cosine of the inclination, from 0 to 1: c per
    /// channel and the norms of the four lobes, c times and norms over
    /// `sqrt(cos^2 + b^2)` with the blur b of R.
    pub balance: Vec<BalanceNode>,
    /// No less than the mean of c over channels times `cos^2` anywhere.
    pub max_drawn: f32,
    /// Of a dielectric that is not round, or a measured fibre, in place of ray optics at the offset.
    pub section: Option<SectionTable>,
}

/// The azimuthal part of a fibre that is not round: R, TT and what comes later, and a
/// remainder that is even.
#[derive(Clone, Debug)]
pub struct SectionTable {
    /// At even steps of the cosine of the mean inclination, from 0 to 1: [`FAR_ROWS`] of them,
    /// with equally many nodes, two at least.
    ///
    /// [`FAR_ROWS`]: crate::FAR_ROWS
    pub rows: Vec<SectionRow>,
}

/// A [`SectionTable`] at a mean inclination.
#[derive(Clone, Debug)]
pub struct SectionRow {
    /// Probability of each lobe.
    pub lobes: [f32; LOBES],
    /// Light of the remainder per radian, per channel.
    pub rest: [f32; 3],
    /// Of R, TT and what comes later, at even steps of the azimuth from 0 to pi: light per
    /// radian and channel, and the density of drawing the azimuth.
    pub nodes: [Vec<[f32; 4]>; LOBES - 1],
}

/// A node of [`NearParts::balance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BalanceNode {
    /// c, per channel.
    pub scale: [f32; 3],
    /// Norms per lobe.
    pub norms: [f32; LOBES],
}

/// The kinds of fibres that have a near field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NearKind {
    /// R, TT, TRT and the rest, from ray optics at the offset.
    Dielectric {
        /// Index of refraction.
        ior: f32,
        /// Absorption coefficient times radius.
        absorption_radii: Rgb,
    },
    /// An even R and a TT about the way straight on.
    Fitted {
        /// Reflectance of R at normal incidence.
        colour_r: Rgb,
        /// Part of the rest that TT keeps.
        colour_tt: Rgb,
    },
}

impl NearParts {
    /// Of a kind of fibre with its blurs, the deviation of its azimuth, and its balance.
    pub fn new(kind: NearKind, blurs: &[Blur], azimuthal_rad: f32, balance: &Balance) -> NearParts {
        let of = |p: usize| blurs.get(p).unwrap_or(&blurs[0]).deviation_rad;
        let node = |i: usize| {
            let bare = balance.node(i);
            BalanceNode {
                scale: bare.scale.to_array(),
                norms: bare.norms.to_array(),
            }
        };
        NearParts {
            blurs_rad: [0, 1, 2, 3].map(of),
            azimuthal_rad,
            kind,
            balance: (0..balance.nodes()).map(node).collect(),
            max_drawn: balance.most(),
            section: None,
        }
    }
}
