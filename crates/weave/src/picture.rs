//! Pictures of drafts.

use crate::{Draft, Thread};
use organza_basis::Rgb;

/// A picture in 8-bit sRGB, rows from top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// `3 * width * height` bytes, red first.
    pub rgb: Vec<u8>,
}

/// The longest side of a picture, pixels.
const MAX_SIDE: usize = 8192;

impl Draft {
    /// The face of the weave, one square of `cell` pixels per crossing (fewer
    /// where the picture would become wider than 8192), the first pick at the
    /// bottom. A thread without colour is dark as warp and light as weft; the
    /// sides of each square are shaded along the thread that lies on top.
    pub fn picture(&self, cell: u32) -> Picture {
        let longest = self.ends().max(self.picks());
        let cell = (cell as usize).clamp(1, (MAX_SIDE / longest).max(1));
        let (width, height) = (cell * self.ends(), cell * self.picks());
        let mut rgb = Vec::with_capacity(3 * width * height);
        let warp: Vec<_> = self.warp.iter().map(|t| shades(t, 0.03)).collect();
        let weft: Vec<_> = self.weft.iter().map(|t| shades(t, 0.85)).collect();
        for row in 0..height {
            let p = self.picks() - 1 - row / cell;
            for column in 0..width {
                let e = column / cell;
                let (shades, across) = if self.warp_up(e, p) {
                    (&warp[e], column % cell)
                } else {
                    (&weft[p], row % cell)
                };
                let edge = cell >= 4 && (across == 0 || across == cell - 1);
                rgb.extend(shades[usize::from(edge)]);
            }
        }
        Picture {
            width: width as u32,
            height: height as u32,
            rgb,
        }
    }
}

/// sRGB of a thread, on top and at its edge.
fn shades(thread: &Thread, default: f32) -> [[u8; 3]; 2] {
    let colour = thread.colour.unwrap_or(Rgb::splat(default));
    [1.0, 0.45].map(|k| (colour * k).0.to_array().map(Rgb::srgb8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_show_the_thread_on_top_where_it_belongs() {
        let mut draft = Draft::from_drawdown(&["X.", ".."]).unwrap();
        draft.warp[0].colour = Some(Rgb::new(1.0, 0.0, 0.0));
        draft.weft[1].colour = Some(Rgb::new(0.0, 1.0, 0.0));
        let picture = draft.picture(1);
        assert_eq!((picture.width, picture.height), (2, 2));
        assert_eq!(picture.rgb[..6], [255, 0, 0, 0, 255, 0]);
        let big = draft.picture(6);
        assert_eq!(big.rgb.len(), 3 * 12 * 12);
        let at = |x: usize, y: usize| &big.rgb[3 * (12 * y + x)..][..3];
        assert_eq!(at(2, 2), [255, 0, 0]);
        assert!(at(0, 2)[0] < 200, "warp is shaded at its left side");
        assert_eq!(at(8, 2), [0, 255, 0]);
    }

    #[test]
    fn large_drafts_give_pictures_of_bounded_size() {
        let draft = Draft::from_fn(3000, 2, |e, p| e % 2 == p).unwrap();
        assert_eq!(draft.picture(100).width, 6000);
    }
}
