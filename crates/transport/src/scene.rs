//! Everything light can meet.

use crate::lattice::{Lattice, LocalRay};
use crate::{
    Camera, ClothMedium, FibreMedium, FlakeMedium, GridMedium, Integrator, Light, Medium, SiteInfo,
    Stats, tracking,
};
use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use organza_scatter::LobeSample;

/// Media, lights and the camera that looks at them.
pub struct Scene {
    /// Matter; extinctions add where boxes overlap.
    pub media: Vec<AnyMedium>,
    /// Lights; their light adds.
    pub lights: Vec<Light>,
    /// The camera.
    pub camera: Camera,
}

/// The closed set of media, resolved once per ray.
pub enum AnyMedium {
    /// Dense grids.
    Grid(GridMedium),
    /// An octree of fibres, as micro-flakes.
    Cloth(ClothMedium),
    /// An octree of fibres, as micro-flakes of another family.
    Flakes(FlakeMedium),
    /// An octree of fibres, as virtual fibres.
    Fibres(FibreMedium),
}

impl AnyMedium {
    /// Where the medium is.
    pub fn lattice(&self) -> &Lattice {
        match self {
            AnyMedium::Grid(m) => m.lattice(),
            AnyMedium::Cloth(m) => m.lattice(),
            AnyMedium::Flakes(m) => m.lattice(),
            AnyMedium::Fibres(m) => m.lattice(),
        }
    }

    /// True when exact stepping is possible.
    pub fn is_piecewise_constant(&self) -> bool {
        match self {
            AnyMedium::Grid(m) => m.is_piecewise_constant(),
            AnyMedium::Cloth(m) => m.is_piecewise_constant(),
            AnyMedium::Flakes(m) => m.is_piecewise_constant(),
            AnyMedium::Fibres(m) => m.is_piecewise_constant(),
        }
    }
}

/// A collision in one of the scene's media.
pub struct Collision<'a> {
    /// Distance from the ray's origin, mm.
    pub t: f32,
    site: AnySite<'a>,
}

enum AnySite<'a> {
    Grid(&'a GridMedium, <GridMedium as Medium>::Site),
    Cloth(&'a ClothMedium, <ClothMedium as Medium>::Site),
    Flakes(&'a FlakeMedium, <FlakeMedium as Medium>::Site),
    Fibres(&'a FibreMedium, <FibreMedium as Medium>::Site),
}

impl Collision<'_> {
    /// Albedo times phase, per channel; see [`Medium::eval`].
    pub fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        match &self.site {
            AnySite::Grid(m, s) => m.eval(s, w_out, w_in),
            AnySite::Cloth(m, s) => m.eval(s, w_out, w_in),
            AnySite::Flakes(m, s) => m.eval(s, w_out, w_in),
            AnySite::Fibres(m, s) => m.eval(s, w_out, w_in),
        }
    }

    /// A scattered direction; see [`Medium::sample`].
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        match &self.site {
            AnySite::Grid(m, s) => m.sample(s, w_out, rng),
            AnySite::Cloth(m, s) => m.sample(s, w_out, rng),
            AnySite::Flakes(m, s) => m.sample(s, w_out, rng),
            AnySite::Fibres(m, s) => m.sample(s, w_out, rng),
        }
    }

    /// From the collision to where a ray toward `w_in` starts, mm; see
    /// [`Medium::exit_mm`].
    pub fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        match &self.site {
            AnySite::Grid(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Cloth(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Flakes(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Fibres(m, s) => m.exit_mm(s, w_out, w_in, rng),
        }
    }

    fn settle(&mut self, w_out: Vec3, rng: &mut PathRng) {
        match &mut self.site {
            AnySite::Grid(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Cloth(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Flakes(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Fibres(m, s) => *s = m.settle(*s, w_out, rng),
        }
    }

    /// What to show of the place.
    pub fn info(&self) -> SiteInfo {
        match &self.site {
            AnySite::Grid(m, s) => m.info(s),
            AnySite::Cloth(m, s) => m.info(s),
            AnySite::Flakes(m, s) => m.info(s),
            AnySite::Fibres(m, s) => m.info(s),
        }
    }
}

impl Scene {
    /// The first collision along a ray, in whichever medium. Collisions of
    /// superposed media are independent, so the nearest of each medium's own
    /// first collision is the first of their sum.
    pub fn first_collision(
        &self,
        ray: &Ray,
        integrator: Integrator,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let mut nearest: Option<Collision<'_>> = None;
        for medium in &self.media {
            let limit = nearest.as_ref().map_or(f32::INFINITY, |c| c.t);
            let found = match medium {
                AnyMedium::Grid(m) => collide(m, ray, limit, integrator, rng, stats)
                    .map(|(t, s)| (t, AnySite::Grid(m, s))),
                AnyMedium::Cloth(m) => collide(m, ray, limit, integrator, rng, stats)
                    .map(|(t, s)| (t, AnySite::Cloth(m, s))),
                AnyMedium::Flakes(m) => collide(m, ray, limit, integrator, rng, stats)
                    .map(|(t, s)| (t, AnySite::Flakes(m, s))),
                AnyMedium::Fibres(m) => collide(m, ray, limit, integrator, rng, stats)
                    .map(|(t, s)| (t, AnySite::Fibres(m, s))),
            };
            if let Some((t, site)) = found {
                nearest = Some(Collision { t, site });
            }
        }
        if let Some(collision) = &mut nearest {
            collision.settle(-ray.direction, rng);
        }
        nearest
    }

    /// Estimates the transmittance from a point to infinity.
    pub fn transmittance(
        &self,
        ray: &Ray,
        integrator: Integrator,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        stats.shadow_rays += 1;
        let mut product = 1.0;
        for medium in &self.media {
            product *= match medium {
                AnyMedium::Grid(m) => pass(m, ray, integrator, rng, stats),
                AnyMedium::Cloth(m) => pass(m, ray, integrator, rng, stats),
                AnyMedium::Flakes(m) => pass(m, ray, integrator, rng, stats),
                AnyMedium::Fibres(m) => pass(m, ray, integrator, rng, stats),
            };
            if product == 0.0 {
                break;
            }
        }
        product
    }

    /// Distance in mm along a ray from far away to just before the first
    /// matter: where a walk in `f32` should start.
    pub fn near_start(&self, origin_mm: DVec3, direction: DVec3) -> f64 {
        let nearest = self
            .media
            .iter()
            .map(|m| m.lattice().distance_mm(origin_mm, direction))
            .fold(f64::INFINITY, f64::min);
        if nearest.is_finite() { nearest } else { 0.0 }
    }
}

fn collide<M: Medium>(
    medium: &M,
    ray: &Ray,
    limit: f32,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> Option<(f32, M::Site)> {
    let local: LocalRay = medium.lattice().clip(ray, limit)?;
    let found = match integrator {
        Integrator::Woodcock => tracking::sample_collision(medium, &local, rng, stats),
        Integrator::Regular => tracking::sample_collision_exactly(medium, &local, rng, stats),
    };
    found.map(|(t, site)| (local.t_entry + t, site))
}

fn pass<M: Medium>(
    medium: &M,
    ray: &Ray,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    match medium.lattice().clip(ray, f32::INFINITY) {
        None => 1.0,
        Some(local) => match integrator {
            Integrator::Woodcock => tracking::transmittance(medium, &local, rng, stats),
            Integrator::Regular => tracking::exact_transmittance(medium, &local, stats),
        },
    }
}
