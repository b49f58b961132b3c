//! The walk: one path in every lane, and a new one where one has ended.

use super::aim::Aim;
use super::borders::Borders;
use super::camera_rays::inverse_of_step;
use super::event::{Event, Meeting};
use super::flat_medium::{NO_POPULATION, PLACE_BITS};
use super::flat_scene::FlatScene;
use super::lane_work::{LaneWork, regenerate};
use super::optical_depth_table::depth;
use super::placed_light::Toward;
use super::voxel_words::{MOST, VoxelWords, WORDS};
use crate::block::Block;
use crate::roulette::{VOXEL_SCALE, survivors};
use glam::Vec3;
use organza_film::Stats;
use organza_lanes::math::{LaneRng, V3, minus_ln, positive, with_sign_of};
use organza_lanes::{Floats, Ints, MAX_LANES, Mask, SetBits};

/// Reaches are taken to end so much, in voxels, before they do, so that
/// rounding takes no place beyond them.
const BORDER: f32 = 1.0 / 1024.0;

/// Steps between two looks at which lanes met something or left.
pub const STEPS_PER_ROUND: usize = 2;

/// Room for rounding when the square of an extinction is held against that of
/// its bound.
pub const BOUND_SLACK: f32 = 1.0 + 4e-5;

/// The state of the paths in all lanes. Extinctions are shares of the medium's
/// greatest, `scale_per_mm`, and lengths in units of one over that.
pub struct Paths<F: Floats> {
    pub rng: LaneRng<F::Ints>,
    /// Place in voxels, within the first period, and how far that is from the
    /// first in x and y.
    pub at: V3<F>,
    pub beyond: [F; 2],
    pub direction: V3<F>,
    /// Voxels per length, and length per voxel, along the way.
    step: V3<F>,
    per_step: V3<F>,
    /// The voxel looked at last, or the population in it that the lane met, and
    /// where it stands.
    pub voxel: VoxelWords<F::Ints>,
    place: F::Ints,
    /// Way from the camera.
    pub depth: F,
    pub throughput: V3<F>,
    pub radiance: V3<F>,
    /// What of it was found before the second event, once that has come.
    before_second: V3<F>,
    pub bounces: F::Ints,
    /// The first population that the path met.
    pub first_place: F::Ints,
    pub first_depth: F,
    /// In flight; at an event; outside.
    pub flying: F::Mask,
    met: F::Mask,
    pub gone: F::Mask,
}

impl<F: Floats> Paths<F> {
    #[inline(always)]
    fn none() -> Paths<F> {
        let (zero, zeros) = (F::splat(0.0), V3::splat(Vec3::ZERO));
        let (zero_bits, nowhere) = (F::Ints::splat(0), F::Mask::from_bits(0));
        Paths {
            rng: LaneRng::new((zero_bits, zero_bits), zero_bits),
            at: zeros,
            beyond: [zero; 2],
            direction: zeros,
            step: zeros,
            per_step: zeros,
            voxel: VoxelWords::unknown(),
            place: zero_bits,
            depth: zero,
            throughput: zeros,
            radiance: zeros,
            before_second: zeros,
            bounces: zero_bits,
            first_place: F::Ints::splat(NO_POPULATION),
            first_depth: zero,
            flying: nowhere,
            met: nowhere,
            gone: nowhere,
        }
    }

    /// What of the radiance came straight to the camera or by one event.
    #[inline(always)]
    pub fn direct(&self) -> V3<F> {
        let one = F::Ints::splat(1);
        let has_second = !(self.bounces.equals(one) | self.bounces.equals(F::Ints::splat(0)));
        self.before_second.or_where_not(has_second, self.radiance)
    }

    /// Turns the lanes of a mask.
    #[inline(always)]
    pub fn turn(&mut self, scene: &FlatScene, direction: V3<F>, mask: F::Mask) {
        let mut step = direction.times(V3::splat(scene.voxels_per_length));
        let least = F::splat(scene.least_rise);
        step.z = with_sign_of(step.z.abs().max(least), step.z);
        self.direction = direction.or_where_not(mask, self.direction);
        self.step = step.or_where_not(mask, self.step);
        self.per_step = inverse_of_step(step).or_where_not(mask, self.per_step);
    }
}

/// Walks all paths of a block.
#[inline(always)]
pub fn walk<F: Floats, E: Event<F>>(scene: &FlatScene, block: &mut Block<'_>) -> Stats {
    let mut stats = Stats::default();
    let mut paths = Paths::<F>::none();
    let mut work = LaneWork::new();
    let all = u32::MAX >> (32 - F::LANES);
    let mut ended = F::Mask::from_bits(all);
    loop {
        if ended.any() {
            regenerate(scene, block, &mut paths, &mut work, ended, &mut stats);
        }
        if !(paths.flying | paths.gone).any() {
            return stats;
        }
        for _ in 0..STEPS_PER_ROUND {
            fly::<F, E>(scene, &mut paths, &mut stats);
        }
        ended = paths.gone;
        if paths.gone.any() {
            escape(scene, &mut paths);
        }
        if paths.met.any() {
            ended = ended | scatter::<F, E>(scene, &mut paths, &mut stats);
        }
    }
}

/// One flight to a tentative collision and the look-up there, for the lanes in
/// flight.
#[inline(always)]
fn fly<F: Floats, E: Event<F>>(scene: &FlatScene, paths: &mut Paths<F>, stats: &mut Stats) {
    let medium = &scene.medium;
    let word = F::Ints::splat;
    let [u_flight, u_real, u_which] = paths.rng.units(paths.flying);

    // At the bound to the border of what the voxel reaches, then at the
    // greatest there is.
    let bound = paths.voxel.bound();
    let border = to_border(paths.voxel.reach(), paths.at, paths.per_step);
    let depth = minus_ln(positive(u_flight));
    let depth_there = bound * border;
    let within = depth.below(depth_there);
    let beyond = (depth - depth_there).mul_add(F::splat(1.0 / MOST), border);
    let way = (depth / bound).or_where_not(within, beyond);
    let majorant = bound.or_where_not(within, F::splat(MOST));
    let way = way.or_where_not(paths.flying, F::splat(0.0));
    paths.depth = paths.depth + way;
    let mut at = paths.step.scaled_add(way, paths.at);

    let dims = medium.cell_grid.dims();
    let size = dims.as_vec3();
    let mut outside = is_outside(at.z, 0.0, size.z);
    let mut beyond = paths.beyond;
    if medium.cell_grid.repeats() {
        (at.x, beyond[0]) = in_first_period(at.x, beyond[0], size.x);
        (at.y, beyond[1]) = in_first_period(at.y, beyond[1], size.y);
        paths.beyond = beyond;
    }
    if let Some(Borders { low, high }) = scene.borders {
        outside = outside
            | is_outside(at.x + beyond[0], low.x, high.x)
            | is_outside(at.y + beyond[1], low.y, high.y);
    }
    paths.at = at;

    // The voxel there; one of its populations, if it has several.
    let (x, y, z) = (at.x.to_ints(), at.y.to_ints(), at.z.to_ints());
    let mut place = x + word(dims.x) * (y + word(dims.y) * z);
    if let Some(blocks) = &medium.blocks {
        let block = blocks.numbers::<F>(beyond, dims);
        place = place + block * word(blocks.voxels);
    }
    if !medium.places.is_empty() {
        let found = place.gather(&medium.places);
        let count = found.shr::<PLACE_BITS>() + word(1);
        let which = (u_which * count.to_floats()).to_ints();
        place = (found & word((1 << PLACE_BITS) - 1)) + which;
    }
    let first = place * word(WORDS as u32);
    let words = [
        first.gather(&medium.words),
        (first + word(1)).gather(&medium.words),
    ];
    let voxel = VoxelWords(words);

    // Squares of extinctions, times that of the axis' length.
    let axis = voxel.axis();
    let across = axis.cross(paths.direction);
    let (square, across) = (axis.dot(axis), across.dot(across));
    let area = E::area_squared(scene, voxel, square - across, across);
    let broadside = voxel.broadside();
    let extinction = broadside * broadside * area;
    let bound = majorant * majorant * square;
    let u = positive(u_real);
    let considered = paths.flying & !outside;
    let met = considered & (u * u * bound).below(extinction);
    let excess = considered & (bound * F::splat(BOUND_SLACK)).below(extinction);
    stats.tentative += u64::from(considered.bits().count_ones());
    stats.collisions += u64::from(met.bits().count_ones());
    stats.majorant_violations += u64::from(excess.bits().count_ones());

    paths.voxel = voxel.or_where_not(paths.flying, paths.voxel);
    paths.place = place.or_where_not(paths.flying, paths.place);
    let left = paths.flying & outside;
    paths.met = paths.met | met;
    paths.gone = paths.gone | left;
    paths.flying = paths.flying & !(met | left);
}

/// Along the way from a place to where what its voxel reaches ends.
#[inline(always)]
pub fn to_border<F: Floats>(reach: F, at: V3<F>, per_step: V3<F>) -> F {
    let half = reach - F::splat(0.5 + BORDER);
    way_out(half, at.x, per_step.x)
        .min(way_out(half, at.y, per_step.y))
        .min(way_out(half, at.z, per_step.z))
        .max(F::splat(0.0))
}

/// From a place to where it leaves the box of `half` an edge around the middle
/// of its voxel, along one axis.
#[inline(always)]
fn way_out<F: Floats>(half: F, at: F, per_step: F) -> F {
    let beside_middle = at - at.floor() - F::splat(0.5);
    (-beside_middle).mul_add(per_step, half * per_step.abs())
}

#[inline(always)]
pub fn is_outside<F: Floats>(at: F, low: f32, high: f32) -> F::Mask {
    at.below(F::splat(low)) | !at.below(F::splat(high))
}

/// A coordinate within the first period, and the rest, in whole periods.
#[inline(always)]
fn in_first_period<F: Floats>(at: F, beyond: F, size: f32) -> (F, F) {
    let periods = (at * F::splat(1.0 / size)).floor() * F::splat(size);
    // Rounding may take it a hair beyond either end.
    let within = (at - periods)
        .max(F::splat(0.0))
        .min(F::splat(size * (1.0 - f32::EPSILON)));
    (within, beyond + periods)
}

/// The environment, for the lanes that have left.
#[inline(always)]
fn escape<F: Floats>(scene: &FlatScene, paths: &mut Paths<F>) {
    let [behind, before] = scene.environment;
    let back = paths.direction.z.below(F::splat(0.0));
    let mut sky = V3::splat(behind).or_where_not(back, V3::splat(before));
    let unscattered = paths.bounces.equals(F::Ints::splat(0));
    for picture in &scene.skies {
        sky = sky + picture.radiance_toward(paths.direction, unscattered);
    }
    let lit = paths.radiance + paths.throughput.times(sky);
    paths.radiance = lit.or_where_not(paths.gone, paths.radiance);
    let unscattered = paths.gone & paths.first_place.equals(F::Ints::splat(NO_POPULATION));
    if scene.has_placed_lights() && unscattered.any() {
        add_lights_in_sight(scene, paths, unscattered, true);
    }
    paths.gone = F::Mask::from_bits(0);
}

/// What camera rays see of lights before or behind the matter.
#[inline(always)]
pub fn add_lights_in_sight<F: Floats>(
    scene: &FlatScene,
    paths: &mut Paths<F>,
    mask: F::Mask,
    behind: bool,
) {
    let (at, direction) = (stored(paths.at), stored(paths.direction));
    let depths = stored(V3::new(paths.beyond[0], paths.beyond[1], paths.depth));
    let mut radiance = stored(paths.radiance);
    for lane in SetBits(mask.bits()) {
        let [at, direction, depths] =
            [&at, &direction, &depths].map(|v| Vec3::from_array(v.map(|x| x[lane])));
        let at = at + depths.with_z(0.0);
        let seen = scene.lights_in_sight(at, direction, depths.z, behind);
        for (channel, seen) in radiance.iter_mut().zip(seen.to_array()) {
            channel[lane] += seen;
        }
    }
    paths.radiance = loaded(&radiance);
}

/// The events of the lanes that met something: light, a new direction,
/// roulette. Gives the lanes whose paths end.
#[inline(always)]
fn scatter<F: Floats, E: Event<F>>(
    scene: &FlatScene,
    paths: &mut Paths<F>,
    stats: &mut Stats,
) -> F::Mask {
    let word = F::Ints::splat;
    let first = paths.met & paths.first_place.equals(word(NO_POPULATION));
    paths.first_place = paths.place.or_where_not(first, paths.first_place);
    paths.first_depth = paths.depth.or_where_not(first, paths.first_depth);
    let cut = paths.met & paths.bounces.equals(word(scene.max_bounces));
    stats.cut += u64::from(cut.bits().count_ones());
    let met = paths.met & !cut;
    let second = met & paths.bounces.equals(word(1));
    paths.before_second = paths.radiance.or_where_not(second, paths.before_second);
    paths.bounces = (paths.bounces + word(1)).or_where_not(met, paths.bounces);

    let meeting = Meeting {
        voxel: paths.voxel,
        place: paths.place,
        w_out: V3::new(-paths.direction.x, -paths.direction.y, -paths.direction.z),
    };
    let event = E::new(scene, &meeting, &mut paths.rng, met);
    let throughput = paths.throughput.times(event.common());
    let mean = throughput.sum() * F::splat(1.0 / 3.0);

    // What is scattered of the light that arrives.
    let mut light_in = V3::splat(Vec3::ZERO);
    let blocks = scene.medium.blocks.as_ref();
    let dims = scene.medium.cell_grid.dims();
    let table = blocks.map(|b| b.numbers::<F>(paths.beyond, dims));
    let corners = scene.nodes.around(paths.at, table);
    let count = scene.lights.len();
    let mut units = [F::splat(0.0); 3];
    for (i, light) in scene.lights.iter().enumerate() {
        if i % 3 == 0 {
            units = paths.rng.units(met);
        }
        let u = units[i % 3];
        let Toward {
            toward,
            distance_mm,
            irradiance,
            seen,
        } = match &light.placed {
            None => Toward {
                toward: V3::splat(light.to_light),
                distance_mm: F::splat(f32::INFINITY),
                irradiance: V3::splat(light.irradiance.0),
                seen: met,
            },
            Some(placed) => placed.toward(paths.at, paths.beyond, &mut paths.rng, met),
        };
        let (grey, scattered) = event.toward(scene, toward);
        let aim = Aim {
            grey,
            toward,
            distance_mm,
            table_depth: depth(&scene.depths, count, i, &corners),
            u,
        };
        let through = aim.transmittance(scene, light, paths, mean, seen, stats);
        light_in = irradiance.times_add(scattered.scaled(through), light_in);
    }
    for sky in &scene.skies {
        for lamp in &sky.lamps {
            let [place, own, u] = paths.rng.units(met);
            let [across, down, _] = paths.rng.units(met);
            let drawn = sky.sample(lamp, [place, own, across, down]);
            let (grey, scattered) = event.toward(scene, drawn.to_light);
            let aim = Aim {
                grey,
                toward: drawn.to_light,
                distance_mm: F::splat(f32::INFINITY),
                table_depth: depth(&lamp.table.depths, 1, 0, &corners),
                u,
            };
            let through = aim.transmittance(scene, &lamp.table, paths, mean, met, stats);
            let arriving = scattered.scaled(through);
            light_in = drawn.irradiance.times_add(arriving, light_in);
        }
    }
    let lit = throughput.times_add(light_in, paths.radiance);
    paths.radiance = lit.or_where_not(met, paths.radiance);

    let turn = event.turn(scene, &mut paths.rng, met);
    let throughput = throughput.times(turn.weight);
    let (survives, carried) = survivors(throughput, VOXEL_SCALE, turn.u, met);
    paths.throughput = carried.or_where_not(survives, paths.throughput);
    paths.turn(scene, turn.direction, survives);
    paths.flying = paths.flying | survives;
    let ended = paths.met & !survives;
    paths.met = F::Mask::from_bits(0);
    ended
}

/// The components of all lanes.
#[inline(always)]
pub fn stored<F: Floats>(v: V3<F>) -> [[f32; MAX_LANES]; 3] {
    let mut out = [[0.0; MAX_LANES]; 3];
    v.x.store(&mut out[0]);
    v.y.store(&mut out[1]);
    v.z.store(&mut out[2]);
    out
}

/// Lanes of components.
#[inline(always)]
pub fn loaded<F: Floats>([x, y, z]: &[[f32; MAX_LANES]; 3]) -> V3<F> {
    V3::new(F::load(x), F::load(y), F::load(z))
}
