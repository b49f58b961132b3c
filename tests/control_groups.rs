//! Limits of control groups, which the program reads from files of the system: here from files of
//! the test in their place (`tests/data/failing_disk.rs`).
#![cfg(all(target_os = "linux", target_arch = "x86_64", target_env = "gnu"))]

use crate::cli::write_grid_scene;
use crate::failing_disk::library;
use crate::program::{argv, ended, folder};
use organza_testing::assert_contains;
use std::path::Path;
use std::process::{Command, Output};

/// Renders a film of about 25 MiB among the files of this system.
fn render(folder: &Path, system: &[(&str, &str)]) -> Output {
    let root = folder.join("root");
    let _ = std::fs::remove_dir_all(&root);
    for (name, text) in system {
        let path = root.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let film = "camera.resolution=[256,256]";
    Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(folder)
        .args(argv("render scene.toml -o x.exr --quiet --spp 1"))
        .args(["--set", film])
        .env_remove("ORGANZA_CACHE")
        .env("LD_PRELOAD", library())
        .env("OTHER_ROOT", &root)
        .env("FAILING_FOLDER", folder)
        .env("FAILING_LOG", folder.join("log"))
        .output()
        .unwrap()
}

#[test]
fn what_a_control_group_leaves_is_a_limit_of_memory() {
    let folder = folder("control-groups");
    write_grid_scene(&folder);
    // Version 2: of 10 MiB 1,000,000 bytes are taken, the cache of files not counted.
    let second = |limit| {
        [
            ("proc/self/cgroup", "0::/\n"),
            (
                "proc/self/mountinfo",
                "30 23 0:26 / /sys/fs/cgroup rw - cgroup2 cgroup2 rw\n",
            ),
            ("sys/fs/cgroup/memory.max", limit),
            ("sys/fs/cgroup/memory.current", "6000000\n"),
            ("sys/fs/cgroup/memory.stat", "anon 1000000\nfile 5000000\n"),
        ]
    };
    let first = [
        ("proc/self/cgroup", "5:memory:/\n"),
        (
            "proc/self/mountinfo",
            "30 23 0:26 / /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory\n",
        ),
        ("sys/fs/cgroup/memory/memory.limit_in_bytes", "8388608\n"),
        ("sys/fs/cgroup/memory/memory.usage_in_bytes", "6000000\n"),
        (
            "sys/fs/cgroup/memory/memory.stat",
            "total_cache 3000000\ntotal_rss 3000000\n",
        ),
    ];
    for (system, left) in [
        (&second("10485760\n"), 10_485_760 - 1_000_000),
        (&first, 8_388_608 - 3_000_000),
    ] {
        let out = render(&folder, system);
        let said = ended(&out, 2);
        assert_contains(&said, &format!(" {left} are allowed: "));
        assert!(!folder.join("x.exr").exists());
    }
    // Known bad: without a limit, and with a wide one, the same film is rendered.
    for limit in ["max\n", "4294967296\n"] {
        let out = render(&folder, &second(limit));
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{limit}: {said}");
    }
}
