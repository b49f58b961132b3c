//! Printed cloth: which fibres have which colour.

use super::*;
use crate::{PrintImage, PrintMode, PrintSide, PrintSpec};

const RED: Rgb = Rgb::new(0.9, 0.1, 0.1);
const BLUE: Rgb = Rgb::new(0.1, 0.1, 0.9);

/// Red on the left, blue on the right; white above both.
fn image() -> PrintImage {
    PrintImage {
        size: [2, 2],
        pixels: vec![Rgb::WHITE, Rgb::WHITE, RED, BLUE],
    }
}

fn spec() -> PrintSpec {
    parsed("image = 'any.png'\nmode = 'replace'\ncolours = 8")
}

/// The print of that image with other keys.
fn with(change: impl FnOnce(&mut PrintSpec)) -> PrintSpec {
    let mut spec = spec();
    change(&mut spec);
    spec
}

fn pixel(colour: Rgb) -> PrintImage {
    PrintImage {
        size: [1, 1],
        pixels: vec![colour],
    }
}

fn plain() -> Cloth {
    let mut fabric = fabric("plain");
    fabric.tile.repeats = [4, 4];
    build(&fabric)
}

fn printed(spec: &PrintSpec) -> Cloth {
    let mut cloth = plain();
    cloth.print(spec, &image()).unwrap();
    cloth
}

/// Length of fibre by colour and by half of the thickness: red, blue, other; lower, upper.
fn lengths(cloth: &Cloth) -> [[f32; 2]; 3] {
    let tile = cloth.tile();
    let middle = tile.bounds_mm.centre().z;
    let mut sums = [[0.0; 2]; 3];
    for s in segments(cloth) {
        let colour = colour(cloth, &s);
        let is = |c: Rgb| colour.is_some_and(|own| (own.0 - c.0).abs().max_element() < 0.01);
        let at = 0.5 * (s.start_mm + s.end_mm);
        let kind = [is(RED), is(BLUE)].iter().position(|k| *k).unwrap_or(2);
        sums[kind][usize::from(at.z > middle)] += s.length_mm();
        if kind < 2 {
            // Where the image has it: below, red on the left.
            let period = tile.period_mm();
            let place = (at.truncate() - tile.bounds_mm.min.truncate()) / period;
            let share = place - place.floor();
            assert!(share.y < 0.51, "{share}");
            assert!(
                (share.x < 0.51) == is(RED) || (share.x - 0.5).abs() < 0.01,
                "{share}"
            );
        }
    }
    sums
}

#[test]
fn the_face_has_the_colours_of_the_image() {
    let [red, blue, other] = lengths(&printed(&spec()));
    assert!((red[1] / blue[1] - 1.0).abs() < 0.1, "{red:?} {blue:?}");
    // The face dips between threads.
    assert!(red[0] < 0.5 * red[1], "ink stays near the face: {red:?}");
    assert!(other[0] > other[1], "{other:?}");
    // All of it, to any depth, and as much fibre as before.
    let all = lengths(&printed(&with(|deep| deep.depth_um = Some(1e5))));
    let sum = |sums: &[[f32; 2]; 3]| sums.iter().flatten().sum::<f32>();
    assert!((all[0][0] / all[0][1] - 1.0).abs() < 0.2, "{all:?}");
    let before = sum(&lengths(&plain()));
    assert!((sum(&all) / before - 1.0).abs() < 1e-3, "{all:?} {before}");
    // The back instead.
    let back = with(|back| back.side = PrintSide::Back);
    let [red, ..] = lengths(&printed(&back));
    assert!(red[1] < 0.5 * red[0], "{red:?}");
}

/// White paste takes all dye, black none, and grey its share; under the paste's depth dye stays.
#[test]
fn discharge_fades_the_ground_where_the_image_is_bright() {
    let undyed = Rgb::new(0.6, 0.5, 0.4);
    let discharge = |grey: f32, mode| {
        let mut fabric = fabric("plain");
        fabric.warp.colours = vec![BLUE];
        fabric.weft.colours = vec![BLUE];
        let mut cloth = build(&fabric);
        let spec = PrintSpec {
            mode,
            undyed: (mode == PrintMode::Discharge).then_some(undyed),
            ..spec()
        };
        cloth.print(&spec, &pixel(Rgb::splat(grey))).unwrap();
        let all = segments(&cloth);
        let at_z = |s: &Segment| 0.5 * (s.start_mm.z + s.end_mm.z);
        let least = |a: &&Segment, b: &&Segment| at_z(a).total_cmp(&at_z(b));
        let [low, high] = [all.iter().min_by(least), all.iter().max_by(least)];
        [low, high].map(|found| colour(&cloth, found.unwrap()).unwrap())
    };
    let near = |a: Rgb, b: Rgb| (a.0 - b.0).abs().max_element() < 0.01;
    for (grey, left) in [(1.0, 0.0), (0.25, 0.75), (0.0, 1.0)] {
        let [low, high] = discharge(grey, PrintMode::Discharge);
        assert!(near(low, BLUE), "{low:?}");
        assert!(
            near(high, Rgb(undyed.0.lerp(BLUE.0, left))),
            "{grey}: {high:?}"
        );
    }
    // The twin: a dye that is multiplied darkens.
    assert!(!near(
        discharge(0.25, PrintMode::Multiply)[1],
        Rgb(undyed.0.lerp(BLUE.0, 0.75))
    ));
    let misplaced = with(|spec| spec.undyed = Some(undyed));
    let error = plain().print(&misplaced, &image()).unwrap_err().to_string();
    assert!(error.starts_with("print.undyed: "), "{error}");
}

#[test]
fn dye_multiplies_and_cloth_without_print_is_the_same() {
    let cloth = printed(&with(|spec| spec.mode = PrintMode::Multiply));
    let colours: Vec<Rgb> = cloth.materials().iter().filter_map(|m| m.colour).collect();
    let is_darkened = |c: &Rgb| (c.0 - 0.8 * RED.0).abs().max_element() < 0.01;
    assert!(colours.iter().any(is_darkened), "{colours:?}");
    // Ink that reaches nothing leaves every segment as it was.
    let mut sheer = plain();
    let nowhere = PrintSpec {
        depth_um: Some(0.0),
        side: PrintSide::Back,
        ..spec()
    };
    sheer.print(&nowhere, &image()).unwrap();
    assert!(segments_of(&sheer, [0]).len() >= segments_of(&plain(), [0]).len());
}

/// Dye of the whole piece reaches down to its depth from both faces; the core, and threads where
/// others press on them, keep their colour.
#[test]
fn piece_dye_does_not_reach_the_core() {
    let dyed = |depth_um: f64| {
        let spec = PrintSpec {
            image: None,
            colour: Some(RED),
            side: PrintSide::Both,
            depth_um: Some(depth_um),
            ..spec()
        };
        let mut cloth = plain();
        cloth.print(&spec, &pixel(RED)).unwrap();
        cloth
    };
    // Length of fibre that is dyed and all of it, in three layers of the same height.
    let layers = |cloth: &Cloth| {
        let bounds = cloth.tile().bounds_mm;
        let mut sums = [[0.0f32; 2]; 3];
        for s in segments(cloth) {
            let z = 0.5 * (s.start_mm.z + s.end_mm.z);
            let layer = (3.0 * (z - bounds.min.z) / bounds.size().z) as usize;
            let sums = &mut sums[layer.min(2)];
            let is_dyed = colour(cloth, &s) == Some(RED);
            sums[0] += if is_dyed { s.length_mm() } else { 0.0 };
            sums[1] += s.length_mm();
        }
        sums.map(|[dyed, all]| dyed / all)
    };
    let [low, core, high] = layers(&dyed(60.0));
    assert!(low > 0.7 && high > 0.7, "{low} {core} {high}");
    assert!(core < 0.8 * low.min(high), "{low} {core} {high}");
    // The twin: deeper dye leaves nothing.
    assert!(layers(&dyed(1e5)).iter().all(|share| *share > 0.99));
    let refused = |colour, size_mm| {
        let spec = PrintSpec {
            image: None,
            colour: Some(colour),
            size_mm,
            ..spec()
        };
        let refused = plain().print(&spec, &pixel(RED));
        refused.unwrap_err().to_string()
    };
    let said = refused(Rgb::new(0.0, 1.5, 0.0), None);
    let expected = "print.colour: expected numbers from 0 to 1, found 1.5";
    assert_eq!(said, expected);
    let said = refused(RED, Some([1.0, 1.0]));
    assert_eq!(said, "print.size_mm: only applies to an image");
}

#[test]
fn images_must_fit_the_tile() {
    let period = plain().tile().period_mm();
    let sized =
        |width: f32, height: f32| with(|spec| spec.size_mm = Some([width, height].map(f64::from)));
    let tried = |spec: &PrintSpec, image: &PrintImage| plain().print(spec, image);
    // Twice across, three times up, stretched by less than a hundredth.
    let fits = sized(period.x / 2.0 * 1.005, period.y / 3.0);
    tried(&fits, &image()).unwrap();
    let refused = |spec: PrintSpec, image: PrintImage, words: &str| {
        let said = tried(&spec, &image).unwrap_err().to_string();
        assert!(said.starts_with(words), "{said}");
    };
    for (spec, words) in [
        (sized(period.x / 2.5, period.y), "size_mm: expected a width"),
        (sized(period.x, f32::NAN), "size_mm: expected a height"),
        (sized(period.x, 0.0), "size_mm: expected a height"),
        (
            with(|s| s.colours = 1),
            "colours: expected 2 to 256, found 1",
        ),
        (
            with(|s| s.depth_um = Some(-1.0)),
            "depth_um: expected a number from 0 to 1e6, found -1",
        ),
    ] {
        refused(spec, image(), &format!("print.{words}"));
    }
    let flat = PrintImage {
        size: [0, 3],
        pixels: Vec::new(),
    };
    let words = "print.image: expected 1 to 8192 pixels along an edge, found 0 x 3";
    refused(spec(), flat, words);
}
