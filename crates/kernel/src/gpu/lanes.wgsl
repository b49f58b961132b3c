// Lanes that persist: each walks one path at a time and takes the next sample in place.
// A dispatch takes a fixed number of steps; what a lane knows stays in a buffer between
// dispatches, so their length makes no difference to any bit.

const NO_PLACE: u32 = 0xffffffffu;
// Bits of 2^32: every channel of a sample is below, whatever is not a number above.
const RADIANCE_LIMIT_BITS: u32 = 0x4f800000u;

// What a lane is doing. A buffer of zeros is a lane without a slot.
const BEGINNING: u32 = 0u;
const FLYING: u32 = 1u;
const MET: u32 = 2u;
const ENDED: u32 = 3u;
const IDLE: u32 = 4u;

// Words of the control buffer: slots handed out, lanes at work, bright samples, the
// brightest, then counts of two words.
const CONTROL_NEXT: u32 = 0u;
const CONTROL_ACTIVE: u32 = 1u;
const CONTROL_BRIGHT: u32 = 2u;
const CONTROL_BRIGHTEST: u32 = 3u;
const CONTROL_COUNTS: u32 = 4u;

var<private> path: Path;
var<private> paths_count: u32;
var<private> tentative_count: u32;
var<private> collision_count: u32;
var<private> shadow_ray_count: u32;
var<private> shadow_step_count: u32;
var<private> cut_count: u32;
var<private> rejected_count: u32;
var<private> violation_count: u32;
var<private> brightest_bits: u32;

// The next sample for the lane's path: of its slot, or of the next slot.
fn take_next() {
    if path.has_slot != 0u {
        path.sample += slots_per_pixel();
        if path.sample >= samples_end() {
            path.has_slot = 0u;
        }
    }
    if path.has_slot == 0u {
        let slot = atomicAdd(&control[CONTROL_NEXT], 1u);
        if slot >= slot_count() {
            path.phase = IDLE;
            return;
        }
        path.has_slot = 1u;
        path.slot = slot;
        path.sample = samples_start() + slot / pixel_count();
        sums[slot * SLOT_WORDS + 31u] = NO_PLACE;
        if path.sample >= samples_end() {
            return;
        }
    }
    paths_count += 1u;
    let pixel = pixel_of(path.slot % pixel_count());
    path.random = begin_random(pixel.x, pixel.y, path.sample);
    path.throughput = vec3<f32>(1.0);
    path.radiance = vec3<f32>(0.0);
    path.bounces = 0u;
    path.first_place = NO_PLACE;
    path.first_depth = 0.0;
    begin_path(vec2<f32>(pixel));
}

// Column and row in the whole picture of the pixel that is walked as number `turn`:
// neighbours follow each other in strips, as in `block.rs`.
fn pixel_of(turn: u32) -> vec2<u32> {
    let width = block_width();
    let rows = block_rows();
    let strip = turn / (8u * rows);
    let across = min(8u, width - strip * 8u);
    let within = turn - strip * 8u * rows;
    return vec2<u32>(block_left() + strip * 8u + within % across, block_top() + within / across);
}

// Roulette: true while the path goes on.
fn survives_roulette(scale: f32, u: f32) -> bool {
    let survival = min(sum_of(path.throughput) * (scale / 3.0), 1.0);
    if u >= survival {
        return false;
    }
    path.throughput *= 1.0 / max(survival, LEAST_NORMAL);
    return true;
}

fn add_count(k: u32, more: u32) {
    let at = CONTROL_COUNTS + 2u * k;
    let before = atomicAdd(&control[at], more);
    if before + more < before {
        atomicAdd(&control[at + 1u], 1u);
    }
}

// Lanes add their counts one by one, once a dispatch: a group that waits for its lanes takes a
// third longer to compile.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let lane = id.x;
    own_lane = lane;
    load_path();
    // There are whole groups of lanes, so that the condition always holds. It keeps drivers from
    // compiling the program anew for every number of steps.
    let steps = select(0u, steps_per_dispatch(), lane < lane_count());
    for (var i = 0u; i < steps; i++) {
        if path.phase == ENDED {
            if !record_sample() {
                break;
            }
            path.phase = BEGINNING;
        }
        if path.phase == BEGINNING {
            take_next();
        }
        if path.phase == IDLE {
            break;
        }
        advance();
    }
    store_path();
    add_count(0u, paths_count);
    add_count(1u, tentative_count);
    add_count(2u, collision_count);
    add_count(3u, shadow_ray_count);
    add_count(4u, shadow_step_count);
    add_count(5u, cut_count);
    add_count(6u, rejected_count);
    add_count(7u, violation_count);
    atomicMax(&control[CONTROL_BRIGHTEST], brightest_bits);
    if path.phase != IDLE {
        atomicAdd(&control[CONTROL_ACTIVE], 1u);
    }
}
