//! How well a computed picture agrees with a photograph.

use super::sides::Side;
use organza_photograph::Photograph;
use organza_report::{FittedSide, Picture, perceptual_difference};
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::fmt;

/// Least side of the pictures that FLIP compares, pixels.
const FLIP_SIDE: usize = 192;

/// Agreement of a computed picture with a photograph, both folded onto one repeat.
pub struct Agreement {
    /// Mean colour of the photograph and of the picture.
    pub mean: [[f64; 3]; 2],
    /// Mean of FLIP, one texel a pixel.
    pub flip: f64,
    /// Amplitude of the weave's strongest wave that is not the threads' own, as a share of the
    /// mean, of the photograph and of the picture.
    pub wale: [f64; 2],
}

impl Agreement {
    /// Compares a picture in the units of the photograph with the folded photograph.
    pub fn new(side: &Side, picture: &[[f64; 3]]) -> Agreement {
        let photograph = &side.fold.mean[..];
        let pictures = [photograph, picture];
        let mean = pictures.map(|p| -> [f64; 3] {
            std::array::from_fn(|c| p.iter().map(|v| v[c]).sum::<f64>() / p.len() as f64)
        });
        Agreement {
            mean,
            flip: f64::from(perceptual_difference(
                &tiled(side, picture),
                &tiled(side, photograph),
            )),
            wale: wale(side, pictures),
        }
    }

    /// For programs.
    pub fn json(&self, name: &str) -> Value {
        json!({
            "side": name,
            "mean": { "photograph": self.mean[0], "picture": self.mean[1] },
            "flip": self.flip,
            "wale": { "photograph": self.wale[0], "picture": self.wale[1] },
        })
    }
}

impl fmt::Display for Agreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [photograph, picture] = self.mean.map(crate::triple);
        write!(
            f,
            "mean {picture}, photograph {photograph}; FLIP {:.3}; amplitude at the wale {:.3}, \
             photograph {:.3}",
            self.flip, self.wale[1], self.wale[0]
        )
    }
}

/// Repeats of a folded picture, at least `FLIP_SIDE` pixels wide and high.
fn tiled(side: &Side, picture: &[[f64; 3]]) -> Picture {
    let [w, h] = side.fold.size();
    let size = [w, h].map(|n| FLIP_SIDE.div_ceil(n) * n);
    let pixel = |x: usize, y: usize| picture[y % h * w + x % w].map(|v| v as f32);
    let rows = (0..size[1])
        .rev()
        .flat_map(|y| (0..size[0]).map(move |x| (x, y)));
    Picture::new(
        size.map(|n| n as u32),
        rows.map(|(x, y)| pixel(x, y)).collect(),
    )
}

/// The side of a report: a part of the photograph, both folded pictures, and words.
pub fn shown(
    side: &Side,
    whole: &Photograph,
    picture: &[[f64; 3]],
    agreement: &Agreement,
) -> FittedSide {
    let size = whole.size().map(|n| n.min(2 * FLIP_SIDE));
    let rows = (0..size[1])
        .rev()
        .flat_map(|y| (0..size[0]).map(move |x| (x, y)));
    FittedSide {
        name: side.name.to_owned(),
        photograph: Picture {
            size: size.map(|n| n as u32),
            pixels: rows
                .map(|(x, y)| whole.pixel(x, y).map(|v| v as f32))
                .collect(),
        },
        folded: tiled(side, &side.fold.mean),
        picture: tiled(side, picture),
        words: agreement.to_string(),
    }
}

fn wale(side: &Side, pictures: [&[[f64; 3]]; 2]) -> [f64; 2] {
    let [w, h] = side.fold.size();
    let (ends, picks) = (side.fold.repeat.ends, side.fold.repeat.all_picks());
    let amplitude = |picture: &[[f64; 3]], (i, j): (usize, usize)| {
        let (mut re, mut im, mut sum) = (0.0, 0.0, 0.0);
        for (t, c) in picture.iter().enumerate() {
            let (x, y) = ((t % w) as f64 / w as f64, (t / w) as f64 / h as f64);
            let v = c[0] + c[1] + c[2];
            let (s, c) = (TAU * (i as f64 * x + j as f64 * y)).sin_cos();
            re += v * c;
            im += v * s;
            sum += v;
        }
        2.0 * re.hypot(im) / f64::max(sum, 1e-12)
    };
    // Waves as long as a thread's spacing or longer, of both slants.
    let waves = (0..=ends).flat_map(|i| (0..h).map(move |j| (i, j)));
    let waves = waves.filter(|&(i, j)| {
        let up = j.min(h - j);
        up <= picks && !(i % ends == 0 && up % picks == 0)
    });
    let strength = |wave: &(usize, usize)| amplitude(pictures[0], *wave);
    let strongest = waves.max_by(|a, b| strength(a).total_cmp(&strength(b)));
    strongest.map_or([0.0; 2], |wave| pictures.map(|p| amplitude(p, wave)))
}
