//! Cloths that come without a scene: drafts, weaves and fabrics in studios, drafts of any size,
//! and the fabrics that are written for drafts.

use crate::program::{complaint, folder, organza, succeed};
use organza_testing::assert_contains;
use std::fmt::Write;
use std::path::Path;

/// A draft of blocks of satin and sateen, without colours and distances.
fn damask(threads: usize) -> String {
    let mut wif = format!(
        "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=16\n[WARP]\nThreads={threads}\n\
         [WEFT]\nThreads={threads}\n[THREADING]\n"
    );
    for e in 0..threads {
        let _ = writeln!(wif, "{}={}", e + 1, e * e / 1600 % 2 * 8 + e % 8 + 1);
    }
    wif += "[LIFTPLAN]\n";
    for p in 0..threads {
        let is_up = |shaft: &usize| {
            let bound = (shaft % 8 * 3) % 8 == p % 8;
            bound == ((shaft / 8 + p * p / 1600) % 2 == 1)
        };
        let up: Vec<String> = (0..16).filter(is_up).map(|s| (s + 1).to_string()).collect();
        let _ = writeln!(wif, "{}={}", p + 1, up.join(","));
    }
    wif
}

const PLAIN: &str = "[WIF]\nVersion=1.1\n[WARP]\nThreads=2\n[WEFT]\nThreads=2\n\
                     [THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n";

/// Cloth of few fibres is made in a moment.
const FEW: &str = "--set yarn.cotton.fibres_per_ply=12";

/// Renders a small picture, which must not be black.
fn render(folder: &Path, what: &str, more: &str) -> String {
    let small = "-o out.png --spp 2 --set camera.resolution=[24,24]";
    let words = succeed(folder, &format!("render {what} {small} {more}"));
    let picture = std::fs::read(folder.join("out.png")).unwrap();
    let (picture, _) = organza_picture::decode(&picture, 1 << 20).unwrap();
    assert_eq!(picture.size.to_array(), [24, 24]);
    let lit = picture.pixels.iter().filter(|p| p.mean() > 0.0).count();
    assert!(
        lit > 24 * 24 / 8,
        "{what} {more:?}: {lit} pixels are not black"
    );
    std::fs::remove_file(folder.join("out.png")).unwrap();
    words
}

#[test]
fn a_draft_a_weave_and_a_fabric_are_rendered_without_a_scene() {
    let folder = folder("studios");
    std::fs::write(folder.join("plain.wif"), PLAIN).unwrap();
    let words = render(&folder, "plain.wif", FEW);
    assert_contains(&words, "exposure      auto");
    for studio in ["swatch", "macro", "window"] {
        let more = format!("{FEW} --studio {studio} --set tile.repeats=[1,1]");
        render(&folder, "satin-5-2", &more);
    }
    succeed(&folder, "weave plain.wif -o made.toml");
    render(&folder, "made.toml", &format!("{FEW} --set warp.per_cm=20"));
    // Nothing but pictures and what was asked for is written.
    let mut names = organza_testing::file_names(&folder);
    names.sort();
    assert_eq!(names, ["made.toml", "plain.wif"]);
}

#[test]
fn a_large_draft_is_listed_and_rendered_at_once() {
    let folder = folder("studio-large");
    std::fs::write(folder.join("large.wif"), damask(880)).unwrap();
    render(&folder, "large.wif", &format!("{FEW} --studio macro"));
    succeed(&folder, "weave large.wif -o large.toml");
    assert_contains(&succeed(&folder, "info large.toml"), "Synthesis\n");
    let refused = complaint(
        &folder,
        "measure large.toml --model fibres --quiet --layout irawan -o x.csv --spp 2",
    );
    assert_contains(&refused, "draft.part = [0, 0, 64, 64]");
}

#[test]
fn a_jam_names_what_fits_and_that_fits() {
    let folder = folder("studio-jam");
    let fabric = |tex: &str| {
        format!(
            "draft = {{ weave = 'plain' }}\nwarp = {{ per_cm = 40 }}\nweft = {{ per_cm = 30 }}\n\
             yarn.cotton = {{ tex = {tex} }}\n"
        )
    };
    std::fs::write(folder.join("jam.toml"), fabric("60")).unwrap();
    let refused = complaint(&folder, "render jam.toml -o x.png");
    let (_, tex) = refused.split_once("what fits: tex ").unwrap();
    let (tex, rest) = tex.split_once(' ').unwrap();
    assert!(rest.contains("--fit-yarn"), "{refused}");
    std::fs::write(folder.join("fine.toml"), fabric(tex)).unwrap();
    succeed(&folder, "info fine.toml");
    let (_, per_cm) = refused.split_once("; or ").unwrap();
    let per_cm: Vec<&str> = per_cm
        .split(' ')
        .filter(|w| w.parse::<f64>().is_ok())
        .collect();
    let (warp, weft) = (
        format!("warp.per_cm={}", per_cm[0]),
        format!("weft.per_cm={}", per_cm[1]),
    );
    succeed(&folder, &format!("info jam.toml --set {warp} --set {weft}"));
    let words = render(&folder, "jam.toml", "--fit-yarn");
    assert_contains(&words, "finer yarns, so that they fit");
}

#[test]
fn colours_are_read_as_weavers_write_them() {
    let folder = folder("studio-colours");
    let fabric = |colours: &str| {
        let text = format!(
            "draft = {{ weave = 'plain' }}\nwarp = {{ per_cm = 25, colours = {colours} }}\n\
             weft = {{ per_cm = 25 }}\nyarn.cotton = {{ tex = 20 }}\n"
        );
        std::fs::write(folder.join("a.toml"), text).unwrap();
    };
    let ends = |colours: &str| {
        fabric(colours);
        let words = succeed(&folder, "weave a.toml --json");
        let listing: serde_json::Value = serde_json::from_str(&words).unwrap();
        listing["draft"]["ends"].as_u64().unwrap()
    };
    assert_eq!(ends("'8 red, 8 #00f, 4 white'"), 20);
    assert_eq!(ends("'B/24 R4 K24 Y/4'"), 24 + 4 + 24 + 4 + 24 + 4);
    assert_eq!(ends("['navy', [0.1, 0.2, 0.3]]"), 2);
    fabric("'8 redd'");
    let refused = complaint(&folder, "info a.toml");
    assert!(
        refused.contains("a.toml:2:33: warp: ") && refused.contains("did you mean \"red\"?"),
        "{refused}"
    );
}

#[test]
fn what_cannot_be_rendered_is_refused_with_the_nearest() {
    let folder = folder("studio-wrong");
    std::fs::write(
        folder.join("bad.wif"),
        "[WIF]\nVersion=1.1\n[WARP]\nThreads=2\n",
    )
    .unwrap();
    std::fs::write(folder.join("notes.txt"), "no cloth\n").unwrap();
    std::fs::write(
        folder.join("scene.toml"),
        "[camera]\norigin_mm = [0, 0, 1]\n",
    )
    .unwrap();
    for (what, more, words) in [
        ("twil-2-2", "", "did you mean \"twill-2-2\"?"),
        ("bad.wif", "", "bad.wif: ["),
        ("none.wif", "", "none.wif: no such file"),
        ("notes.txt", "", "notes.txt: is not TOML"),
        (
            "scene.toml",
            "--studio macro",
            "--studio macro: scene.toml is a scene",
        ),
        ("plain", "--set warp.per_cn=3", "per_cn"),
        ("plain", "--set camera.fow=3", "fow"),
    ] {
        let refused = complaint(&folder, &format!("render {what} -o x.png {more}"));
        assert!(refused.contains(words), "{what}: {refused}");
        assert!(!folder.join("x.png").exists());
    }
}

#[test]
fn a_finished_render_is_developed_again() {
    let folder = folder("studio-develop");
    let small = "camera.resolution=[24,24]";
    succeed(
        &folder,
        &format!("render plain -o a.exr --spp 2 --set {small}"),
    );
    let words = succeed(
        &folder,
        "develop a.exr -o b.png --tone-mapping agx --size-px 12",
    );
    assert_contains(&words, "b.png: 12 x 12, exposure ");
    assert_contains(&succeed(&folder, "info b.png"), "resolution: 12 12");
    let said = complaint(&folder, "develop b.png -o c.png");
    assert_contains(&said, "is a finished picture");
}

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_picture_so_far() {
    use std::io::{BufRead, BufReader};
    let folder = folder("studio-interrupt");
    let endless = "40000000";
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(&folder)
        .args(["render", "plain", "-o", "x.png", "--spp", endless])
        .args(["--set", "camera.resolution=[8,8]"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // The first line of progress shows that paths are being traced.
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    lines
        .find(|l| l.as_ref().unwrap().starts_with("rendering: "))
        .unwrap()
        .unwrap();
    crate::program::signal(&child, "-INT");
    let last = lines.last().unwrap().unwrap();
    assert!(!child.wait().unwrap().success());
    assert_contains(&last, "x.png holds the picture so far");
    assert!(folder.join("x.png").exists());
    let listed = organza(&folder, "info x.png");
    assert!(listed.status.success());
}
