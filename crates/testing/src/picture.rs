//! Environment pictures of tests.

use glam::{UVec2, Vec3};
use organza_basis::Rgb;
use organza_light::ImageEnvironment;

/// A wavy sky of 24 x 12 pixels with small bright lamps and a bright pole; up is oblique.
///
/// # Panics
/// Never: the picture is valid.
pub fn environment_with_lamps() -> ImageEnvironment {
    let size = UVec2::new(24, 12);
    let mut pixels: Vec<Rgb> = (0..size.element_product())
        .map(|i| Rgb::new(0.3, 0.4, 0.6) * (1.0 + 0.5 * (i as f32).sin()))
        .collect();
    let mut shine = |x: usize, y: usize, radiance| pixels[y * 24 + x] = radiance;
    shine(13, 8, Rgb::new(60.0, 40.0, 20.0));
    shine(14, 8, Rgb::new(30.0, 20.0, 10.0));
    shine(13, 9, Rgb::new(20.0, 15.0, 10.0));
    shine(0, 5, Rgb::new(2.0, 9.0, 30.0));
    (0..24).for_each(|x| shine(x, 0, Rgb::splat(9.0)));
    let environment = ImageEnvironment::new(size, pixels, Vec3::new(0.2, 0.3, 1.0), Vec3::Y);
    environment.expect("the picture is valid")
}
