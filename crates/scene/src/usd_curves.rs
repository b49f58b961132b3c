//! Yarns or fibres of a tile as USD curves \[Pixar2024\], with a MaterialX hair material each.
//!
//! The tile is a prototype, of which there are as many instances as asked for. A fibre of
//! organza's is that of [Marschner2003] with lobes whose widths are in the ratio of [Chiang2016],
//! so that the hair material takes the same index, absorption and widths without a fit.

use crate::error::{Result, input};
use crate::fabric_file::Fabric;
use crate::fibre_model;
use crate::optics::{self, UNDYED};
use glam::{UVec2, Vec2, Vec3};
use organza_basis::{Budget, SegmentSource};
use organza_scatter::DielectricParameters;
use organza_weave::curve_file::for_each_curve;
use organza_weave::{CurveLevel, Error};
use std::f32::consts::PI;
use std::io::Write;
use std::path::Path;

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
    /// Tiles along x and y.
    pub repeats: UVec2,
    /// Memory that may be taken.
    pub max_memory_bytes: u64,
}

/// What a file holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Written {
    /// Curves of the tile.
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
        let fail = |why: String| input(format!("{}: {why}", self.path.display()));
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
        let mut points = 0;
        for_each_curve(&source, |curve| {
            points += curve.points_mm.len();
            Ok(())
        })
        .map_err(failed)?;
        let bytes = points as u64 * (size_of::<Vec3>() + 3 * size_of::<u32>()) as u64;
        Budget::new(self.max_memory_bytes)
            .take(bytes, "the curves")
            .map_err(|e| fail(e.to_string()))?;
        let mut curves: Vec<Curves> = Vec::new();
        curves.resize_with(looks.len(), Curves::default);
        for_each_curve(&source, |curve| {
            let own = &mut curves[usize::from(curve.material)];
            own.points_mm
                .extend(curve.points_mm.iter().map(|(p, _)| *p));
            own.radii_mm.extend(curve.points_mm.iter().map(|(_, r)| *r));
            own.counts.push(curve.points_mm.len() as u32);
            own.yarns.push(curve.yarn);
            Ok(())
        })
        .map_err(failed)?;
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

impl UsdFile {
    /// Curves and points of the tile.
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
             def Xform \"{name}\" (\n    kind = \"component\"\n)\n{{\n\
             \x20   def PointInstancer \"Tiles\"\n    {{\n\
             \x20       rel prototypes = </{name}/Tiles/Tile>\n"
        )?;
        let [nx, ny] = self.repeats.to_array();
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
        writeln!(out, "        def Xform \"Tile\"\n        {{")?;
        for (curves, look) in self.curves.iter().zip(&self.looks) {
            if !curves.counts.is_empty() {
                self.basis_curves(out, curves, look)?;
            }
        }
        writeln!(
            out,
            "        }}\n    }}\n\n    def Scope \"Materials\"\n    {{"
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

    #[test]
    fn names_are_what_usd_takes() {
        assert_eq!(identifier("cotton 20/2"), "cotton_20_2");
        assert_eq!(identifier("2-ply"), "_2_ply");
        assert_eq!(identifier(""), "_");
    }
}
