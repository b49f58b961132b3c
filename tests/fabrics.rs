//! Fabrics that tests of several modules weave.

/// A cotton fabric. `yarn` holds the keys of its yarn beside the preset; the warp has 20
/// threads a centimetre, the weft 18.
pub fn cotton(weave: &str, yarn: &str, voxel_um: f32) -> String {
    format!(
        r#"name = "test cloth"
[draft]
weave = "{weave}"
[warp]
yarn = "cotton"
per_cm = 20.0
[weft]
yarn = "cotton"
per_cm = 18.0
[yarn.cotton]
preset = "cotton"
{yarn}
[voxel]
size_um = {voxel_um:.1}
"#
    )
}

/// Few thick fibres: quickly woven, voxelized and traced.
pub fn few_fibres(voxel_um: f32) -> String {
    let yarn = "tex = 30.0\nfibres_per_ply = 6\nfibre_radius_um = 12.0";
    cotton("plain", yarn, voxel_um)
}

/// A sheet whose BSDF is known; in green it absorbs nothing.
pub const SHEET: &str = r#"[surface]
model = "diffuse"
reflectance = [0.4, 0.5, 0.1]
transmittance = [0.2, 0.3, 0.3]
openness = 0.2
"#;

/// A cotton satin with a surface model, in voxels of 16 um.
pub const COTTON_SATIN: &str = r#"
[draft]
weave = "satin-5-2"
[warp]
yarn = "cotton"
per_cm = 24.0
[weft]
yarn = "cotton"
per_cm = 22.0
[yarn.cotton]
preset = "cotton"
tex = 20.0
fibres_per_ply = 60
[voxel]
size_um = 16.0
[surface]
preset = "cotton-twill"
"#;
