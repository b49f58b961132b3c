// Direct light: by a table, set right by an exact ray now and then. See `voxels/aim.rs` and
// `voxels/shadow_ray.rs`.

// An exact ray is followed for sure to so much more optical depth than the table promises.
const SURE_DEPTH: f32 = 2.0;
// A ray along an endless slab without matter in its way has to end some time.
const MAX_SHADOW_STEPS: u32 = 1048576u;
// Extinctions are those of the medium toward any direction.
const NO_TABLE: u32 = 0xffffffffu;

struct Aim {
    // What is scattered of the light, 1/sr, and the mean throughput.
    grey: f32,
    mean: f32,
    toward: vec3<f32>,
    distance_mm: f32,
    depth: f32,
    residual_floor: f32,
    // Table of the extinction toward the light.
    extinctions: u32,
    u: f32,
}

fn transmittance(aim: Aim) -> f32 {
    let through = exp2_of(aim.depth * -LOG2_E);
    let share = aim.mean * aim.grey * residual_scale();
    let keep = min(share * (through + aim.residual_floor), 1.0);
    if aim.u >= keep {
        return through;
    }
    var reach_mm = aim.distance_mm;
    if HAS_BORDERS {
        reach_mm = min(reach_mm, way_to_border_mm(aim.toward));
    }
    let exact = exact_transmittance(aim, reach_mm, aim.u / keep);
    return (exact - through) / keep + through;
}

// From the path's place to where the matter is cut.
fn way_to_border_mm(toward: vec3<f32>) -> f32 {
    let per_mm = toward.xy / voxel_mm().xy;
    let border = select(border_low(), border_high(), per_mm > vec2<f32>(0.0));
    let way = (border - path.at.xy - path.beyond) / per_mm;
    let bounded = select(way, vec2<f32>(FAR), abs(per_mm) < vec2<f32>(1.0e-30));
    return max(min(bounded.x, bounded.y), 0.0);
}

// The transmittance, exact on average over the chance.
fn exact_transmittance(aim: Aim, reach_mm: f32, chance: f32) -> f32 {
    shadow_ray_count += 1u;
    let size = vec3<i32>(dims());
    let cell = clamp(vec3<i32>(path.at), vec3<i32>(0), size - 1);
    let voxel = vec3<f32>(cell);
    let forth = aim.toward >= vec3<f32>(0.0);
    let per_voxel_mm = voxel_mm() / max(abs(aim.toward), vec3<f32>(1.0e-12));
    var border_mm = select(path.at - voxel, voxel + 1.0 - path.at, forth) * per_voxel_mm;
    var left = select(cell, size - 1 - cell, forth);
    let forward = vec3<i32>(1, size.x, size.x * size.y);
    let strides = select(-forward, forward, forth);
    var place = (cell.z * size.y + cell.y) * size.x + cell.x;
    let sure_depth = aim.depth + SURE_DEPTH;
    let stop = sure_depth + minus_ln(max(1.0 - chance, 1.0e-7));
    var at_mm = 0.0;
    var depth = 0.0;
    for (var steps = 0u; steps < MAX_SHADOW_STEPS; steps++) {
        shadow_step_count += 1u;
        var extinction = 0.0;
        if aim.extinctions == NO_TABLE {
            extinction = extinction_per_mm(u32(place), aim.toward);
        } else {
            extinction = number(aim.extinctions + u32(place));
        }
        let next_mm = min(border_mm.x, min(border_mm.y, border_mm.z));
        depth += extinction * max(min(next_mm, reach_mm) - at_mm, 0.0);
        at_mm = next_mm;
        if depth > stop {
            return 0.0;
        }
        // Through an edge both borders are passed at once.
        let passed = border_mm == vec3<f32>(next_mm);
        border_mm += select(vec3<f32>(0.0), per_voxel_mm, passed);
        let by = select(vec3<i32>(0), strides, passed);
        place += by.x + by.y + by.z;
        left -= select(vec3<i32>(0), vec3<i32>(1), passed);
        if any(left < vec3<i32>(0)) {
            if left.z < 0 || !REPEATS {
                break;
            }
            if left.x < 0 {
                left.x = size.x - 1;
                place -= size.x * strides.x;
            }
            if left.y < 0 {
                left.y = size.y - 1;
                place -= size.y * strides.y;
            }
        }
        if at_mm >= reach_mm {
            break;
        }
    }
    if depth > stop {
        return 0.0;
    }
    return exp2_of(min(depth, sure_depth) * -LOG2_E);
}
