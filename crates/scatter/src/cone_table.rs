//! Projected areas of things spread about an axis, tabulated so that they are
//! accurate relative to themselves even where they nearly vanish.

/// `area(sine of the angle to the axis, width)` on a grid.
///
/// Seen from the side the area grows with the sine; seen end-on a remainder
/// `end_on(width)` is left. Where both are small the area depends on their ratio
/// alone, like a cone with its tip at the origin, which no grid in sine and
/// width can follow. So the grid holds `area / hypot(slope * sine, end_on)`, of
/// order one and smooth, over `sine (1 + end_on) / (sine + end_on)` and the
/// bounded coordinate v = width / (width + scale).
#[derive(Clone, Debug)]
pub(crate) struct ConeTable {
    slope: f32,
    width_scale: f32,
    /// `end_on / v`, which is smooth down to v = 0.
    end_on_slope: [f32; WIDTHS],
    /// One row per width.
    ratio: [[f32; RATIOS]; WIDTHS],
}

/// Grid nodes from end-on to broadside.
const RATIOS: usize = 33;
/// Grid nodes over the width.
const WIDTHS: usize = 49;

impl ConeTable {
    /// Tabulates `area(sine, width)`, for widths from zero to infinity.
    pub(crate) fn build(slope: f64, width_scale: f64, area: impl Fn(f64, f64) -> f64) -> ConeTable {
        let mut end_on_slope = [0.0; WIDTHS];
        let mut ratio = [[0.0; RATIOS]; WIDTHS];
        for i in 0..WIDTHS {
            // The ends stand for zero and infinity: close enough that the limit
            // is reached to single precision, far enough to be computed.
            let v = (i as f64 / (WIDTHS - 1) as f64).clamp(1e-4, 1.0 - 1e-4);
            let width = width_scale * v / (1.0 - v);
            let e = area(0.0, width);
            end_on_slope[i] = (e / v) as f32;
            for (j, out) in ratio[i].iter_mut().enumerate() {
                let t = j as f64 / (RATIOS - 1) as f64;
                let sine = (t * e / (1.0 + e - t)).min(1.0);
                *out = (area(sine, width) / (slope * sine).hypot(e)) as f32;
            }
        }
        ConeTable {
            slope: slope as f32,
            width_scale: width_scale as f32,
            end_on_slope,
            ratio,
        }
    }

    /// The area for a sine in `[0, 1]` and a positive, finite width.
    #[inline]
    pub(crate) fn area(&self, sine: f32, width: f32) -> f32 {
        let v = width / (width + self.width_scale);
        let (i, u) = node(v, WIDTHS);
        let e = v * mix(self.end_on_slope[i], self.end_on_slope[i + 1], u);
        let (j, t) = node(sine * (1.0 + e) / (sine + e), RATIOS);
        let side = self.slope * sine;
        let root = (side * side + e * e).sqrt();
        let (below, above) = (&self.ratio[i], &self.ratio[i + 1]);
        let low = mix(below[j], below[j + 1], t);
        let high = mix(above[j], above[j + 1], t);
        mix(low, high, u) * root
    }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// Lower node and fraction of `x` in `[0, 1]` on `nodes` equally spaced nodes;
/// the fraction reaches one only at the last. An `x` outside by rounding goes
/// on along the nearest cell.
#[inline]
pub(crate) fn node(x: f32, nodes: usize) -> (usize, f32) {
    let scaled = x * (nodes - 1) as f32;
    // Through i32, which the hardware converts to; cheaper than clamping x.
    let lower = (scaled as i32).max(0).min(nodes as i32 - 2);
    (lower as usize, scaled - lower as f32)
}
