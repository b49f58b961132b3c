// Micro-flakes about the fibres of a voxel: see `voxels/flakes.rs`.

struct Event {
    w_out: vec3<f32>,
    scaled_axis: vec3<f32>,
    end_on: f32,
    per_area: f32,
    // What all light is multiplied by, wherever it comes from.
    factor: vec3<f32>,
}

var<private> event: Event;

fn area_squared(along: f32, across: f32, end_on: f32) -> f32 {
    return fma(end_on * end_on, along, across);
}

fn meet() {
    let axis = axis_of(path.voxel);
    let end_on = end_on_of(path.voxel);
    let square = fma(-end_on, end_on, 1.0);
    event.w_out = -path.direction;
    event.scaled_axis = axis * sqrt(max(square, 0.0) / dot(axis, axis));
    event.end_on = end_on;
    let across = cross(event.scaled_axis, event.w_out);
    event.per_area = 1.0 / sqrt(fma(end_on, end_on, dot(across, across)));
    var substance = substances_table();
    if HAS_MATERIALS {
        substance += word(materials_table() + path.place) << 2u;
    }
    event.factor = vec3<f32>(number(substance), number(substance + 1u), number(substance + 2u));
}

// The mirror phase function: see `MicroFlake::eval`.
fn scattered_toward(w_in: vec3<f32>) -> vec3<f32> {
    let h = event.w_out + w_in;
    let squared = dot(h, h);
    let along = dot(event.scaled_axis, h);
    let e2 = event.end_on * event.end_on;
    if squared < 1.0e-10 {
        // Half vector undefined: the mean over the circle of possible ones.
        let per_square = event.per_area * event.per_area;
        return vec3<f32>(0.125 / PI * fma(e2, per_square, 1.0) * per_square);
    }
    let q = fma(along, along, squared * e2);
    let scale = 0.25 / PI * e2 * event.end_on * event.per_area;
    return vec3<f32>(scale * squared * squared / max(q * q, LEAST_NORMAL));
}

fn root_of(v: vec3<f32>, per_one_and_end_on: f32) -> vec3<f32> {
    let along = dot(event.scaled_axis, v) * per_one_and_end_on;
    return v - event.scaled_axis * along;
}

struct Turn {
    direction: vec3<f32>,
    weight: vec3<f32>,
    // A random number that is left.
    u: f32,
}

fn turned() -> Turn {
    let u = units();
    let s = sin_cos_of_turns(u.x);
    let height = u.y;
    let r = sqrt(4.0 * height * (1.0 - height));
    let on_sphere = vec3<f32>(r * s.y, r * s.x, fma(height, -2.0, 1.0));
    let per_one_and_end_on = 1.0 / (1.0 + event.end_on);
    let seen = root_of(event.w_out, per_one_and_end_on) * event.per_area + on_sphere;
    let m = root_of(seen, per_one_and_end_on);
    let across = dot(event.w_out, m) / max(dot(m, m), LEAST_NORMAL);
    let w_in = m * (across + across) - event.w_out;
    return Turn(nearly_unit(w_in), vec3<f32>(1.0), u.z);
}
