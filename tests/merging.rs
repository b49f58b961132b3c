//! Renders in parts: sample ranges, and merging of the parts.

use crate::cli::write_grid_scene;
use crate::program::{bytes, complaint, exr_channels, folder, picture, sources, succeed};
use organza_testing::assert_contains;

#[test]
fn parts_merge_to_the_unbroken_picture() {
    let folder = folder("merge");
    write_grid_scene(&folder);
    let whole = picture(&folder, "--spp 48");
    let splits: [&[u64]; 4] = [
        &[0, 24, 48],
        &[0, 1, 47, 48],
        &[0, 16, 17, 33, 48],
        &[0, 5, 10, 15, 20, 25, 30, 35, 40, 48],
    ];
    for split in splits {
        let mut names = Vec::new();
        for (i, ends) in split.windows(2).enumerate() {
            let range = format!("{}..{}", ends[0], ends[1]);
            let name = format!("part{i}.exr");
            let threads = if i % 2 == 0 { "1" } else { "2" };
            let arguments = format!("render scene.toml --samples {range} -o {name}");
            succeed(&folder, &format!("{arguments} --threads {threads}"));
            names.push(name);
        }
        for _ in 0..2 {
            succeed(&folder, &format!("merge {} -o all.exr", names.join(" ")));
            assert!(bytes(&folder, "all.exr") == whole, "{split:?}: {names:?}");
            names.reverse();
        }
    }
    // Merged pictures merge again, with a gap in between for a while.
    for (name, range) in [("a.exr", "0..8"), ("b.exr", "8..40"), ("c.exr", "40..48")] {
        succeed(
            &folder,
            &format!("render scene.toml --samples {range} -o {name}"),
        );
    }
    succeed(&folder, "merge c.exr a.exr -o gap.exr");
    succeed(&folder, "merge gap.exr b.exr -o all.exr");
    assert!(bytes(&folder, "all.exr") == whole);
    // The known-bad twin: a part is not the whole.
    assert!(bytes(&folder, "b.exr") != whole);
}

#[test]
fn cropped_parts_merge_too() {
    let folder = folder("merge-crop");
    write_grid_scene(&folder);
    let crop = "--crop 4,2,12,7";
    let whole = picture(&folder, &format!("{crop} --spp 9"));
    for (name, range) in [("a.exr", "0..4"), ("b.exr", "4..9")] {
        let arguments = format!("render scene.toml --samples {range} -o {name}");
        succeed(&folder, &format!("{arguments} {crop}"));
    }
    succeed(&folder, "merge b.exr a.exr -o all.exr");
    assert!(bytes(&folder, "all.exr") == whole);
}

#[test]
fn what_does_not_belong_together_is_not_merged() {
    let folder = folder("merge-refused");
    write_grid_scene(&folder);
    let make = |name: &str, more: &str| {
        let arguments = format!("render scene.toml -o {name}");
        succeed(&folder, &format!("{arguments} {more}"));
    };
    make("a.exr", "--samples 0..4");
    let refuse = |name: &str| complaint(&folder, &format!("merge a.exr {name} -o all.exr"));
    make("b.exr", "--samples 3..6");
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: cannot join a.exr: samples 3..4 twice"
    );
    make("b.exr", "--samples 4..6 --seed 7");
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: cannot join a.exr: seed is 7, but 0 in a.exr"
    );
    make("b.exr", "--samples 4..6 --crop 0,0,8,8");
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: cannot join a.exr: crop is 0,0,8,8, but 0,0,16,8 in a.exr"
    );
    let cannot = "organza: b.exr: cannot join a.exr: ";
    make("b.exr", "--samples 4..6 --set camera.width_mm=1.5");
    assert_eq!(refuse("b.exr"), format!("{cannot}the scenes differ"));
    // The same scene file with other bytes behind a name in it.
    let grid = bytes(&folder, "sigma_t.vol");
    let mut denser = grid.clone();
    denser[48..52].copy_from_slice(&6.0f32.to_le_bytes());
    std::fs::write(folder.join("sigma_t.vol"), denser).unwrap();
    make("b.exr", "--samples 4..6");
    let changed = format!("{cannot}the contents of sigma_t.vol differ");
    assert_eq!(refuse("b.exr"), changed);
    std::fs::write(folder.join("sigma_t.vol"), grid).unwrap();
    // The same scene by other code.
    let part = bytes(&folder, "a.exr");
    let (own, other) = (sources(), "0".repeat(32));
    let at = part.windows(32).position(|w| w == own.as_bytes()).unwrap();
    let foreign = [&part[..at], other.as_bytes(), &part[at + 32..]].concat();
    std::fs::write(folder.join("b.exr"), foreign).unwrap();
    let refused = refuse("b.exr");
    assert_contains(
        &refused,
        &format!("{cannot}code is 0.1.0 (sources {other})"),
    );
    // What only says how much to take and how to show it may differ.
    make("b.exr", "--samples 4..6 --set render.exposure=1");
    succeed(&folder, "merge a.exr b.exr -o all.exr");
    // Files that are no pictures of ours.
    std::fs::write(folder.join("b.exr"), b"not a picture").unwrap();
    assert!(refuse("b.exr").starts_with("organza: b.exr: cannot be read as EXR"));
    let part = bytes(&folder, "a.exr");
    std::fs::write(folder.join("b.exr"), &part[..part.len() - 40]).unwrap();
    assert!(refuse("b.exr").starts_with("organza: b.exr: "));
    let foreign = exr::prelude::Image::from_channels(
        (4, 2),
        exr::prelude::SpecificChannels::rgb(|_| (0.5f32, 0.5f32, 0.5f32)),
    );
    exr::prelude::WritableImage::write(&foreign)
        .to_file(folder.join("b.exr"))
        .unwrap();
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: holds no exact sums; expected a picture of `organza render`"
    );
    assert_eq!(refuse("none.exr"), "organza: none.exr: no such file");
    assert_eq!(
        complaint(&folder, "merge a.exr -o all.png"),
        "organza: all.png: expected a name that ends in .exr"
    );
}

#[test]
fn the_channels_hold_what_the_sums_say() {
    let folder = folder("sums");
    write_grid_scene(&folder);
    picture(&folder, "--spp 8");
    let channels = exr_channels(&folder.join("out.exr"));
    // The corner sees past the grid: escaped rays are exactly one.
    let (red, through) = (&channels["R"], &channels["through"]);
    let corner = red.first().unwrap();
    assert_eq!((*corner, through[0]), (1.0, 1.0));
    assert_eq!(channels["variance.R"][0], 0.0);
    assert!(red.iter().any(|&x| x < 0.99), "the grid is seen");
    assert!(channels["tangent.Z"].contains(&1.0));
}

/// The engine is another cause than the scene, and is named as such.
#[test]
fn parts_of_another_engine_are_refused_for_that_reason() {
    let folder = folder("other-engine");
    write_grid_scene(&folder);
    for (name, samples, backend) in [("a.exr", "0..2", "walk"), ("b.exr", "2..4", "scalar")] {
        let run = format!("render scene.toml -o {name} --samples {samples}");
        let state = format!("{backend}.state");
        let more = format!("--backend {backend} --checkpoint {state}");
        succeed(&folder, &format!("{run} {more}"));
    }
    let merged = complaint(&folder, "merge a.exr b.exr -o all.exr");
    assert_eq!(
        merged,
        "organza: b.exr: cannot join a.exr: backend is scalar, but walk in a.exr; render both \
         with one --engine"
    );
    let run = "render scene.toml -o c.exr --resume";
    let resume = |more: &str| complaint(&folder, &format!("{run} {more}"));
    let walked = "--samples 0..2 --checkpoint walk.state";
    assert_eq!(
        resume(&format!("{walked} --backend scalar")),
        "organza: walk.state: is a checkpoint of the general walk; this render is of the kernel; \
         continue with --engine walk"
    );
    let by_kernel = "--samples 2..4 --checkpoint scalar.state";
    assert_eq!(
        resume(&format!("{by_kernel} --set render.clamp=100.0")),
        "organza: scalar.state: is a checkpoint of the kernel; this render is of the general \
         walk, for clamping needs the general walk"
    );
}

/// A scene's name in another script: its parts keep what they are of.
#[test]
fn a_scene_of_any_name_can_be_merged() {
    let folder = folder("other-script");
    write_grid_scene(&folder);
    std::fs::rename(folder.join("scene.toml"), folder.join("шёлк.toml")).unwrap();
    for (name, samples) in [("a.exr", "0..1"), ("b.exr", "1..2")] {
        let run = format!("render шёлк.toml -o {name} --samples {samples}");
        succeed(&folder, &run);
    }
    succeed(&folder, "merge a.exr b.exr -o all.exr");
    assert_contains(&succeed(&folder, "info all.exr"), "шёлк.toml");
}
