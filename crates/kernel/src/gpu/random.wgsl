// Random numbers of a path: those of the processors' engines (`lanes/src/math.rs`), which are
// a rule of 32 bits, named by seed, pixel and sample. Only the name of a pixel has 64
// bits; two words stand for them here, the lower one first.

const RANDOM_FACTOR: u32 = 1664525u;
const RANDOM_SUMMAND: u32 = 1013904223u;

fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let one = a0 * b1;
    let other = a1 * b0;
    let middle = (low >> 16u) + (one & 0xffffu) + (other & 0xffffu);
    let high = a1 * b1 + (one >> 16u) + (other >> 16u) + (middle >> 16u);
    return vec2<u32>((low & 0xffffu) | (middle << 16u), high);
}

fn product64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = wide_product(a.x, b.x);
    return vec2<u32>(low.x, low.y + a.x * b.y + a.y * b.x);
}

fn sum64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// To the right by 1 to 31 places, combined with the number itself.
fn xor_shifted(v: vec2<u32>, places: u32) -> vec2<u32> {
    return v ^ vec2<u32>((v.x >> places) | (v.y << (32u - places)), v.y >> places);
}

// The finaliser of SplitMix64 [Steele2014].
fn mix64(from_: vec2<u32>) -> vec2<u32> {
    var x = sum64(from_, vec2<u32>(0x7f4a7c15u, 0x9e3779b9u));
    x = product64(xor_shifted(x, 30u), vec2<u32>(0x1ce4e5b9u, 0xbf58476du));
    x = product64(xor_shifted(x, 27u), vec2<u32>(0x133111ebu, 0x94d049bbu));
    return xor_shifted(x, 31u);
}

// The state from which the numbers of a sample come.
fn begin_random(column: u32, row: u32, sample: u32) -> vec3<u32> {
    let pixel = sum64(wide_product(row, film_width()), vec2<u32>(column, 0u));
    let key = mix64(vec2<u32>(seed_low(), seed_high()) ^ mix64(pixel));
    return vec3<u32>(
        key.x * RANDOM_FACTOR + RANDOM_SUMMAND,
        (key.y + sample) * RANDOM_FACTOR + RANDOM_SUMMAND,
        RANDOM_SUMMAND,
    );
}

// The next three numbers of the lane's path on the grid of 24 bits in [0, 1): pcg3d of
// [Jarzynski2020].
fn units() -> vec3<f32> {
    var v = path.random;
    path.random.z += RANDOM_FACTOR;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> vec3<u32>(16u);
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return vec3<f32>(v >> vec3<u32>(8u)) * (1.0 / 16777216.0);
}

// From [0, 1) to (0, 1] on the same grid, so that a logarithm is finite.
fn positive(unit: f32) -> f32 {
    return unit + 1.0 / 16777216.0;
}
