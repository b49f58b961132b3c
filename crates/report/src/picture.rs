//! Pictures inside a page.

use crate::ReportError;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::UVec2;
use organza_basis::Rgb;
use organza_picture::png;
use std::io::Cursor;

/// A linear picture.
pub struct Picture {
    /// Width and height.
    pub size: [u32; 2],
    /// Rows from the top.
    pub pixels: Vec<[f32; 3]>,
}

/// Share of values that become white with [`exposure`].
const BRIGHTEST: usize = 20;

/// The gain that keeps all but the brightest twentieth of some values below white.
pub(crate) fn exposure(values: impl Iterator<Item = f64>) -> f32 {
    let mut list: Vec<f64> = values.collect();
    list.sort_by(f64::total_cmp);
    let rank = list.len() * (BRIGHTEST - 1) / BRIGHTEST;
    let bright = list.get(rank).copied().unwrap_or(1.0);
    (0.85 / bright.max(1e-6)) as f32
}

/// Display values of a linear colour.
pub(crate) fn pixel(value: [f64; 3], gain: f32) -> [u8; 3] {
    value.map(|v| Rgb::srgb8((v as f32 * gain).clamp(0.0, 1.0)))
}

impl Picture {
    /// Of pixels.
    pub const fn new(size: [u32; 2], pixels: Vec<[f32; 3]>) -> Picture {
        Picture { size, pixels }
    }

    /// The suitable gain.
    pub(crate) fn exposure(&self) -> f32 {
        exposure(self.pixels.iter().flatten().map(|&v| f64::from(v)))
    }

    /// Display values, three bytes a pixel.
    pub(crate) fn display(&self, gain: f32) -> Vec<u8> {
        let to_bytes = |v: &[f32; 3]| pixel(v.map(f64::from), gain);
        self.pixels.iter().flat_map(to_bytes).collect()
    }
}

/// A picture on a page.
pub(crate) struct Thumbnail {
    /// Alternative text.
    pub alt: String,
    pub caption: String,
    pub data_url: String,
}

impl Thumbnail {
    /// A thumbnail of 8-bit RGB, whose caption describes it.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub(crate) fn new(
        caption: impl Into<String>,
        rgb: &[u8],
        size: [u32; 2],
    ) -> Result<Thumbnail, ReportError> {
        let caption = caption.into();
        let mut bytes = Cursor::new(Vec::new());
        png::write_rgb8(UVec2::from(size), rgb, &mut bytes)?;
        Ok(Thumbnail {
            alt: caption.clone(),
            caption,
            data_url: format!("data:image/png;base64,{}", STANDARD.encode(bytes.get_ref())),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thumbnails_hold_their_pixels() {
        let rgb = [255, 0, 0, 0, 255, 0, 0, 0, 255, 10, 20, 30];
        let thumbnail = Thumbnail::new("colours", &rgb, [2, 2]).unwrap();
        let text = thumbnail
            .data_url
            .strip_prefix("data:image/png;base64,")
            .unwrap();
        let png = STANDARD.decode(text).unwrap();
        let (image, _) = organza_picture::decode(&png, u64::MAX).unwrap();
        assert_eq!(image.size, UVec2::splat(2));
        assert_eq!(image.pixels[0], Rgb::new(1.0, 0.0, 0.0));
    }

    #[test]
    fn all_but_the_brightest_twentieth_stay_below_white() {
        let values = (0..100).map(f64::from);
        let gain = f64::from(exposure(values.clone()));
        let white = values.filter(|v| v * gain > 1.0).count();
        assert!(white <= 5, "{white}");
        assert!(exposure(std::iter::empty()).is_finite());
    }
}
