//! Wrong flags and command lines.

use crate::program::{ended, folder, organza};
use organza_testing::table_rows;

#[test]
fn wrong_command_lines_end_with_two() {
    let folder = folder("wrong-arguments");
    for line in ["rendre", "render", "render x -o y --sspp 3"] {
        assert_eq!(organza(&folder, line).status.code(), Some(2), "{line}");
    }
}

/// A command line, and a part of the message.
const WRONG: &str = "
render scene.toml -o x.exr --clamp -1 | expected a number above 0
render scene.toml -o x.exr --spp -3 | expected a whole number from 1 to
render scene.toml -o x.exr --seed -1 | expected a whole number from 0 to
render scene.toml -o x.exr --seed abc | expected a whole number from 0 to
render scene.toml -o x.exr --crop -1,0,4,4 | expected four whole numbers
render scene.toml -o x.exr --samples -1..4 | expected A..B
render scene.toml -o x.exr --time-limit -5s | expected a time such as
render scene.toml -o x.exr --target-error -1 | 0.05 is 5 %
render scene.toml -o x.exr --target-error 5 | 0.05 is 5 %
voxelize cloth.toml -o x.ovox --voxel-um 60um | a number of micrometres
voxelize cloth.toml -o x.ovox --levels 9 | a whole number from 1 to 8
weave plain -o x.png --cell-px 0 | from 1 to 1024
weave plain --cell-px 8 | --outfile
compare a.toml -o b --limit 15 | 0.05 is 5 %
bench -o b --within 0.1,5 | 0.05 is 5 %
export mitsuba a.toml -o b --repeats -1,2 | from 1 to 4096
";

#[test]
fn wrong_flags_are_reported() {
    let folder = folder("running-flags");
    for wrong in [
        "--samples 4..4",
        "--samples 0..4 --spp 4",
        "--resume",
        "--time-limit soon",
        "--target-error 0",
        "--checkpoint-every 5s",
    ] {
        let out = organza(&folder, &format!("render scene.toml -o x.exr {wrong}"));
        assert_eq!(out.status.code(), Some(2), "{wrong}");
    }
    for [line, words] in table_rows(WRONG) {
        let said = ended(&organza(&folder, line), 2);
        assert!(said.contains(words), "{line}: {said}");
    }
}
