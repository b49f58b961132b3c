//! Where the noise of a scene's paths comes from: the variance of one path, by light, for direct
//! and for all light, and the share of it that is drawn after the first place.
//!
//! `cargo run --release -p organza-scene --example noise_of_paths -- SCENE [KEY.PATH=VALUE]...`

#![allow(clippy::print_stdout)] // Its output is its purpose.

use glam::UVec2;
use organza_basis::{Moments, PathRng};
use organza_scene::loader::Loader;
use organza_transport::{Integrator, Light, Stats, trace_from};
use std::path::Path;
use std::time::Instant;

/// Pixels, places in a pixel and paths from a place.
const PIXELS: u64 = 300;
const PLACES: u64 = 64;
const PATHS: u64 = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let path = words.next().ok_or("expected a scene")?;
    let overrides: Vec<String> = words.collect();
    let loader = Loader::new();
    let loaded = organza_scene::load(Path::new(&path), &overrides, &loader)?;
    let scene = loaded.build(None, &loader)?;
    let size = scene.camera.resolution().as_vec2();
    let mut parts: Vec<(String, Vec<Light>, u32)> = vec![
        ("all light".into(), scene.lights.clone(), u32::MAX),
        ("direct light".into(), scene.lights.clone(), 1),
    ];
    for (i, light) in scene.lights.iter().enumerate() {
        parts.push((format!("direct of light {i}"), vec![light.clone()], 1));
    }
    println!(
        "| part | mean | noise of a path | of the median pixel | within a place | largest | time |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, lights, bounces) in &parts {
        let started = Instant::now();
        let (mut mean, mut total, mut within) = <(Moments, Moments, Moments)>::default();
        let mut of_pixels = Vec::new();
        let (mut largest, mut stats) = (0f64, Stats::default());
        for pixel in 0..PIXELS {
            let mut rng = PathRng::new(11, pixel, 0);
            let at = (size * (0.3 + 0.4 * rng.unit2())).as_uvec2();
            let mut of_pixel = Moments::default();
            for place in 0..PLACES {
                let mut rng = PathRng::new(1, pixel, place);
                let ray = scene.camera.ray(UVec2::new(at.x, at.y), &mut rng);
                let tracking = scene.tracking(Integrator::Woodcock, ray, &mut rng);
                let mut of_place = Moments::default();
                for path in 0..PATHS {
                    let mut rng = PathRng::new(2, PLACES * pixel + place, path);
                    let s = trace_from(
                        &scene, lights, ray, tracking, *bounces, &mut rng, &mut stats,
                    );
                    let radiance = f64::from(s.radiance.mean());
                    of_place.add(radiance);
                    largest = largest.max(radiance);
                }
                of_pixel.merge(&of_place);
                within.add(of_place.variance());
            }
            total.add(of_pixel.variance());
            mean.merge(&of_pixel);
            if of_pixel.mean > 0.0 {
                of_pixels.push(of_pixel.variance().sqrt() / of_pixel.mean);
            }
        }
        of_pixels.sort_by(f64::total_cmp);
        let median = of_pixels.get(of_pixels.len() / 2).copied();
        println!(
            "| {name} | {:.4} | {:.0} % | {:.0} % | {:.2} | {:.0} | {:.1} s |",
            mean.mean,
            100.0 * total.mean.sqrt() / mean.mean,
            100.0 * median.unwrap_or(f64::NAN),
            within.mean / total.mean,
            largest / mean.mean,
            started.elapsed().as_secs_f64(),
        );
    }
    Ok(())
}
