// Light at the surface of a fibre: see `scatter/src/near/event.rs`, `scatter/src/near/crossing.rs` and, for
// the words of materials, `scatter/src/near/optics.rs`.

const MATERIAL_WORDS: u32 = 32u;
const NODE_WORDS: u32 = 8u;
const INVERSE_SQRT_TAU: f32 = 0.3989423;
// Tries to draw an inclination before the last one is taken.
const MAX_TRIES: u32 = 2048u;

struct Material {
    is_dielectric: bool,
    ior: f32,
    // Absorption times radius of a dielectric; of a fitted fibre R at normal incidence.
    absorption: vec3<f32>,
    // Of a fitted fibre what TT keeps.
    colour_tt: vec3<f32>,
    // Of R, TT, TRT and the rest.
    blurs: vec4<f32>,
    inverse_blurs: vec4<f32>,
    // Cosine of how near to an end folds matter.
    fold_cosines: vec4<f32>,
    azimuth_blur: f32,
    inverse_azimuth_blur: f32,
    near_axis: f32,
    max_drawn: f32,
    nodes: f32,
    first_node: u32,
    // Of a dielectric that is not round: its first row, and nodes of a row.
    first_row: u32,
    azimuths: u32,
}

// How a ray passes a fibre.
struct Crossing {
    gamma_t: f32,
    fresnel: f32,
    path_radii: f32,
}

// The balance at an inclination.
struct Balanced {
    scale: vec3<f32>,
    norms: vec4<f32>,
}

struct NearEvent {
    tangent: vec3<f32>,
    forward: vec3<f32>,
    side: vec3<f32>,
    sin_out: f32,
    cos_out: f32,
    offset: f32,
    gamma_i: f32,
    out: Balanced,
    // Probability of drawing each lobe, and that over its norm.
    shares: vec4<f32>,
    draws: vec4<f32>,
    radius_mm: f32,
    // Angles of the surface normals where R, TT and TRT leave.
    exit_normals: vec3<f32>,
}

// What an event does with light from a direction.
struct Scattered {
    // Light sent back along the way per radiance and steradian.
    value: vec3<f32>,
    // Density with which the walk draws the direction, 1/sr.
    pdf: f32,
    azimuth: f32,
    // What each lobe sends, for the choice of where light leaves.
    sent: vec4<f32>,
}

struct Angles {
    sin_in: f32,
    cos_in: f32,
    azimuth: f32,
}

struct Lobes {
    r: vec3<f32>,
    tt: vec3<f32>,
    trt: vec3<f32>,
    rest: vec3<f32>,
}

// Of a fibre that is not round: of each lobe light over the density of drawing an azimuth, and
// that density.
struct SectionLight {
    light: Lobes,
    densities: vec4<f32>,
}

var<private> material: Material;
var<private> event: NearEvent;

fn load_material(index: u32) {
    let at = optics_table() + MATERIAL_WORDS * index;
    material.is_dielectric = word(at) == 1u;
    material.ior = number(at + 1u);
    material.absorption = vector(at + 2u);
    material.colour_tt = vector(at + 5u);
    material.blurs = four(at + 8u);
    material.inverse_blurs = four(at + 12u);
    material.fold_cosines = four(at + 16u);
    material.azimuth_blur = number(at + 20u);
    material.inverse_azimuth_blur = number(at + 21u);
    material.near_axis = number(at + 22u);
    material.max_drawn = number(at + 23u);
    material.nodes = number(at + 24u);
    material.first_node = optics_table() + word(at + 25u);
    material.first_row = optics_table() + word(at + 26u);
    material.azimuths = word(at + 27u);
}

// The node before a cosine, and how far it is to the next.
fn node_of(cos_of: f32) -> vec2<f32> {
    let last = material.nodes - 1.0;
    let scaled = cos_of * last;
    let lower = clamp(floor(scaled), 0.0, last - 1.0);
    return vec2<f32>(lower, scaled - lower);
}

fn near_axis_of(cos_of: f32) -> f32 {
    return sqrt(fma(cos_of, cos_of, material.near_axis));
}

fn balanced(cos_of: f32) -> Balanced {
    let node = node_of(cos_of);
    let at = material.first_node + NODE_WORDS * u32(node.x);
    let near_axis = near_axis_of(cos_of);
    let scale = mix(four(at).xyz, four(at + NODE_WORDS).xyz, node.y) * (1.0 / near_axis);
    let norms = mix(four(at + 4u), four(at + 4u + NODE_WORDS), node.y) * near_axis;
    return Balanced(scale, norms);
}

// The mean of c over channels.
fn mean_scale(cos_of: f32) -> f32 {
    let node = node_of(cos_of);
    let at = material.first_node + NODE_WORDS * u32(node.x);
    return mix(number(at + 3u), number(at + 3u + NODE_WORDS), node.y) / near_axis_of(cos_of);
}

fn angle_of(y: f32, x: f32) -> f32 {
    return turns_of(y, x) * TAU;
}

fn sin_cos_of(angle: f32) -> vec2<f32> {
    let turns = angle * (1.0 / TAU);
    return sin_cos_of_turns(turns - floor(turns));
}

// An angle brought to between about -pi and pi.
fn wrapped_angle(angle: f32) -> f32 {
    return fma(floor(angle * (1.0 / TAU) + 0.5), -TAU, angle);
}

// exp(-x^2 / 2).
fn bell(x: f32) -> f32 {
    return exp2_of(x * x * (-0.5 * LOG2_E));
}

// A standard normal number.
fn normal_number(u: f32, v: f32) -> f32 {
    let half_square = minus_ln(positive(u));
    return sqrt(half_square + half_square) * sin_cos_of_turns(v).y;
}

// Unpolarised reflectance for the cosine of the angle of incidence.
fn fresnel_of(cosine: f32, ior: f32) -> f32 {
    let cos_i = clamp(cosine, 0.0, 1.0);
    let cos_t = sqrt(max(1.0 - (1.0 - cos_i * cos_i) / (ior * ior), 0.0));
    let across = (cos_i - ior * cos_t) / max(fma(ior, cos_t, cos_i), 1.0e-12);
    let along = (ior * cos_i - cos_t) / max(fma(ior, cos_i, cos_t), 1.0e-12);
    return 0.5 * fma(across, across, along * along);
}

fn crossing_at(cosine: f32) -> Crossing {
    let cos_of = clamp(cosine, 1.0e-4, 1.0);
    let cos_squared = cos_of * cos_of;
    let ior_squared = material.ior * material.ior;
    let index = sqrt(max(ior_squared - 1.0 + cos_squared, 0.0)) / cos_of;
    let sin_t = clamp(event.offset / index, -1.0, 1.0);
    let cos_t = sqrt(max(1.0 - sin_t * sin_t, 0.0));
    let cos_i = sqrt(max(1.0 - event.offset * event.offset, 0.0));
    let inside = sqrt(max(1.0 - (1.0 - cos_squared) / ior_squared, 0.0));
    return Crossing(
        angle_of(sin_t, cos_t),
        fresnel_of(cos_of * cos_i, material.ior),
        (cos_t + cos_t) / max(inside, 1.0e-4),
    );
}

// Angle of the surface normal where light of a lobe leaves.
fn exit_normal_of(crossing: Crossing, lobe: f32) -> f32 {
    let inside = PI - (crossing.gamma_t + crossing.gamma_t);
    return PI - event.gamma_i - lobe * inside;
}

fn exit_azimuth_of(crossing: Crossing, lobe: f32) -> f32 {
    return exit_normal_of(crossing, lobe) - event.gamma_i;
}

// What each lobe keeps of the light at a mean inclination.
fn energies(crossing: Crossing, mean_cos: f32) -> Lobes {
    if material.is_dielectric {
        let f = crossing.fresnel;
        let path = -crossing.path_radii * LOG2_E;
        let t = vec3<f32>(
            exp2_of(material.absorption.x * path),
            exp2_of(material.absorption.y * path),
            exp2_of(material.absorption.z * path),
        );
        let tt = (1.0 - f) * (1.0 - f) * t;
        let trt = f * t * tt;
        let again = f * t;
        let rest = trt * again / max(1.0 - again, vec3<f32>(1.0e-6));
        return Lobes(vec3<f32>(f), tt, trt, rest);
    }
    let x = clamp(1.0 - mean_cos, 0.0, 1.0);
    let square = x * x;
    let r = (1.0 - material.absorption) * (square * square * x) + material.absorption;
    return Lobes(r, (1.0 - r) * material.colour_tt, vec3<f32>(0.0), vec3<f32>(0.0));
}

// A Gaussian of the azimuth's blur around the circle.
fn around_circle(apart: f32) -> f32 {
    let x = abs(wrapped_angle(apart));
    let inverse = material.inverse_azimuth_blur;
    var value = bell(x * inverse);
    let around = TAU - x;
    if around < material.azimuth_blur * 6.0 {
        value += bell(around * inverse) + bell((x + TAU) * inverse);
    }
    return value * inverse * INVERSE_SQRT_TAU;
}

// Densities per radian of each lobe's azimuth.
fn azimuth_densities(crossing: Crossing, azimuth: f32) -> vec4<f32> {
    let even = 1.0 / TAU;
    if material.is_dielectric {
        return vec4<f32>(
            around_circle(azimuth - exit_azimuth_of(crossing, 0.0)),
            around_circle(azimuth - exit_azimuth_of(crossing, 1.0)),
            around_circle(azimuth - exit_azimuth_of(crossing, 2.0)),
            even,
        );
    }
    return vec4<f32>(even, around_circle(azimuth), even, even);
}

fn bell_with_fold(lobe: u32, sum: f32, folded: f32, cos_folded: f32) -> f32 {
    let inverse = material.inverse_blurs[lobe];
    var value = bell(sum * inverse);
    if material.fold_cosines[lobe] < cos_folded {
        value += bell(folded * inverse);
    }
    return value * inverse * INVERSE_SQRT_TAU;
}

// Densities per radian of the inclination, of each lobe; the rest is as wide as TRT.
fn inclination_densities(pair: Inclinations) -> vec4<f32> {
    let sum = angle_of(pair.sum.x, pair.sum.y);
    let folded = angle_of(pair.folded.x, pair.folded.y);
    let trt = bell_with_fold(2u, sum, folded, pair.folded.y);
    return vec4<f32>(
        bell_with_fold(0u, sum, folded, pair.folded.y),
        bell_with_fold(1u, sum, folded, pair.folded.y),
        trt,
        trt,
    );
}

fn scattered_by(angles: Angles, pair: Inclinations, crossing: Crossing) -> Scattered {
    var azimuths: vec4<f32>;
    var colours: Lobes;
    if is_section() {
        let own = section_light(pair.mean_cos, angles.azimuth);
        azimuths = own.densities;
        colours = own.light;
    } else {
        azimuths = azimuth_densities(crossing, angles.azimuth);
        colours = energies(crossing, pair.mean_cos);
    }
    let k = inclination_densities(pair) * azimuths;
    let value = colours.r * k.x + colours.tt * k.y + colours.trt * k.z + colours.rest * k.w;
    let sums = vec4<f32>(
        sum_of(colours.r),
        sum_of(colours.tt),
        sum_of(colours.trt),
        sum_of(colours.rest),
    );
    let here = balanced(angles.cos_in);
    let scale = event.out.scale * here.scale * angles.cos_in;
    let mean = sum_of(here.scale) * (1.0 / 3.0);
    let pdf = dot(k, event.draws) * mean * angles.cos_in;
    return Scattered(value * scale, pdf, angles.azimuth, k * sums);
}

// Light from a direction.
fn scattered_from(w_in: vec3<f32>) -> Scattered {
    let x = dot(w_in, event.forward);
    let y = dot(w_in, event.side);
    let angles = Angles(
        clamp(dot(w_in, event.tangent), -1.0, 1.0),
        min(sqrt(fma(x, x, y * y)), 1.0),
        angle_of(y, x),
    );
    let pair = inclinations(angles.sin_in, angles.cos_in);
    return scattered_by(angles, pair, crossing_at(pair.mean_cos));
}

// The event where a fibre was met.
fn meet_fibre(tangent: vec3<f32>, out_mm: vec3<f32>, w_out: vec3<f32>) {
    event.tangent = tangent;
    event.sin_out = clamp(dot(tangent, w_out), -1.0, 1.0);
    let aside = cross(w_out, tangent);
    event.cos_out = min(sqrt(dot(aside, aside)), 1.0);
    // Rounding has tilted a short product toward the tangent.
    let upright = aside - tangent * dot(tangent, aside);
    let size = sqrt(dot(upright, upright));
    event.side = beside(tangent);
    if size > 1.0e-7 {
        event.side = upright * (1.0 / size);
    }
    event.forward = cross(event.side, tangent);
    // Across the tangent, which at a bend is not that of the cylinder.
    let across = out_mm - tangent * dot(tangent, out_mm);
    let height = sqrt(dot(across, across));
    event.offset = clamp(dot(across, event.side) / max(height, 1.0e-20), -1.0, 1.0);
    event.gamma_i = angle_of(event.offset, sqrt(max(1.0 - event.offset * event.offset, 0.0)));
    let blur = material.blurs.x;
    let drawing = sqrt(min(fma(event.cos_out, event.cos_out, blur * blur * 0.25), 1.0));
    event.out = balanced(event.cos_out);
    event.radius_mm = sqrt(dot(out_mm, out_mm));
    var means: vec4<f32>;
    if is_section() {
        means = section_shares(drawing);
    } else {
        let kept = energies(crossing_at(drawing), drawing);
        means = vec4<f32>(sum_of(kept.r), sum_of(kept.tt), sum_of(kept.trt), sum_of(kept.rest));
        means *= 1.0 / 3.0;
    }
    let sent = means * event.out.norms;
    let total = sent.x + sent.y + sent.z + sent.w;
    event.shares = vec4<f32>(1.0, 0.0, 0.0, 0.0);
    if total > 0.0 {
        event.shares = sent / total;
    }
    event.draws = event.shares / max(event.out.norms, vec4<f32>(LEAST_NORMAL));
    let crossing = crossing_at(event.cos_out);
    event.exit_normals = vec3<f32>(
        exit_normal_of(crossing, 0.0),
        exit_normal_of(crossing, 1.0),
        exit_normal_of(crossing, 2.0),
    );
}

// The index at which the sum of parts first exceeds `u`, never of a part that is zero unless
// all are.
fn pick(parts: vec4<f32>, u: f32) -> u32 {
    var left = u;
    var chosen = 0u;
    for (var p = 0u; p < 4u; p++) {
        if parts[p] > 0.0 {
            chosen = p;
            left -= parts[p];
            if left < 0.0 {
                break;
            }
        }
    }
    return chosen;
}

struct NearTurn {
    direction: vec3<f32>,
    weight: vec3<f32>,
    scattered: Scattered,
}

// Draws where light comes from.
fn turned() -> NearTurn {
    let first = units();
    let lobe = pick(event.shares, first.x);
    let blur = material.blurs[lobe];

    // The inclination: by the blur, kept in proportion to what the balance makes of it.
    var sin_in = 0.0;
    var cos_in = 1.0;
    for (var i = 0u; i < MAX_TRIES; i++) {
        let u = units();
        let s = sin_cos_of(normal_number(u.x, u.y) * blur);
        sin_in = clamp(s.x * event.cos_out - s.y * event.sin_out, -1.0, 1.0);
        cos_in = min(abs(fma(s.y, event.cos_out, s.x * event.sin_out)), 1.0);
        let drawing = mean_scale(cos_in) * cos_in * cos_in;
        if u.z * material.max_drawn < drawing {
            break;
        }
    }
    let pair = inclinations(sin_in, cos_in);
    let crossing = crossing_at(pair.mean_cos);

    // The azimuth: about where the lobe leaves, or anywhere.
    var mean = 0.0;
    if material.is_dielectric && lobe < 3u {
        mean = exit_azimuth_of(crossing, f32(lobe));
    }
    let is_even = select(lobe == 0u, lobe == 3u, material.is_dielectric || is_section());
    let about = mean + normal_number(first.y, first.z) * material.azimuth_blur;
    var azimuth = wrapped_angle(select(about, PI - first.z * TAU, is_even));
    if is_section() && lobe < 3u {
        azimuth = section_azimuth(lobe, pair.mean_cos);
    }

    let s = sin_cos_of(azimuth);
    let across = event.forward * (s.y * cos_in) + event.side * (s.x * cos_in);
    let direction = event.tangent * sin_in + across;
    let scattered = scattered_by(Angles(sin_in, cos_in, azimuth), pair, crossing);
    var per = 0.0;
    if scattered.pdf > 0.0 {
        per = 1.0 / scattered.pdf;
    }
    return NearTurn(nearly_unit(direction), scattered.value * per, scattered);
}

// The unit normal of the surface where light leaves toward a direction.
fn exit_normal(toward: Scattered, u_lobe: f32, u_place: f32) -> vec3<f32> {
    let total = toward.sent.x + toward.sent.y + toward.sent.z + toward.sent.w;
    let lobe = pick(toward.sent, u_lobe * total);
    let s = u_place + u_place - 1.0;
    var angle = toward.azimuth + angle_of(s, sqrt(max(1.0 - s * s, 0.0)));
    // Of fibres that are not round only R.
    if (material.is_dielectric && lobe < 3u) || (is_section() && lobe == 0u) {
        angle = event.exit_normals[lobe];
    }
    let apart = clamp(wrapped_angle(angle - toward.azimuth), -0.5 * PI, 0.5 * PI);
    let of_normal = sin_cos_of(wrapped_angle(toward.azimuth + apart));
    return event.side * of_normal.x + event.forward * of_normal.y;
}
