//! A patch under the whole of the sun's radiation, from what it does to two parts of it.

use crate::{Draw, DrawNumbered, Exit, Look, PatchResponse, PathNames, PathRun};
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb, mix64};
use organza_transport::Stats;
use std::ops::Range;

/// The sum of a patch seen by light, whose channels count alike, and of the same patch in the near
/// infrared, which is grey. Some paths go through the one and some through the other.
pub struct SolarPatch<P> {
    /// The patch as light sees it.
    pub visible: P,
    /// The same in the near infrared.
    pub nir: P,
    /// Share of the near infrared in the radiation.
    pub nir_share: f64,
}

/// What a path of light is worth to the sum, times a weight.
fn grey(value: Rgb, weight: f32) -> Rgb {
    Rgb::splat(weight * value.0.element_sum() / 3.0)
}

fn grey_exit(exit: Exit, weight: f32) -> Exit {
    Exit {
        escape: exit.escape.map(|(w, value)| (w, grey(value, weight))),
        absorbed: grey(exit.absorbed, weight),
        ..exit
    }
}

impl<P: PatchResponse> SolarPatch<P> {
    /// The patch that a random number of a path chooses.
    fn drawn(&self, number: f64) -> &P {
        if number < self.nir_share {
            &self.nir
        } else {
            &self.visible
        }
    }

    /// The patch for one named path, apart from its random numbers.
    fn of_path(&self, names: &PathNames, path: u64) -> &P {
        let bits = mix64(names.seed ^ mix64(names.stream ^ mix64(path ^ 0x0073_6f6c_6172)));
        self.drawn((bits >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Traces parts of the paths by a patch each. What they find is `seen` with the factor by which
    /// each path counts more than its share says. A single path is drawn.
    fn parts<T>(
        &self,
        run: PathRun<'_, T>,
        trace: impl Fn(&P, PathRun<'_, T>),
        seen: impl Fn(T, f32) -> T,
    ) {
        let Range { start, end } = run.names.paths.clone();
        let count = end.saturating_sub(start);
        let mut part = |patch: &P, paths: Range<u64>, weight: f64| {
            let names = PathNames {
                paths,
                ..run.names.clone()
            };
            let part = PathRun {
                names: &names,
                stats: run.stats,
                found: &mut |found| (run.found)(seen(found, weight as f32)),
            };
            trace(patch, part);
        };
        if count < 2 {
            part(self.of_path(run.names, start), start..end, 1.0);
            return;
        }
        let nir = (self.nir_share * count as f64).round() as u64;
        let nir = nir.clamp(1, count - 1);
        let weight = |share: f64, paths: u64| share * count as f64 / paths as f64;
        part(&self.nir, start..start + nir, weight(self.nir_share, nir));
        let visible_share = 1.0 - self.nir_share;
        let visible = count - nir;
        part(
            &self.visible,
            start + nir..end,
            weight(visible_share, visible),
        );
    }

    /// Traces every path by the patch that is drawn for it.
    fn each<T>(
        &self,
        run: PathRun<'_, T>,
        trace: impl Fn(&P, PathRun<'_, T>),
        seen: impl Fn(T, f32) -> T,
    ) {
        for path in run.names.paths.clone() {
            let names = PathNames {
                paths: path..path + 1,
                ..run.names.clone()
            };
            let one = PathRun {
                names: &names,
                stats: run.stats,
                found: &mut |found| (run.found)(seen(found, 1.0)),
            };
            trace(self.of_path(run.names, path), one);
        }
    }
}

impl<P: PatchResponse> PatchResponse for SolarPatch<P> {
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
        let patch = self.drawn(f64::from(rng.unit()));
        grey(patch.estimate_bsdf(w_in, w_out, rng, stats), 1.0)
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        let patch = self.drawn(f64::from(rng.unit()));
        grey(patch.estimate_at(place_mm, w_in, w_out, rng, stats), 1.0)
    }

    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        let patch = self.drawn(f64::from(rng.unit()));
        grey_exit(patch.estimate_exit(w, rng, stats), 1.0)
    }

    fn each_bsdf(&self, directions: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        self.parts(run, |patch, run| patch.each_bsdf(directions, run), grey);
    }

    fn each_bsdf_at(&self, place: &Draw<'_, Vec2>, pair: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        self.each(run, |patch, run| patch.each_bsdf_at(place, pair, run), grey);
    }

    fn each_exit(&self, from: &Draw<'_, Vec3>, run: PathRun<'_, Exit>) {
        self.parts(run, |patch, run| patch.each_exit(from, run), grey_exit);
    }

    fn each_exit_at(&self, start: &DrawNumbered<'_, (Vec2, Vec3)>, run: PathRun<'_, Exit>) {
        self.each(run, |patch, run| patch.each_exit_at(start, run), grey_exit);
    }

    fn each_look(&self, place: &DrawNumbered<'_, Vec2>, run: PathRun<'_, Look>) {
        let seen = |look: Look, weight| Look {
            exit: grey_exit(look.exit, weight),
            ..look
        };
        self.each(run, |patch, run| patch.each_look(place, run), seen);
    }
}
