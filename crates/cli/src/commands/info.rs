//! `organza info`

use super::Command;
use crate::flags::{CommonArgs, SetArgs, set_help};
use crate::{data_sheet, terminal};
use anyhow::Result;
use clap::Args;
use organza_basis::{Aabb, Budget};
use organza_kernel::DeviceKind;
use organza_light::LightTable;
use organza_scatter::Surface;
use organza_scene::loader::Loader;
use organza_scene::memory::free_memory_bytes;
use organza_scene::object::At;
use organza_scene::scene_file::{IntegratorName, is_scene};
use organza_scene::{BuildOptions, fabric_file, far_table, light_pictures, read, volume_file};
use organza_surface::table::FarTable;
use organza_volume::format::{self, Format};
use organza_weave::blend::mass_shares;
use organza_weave::{Draft, Yarn, curve_file::CurveSet};
use organza_work::{InputError, Waiting, of_file, picture};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `organza info`
#[derive(Debug, Args)]
#[command(about = "Print what a draft, fabric, scene, volume, curve or picture file holds, and check it; or list graphics adapters", after_help = "Example:\n  organza info scenes/fabrics/organza.toml --json", mut_arg("set", |a| a.help(set_help::FABRIC_OR_SCENE)))]
pub struct InfoArgs {
    /// A draft (.wif), fabric or scene (.toml), volume (.ovox, .vdb, .vol), curves (.bcc, .txt), table (.bsdf) or picture (.exr, .png, .jpg, .tif, .hdr)
    #[arg(required_unless_present = "devices", conflicts_with = "devices")]
    pub file: Option<PathBuf>,
    /// List the graphics adapters that `render --engine gpu` can use, the preferred one first
    #[arg(long)]
    pub devices: bool,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub set: SetArgs,
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
    let context = args.common.context();
    let waiting = Waiting::new("reading", &context);
    let listing = context.run(|| tell(args))?;
    drop(waiting);
    if args.json {
        return terminal::print_json(&listing);
    }
    let mut text = String::new();
    if ["fabric", "draft"]
        .iter()
        .any(|kind| listing["kind"] == *kind)
    {
        text = data_sheet::text(&listing);
    } else {
        list(&mut text, &listing, 0);
    }
    terminal::print(&text)
}

fn tell(args: &InfoArgs) -> Result<Value> {
    let Some(path) = args.file.as_deref() else {
        return Ok(devices_info());
    };
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let fail = |e: String| of_file(path, e);
    if let Some(key) = args.set.set.first()
        && !ending.eq_ignore_ascii_case("toml")
    {
        let why = format!("{key}: only fabrics and scenes have keys");
        return Err(InputError::after_option("set", why).in_file(path).into());
    }
    if let Some(format) = format::by_name(&path.to_string_lossy()) {
        return volume(format, path);
    }
    match ending.to_lowercase().as_str() {
        "wif" => {
            let draft = Draft::from_wif(&read::bytes(path)?).map_err(|e| fail(e.to_string()))?;
            Ok(json!({ "kind": "draft", "draft": draft.summary() }))
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
        far_table::ENDING => {
            let (table, about) = far_table::read(path, &Loader::new())?;
            Ok(table_info(&table, &about))
        }
        "toml" => toml(path, &args.set.set),
        other if organza_picture::format_of_ending(other).is_some() => plain_picture_info(path),
        _ => Err(read::unreachable(path).map_or_else(
            || {
                fail(
                    "expected a name that ends in .wif, .toml, .ovox, .vdb, .vol, .bcc, .txt, \
                     .bsdf, .exr, .png, .jpg, .tif or .hdr"
                        .into(),
                )
            },
            Into::into,
        )),
    }
}

/// A far-field table. Shares are those of light along the normal of the face.
fn table_info(table: &FarTable, about: &Value) -> Value {
    let mut listing = json!({
        "kind": "table",
        "nodes": table.rings().sphere(),
        "memory_bytes": table.memory_bytes(),
        "scattered_along_normal": table.albedo(glam::Vec3::Z).0.to_array(),
        "straight_along_normal": table.gap(glam::Vec3::Z, organza_scatter::Footprint::FAR),
    });
    if let (Some(listing), Some(about)) = (listing.as_object_mut(), about.as_object()) {
        listing.extend(about.clone());
    }
    listing
}

/// The graphics adapters.
fn devices_info() -> Value {
    let Some(devices) = organza_kernel::devices() else {
        return json!({
            "devices": "this program was built without graphics cards; cargo build --features gpu",
        });
    };
    let listed: Vec<Value> = devices
        .iter()
        .map(|device| {
            json!({
                "name": device.name,
                "kind": device.kind.name(),
                "interface": device.interface,
                "driver": device.driver,
                "chosen_by_auto": device.kind != DeviceKind::Software,
                "max_binding_bytes": device.max_binding_bytes,
                "max_buffers": device.max_buffers,
            })
        })
        .collect();
    match listed.is_empty() {
        true => json!({ "devices": "none with Vulkan, Metal or Direct3D 12" }),
        false => json!({ "devices": listed }),
    }
}

/// A volume.
fn volume(format: &Format, path: &Path) -> Result<Value> {
    let mut budget = Budget::new(free_memory_bytes());
    let mut listing = volume_file::read(path, &Loader::new(), |source| {
        (format.describe)(source, &mut budget)
    })?;
    // A scan keeps its figures as TOML.
    if let Some(text) = listing.get("scan").and_then(Value::as_str)
        && let Ok(table) = toml::from_str::<toml::Table>(text)
    {
        if let Some(scanned) = scanned_box(&listing["box"], &table) {
            listing["box"] = scanned;
        }
        listing["scan"] = json!(table);
    }
    Ok(listing)
}

/// The box of the voxels that a scan has: coarse levels need more about them, evenly on both
/// sides.
fn scanned_box(padded: &Value, scan: &toml::Table) -> Option<Value> {
    let scan = scan.get("scan")?;
    let mut scanned = padded.clone();
    for axis in 0..3 {
        let number = |key: &str| match scan.get(key)?.get(axis)? {
            toml::Value::Integer(n) => Some(*n as f64),
            toml::Value::Float(x) => Some(*x),
            _ => None,
        };
        let [low, high] = ["min_mm", "max_mm"].map(|key| padded[key][axis].as_f64());
        let (low, high) = (low?, high?);
        let size_mm = (number("size")? * 1e-3 * number("voxel_um")?).min(high - low);
        let middle = 0.5 * (low + high);
        scanned["min_mm"][axis] = json!(middle - 0.5 * size_mm);
        scanned["max_mm"][axis] = json!(middle + 0.5 * size_mm);
    }
    Some(scanned)
}

/// A fabric or a scene.
fn toml(path: &Path, overrides: &[String]) -> Result<Value> {
    if is_scene(path)? {
        return scene_info(path, overrides);
    }
    let fabric = fabric_file::load(path, overrides, &Loader::new())?;
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
                "irregularity": y.irregularity,
                "finish": y.finish,
                "mass_cv_percent": y.evenness.map_or(0.0, |e| e.mass_cv_percent),
                "drafting_waves": y.drafting_waves,
                "fibre_radius_cv_percent": 100.0 * y.fibre_radius_cv,
                "hairiness": y.hairiness.map(|h| h.index),
                "blend": blend_info(y),
                "crimp": y.crimp,
                "crimp_percent": y.crimp_percent(),
            })
        })
        .collect();
    let materials: Vec<Value> = fabric
        .cloth
        .materials()
        .iter()
        .zip(fabric.flake_optics())
        .map(|(m, o)| {
            json!({
                "yarn": m.yarn,
                "fibre": m.fibre,
                "colour": m.colour,
                "fibre_radius_um": m.fibre_radius_mm * 1e3,
                "albedo": o.albedo,
                "end_on_ratio": o.end_on_ratio,
            })
        })
        .collect();
    let mut about = json!({
        "kind": "fabric",
        "name": fabric.file.name,
        "tile": box_of(&organza_basis::SegmentSource::tile(&fabric.cloth).bounds_mm),
        "draft": fabric.cloth.draft().map(Draft::summary),
        "figures": fabric.cloth.figures(),
        "irregularity": fabric.cloth.irregularity(),
        "openness": 1.0 - fabric.cloth.figures().cover_factor,
        "yarns": yarns,
        "materials": materials,
        "warnings": fabric.cloth.warnings(),
    });
    if let Some(synthesis) = &fabric.synthesis {
        about["synthesis"] = json!({
            "design": synthesis.design.summary(),
            "figures": synthesis.figures(),
            "border_gaps": fabric.cloth.border_gaps(synthesis),
            "tile_mm": fabric.tile_mm().to_array(),
        });
    }
    Ok(about)
}

/// The parts of a yarn of several fibres.
fn blend_info(yarn: &Yarn) -> Vec<Value> {
    let mass_shares = mass_shares(&yarn.blend);
    let parts = yarn.blend.iter().zip(mass_shares);
    parts
        .map(|(part, mass_share)| {
            json!({
                "fibre": part.fibre,
                "colour": part.colour,
                "share": part.share,
                "mass_share": mass_share,
                "fibre_radius_um": 1e3 * part.fibre_radius_mm,
                "fibre_density_g_per_cm3": part.fibre_density_g_per_cm3,
                "fibre_radius_cv_percent": 100.0 * part.fibre_radius_cv,
            })
        })
        .collect()
}

/// A scene, of which everything is read that can be without making voxels:
/// mistakes in it are reported as by `render`.
fn scene_info(path: &Path, overrides: &[String]) -> Result<Value> {
    let loader = &Loader::new();
    let loaded = organza_scene::load(path, overrides, loader)?;
    let (file, chosen) = (&loaded.file, &loaded.chosen);
    light_pictures::lights(&file.light, path, None, loader)?;
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    let options = BuildOptions {
        scene_path: path,
        loader,
        max_memory_bytes: None,
    };
    let objects = file.object.iter().enumerate();
    let objects = objects
        .map(|(index, table)| {
            let at = At {
                index,
                as_fibres,
                scene_path: path,
                loader,
            };
            Ok(table.describe(&at, &options)?)
        })
        .collect::<Result<Vec<Value>>>()?;
    let mut listing = json!({
        "kind": "scene",
        "camera": file.camera.as_ref().map(|c| c.kind.name),
        "resolution": file.camera.as_ref().map(|c| c.resolution),
        "spp": file.render.spp,
        "seed": file.render.seed,
        "lights": file.light.iter().map(light_info).collect::<Vec<_>>(),
        "objects": objects,
    });
    if !chosen.is_empty() {
        listing["chosen"] = json!(chosen);
    }
    Ok(listing)
}

fn light_info(table: &LightTable) -> Value {
    match table.file() {
        Some(file) => json!({ "kind": table.kind(), "file": file }),
        None => json!({ "kind": table.kind() }),
    }
}

fn box_of(b: &Aabb) -> Value {
    json!({ "min_mm": b.min.to_array(), "max_mm": b.max.to_array() })
}

/// A picture that `render` wrote.
fn picture_info(path: &Path) -> Result<Value> {
    let stored = picture::read_exr(path, free_memory_bytes())?;
    let size = stored.film.size();
    let attributes: BTreeMap<&str, &str> = stored.attributes.iter().collect();
    Ok(json!({
        "kind": "picture",
        "resolution": size.to_array(),
        "attributes": attributes,
    }))
}

/// A picture that keeps nothing of its render.
fn plain_picture_info(path: &Path) -> Result<Value> {
    let decoded = organza_picture::decode(&read::bytes(path)?, free_memory_bytes());
    let (picture, format) = decoded.map_err(|e| of_file(path, e))?;
    Ok(json!({
        "kind": "picture",
        "format": format.name,
        "resolution": picture.size.to_array(),
    }))
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
                    *text += &format!("{indent}{key}: {}\n", value_text(v));
                } else {
                    *text += &format!("{indent}{key}:\n");
                    list(text, v, depth + 1);
                }
            }
        }
        Value::Array(items) => {
            for (i, v) in items.iter().enumerate() {
                if is_flat(v) {
                    *text += &format!("{indent}{}\n", value_text(v));
                } else {
                    *text += &format!("{indent}[{i}]\n");
                    list(text, v, depth + 1);
                }
            }
        }
        v => *text += &format!("{indent}{}\n", value_text(v)),
    }
}

fn value_text(v: &Value) -> String {
    match v {
        Value::String(s) => s.clone(),
        Value::Array(a) if a.is_empty() => "none".into(),
        Value::Array(a) => a.iter().map(value_text).collect::<Vec<_>>().join(" "),
        Value::Null => "-".into(),
        Value::Number(n) => match n.as_f64() {
            Some(x) if n.is_f64() => format!("{}", (x * 1e6).round() / 1e6),
            _ => n.to_string(),
        },
        v => v.to_string(),
    }
}
