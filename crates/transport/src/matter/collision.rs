//! Collisions of light with any kind of matter.

use crate::matter::sheet::SheetSite;
use crate::{
    ExplicitFibres, FibreHit, FlakeOctreeMedium, GridMedium, Medium, Plane, SggxOctreeMedium,
    SiteInfo, VirtualFibreMedium,
};
use glam::{Mat3, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_scatter::LobeSample;

/// One expression for every kind of matter that is tracked collision by
/// collision, of [`crate::AnyMedium`] or [`AnySite`]; the arms of the others follow.
macro_rules! each_volume {
    ($kind:ident, $of:expr, ($($part:ident),+) => $same:expr, $($others:tt)+) => {
        match $of {
            $kind::Grid($($part),+) => $same,
            $kind::SggxOctree($($part),+) => $same,
            $kind::FlakeOctree($($part),+) => $same,
            $kind::VirtualFibres($($part),+) => $same,
            $($others)+
        }
    };
}
pub(crate) use each_volume;

/// A collision with some of the scene's matter.
pub struct Collision<'a> {
    /// Distance from the ray's origin, mm.
    pub t: f32,
    site: AnySite<'a>,
    /// From the matter's own directions to the world's, where they differ.
    turn: Option<Mat3>,
    /// From differences of the matter's own places to the world's, where the turn does
    /// not serve.
    stretch: Option<Mat3>,
}

pub(crate) enum AnySite<'a> {
    Grid(&'a GridMedium, <GridMedium as Medium>::Site),
    SggxOctree(&'a SggxOctreeMedium, <SggxOctreeMedium as Medium>::Site),
    FlakeOctree(&'a FlakeOctreeMedium, <FlakeOctreeMedium as Medium>::Site),
    VirtualFibres(&'a VirtualFibreMedium, <VirtualFibreMedium as Medium>::Site),
    ExplicitFibres(&'a ExplicitFibres, FibreHit),
    Sheet(SheetSite<'a>),
    /// With where it is hit.
    Plane(&'a Plane, Vec3),
}

/// Media whose sites are kinds of their own.
pub(crate) trait Located: Medium {
    /// A site with its medium.
    fn located(&self, site: Self::Site) -> AnySite<'_>;
}

macro_rules! located {
    ($($kind:ident: $medium:ty),+) => {$(
        impl Located for $medium {
            fn located(&self, site: Self::Site) -> AnySite<'_> {
                AnySite::$kind(self, site)
            }
        }
    )+};
}
located!(Grid: GridMedium, SggxOctree: SggxOctreeMedium, FlakeOctree: FlakeOctreeMedium, VirtualFibres: VirtualFibreMedium);

impl<'a> Collision<'a> {
    pub(crate) fn new(t: f32, site: AnySite<'a>) -> Collision<'a> {
        Collision {
            t,
            site,
            turn: None,
            stretch: None,
        }
    }

    /// In matter whose directions differ from the world's.
    pub(crate) fn turned(t: f32, site: AnySite<'a>, turn: Mat3) -> Collision<'a> {
        Collision {
            turn: Some(turn),
            ..Collision::new(t, site)
        }
    }

    /// In matter whose directions and lengths differ from the world's.
    pub(crate) fn stretched(t: f32, site: AnySite<'a>, turn: Mat3, stretch: Mat3) -> Self {
        Collision {
            stretch: Some(stretch),
            ..Collision::turned(t, site, turn)
        }
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
        each_volume!(AnySite, &self.site, (m, s) => m.eval(s, w_out, w_in),
            AnySite::ExplicitFibres(m, s) => m.eval(s, w_out, w_in),
            AnySite::Sheet(s) => s.eval(w_out, w_in),
            AnySite::Plane(p, _) => p.eval(w_out, w_in),
        )
    }

    /// A scattered direction; see [`Medium::sample`].
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let w_out = self.own(w_out);
        let drawn = each_volume!(AnySite, &self.site, (m, s) => m.sample(s, w_out, rng),
            AnySite::ExplicitFibres(m, s) => m.sample(s, w_out, rng),
            AnySite::Sheet(s) => s.sample(w_out, rng),
            AnySite::Plane(p, _) => p.sample(w_out, rng),
        )?;
        Some(LobeSample {
            w_in: self.world(drawn.w_in),
            ..drawn
        })
    }

    /// Density with which [`Collision::sample`] draws `w_in`, 1/sr.
    pub fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let (w_out, w_in) = (self.own(w_out), self.own(w_in));
        each_volume!(AnySite, &self.site, (m, s) => m.pdf(s, w_out, w_in),
            AnySite::ExplicitFibres(m, s) => m.pdf(s, w_out, w_in),
            AnySite::Sheet(s) => s.pdf(w_out, w_in),
            AnySite::Plane(p, _) => p.pdf(w_out, w_in),
        )
    }

    /// Radiance that the matter itself sends along `w_out`.
    pub fn emitted(&self, w_out: Vec3) -> Rgb {
        match &self.site {
            AnySite::Plane(p, _) => p.emitted(w_out),
            _ => Rgb::BLACK,
        }
    }

    /// From the collision to where a ray toward `w_in` starts, mm; see
    /// [`Medium::exit_mm`].
    pub fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let (w_out, w_in) = (self.own(w_out), self.own(w_in));
        let exit = each_volume!(AnySite, &self.site, (m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::ExplicitFibres(m, s) => m.exit_mm(s, w_out, w_in, rng),
            AnySite::Sheet(s) => s.exit_mm(w_in),
            AnySite::Plane(p, at) => p.lift_mm(*at, w_in),
        );
        match self.stretch {
            Some(stretch) => stretch * exit,
            None => self.world(exit),
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
            AnySite::VirtualFibres(m, s) => m.local_visibility(s, at_mm, w_out, w_in),
            _ => None,
        }
    }

    /// Draws what the light meets at this collision; see [`Medium::draw_event`].
    pub(crate) fn draw_event(&mut self, w_out: Vec3, rng: &mut PathRng) {
        let w_out = self.own(w_out);
        each_volume!(AnySite, &mut self.site, (m, s) => *s = m.draw_event(*s, w_out, rng),
            AnySite::ExplicitFibres(..) | AnySite::Sheet(_) | AnySite::Plane(..) => {}
        );
    }

    /// What to show of the place; `None` of a plane, which is no cloth.
    pub fn info(&self) -> Option<SiteInfo> {
        let info = each_volume!(AnySite, &self.site, (m, s) => Some(m.info(s)),
            AnySite::ExplicitFibres(m, s) => Some(m.info(s)),
            AnySite::Sheet(s) => Some(s.info()),
            AnySite::Plane(..) => None,
        )?;
        Some(SiteInfo {
            axis: self.world(info.axis),
            ..info
        })
    }
}
