//! Records of measurements: what they say, and how old they are.

use super::{code_spans, file_paths, git, is_commit, root};
use std::collections::BTreeMap;

/// One section of a record: what was measured, with what, and where.
pub struct Measurement {
    /// `kernel.md` or `kernel.md#walk-and-kernel`.
    pub place: String,
    rows: BTreeMap<String, String>,
}

/// The rows that every measurement has, and those that explain an old one.
const REQUIRED: [&str; 5] = ["commit", "code", "command", "machine", "load"];
const STILL_HOLDS: &str = "still holds";
const NOT_AGAIN: &str = "not measured again";

impl Measurement {
    /// The commits that were measured; the first is that of the figures.
    pub fn commits(&self) -> Vec<&str> {
        let text = self.rows.get("commit").map_or("", String::as_str);
        code_spans(text).filter(|word| is_commit(word)).collect()
    }

    /// Files and folders whose change makes the figures old.
    pub fn code(&self) -> Vec<&str> {
        code_spans(self.rows.get("code").map_or("", String::as_str)).collect()
    }

    /// What is missing, whatever the repository's history is.
    pub fn defects(&self, files: &[String]) -> Vec<String> {
        let mut defects = Vec::new();
        for key in REQUIRED {
            let is_there = self.rows.get(key).is_some_and(|row| row.len() > 3);
            if !is_there || self.rows[key].contains("as above") {
                defects.push(format!("{}: no row `{key}`", self.place));
            }
        }
        for key in self.rows.keys() {
            if !REQUIRED.contains(&key.as_str()) && ![STILL_HOLDS, NOT_AGAIN].contains(&&**key) {
                defects.push(format!("{}: unknown row `{key}`", self.place));
            }
        }
        if self.commits().is_empty() {
            defects.push(format!("{}: names no commit", self.place));
        }
        let exists = |path: &str| {
            let inside = format!("{path}/");
            files.iter().any(|f| f == path || f.starts_with(&inside))
        };
        let code = self.code();
        let absent: Vec<&&str> = code.iter().filter(|path| !exists(path)).collect();
        if code.is_empty() || !absent.is_empty() {
            defects.push(format!(
                "{}: code that is not there: {absent:?}",
                self.place
            ));
        }
        if let Some(reason) = self.rows.get(STILL_HOLDS) {
            let first = code_spans(reason).next().unwrap_or("");
            let is_test = first.contains("tests/") && exists(first);
            if !is_commit(first) && !is_test {
                defects.push(format!(
                    "{}: `{STILL_HOLDS}` begins with neither a commit nor a test: {reason}",
                    self.place
                ));
            }
        }
        defects
    }
}

/// The place of a heading in links.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// The measurements of a record: tables of two columns without a heading.
pub fn measurements(name: &str, text: &str) -> Vec<Measurement> {
    let mut found: Vec<Measurement> = Vec::new();
    let (mut place, mut is_inside) = (name.to_owned(), false);
    for line in text.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            place = format!("{name}#{}", anchor(heading));
        }
        let cells: Vec<&str> = line
            .split(" | ")
            .map(|c| c.trim_matches(['|', ' ']))
            .collect();
        if is_inside && line.starts_with("| ") && cells.len() >= 2 {
            let rows = &mut found.last_mut().unwrap().rows;
            rows.insert(cells[0].to_owned(), cells[1..].join(" | "));
        } else if line.starts_with("| commit | ") {
            is_inside = true;
            found.push(Measurement {
                place: place.clone(),
                rows: BTreeMap::from([("commit".to_owned(), cells[1..].join(" | "))]),
            });
        } else {
            is_inside = false;
        }
    }
    found
}

pub fn records() -> Vec<Measurement> {
    let folder = root().join("benches/runs");
    let mut names = file_paths(&folder);
    names.sort();
    let read = |name: &String| {
        let found = measurements(name, &std::fs::read_to_string(folder.join(name)).unwrap());
        assert!(
            !found.is_empty(),
            "benches/runs/{name} holds no measurement"
        );
        found
    };
    names.iter().flat_map(read).collect()
}

/// Lines of code, without comments, that differ between a commit and the working tree.
pub fn changed_lines(commit: &str, paths: &[&str]) -> usize {
    let mut arguments = vec!["diff", "-M", "-U0", commit, "--"];
    arguments.extend(paths);
    arguments.extend([
        ":(exclude)**/tests/**",
        ":(exclude)**/*_tests/**",
        ":(exclude)**tests.rs",
    ]);
    let difference = git(&arguments).unwrap_or_else(|| panic!("git diff {commit} failed"));
    code_lines(&difference)
}

/// Lines of a difference that add or remove code. Git ends the head of a part with the last line
/// before it that is not indented, which is that of the module in a module of tests.
pub fn code_lines(difference: &str) -> usize {
    let mut is_test = false;
    let is_code = |line: &&str| {
        if line.starts_with("@@ ") {
            is_test = line.ends_with(" mod tests {");
        }
        let is_head = line.starts_with("+++") || line.starts_with("---");
        let code = line.strip_prefix(['+', '-']).unwrap_or("").trim();
        // A module of tests that is new ends its file.
        is_test |= code == "mod tests {" || code == "#[cfg(test)]";
        !is_test && !is_head && !code.is_empty() && !code.starts_with("//")
    };
    difference.lines().filter(is_code).count()
}

/// Why a page may not cite a measurement, if so. `changed` tells how many lines of code
/// differ from a commit.
pub fn outdated(
    m: &Measurement,
    citing: &[String],
    changed: &dyn Fn(&str) -> usize,
) -> Option<String> {
    let reason = m.rows.get(STILL_HOLDS).map_or("", String::as_str);
    let first = code_spans(reason).next().unwrap_or("");
    let is_held_by_test = first.contains("tests/");
    let commit = match m.commits().first() {
        Some(own) if !is_commit(first) => own,
        _ => first,
    };
    if is_held_by_test || changed(commit) == 0 {
        return None;
    }
    if !m.rows.contains_key(NOT_AGAIN) {
        let lines = changed(commit);
        return Some(format!(
            "{}: {lines} lines of its code changed since {commit}",
            m.place
        ));
    }
    let tells = |text: &&String| !m.commits().iter().any(|commit| text.contains(commit));
    let silent = citing.iter().find(tells)?;
    Some(format!(
        "{} was not measured again; name its commit in: {silent}",
        m.place
    ))
}
