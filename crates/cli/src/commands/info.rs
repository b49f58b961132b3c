//! `organza info`

use super::{Command, with_threads};
use crate::error::input;
use crate::fabric_file::free_memory_bytes;
use crate::flags::{CommonArgs, set_help};
use crate::scene_build::{self, BuildOptions};
use crate::scene_file::{self, IntegratorName, LightTable, ObjectTable, is_scene};
use crate::{auto_model, cloth_object, fabric_file, output, picture, read};
use anyhow::Result;
use clap::Args;
use organza_basis::Aabb;
use organza_volume::{Octree, VolGrid, ovox, vdb};
use organza_weave::{Draft, curve_file::CurveSet};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// `organza info`
#[derive(Debug, Args)]
#[command(about = "Print what a draft, fabric, scene, volume, curve or picture file holds, and check it", after_help = "Example:\n  organza info scenes/fabrics/organza.toml --json", mut_arg("set", |a| a.help(set_help::FABRIC_OR_SCENE)))]
pub struct InfoArgs {
    /// A draft (.wif), fabric or scene (.toml), volume (.ovox, .vdb, .vol), curves (.bcc, .txt) or picture that `render` wrote (.exr)
    pub file: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for InfoArgs {
    const NAME: &'static str = "info";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// Runs the command.
pub fn run(args: &InfoArgs) -> Result<()> {
    let told = with_threads(&args.common, || tell(args))?;
    let mut text = String::new();
    if args.json {
        text = serde_json::to_string_pretty(&told)? + "\n";
    } else {
        list(&mut text, &told, 0);
    }
    output::print(&text)
}

fn tell(args: &InfoArgs) -> Result<Value> {
    let path = args.file.as_path();
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let fail = |e: String| input(format!("{}: {e}", path.display()));
    if let Some(key) = args.common.set.first()
        && !ending.eq_ignore_ascii_case("toml")
    {
        return Err(fail(format!(
            "--set {key}: only fabrics and scenes have keys"
        )));
    }
    match ending.to_lowercase().as_str() {
        "wif" => {
            let draft = Draft::from_wif(&read::bytes(path)?).map_err(|e| fail(e.to_string()))?;
            Ok(json!({ "kind": "draft", "draft": draft.summary() }))
        }
        "vol" => {
            let parts = path.with_extension("sigma_t.vol");
            if !path.exists() && parts.is_file() {
                return Err(fail(format!(
                    "no such file; `voxelize` writes three, the first is {}",
                    parts.display()
                )));
            }
            let bytes = read::bytes(path)?;
            let limit = bytes.len() as u64;
            let grid = VolGrid::read(&mut &bytes[..], limit).map_err(|e| fail(e.to_string()))?;
            Ok(vol(&grid))
        }
        "ovox" => {
            let bytes = read::bytes(path)?;
            let octree = ovox::read(&mut &bytes[..], free_memory_bytes())
                .map_err(|e| fail(e.to_string()))?;
            Ok(octree_info(&octree))
        }
        "vdb" => {
            let file = vdb::read(&read::bytes(path)?).map_err(|e| fail(e.to_string()))?;
            Ok(vdb_info(&file))
        }
        "bcc" => {
            let set = CurveSet::read_bcc(&read::bytes(path)?, 1.0, 0.0)
                .map_err(|e| fail(e.to_string()))?;
            Ok(curves_info(&set))
        }
        "txt" => {
            let set =
                CurveSet::read_text(&read::text(path)?, 1.0).map_err(|e| fail(e.to_string()))?;
            Ok(curves_info(&set))
        }
        "exr" => picture_info(path),
        "toml" => toml(path, &args.common.set),
        _ => Err(read::unreachable(path).map_or_else(
            || {
                fail(
                    "expected a name that ends in .wif, .toml, .ovox, .vdb, .vol, .bcc, .txt or \
                     .exr"
                        .into(),
                )
            },
            input,
        )),
    }
}

/// A fabric or a scene.
fn toml(path: &Path, overrides: &[String]) -> Result<Value> {
    if is_scene(path)? {
        return scene_info(path, overrides);
    }
    let fabric = fabric_file::load(path, overrides)?;
    if fabric.file.surface.is_some() {
        // What would be refused later is no surface.
        fabric.surface(path)?;
    }
    let yarns: Vec<Value> = fabric
        .cloth
        .yarns()
        .iter()
        .map(|y| {
            json!({
                "name": y.name,
                "radius_mm": y.radius_mm(),
                "tex": y.tex(),
                "fibre_volume_fraction": y.fibre_volume_fraction(),
            })
        })
        .collect();
    let materials: Vec<Value> = fabric
        .cloth
        .materials()
        .iter()
        .zip(fabric.optics())
        .map(|(m, o)| {
            json!({
                "yarn": m.yarn,
                "colour": m.colour,
                "fibre_radius_um": m.fibre_radius_mm * 1e3,
                "albedo": o.albedo,
                "end_on_ratio": o.end_on_ratio,
            })
        })
        .collect();
    Ok(json!({
        "kind": "fabric",
        "name": fabric.file.name,
        "tile": box_of(&organza_basis::SegmentSource::tile(&fabric.cloth).bounds_mm),
        "draft": fabric.cloth.draft().map(Draft::summary),
        "figures": fabric.cloth.figures(),
        "openness": 1.0 - fabric.cloth.figures().cover_factor,
        "yarns": yarns,
        "materials": materials,
        "warnings": fabric.cloth.warnings(),
    }))
}

/// A scene, of which everything is read that can be without making voxels:
/// what is wrong with it is told as `render` tells it.
fn scene_info(path: &Path, overrides: &[String]) -> Result<Value> {
    let mut file = scene_file::load(path, overrides)?;
    let fail = |why| input(format!("{}: render.{why}", path.display()));
    file.render.check().map_err(fail)?;
    scene_build::check(&file, path)?;
    let chosen = auto_model::resolve(&mut file, path)?;
    scene_build::lights(&file, path)?;
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    let objects = file.object.iter().enumerate();
    let objects = objects
        .map(|(i, table)| object_info(table, i, as_fibres, path))
        .collect::<Result<Vec<Value>>>()?;
    let mut told = json!({
        "kind": "scene",
        "camera": file.camera.kind.name(),
        "resolution": file.camera.resolution,
        "spp": file.render.spp,
        "seed": file.render.seed,
        "lights": file.light.iter().map(light_info).collect::<Vec<_>>(),
        "objects": objects,
    });
    if !chosen.is_empty() {
        told["chosen"] = json!(chosen);
    }
    Ok(told)
}

fn light_info(table: &LightTable) -> Value {
    match table {
        LightTable::Directional { .. } => json!({ "kind": "directional" }),
        LightTable::Rectangle { .. } => json!({ "kind": "rectangle" }),
        LightTable::Environment(t) => match &t.file {
            Some(file) => json!({ "kind": "environment", "file": file }),
            None => json!({ "kind": "environment" }),
        },
    }
}

fn object_info(
    table: &ObjectTable,
    index: usize,
    as_fibres: bool,
    scene_path: &Path,
) -> Result<Value> {
    match table {
        ObjectTable::Plane(_) => Ok(json!({ "kind": "plane" })),
        ObjectTable::Grid(t) => {
            scene_build::grid(t, scene_path)?;
            Ok(json!({ "kind": "grid", "extinction": t.extinction, "sggx": t.sggx }))
        }
        ObjectTable::Cloth(t) => {
            let options = BuildOptions {
                scene_path,
                quiet: true,
                max_memory_bytes: None,
            };
            let model = cloth_object::check(t, index, as_fibres, &options)?;
            let mut told = json!({ "kind": "cloth", "fabric": t.fabric, "model": model.words() });
            if let Some(mesh) = &t.mesh {
                told["mesh"] = json!(mesh);
            }
            Ok(told)
        }
    }
}

fn box_of(b: &Aabb) -> Value {
    json!({ "min_mm": b.min.to_array(), "max_mm": b.max.to_array() })
}

/// A picture that `render` wrote.
fn picture_info(path: &Path) -> Result<Value> {
    let (film, attributes) = picture::read_exr(path, free_memory_bytes())?;
    let size = film.size();
    Ok(json!({
        "kind": "picture",
        "resolution": size.to_array(),
        "attributes": attributes,
    }))
}

fn vol(grid: &VolGrid) -> Value {
    let range = |c: usize| {
        let values = grid.data.iter().skip(c).step_by(grid.channels as usize);
        let (lo, hi) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| {
            (lo.min(v), hi.max(v))
        });
        json!([lo, hi])
    };
    json!({
        "kind": "grid",
        "resolution": grid.dims.to_array(),
        "channels": grid.channels,
        "box": box_of(&grid.bounds_mm),
        "voxel_mm": (grid.bounds_mm.size() / grid.dims.as_vec3()).to_array(),
        "range": (0..grid.channels as usize).map(range).collect::<Vec<_>>(),
    })
}

fn vdb_info(file: &vdb::File) -> Value {
    let grids: Vec<Value> = file
        .grids
        .iter()
        .map(|g| {
            let (low, high) = g.data.active_box().unwrap_or_default();
            json!({
                "name": g.name,
                "type": g.data.type_name(),
                "active_voxels": g.data.active_count(),
                "first_cell": low.to_array(),
                "last_cell": high.to_array(),
                "voxel_mm": [
                    g.mm_from_cell.matrix3.x_axis.length(),
                    g.mm_from_cell.matrix3.y_axis.length(),
                    g.mm_from_cell.matrix3.z_axis.length(),
                ],
            })
        })
        .collect();
    let unread: Vec<Value> = file
        .unread
        .iter()
        .map(|(name, why)| json!({ "name": name, "not_read": why }))
        .collect();
    json!({ "kind": "vdb", "grids": grids, "unread": unread })
}

/// Lengths are in the file's own units.
fn curves_info(set: &CurveSet) -> Value {
    let points: usize = set.curves.iter().map(|c| c.points_mm.len()).sum();
    let closed = set.curves.iter().filter(|c| c.closed).count();
    let length: f64 = set
        .segments()
        .segments
        .iter()
        .map(|s| f64::from(s.length_mm()))
        .sum();
    let bounds = set.bounds_mm();
    json!({
        "kind": "curves",
        "curves": set.curves.len(),
        "closed": closed,
        "points": points,
        "length": length,
        "min": bounds.min.to_array(),
        "max": bounds.max.to_array(),
    })
}

fn octree_info(octree: &Octree) -> Value {
    let levels: Vec<Value> = (0..octree.level_count())
        .map(|l| {
            json!({
                "voxel_um": (octree.voxel_mm(l) * 1e3).to_array(),
                "dims": octree.dims(l).to_array(),
                "occupied": octree.occupied_cells(l),
                "fibre_length_mm": octree.fibre_length_mm(l),
                "memory_bytes": octree.level_memory_bytes(l),
            })
        })
        .collect();
    let (mut least, mut most) = (f32::INFINITY, 0.0f32);
    octree.for_each_occupied(0, |cell| {
        let sigma = octree.broadside_per_mm(0, cell);
        least = least.min(sigma);
        most = most.max(sigma);
    });
    json!({
        "kind": "octree",
        "box": box_of(&octree.bounds_mm()),
        "repeats": octree.repeats(),
        "materials": octree.material_count(),
        "extinction_per_mm": if most > 0.0 { json!([least, most]) } else { json!([0.0, 0.0]) },
        "memory_bytes": octree.memory_bytes(),
        "levels": levels,
    })
}

/// A listing for people: one key a line, nested by indentation.
fn list(text: &mut String, value: &Value, depth: usize) {
    let indent = "  ".repeat(depth);
    let is_flat = |v: &Value| match v {
        Value::Array(a) => a.iter().all(|v| !v.is_object() && !v.is_array()),
        Value::Object(_) => false,
        _ => true,
    };
    match value {
        Value::Object(map) => {
            for (key, v) in map {
                if is_flat(v) {
                    *text += &format!("{indent}{key}: {}\n", words(v));
                } else {
                    *text += &format!("{indent}{key}:\n");
                    list(text, v, depth + 1);
                }
            }
        }
        Value::Array(items) => {
            for (i, v) in items.iter().enumerate() {
                if is_flat(v) {
                    *text += &format!("{indent}{}\n", words(v));
                } else {
                    *text += &format!("{indent}[{i}]\n");
                    list(text, v, depth + 1);
                }
            }
        }
        v => *text += &format!("{indent}{}\n", words(v)),
    }
}

fn words(v: &Value) -> String {
    match v {
        Value::String(s) => s.clone(),
        Value::Array(a) if a.is_empty() => "none".into(),
        Value::Array(a) => a.iter().map(words).collect::<Vec<_>>().join(" "),
        Value::Null => "-".into(),
        Value::Number(n) => match n.as_f64() {
            Some(x) if n.is_f64() => format!("{}", (x * 1e6).round() / 1e6),
            _ => n.to_string(),
        },
        v => v.to_string(),
    }
}
