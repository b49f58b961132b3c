//! `organza bake` as its users run it: all files or none, the same on any number of threads,
//! and clear refusals.

use crate::program::{argv, complaint, contents, folder, succeed};
use organza_testing::assert_contains;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A bake that takes a second: sheer silk, few texels and pairs.
const QUICK: &str = "--resolution 32 --texel-spp 8 --pairs 64 --spp 128 --fit-texels 16";

fn fabric(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join("scenes/fabrics").join(name);
    path.display().to_string()
}

#[test]
fn a_bake_writes_the_same_folder_on_any_number_of_threads() {
    let folder = folder("bake");
    let silk = fabric("organza.toml");
    let bake = |out: &str, threads: &str| {
        let mut arguments = vec!["bake", &silk, "-o", out, "--threads", threads];
        arguments.extend(argv(QUICK));
        succeed(&folder, &arguments)
    };
    let printed = bake("one", "1");
    bake("two", "2");
    for words in [
        "reflected by the face: highlight",
        "scattered through",
        "straight through",
        "USD Preview Surface (material.usda) cannot show:",
        "no transmission by scattering",
    ] {
        assert!(printed.contains(words), "{words}: {printed}");
    }
    let files = contents(&folder.join("one"));
    assert!(
        files == contents(&folder.join("two")),
        "threads change the files"
    );
    for name in [
        "bake.json",
        "material.glb",
        "material.mtlx",
        "material.usda",
    ] {
        assert!(files.contains_key(name), "{name} of {:?}", files.keys());
    }
    let json: serde_json::Value = serde_json::from_slice(&files["bake.json"]).unwrap();
    let textures = json["textures"].as_array().unwrap();
    for texture in textures {
        let name = texture["file"].as_str().unwrap();
        let picture = files.get(name).unwrap_or_else(|| panic!("{name}"));
        assert!(picture.starts_with(b"\x89PNG"), "{name}");
    }
    assert_eq!(files.len(), 4 + textures.len());
    // The sheer cloth is open where it is measured open.
    let straight = &json["straight_through"][0];
    let (measured, shown) = (&straight["measured"], &straight["material"]);
    let (measured, shown) = (measured.as_f64().unwrap(), shown.as_f64().unwrap());
    let error = straight["standard_error"].as_f64().unwrap();
    // 32 x 32 texels of 8 paths each, which are drawn evenly.
    let own = (shown * (1.0 - shown) / 8192.0).sqrt();
    let within = 5.0 * error.hypot(own);
    assert!(
        (measured - shown).abs() < within,
        "{measured} {shown} {within}"
    );
    // Errors are listed for each material, and the ones that were not seen are there.
    for material in json["materials"].as_array().unwrap() {
        assert!(!material["errors_held_out"].as_array().unwrap().is_empty());
        assert!(!material["cannot_show"].as_array().unwrap().is_empty());
    }
}

#[test]
fn colourways_share_the_files_and_must_have_the_same_threads() {
    let folder = folder("bake_colourways");
    let organza = fabric("organza.toml");
    let text = std::fs::read_to_string(&organza).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    let named = |name: &str| format!("name = \"{name}\"\n{}", text.replace("name = ", "# "));
    write("ivory.toml", &named("ivory"));
    write("wine.toml", &named("wine"));
    let bake = |second| format!("bake ivory.toml {second} -o out --repeats 2,1 {QUICK}");
    succeed(&folder, &bake("wine.toml"));
    let files = contents(&folder.join("out"));
    let json: serde_json::Value = serde_json::from_slice(&files["bake.json"]).unwrap();
    assert_eq!(json["texels"], serde_json::json!([32, 16]));
    assert_eq!(json["name"], "ivory_45x42_per_cm");
    let other = &json["colourways"][0];
    assert_eq!(other["name"], "wine_45x42_per_cm");
    for report in [&json, other] {
        let textures = report["textures"].as_array().unwrap();
        assert_eq!(textures.len(), 12);
        let name = report["name"].as_str().unwrap();
        for texture in textures {
            let file = texture["file"].as_str().unwrap();
            assert!(file.contains(name) && files.contains_key(file), "{file}");
        }
    }
    std::fs::remove_dir_all(folder.join("out")).unwrap();
    write(
        "finer.toml",
        &named("finer").replace("per_cm = 42", "per_cm = 52"),
    );
    for (twin, words) in [
        ("ivory.toml", "name: is ivory"),
        ("finer.toml", "the same threads"),
    ] {
        assert_contains(&complaint(&folder, &bake(twin)), words);
        assert!(!folder.join("out").exists());
    }
}

#[test]
fn what_cannot_be_baked_is_refused_and_leaves_nothing() {
    let folder = folder("bake_refused");
    let silk = fabric("organza.toml");
    let refused = |more: &[&str]| {
        let mut arguments = vec!["bake", &silk, "-o", "out"];
        arguments.extend(more);
        let words = complaint(&folder, &arguments);
        assert!(!folder.join("out").exists(), "{words}");
        words
    };
    assert!(refused(&["--model", "surface"]).contains("no geometry"));
    let words = refused(&["--resolution", "4096", "--max-memory", "1GiB"]);
    assert!(
        words.contains("--resolution 4096") && words.contains("take fewer"),
        "{words}"
    );
    std::fs::write(folder.join("taken"), "a file").unwrap();
    let said = complaint(&folder, &["bake", &silk, "-o", "taken"]);
    assert_contains(&said, "taken: is a file");
}

#[test]
#[ignore = "takes 8 seconds: .ci/full runs it"]
fn a_killed_bake_leaves_a_whole_folder_or_none() {
    let folder = folder("bake_killed");
    let silk = fabric("organza.toml");
    let mut arguments = vec!["bake", &silk, "-o", "out", "--threads", "1", "--quiet"];
    arguments.extend(argv(QUICK));
    let started = Instant::now();
    succeed(&folder, &arguments);
    let whole_s = started.elapsed().as_secs_f64();
    let whole = contents(&folder.join("out"));
    let kills = organza_testing::sized(3, 40);
    for kill in 0..kills {
        std::fs::remove_dir_all(folder.join("out")).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .args(&arguments)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Spread over the last tenth, in which the files are written.
        let share = 0.9 + 0.15 * f64::from(kill + 1) / f64::from(kills);
        std::thread::sleep(Duration::from_secs_f64(share * whole_s));
        let _ = child.kill();
        child.wait().unwrap();
        if folder.join("out").exists() {
            assert!(
                contents(&folder.join("out")) == whole,
                "kill {kill}: part of a folder"
            );
        }
        // The next run removes what is left, and gives the same.
        succeed(&folder, &arguments);
        assert!(contents(&folder.join("out")) == whole, "kill {kill}");
        assert_eq!(organza_testing::file_names(&folder), ["out"], "kill {kill}");
    }
}
