//! The scene whose volume is fitted: read or made, and changed.

use super::{FitJob, volume};
use anyhow::{Context, Result};
use glam::DVec3;
use organza_basis::Budget;
use organza_measure::{Angles, Appearance};
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::memory::free_memory_bytes;
use organza_scene::object::{ObjectTable, VolumeMaterials};
use organza_scene::optics::EVERY_YARN;
use organza_scene::scene_file::SceneFile;
use organza_scene::{BuildOptions, LoadedScene, from_str, read};
use organza_volume::format;
use organza_work::{InputError, of_file};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Albedo from which searches begin.
pub const START: f64 = 0.8;

/// Keys of optics that say otherwise what `albedo` and `gamma` say.
const REPLACED: [&str; 2] = ["end_on_ratio", "sin_power"];

/// The scene whose volume is fitted.
pub struct Draft {
    /// The file that was given; paths in the table are relative to its folder.
    pub path: PathBuf,
    /// Its keys, or those made for a volume file.
    pub table: Table,
    /// Whether the table was made for a volume file.
    pub is_made: bool,
    /// Which object is fitted.
    pub index: usize,
    /// What is known of its materials.
    pub materials: VolumeMaterials,
}

impl Draft {
    /// Reads the scene, or makes one for a volume file.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    pub fn new(args: &FitJob, loader: &Loader<'_>) -> Result<Draft> {
        let path = args.fabric_path().to_owned();
        let is_made = format::by_name(&path.to_string_lossy()).is_some();
        let table = if is_made {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let text = format!(
                "[[object]]\nkind = \"volume\"\nfile = {}\n",
                Value::from(name.as_ref())
            );
            let changed = read::toml_changed(&path, &text, &[], &args.set, Wanted::Scene);
            changed?
        } else {
            loader.toml_of(&path, &args.set, Wanted::Scene)?
        };
        let mut draft = Draft {
            path,
            table,
            is_made,
            index: 0,
            materials: VolumeMaterials::default(),
        };
        let file: SceneFile = if is_made {
            draft.load(&draft.table, loader)?.file
        } else {
            // Messages of the file itself name its lines.
            organza_scene::load(&draft.path, &args.set, loader)?.file
        };
        let volumes = file.object.iter().enumerate();
        let mut volumes = volumes.filter_map(|(i, object)| match object {
            ObjectTable::Volume(table) => Some((i, table)),
            _ => None,
        });
        let fail = |why: String| of_file(&draft.path, why);
        let (Some((index, volume)), None) = (volumes.next(), volumes.next()) else {
            let count = file.object.iter().filter(|o| o.kind() == "volume").count();
            return Err(fail(format!(
                "expected one object of kind = \"volume\", found {count}"
            )));
        };
        draft.index = index;
        // The search may give any albedo; until then the file need have none.
        let tried = draft.with(
            &[EVERY_YARN.to_owned()],
            &Appearance {
                albedo: vec![[START; 3]],
                gamma: 0.15,
                density: 1.0,
            },
        )?;
        let allowed = args.context.max_memory_bytes;
        let options = BuildOptions {
            scene_path: &draft.path,
            loader,
            max_memory_bytes: allowed,
        };
        let mut budget = Budget::new(allowed.unwrap_or_else(free_memory_bytes));
        let shown = draft.load(&tried, loader)?;
        let shown = match &shown.file.object[index] {
            ObjectTable::Volume(table) => table.clone(),
            _ => volume.clone(),
        };
        draft.materials = shown.materials(index, &options, &mut budget)?;
        if is_made && volume::has_picture(args) {
            draft.look(args, &tried, loader)?;
        }
        Ok(draft)
    }

    /// A camera and a lamp for a volume file, as the flags describe them: white paper has a
    /// radiance of one.
    fn look(&mut self, args: &FitJob, tried: &Table, loader: &Loader<'_>) -> Result<()> {
        let scene = self
            .load(tried, loader)?
            .build(args.context.max_memory_bytes, loader)?;
        let grid = scene.media.first().and_then(|m| m.cell_grid().copied());
        let grid = grid.ok_or_else(|| of_file(&self.path, "is empty"))?;
        let bounds = grid.bounds_mm();
        let (middle, size) = (bounds.centre().as_dvec3(), bounds.size().as_dvec3());
        let toward =
            |[theta_deg, phi_deg]: [f64; 2]| Angles { theta_deg, phi_deg }.direction().as_dvec3();
        let view = toward(args.view.unwrap_or(super::VIEW));
        let light = toward(args.light.unwrap_or(super::LIGHT));
        let list = |v: DVec3| Value::from(v.to_array().to_vec());
        let camera: Table = [
            ("kind", Value::from("orthographic")),
            (
                "origin_mm",
                list(middle + view * (2.0 * size.length() + 10.0)),
            ),
            ("target_mm", list(middle)),
            ("up", list(DVec3::Y)),
            ("width_mm", Value::from(args.width_mm.unwrap_or(size.x))),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into_iter()
        .collect();
        let lamp: Table = [
            ("kind", Value::from("directional")),
            ("direction", list(-light)),
            (
                "irradiance",
                Value::from(vec![PI / light.z.abs().max(1e-3); 3]),
            ),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into_iter()
        .collect();
        self.table.entry("camera").or_insert(Value::Table(camera));
        self.table
            .entry("light")
            .or_insert(Value::Array(vec![Value::Table(lamp)]));
        Ok(())
    }

    /// Reads a changed table.
    ///
    /// # Errors
    /// Names the scene and the key at fault.
    pub fn load(&self, table: &Table, loader: &Loader<'_>) -> Result<LoadedScene> {
        let text = toml::to_string(table).context("the scene cannot be written")?;
        Ok(from_str(&text, &self.path, &[], loader)?)
    }

    /// The table with the optics of named yarns, or of every yarn.
    ///
    /// # Errors
    /// Names the key that contradicts them.
    pub fn with(&self, names: &[String], optics: &Appearance) -> Result<Table> {
        let mut table = self.table.clone();
        let fail = |why: &str| {
            let keyed = InputError::keyed(format!("object[{}]{why}", self.index));
            anyhow::Error::new(keyed.in_file(&self.path))
        };
        let objects = table.get_mut("object").and_then(Value::as_array_mut);
        let object = objects
            .and_then(|list| list.get_mut(self.index))
            .and_then(Value::as_table_mut)
            .ok_or_else(|| fail(": expected a table"))?;
        if object
            .get("model")
            .is_some_and(|m| m.as_str() != Some("microflake"))
        {
            return Err(fail(
                ".model: a fit finds the optics of micro-flakes; expected \"microflake\"",
            ));
        }
        object.insert("model".into(), "microflake".into());
        object.remove("albedo");
        let own = object.get("density_scale").and_then(number).unwrap_or(1.0);
        if optics.density != 1.0 {
            object.insert("density_scale".into(), rounded(own * optics.density).into());
        }
        let all = object
            .entry("optics")
            .or_insert_with(|| Value::Table(Table::new()));
        let all = all
            .as_table_mut()
            .ok_or_else(|| fail(".optics: expected a table"))?;
        for (name, list) in all.iter_mut() {
            let Some(list) = list.as_table_mut() else {
                let why = "is a list of tables for colours of thread; a fit needs one table";
                return Err(fail(&format!(".optics.{name}: {why}")));
            };
            for key in REPLACED.iter().chain(&["albedo", "gamma"]) {
                list.remove(*key);
            }
        }
        for (name, albedo) in names.iter().zip(&optics.albedo) {
            let own = all
                .entry(name.as_str())
                .or_insert_with(|| Value::Table(Table::new()));
            if let Some(own) = own.as_table_mut() {
                own.insert("albedo".into(), Value::from(albedo.map(rounded).to_vec()));
                own.insert("gamma".into(), rounded(optics.gamma).into());
            }
        }
        Ok(table)
    }

    /// The table with names of files that are valid where it is written.
    ///
    /// # Errors
    /// A folder that is not known.
    pub fn portable(&self, mut table: Table, outfile: &Path) -> Result<Table> {
        let folder = |path: &Path| {
            let parent = path.parent().map(Path::to_owned).unwrap_or_default();
            std::path::absolute(if parent.as_os_str().is_empty() {
                Path::new(".")
            } else {
                &parent
            })
        };
        if folder(&self.path)? == folder(outfile)? {
            return Ok(table);
        }
        for list in ["object", "light"] {
            let entries = table.get_mut(list).and_then(Value::as_array_mut);
            for entry in entries.into_iter().flatten() {
                let Some(entry) = entry.as_table_mut() else {
                    continue;
                };
                for key in ["file", "fabric", "mesh", "extinction", "sggx", "albedo"] {
                    if let Some(Value::String(name)) = entry.get_mut(key) {
                        let there = std::path::absolute(read::beside(&self.path, name))?;
                        *name = there.to_string_lossy().into_owned();
                    }
                }
            }
        }
        Ok(table)
    }
}

/// To a hundred-thousandth, far below any error of a fit.
fn rounded(value: f64) -> f64 {
    (value * 1e5).round() / 1e5
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|i| i as f64))
}
