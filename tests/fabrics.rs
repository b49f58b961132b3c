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
