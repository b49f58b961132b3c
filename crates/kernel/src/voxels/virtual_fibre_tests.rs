//! Virtual fibres in lanes against the scalar lobes.

use super::even_fibres::MAX_EVEN_BLUR_RAD;
use super::event::{Event, Meeting};
use super::fibre_tables::{FibreTables, area_squared, end_on_ratio};
use super::virtual_fibres::VirtualFibres;
use super::voxel_words::{VoxelWords, pack};
use glam::Vec3;
use organza_basis::hypothesis::welch_test;
use organza_basis::{Moments, PathRng, Rgb, warp};
use organza_lanes::math::{LaneRng, V3, pixel_key};
use organza_lanes::{Floats, Ints, one};
use organza_scatter::virtual_fibres::visible_tangent_sample;
use organza_scatter::{Fibre, FibreFrame, Lobe, effective_cross_section};
use organza_testing::{dielectric_fibre, fitted_fibre};

type One = one::F;

fn dielectric(absorption: [f32; 3], longitudinal_deg: f32, azimuthal_deg: f32) -> Fibre {
    let [longitudinal_rad, azimuthal_rad] = [longitudinal_deg, azimuthal_deg].map(f32::to_radians);
    dielectric_fibre(Rgb::from(absorption), longitudinal_rad, azimuthal_rad)
}

/// Clear, dyed, rough, and two that were fitted.
fn fibres() -> Vec<Fibre> {
    vec![
        dielectric([0.0; 3], 6.0, 10.0),
        dielectric([0.02, 0.3, 2.0], 4.0, 15.0),
        dielectric([0.1, 0.1, 0.02], 15.0, 40.0),
        fitted_fibre("gabardine"),
        fitted_fibre("cotton"),
    ]
}

/// The numbers of one path.
fn numbers(seed: u32) -> LaneRng<one::U> {
    let (a, b) = pixel_key(3, u64::from(seed));
    LaneRng::new((one::U::splat(a), one::U::splat(b)), one::U::splat(seed))
}

fn lanes(v: Vec3) -> V3<One> {
    V3::splat(v)
}

fn vector(v: V3<One>) -> Vec3 {
    Vec3::new(v.x.0, v.y.0, v.z.0)
}

/// A population in lanes, its axis as stored, and its spread.
fn population(axis: Vec3, spread_rad: f32) -> (VoxelWords<one::U>, Vec3, f32) {
    let words = pack(1.0, axis, end_on_ratio(spread_rad));
    let voxel = VoxelWords(words.map(<one::U as Ints>::splat));
    let spreads = FibreTables::new(std::iter::empty()).spreads;
    let code = one::U::splat(2) * voxel.end_on_code();
    let spread = Ints::as_floats(code.gather(&spreads)).0;
    (voxel, vector(voxel.axis()).normalize(), spread)
}

fn meet(
    tables: &FibreTables,
    number: u32,
    voxel: VoxelWords<one::U>,
    w_out: Vec3,
    rng: &mut LaneRng<one::U>,
) -> VirtualFibres<One> {
    let met = Meeting {
        voxel,
        place: one::U::splat(0),
        w_out: lanes(w_out),
    };
    VirtualFibres::meet(tables, one::U::splat(number), &met, rng, true)
}

#[test]
fn what_populations_block_is_fitted() {
    for spread in [1e-3f32, 0.02, 0.07, 0.2, 0.45, 0.7, 1.3, 4.0, 100.0] {
        let e = end_on_ratio(spread);
        let broadside = effective_cross_section(1.0, spread);
        for i in 0..=200 {
            let sine = (i as f32 / 200.0).powi(2);
            let parts = [1.0 - sine * sine, sine * sine, e].map(One::splat);
            let got = area_squared(parts[0], parts[1], parts[2]).0.sqrt();
            let exact = effective_cross_section(sine, spread) / broadside;
            let off = (got / exact - 1.0).abs();
            assert!(off < 3e-3, "{spread} {sine}: {got} {exact}");
            assert!(got <= 1.0 + 1e-5, "{spread} {sine}: {got}");
        }
    }
}

/// Weighed tangents against those that are drawn without weights.
#[test]
fn tangents_are_met_as_they_are_seen() {
    let tables = FibreTables::new(fibres().iter());
    let mut scalar = PathRng::from_seed(61);
    let n = 6000;
    for spread in [1e-3f32, 0.1, 0.35, 0.9, 4.0] {
        let (voxel, axis, spread) = population(Vec3::new(0.48, -0.6, 0.64), spread);
        let aside = axis.any_orthonormal_vector();
        for beta in [0.0f32, 0.02, 0.2, 0.8, 1.5, 2.9] {
            let w = axis * beta.cos() + aside * beta.sin();
            let of = |t: Vec3| {
                let (x, y) = (t.dot(w).abs(), t.dot(aside));
                [1.0, x, y * y, axis.dot(t).abs()].map(f64::from)
            };
            let (mut own, mut other) = ([Moments::default(); 4], [Moments::default(); 4]);
            for i in 0..n {
                let mut rng = numbers(i);
                let f = meet(&tables, 0, voxel, w, &mut rng);
                assert!((vector(f.tangent).length() - 1.0).abs() < 8.0 * f32::EPSILON);
                let weight = f64::from(f.weight.0);
                for (m, x) in own.iter_mut().zip(of(vector(f.tangent))) {
                    m.add(weight * x);
                }
                let t = visible_tangent_sample(axis, spread, w, &mut scalar);
                for (m, x) in other.iter_mut().zip(of(t)) {
                    m.add(x);
                }
            }
            for (m, o) in own.iter().zip(&other) {
                let error = m.standard_error().hypot(o.standard_error()) + 1e-3 * o.mean.abs();
                let apart = (m.mean - o.mean).abs();
                assert!(apart < 4.5 * error, "seed 61, {spread} {beta}: {m:?} {o:?}");
            }
            assert!(own[0].variance() < 0.35, "{spread} {beta}: {:?}", own[0]);
        }
    }
}

/// What lights are looked up at, on average over its chances, is the scalar lobe;
/// and light that is drawn is the same on average, over whole directions.
#[test]
fn lanes_scatter_as_the_scalar_lobes_do() {
    let all = fibres();
    let tables = FibreTables::new(all.iter());
    let mut scalar = PathRng::from_seed(62);
    for (number, fibre) in all.iter().enumerate() {
        let (mut whole, mut apart) = (0.0, 0.0f64);
        for turn in 0..40u32 {
            let axis = warp::uniform_sphere(scalar.unit2());
            let w_out = warp::uniform_sphere(scalar.unit2());
            let w_in = warp::uniform_sphere(scalar.unit2());
            let (voxel, _, _) = population(axis, 0.05);
            let mut f = meet(&tables, number as u32, voxel, w_out, &mut numbers(turn));
            // The chances run through a cell grid of 8 x 8 x 8 middles.
            let mut mean = Vec3::ZERO;
            for i in 0..512 {
                let chance = |k: u32| One::splat(((i >> (3 * k) & 7) as f32 + 0.5) / 8.0);
                f.chances = [chance(0), chance(1), chance(2)];
                mean += vector(f.value(&tables, lanes(w_in))) / 512.0;
            }
            let tangent = vector(f.tangent);
            let parts = fibre.far_parts();
            let exact = fibre.far_field(tangent).eval(w_out, w_in).0;
            let exact = exact / parts.scale(FibreFrame::new(tangent, w_out).cos_out);
            // Nodes differ by an eighth of a deviation, whose sixteenth is lost to
            // the cell grid.
            let error = (mean - exact).abs().max_element();
            let most = 0.03 * exact.max_element() + 1e-4;
            assert!(error < most, "seed 62, {number} {turn}: {mean} {exact}");
            whole += f64::from(exact.element_sum());
            apart += f64::from((mean - exact).element_sum());
        }
        let most = 3e-3 * whole;
        assert!(apart.abs() < most, "seed 62, {number}: {apart} of {whole}");
    }
}

/// Moments of what is drawn.
fn drawn_moments(w: Vec3, weight: Vec3, t: Vec3, into: &mut [Moments; 8]) {
    let along = t.dot(w);
    let values = [
        weight.x,
        weight.z,
        weight.y * along,
        weight.y * along * along,
        weight.x * w.x,
        weight.y * w.y,
        weight.z * w.z * w.z,
        weight.x * (1.0 - along * along).max(0.0).sqrt(),
    ];
    for (m, v) in into.iter_mut().zip(values) {
        m.add(f64::from(v));
    }
}

/// Directions drawn in lanes against those of the scalar sampler, on average over
/// chances; the twin draws from another fibre's tables.
#[test]
fn lanes_draw_what_they_scatter() {
    let all = fibres();
    let tables = FibreTables::new(all.iter());
    let mut scalar = PathRng::from_seed(63);
    let n = 15_000;
    let mut twins = 0;
    for (number, fibre) in all.iter().enumerate() {
        for w_out in [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.96, 0.0, -0.28)] {
            let (voxel, axis, _) = population(Vec3::new(0.8, 0.6, 0.0), 1e-3);
            let drawn = |number: usize| {
                let mut moments = [Moments::default(); 8];
                for i in 0..n {
                    let mut rng = numbers(i);
                    let mut f = meet(&tables, number as u32, voxel, w_out, &mut rng);
                    f.weight = One::splat(1.0);
                    let turn = f.sample(&tables, &mut rng, true);
                    let (w, common) = (vector(turn.direction), vector(Event::common(&f)));
                    assert!((w.length() - 1.0).abs() < 4.0 * f32::EPSILON, "{w}");
                    drawn_moments(w, common * vector(turn.weight), axis, &mut moments);
                }
                moments
            };
            let mut other = [Moments::default(); 8];
            let lobe = fibre.far_field(axis);
            for _ in 0..n {
                let Some(s) = lobe.sample(w_out, &mut scalar) else {
                    continue;
                };
                drawn_moments(s.w_in, s.weight.0, axis, &mut other);
            }
            for (m, o) in drawn(number).iter().zip(&other) {
                let p_value = welch_test(m, o).p_value;
                let close = (m.mean - o.mean).abs() < 2e-3 * o.mean.abs().max(0.1);
                assert!(close || p_value > 1e-5, "seed 63, {number}: {m:?} {o:?}");
            }
            let twin = drawn((number + 1) % all.len());
            let pairs = twin.iter().zip(&other);
            let least = pairs.map(|(m, o)| welch_test(m, o).p_value);
            twins += usize::from(least.fold(1.0, f64::min) < 1e-9);
        }
    }
    assert!(twins >= 9, "{twins} of 10 twins rejected");
}

/// What events of the first fibre of some tables send on in green, met from directions as they
/// see a population about an axis.
fn event_weights(
    tables: &FibreTables,
    (voxel, axis): (VoxelWords<one::U>, Vec3),
    seed: u64,
    count: u32,
) -> Moments {
    let mut scalar = PathRng::from_seed(seed);
    let weight = |i| {
        let w_out = loop {
            let w = warp::uniform_sphere(scalar.unit2());
            if scalar.unit() < w.cross(axis).length() {
                break w;
            }
        };
        let mut rng = numbers(i);
        let f = meet(tables, 0, voxel, w_out, &mut rng);
        let turn = f.sample(tables, &mut rng, true);
        f64::from(Event::common(&f).y.0 * turn.weight.y.0)
    };
    (0..count).map(weight).collect()
}

/// What an event among parallel fibres sends on, and how unevenly: the reason for
/// [`MAX_EVEN_BLUR_RAD`].
#[test]
fn weights_of_fibres_that_are_taken_are_even() {
    let (narrow, axis, _) = population(Vec3::Z, 1e-3);
    for (blur_deg, is_taken) in [(6.0f32, true), (20.0, true), (34.0, false)] {
        let tables = FibreTables::new([dielectric([0.0; 3], blur_deg, 2.0 * blur_deg)].iter());
        let weights = event_weights(&tables, (narrow, axis), 65, 20_000);
        let lost = (weights.mean - 1.0).abs();
        // Margin: most of the bound is five standard errors.
        let most = 2e-3 + 5.0 * weights.standard_error();
        assert!(lost < most, "seed 65, {blur_deg}: {weights:?}");
        let is_even = weights.variance() < 0.04;
        assert_eq!(is_even, is_taken, "seed 65, {blur_deg}: {weights:?}");
        assert_eq!(blur_deg.to_radians() <= MAX_EVEN_BLUR_RAD, is_taken);
    }
}

/// What events of white fibres send on, on average: one, to an error that tens of
/// events do not make visible.
#[test]
fn events_of_white_fibres_keep_all_light() {
    for (number, spread) in [(0, 1e-3f32), (1, 0.15), (2, 0.6)] {
        let longitudinal_deg = [6.0, 7.0, 10.0][number];
        let fibre = dielectric([0.0; 3], longitudinal_deg, 10.0);
        let tables = FibreTables::new([&fibre].into_iter());
        let (voxel, axis, _) = population(Vec3::Z, spread);
        let own = event_weights(&tables, (voxel, axis), 66, 400_000);
        let error = own.standard_error();
        // Margin: most of the bound is 4.5 standard errors.
        let is_kept = (own.mean - 1.0).abs() < 4.5 * error + 1e-4;
        assert!(is_kept, "seed 66, {longitudinal_deg} {spread}: {own:?}");
    }
}
