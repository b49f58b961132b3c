//! Wrong flags and command lines.

use crate::program::{folder, organza};

#[test]
fn wrong_command_lines_end_with_two() {
    let folder = folder("wrong-arguments");
    for arguments in [
        &["rendre"][..],
        &["render"],
        &["render", "x", "-o", "y", "--sspp", "3"],
    ] {
        assert_eq!(
            organza(&folder, arguments).status.code(),
            Some(2),
            "{arguments:?}"
        );
    }
}

#[test]
fn wrong_flags_are_reported() {
    let folder = folder("running-flags");
    for wrong in [
        &["--samples", "4..4"][..],
        &["--samples", "0..4", "--spp", "4"],
        &["--resume"],
        &["--time-limit", "soon"],
        &["--target-error", "0"],
        &["--checkpoint-every", "5s"],
    ] {
        let arguments = ["render", "scene.toml", "-o", "x.exr"];
        let out = organza(&folder, &[&arguments[..], wrong].concat());
        assert_eq!(out.status.code(), Some(2), "{wrong:?}");
    }
    let render = &["render", "scene.toml", "-o", "x.exr"][..];
    let voxelize = &["voxelize", "cloth.toml", "-o", "x.ovox"][..];
    for (command, flag, value, words) in [
        (render, "--clamp", "-1", "expected a number above 0"),
        (render, "--spp", "-3", "expected a whole number from 1 to"),
        (render, "--seed", "-1", "expected a whole number from 0 to"),
        (render, "--seed", "abc", "expected a whole number from 0 to"),
        (render, "--crop", "-1,0,4,4", "expected four whole numbers"),
        (render, "--samples", "-1..4", "expected A..B"),
        (render, "--time-limit", "-5s", "expected a time such as"),
        (render, "--target-error", "-1", "0.05 is 5 %"),
        (render, "--target-error", "5", "0.05 is 5 %"),
        (voxelize, "--voxel-um", "60um", "a number of micrometres"),
        (voxelize, "--levels", "9", "a whole number from 1 to 8"),
        (
            &["weave", "plain", "-o", "x.png"],
            "--cell-px",
            "0",
            "from 1 to 1024",
        ),
        (&["weave", "plain"], "--cell-px", "8", "--outfile"),
        (
            &["compare", "a.toml", "-o", "b"],
            "--limit",
            "15",
            "0.05 is 5 %",
        ),
        (&["bench", "-o", "b"], "--within", "0.1,5", "0.05 is 5 %"),
        (
            &["export", "mitsuba", "a.toml", "-o", "b"],
            "--repeats",
            "-1,2",
            "from 1 to 4096",
        ),
    ] {
        let out = organza(&folder, &[command, &[flag, value]].concat());
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{flag} {value}: {said}");
        assert!(said.contains(words), "{flag} {value}: {said}");
    }
}
