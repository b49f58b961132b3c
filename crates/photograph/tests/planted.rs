//! Planted cloth: the grid and the repeat of drawn pictures are found again.

use glam::DVec2;
use organza_photograph::{
    FINE_PX, Fold, Likeness, Photograph, PhotographError, Repeat, Shading, ThreadGrid, Vignetting,
    name_of, repeats, straightened,
};
use organza_weave::Draft;

const SIDE: usize = 288;

/// A number from 0 to 1 that the place decides.
fn noise(seed: u64, i: usize) -> f64 {
    let mut z =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (i as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z ^= z >> 31;
    z = z.wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 29;
    (z >> 11) as f64 / (1u64 << 53) as f64
}

/// A drawn cloth: round threads of one colour that dive at the ends of floats, turned by an
/// angle, under light that fades to one side, with noise.
fn drawn(name: &str, spacing_px: [f64; 2], turn_deg: f64, seed: u64) -> Photograph {
    let rows = drawn_rows(SIDE, (name, spacing_px, turn_deg), seed, |place| place);
    Photograph::new(SIDE, SIDE, &rows).unwrap()
}

/// The same with threads as fine as a camera far away sees them, on cloth with wrinkles of some pixels:
/// nine points of the drawing make a pixel.
fn seen_from_afar(
    (name, spacing_px, turn_deg): (&str, [f64; 2], f64),
    seed: u64,
    wrinkle_px: f64,
) -> Photograph {
    const FINE: usize = 3;
    let side = FAR_SIDE * FINE;
    let moved = |place: DVec2| {
        // Whole waves, which leave the mean spacing as it is.
        let wave = DVec2::new(place.y, place.x + place.y) * (std::f64::consts::TAU / side as f64);
        place + FINE as f64 * wrinkle_px * DVec2::new(wave.x.sin(), wave.y.sin())
    };
    let spacing_px = spacing_px.map(|s| s * FINE as f64);
    let fine = drawn_rows(side, (name, spacing_px, turn_deg), seed, moved);
    let rows: Vec<[f32; 3]> = (0..FAR_SIDE * FAR_SIDE)
        .map(|i| {
            let (x, y) = (i % FAR_SIDE * FINE, i / FAR_SIDE * FINE);
            let part = |k: usize| fine[(y + k / FINE) * side + x + k % FINE][0];
            [(0..FINE * FINE).map(part).sum::<f32>() / (FINE * FINE) as f32; 3]
        })
        .collect();
    Photograph::new(FAR_SIDE, FAR_SIDE, &rows).unwrap()
}

const FAR_SIDE: usize = 384;

fn drawn_rows(
    side: usize,
    (name, spacing_px, turn_deg): (&str, [f64; 2], f64),
    seed: u64,
    moved: impl Fn(DVec2) -> DVec2,
) -> Vec<[f32; 3]> {
    let draft = Draft::named(name).unwrap();
    let (sin, cos) = turn_deg.to_radians().sin_cos();
    let thread = |n: i64, m: usize| n.rem_euclid(m as i64) as usize;
    let mut rows = Vec::new();
    for i in 0..side * side {
        let DVec2 { x, y } = moved(DVec2::new((i % side) as f64, (side - 1 - i / side) as f64));
        let at = DVec2::new(x * cos + y * sin + 3.3, y * cos - x * sin + 1.7)
            / DVec2::from_array(spacing_px);
        let (e, p) = ((at.x + 0.5).floor(), (at.y + 0.5).floor());
        let (u, v) = (at.x - e, at.y - p);
        let up = |de: i64, dp: i64| {
            draft.warp_up(
                thread(e as i64 + de, draft.ends()),
                thread(p as i64 + dp, draft.picks()),
            )
        };
        // Across the thread, along it, and whether the float goes on at the nearer end.
        let (across, along, goes_on) = if up(0, 0) {
            (u, v, up(0, if v > 0.0 { 1 } else { -1 }))
        } else {
            (v, u, !up(if u > 0.0 { 1 } else { -1 }, 0))
        };
        let round = (1.0 - (across / 0.52).powi(2)).max(0.02).sqrt();
        let dive = if goes_on {
            1.0
        } else {
            1.0 - 0.8 * along * along
        };
        let light = 0.4 * (1.0 + 0.4 * x / side as f64);
        let value = light * round * dive * (0.85 + 0.3 * noise(seed, i));
        rows.push([value as f32; 3]);
    }
    rows
}

/// Threads of 2.5 to 4 pixels on wrinkled cloth: spacing within 1 %, the repeat that of the draft; and
/// straightened, the fold keeps most of the contrast, which the wrinkles take from it.
#[test]
fn fine_threads_are_found_by_the_waves_of_their_weave() {
    let cases = [
        ("twill-3-1-z", [3.6, 2.5], 1.0),
        ("twill-2-1-s", [3.1, 3.9], -2.0),
        ("twill-2-2-z", [2.7, 3.3], 0.0),
        ("satin-5-2", [2.6, 3.2], 2.0),
    ];
    for (seed, (name, spacing, turn)) in cases.into_iter().enumerate() {
        let case = format!("{name}, {spacing:?} px, {turn} degrees, seed {seed}");
        let photograph = seen_from_afar((name, spacing, turn), seed as u64, 1.0);
        let straight =
            straightened(&[&photograph], FINE_PX).unwrap_or_else(|e| panic!("{case}: {e}"));
        let straight = straight.unwrap_or_else(|| panic!("{case}: threads seen one by one"));
        let lattice = straight.lattice;
        for (f, planted) in lattice.frequency.into_iter().zip(spacing) {
            let found = 1.0 / f.length();
            assert!((found / planted - 1.0).abs() < 0.01, "{case}: {lattice:?}");
        }
        let draft = Draft::named(name).unwrap();
        assert_eq!(lattice.repeat, Repeat::of_draft(&draft), "{case}");
        let contrast = |photograph: &Photograph, grid: &ThreadGrid| {
            let known = (&Shading::default(), Some(Vignetting::default()));
            let fold = Fold::new(photograph, grid, lattice.repeat, known);
            let mean = fold.mean_colour[0];
            let squares = fold.mean.iter().map(|t| (t[0] - mean).powi(2));
            squares.sum::<f64>() / fold.mean.len() as f64
        };
        let kept = contrast(&straight.photographs[0], &straight.grid);
        // The twin: the same grid on cloth with its wrinkles.
        let grid = ThreadGrid {
            frequency: lattice.frequency,
            origin: DVec2::ZERO,
        };
        let wrinkled = contrast(&photograph.evened(24), &grid);
        assert!(kept > 2.0 * wrinkled, "{case}: {kept} {wrinkled}");
    }
    // The twin: noise has no weave.
    let grey: Vec<[f32; 3]> = (0..FAR_SIDE * FAR_SIDE)
        .map(|i| [0.3 + 0.1 * noise(9, i) as f32; 3])
        .collect();
    let grey = Photograph::new(FAR_SIDE, FAR_SIDE, &grey).unwrap();
    let error = straightened(&[&grey], FINE_PX).unwrap_err();
    assert!(
        matches!(error, PhotographError::NoThreads { .. }),
        "{error}"
    );
}

/// Every named kind, straight and turned: spacing within 1 %, angle within half a degree, the draft
/// among those of the repeat.
#[test]
fn planted_cloth_is_found() {
    let cases = [
        ("plain", [12.3, 14.1], 0.0),
        ("plain", [11.0, 11.7], 7.0),
        ("twill-2-1-z", [10.2, 15.1], 0.0),
        ("twill-3-1-s", [9.3, 16.2], -3.0),
        ("satin-5-3", [9.1, 15.3], 2.0),
        ("basket-2-2", [12.2, 12.9], 0.0),
    ];
    for (seed, (name, spacing, turn)) in cases.into_iter().enumerate() {
        let case = format!("{name}, {spacing:?} px, {turn} degrees, seed {seed}");
        let photograph = drawn(name, spacing, turn, seed as u64);
        let grid = ThreadGrid::find(&photograph).unwrap_or_else(|e| panic!("{case}: {e}"));
        let found = grid.spacing_px().into_iter().zip(grid.angles_deg());
        for ((spacing_px, angle_deg), planted) in found.zip(spacing) {
            let error = spacing_px / planted - 1.0;
            assert!(error.abs() < 0.01, "{case}: {:?}", grid.spacing_px());
            let error_deg = angle_deg - turn;
            assert!(error_deg.abs() < 0.5, "{case}: {:?}", grid.angles_deg());
        }
        // No finer weave is seen in it.
        let finer = straightened(&[&photograph], FINE_PX).ok().flatten();
        assert!(finer.is_none(), "{case}: {:?}", finer.map(|f| f.lattice));
        let (repeat, explained) = repeats(&photograph, &grid, 1)[0];
        let drafts = repeat.drafts();
        let names: Vec<String> = drafts.iter().filter_map(name_of).collect();
        assert!(
            names.iter().any(|n| n == name),
            "{case}: {repeat:?}: {names:?}"
        );
        assert!(explained > 0.3, "{case}: {explained}");
        // The draft's own fewest crossings, not a multiple.
        let own = Repeat::of_draft(&Draft::named(name).unwrap());
        assert_eq!(repeat.count(), own.count(), "{case}: {repeat:?}");
    }
}

/// Threads of six pixels leave one pixel to some quarters of a crossing where two and more are due;
/// they are whole crossings all the same.
#[test]
fn crossings_of_few_pixels_repeat() {
    let photograph = drawn("plain", [6.0, 6.9], 0.0, 6);
    let grid = ThreadGrid::find(&photograph).unwrap();
    let list = repeats(&photograph, &grid, 1);
    let (repeat, explained) = list.first().expect("seed 6");
    assert!(*explained > 0.3, "seed 6: {repeat:?} {explained}");
    let own = Repeat::of_draft(&Draft::named("plain").unwrap());
    assert_eq!(repeat.count(), own.count(), "seed 6: {repeat:?}");
}

/// The twin: pictures without threads are refused.
#[test]
fn pictures_without_threads_are_refused() {
    let grey: Vec<[f32; 3]> = (0..SIDE * SIDE)
        .map(|i| [0.3 + 0.1 * noise(9, i) as f32; 3])
        .collect();
    let grey = Photograph::new(SIDE, SIDE, &grey).unwrap();
    let error = ThreadGrid::find(&grey).unwrap_err();
    assert!(
        matches!(error, PhotographError::NoThreads { .. }),
        "{error}"
    );
    // Blurred noise has waves far above its finer ones, and no two systems among its like.
    let mut blurred: Vec<f64> = (0..SIDE * SIDE).map(|i| noise(9, i)).collect();
    for step in [1, SIDE].repeat(8) {
        let n = blurred.len();
        let two = |i: usize| 0.5 * (blurred[i] + blurred[(i + step) % n]);
        blurred = (0..n).map(two).collect();
    }
    let blurred: Vec<[f32; 3]> = blurred.iter().map(|v| [*v as f32; 3]).collect();
    let blurred = Photograph::new(SIDE, SIDE, &blurred).unwrap();
    let error = ThreadGrid::find(&blurred).unwrap_err().to_string();
    assert!(error.contains("as half of those of that length"), "{error}");
    let flat = Photograph::new(SIDE, SIDE, &vec![[0.5; 3]; SIDE * SIDE]).unwrap();
    assert!(ThreadGrid::find(&flat).is_err());
    let small = Photograph::new(32, 32, &[[0.5; 3]; 1024]);
    assert!(matches!(small, Err(PhotographError::TooSmall { .. })));
}

/// A picture that is moved explains itself wherever it begins, and no other does.
#[test]
fn a_picture_is_recognised_wherever_it_begins() {
    let photograph = drawn("twill-3-1-s", [14.0, 13.0], 0.0, 11);
    let grid = ThreadGrid::find(&photograph).unwrap();
    let (repeat, _) = repeats(&photograph, &grid, 1)[0];
    let fold = Fold::new(
        &photograph,
        &grid,
        repeat,
        (&Shading::default(), Some(Vignetting::default())),
    );
    let [w, h] = fold.size();
    let moved: Vec<[f64; 3]> = (0..w * h)
        .map(|t| fold.mean[(t / w + 5) % h * w + (t % w + 3) % w])
        .map(|c| [c[0], 0.0, 0.0])
        .collect();
    let same = Likeness::best(&fold, &moved);
    assert!(same.of_fold > 0.95, "{same:?}");
    // The known-bad twin: a picture of noise.
    let other: Vec<[f64; 3]> = (0..w * h).map(|t| [noise(12, t), 0.0, 0.0]).collect();
    let other = Likeness::best(&fold, &other);
    assert!(other.of_fold < 0.5, "{other:?}");
}
