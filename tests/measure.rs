//! `organza measure`: the slab against another renderer, through the program;
//! a fabric as volume and as surface; wrong pairs files.

use crate::fabrics::cotton;
use crate::program::{complaint, folder, succeed};
use crate::slab::write_slab;
use organza_measure::parse_pairs;
use organza_scatter::{Footprint, Surface};
use organza_surface::SurfaceSpec;
use organza_testing::{assert_contains, csv_numbers, table_rows};
use std::path::Path;

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

/// A table in parts, or by another number of threads, is the whole table, byte for byte.
#[test]
fn rows_measured_apart_make_the_whole_table() {
    let folder = folder("measure-rows");
    write_slab(&folder);
    let table = include_str!("data/slab_mitsuba.csv");
    std::fs::write(folder.join("pairs.csv"), table).unwrap();
    let run = "measure slab.toml --pairs pairs.csv --spp 64";
    // Sixteen pairs have nine incident directions.
    for (more, parts) in [
        ("", ["0..1", "1..9", "9..16"]),
        ("--albedo", ["0..1", "1..4", "4..9"]),
    ] {
        let measure = |rows: &str| {
            succeed(&folder, &format!("{run} {more} {rows} -o out.csv"));
            read(&folder, "out.csv")
        };
        let whole = measure("--threads 1");
        assert_eq!(measure("--threads 2"), whole, "{more:?}");
        let mut joined = String::new();
        for rows in parts {
            let part = measure(&format!("--rows {rows}"));
            let (head, list) = part.split_once('\n').unwrap();
            if joined.is_empty() {
                joined = format!("{head}\n");
            }
            joined += list;
        }
        assert_eq!(joined, whole, "{more:?}");
    }
    let refuse = |more: &str| complaint(&folder, &format!("measure slab.toml --spp 2 {more}"));
    assert_eq!(
        refuse("--pairs pairs.csv --rows 8..17 -o no.csv"),
        "organza: --rows 8..17: the table has 16 rows; expected rows within 0..16"
    );
    assert_eq!(
        refuse("--layout klems --rows 0..1 -o no.csv"),
        "organza: --rows 0..1: this layout is measured all at once; take irawan, grid or --pairs"
    );
    assert_eq!(
        refuse("--layout grid --rows 0..1 -o no.exr"),
        "organza: --rows 0..1: pictures of the tile are measured all at once"
    );
    assert!(!folder.join("no.csv").exists() && !folder.join("no.exr").exists());
}

fn fabric() -> String {
    let yarn = "tex = 20.0\nfibres_per_ply = 40\nfibre_radius_um = 8.0";
    cotton("twill-2-1-s", yarn, 25.0)
}

#[test]
fn a_fabric_is_measured_as_volume_and_as_surface() {
    let folder = folder("measure-fabric");
    let surface = "[surface]\npreset = \"cotton-twill\"\n";
    std::fs::write(folder.join("cloth.toml"), fabric() + surface).unwrap();
    std::fs::write(folder.join("bare.toml"), fabric()).unwrap();
    let pairs = "theta_i,phi_i,theta_o,phi_o\n30,0,40,170\n10,80,0,0\n20,0,150,0\n";
    std::fs::write(folder.join("pairs.csv"), pairs).unwrap();
    let measure = "measure cloth.toml --pairs pairs.csv -o out.csv --model surface";
    succeed(&folder, measure);
    // Draft and spacing are the fabric's own: 2 over, 1 under, 0.5 by 1/1.8 mm,
    // and warp of the same yarn as the weft but denser shows at full pitch.
    let mut spec = SurfaceSpec::preset("cotton-twill").unwrap();
    let weave = spec.weave.as_mut().unwrap();
    let draft = organza_weave::Draft::named("twill-2-1-s").unwrap();
    weave.draft = draft.drawdown().lines().map(str::to_owned).collect();
    (weave.warp_pitch_mm, weave.weft_pitch_mm) = (0.5, 1.0 / 1.8);
    let printed = succeed(&folder, "info cloth.toml --json");
    let printed: serde_json::Value = serde_json::from_str(&printed).unwrap();
    let width = printed["figures"]["weft"]["width_mm"].as_f64().unwrap();
    (weave.warp_width_mm, weave.weft_width_mm) = (None, Some(width));
    let model = spec.build().unwrap();
    for (row, pair) in csv_numbers(&read(&folder, "out.csv"))
        .iter()
        .zip(parse_pairs(pairs).unwrap())
    {
        let (w_in, w_out) = (pair.incident.direction(), pair.exitant.direction());
        let own = model.eval(w_out, w_in, Footprint::FAR).0.to_array();
        for c in 0..3 {
            let expected = f64::from(own[c]);
            assert!(
                (row[4 + c] - expected).abs() <= 4.0 * f64::from(f32::EPSILON) * expected,
                "{row:?}"
            );
        }
        assert_eq!(row[7..], [0.0; 3]);
    }

    let arguments = "measure bare.toml --pairs pairs.csv --albedo --spp 4000 -o albedo.csv --json";
    assert_contains(&succeed(&folder, &arguments), "\"cover_factor\"");
    let table = csv_numbers(&read(&folder, "albedo.csv"));
    assert_eq!(table.len(), 3);
    for row in &table {
        for c in 0..3 {
            let sum: f64 = (0..4).map(|part| row[2 + 6 * part + c]).sum();
            let errors: f64 = (0..4).map(|part| row[5 + 6 * part + c]).sum();
            assert!((sum - 1.0).abs() < 4.0 * errors, "{row:?}");
        }
        assert!(
            row[2] > 0.05 && row[2 + 18] > 0.01,
            "cloth reflects and absorbs: {row:?}"
        );
    }
    let said = complaint(&folder, &format!("{arguments} --model surface"));
    assert_contains(&said, "bare.toml: has no [surface] section");
}

#[test]
fn pairs_without_light_are_no_exact_zeros() {
    let folder = folder("measure-dark");
    let optics = "[optics.cotton]\nalbedo = [0.0, 0.0, 0.0]\n";
    std::fs::write(folder.join("black.toml"), fabric() + optics).unwrap();
    let pairs = "theta_i,phi_i,theta_o,phi_o\n30,0,40,170\n10,80,0,0\n";
    std::fs::write(folder.join("pairs.csv"), pairs).unwrap();
    let arguments = "measure black.toml --pairs pairs.csv --spp 4 -o out.csv";
    assert_contains(&succeed(&folder, &arguments), "2 of 2 pairs met no light");
    assert_eq!(succeed(&folder, &format!("{arguments} --quiet")), "");
}

#[test]
fn wrong_pairs_are_reported_with_line_and_column() {
    let folder = folder("measure-wrong");
    write_slab(&folder);
    let say = |text: &str| {
        std::fs::write(folder.join("pairs.csv"), text).unwrap();
        complaint(&folder, "measure slab.toml --pairs pairs.csv -o out.csv")
    };
    let head = "theta_i,phi_i,theta_o,phi_o\n";
    let words = say(&format!("{head}10,0,nan,0\n"));
    assert_contains(&words, "pairs.csv:2:6: theta_o:");
    let words = say(&format!("{head}10,0,20,0\n190,0,20,0\n"));
    assert!(words.contains("pairs.csv:3:1: theta_i: expected an angle from 0 to 180"));
    let words = say("theta_i,phi_i,theta_o,fi_o\n");
    assert_contains(&words, "pairs.csv:1:23: the header has no column `phi_o`");
    for arguments in [
        "measure slab.toml --pairs pairs.csv",
        "measure slab.toml -o out.csv",
        "measure slab.toml --layout irawan -o nowhere/out.csv",
        "measure slab.toml --layout irawan -o out.csv --model surface",
    ] {
        let out = crate::program::organza(&folder, arguments);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
    }
    assert!(!folder.join("out.csv").exists(), "nothing is written");
}

/// Flags, and a part of the message.
const UNFIT: &str = "
--layout rgl -o x.csv | --layout rgl needs a table that ends in .bsdf
--layout ptm -o x.exr | --layout ptm needs a table that ends in .ptm
--layout grid -o x.ptm | that ends in .ptm needs --layout ptm
--layout grid -o x.bsdf | that ends in .bsdf needs --layout rgl
--layout tensor-tree -o x.csv | needs a table that ends in .xml
--layout rgl --albedo -o x.bsdf | --albedo goes with pairs
--layout rgl --rows 0..1 -o x.bsdf | measured all at once
";

/// Flags, and a part of the message.
const TOO_LARGE: &str = "
--layout tensor-tree --tree-depth 7 -o x.xml | expected at most 6 for --tree-rank 4
--layout tensor-tree --tree-depth 6 --max-memory 1GiB -o x.xml | --tree-depth: the table needs
--layout rgl --rgl-grid 90,360,256 --max-memory 1GiB -o x.bsdf | --rgl-grid: the table needs
";

/// Tables for other programs: any number of threads gives the same bytes, and flags that do not
/// fit are refused before anything is measured.
#[test]
fn tables_for_other_programs_are_written_or_refused() {
    let folder = folder("measure-tables");
    std::fs::write(
        folder.join("cotton.toml"),
        cotton("plain", "tex = 30.0", 40.0),
    )
    .unwrap();
    let run = "measure cotton.toml --spp 64 --tree-depth 2 --rgl-grid 2,3,4";
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    for layout in ["tensor-tree -o one.xml", "rgl -o one.bsdf"] {
        let one = format!("{run} --layout {layout}");
        succeed(&folder, &format!("{one} --threads 1"));
        succeed(
            &folder,
            &format!("{} --threads 2", one.replace("one", "two")),
        );
    }
    assert_eq!(bytes("one.xml"), bytes("two.xml"));
    assert_eq!(bytes("one.bsdf"), bytes("two.bsdf"));
    assert!(bytes("one.bsdf").starts_with(b"tensor_file\0"));
    for (name, threads) in [("one.ptm", "1"), ("two.ptm", "2")] {
        let ptm = "measure cotton.toml --layout ptm --spp 4 --texels 6 --ptm-lamps 12";
        succeed(&folder, &format!("{ptm} -o {name} --threads {threads}"));
    }
    assert_eq!(bytes("one.ptm"), bytes("two.ptm"));
    assert!(bytes("one.ptm").starts_with(b"PTM_1.2\nPTM_FORMAT_RGB\n5\n6\n"));
    for [more, words] in table_rows(UNFIT) {
        let printed = complaint(&folder, &format!("{run} {more}"));
        assert!(printed.contains(words), "{more}: {printed}");
    }
    for [more, words] in table_rows(TOO_LARGE) {
        let printed = complaint(&folder, &format!("measure cotton.toml {more}"));
        assert!(printed.contains(words), "{more}: {printed}");
    }
    let left = std::fs::read_dir(&folder).unwrap().count();
    assert_eq!(left, 7, "a refused table left a file");
}
