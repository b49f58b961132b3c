//! Errors of measured reflectances and transmittances.

use organza_basis::Moments;

/// Reflected, transmitted by scattering (three channels each), straight through.
pub type Shares = [Moments; 7];

/// The names of what is measured.
pub const NAMES: [&str; 7] = ["R.98", "R.9", "R.5", "T.98", "T.9", "T.5", "T0"];

/// Root mean square and worst relative error in percent, over views, of the
/// reflectances and of the transmittances at the two high albedos.
#[derive(Default)]
pub struct Errors(pub [Vec<f64>; 2]);

impl Errors {
    pub fn take(&mut self, truth: &Shares, got: &Shares) {
        for (kind, slots) in [(0, [0, 1]), (1, [3, 4])] {
            for i in slots {
                if truth[i].mean > 0.02 {
                    self.0[kind].push(100.0 * (got[i].mean / truth[i].mean - 1.0));
                }
            }
        }
    }

    pub fn rms(&self, kind: usize) -> f64 {
        let list = &self.0[kind];
        (list.iter().map(|e| e * e).sum::<f64>() / list.len().max(1) as f64).sqrt()
    }

    pub fn worst(&self, kind: usize) -> f64 {
        let list = self.0[kind].iter().copied();
        list.reduce(|a, b| if b.abs() > a.abs() { b } else { a })
            .unwrap_or(0.0)
    }
}
