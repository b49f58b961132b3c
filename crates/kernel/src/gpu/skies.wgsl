// Environment pictures: their sky, which escaping walks find, and their lamps, which shadow
// rays find. See `voxels/environment.rs`. Words of a picture in the table of skies, and of
// its lamps:
//
// 0 columns, 1 rows (numbers), 2 centre 3, 5 left 3, 8 up 3, 11 table of texels,
// 12 where the whole picture begins in it, 13 lamps, 14 table of lamps
// 0 table of places, 1 slots, 2 table of depths, 3 residual floor

const SKY_WORDS: u32 = 16u;
const LAMP_WORDS: u32 = 4u;

fn sky_radiance(direction: vec3<f32>, whole: bool) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < sky_count(); i++) {
        sum += picture_radiance(skies_table() + i * SKY_WORDS, direction, whole);
    }
    return sum;
}

// Radiance along a direction of sight: the sky's, or the whole picture's where nothing
// looked for the lamps.
fn picture_radiance(sky: u32, w: vec3<f32>, whole: bool) -> vec3<f32> {
    let width = number(sky);
    let height = number(sky + 1u);
    let x = dot(w, vector(sky + 2u));
    let y = dot(w, vector(sky + 5u));
    let z = dot(w, vector(sky + 8u));
    let polar = turns_of(sqrt(fma(x, x, y * y)), z);
    let column = fma(0.5 - turns_of(y, x), width, -0.5);
    let row = fma(polar, 2.0 * height, -0.5);
    let first = floor(column);
    let above = floor(row);
    let fx = column - first;
    let fy = row - above;
    let last = width - 1.0;
    let right = select(first + 1.0, 0.0, first + 1.0 > last);
    let left = select(first, last, first < 0.0);
    let lower = min(above + 1.0, height - 1.0);
    let upper = max(above, 0.0);
    var texels = word(sky + 11u);
    if whole {
        texels += word(sky + 12u);
    }
    let left_at = u32(min(max(left, 0.0), last)) * 3u;
    let right_at = u32(min(max(right, 0.0), last)) * 3u;
    let upper_at = texels + u32(upper) * 3u * u32(width);
    let lower_at = texels + u32(lower) * 3u * u32(width);
    let high = mix(vector(upper_at + left_at), vector(upper_at + right_at), fx);
    let low = mix(vector(lower_at + left_at), vector(lower_at + right_at), fx);
    return mix(high, low, fy);
}

// A number between -1 and 1, the more seldom the farther from 0: linearly.
fn tent(u: f32) -> f32 {
    let twice = u + u;
    if twice < 1.0 {
        return sqrt(twice) - 1.0;
    }
    return 1.0 - sqrt(max(2.0 - twice, 0.0));
}

struct LampSample {
    toward: vec3<f32>,
    // Radiance over density.
    irradiance: vec3<f32>,
    // A random number that is left.
    u: f32,
}

// Draws a direction toward a lamp: a texel, then a place in the tent that interpolation
// spreads it over.
fn lamp_sample(sky: u32, lamp: u32) -> LampSample {
    let u = units();
    let v = units();
    let places = word(lamp);
    var place = places + u32(u.x * f32(word(lamp + 1u))) * 8u;
    if u.y >= number(place) {
        place = places + word(place + 1u);
    }
    let at = word(place + 2u);
    let height = number(sky + 1u);
    let x = f32(at & 0xffffu) + 0.5 + tent(v.x);
    // Beyond a pole the picture goes on as its last row: the tent folds.
    let folded = abs(f32(at >> 16u) + 0.5 + tent(v.y));
    let y = height - abs(height - folded);
    let turns = 0.5 - x / number(sky);
    let azimuth = sin_cos_of_turns(turns - floor(turns));
    let polar = sin_cos_of_turns(y * (0.5 / height));
    let across = vector(sky + 2u) * azimuth.y + vector(sky + 5u) * azimuth.x;
    let toward = vector(sky + 8u) * polar.y + across * polar.x;
    return LampSample(toward, vector(place + 3u) * polar.x, u.z);
}
