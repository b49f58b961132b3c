//! Faults of the machine and dangerous paths: a full disk, a folder that takes no files,
//! too little memory, special files in the place of inputs and outputs, names in a scene
//! that lead elsewhere.
#![allow(clippy::print_stdout)] // prints the messages of the runs

use crate::cli::write_grid_scene;
use crate::fabrics::{COTTON_SATIN, SHEET, few_fibres};
use crate::program::{argv, complaint, ended, files_left, folder, organza, succeed};
use organza_testing::assert_contains;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a shell where `disk` is a file system of its own, mounted by
/// `mount` in a name space that `unshare` makes (Linux allows that to every user where
/// user name spaces are enabled). Where that is not allowed, `otherwise` prepares a folder
/// `disk` in which writing fails as well.
fn with_disk(folder: &Path, mount: &str, otherwise: &str, arguments: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_organza");
    let script = |before: &str| {
        format!("{{ {before}; }} >/dev/null 2>&1 || exit 99; '{program}' {arguments}")
    };
    let run = |command: &mut Command| command.current_dir(folder).output();
    let mounted = run(Command::new("unshare").args(["-rm", "sh", "-c", &script(mount)]));
    if let Ok(out) = mounted
        && out.status.code() != Some(99)
        && !out.stderr.starts_with(b"unshare:")
    {
        return out;
    }
    let out = run(Command::new("sh").args(["-c", &script(otherwise)])).unwrap();
    assert_ne!(out.status.code(), Some(99), "{otherwise}");
    out
}

/// A picture is whole whatever becomes of the checkpoint: here the shell limits
/// the length of files to more than the one and less than the other.
#[cfg(target_os = "linux")]
#[test]
fn a_checkpoint_that_cannot_be_saved_costs_no_picture() {
    let folder = folder("no-checkpoint");
    write_grid_scene(&folder);
    let program = env!("CARGO_BIN_EXE_organza");
    let script = format!(
        "trap '' XFSZ; ulimit -f 16; \
         exec '{program}' render scene.toml -o out.png --spp 4 --checkpoint state --quiet"
    );
    let out = Command::new("sh")
        .args(["-c", &script])
        .current_dir(&folder)
        .output()
        .unwrap();
    let message = ended(&out, 1);
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(
        message.contains("the picture out.png with 4 of 4 samples is written")
            && message.contains("cannot write state: ")
            && message.contains("File too large"),
        "{message}"
    );
    let whole = std::fs::read(folder.join("out.png")).unwrap();
    assert!(!folder.join("state").exists());
    // Known bad: without the limit both are there, and the picture is the same.
    let both = "render scene.toml -o b.png --spp 4";
    succeed(&folder, &format!("{both} --checkpoint state"));
    assert_eq!(std::fs::read(folder.join("b.png")).unwrap(), whole);
    assert!(std::fs::metadata(folder.join("state")).unwrap().len() > 16 * 1024);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_and_leaves_nothing() {
    let folder = folder("full-disk");
    write_grid_scene(&folder);
    std::fs::write(folder.join("cloth.toml"), few_fibres(40.0) + SHEET).unwrap();
    std::fs::create_dir(folder.join("disk")).unwrap();
    let mount = "mount -t tmpfs -o size=16k none disk";
    let limit = "rm -rf disk; mkdir disk; trap '' XFSZ; ulimit -f 32";
    let reasons = ["No space left on device", "File too large"];
    for arguments in [
        "render scene.toml -o disk/out.exr --set camera.resolution=[64,64]",
        "render scene.toml -o disk/out.png --set camera.resolution=[512,512] --spp 1",
        "voxelize cloth.toml -o disk/cloth.ovox --voxel-um 20",
        "voxelize cloth.toml -o disk/cloth.vdb --voxel-um 20",
        "voxelize cloth.toml -o disk/cloth.vol --voxel-um 20",
        "voxelize cloth.toml -o disk/cloth.nrrd --voxel-um 20",
        "voxelize cloth.toml -o disk/cloth.nrrd --voxel-um 20 --raw",
        "measure cloth.toml --layout grid --grid 6,24 --spp 2 --model surface -o disk/out.csv",
        "measure cloth.toml --layout grid --grid 6,24 --spp 2 --model surface -o disk/out.json",
        "measure cloth.toml --layout tensor-tree --spp 2 --model surface -o disk/out.xml",
        "measure cloth.toml --layout rgl --spp 2 --model surface -o disk/out.bsdf",
        "export mitsuba scene.toml -o disk/scene --set object.0.extinction=big.vol",
    ] {
        let big = [0.5; 8 * 8 * 80];
        let bounds = [-0.2, -0.2, -0.2, 0.2, 0.2, 0.2];
        crate::program::write_vol(&folder.join("big.vol"), [8, 8, 80], 1, bounds, &big);
        // Run by the shell, for the disk is seen from there alone.
        let listing = format!("{arguments} --quiet; code=$?; ls -A disk disk/scene; exit $code");
        let out = with_disk(&folder, mount, limit, &listing);
        let said = String::from_utf8_lossy(&out.stderr);
        let said = said.lines().next().unwrap_or_default();
        assert_eq!(out.status.code(), Some(1), "{arguments}: {said}");
        assert!(
            said.starts_with("organza: cannot write disk/")
                && reasons.iter().any(|why| said.contains(why)),
            "{arguments}: {said}"
        );
        let left = String::from_utf8_lossy(&out.stdout);
        for name in [
            ".tmp", ".exr", ".png", ".ovox", ".vdb", ".vol", ".nrrd", ".csv", ".json", ".xml",
            ".bsdf",
        ] {
            assert!(!left.contains(name), "{arguments}: left {left}");
        }
        println!("{arguments}\n    {said}");
    }
    let kept = "render scene.toml -o out.png --set camera.resolution=[64,64] \
                --checkpoint disk/state --quiet";
    let out = with_disk(&folder, mount, limit, kept);
    let message = ended(&out, 1);
    assert_contains(&message, "cannot write disk/state");
    assert!(folder.join("out.png").exists(), "the picture is kept");
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files_is_reported_before_the_work_begins() {
    let folder = folder("read-only");
    write_grid_scene(&folder);
    std::fs::write(folder.join("cloth.toml"), COTTON_SATIN).unwrap();
    std::fs::create_dir(folder.join("disk")).unwrap();
    let mount = "mount -t tmpfs -o ro none disk";
    let closed = "rm -rf disk; ln -s /sys disk";
    let reasons = ["Read-only file system", "Permission denied"];
    for arguments in [
        "render scene.toml -o disk/out.exr --spp 4000000000",
        "render scene.toml -o out.exr --checkpoint disk/state --spp 4000000000",
        "voxelize cloth.toml -o disk/cloth.ovox",
        "measure cloth.toml --layout klems --spp 4000000000 -o disk/out.xml",
        "measure cloth.toml --layout rgl --spp 4000000000 -o disk/out.bsdf",
        "fit surface cloth.toml --spp 4000000000 -o disk/fitted.toml",
        "compare cloth.toml --spp 4000000000 -o disk",
        "export mitsuba scene.toml -o disk",
        "merge scene.toml scene.toml -o disk/all.exr",
        "weave plain -o disk/plain.png",
        "man -o disk",
    ] {
        let out = with_disk(&folder, mount, closed, &format!("{arguments} </dev/null"));
        let said = ended(&out, 2);
        assert_eq!(said.lines().count(), 1, "{arguments}: {said}");
        assert!(
            reasons
                .iter()
                .any(|why| said.contains(&format!("cannot write in disk: {why}"))),
            "{arguments}: {said}"
        );
    }
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_are_neither_read_nor_replaced() {
    let folder = folder("devices");
    write_grid_scene(&folder);
    std::fs::write(folder.join("cloth.toml"), COTTON_SATIN).unwrap();
    let made = Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(made.unwrap().success());
    let special = "is a device or a pipe; expected ";
    for (key, file) in [
        ("extinction", "/dev/zero"),
        ("sggx", "pipe"),
        ("albedo", "pipe"),
    ] {
        let set = format!("object.0.{key}={file}");
        let said = complaint(&folder, &format!("render scene.toml -o x.exr --set {set}"));
        assert_eq!(said, format!("organza: {file}: {special}a file"));
    }
    let said = complaint(&folder, "info pipe");
    assert_eq!(said, format!("organza: pipe: {special}a file"));
    // To open it would be to wait.
    std::fs::rename(folder.join("pipe"), folder.join("pipe.tif")).unwrap();
    let scan = "scan pipe.tif --voxel-um 1 -o x.ovox";
    let said = complaint(&folder, &scan);
    assert_eq!(said, format!("organza: pipe.tif: {special}a file"));
    std::os::unix::fs::symlink("/dev/zero", folder.join("endless.toml")).unwrap();
    let said = complaint(&folder, "info endless.toml");
    assert_eq!(said, format!("organza: endless.toml: {special}a file"));
    std::os::unix::fs::symlink("/dev/full", folder.join("out.csv")).unwrap();
    let arguments = "measure cloth.toml --layout grid -o out.csv";
    let said = complaint(&folder, &arguments);
    assert_eq!(
        said,
        format!("organza: out.csv: {special}the name of a file")
    );
    assert!(folder.join("out.csv").is_symlink());
}

#[test]
fn too_little_memory_is_reported_before_it_is_taken() {
    let folder = folder("memory");
    write_grid_scene(&folder);
    std::fs::write(folder.join("cloth.toml"), COTTON_SATIN).unwrap();
    let scene = "[camera]\norigin_mm=[0,0,3]\ntarget_mm=[0,0,0]\nwidth_mm=1\nresolution=[8,8]\n\
                 [[light]]\nkind='environment'\nradiance=[1,1,1]\n\
                 [[object]]\nkind='cloth'\nfabric='cloth.toml'\n";
    std::fs::write(folder.join("cloth_scene.toml"), scene).unwrap();
    let large = "camera.resolution=[65536,65536]";
    for arguments in [
        &format!("render scene.toml -o x.exr --set {large}"),
        "render cloth_scene.toml -o x.exr",
        "measure cloth.toml --layout irawan -o x.exr --model surface",
        "render cloth_scene.toml -o x.exr --set render.integrator='fibres'",
        "voxelize cloth.toml -o x.ovox",
        "measure cloth.toml --layout grid -o x.csv",
        "measure cloth.toml --layout irawan -o x.csv",
        "measure cloth.toml --layout irawan -o x.csv --model fibres",
        "compare cloth.toml -o report --models packed,plain",
        "fit surface cloth.toml -o x.toml",
        "export mitsuba cloth_scene.toml -o out",
    ] {
        let said = complaint(&folder, &format!("{arguments} --quiet --max-memory 100KiB"));
        assert!(
            said.contains("bytes of memory, ") && said.contains(" are allowed: "),
            "{arguments:?}: {said}"
        );
        println!("{said}");
    }
}

/// The limit of the address space is respected before it is met: a film that needs more
/// is refused, where allocating it would abort.
#[cfg(target_os = "linux")]
#[test]
fn the_limit_of_the_address_space_is_a_limit_of_memory() {
    let folder = folder("address-space");
    write_grid_scene(&folder);
    let program = env!("CARGO_BIN_EXE_organza");
    let large = "camera.resolution=[4096,4096]";
    let render = format!("exec {program} render scene.toml -o x.exr --quiet --set {large}");
    let out = Command::new("sh")
        .current_dir(&folder)
        .args(["-c", &format!("ulimit -v 600000; {render}")])
        .output()
        .unwrap();
    let words = ended(&out, 2);
    assert_contains(&words, " are allowed");
}

/// A scene names what is read, the command line alone what is written.
#[cfg(unix)]
#[test]
fn a_scene_writes_nowhere() {
    let folder = folder("paths");
    let inner = folder.join("inner");
    std::fs::create_dir(&inner).unwrap();
    write_grid_scene(&inner);
    // Its inputs by ways that lead about: up and down again, a link, a chain
    // of links without an end.
    std::fs::rename(inner.join("sggx.vol"), folder.join("sggx.vol")).unwrap();
    std::os::unix::fs::symlink("../sggx.vol", inner.join("link.vol")).unwrap();
    std::os::unix::fs::symlink("loop.vol", inner.join("loop.vol")).unwrap();
    let render = |name: &str| {
        let set = format!("object.0.sggx={name}");
        organza(
            &inner,
            &format!("render scene.toml -o out.png --set {set} --quiet"),
        )
    };
    for name in ["../sggx.vol", "../inner/../sggx.vol", "link.vol"] {
        assert!(render(name).status.success(), "{name}");
    }
    for (name, why) in [
        ("loop.vol", "Too many levels of symbolic links"),
        ("../../../../../../../../../no_such.vol", "no such file"),
        ("nul\\u0000byte", "contained an unexpected NUL byte"),
        ("..", "is a folder; expected a file"),
    ] {
        let out = render(&format!("\"{name}\""));
        let said = ended(&out, 2);
        assert!(
            said.contains(why) || cfg!(not(target_os = "linux")),
            "{said}"
        );
    }
    let names = argv("inner link.vol loop.vol out.png scene.toml sggx.vol");
    for name in [files_left(&folder), files_left(&inner)].concat() {
        assert!(
            names.contains(&name.as_str()) || name == "sigma_t.vol",
            "{name}"
        );
    }
    // What stands at the end of a link is not written through it.
    std::fs::write(folder.join("precious"), "precious").unwrap();
    std::fs::remove_file(inner.join("out.png")).unwrap();
    std::os::unix::fs::symlink("../precious", inner.join("out.png")).unwrap();
    assert!(render("link.vol").status.success());
    assert_eq!(std::fs::read(folder.join("precious")).unwrap(), b"precious");
    assert!(!inner.join("out.png").is_symlink());
}
