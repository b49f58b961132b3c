//! USD text with a square of cloth and a UsdPreviewSurface material [Pixar2024].

use super::{Baked, FOLDER, PATCH_MM, number, ratio};

/// One texture of the material.
struct Texture<'a> {
    name: &'a str,
    file: &'a str,
    space: &'a str,
    scale: [f64; 4],
    bias: [f64; 4],
    output: &'a str,
    kind: &'a str,
}

/// The whole file. Lengths are millimetres.
pub fn write_usda(baked: &Baked<'_>) -> String {
    let (p, own, maps) = (baked.usd_preview, baked.openpbr, baked.maps);
    let (low, high) = maps.height_range_mm();
    let half = f64::from(0.5 * PATCH_MM);
    let repeats = PATCH_MM / maps.tile_mm;
    let (u, v) = (number(repeats.x.into()), number(repeats.y.into()));
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
    let textures = [
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
    ];
    let name = baked.name;
    let path = format!("/{name}/Material");
    let connect = |texture: &str, output: &str| format!("<{path}/{texture}.outputs:{output}>");
    let mut text = format!(
        r#"#usda 1.0
(
    defaultPrim = "{name}"
    doc = "Cloth baked by organza: a square of {side} mm"
    metersPerUnit = 0.001
    upAxis = "Z"
)

def Xform "{name}" (
    kind = "component"
)
{{
    def Mesh "Patch" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        uniform bool doubleSided = 1
        float3[] extent = [({low_corner}, {low_corner}, 0), ({corner}, {corner}, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        rel material:binding = <{path}>
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)] (
            interpolation = "vertex"
        )
        point3f[] points = [({low_corner}, {low_corner}, 0), ({corner}, {low_corner}, 0), ({corner}, {corner}, 0), ({low_corner}, {corner}, 0)]
        texCoord2f[] primvars:st = [(0, 0), ({u}, 0), ({u}, {v}), (0, {v})] (
            interpolation = "vertex"
        )
        uniform token subdivisionScheme = "none"
    }}

    def Material "Material"
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
        side = number(PATCH_MM.into()),
        low_corner = number(-half),
        corner = number(half),
        displacement = connect("Surface", "displacement"),
        surface = connect("Surface", "surface"),
        diffuse = connect("baseColor", "rgb"),
        height = connect("height", "r"),
        normal = connect("normal", "rgb"),
        opacity = connect("opacity", "r"),
        roughness = connect("roughness", "r"),
        ior = number(p.ior),
    );
    for t in textures {
        let four = |v: [f64; 4]| v.map(number).join(", ");
        text += &format!(
            r#"
        def Shader "{name}"
        {{
            uniform token info:id = "UsdUVTexture"
            float4 inputs:bias = ({bias})
            asset inputs:file = @./{FOLDER}/{file}@
            float4 inputs:scale = ({scale})
            token inputs:sourceColorSpace = "{space}"
            float2 inputs:st.connect = {st}
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
            {kind} outputs:{output}
        }}
"#,
            name = t.name,
            bias = four(t.bias),
            file = t.file,
            scale = four(t.scale),
            space = t.space,
            st = connect("Coordinates", "result"),
            kind = t.kind,
            output = t.output,
        );
    }
    text + "    }\n}\n"
}
