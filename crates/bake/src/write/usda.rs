//! USD text with a square of cloth and a UsdPreviewSurface material [Pixar2024].

use super::{Baked, PATCH_MM, number, ratio};

/// One texture of the material.
struct Texture {
    name: &'static str,
    file: &'static str,
    space: &'static str,
    scale: [f64; 4],
    bias: [f64; 4],
    output: &'static str,
    kind: &'static str,
}

/// The whole file. Lengths are millimetres.
pub fn write_usda(colourways: &[Baked<'_>]) -> String {
    let Some(first) = colourways.first() else {
        return String::new();
    };
    let root = format!("/{}", first.name);
    let mut text = patch(first, colourways);
    for baked in colourways {
        let name = material_name(baked, colourways);
        let path = format!("{root}/{name}");
        text += &surface(baked, &path, name);
        for texture in textures(baked) {
            text += &texture.shader(&path, baked.folder);
        }
        text += "    }\n";
    }
    if colourways.len() > 1 {
        text += "\n    variantSet \"colourway\" = {\n";
        for Baked { name, .. } in colourways {
            text += &format!(
                r#"        "{name}" {{
            over "Patch"
            {{
                rel material:binding = <{root}/{name}>
            }}
        }}
"#
            );
        }
        text += "    }\n";
    }
    text + "}\n"
}

/// The name of a material below the root, which has the name of the first.
fn material_name<'a>(baked: &Baked<'a>, colourways: &[Baked<'_>]) -> &'a str {
    match colourways.len() {
        1 => "Material",
        _ => baked.name,
    }
}

/// The textures that the surface reads.
fn textures(baked: &Baked<'_>) -> [Texture; 5] {
    let (p, own) = (baked.usd_preview, baked.openpbr);
    let (low, high) = baked.maps.height_range_mm();
    let base = p.reflectance;
    let plain = |name, file, output| Texture {
        name,
        file,
        space: "raw",
        scale: [1.0; 4],
        bias: [0.0; 4],
        output,
        kind: "float",
    };
    [
        Texture {
            space: "sRGB",
            scale: [base[0], base[1], base[2], 1.0],
            kind: "float3",
            ..plain("baseColor", "base_color.png", "rgb")
        },
        plain("opacity", "opacity.png", "r"),
        Texture {
            scale: [2.0, 2.0, 2.0, 1.0],
            bias: [-1.0, -1.0, -1.0, 0.0],
            kind: "float3",
            ..plain("normal", "normal_preview.png", "rgb")
        },
        Texture {
            scale: [ratio(p.roughness, own.roughness); 4],
            ..plain("roughness", "roughness.png", "r")
        },
        Texture {
            scale: [f64::from(high - low); 4],
            bias: [f64::from(low); 4],
            ..plain("height", "height.png", "r")
        },
    ]
}

/// An output of a shader of the material of this path.
fn connection(path: &str, shader: &str, output: &str) -> String {
    format!("<{path}/{shader}.outputs:{output}>")
}

/// The head of the file and the square of cloth.
fn patch(baked: &Baked<'_>, colourways: &[Baked<'_>]) -> String {
    let name = baked.name;
    let (variants, binding) = match colourways.len() {
        1 => {
            let binding = format!("        rel material:binding = </{name}/Material>\n");
            (String::new(), binding)
        }
        _ => {
            let chosen = format!(
                "    variants = {{\n        string colourway = \"{name}\"\n    }}\n    prepend \
                 variantSets = \"colourway\"\n"
            );
            (chosen, String::new())
        }
    };
    let half = f64::from(0.5 * PATCH_MM);
    let repeats = PATCH_MM / baked.maps.tile_mm;
    format!(
        r#"#usda 1.0
(
    defaultPrim = "{name}"
    doc = "Cloth baked by organza: a square of {side} mm"
    metersPerUnit = 0.001
    upAxis = "Z"
)

def Xform "{name}" (
    kind = "component"
{variants})
{{
    def Mesh "Patch" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        uniform bool doubleSided = 1
        float3[] extent = [({low_corner}, {low_corner}, 0), ({corner}, {corner}, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
{binding}        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)] (
            interpolation = "vertex"
        )
        point3f[] points = [({low_corner}, {low_corner}, 0), ({corner}, {low_corner}, 0), ({corner}, {corner}, 0), ({low_corner}, {corner}, 0)]
        texCoord2f[] primvars:st = [(0, 0), ({u}, 0), ({u}, {v}), (0, {v})] (
            interpolation = "vertex"
        )
        uniform token subdivisionScheme = "none"
    }}

"#,
        side = number(PATCH_MM.into()),
        low_corner = number(-half),
        corner = number(half),
        u = number(repeats.x.into()),
        v = number(repeats.y.into()),
    )
}

/// The material of this path and name, and its surface; textures follow.
fn surface(baked: &Baked<'_>, path: &str, name: &str) -> String {
    let connect = |shader: &str, output: &str| connection(path, shader, output);
    format!(
        r#"    def Material "{name}"
    {{
        token outputs:displacement.connect = {displacement}
        token outputs:surface.connect = {surface}

        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = {diffuse}
            float inputs:displacement.connect = {height}
            float inputs:ior = {ior}
            float inputs:metallic = 0
            normal3f inputs:normal.connect = {normal}
            float inputs:opacity.connect = {opacity}
            float inputs:opacityThreshold = 0
            float inputs:roughness.connect = {roughness}
            int inputs:useSpecularWorkflow = 0
            token outputs:displacement
            token outputs:surface
        }}

        def Shader "Coordinates"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
"#,
        displacement = connect("Surface", "displacement"),
        surface = connect("Surface", "surface"),
        diffuse = connect("baseColor", "rgb"),
        height = connect("height", "r"),
        normal = connect("normal", "rgb"),
        opacity = connect("opacity", "r"),
        roughness = connect("roughness", "r"),
        ior = number(baked.usd_preview.ior),
    )
}

impl Texture {
    /// The shader that reads it from a folder, in the material of this path.
    fn shader(&self, path: &str, folder: &str) -> String {
        let four = |v: [f64; 4]| v.map(number).join(", ");
        format!(
            r#"
        def Shader "{name}"
        {{
            uniform token info:id = "UsdUVTexture"
            float4 inputs:bias = ({bias})
            asset inputs:file = @./{folder}/{file}@
            float4 inputs:scale = ({scale})
            token inputs:sourceColorSpace = "{space}"
            float2 inputs:st.connect = {st}
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
            {kind} outputs:{output}
        }}
"#,
            name = self.name,
            bias = four(self.bias),
            file = self.file,
            scale = four(self.scale),
            space = self.space,
            st = connection(path, "Coordinates", "result"),
            kind = self.kind,
            output = self.output,
        )
    }
}
