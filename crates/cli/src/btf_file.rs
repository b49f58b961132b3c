//! Spatially varying measurements as multi-part EXR: one part per pair of
//! directions, its angles in its name and in `organza.angles` of the file.

use crate::output;
use anyhow::{Context, Result};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, Text, WritableImage,
};
use organza_measure::{TexelGrid, Texture};
use std::path::Path;

/// Writes textures, values in R, G, B and standard errors in `se.R`, ...
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, textures: &[Texture], grid: &TexelGrid) -> Result<()> {
    let size = (grid.texels.x as usize, grid.texels.y as usize);
    let text = |s: &str| Text::new_or_none(s).unwrap_or_default();
    let mut angles = String::from("part,theta_i,phi_i,theta_o,phi_o\n");
    let mut layers = Vec::with_capacity(textures.len());
    for (number, texture) in textures.iter().enumerate() {
        let (i, o) = (texture.pair.incident, texture.pair.exitant);
        angles += &format!(
            "{number},{},{},{},{}\n",
            i.theta_deg, i.phi_deg, o.theta_deg, o.phi_deg
        );
        let mut list = Vec::new();
        for (prefix, values) in [("", &texture.mean), ("se.", &texture.se)] {
            for (c, letter) in ["R", "G", "B"].into_iter().enumerate() {
                let samples = values.iter().map(|v| v[c]).collect();
                list.push(AnyChannel::new(
                    text(&format!("{prefix}{letter}")),
                    FlatSamples::F32(samples),
                ));
            }
        }
        let name = format!(
            "l{:.2},{:.2} v{:.2},{:.2}",
            i.theta_deg, i.phi_deg, o.theta_deg, o.phi_deg
        );
        layers.push(Layer::new(
            size,
            LayerAttributes::named(text(&name)),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(list.into_iter().collect()),
        ));
    }
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
    let attribute = exr::meta::attribute::AttributeValue::Text(text(&angles));
    attributes.other.insert(text("organza.angles"), attribute);
    let place = format!(
        "low_mm {} {} size_mm {} {}",
        grid.low_mm.x, grid.low_mm.y, grid.size_mm.x, grid.size_mm.y
    );
    let place = exr::meta::attribute::AttributeValue::Text(text(&place));
    attributes.other.insert(text("organza.texels"), place);
    let image = Image::from_layers(attributes, layers);
    output::write_file(path, |out| {
        image
            .write()
            .to_buffered(out)
            .context("writing the pictures failed")
    })
}
