//! Projected areas of things spread about an axis, tabulated so that they are
//! accurate relative to themselves even where they nearly vanish.

/// `area(sine of the angle to the axis, width)` on a grid.
///
/// Seen from the side the area grows with the sine; seen end-on a remainder
/// `end_on(width)` is left. Where both are small the area depends on their ratio
/// alone, like a cone with its tip at the origin, which no grid in sine and
/// width can follow. So the grid holds `area / (slope * sine + end_on)`, of order
/// one and smooth, over `sine (1 + end_on) / (sine + end_on)`. Widths are spaced
/// evenly within octaves, whose number a float tells by its bits: a look-up then
/// divides once and takes no root.
#[derive(Clone, Debug)]
pub(crate) struct ConeTable {
    slope: f32,
    end_on: [f32; WIDTHS],
    /// One row per width.
    ratio: [[f32; RATIOS]; WIDTHS],
}

/// Grid nodes from end-on to broadside.
const RATIOS: usize = 49;
/// Mantissa bits that tell the cell within an octave.
const STEP_BITS: u32 = 3;
/// Octaves of widths; beyond them the limits are reached.
const OCTAVES: usize = 20;
/// Lowest width but zero.
const LEAST: f32 = 1.0 / 8192.0;
/// Greatest width.
const MOST: f32 = 128.0;
/// Zero, and the ends of the cells of all octaves.
const WIDTHS: usize = (OCTAVES << STEP_BITS) + 2;

impl ConeTable {
    /// Tabulates `area(sine, width)`, for widths from zero to infinity.
    pub(crate) fn build(slope: f64, area: impl Fn(f64, f64) -> f64) -> ConeTable {
        let mut end_on = [0.0; WIDTHS];
        let mut ratio = [[0.0; RATIOS]; WIDTHS];
        for i in 1..WIDTHS {
            let (octave, step) = ((i - 1) >> STEP_BITS, (i - 1) & ((1 << STEP_BITS) - 1));
            let mantissa = 1.0 + step as f64 / f64::from(1 << STEP_BITS);
            let width = f64::from(LEAST) * mantissa * 2f64.powi(octave as i32);
            let e = area(0.0, width);
            end_on[i] = e as f32;
            for (j, out) in ratio[i].iter_mut().enumerate() {
                let t = j as f64 / (RATIOS - 1) as f64;
                let sine = (t * e / (1.0 + e - t)).min(1.0);
                *out = (area(sine, width) / (slope * sine + e)) as f32;
            }
        }
        // Near zero all widths look alike.
        ratio[0] = ratio[1];
        ConeTable {
            slope: slope as f32,
            end_on,
            ratio,
        }
    }

    /// The area for a sine in `[0, 1]` and a positive width.
    #[inline]
    pub(crate) fn area(&self, sine: f32, width: f32) -> f32 {
        let (i, u) = width_cell(width);
        let e = mix(self.end_on[i], self.end_on[i + 1], u);
        // Finite at an angle and a width of zero too.
        let (j, t) = node(sine * (1.0 + e) / (sine + e).max(f32::MIN_POSITIVE), RATIOS);
        let (below, above) = (&self.ratio[i], &self.ratio[i + 1]);
        let low = mix(below[j], below[j + 1], t);
        let high = mix(above[j], above[j + 1], t);
        mix(low, high, u) * (self.slope * sine + e)
    }
}

/// Cell of a width and the fraction passed in it.
#[inline]
fn width_cell(width: f32) -> (usize, f32) {
    const SHIFT: u32 = 23 - STEP_BITS;
    if width < LEAST {
        return (0, width * (1.0 / LEAST));
    }
    // The last float below the greatest keeps its cell inside.
    let bits = width.min(MOST - 1e-5).to_bits();
    let cell = (bits >> SHIFT) - (LEAST.to_bits() >> SHIFT) + 1;
    let passed = bits & ((1 << SHIFT) - 1);
    (cell as usize, passed as f32 * (1.0 / (1 << SHIFT) as f32))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_follow_each_other() {
        let mut last = -1.0;
        let mut width = 1e-6f32;
        while width < 1e6 {
            let (i, u) = width_cell(width);
            assert!(i + 1 < WIDTHS && (0.0..=1.0).contains(&u), "{width}");
            let place = i as f32 + u;
            assert!(place >= last, "{width}: {place} {last}");
            assert!(place - last < 1.2 || last < 0.0, "{width}: {place} {last}");
            last = place;
            width *= 1.01;
        }
    }
}
