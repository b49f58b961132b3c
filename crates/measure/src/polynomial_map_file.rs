//! Files of polynomial texture maps, `.ptm`, version 1.2, `PTM_FORMAT_RGB`.
//!
//! Lines of text hold the version, the format, the size, a scale of each of the six terms and
//! a bias of each. Bytes follow: a block of red, one of green, one of blue, each with six bytes
//! a texel in rows from the bottom. A coefficient is `(byte - bias) * scale`. Viewers show the
//! polynomial's value as it is, so it is a display value.

use crate::PolynomialMap;
use crate::polynomial_map::TERMS;
use std::io::{Result, Write};

/// Scale and bias of a term.
#[derive(Clone, Copy)]
struct Steps {
    scale: f32,
    bias: i32,
}

impl Steps {
    /// The finest steps whose 256 values hold all of a term's coefficients.
    fn of(map: &PolynomialMap, term: usize) -> Steps {
        let all = map.display_coefficients.iter().flatten().map(|c| c[term]);
        let (low, high) = all.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), c| {
            (low.min(c), high.max(c))
        });
        // One step is kept for the rounding of the bias. A term that is the same everywhere
        // would have steps of no length.
        let size = high.abs().max(low.abs()).max(1.0);
        let scale = ((high - low) / 254.0).max(size * 1e-4);
        Steps {
            scale,
            bias: (-low / scale).round() as i32,
        }
    }

    fn byte(self, coefficient: f32) -> u8 {
        let step = (coefficient / self.scale).round() as i32 + self.bias;
        step.clamp(0, 255) as u8
    }
}

/// Writes a map, which programs for reflectance transformation imaging open.
///
/// # Errors
/// Those of the writer.
pub fn write_polynomial_map(map: &PolynomialMap, mut out: impl Write) -> Result<()> {
    let steps: [Steps; TERMS] = std::array::from_fn(|term| Steps::of(map, term));
    let line = |words: [String; TERMS]| words.join(" ");
    let (width, height) = (map.texels.x, map.texels.y);
    writeln!(out, "PTM_1.2\nPTM_FORMAT_RGB\n{width}\n{height}")?;
    writeln!(out, "{}", line(steps.map(|s| s.scale.to_string())))?;
    writeln!(out, "{}", line(steps.map(|s| s.bias.to_string())))?;
    for channel in 0..3 {
        for row in map.display_coefficients.rchunks(width as usize) {
            let bytes = row.iter().flat_map(|texel| {
                let pairs = texel[channel].iter().zip(&steps);
                pairs.map(|(&c, s)| s.byte(c))
            });
            out.write_all(&bytes.collect::<Vec<u8>>())?;
        }
    }
    Ok(())
}
