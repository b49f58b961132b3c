// Camera rays, given by where they cross a plane near the matter and by the way there from
// the camera: see `voxels/camera_rays.rs`.

struct CameraRay {
    // In voxels.
    crossing: vec3<f32>,
    direction: vec3<f32>,
    // From the camera to the crossing, mm.
    length_mm: f32,
}

// Through the pixel at a column and row.
fn camera_ray(pixel: vec2<f32>) -> CameraRay {
    let u = units();
    var fourth = 0.0;
    var on_lens = vec2<f32>(0.0);
    if HAS_LENS || FILTER == FILTER_TENT {
        let v = units();
        fourth = v.x;
        let s = sin_cos_of_turns(v.z);
        on_lens = sqrt(v.y) * vec2<f32>(s.y, s.x);
    }
    var beside = vec2<f32>(u.x - 0.5, u.y - 0.5);
    if FILTER == FILTER_TENT {
        beside = vec2<f32>(u.x + u.y - 1.0, u.z + fourth - 1.0);
    }
    if FILTER == FILTER_GAUSSIAN {
        let s = sin_cos_of_turns(u.y);
        beside = 0.5 * sqrt(minus_ln(positive(u.x)) * 2.0) * vec2<f32>(s.y, s.x);
    }
    let film_x = (pixel.x + 0.5 - half_columns() + beside.x) * film_scale();
    let film_y = (half_rows() - 0.5 - pixel.y - beside.y) * film_scale();
    var way = way_mm() + way_x_mm() * film_x + way_y_mm() * film_y;
    if HAS_LENS {
        way -= lens_x_mm() * on_lens.x + lens_y_mm() * on_lens.y;
    }
    let length_mm = sqrt(dot(way, way));
    let crossing = crossing() + crossing_x() * film_x + crossing_y() * film_y;
    return CameraRay(crossing, way * (1.0 / length_mm), length_mm);
}

// Where a ray passes two places along one axis.
fn between(at: f32, per_step: f32, low: f32, high: f32) -> vec2<f32> {
    let a = (low - at) * per_step;
    let b = (high - at) * per_step;
    return vec2<f32>(min(a, b), max(a, b));
}
