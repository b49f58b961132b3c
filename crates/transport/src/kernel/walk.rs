//! The walk: one path in every lane, and a new one where one has ended.

use super::environment::Lamp;
use super::film_rays::{inverse_of_step, with_sign_of};
use super::flat_medium::{
    AXIS_ZERO, EMPTY, END_ON_ONE, FlatMedium, INDEX_BITS, NO_POPULATION, Reach,
};
use super::lanes::{Floats, Ints, MAX_LANES, Mask};
use super::light_table::{LightTable, MOST_DEPTH};
use super::math::{LaneRng, V3, exp2, minus_ln, pixel_key, positive, sin_cos_of_turns};
use super::tally::{Sample, Tally};
use super::{Block, Kernel};
use crate::Stats;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, LOG2_E};

/// A flight that ends in a border looks so far ahead along each axis, in
/// voxels, so that it looks beyond the border whatever rounding did. It may so
/// pass an edge between voxels on the wrong side, by as much at the most.
const AHEAD: f32 = 1.0 / 1024.0;

/// Steps between two looks at which lanes met something or left.
const STEPS_PER_ROUND: usize = 2;

/// Survival probability of Russian roulette over the mean throughput.
const ROULETTE_SCALE: f32 = 5.0;

/// Room for rounding when an extinction is held against its bound.
const BOUND_SLACK: f32 = 1.0 + 1e-5;

/// A bound that nothing reaches, 1/mm.
const UNKNOWN: f32 = 1e30;

/// A flake population in every lane.
#[derive(Clone, Copy)]
struct Flakes<F: Floats> {
    scaled_axis: V3<F>,
    end_on: F,
}

impl<F: Floats> Flakes<F> {
    #[inline(always)]
    fn unpack(words: [F::Ints; 2]) -> Flakes<F> {
        let low = F::Ints::splat(0xffff);
        let root = words[1].shr::<16>().to_floats() * F::splat(1.0 / END_ON_ONE);
        Flakes {
            scaled_axis: V3 {
                x: axis_component::<F>(words[0] & low),
                y: axis_component::<F>(words[0].shr::<16>()),
                z: axis_component::<F>(words[1] & low),
            },
            end_on: root * root,
        }
    }

    /// `sqrt(e^2 + |t' x w|^2)`, exact when looking along the fibre.
    #[inline(always)]
    fn area(&self, w: V3<F>) -> F {
        let across = self.scaled_axis.cross(w);
        self.end_on.mul_add(self.end_on, across.dot(across)).sqrt()
    }

    /// S^1/2 v, given one over 1 + e.
    #[inline(always)]
    fn root(&self, v: V3<F>, per_one_and_end_on: F) -> V3<F> {
        let along = self.scaled_axis.dot(v) * per_one_and_end_on;
        self.scaled_axis.scaled_add(-along, v)
    }

    /// Mirror phase function toward `w_in`, given one over the area that
    /// `w_out` sees; see `MicroFlake::eval`. Quadratic forms are times e^2, so
    /// that there is one division.
    #[inline(always)]
    fn phase(&self, w_out: V3<F>, per_area: F, w_in: V3<F>) -> F {
        let h = w_out + w_in;
        let squared = h.dot(h);
        let along = self.scaled_axis.dot(h);
        let e2 = self.end_on * self.end_on;
        let q = along.mul_add(along, squared * e2);
        let scale = F::splat(0.25 * FRAC_1_PI) * e2 * self.end_on * per_area;
        let value = scale * squared * squared / (q * q).max(F::splat(f32::MIN_POSITIVE));
        // Half vector undefined: the mean over the circle of possible ones.
        let opposite = squared.below(F::splat(1e-10));
        if opposite.any() {
            let per_square = per_area * per_area;
            let sum = e2.mul_add(per_square, F::splat(1.0)) * per_square;
            let mean = F::splat(0.125 * FRAC_1_PI) * sum;
            return mean.or_where_not(opposite, value);
        }
        value
    }

    /// Draws where a mirror flake sends `w_out`; see `MicroFlake::sample`.
    #[inline(always)]
    fn scatter(&self, w_out: V3<F>, per_area: F, turns: F, height: F) -> V3<F> {
        let one = F::splat(1.0);
        let (sin, cos) = sin_cos_of_turns(turns);
        let r = (F::splat(4.0) * height * (one - height)).sqrt();
        let on_sphere = V3 {
            x: r * cos,
            y: r * sin,
            z: height.mul_add(F::splat(-2.0), one),
        };
        let per_one_and_end_on = one / (one + self.end_on);
        let seen = self
            .root(w_out, per_one_and_end_on)
            .scaled_add(per_area, on_sphere);
        let m = self.root(seen, per_one_and_end_on);
        let across = w_out.dot(m) / m.dot(m).max(F::splat(f32::MIN_POSITIVE));
        let w_in = m.scaled(across + across) - w_out;
        // One step toward unit length, against rounding along a path.
        w_in.scaled(w_in.dot(w_in).mul_add(F::splat(-0.5), F::splat(1.5)))
    }
}

#[inline(always)]
fn axis_component<F: Floats>(code: F::Ints) -> F {
    code.to_floats()
        .mul_add(F::splat(1.0 / AXIS_ZERO), F::splat(-1.0))
}

/// The state of the paths in all lanes.
struct Paths<F: Floats> {
    rng: LaneRng<F::Ints>,
    /// Place in voxels, within the first period.
    at: V3<F>,
    direction: V3<F>,
    /// The voxel looked at last, around which `bound` holds.
    cell: V3<F>,
    /// Voxels per mm, and mm per voxel, along the way.
    step: V3<F>,
    per_step: V3<F>,
    /// What the last voxel said of its surroundings.
    bound: F,
    reach: F,
    /// Way from the camera, mm.
    depth_mm: F,
    throughput: V3<F>,
    radiance: V3<F>,
    bounces: F::Ints,
    /// The population that the lane meets, and the first that its path met.
    population: F::Ints,
    first_population: F::Ints,
    first_depth_mm: F,
    /// In flight; at an event; outside.
    flying: F::Mask,
    met: F::Mask,
    gone: F::Mask,
}

/// What the lanes work for.
struct Posts {
    lanes: [Post; MAX_LANES],
    /// Pixels handed out.
    next_turn: usize,
}

/// What one lane works for.
#[derive(Clone, Copy, Default)]
struct Post {
    /// None when there is nothing left to do.
    place: Option<Place>,
    /// The sample under way.
    sample: u32,
    tally: Tally,
}

/// A pixel.
#[derive(Clone, Copy)]
struct Place {
    /// Its number in the block.
    pixel: usize,
    /// Its column and row in the whole picture.
    film: [f32; 2],
    key: (u32, u32),
}

/// Walks all paths of a block.
#[inline(always)]
pub(super) fn walk<F: Floats>(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
    let mut stats = Stats::default();
    let zero = F::splat(0.0);
    let zeros = V3::splat(Vec3::ZERO);
    let none = F::Mask::from_bits(0);
    let zero_bits = F::Ints::splat(0);
    let mut paths = Paths::<F> {
        rng: LaneRng::new((zero_bits, zero_bits), zero_bits),
        at: zeros,
        cell: zeros,
        direction: zeros,
        step: zeros,
        per_step: zeros,
        bound: F::splat(1.0),
        reach: F::splat(1.0),
        depth_mm: zero,
        throughput: zeros,
        radiance: zeros,
        bounces: zero_bits,
        population: zero_bits,
        first_population: F::Ints::splat(NO_POPULATION),
        first_depth_mm: zero,
        flying: none,
        met: none,
        gone: none,
    };
    let mut posts = Posts {
        lanes: [Post::default(); MAX_LANES],
        next_turn: 0,
    };
    let all = u32::MAX >> (32 - F::LANES);
    let mut ended = F::Mask::from_bits(all);
    loop {
        if ended.any() {
            regenerate(kernel, block, &mut paths, &mut posts, ended, &mut stats);
        }
        if !(paths.flying | paths.gone).any() {
            return stats;
        }
        for _ in 0..STEPS_PER_ROUND {
            fly(kernel, &mut paths, &mut stats);
        }
        ended = paths.gone;
        if paths.gone.any() {
            escape(kernel, &mut paths);
        }
        if paths.met.any() {
            ended = ended | scatter(kernel, &mut paths, &mut stats);
        }
    }
}

/// One flight to a tentative collision or to the end of the reach, and the
/// look-up there, for the lanes in flight.
#[inline(always)]
fn fly<F: Floats>(kernel: &Kernel, paths: &mut Paths<F>, stats: &mut Stats) {
    let medium = &kernel.medium;
    let dims = medium.lattice.dims();
    let size = dims.as_vec3();
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let word = F::Ints::splat;
    let [u_flight, u_real, u_which] = paths.rng.units(paths.flying);

    // The box within which the bound holds, and where the flight leaves it.
    let (from, step, per_step) = (paths.cell, paths.step, paths.per_step);
    let half = paths.reach - F::splat(0.5);
    let exit = way_out(half, paths.at.x, from.x, step.x, per_step.x)
        .min(way_out(half, paths.at.y, from.y, step.y, per_step.y))
        .min(way_out(half, paths.at.z, from.z, step.z, per_step.z));
    let flight = minus_ln(positive(u_flight)) / paths.bound;
    let tentative = flight.below(exit);
    let way = flight.min(exit).or_where_not(paths.flying, zero);
    let mut at = step.scaled_add(way, paths.at);
    paths.depth_mm = paths.depth_mm + way;

    // The voxel there: of the box, or of those behind its border.
    let around = paths.reach - one;
    let mut cell = V3 {
        x: voxel_within(at.x, from.x, around).or_where_not(tentative, voxel_ahead(at.x, step.x)),
        y: voxel_within(at.y, from.y, around).or_where_not(tentative, voxel_ahead(at.y, step.y)),
        z: voxel_within(at.z, from.z, around).or_where_not(tentative, voxel_ahead(at.z, step.z)),
    };
    let mut outside = is_outside(cell.z, size.z);
    if medium.lattice.repeats() {
        let (px, py) = (period(cell.x, size.x), period(cell.y, size.y));
        cell.x = cell.x - px;
        cell.y = cell.y - py;
        at.x = at.x - px;
        at.y = at.y - py;
    } else {
        outside = outside | is_outside(cell.x, size.x) | is_outside(cell.y, size.y);
    }
    paths.at = at.or_where_not(paths.flying, paths.at);
    paths.cell = cell.or_where_not(paths.flying, paths.cell);
    let x = index_in(cell.x, size.x);
    let y = index_in(cell.y, size.y);
    let z = index_in(cell.z, size.z);
    let found = (x + word(dims.x) * (y + word(dims.y) * z)).gather(&medium.cells);

    // One of its populations.
    let empty = (found & word(EMPTY)).equals(word(EMPTY));
    let others = found.shr::<INDEX_BITS>() & word(3);
    let which = (u_which * (others.to_floats() + one)).to_ints();
    let population = (found & word((1 << INDEX_BITS) - 1)) + which;
    let base = population.shl::<2>();
    let table = &medium.populations[..];
    let words = [
        base.gather(table),
        (base + word(1)).gather(table),
        (base + word(2)).gather(table),
        (base + word(3)).gather(table),
    ];
    let flakes = Flakes::<F>::unpack([words[0], words[1]]);
    let extinction = words[2].as_floats() * flakes.area(paths.direction);

    let considered = paths.flying & tentative & !outside & !empty;
    let met = considered & (positive(u_real) * paths.bound).below(extinction);
    let excess = considered & (paths.bound * F::splat(BOUND_SLACK)).below(extinction);
    stats.tentative += u64::from((paths.flying & tentative & !outside).bits().count_ones());
    stats.collisions += u64::from(met.bits().count_ones());
    stats.majorant_violations += u64::from(excess.bits().count_ones());
    paths.population = population.or_where_not(met, paths.population);
    paths.met = paths.met | met;

    // What it says of its surroundings.
    let packed = found.or_where_not(empty, words[3]);
    let bound = (packed & word(0xfff)).shl::<16>() + word(Reach::BOUND_BASE);
    let bound = bound.as_floats() * F::splat(medium.bound_scale);
    let reach = (packed.shr::<12>() & word(0xf)).shl::<22>() + word(Reach::STEPS_BASE);
    paths.bound = bound.or_where_not(paths.flying, paths.bound);
    paths.reach = reach.as_floats().or_where_not(paths.flying, paths.reach);

    let left = paths.flying & outside;
    paths.gone = paths.gone | left;
    paths.flying = paths.flying & !(met | left);
}

/// From a place to where it leaves the box of `half` an edge around the middle
/// of a voxel, along one axis.
#[inline(always)]
fn way_out<F: Floats>(half: F, at: F, cell: F, step: F, per_step: F) -> F {
    (cell + F::splat(0.5) + with_sign_of(half, step) - at) * per_step
}

/// The voxel of a place, at most so many from another.
#[inline(always)]
fn voxel_within<F: Floats>(at: F, cell: F, around: F) -> F {
    at.floor().max(cell - around).min(cell + around)
}

/// The voxel just ahead of a place.
#[inline(always)]
fn voxel_ahead<F: Floats>(at: F, step: F) -> F {
    (at + with_sign_of(F::splat(AHEAD), step)).floor()
}

#[inline(always)]
fn is_outside<F: Floats>(cell: F, size: f32) -> F::Mask {
    cell.below(F::splat(0.0)) | !cell.below(F::splat(size))
}

/// What takes a voxel into the first period when taken away.
#[inline(always)]
fn period<F: Floats>(cell: F, size: f32) -> F {
    ((cell + F::splat(0.5)) * F::splat(1.0 / size)).floor() * F::splat(size)
}

#[inline(always)]
fn index_in<F: Floats>(cell: F, size: f32) -> F::Ints {
    cell.max(F::splat(0.0)).min(F::splat(size - 1.0)).to_ints()
}

/// The environment, for the lanes that have left.
#[inline(always)]
fn escape<F: Floats>(kernel: &Kernel, paths: &mut Paths<F>) {
    let [behind, before] = kernel.environment;
    let back = paths.direction.z.below(F::splat(0.0));
    let mut sky = V3::splat(behind).or_where_not(back, V3::splat(before));
    let unscattered = paths.bounces.equals(F::Ints::splat(0));
    for picture in &kernel.skies {
        sky = sky + picture.radiance_toward(paths.direction, unscattered);
    }
    let lit = paths.radiance + paths.throughput.times(sky);
    paths.radiance = lit.or_where_not(paths.gone, paths.radiance);
    paths.gone = F::Mask::from_bits(0);
}

/// The events of the lanes that met something: light, a new direction,
/// roulette. Gives the lanes whose paths end.
#[inline(always)]
fn scatter<F: Floats>(kernel: &Kernel, paths: &mut Paths<F>, stats: &mut Stats) -> F::Mask {
    let medium = &kernel.medium;
    let word = F::Ints::splat;
    let one = F::splat(1.0);
    let first = paths.met & paths.first_population.equals(word(NO_POPULATION));
    paths.first_population = paths.population.or_where_not(first, paths.first_population);
    paths.first_depth_mm = paths.depth_mm.or_where_not(first, paths.first_depth_mm);
    let cut = paths.met & paths.bounces.equals(word(kernel.max_bounces));
    stats.cut += u64::from(cut.bits().count_ones());
    let met = paths.met & !cut;
    paths.bounces = (paths.bounces + word(1)).or_where_not(met, paths.bounces);

    let base = paths.population.shl::<2>();
    let table = &medium.populations[..];
    let flakes = Flakes::<F>::unpack([base.gather(table), (base + word(1)).gather(table)]);
    let albedo = (base + word(3)).gather(table).shr::<16>().shl::<2>();
    let albedo = V3 {
        x: albedo.gather(&medium.albedos).as_floats(),
        y: (albedo + word(1)).gather(&medium.albedos).as_floats(),
        z: (albedo + word(2)).gather(&medium.albedos).as_floats(),
    };
    let w_out = V3 {
        x: -paths.direction.x,
        y: -paths.direction.y,
        z: -paths.direction.z,
    };
    let per_area = one / flakes.area(w_out);
    let mut throughput = paths.throughput.times(albedo);
    let mean = throughput.sum() * F::splat(1.0 / 3.0);

    for lights in kernel.lights.chunks(3) {
        let units = paths.rng.units(met);
        for (light, u) in lights.iter().zip(units) {
            let phase = flakes.phase(w_out, per_area, V3::splat(light.to_light));
            let scattered = throughput
                .scaled(phase)
                .times(V3::splat(light.irradiance.0));
            let through = exp2(depth_from_table(light, paths.at) * F::splat(-LOG2_E));
            // An exact shadow ray where there is light to be set right.
            let share = mean * phase * F::splat(kernel.residual_scale);
            let keep = (share * (through + F::splat(kernel.residual_floor))).min(one);
            let traced = met & u.below(keep);
            let mut shown = through;
            if traced.any() {
                let exact = trace_exactly(light, paths.at, traced, stats);
                let set_right = (exact - through) / keep + through;
                shown = set_right.or_where_not(traced, through);
            }
            let lit = scattered.scaled_add(shown, paths.radiance);
            paths.radiance = lit.or_where_not(met, paths.radiance);
        }
    }

    for sky in &kernel.skies {
        for lamp in &sky.lamps {
            let [place, own, u] = paths.rng.units(met);
            let [across, down, _] = paths.rng.units(met);
            let drawn = sky.sample(lamp, [place, own, across, down]);
            let phase = flakes.phase(w_out, per_area, drawn.to_light);
            let scattered = throughput.scaled(phase).times(drawn.irradiance);
            let through = exp2(depth_from_table(&lamp.table, paths.at) * F::splat(-LOG2_E));
            let share = mean * phase * F::splat(kernel.residual_scale);
            let keep = (share * (through + F::splat(kernel.residual_floor))).min(one);
            let traced = met & u.below(keep);
            let mut shown = through;
            if traced.any() {
                let exact = trace_toward(medium, paths.at, drawn.to_light, traced, stats);
                let set_right = (exact - through) / keep + through;
                shown = set_right.or_where_not(traced, through);
            }
            let lit = scattered.scaled_add(shown, paths.radiance);
            paths.radiance = lit.or_where_not(met, paths.radiance);
        }
    }

    let [turns, height, u_survive] = paths.rng.units(met);
    let direction = flakes.scatter(w_out, per_area, turns, height);
    let survival = (mean * F::splat(ROULETTE_SCALE)).min(one);
    let survives = met & u_survive.below(survival);
    throughput = throughput.scaled(one / survival.max(F::splat(f32::MIN_POSITIVE)));
    paths.throughput = throughput.or_where_not(survives, paths.throughput);
    let step = direction.times(V3::splat(kernel.voxels_per_mm));
    paths.direction = direction.or_where_not(survives, paths.direction);
    paths.step = step.or_where_not(survives, paths.step);
    paths.per_step = inverse_of_step(step).or_where_not(survives, paths.per_step);
    paths.flying = paths.flying | survives;
    let ended = paths.met & !survives;
    paths.met = F::Mask::from_bits(0);
    ended
}

/// Optical depth toward a light: linear between the eight nearest nodes.
#[inline(always)]
fn depth_from_table<F: Floats>(light: &LightTable, at: V3<F>) -> F {
    let word = F::Ints::splat;
    let per_voxel = light.per_voxel as f32;
    let size = light.dims.as_vec3();
    let wraps = light.repeats();
    let (x, fx) = node_before(at.x, per_voxel, size.x, wraps);
    let (y, fy) = node_before(at.y, per_voxel, size.y, wraps);
    let (z, fz) = node_before(at.z, per_voxel, size.z, false);
    let above = (z.to_floats() + F::splat(1.0))
        .min(F::splat(size.z - 1.0))
        .to_ints();
    let column = (x + word(light.dims.x) * y) * word(light.dims.z);
    let low = between_four((column + z).gather(&light.depths), fx, fy);
    let high = between_four((column + above).gather(&light.depths), fx, fy);
    (high - low).mul_add(fz, low) * F::splat(MOST_DEPTH / 255.0)
}

/// The last node before a place, along one axis, and how far behind it the
/// place is. Before the first node: the last one of the period before, or
/// itself.
#[inline(always)]
fn node_before<F: Floats>(at: F, per_voxel: f32, size: f32, wraps: bool) -> (F::Ints, F) {
    let zero = F::splat(0.0);
    let at = at.mul_add(F::splat(per_voxel), F::splat(-0.5));
    let at = if wraps { at } else { at.max(zero) };
    let low = at.floor();
    let index = (low + F::splat(size)).or_where_not(low.below(zero), low);
    (index_in(index, size), at - low)
}

/// Between the four depths of a word.
#[inline(always)]
fn between_four<F: Floats>(four: F::Ints, fx: F, fy: F) -> F {
    let byte = F::Ints::splat(0xff);
    let (a, b) = (
        (four & byte).to_floats(),
        (four.shr::<8>() & byte).to_floats(),
    );
    let (c, d) = (
        (four.shr::<16>() & byte).to_floats(),
        four.shr::<24>().to_floats(),
    );
    let (low, high) = ((b - a).mul_add(fx, a), (d - c).mul_add(fx, c));
    (high - low).mul_add(fy, low)
}

/// Exact transmittances, one lane after the other.
#[inline(always)]
fn trace_exactly<F: Floats>(
    light: &LightTable,
    at: V3<F>,
    traced: F::Mask,
    stats: &mut Stats,
) -> F {
    let (mut x, mut y, mut z) = ([0.0; MAX_LANES], [0.0; MAX_LANES], [0.0; MAX_LANES]);
    at.x.store(&mut x);
    at.y.store(&mut y);
    at.z.store(&mut z);
    let mut through = [0.0; MAX_LANES];
    for lane in SetBits(traced.bits()) {
        let (t, steps) = light.transmittance(Vec3::new(x[lane], y[lane], z[lane]));
        through[lane] = t;
        stats.shadow_rays += 1;
        stats.shadow_steps += steps;
    }
    F::load(&through)
}

/// The same toward directions of their own.
#[inline(always)]
fn trace_toward<F: Floats>(
    medium: &FlatMedium,
    at: V3<F>,
    toward: V3<F>,
    traced: F::Mask,
    stats: &mut Stats,
) -> F {
    let (mut from, mut way) = ([[0.0; MAX_LANES]; 3], [[0.0; MAX_LANES]; 3]);
    at.x.store(&mut from[0]);
    at.y.store(&mut from[1]);
    at.z.store(&mut from[2]);
    toward.x.store(&mut way[0]);
    toward.y.store(&mut way[1]);
    toward.z.store(&mut way[2]);
    let mut through = [0.0; MAX_LANES];
    for lane in SetBits(traced.bits()) {
        let from = Vec3::new(from[0][lane], from[1][lane], from[2][lane]);
        let way = Vec3::new(way[0][lane], way[1][lane], way[2][lane]);
        let (t, steps) = Lamp::transmittance(medium, from, way);
        through[lane] = t;
        stats.shadow_rays += 1;
        stats.shadow_steps += steps;
    }
    F::load(&through)
}

/// Numbers of the bits that are set.
struct SetBits(u32);

impl Iterator for SetBits {
    type Item = usize;
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (lane < 32).then_some(lane as usize)
    }
}

/// Counts the paths that have ended, and begins new ones in their lanes while
/// there are samples left.
#[inline(always)]
fn regenerate<F: Floats>(
    kernel: &Kernel,
    block: &mut Block<'_>,
    paths: &mut Paths<F>,
    posts: &mut Posts,
    ended: F::Mask,
    stats: &mut Stats,
) {
    let mut radiance = [[0.0; MAX_LANES]; 3];
    paths.radiance.x.store(&mut radiance[0]);
    paths.radiance.y.store(&mut radiance[1]);
    paths.radiance.z.store(&mut radiance[2]);
    let (mut bounces, mut first) = ([0; MAX_LANES], [0; MAX_LANES]);
    paths.bounces.store(&mut bounces);
    paths.first_population.store(&mut first);
    let mut first_depth = [0.0; MAX_LANES];
    paths.first_depth_mm.store(&mut first_depth);

    let mut key = [[0u32; MAX_LANES]; 2];
    let mut index = [0u32; MAX_LANES];
    let mut film = [[0.0f32; MAX_LANES]; 2];
    let mut begun = 0u32;
    for lane in SetBits(ended.bits()) {
        let post = &mut posts.lanes[lane];
        if let Some(place) = post.place {
            let radiance = [radiance[0][lane], radiance[1][lane], radiance[2][lane]];
            let path = Sample {
                radiance,
                bounces: bounces[lane],
                first: kernel.medium.first_event(first[lane], first_depth[lane]),
                index: post.sample,
            };
            let pixel = &mut block.pixels[place.pixel];
            if post.tally.add(&path, &kernel.brightness, pixel) {
                for x in radiance {
                    stats.brightest = stats.brightest.max(x);
                }
            } else {
                stats.rejected += 1;
            }
            post.sample += 1;
            if post.sample >= block.samples.end {
                post.tally.flush(&kernel.brightness, pixel);
                post.place = None;
            }
        }
        if post.place.is_none() {
            post.place = block.pixel(posts.next_turn).map(|(pixel, x, y)| {
                let name = u64::from(y) * u64::from(kernel.film_width) + u64::from(x);
                Place {
                    pixel,
                    film: [x as f32, y as f32],
                    key: pixel_key(kernel.seed, name),
                }
            });
            posts.next_turn += 1;
            post.sample = block.samples.start;
        }
        if let Some(place) = post.place {
            (key[0][lane], key[1][lane]) = place.key;
            index[lane] = post.sample;
            (film[0][lane], film[1][lane]) = (place.film[0], place.film[1]);
            begun |= 1 << lane;
            stats.paths += 1;
        }
    }
    let begun = F::Mask::from_bits(begun);
    if !begun.any() {
        return;
    }
    let keys = (F::Ints::load(&key[0]), F::Ints::load(&key[1]));
    let mut rng = LaneRng::new(keys, F::Ints::load(&index));
    let place = (F::load(&film[0]), F::load(&film[1]));
    let lattice = &kernel.medium.lattice;
    let rays = kernel.rays.rays::<F>(lattice, place, &mut rng, begun);
    let step = rays.direction.times(V3::splat(kernel.voxels_per_mm));
    let zeros = V3::splat(Vec3::ZERO);
    let one = F::splat(1.0);
    paths.rng = rng.or_where_not(begun, paths.rng);
    paths.at = rays.at.or_where_not(begun, paths.at);
    let cell = V3 {
        x: voxel_ahead(rays.at.x, step.x),
        y: voxel_ahead(rays.at.y, step.y),
        z: voxel_ahead(rays.at.z, step.z),
    };
    paths.cell = cell.or_where_not(begun, paths.cell);
    paths.direction = rays.direction.or_where_not(begun, paths.direction);
    paths.step = step.or_where_not(begun, paths.step);
    paths.per_step = inverse_of_step(step).or_where_not(begun, paths.per_step);
    paths.depth_mm = rays.depth_mm.or_where_not(begun, paths.depth_mm);
    paths.throughput = V3::splat(Vec3::ONE).or_where_not(begun, paths.throughput);
    paths.radiance = zeros.or_where_not(begun, paths.radiance);
    paths.bounces = F::Ints::splat(0).or_where_not(begun, paths.bounces);
    paths.first_population =
        F::Ints::splat(NO_POPULATION).or_where_not(begun, paths.first_population);
    // Nothing is known of where a path begins: the first flight has no length
    // and is met by nothing.
    paths.bound = F::splat(UNKNOWN).or_where_not(begun, paths.bound);
    paths.reach = one.or_where_not(begun, paths.reach);
    paths.gone = begun & rays.missing;
    paths.flying = paths.flying | (begun & !rays.missing);
}
