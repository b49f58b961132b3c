// Sums of a slot, the samples that one lane takes of a pixel. They are whole numbers of
// 64 bits in two words each, the lower one first, so their order leaves no trace. The
// units are those of `organza_film::Tally`; the host adds slots to pixels.
//
// words: 0 values 3 x 2, 6 squares 3 x 2, 12 products of the axis 6 x 2, 24 depth 2,
//        26 bounces 2, 28 samples, 29 hits, 30 yarn, 31 its sample (all bits set: none)

const SLOT_WORDS: u32 = 32u;
// Words of a sample too bright for the sums: slot, sample, red, green, blue, bounces, then of
// its first event the place (all bits set: none), depth, axis and yarn.
const BRIGHT_WORDS: u32 = 12u;
const VALUE_BITS: i32 = 40;

fn add_to_slot(at: u32, term: vec2<u32>) {
    let low = sums[at] + term.x;
    sums[at + 1u] += term.y + select(0u, 1u, low < term.x);
    sums[at] = low;
}

fn negated64(v: vec2<u32>) -> vec2<u32> {
    let low = ~v.x + 1u;
    return vec2<u32>(low, ~v.y + select(0u, 1u, low == 0u));
}

// Shifted by any number of places, to the left where it is positive.
fn shifted64(v: vec2<u32>, places: i32) -> vec2<u32> {
    if places >= 64 || places <= -64 {
        return vec2<u32>(0u);
    }
    if places >= 32 {
        return vec2<u32>(0u, v.x << u32(places - 32));
    }
    if places > 0 {
        let n = u32(places);
        return vec2<u32>(v.x << n, (v.y << n) | (v.x >> (32u - n)));
    }
    if places == 0 {
        return v;
    }
    if places <= -32 {
        return vec2<u32>(v.y >> u32(-places - 32), 0u);
    }
    let n = u32(-places);
    return vec2<u32>((v.x >> n) | (v.y << (32u - n)), v.y >> n);
}

fn mantissa_of(bits: u32) -> u32 {
    return select((bits & 0x7fffffu) | 0x800000u, 0u, (bits & 0x7f800000u) == 0u);
}

fn exponent_of(bits: u32) -> i32 {
    return i32((bits >> 23u) & 0xffu) - 150;
}

// x in units of 2^-bits, cut off toward zero.
fn whole64(x: f32, unit_bits: i32) -> vec2<u32> {
    let bits = bitcast<u32>(x);
    let size = shifted64(vec2<u32>(mantissa_of(bits), 0u), exponent_of(bits) + unit_bits);
    if (bits >> 31u) != 0u {
        return negated64(size);
    }
    return size;
}

// The square of x in units of 2^-bits, cut off.
fn whole_square64(x: f32, unit_bits: i32) -> vec2<u32> {
    let bits = bitcast<u32>(x);
    let m = mantissa_of(bits);
    return shifted64(wide_product(m, m), 2 * exponent_of(bits) + unit_bits);
}

fn add_product(at: u32, x: f32) {
    let whole = i32(x * 1073741824.0);
    add_to_slot(at, vec2<u32>(u32(whole), select(0u, 0xffffffffu, whole < 0)));
}

// Adds the path that has ended to its slot; false when the list of bright samples is
// full, and the lane has to wait.
fn record_sample() -> bool {
    let r = path.radiance;
    // Bits, for comparisons with what is not a number may be left out by compilers.
    let sizes = bitcast<vec3<u32>>(r) & vec3<u32>(0x7fffffffu);
    let most = max(max(sizes.x, sizes.y), sizes.z);
    if most >= RADIANCE_LIMIT_BITS {
        rejected_count += 1u;
        return true;
    }
    if most >= bitcast<u32>(brightest_summed()) {
        let entry = atomicAdd(&control[CONTROL_BRIGHT], 1u);
        if entry >= bright_room() {
            return false;
        }
        let at = entry * BRIGHT_WORDS;
        bright[at] = path.slot;
        bright[at + 1u] = path.sample;
        bright[at + 2u] = bitcast<u32>(r.x);
        bright[at + 3u] = bitcast<u32>(r.y);
        bright[at + 4u] = bitcast<u32>(r.z);
        bright[at + 5u] = path.bounces;
        bright[at + 6u] = path.first_place;
        if path.first_place != NO_PLACE {
            let t = first_axis();
            bright[at + 7u] = bitcast<u32>(first_depth_mm());
            bright[at + 8u] = bitcast<u32>(t.x);
            bright[at + 9u] = bitcast<u32>(t.y);
            bright[at + 10u] = bitcast<u32>(t.z);
            bright[at + 11u] = first_yarn();
        }
        note_brightest(r);
        return true;
    }
    note_brightest(r);
    let at = path.slot * SLOT_WORDS;
    let value_bits = VALUE_BITS - brightness_exponent();
    let square_bits = VALUE_BITS - 2 * brightness_exponent();
    for (var c = 0u; c < 3u; c++) {
        add_to_slot(at + 2u * c, whole64(r[c], value_bits));
        add_to_slot(at + 6u + 2u * c, whole_square64(r[c], square_bits));
    }
    add_to_slot(at + 26u, vec2<u32>(path.bounces, 0u));
    sums[at + 28u] += 1u;
    if path.first_place != NO_PLACE {
        sums[at + 29u] += 1u;
        add_to_slot(at + 24u, whole64(first_depth_mm(), 32));
        let t = first_axis();
        add_product(at + 12u, t.x * t.x);
        add_product(at + 14u, t.y * t.y);
        add_product(at + 16u, t.z * t.z);
        add_product(at + 18u, t.x * t.y);
        add_product(at + 20u, t.x * t.z);
        add_product(at + 22u, t.y * t.z);
        let yarn = first_yarn();
        // Samples of a slot come in their order: the first that met a yarn counts.
        if yarn != NO_PLACE && sums[at + 31u] == NO_PLACE {
            sums[at + 30u] = yarn;
            sums[at + 31u] = path.sample;
        }
    }
    return true;
}

fn note_brightest(r: vec3<f32>) {
    let most = max(max(max(r.x, r.y), r.z), 0.0);
    brightest_bits = max(brightest_bits, bitcast<u32>(most));
}
