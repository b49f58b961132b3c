// Tables of optical depths toward lights: see `voxels/optical_depth_table.rs`.

struct Corners {
    // The node of the lower four; that of the upper follows.
    node: u32,
    // How far the place is from the first.
    share: vec3<f32>,
}

// The last node before a place along one axis in x, how far behind it the place is in y.
fn node_before(at: f32, size: f32, wraps: bool) -> vec2<f32> {
    let scaled = fma(at, nodes_per_voxel(), -0.5);
    if wraps {
        let low = floor(scaled);
        return vec2<f32>(select(low, size - 1.0, low < 0.0), scaled - low);
    }
    // Nothing is known beyond the last node.
    let kept = min(max(scaled, 0.0), size - 1.0);
    let low = floor(kept);
    return vec2<f32>(low, kept - low);
}

fn corners_around(at: vec3<f32>) -> Corners {
    let dims = node_dims();
    let size = vec3<f32>(dims);
    let x = node_before(at.x, size.x, REPEATS);
    let y = node_before(at.y, size.y, REPEATS);
    let z = node_before(at.z, size.z, false);
    let node = (u32(x.x) + dims.x * u32(y.x)) * dims.z + u32(z.x);
    return Corners(node, vec3<f32>(x.y, y.y, z.y));
}

fn between_four(four: u32, share: vec3<f32>) -> f32 {
    let a = f32(four & 0xffu);
    let b = f32((four >> 8u) & 0xffu);
    let c = f32((four >> 16u) & 0xffu);
    let d = f32(four >> 24u);
    return mix(mix(a, b, share.x), mix(c, d, share.x), share.y);
}

// The depth by a table with the words of so many lights side by side. The last node of a
// column has no upper one: its share is then zero, and any word will do.
fn table_depth(table: u32, lights: u32, light: u32, corners: Corners) -> f32 {
    let low = table + corners.node * lights + light;
    let low_depth = between_four(word(low), corners.share);
    var depth = low_depth;
    if corners.share.z > 0.0 {
        depth = mix(low_depth, between_four(word(low + lights), corners.share), corners.share.z);
    }
    return depth * (10.0 / 255.0);
}
