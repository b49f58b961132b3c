//! Draws a fabric at yarn, ply and fibre level, from the top.
//!
//! `cargo run --release -p organza-weave --example draw_cloth -- FABRIC.toml OUT`
//! writes `OUT.yarn.png`, `OUT.ply.png` and `OUT.fibre.png`.
//! Files named in the fabric are looked for beside it.

use organza_weave::{Cloth, CurveLevel, FabricGeometry, Picture};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, fabric, out] = args.as_slice() else {
        return Err("expected FABRIC.toml OUT".into());
    };
    let folder = Path::new(fabric).parent().unwrap_or(Path::new("."));
    let geometry: FabricGeometry = toml::from_str(&std::fs::read_to_string(fabric)?)?;
    let load = |name: &str| std::fs::read(folder.join(name));
    let cloth = Cloth::build(&geometry, &load, 1)?;
    for (level, name) in [
        (CurveLevel::Yarn, "yarn"),
        (CurveLevel::Ply, "ply"),
        (CurveLevel::Fibre, "fibre"),
    ] {
        let drawn = cloth.picture(level, cloth.default_picture_mm());
        save(drawn, &format!("{out}.{name}.png"))?;
    }
    Ok(())
}

fn save(p: Picture, path: &str) -> Result<(), Box<dyn std::error::Error>> {
    let image = image::RgbImage::from_raw(p.width, p.height, p.rgb).ok_or("an empty picture")?;
    Ok(image.save(path)?)
}
