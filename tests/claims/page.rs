//! The figures of pages, and what they cite.

use super::code_spans;

#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Kind {
    Heading,
    Paragraph,
    Item,
    Table,
}

/// A paragraph, an item of a list, or a table.
pub struct Block {
    kind: Kind,
    line: usize,
    lines: Vec<String>,
    /// The paragraph that introduces a list or a table.
    introduction: Option<usize>,
    /// Follows the comment `<!-- not measured -->`.
    is_exempt: bool,
}

impl Block {
    pub fn text(&self) -> String {
        let lines: Vec<&str> = self.lines.iter().map(|line| line.trim()).collect();
        lines.join(" ")
    }
}

const EXEMPT: &str = "<!-- not measured -->";

/// The blocks of a page, without blocks of code.
pub fn blocks(page: &str) -> Vec<Block> {
    let mut found: Vec<Block> = Vec::new();
    let (mut is_code, mut is_open, mut is_exempt) = (false, false, false);
    let mut introduction = None;
    for (number, line) in page.lines().enumerate() {
        let trimmed = line.trim_start();
        if trimmed.starts_with("```") {
            (is_code, is_open) = (!is_code, false);
            continue;
        }
        if is_code {
            continue;
        }
        if trimmed.is_empty() || trimmed == EXEMPT {
            (is_open, is_exempt) = (false, is_exempt || trimmed == EXEMPT);
            continue;
        }
        let is_numbered = trimmed.split_once(". ");
        let is_numbered = is_numbered.is_some_and(|(n, _)| n.chars().all(|c| c.is_ascii_digit()));
        let kind = match trimmed {
            _ if line.starts_with('#') => Kind::Heading,
            _ if line.starts_with('|') => Kind::Table,
            _ if is_numbered || trimmed.starts_with("- ") || trimmed.starts_with("* ") => {
                Kind::Item
            }
            _ => Kind::Paragraph,
        };
        let last = found.last().map(|block| block.kind);
        let goes_on = match kind {
            Kind::Table => last == Some(Kind::Table),
            Kind::Paragraph => matches!(last, Some(Kind::Paragraph | Kind::Item)),
            Kind::Heading | Kind::Item => false,
        };
        if is_open && goes_on {
            found.last_mut().unwrap().lines.push(line.to_owned());
            continue;
        }
        match kind {
            Kind::Paragraph => introduction = Some(found.len()),
            Kind::Heading => introduction = None,
            Kind::Item | Kind::Table => {}
        }
        found.push(Block {
            kind,
            line: number + 1,
            lines: vec![line.to_owned()],
            introduction: introduction.filter(|_| matches!(kind, Kind::Item | Kind::Table)),
            is_exempt,
        });
        is_open = kind != Kind::Heading;
        is_exempt = false;
    }
    found
}

/// Whether a text holds a figure that looks measured: a share, a time, a size, a ratio, an
/// error, or a value of three digits behind the point.
fn has_figure(text: &str) -> bool {
    const UNITS: [&str; 20] = [
        "%", "s", "ms", "us", "ns", "second", "seconds", "minute", "minutes", "hours", "KiB",
        "MiB", "GiB", "kB", "MB", "GB", "times", "million", "bytes", "cent",
    ];
    const RATIOS: [&str; 9] = [
        "half",
        "third",
        "quarter",
        "fifth",
        "eighth",
        "tenth",
        "twelfth",
        "hundredth",
        "hundredths",
    ];
    let is_number = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_digit() || "+-(".contains(c))
            && word.ends_with(|c: char| c.is_ascii_digit() || c == ')')
    };
    let words: Vec<&str> = text
        .split_whitespace()
        .map(|word| word.trim_end_matches([',', '.', ';', ':']))
        .collect();
    let in_pair = |pair: &[&str]| {
        let unit = pair[1].trim_end_matches([')', '*']);
        is_number(pair[0]) && UNITS.contains(&unit) || pair[0] == "a" && RATIOS.contains(&unit)
    };
    let is_alone = |word: &&str| {
        let decimals = word.trim_start_matches(['+', '-', '(']).strip_prefix("0.");
        let digits = decimals.map_or(0, |d| d.chars().take_while(char::is_ascii_digit).count());
        *word == "±" || *word == "+-" || digits >= 3
    };
    words.windows(2).any(in_pair) || words.iter().any(is_alone)
}

/// Links from a text to records, as places of measurements.
pub fn cited_records(text: &str) -> Vec<String> {
    let links = text.split("benches/runs/").skip(1);
    let ends = |c: char| c.is_whitespace() || ")`,;".contains(c);
    let names = links.map(|rest| rest.split(ends).next().unwrap_or(""));
    names
        .map(|name| name.trim_end_matches('.').to_owned())
        .collect()
}

/// Whether a text names a test of the repository in a span of code.
fn cites_test(text: &str, files: &[String]) -> bool {
    let is_test = |name: &str| {
        let name = name.trim_end_matches(".rs");
        let ending = format!("/{name}.rs");
        let inside = format!("/{name}/");
        name.contains("test")
            && files
                .iter()
                .map(|f| format!("/{f}"))
                .any(|f| f.ends_with(&ending) || f.contains(&inside))
    };
    code_spans(text).any(is_test)
}

/// Figures of a page that are tied to nothing, by line.
pub fn loose_figures(page: &str, files: &[String]) -> Vec<String> {
    let cites = |text: &str| !cited_records(text).is_empty() || cites_test(text, files);
    let blocks = blocks(page);
    let mut loose = Vec::new();
    for block in &blocks {
        let introduction = block.introduction.map(|i| blocks[i].text());
        if block.is_exempt || block.kind == Kind::Heading || introduction.is_some_and(|t| cites(&t))
        {
            continue;
        }
        // A table of keys gives ranges, not measurements.
        let head = block.lines[0]
            .split(" | ")
            .map(|cell| cell.trim_matches(['|', ' ']));
        if block.kind == Kind::Table && head.into_iter().any(|cell| cell == "unit") {
            continue;
        }
        let parts = match block.kind {
            Kind::Table => block.lines.clone(),
            _ => vec![block.text()],
        };
        for part in parts.iter().filter(|part| has_figure(part) && !cites(part)) {
            loose.push(format!("{}: {part}", block.line));
        }
    }
    loose
}
