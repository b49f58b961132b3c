//! `in-plane`: the planes of weft and warp, as goniometers scan them.

use super::layout::{Kind, Layout};
use organza_measure::{Angles, Pair, in_plane_layout};

/// Polar angles of the light, degrees.
const LIGHT_DEG: [f64; 4] = [0.0, 30.0, 45.0, 60.0];

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "in-plane",
    help: "The planes of weft and warp: light at 0, 30, 45 and 60 degrees, exitant directions every 10 degrees on both sides",
    kind: Kind::Rows {
        pairs: |_| {
            LIGHT_DEG
                .into_iter()
                .flat_map(in_plane_layout)
                .collect::<Vec<Pair>>()
        },
        incident: |_| {
            let of = |theta_deg| [0.0, 90.0].map(|phi_deg| Angles { theta_deg, phi_deg });
            LIGHT_DEG.into_iter().flat_map(of).collect()
        },
        check: |_| Ok(()),
    },
};
