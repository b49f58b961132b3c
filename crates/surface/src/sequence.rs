//! Low-discrepancy points for the integrals of construction.

/// Points of a low-discrepancy sequence in `N` dimensions [Roberts2018].
pub(crate) fn sequence<const N: usize>(count: usize) -> impl Iterator<Item = [f32; N]> {
    let mut root = 1.5f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (N as f64 + 1.0));
    }
    (0..count).map(move |i| {
        let mut step = 1.0;
        std::array::from_fn(|_| {
            step /= root;
            (0.5 + step * (i + 1) as f64).fract() as f32
        })
    })
}
