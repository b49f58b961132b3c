//! Sampling and its inverse for a density on the unit square that is bilinear between the
//! nodes of a grid: the marginal density of the row first, then the density within the row.

use glam::DVec2;

/// A density on the unit square with an integral of one.
pub(crate) struct BilinearWarp {
    width: usize,
    /// Densities at the nodes, row by row.
    nodes: Vec<f64>,
    /// Integral of the density along each row of nodes.
    rows: Vec<f64>,
}

impl BilinearWarp {
    /// A density in proportion to non-negative values at nodes, `width` a row, at least two
    /// rows of at least two; a constant one if all values are zero.
    pub fn new(width: usize, values: &[f64]) -> BilinearWarp {
        let steps = (width - 1) as f64;
        let mut nodes = values.to_vec();
        let total = |nodes: &[f64]| {
            let rows: Vec<f64> = nodes.chunks(width).map(|r| area(r) / steps).collect();
            area(&rows) / (rows.len() - 1) as f64
        };
        if total(&nodes) <= 0.0 {
            nodes.fill(1.0);
        }
        let whole = total(&nodes);
        nodes.iter_mut().for_each(|v| *v /= whole);
        let rows = nodes.chunks(width).map(|r| area(r) / steps).collect();
        BilinearWarp { width, nodes, rows }
    }

    /// Densities at the nodes.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// The point that a uniform sample of the square is mapped to.
    pub fn sample(&self, uniform: DVec2) -> DVec2 {
        let y = place_of_share(&self.rows, uniform.y);
        DVec2::new(place_of_share(&self.row(y), uniform.x), y)
    }

    /// The sample that is mapped to a point.
    #[cfg(test)]
    pub fn invert(&self, point: DVec2) -> DVec2 {
        DVec2::new(
            share_of_place(&self.row(point.y), point.x),
            share_of_place(&self.rows, point.y),
        )
    }

    /// Densities of the row of nodes at a height.
    fn row(&self, y: f64) -> Vec<f64> {
        let (first, t) = piece(y, self.rows.len());
        let row = |k: usize| self.nodes.iter().skip(k * self.width).take(self.width);
        let mix = |(a, b): (&f64, &f64)| a + t * (b - a);
        row(first).zip(row(first + 1)).map(mix).collect()
    }
}

/// Sum of the areas under pieces of unit width between nodes.
fn area(nodes: &[f64]) -> f64 {
    nodes.windows(2).map(|w| 0.5 * (w[0] + w[1])).sum()
}

/// The piece between nodes that contains a place from 0 to 1, and where in it.
pub(crate) fn piece(place: f64, nodes: usize) -> (usize, f64) {
    let scaled = place.clamp(0.0, 1.0) * (nodes - 1) as f64;
    let first = (scaled as usize).min(nodes - 2);
    (first, scaled - first as f64)
}

/// The place, 0 to 1, to the left of which lies a share of the area under nodes.
fn place_of_share(nodes: &[f64], share: f64) -> f64 {
    let target = share.clamp(0.0, 1.0) * area(nodes);
    let (mut before, mut found) = (0.0, (0, 0.0));
    for (k, w) in nodes.windows(2).enumerate() {
        let (left, right) = (w[0], w[1]);
        let here = 0.5 * (left + right);
        if here > 0.0 {
            // The root of left t + (right - left) t^2 / 2 = rest that is stable for equal sides.
            let rest = (target - before).clamp(0.0, here);
            let root = (left * left + 2.0 * (right - left) * rest).max(0.0).sqrt();
            let t = if rest > 0.0 {
                2.0 * rest / (left + root)
            } else {
                0.0
            };
            found = (k, t.min(1.0));
            if before + here >= target {
                break;
            }
        }
        before += here;
    }
    (found.0 as f64 + found.1) / (nodes.len() - 1) as f64
}

/// The inverse of [`place_of_share`].
#[cfg(test)]
fn share_of_place(nodes: &[f64], place: f64) -> f64 {
    let (k, t) = piece(place, nodes.len());
    let partial = nodes[k] * t + 0.5 * (nodes[k + 1] - nodes[k]) * t * t;
    (area(&nodes[..=k]) + partial) / area(nodes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn samples_and_points_are_each_others_inverse() {
        let mut rng = PathRng::from_seed(8);
        let mut values: Vec<f64> = (0..7 * 5).map(|_| f64::from(rng.unit())).collect();
        // A row and a corner without density.
        values[14..21].fill(0.0);
        values[28..30].fill(0.0);
        let warp = BilinearWarp::new(7, &values);
        for _ in 0..2000 {
            let sample = rng.unit2().as_dvec2();
            let back = warp.invert(warp.sample(sample));
            let off = (back - sample).length();
            assert!(off < 4.0 * f64::EPSILON, "seed 8: {sample} {back}");
        }
        assert_eq!(warp.sample(DVec2::ZERO), DVec2::ZERO);
        assert_eq!(warp.sample(DVec2::ONE), DVec2::ONE);
    }

    /// Mean of x y of samples against the integral of the density, in closed form for two
    /// nodes a side; with the axes exchanged the mean of x differs.
    #[test]
    fn samples_have_the_density() {
        let warp = BilinearWarp::new(2, &[0.0, 3.0, 0.0, 1.0]);
        let n = 200;
        let mut mean = DVec2::ZERO;
        for k in 0..n * n {
            let cell = DVec2::new((k % n) as f64, (k / n) as f64);
            mean += warp.sample((cell + 0.5) / n as f64) / (n * n) as f64;
        }
        // Density 2 x (3 - 2 y) / 2: the mean of x is 2/3, that of y 5/12.
        let expected = DVec2::new(2.0 / 3.0, 5.0 / 12.0);
        assert!((mean - expected).length() < 1e-4, "{mean}");
        assert!((mean.y - 2.0 / 3.0).abs() > 0.1);
    }
}
