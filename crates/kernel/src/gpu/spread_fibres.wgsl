// Which tangent of a population of fibres a way meets: see `voxels/seen_tangent.rs` and, for
// their tables, `voxels/population_tables.rs`.

const SHOWN_NODES: u32 = 65u;

struct SeenTangent {
    // Unit, but for rounding.
    tangent: vec3<f32>,
    // Cosine of the inclination of the way.
    cos_out: f32,
    // How much more of the fibre is seen than it was drawn for.
    weight: f32,
    // A random number that is left.
    u: f32,
}

fn of_end_on(a: f32, b: f32, c: f32, end_on: f32) -> f32 {
    return fma(fma(end_on, c, b), end_on, a);
}

fn area_squared(along_squared: f32, across: f32, end_on: f32) -> f32 {
    let along = end_on * end_on * along_squared;
    let ellipsoid = along + across;
    let part = across / max(ellipsoid, LEAST_NORMAL);
    let a = of_end_on(0.32933731, 0.28064235, -0.22881158, end_on);
    let b = of_end_on(-1.0305073, -0.11435021, 0.57003765, end_on);
    let c = of_end_on(1.2415874, 0.20291151, -0.7465945, end_on);
    let d = of_end_on(-0.85803, 0.26867473, 0.3992522, end_on);
    let term = fma(fma(fma(d, part, c), part, b), part, a);
    return fma(along * part, term, ellipsoid);
}

// The fitted area that a population shows over the exact one.
fn shown_correction(code: u32, along: f32, across: f32, end_on: f32) -> f32 {
    let ellipsoid = fma(end_on * end_on, along, across);
    let part = across / max(ellipsoid, LEAST_NORMAL);
    let place = min(part, 1.0) * f32(SHOWN_NODES - 1u);
    let node = floor(min(place, f32(SHOWN_NODES - 2u)));
    let at = shown_table() + (code >> 6u) * SHOWN_NODES + u32(node);
    return mix(number(at), number(at + 1u), place - node);
}

// The tangent of a fibre of a population about a unit axis, with the code of its end-on ratio,
// as it is shown toward `w`.
fn seen_tangent(axis: vec3<f32>, code: u32, w: vec3<f32>) -> SeenTangent {
    let end_on = end_on_of_code(code);
    let spread = number(spreads_table() + 2u * code);
    let drawn = number(spreads_table() + 2u * code + 1u);

    // w = s e1 + c axis.
    let aside = cross(axis, w);
    let sine = sqrt(dot(aside, aside));
    let cosine = dot(axis, w);
    var e2 = aside * (1.0 / max(sine, 1.0e-6));
    if sine < 1.0e-6 {
        e2 = beside(axis);
    }
    let e1 = cross(e2, axis);

    let u = units();
    let v = units();
    let wide = spread > 1.0;
    let mean = select(spread * 0.79788456, 0.25 * PI, wide);
    let is_flat = u.x * (sine + mean) < sine;
    let half_square = minus_ln(positive(u.y));
    let v_cos = sin_cos_of_turns(u.z).y;
    var polar = sqrt(half_square + half_square) * spread * select(1.0, abs(v_cos), is_flat);
    var weight = drawn * (sine + mean);
    if wide {
        polar = select(sqrt(u.y), u.y, is_flat) * (0.5 * PI);
        let deviations = polar / max(spread, LEAST_NORMAL);
        weight *= exp2_of(deviations * deviations * (-0.5 * LOG2_E));
    }
    if polar > 0.5 * PI {
        weight = 0.0;
    }
    // Wide of the turn where the weight is nothing: brought back into it.
    let polar_turns = polar * (1.0 / TAU);
    let of_polar = sin_cos_of_turns(polar_turns - floor(polar_turns));
    let of_turn = sin_cos_of_turns(v.x);
    let x = of_polar.x * of_turn.y;
    let y = of_polar.x * of_turn.x;
    let a = sine * of_polar.y;
    let b = cosine * x;
    let y2 = y * y;
    let plain = sqrt(fma(a - b, a - b, y2));
    let mirrored = sqrt(fma(a + b, a + b, y2));
    let both = plain + mirrored;
    let is_plain = v.y * both < plain;
    let cos_out = min(select(mirrored, plain, is_plain), 1.0);
    let sign_of_turn = select(-1.0, 1.0, is_plain);
    let tangent = e1 * (x * sign_of_turn) + e2 * (y * sign_of_turn) + axis * of_polar.y;

    let seen = sine * sine;
    let along = max(1.0 - seen, 0.0);
    let shown = sqrt(area_squared(along, seen, end_on));
    let exactly = shown_correction(code, along, seen, end_on);
    weight = select(0.0, weight * 0.5 * both * exactly / ((sine + polar) * shown), both > 0.0);
    return SeenTangent(tangent, cos_out, weight, v.z);
}
