//! What lies in `docs/farm`, without the engines that it is made for: the scripts inside the
//! Open Job Description templates and the scripts for Slurm run as the engines would run
//! them, on small scenes, and must make the files of one run. `tests/peers/run` runs them on
//! the engines themselves.

use crate::cli::write_grid_scene;
use crate::program::{bytes, ended, folder, organza, picture, succeed};
use crate::slab::write_slab;
use organza_testing::assert_contains;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const TEMPLATES: [&str; 3] = ["render.yaml", "animation.yaml", "measure.yaml"];

fn farm() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/farm")
}

fn text(name: &str) -> String {
    std::fs::read_to_string(farm().join(name)).unwrap()
}

/// Values by their names.
type Values<'a> = BTreeMap<&'a str, String>;

/// A step of a template.
#[derive(Default)]
struct Step {
    name: String,
    dependencies: Vec<String>,
    /// Words after `bash`.
    arguments: Vec<String>,
    /// Embedded files: names and texts.
    scripts: Vec<(String, String)>,
}

/// A template, as far as these tests need it. It reads the layout of these files, not YAML
/// in general; `openjd check` checks the rest.
struct Template {
    /// Parameters, with their defaults.
    parameters: BTreeMap<String, Option<String>>,
    /// Variables of the environment.
    variables: Vec<(String, String)>,
    steps: Vec<Step>,
}

fn indentation(line: &str) -> usize {
    line.len() - line.trim_start().len()
}

impl Template {
    fn read(name: &str) -> Template {
        let text = text(name);
        let mut read = Template {
            parameters: BTreeMap::new(),
            variables: Vec::new(),
            steps: Vec::new(),
        };
        let (mut section, mut named) = ("", String::new());
        let mut lines = text.lines().peekable();
        while let Some(line) = lines.next() {
            let depth = indentation(line);
            let (key, value) = line.trim().split_once(':').unwrap_or((line.trim(), ""));
            let value = value.trim().trim_matches('"').to_owned();
            if depth == 0 {
                section = key;
                continue;
            }
            if key == "- name" {
                named = value.split(" #").next().unwrap().to_owned();
            }
            match (section, key, depth) {
                ("parameterDefinitions", "- name", 2) => {
                    read.parameters.insert(named.clone(), None);
                }
                ("parameterDefinitions", "default", _) => {
                    read.parameters.insert(named.clone(), Some(value));
                }
                ("jobEnvironments", key, 6) => read.variables.push((key.to_owned(), value)),
                ("steps", "- name", 2) => read.steps.push(Step {
                    name: named.clone(),
                    ..Step::default()
                }),
                ("steps", key, _) => {
                    let step = read.steps.last_mut().unwrap();
                    match key {
                        "- dependsOn" => step.dependencies.push(value),
                        "args" => {
                            let list = line.split_once(": ").unwrap().1;
                            step.arguments = serde_json::from_str(list).unwrap();
                        }
                        "data" => {
                            let mut script = String::new();
                            while let Some(line) =
                                lines.next_if(|line| line.is_empty() || indentation(line) > depth)
                            {
                                script += line.get(depth + 2..).unwrap_or("");
                                script += "\n";
                            }
                            step.scripts.push((named.clone(), script));
                        }
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        read
    }

    fn step(&self, name: &str) -> &Step {
        self.steps.iter().find(|s| s.name == name).unwrap()
    }

    /// Runs a task of a step in a folder, as the engine would: with the job's parameters
    /// (the others have their defaults), which may be of the task as well.
    fn run(&self, folder: &Path, step: &str, job: &Values<'_>, task: &Values<'_>) -> Output {
        let mut known: Vec<(String, String)> = Vec::new();
        for (name, default) in &self.parameters {
            let value = job.get(name.as_str()).or(default.as_ref());
            let value = value.unwrap_or_else(|| panic!("{name} has no value"));
            known.push((format!("{{{{Param.{name}}}}}"), value.clone()));
        }
        let of_task = task.iter();
        known.extend(of_task.map(|(name, v)| (format!("{{{{Task.Param.{name}}}}}"), v.clone())));
        let step = self.step(step);
        for (name, script) in &step.scripts {
            let path = folder.join(format!("{name}.sh"));
            std::fs::write(&path, script).unwrap();
            let path = path.display().to_string();
            known.push((format!("{{{{Task.File.{name}}}}}"), path));
        }
        let fill = |text: &String| {
            let filled = known
                .iter()
                .fold(text.clone(), |text, (from, to)| text.replace(from, to));
            assert!(!filled.contains("{{"), "{filled}: nothing has this name");
            filled
        };
        Command::new("bash")
            .args(step.arguments.iter().map(fill))
            .envs(self.variables.iter().map(|(name, v)| (name, fill(v))))
            .current_dir(folder)
            .output()
            .unwrap()
    }
}

fn must_succeed(out: &Output) {
    let words = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{words}");
}

/// Values of parameters, with the program.
fn values<'a>(list: &[(&'a str, &str)]) -> Values<'a> {
    let program = ("Organza", env!("CARGO_BIN_EXE_organza"));
    let all = list.iter().chain([&program]);
    all.map(|&(name, v)| (name, v.to_owned())).collect()
}

fn task<'a>(list: &[(&'a str, u64)]) -> Values<'a> {
    list.iter()
        .map(|&(name, v)| (name, v.to_string()))
        .collect()
}

#[test]
fn templates_name_what_they_declare_and_depend_on_steps_before() {
    for name in TEMPLATES {
        let template = Template::read(name);
        let text = text(name);
        let mut used = BTreeSet::new();
        for reference in text.split("{{Param.").skip(1) {
            used.insert(reference.split("}}").next().unwrap().to_owned());
        }
        let declared: BTreeSet<String> = template.parameters.keys().cloned().collect();
        assert_eq!(used, declared, "{name}: what is used, what is declared");
        assert!(template.steps.len() >= 2, "{name}");
        for (i, step) in template.steps.iter().enumerate() {
            assert_eq!(step.scripts.len(), 1, "{name}: {}", step.name);
            let before: Vec<&str> = template.steps[..i]
                .iter()
                .map(|s| s.name.as_str())
                .collect();
            let needed = step.dependencies.iter();
            assert!(
                needed.clone().all(|n| before.contains(&n.as_str())),
                "{name}"
            );
            assert_eq!(
                step.dependencies.is_empty(),
                i == 0,
                "{name}: {}",
                step.name
            );
        }
    }
}

#[test]
fn parts_of_a_template_merge_to_the_picture_of_one_run() {
    let folder = folder("farm-render");
    write_grid_scene(&folder);
    let whole = picture(&folder, "--spp 20 --set camera.width_mm=1.5");
    let template = Template::read("render.yaml");
    let job = values(&[
        ("Scene", "scene.toml"),
        ("Folder", "a farm"),
        ("Samples", "20"),
        ("SamplesPerTask", "8"),
        ("Set", "camera.width_mm=1.5 render.exposure=1"),
    ]);
    let part = |first| template.run(&folder, "Render", &job, &task(&[("FirstSample", first)]));
    let merge = || template.run(&folder, "Merge", &job, &task(&[]));
    must_succeed(&part(1));
    must_succeed(&part(17));
    // A part is missing: an error, and no picture.
    let out = merge();
    let words = ended(&out, 2);
    assert_contains(&words, "samples_8_16.exr: no such file");
    assert!(!folder.join("a farm/picture.exr").exists());
    // A task that runs again resumes.
    must_succeed(&part(9));
    assert!(folder.join("a farm/parts/samples_8_16.state").exists());
    must_succeed(&part(9));
    must_succeed(&merge());
    assert!(bytes(&folder, "a farm/picture.exr") == whole);
    assert!(!folder.join("a farm/parts/samples_8_16.state").exists());
    // A wrong value is refused by the program, not lost on the way.
    let wrong = values(&[
        ("Set", "camera.with_mm=1"),
        ("Scene", "scene.toml"),
        ("Folder", "no"),
    ]);
    let out = template.run(&folder, "Render", &wrong, &task(&[("FirstSample", 1)]));
    assert_eq!(out.status.code(), Some(2));
}

#[test]
fn frames_of_a_template_are_those_of_single_runs() {
    let folder = folder("farm-animation");
    write_grid_scene(&folder);
    let template = Template::read("animation.yaml");
    std::fs::write(
        folder.join("frames.txt"),
        "camera.width_mm=1.5\ncamera.width_mm=1.25 render.seed=4\n",
    )
    .unwrap();
    let job = values(&[
        ("Scene", "scene.toml"),
        ("FrameList", "frames.txt"),
        ("Frames", "2"),
        ("Folder", "frames"),
        ("Samples", "5"),
        ("SamplesPerTask", "3"),
    ]);
    let run = |step, list: &[(&str, u64)]| template.run(&folder, step, &job, &task(list));
    for first in [1, 4] {
        must_succeed(&run("Render", &[("Frame", 2), ("FirstSample", first)]));
    }
    must_succeed(&run("Merge", &[("Frame", 2)]));
    let alone = picture(
        &folder,
        "--spp 5 --set camera.width_mm=1.25 --set render.seed=4",
    );
    assert!(bytes(&folder, "frames/frame_0002.exr") == alone);
    let beyond = run("Render", &[("Frame", 3), ("FirstSample", 1)]);
    let words = ended(&beyond, 2);
    assert_eq!(words, "frames.txt: line 3 is missing or empty\n");
}

#[test]
fn tables_of_a_template_are_those_of_single_runs() {
    let folder = folder("farm-measure");
    write_slab(&folder);
    std::fs::copy(folder.join("slab.toml"), folder.join("other.toml")).unwrap();
    std::fs::write(folder.join("fabrics.txt"), "slab.toml\nother.toml\n").unwrap();
    let pairs = "theta_i,phi_i,theta_o,phi_o\n30,0,40,170\n10,80,0,0\n20,0,150,0\n";
    std::fs::write(folder.join("pairs.csv"), pairs).unwrap();
    let template = Template::read("measure.yaml");
    let job = values(&[
        ("FabricList", "fabrics.txt"),
        ("Library", "."),
        ("Fabrics", "1-2"),
        ("Pairs", "pairs.csv"),
        ("Rows", "3"),
        ("RowsPerTask", "2"),
        ("Paths", "64"),
        ("Folder", "tables"),
    ]);
    let run = |step, list: &[(&str, u64)]| template.run(&folder, step, &job, &task(list));
    for fabric in [1, 2] {
        for first in [1, 3] {
            must_succeed(&run("Measure", &[("Fabric", fabric), ("FirstRow", first)]));
        }
        must_succeed(&run("JoinRows", &[("Fabric", fabric)]));
    }
    must_succeed(&run("JoinFabrics", &[]));
    succeed(
        &folder,
        "measure slab.toml --pairs pairs.csv --spp 64 -o whole.csv",
    );
    let whole = String::from_utf8(bytes(&folder, "whole.csv")).unwrap();
    for fabric in [1, 2] {
        let table = bytes(&folder, &format!("tables/fabric_{fabric}.csv"));
        assert_eq!(String::from_utf8(table).unwrap(), whole);
    }
    let (head, rows) = whole.split_once('\n').unwrap();
    let mut expected = format!("fabric,{head}\n");
    for fabric in ["slab.toml", "other.toml"] {
        expected.extend(rows.lines().map(|row| format!("{fabric},{row}\n")));
    }
    let library = String::from_utf8(bytes(&folder, "tables/library.csv")).unwrap();
    assert_eq!(library, expected);
}

#[test]
fn parts_of_an_array_job_merge_to_the_picture_of_one_run() {
    let folder = folder("farm-slurm");
    write_grid_scene(&folder);
    let set = ["--set", "camera.width_mm=1.5"];
    let whole = picture(&folder, "--spp 20 --set camera.width_mm=1.5");
    let run = |script: &str, arguments: &[&str], task: &str| {
        Command::new("bash")
            .arg(farm().join(script))
            .args(arguments)
            .env("SLURM_ARRAY_TASK_ID", task)
            .env("ORGANZA", env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .output()
            .unwrap()
    };
    let part = ["scene.toml", "a farm", "20", "8"];
    let part = |task: &str| run("render_part.sbatch", &[&part[..], &set].concat(), task);
    let merge = || run("merge_parts.sbatch", &["a farm", "20", "8"], "");
    must_succeed(&part("0"));
    must_succeed(&part("2"));
    assert_eq!(merge().status.code(), Some(2), "a part is missing");
    must_succeed(&part("1"));
    must_succeed(&part("1"));
    must_succeed(&merge());
    assert!(bytes(&folder, "a farm/picture.exr") == whole);
    let words = String::from_utf8(part("3").stderr).unwrap();
    assert_eq!(words, "task 3 has no samples: the last task is 2\n");
}

#[test]
fn the_command_of_the_ray_example_is_one_that_the_program_knows() {
    let script = text("measure_library.py");
    let command = script.split("\nCOMMAND = \"").nth(1).unwrap();
    let command = command.split('"').next().unwrap();
    let filled = [("{rows}", "0..2"), ("{paths}", "64"), ("{threads}", "1")];
    let filled = filled.iter().fold(command.to_owned(), |text, (from, to)| {
        text.replace(from, to)
    });
    let mut words: Vec<&str> = filled.split_whitespace().collect();
    assert!(words.len() > 10, "{words:?}");
    // An unknown flag or value is an error even with --help.
    words.push("--help");
    let folder = folder("farm-ray");
    assert!(organza(&folder, &words).status.success(), "{words:?}");
    words[1] = "--fabric";
    assert_eq!(organza(&folder, &words).status.code(), Some(2));
}
