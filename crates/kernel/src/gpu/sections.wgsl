// Azimuthal lobes of fibres that are not round: see `scatter/src/near/section_lobes.rs`.
//
// rows, over even steps of the cosine of the mean inclination: 0 light of the remainder 3,
//   4 chances of the four lobes, 8 nodes, over even steps of the azimuth from 0 to pi
// nodes: of three lobes the light 3 and the density of drawing, then of each what of its slot
//   is its own, and who has the rest

const ROW_HEAD: u32 = 8u;
const SECTION_NODE: u32 = 18u;
const NODE_PAIRS: u32 = 12u;

struct SectionRow {
    first: u32,
    next: u32,
    // How far it is to the next.
    down: f32,
}

// Whether the fibre that was met is not round.
fn is_section() -> bool {
    return material.azimuths > 0u;
}

fn section_row(mean_cos: f32) -> SectionRow {
    let last = f32(SECTION_ROWS - 1u);
    let scaled = mean_cos * last;
    let row = clamp(floor(scaled), 0.0, last - 1.0);
    let stride = ROW_HEAD + SECTION_NODE * material.azimuths;
    let first = material.first_row + stride * u32(row);
    return SectionRow(first, first + stride, scaled - row);
}

fn four_numbers(at: u32) -> vec4<f32> {
    return vec4<f32>(vector(at), number(at + 3u));
}

// Chances of the lobes at the cosine of an inclination.
fn section_shares(cos_of: f32) -> vec4<f32> {
    let row = section_row(cos_of);
    return mix(four_numbers(row.first + 4u), four_numbers(row.next + 4u), row.down);
}

// A lobe between four nodes: light over the density of drawing, and that density.
fn section_lobe(row: SectionRow, offset: u32, along: f32) -> vec4<f32> {
    let above = row.first + offset;
    let below = row.next + offset;
    let a = mix(four_numbers(above), four_numbers(above + SECTION_NODE), along);
    let b = mix(four_numbers(below), four_numbers(below + SECTION_NODE), along);
    let both = mix(a, b, row.down);
    let density = max(both.w, LEAST_NORMAL);
    return vec4<f32>(both.xyz / density, density);
}

fn section_light(mean_cos: f32, azimuth: f32) -> SectionLight {
    let row = section_row(mean_cos);
    let last = f32(material.azimuths - 1u);
    let scaled = min(abs(azimuth), PI) * (1.0 / PI) * last;
    let left = min(floor(scaled), last - 1.0);
    let offset = ROW_HEAD + SECTION_NODE * u32(left);
    let r = section_lobe(row, offset, scaled - left);
    let tt = section_lobe(row, offset + 4u, scaled - left);
    let trt = section_lobe(row, offset + 8u, scaled - left);
    let rest = mix(vector(row.first), vector(row.next), row.down) * TAU;
    let densities = vec4<f32>(r.w, tt.w, trt.w, 1.0 / TAU);
    return SectionLight(Lobes(r.xyz, tt.xyz, trt.xyz, rest), densities);
}

// Draws the azimuth of a lobe with its density.
fn section_azimuth(lobe: u32, mean_cos: f32) -> f32 {
    let u = units();
    let v = units();
    let row = section_row(mean_cos);
    let nodes = ROW_HEAD + select(row.first, row.next, u.x < row.down);
    let count = f32(material.azimuths);
    let slot = u32(min(floor(u.y * count), count - 1.0));
    let pair = nodes + SECTION_NODE * slot + NODE_PAIRS + 2u * lobe;
    var node = slot;
    if u.z >= number(pair) {
        node = word(pair + 1u);
    }
    // Folded at the ends.
    let last = count - 1.0;
    let place = abs(f32(node) + (v.x + v.y - 1.0));
    let azimuth = min(place, 2.0 * last - place) * PI / last;
    return select(-azimuth, azimuth, v.z < 0.5);
}
