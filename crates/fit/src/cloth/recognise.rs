//! The draft of a photographed cloth, by comparison with computed pictures of each that its
//! repeat allows.

use super::Step;
use super::model::{ClothModel, Trial};
use super::pictures::{Effort, pictures};
use super::sides::Side;
use anyhow::Result;
use organza_basis::Stopped;
use organza_photograph::{Likeness, name_of};
use organza_weave::Draft;

/// Shares of the spacing that threads cover, of warp and weft, in the order in which they are
/// tried. Every draft is tried with the first.
const COVERS: [[f64; 2]; 10] = [
    [0.7, 0.7],
    [0.55, 0.55],
    [0.9, 0.9],
    [0.9, 0.7],
    [0.7, 0.9],
    [0.55, 0.75],
    [0.75, 0.55],
    [0.4, 0.4],
    [1.0, 0.6],
    [0.25, 0.25],
];

/// Share of the best likeness that is nearly as good.
const NEARLY: f64 = 0.9;

/// Share of a photograph whose single threads are seen that a weave explains at least, with yarns of any
/// width: knits and noise reach 0.035, cloth 0.1 to 0.4.
pub const HOPELESS: f64 = 0.05;

/// Drafts that are tried with all covers, and the share of the best likeness from which on that may
/// help.
const FINALISTS: usize = 4;
const IN_REACH: f64 = 0.5;

/// By how much more an interlacing without a name must explain than a named weave.
const UNNAMED: f64 = 1.1;

/// How drafts are looked at: each for a moment. Yarns of fewer and thicker fibres look alike from
/// a thread's width away.
pub const LOOK: Effort = Effort {
    threads: 8,
    paths: 20,
    most_fibres: 60.0,
    seed: 1,
};

/// How the best two are compared: what is left between them is little more than the noise of a look.
const COMPARED: usize = 2;
const COMPARE: Effort = Effort {
    threads: 16,
    paths: 40,
    most_fibres: 200.0,
    seed: 2,
};

/// Brightness of white and black threads.
pub const WHITE: f64 = 0.7;
pub const BLACK: f64 = 0.02;

/// Channels do not mix: one picture shows white warp, white weft, and both.
pub const LOOK_COLOURS: [[f64; 3]; 2] = [[WHITE, BLACK, WHITE], [BLACK, WHITE, WHITE]];

/// A draft that the cloth may have.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// One whole repeat.
    pub draft: Draft,
    /// The best likeness of its pictures.
    pub likeness: Likeness,
    /// Values with which it has that likeness.
    pub trial: Trial,
}

/// Compares drafts with the photograph, the best first. `step` is called after each picture. Unless
/// a guess will do, a photograph that no draft explains at all is given up after one picture each.
///
/// # Errors
/// Those of the pictures, if no draft has any.
pub fn recognise(
    model: &ClothModel<'_>,
    side: &Side,
    drafts: Vec<Draft>,
    may_guess: bool,
    step: Step<'_>,
) -> Result<Vec<Candidate>> {
    let mut failure = None;
    let mut list: Vec<Candidate> = Vec::new();
    for draft in drafts {
        // Yarns that do not fit are tried thinner.
        for cover in [0, 1, 7] {
            step()?;
            match look(model, side, &draft, model.tex_of_cover(COVERS[cover])) {
                Ok(found) => {
                    list.push(found);
                    break;
                }
                Err(e) => failure = Some(e),
            }
        }
    }
    if let (true, Some(e)) = (list.is_empty(), failure) {
        return Err(e);
    }
    let better = |a: &Candidate, b: &Candidate| {
        let share = |c: &Candidate| {
            let own = c.likeness.of_photograph;
            match name_of(&c.draft) {
                Some(_) => own,
                None => own / UNNAMED,
            }
        };
        share(b).total_cmp(&share(a))
    };
    list.sort_by(better);
    let is_hopeless = |c: &Candidate| c.likeness.of_photograph < HOPELESS;
    if !may_guess && list.first().is_some_and(is_hopeless) {
        return Ok(list);
    }
    let best = list.first().map_or(0.0, |c| c.likeness.of_photograph);
    let is_near = |c: &&mut Candidate| c.likeness.of_photograph >= IN_REACH * best;
    for candidate in list.iter_mut().take(FINALISTS).filter(is_near) {
        for cover in &COVERS[1..] {
            step()?;
            if let Ok(found) = look(model, side, &candidate.draft, model.tex_of_cover(*cover))
                && found.likeness.of_photograph > candidate.likeness.of_photograph
            {
                *candidate = found;
            }
        }
    }
    list.sort_by(better);
    if list.len() >= COMPARED {
        for candidate in &mut list[..COMPARED] {
            step()?;
            let tex = candidate.trial.tex;
            if let Ok(found) = look_by(COMPARE, model, side, &candidate.draft, tex) {
                *candidate = found;
            }
        }
        list[..COMPARED].sort_by(better);
    }
    Ok(list)
}

/// A candidate with the widest yarns that are nearly as like the photograph: where single threads are
/// not seen widths hardly show, and cloth is rarely open.
///
/// # Errors
/// When `step` has them.
pub fn widest(
    model: &ClothModel<'_>,
    side: &Side,
    candidate: &Candidate,
    step: Step<'_>,
) -> Result<Candidate, Stopped> {
    let mut covers = COVERS;
    let product = |c: &[f64; 2]| c[0] * c[1];
    covers.sort_by(|a, b| product(b).total_cmp(&product(a)));
    for cover in covers {
        step()?;
        let found = look(model, side, &candidate.draft, model.tex_of_cover(cover));
        if let Ok(found) = found
            && found.likeness.of_fold > NEARLY * candidate.likeness.of_fold
        {
            return Ok(found);
        }
    }
    Ok(candidate.clone())
}

/// The likeness of one draft with yarns of some counts.
///
/// # Errors
/// Those of the picture.
pub fn look(
    model: &ClothModel<'_>,
    side: &Side,
    draft: &Draft,
    tex: [f64; 2],
) -> Result<Candidate> {
    look_by(LOOK, model, side, draft, tex)
}

fn look_by(
    effort: Effort,
    model: &ClothModel<'_>,
    side: &Side,
    draft: &Draft,
    tex: [f64; 2],
) -> Result<Candidate> {
    let trial = Trial {
        tex,
        colours: LOOK_COLOURS,
        roughness: model.fitted.start,
        exposure: 1.0,
        lights_deg: [side.view.light_deg; 2],
    };
    let pictures = pictures(model, draft, &trial, std::slice::from_ref(side), effort)?;
    let likeness = Likeness::best(&side.fold, &pictures[0].folded([0.0; 2]));
    let colour = |k: usize| -> [f64; 3] {
        std::array::from_fn(|c| (WHITE * likeness.weights[c][k]).clamp(BLACK, 0.9))
    };
    Ok(Candidate {
        draft: draft.clone(),
        likeness,
        trial: Trial {
            colours: [colour(0), colour(1)],
            ..trial
        },
    })
}
