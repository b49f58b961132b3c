//! Everything light can meet.

use crate::lattice::{Lattice, LocalRay};
use crate::{
    Camera, ClothMedium, ExplicitFibres, FibreHit, FibreMedium, GridMedium, Integrator, Light,
    Medium, Plane, SiteInfo, Stats, tracking,
};
use glam::{DVec3, Vec2, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use organza_scatter::LobeSample;

/// Media, lights and the camera that looks at them.
pub struct Scene {
    /// Matter; extinctions of media add where boxes overlap.
    pub media: Vec<AnyMedium>,
    /// Lights; their light adds.
    pub lights: Vec<Light>,
    /// The camera.
    pub camera: Camera,
}

/// The closed set of matter, resolved once per ray.
pub enum AnyMedium {
    /// Dense grids.
    Grid(GridMedium),
    /// An octree of fibres, as micro-flakes.
    Cloth(ClothMedium),
    /// An octree of fibres, as virtual fibres.
    Fibres(FibreMedium),
    /// Fibres themselves.
    Explicit(ExplicitFibres),
    /// No medium but an opaque plane.
    Plane(Plane),
}

impl AnyMedium {
    /// Where the medium is; `None` for a plane, which has no box.
    pub fn lattice(&self) -> Option<&Lattice> {
        match self {
            AnyMedium::Grid(m) => Some(m.lattice()),
            AnyMedium::Cloth(m) => Some(m.lattice()),
            AnyMedium::Fibres(m) => Some(m.lattice()),
            AnyMedium::Explicit(m) => Some(m.lattice()),
            AnyMedium::Plane(_) => None,
        }
    }

    /// Cuts a medium to a rectangle of the x-y plane ([`Lattice::cut_to`]).
    /// `None`, and unchanged, when nothing would be left or it is a plane.
    pub fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        let lattice = match self {
            AnyMedium::Grid(m) => m.lattice_mut(),
            AnyMedium::Cloth(m) => m.lattice_mut(),
            AnyMedium::Fibres(m) => m.lattice_mut(),
            AnyMedium::Explicit(m) => m.lattice_mut(),
            AnyMedium::Plane(_) => return None,
        };
        *lattice = lattice.cut_to(min_mm, max_mm)?;
        Some(())
    }

    /// True when exact stepping is possible.
    pub fn is_piecewise_constant(&self) -> bool {
        match self {
            AnyMedium::Grid(m) => m.is_piecewise_constant(),
            AnyMedium::Cloth(m) => m.is_piecewise_constant(),
            AnyMedium::Fibres(m) => m.is_piecewise_constant(),
            // What is solid takes no stepping.
            AnyMedium::Explicit(_) | AnyMedium::Plane(_) => true,
        }
    }
}

/// A collision with some of the scene's matter.
pub struct Collision<'a> {
    /// Distance from the ray's origin, mm.
    pub t: f32,
    site: AnySite<'a>,
}

enum AnySite<'a> {
    Grid(&'a GridMedium, <GridMedium as Medium>::Site),
    Cloth(&'a ClothMedium, <ClothMedium as Medium>::Site),
    Fibres(&'a FibreMedium, <FibreMedium as Medium>::Site),
    Explicit(&'a ExplicitFibres, FibreHit),
    /// With where it is hit.
    Plane(&'a Plane, Vec3),
}

impl Collision<'_> {
    /// Albedo times phase, per channel; see [`Medium::eval`].
    pub fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        match &self.site {
            AnySite::Grid(m, s) => m.eval(s, w_out, w_in),
            AnySite::Cloth(m, s) => m.eval(s, w_out, w_in),
            AnySite::Fibres(m, s) => m.eval(s, w_out, w_in),
            AnySite::Explicit(m, s) => m.eval(s, w_out, w_in),
            AnySite::Plane(p, _) => p.eval(w_out, w_in),
        }
    }

    /// A scattered direction; see [`Medium::sample`].
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        match &self.site {
            AnySite::Grid(m, s) => m.sample(s, w_out, rng),
            AnySite::Cloth(m, s) => m.sample(s, w_out, rng),
            AnySite::Fibres(m, s) => m.sample(s, w_out, rng),
            AnySite::Explicit(m, s) => m.sample(s, w_out, rng),
            AnySite::Plane(p, _) => p.sample(w_out, rng),
        }
    }

    /// Density with which [`Collision::sample`] draws `w_in`, 1/sr.
    pub fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        match &self.site {
            AnySite::Grid(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Cloth(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Fibres(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Explicit(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Plane(p, _) => p.pdf(w_out, w_in),
        }
    }

    /// Radiance that the matter itself sends along `w_out`.
    pub fn emitted(&self, w_out: Vec3) -> Rgb {
        match &self.site {
            AnySite::Plane(p, _) => p.emitted(w_out),
            AnySite::Grid(..)
            | AnySite::Cloth(..)
            | AnySite::Fibres(..)
            | AnySite::Explicit(..) => Rgb::BLACK,
        }
    }

    /// From the collision to where a ray toward `w_in` starts, mm; see
    /// [`Medium::exit_mm`].
    pub fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        match &self.site {
            AnySite::Grid(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Cloth(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Fibres(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Explicit(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Plane(p, at) => p.lift_mm(*at, w_in),
        }
    }

    /// Visibility within the cell around the collision at `at_mm`, and the
    /// distance to the cell's face, where matter has tables of it.
    pub(crate) fn local_visibility(
        &self,
        at_mm: Vec3,
        w_out: Vec3,
        w_in: Vec3,
    ) -> Option<(f32, f32)> {
        match &self.site {
            AnySite::Fibres(m, s) => m.local_visibility(s, at_mm, w_out, w_in),
            _ => None,
        }
    }

    fn settle(&mut self, w_out: Vec3, rng: &mut PathRng) {
        match &mut self.site {
            AnySite::Grid(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Cloth(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Fibres(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Explicit(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Plane(..) => {}
        }
    }

    /// What to show of the place; `None` of a plane, which is no cloth.
    pub fn info(&self) -> Option<SiteInfo> {
        match &self.site {
            AnySite::Grid(m, s) => Some(m.info(s)),
            AnySite::Cloth(m, s) => Some(m.info(s)),
            AnySite::Fibres(m, s) => Some(m.info(s)),
            AnySite::Explicit(m, s) => Some(m.info(s)),
            AnySite::Plane(..) => None,
        }
    }
}

impl Scene {
    /// The first collision along a ray, with whichever matter. Collisions of
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
                AnyMedium::Fibres(m) => collide(m, ray, limit, integrator, rng, stats)
                    .map(|(t, s)| (t, AnySite::Fibres(m, s))),
                AnyMedium::Explicit(m) => m
                    .first_hit(ray, limit, stats)
                    .map(|(t, s)| (t, AnySite::Explicit(m, s))),
                AnyMedium::Plane(p) => p.hit(ray, limit).map(|t| (t, AnySite::Plane(p, ray.at(t)))),
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

    /// Estimates the transmittance from a point to `reach` mm along a ray,
    /// which may be infinite.
    pub fn transmittance(
        &self,
        ray: &Ray,
        reach: f32,
        integrator: Integrator,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        stats.shadow_rays += 1;
        let mut product = 1.0;
        for medium in &self.media {
            product *= match medium {
                AnyMedium::Grid(m) => pass(m, ray, reach, integrator, rng, stats),
                AnyMedium::Cloth(m) => pass(m, ray, reach, integrator, rng, stats),
                AnyMedium::Fibres(m) => pass(m, ray, reach, integrator, rng, stats),
                AnyMedium::Explicit(m) => f32::from(!m.blocks(ray, reach, stats)),
                AnyMedium::Plane(p) => f32::from(p.hit(ray, reach).is_none()),
            };
            if product == 0.0 {
                break;
            }
        }
        product
    }

    /// Distance in mm along a ray from far away to just before the first
    /// matter or light with a place: where a walk in `f32` should start.
    pub fn near_start(&self, lights: &[Light], origin_mm: DVec3, direction: DVec3) -> f64 {
        let matter = self.media.iter().map(|m| match m {
            AnyMedium::Plane(p) => before(p.distance_mm(origin_mm, direction)),
            AnyMedium::Grid(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Cloth(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Fibres(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Explicit(m) => m.lattice().distance_mm(origin_mm, direction),
        });
        let places = lights
            .iter()
            .filter_map(|l| l.distance_mm(origin_mm, direction))
            .map(before);
        let nearest = matter.chain(places).fold(f64::INFINITY, f64::min);
        if nearest.is_finite() { nearest } else { 0.0 }
    }
}

/// A little short of what has no thickness, which a ray that starts on it
/// would miss.
fn before(distance_mm: f64) -> f64 {
    (distance_mm - 1.0).max(0.0)
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
    reach: f32,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    match medium.lattice().clip(ray, reach) {
        None => 1.0,
        Some(local) => match integrator {
            Integrator::Woodcock => tracking::transmittance(medium, &local, rng, stats),
            Integrator::Regular => tracking::exact_transmittance(medium, &local, stats),
        },
    }
}
