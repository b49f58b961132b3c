//! Flights of rays through packed fibres, one in every lane, the next ray where one has
//! ended.

use super::axis_code::decoded;
use super::fibre_volume::{FibreVolume, NO_YARN, PLACE_BITS};
use super::volume_ray::{NOWHERE, UNDER_WAY, VolumeRay};
use crate::voxels::camera_rays::inverse_of_step;
use crate::voxels::fibre_tables::area_squared;
use crate::voxels::voxel_words::{MOST, bound_of_code, reach_of_code};
use crate::voxels::walk::{BOUND_SLACK, STEPS_PER_ROUND, is_outside, to_border};
use organza_lanes::math::{LaneRng, V3, beside, minus_ln, positive};
use organza_lanes::{Floats, Ints, MAX_LANES, Mask, SetBits};

/// One lane in so many may be busy when the rest of a list is left under way.
const LEFT_SHARE: usize = 4;

/// Counts of flights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FlightCounts {
    /// Tentative collisions of paths, and of shadow rays.
    pub tentative: u64,
    pub of_shadows: u64,
    /// Those whose extinction exceeded its bound.
    pub violations: u64,
}

/// The rays in all lanes.
struct Lanes<F: Floats> {
    rng: LaneRng<F::Ints>,
    at: V3<F>,
    period: [F; 2],
    direction: V3<F>,
    /// Voxels per mm, and mm per voxel, along the way.
    step: V3<F>,
    per_step: V3<F>,
    gone_mm: F,
    end_mm: F,
    left_yarn: F::Ints,
    /// The word of the voxel that it is in.
    voxel: F::Ints,
    place: F::Ints,
    offset: F,
    flying: F::Mask,
    /// Lanes with shadow rays.
    shadows: u32,
}

/// What lanes hold of rays, in memory.
struct Columns {
    floats: [[f32; MAX_LANES]; FLOATS],
    words: [[u32; MAX_LANES]; WORDS],
}

/// Numbers of a ray: its place, periods, direction, way and end.
const FLOATS: usize = 10;
/// Words of a ray: its yarn and random numbers.
const WORDS: usize = 4;

/// Follows rays of these numbers until they meet a fibre or leave the volume. Those from
/// `first_shadow` on are shadow rays.
///
/// The last few rays of paths are left [under way](UNDER_WAY), so that lanes stay busy: a ray
/// that is followed later meets the same, because it keeps its random numbers.
#[inline(always)]
pub fn fly<F: Floats>(
    volume: &FibreVolume,
    rays: &mut [VolumeRay],
    numbers: &[u32],
    first_shadow: u32,
    counts: &mut FlightCounts,
) {
    let mut lanes = Lanes::<F>::none();
    let mut columns = Columns {
        floats: [[0.0; MAX_LANES]; FLOATS],
        words: [[0; MAX_LANES]; WORDS],
    };
    let all = u32::MAX >> (32 - F::LANES);
    let few = F::LANES / LEFT_SHARE;
    let (mut next, mut busy) = (0, 0u32);
    let mut owners = [0usize; MAX_LANES];
    loop {
        let mut begun = 0u32;
        for lane in SetBits(all & !busy) {
            let Some(&number) = numbers.get(next) else {
                break;
            };
            next += 1;
            owners[lane] = number as usize;
            columns.put(lane, &rays[number as usize]);
            begun |= 1 << lane;
            lanes.shadows &= !(1 << lane);
            lanes.shadows |= u32::from(number >= first_shadow) << lane;
        }
        if begun != 0 {
            lanes.begin(volume, &columns, F::Mask::from_bits(begun));
            busy |= begun;
        }
        let is_last = next >= numbers.len();
        let is_thin = busy.count_ones() as usize <= few && numbers.len() > few;
        if busy == 0 || is_last && is_thin && busy & lanes.shadows == 0 {
            lanes.end(rays, &owners, busy);
            for lane in SetBits(busy) {
                rays[owners[lane]].place = UNDER_WAY;
            }
            return;
        }
        for _ in 0..STEPS_PER_ROUND {
            lanes.step(volume, counts);
        }
        let ended = busy & !lanes.flying.bits();
        if ended != 0 {
            lanes.end(rays, &owners, ended);
            busy &= !ended;
        }
    }
}

impl Columns {
    #[inline(always)]
    fn put(&mut self, lane: usize, ray: &VolumeRay) {
        let VolumeRay {
            at: [x, y, z],
            period: [over_x, over_y],
            direction: [dx, dy, dz],
            gone_mm,
            end_mm,
            left_yarn,
            rng: [a, b, c],
            ..
        } = *ray;
        let floats = [x, y, z, over_x, over_y, dx, dy, dz, gone_mm, end_mm];
        for (column, value) in self.floats.iter_mut().zip(floats) {
            column[lane] = value;
        }
        for (column, value) in self.words.iter_mut().zip([left_yarn, a, b, c]) {
            column[lane] = value;
        }
    }

    #[inline(always)]
    fn vector<F: Floats>(&self, first: usize) -> V3<F> {
        V3 {
            x: F::load(&self.floats[first]),
            y: F::load(&self.floats[first + 1]),
            z: F::load(&self.floats[first + 2]),
        }
    }
}

impl<F: Floats> Lanes<F> {
    #[inline(always)]
    fn none() -> Lanes<F> {
        let (zero, word) = (F::splat(0.0), F::Ints::splat(0));
        let zeros = V3::new(zero, zero, zero);
        Lanes {
            rng: LaneRng::from_words([word; 3]),
            at: zeros,
            period: [zero; 2],
            direction: zeros,
            step: zeros,
            per_step: zeros,
            gone_mm: zero,
            end_mm: zero,
            left_yarn: word,
            voxel: word,
            place: word,
            offset: zero,
            flying: F::Mask::from_bits(0),
            shadows: 0,
        }
    }

    /// Takes the rays of the lanes of a mask from columns.
    #[inline(always)]
    fn begin(&mut self, volume: &FibreVolume, columns: &Columns, begun: F::Mask) {
        let load = |k: usize| F::load(&columns.floats[k]);
        let words = |k: usize| F::Ints::load(&columns.words[k]);
        self.at = columns.vector::<F>(0).or_where_not(begun, self.at);
        self.period[0] = load(3).or_where_not(begun, self.period[0]);
        self.period[1] = load(4).or_where_not(begun, self.period[1]);
        let direction = columns.vector::<F>(5);
        let step = direction.times(V3::splat(volume.cell_grid.voxels_per_mm()));
        let per_step = inverse_of_step(step);
        self.direction = direction.or_where_not(begun, self.direction);
        self.step = step.or_where_not(begun, self.step);
        self.per_step = per_step.or_where_not(begun, self.per_step);
        self.gone_mm = load(8).or_where_not(begun, self.gone_mm);
        self.end_mm = load(9).or_where_not(begun, self.end_mm);
        self.left_yarn = words(0).or_where_not(begun, self.left_yarn);
        let rng = LaneRng::from_words([words(1), words(2), words(3)]);
        self.rng = rng.or_where_not(begun, self.rng);
        let voxel = index(volume, self.at).shl::<1>().gather(&volume.voxels);
        self.voxel = voxel.or_where_not(begun, self.voxel);
        self.place = F::Ints::splat(NOWHERE).or_where_not(begun, self.place);
        self.flying = self.flying | begun;
    }

    /// Hands the rays of lanes back that have ended.
    #[inline(always)]
    fn end(&self, rays: &mut [VolumeRay], owners: &[usize; MAX_LANES], ended: u32) {
        let mut floats = [[0.0; MAX_LANES]; 7];
        let numbers = [
            self.at.x,
            self.at.y,
            self.at.z,
            self.period[0],
            self.period[1],
            self.gone_mm,
            self.offset,
        ];
        for (column, values) in floats.iter_mut().zip(numbers) {
            values.store(column);
        }
        let mut words = [[0; MAX_LANES]; 4];
        let [a, b, c] = self.rng.words();
        for (column, values) in words.iter_mut().zip([self.place, a, b, c]) {
            values.store(column);
        }
        for lane in SetBits(ended) {
            let ray = &mut rays[owners[lane]];
            let [x, y, z, over_x, over_y, gone_mm, offset] = floats.map(|c| c[lane]);
            let [place, a, b, c] = words.map(|c| c[lane]);
            ray.at = [x, y, z];
            ray.period = [over_x, over_y];
            (ray.gone_mm, ray.offset) = (gone_mm, offset);
            (ray.place, ray.rng) = (place, [a, b, c]);
        }
    }

    /// One flight to a tentative collision and the look-up there, for the lanes in flight.
    #[inline(always)]
    fn step(&mut self, volume: &FibreVolume, counts: &mut FlightCounts) {
        let (word, one) = (F::Ints::splat, F::splat(1.0));
        let [u_flight, u_real, u_offset] = self.rng.units(self.flying);

        // At the bound to the border of what the voxel reaches, then at the
        // greatest there is.
        let bound: F = bound_of_code(self.voxel.shr::<24>());
        let reach: F = reach_of_code(self.voxel.shr::<20>() & word(0xf));
        let border = to_border(reach, self.at, self.per_step);
        let depth = minus_ln(positive(u_flight)) * F::splat(1.0 / volume.scale_per_mm);
        let depth_there = bound * border;
        let within = depth.below(depth_there);
        let beyond = (depth - depth_there).mul_add(F::splat(1.0 / MOST), border);
        let way = (depth / bound).or_where_not(within, beyond);
        let majorant = bound.or_where_not(within, F::splat(MOST));
        let way = way.or_where_not(self.flying, F::splat(0.0));
        let gone_mm = self.gone_mm + way;
        let mut at = self.step.scaled_add(way, self.at);

        let grid = &volume.cell_grid;
        let size = grid.dims().as_vec3();
        let mut outside = is_outside(at.z, 0.0, size.z) | !gone_mm.below(self.end_mm);
        let mut period = self.period;
        if grid.repeats() {
            (at.x, period[0]) = in_first_period(at.x, period[0], size.x);
            (at.y, period[1]) = in_first_period(at.y, period[1], size.y);
        } else {
            outside = outside | is_outside(at.x, 0.0, size.x) | is_outside(at.y, 0.0, size.y);
        }
        let considered = self.flying & !outside;

        // The axis of the fibre that would be met.
        let place_of = index(volume, at);
        let voxel = place_of.shl::<1>().gather(&volume.voxels);
        let radius_mm = if volume.radii.is_empty() {
            F::splat(volume.radius_mm)
        } else {
            place_of.gather(&volume.radii).as_floats()
        };
        let axis = decoded::<F, 10>(voxel);
        let d = self.direction;
        let upright = axis.scaled_add(-(axis.dot(d) / axis.dot(axis)), d);
        let square = upright.dot(upright);
        let lost = square.below(F::splat(1e-10));
        let mut forward = upright.scaled(one / square.max(F::splat(1e-10)).sqrt());
        if (considered & lost).any() {
            forward = beside(axis).or_where_not(lost, forward);
        }
        let side = axis.cross(forward);
        let side = side.scaled(one / side.dot(side).sqrt());
        let offset = u_offset.mul_add(F::splat(2.0), F::splat(-1.0));
        let deep = (one - offset * offset).max(F::splat(0.0)).sqrt();
        let to_axis = side.scaled_add(-offset, forward.scaled(deep));
        let per_mm = V3::splat(grid.voxels_per_mm());
        let axis_at = to_axis.scaled(radius_mm).times_add(per_mm, at);

        // The populations there; one of them, if there are several.
        let (mut x, mut y, z) = (axis_at.x.floor(), axis_at.y.floor(), axis_at.z.floor());
        let mut beside_all = is_outside(z, 0.0, size.z);
        if grid.repeats() {
            (x, y) = (around(x, size.x), around(y, size.y));
        } else {
            beside_all = beside_all | is_outside(x, 0.0, size.x) | is_outside(y, 0.0, size.y);
        }
        let cell = volume.index::<F>(x.to_ints(), y.to_ints(), z.to_ints());
        let found = (cell.shl::<1>() + word(1)).gather(&volume.voxels);
        let found = word(0).or_where_not(beside_all, found);
        let count = (found.shr::<PLACE_BITS>() + word(1)).to_floats();
        let u = u_real * count;
        let which = u.floor();
        let place = (found & word((1 << PLACE_BITS) - 1)) + which.to_ints();
        let population = volume.populations::<F>(place);

        // Squares of extinctions, times that of the axis' length.
        let axis = population.axis();
        let across = axis.cross(d);
        let (square, across) = (axis.dot(axis), across.dot(across));
        let area = area_squared(square - across, across, population.end_on());
        let share = self.share(volume, population.material(), population.yarn());
        let broadside = population.broadside() * share * count;
        let extinction = broadside * broadside * area;
        let bound = majorant * majorant * square;
        let u = positive(u - which);
        let met = considered & (u * u * bound).below(extinction);
        let excess = considered & (bound * F::splat(BOUND_SLACK)).below(extinction);
        let looked = considered.bits();
        counts.tentative += u64::from((looked & !self.shadows).count_ones());
        counts.of_shadows += u64::from((looked & self.shadows).count_ones());
        counts.violations += u64::from(excess.bits().count_ones());

        self.at = at;
        self.period = period;
        self.gone_mm = gone_mm;
        self.voxel = voxel.or_where_not(self.flying, self.voxel);
        self.place = place.or_where_not(met, self.place);
        self.offset = offset.or_where_not(met, self.offset);
        self.flying = considered & !met;
    }

    /// Packing factors over the greatest.
    #[inline(always)]
    fn share(&self, volume: &FibreVolume, material: F::Ints, yarn: F::Ints) -> F {
        let word = F::Ints::splat;
        let own = self.left_yarn.equals(yarn);
        let from_outside = self.left_yarn.equals(word(NO_YARN));
        let kind = word(0).or_where_not(own, word(2).or_where_not(from_outside, word(1)));
        (material.shl::<2>() + kind)
            .gather(&volume.shares)
            .as_floats()
    }
}

/// Index of the voxel at a place.
#[inline(always)]
fn index<F: Floats>(volume: &FibreVolume, at: V3<F>) -> F::Ints {
    volume.index::<F>(at.x.to_ints(), at.y.to_ints(), at.z.to_ints())
}

/// A coordinate within the first period, and the periods that it is on.
#[inline(always)]
fn in_first_period<F: Floats>(at: F, period: F, size: f32) -> (F, F) {
    let periods = (at * F::splat(1.0 / size)).floor();
    // Rounding may take it a hair beyond either end.
    let within = periods
        .mul_add(F::splat(-size), at)
        .max(F::splat(0.0))
        .min(F::splat(size * (1.0 - f32::EPSILON)));
    (within, period + periods)
}

/// A whole coordinate less than a period beside the first, brought into it.
#[inline(always)]
fn around<F: Floats>(x: F, size: f32) -> F {
    let size = F::splat(size);
    let before = x.below(F::splat(0.0));
    let x = (x + size).or_where_not(before, x);
    let beyond = !x.below(size);
    (x - size).or_where_not(beyond, x)
}
