//! Pictures of the tile, one for each pair of directions, as multi-part EXR: one part per pair, its
//! angles in its name and in `organza.angles` of the file.

use super::layout::Found;
use super::{Measuring, Values, results};
use anyhow::{Context, Result};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, Text, WritableImage,
};
use glam::UVec2;
use organza_measure::{Pair, TexelGrid, Texture, measure_texture};
use organza_work::output::SeekWrite;
use organza_work::{Results, after_option};
use serde_json::{Value, json};

/// Ending of the files.
pub const ENDING: &str = "exr";

/// Measures a picture for each pair.
///
/// # Errors
/// Too little memory, and those of the measurement.
pub fn measure(m: &Measuring<'_>, pairs: &[Pair]) -> Result<Found> {
    let grid = m.subject.grid;
    check_memory(m, pairs.len() as u64)?;
    let texels = grid.texels.element_product();
    let mut list = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let (spp, seed) = (m.job.spp, m.job.seed);
        list.push(measure_texture(
            m.patch(),
            *pair,
            &grid,
            spp,
            seed,
            m.watch,
        )?);
    }
    let count = pairs.len() * texels as usize;
    Ok(Found {
        values: Box::new(Textures { list, grid }),
        paths: m.job.spp * count as u64,
        heavy_tails: 0,
        count,
    })
}

/// Refuses pictures that do not fit into memory: six numbers a texel, held
/// twice when they are written.
fn check_memory(m: &Measuring<'_>, pairs: u64) -> Result<()> {
    let UVec2 { x, y } = m.subject.grid.texels;
    let texels = u64::from(x) * u64::from(y);
    let needed = texels.saturating_mul(2 * 6 * 4).saturating_mul(pairs);
    let most = m.job.context.memory_bytes();
    if needed <= most {
        return Ok(());
    }
    let why = format!(
        "{}: {pairs} pictures of {x} x {y} texels need {needed} bytes of memory, {most} are allowed: \
         take fewer texels or fewer pairs",
        m.job.texels
    );
    Err(after_option("texels", why))
}

struct Textures {
    list: Vec<Texture>,
    grid: TexelGrid,
}

impl Values for Textures {
    fn what(&self) -> &'static str {
        "textures"
    }

    fn results(&self, _paths: u64) -> Results {
        results::textures(&self.list, &self.grid)
    }

    /// Values in R, G, B and standard errors in `se.R`, ...
    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        let (textures, grid) = (&self.list, &self.grid);
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
        image
            .write()
            .to_buffered(out)
            .context("writing the pictures failed")
    }

    fn list(&self) -> Value {
        json!(self.list.iter().map(|t| t.pair).collect::<Vec<Pair>>())
    }
}
