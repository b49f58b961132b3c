//! A yarn with every value settled and checked.

use crate::Error;
use crate::error::did_you_mean;
use crate::preset::{self, preset};
use crate::spec::{CrossSectionSpec, MigrationSpec, TwistDirection, TwistSpec, YarnKind, YarnSpec};
use std::f64::consts::{PI, TAU};

/// Densest packing of equal circles in the plane, pi / sqrt(12).
pub const MAX_FIBRE_VOLUME_FRACTION: f64 = 0.9069;
/// The most fibres that the cross-section of a ply may have.
pub const MAX_FIBRES_PER_PLY: u32 = 1 << 20;

/// A yarn at rest, before a fabric presses on it.
#[derive(Clone, Debug)]
pub struct Yarn {
    /// Its name in the fabric file.
    pub name: String,
    /// Kind.
    pub kind: YarnKind,
    /// Number of plies.
    pub plies: u32,
    /// Fibres in the cross-section of one ply.
    pub fibres_per_ply: u32,
    /// Fibre radius, millimetres.
    pub fibre_radius_mm: f64,
    /// Density of the fibre substance.
    pub fibre_density_g_per_cm3: f64,
    /// Radius of a ply, millimetres.
    pub ply_radius_mm: f64,
    /// Distance of ply centres from the yarn's, millimetres; 0 for one ply.
    pub ply_centre_mm: f64,
    /// Twist of the fibres about their ply's centre; positive is Z.
    pub twist_rad_per_mm: f64,
    /// Twist of the plies about the yarn's centre; positive is Z.
    pub ply_twist_rad_per_mm: f64,
    /// Width over height of the cross-section.
    pub aspect: f64,
    /// Relative resistance to crimp.
    pub stiffness: f64,
    /// Fibre density over the ply's cross-section.
    pub cross_section: CrossSectionSpec,
    /// Wandering of the fibres, if any.
    pub migration: Option<MigrationSpec>,
    /// Fibre ends that stand out.
    pub hairs: Hairs,
    /// Fibres that leave the surface and come back.
    pub loops: Loops,
    /// Quantiles of the fibres' distance from the ply's centre, as shares of
    /// the largest, at equal steps from 0 to 1.
    radial_quantiles: Vec<f64>,
}

/// Settled [`crate::spec::HairSpec`]; pairs are mean and deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hairs {
    /// Per millimetre of ply.
    pub per_mm: f64,
    /// Start, ply radii.
    pub start: [f64; 2],
    /// Rise, ply radii.
    pub rise: [f64; 2],
    /// Run, ply radii.
    pub run: [f64; 2],
    /// Turn, radians.
    pub turn_rad: [f64; 2],
}

/// Settled [`crate::spec::LoopSpec`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loops {
    /// Per millimetre of ply.
    pub per_mm: f64,
    /// Top, mean and deviation, ply radii.
    pub peak: [f64; 2],
}

impl Yarn {
    /// Settles a specification: its own keys, then its preset's.
    ///
    /// # Errors
    /// When a value is out of range or the preset is unknown; the key is
    /// named as `yarn.NAME.KEY`.
    pub fn new(name: &str, spec: &YarnSpec) -> Result<Yarn, Error> {
        // Twisted fibres are longer than their yarn, so fewer make its tex.
        let straight = Yarn::settle(name, spec, 1.0)?;
        Yarn::settle(name, spec, straight.fibre_per_yarn_length())
    }

    fn settle(name: &str, spec: &YarnSpec, fibre_per_yarn_length: f64) -> Result<Yarn, Error> {
        let key = |k: &str| format!("yarn.{name}.{k}");
        let preset_name = match &spec.preset {
            Some(p) => p.as_str(),
            None if preset::NAMES.contains(&name) => name,
            None => "cotton",
        };
        let base = preset(preset_name)
            .ok_or_else(|| {
                let hint = did_you_mean(preset_name, preset::NAMES);
                let names = preset::NAMES.join(", ");
                let message = format!("no preset \"{preset_name}\"{hint}; there are {names}");
                Error::spec(key("preset"), message)
            })?
            .spec;
        let number = |k: &str, own: Option<f64>, from: f64, to: f64, fallback: Option<f64>| {
            let v = own.or(fallback).unwrap_or(f64::NAN);
            if v >= from && v <= to {
                Ok(v)
            } else {
                let message = format!("expected a number from {from} to {to}, found {v}");
                Err(Error::spec(key(k), message))
            }
        };
        let kind = spec.kind.or(base.kind).unwrap_or(YarnKind::Staple);
        let fibre_radius_mm = 1e-3
            * number(
                "fibre_radius_um",
                spec.fibre_radius_um,
                0.1,
                1e4,
                base.fibre_radius_um,
            )?;
        let density = number(
            "fibre_density_g_per_cm3",
            spec.fibre_density_g_per_cm3,
            0.1,
            30.0,
            base.fibre_density_g_per_cm3,
        )?;
        let plies = spec.plies.or(base.plies).unwrap_or(1);
        if !(1..=64).contains(&plies) {
            let message = format!("expected 1 to 64 plies, found {plies}");
            return Err(Error::spec(key("plies"), message));
        }
        let fibre_tex = 1000.0 * density * PI * fibre_radius_mm * fibre_radius_mm;
        let fibres = match spec.fibres_per_ply {
            Some(n) => f64::from(n),
            None => {
                let tex = number("tex", spec.tex, 1e-3, 1e6, base.tex)?;
                let straight_tex = tex / fibre_per_yarn_length;
                (straight_tex / (f64::from(plies) * fibre_tex))
                    .round()
                    .max(1.0)
            }
        };
        if !(1.0..=f64::from(MAX_FIBRES_PER_PLY)).contains(&fibres) {
            let message = format!("expected 1 to {MAX_FIBRES_PER_PLY} fibres, found {fibres}");
            return Err(Error::spec(key("fibres_per_ply"), message));
        }
        let fraction = match spec.ply_radius_mm {
            Some(r) => fibres * (fibre_radius_mm / r).powi(2),
            // A single fibre is its own ply.
            None if fibres == 1.0 => 1.0,
            None => number(
                "fibre_volume_fraction",
                spec.fibre_volume_fraction,
                1e-4,
                1.0,
                base.fibre_volume_fraction,
            )?,
        };
        let densest = if fibres == 1.0 {
            1.0
        } else {
            MAX_FIBRE_VOLUME_FRACTION
        };
        if !(fraction > 0.0 && fraction <= densest) {
            let message = format!(
                "a fibre volume fraction of {fraction:.4} inside the ply is outside 0 to {densest}"
            );
            return Err(Error::spec(key("fibre_volume_fraction"), message));
        }
        let ply_radius_mm = fibre_radius_mm * (fibres / fraction).sqrt();
        // Plies touch their neighbours.
        let ply_centre_mm = match plies {
            1 => 0.0,
            n => ply_radius_mm / (PI / f64::from(n)).sin(),
        };
        let is_ribbon = kind == YarnKind::Ribbon;
        let no_twist = is_ribbon && spec.twist.is_none();
        let rate = |k, spec: Option<TwistSpec>, base: Option<TwistSpec>, radius| match spec.or(base)
        {
            Some(t) => rate_rad_per_mm(&key(k), t, radius),
            None => Ok(0.0),
        };
        let (hair_rate, loop_rate) = match kind {
            YarnKind::Staple => preset::fuzz_per_mm(preset_name, ply_radius_mm),
            _ => (0.0, 0.0),
        };
        let (hairs, loops) = (
            spec.hairs.unwrap_or_default(),
            spec.loops.unwrap_or_default(),
        );
        let cross_section = spec
            .cross_section
            .or(base.cross_section)
            .unwrap_or(CrossSectionSpec {
                epsilon: 0.0,
                beta: 0.0,
            });
        let outer = ply_centre_mm + ply_radius_mm;
        let yarn = Yarn {
            name: name.to_owned(),
            kind,
            plies,
            fibres_per_ply: fibres as u32,
            fibre_radius_mm,
            fibre_density_g_per_cm3: density,
            ply_radius_mm,
            ply_centre_mm,
            twist_rad_per_mm: if no_twist {
                0.0
            } else {
                rate("twist", spec.twist, base.twist, ply_radius_mm)?
            },
            ply_twist_rad_per_mm: if plies == 1 {
                0.0
            } else {
                rate("ply_twist", spec.ply_twist, base.ply_twist, outer)?
            },
            aspect: number(
                "aspect",
                spec.aspect,
                0.1,
                50.0,
                if is_ribbon { Some(6.0) } else { base.aspect },
            )?,
            stiffness: number("stiffness", spec.stiffness, 1e-3, 1e3, base.stiffness)?,
            cross_section,
            migration: match kind {
                YarnKind::Staple => spec.migration.or(base.migration),
                _ => spec.migration,
            },
            hairs: Hairs {
                per_mm: hairs.per_mm.unwrap_or(hair_rate),
                start: hairs.start.unwrap_or(preset::HAIR_START),
                rise: hairs.rise.unwrap_or(preset::HAIR_RISE),
                run: hairs.run.unwrap_or(preset::HAIR_RUN),
                turn_rad: hairs.turn_rad.unwrap_or(preset::HAIR_TURN_RAD),
            },
            loops: Loops {
                per_mm: loops.per_mm.unwrap_or(loop_rate),
                peak: loops.peak.unwrap_or(preset::LOOP_PEAK),
            },
            radial_quantiles: radial_quantiles(cross_section),
        };
        let c = yarn.cross_section;
        number("cross_section.epsilon", Some(c.epsilon), 0.0, 0.5, None)?;
        number("cross_section.beta", Some(c.beta), 0.0, 10.0, None)?;
        if let Some(m) = yarn.migration {
            number(
                "migration.max_fraction",
                Some(m.max_fraction),
                0.0,
                1.0,
                None,
            )?;
            number(
                "migration.min_fraction",
                Some(m.min_fraction),
                0.0,
                m.max_fraction,
                None,
            )?;
            number(
                "migration.cycles_per_turn",
                Some(m.cycles_per_turn),
                0.0,
                20.0,
                None,
            )?;
        }
        number("hairs.per_mm", Some(yarn.hairs.per_mm), 0.0, 1e5, None)?;
        number("loops.per_mm", Some(yarn.loops.per_mm), 0.0, 1e5, None)?;
        let (h, l) = (yarn.hairs, yarn.loops);
        for (k, [mean, deviation]) in [
            ("hairs.start", h.start),
            ("hairs.rise", h.rise),
            ("hairs.run", h.run),
            ("hairs.turn_rad", h.turn_rad),
            ("loops.peak", l.peak),
        ] {
            number(k, Some(mean), -100.0, 100.0, None)?;
            number(k, Some(deviation), 0.0, 100.0, None)?;
        }
        Ok(yarn)
    }

    /// Distance of a fibre from the ply's centre below which the share `u` of
    /// all fibres lie, millimetres, migration left out.
    pub(crate) fn radius_at(&self, u: f64) -> f64 {
        let reach = (self.ply_radius_mm - self.fibre_radius_mm).max(0.0);
        let place = u.clamp(0.0, 1.0) * (self.radial_quantiles.len() - 1) as f64;
        let i = (place as usize).min(self.radial_quantiles.len() - 2);
        let (a, b) = (self.radial_quantiles[i], self.radial_quantiles[i + 1]);
        reach * (a + (place - i as f64) * (b - a))
    }

    /// Share of a fibre's own radius at an angle of its migration.
    pub(crate) fn migrated(&self, swing_rad: f64) -> f64 {
        self.migration.map_or(1.0, |m| {
            m.min_fraction + 0.5 * (m.max_fraction - m.min_fraction) * (swing_rad.cos() + 1.0)
        })
    }

    /// Mean length of fibre per length of straight yarn: fibres turn about
    /// their ply and the plies about the yarn. The mean is over the fibres'
    /// radii, their angles to the ply and their migration.
    pub fn fibre_per_yarn_length(&self) -> f64 {
        self.fibre_per_length_at(self.twist_rad_per_mm, self.ply_twist_rad_per_mm)
    }

    /// The same for another twist, as it comes out where yarns must close.
    pub(crate) fn fibre_per_length_at(&self, twist: f64, ply_twist: f64) -> f64 {
        const RADII: u32 = 64;
        const ANGLES: u32 = 16;
        let ply = ply_twist * self.ply_centre_mm;
        let mean = |n: u32, f: &dyn Fn(f64) -> f64| {
            (0..n)
                .map(|i| f((f64::from(i) + 0.5) / f64::from(n)))
                .sum::<f64>()
                / f64::from(n)
        };
        mean(RADII, &|u| {
            let fibre = twist * self.radius_at(u);
            mean(ANGLES, &|swing| {
                let fibre = fibre * self.migrated(TAU * swing);
                mean(ANGLES, &|angle| {
                    let along = (TAU * angle).cos();
                    (1.0 + ply * ply + fibre * fibre + 2.0 * ply * fibre * along).sqrt()
                })
            })
        })
    }

    /// Radius of the circle around all plies, millimetres.
    pub fn radius_mm(&self) -> f64 {
        self.ply_centre_mm + self.ply_radius_mm
    }

    /// Linear density of straight yarn, grams per kilometre, hairs left out.
    pub fn tex(&self) -> f64 {
        self.fibre_per_yarn_length() * self.straight_tex()
    }

    /// What the fibres would weigh if they ran straight.
    fn straight_tex(&self) -> f64 {
        let area = PI * self.fibre_radius_mm * self.fibre_radius_mm;
        1000.0 * self.fibre_density_g_per_cm3 * area * f64::from(self.plies * self.fibres_per_ply)
    }

    /// Share of a ply's cross-section that is fibre.
    pub fn fibre_volume_fraction(&self) -> f64 {
        f64::from(self.fibres_per_ply) * (self.fibre_radius_mm / self.ply_radius_mm).powi(2)
    }
}

/// Solves for the quantiles of `p(R) R`, with p of [Zhao2016].
fn radial_quantiles(c: CrossSectionSpec) -> Vec<f64> {
    const STEPS: usize = 512;
    let e = std::f64::consts::E;
    let density = |r: f64| {
        r * ((1.0 - 2.0 * c.epsilon) * ((e - r.exp()) / (e - 1.0)).max(0.0).powf(c.beta)
            + c.epsilon)
    };
    let mut below = vec![0.0];
    let mut sum = 0.0;
    for i in 0..STEPS {
        sum += density((i as f64 + 0.5) / STEPS as f64);
        below.push(sum);
    }
    let mut i = 0;
    (0..=STEPS)
        .map(|k| {
            let wanted = sum * k as f64 / STEPS as f64;
            while i + 1 < STEPS && below[i + 1] < wanted {
                i += 1;
            }
            let width = below[i + 1] - below[i];
            let part = if width > 0.0 {
                (wanted - below[i]) / width
            } else {
                0.0
            };
            (i as f64 + part.clamp(0.0, 1.0)) / STEPS as f64
        })
        .collect()
}

/// Signed twist; the angle is that of a helix on the given radius.
fn rate_rad_per_mm(key: &str, twist: TwistSpec, radius_mm: f64) -> Result<f64, Error> {
    let rate = match (twist.turns_per_m, twist.angle_deg) {
        (Some(turns), None) if (0.0..=1e5).contains(&turns) => turns * 1e-3 * TAU,
        (None, Some(angle)) if (0.0..=70.0).contains(&angle) => {
            angle.to_radians().tan() / radius_mm
        }
        (turns, angle) => {
            let given = [("turns_per_m", turns), ("angle_deg", angle)];
            let given = given.iter().filter_map(|(k, v)| Some((k, (*v)?)));
            let found: Vec<String> = given.map(|(k, v)| format!("{k} = {v}")).collect();
            return Err(Error::spec(
                key,
                format!(
                    "expected either turns_per_m (0 to 100000) or angle_deg (0 to 70), found {}",
                    if found.is_empty() {
                        "neither".to_owned()
                    } else {
                        found.join(" and ")
                    }
                ),
            ));
        }
    };
    Ok(match twist.direction {
        TwistDirection::Z => rate,
        TwistDirection::S => -rate,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yarn(change: impl FnOnce(&mut YarnSpec)) -> Result<Yarn, Error> {
        let mut spec = YarnSpec::default();
        change(&mut spec);
        Yarn::new("cotton", &spec)
    }

    #[test]
    fn every_preset_settles_at_its_own_tex_and_says_where_it_comes_from() {
        for name in preset::NAMES {
            let yarn = Yarn::new(name, &YarnSpec::default()).unwrap();
            let preset = preset(name).unwrap();
            let wanted = preset.spec.tex.unwrap();
            // One fibre more or less is the grain of a yarn.
            assert!((yarn.tex() / wanted - 1.0).abs() < 0.6 / f64::from(yarn.fibres_per_ply));
            assert!(preset.source.contains("estimated"), "{name}");
        }
    }

    #[test]
    fn packing_beyond_the_densest_is_refused() {
        let error = yarn(|s| s.fibre_volume_fraction = Some(0.95))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("yarn.cotton.fibre_volume_fraction"),
            "{error}"
        );
        assert!(yarn(|s| s.fibre_volume_fraction = Some(0.9069)).is_ok());
        let tight = yarn(|s| {
            s.fibres_per_ply = Some(100);
            s.ply_radius_mm = Some(0.08);
        });
        assert!(tight.is_err(), "100 fibres of 8 um fill 1.0 of 80 um");
        let one = yarn(|s| s.fibres_per_ply = Some(1)).unwrap();
        assert_eq!(one.ply_radius_mm, one.fibre_radius_mm);
    }

    #[test]
    fn fibre_length_of_a_twisted_yarn_follows_the_closed_form() {
        let y = yarn(|s| {
            s.cross_section = Some(CrossSectionSpec {
                epsilon: 0.0,
                beta: 0.0,
            });
            s.migration = Some(MigrationSpec {
                min_fraction: 1.0,
                max_fraction: 1.0,
                cycles_per_turn: 1.0,
            });
        })
        .unwrap();
        // Uniform disc of helices: 2/3 ((1 + a^2)^(3/2) - 1) / a^2.
        let a = y.twist_rad_per_mm * (y.ply_radius_mm - y.fibre_radius_mm);
        let closed = 2.0 / 3.0 * ((1.0 + a * a).powf(1.5) - 1.0) / (a * a);
        assert!(
            (y.fibre_per_yarn_length() - closed).abs() < 1e-4,
            "{closed}"
        );
    }

    #[test]
    fn radii_follow_the_published_density() {
        let c = CrossSectionSpec {
            epsilon: 0.1,
            beta: 0.4,
        };
        let y = yarn(|s| s.cross_section = Some(c)).unwrap();
        let e = std::f64::consts::E;
        let p = |r: f64| {
            r * ((1.0 - 2.0 * c.epsilon) * ((e - r.exp()) / (e - 1.0)).powf(c.beta) + c.epsilon)
        };
        // Simpson's rule up to the quantile against the quantile itself; a
        // uniform disc would be off by far more.
        let simpson = |to: f64| {
            let h = to / 200.0;
            (0..100)
                .map(|i| 2.0 * h * f64::from(i))
                .map(|a| h / 3.0 * (p(a) + 4.0 * p(a + h) + p((a + 2.0 * h).min(1.0))))
                .sum::<f64>()
        };
        let reach = y.radius_at(1.0);
        for k in 1..10 {
            let u = f64::from(k) / 10.0;
            let r = y.radius_at(u) / reach;
            assert!((simpson(r) / simpson(1.0) - u).abs() < 1e-3, "{u}");
            assert!((r * r - u).abs() > 1e-2, "not uniform");
        }
    }

    #[test]
    fn twist_is_an_angle_or_a_number_of_turns() {
        let twist = |direction, turns_per_m, angle_deg| {
            yarn(|s| {
                s.twist = Some(TwistSpec {
                    direction,
                    turns_per_m,
                    angle_deg,
                })
            })
        };
        let s = twist(TwistDirection::S, Some(500.0), None).unwrap();
        assert!((s.twist_rad_per_mm + TAU * 0.5).abs() < 1e-12);
        let z = twist(TwistDirection::Z, None, Some(45.0)).unwrap();
        assert!((z.twist_rad_per_mm * z.ply_radius_mm - 1.0).abs() < 1e-12);
        assert!(twist(TwistDirection::Z, None, None).is_err());
        assert!(twist(TwistDirection::Z, Some(1.0), Some(1.0)).is_err());
    }

    #[test]
    fn wrong_values_name_their_key() {
        let error = yarn(|s| s.preset = Some("coton".to_owned()))
            .unwrap_err()
            .to_string();
        assert!(error.contains("did you mean \"cotton\""), "{error}");
        for (error, key) in [
            (yarn(|s| s.tex = Some(-1.0)), "yarn.cotton.tex"),
            (
                yarn(|s| s.fibre_radius_um = Some(f64::NAN)),
                "yarn.cotton.fibre_radius_um",
            ),
            (yarn(|s| s.plies = Some(0)), "yarn.cotton.plies"),
            (
                yarn(|s| s.fibres_per_ply = Some(u32::MAX)),
                "yarn.cotton.fibres_per_ply",
            ),
            (yarn(|s| s.tex = Some(1e6)), "yarn.cotton.fibres_per_ply"),
            (yarn(|s| s.aspect = Some(0.0)), "yarn.cotton.aspect"),
        ] {
            let message = error.unwrap_err().to_string();
            assert!(message.starts_with(key), "{key}: {message}");
        }
    }
}
