//! Designs that are too large to be woven thread by thread: they are made of blocks.

use organza_weave::{Draft, Error, FabricGeometry, Synthesis, SynthesisSpec};

/// Crossings of a design that is woven as a whole: the relaxation of more takes longer than ten
/// seconds of a processor (estimated), and their fibres more than the memory of most.
const MAX_WHOLE: usize = 1 << 17;
/// Crossings of the exemplar of a large design at most.
const MAX_EXEMPLAR: u32 = 1 << 18;

/// How to make the cloth of blocks if its design is large and blocks can show it. What blocks
/// cannot show of the threads is left out then: distances that vary and threads that wander.
pub(crate) fn blocks(
    geometry: &mut FabricGeometry,
    open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
) -> Option<SynthesisSpec> {
    let spec = &geometry.draft;
    let is_woven = spec.wif.is_some() || spec.drawdown.is_some();
    let is_even = geometry.warp.yarn.len() < 2 && geometry.weft.yarn.len() < 2;
    if !is_woven || !is_even || geometry.pile.is_some() || geometry.nonwoven.is_some() {
        return None;
    }
    // Mistakes are reported by whoever weaves.
    let draft = Draft::of_spec(spec, open).ok()?;
    if draft.ends() * draft.picks() <= MAX_WHOLE {
        return None;
    }
    let repeat = draft.smallest_repeat();
    let [rx, ry] = geometry.tile.repeats.map(|r| r as usize);
    let crossings = (repeat.ends() * repeat.picks()).saturating_mul(rx.saturating_mul(ry));
    if crossings <= MAX_WHOLE {
        return None;
    }
    for threads in [&mut geometry.warp, &mut geometry.weft] {
        threads.spacing_cv_percent = None;
        threads.reed_dents = None;
        threads.wander = None;
    }
    Some(SynthesisSpec::default())
}

/// Allows a larger exemplar if that is what was lacking, and more is allowed.
pub(crate) fn enlarge(spec: &mut SynthesisSpec, error: &Error) -> bool {
    let lacked = matches!(error, Error::Spec { key, .. } if key == "synthesis.exemplar_crossings");
    let may = lacked && spec.exemplar_crossings < MAX_EXEMPLAR;
    if may {
        spec.exemplar_crossings *= 4;
    }
    may
}

/// What to say of it.
pub(crate) fn warning(synthesis: &Synthesis) -> String {
    let (ends, picks) = (synthesis.design.ends(), synthesis.design.picks());
    format!(
        "the design of {ends} x {picks} threads is made of blocks, as [synthesis] does: distances \
         of threads do not vary"
    )
}
