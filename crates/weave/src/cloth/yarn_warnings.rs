//! Warnings about the yarns of a cloth.

use super::{Centreline, Cloth};
use crate::CurveLevel;
use crate::blend::FibrePart;
use crate::closure::Closure;
use crate::yarn::Yarn;

/// Largest difference between realised and requested twist without a warning, as the slope of
/// the outermost fibres or plies.
const TWIST_WARNING: f64 = 0.06;

impl Cloth {
    /// Warns of twist that changes so that the tile closes, and of yarns with too
    /// many fibres to be pushed apart, and of keys without effect.
    pub(super) fn warn_of_yarns(&mut self) {
        self.warn_of_single_fibres();
        let mut is_checked = vec![false; self.yarns.len()];
        for (batch, thread) in self.threads.iter().enumerate() {
            if std::mem::replace(&mut is_checked[thread.yarn], true) {
                continue;
            }
            if let Centreline::Bare(_) = thread.line {
                continue;
            }
            let yarn = &*thread.spun.yarn;
            if yarn.flattening.is_some() && !matches!(thread.line, Centreline::Woven { .. }) {
                self.warnings.push(format!(
                    "yarn.{}.flattening has no effect: only threads of weaves flatten",
                    yarn.name,
                ));
            }
            let path = self.path(thread, CurveLevel::Yarn);
            let length = path.length_mm();
            let closure = Closure::new(yarn, length);
            if self.strand(batch, &path).is_too_large_to_push_apart() {
                self.warnings.push(format!(
                    "yarn.{}: too many fibres over {length:.0} mm to be pushed apart; some of them \
                     overlap",
                    yarn.name,
                ));
            }
            self.warnings.extend(rare_parts(yarn, &closure));
            for (what, wanted, got, radius) in [
                (
                    "twist",
                    yarn.twist_rad_per_mm,
                    closure.twist_rad_per_mm(length),
                    yarn.ply_radius_mm,
                ),
                (
                    "ply_twist",
                    yarn.ply_twist_rad_per_mm,
                    closure.ply_twist_rad_per_mm(yarn.plies, length),
                    yarn.radius_mm(),
                ),
            ] {
                if (wanted - got).abs() * radius > TWIST_WARNING {
                    let turns = |rate: f64| (rate * 1000.0 / std::f64::consts::TAU).round();
                    self.warnings.push(format!(
                        "yarn.{}.{what}: {} turns per metre were changed to {} so that the tile \
                         closes; more tile.repeats reduce the change",
                        yarn.name,
                        turns(wanted),
                        turns(got)
                    ));
                }
            }
        }
    }
}

impl Cloth {
    /// Warns of neps and fulling of yarns whose fibres are laid singly.
    fn warn_of_single_fibres(&mut self) {
        let is_spun = |yarn: &Yarn| self.spun_yarns().any(|s| s.name == yarn.name);
        let mut warnings = Vec::new();
        for yarn in self.yarns.iter().filter(|y| !is_spun(y)) {
            let keys = [
                ("neps", yarn.neps.is_some()),
                ("fulling", yarn.fulling > 0.0),
            ];
            for (key, _) in keys.iter().filter(|k| k.1) {
                warnings.push(format!(
                    "yarn.{}.{key} has no effect: cut pile, nonwovens and imported fibres do not \
                     consist of yarn",
                    yarn.name
                ));
            }
        }
        self.warnings.extend(warnings);
    }
}

/// Warnings about materials of a blend of which most threads hold no fibre.
fn rare_parts(yarn: &Yarn, closure: &Closure) -> Vec<String> {
    let fibres = f64::from(closure.fibres * yarn.plies / closure.visited);
    let parts = yarn.blend.iter().enumerate();
    let rare = parts.filter(|(_, part)| yarn.blends_materials && part.share * fibres < 0.5);
    let warning = |(i, part): (usize, &FibrePart)| {
        format!(
            "yarn.{}.blend[{i}]: most threads hold no fibre of this part, because they hold \
             {fibres} different fibres and its share by number is {:.4}; more tile.repeats, a \
             larger share or finer fibres help",
            yarn.name, part.share,
        )
    };
    rare.map(warning).collect()
}
