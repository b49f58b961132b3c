//! Built volumes that are kept from run to run: the results are those of a run without a
//! cache, whatever happens to the cache.

use crate::fabrics::cotton;
use crate::program::{bytes, complaint, folder, organza, succeed};
use organza_testing::assert_contains;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime};

const SCENE: &str = r#"
[render]
spp = 2
[camera]
origin_mm = [0.5, 0.5, 5.0]
target_mm = [0.5, 0.5, 0.0]
width_mm = 1.0
resolution = [8, 8]
[[light]]
kind = "environment"
radiance = [1.0, 1.0, 1.0]
[[object]]
kind = "cloth"
fabric = "cloth.toml"
model = "packed"
voxel_um = 40.0
lod = 0
"#;

/// A folder with a scene of a cotton of few fibres.
fn workplace(test: &str) -> PathBuf {
    let folder = folder(test);
    let fabric = cotton("plain", "tex = 20.0\nfibres_per_ply = 20", 40.0);
    std::fs::write(folder.join("cloth.toml"), fabric).unwrap();
    std::fs::write(folder.join("scene.toml"), SCENE).unwrap();
    folder
}

/// The scene without measured packing, which takes most of the time.
fn write_quick_scene(folder: &Path) {
    let scene = SCENE
        .replace("packed", "microflake")
        .replace("40.0", "20.0");
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
}

/// The entries of the cache of a folder.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(files) = std::fs::read_dir(folder.join("cache")) else {
        return Vec::new();
    };
    let paths = files.map(|file| file.unwrap().path());
    let is_entry = |path: &PathBuf| path.file_name().unwrap().len() == 64;
    let mut paths: Vec<PathBuf> = paths.filter(is_entry).collect();
    paths.sort();
    paths
}

/// The picture of the scene with further flags, and what the program printed.
fn rendered(folder: &Path, more: &str) -> (Vec<u8>, String) {
    let render = "render scene.toml -o out.exr";
    let printed = succeed(folder, &format!("{render} {more}"));
    (bytes(folder, "out.exr"), printed)
}

#[test]
fn results_are_the_same_with_a_cache_and_without() {
    let folder = workplace("cache-results");
    let cached = "--cache cache";
    let (plain, _) = rendered(&folder, "");
    assert!(entries(&folder).is_empty(), "off unless asked for");
    let (first, printed) = rendered(&folder, cached);
    assert!(!printed.contains("from the cache"), "{printed}");
    assert_eq!(entries(&folder).len(), 1);
    let (second, printed) = rendered(&folder, cached);
    assert_contains(&printed, "cloth.toml: its volume is from the cache");
    assert!(plain == first && plain == second);
    // Other commands make and take the same volumes. Here without measured packing, which
    // takes most of the time.
    let volume = |name: &str, cache: &str| {
        let voxelize = format!("voxelize cloth.toml -o {name}");
        let printed = succeed(&folder, &format!("{voxelize} {cache}"));
        (bytes(&folder, name), printed.contains("from the cache"))
    };
    let (fresh, _) = volume("a.ovox", "");
    assert_eq!(volume("b.ovox", cached), (fresh.clone(), false));
    assert_eq!(volume("b.ovox", cached), (fresh, true));
    let table = |name: &str, cache: &str| {
        let measure = format!("measure cloth.toml -o {name} --layout grid");
        let small = "--grid 1,2 --spp 16";
        let printed = succeed(&folder, &format!("{measure} {small} {cache}"));
        (bytes(&folder, name), printed.contains("from the cache"))
    };
    let (fresh, _) = table("a.csv", "");
    assert_eq!(table("b.csv", cached), (fresh, true));
    assert_eq!(entries(&folder).len(), 2);
    // The variable does what the flag does, and the flag can turn it off.
    let by_variable = |more: &str| {
        let out = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .env("ORGANZA_CACHE", "cache")
            .args(["voxelize", "cloth.toml", "-o", "c.ovox"])
            .args(more.split_whitespace())
            .output();
        let out = out.unwrap();
        assert!(out.status.success());
        String::from_utf8_lossy(&out.stderr).contains("from the cache")
    };
    assert!(by_variable(""));
    assert!(!by_variable("--cache off"));
}

#[test]
fn whatever_changes_a_volume_has_an_entry_of_its_own() {
    let folder = workplace("cache-keys");
    let mut count = 0;
    let mut volume = |more: &str, is_new: bool| {
        let voxelize = "voxelize cloth.toml --quiet -o";
        let with = |name, cache: &str| {
            succeed(&folder, &format!("{voxelize} {name} {more} {cache}"));
            bytes(&folder, name)
        };
        assert!(
            with("a.ovox", "--cache cache") == with("b.ovox", ""),
            "{more:?}"
        );
        count += usize::from(is_new);
        assert_eq!(entries(&folder).len(), count, "{more:?}");
    };
    volume("", true);
    volume("--threads 1 --max-memory 1GiB", false);
    volume("--voxel-um 50", true);
    volume("--levels 2", true);
    volume("--set seed=5", true);
    volume("--set weft.per_cm=17", true);
    // The content of a file counts, not its name.
    let wif = |first: &str| {
        let text = format!(
            "[WIF]\nVersion=1.1\n[CONTENTS]\nWEAVING=yes\nWARP=yes\nWEFT=yes\nTHREADING=yes\n\
             TIEUP=yes\nTREADLING=yes\n[WEAVING]\nShafts=3\nTreadles=3\n[WARP]\nThreads=3\n\
             [WEFT]\nThreads=3\n[THREADING]\n1=1\n2=2\n3=3\n[TIEUP]\n1={first}\n2=2\n3=3\n\
             [TREADLING]\n1=1\n2=2\n3=3\n"
        );
        std::fs::write(folder.join("draft.wif"), text).unwrap();
    };
    let draft = "--set draft={wif=\"draft.wif\"}";
    wif("1");
    volume(draft, true);
    wif("1,2");
    volume(draft, true);
    std::fs::rename(folder.join("cloth.toml"), folder.join("other.toml")).unwrap();
    succeed(&folder, "voxelize other.toml -o c.ovox --cache cache");
    assert_eq!(entries(&folder).len(), count);
}

#[test]
fn a_damaged_entry_is_built_anew_with_a_warning() {
    let folder = workplace("cache-damage");
    write_quick_scene(&folder);
    let cached = "--cache cache";
    let (plain, _) = rendered(&folder, cached);
    let [entry] = &entries(&folder)[..] else {
        panic!("one entry");
    };
    let whole = std::fs::read(entry).unwrap();
    let middle = whole.len() / 2;
    let mut altered = whole.clone();
    altered[middle] ^= 1;
    // A volume of another key, whole in itself: the twin that a checksum alone would pass.
    succeed(&folder, "voxelize cloth.toml -o a.ovox --cache cache");
    let other = entries(&folder).into_iter().find(|path| path != entry);
    let other = std::fs::read(other.unwrap()).unwrap();
    for (wrong, why) in [
        (altered, "does not match its checksum"),
        (whole[..middle].to_vec(), "does not match its checksum"),
        (Vec::new(), "is cut short"),
        (other, "belongs to another key"),
    ] {
        std::fs::write(entry, wrong).unwrap();
        let (picture, printed) = rendered(&folder, cached);
        assert!(picture == plain, "{why}");
        let warning = format!("{why}; the volume is built anew");
        assert_contains(&printed, &warning);
        assert!(std::fs::read(entry).unwrap() == whole, "{why}");
    }
}

/// A run in the background that writes a picture of its own name.
fn start(folder: &Path, name: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(folder)
        .args(["render", "scene.toml", "--quiet", "--cache", "cache", "-o"])
        .arg(name)
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap()
}

#[test]
fn runs_at_once_and_killed_ones_leave_a_cache_that_works() {
    let folder = workplace("cache-crowd");
    write_quick_scene(&folder);
    let (plain, _) = rendered(&folder, "");
    let took = {
        let started = std::time::Instant::now();
        rendered(&folder, "");
        started.elapsed()
    };
    // Each round begins without an entry; two runs are killed, at a time that moves through
    // the run, and two come to their ends.
    for round in 1..=organza_testing::sized(4, 60) {
        for entry in entries(&folder) {
            std::fs::remove_file(entry).unwrap();
        }
        let mut killed = [start(&folder, "k0.exr"), start(&folder, "k1.exr")];
        let kept = ["e0.exr", "e1.exr"].map(|name| (name, start(&folder, name)));
        let share = f64::from(round % 12) / 3.0;
        std::thread::sleep(Duration::from_secs_f64(share * took.as_secs_f64()));
        for child in &mut killed {
            let _ = child.kill();
            child.wait().unwrap();
        }
        for (name, mut child) in kept {
            assert!(child.wait().unwrap().success());
            assert!(bytes(&folder, name) == plain, "round {round}");
        }
        let (picture, printed) = rendered(&folder, "--cache cache");
        assert_contains(&printed, "from the cache");
        assert!(picture == plain, "round {round}");
    }
    // The next look removes what the killed runs left.
    succeed(&folder, "cache --cache cache");
    let mut left = organza_testing::file_names(&folder.join("cache"));
    left.retain(|name| name.len() != 64);
    assert_eq!(left, ["CACHEDIR.TAG", "lock"]);
}

#[test]
fn the_command_lists_entries_and_removes_them() {
    let folder = workplace("cache-command");
    let at = "--cache cache";
    let cache = |more: &str| succeed(&folder, &format!("cache {more} {at}"));
    let listed = cache("");
    assert!(listed.contains("no entries, 0 B of at most 10.0 GiB"));
    assert!(!folder.join("cache").exists(), "looking makes nothing");
    for voxel_um in ["40", "50", "60"] {
        let voxelize = "voxelize cloth.toml -o a.ovox --voxel-um";
        succeed(&folder, &format!("{voxelize} {voxel_um} {at}"));
    }
    let listed = cache("");
    assert_contains(&listed, "3 entries");
    assert_contains(&listed, "volume  cloth.toml (50.000 um, ");
    let json: serde_json::Value = serde_json::from_str(&cache("--json")).unwrap();
    let about = &json["entries"][0]["about"];
    assert_eq!(about["kind"], "volume");
    assert!(about["program"].as_str().unwrap().contains("sources "));
    let bytes: u64 = entries(&folder)
        .iter()
        .map(|e| e.metadata().unwrap().len())
        .sum();
    assert_eq!(json["bytes"], bytes);
    let old = std::fs::File::options()
        .append(true)
        .open(&entries(&folder)[0]);
    let month_ago = SystemTime::now() - Duration::from_secs(31 * 24 * 3600);
    old.unwrap().set_modified(month_ago).unwrap();
    assert!(cache("").contains("used 31 d ago"));
    let removed = cache("clean --older-than 30d");
    assert_contains(&removed, "removed 1 entry of");
    assert_contains(&removed, "; 2 entries of");
    let removed = cache("clean --all");
    assert_contains(&removed, "; no entries of 0 B left");
    // A limit that holds nothing: the result is there all the same.
    let limited = Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(&folder)
        .env("ORGANZA_CACHE", "cache")
        .env("ORGANZA_CACHE_LIMIT", "100")
        .args(["voxelize", "cloth.toml", "-o", "a.ovox"])
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&limited.stderr);
    assert!(limited.status.success(), "{printed}");
    assert_contains(&printed, "whose limit of 100 bytes is too small");
    assert!(entries(&folder).is_empty());
}

#[test]
fn a_cache_that_cannot_be_is_refused() {
    let folder = workplace("cache-refused");
    let voxelize = "voxelize cloth.toml -o a.ovox --cache";
    let words = complaint(&folder, &format!("{voxelize} cloth.toml"));
    assert_contains(&words, "--cache: cloth.toml: ");
    let said = complaint(&folder, "cache --cache off");
    assert_contains(&said, "\"off\" names no cache");
    assert!(!organza(&folder, "cache clean").status.success());
    assert!(!folder.join("a.ovox").exists());
}
