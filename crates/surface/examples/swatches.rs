//! Pictures of the six fabrics: texture and mean side by side on a flat patch
//! under three lights, and draped over a cylinder.
//!
//! `cargo run --release -p organza-surface --example swatches -- DIR`

use glam::{Vec2, Vec3};
use image::{Rgb as Pixel, RgbImage};
use organza_basis::{PathRng, Rgb, warp};
use organza_scatter::{Footprint, Surface};
use organza_surface::spec::PRESETS;
use organza_surface::{SurfaceSpec, WovenSurface};
use std::path::Path;

/// Side of one panel, pixels.
const SIDE: u32 = 320;

/// Samples along each side of a pixel.
const OVER: u32 = 4;

fn light(theta_deg: f32, phi_deg: f32) -> Vec3 {
    warp::direction_from_angles(theta_deg.to_radians(), phi_deg.to_radians())
}

/// One panel: `shade` gives radiance at a point of the unit square.
fn panel(
    picture: &mut RgbImage,
    column: u32,
    row: u32,
    exposure: f32,
    shade: impl Fn(Vec2) -> Rgb,
) {
    for y in 0..SIDE {
        for x in 0..SIDE {
            let mut rng = PathRng::new(0, y.into(), x.into());
            let mut sum = Rgb::BLACK;
            for k in 0..OVER * OVER {
                let (i, j) = (k % OVER, k / OVER);
                let at = Vec2::new(
                    x as f32 + (i as f32 + rng.unit()) / OVER as f32,
                    y as f32 + (j as f32 + rng.unit()) / OVER as f32,
                );
                sum += shade(at / SIDE as f32);
            }
            let c: [f32; 3] = (sum * (exposure / (OVER * OVER) as f32)).into();
            picture.put_pixel(
                column * (SIDE + 4) + x,
                row * (SIDE + 4) + y,
                Pixel(c.map(Rgb::srgb8)),
            );
        }
    }
}

/// A flat patch `width_mm` wide, seen from above.
fn flat(cloth: &WovenSurface, w_in: Vec3, width_mm: f32, far: bool) -> impl Fn(Vec2) -> Rgb {
    move |p| {
        let at = Vec2::new(p.x, 1.0 - p.y) * width_mm;
        let footprint = if far {
            Footprint::FAR
        } else {
            Footprint::point(at)
        };
        cloth.eval(Vec3::Z, w_in, footprint) * w_in.z
    }
}

/// A standing cylinder with the warp around it or along it.
fn cylinder(
    cloth: &WovenSurface,
    light: Vec3,
    radius_mm: f32,
    turned: bool,
) -> impl Fn(Vec2) -> Rgb {
    move |p| {
        let x = (2.0 * p.x - 1.0) * 1.05;
        if x.abs() >= 1.0 {
            return Rgb::BLACK;
        }
        let normal = Vec3::new(x, 0.0, (1.0 - x * x).sqrt());
        let around = Vec3::new(normal.z, 0.0, -x);
        let (s, t) = if turned {
            (Vec3::Y, -around)
        } else {
            (around, Vec3::Y)
        };
        let local = |w: Vec3| Vec3::new(w.dot(s), w.dot(t), w.dot(normal));
        let (w_in, w_out) = (local(light), local(Vec3::Z));
        if w_in.z <= 0.0 {
            return Rgb::BLACK;
        }
        let (a, b) = (x.asin() * radius_mm, (1.0 - 2.0 * p.y) * radius_mm);
        let at = if turned {
            Vec2::new(b, -a)
        } else {
            Vec2::new(a, b)
        };
        let width_mm = 2.0 * radius_mm / SIDE as f32 / OVER as f32 / w_out.z;
        cloth.eval(
            w_in,
            w_out,
            Footprint {
                position_mm: at,
                width_mm,
            },
        ) * w_in.z
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let directory = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    for (name, _) in PRESETS {
        let cloth = SurfaceSpec::preset(name)?.build()?;
        let mut picture = RgbImage::new(4 * (SIDE + 4), 2 * (SIDE + 4));
        // Bright cloth and black cloth on one scale each.
        let exposure = 0.35
            / cloth
                .eval(Vec3::Z, light(30.0, 60.0), Footprint::FAR)
                .max_component();
        let patch_mm = 5.0 * cloth.period_mm().max_element();
        for (column, (theta, phi)) in [(20.0, 90.0), (55.0, 0.0), (60.0, 135.0)]
            .iter()
            .enumerate()
        {
            let w_in = light(*theta, *phi);
            panel(&mut picture, column as u32, 0, exposure, |p| {
                // The lower corner shows the mean beside the texture.
                flat(&cloth, w_in, patch_mm, p.x > 0.7 && p.y > 0.7)(p)
            });
        }
        let above = light(50.0, 60.0);
        panel(
            &mut picture,
            3,
            0,
            exposure,
            flat(&cloth, above, 12.0 * patch_mm, false),
        );
        for (column, (radius, turned)) in [(12.0, false), (12.0, true), (60.0, false), (60.0, true)]
            .iter()
            .enumerate()
        {
            let sun = Vec3::new(0.35, 0.45, 0.82).normalize();
            let scale = patch_mm / 6.0;
            panel(
                &mut picture,
                column as u32,
                1,
                exposure,
                cylinder(&cloth, sun, radius * scale, *turned),
            );
        }
        picture.save(Path::new(&directory).join(format!("{name}.png")))?;
    }
    Ok(())
}
