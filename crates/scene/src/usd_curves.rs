//! Yarns or fibres of a tile as USD curves \[Pixar2024\], with a MaterialX hair material each.
//!
//! The tile is a prototype, of which there are as many instances as asked for. A fibre of
//! organza's is that of [Marschner2003] with lobes whose widths are in the ratio of [Chiang2016],
//! so that the hair material takes the same index, absorption and widths without a fit.

use crate::error::{InputError, Result};
use crate::fabric_file::Fabric;
use crate::fibre_model;
use crate::optics::{self, UNDYED};
use glam::{DVec2, IVec2, UVec2, Vec2, Vec3};
use organza_basis::{Budget, SegmentSource};
use organza_mesh::{Chart, Mesh};
use organza_scatter::DielectricParameters;
use organza_weave::curve_file::{SourceCurve, for_each_curve};
use organza_weave::{CurveLevel, Error};
use std::f32::consts::PI;
use std::io::Write;
use std::path::Path;

/// Tiles of the cloth on a mesh, at most: a square metre of tiles of a millimetre.
const MAX_TILES: f64 = 1e6;

/// Numbers of a line of the file.
const OF_A_LINE: usize = 8;

/// What is to be written of a fabric.
#[derive(Clone, Copy)]
pub struct UsdCurves<'a> {
    /// The fabric, and where it lies.
    pub fabric: &'a Fabric,
    /// See `fabric`.
    pub path: &'a Path,
    /// How far it is taken apart.
    pub level: CurveLevel,
    /// Tiles along x and y, instances of one.
    pub repeats: UVec2,
    /// What the cloth lies over; then all curves are written.
    pub mesh: Option<&'a Mesh>,
    /// Memory that may be taken.
    pub max_memory_bytes: u64,
}

/// What a file holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Written {
    /// Curves of the tile, or of the cloth on a mesh.
    pub curves: usize,
    /// Their points.
    pub points: usize,
}

/// The curves of one material.
#[derive(Default)]
struct Curves {
    points_mm: Vec<Vec3>,
    radii_mm: Vec<f32>,
    counts: Vec<u32>,
    yarns: Vec<u32>,
}

/// Bytes of a point: its place, its radius, and what a curve of few points adds.
const POINT_BYTES: u64 = (size_of::<Vec3>() + 3 * size_of::<u32>()) as u64;

impl Curves {
    fn add(&mut self, yarn: u32, points_mm: impl Iterator<Item = (Vec3, f32)>) {
        let before = self.points_mm.len();
        for (point, radius) in points_mm {
            self.points_mm.push(point);
            self.radii_mm.push(radius);
        }
        self.counts.push((self.points_mm.len() - before) as u32);
        self.yarns.push(yarn);
    }
}

/// One material of the file.
struct Look {
    name: String,
    colour: Vec3,
    fibre: Option<DielectricParameters>,
}

/// The file, made up to its text.
pub struct UsdFile {
    name: String,
    period_mm: Vec2,
    repeats: UVec2,
    curves: Vec<Curves>,
    looks: Vec<Look>,
    /// Whether curves are fibres, which scatter as hair does.
    are_fibres: bool,
}

impl UsdCurves<'_> {
    /// Takes the curves of the tile.
    ///
    /// # Errors
    /// A fabric of blocks, optics that do not hold, repeats of what does not repeat, or too little
    /// memory.
    pub fn gather(&self) -> Result<UsdFile> {
        self.fabric.whole(self.path, "curves")?;
        let cloth = &self.fabric.cloth;
        let source = cloth.curves(self.level);
        let tile = source.tile();
        let fail = |why: String| InputError::keyed(why).in_file(self.path);
        if !tile.repeats && self.repeats != UVec2::ONE {
            return Err(fail(
                "these curves do not repeat; expected --repeats 1,1".into(),
            ));
        }
        let looks = cloth.materials().iter().enumerate();
        let looks = looks.map(|(n, material)| {
            let table = optics::of_material(&self.fabric.optics, material);
            let fibre = fibre_model::dielectric(&table, material);
            let fibre = fibre.map_err(|why| fail(format!("optics.{}: {why}", material.yarn)))?;
            Ok(Look {
                name: format!("{}_{n}", identifier(&material.yarn)),
                colour: material.colour.unwrap_or(UNDYED).0,
                fibre,
            })
        });
        let looks = looks.collect::<Result<Vec<Look>>>()?;
        let failed = |e: Error| fail(e.to_string());
        let budget = &mut Budget::new(self.max_memory_bytes);
        let mut curves: Vec<Curves> = Vec::new();
        curves.resize_with(looks.len(), Curves::default);
        if let Some(mesh) = self.mesh {
            let bytes = mesh.triangles().len() as u64 * Chart::BYTES_PER_FACE;
            let taken = budget.take(bytes, "charts of the mesh");
            taken.map_err(|e| fail(e.to_string()))?;
        }
        let charts = self.mesh.map(Chart::all);
        let period_mm = tile.repeats.then(|| tile.period_mm());
        let tiles: f64 = period_mm.map_or(1.0, |period| {
            let of = |chart: &Chart| {
                let (low, high) = chart.bounds_mm();
                let tiles = ((high - low) / period).ceil().as_dvec2();
                tiles.x * tiles.y
            };
            charts.iter().flatten().map(of).sum()
        });
        if tiles.is_nan() || tiles > MAX_TILES {
            return Err(fail(format!(
                "the mesh shows {tiles:e} tiles of this cloth; at most {MAX_TILES:e}: lay less cloth \
                 on it, or take a part of it"
            )));
        }
        for_each_curve(&source, |curve| {
            let own = &mut curves[usize::from(curve.material)];
            match &charts {
                Some(charts) => drape(curve, charts, period_mm, budget, own),
                None => {
                    take(budget, curve.points_mm.len())?;
                    own.add(curve.yarn, curve.points_mm.iter().copied());
                    Ok(())
                }
            }
        })
        .map_err(failed)?;
        if curves.iter().all(|c| c.counts.is_empty()) {
            return Err(fail("no curve of the cloth lies on the mesh".into()));
        }
        Ok(UsdFile {
            name: identifier(self.fabric.file.name.as_deref().unwrap_or("cloth")),
            period_mm: tile.period_mm(),
            repeats: self.repeats,
            curves,
            looks,
            are_fibres: self.level == CurveLevel::Fibre,
        })
    }
}

fn take(budget: &mut Budget, points: usize) -> std::io::Result<()> {
    let taken = budget.take(points as u64 * POINT_BYTES, "curves");
    taken.map_err(std::io::Error::other)
}

/// A curve of the tile wherever it lies on the charts of a mesh, in pieces where their borders cut
/// it; once where the tile does not repeat.
fn drape(
    curve: &SourceCurve<'_>,
    charts: &[Chart],
    period_mm: Option<Vec2>,
    budget: &mut Budget,
    out: &mut Curves,
) -> std::io::Result<()> {
    let points = || curve.points_mm.iter().map(|(p, _)| p.truncate());
    let low = points().fold(Vec2::INFINITY, Vec2::min);
    let high = points().fold(Vec2::NEG_INFINITY, Vec2::max);
    for chart in charts {
        let (least, greatest) = chart.bounds_mm();
        let (first, last) = match period_mm {
            Some(period) => (
                ((least - high) / period).ceil().as_ivec2(),
                ((greatest - low) / period).floor().as_ivec2(),
            ),
            None => (IVec2::ZERO, IVec2::ZERO),
        };
        let tiles = (first.y..=last.y).flat_map(|y| (first.x..=last.x).map(move |x| (x, y)));
        for (x, y) in tiles {
            let shift = period_mm.unwrap_or_default().as_dvec2() * DVec2::new(x.into(), y.into());
            let (mut face, mut piece) = (0, Vec::new());
            let mut end = |piece: &mut Vec<(Vec3, f32)>| {
                if piece.len() > 1 {
                    take(budget, piece.len())?;
                    out.add(curve.yarn, piece.iter().copied());
                }
                piece.clear();
                Ok::<_, std::io::Error>(())
            };
            for (point, radius) in curve.points_mm {
                let place = point.as_dvec3() + shift.extend(0.0);
                match chart.lift_mm(place, &mut face) {
                    Some(lifted) => piece.push((lifted.as_vec3(), *radius)),
                    None => end(&mut piece)?,
                }
            }
            end(&mut piece)?;
        }
    }
    Ok(())
}

impl UsdFile {
    /// Curves and points of the tile, or of the cloth on a mesh.
    pub fn counts(&self) -> Written {
        Written {
            curves: self.curves.iter().map(|c| c.counts.len()).sum(),
            points: self.curves.iter().map(|c| c.points_mm.len()).sum(),
        }
    }

    /// Writes the text. Lengths are millimetres, z is up.
    ///
    /// # Errors
    /// The sink fails.
    pub fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let name = &self.name;
        write!(
            out,
            "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    metersPerUnit = 0.001\n    upAxis = \"Z\"\n)\n\n\
             def Xform \"{name}\" (\n    kind = \"component\"\n)\n{{\n"
        )?;
        let [nx, ny] = self.repeats.to_array();
        let is_one = self.repeats == UVec2::ONE;
        if !is_one {
            write!(
                out,
                "    def PointInstancer \"Tiles\"\n    {{\n\
                 \x20       rel prototypes = </{name}/Tiles/Tile>\n"
            )?;
            let tiles = (0..ny).flat_map(|y| (0..nx).map(move |x| UVec2::new(x, y)));
            let places = tiles.clone().map(|at| at.as_vec2() * self.period_mm);
            let zeros = tiles.map(|_| "0".to_string());
            array(out, 2, "int[] protoIndices", zeros, None)?;
            array(
                out,
                2,
                "point3f[] positions",
                places.map(|p| tuple(p.extend(0.0))),
                None,
            )?;
        }
        writeln!(out, "        def Xform \"Tile\"\n        {{")?;
        for (curves, look) in self.curves.iter().zip(&self.looks) {
            if !curves.counts.is_empty() {
                self.basis_curves(out, curves, look)?;
            }
        }
        let end_of_tiles = if is_one { "" } else { "    }\n" };
        writeln!(
            out,
            "        }}\n{end_of_tiles}\n    def Scope \"Materials\"\n    {{"
        )?;
        for look in &self.looks {
            self.material(out, look)?;
        }
        writeln!(out, "    }}\n}}")
    }

    fn basis_curves(
        &self,
        out: &mut dyn Write,
        curves: &Curves,
        look: &Look,
    ) -> std::io::Result<()> {
        let (name, own) = (&self.name, &look.name);
        writeln!(
            out,
            "            def BasisCurves \"{own}\" (\n                prepend apiSchemas = \
             [\"MaterialBindingAPI\"]\n            )\n            {{\n                \
             uniform token type = \"linear\"\n                \
             rel material:binding = </{name}/Materials/{own}>"
        )?;
        let widest = curves.radii_mm.iter().copied().fold(0.0, f32::max);
        let fold = |f: fn(Vec3, Vec3) -> Vec3| curves.points_mm.iter().copied().reduce(f);
        let (low, high) = (fold(Vec3::min), fold(Vec3::max));
        let ends = [low.map(|p| p - widest), high.map(|p| p + widest)];
        array(
            out,
            4,
            "float3[] extent",
            ends.into_iter().flatten().map(tuple),
            None,
        )?;
        array(
            out,
            4,
            "int[] curveVertexCounts",
            curves.counts.iter().map(u32::to_string),
            None,
        )?;
        array(
            out,
            4,
            "point3f[] points",
            curves.points_mm.iter().copied().map(tuple),
            None,
        )?;
        let same = curves.radii_mm.iter().all(|r| *r == widest);
        let shown = if same { 1 } else { curves.radii_mm.len() };
        let widths = curves.radii_mm[..shown].iter();
        let how = Some(if same { "constant" } else { "vertex" });
        array(
            out,
            4,
            "float[] widths",
            widths.map(|r| number(2.0 * r)),
            how,
        )?;
        let colour = std::iter::once(tuple(look.colour));
        array(
            out,
            4,
            "color3f[] primvars:displayColor",
            colour,
            Some("constant"),
        )?;
        array(
            out,
            4,
            "int[] primvars:yarn",
            curves.yarns.iter().map(u32::to_string),
            Some("uniform"),
        )?;
        writeln!(out, "            }}")
    }

    fn material(&self, out: &mut dyn Write, look: &Look) -> std::io::Result<()> {
        let path = format!("/{}/Materials/{}", self.name, look.name);
        let indent = " ".repeat(12);
        writeln!(out, "        def Material \"{}\"\n        {{", look.name)?;
        writeln!(
            out,
            "{indent}token outputs:surface.connect = <{path}/Preview.outputs:surface>"
        )?;
        let fibre = look.fibre.filter(|_| self.are_fibres);
        if fibre.is_some() {
            writeln!(
                out,
                "{indent}token outputs:mtlx:surface.connect = <{path}/Surface.outputs:out>"
            )?;
        }
        shader(
            out,
            "Preview",
            "UsdPreviewSurface",
            &[
                format!("color3f inputs:diffuseColor = {}", tuple(look.colour)),
                "float inputs:roughness = 0.6".into(),
                "token outputs:surface".into(),
            ],
        )?;
        if let Some(fibre) = fibre {
            let widths = |factor: f32| {
                let variance = (factor * fibre.longitudinal_rad).powi(2);
                // A logistic distribution of this scale has the deviation of the Gaussian.
                let scale = fibre.azimuthal_rad * 3f32.sqrt() / PI;
                format!("({variance}, {scale})")
            };
            let [r, g, b] = fibre.absorption_radii.0.to_array();
            shader(
                out,
                "Fibre",
                "ND_chiang_hair_bsdf",
                &[
                    format!("float inputs:ior = {}", fibre.ior),
                    format!("float2 inputs:roughness_R = {}", widths(1.0)),
                    format!("float2 inputs:roughness_TT = {}", widths(0.5)),
                    format!("float2 inputs:roughness_TRT = {}", widths(2.0)),
                    // The middle of its range: scales that do not tilt.
                    "float inputs:cuticle_angle = 0.5".into(),
                    format!("float3 inputs:absorption_coefficient = ({r}, {g}, {b})"),
                    "token outputs:out".into(),
                ],
            )?;
            shader(
                out,
                "Surface",
                "ND_surface",
                &[
                    format!("token inputs:bsdf.connect = <{path}/Fibre.outputs:out>"),
                    "token outputs:out".into(),
                ],
            )?;
        }
        writeln!(out, "        }}")
    }
}

fn shader(out: &mut dyn Write, name: &str, id: &str, lines: &[String]) -> std::io::Result<()> {
    let indent = " ".repeat(16);
    writeln!(
        out,
        "            def Shader \"{name}\"\n            {{\n{indent}uniform token info:id = \"{id}\""
    )?;
    for line in lines {
        writeln!(out, "{indent}{line}")?;
    }
    writeln!(out, "            }}")
}

/// An attribute of many values, some to a line, and how they are spread over a curve.
fn array(
    out: &mut dyn Write,
    depth: usize,
    name: &str,
    values: impl Iterator<Item = String>,
    interpolation: Option<&str>,
) -> std::io::Result<()> {
    let indent = " ".repeat(4 * depth);
    write!(out, "{indent}{name} = [")?;
    for (n, value) in values.enumerate() {
        let between = match n {
            0 => "",
            n if n % OF_A_LINE == 0 => ",\n",
            _ => ", ",
        };
        write!(out, "{between}{value}")?;
    }
    match interpolation {
        Some(how) => writeln!(out, "] (\n{indent}    interpolation = \"{how}\"\n{indent})"),
        None => writeln!(out, "]"),
    }
}

/// Hundred-thousandths: 10 nanometres of millimetres.
fn number(x: f32) -> String {
    let text = format!("{x:.5}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

fn tuple(v: Vec3) -> String {
    format!("({}, {}, {})", number(v.x), number(v.y), number(v.z))
}

/// A name that USD takes.
fn identifier(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let plain: String = name
        .chars()
        .map(|c| if is_plain(c) { c } else { '_' })
        .collect();
    match plain.starts_with(|c: char| c.is_ascii_digit()) || plain.is_empty() {
        true => format!("_{plain}"),
        false => plain,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric_file;
    use crate::loader::Loader;

    fn text(repeats: UVec2, level: CurveLevel) -> (String, Written) {
        let path = Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../scenes/fabrics/organza.toml"
        ));
        let curves = UsdCurves {
            fabric: &fabric_file::load(path, &[], &Loader::new()).unwrap(),
            path,
            level,
            repeats,
            mesh: None,
            max_memory_bytes: 1 << 30,
        };
        let file = curves.gather().unwrap();
        let mut out = Vec::new();
        file.write(&mut out).unwrap();
        (String::from_utf8(out).unwrap(), file.counts())
    }

    /// The numbers of all attributes of a name, which are separated by commas.
    fn count(text: &str, name: &str) -> usize {
        let start = format!("{name} = [");
        let parts = text.split(start.as_str()).skip(1);
        let of = |part: &str| part[..part.find(']').unwrap()].matches(',').count() + 1;
        parts.map(of).sum()
    }

    #[test]
    fn curves_and_instances_are_counted() {
        let (text, written) = text(UVec2::new(3, 2), CurveLevel::Fibre);
        assert_eq!(count(&text, "protoIndices"), 6);
        assert_eq!(count(&text, "curveVertexCounts"), written.curves);
        // Three numbers each.
        assert_eq!(count(&text, "point3f[] points"), 3 * written.points);
        assert!(text.contains("ND_chiang_hair_bsdf"));
        assert_eq!(text.matches('{').count(), text.matches('}').count());
        let (yarns, fewer) = self::text(UVec2::ONE, CurveLevel::Yarn);
        assert!(fewer.curves < written.curves && !yarns.contains("hair"));
    }

    /// Yarns on a wall: as long as in flat cloth of the same size, and where the wall is.
    #[test]
    fn curves_lie_on_a_mesh() {
        let path = Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../scenes/fabrics/organza.toml"
        ));
        let fabric = fabric_file::load(path, &[], &Loader::new()).unwrap();
        // Whole tiles.
        let Vec2 { x, y } = 2.0 * fabric.cloth.curves(CurveLevel::Yarn).tile().period_mm();
        let end = 50.0 + x;
        let wall = format!(
            "v 50 0 0\nv {end} 0 0\nv {end} 0 {y}\nv 50 0 {y}\nvt 0 0\nvt {x} 0\nvt {x} {y}\nvt 0 {y}\n\
             f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
        );
        let placement = organza_mesh::Placement {
            mm_per_unit: 1.0,
            mm_per_uv: 1.0,
        };
        let budget = &mut Budget::new(1 << 20);
        let mesh = organza_mesh::read_obj(wall.as_bytes(), placement, budget).unwrap();
        let curves = |mesh, max_memory_bytes| UsdCurves {
            fabric: &fabric,
            path,
            level: CurveLevel::Yarn,
            repeats: UVec2::ONE,
            mesh,
            max_memory_bytes,
        };
        let length = |file: &UsdFile| -> f32 {
            let of = |c: &Curves| {
                let mut at = 0;
                let counts = c.counts.iter();
                let pieces = counts.map(|&n| {
                    at += n as usize;
                    let piece = &c.points_mm[at - n as usize..at];
                    piece.windows(2).map(|p| p[0].distance(p[1])).sum::<f32>()
                });
                pieces.sum::<f32>()
            };
            file.curves.iter().map(of).sum()
        };
        let step_mm = |file: &UsdFile| {
            let curves = file.curves.iter().flat_map(|c| {
                let mut at = 0;
                c.counts.iter().flat_map(move |&n| {
                    at += n as usize;
                    c.points_mm[at - n as usize..at].windows(2)
                })
            });
            curves.map(|p| p[0].distance(p[1])).fold(0.0, f32::max)
        };
        let flat = curves(None, 1 << 30).gather().unwrap();
        let hung = curves(Some(&mesh), 1 << 30).gather().unwrap();
        let density = length(&flat) / (flat.period_mm.x * flat.period_mm.y);
        let found = length(&hung) / (x * y);
        // Pieces end at their last points within the wall, up to a step from either border.
        let pieces = hung.counts().curves as f32;
        let step = step_mm(&hung);
        let lost = pieces * 2.0 * step / (x * y);
        let is_near = |found: f32| found <= density * 1.001 && found >= density - lost;
        assert!(is_near(found), "{found} {density}, {lost} lost at most");
        // The twin: one yarn of twelve is missing.
        assert!(!is_near(found * 11.0 / 12.0), "{found} {density} {lost}");
        let box_of = hung.curves.iter().flat_map(|c| &c.points_mm);
        let (low, high) = box_of.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| {
            (l.min(*p), h.max(*p))
        });
        assert!(low.x > 49.99 && high.x < end + 0.01 && low.z > -0.01 && high.z < y + 0.01);
        assert!(low.y > -0.1 && high.y < 0.1, "{low} {high}");
        let placement = organza_mesh::Placement {
            mm_per_uv: 1e6,
            ..placement
        };
        let wide = organza_mesh::read_obj(wall.as_bytes(), placement, budget).unwrap();
        let Err(why) = curves(Some(&wide), 1 << 30).gather() else {
            panic!("a square kilometre and more was laid out");
        };
        assert!(why.to_string().contains("at most 1e6"), "{why}");
        let Err(why) = curves(Some(&mesh), 1000).gather() else {
            panic!("1000 bytes are enough");
        };
        assert!(why.to_string().contains("1000 bytes are allowed"), "{why}");
    }

    #[test]
    fn names_are_what_usd_takes() {
        assert_eq!(identifier("cotton 20/2"), "cotton_20_2");
        assert_eq!(identifier("2-ply"), "_2_ply");
        assert_eq!(identifier(""), "_");
    }
}
