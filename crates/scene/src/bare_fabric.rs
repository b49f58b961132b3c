//! A fabric for a draft that comes alone: distances, yarn and colours from what the draft has,
//! otherwise those of a good cloth of its weave.

use crate::error::{InputError, Result};
use organza_basis::Rgb;
use organza_weave::{Draft, Thread, colour_list};
use std::fmt::Write;

/// Threads of a tile at least, where copies of the draft make it: fewer show that it repeats.
const MIN_THREADS: usize = 20;
/// Colours of threads of drafts that give none, linear: an indigo and undyed cotton, so that the
/// weave is seen.
const WARP: Rgb = Rgb::new(0.026, 0.040, 0.095);
const WEFT: Rgb = Rgb::new(0.60, 0.55, 0.45);
/// What dyed yarn reflects at least and at most, linear (estimated): drafts are coloured on
/// screens, whose black and white no yarn has.
const DYED: [f32; 2] = [0.012, 0.72];

/// Where a draft is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DraftName<'a> {
    /// In a WIF file of this name, beside the fabric.
    Wif(&'a str),
    /// A named weave.
    Weave(&'a str),
}

/// The text of a fabric file for a draft, or for a part of it: first end, first pick, ends,
/// picks.
///
/// # Errors
/// No cloth can be woven from the draft; names it.
pub fn of_draft(name: DraftName<'_>, draft: &Draft, part: Option<[u32; 4]>) -> Result<String> {
    let (key, value) = match name {
        DraftName::Wif(file) => ("wif", file),
        DraftName::Weave(weave) => ("weave", weave),
    };
    let fail = |e: organza_weave::Error| match name {
        DraftName::Wif(file) => InputError::from(e).in_file(file),
        DraftName::Weave(weave) => InputError::new(format!("{weave}: {e}")),
    };
    let sett = draft.sett().map_err(fail)?;
    let mut shown = draft.clone();
    if let Some([end, pick, ends, picks]) = part.map(|p| p.map(|n| n as usize)) {
        shown = draft.part([end, pick], [ends, picks]).map_err(fail)?;
    }
    dye(&mut shown.warp, WARP);
    dye(&mut shown.weft, WEFT);
    let tile = shown.smallest_repeat();
    let has_colours = |threads: &[Thread]| threads.iter().any(|t| t.colour.is_some());
    let guessed: Vec<&str> = [
        (sett.per_cm[0].is_some(), "threads per cm"),
        (true, "yarn"),
        (
            !has_colours(&draft.warp) && !has_colours(&draft.weft),
            "colours",
        ),
    ]
    .iter()
    .filter_map(|(is_so, what)| is_so.then_some(*what))
    .collect();
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    // A name of its own for each, the preset's where there is one.
    let name_of = |yarn: usize| match sett.yarns.len() {
        1 => sett.preset.to_owned(),
        _ => format!("{}-{}", sett.preset, yarn + 1),
    };
    let copies = |threads: usize| MIN_THREADS.div_ceil(threads);
    let mut text = format!(
        "# Cloth for the draft {value}, written by organza. Not in the draft, and chosen so that\n\
         # the cloth is good: {}.\n\n[draft]\n{key} = {}\n",
        guessed.join(", "),
        quoted(value)
    );
    if let Some(part) = part {
        let _ = writeln!(text, "part = {part:?}");
    }
    let _ = write!(
        text,
        "\n[tile]\nrepeats = [{}, {}]\n",
        copies(tile.ends()),
        copies(tile.picks())
    );
    for (i, (system, threads)) in [("warp", &tile.warp), ("weft", &tile.weft)]
        .into_iter()
        .enumerate()
    {
        let colours: Vec<Rgb> = threads.iter().filter_map(|t| t.colour).collect();
        let period = period_of(&colours);
        let yarns: Vec<usize> = threads.iter().map(|t| sett.yarn_of(t)).collect();
        let _ = write!(
            text,
            "\n[{system}]\nyarn = {}\n",
            quoted(&runs(&yarns, &name_of))
        );
        if let Some(per_cm) = sett.per_cm[i] {
            let _ = writeln!(text, "per_cm = {per_cm:?}");
        }
        let _ = write!(
            text,
            "spacing_cv_percent = 3.0\ncolours = {}\n",
            quoted(&colour_list::written(&colours[..period]))
        );
    }
    let shown: Vec<&Thread> = tile.warp.iter().chain(&tile.weft).collect();
    for (i, yarn) in sett.yarns.iter().enumerate() {
        if shown.iter().all(|thread| sett.yarn_of(thread) != i) {
            continue;
        }
        let _ = write!(
            text,
            "\n[yarn.{}]\npreset = {}\nirregularity = {}\ntex = {:?}\naspect = {:?}\n",
            name_of(i),
            quoted(sett.preset),
            quoted(sett.irregularity),
            yarn.tex,
            sett.aspect
        );
        if let Some((radius_um, hairs)) = yarn.thicker {
            let _ = writeln!(
                text,
                "# Thick: few fibres and hairs stand for many.\nfibre_radius_um = {radius_um:?}\n\
                 hairiness = {{ index = {:?}, length_mm = {:?}, reach_mm = {:?}, curl_mm = {:?}, \
                 returning = {:?} }}",
                hairs.index, hairs.length_mm, hairs.reach_mm, hairs.curl_mm, hairs.returning
            );
        }
    }
    Ok(text)
}

/// Threads get the colours of dyed yarn.
fn dye(threads: &mut [Thread], usual: Rgb) {
    let [black, white] = DYED;
    for thread in threads {
        let colour = thread.colour.map(|c| Rgb(c.0 * (white - black) + black));
        thread.colour = Some(colour.unwrap_or(usual));
    }
}

/// The yarns of threads as runs: `2 cotton-1, 1 cotton-2`.
fn runs(yarns: &[usize], name_of: &dyn Fn(usize) -> String) -> String {
    let yarns = &yarns[..period_of(yarns)];
    let runs = yarns.chunk_by(|a, b| a == b).map(|run| match run.len() {
        1 => name_of(run[0]),
        count => format!("{count} {}", name_of(run[0])),
    });
    runs.collect::<Vec<_>>().join(", ")
}

/// After how many values they repeat.
fn period_of<T: PartialEq>(all: &[T]) -> usize {
    let n = all.len();
    let repeats = |d: &usize| n.is_multiple_of(*d) && (*d..n).all(|i| all[i] == all[i - d]);
    (1..n).find(repeats).unwrap_or(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric_file;
    use crate::loader::Loader;
    use std::path::Path;

    /// A plain weave of two ends and two picks with a spacing in centimetres, if any.
    fn plain(spacing_cm: Option<f64>) -> String {
        let spacing = spacing_cm.map_or(String::new(), |cm| {
            format!("Units=centimeters\nSpacing={cm}\n")
        });
        format!(
            "[WIF]\nVersion=1.1\n[WARP]\nThreads=2\n{spacing}[WEFT]\nThreads=2\n{spacing}\
             [THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n"
        )
    }

    #[test]
    fn a_draft_alone_becomes_a_fabric_whose_threads_fit() {
        for spacing in [None, Some(0.05), Some(0.212), Some(0.004)] {
            let wif = plain(spacing);
            let draft = Draft::from_wif(wif.as_bytes()).unwrap();
            let text = of_draft(DraftName::Wif("a.wif"), &draft, None).unwrap();
            let path = Path::new("folder/made.toml");
            let mut loader = Loader::new();
            loader.give(path, text);
            loader.give("folder/a.wif", wif);
            let cloth = fabric_file::load(path, &[], &loader).unwrap();
            let figures = cloth.cloth.figures();
            assert!(figures.cover_factor > 0.7, "{spacing:?}: {figures:?}");
        }
    }
}
