//! Renders that are killed or interrupted and resumed from a checkpoint.

use crate::cli::write_grid_scene;
use crate::program::{argv, bytes, complaint, ended, folder, picture, sources, succeed};
use organza_testing::assert_contains;
use sha2::Digest;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn start(folder: &Path, line: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(folder)
        .args(argv(line))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits for a file of the running program.
fn wait_for(path: &Path, child: &mut Child) {
    let started = Instant::now();
    while !path.exists() {
        assert!(child.try_wait().unwrap().is_none(), "ended too soon");
        assert!(started.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Enough to be in the middle of it for a while: a second, at 5 million paths a second.
const LONG: &str = "40000";
/// More than that.
const LONGER: &str = "41000";

#[test]
fn a_killed_render_resumes_to_the_unbroken_picture() {
    let folder = folder("killed");
    write_grid_scene(&folder);
    let whole = picture(&folder, &format!("--spp {LONG}"));
    let saved = folder.join("state");
    let keep = "--checkpoint state --checkpoint-every 0s";
    let run = format!("render scene.toml -o late.exr --spp {LONG}");
    let mut child = start(&folder, &format!("{run} {keep} --threads 1"));
    wait_for(&saved, &mut child);
    child.kill().unwrap(); // SIGKILL
    assert!(!child.wait().unwrap().success(), "killed in the middle");
    assert!(!folder.join("late.exr").exists());
    let resume = format!("{run} {keep} --resume");
    succeed(&folder, &resume);
    assert!(bytes(&folder, "late.exr") == whole);
    // A complete render can be shown again, and continued with more samples.
    succeed(&folder, &resume);
    assert!(bytes(&folder, "late.exr") == whole);
    let more = format!("--checkpoint state --resume --spp {LONGER}");
    let more = picture(&folder, &more);
    assert!(more == picture(&folder, &format!("--spp {LONGER}")));
}

#[cfg(unix)]
#[test]
fn an_interrupt_saves_and_ends() {
    let folder = folder("interrupted");
    write_grid_scene(&folder);
    let whole = picture(&folder, &format!("--spp {LONG}"));
    for signal in ["-INT", "-TERM", "-HUP"] {
        interrupt_with(signal, &folder, &whole);
        std::fs::remove_file(folder.join("state")).unwrap();
        std::fs::remove_file(folder.join("late.exr")).unwrap();
    }
}

#[cfg(unix)]
fn interrupt_with(signal: &str, folder: &Path, whole: &[u8]) {
    let run = format!("render scene.toml -o late.exr --spp {LONG}");
    // The first checkpoint shows that the render is under way.
    let keep = "--checkpoint state --checkpoint-every 0s";
    let mut child = start(folder, &format!("{run} {keep} --threads 1"));
    wait_for(&folder.join("state"), &mut child);
    crate::program::signal(&child, signal);
    let out = child.wait_with_output().unwrap();
    let words = ended(&out, 1);
    assert!(
        words.starts_with("organza: interrupted with ")
            && words.trim_end().ends_with(&format!(
                " of {LONG} samples; saved to state, continue with --resume"
            )),
        "{words}"
    );
    assert!(!folder.join("late.exr").exists());
    succeed(folder, &format!("{run} {keep} --resume"));
    assert!(bytes(folder, "late.exr") == whole);
}

/// A checkpoint as other code would have written it: the digest of the sources in its head, which
/// comes after 8 bytes, is another, and the head's checksum is right.
fn of_other_code(good: &[u8], own: &str, other: &str) -> Vec<u8> {
    let length = u64::from_le_bytes(good[8..16].try_into().unwrap()) as usize;
    let (head, rest) = good[48..].split_at(length);
    let head = String::from_utf8(head.to_vec()).unwrap();
    assert_contains(&head, own);
    let head = head.replace(own, other);
    let sum = sha2::Sha256::digest(&head);
    [&good[..16], &sum, head.as_bytes(), rest].concat()
}

#[test]
fn checkpoints_that_do_not_belong_are_refused() {
    let folder = folder("foreign-checkpoint");
    write_grid_scene(&folder);
    picture(&folder, "--checkpoint state --samples 2..6");
    let good = bytes(&folder, "state");
    let refuse = |content: &[u8], more: &str| {
        std::fs::write(folder.join("state"), content).unwrap();
        let arguments = "render scene.toml -o no.exr --checkpoint state";
        let all = format!("{arguments} --resume {more}");
        let words = complaint(&folder, &all);
        assert_eq!(bytes(&folder, "state"), content, "the file is kept");
        words
    };
    let same = "--samples 2..6";
    assert_eq!(
        refuse(&good[..good.len() - 1], same),
        "organza: state: is cut short; it cannot be resumed"
    );
    assert_eq!(
        refuse(&good[..20], same),
        "organza: state: is cut short in its head; remove the file to start again"
    );
    let no_checkpoint = "organza: state: is not a journal; expected one of `organza render`";
    assert_eq!(refuse(b"", same), no_checkpoint);
    assert_eq!(refuse(b"something else", same), no_checkpoint);
    let damaged = "organza: state: is damaged: its checksums do not match";
    for at in [good.len() - 1, good.len() / 2, good.len() / 3] {
        let mut bent = good.clone();
        bent[at] ^= 1;
        assert_eq!(refuse(&bent, same), damaged, "byte {at}");
    }
    let (own, other) = (sources(), "0".repeat(32));
    let refused = refuse(&of_other_code(&good, &own, &other), same);
    assert!(
        refused.contains("was written by other code") && refused.contains(&other),
        "{refused}"
    );
    assert_eq!(
        refuse(&good, "--samples 2..6 --seed 3"),
        "organza: state: is a checkpoint of seed 0; this render has seed 3"
    );
    assert_eq!(
        refuse(&good, "--samples 2..6 --crop 0,0,8,8"),
        "organza: state: is a checkpoint of the pixels 0,0,16,8; this render is of 0,0,8,8"
    );
    for range in ["0..6", "2..5"] {
        assert_eq!(
            refuse(&good, &format!("--samples {range}")),
            format!(
                "organza: state: is a checkpoint of the samples 2..6; this render is of {range}"
            )
        );
    }
    assert_eq!(
        refuse(&good, "--samples 2..6 --set camera.width_mm=1.5"),
        "organza: state: is a checkpoint of another scene"
    );
    let grid = bytes(&folder, "sigma_t.vol");
    let mut denser = grid.clone();
    denser[48..52].copy_from_slice(&6.0f32.to_le_bytes());
    std::fs::write(folder.join("sigma_t.vol"), denser).unwrap();
    assert_eq!(
        refuse(&good, same),
        "organza: state: is a checkpoint of another content of sigma_t.vol, which the scene names"
    );
    std::fs::write(folder.join("sigma_t.vol"), grid).unwrap();
    assert!(!folder.join("no.exr").exists());
    std::fs::remove_file(folder.join("state")).unwrap();
    let arguments = "render scene.toml -o no.exr --checkpoint state";
    assert_eq!(
        complaint(&folder, &format!("{arguments} --resume")),
        "organza: state: no such file"
    );
}
