//! A patch under the whole of the sun's radiation, from what it does to two parts of it.

use crate::{Exit, Look, PatchResponse, PathNames};
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

    /// Calls `walk` for parts of the paths: a patch, its paths, and by how much more each of them
    /// counts than its share says. A single path is drawn.
    fn parts(&self, names: &PathNames, mut walk: impl FnMut(&P, &PathNames, f32)) {
        let Range { start, end } = names.paths.clone();
        let count = end.saturating_sub(start);
        let mut part = |patch: &P, paths: Range<u64>, weight: f64| {
            let names = PathNames {
                paths,
                ..names.clone()
            };
            walk(patch, &names, weight as f32);
        };
        if count < 2 {
            part(self.of_path(names, start), start..end, 1.0);
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

    /// Calls `walk` for every path with the patch that is drawn for it.
    fn each(&self, names: &PathNames, mut walk: impl FnMut(&P, &PathNames)) {
        for path in names.paths.clone() {
            let one = PathNames {
                paths: path..path + 1,
                ..names.clone()
            };
            walk(self.of_path(names, path), &one);
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

    fn each_bsdf(
        &self,
        directions: (Vec3, Vec3),
        names: &PathNames,
        stats: &mut Stats,
        found: &mut dyn FnMut(Rgb),
    ) {
        self.parts(names, |patch, names, weight| {
            patch.each_bsdf(directions, names, stats, &mut |v| found(grey(v, weight)));
        });
    }

    fn each_bsdf_at(
        &self,
        place: &(dyn Fn(&mut PathRng) -> Vec2 + Sync),
        directions: (Vec3, Vec3),
        names: &PathNames,
        stats: &mut Stats,
        found: &mut dyn FnMut(Rgb),
    ) {
        self.each(names, |patch, names| {
            patch.each_bsdf_at(place, directions, names, stats, &mut |v| {
                found(grey(v, 1.0))
            });
        });
    }

    fn each_exit(
        &self,
        draw: &(dyn Fn(&mut PathRng) -> Vec3 + Sync),
        names: &PathNames,
        stats: &mut Stats,
        found: &mut dyn FnMut(Exit),
    ) {
        self.parts(names, |patch, names, weight| {
            patch.each_exit(draw, names, stats, &mut |e| found(grey_exit(e, weight)));
        });
    }

    fn each_exit_at(
        &self,
        start: &(dyn Fn(u64, &mut PathRng) -> (Vec2, Vec3) + Sync),
        names: &PathNames,
        stats: &mut Stats,
        found: &mut dyn FnMut(Exit),
    ) {
        self.each(names, |patch, names| {
            patch.each_exit_at(start, names, stats, &mut |e| found(grey_exit(e, 1.0)));
        });
    }

    fn each_look(
        &self,
        place: &(dyn Fn(u64, &mut PathRng) -> Vec2 + Sync),
        names: &PathNames,
        stats: &mut Stats,
        found: &mut dyn FnMut(Look),
    ) {
        self.each(names, |patch, names| {
            patch.each_look(place, names, stats, &mut |look| {
                found(Look {
                    exit: grey_exit(look.exit, 1.0),
                    ..look
                });
            });
        });
    }

    /// Which part of the radiation a single estimate is of is drawn.
    fn is_exact(&self) -> bool {
        false
    }
}
