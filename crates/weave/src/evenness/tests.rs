//! Unevenness against its spectrum, and twist and slubs along it.

use super::*;
use organza_testing::{assert_contains, sized, table_rows};

fn yarn(keys: &str) -> Yarn {
    Yarn::new("cotton", &toml::from_str(keys).unwrap()).unwrap()
}

/// A yarn whose mass varies.
fn uneven(mass_cv_percent: f64, fibre_length_mm: f64) -> Yarn {
    let mass = format!("mass_cv_percent = {mass_cv_percent}");
    yarn(&format!(
        "evenness = {{ {mass}, fibre_length_mm = {fibre_length_mm} }}"
    ))
}

/// Threads over which moments are taken.
fn threads() -> u64 {
    sized(700, 4000)
}

/// Mean, variance, and covariances at distances, over many threads of a yarn.
fn moments<const N: usize>(
    yarn: &Yarn,
    length_mm: f64,
    apart_mm: [f64; N],
) -> (f64, f64, [f64; N]) {
    let (mut sum, mut square, mut there) = (0.0, 0.0, [[0.0; 2]; N]);
    for thread in 0..threads() {
        let mut rng = PathRng::new(11, thread, 0);
        let mean = thread_mass(yarn, length_mm, &mut rng);
        let profile = Profile::new(yarn, length_mm, &mut rng).unwrap();
        // Both variations are small, so they add up.
        let mass = |from_mm: f64| mean + profile.mass(0.3 + from_mm / length_mm) - 1.0;
        let a = mass(0.0);
        sum += a;
        square += a * a;
        for ([sum, product], mm) in there.iter_mut().zip(apart_mm) {
            let b = mass(mm);
            *sum += b;
            *product += a * b;
        }
    }
    let n = threads() as f64;
    let mean = sum / n;
    // Each place has its own mean: the error of a mean is larger than that of a covariance.
    let covariances = there.map(|[sum, product]| product / n - mean * sum / n);
    (mean, square / n - mean * mean, covariances)
}

/// The variance over all threads is what was asked for, and the correlation falls as that of
/// fibres of the given length, on tiles that are shorter and longer than a fibre.
#[test]
fn mass_varies_as_that_of_random_fibres() {
    for (fibre_mm, length_mm, apart_mm) in [(28.0, 4.0, [2.0, 1.0]), (3.0, 40.0, [2.0, 6.0])] {
        mass_varies(fibre_mm, length_mm, apart_mm);
    }
}

fn mass_varies(fibre_mm: f64, length_mm: f64, apart_mm: [f64; 2]) {
    let cv: f64 = 0.08;
    let of_fibres = |fibre_mm: f64| moments(&uneven(100.0 * cv, fibre_mm), length_mm, apart_mm);
    let (mean, variance, covariances) = of_fibres(fibre_mm);
    let wrapped = |x: f64| {
        let copies = (-50..=50).map(|n| x + f64::from(n) * length_mm);
        copies
            .map(|x| (1.0 - x.abs() / fibre_mm).max(0.0))
            .sum::<f64>()
    };
    let expected = apart_mm.map(|mm| cv * cv * wrapped(mm) / wrapped(0.0));
    // Four standard errors of a variance over the threads, and what clamped
    // deviates and cut waves take away.
    let n = threads() as f64;
    let error = cv * cv * (4.0 * (2.0 / n).sqrt() + 0.05);
    assert!((mean - 1.0).abs() < 4.0 * cv / n.sqrt(), "mean {mean}");
    assert!(
        (variance - cv * cv).abs() < error,
        "{fibre_mm} {length_mm}: {variance}"
    );
    let is_near = |found: f64, expected: f64| (found - expected).abs() < error;
    let mut found = covariances.iter().zip(expected);
    assert!(
        found.all(|(&c, e)| is_near(c, e)),
        "{fibre_mm} {length_mm} at {apart_mm:?}: {covariances:?} for {expected:?}; seed 11"
    );
    // The twin: fibres of another length.
    if fibre_mm < length_mm {
        let (_, _, twin) = of_fibres(10.0 * fibre_mm);
        assert!(
            twin.iter().zip(expected).all(|(&c, e)| !is_near(c, e)),
            "{twin:?} for {expected:?}"
        );
    }
}

/// Mean power of each wave along threads of a length, the variance between threads first,
/// from the profiles.
fn spectrogram(yarn: &Yarn, length_mm: f64, threads: u64) -> Vec<f64> {
    const SAMPLES: usize = 512;
    const WAVES: usize = 60;
    let mut power = vec![0.0; WAVES + 1];
    for thread in 0..threads {
        let mut rng = PathRng::new(23, thread, 0);
        let mean = thread_mass(yarn, length_mm, &mut rng);
        let profile = Profile::new(yarn, length_mm, &mut rng).unwrap();
        power[0] += (mean - 1.0).powi(2);
        let at = |i: usize| profile.mass(i as f64 / SAMPLES as f64);
        let mass: Vec<f64> = (0..SAMPLES).map(at).collect();
        for (k, power) in power.iter_mut().enumerate().skip(1) {
            let turn = |i: usize| TAU * ((k * i) % SAMPLES) as f64 / SAMPLES as f64;
            let [a, b] = mass.iter().enumerate().fold([0.0; 2], |[a, b], (i, m)| {
                let (sin, cos) = turn(i).sin_cos();
                [a + m * cos, b + m * sin]
            });
            *power += 2.0 * (a * a + b * b) / (SAMPLES * SAMPLES) as f64;
        }
    }
    power.iter_mut().for_each(|p| *p /= threads as f64);
    power
}

/// The spectrogram of a long yarn has its hill at 2.75 lengths of the fibres, with the share
/// of the variance that was asked for; without drafting waves it falls from the longest wave.
#[test]
fn drafting_waves_are_a_hill_of_the_spectrogram() {
    let (cv, length_mm, threads): (f64, f64, u64) = (0.1, 1500.0, 300);
    let even = "evenness = { mass_cv_percent = 10, fibre_length_mm = 28 }";
    let waved = yarn(&format!(
        "{even}\ndrafting_waves = {{ share = 0.5, spread = 0.15 }}"
    ));
    let drafting = waved.drafting_waves.unwrap();
    let wave_mm = drafting.length_mm.unwrap();
    assert_eq!(wave_mm, 77.0);
    let [with, without] = [waved, yarn(even)].map(|yarn| spectrogram(&yarn, length_mm, threads));
    // Where the power of five neighbouring waves, smoothed, is largest beyond the longest.
    let peak_mm = |power: &[f64]| {
        let smooth = |k: usize| power[k - 2..=k + 2].iter().sum::<f64>();
        let highest = (5..58).max_by(|&a, &b| smooth(a).total_cmp(&smooth(b)));
        length_mm / highest.unwrap() as f64
    };
    // Waves of 300 threads have 600 parts each: a power has the standard error of 6 %, a sum
    // of five one of 3 %, and the hill falls by 3 % within 0.25 deviations: 4 %; smoothing
    // and the slope of the random spectrum below it shift it by as much.
    let found_mm = peak_mm(&with);
    assert!(
        (found_mm / wave_mm - 1.0).abs() < 0.08,
        "{found_mm} mm; seed 23"
    );
    let twin_mm = peak_mm(&without);
    assert!((twin_mm / wave_mm - 1.0).abs() > 0.5, "{twin_mm} mm");
    // Within two deviations of the wave number lies 95 % of the share, and of the random
    // part what the twin has there.
    let periods = length_mm / wave_mm;
    let hill = |power: &[f64]| {
        let near = |k: f64| (k / periods - 1.0).abs() < 2.0 * drafting.spread;
        let of_hill = (1..=60).filter(|&k| near(k as f64));
        of_hill.map(|k| power[k]).sum::<f64>() / (cv * cv)
    };
    let share = (hill(&with) - 0.5 * hill(&without)) / 0.954;
    assert!((share - 0.5).abs() < 0.05, "{share} of the variance");
    assert!(hill(&with) > 2.0 * hill(&without));
    // The variance is what `evenness` says, with and without.
    for power in [&with, &without] {
        let found = (power.iter().sum::<f64>()).sqrt();
        assert!((found / cv - 1.0).abs() < 0.05, "{found} for {cv}");
    }
}

/// In a tile that is shorter than the waves they lie between the threads, whatever their
/// spread.
#[test]
fn drafting_waves_of_short_tiles_lie_between_the_threads() {
    let spec = DraftingWaveSpec {
        share: 1.0,
        length_mm: Some(77.0),
        spread: 0.01,
    };
    let shares = drafting_shares(&spec, 5.0, 8);
    assert!((shares[0] - 1.0).abs() < 4.0 * f64::EPSILON, "{shares:?}");
    let shares = drafting_shares(&spec, 154.0, 8);
    assert!((shares[2] - 1.0).abs() < 4.0 * f64::EPSILON, "{shares:?}");
}

#[test]
fn wrong_drafting_waves_name_their_key() {
    let refused = |keys: &str, expected: &str| {
        let error = Yarn::new("x", &toml::from_str(keys).unwrap()).unwrap_err();
        assert_contains(&error.to_string(), expected);
    };
    let needs = "x.drafting_waves: needs evenness";
    refused("drafting_waves = { share = 0.5 }", needs);
    for [waves, expected] in table_rows(
        "share = 1.5 | share: expected a number from 0 to 1, found 1.5
        share = 0.5, length_mm = 0 | length_mm: expected a number from 1
        share = 0.5, spread = 0 | spread: expected a number from 0.01",
    ) {
        let keys = format!("irregularity = 'filament'\ndrafting_waves = {{ {waves} }}");
        refused(&keys, &format!("x.drafting_waves.{expected}"));
    }
}

#[test]
fn twist_closes_and_gathers_in_thin_places() {
    let yarn = uneven(20.0, 3.0);
    let profile = Profile::new(&yarn, 10.0, &mut PathRng::new(3, 0, 0)).unwrap();
    assert!((profile.twisted(1.25) - profile.twisted(0.25) - 1.0).abs() < 4.0 * f64::EPSILON);
    for i in 0..200 {
        let s = f64::from(i) / 200.0;
        let rate = (profile.twisted(s + 1e-4) - profile.twisted(s - 1e-4)) / 2e-4;
        let normalised = rate * profile.mass(s) * profile.mean(|m| 1.0 / m);
        assert!((normalised - 1.0).abs() < 0.02, "{s}: {normalised}");
    }
}

#[test]
fn slubs_have_their_number_and_their_mass() {
    let yarn = yarn("slubs = { per_m = 50, length_mm = [8, 0], mass = [1.5, 0] }");
    let mean = |length_mm: f64| {
        let thread = |i| Profile::new(&yarn, length_mm, &mut PathRng::new(5, i, 0));
        let masses = (0..2000).map(|i| thread(i).map_or(1.0, |p| p.mean(|m| m)));
        masses.sum::<f64>() / 2000.0
    };
    // 50 slubs of 8 mm per metre, half as heavy again in the middle and half of that on
    // average; slubs that touch are cut at no more than the bound.
    let expected = 1.0 + 0.05 * 8.0 * 0.5 * 0.5;
    for length_mm in [10.0, 40.0] {
        let mean = mean(length_mm);
        assert!((mean - expected).abs() < 0.01, "{length_mm}: {mean}");
    }
    let silk = Yarn::new("silk", &Default::default()).unwrap();
    assert!(Profile::new(&silk, 5.0, &mut PathRng::new(1, 0, 0)).is_none());
}
