//! The interface of a patch for goniometers.

use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_transport::Stats;
use std::ops::Range;

/// One random estimate, per channel, of where a unit of light from one direction goes. The mean
/// of the sum of all four is one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Reflected to the side of the light.
    pub reflected: Rgb,
    /// Scattered to the other side.
    pub transmitted: Rgb,
    /// Straight through, without an event.
    pub direct: Rgb,
    /// Absorbed by the cloth.
    pub absorbed: Rgb,
}

impl Energy {
    /// The sum of all shares.
    pub fn sum(&self) -> Rgb {
        self.reflected + self.transmitted + self.direct + self.absorbed
    }
}

/// The end of one path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exit {
    /// Direction away from the cloth and weight; `None` when the path was absorbed.
    pub escape: Option<(Vec3, Rgb)>,
    /// True when it met nothing on its way.
    pub is_straight: bool,
    /// The light that the cloth absorbed.
    pub absorbed: Rgb,
}

impl Exit {
    /// What escapes. A weight that is not finite counts as rejected.
    pub(crate) fn finite(&self, rejected: &mut u64) -> Option<(Vec3, Rgb)> {
        let escape = self.escape.filter(|(_, weight)| weight.0.is_finite());
        *rejected += u64::from(self.escape.is_some() && escape.is_none());
        escape
    }

    /// The shares of a unit of light from `w`.
    pub fn energy(&self, w: Vec3) -> Energy {
        let mut energy = Energy {
            absorbed: self.absorbed,
            ..Energy::default()
        };
        if let Some((direction, weight)) = self.escape {
            let share = if self.is_straight {
                &mut energy.direct
            } else if (direction.z > 0.0) == (w.z > 0.0) {
                &mut energy.reflected
            } else {
                &mut energy.transmitted
            };
            *share = weight;
        }
        energy
    }
}

/// What one path that began at a chosen place of the cloth found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look {
    /// Where its light goes.
    pub exit: Exit,
    /// What it met first; `None` when it met nothing.
    pub first: Option<FirstSight>,
    /// Scattering events.
    pub events: u32,
}

/// The first thing that a path meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstSight {
    /// Unit axis of the fibre, or zero where there is none.
    pub axis: Vec3,
    /// Height above the middle plane of the cloth, mm, towards the face.
    pub height_mm: f32,
}

/// Identifiers of the random numbers of some paths.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathNames {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Stream that the paths share.
    pub stream: u64,
    /// The paths.
    pub paths: Range<u64>,
}

impl PathNames {
    /// Paths of a stream.
    pub const fn new(seed: u64, stream: u64, paths: Range<u64>) -> PathNames {
        PathNames {
            seed,
            stream,
            paths,
        }
    }

    /// The random numbers of a path.
    pub fn rng(&self, path: u64) -> PathRng {
        PathRng::new(self.seed, self.stream, path)
    }
}

/// Draws something for a path with the first random numbers of the path.
pub type Draw<'a, T> = dyn Fn(&mut PathRng) -> T + Sync + 'a;

/// The same, by the number of the path as well.
pub type DrawNumbered<'a, T> = dyn Fn(u64, &mut PathRng) -> T + Sync + 'a;

/// Some paths that are traced in order.
pub struct PathRun<'a, T> {
    /// Their names.
    pub names: &'a PathNames,
    /// Counts, to which those of the paths are added.
    pub stats: &'a mut Stats,
    /// Takes what each of them found.
    pub found: &'a mut dyn FnMut(T),
}

impl<'a, T> PathRun<'a, T> {
    /// A run of these paths.
    pub fn new(
        names: &'a PathNames,
        stats: &'a mut Stats,
        found: &'a mut dyn FnMut(T),
    ) -> PathRun<'a, T> {
        PathRun {
            names,
            stats,
            found,
        }
    }
}

/// A patch of cloth, as volume or as surface.
///
/// Directions are unit vectors away from the cloth that do not lie in its
/// plane (`z` is not zero).
pub trait PatchResponse: Sync {
    /// One unbiased estimate of the mean BSDF of the patch, 1/sr, without light that passes
    /// straight through.
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb;

    /// The same at a place of the middle plane of the cloth, mm; unless said otherwise, the patch is
    /// the same everywhere.
    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        let _ = place_mm;
        self.estimate_bsdf(w_in, w_out, rng, stats)
    }

    /// One path of light that comes from `w`.
    ///
    /// By reciprocity it may be traced as light that leaves along `w`
    /// under a furnace that fills the sphere.
    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit;

    /// [`PatchResponse::estimate_bsdf`] of every path.
    fn each_bsdf(&self, (w_in, w_out): (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        for path in run.names.paths.clone() {
            let mut rng = run.names.rng(path);
            (run.found)(self.estimate_bsdf(w_in, w_out, &mut rng, run.stats));
        }
    }

    /// [`PatchResponse::estimate_at`] of every path, at the place of the middle plane, mm, that
    /// `place` draws.
    fn each_bsdf_at(&self, place: &Draw<'_, Vec2>, pair: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        for path in run.names.paths.clone() {
            let mut rng = run.names.rng(path);
            let place_mm = place(&mut rng);
            (run.found)(self.estimate_at(place_mm, pair.0, pair.1, &mut rng, run.stats));
        }
    }

    /// [`PatchResponse::estimate_exit`] of every path, from the direction that `from` draws.
    fn each_exit(&self, from: &Draw<'_, Vec3>, run: PathRun<'_, Exit>) {
        for path in run.names.paths.clone() {
            let mut rng = run.names.rng(path);
            let w = from(&mut rng);
            (run.found)(self.estimate_exit(w, &mut rng, run.stats));
        }
    }

    /// [`PatchResponse::estimate_exit`] of every path, through the place of the middle plane of the
    /// cloth, mm, and from the direction that `start` draws. A patch without geometry ignores the
    /// place.
    fn each_exit_at(&self, start: &DrawNumbered<'_, (Vec2, Vec3)>, run: PathRun<'_, Exit>) {
        for path in run.names.paths.clone() {
            let mut rng = run.names.rng(path);
            let (_, w) = start(path, &mut rng);
            (run.found)(self.estimate_exit(w, &mut rng, run.stats));
        }
    }

    /// Every path looks down on the face along its normal at the place of the middle plane, mm, that
    /// `place` draws. A patch without geometry finds nothing.
    fn each_look(&self, place: &DrawNumbered<'_, Vec2>, run: PathRun<'_, Look>) {
        let _ = place;
        for _ in run.names.paths.clone() {
            (run.found)(Look::default());
        }
    }

    /// True when [`estimate_bsdf`](Self::estimate_bsdf) uses no random numbers:
    /// one estimate is the value.
    fn is_exact(&self) -> bool {
        false
    }
}

impl<P: PatchResponse + ?Sized> PatchResponse for Box<P>
where
    Box<P>: Sync,
{
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
        (**self).estimate_bsdf(w_in, w_out, rng, stats)
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        (**self).estimate_at(place_mm, w_in, w_out, rng, stats)
    }

    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        (**self).estimate_exit(w, rng, stats)
    }

    fn each_bsdf(&self, directions: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        (**self).each_bsdf(directions, run);
    }

    fn each_bsdf_at(&self, place: &Draw<'_, Vec2>, pair: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        (**self).each_bsdf_at(place, pair, run);
    }

    fn each_exit(&self, from: &Draw<'_, Vec3>, run: PathRun<'_, Exit>) {
        (**self).each_exit(from, run);
    }

    fn each_exit_at(&self, start: &DrawNumbered<'_, (Vec2, Vec3)>, run: PathRun<'_, Exit>) {
        (**self).each_exit_at(start, run);
    }

    fn each_look(&self, place: &DrawNumbered<'_, Vec2>, run: PathRun<'_, Look>) {
        (**self).each_look(place, run);
    }

    fn is_exact(&self) -> bool {
        (**self).is_exact()
    }
}
