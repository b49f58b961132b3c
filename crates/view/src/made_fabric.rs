//! A fabric for a draft that comes alone: cotton of a count that its threads have room for.

use crate::document::FabricDocument;
use organza_scene::InputError;
use organza_weave::spec::{ThreadSetSpec, YarnSpec};
use organza_weave::{Cloth, Draft, Error, FabricGeometry, Thread};
use std::fmt::Write;
use std::path::Path;
use toml_edit::DocumentMut;

/// The most bytes of a draft that is dropped on the page.
pub const MAX_DRAFT_BYTES: usize = 2 << 20;

/// Crossings of a draft at most: the page weaves it several times to find a count.
const MAX_CROSSINGS: usize = 1 << 18;

/// Threads per centimetre of a draft that gives no spacing: a shirting.
const USUAL_PER_CM: f64 = 24.0;
/// Diameter of the yarn over the spacing of its threads: nearly covered cloth.
const COVER: f64 = 0.85;
/// Mass of a cotton yarn per volume: 1.52 g/cm3 in six tenths of it, as in the preset.
const GRAMS_PER_MM3: f64 = 0.6 * 1.52e-3;
/// What a count is multiplied with while the threads are jammed, and how often.
const FINER: f64 = 0.7;
const MAX_TRIES: usize = 12;

/// A fabric of a draft that is called `wif` beside it. The fabric is on no disk.
///
/// # Errors
/// The bytes are no draft, or no cloth can be woven from it; names the draft.
pub fn of_draft(path: &Path, wif: &str, bytes: &[u8]) -> Result<FabricDocument, InputError> {
    let fail = |why: String| InputError(format!("{wif}: {why}"));
    let draft = Draft::from_wif(bytes).map_err(|e| fail(e.to_string()))?;
    let crossings = draft.ends().saturating_mul(draft.picks());
    if crossings > MAX_CROSSINGS {
        return Err(fail(format!(
            "has {crossings} crossings; without a fabric a draft of at most {MAX_CROSSINGS} can be \
             shown: name it in a fabric file"
        )));
    }
    let [warp, weft] = [&draft.warp, &draft.weft].map(|threads| spacing_mm(threads));
    let usual_mm = 10.0 / USUAL_PER_CM;
    let narrow_mm = warp.unwrap_or(usual_mm).min(weft.unwrap_or(usual_mm));
    let tex = count_that_fits(wif, bytes, narrow_mm, [warp, weft]).map_err(fail)?;
    let mut text = format!(
        "# A fabric that `organza view` made for the draft {wif}. Yarn and count are guesses:\n\
         # cotton that the threads have room for.\n\n[draft]\nwif = {}\n",
        toml_edit::Value::from(wif)
    );
    for (system, spacing) in [("warp", warp), ("weft", weft)] {
        let _ = write!(text, "\n[{system}]\nyarn = \"cotton\"\n");
        if spacing.is_none() {
            let _ = writeln!(text, "per_cm = {USUAL_PER_CM:.1}");
        }
    }
    let _ = write!(
        text,
        "\n[yarn.cotton]\npreset = \"cotton\"\ntex = {tex:.1}\n"
    );
    let text: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| fail(e.to_string()))?;
    Ok(FabricDocument {
        name: crate::document::file_name(path),
        path: path.to_owned(),
        text,
        dropped: None,
        is_changed: true,
    })
}

/// The mean spacing that a draft gives its threads, if it gives any.
fn spacing_mm(threads: &[Thread]) -> Option<f64> {
    let given: Vec<f64> = threads
        .iter()
        .filter_map(|thread| thread.spacing_mm.map(f64::from))
        .collect();
    let sum: f64 = given.iter().sum();
    (!given.is_empty() && sum > 0.0).then(|| sum / given.len() as f64)
}

/// The largest count, in g/km, of those tried for which the threads fit.
fn count_that_fits(
    wif: &str,
    bytes: &[u8],
    spacing_mm: f64,
    spacings: [Option<f64>; 2],
) -> Result<f64, String> {
    let radius_mm = 0.5 * COVER * spacing_mm;
    // Grams per kilometre: a yarn is 1e6 mm long.
    let mut tex = 1e6 * GRAMS_PER_MM3 * std::f64::consts::PI * radius_mm * radius_mm;
    let [warp, weft] = spacings.map(|spacing| ThreadSetSpec {
        yarn: vec!["cotton".into()],
        per_cm: spacing.is_none().then_some(USUAL_PER_CM),
        ..ThreadSetSpec::default()
    });
    let mut geometry = FabricGeometry {
        warp,
        weft,
        ..FabricGeometry::default()
    };
    geometry.draft.wif = Some(wif.to_owned());
    let load = |_: &str| Ok(bytes.to_vec());
    for tries_left in (0..MAX_TRIES).rev() {
        // As it is written.
        tex = ((10.0 * tex).round() / 10.0).clamp(0.1, 1e6);
        let yarn = YarnSpec {
            preset: Some("cotton".into()),
            tex: Some(tex),
            ..YarnSpec::default()
        };
        geometry.yarn.insert("cotton".into(), yarn);
        match Cloth::build(&geometry, &load, 0) {
            Ok(_) => return Ok(tex),
            Err(Error::Jammed(_)) if tries_left > 0 => tex *= FINER,
            Err(e) => return Err(e.to_string()),
        }
    }
    Ok(tex)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let path = Path::new("folder/made.toml");
            let fabric = of_draft(path, "a.wif", wif.as_bytes()).unwrap();
            let mut loader = organza_scene::loader::Loader::new();
            loader.give(path, fabric.text.to_string());
            loader.give("folder/a.wif", wif);
            let cloth = organza_scene::fabric_file::load(path, &[], &loader).unwrap();
            let figures = cloth.cloth.figures();
            assert!(figures.cover_factor > 0.5, "{spacing:?}: {figures:?}");
        }
    }

    #[test]
    fn what_is_no_draft_is_refused_by_name() {
        let wrong = of_draft(Path::new("x.toml"), "cat.wif", b"\x89PNG").unwrap_err();
        assert!(wrong.to_string().starts_with("cat.wif: "), "{wrong}");
    }
}
