//! A fabric over a mesh, from far to close: four frames of a zoom.
//!
//! `cargo run --release -p organza-surface --example draped -- MESH.obj denim OUT.png`

use glam::Vec3;
use image::{Rgb as Pixel, RgbImage};
use organza_basis::{Budget, PathRng, Ray, Rgb};
use organza_mesh::{DrapedMesh, MeshHit, Placement, read_obj};
use organza_scatter::{Footprint, Surface};
use organza_surface::{SurfaceSpec, WovenSurface};

/// Side of a frame, pixels.
const SIDE: u32 = 384;

/// Samples along each side of a pixel.
const OVER: u32 = 3;

struct Camera {
    origin: Vec3,
    axes: [Vec3; 3],
    half_width: f32,
}

impl Camera {
    fn toward(origin: Vec3, target: Vec3, half_width: f32) -> Camera {
        let out = (origin - target).normalize();
        let right = Vec3::Y.cross(out).normalize();
        Camera {
            origin,
            axes: [right, out.cross(right), out],
            half_width,
        }
    }

    /// The ray through a place of the film, in [-1, 1].
    fn ray(&self, x: f32, y: f32) -> Ray {
        let [right, up, out] = self.axes;
        let d = (right * x - up * y) * self.half_width - out;
        Ray::new(self.origin, d.normalize())
    }
}

fn shade(cloth: &WovenSurface, mesh: &DrapedMesh, ray: &Ray, hit: &MeshHit, spread: f32) -> Rgb {
    let sun = Vec3::new(0.5, 0.8, 0.4).normalize();
    let local = |w: Vec3| hit.frame.frame_from_world(w);
    let (w_in, w_out) = (local(sun), local(-ray.direction));
    // Mm of cloth per mm of the world: the smaller stretch counts.
    let stretch = hit.stretch[0].length().min(hit.stretch[1].length());
    let footprint = Footprint {
        position_mm: hit.uv_mm,
        width_mm: spread * hit.distance_mm as f32 / stretch / w_out.z.abs().max(0.1),
    };
    let side = hit.face_normal * hit.face_normal.dot(sun).signum();
    let lift = 1e-4 * mesh.bounds_mm().size().length();
    let shadow = Ray::new(hit.position_mm + (side * lift).as_dvec3(), sun);
    let direct = if mesh.hit(&shadow, 0.0, f64::INFINITY).is_some() {
        Rgb::BLACK
    } else {
        cloth.eval(w_out, w_in, footprint) * (3.0 * w_in.z.abs())
    };
    // A little sky, from straight along the view.
    direct + cloth.eval(w_out, w_out, Footprint::FAR) * 0.3
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, path, fabric, out] = arguments.as_slice() else {
        return Err("draped MESH.obj FABRIC OUT.png".into());
    };
    let placement = Placement {
        mm_per_unit: 40.0,
        mm_per_uv: 90.0,
    };
    let mesh = DrapedMesh::new(read_obj(
        &std::fs::read(path)?,
        placement,
        &mut Budget::new(1 << 32),
    )?);
    let cloth = SurfaceSpec::preset(fabric)?.build()?;
    let mut picture = RgbImage::new(4 * SIDE, SIDE);
    let bounds = mesh.bounds_mm();
    let far = bounds.centre() + Vec3::new(0.3, 1.0, 1.1) * bounds.size().length();
    let aim = Ray::new(far, (bounds.centre() - far).normalize());
    let target = mesh
        .hit(&aim, 0.0, f64::INFINITY)
        .map_or(bounds.centre(), |h| h.position_mm.as_vec3());
    let exposure = 0.25
        / cloth
            .eval(Vec3::Z, Vec3::new(0.3, 0.4, 0.866), Footprint::FAR)
            .max_component();
    for frame in 0..4 {
        let origin = target + (far - target) * 0.22f32.powi(frame);
        let camera = Camera::toward(origin, target, 0.3);
        let spread = 2.0 * camera.half_width / (SIDE * OVER) as f32;
        for y in 0..SIDE {
            for x in 0..SIDE {
                let mut rng = PathRng::new(frame as u64, y.into(), x.into());
                let mut sum = Rgb::BLACK;
                for k in 0..OVER * OVER {
                    let film = |p: u32, k: u32, u: f32| {
                        2.0 * (p as f32 + (k as f32 + u) / OVER as f32) / SIDE as f32 - 1.0
                    };
                    let u = rng.unit2();
                    let ray = camera.ray(film(x, k % OVER, u.x), film(y, k / OVER, u.y));
                    if let Some(hit) = mesh.hit(&ray, 0.0, f64::INFINITY) {
                        sum += shade(&cloth, &mesh, &ray, &hit, spread);
                    }
                }
                let c: [f32; 3] = (sum * (exposure / (OVER * OVER) as f32)).into();
                picture.put_pixel(frame as u32 * SIDE + x, y, Pixel(c.map(Rgb::srgb8)));
            }
        }
    }
    picture.save(out)?;
    Ok(())
}
