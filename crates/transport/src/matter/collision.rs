//! Collisions of light with any kind of matter.

use crate::matter::explicit_fibre_site::ExplicitFibreSite;
use crate::matter::plane::PlaneSite;
use crate::matter::plies::PlySite;
use crate::matter::sheet::SheetSite;
use crate::matter::site::{MediumSite, Site};
use crate::{FlakeOctreeMedium, GridMedium, SiteInfo, VirtualFibreMedium};
use glam::{DVec3, Mat3, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_scatter::LobeSample;

/// A collision with some of the scene's matter.
pub struct Collision<'a> {
    /// Distance from the ray's origin, mm.
    pub t: f64,
    site: AnySite<'a>,
    /// From the matter's own directions to the world's, where they differ.
    turn: Option<Mat3>,
    /// From differences of the matter's own places to the world's, where the turn does
    /// not serve.
    stretch: Option<Mat3>,
}

/// What a ray meets first, if anything.
pub(crate) type Met<'a> = Option<Collision<'a>>;

/// The site of any matter, by value, so that a collision allocates nothing.
pub(crate) enum AnySite<'a> {
    Grid(MediumSite<'a, GridMedium>),
    FlakeOctree(MediumSite<'a, FlakeOctreeMedium>),
    VirtualFibres(MediumSite<'a, VirtualFibreMedium>),
    ExplicitFibres(ExplicitFibreSite<'a>),
    Ply(PlySite<'a>),
    Sheet(SheetSite<'a>),
    Plane(PlaneSite<'a>),
}

impl<'a> AnySite<'a> {
    fn as_site(&self) -> &(dyn Site + 'a) {
        match self {
            AnySite::Grid(s) => s,
            AnySite::FlakeOctree(s) => s,
            AnySite::VirtualFibres(s) => s,
            AnySite::ExplicitFibres(s) => s,
            AnySite::Ply(s) => s,
            AnySite::Sheet(s) => s,
            AnySite::Plane(s) => s,
        }
    }
}

impl<'a> Collision<'a> {
    pub(crate) fn new(t: f64, site: AnySite<'a>) -> Collision<'a> {
        Collision {
            t,
            site,
            turn: None,
            stretch: None,
        }
    }

    /// In matter whose directions differ from the world's.
    pub(crate) fn turned(t: f64, site: AnySite<'a>, turn: Mat3) -> Collision<'a> {
        Collision {
            turn: Some(turn),
            ..Collision::new(t, site)
        }
    }

    /// In matter whose directions and lengths differ from the world's.
    pub(crate) fn stretched(t: f64, site: AnySite<'a>, turn: Mat3, stretch: Mat3) -> Self {
        Collision {
            stretch: Some(stretch),
            ..Collision::turned(t, site, turn)
        }
    }

    /// Whether it is with cloth without thickness.
    pub(crate) fn is_on_sheet(&self) -> bool {
        matches!(self.site, AnySite::Sheet(_))
    }

    /// A direction of the world in the matter's own frame.
    fn own(&self, w: Vec3) -> Vec3 {
        self.turn.map_or(w, |turn| turn.transpose() * w)
    }

    /// And back.
    fn world(&self, w: Vec3) -> Vec3 {
        self.turn.map_or(w, |turn| turn * w)
    }

    /// Albedo times phase, per channel; see [`Medium::eval`](crate::Medium::eval).
    pub fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.site.as_site().eval(self.own(w_out), self.own(w_in))
    }

    /// A scattered direction; see [`Medium::sample`](crate::Medium::sample).
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let drawn = self.site.as_site().sample(self.own(w_out), rng)?;
        Some(LobeSample {
            w_in: self.world(drawn.w_in),
            ..drawn
        })
    }

    /// Density with which [`Collision::sample`] draws `w_in`, 1/sr.
    pub fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.site.as_site().pdf(self.own(w_out), self.own(w_in))
    }

    /// Radiance that the matter itself sends along `w_out`.
    pub fn emitted(&self, w_out: Vec3) -> Rgb {
        self.site.as_site().emitted(self.own(w_out))
    }

    /// From the collision to where a ray toward `w_in` starts, mm; see
    /// [`Medium::exit_mm`](crate::Medium::exit_mm).
    pub fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let (w_out, w_in) = (self.own(w_out), self.own(w_in));
        let exit = self.site.as_site().exit_mm(w_out, w_in, rng);
        match self.stretch {
            Some(stretch) => stretch * exit,
            None => self.world(exit),
        }
    }

    /// Visibility within the cell around the collision at `at_mm`, and the
    /// distance to the cell's face, where matter has tables of it.
    pub(crate) fn local_visibility(
        &self,
        at_mm: DVec3,
        w_out: Vec3,
        w_in: Vec3,
    ) -> Option<(f32, f32)> {
        self.site
            .as_site()
            .local_visibility(at_mm.as_vec3(), w_out, w_in)
    }

    /// Draws what the light meets at this collision; see
    /// [`Medium::draw_event`](crate::Medium::draw_event).
    pub(crate) fn draw_event(&mut self, w_out: Vec3, rng: &mut PathRng) {
        let w_out = self.own(w_out);
        match &mut self.site {
            AnySite::Grid(s) => s.draw_event(w_out, rng),
            AnySite::FlakeOctree(s) => s.draw_event(w_out, rng),
            AnySite::VirtualFibres(s) => s.draw_event(w_out, rng),
            // Where these are met leaves nothing open.
            AnySite::ExplicitFibres(_)
            | AnySite::Ply(_)
            | AnySite::Sheet(_)
            | AnySite::Plane(_) => {}
        }
    }

    /// The yarn of the fibre that is met, where there is one.
    pub(crate) fn yarn(&self) -> Option<u32> {
        self.site.as_site().yarn()
    }

    /// What to show of the place; `None` of a plane, which is no cloth.
    pub fn info(&self) -> Option<SiteInfo> {
        let info = self.site.as_site().info()?;
        Some(SiteInfo {
            axis: self.world(info.axis),
            ..info
        })
    }
}
