//! Tufts of cut pile: fibres that run down one leg, under the thread that binds the tuft, and up
//! the other leg.
//!
//! In the ground a leg is as thick as its yarn. Above the ground's face its fibres spread until
//! the tips of a tuft fill the room between its neighbours. Lean grows from half its value at
//! the ground to more at the tip, as in pile that was brushed and set. The tips are cut.

use crate::curve_file::PolyCurve;
use crate::dye::Dye;
use crate::strand::{any_fibre, normal, unit};
use crate::yarn::Yarn;
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, Segment};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Steps of a fibre above the ground's face, inside the ground, and under the binding thread.
const FREE_STEPS: usize = 10;
const HELD_STEPS: usize = 2;
const ROOT_STEPS: usize = 6;
/// Share of the lean that a leg has where it leaves the ground, relative to its mean.
const FIRST_LEAN: f64 = 0.4;
/// Pieces of the line of a tuft that is pushed.
pub(crate) const PUSHED_PIECES: usize = 5;
/// Height of the edge of a ridge over that of its middle (estimated). The legs of a float that is
/// cut in its middle are equally long, so ridges are round only as far as their edges lean outward.
const EDGE_HEIGHT: f64 = 0.7;
/// How many half waves a fibre has.
const HALF_WAVES: f64 = 3.0;
/// Radius at which the spiral of fibres ends, relative to the yarn's.
const FILLED: f64 = 0.97;
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Family of the random numbers of a tuft.
const TUFT: u64 = 6 << 40;

/// A tuft: two legs around a thread of the ground.
#[derive(Clone, Debug)]
pub(crate) struct Tuft {
    /// Where the middle of the binding thread lies.
    pub bound_mm: DVec3,
    /// Half its width and half its height.
    pub bound_half_mm: DVec2,
    /// Unit direction from the first leg to the second.
    pub across: DVec2,
    /// Half the room of the tips: along `across`, and beside it.
    pub room_mm: DVec2,
    /// How far the tips lie from above the roots.
    pub tip_mm: DVec2,
    /// Height of the tips above the ground's face.
    pub height_mm: f64,
    /// How far other tufts push it aside at equal steps of height, from the ground's face to the
    /// tips.
    pub pushed_mm: [DVec2; PUSHED_PIECES + 1],
    /// Index of the tuft's dye.
    pub dye: usize,
    /// The ridge that the tuft belongs to.
    pub ridge: Option<Ridge>,
}

impl Tuft {
    /// How far other tufts push it aside at a share of its height.
    fn pushed_at(&self, s: f64) -> DVec2 {
        let place = s * PUSHED_PIECES as f64;
        let below = (place as usize).min(PUSHED_PIECES - 1);
        self.pushed_mm[below].lerp(self.pushed_mm[below + 1], place - below as f64)
    }
}

/// The share of its lean that a tuft has at a share of its height.
pub(crate) fn share_of_lean(s: f64) -> f64 {
    FIRST_LEAN * s + (1.0 - FIRST_LEAN) * s * s
}

/// A ridge along the warp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ridge {
    /// Its middle, and half its width.
    pub middle_mm: f64,
    pub half_mm: f64,
}

impl Ridge {
    /// Height at a place across the ridge, relative to the middle.
    fn height(self, x_mm: f64) -> f64 {
        let u = ((x_mm - self.middle_mm) / self.half_mm).clamp(-1.0, 1.0);
        EDGE_HEIGHT + (1.0 - EDGE_HEIGHT) * (1.0 - u * u).sqrt()
    }
}

/// All tufts of a tile.
#[derive(Clone, Debug)]
pub(crate) struct Tufts {
    pub yarn: Arc<Yarn>,
    pub dyes: Vec<Dye>,
    pub tufts: Vec<Tuft>,
    /// Height of the ground's face.
    pub face_mm: f64,
    /// Width of a tip over the room that it has.
    pub splay: f64,
    /// Standard deviation of the tangent of a single fibre's lean, in either direction.
    pub fibre_lean: f64,
    /// Coefficient of variation of a single fibre's height.
    pub height_cv: f64,
    /// Root mean square of the sideways waves of a fibre, relative to its height.
    pub wave: f64,
}

/// One fibre of a tuft: its place in the round section of the leg, and its two tips.
struct Fibre {
    /// Radially outward from the binding thread, and beside it.
    offset_mm: DVec2,
    tips: [Tip; 2],
}

/// How one end of a fibre differs from its tuft.
#[derive(Clone, Copy)]
struct Tip {
    shift_mm: DVec2,
    height: f64,
    wave_mm: DVec2,
    phase_rad: f64,
}

impl Tip {
    const EVEN: Tip = Tip {
        shift_mm: DVec2::ZERO,
        height: 1.0,
        wave_mm: DVec2::ZERO,
        phase_rad: 0.0,
    };
}

impl Tufts {
    /// The fibres of a tuft, or its yarn as one curve, as the batch `batch` of a cloth.
    pub fn emit(
        &self,
        tuft: usize,
        as_fibres: bool,
        (seed, batch): (u64, usize),
        emit: &mut dyn FnMut(&Segment),
    ) {
        let mut number = 0;
        let tuft = &self.tufts[tuft];
        let mut rng = PathRng::new(seed, batch as u64, TUFT);
        self.for_each_curve(tuft, as_fibres, &mut rng, &mut |curve, material| {
            curve.for_each_segment(&mut |s| {
                emit(&Segment {
                    yarn: batch as u32,
                    fibre: number,
                    material,
                    ..*s
                });
            });
            number += 1;
        });
    }

    fn for_each_curve(
        &self,
        tuft: &Tuft,
        as_fibres: bool,
        rng: &mut PathRng,
        emit: &mut dyn FnMut(&PolyCurve, u16),
    ) {
        let yarn = &*self.yarn;
        let dye = &self.dyes[tuft.dye];
        if !as_fibres {
            let middle = Fibre {
                offset_mm: DVec2::ZERO,
                tips: [Tip::EVEN; 2],
            };
            emit(&self.curve(tuft, &middle, yarn.radius_mm()), dye.main());
            return;
        }
        let count = self.fibres();
        let turn = unit(rng) * TAU;
        let reach_mm = FILLED * (yarn.radius_mm() - yarn.fibre_radius_mm).max(0.0);
        for i in 0..count {
            // A spiral of equal areas keeps fibres apart.
            let share = ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
            let direction = DVec2::from_angle(turn + GOLDEN_ANGLE * f64::from(i));
            let (radius_mm, fibre_dye) = any_fibre(yarn, dye, rng);
            let material = fibre_dye.at(|| share);
            let tips = [(); 2].map(|()| self.tip(tuft, rng));
            let fibre = Fibre {
                offset_mm: share * reach_mm * direction,
                tips,
            };
            emit(&self.curve(tuft, &fibre, radius_mm), material);
        }
    }

    /// Fibres of a leg.
    pub fn fibres(&self) -> u32 {
        self.yarn.fibres_per_ply * self.yarn.plies
    }

    fn tip(&self, tuft: &Tuft, rng: &mut PathRng) -> Tip {
        let [lean, wave] = [self.fibre_lean, self.wave];
        let pair = |rng: &mut PathRng, deviation: f64| {
            let [x, y] = [(); 2].map(|()| normal(rng, [0.0, deviation], 1.0));
            tuft.height_mm * DVec2::new(x, y)
        };
        Tip {
            shift_mm: pair(rng, lean),
            wave_mm: pair(rng, wave),
            phase_rad: unit(rng) * PI,
            height: normal(rng, [1.0, self.height_cv], 1.0).max(0.1),
        }
    }

    /// The line of a fibre from the tip of the first leg to that of the second.
    fn curve(&self, tuft: &Tuft, fibre: &Fibre, radius_mm: f64) -> PolyCurve {
        let leg_mm = self.yarn.radius_mm();
        let bound = tuft.bound_half_mm + leg_mm + fibre.offset_mm.x;
        let (across, beside) = (tuft.across, tuft.across.perp());
        let at = |out: f64, aside: f64, z: f64| {
            let plane = tuft.bound_mm.truncate() + out * across + aside * beside;
            plane.extend(z)
        };
        let free = |side: f64, tip: &Tip, s: f64| {
            let spread = |room: f64| 1.0 + s * (self.splay * room / leg_mm - 1.0);
            let middle = bound.x - fibre.offset_mm.x;
            let out = middle
                + s * (0.5 * tuft.room_mm.x - middle)
                + fibre.offset_mm.x * spread(0.5 * tuft.room_mm.x);
            let aside = fibre.offset_mm.y * spread(tuft.room_mm.y);
            let wave = (HALF_WAVES * PI * s + tip.phase_rad).sin() - tip.phase_rad.sin();
            let lean_mm = share_of_lean(s) * (tuft.tip_mm + tip.shift_mm);
            let shift = lean_mm + s * wave * tip.wave_mm + tuft.pushed_at(s);
            let plain = at(side * out, aside, 0.0) + shift.extend(0.0);
            (plain, s)
        };
        let leg = |side: f64, tip: &Tip| -> Vec<DVec3> {
            let top = free(side, tip, 1.0).0.x;
            let ridge = tuft.ridge.map_or(1.0, |r| r.height(top));
            let height_mm = tuft.height_mm * tip.height * ridge;
            let held = (0..HELD_STEPS).map(|i| {
                let t = i as f64 / HELD_STEPS as f64;
                let z = tuft.bound_mm.z + t * (self.face_mm - tuft.bound_mm.z);
                at(side * bound.x, fibre.offset_mm.y, z)
            });
            let free = (0..=FREE_STEPS).map(|i| {
                let (plain, s) = free(side, tip, i as f64 / FREE_STEPS as f64);
                plain + (self.face_mm + s * height_mm) * DVec3::Z
            });
            held.chain(free).collect()
        };
        let mut points = leg(-1.0, &fibre.tips[0]);
        points.reverse();
        points.extend((1..ROOT_STEPS).map(|i| {
            let (sin, cos) = (PI * i as f64 / ROOT_STEPS as f64).sin_cos();
            let z = tuft.bound_mm.z - bound.y * sin;
            at(-bound.x * cos, fibre.offset_mm.y, z)
        }));
        points.extend(leg(1.0, &fibre.tips[1]));
        PolyCurve {
            radii_mm: vec![radius_mm as f32; points.len()],
            points_mm: points.iter().map(|p| p.as_vec3()).collect(),
            closed: false,
        }
    }
}
