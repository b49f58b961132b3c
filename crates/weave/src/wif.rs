//! Weaving Information Files, versions 1.0 to 1.2, read tolerantly `[WIF1997]`: missing values
//! get defaults, deviations from the format are warned of, and a file is refused only if it
//! does not determine the weave.

#[cfg(test)]
pub(crate) mod example_drafts;
#[cfg(test)]
mod tests;
mod threads;

use crate::draft::{MAX_CROSSINGS, MAX_THREADS};
use crate::error::did_you_mean;
use crate::ini::{Ini, IniSection};
use crate::{Draft, Error};

const SECTIONS: [&str; 22] = [
    "WIF",
    "CONTENTS",
    "COLOR PALETTE",
    "WARP SYMBOL PALETTE",
    "WEFT SYMBOL PALETTE",
    "TEXT",
    "WEAVING",
    "WARP",
    "WEFT",
    "NOTES",
    "TIEUP",
    "COLOR TABLE",
    "WARP SYMBOL TABLE",
    "WEFT SYMBOL TABLE",
    "THREADING",
    "WARP THICKNESS",
    "WARP SPACING",
    "WARP COLORS",
    "TREADLING",
    "LIFTPLAN",
    "WEFT THICKNESS",
    "WEFT SPACING",
];
const MORE_SECTIONS: [&str; 3] = ["WEFT COLORS", "WARP SYMBOLS", "WEFT SYMBOLS"];

impl Draft {
    /// Reads a WIF file.
    ///
    /// End 1 of the file is the first end of the draft (x grows with the number), pick 1 the
    /// first pick. The weave comes from `LIFTPLAN` if there is one and `CONTENTS` does not
    /// declare it absent, otherwise from `TIEUP` and `TREADLING`; a sinking shed gives the
    /// complement. Threads without shaft or treadle stay down. Palette colours are taken as
    /// sRGB.
    ///
    /// # Errors [`Error::Wif`] with section and key where the weave or a colour cannot be
    /// determined: a missing section, a malformed number, a treadle or colour beyond the
    /// declared count, absurd sizes.
    pub fn from_wif(bytes: &[u8]) -> Result<Draft, Error> {
        Reader {
            ini: Ini::parse(bytes),
            warnings: Vec::new(),
        }
        .read()
    }
}

struct Reader {
    ini: Ini,
    warnings: Vec<String>,
}

/// Numbered lines of a section, `lists[i - 1]` being line `i`.
type Lists = Vec<Vec<usize>>;

impl Reader {
    fn read(mut self) -> Result<Draft, Error> {
        if self.ini.names().next().is_none() {
            return Err(wrong(
                "WIF",
                "",
                "there is no section at all; not a WIF file",
            ));
        }
        // Some programs omit [WIF], but every draft has one of these.
        const DRAFT: [&str; 5] = ["WIF", "THREADING", "TIEUP", "TREADLING", "LIFTPLAN"];
        if DRAFT.iter().all(|s| self.ini.section(s).is_none()) {
            return Err(wrong("WIF", "", "the section is missing; not a WIF file"));
        }
        self.warn_of_unknown_sections();
        let ends = self.thread_count("WARP", &["THREADING"])?;
        let picks = self.thread_count("WEFT", &["LIFTPLAN", "TREADLING"])?;
        if ends * picks > MAX_CROSSINGS {
            return Err(wrong(
                "WARP",
                "Threads",
                format!("{ends} x {picks} threads are more than {MAX_CROSSINGS} crossings"),
            ));
        }
        let shafts = self.count("WEAVING", "SHAFTS")?;
        let rising = self.flag("WEAVING", "RISING SHED")?.unwrap_or(true);

        let threading = self.threading(ends, shafts)?;
        let highest = threading.iter().flatten().copied().max().unwrap_or(0);
        let raised = self.raised(picks, shafts)?;
        let mut sheds = vec![false; highest + 1];
        let mut warp_up = Vec::with_capacity(ends * picks);
        for pick in &raised {
            sheds.fill(false);
            for &s in pick.iter().filter(|&&s| s <= highest) {
                sheds[s] = true;
            }
            warp_up.extend(
                threading
                    .iter()
                    .map(|on| on.iter().any(|&s| sheds[s]) == rising),
            );
        }

        let palette = self.palette()?;
        let mut draft = Draft::from_fn(ends, picks, |e, p| warp_up[p * ends + e])?;
        draft.warp = self.threads("WARP", ends, palette.as_deref())?;
        draft.weft = self.threads("WEFT", picks, palette.as_deref())?;
        draft.title = self.value("TEXT", "TITLE").unwrap_or_default().to_owned();
        draft.warnings = self.warnings;
        Ok(draft)
    }

    fn warn(&mut self, section: &str, message: impl std::fmt::Display) {
        self.warnings.push(format!("[{section}] {message}"));
    }

    fn warn_of_unknown_sections(&mut self) {
        let known = || SECTIONS.into_iter().chain(MORE_SECTIONS);
        let unknown: Vec<String> = self
            .ini
            .names()
            .filter(|n| !n.starts_with("PRIVATE") && !known().any(|k| k == *n))
            .map(str::to_owned)
            .collect();
        for name in unknown {
            let hint = did_you_mean(&name, known());
            self.warn(
                &name,
                format!("is not a section of WIF and is ignored{hint}"),
            );
        }
    }

    fn value(&self, section: &str, key: &str) -> Option<&str> {
        self.ini.section(section)?.get(key)
    }

    fn flag(&self, section: &str, key: &str) -> Result<Option<bool>, Error> {
        self.value(section, key)
            .map(|v| match v.to_lowercase().as_str() {
                "true" | "yes" | "on" | "1" | "t" | "y" => Ok(true),
                "false" | "no" | "off" | "0" | "f" | "n" => Ok(false),
                _ => Err(wrong(
                    section,
                    key,
                    format!("expected true or false, found \"{v}\""),
                )),
            })
            .transpose()
    }

    fn count(&self, section: &str, key: &str) -> Result<Option<usize>, Error> {
        self.value(section, key)
            .map(|v| whole(v).ok_or_else(|| wrong(section, key, expected_whole(v))))
            .transpose()
    }

    fn real(&self, section: &str, key: &str) -> Result<Option<f64>, Error> {
        self.value(section, key)
            .map(|v| real(v).ok_or_else(|| wrong(section, key, expected_number(v))))
            .transpose()
    }

    /// The section, unless it is missing or `CONTENTS` declares it absent.
    fn used(&self, name: &str) -> Option<&IniSection> {
        let disowned = matches!(self.flag("CONTENTS", name), Ok(Some(false)));
        self.ini.section(name).filter(|_| !disowned)
    }

    /// `Threads`, or the highest numbered line of the first section present.
    fn thread_count(&mut self, system: &str, sections: &[&str]) -> Result<usize, Error> {
        let counted = sections.iter().find_map(|s| self.used(s)).map(|s| {
            let keys = s.entries().filter_map(|(k, _)| whole(k));
            keys.max().unwrap_or(0)
        });
        let count = match self.count(system, "THREADS")? {
            Some(n) => n,
            None => {
                let n = counted.unwrap_or(0);
                self.warn(system, format!("Threads is missing; {n} found by counting"));
                n
            }
        };
        if !(1..=MAX_THREADS).contains(&count) {
            return Err(wrong(
                system,
                "Threads",
                format!("expected 1 to {MAX_THREADS} threads, found {count}"),
            ));
        }
        Ok(count)
    }

    /// The lines of a section that hold lists of numbers, without zeros.
    fn lists(&mut self, name: &str, lines: usize, highest: Option<usize>) -> Result<Lists, Error> {
        let mut lists = vec![Vec::new(); lines];
        let mut extra = 0;
        let Some(section) = self.ini.section(name) else {
            return Ok(lists);
        };
        for (key, value) in section.entries() {
            let line =
                whole(key).ok_or_else(|| wrong(name, key, "expected a line number as the key"))?;
            if line == 0 || line > lines {
                extra += 1;
                continue;
            }
            for item in number_part(value)
                .split(',')
                .map(str::trim)
                .filter(|v| !v.is_empty())
            {
                let n = whole(item).ok_or_else(|| wrong(name, key, expected_whole(item)))?;
                if let Some(highest) = highest.filter(|&h| n > h) {
                    let message = format!("{n} is beyond the {highest} declared in [WEAVING]");
                    return Err(wrong(name, key, message));
                }
                if n > MAX_THREADS {
                    return Err(wrong(name, key, format!("{n} is more than {MAX_THREADS}")));
                }
                if n > 0 {
                    lists[line - 1].push(n);
                }
            }
        }
        if extra > 0 {
            self.warn(
                name,
                format!("{extra} lines lie beyond line {lines} and are ignored"),
            );
        }
        Ok(lists)
    }

    fn threading(&mut self, ends: usize, shafts: Option<usize>) -> Result<Lists, Error> {
        if self.used("THREADING").is_none() {
            return Err(wrong("THREADING", "", "the section is missing"));
        }
        let threading = self.lists("THREADING", ends, None)?;
        self.warn_of_hidden_shafts("THREADING", &threading, shafts);
        self.warn_of_idle("THREADING", &threading, "ends are on no shaft");
        Ok(threading)
    }

    /// Programs for small looms write drafts for large ones with the wrong number of shafts.
    fn warn_of_hidden_shafts(&mut self, section: &str, lists: &Lists, declared: Option<usize>) {
        let highest = lists.iter().flatten().copied().max().unwrap_or(0);
        if let Some(declared) = declared.filter(|&d| d < highest) {
            self.warn(
                section,
                format!("shaft {highest} is beyond the {declared} declared"),
            );
        }
    }

    fn warn_of_idle(&mut self, section: &str, lists: &Lists, what: &str) {
        let idle = lists.iter().filter(|l| l.is_empty()).count();
        if idle > 0 {
            self.warn(section, format!("{idle} of {} {what}", lists.len()));
        }
    }

    /// The shafts that each pick moves.
    fn raised(&mut self, picks: usize, shafts: Option<usize>) -> Result<Lists, Error> {
        let has = |name| self.used(name).is_some();
        let (liftplan, treadling, tieup) = (has("LIFTPLAN"), has("TREADLING"), has("TIEUP"));
        if liftplan {
            let lifted = self.lists("LIFTPLAN", picks, None)?;
            self.warn_of_hidden_shafts("LIFTPLAN", &lifted, shafts);
            self.warn_of_idle("LIFTPLAN", &lifted, "picks move no shaft");
            if treadling && tieup {
                let trodden = self.trodden(picks, shafts)?;
                if !equal_sets(&lifted, &trodden) {
                    self.warn(
                        "LIFTPLAN",
                        "differs from TIEUP with TREADLING; LIFTPLAN is used",
                    );
                }
            }
            return Ok(lifted);
        }
        match (treadling, tieup) {
            (true, true) => self.trodden(picks, shafts),
            (true, false) => Err(wrong(
                "TIEUP",
                "",
                "the section is missing, TREADLING needs it",
            )),
            (false, _) => Err(wrong(
                "LIFTPLAN",
                "",
                "the section is missing, and so is TREADLING: nothing says which shafts move",
            )),
        }
    }

    fn trodden(&mut self, picks: usize, shafts: Option<usize>) -> Result<Lists, Error> {
        let treadles = self.count("WEAVING", "TREADLES")?;
        let treadling = self.lists("TREADLING", picks, treadles)?;
        self.warn_of_idle("TREADLING", &treadling, "picks use no treadle");
        let highest = treadling.iter().flatten().copied().max().unwrap_or(0);
        let lines = treadles.unwrap_or(highest).clamp(highest, MAX_THREADS);
        let tieup = self.lists("TIEUP", lines, None)?;
        self.warn_of_hidden_shafts("TIEUP", &tieup, shafts);
        let shafts_of = |treadles: &Vec<usize>| {
            treadles
                .iter()
                .flat_map(|&t| tieup[t - 1].iter().copied())
                .collect()
        };
        Ok(treadling.iter().map(shafts_of).collect())
    }
}

fn wrong(section: &str, key: &str, message: impl Into<String>) -> Error {
    Error::Wif {
        section: section.to_owned(),
        key: key.to_owned(),
        message: message.into(),
    }
}

fn expected_whole(found: &str) -> String {
    format!("expected a whole number, found \"{found}\"")
}

fn expected_number(found: &str) -> String {
    format!("expected a number, found \"{found}\"")
}

/// The number, without a comment that follows it on the line.
fn number_part(text: &str) -> &str {
    text.split([';', '#']).next().unwrap_or(text).trim()
}

fn whole(text: &str) -> Option<usize> {
    number_part(text).parse().ok()
}

/// A finite number. A comma separates list items, so decimal commas are not accepted.
fn real(text: &str) -> Option<f64> {
    number_part(text)
        .parse()
        .ok()
        .filter(|v: &f64| v.is_finite())
}

fn equal_sets(a: &Lists, b: &Lists) -> bool {
    let set = |l: &Vec<usize>| l.iter().copied().collect::<std::collections::BTreeSet<_>>();
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| set(a) == set(b))
}
