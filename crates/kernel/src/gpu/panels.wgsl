// Rectangle lights, and the words of lights in their table:
//
// 0 toward the light 3, 3 residual floor, 4 irradiance, radiance or intensity 3, 7 1 of a
// panel, 2 of a spot, 8 table of extinctions, 9 1 of a panel with two sides,
// of a panel 10 corner 3 mm, 13 edges 6 mm, 19 normal 3, 22 area mm2,
// of a spot 10 place 3 mm, 13 axis 3, 16 half angle, 17 width of its edge, radians

const LIGHT_WORDS: u32 = 24u;

fn vector(at: u32) -> vec3<f32> {
    return vec3<f32>(number(at), number(at + 1u), number(at + 2u));
}

fn is_panel(light: u32) -> bool {
    return word(light + 7u) == 1u;
}

// Where a ray from a place, mm, meets the side of a panel that shines, mm; FAR where it does
// not. Before the place it is negative.
fn panel_distance(light: u32, from_mm: vec3<f32>, direction: vec3<f32>) -> f32 {
    let normal = vector(light + 19u);
    let facing = dot(direction, normal);
    if abs(facing) < 1.0e-20 || (word(light + 9u) == 0u && facing >= 0.0) {
        return FAR;
    }
    let from_corner = from_mm - vector(light + 10u);
    let t = -dot(from_corner, normal) / facing;
    let p = from_corner + direction * t;
    let u = vector(light + 13u);
    let v = vector(light + 16u);
    let across = dot(p, u);
    let up = dot(p, v);
    let inside = across >= 0.0 && across <= dot(u, u) && up >= 0.0 && up <= dot(v, v);
    return select(FAR, t, inside);
}
