//! Textures: the mean over a repeat, its light, and samples.

use super::*;

/// Stripes across the weft: yarn that is bright in red on the left, gaps on the right.
pub fn stripes() -> TextureParts {
    let rings = |counts: [u32; 3]| {
        let degrees = [0.0, 45.0, 90.0].map(f32::to_radians);
        let list: Vec<_> = degrees.into_iter().zip(counts).collect();
        Rings::new(&list).unwrap()
    };
    let (eye, light) = (rings([1, 8, 8]), rings([1, 4, 4]));
    let size = glam::UVec2::new(8, 4);
    let is_left = |texel: usize| texel % 8 < 4;
    let (n, m) = (eye.sphere(), light.sphere());
    let texels = 32;
    TextureParts {
        gaps: (0..texels * eye.hemisphere())
            .map(|at| {
                if is_left(at / eye.hemisphere()) {
                    20
                } else {
                    60
                }
            })
            .collect(),
        images: (0..texels)
            .map(|x| if is_left(x) { 32767 } else { -32767 })
            .collect(),
        scales: vec![0.8; n],
        // More for light from the face than from the back.
        functions: (0..n * m)
            .map(|at| {
                if at % m < m / 2 {
                    [127, 64, 32]
                } else {
                    [32, 32, 16]
                }
            })
            .collect(),
        eye,
        light,
        layout: TextureLayout {
            size,
            origin_mm: Vec2::new(-1.0, 3.0),
            period_mm: Vec2::new(2.0, 0.5),
            heights_mm: [0.1, -0.2],
        },
    }
}

pub fn striped() -> FarTable {
    let texture = Texture::new(&stripes()).unwrap();
    table().with_texture(Some(texture))
}

#[test]
fn a_texture_keeps_the_mean_and_repeats() {
    let (plain, striped) = (table(), striped());
    let mut rng = PathRng::from_seed(61);
    for _ in 0..50 {
        let [a, b] = [direction(&mut rng), direction(&mut rng)];
        let mean = plain.eval(a, b, Footprint::FAR);
        assert_eq!(striped.eval(a, b, Footprint::FAR), mean, "seed 61");
        const READS: usize = 16;
        let (mut sum, mut gap) = (Vec3::ZERO, 0.0);
        for x in 0..READS {
            let place = Vec2::new((x as f32 + 0.5) / READS as f32 * 2.0, 0.3);
            let at = Footprint::point(place);
            sum += striped.eval(a, b, at).0 / READS as f32;
            gap += striped.gap(a, at) / READS as f32;
            let next = Footprint::point(place + Vec2::new(-6.0, 1.0));
            let moved = (striped.eval(a, b, next).0 - striped.eval(a, b, at).0).abs();
            let most = 1e-3 * mean.max_component().max(0.1);
            assert!(moved.max_element() < most, "seed 61");
        }
        let off = (sum - mean.0).abs().max_element() / mean.max_component().max(1e-6);
        assert!(off < 4.0 * f32::EPSILON, "seed 61: {a} {b}: {off}");
        let off = (gap - plain.gap(a, Footprint::FAR)).abs();
        assert!(off < 4.0 * f32::EPSILON, "seed 61: {gap}");
    }
    // It is no copy of the mean: the left is 1.8 times as red, the right a fifth.
    let w = Vec3::Z;
    let at = |x: f32| striped.eval(w, w, Footprint::point(Vec2::new(x, 3.0))).0.x;
    let mean = plain.eval(w, w, Footprint::FAR).0.x;
    assert!((at(-0.5) / mean - 1.8).abs() < 0.01 && (at(0.5) / mean - 0.2).abs() < 0.01);
    // Wide pixels see both.
    let wide = Footprint::new(Vec2::new(-0.5, 3.0), 2.0);
    assert_eq!(striped.eval(w, w, wide).0.x, mean);
    // It does not begin at an edge: a pixel a little narrower sees a little of it.
    let nearly = |share: f32| Footprint {
        width_mm: 2.0 * share,
        ..wide
    };
    let off = |share: f32| (striped.eval(w, w, nearly(share)).0.x / mean - 1.0).abs();
    let (near, far) = (off(0.99), off(0.8));
    assert!(near < 0.06 && far > 3.0 * near, "{near} {far}");
}

/// Dark places whose images would be negative add little light to the mean.
#[test]
fn a_texture_makes_no_light() {
    let steep = TextureParts {
        scales: vec![3.0; stripes().scales.len()],
        ..stripes()
    };
    // Stripes and one bright texel in eight, each as strong as a random number of the nodes.
    let mut rng = PathRng::from_seed(62);
    let pairs = steep.functions.len();
    let mixed = TextureParts {
        images: (0..32)
            .flat_map(|x| [steep.images[x], if x % 8 == 5 { 28671 } else { -4095 }])
            .collect(),
        scales: vec![3.0; 2 * steep.scales.len()],
        functions: (0..2 * pairs)
            .map(|_| [(rng.unit() * 127.0) as i8; 3])
            .collect(),
        ..steep.clone()
    };
    // The mean and the largest of what is left of the light that they would make.
    for (parts, mean_error, largest) in [(steep, 0.01, 0.03), (mixed, 0.02, 0.15)] {
        let texture = Texture::new(&parts).unwrap();
        let twin = texture.clone().undivided();
        let (mut made, mut without) = ([0.0f32; 2], 0.0);
        const PAIRS: u16 = 200;
        for _ in 0..PAIRS {
            let [a, b] = [direction(&mut rng), direction(&mut rng)];
            let mean = |texture: &Texture| {
                let place = |k: u16| Vec2::new(f32::from(k % 64), f32::from(k / 64) + 0.5) / 32.0;
                let ratios = (0..1024).map(|k| texture.ratio(a, b, Footprint::point(place(k))).0);
                ratios.map(|r| r.x).sum::<f32>() / 1024.0 - 1.0
            };
            let off = mean(&texture);
            made = [made[0] + off / f32::from(PAIRS), made[1].max(off.abs())];
            without += mean(&twin) / f32::from(PAIRS);
        }
        let [mean, most] = made;
        let is_kept = mean.abs() < mean_error && most < largest;
        assert!(is_kept, "seed 62: {mean}, {most}");
        let least = 5.0 * mean_error;
        assert!(without > least, "seed 62: the twin makes {without}");
    }
}

#[test]
fn samples_of_a_texture_bring_its_light() {
    let striped = striped();
    let mut rng = PathRng::from_seed(71);
    for x in [-0.5, 0.0, 0.5] {
        let at = Footprint::point(Vec2::new(x, 3.1));
        for _ in 0..4 {
            let w = direction(&mut rng);
            let mut drawn = organza_basis::Moments::default();
            let mut even = organza_basis::Moments::default();
            for _ in 0..20_000 {
                let sample = striped.sample(w, at, &mut rng);
                let met = 1.0 - striped.gap(w, at);
                drawn.add(sample.map_or(0.0, |s| f64::from(s.weight.0.x * met)));
                let w_in = direction(&mut rng);
                let value = striped.eval(w, w_in, at).0.x * w_in.z.abs();
                even.add(f64::from(value / warp::UNIFORM_SPHERE_PDF));
            }
            let error = drawn.standard_error().hypot(even.standard_error());
            let z = (drawn.mean - even.mean) / error;
            let (mean, expected) = (drawn.mean, even.mean);
            assert!(z.abs() < 4.5, "seed 71: {w} at {x}: {mean} for {expected}");
            // Samples without the texture would not.
            let twin = drawn.mean / f64::from(striped.ratio(w, w, at).0.x.max(0.05));
            let z = (twin - even.mean) / error;
            assert!(x == 0.0 || z.abs() > 4.5, "seed 71: the twin passes at {x}");
        }
    }
}
