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
                Source::Output(output) => ("output", *output),
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
    /// An output of the graph of textures.
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
            doc.empty(
                "input",
                &[("name", wrap), ("type", "string"), ("value", "periodic")],
            )?;
        }
        doc.close("image")?;
    }
    // The direction across the fibres: tangent and bitangent turned by the angle of the map.
    let map = |name: &'static str| Source::Node(name);
    doc.node(
        "multiply",
        ("turned_deg", "float"),
        &[
            ("in1", "float", map("rotation")),
            ("in2", "float", scalar(180.0)),
        ],
    )?;
    doc.node(
        "subtract",
        ("angle_deg", "float"),
        &[
            ("in1", "float", map("turned_deg")),
            ("in2", "float", scalar(45.0)),
        ],
    )?;
    doc.node(
        "multiply",
        ("angle_rad", "float"),
        &[
            ("in1", "float", map("angle_deg")),
            ("in2", "float", Source::Value("0.0174532925".into())),
        ],
    )?;
    for (function, name, along, axis) in [
        ("cos", "cosine", "along_tangent", "tangent"),
        ("sin", "sine", "along_bitangent", "bitangent"),
    ] {
        doc.node(
            function,
            (name, "float"),
            &[("in", "float", map("angle_rad"))],
        )?;
        let space = [("space", "string", Source::Value("world".into()))];
        let axis_name = format!("world_{axis}");
        doc.node(axis, (&axis_name, "vector3"), &space)?;
        doc.node(
            "multiply",
            (along, "vector3"),
            &[
                ("in1", "vector3", Source::Node(&axis_name)),
                ("in2", "float", Source::Node(name)),
            ],
        )?;
    }
    doc.node(
        "add",
        ("across", "vector3"),
        &[
            ("in1", "vector3", map("along_tangent")),
            ("in2", "vector3", map("along_bitangent")),
        ],
    )?;
    doc.node(
        "normalize",
        ("across_unit", "vector3"),
        &[("in", "vector3", map("across"))],
    )?;
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
    for (name, kind) in OUTPUTS {
        let node = name.strip_prefix("out_").unwrap_or(name);
        doc.empty(
            "output",
            &[("name", name), ("type", kind), ("nodename", node)],
        )?;
    }
    doc.close("nodegraph")
}

/// Textures times the constants of each material.
fn write_scaled(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let own = baked.openpbr;
    for (suffix, p) in [("openpbr", own), ("standard", baked.standard_surface)] {
        let factors = [
            ("base_color", "base_color", "color3", triple(p.reflectance)),
            (
                "roughness",
                "roughness",
                "float",
                scalar(ratio(p.roughness, own.roughness)),
            ),
            ("anisotropy", "anisotropy", "float", scalar(p.anisotropy)),
            (
                "transmission",
                "transmission",
                "float",
                scalar(p.transmittance),
            ),
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
    doc.node(
        "convert",
        ("opacity_color", "color3"),
        &[("in", "float", Source::Node("opacity"))],
    )
}

/// Outputs of the graph: `out_` and the node that they show.
const OUTPUTS: [(&str, &str); 18] = [
    ("out_opacity", "float"),
    ("out_opacity_color", "color3"),
    ("out_across_unit", "vector3"),
    ("out_sheen", "color3"),
    ("out_specular", "float"),
    ("out_normal_openpbr", "vector3"),
    ("out_base_color_openpbr", "color3"),
    ("out_roughness_openpbr", "float"),
    ("out_anisotropy_openpbr", "float"),
    ("out_transmission_openpbr", "float"),
    ("out_forward_openpbr", "float"),
    ("out_transmission_color", "color3"),
    ("out_normal_standard", "vector3"),
    ("out_base_color_standard", "color3"),
    ("out_roughness_standard", "float"),
    ("out_anisotropy_standard", "float"),
    ("out_transmission_standard", "float"),
    ("out_forward_standard", "float"),
];

fn write_openpbr(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let p = baked.openpbr;
    let shader = format!("{}_openpbr_shader", baked.name);
    let inputs = [
        (
            "base_color",
            "color3",
            Source::Output("out_base_color_openpbr"),
        ),
        ("specular_weight", "float", Source::Output("out_specular")),
        ("specular_ior", "float", scalar(p.ior)),
        (
            "specular_roughness",
            "float",
            Source::Output("out_roughness_openpbr"),
        ),
        (
            "specular_roughness_anisotropy",
            "float",
            Source::Output("out_anisotropy_openpbr"),
        ),
        (
            "transmission_weight",
            "float",
            Source::Output("out_forward_openpbr"),
        ),
        (
            "transmission_color",
            "color3",
            Source::Output("out_transmission_color"),
        ),
        (
            "subsurface_weight",
            "float",
            Source::Output("out_transmission_openpbr"),
        ),
        (
            "subsurface_color",
            "color3",
            Source::Output("out_transmission_color"),
        ),
        ("subsurface_scatter_anisotropy", "float", scalar(1.0)),
        ("fuzz_weight", "float", scalar(p.sheen)),
        ("fuzz_color", "color3", Source::Output("out_sheen")),
        ("fuzz_roughness", "float", scalar(p.sheen_roughness)),
        ("geometry_opacity", "float", Source::Output("out_opacity")),
        (
            "geometry_thin_walled",
            "boolean",
            Source::Value("true".into()),
        ),
        (
            "geometry_normal",
            "vector3",
            Source::Output("out_normal_openpbr"),
        ),
        (
            "geometry_tangent",
            "vector3",
            Source::Output("out_across_unit"),
        ),
    ];
    doc.node("open_pbr_surface", (&shader, "surfaceshader"), &inputs)?;
    write_material(doc, &format!("{}_openpbr", baked.name), &shader)
}

fn write_standard_surface(doc: &mut Document, baked: &Baked<'_>) -> Result<(), WriteError> {
    let p = baked.standard_surface;
    let shader = format!("{}_standard_surface_shader", baked.name);
    let inputs = [
        ("base", "float", scalar(1.0)),
        (
            "base_color",
            "color3",
            Source::Output("out_base_color_standard"),
        ),
        ("specular", "float", Source::Output("out_specular")),
        ("specular_color", "color3", triple([1.0; 3])),
        ("specular_IOR", "float", scalar(p.ior)),
        (
            "specular_roughness",
            "float",
            Source::Output("out_roughness_standard"),
        ),
        (
            "specular_anisotropy",
            "float",
            Source::Output("out_anisotropy_standard"),
        ),
        (
            "transmission",
            "float",
            Source::Output("out_forward_standard"),
        ),
        (
            "transmission_color",
            "color3",
            Source::Output("out_transmission_color"),
        ),
        (
            "subsurface",
            "float",
            Source::Output("out_transmission_standard"),
        ),
        (
            "subsurface_color",
            "color3",
            Source::Output("out_transmission_color"),
        ),
        ("sheen", "float", scalar(p.sheen)),
        ("sheen_color", "color3", Source::Output("out_sheen")),
        ("sheen_roughness", "float", scalar(p.sheen_roughness)),
        ("opacity", "color3", Source::Output("out_opacity_color")),
        ("thin_walled", "boolean", Source::Value("true".into())),
        ("normal", "vector3", Source::Output("out_normal_standard")),
        ("tangent", "vector3", Source::Output("out_across_unit")),
    ];
    doc.node("standard_surface", (&shader, "surfaceshader"), &inputs)?;
    write_material(doc, &format!("{}_standard_surface", baked.name), &shader)
}

fn write_material(doc: &mut Document, name: &str, shader: &str) -> Result<(), WriteError> {
    let inputs = [("surfaceshader", "surfaceshader", Source::Node(shader))];
    doc.node("surfacematerial", (name, "material"), &inputs)
}
