//! A MaterialX document [Smythe2024] with an OpenPBR and a standard_surface material of each
//! colourway, which share a graph of textures.

use super::{Baked, WriteError, number, ratio};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesStart, Event};
use std::io::Cursor;

/// A document that is written element by element.
struct Document {
    writer: Writer<Cursor<Vec<u8>>>,
    /// Name of the graph of textures that outputs belong to.
    graph: String,
}

type Attributes<'a> = &'a [(&'a str, &'a str)];

fn failed(e: impl std::fmt::Display) -> WriteError {
    WriteError::Text(e.to_string())
}

fn element<'a>(tag: &'a str, attributes: Attributes<'a>) -> BytesStart<'a> {
    let mut start = BytesStart::new(tag);
    attributes.iter().for_each(|a| start.push_attribute(*a));
    start
}

impl Document {
    fn open(&mut self, tag: &str, attributes: Attributes<'_>) -> Result<(), WriteError> {
        let start = element(tag, attributes);
        self.writer.write_event(Event::Start(start)).map_err(failed)
    }

    fn close(&mut self, tag: &str) -> Result<(), WriteError> {
        let end = BytesStart::new(tag);
        self.writer
            .write_event(Event::End(end.to_end()))
            .map_err(failed)
    }

    fn empty(&mut self, tag: &str, attributes: Attributes<'_>) -> Result<(), WriteError> {
        let start = element(tag, attributes);
        self.writer.write_event(Event::Empty(start)).map_err(failed)
    }

    /// A node and its inputs: name, type, and what it is connected to or its value.
    fn node(
        &mut self,
        category: &str,
        (name, kind): (&str, &str),
        inputs: &[(&str, &str, Source<'_>)],
    ) -> Result<(), WriteError> {
        self.open(category, &[("name", name), ("type", kind)])?;
        let graph = self.graph.clone();
        for (name, kind, source) in inputs {
            let common = [("name", *name), ("type", *kind)];
            let (key, value) = match source {
                Source::Value(value) => ("value", value.as_str()),
                Source::Node(node) => ("nodename", *node),
                Source::Output(node) => ("output", &*format!("out_{node}")),
            };
            let mut attributes = common.to_vec();
            if let Source::Output(_) = source {
                attributes.push(("nodegraph", &graph));
            }
            attributes.push((key, value));
            self.empty("input", &attributes)?;
        }
        self.close(category)
    }
}

/// What an input is.
enum Source<'a> {
    /// A constant.
    Value(String),
    /// A node of the same graph.
    Node(&'a str),
    /// The output of the graph of textures that shows this node.
    Output(&'a str),
}

/// The textures: node, type, file, and the colour space of those that hold colour.
const IMAGES: [(&str, &str, &str, bool); 10] = [
    ("base_color", "color3", "base_color.png", true),
    ("opacity", "float", "opacity.png", false),
    ("normal_map", "vector3", "normal.png", false),
    ("roughness", "float", "roughness.png", false),
    ("anisotropy", "float", "anisotropy.png", false),
    ("rotation", "float", "anisotropy_rotation.png", false),
    ("sheen", "color3", "sheen.png", true),
    ("transmission", "float", "diffuse_transmission.png", false),
    (
        "transmission_color",
        "color3",
        "diffuse_transmission_color.png",
        true,
    ),
    ("specular", "float", "specular.png", false),
];

fn scalar(x: f64) -> Source<'static> {
    Source::Value(number(x))
}

fn triple(v: [f64; 3]) -> Source<'static> {
    Source::Value(v.map(number).join(", "))
}

/// The whole document.
///
/// # Errors
/// The text cannot be made; this is not expected.
pub fn write_materialx(colourways: &[Baked<'_>]) -> Result<String, WriteError> {
    let mut doc = Document {
        writer: Writer::new_with_indent(Cursor::new(Vec::new()), b' ', 2),
        graph: String::new(),
    };
    let declaration = Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None));
    doc.writer.write_event(declaration).map_err(failed)?;
    let head = [("version", "1.39"), ("colorspace", "lin_rec709")];
    doc.open("materialx", &head)?;
    for baked in colourways {
        doc.graph = format!("{}_textures", baked.name);
        write_graph(&mut doc, baked)?;
        write_openpbr(&mut doc, baked)?;
        write_standard_surface(&mut doc, baked)?;
    }
    doc.close("materialx")?;
    let bytes = doc.writer.into_inner().into_inner();
    let text = String::from_utf8(bytes).map_err(failed)?;
    Ok(text + "\n")
}

fn write_graph(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let graph = doc.graph.clone();
    doc.open("nodegraph", &[("name", &graph)])?;
    for (name, kind, file, is_colour) in IMAGES {
        doc.open("image", &[("name", name), ("type", kind)])?;
        let path = format!("{}/{file}", baked.folder);
        let mut attributes = vec![("name", "file"), ("type", "filename"), ("value", &path)];
        if is_colour {
            attributes.push(("colorspace", "srgb_texture"));
        }
        doc.empty("input", &attributes)?;
        for wrap in ["uaddressmode", "vaddressmode"] {
            let attributes = [("name", wrap), ("type", "string"), ("value", "periodic")];
            doc.empty("input", &attributes)?;
        }
        doc.close("image")?;
    }
    // The direction across the fibres: tangent and bitangent turned by the angle of the map.
    let map = Source::Node;
    for (operation, result, from, by) in [
        ("multiply", "turned_deg", "rotation", scalar(180.0)),
        ("subtract", "angle_deg", "turned_deg", scalar(45.0)),
        (
            "multiply",
            "angle_rad",
            "angle_deg",
            Source::Value("0.0174532925".into()),
        ),
    ] {
        let inputs = [("in1", "float", map(from)), ("in2", "float", by)];
        doc.node(operation, (result, "float"), &inputs)?;
    }
    for (function, name, along, axis) in [
        ("cos", "cosine", "along_tangent", "tangent"),
        ("sin", "sine", "along_bitangent", "bitangent"),
    ] {
        let angle = [("in", "float", map("angle_rad"))];
        doc.node(function, (name, "float"), &angle)?;
        let space = [("space", "string", Source::Value("world".into()))];
        let axis_name = format!("world_{axis}");
        doc.node(axis, (&axis_name, "vector3"), &space)?;
        let factors = [
            ("in1", "vector3", Source::Node(&axis_name)),
            ("in2", "float", Source::Node(name)),
        ];
        doc.node("multiply", (along, "vector3"), &factors)?;
    }
    let terms = [
        ("in1", "vector3", map("along_tangent")),
        ("in2", "vector3", map("along_bitangent")),
    ];
    doc.node("add", ("across", "vector3"), &terms)?;
    let sum = [("in", "vector3", map("across"))];
    doc.node("normalize", ("across_unit", "vector3"), &sum)?;
    let reliefs = [
        ("normal_openpbr", baked.openpbr.relief),
        ("normal_standard", baked.standard_surface.relief),
    ];
    for (name, relief) in reliefs {
        let inputs = [
            ("in", "vector3", map("normal_map")),
            ("scale", "float", scalar(relief)),
        ];
        doc.node("normalmap", (name, "vector3"), &inputs)?;
    }
    write_scaled(doc, baked)?;
    for (node, kind) in OUTPUTS {
        let name = format!("out_{node}");
        let attributes = [("name", &*name), ("type", kind), ("nodename", node)];
        doc.empty("output", &attributes)?;
    }
    doc.close("nodegraph")
}

/// Textures times the constants of each material.
fn write_scaled(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let own = baked.openpbr;
    for (suffix, p) in [("openpbr", own), ("standard", baked.standard_surface)] {
        let roughness = scalar(ratio(p.roughness, own.roughness));
        let transmission = scalar(p.transmittance);
        let factors = [
            ("base_color", "base_color", "color3", triple(p.reflectance)),
            ("roughness", "roughness", "float", roughness),
            ("anisotropy", "anisotropy", "float", scalar(p.anisotropy)),
            ("transmission", "transmission", "float", transmission),
            ("forward", "transmission", "float", scalar(p.forward)),
        ];
        for (result, map, kind, factor) in factors {
            let product = format!("{result}_times_{suffix}");
            let inputs = [("in1", kind, Source::Node(map)), ("in2", kind, factor)];
            doc.node("multiply", (&product, kind), &inputs)?;
            let name = format!("{result}_{suffix}");
            let inputs = [("in", kind, Source::Node(product.as_str()))];
            doc.node("clamp", (&name, kind), &inputs)?;
        }
    }
    let opacity = [("in", "float", Source::Node("opacity"))];
    doc.node("convert", ("opacity_color", "color3"), &opacity)
}

/// Nodes that the graph shows, each as the output of its name with `out_` before it.
const OUTPUTS: [(&str, &str); 18] = [
    ("opacity", "float"),
    ("opacity_color", "color3"),
    ("across_unit", "vector3"),
    ("sheen", "color3"),
    ("specular", "float"),
    ("normal_openpbr", "vector3"),
    ("base_color_openpbr", "color3"),
    ("roughness_openpbr", "float"),
    ("anisotropy_openpbr", "float"),
    ("transmission_openpbr", "float"),
    ("forward_openpbr", "float"),
    ("transmission_color", "color3"),
    ("normal_standard", "vector3"),
    ("base_color_standard", "color3"),
    ("roughness_standard", "float"),
    ("anisotropy_standard", "float"),
    ("transmission_standard", "float"),
    ("forward_standard", "float"),
];

fn write_openpbr(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let p = baked.openpbr;
    let shader = format!("{}_openpbr_shader", baked.name);
    let out = Source::Output;
    let inputs = [
        ("base_color", "color3", out("base_color_openpbr")),
        ("specular_weight", "float", out("specular")),
        ("specular_ior", "float", scalar(p.ior)),
        ("specular_roughness", "float", out("roughness_openpbr")),
        (
            "specular_roughness_anisotropy",
            "float",
            out("anisotropy_openpbr"),
        ),
        ("transmission_weight", "float", out("forward_openpbr")),
        ("transmission_color", "color3", out("transmission_color")),
        ("subsurface_weight", "float", out("transmission_openpbr")),
        ("subsurface_color", "color3", out("transmission_color")),
        ("subsurface_scatter_anisotropy", "float", scalar(1.0)),
        ("fuzz_weight", "float", scalar(p.sheen)),
        ("fuzz_color", "color3", out("sheen")),
        ("fuzz_roughness", "float", scalar(p.sheen_roughness)),
        ("geometry_opacity", "float", out("opacity")),
        (
            "geometry_thin_walled",
            "boolean",
            Source::Value("true".into()),
        ),
        ("geometry_normal", "vector3", out("normal_openpbr")),
        ("geometry_tangent", "vector3", out("across_unit")),
    ];
    doc.node("open_pbr_surface", (&shader, "surfaceshader"), &inputs)?;
    write_material(doc, &format!("{}_openpbr", baked.name), &shader)
}

fn write_standard_surface(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let p = baked.standard_surface;
    let shader = format!("{}_standard_surface_shader", baked.name);
    let out = Source::Output;
    let inputs = [
        ("base", "float", scalar(1.0)),
        ("base_color", "color3", out("base_color_standard")),
        ("specular", "float", out("specular")),
        ("specular_color", "color3", triple([1.0; 3])),
        ("specular_IOR", "float", scalar(p.ior)),
        ("specular_roughness", "float", out("roughness_standard")),
        ("specular_anisotropy", "float", out("anisotropy_standard")),
        ("transmission", "float", out("forward_standard")),
        ("transmission_color", "color3", out("transmission_color")),
        ("subsurface", "float", out("transmission_standard")),
        ("subsurface_color", "color3", out("transmission_color")),
        ("sheen", "float", scalar(p.sheen)),
        ("sheen_color", "color3", out("sheen")),
        ("sheen_roughness", "float", scalar(p.sheen_roughness)),
        ("opacity", "color3", out("opacity_color")),
        ("thin_walled", "boolean", Source::Value("true".into())),
        ("normal", "vector3", out("normal_standard")),
        ("tangent", "vector3", out("across_unit")),
    ];
    doc.node("standard_surface", (&shader, "surfaceshader"), &inputs)?;
    write_material(doc, &format!("{}_standard_surface", baked.name), &shader)
}

fn write_material(doc: &mut Document, name: &str, shader: &str) -> Result<(), WriteError> {
    let inputs = [("surfaceshader", "surfaceshader", Source::Node(shader))];
    doc.node("surfacematerial", (name, "material"), &inputs)
}
