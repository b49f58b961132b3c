//! Named weaves.

use crate::error::did_you_mean;
use crate::{Draft, Error};

const FORMS: [&str; 10] = [
    "plain",
    "twill-3-1-s",
    "satin-8-3",
    "sateen-8-3",
    "basket-2-2",
    "herringbone-2-2-8",
    "warp-rib-2",
    "weft-rib-2",
    "double-plain-8-8",
    "weft-backed-8-3",
];

impl Draft {
    /// A weave by name.
    ///
    /// | name | weave |
    /// |---|---|
    /// | `plain` | over one, under one |
    /// | `twill-U-D[-U-D..][-s\|-z]` | each end over U picks and under D, the next end one pick later; lines rise to the right (z, the default) or to the left (s) |
    /// | `satin-N[-M]` | warp-faced, one binding point in N, M picks further on each end |
    /// | `sateen-N[-M]` | the same, weft-faced |
    /// | `basket-E[-P]` | plain weave of E ends and P picks as one |
    /// | `herringbone[-U-D[-W]]` | twill that turns after W ends with a clean break |
    /// | `warp-rib-P` | P picks in one shed |
    /// | `weft-rib-E` | E ends side by side weave as one |
    /// | `double-plain[-E[-P]]` | two plain weaves, one over the other, of alternate ends and picks; they change places after E ends and P picks of each |
    /// | `weft-backed-N[-M]` | the sateen `N-M` on both sides, of alternate picks |
    ///
    /// # Errors
    /// When the name is unknown or its numbers do not make a weave.
    pub fn named(name: &str) -> Result<Draft, Error> {
        let wrong = |message: String| Error::spec("draft.weave", message);
        let lower = name.trim().to_lowercase();
        let parts: Vec<&str> = lower.split('-').collect();
        let words = parts
            .iter()
            .take_while(|p| p.parse::<usize>().is_err())
            .count();
        let (family, rest) = (parts[..words].join("-"), &parts[words..]);
        let (rest, turn) = match rest.split_last() {
            Some((&"s", front)) => (front, Some(Turn::S)),
            Some((&"z", front)) => (front, Some(Turn::Z)),
            _ => (rest, None),
        };
        let numbers: Vec<usize> = rest
            .iter()
            .map(|p| p.parse::<usize>().ok().filter(|n| (1..=1024).contains(n)))
            .collect::<Option<_>>()
            .ok_or_else(|| {
                let side = match rest.last() {
                    Some(last) if family == "twill" && last.parse::<usize>().is_err() => {
                        ", and s or z at the end for the side to which the lines rise"
                    }
                    _ => "",
                };
                wrong(format!(
                    "\"{name}\": expected numbers from 1 to 1024 separated by -{side}"
                ))
            })?;
        let known = FORMS.iter().any(|f| {
            f.strip_prefix(&family)
                .is_some_and(|r| r.is_empty() || r.starts_with('-'))
        });
        if turn.is_some() && known && family != "twill" {
            return Err(wrong(format!("\"{name}\": only a twill runs s or z")));
        }
        let mut draft = match (family.as_str(), numbers.as_slice()) {
            ("plain", []) => Draft::from_fn(2, 2, |e, p| (e + p).is_multiple_of(2)),
            ("twill", runs) if runs.len() >= 2 && runs.len().is_multiple_of(2) => {
                let line = twill_line(runs);
                let n = line.len();
                Draft::from_fn(n, n, |e, p| match turn {
                    Some(Turn::S) => line[(p + e) % n],
                    _ => line[(p + n - e) % n],
                })
            }
            ("satin", &[n]) => satin(name, n, None, true),
            ("satin", &[n, m]) => satin(name, n, Some(m), true),
            ("sateen", &[n]) => satin(name, n, None, false),
            ("sateen", &[n, m]) => satin(name, n, Some(m), false),
            ("basket", &[n]) => blocks(n, n),
            ("basket", &[e, p]) => blocks(e, p),
            ("warp-rib", &[p]) => blocks(1, p),
            ("weft-rib", &[e]) => blocks(e, 1),
            ("double-plain", []) => double_plain(None),
            ("double-plain", &[n]) => double_plain(Some([n, n])),
            ("double-plain", &[e, p]) => double_plain(Some([e, p])),
            ("weft-backed", &[n]) => weft_backed(name, n, None),
            ("weft-backed", &[n, m]) => weft_backed(name, n, Some(m)),
            ("herringbone", []) => herringbone(&[2, 2], 8),
            ("herringbone", &[u, d]) => herringbone(&[u, d], 2 * (u + d)),
            ("herringbone", &[u, d, w]) => herringbone(&[u, d], w),
            _ => Err(wrong(format!(
                "no weave is called \"{name}\"{}; expected {}",
                nearest(&lower, &family),
                FORMS.join(", ")
            ))),
        }?;
        draft.title = lower;
        Ok(draft)
    }
}

/// The nearest weave: another family with the same numbers, if that is one, or a form.
fn nearest(name: &str, family: &str) -> String {
    let families = FORMS.map(|f| f.split(|c: char| c.is_ascii_digit()).next().unwrap_or(f));
    let families = families.map(|f| f.trim_end_matches('-'));
    let rest = name.strip_prefix(family).unwrap_or_default();
    let better = organza_basis::nearest_name(family, families)
        .filter(|f| *f != family)
        .map(|f| format!("{f}{rest}"))
        .filter(|whole| Draft::named(whole).is_ok());
    match better {
        Some(whole) => format!("; did you mean \"{whole}\"?"),
        None => did_you_mean(name, FORMS),
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Turn {
    S,
    Z,
}

fn twill_line(runs: &[usize]) -> Vec<bool> {
    runs.iter()
        .enumerate()
        .flat_map(|(i, &n)| std::iter::repeat_n(i.is_multiple_of(2), n))
        .collect()
}

/// Binding points that lie a step of picks apart from one end to the next.
fn satin(name: &str, n: usize, step: Option<usize>, warp_faced: bool) -> Result<Draft, Error> {
    let step = satin_step(name, n, step)?;
    Draft::from_fn(n, n, |e, p| ((e * step) % n == p) != warp_faced)
}

/// The sateen on the face, of the even picks, and on the back, of the odd ones, which are bound
/// where the floats of the face hide it.
fn weft_backed(name: &str, n: usize, step: Option<usize>) -> Result<Draft, Error> {
    let step = satin_step(name, n, step)?;
    Draft::from_fn(n, 2 * n, |e, p| {
        let place = (e * step) % n;
        match p % 2 {
            0 => place == p / 2,
            _ => place != (p / 2 + n.div_ceil(2)) % n,
        }
    })
}

/// Two plain weaves of alternate ends and picks. Those of even number lie above where the
/// numbers of the blocks along both add up to an even one.
fn double_plain(block: Option<[usize; 2]>) -> Result<Draft, Error> {
    let [ends, picks] = block.unwrap_or([1, 1]).map(|n| 4 * n);
    Draft::from_fn(ends, picks, |e, p| {
        let (i, j) = (e / 2, p / 2);
        let above = block.map_or(0, |[ends, picks]| (i / ends + j / picks) % 2);
        if e % 2 == p % 2 {
            (i + j).is_multiple_of(2)
        } else {
            e % 2 == above
        }
    })
}

/// The step of a satin: the default is the one nearest to the golden section of the repeat,
/// which scatters the points best.
fn satin_step(name: &str, n: usize, step: Option<usize>) -> Result<usize, Error> {
    let good = |m: usize| m > 1 && m + 1 < n && gcd(m, n) == 1;
    let golden = 0.381_966 * n as f64;
    let step = match step {
        Some(m) => Some(m).filter(|&m| good(m)),
        None => (2..n).filter(|&m| good(m)).min_by(|&a, &b| {
            (a as f64 - golden)
                .abs()
                .total_cmp(&(b as f64 - golden).abs())
        }),
    };
    step.ok_or_else(|| {
        let steps: Vec<String> = (2..n).filter(|&m| good(m)).map(|m| m.to_string()).collect();
        let expected = if steps.is_empty() {
            format!("there is no satin over {n} ends")
        } else {
            format!("a satin over {n} ends steps by {}", steps.join(", "))
        };
        Error::spec("draft.weave", format!("\"{name}\": {expected}"))
    })
}

fn blocks(ends: usize, picks: usize) -> Result<Draft, Error> {
    Draft::from_fn(2 * ends, 2 * picks, |e, p| {
        (e / ends + p / picks).is_multiple_of(2)
    })
}

/// A twill rising to the right over `width` ends and to the left over the
/// next; half a repeat of offset makes every end at the break the complement
/// of its neighbour when the twill is balanced.
fn herringbone(runs: &[usize], width: usize) -> Result<Draft, Error> {
    let line = twill_line(runs);
    let n = line.len();
    let offset = n / 2 + n * width - (width - 1);
    Draft::from_fn(2 * width, n, |e, p| {
        if e < width {
            line[(p + n * width - e) % n]
        } else {
            line[(p + e - width + offset) % n]
        }
    })
}

pub(crate) fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(name: &str) -> String {
        Draft::named(name).unwrap().drawdown()
    }

    #[test]
    fn named_weaves_are_what_textile_books_draw() {
        assert_eq!(rows("plain"), ".X\nX.\n");
        assert_eq!(rows("twill-2-1-s"), ".XX\nX.X\nXX.\n");
        assert_eq!(rows("twill-2-2-z"), "..XX\n.XX.\nXX..\nX..X\n");
        assert_eq!(rows("basket-2-2"), "..XX\n..XX\nXX..\nXX..\n");
        assert_eq!(rows("warp-rib-2"), ".X\n.X\nX.\nX.\n");
        assert_eq!(rows("double-plain"), "X.XX\n..X.\nXXX.\nX...\n");
        let backed = rows("weft-backed-5-2");
        assert_eq!(
            backed.lines().rev().take(3).collect::<Vec<_>>(),
            ["X....", "XXXX.", "...X."]
        );
        for (name, floats) in [("satin-8-3", (7, 1)), ("sateen-5-2", (1, 4))] {
            let f = Draft::named(name).unwrap().floats();
            assert_eq!((f.warp_face, f.warp_back), floats, "{name}");
        }
    }

    #[test]
    fn twill_lines_rise_to_the_side_that_the_name_says() {
        let (z, s) = (
            Draft::named("twill-3-1").unwrap(),
            Draft::named("twill-3-1-s").unwrap(),
        );
        for i in 0..4 {
            assert!(
                !z.warp_up(i, 3 + i),
                "z: a binding point goes up to the right"
            );
            assert!(!s.warp_up(i, 7 - i), "s: and to the left");
        }
        assert_eq!(z.floats().warp_face, 3);
    }

    #[test]
    fn a_herringbone_breaks_clean() {
        let d = Draft::named("herringbone").unwrap();
        assert_eq!((d.ends(), d.picks()), (16, 4));
        for p in 0..4 {
            assert_ne!(d.warp_up(7, p), d.warp_up(8, p));
            assert_ne!(d.warp_up(15, p), d.warp_up(16, p));
        }
        assert_eq!(d.floats().warp_share, 0.5);
    }

    #[test]
    fn every_satin_binds_once_a_thread() {
        for n in 5..40usize {
            if n == 6 {
                continue;
            }
            let d = Draft::named(&format!("satin-{n}")).unwrap();
            for e in 0..n {
                assert_eq!((0..n).filter(|&p| !d.warp_up(e, p)).count(), 1);
                assert_eq!((0..n).filter(|&p| !d.warp_up(p, e)).count(), 1);
            }
        }
    }

    #[test]
    fn wrong_names_are_answered_with_the_nearest() {
        for (name, message) in [
            ("plane", "did you mean \"plain\""),
            ("twil-2-2", "did you mean \"twill-2-2\""),
            ("twil-2-1-1-2-s", "did you mean \"twill-2-1-1-2-s\""),
            ("heringbone", "did you mean \"herringbone\""),
            ("satin-6", "there is no satin over 6 ends"),
            ("satin-8-4", "steps by 3, 5"),
            ("twill-3", "no weave is called"),
            ("twill-0-1", "numbers from 1 to 1024"),
            ("twill-3-1-x", "s or z at the end"),
            ("plain-s", "no weave is called"),
            ("doubel-plain-4", "did you mean \"double-plain-4\""),
            ("weft-backed-6", "there is no satin over 6 ends"),
            ("basket-2-s", "only a twill"),
            ("", "no weave is called"),
            ("twill-99999999999999999999-1", "no weave is called"),
        ] {
            let error = Draft::named(name).unwrap_err().to_string();
            assert!(error.contains(message), "{name}: {error}");
        }
    }
}
