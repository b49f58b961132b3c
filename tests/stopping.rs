//! Renders that end early, at a time limit or a target error, and what they report.

use crate::cli::write_grid_scene;
use crate::program::{bytes, exr_channels, folder, picture, succeed};
use crate::refusals::SAILCLOTH;
use organza_testing::assert_contains;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The number before " of N samples" in the final line.
fn taken(words: &str) -> u64 {
    let line = words.lines().find(|l| l.starts_with("stopped")).unwrap();
    let (_, printed) = line.rsplit_once("; ").unwrap();
    printed.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn the_time_limit_ends_a_render() {
    let folder = folder("time-limit");
    write_grid_scene(&folder);
    let spp = "4000000";
    let limited = format!("render scene.toml -o out.exr --spp {spp}");
    let words = succeed(&folder, &format!("{limited} --time-limit 300ms"));
    assert_contains(&words, "time limit reached; ");
    assert_contains(&words, " of 4000000 samples a pixel");
    let samples = taken(&words);
    assert!(samples > 0 && samples < 4_000_000, "{words}");
    // What there was time for is what as many samples give.
    let early = bytes(&folder, "out.exr");
    assert!(early == picture(&folder, &["--spp", &samples.to_string()]));
}

#[test]
fn errors_that_were_not_reached_or_are_not_known_are_reported() {
    let folder = folder("target-missed");
    write_grid_scene(&folder);
    let run = "render scene.toml -o out.exr --target-error";
    let printed = |more: &str| succeed(&folder, &format!("{run} {more}"));
    let words = printed("0.0001 --spp 4");
    let missed = "all samples taken, target error not reached, 0.";
    assert_contains(&words, missed);
    assert_contains(&words, " of the mean; 4 of 4 samples");
    let words = printed("0.99 --spp 4");
    assert_contains(&words, "taken, target error reached, 0.");
    // The spread of one sample is not zero, it is not known.
    let words = printed("0.99 --spp 1 --stats");
    assert_contains(&words, "error         unknown (one sample)");
    assert!(
        !words.contains("+-") && !words.contains("reached"),
        "{words}"
    );
    let figures = printed("0.99 --spp 1 --json --quiet");
    let figures: serde_json::Value = serde_json::from_str(&figures).unwrap();
    assert!(figures["relative_error"].is_null() && figures["standard_error"].is_null());
    let figures = printed("0.0001 --spp 2 --json --quiet");
    let figures: serde_json::Value = serde_json::from_str(&figures).unwrap();
    assert!(figures["relative_error"].as_f64() > Some(0.0), "{figures}");
}

#[test]
fn the_target_error_ends_a_render_at_the_same_sample_on_any_machine() {
    let folder = folder("target-error");
    write_grid_scene(&folder);
    let run = "render scene.toml -o out.exr --spp 100000";
    let reach = |target: &str, more: &str| {
        let words = succeed(&folder, &format!("{run} --target-error {target} {more}"));
        assert_contains(&words, "target error reached, ");
        taken(&words)
    };
    let samples = reach("0.004", "--threads 1");
    let channels = exr_channels(&folder.join("out.exr"));
    let sum = |names: [&str; 3]| -> f64 {
        let values = names.iter().flat_map(|n| channels[*n].iter());
        values.map(|&x| f64::from(x)).sum()
    };
    let values = 3.0 * channels["R"].len() as f64;
    let variance = sum(["variance.R", "variance.G", "variance.B"]) / values;
    let error = variance.sqrt() / (sum(["R", "G", "B"]) / values);
    assert!(
        error <= 0.004 && error > 0.003,
        "{error} at {samples} samples"
    );
    let early = bytes(&folder, "out.exr");
    assert_eq!(reach("0.004", "--threads 2"), samples);
    assert!(bytes(&folder, "out.exr") == early);
    assert!(early == picture(&folder, &["--spp", &samples.to_string()]));
    // Without --spp there are as many as it takes, though the scene asks for 4.
    let words = succeed(&folder, "render scene.toml -o out.exr --target-error 0.004");
    assert_eq!(taken(&words), samples);
    assert!(bytes(&folder, "out.exr") == early);
    let both = "--target-median-error 0.99";
    assert_eq!(reach("0.004", both), samples);
    let both = "--target-median-error 0.002";
    assert!(reach("0.9", both) > 16);
    // Four times the samples for half the error, within the steps of looks.
    let finer = reach("0.002", "");
    assert!(
        finer > 3 * samples && finer < 5 * samples,
        "{samples}, {finer}"
    );
}

#[test]
fn statistics_tell_fireflies_and_memory() {
    let folder = folder("statistics");
    write_grid_scene(&folder);
    let words = succeed(&folder, "render scene.toml -o out.exr --stats");
    assert_contains(&words, "rejected      0 samples");
    assert_contains(&words, "times the mean");
    assert_contains(&words, "memory ");
    assert_contains(&words, "all samples taken; 4 of 4 samples");
}

/// Rays beside all matter of a cloth without end, whose samples once took for ever.
#[test]
fn the_time_limit_ends_a_view_along_the_cloth() {
    let folder = folder("time-limit-edge");
    std::fs::write(folder.join("cloth.toml"), SAILCLOTH).unwrap();
    let scene = "[camera]\norigin_mm = [10.0, 0.1, 0.0]\ntarget_mm = [0.0, 0.1, 0.0]\n\
        up = [0.0, 0.0, 1.0]\nwidth_mm = 0.02\nresolution = [2, 40]\n[[light]]\n\
        kind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n[[object]]\nkind = \"cloth\"\n\
        fabric = \"cloth.toml\"\nmodel = \"packed\"\nlod = 0\n";
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(&folder)
        .args(["render", "scene.toml", "-o", "out.exr", "--spp", "4000000"])
        .args(["--time-limit", "300ms", "--quiet"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = run.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > Duration::from_secs(120) {
            run.kill().unwrap();
            run.wait().unwrap();
            panic!("no end");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    assert!(status.success(), "{status}");
    println!("{:?}", began.elapsed());
}
