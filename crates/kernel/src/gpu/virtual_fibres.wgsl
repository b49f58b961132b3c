// Virtual fibres, which are met at a point, in the far field: see `voxels/virtual_fibres.rs`
// and, for the words of their tables, `voxels/fibre_tables.rs`.

const FIBRE_HEAD: u32 = 8u;
const ROW_HEAD: u32 = 4u;
const LOBES: u32 = 3u;
const CHANCES: f32 = 65535.0;

struct Event {
    w_out: vec3<f32>,
    tangent: vec3<f32>,
    // Across the tangent: along the way, and beside it.
    forward: vec3<f32>,
    side: vec3<f32>,
    // Of the inclination of the way.
    sin_out: f32,
    cos_out: f32,
    // What all light is multiplied by, wherever it comes from.
    factor: vec3<f32>,
    // Of the tables: the first row, words of a row, azimuths in it, one over the deviations
    // of the lobes, the scale, its nodes less one.
    rows: u32,
    stride: u32,
    azimuths: u32,
    inverse_blurs: vec3<f32>,
    scale: u32,
    scale_steps: f32,
    // Which nodes light from lights is looked up at.
    chances: vec3<f32>,
}

var<private> event: Event;

// Draws the tangent of a fibre as its population shows it.
fn meet() {
    var fibre = 0u;
    if HAS_MATERIALS {
        fibre = word(materials_table() + path.place);
    }
    let head = fibres_table() + fibre * FIBRE_HEAD;
    event.rows = fibres_table() + word(head);
    event.stride = word(head + 1u);
    event.azimuths = word(head + 2u);
    event.inverse_blurs = vector(head + 3u);
    event.scale = fibres_table() + word(head + 6u);
    event.scale_steps = f32(word(head + 7u)) - 1.0;

    let raw_axis = axis_of(path.voxel);
    let axis = raw_axis * (1.0 / sqrt(dot(raw_axis, raw_axis)));
    let w = -path.direction;
    let seen = seen_tangent(axis, end_on_code_of(path.voxel), w);
    event.tangent = seen.tangent;
    event.cos_out = seen.cos_out;
    let across = cross(w, event.tangent);
    event.side = across * (1.0 / sqrt(max(dot(across, across), 1.0e-20)));
    event.forward = cross(event.side, event.tangent);
    event.sin_out = clamp(dot(event.tangent, w), -1.0, 1.0);
    event.w_out = w;
    event.chances = units();
    event.factor = scale_at(event.cos_out, seen.u) * seen.weight;
}

// The scale c at an inclination, at one of two nodes by chance.
fn scale_at(cos_of: f32, chance: f32) -> vec3<f32> {
    let node = u32(min(fma(cos_of, event.scale_steps, chance), event.scale_steps));
    let first = word(event.scale + 2u * node);
    let second = word(event.scale + 2u * node + 1u);
    let scale = bitcast<f32>((second >> 16u) << 23u);
    return vec3<f32>(f32(first & 0xffffu), f32(first >> 16u), f32(second & 0xffffu)) * scale;
}

// First word of the row of an inclination, one of two by chance.
fn row_at(cos_of: f32, chance: f32) -> u32 {
    let node = u32(min(fma(cos_of, LAST_FAR_ROW, chance), LAST_FAR_ROW));
    return event.rows + event.stride * node;
}

fn colour_of(code: u32) -> vec3<f32> {
    let scale = bitcast<f32>(((code >> 27u) + (127u - 20u)) << 23u);
    let mantissas = vec3<u32>(code & 0x1ffu, (code >> 9u) & 0x1ffu, (code >> 18u) & 0x1ffu);
    return vec3<f32>(mantissas) * scale;
}

// Density of an angle for one over the deviations of the lobes.
fn bells(angle: f32) -> vec3<f32> {
    let x = angle * event.inverse_blurs;
    let e = max(x * x * (-0.5 * LOG2_E), vec3<f32>(-48.0));
    let bell = vec3<f32>(exp2_of(e.x), exp2_of(e.y), exp2_of(e.z));
    return bell * event.inverse_blurs * 0.3989423;
}

// The far field toward a direction over what all light is multiplied by.
fn scattered_toward(w_in: vec3<f32>) -> vec3<f32> {
    let x = dot(w_in, event.forward);
    let y = dot(w_in, event.side);
    let cos_in = sqrt(fma(x, x, y * y));
    let pair = inclinations(dot(w_in, event.tangent), cos_in);
    let steps = f32(event.azimuths) - 1.0;
    let half_turns = abs(turns_of(y, x)) * 2.0;
    let node = u32(min(fma(half_turns, steps, event.chances.y), steps));
    let at = row_at(pair.mean_cos, event.chances.x) + ROW_HEAD + node;

    var kernels = bells(turns_of(pair.sum.x, pair.sum.y) * TAU);
    // Folds matter where some lobe reaches the end within five deviations.
    let widest = min(min(event.inverse_blurs.x, event.inverse_blurs.y), event.inverse_blurs.z);
    let folded = turns_of(pair.folded.x, pair.folded.y) * TAU;
    if folded * widest < 5.0 {
        kernels += bells(folded);
    }
    let value = colour_of(word(at)) * kernels.x
        + colour_of(word(at + event.azimuths)) * kernels.y
        + colour_of(word(at + 2u * event.azimuths)) * kernels.z;
    return value * scale_at(cos_in, event.chances.z) * cos_in;
}

struct Turn {
    direction: vec3<f32>,
    weight: vec3<f32>,
    // A random number that is left.
    u: f32,
}

// Draws a direction; the weight is over what all light is multiplied by.
fn turned() -> Turn {
    let a = units();
    let b = units();
    let c = units();
    let d = units();

    // The lobe, at the inclination of the way, kept from the end by the blur.
    let blur = 0.5 / event.inverse_blurs.x;
    let drawing = sqrt(min(fma(blur, blur, event.cos_out * event.cos_out), 1.0));
    let chances = word(row_at(drawing, a.x));
    let first = f32(chances & 0xffffu);
    let two = f32(chances >> 16u);
    let x = a.y * CHANCES;
    var lobe = 2u;
    var chance = CHANCES - two;
    if x < first {
        lobe = 0u;
        chance = first;
    } else if x < two {
        lobe = 1u;
        chance = two - first;
    }

    // The inclination.
    let half_square = minus_ln(positive(b.x));
    let normal = sqrt(half_square + half_square) * sin_cos_of_turns(b.y).y;
    let turns = normal * (1.0 / TAU) / event.inverse_blurs[lobe];
    let s = sin_cos_of_turns(turns - floor(turns));
    let sin_in = s.x * event.cos_out - s.y * event.sin_out;
    let cos_in = abs(fma(s.y, event.cos_out, s.x * event.sin_out));
    let pair = inclinations(sin_in, cos_in);

    // The azimuth: a node, then a place in its tent.
    let row = row_at(pair.mean_cos, b.z);
    let total = number(row + 1u + lobe);
    let colours = row + ROW_HEAD + event.azimuths * lobe;
    let aliases = colours + event.azimuths * LOBES;
    let azimuths = f32(event.azimuths);
    let u_node = c.x * azimuths;
    let slot = u32(min(u_node, azimuths - 1.0));
    let alias_word = word(aliases + slot);
    let coin = (u_node - floor(u_node)) * 65535.0;
    let node = select(alias_word & 0xffffu, slot, coin < f32(alias_word >> 16u));
    let colour = colour_of(word(colours + node));
    let place = f32(node) + (c.y + c.z - 1.0);
    let azimuth_turns = place * 0.5 / (azimuths - 1.0);
    let azimuth = sin_cos_of_turns(azimuth_turns - floor(azimuth_turns));
    let sin_azimuth = select(-azimuth.x, azimuth.x, d.x < 0.5);

    let per_chance = total * CHANCES * cos_in * cos_in;
    let drawn = max(sum_of(colour) * chance, LEAST_NORMAL);
    let across = event.forward * (azimuth.y * cos_in) + event.side * (sin_azimuth * cos_in);
    let direction = event.tangent * sin_in + across;
    let weight = colour * scale_at(cos_in, a.z) * (per_chance / drawn);
    return Turn(nearly_unit(direction), weight, d.y);
}
