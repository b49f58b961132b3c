//! What plies are fitted to, and what is held out to judge them by.

use super::pictures::Pictures;
use crate::fibres::Observed;
use crate::{FitJob, effort};
use anyhow::Result;
use organza_basis::PathRng;
use organza_measure::{Angles, Effort, HeldOutKind, Measured, Pair, PairValue, held_out_pairs};
use organza_scene::patches::AnyPatch;
use organza_work::of_file;
use serde_json::json;
use std::path::Path;

/// Which of the observed values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Those that the search sees.
    Fitted,
    /// Those that judge the answer.
    HeldOut,
}

/// One channel of an observed or simulated value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// What it is.
    pub group: &'static str,
    /// Its channel, 0 to 2; none of what depends on all.
    pub channel: Option<usize>,
    /// Expected error of the model, as a share of the value.
    pub expected: f64,
    /// Its mean.
    pub mean: f64,
    /// Its standard error.
    pub se: f64,
}

/// Observed values, and how the same are simulated.
pub enum Target {
    /// Pairs of directions and reflected and transmitted light: fitted, held out.
    Lists([Vec<Observed>; 2]),
    /// Pictures.
    Pictures(Pictures),
}

/// Expected error of the model, estimated: of all the light of a hemisphere or a picture, and of
/// the light between two directions. The search weighs values by it.
pub const WHOLE: f64 = 0.02;
const PAIR: f64 = 0.1;

/// Random pairs of explicit fibres, of each part.
const PAIRS: usize = 64;

/// Seeds of the pairs that are fitted and held out.
const PAIR_SEEDS: [u64; 2] = [31, 32];

/// Polar angles of the light whose whole reflection and transmission are compared, for each
/// part, degrees, and their azimuths. Each is taken on both sides.
const THETA_DEG: [[f64; 3]; 2] = [[0.0, 30.0, 60.0], [15.0, 45.0, 75.0]];
const PHI_DEG: [f64; 2] = [0.0, 90.0];

/// What plies are fitted to, and what judges them, has so many times the paths of the search.
const MORE_PATHS: u64 = 8;

/// Reflected and transmitted light has so many times the paths of a pair: it is few values, and
/// all light is in it.
const LIGHT_PATHS: u64 = 8;

/// One of so many measured values is held out.
const BLOCK: usize = 4;

/// Of the choice of values that are held out.
const HOLD_SEED: u64 = 33;

/// Least values of a file.
const MIN_VALUES: usize = 2 * BLOCK;

impl Target {
    /// Of another representation, at directions of its own, before it is measured.
    pub fn unknown() -> Target {
        let list = |part: usize| -> Vec<Observed> {
            let unknown = |pair: Pair| PairValue {
                pair,
                bsdf: NONE,
                paths: 0,
            };
            let pairs = held_out_pairs(PAIRS, PAIR_SEEDS[part]);
            let pairs = Observed::Pairs(pairs.into_iter().map(unknown).collect());
            let mut from: Vec<Angles> = Vec::new();
            for theta in THETA_DEG[part] {
                for theta_deg in [theta, 180.0 - theta] {
                    let azimuths = if theta == 0.0 {
                        &PHI_DEG[..1]
                    } else {
                        &PHI_DEG
                    };
                    from.extend(
                        azimuths
                            .iter()
                            .map(|&phi_deg| Angles { theta_deg, phi_deg }),
                    );
                }
            }
            let light = Observed::Hemispheres(from.into_iter().map(|a| (a, [NONE; 2])).collect());
            vec![pairs, light]
        };
        Target::Lists([list(0), list(1)])
    }

    /// The numbers of all values: means and standard errors of the fitted ones, then the
    /// same of the values that are held out.
    pub fn numbers(&self) -> Vec<f64> {
        let parts = [Part::Fitted, Part::HeldOut].map(|part| self.values(part));
        let all = parts.iter().flatten();
        all.flat_map(|v| [v.mean, v.se]).collect()
    }

    /// The [numbers](Target::numbers) of a patch: of the representation that plies are fitted
    /// to, with more paths.
    ///
    /// # Errors
    /// Those of the measurement.
    pub fn measured(&self, args: &FitJob, patch: &AnyPatch) -> Result<Vec<f64>> {
        let mut numbers = Vec::new();
        if let Target::Lists(lists) = self {
            for (part, observed) in lists.iter().enumerate() {
                for observed in observed {
                    let usual = effort_for(args, observed);
                    let effort = Effort {
                        paths: MORE_PATHS * usual.paths,
                        seed: args.seed ^ (1 + part as u64) << 40,
                        ..usual
                    };
                    let found = values(&observed.simulate_with(args, patch, &effort)?);
                    numbers.extend(found.iter().flat_map(|v| [v.mean, v.se]));
                }
            }
        }
        Ok(numbers)
    }

    /// Takes numbers as the observed values, in the order of [`Target::numbers`].
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        if let Target::Lists(lists) = self {
            let all = lists.iter_mut().flatten();
            let all = all.flat_map(Observed::list_mut);
            for (value, numbers) in all.zip(numbers.chunks_exact(6)) {
                for c in 0..3 {
                    value.mean[c] = numbers[2 * c];
                    value.se[c] = numbers[2 * c + 1];
                }
            }
        }
    }

    /// Of a file of measured values, of which one in four is held out.
    ///
    /// # Errors
    /// Names the file.
    pub fn read(args: &FitJob, path: &Path) -> Result<Target> {
        let all = Observed::read(path, &args.context)?;
        let count = all.list().len();
        if count < MIN_VALUES {
            return Err(of_file(
                path,
                format!(
                    "has {count} values; expected at least {MIN_VALUES}, of which one in {BLOCK} \
                     is held out"
                ),
            ));
        }
        let is_held_out = |k: usize| {
            let mut rng = PathRng::new(HOLD_SEED, 0, (k / BLOCK) as u64);
            k % BLOCK == (rng.unit() * BLOCK as f32) as usize
        };
        let of = |held_out: bool| vec![all.filtered(|k| is_held_out(k) == held_out)];
        Ok(Target::Lists([of(false), of(true)]))
    }

    /// What was observed.
    pub fn values(&self, part: Part) -> Vec<Value> {
        match self {
            Target::Lists(lists) => lists[part as usize].iter().flat_map(values).collect(),
            Target::Pictures(pictures) => pictures.values(part),
        }
    }

    /// The same of a patch.
    ///
    /// # Errors
    /// Those of the measurement.
    pub fn simulate(&self, args: &FitJob, patch: &AnyPatch, part: Part) -> Result<Vec<Value>> {
        match self {
            Target::Lists(lists) => {
                let mut all = Vec::new();
                for observed in &lists[part as usize] {
                    let usual = effort_for(args, observed);
                    let effort = match part {
                        Part::Fitted => usual,
                        Part::HeldOut => Effort {
                            paths: MORE_PATHS * usual.paths,
                            ..usual
                        },
                    };
                    all.extend(values(&observed.simulate_with(args, patch, &effort)?));
                }
                Ok(all)
            }
            Target::Pictures(pictures) => pictures.simulate(args, patch, part),
        }
    }
}

fn effort_for(args: &FitJob, observed: &Observed) -> Effort {
    let usual = effort(args);
    Effort {
        paths: match observed {
            Observed::Pairs(_) => usual.paths,
            Observed::Hemispheres(_) => LIGHT_PATHS * usual.paths,
        },
        ..usual
    }
}

const NONE: Measured = Measured::new([0.0; 3], [0.0; 3]);

/// All channels, with their groups.
fn values(observed: &Observed) -> Vec<Value> {
    let groups: Vec<&'static str> = match observed {
        Observed::Pairs(list) => list
            .iter()
            .map(|v| match HeldOutKind::of(&v.pair) {
                HeldOutKind::Reflected => "reflected pairs",
                HeldOutKind::Transmitted => "transmitted pairs",
                HeldOutKind::ReflectedGrazing => "reflected pairs beyond 80 degrees",
                HeldOutKind::TransmittedGrazing => "transmitted pairs beyond 80 degrees",
            })
            .collect(),
        Observed::Hemispheres(list) => {
            let both = ["reflected light", "transmitted light"];
            list.iter().flat_map(|_| both).collect()
        }
    };
    let expected = match observed {
        Observed::Pairs(_) => PAIR,
        Observed::Hemispheres(_) => WHOLE,
    };
    let channels = |(m, group): (Measured, &'static str)| {
        [0, 1, 2].map(|c| Value {
            group,
            channel: Some(c),
            expected,
            mean: m.mean[c],
            se: m.se[c],
        })
    };
    observed
        .list()
        .into_iter()
        .zip(groups)
        .flat_map(channels)
        .collect()
}

/// How far simulated values of a group are from the observed ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupError {
    /// What they are.
    pub group: &'static str,
    /// Root mean square difference as a share of the root mean square value, without what
    /// noise explains.
    pub rms: f64,
    /// What noise explains of it.
    pub noise: f64,
}

impl GroupError {
    /// For programs.
    pub fn json(&self) -> serde_json::Value {
        json!({ "group": self.group, "rms": self.rms, "noise": self.noise })
    }
}

/// The errors of all groups, in the order in which they come.
pub fn errors(found: &[Value], wanted: &[Value]) -> Vec<GroupError> {
    let mut groups: Vec<&'static str> = Vec::new();
    for value in wanted {
        if !groups.contains(&value.group) {
            groups.push(value.group);
        }
    }
    let one = |group: &'static str| {
        let (mut apart, mut noise, mut all) = (0.0, 0.0, 0.0);
        for (f, w) in found.iter().zip(wanted).filter(|(_, w)| w.group == group) {
            apart += (f.mean - w.mean).powi(2);
            noise += f.se * f.se + w.se * w.se;
            all += w.mean * w.mean - w.se * w.se;
        }
        let all = all.max(f64::MIN_POSITIVE);
        GroupError {
            group,
            rms: ((apart - noise).max(0.0) / all).sqrt(),
            noise: (noise / all).sqrt(),
        }
    };
    groups.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_shares_of_a_group_without_noise() {
        let value = |group, mean, se| Value {
            group,
            channel: None,
            expected: WHOLE,
            mean,
            se,
        };
        let wanted = [
            value("a", 3.0, 0.0),
            value("a", 4.0, 0.0),
            value("b", 1.0, 0.0),
        ];
        let found = [
            value("a", 3.0, 0.0),
            value("a", 5.0, 0.6),
            value("b", 1.0, 0.1),
        ];
        let list = errors(&found, &wanted);
        assert_eq!((list[0].group, list[1].group), ("a", "b"));
        assert!(
            (list[0].rms - 0.8 / 5.0).abs() < 4.0 * f64::EPSILON,
            "{list:?}"
        );
        assert!((list[0].noise - 0.6 / 5.0).abs() < 4.0 * f64::EPSILON);
        assert_eq!((list[1].rms, list[1].noise), (0.0, 0.1));
    }
}
