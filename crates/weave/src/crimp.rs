//! Crimp of the fibres inside a yarn: each fibre winds or swings about the line that it would
//! follow without it.
//!
//! The displacement lies in the fibre's own frame, whose axes point away from the axis of the ply
//! and around it, and which therefore turns with the twist. Every fibre has its own number of
//! crimps, size, handedness or plane, and phase; the phase drifts along the fibre, so that crimps
//! differ in length. All of it closes over the windings of the fibre.

use crate::spec::{CrimpShape, CrimpSpec};
use crate::spline::periodic_spline;
use glam::DVec2;
use organza_basis::PathRng;
use std::f64::consts::TAU;

/// Crimps between the knots of the drift of the phase.
const CRIMPS_PER_KNOT: f64 = 2.0;
/// The most knots along a fibre, and the fewest.
const MAX_KNOTS: f64 = 65_536.0;
const MIN_KNOTS: usize = 4;
/// Deviates are clamped to this magnitude, so that no fibre leaves its room.
const MAX_DEVIATIONS: f64 = 2.0;

/// The crimp of one fibre over all its windings.
pub(crate) struct Crimp {
    shape: CrimpShape,
    amplitude_mm: f64,
    /// Whole crimps; negative if a helix is left-handed.
    crimps: f64,
    phase_rad: f64,
    /// Direction of the swings of a planar crimp.
    plane: DVec2,
    /// Drift of the phase, radians.
    drift_rad: Vec<f64>,
}

impl Crimp {
    /// Draws the crimp of a fibre of the given length.
    pub fn new(spec: &CrimpSpec, fibre_mm: f64, rng: &mut PathRng) -> Crimp {
        let cv = 0.01 * spec.cv_percent;
        let normal =
            |rng: &mut PathRng| f64::from(rng.normal2().x).clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS);
        let unit = |rng: &mut PathRng| f64::from(rng.unit());
        let expected = 0.1 * spec.per_cm * fibre_mm;
        let crimps = (expected * (1.0 + cv * normal(rng))).round().max(1.0);
        let amplitude_mm = 1e-3 * spec.amplitude_um * (1.0 + cv * normal(rng)).max(0.0);
        let is_left = unit(rng) < 0.5;
        let phase_rad = TAU * unit(rng);
        let plane = DVec2::from_angle(TAU * unit(rng));
        let knots = (crimps / CRIMPS_PER_KNOT).round().min(MAX_KNOTS) as usize;
        // Neighbouring knots differ by the deviation of the length of the crimps between them.
        let step_rad = TAU * CRIMPS_PER_KNOT * cv / 2f64.sqrt();
        let drift_rad = (0..knots.max(MIN_KNOTS))
            .map(|_| step_rad * normal(rng))
            .collect();
        Crimp {
            shape: spec.shape,
            amplitude_mm,
            crimps: if is_left { -crimps } else { crimps },
            phase_rad,
            plane,
            drift_rad,
        }
    }

    /// Displacement at the share `run` of all windings: away from the axis of the ply and around
    /// it, mm.
    pub fn at(&self, run: f64) -> DVec2 {
        let drift = periodic_spline(&self.drift_rad, run);
        let turned = DVec2::from_angle(self.phase_rad + TAU * self.crimps * run + drift);
        match self.shape {
            CrimpShape::Helical => self.amplitude_mm * turned,
            CrimpShape::Planar => self.amplitude_mm * turned.x * self.plane,
        }
    }
}

impl CrimpSpec {
    /// The largest displacement, millimetres.
    pub(crate) fn reach_mm(&self) -> f64 {
        1e-3 * self.amplitude_um * (1.0 + MAX_DEVIATIONS * 0.01 * self.cv_percent)
    }

    /// Mean square of the slope that it adds to fibres in a frame that turns at a rate.
    pub(crate) fn square_slope(&self, turn_rad_per_mm: f64) -> f64 {
        let spread = 1.0 + (0.01 * self.cv_percent).powi(2);
        let wave = 0.1 * TAU * self.per_cm;
        let square = 1e-6 * self.amplitude_um.powi(2) * spread;
        let helical = square * (wave * wave * spread + turn_rad_per_mm * turn_rad_per_mm);
        match self.shape {
            CrimpShape::Helical => helical,
            CrimpShape::Planar => 0.5 * helical,
        }
    }

    /// Curvature of its tightest places, 1/mm.
    pub(crate) fn bend_per_mm(&self) -> f64 {
        self.reach_mm() * (0.1 * TAU * self.per_cm).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(shape: CrimpShape) -> CrimpSpec {
        CrimpSpec {
            per_cm: 8.0,
            amplitude_um: 25.0,
            shape,
            cv_percent: 20.0,
        }
    }

    /// Crimps per centimetre and root mean square of the displacement, by counting how often one
    /// component changes its sign, over many fibres.
    fn measured(spec: &CrimpSpec) -> [f64; 2] {
        const FIBRE_MM: f64 = 30.0;
        const STEPS: usize = 1200;
        let (mut changes, mut square, fibres) = (0.0, 0.0, 200);
        for i in 0..fibres {
            let crimp = Crimp::new(spec, FIBRE_MM, &mut PathRng::new(5, i, 0));
            assert!(
                crimp.at(0.3).distance(crimp.at(1.3)) < 16.0 * f64::EPSILON,
                "it closes"
            );
            let along = |k: usize| {
                let shift = crimp.at(k as f64 / STEPS as f64);
                assert!(shift.length() <= spec.reach_mm() + 1e-12);
                square += shift.length_squared();
                match spec.shape {
                    CrimpShape::Helical => shift.x,
                    CrimpShape::Planar => shift.dot(crimp.plane),
                }
            };
            let places: Vec<f64> = (0..=STEPS).map(along).collect();
            let changed = places.windows(2).filter(|w| w[0] * w[1] < 0.0);
            changes += changed.count() as f64;
        }
        let all = fibres as f64;
        [
            0.5 * changes / (0.1 * FIBRE_MM * all),
            (square / (all * (STEPS + 1) as f64)).sqrt(),
        ]
    }

    #[test]
    fn crimps_have_their_number_and_size() {
        // Of 200 fibres with a variation of 20 %: four standard errors are 6 %. Clamped deviates
        // and their squares take 2 %.
        let error = 4.0 * 0.2 / 200f64.sqrt() + 0.02;
        for (shape, mean_square) in [(CrimpShape::Helical, 1.0), (CrimpShape::Planar, 0.5)] {
            let [per_cm, rms_mm] = measured(&spec(shape));
            let expected_mm = 0.025 * (mean_square * (1.0 + 0.2f64 * 0.2)).sqrt();
            assert!((per_cm / 8.0 - 1.0).abs() < error, "{per_cm}; seed 5");
            assert!(
                (rms_mm / expected_mm - 1.0).abs() < error,
                "{rms_mm} {expected_mm}"
            );
            // The twin: a fifth fewer crimps.
            let twin = CrimpSpec {
                per_cm: 6.4,
                ..spec(shape)
            };
            assert!((measured(&twin)[0] / 8.0 - 1.0).abs() > error);
        }
    }
}
