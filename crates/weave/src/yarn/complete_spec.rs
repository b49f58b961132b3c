//! A yarn's specification completed by its preset and checked, and the yarn that it makes.

mod irregularity;

use super::{Hairs, Loops, MAX_FIBRE_VOLUME_FRACTION, MAX_FIBRES_PER_PLY, Yarn, radial_quantiles};
use crate::Error;
use crate::blend::{self, OwnFibres};
use crate::error::did_you_mean;
use crate::preset::{self, preset};
use crate::spec::{CrossSectionSpec, MigrationSpec, TwistDirection, TwistSpec, YarnKind, YarnSpec};
use crate::spinning::{finish, spin};
use std::f64::consts::{PI, TAU};

/// A specification in which every key has a value, its own or that of its preset.
pub(super) struct CompleteSpec<'a> {
    name: &'a str,
    preset_name: &'a str,
    kind: YarnKind,
    spec: YarnSpec,
    /// Factor on the preset's number of hairs and loops.
    fuzz: f64,
}

impl<'a> CompleteSpec<'a> {
    pub fn new(name: &'a str, own: &'a YarnSpec) -> Result<Self, Error> {
        let preset_name = match &own.preset {
            Some(p) => p.as_str(),
            None if preset::NAMES.contains(&name) => name,
            None => "cotton",
        };
        let base = preset(preset_name)
            .ok_or_else(|| {
                let hint = did_you_mean(preset_name, preset::NAMES);
                let names = preset::NAMES.join(", ");
                let message = format!("no preset \"{preset_name}\"{hint}; there are {names}");
                Error::spec(format!("yarn.{name}.preset"), message)
            })?
            .spec;
        let kind = own.kind.or(base.kind).unwrap_or(YarnKind::Staple);
        let is_ribbon = kind == YarnKind::Ribbon;
        let is_staple = kind == YarnKind::Staple;
        Self::check_names(name, own)?;
        let mut spec = YarnSpec {
            preset: None,
            kind: Some(kind),
            tex: own.tex.or(base.tex),
            plies: own.plies.or(base.plies),
            fibres_per_ply: own.fibres_per_ply,
            fibre_radius_um: own.fibre_radius_um.or(base.fibre_radius_um),
            fibre_density_g_per_cm3: own.fibre_density_g_per_cm3.or(base.fibre_density_g_per_cm3),
            fibre_modulus_gpa: own.fibre_modulus_gpa.or(base.fibre_modulus_gpa),
            fibre_volume_fraction: own.fibre_volume_fraction.or(base.fibre_volume_fraction),
            ply_radius_mm: own.ply_radius_mm,
            twist: own.twist.or(base.twist.filter(|_| !is_ribbon)),
            ply_twist: own.ply_twist.or(base.ply_twist),
            aspect: own
                .aspect
                .or(if is_ribbon { Some(6.0) } else { base.aspect }),
            stiffness: own.stiffness.or(base.stiffness),
            cross_section: own.cross_section.or(base.cross_section),
            migration: own.migration.or(base.migration.filter(|_| is_staple)),
            hairs: own.hairs,
            loops: own.loops,
            irregularity: own.irregularity.clone(),
            finish: own.finish.clone(),
            fulling: own.fulling,
            evenness: own.evenness,
            drafting_waves: own.drafting_waves,
            slubs: own.slubs,
            neps: own.neps.clone(),
            fibre_radius_cv_percent: own.fibre_radius_cv_percent,
            wander: own.wander,
            crimp: own.crimp,
            hairiness: own.hairiness,
            flattening: own.flattening,
            ring_dye: own.ring_dye,
            blend: own.blend.clone(),
            blend_tufts: own.blend_tufts,
        };
        if let Some(way) = &own.irregularity {
            spin(&mut spec, own, way);
        }
        let finishes = own.finish.iter();
        let fuzz = finishes.map(|f| finish(&mut spec, own, f)).product();
        Ok(Self {
            name,
            preset_name,
            kind,
            spec,
            fuzz,
        })
    }

    fn key(&self, key: &str) -> String {
        format!("yarn.{}.{key}", self.name)
    }

    /// A number of the specification, which must be within bounds.
    fn number(&self, key: &str, value: Option<f64>, from: f64, to: f64) -> Result<f64, Error> {
        let v = value.unwrap_or(f64::NAN);
        if v >= from && v <= to {
            Ok(v)
        } else {
            let message = format!("expected a number from {from} to {to}, found {v}");
            Err(Error::spec(self.key(key), message))
        }
    }

    /// The yarn whose fibres are so many times as long as it is.
    pub fn yarn(&self, fibre_per_yarn_length: f64) -> Result<Yarn, Error> {
        let spec = &self.spec;
        let fibre_radius_mm =
            1e-3 * self.number("fibre_radius_um", spec.fibre_radius_um, 0.1, 1e4)?;
        let density = self.number(
            "fibre_density_g_per_cm3",
            spec.fibre_density_g_per_cm3,
            0.1,
            30.0,
        )?;
        let fibre_radius_cv = 0.01
            * self.number(
                "fibre_radius_cv_percent",
                Some(spec.fibre_radius_cv_percent.unwrap_or(0.0)),
                0.0,
                50.0,
            )?;
        let modulus_gpa = self.number("fibre_modulus_gpa", spec.fibre_modulus_gpa, 1e-3, 1e3)?;
        let own = OwnFibres {
            radius_mm: fibre_radius_mm,
            density_g_per_cm3: density,
            modulus_gpa,
            radius_cv: fibre_radius_cv,
        };
        let parts = blend::parts(&spec.blend, &own, &|key| self.key(key))?;
        let blends_materials = blend::are_materials(&parts, &own);
        let (fibre_radius_mm, density) = match blends_materials {
            true => blend::mean_fibre(&parts),
            false => (fibre_radius_mm, density),
        };
        let plies = spec.plies.unwrap_or(1);
        if !(1..=64).contains(&plies) {
            let message = format!("expected 1 to 64 plies, found {plies}");
            return Err(Error::spec(self.key("plies"), message));
        }
        let fibre_tex = 1000.0 * density * PI * fibre_radius_mm * fibre_radius_mm;
        let fibres = self.fibres_per_ply(f64::from(plies) * fibre_tex, fibre_per_yarn_length)?;
        let fraction = self.fibre_volume_fraction(fibres, fibre_radius_mm)?;
        let ply_radius_mm = fibre_radius_mm * (fibres / fraction).sqrt();
        // Plies touch their neighbours.
        let ply_centre_mm = match plies {
            1 => 0.0,
            n => ply_radius_mm / (PI / f64::from(n)).sin(),
        };
        let rate = |key, twist: Option<TwistSpec>, radius_mm| match twist {
            Some(t) => rate_rad_per_mm(&self.key(key), t, radius_mm),
            None => Ok(0.0),
        };
        let cross_section = self.cross_section()?;
        Ok(Yarn {
            name: self.name.to_owned(),
            kind: self.kind,
            plies,
            fibres_per_ply: fibres as u32,
            fibre_radius_mm,
            fibre_density_g_per_cm3: density,
            fibre_modulus_gpa: modulus_gpa,
            ply_radius_mm,
            ply_centre_mm,
            twist_rad_per_mm: rate("twist", spec.twist, ply_radius_mm)?,
            ply_twist_rad_per_mm: if plies == 1 {
                0.0
            } else {
                rate("ply_twist", spec.ply_twist, ply_centre_mm + ply_radius_mm)?
            },
            aspect: self.number("aspect", spec.aspect, 0.1, 50.0)?,
            stiffness: self.number("stiffness", spec.stiffness, 1e-3, 1e3)?,
            cross_section,
            migration: self.migration()?,
            hairs: self.hairs(ply_radius_mm)?,
            loops: self.loops(ply_radius_mm)?,
            irregularity: spec.irregularity.clone(),
            finish: spec.finish.clone(),
            fulling: self.number("fulling", Some(spec.fulling.unwrap_or(0.0)), 0.0, 1.0)?,
            evenness: self.evenness()?,
            drafting_waves: self.drafting_waves()?,
            slubs: self.slubs()?,
            neps: self.neps(fibres * f64::from(plies) * PI * fibre_radius_mm.powi(2))?,
            fibre_radius_cv,
            wander: self.wander()?,
            crimp: self.crimp(ply_radius_mm - fibre_radius_mm)?,
            hairiness: self.hairiness()?,
            flattening: self.flattening()?,
            ring_dye: self.ring_dye()?,
            blend: parts,
            blends_materials,
            blend_tufts: self.blend_tufts(blends_materials)?,
            radial_quantiles: radial_quantiles(cross_section),
        })
    }

    /// As given, or by `tex`, where `fibre_tex` is that of one straight fibre in every ply.
    fn fibres_per_ply(&self, fibre_tex: f64, fibre_per_yarn_length: f64) -> Result<f64, Error> {
        let fibres = match self.spec.fibres_per_ply {
            Some(n) => f64::from(n),
            None => {
                let tex = self.number("tex", self.spec.tex, 1e-3, 1e6)?;
                let straight_tex = tex / fibre_per_yarn_length;
                (straight_tex / fibre_tex).round().max(1.0)
            }
        };
        if !(1.0..=f64::from(MAX_FIBRES_PER_PLY)).contains(&fibres) {
            let message = format!("expected 1 to {MAX_FIBRES_PER_PLY} fibres, found {fibres}");
            return Err(Error::spec(self.key("fibres_per_ply"), message));
        }
        Ok(fibres)
    }

    fn fibre_volume_fraction(&self, fibres: f64, fibre_radius_mm: f64) -> Result<f64, Error> {
        const KEY: &str = "fibre_volume_fraction";
        let fraction = match self.spec.ply_radius_mm {
            Some(r) => fibres * (fibre_radius_mm / r).powi(2),
            // A single fibre is its own ply.
            None if fibres == 1.0 => 1.0,
            None => self.number(KEY, self.spec.fibre_volume_fraction, 1e-4, 1.0)?,
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
            return Err(Error::spec(self.key(KEY), message));
        }
        Ok(fraction)
    }

    fn cross_section(&self) -> Result<CrossSectionSpec, Error> {
        let c = self.spec.cross_section.unwrap_or(CrossSectionSpec {
            epsilon: 0.0,
            beta: 0.0,
        });
        self.number("cross_section.epsilon", Some(c.epsilon), 0.0, 0.5)?;
        self.number("cross_section.beta", Some(c.beta), 0.0, 10.0)?;
        Ok(c)
    }

    fn migration(&self) -> Result<Option<MigrationSpec>, Error> {
        let Some(m) = self.spec.migration else {
            return Ok(None);
        };
        let (most, least) = (m.max_fraction, m.min_fraction);
        self.number("migration.max_fraction", Some(most), 0.0, 1.0)?;
        self.number("migration.min_fraction", Some(least), 0.0, most)?;
        let cycles = Some(m.cycles_per_turn);
        self.number("migration.cycles_per_turn", cycles, 0.0, 20.0)?;
        Ok(Some(m))
    }

    /// Hairs and loops per millimetre of ply, unless given.
    fn preset_fuzz_per_mm(&self, ply_radius_mm: f64) -> (f64, f64) {
        match self.kind {
            YarnKind::Staple => {
                let (hairs, loops) = preset::fuzz_per_mm(self.preset_name, ply_radius_mm);
                (self.fuzz * hairs, self.fuzz * loops)
            }
            _ => (0.0, 0.0),
        }
    }

    fn hairs(&self, ply_radius_mm: f64) -> Result<Hairs, Error> {
        if self.spec.hairiness.is_some() && self.spec.hairs.is_some() {
            let message = "give hairs or hairiness, not both";
            return Err(Error::spec(self.key("hairs"), message));
        }
        let own = self.spec.hairs.unwrap_or_default();
        let per_mm = match self.spec.hairiness {
            Some(_) => 0.0,
            None => self.preset_fuzz_per_mm(ply_radius_mm).0,
        };
        let hairs = Hairs {
            per_mm: own.per_mm.unwrap_or(per_mm),
            start: own.start.unwrap_or(preset::HAIR_START),
            rise: own.rise.unwrap_or(preset::HAIR_RISE),
            run: own.run.unwrap_or(preset::HAIR_RUN),
            turn_rad: own.turn_rad.unwrap_or(preset::HAIR_TURN_RAD),
        };
        self.number("hairs.per_mm", Some(hairs.per_mm), 0.0, 1e5)?;
        self.pair("hairs.start", hairs.start)?;
        self.pair("hairs.rise", hairs.rise)?;
        self.pair("hairs.run", hairs.run)?;
        self.pair("hairs.turn_rad", hairs.turn_rad)?;
        Ok(hairs)
    }

    fn loops(&self, ply_radius_mm: f64) -> Result<Loops, Error> {
        let own = self.spec.loops.unwrap_or_default();
        let per_mm = self.preset_fuzz_per_mm(ply_radius_mm).1;
        let loops = Loops {
            per_mm: own.per_mm.unwrap_or(per_mm),
            peak: own.peak.unwrap_or(preset::LOOP_PEAK),
        };
        self.number("loops.per_mm", Some(loops.per_mm), 0.0, 1e5)?;
        self.pair("loops.peak", loops.peak)?;
        Ok(loops)
    }

    /// Checks a mean and its standard deviation.
    fn pair(&self, key: &str, [mean, deviation]: [f64; 2]) -> Result<(), Error> {
        self.number(key, Some(mean), -100.0, 100.0)?;
        self.number(key, Some(deviation), 0.0, 100.0)?;
        Ok(())
    }
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
