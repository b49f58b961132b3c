// Elementary functions, as the processors' engines compute them (`lanes/src/math.rs`): those of
// the language may be off by 5e-4 on some adapters.

const PI: f32 = 3.14159265;
const TAU: f32 = 6.28318531;
const LOG2_E: f32 = 1.44269504;
const LN_2: f32 = 0.69314718;
const LEAST_NORMAL: f32 = 1.17549435e-38;
// Farther than anything: infinity is no constant of the language.
const FAR: f32 = 3.0e38;

// -ln x of a normal positive number.
fn minus_ln(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = i32((bits + (0x3f800000u - 0x3f3504f3u)) >> 23u) - 127;
    let f = bitcast<f32>(bits - (u32(exponent) << 23u)) - 1.0;
    var p = -7.63443e-2;
    p = fma(p, f, 1.276155e-1);
    p = fma(p, f, -1.3160195e-1);
    p = fma(p, f, 1.4201762e-1);
    p = fma(p, f, -1.6623356e-1);
    p = fma(p, f, 2.0001227e-1);
    p = fma(p, f, -2.5000821e-1);
    p = fma(p, f, 3.3333332e-1);
    let ln = fma(f * f, fma(f, p, -0.5), f);
    return -fma(f32(exponent), LN_2, ln);
}

// 2^x for x <= 0; below 2^-126 that.
fn exp2_of(exponent: f32) -> f32 {
    let x = max(exponent, -126.0);
    let whole = floor(x + 0.5);
    let f = x - whole;
    var p = 1.5476188e-4;
    p = fma(p, f, 1.3400274e-3);
    p = fma(p, f, 9.618004e-3);
    p = fma(p, f, 5.5503278e-2);
    p = fma(p, f, 2.4022651e-1);
    p = fma(p, f, 6.931472e-1);
    return fma(f, p, 1.0) * bitcast<f32>(u32(i32(whole) + 127) << 23u);
}

// Sine and cosine of 2 pi u for u in [0, 1).
fn sin_cos_of_turns(u: f32) -> vec2<f32> {
    let four = u * 4.0;
    let nearest = floor(four + 0.5);
    let r = (four - nearest) * (0.25 * TAU);
    let z = r * r;
    let sin_part = fma(r * z, fma(fma(-1.95173e-4, z, 8.332178e-3), z, -1.6666655e-1), r);
    let cos_poly = fma(fma(2.443845e-5, z, -1.3887368e-3), z, 4.1666647e-2);
    let cos_part = fma(z * z, cos_poly, fma(z, -0.5, 1.0));
    let quarter = u32(i32(nearest));
    let swapped = (quarter & 1u) == 1u;
    let s = select(sin_part, cos_part, swapped);
    let c = select(cos_part, sin_part, swapped);
    return vec2<f32>(
        bitcast<f32>(bitcast<u32>(s) ^ ((quarter & 2u) << 30u)),
        bitcast<f32>(bitcast<u32>(c) ^ (((quarter + 1u) & 2u) << 30u)),
    );
}

// `size`, which must not be negative, with the sign of `s`.
fn with_sign_of(size: f32, s: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(size) | (bitcast<u32>(s) & 0x80000000u));
}

// The angle of the point (x, y) from the x axis in turns, from -1/2 to 1/2.
fn turns_of(y: f32, x: f32) -> f32 {
    let across = abs(x);
    let up = abs(y);
    let most = max(max(across, up), LEAST_NORMAL);
    let a = min(across, up) / most;
    let z = a * a;
    var p = -6.453043e-4;
    p = fma(p, z, 3.4795979e-3);
    p = fma(p, z, -8.898723e-3);
    p = fma(p, z, 1.5346034e-2);
    p = fma(p, z, -2.213627e-2);
    p = fma(p, z, 3.1745944e-2);
    p = fma(p, z, -5.304612e-2);
    p = fma(p, z, 1.5915483e-1);
    var turns = a * p;
    turns = select(turns, 0.25 - turns, across < up);
    turns = select(turns, 0.5 - turns, x < 0.0);
    return bitcast<f32>(bitcast<u32>(turns) | (bitcast<u32>(y) & 0x80000000u));
}

fn sum_of(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

// A unit vector across another.
fn beside(axis: vec3<f32>) -> vec3<f32> {
    let other = select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(1.0, 0.0, 0.0), abs(axis.x) < 0.6);
    let across = cross(axis, other);
    return across * (1.0 / sqrt(dot(across, across)));
}

// One step toward unit length, against rounding along a path.
fn nearly_unit(v: vec3<f32>) -> vec3<f32> {
    return v * fma(dot(v, v), -0.5, 1.5);
}

// One over a step, where zero counts as very little; by one division.
fn inverse_of_step(step: vec3<f32>) -> vec3<f32> {
    let x = not_zero(step.x);
    let y = not_zero(step.y);
    let z = not_zero(step.z);
    let xy = x * y;
    let yz = y * z;
    let per_all = 1.0 / (xy * z);
    return vec3<f32>(yz * per_all, x * z * per_all, xy * per_all);
}

fn not_zero(s: f32) -> f32 {
    return select(with_sign_of(1.0e-10, s), s, abs(s) > 1.0e-10);
}
