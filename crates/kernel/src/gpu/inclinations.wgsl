// The inclination of light with that of the way at an event: see `organza_scatter::InclinationPair`.
struct Inclinations {
    sum: vec2<f32>,
    folded: vec2<f32>,
    mean_cos: f32,
}

fn inclinations(sin_in: f32, cos_in: f32) -> Inclinations {
    let cosines = event.cos_out * cos_in;
    let sines = event.sin_out * sin_in;
    let oi = event.sin_out * cos_in;
    let io = event.cos_out * sin_in;
    let cos_difference = cosines + sines;
    let sin_difference = abs(oi - io);
    let root = sqrt(fma(0.5, abs(cos_difference), 0.5));
    let mean_cos = select(root, 0.5 * sin_difference / root, cos_difference < 0.0);
    let sum = vec2<f32>(oi + io, cosines - sines);
    return Inclinations(sum, vec2<f32>(sin_difference, -cos_difference), mean_cos);
}
