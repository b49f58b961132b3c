//! What came of the fit of a shade, in words.

use super::cloth::{Cloth, Place};
use super::target::{Seen, Target, mean, straight_of};
use organza_measure::Measured;
use serde_json::{Value, json};

/// Share of a value up to which it counts as found.
const GOOD: f64 = 0.05;
/// Light below which shares of a value mean nothing.
const LITTLE: f64 = 0.002;

/// One value that was measured, and what the fabric has.
struct Compared {
    name: &'static str,
    is_reflected: bool,
    side: usize,
    measured: f64,
    found: f64,
    se: f64,
}

impl Compared {
    /// How far it is off, as a share.
    fn off(&self) -> f64 {
        (self.found - self.measured) / (self.measured + LITTLE)
    }

    /// Whether it is within the limit, or cannot be told from it.
    fn is_good(&self) -> bool {
        (self.found - self.measured).abs() <= GOOD * self.measured + LITTLE.min(2.0 * self.se)
    }
}

/// The names of the bands in sentences.
pub const LIGHT: &str = "light";
pub const SUN: &str = "sun";

/// The values of a band.
pub struct Verdict {
    band: &'static str,
    /// Of a beam along the normal: what is fitted.
    beam: Vec<Compared>,
    /// Of diffuse light: what follows.
    diffuse: Vec<Compared>,
    straight: Option<[f64; 3]>,
    causes: Vec<String>,
}

impl Verdict {
    /// `band` is its name in sentences.
    pub fn new(band: &'static str, target: &Target, seen: &Seen) -> Verdict {
        let mut beam = Vec::new();
        let mut diffuse = Vec::new();
        for (side, (known, [along, all])) in target.sides.iter().zip(seen).enumerate() {
            let names = [
                ["face", "back"],
                ["light through", "light through from the back"],
            ];
            let add = |list: &mut Vec<Compared>,
                       name,
                       is_reflected,
                       known: Option<[f64; 3]>,
                       found: &Measured| {
                list.extend(known.map(|known| Compared {
                    name,
                    is_reflected,
                    side,
                    measured: mean(known),
                    found: mean(found.mean),
                    se: mean(found.se),
                }));
            };
            add(
                &mut beam,
                names[0][side],
                true,
                known.reflected,
                &along.reflected,
            );
            add(
                &mut beam,
                names[1][side],
                false,
                known.through,
                &along.through,
            );
            add(
                &mut diffuse,
                names[0][side],
                true,
                known.diffuse_reflected,
                &all.reflected,
            );
            add(
                &mut diffuse,
                names[1][side],
                false,
                known.diffuse_through,
                &all.through,
            );
        }
        let [found, se] = straight_of(seen);
        Verdict {
            band,
            beam,
            diffuse,
            straight: target.straight.map(|measured| [measured, found, se]),
            causes: Vec::new(),
        }
    }

    fn is_straight_good(&self) -> bool {
        self.straight.is_none_or(|[measured, found, se]| {
            (found - measured).abs() <= GOOD * measured + LITTLE.min(2.0 * se)
        })
    }

    fn is_good(&self) -> bool {
        self.beam.iter().all(Compared::is_good) && self.is_straight_good()
    }

    /// Says why the fabric cannot have what was measured.
    pub fn explain(&mut self, target: &Target, place: &Place, cloth: &Cloth<'_>) {
        let reflected = target.sides.map(|s| s.reflected.map(mean));
        let sides = || self.beam.iter().filter(|v| v.is_reflected);
        let is_missed = sides().any(|v| !v.is_good());
        let signs: Vec<f64> = sides().map(|v| v.off().signum()).collect();
        if let ([Some(face), Some(back)], true) = (reflected, is_missed) {
            let apart = (face - back).abs() > GOOD * face.max(back);
            let opposite = signs.len() == 2 && signs[0] * signs[1] < 0.0;
            if apart && opposite {
                let why = match cloth.has_two_colours() {
                    true => "the draft shows warp and weft too much alike on both sides",
                    false => "the fabric has one colour for both sides",
                };
                self.causes.push(format!(
                    "the sides were measured as {face:.3} and {back:.3}, but {why}: a draft with one \
                     system on the face, such as a satin, or a coating, could differ so"
                ));
            }
        }
        let [low, high] = cloth.strengths();
        let is_at_a_bound = place.strength <= low + 1e-6 || place.strength >= high - 1e-6;
        let through = self.beam.iter().find(|v| !v.is_reflected && !v.is_good());
        if let (true, Some(value)) = (is_at_a_bound, through) {
            let cause = match value.off() > 0.0 {
                true => {
                    "these yarns let more light through than was measured: thicker ones would not"
                }
                false => {
                    "these yarns hold back more light than was measured: thinner ones would not"
                }
            };
            self.causes.push(cause.into());
        }
        if !self.is_straight_good() {
            let cause = "no width of the yarns leaves gaps as measured: check the threads per \
                         centimetre";
            self.causes.push(cause.into());
        }
        if let [Some(face), Some(back)] = target.sides.map(|s| s.diffuse_through.map(mean))
            && (face - back).abs() > GOOD * face.max(back)
        {
            self.causes.push(format!(
                "the file lets {face:.3} of diffuse light through from the face and {back:.3} from the \
                 back, which are the same for every cloth (reciprocity)"
            ));
        }
        for (sign, word) in [(1.0, "less"), (-1.0, "more")] {
            let all = !signs.is_empty() && signs.iter().all(|s| *s == sign);
            if self.band == SUN && !self.is_good() && all {
                self.causes.push(format!(
                    "the yarns scatter the sun's radiation {word} than light, which a colour of the \
                     fibres alone does not show"
                ));
            }
        }
        if !self.is_good() && self.causes.is_empty() {
            self.causes.push(
                "no colour of the fibres and no number of them gives all of these values at once"
                    .into(),
            );
        }
    }

    /// The sentences.
    pub fn lines(&self) -> Vec<String> {
        let say = |list: &[Compared]| -> String {
            let words: Vec<String> = list.iter().map(words).collect();
            words.join(", ")
        };
        let straight = self.straight.map_or(String::new(), |[measured, found, _]| {
            format!("; straight light {found:.4} for {measured:.4}")
        });
        let grade = if self.is_good() {
            "good"
        } else {
            "not within 5 %"
        };
        let mut lines = vec![
            format!(
                "{}: {}{straight}: {grade}.",
                self.subject(),
                say(&self.beam)
            ),
            format!("Diffuse {}: {}.", self.band, say(&self.diffuse)),
        ];
        lines.extend(self.causes.iter().map(|cause| format!("Note: {cause}.")));
        lines
    }

    fn subject(&self) -> &'static str {
        match self.band {
            SUN => "Under the sun",
            _ => "Along the normal",
        }
    }
}

/// A value as people say it.
fn words(value: &Compared) -> String {
    let percent = (100.0 * value.off()).round();
    let direction = match (value.is_reflected, percent > 0.0) {
        _ if percent == 0.0 => "as measured",
        (true, true) => "too bright",
        (true, false) => "too dark",
        (false, true) => "too much",
        (false, false) => "too little",
    };
    match percent == 0.0 {
        true => format!("{} {direction}", value.name),
        false => format!("{} {:.0} % {direction}", value.name, percent.abs()),
    }
}

/// The same for programs.
pub fn figures(verdicts: &[Verdict]) -> Value {
    let list = |list: &[Compared]| -> Vec<Value> {
        let one = |v: &Compared| {
            let side = ["face", "back"][v.side];
            json!({"side": side, "is_reflected": v.is_reflected,
                "measured": v.measured, "found": v.found, "se": v.se})
        };
        list.iter().map(one).collect()
    };
    let bands = verdicts.iter().map(|v| {
        json!({"band": v.band, "good": v.is_good(), "beam": list(&v.beam),
            "diffuse": list(&v.diffuse), "straight": v.straight, "causes": v.causes})
    });
    json!({"shade": bands.collect::<Vec<_>>()})
}
