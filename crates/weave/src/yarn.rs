//! A yarn whose values are all known and checked.

mod complete_spec;

use crate::Error;
use crate::blend::FibrePart;
use crate::error::did_you_mean;
use crate::preset;
use crate::spec::{
    BlendTuftSpec, CrimpSpec, CrossSectionSpec, DraftingWaveSpec, EvennessSpec, FlatteningSpec,
    HairinessSpec, MigrationSpec, NepSpec, RingDyeSpec, SlubSpec, WanderSpec, YarnKind, YarnSpec,
};
use complete_spec::CompleteSpec;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Densest packing of equal circles in the plane, pi / sqrt(12).
pub const MAX_FIBRE_VOLUME_FRACTION: f64 = 0.9069;
/// The largest number of fibres in the cross-section of a ply: more than the 50,000 filaments
/// of the heaviest tows, and few enough that a tile is voxelized in seconds.
pub const MAX_FIBRES_PER_PLY: u32 = 1 << 16;

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
    /// Fibre radius, millimetres; of a blend, that of the mean area.
    pub fibre_radius_mm: f64,
    /// Density of the fibre substance; of a blend, the mean over its volume.
    pub fibre_density_g_per_cm3: f64,
    /// Young's modulus of the fibres along them; parts of a blend have their own.
    pub fibre_modulus_gpa: f64,
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
    /// How it was spun, if that is given.
    pub irregularity: Option<String>,
    /// How it was finished.
    pub finish: Vec<String>,
    /// How far it was fulled, 0 to 1.
    pub fulling: f64,
    /// Variation of the mass along the yarn, if any.
    pub evenness: Option<EvennessSpec>,
    /// Waves in that variation, if any, with their length; only with `evenness`.
    pub drafting_waves: Option<DraftingWaveSpec>,
    /// Thick places, if any.
    pub slubs: Option<SlubSpec>,
    /// Small clumps of entangled fibre, if any.
    pub neps: Option<NepSpec>,
    /// Coefficient of variation of the fibres' radii.
    pub fibre_radius_cv: f64,
    /// Random wandering of the fibres, if any.
    pub wander: Option<WanderSpec>,
    /// Crimp of the fibres, if any.
    pub crimp: Option<CrimpSpec>,
    /// Protruding fibres as random curves, if any; `hairs` then has none.
    pub hairiness: Option<HairinessSpec>,
    /// How much threads press it flat, if they do.
    pub flattening: Option<FlatteningSpec>,
    /// Dye that does not reach the core, if any.
    pub ring_dye: Option<RingDyeSpec>,
    /// Colours and materials of the fibres, if there are several; empty with `ring_dye`.
    pub blend: Vec<FibrePart>,
    /// Whether the parts of the blend differ by more than colour.
    pub blends_materials: bool,
    /// How fibres of one colour of the blend lie together, if they do.
    pub blend_tufts: Option<BlendTuftSpec>,
    /// Quantiles of the fibres' distance from the ply's centre, as shares of
    /// the largest, at equal steps from 0 to 1.
    radial_quantiles: Arc<[f64]>,
}

/// [`crate::spec::HairSpec`] with every value; pairs are mean and standard deviation.
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

/// [`crate::spec::LoopSpec`] with every value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loops {
    /// Per millimetre of ply.
    pub per_mm: f64,
    /// Top, mean and deviation, ply radii.
    pub peak: [f64; 2],
}

impl Yarn {
    /// The yarn that a key of a fabric names: one of its `[yarn]` tables, or a preset.
    ///
    /// # Errors
    /// There is none of that name, or a value of its table is out of range.
    pub fn named(
        name: &str,
        tables: &BTreeMap<String, YarnSpec>,
        key: &str,
    ) -> Result<Yarn, Error> {
        let preset_itself = YarnSpec::default();
        let spec = match tables.get(name) {
            Some(spec) => spec,
            None if preset::NAMES.contains(&name) => &preset_itself,
            None => {
                let own = tables.keys().map(String::as_str);
                let mut known: Vec<&str> = own.chain(preset::NAMES).collect();
                let hint = did_you_mean(name, known.iter().copied());
                known.dedup();
                return Err(Error::spec(
                    key,
                    format!(
                        "there is no [yarn.{name}] and no preset of that name{hint}; there are {}",
                        known.join(", ")
                    ),
                ));
            }
        };
        Yarn::new(name, spec)
    }

    /// Builds a yarn from a specification; its preset supplies the keys that it does not set.
    ///
    /// # Errors
    /// When a value is out of range or the preset is unknown; the key is
    /// named as `yarn.NAME.KEY`.
    pub fn new(name: &str, spec: &YarnSpec) -> Result<Yarn, Error> {
        let complete = CompleteSpec::new(name, spec)?;
        let straight = complete.yarn(1.0)?;
        // Twisted fibres are longer than their yarn, so fewer fibres give its tex.
        complete.yarn(straight.fibre_per_yarn_length())
    }

    /// The yarn of a thread whose mass per length is so many times the mean. It has the same
    /// packing, and twist gathers in thin yarn.
    pub(crate) fn with_mass(&self, mass: f64) -> Yarn {
        if mass == 1.0 {
            return self.clone();
        }
        let fibres = (f64::from(self.fibres_per_ply) * mass).round();
        let fibres = fibres.clamp(1.0, f64::from(MAX_FIBRES_PER_PLY));
        let mass = fibres / f64::from(self.fibres_per_ply);
        Yarn {
            fibres_per_ply: fibres as u32,
            ply_radius_mm: self.ply_radius_mm * mass.sqrt(),
            ply_centre_mm: self.ply_centre_mm * mass.sqrt(),
            twist_rad_per_mm: self.twist_rad_per_mm / mass,
            ply_twist_rad_per_mm: self.ply_twist_rad_per_mm / mass,
            ..self.clone()
        }
    }

    /// Distance from the centre of the ply within which the share `u` of all fibres lies,
    /// millimetres, without migration.
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

    /// The share of the distance from the ply's centre that crimp leaves to the middle lines of
    /// fibres, so that the fibres stay inside.
    pub(crate) fn crimp_room(&self) -> f64 {
        let reach_mm = self.ply_radius_mm - self.fibre_radius_mm;
        self.crimp.map_or(1.0, |c| 1.0 - c.reach_mm() / reach_mm)
    }

    /// By how much the fibres are longer than the lines about which they are crimped, per cent.
    pub fn crimp_percent(&self) -> f64 {
        let length = |slope| self.fibre_per_length_with(self.twist_rad_per_mm, 0.0, slope);
        let slope = self.crimp_slope(self.twist_rad_per_mm);
        100.0 * (length(slope) / length(0.0) - 1.0)
    }

    /// Mean square of the slope that crimp adds.
    fn crimp_slope(&self, twist: f64) -> f64 {
        self.crimp.map_or(0.0, |c| c.square_slope(twist))
    }

    /// Mean length of fibre per length of straight yarn: fibres turn about
    /// their ply and the plies about the yarn. The mean is over the fibres'
    /// radii, their angles to the ply, their migration and their crimp.
    pub fn fibre_per_yarn_length(&self) -> f64 {
        self.fibre_per_length_at(self.twist_rad_per_mm, self.ply_twist_rad_per_mm)
    }

    /// The same for another twist, as it comes out where yarns must close.
    pub(crate) fn fibre_per_length_at(&self, twist: f64, ply_twist: f64) -> f64 {
        self.fibre_per_length_with(twist, ply_twist, self.crimp_slope(twist))
    }

    /// The same for fibres that a crimp of some mean square slope lengthens.
    fn fibre_per_length_with(&self, twist: f64, ply_twist: f64, crimp: f64) -> f64 {
        const RADII: u32 = 64;
        const ANGLES: u32 = 16;
        let ply = ply_twist * self.ply_centre_mm;
        let room = self.crimp_room();
        let mean = |n: u32, f: &dyn Fn(f64) -> f64| {
            (0..n)
                .map(|i| f((f64::from(i) + 0.5) / f64::from(n)))
                .sum::<f64>()
                / f64::from(n)
        };
        mean(RADII, &|u| {
            let fibre = twist * room * self.radius_at(u);
            mean(ANGLES, &|swing| {
                let fibre = fibre * self.migrated(TAU * swing);
                mean(ANGLES, &|angle| {
                    let along = (TAU * angle).cos();
                    (1.0 + ply * ply + fibre * fibre + 2.0 * ply * fibre * along + crimp).sqrt()
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
fn radial_quantiles(c: CrossSectionSpec) -> Arc<[f64]> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::{self, preset};
    use organza_testing::assert_contains;

    fn yarn(keys: &str) -> Result<Yarn, Error> {
        Yarn::new("cotton", &toml::from_str(keys).unwrap())
    }

    #[test]
    fn every_preset_reaches_its_own_tex_and_names_its_source() {
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
        let error = yarn("fibre_volume_fraction = 0.95").unwrap_err();
        let key = "yarn.cotton.fibre_volume_fraction";
        assert_contains(&error.to_string(), key);
        assert!(yarn("fibre_volume_fraction = 0.9069").is_ok());
        let tight = yarn("fibres_per_ply = 100\nply_radius_mm = 0.08");
        assert!(tight.is_err(), "100 fibres of 8 um fill 1.0 of 80 um");
        let one = yarn("fibres_per_ply = 1").unwrap();
        assert_eq!(one.ply_radius_mm, one.fibre_radius_mm);
    }

    #[test]
    fn fibre_length_of_a_twisted_yarn_follows_the_closed_form() {
        let y = yarn(
            "cross_section = { epsilon = 0, beta = 0 }\n\
             migration = { min_fraction = 1, cycles_per_turn = 1 }",
        )
        .unwrap();
        // Uniform disc of helices: 2/3 ((1 + a^2)^(3/2) - 1) / a^2.
        let a = y.twist_rad_per_mm * (y.ply_radius_mm - y.fibre_radius_mm);
        let closed = 2.0 / 3.0 * ((1.0 + a * a).powf(1.5) - 1.0) / (a * a);
        assert!(
            (y.fibre_per_yarn_length() - closed).abs() < 4.0 * f64::from(f32::EPSILON),
            "{closed}"
        );
    }

    #[test]
    fn radii_follow_the_published_density() {
        let [epsilon, beta] = [0.1, 0.4];
        let keys = format!("cross_section = {{ epsilon = {epsilon}, beta = {beta} }}");
        let y = yarn(&keys).unwrap();
        let e = std::f64::consts::E;
        let p =
            |r: f64| r * ((1.0 - 2.0 * epsilon) * ((e - r.exp()) / (e - 1.0)).powf(beta) + epsilon);
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
        let twist = |keys: &str| yarn(&format!("twist = {{ direction = {keys} }}"));
        let s = twist("'S', turns_per_m = 500").unwrap();
        assert!((s.twist_rad_per_mm + TAU * 0.5).abs() < 4.0 * f64::EPSILON);
        let z = twist("'Z', angle_deg = 45").unwrap();
        assert!((z.twist_rad_per_mm * z.ply_radius_mm - 1.0).abs() < 4.0 * f64::EPSILON);
        assert!(twist("'Z'").is_err());
        assert!(twist("'Z', turns_per_m = 1, angle_deg = 1").is_err());
    }

    #[test]
    fn wrong_values_name_their_key() {
        let error = yarn("preset = 'coton'").unwrap_err().to_string();
        assert_contains(&error, "did you mean \"cotton\"");
        for (keys, key) in [
            ("tex = -1", "tex"),
            ("fibre_radius_um = nan", "fibre_radius_um"),
            ("plies = 0", "plies"),
            ("fibres_per_ply = 4294967295", "fibres_per_ply"),
            ("tex = 1e6", "fibres_per_ply"),
            ("aspect = 0", "aspect"),
        ] {
            let message = yarn(keys).unwrap_err().to_string();
            let start = format!("yarn.cotton.{key}");
            assert!(message.starts_with(&start), "{keys}: {message}");
        }
    }
}
