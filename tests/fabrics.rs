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
