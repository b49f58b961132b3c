//! Everything light can meet.

use crate::detail::{Detail, Tracking};
use crate::draping::{Draping, find, pass_through};
use crate::lattice::Lattice;
use crate::sheet::SheetSite;
use crate::{
    Camera, ClothMedium, ExplicitFibres, FibreHit, FibreMedium, FlakeMedium, GridMedium,
    Integrator, LevelledCloth, Light, Medium, Plane, SiteInfo, Stats,
};
use glam::{DVec3, Mat3, Vec2, Vec3};
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
    /// An octree of fibres, as micro-flakes of another family.
    Flakes(FlakeMedium),
    /// An octree of fibres, as virtual fibres.
    Fibres(FibreMedium),
    /// Fibres themselves.
    Explicit(ExplicitFibres),
    /// A cloth in several representations, or over a mesh.
    Levelled(Box<LevelledCloth>),
    /// No medium but an opaque plane.
    Plane(Plane),
}

impl AnyMedium {
    /// Where the medium is; `None` for a plane, which has no box.
    pub fn lattice(&self) -> Option<&Lattice> {
        match self {
            AnyMedium::Grid(m) => Some(m.lattice()),
            AnyMedium::Cloth(m) => Some(m.lattice()),
            AnyMedium::Flakes(m) => Some(m.lattice()),
            AnyMedium::Fibres(m) => Some(m.lattice()),
            AnyMedium::Explicit(m) => Some(m.lattice()),
            AnyMedium::Levelled(m) => Some(m.lattice()),
            AnyMedium::Plane(_) => None,
        }
    }

    /// Cuts a medium to a rectangle of the x-y plane ([`Lattice::cut_to`]).
    /// `None` when nothing would be left, or it is a plane or over a mesh.
    pub fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        let lattice = match self {
            AnyMedium::Grid(m) => m.lattice_mut(),
            AnyMedium::Cloth(m) => m.lattice_mut(),
            AnyMedium::Flakes(m) => m.lattice_mut(),
            AnyMedium::Fibres(m) => m.lattice_mut(),
            AnyMedium::Explicit(m) => m.lattice_mut(),
            AnyMedium::Levelled(m) => return m.cut_to(min_mm, max_mm),
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
            AnyMedium::Flakes(m) => m.is_piecewise_constant(),
            AnyMedium::Fibres(m) => m.is_piecewise_constant(),
            AnyMedium::Levelled(m) => m.is_piecewise_constant(),
            // What is solid takes no stepping.
            AnyMedium::Explicit(_) | AnyMedium::Plane(_) => true,
        }
    }

    /// The first collision along a ray before `limit` mm.
    pub(crate) fn collide(
        &self,
        ray: &Ray,
        limit: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let by = tracking.integrator;
        let (t, site) = match self {
            AnyMedium::Grid(m) => {
                collide(m, ray, limit, by, rng, stats).map(|(t, s)| (t, AnySite::Grid(m, s)))
            }
            AnyMedium::Cloth(m) => {
                collide(m, ray, limit, by, rng, stats).map(|(t, s)| (t, AnySite::Cloth(m, s)))
            }
            AnyMedium::Flakes(m) => {
                collide(m, ray, limit, by, rng, stats).map(|(t, s)| (t, AnySite::Flakes(m, s)))
            }
            AnyMedium::Fibres(m) => {
                collide(m, ray, limit, by, rng, stats).map(|(t, s)| (t, AnySite::Fibres(m, s)))
            }
            AnyMedium::Explicit(m) => m
                .first_hit(ray, limit, stats)
                .map(|(t, s)| (t, AnySite::Explicit(m, s))),
            AnyMedium::Levelled(m) => return m.collide(ray, limit, tracking, rng, stats),
            AnyMedium::Plane(p) => p.hit(ray, limit).map(|t| (t, AnySite::Plane(p, ray.at(t)))),
        }?;
        Some(Collision::new(t, site))
    }

    /// Estimates the transmittance from a point to `reach` mm along a ray.
    pub(crate) fn pass(
        &self,
        ray: &Ray,
        reach: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let by = tracking.integrator;
        match self {
            AnyMedium::Grid(m) => pass(m, ray, reach, by, rng, stats),
            AnyMedium::Cloth(m) => pass(m, ray, reach, by, rng, stats),
            AnyMedium::Flakes(m) => pass(m, ray, reach, by, rng, stats),
            AnyMedium::Fibres(m) => pass(m, ray, reach, by, rng, stats),
            AnyMedium::Explicit(m) => f32::from(!m.blocks(ray, reach, stats)),
            AnyMedium::Levelled(m) => m.pass(ray, reach, tracking, rng, stats),
            AnyMedium::Plane(p) => f32::from(p.hit(ray, reach).is_none()),
        }
    }

    /// Whether the medium can fill a shell: it repeats, and asks for nothing
    /// but extinction along straight lines.
    pub(crate) fn can_be_draped(&self) -> bool {
        match self {
            AnyMedium::Grid(_)
            | AnyMedium::Cloth(_)
            | AnyMedium::Flakes(_)
            | AnyMedium::Fibres(_) => self.lattice().is_some_and(Lattice::repeats),
            AnyMedium::Explicit(_) | AnyMedium::Levelled(_) | AnyMedium::Plane(_) => false,
        }
    }

    /// [`AnyMedium::collide`] of a medium that fills a shell.
    pub(crate) fn collide_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        limit: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let by = tracking.integrator;
        let (t, site, turn) = match self {
            AnyMedium::Grid(m) => over
                .collide(m, ray, limit, by, rng, stats)
                .map(|(t, s, turn)| (t, AnySite::Grid(m, s), turn)),
            AnyMedium::Cloth(m) => over
                .collide(m, ray, limit, by, rng, stats)
                .map(|(t, s, turn)| (t, AnySite::Cloth(m, s), turn)),
            AnyMedium::Flakes(m) => over
                .collide(m, ray, limit, by, rng, stats)
                .map(|(t, s, turn)| (t, AnySite::Flakes(m, s), turn)),
            AnyMedium::Fibres(m) => over
                .collide(m, ray, limit, by, rng, stats)
                .map(|(t, s, turn)| (t, AnySite::Fibres(m, s), turn)),
            AnyMedium::Explicit(_) | AnyMedium::Levelled(_) | AnyMedium::Plane(_) => None,
        }?;
        let turn = Some(turn);
        Some(Collision { t, site, turn })
    }

    /// [`AnyMedium::pass`] of a medium that fills a shell.
    pub(crate) fn pass_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        reach: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let by = tracking.integrator;
        match self {
            AnyMedium::Grid(m) => over.pass(m, ray, reach, by, rng, stats),
            AnyMedium::Cloth(m) => over.pass(m, ray, reach, by, rng, stats),
            AnyMedium::Flakes(m) => over.pass(m, ray, reach, by, rng, stats),
            AnyMedium::Fibres(m) => over.pass(m, ray, reach, by, rng, stats),
            AnyMedium::Explicit(_) | AnyMedium::Levelled(_) | AnyMedium::Plane(_) => 1.0,
        }
    }
}

/// A collision with some of the scene's matter.
pub struct Collision<'a> {
    /// Distance from the ray's origin, mm.
    pub t: f32,
    site: AnySite<'a>,
    /// From the matter's own directions to the world's, where they differ.
    turn: Option<Mat3>,
}

pub(crate) enum AnySite<'a> {
    Grid(&'a GridMedium, <GridMedium as Medium>::Site),
    Cloth(&'a ClothMedium, <ClothMedium as Medium>::Site),
    Flakes(&'a FlakeMedium, <FlakeMedium as Medium>::Site),
    Fibres(&'a FibreMedium, <FibreMedium as Medium>::Site),
    Explicit(&'a ExplicitFibres, FibreHit),
    Sheet(SheetSite<'a>),
    /// With where it is hit.
    Plane(&'a Plane, Vec3),
}

impl<'a> Collision<'a> {
    pub(crate) fn new(t: f32, site: AnySite<'a>) -> Collision<'a> {
        let turn = None;
        Collision { t, site, turn }
    }

    /// A direction of the world in the matter's own frame.
    fn own(&self, w: Vec3) -> Vec3 {
        self.turn.map_or(w, |turn| turn.transpose() * w)
    }

    /// And back.
    fn world(&self, w: Vec3) -> Vec3 {
        self.turn.map_or(w, |turn| turn * w)
    }

    /// Albedo times phase, per channel; see [`Medium::eval`].
    pub fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        let (w_out, w_in) = (self.own(w_out), self.own(w_in));
        match &self.site {
            AnySite::Grid(m, s) => m.eval(s, w_out, w_in),
            AnySite::Cloth(m, s) => m.eval(s, w_out, w_in),
            AnySite::Flakes(m, s) => m.eval(s, w_out, w_in),
            AnySite::Fibres(m, s) => m.eval(s, w_out, w_in),
            AnySite::Explicit(m, s) => m.eval(s, w_out, w_in),
            AnySite::Sheet(s) => s.eval(w_out, w_in),
            AnySite::Plane(p, _) => p.eval(w_out, w_in),
        }
    }

    /// A scattered direction; see [`Medium::sample`].
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let w_out = self.own(w_out);
        let drawn = match &self.site {
            AnySite::Grid(m, s) => m.sample(s, w_out, rng),
            AnySite::Cloth(m, s) => m.sample(s, w_out, rng),
            AnySite::Flakes(m, s) => m.sample(s, w_out, rng),
            AnySite::Fibres(m, s) => m.sample(s, w_out, rng),
            AnySite::Explicit(m, s) => m.sample(s, w_out, rng),
            AnySite::Sheet(s) => s.sample(w_out, rng),
            AnySite::Plane(p, _) => p.sample(w_out, rng),
        }?;
        Some(LobeSample {
            w_in: self.world(drawn.w_in),
            ..drawn
        })
    }

    /// Density with which [`Collision::sample`] draws `w_in`, 1/sr.
    pub fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let (w_out, w_in) = (self.own(w_out), self.own(w_in));
        match &self.site {
            AnySite::Grid(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Cloth(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Flakes(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Fibres(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Explicit(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Sheet(s) => s.pdf(w_out, w_in),
            AnySite::Plane(p, _) => p.pdf(w_out, w_in),
        }
    }

    /// Radiance that the matter itself sends along `w_out`.
    pub fn emitted(&self, w_out: Vec3) -> Rgb {
        match &self.site {
            AnySite::Plane(p, _) => p.emitted(w_out),
            AnySite::Grid(..)
            | AnySite::Cloth(..)
            | AnySite::Flakes(..)
            | AnySite::Fibres(..)
            | AnySite::Explicit(..)
            | AnySite::Sheet(_) => Rgb::BLACK,
        }
    }

    /// From the collision to where a ray toward `w_in` starts, mm; see
    /// [`Medium::exit_mm`].
    pub fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let (w_out, w_in) = (self.own(w_out), self.own(w_in));
        let exit = match &self.site {
            AnySite::Grid(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Cloth(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Flakes(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Fibres(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Explicit(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Sheet(s) => s.exit_mm(w_in),
            AnySite::Plane(p, at) => p.lift_mm(*at, w_in),
        };
        self.world(exit)
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
        let w_out = self.own(w_out);
        match &mut self.site {
            AnySite::Grid(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Cloth(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Flakes(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Fibres(m, s) => *s = m.settle(*s, w_out, rng),
            AnySite::Explicit(..) | AnySite::Sheet(_) | AnySite::Plane(..) => {}
        }
    }

    /// What to show of the place; `None` of a plane, which is no cloth.
    pub fn info(&self) -> Option<SiteInfo> {
        let info = match &self.site {
            AnySite::Grid(m, s) => Some(m.info(s)),
            AnySite::Cloth(m, s) => Some(m.info(s)),
            AnySite::Flakes(m, s) => Some(m.info(s)),
            AnySite::Fibres(m, s) => Some(m.info(s)),
            AnySite::Explicit(m, s) => Some(m.info(s)),
            AnySite::Sheet(s) => Some(s.info()),
            AnySite::Plane(..) => None,
        }?;
        Some(SiteInfo {
            axis: self.world(info.axis),
            ..info
        })
    }
}

impl Scene {
    /// The first collision along a ray, with whichever matter. Collisions of
    /// superposed media are independent, so the nearest of each medium's own
    /// first collision is the first of their sum.
    pub fn first_collision(
        &self,
        ray: &Ray,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let mut nearest: Option<Collision<'_>> = None;
        for medium in &self.media {
            let limit = nearest.as_ref().map_or(f32::INFINITY, |c| c.t);
            nearest = medium.collide(ray, limit, tracking, rng, stats).or(nearest);
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
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        stats.shadow_rays += 1;
        let mut product = 1.0;
        for medium in &self.media {
            product *= medium.pass(ray, reach, tracking, rng, stats);
            if product == 0.0 {
                break;
            }
        }
        product
    }

    /// How a camera ray and the path that follows it track: through the
    /// representations that suit the width of its pixel.
    ///
    /// Random numbers are drawn only where there are several to choose from.
    pub fn tracking(
        &self,
        integrator: Integrator,
        (origin_mm, direction): (DVec3, DVec3),
        rng: &mut PathRng,
    ) -> Tracking {
        let cone = self.camera.pixel_cone(direction);
        let footprint = |m: &AnyMedium| match m {
            AnyMedium::Levelled(m) => m.footprint_mm(cone, origin_mm, direction),
            _ => None,
        };
        let nearest = self.media.iter().filter_map(footprint).reduce(f64::min);
        Tracking {
            integrator,
            detail: nearest.map_or(Detail::FINEST, |width| Detail {
                footprint_mm: width as f32,
                choice: rng.unit(),
            }),
        }
    }

    /// Distance in mm along a ray from far away to just before the first
    /// matter or light with a place: where a walk in `f32` should start.
    pub fn near_start(&self, lights: &[Light], origin_mm: DVec3, direction: DVec3) -> f64 {
        let matter = self.media.iter().map(|m| match m {
            AnyMedium::Plane(p) => before(p.distance_mm(origin_mm, direction)),
            AnyMedium::Grid(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Cloth(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Flakes(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Fibres(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Explicit(m) => m.lattice().distance_mm(origin_mm, direction),
            AnyMedium::Levelled(m) => m.lattice().distance_mm(origin_mm, direction),
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
    let local = medium.lattice().clip(ray, limit)?;
    find(medium, &local, integrator, rng, stats).map(|(t, site)| (local.t_entry + t, site))
}

fn pass<M: Medium>(
    medium: &M,
    ray: &Ray,
    reach: f32,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    let local = medium.lattice().clip(ray, reach);
    local.map_or(1.0, |local| {
        pass_through(medium, &local, integrator, rng, stats)
    })
}
