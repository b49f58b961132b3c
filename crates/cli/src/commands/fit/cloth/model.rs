//! The computed side of a fit to photographs: a fabric with trial values and its pictures.

use crate::commands::fit::FitArgs;
use crate::error::input;
use anyhow::Result;
use glam::{UVec2, Vec2};
use organza_basis::SegmentSource;
use organza_measure::{Pair, TexelGrid, measure_texture};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::file_kind::Wanted;
use organza_scene::patches::{Matter, PatchModel, PatchOptions};
use organza_scene::representation::{Build, EXPLICIT_FIBRES, FittedOptics, ShownAs};
use organza_weave::{Draft, preset};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Threads of each system in trial pictures, at least.
const FEW: usize = 4;

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
}

/// A cloth whose trial values change.
pub struct ClothModel<'a> {
    args: &'a FitArgs,
    /// The name under which the trial fabric is read; files that it names are beside it.
    path: PathBuf,
    /// Everything but draft, threads and colours.
    base: Table,
    shown: ShownAs,
    /// The optics that are fitted.
    pub fitted: &'static FittedOptics,
    /// Spacing of warp and weft, mm.
    spacing_mm: [f64; 2],
    /// Count and width of both yarns where nothing presses on them.
    free: [[f64; 2]; 2],
    /// The last matter, for other colours of the same cloth.
    matter: RefCell<Option<Built>>,
}

/// Matter, and the draft and counts that it was made for.
struct Built {
    draft: Draft,
    tex: [f64; 2],
    matter: Matter,
}

impl<'a> ClothModel<'a> {
    /// The model of a cloth with threads this far apart; yarns, fibres and finish are those of
    /// the fabric that the arguments name, or cotton.
    ///
    /// # Errors
    /// A fabric that cannot be read or is not woven, or a model without fibres.
    pub fn new(args: &'a FitArgs, spacing_mm: [f64; 2]) -> Result<ClothModel<'a>> {
        let own: Table = match &args.fabric {
            Some(path) => {
                let loader = args.common.host.loader();
                loader.toml_of(path, &args.common.set, Wanted::Fabric)?
            }
            None => Table::new(),
        };
        let shown = match args.model.model {
            PatchModel::Own => ShownAs::usual(&EXPLICIT_FIBRES),
            PatchModel::Is(representation) => ShownAs::usual(representation),
        };
        let Some(fitted) = shown.representation.fitted else {
            let name = shown.representation.name;
            return Err(input(format!(
                "--model: {name:?} has no fibres to fit; choose another"
            )));
        };
        if matches!(shown.representation.build, Build::Surface(_)) {
            return Err(input("--model: a surface cannot stand for the volume"));
        }
        let folder = args.fabric.as_deref().and_then(Path::parent);
        let mut model = ClothModel {
            args,
            path: folder.unwrap_or(Path::new("")).join("fitted cloth.toml"),
            base: base(args, &own, spacing_mm)?,
            shown,
            fitted,
            spacing_mm,
            free: [[1.0; 2]; 2],
            matter: RefCell::new(None),
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
        };
        let fabric = self.fabric(&plain, &trial);
        self.spacing_mm = spacing_mm;
        let figures = fabric?.cloth.figures();
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
    pub fn table(&self, draft: &Draft, trial: &Trial, name: Option<&str>) -> Table {
        let mut table = Table::new();
        let text = |t: &str| Value::String(t.to_owned());
        let number = Value::Float;
        if let Some(name) = name {
            table.insert("name".into(), text(name));
        }
        let mut of_draft = Table::new();
        match organza_photograph::name_of(draft).filter(|_| name.is_some()) {
            Some(weave) => of_draft.insert("weave".into(), text(&weave)),
            None => {
                let rows = draft.drawdown().lines().map(text).collect();
                of_draft.insert("drawdown".into(), Value::Array(rows))
            }
        };
        table.insert("draft".into(), Value::Table(of_draft));
        for (k, system) in SYSTEMS.into_iter().enumerate() {
            let colour = trial.colours[k].map(|v| number(round(v))).to_vec();
            let mut threads = Table::new();
            threads.insert("yarn".into(), text(system));
            threads.insert("per_cm".into(), number(round(10.0 / self.spacing_mm[k])));
            let colours = Value::Array(vec![Value::Array(colour)]);
            threads.insert("colours".into(), colours);
            table.insert(system.into(), Value::Table(threads));
        }
        table.extend(self.base.clone());
        if name.is_none() {
            // Several threads, so that no single one decides.
            let repeats = [draft.ends(), draft.picks()];
            let repeats = repeats.map(|n| Value::Integer(FEW.div_ceil(n) as i64));
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
            set("optics", self.fitted.roughness, trial.roughness);
        }
        table
    }

    /// The fabric with trial values.
    ///
    /// # Errors
    /// Yarns that do not fit into their spacing.
    pub fn fabric(&self, draft: &Draft, trial: &Trial) -> Result<Fabric> {
        let text = toml::to_string(&self.table(draft, trial, None))?;
        let mut loader = self.args.common.host.loader();
        loader.give(self.path.clone(), text);
        Ok(fabric_file::load(&self.path, &[], &loader)?)
    }

    /// Pictures of one repeat for pairs of directions to the light and the camera: BSDF, rows
    /// from the bottom, with `texels` along x and y for each thread's spacing. `paths` are those
    /// of a texel; pictures of another `stream` have independent noise.
    ///
    /// # Errors
    /// As [`ClothModel::fabric`].
    pub fn pictures(
        &self,
        draft: &Draft,
        trial: &Trial,
        pairs: &[(Pair, [usize; 2])],
        (paths, stream): (u64, u64),
    ) -> Result<Vec<Vec<[f64; 3]>>> {
        let fabric = self.fabric(draft, trial)?;
        let loader = self.args.common.host.loader();
        let options = PatchOptions {
            loader: &loader,
            voxel_um: self.args.voxel.voxel_um,
            level: 0,
            max_memory_bytes: self.args.memory.max_memory,
        };
        let last = self.matter.take();
        let same = last.filter(|b| b.tex == trial.tex && b.draft == *draft);
        let built = match same {
            Some(built) => built,
            None => Built {
                draft: draft.clone(),
                tex: trial.tex,
                matter: Matter::new(&fabric, &self.path, self.shown, &options)?,
            },
        };
        let patch = built.matter.patch(&fabric, &self.path, &options)?;
        self.matter.replace(Some(built));
        let bounds_mm = fabric.cloth.tile().bounds_mm;
        let size_mm: Vec2 = fabric.tile_mm();
        let tile = fabric.cloth.draft().unwrap_or(draft);
        let picture = |(pair, [n, m]): &(Pair, [usize; 2])| -> Result<Vec<[f64; 3]>> {
            let repeats = UVec2::new(
                (tile.ends() / draft.ends()).max(1) as u32,
                (tile.picks() / draft.picks()).max(1) as u32,
            );
            let one = UVec2::new((draft.ends() * n) as u32, (draft.picks() * m) as u32);
            let grid = TexelGrid {
                low_mm: bounds_mm.min.truncate(),
                size_mm,
                texels: one * repeats,
            };
            let texture = {
                let paths = paths.div_ceil(u64::from(repeats.x * repeats.y)).max(2);
                measure_texture(
                    &patch,
                    *pair,
                    &grid,
                    paths,
                    self.args.seed.wrapping_add(1000 * stream),
                )?
            };
            self.args.common.host.stop_if_asked();
            let width = grid.texels.x as usize;
            let rows: Vec<&[[f32; 3]]> = texture.mean.chunks_exact(width).rev().collect();
            let mut sums = vec![[0.0; 3]; (one.x * one.y) as usize];
            for (y, row) in rows.iter().enumerate() {
                for (x, value) in row.iter().enumerate() {
                    let at = y % one.y as usize * one.x as usize + x % one.x as usize;
                    (0..3).for_each(|c| sums[at][c] += f64::from(value[c]));
                }
            }
            let count = f64::from(repeats.x * repeats.y);
            Ok(sums.into_iter().map(|s| s.map(|v| v / count)).collect())
        };
        pairs.iter().map(picture).collect()
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
fn base(args: &FitArgs, own: &Table, spacing_mm: [f64; 2]) -> Result<Table> {
    let refuse = |why: String| {
        let path = args.fabric.clone().unwrap_or_default();
        input(format!("{}: {why}", path.display()))
    };
    for key in ["nonwoven", "pile", "synthesis", "print"] {
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
