//! Events from which a path goes on more than once.

use super::importance::Importance;
use super::paths::{Column, Paths, State, get, put, store};
use super::work::WAVE;
use glam::{IVec2, IVec3, Vec3};
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, Mask, SetBits};

/// A path is divided where it carries more than the inverse of this over its importance.
const SCALE: f32 = 3.0;
/// Most paths that one is divided into.
const MAX_PATHS: f32 = 8.0;
/// Branches that a slot has room for from the start.
const ROOM: usize = 16;

/// A fibre that was met, from which the path of a slot goes on once more later.
#[derive(Clone, Copy)]
struct Branch {
    piece: u32,
    along: f32,
    axis_at: Vec3,
    out: Vec3,
    cell: IVec3,
    period: IVec2,
    direction: Vec3,
    throughput: Vec3,
    bounces: u32,
}

/// The branches that the paths of a wave have left to follow.
pub struct Branches {
    waiting: Vec<Vec<Branch>>,
    /// Slots that are at the fibre of a branch, whose light has been looked for.
    pub resumed: [bool; WAVE],
    /// Events before the first branch.
    events: [Option<u32>; WAVE],
}

impl Branches {
    pub fn new() -> Branches {
        Branches {
            waiting: (0..WAVE).map(|_| Vec::with_capacity(ROOM)).collect(),
            resumed: [false; WAVE],
            events: [None; WAVE],
        }
    }
}

/// The last branch that a slot has left to follow, if any: it is at its fibre then.
pub fn resume(paths: &mut Paths, slot: usize) -> bool {
    let Some(branch) = paths.branches.waiting[slot].pop() else {
        return false;
    };
    paths.branches.events[slot].get_or_insert(paths.bounces[slot]);
    paths.branches.resumed[slot] = true;
    paths.met.piece[slot] = branch.piece;
    paths.met.along[slot] = branch.along;
    put(&mut paths.met.axis_at, slot, branch.axis_at);
    put(&mut paths.met.out, slot, branch.out);
    paths.met.cell[slot] = branch.cell;
    paths.met.period[slot] = branch.period;
    put(&mut paths.direction, slot, branch.direction);
    put(&mut paths.throughput, slot, branch.throughput);
    paths.bounces[slot] = branch.bounces;
    paths.state[slot] = State::Met;
    true
}

/// Events of the path that a slot has ended, without those of its branches.
pub fn events(paths: &mut Paths, slot: usize) -> u32 {
    let own = paths.branches.events[slot].take();
    own.unwrap_or(paths.bounces[slot])
}

/// Divides the paths of the lanes of a mask, which have just met fibres along tangents:
/// gives what each carries on, and leaves the others to be followed later.
#[inline(always)]
pub fn divide<F: Floats>(
    importance: &Importance,
    paths: &mut Paths,
    first: usize,
    (tangent, direction, throughput): (V3<F>, V3<F>, V3<F>),
    rng: &mut LaneRng<F::Ints>,
    mask: F::Mask,
) -> V3<F> {
    let one = F::splat(1.0);
    let lamps = importance.of_lamps(tangent, direction);
    let wanted = throughput.sum() * lamps * F::splat(SCALE / 3.0);
    let wanted = wanted.min(F::splat(MAX_PATHS));
    let divided = mask & one.below(wanted);
    if !divided.any() {
        return throughput;
    }
    let wanted = wanted.or_where_not(divided, one);
    let [u, ..] = rng.units(divided);
    let mut counts: Column = [0.0; WAVE];
    (wanted + u).floor().store(&mut counts);
    let carried = throughput.scaled(one / wanted);
    let mut each = [[0.0; WAVE]; 3];
    store(&mut each, 0, carried);
    for lane in SetBits(divided.bits()) {
        let slot = first + lane;
        let branch = Branch {
            piece: paths.met.piece[slot],
            along: paths.met.along[slot],
            axis_at: get(&paths.met.axis_at, slot),
            out: get(&paths.met.out, slot),
            cell: paths.met.cell[slot],
            period: paths.met.period[slot],
            direction: get(&paths.direction, slot),
            throughput: get(&each, lane),
            bounces: paths.bounces[slot],
        };
        for _ in 1..counts[lane] as u32 {
            paths.branches.waiting[slot].push(branch);
        }
    }
    carried.or_where_not(divided, throughput)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fibres::matter::FibreMatter;
    use glam::DVec3;
    use organza_basis::Rgb;
    use organza_lanes::{Ints, one};
    use organza_light::{DirectionalLight, Light};

    /// What all the paths carry that one is divided into, on average over many numbers, and
    /// how many they are.
    fn carried(throughput: Vec3) -> (DVec3, f64) {
        let sun = Light::from(DirectionalLight::new(Vec3::NEG_Z, Rgb::WHITE));
        let importance = Importance::new(&[sun], Vec3::ZERO).unwrap();
        let matter = FibreMatter::new(&[], Vec::new(), u64::MAX).unwrap();
        let mut paths = Paths::new(&matter);
        let v = |v: Vec3| V3::<one::F>::splat(v);
        let (mut sum, mut made, tries) = (DVec3::ZERO, 0, 4096);
        for index in 0..tries {
            paths.begin(0, (7, 9), index, Vec3::Z);
            let mut rng =
                LaneRng::from_words([0, 1, 2].map(|k| <one::U as Ints>::splat(paths.rng[k][0])));
            let way = (v(Vec3::X), v(Vec3::Z), v(throughput));
            let on = divide(&importance, &mut paths, 0, way, &mut rng, true);
            sum += DVec3::new(on.x.0.into(), on.y.0.into(), on.z.0.into());
            made += 1;
            while resume(&mut paths, 0) {
                sum += get(&paths.throughput, 0).as_dvec3();
                made += 1;
            }
            assert_eq!(events(&mut paths, 0), 0);
        }
        let tries = f64::from(tries);
        (sum / tries, f64::from(made) / tries)
    }

    #[test]
    fn divided_paths_carry_what_one_carried() {
        for throughput in [Vec3::new(1.0, 0.5, 0.25), Vec3::splat(0.173)] {
            let (mean, made) = carried(throughput);
            let throughput = throughput.as_dvec3();
            // A count is one of two neighbours: it deviates by half a path at most.
            let error = 4.0 * 0.5 / 64.0 / made * throughput.x;
            assert!(mean.abs_diff_eq(throughput, error), "{mean}");
            // The known-bad twin: every path carries all.
            let back = made * throughput;
            assert!(!back.abs_diff_eq(throughput, error), "{made}");
        }
        let (mean, made) = carried(Vec3::splat(0.05));
        assert!(made == 1.0, "too little to be divided: {made}");
        assert!(mean.abs_diff_eq(DVec3::splat(0.05), 1e-8), "{mean}");
    }
}
