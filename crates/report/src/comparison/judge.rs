//! The differences of models from the reference.

use super::Measurement;
use crate::Picture;
use organza_measure::{Difference, PairValue, difference};

/// The differences of a model from the reference.
pub struct Judged {
    /// Name of the model.
    pub model: String,
    /// Over the layout.
    pub layout: Difference,
    /// In the two planes, reflected.
    pub reflection: Difference,
    /// In the two planes, transmitted.
    pub transmission: Difference,
    /// Perceptual difference of each picture.
    pub flip: Vec<Flip>,
}

/// The perceptual difference FLIP [Andersson2020] of two pictures.
pub struct Flip {
    /// Its mean over the pixels.
    pub mean: f32,
    /// Its map in 8-bit RGB, rows from the top; bright is different.
    pub map: Vec<u8>,
}

/// Compares all other measurements with the first. `seed` is that of the random numbers of the
/// intervals.
pub fn judge(measured: &[Measurement], seed: u64) -> Vec<Judged> {
    let Some((reference, others)) = measured.split_first() else {
        return Vec::new();
    };
    let against = |a: &[PairValue], b: &[PairValue]| difference(a, b, seed);
    let in_plane = |m: &Measurement, back: bool| {
        against(&side(&m.in_plane, back), &side(&reference.in_plane, back))
    };
    let judged = |m: &Measurement| Judged {
        model: m.model.clone(),
        layout: against(&m.layout, &reference.layout),
        reflection: in_plane(m, false),
        transmission: in_plane(m, true),
        flip: (m.pictures.iter().zip(&reference.pictures))
            .map(|(picture, truth)| flip(picture, truth))
            .collect(),
    };
    others.iter().map(judged).collect()
}

/// Pairs that are seen from one side of the cloth.
fn side(list: &[PairValue], back: bool) -> Vec<PairValue> {
    let wanted = |v: &&PairValue| (v.pair.exitant.theta_deg > 90.0) == back;
    list.iter().filter(wanted).copied().collect()
}

/// The perceptual difference of two pictures of one size, at the exposure of the second.
pub(crate) fn flip(picture: &Picture, truth: &Picture) -> Flip {
    let gain = truth.exposure();
    let [width, height] = picture.size;
    let image = |p: &Picture| nv_flip::FlipImageRgb8::with_data(width, height, &p.display(gain));
    let error = nv_flip::flip(
        image(truth),
        image(picture),
        nv_flip::DEFAULT_PIXELS_PER_DEGREE,
    );
    Flip {
        mean: nv_flip::FlipPool::from_image(&error).mean(),
        map: error.apply_color_lut(&nv_flip::magma_lut()).to_vec(),
    }
}
