//! Micro-flakes of any family for lanes: what they show, tabulated, and how they scatter.

use super::population_tables::{CODES_PER_ROW_LOG2, ROWS, SHOWN_NODES};
use super::seen_tangent::shown_correction;
use super::voxel_words::end_on_of;
use glam::Vec3;
use organza_basis::Rgb;
use organza_lanes::Floats;
use organza_scatter::{FlakePopulation, FlakeScattering};
use std::sync::Arc;

/// A family of micro-flakes.
pub struct FlakeTables {
    /// How it scatters.
    pub scattering: Arc<dyn FlakeScattering>,
    /// The area that flakes show over that of SGGX flakes with the same end-on ratio, which is
    /// near one, as bits of `f32`: rows of codes, see [`shown_correction`].
    shown: Vec<u32>,
}

impl FlakeTables {
    pub fn new(scattering: Arc<dyn FlakeScattering>) -> FlakeTables {
        let shown = |row: u32, node: u32| {
            let end_on = end_on_of((row << CODES_PER_ROW_LOG2) + (1 << (CODES_PER_ROW_LOG2 - 1)));
            let (e2, part) = (end_on * end_on, node as f32 / (SHOWN_NODES - 1) as f32);
            let across = part * e2 / (1.0 - part + part * e2);
            let along = 1.0 - across;
            let w = Vec3::new(across.sqrt(), 0.0, along.max(0.0).sqrt());
            scattering.area(&upright(end_on), w) / (e2 * along + across).sqrt()
        };
        let rows = (0..ROWS).flat_map(|row| (0..SHOWN_NODES).map(move |node| (row, node)));
        FlakeTables {
            shown: rows.map(|(row, node)| shown(row, node).to_bits()).collect(),
            scattering,
        }
    }

    /// See [`Event::area_squared`](super::event::Event::area_squared): at most the square of
    /// what is shown across the axis.
    #[inline(always)]
    pub fn area_squared<F: Floats>(&self, code: F::Ints, along: F, across: F, end_on: F) -> F {
        let ellipsoid = (end_on * end_on).mul_add(along, across);
        let shown = shown_correction(&self.shown, code, along, across, end_on);
        (ellipsoid * shown * shown).min(along + across)
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        4 * self.shown.len() as u64
    }
}

/// Flakes about the z axis.
fn upright(end_on: f32) -> FlakePopulation {
    FlakePopulation {
        axis: Vec3::Z,
        end_on,
        albedo: Rgb::WHITE,
        material: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_lanes::one;
    use organza_scatter::FlakeFamily;

    /// Tabulated areas are those of every family, of whatever end-on ratio and from wherever.
    /// The ellipsoid alone, which is the area of one family, is the twin.
    #[test]
    fn lanes_see_what_flakes_show() {
        for family in FlakeFamily::all() {
            let tables = FlakeTables::new(family.scattering(&[]));
            let (mut worst, mut twin) = (0.0f32, 0.0f32);
            for code in (130..4096).step_by(17) {
                let end_on = end_on_of(code);
                for k in 0..=40 {
                    let sine = (k as f32 / 40.0).powi(2);
                    let (along, across) = (1.0 - sine * sine, sine * sine);
                    let w = Vec3::new(sine, 0.0, along.sqrt());
                    let exact = tables.scattering.area(&upright(end_on), w);
                    let lanes = [along, across, end_on].map(one::F);
                    let code = one::U(code);
                    let squared = tables.area_squared(code, lanes[0], lanes[1], lanes[2]);
                    let got = squared.0.sqrt();
                    assert!(got <= 1.0, "{family:?}: {got}");
                    worst = worst.max((got - exact).abs());
                    twin = twin.max(((end_on * end_on * along + across).sqrt() - exact).abs());
                }
            }
            assert!(worst < 2e-3, "{family:?}: {worst}");
            let is_sggx = family.name().starts_with("sggx");
            assert_eq!(twin > 0.01, !is_sggx, "{family:?}: {twin}");
        }
    }
}
