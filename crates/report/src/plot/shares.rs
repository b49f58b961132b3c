//! The shares of light, as bars.

use super::{DrawError, INK, Plot, draw_text, fine, paint};
use plotters::element::Rectangle;
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, RGBColor, WHITE};

/// The shares of light, in the order of a bar, with their colours (8-bit sRGB).
pub(crate) const SHARES: [(&str, [u8; 3]); 4] = [
    ("reflected", [0xe0, 0xa0, 0x3a]),
    ("transmitted", [0x4f, 0x9f, 0xbf]),
    ("straight through", [0xb9, 0xd7, 0xe4]),
    ("absorbed", [0x57, 0x50, 0x4a]),
];

/// A bar: its name and its shares in the order of [`SHARES`].
pub(crate) struct Shares {
    pub label: String,
    pub shares: [f64; 4],
}

/// Pixels: height of a row and of its bar, start of bars and length of a full bar.
const ROW: f64 = 19.0;
const BAR: f64 = 15.0;
const LEFT: f64 = 202.0;
const WHOLE: f64 = 350.0;
const WIDTH: f64 = 560.0;
/// Space between a label and its bar.
const GAP: f64 = 6.0;

/// Width of the narrowest piece with room for its number.
const NUMBER: f64 = 26.0;

/// Numbers on light pieces; those of a dark one are white.
const DARK: RGBColor = RGBColor(0x11, 0x11, 0x11);

/// One bar below the other.
pub(crate) fn shares(bars: &[Shares]) -> Result<Plot, DrawError> {
    let size = [WIDTH, ROW * bars.len() as f64 + 4.0];
    Plot::new(size, "Where the light goes", |canvas| {
        for (row, bar) in bars.iter().enumerate() {
            let top = ROW * row as f64 + 2.0;
            let middle = fine(top + 0.5 * BAR);
            let end = (fine(LEFT - GAP), middle);
            draw_text(canvas, &bar.label, end, HPos::Right, INK)?;
            let mut from = LEFT;
            for (share, (_, colour)) in bar.shares.iter().zip(SHARES) {
                let wide = share.clamp(0.0, 1.0) * WHOLE;
                let corners = [
                    (fine(from), fine(top)),
                    (fine(from + wide), fine(top + BAR)),
                ];
                canvas.draw(&Rectangle::new(corners, paint(colour).filled()))?;
                if wide > NUMBER {
                    let at = (fine(from + 0.5 * wide), middle);
                    let is_dark = colour.iter().all(|&c| c < 0x80);
                    let ink = if is_dark { WHITE } else { DARK };
                    draw_text(canvas, &format!("{share:.2}"), at, HPos::Center, ink)?;
                }
                from += wide;
            }
        }
        Ok(Vec::new())
    })
}
