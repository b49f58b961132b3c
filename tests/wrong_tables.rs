//! Wrong values of `[nonwoven]`, `[pile]`, nets and prints: every number that is none, too
//! large, too small or of another kind is refused by its key, and so are tables that together
//! would take minutes or gigabytes.

use crate::program::{complaint, folder, succeed};
use organza_testing::{assert_contains, file_names, table_rows};
use std::path::Path;

/// A fabric, a `--set` that makes its tile small, and keys of numbers.
const NUMBERS: &str = "
nonwoven/wool_felt | nonwoven.tile_mm=[1, 1] | nonwoven.areal_density_g_per_m2 nonwoven.thickness_mm
nonwoven/wool_felt | nonwoven.tile_mm=[1, 1] | nonwoven.length_mm nonwoven.anisotropy nonwoven.curl_mm
nonwoven/wool_felt | nonwoven.tile_mm=[1, 1] | nonwoven.out_of_plane_deg nonwoven.crimp_percent
nonwoven/wool_felt | nonwoven.tile_mm=[1, 1] | nonwoven.crimps_per_cm
nonwoven/needle_felt | nonwoven.tile_mm=[1, 1] | nonwoven.needling.punches_per_cm2
nonwoven/needle_felt | nonwoven.tile_mm=[1, 1] | nonwoven.needling.fibres_per_punch
nonwoven/needle_felt | nonwoven.tile_mm=[1, 1] | nonwoven.needling.tuft_mm nonwoven.needling.depth_mm
nonwoven/spunbond | nonwoven.tile_mm=[1, 1] | nonwoven.bonding.points_per_cm2
nonwoven/spunbond | nonwoven.tile_mm=[1, 1] | nonwoven.bonding.area_percent
nonwoven/spunbond | nonwoven.tile_mm=[1, 1] | nonwoven.bonding.thickness_mm
pile/velvet | tile.repeats=[1, 1] | pile.height_mm pile.height_cv_percent pile.tufts_per_cm2 pile.splay
pile/velvet | tile.repeats=[1, 1] | pile.lean_deg pile.lean_direction_deg pile.lean_deviation_deg
pile/velvet | tile.repeats=[1, 1] | pile.ruffle_deg pile.ruffle_mm
pile/velvet | tile.repeats=[1, 1] | pile.wave pile.turn_deg pile.wales_per_cm pile.wale_width
lace/tulle | tile.repeats=[1, 1] | warp.per_cm weft.per_cm
print/roses | tile.repeats=[1, 1] | print.depth_um
";

/// A fabric, what is set, and a part of the message.
const TABLES: &str = r#"
lace/tulle | warp.per_cm=0.01 | tile.repeats: the threads of
lace/leno | warp.per_cm=0.01 ; weft.per_cm=0.01 | tile.repeats: the threads of
lace/tulle | tile.repeats=[4294967295, 4294967295] | tile.repeats: 4294967295 ends x
nonwoven/wool_felt | yarn.merino.fibre_radius_um=0.5 | nonwoven.tile_mm: the fibres of 6 x 6 mm are
pile/velvet | tile.repeats=[4294967295, 4294967295] | tile.repeats: 8589934590 ends x
pile/velvet | pile.every=[1024, 1024] | tile.repeats: 12288 ends x 8192 picks
nonwoven/wool_felt | nonwoven.tile_mm=[0, 5] | nonwoven.tile_mm[0]: expected a number from 0.5 to 200 mm, found 0
nonwoven/wool_felt | nonwoven.tile_mm=[5, nan] | nonwoven.tile_mm[1]: expected a number from 0.5 to 200 mm, found NaN
nonwoven/wool_felt | nonwoven.colours=[[nan, 0, 0]] | nonwoven.colours[0]: expected linear RGB from 0 to 1
nonwoven/wool_felt | nonwoven.colours=[] | found an empty list
pile/velvet | pile.colours=[] | found an empty list
pile/terry | pile.every=[0, 3] | pile.every: expected two numbers from 1 to 1024, found [0, 3]
pile/terry | pile.every=[1.5, 3] | expected a whole number from 0 to 4294967295, found 1.5
lace/leno | tile.repeats=[0, 1] | tile.repeats: expected two whole numbers from 1, found [0, 1]
print/roses | print.size_mm=[-1, 1] | print.size_mm: expected a width from 0.001 to 1e6 mm
nonwoven/wool_felt | nonwoven.fibre='meirno' | did you mean "merino"?
nonwoven/wool_felt | nonwoven.thicknes_mm=1 | did you mean `thickness_mm`?
nonwoven/wool_felt | nonwovn={} | did you mean `nonwoven`?
nonwoven/wool_felt | yarn.merino.finish='mercerized' | did you mean "mercerised"?
nonwoven/needle_felt | nonwoven.needling.sides='bth' | did you mean `both`?
pile/velvet | pile.kind='cutt' | did you mean `cut`?
pile/velvet | pile.yarn='viscos' | did you mean "viscose"?
pile/velvet | pile.heigth_mm=1 | did you mean `height_mm`?
lace/tulle | draft.openwork='bobinet' | did you mean "bobbinet"?
print/roses | print.side='fase' | did you mean `face`?
print/roses | print.image='.' | print.image: .: is a folder
nonwoven/wool_felt | weft.per_cm=3 | weft: a nonwoven has no threads
nonwoven/wool_felt | tile.repeats=[2, 2] | tile.repeats: nonwoven.tile_mm gives the size of the tile
pile/velvet | pile.wale_width=0.5 | pile.wale_width: belongs to pile of kind "wale"
lace/tulle | warp.wander={amplitude_um=30, length_mm=2} | warp.wander: belongs to a weave
lace/leno | warp.reed_dents={ends=2, gap_percent=10} | warp.reed_dents: belongs to a weave
lace/tulle | warp.per_cm=10000 | the fabric is jammed
"#;

/// A command that would write the fibres of a fabric.
fn weave(name: &str, set: &[&str]) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fabrics");
    let path = root.join(name).with_extension("toml");
    let words = ["weave", path.to_str().unwrap(), "-o", "x.obj", "--quiet"];
    let set = set.iter().flat_map(|s| ["--set", s]);
    words.into_iter().chain(set).map(String::from).collect()
}

fn refused(at: &Path, name: &str, set: &[&str]) -> String {
    let words = weave(name, set);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let message = complaint(at, &words);
    let place = format!("{}.toml", name.split('/').next_back().unwrap());
    let is_placed = message.contains(&place) || message.contains("--set");
    assert!(is_placed && message.len() < 600, "{message}");
    message
}

#[test]
fn numbers_out_of_range_are_refused_by_their_keys() {
    let at = folder("wrong-numbers");
    for [name, small, keys] in table_rows(NUMBERS) {
        for key in keys.split(' ') {
            for value in ["nan", "-1e30", "1e30", "'1 mm'"] {
                let set = format!("{key}={value}");
                let message = refused(&at, name, &[small, &set]);
                assert!(message.contains(key), "{set}: {message}");
                let explains = message.contains("expected") && message.contains("found");
                assert!(explains, "{set}: {message}");
            }
        }
    }
    assert!(file_names(&at).is_empty(), "something was written");
}

#[test]
fn tables_that_make_no_sense_are_refused() {
    let at = folder("wrong-tables");
    for [name, set, expected] in table_rows(TABLES) {
        let set: Vec<&str> = set.split(" ; ").collect();
        let message = refused(&at, name, &set);
        assert!(message.contains(expected), "{set:?}: {message}");
    }
    // More tufts than there is fibre.
    let needling = [
        "punches_per_cm2=2000",
        "fibres_per_punch=200",
        "depth_mm=10",
    ];
    let needling = needling.map(|set| format!("nonwoven.needling.{set}"));
    let message = refused(
        &at,
        "nonwoven/needle_felt",
        &needling.each_ref().map(|s| &**s),
    );
    assert_contains(
        &message,
        "nonwoven.needling.punches_per_cm2: 2000 punches per cm2 of 200 fibres, 22.4 mm each, \
         need 2240.0 m of fibre in a tile that has",
    );
    assert!(file_names(&at).is_empty(), "something was written");
    // The known-bad twin: a fabric as it is shipped is not refused.
    let words = weave("nonwoven/spunbond", &["nonwoven.tile_mm=[1, 1]"]);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    succeed(&at, &words);
    assert_eq!(file_names(&at), ["x.obj"]);
}
