//! The interface of cloth without thickness: what a walk, a goniometer and an
//! exporter ask of a surface model.

use crate::LobeSample;
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb};

/// The piece of cloth that a ray sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Its middle in the fabric plane, mm: x along the weft, y along the warp.
    pub position_mm: Vec2,
    /// Its diameter, mm; zero for a point, infinite for the mean over the whole
    /// cloth.
    pub width_mm: f32,
}

impl Footprint {
    /// The whole cloth.
    pub const FAR: Footprint = Footprint::new(Vec2::ZERO, f32::INFINITY);

    /// So wide about a place.
    pub const fn new(position_mm: Vec2, width_mm: f32) -> Footprint {
        Footprint {
            position_mm,
            width_mm,
        }
    }

    /// A point.
    pub fn point(position_mm: Vec2) -> Footprint {
        Footprint::new(position_mm, 0.0)
    }
}

/// What happens to a ray that arrives at a surface and is not absorbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passage {
    /// It meets nothing and continues unchanged. No other strategy finds it.
    Straight,
    /// It is scattered, as [`Surface::sample`] draws it.
    Scattered(LobeSample),
}

/// A two-sided surface that reflects, transmits and lets light through its gaps.
///
/// # Contract
/// - **Directions** are unit vectors in the fabric frame (x along the weft, y
///   along the warp, z out of the face) that point away from the cloth. `w_out`
///   is where light leaves to, back along the walk; `w_in` is where it comes
///   from. Both on one side is reflection, on opposite sides transmission.
/// - **Delta transmission is apart.** [`gap`](Surface::gap) is the share of an
///   arriving ray that passes straight through. `eval`, `pdf` and `sample` never
///   contain it.
/// - **`eval`** is the scattered radiance along `w_out` over the irradiance on
///   the fabric plane from `w_in`, 1/sr, without a cosine: the BSDF. It counts
///   gaps as cloth, so it is the mean over yarn and gaps. Its mean over the cloth is
///   symmetric in its two directions; at a place it belongs to the line of sight
///   along `w_out`.
/// - **`pdf`** is the density of scattered `w_in` per solid angle and per
///   *arriving* ray, 1/sr. It integrates to at most `1 - gap(w_out)`; what is
///   missing is absorbed.
/// - **`sample`** draws for a ray that is known to have met yarn: `w_in` with
///   density `pdf / (1 - gap(w_out))`. The sample's `pdf` is that of `pdf`, its
///   `weight` is `eval |cos theta_in| / pdf`, all that the throughput of a walk
///   that met yarn is multiplied by. `None` means that the light is absorbed.
/// - Every method returns finite, non-negative numbers for any unit directions,
///   and black, zero or `None` for directions in the plane of the cloth.
pub trait Surface: Send + Sync {
    /// Share of a ray along `w` that passes straight through.
    fn gap(&self, w: Vec3, at: Footprint) -> f32;

    /// Scattered light, 1/sr.
    fn eval(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb;

    /// Density of scattered directions per arriving ray, 1/sr.
    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> f32;

    /// Draws where the light of a ray that met yarn comes from.
    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample>;

    /// Draws what happens to an arriving ray: straight through with probability
    /// `gap`, else as [`sample`](Surface::sample). `None` means absorbed.
    fn pass_or_sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<Passage> {
        if rng.unit() < self.gap(w_out, at) {
            return Some(Passage::Straight);
        }
        self.sample(w_out, at, rng).map(Passage::Scattered)
    }

    /// Unit direction of the yarn in the middle of the footprint, in the fabric
    /// frame; zero where there is none.
    fn axis(&self, at: Footprint) -> Vec3;
}

impl<S: Surface + ?Sized> Surface for Box<S> {
    fn gap(&self, w: Vec3, at: Footprint) -> f32 {
        (**self).gap(w, at)
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        (**self).eval(w_out, w_in, at)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> f32 {
        (**self).pdf(w_out, w_in, at)
    }

    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample> {
        (**self).sample(w_out, at, rng)
    }

    fn pass_or_sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<Passage> {
        (**self).pass_or_sample(w_out, at, rng)
    }

    fn axis(&self, at: Footprint) -> Vec3 {
        (**self).axis(at)
    }
}

/// A surface moved in its own plane.
#[derive(Debug)]
pub struct Shifted<S> {
    surface: S,
    origin_mm: Vec2,
}

impl<S: Surface> Shifted<S> {
    /// `origin_mm` is the place in `surface` that comes to the origin.
    pub fn new(surface: S, origin_mm: Vec2) -> Shifted<S> {
        Shifted { surface, origin_mm }
    }

    fn within(&self, at: Footprint) -> Footprint {
        Footprint {
            position_mm: at.position_mm + self.origin_mm,
            ..at
        }
    }
}

impl<S: Surface> Surface for Shifted<S> {
    fn gap(&self, w: Vec3, at: Footprint) -> f32 {
        self.surface.gap(w, self.within(at))
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        self.surface.eval(w_out, w_in, self.within(at))
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> f32 {
        self.surface.pdf(w_out, w_in, self.within(at))
    }

    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample> {
        self.surface.sample(w_out, self.within(at), rng)
    }

    fn pass_or_sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<Passage> {
        self.surface.pass_or_sample(w_out, self.within(at), rng)
    }

    fn axis(&self, at: Footprint) -> Vec3 {
        self.surface.axis(self.within(at))
    }
}
