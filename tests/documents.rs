//! Commands and links of the README and the pages.

use crate::program::{complaint, folder, organza, succeed};
use organza_testing::assert_contains;
use std::path::{Path, PathBuf};

/// README and the pages of use, with their texts.
fn pages() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let docs = std::fs::read_dir(root.join("docs")).unwrap();
    let docs = docs.map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = docs
        .filter(|p| p.extension().is_some_and(|e| e == "md"))
        .collect();
    paths.extend([root.join("README.md"), root.join("CONTRIBUTING.md")]);
    paths.sort();
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

/// The insides of a page's blocks of a language.
fn blocks<'a>(page: &'a str, language: &'a str) -> impl Iterator<Item = &'a str> {
    page.split("\n```")
        .skip(1)
        .step_by(2)
        .filter_map(move |block| block.strip_prefix(language)?.split_once('\n'))
        .map(|(_, inside)| inside)
}

/// The commands of a page, as words, with the folder they are typed in.
fn commands(page: &str, working_folder: &Path) -> Vec<Vec<String>> {
    let lines: Vec<String> = blocks(page, "sh")
        .flat_map(|block| {
            let joined = block.replace("\\\n", " ");
            joined.lines().map(str::to_owned).collect::<Vec<_>>()
        })
        .collect();
    let words = |line: &String| {
        let line = line.replace("$PWD", &working_folder.display().to_string());
        let words = line.split_whitespace().map(str::to_owned);
        words.take_while(|word| word != "#").collect::<Vec<_>>()
    };
    let lines = lines.iter().map(words);
    lines.filter(|words| !words.is_empty()).collect()
}

#[test]
fn every_command_on_a_page_is_one_that_the_program_knows() {
    let folder = folder("documents");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut count = 0;
    for (path, page) in pages() {
        for words in commands(&page, &folder) {
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            for word in &words {
                let shipped = ["scenes/", "benches/", "volumes/", "tests/", "docs/"];
                if shipped.iter().any(|s| word.starts_with(s)) {
                    assert!(root.join(word).exists(), "{}: {word}", path.display());
                }
            }
            let arguments = match words.as_slice() {
                ["organza", arguments @ ..] => arguments,
                ["cargo", "run", "--release", "--", arguments @ ..] => arguments,
                _ => continue,
            };
            // An unknown flag or value is an error even with --help.
            let asked = [arguments, &["--help"]].concat();
            let out = organza(&folder, &asked);
            let printed = String::from_utf8_lossy(&out.stderr);
            assert!(
                out.status.success(),
                "{}: {words:?}: {printed}",
                path.display()
            );
            count += 1;
        }
    }
    assert!(count > 30, "only {count} commands found");
    // The twin: what no page may say.
    for wrong in [
        &["render", "--sspp", "3", "--help"][..],
        &["measure", "--layout", "round", "--help"],
    ] {
        assert_eq!(organza(&folder, wrong).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn every_link_of_a_page_leads_to_a_file_and_a_heading() {
    let slug = |heading: &str| {
        let kept = |c: char| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' => Some(c.to_ascii_lowercase()),
            _ => None,
        };
        heading.trim().chars().filter_map(kept).collect::<String>()
    };
    for (path, page) in pages() {
        for link in page.split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.contains("://") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => path.clone(),
                file => path.parent().unwrap().join(file),
            };
            assert!(target.exists(), "{}: {link}", path.display());
            if anchor.is_empty() {
                continue;
            }
            let text = std::fs::read_to_string(&target).unwrap();
            let headings = text.lines().filter(|line| line.starts_with('#'));
            let mut slugs = headings.map(|line| slug(line.trim_start_matches('#')));
            assert!(slugs.any(|s| s == anchor), "{}: {link}", path.display());
        }
    }
}

/// The book of the documentation (`.ci/book`) has every page once.
#[test]
fn every_page_is_listed_once_in_the_summary() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let unlisted = |summary: &str| {
        let is_unlisted = |path: &PathBuf| {
            let name = path.file_name().unwrap().to_str().unwrap();
            let is_page = path.parent() == Some(docs.as_path()) && name != "SUMMARY.md";
            is_page && summary.matches(&format!("]({name})")).count() != 1
        };
        let paths = pages().into_iter().map(|(path, _)| path);
        paths.filter(is_unlisted).count()
    };
    assert_eq!(unlisted(&summary), 0);
    // The twins: a page that is missing, and all of them twice.
    assert_eq!(unlisted(&summary.replace("](gallery.md)", "]()")), 1);
    assert!(unlisted(&summary.repeat(2)) > 30);
}

/// The page about drafts, typed from its first line to its last, with another
/// draft than the page's author had and fewer samples.
#[cfg(unix)]
#[test]
fn the_page_about_drafts_leads_to_a_picture() {
    let folder = folder("documents-draft");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::os::unix::fs::symlink(root.join("scenes"), folder.join("scenes")).unwrap();
    std::fs::copy(
        root.join("scenes/drafts/first_light.wif"),
        folder.join("my_draft.wif"),
    )
    .unwrap();
    let page = std::fs::read_to_string(root.join("docs/wif.md")).unwrap();
    let fabric: Vec<&str> = blocks(&page, "toml").collect();
    assert_eq!(fabric.len(), 1);
    // The draft's threads are closer than wool of the page's count is thick.
    let fabric = fabric[0].replace("tex = 60.0", "tex = 6.0");
    std::fs::write(folder.join("my_fabric.toml"), fabric).unwrap();
    let mut rendered = 0;
    for words in commands(&page, &folder) {
        let mut words: Vec<&str> = words.iter().skip(1).map(String::as_str).collect();
        if words[0] == "render" {
            words.extend(["--spp", "1", "--set", "camera.resolution=[24,24]"]);
            rendered += 1;
        }
        succeed(&folder, &words);
    }
    assert_eq!(rendered, 1);
    assert!(folder.join("my_fabric.png").exists());

    // What one types first, and what is said to it.
    let set = ["--set", "object.0.fabric=my_fabric.toml"];
    let render = ["render", "scenes/first_light.toml", "-o", "none.png"];
    let message = complaint(&folder, &[&render[..], &set].concat());
    let whole = folder.join("my_fabric.toml");
    let expected = format!("did you mean {} (a path in a scene", whole.display());
    assert_contains(&message, &expected);
    let message = complaint(&folder, "info my_fabrik.toml");
    assert_eq!(
        message,
        "organza: my_fabrik.toml: no such file; did you mean my_fabric.toml?"
    );
}
