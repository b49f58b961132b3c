// Bounds, reaches, axes and end-on ratios by their codes: see `voxels/voxel_words.rs` and
// `packed/axis_code.rs`.

const EXTINCTION_BASE: u32 = (127u - 15u) << 23u;
const LEAST_EXTINCTION: f32 = 1.0 / 32768.0;
// The greatest bound.
const GREATEST: f32 = 2.0 - 1.0 / 16.0 - LEAST_EXTINCTION;

fn bound_of_code(code: u32) -> f32 {
    return bitcast<f32>((code << 19u) + EXTINCTION_BASE) - LEAST_EXTINCTION;
}

// In voxels.
fn reach_of_code(code: u32) -> f32 {
    return bitcast<f32>((code << 22u) + (127u << 23u));
}

fn end_on_of_code(code: u32) -> f32 {
    let root = f32(code) * (1.0 / 4095.0);
    return root * root;
}

// The axis of a code in the lowest bits, so many for each of two coordinates; its length is
// between 3^-1/2 and one.
fn axis_of_code(code: u32, bits: u32) -> vec3<f32> {
    let most = (1u << bits) - 1u;
    let per_zero = 1.0 / f32(most >> 1u);
    let x = fma(f32((code >> bits) & most), per_zero, -1.0);
    let y = fma(f32(code & most), per_zero, -1.0);
    let z = 1.0 - abs(x) - abs(y);
    let fold = max(-z, 0.0);
    return vec3<f32>(x - with_sign_of(fold, x), y - with_sign_of(fold, y), z);
}
