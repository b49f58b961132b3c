//! The computed side of a fit to photographs: a fabric with trial values.

use crate::{Fit, FitJob};
use anyhow::Result;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::patches::PatchModel;
use organza_scene::representation::{EXPLICIT_FIBRES, FittedOptics, ShownAs};
use organza_weave::{Draft, preset};
use organza_work::{of_file, of_option};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// The systems, as tables of a fabric file and names of their yarns.
pub const SYSTEMS: [&str; 2] = ["warp", "weft"];

/// Trial values of a cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Counts of warp and weft, g/km.
    pub tex: [f64; 2],
    /// Linear colours of warp and weft.
    pub colours: [[f64; 3]; 2],
    /// Width of the highlight of the fibres, in the units of its key.
    pub roughness: f64,
    /// Values of the photographs as a share of what `--white` makes of them.
    pub exposure: f64,
    /// Directions towards the lamps in front and behind, degrees.
    pub lights_deg: [[f64; 2]; 2],
}

/// What a fabric file is made for.
#[derive(Clone, Copy)]
pub enum Purpose<'a> {
    /// The answer.
    Answer {
        name: &'a str,
        /// Colours of one repeat of the threads of warp and weft.
        colours: &'a [Vec<[f64; 3]>; 2],
    },
    /// A picture of at least so many threads of each system, laid by a seed.
    Picture {
        threads: usize,
        seed: u64,
        /// Most fibres of a yarn; thicker ones in place of more.
        most_fibres: f64,
    },
}

/// A cloth whose trial values change.
pub struct ClothModel<'a> {
    pub args: &'a FitJob,
    /// The name under which the trial fabric is read; files that it names are beside it.
    pub path: PathBuf,
    /// Everything but draft, threads and colours.
    base: Table,
    /// How the cloth is shown.
    pub shown: ShownAs,
    /// The optics that are fitted.
    pub fitted: &'static FittedOptics,
    /// Spacing of warp and weft, mm.
    pub spacing_mm: [f64; 2],
    /// By how much the cloth is turned in the photograph, degrees.
    pub turn_deg: f64,
    /// Count and width of both yarns where nothing presses on them.
    free: [[f64; 2]; 2],
    /// Radius of a fibre of each, um, and how many of them a yarn has for its count.
    fibres: [[f64; 2]; 2],
}

/// How the cloth is shown, and which of its optics are fitted.
///
/// # Errors
/// A model without fibres.
pub fn fitted(args: &Fit) -> Result<(ShownAs, &'static FittedOptics)> {
    let shown = match args.model {
        PatchModel::Own => ShownAs::usual(&EXPLICIT_FIBRES),
        PatchModel::Is(representation) => ShownAs::usual(representation),
    };
    let name = shown.representation.name;
    let why = || {
        of_option(
            "model",
            format!("{name:?} has no fibres to fit; choose another"),
        )
    };
    Ok((shown, shown.representation.fitted.ok_or_else(why)?))
}

impl<'a> ClothModel<'a> {
    /// The model of a cloth with threads this far apart; yarns, fibres and finish are those of
    /// the fabric that the arguments name, or cotton.
    ///
    /// # Errors
    /// A fabric that cannot be read or is not woven, or a model without fibres.
    pub fn new(args: &'a FitJob, spacing_mm: [f64; 2], turn_deg: f64) -> Result<ClothModel<'a>> {
        let own: Table = match &args.fabric {
            Some(path) => {
                let loader = args.context.loader();
                loader.toml_of(path, &args.set, Wanted::Fabric)?
            }
            None => Table::new(),
        };
        let (shown, fitted) = fitted(args)?;
        let folder = args.fabric.as_deref().and_then(Path::parent);
        let mut model = ClothModel {
            args,
            path: folder.unwrap_or(Path::new("")).join("fitted cloth.toml"),
            base: base(args, &own, spacing_mm)?,
            shown,
            fitted,
            spacing_mm,
            turn_deg,
            free: [[1.0; 2]; 2],
            fibres: [[1.0; 2]; 2],
        };
        model.measure_yarns()?;
        Ok(model)
    }

    /// Finds how wide the yarns are by themselves.
    fn measure_yarns(&mut self) -> Result<()> {
        let plain = Draft::from_fn(2, 2, |e, p| (e + p).is_multiple_of(2))?;
        let spacing_mm = std::mem::replace(&mut self.spacing_mm, [2.0; 2]);
        let trial = Trial {
            tex: [10.0; 2],
            colours: [[0.5; 3]; 2],
            roughness: self.fitted.start,
            exposure: 1.0,
            lights_deg: [[0.0; 2]; 2],
        };
        let few = Purpose::Picture {
            threads: 4,
            seed: 0,
            most_fibres: f64::INFINITY,
        };
        let fabric = self.fabric(&plain, &trial, few);
        self.spacing_mm = spacing_mm;
        let fabric = fabric?;
        for yarn in fabric.cloth.yarns() {
            if let Some(k) = SYSTEMS.iter().position(|system| *system == yarn.name) {
                let count = f64::from(yarn.plies) * f64::from(yarn.fibres_per_ply);
                self.fibres[k] = [1e3 * yarn.fibre_radius_mm, count / yarn.tex()];
            }
        }
        let figures = fabric.cloth.figures();
        for (k, figures) in [figures.warp, figures.weft].into_iter().enumerate() {
            if let Some(f) = figures {
                self.free[k] = [f.tex, f.width_mm];
            }
        }
        Ok(())
    }

    /// Counts with which free threads cover this share of their spacing.
    pub fn tex_of_cover(&self, cover: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|k| {
            let [tex, width_mm] = self.free[k];
            tex * (cover[k] * self.spacing_mm[k] / width_mm).powi(2)
        })
    }

    /// The fabric file with trial values.
    pub fn table(&self, draft: &Draft, trial: &Trial, purpose: Purpose<'_>) -> Table {
        let mut table = Table::new();
        let text = |t: &str| Value::String(t.to_owned());
        let number = Value::Float;
        let mut weave = None;
        if let Purpose::Answer { name, .. } = purpose {
            table.insert("name".into(), text(name));
            weave = organza_photograph::name_of(draft);
        }
        let mut of_draft = Table::new();
        match weave {
            Some(weave) => of_draft.insert("weave".into(), text(&weave)),
            None => {
                let rows = draft.drawdown().lines().map(text).collect();
                of_draft.insert("drawdown".into(), Value::Array(rows))
            }
        };
        table.insert("draft".into(), Value::Table(of_draft));
        for (k, system) in SYSTEMS.into_iter().enumerate() {
            let shown = match purpose {
                Purpose::Answer { colours, .. } => &colours[k],
                Purpose::Picture { .. } => &vec![trial.colours[k]],
            };
            let list = |c: &[f64; 3]| Value::Array(c.map(|v| number(round(v))).to_vec());
            let colours = Value::Array(shown.iter().map(list).collect());
            let mut threads = Table::new();
            threads.insert("yarn".into(), text(system));
            threads.insert("per_cm".into(), number(round(10.0 / self.spacing_mm[k])));
            threads.insert("colours".into(), colours);
            table.insert(system.into(), Value::Table(threads));
        }
        table.extend(self.base.clone());
        let mut most = f64::INFINITY;
        if let Purpose::Picture {
            threads,
            seed,
            most_fibres,
        } = purpose
        {
            most = most_fibres;
            table.insert("seed".into(), Value::Integer(seed as i64));
            let repeats = [draft.ends(), draft.picks()];
            let repeats = repeats.map(|n| Value::Integer(threads.div_ceil(n) as i64));
            let tile = [("repeats".to_owned(), Value::Array(repeats.to_vec()))];
            table.insert("tile".into(), Value::Table(Table::from_iter(tile)));
        }
        for (k, system) in SYSTEMS.into_iter().enumerate() {
            let mut set = |section: &str, key: &str, value: f64| {
                let section = table.get_mut(section).and_then(Value::as_table_mut);
                let own = section.and_then(|s| s.get_mut(system));
                if let Some(own) = own.and_then(Value::as_table_mut) {
                    own.insert(key.into(), number(round(value)));
                }
            };
            set("yarn", "tex", trial.tex[k]);
            let [radius_um, per_tex] = self.fibres[k];
            let fibres = per_tex * trial.tex[k];
            if fibres > most {
                set(
                    "yarn",
                    "fibre_radius_um",
                    radius_um * (fibres / most).sqrt(),
                );
            }
            set("optics", self.fitted.roughness, trial.roughness);
        }
        table
    }

    /// The fabric with trial values.
    ///
    /// # Errors
    /// Yarns that do not fit into their spacing.
    pub fn fabric(&self, draft: &Draft, trial: &Trial, purpose: Purpose<'_>) -> Result<Fabric> {
        let loader = self.loader(draft, trial, purpose)?;
        Ok(fabric_file::load(&self.path, &[], &loader)?)
    }

    /// Whether the yarns fit into their spacing.
    pub fn fits(&self, draft: &Draft, trial: &Trial) -> bool {
        let few = Purpose::Picture {
            threads: 4,
            seed: 0,
            most_fibres: f64::INFINITY,
        };
        self.fabric(draft, trial, few).is_ok()
    }

    /// A loader that has the fabric with trial values at [`ClothModel::path`].
    pub fn loader(
        &self,
        draft: &Draft,
        trial: &Trial,
        purpose: Purpose<'_>,
    ) -> Result<Loader<'static>> {
        let text = toml::to_string(&self.table(draft, trial, purpose))?;
        let mut loader = self.args.context.loader();
        loader.give(self.path.clone(), text);
        Ok(loader)
    }
}

/// Values of files have five significant digits.
fn round(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

/// The name of the first yarn of a system of a fabric file.
fn yarn_of(own: &Table, system: &str) -> String {
    let named = own.get(system).and_then(|t| t.get("yarn"));
    let first = match named {
        Some(Value::Array(list)) => list.first(),
        other => other,
    };
    let only = || {
        let yarns = own.get("yarn").and_then(Value::as_table)?;
        (yarns.len() == 1).then(|| yarns.keys().next().cloned())?
    };
    let first = first.and_then(Value::as_str).map(str::to_owned);
    first.or_else(only).unwrap_or_else(|| "cotton".to_owned())
}

/// What a trial keeps of a fabric file: yarns, one for each system, their optics without
/// colours, and how the cloth is relaxed and shown.
fn base(args: &FitJob, own: &Table, spacing_mm: [f64; 2]) -> Result<Table> {
    let refuse = |why: String| {
        let path = args.fabric.clone().unwrap_or_default();
        of_file(path, why)
    };
    for key in ["nonwoven", "pile", "synthesis", "print", "wear"] {
        if own.contains_key(key) {
            return Err(refuse(format!(
                "[{key}]: a fit to photographs is of woven cloth without it"
            )));
        }
    }
    let mut base = Table::new();
    for key in ["seed", "relaxation", "ideal", "voxel"] {
        own.get(key).map(|v| base.insert(key.into(), v.clone()));
    }
    let (mut yarns, mut optics) = (Table::new(), Table::new());
    for system in SYSTEMS {
        let name = yarn_of(own, system);
        let table = own.get("yarn").and_then(|y| y.get(&name));
        let mut yarn = table.and_then(Value::as_table).cloned().unwrap_or_default();
        if !yarn.contains_key("preset") && preset::NAMES.contains(&name.as_str()) {
            yarn.insert("preset".into(), Value::String(name.clone()));
        }
        for key in ["fibres_per_ply", "ply_radius_mm"] {
            yarn.remove(key);
        }
        yarns.insert(system.into(), Value::Table(yarn));
        let table = own.get("optics").and_then(|o| o.get(&name).or(o.get("*")));
        let mut table = match table {
            None => Table::new(),
            Some(Value::Table(table)) => table.clone(),
            Some(_) => {
                return Err(refuse(format!(
                    "optics.{name}: is a list of tables for colours of thread; a fit needs one \
                     table, or none"
                )));
            }
        };
        for key in ["colour", "albedo", "absorption_per_mm", "fitted"] {
            table.remove(key);
        }
        optics.insert(system.into(), Value::Table(table));
    }
    base.insert("yarn".into(), Value::Table(yarns));
    base.insert("optics".into(), Value::Table(optics));
    if !base.contains_key("voxel") {
        let size_um = (50.0 * spacing_mm[0].min(spacing_mm[1])).clamp(1.0, 100.0);
        let voxel = [("size_um".to_owned(), Value::Float(round(size_um)))];
        base.insert("voxel".into(), Value::Table(Table::from_iter(voxel)));
    }
    Ok(base)
}
