//! What every choice costs and how far off it is, fabric by fabric and view by
//! view: measured by `organza bench`, kept as a table, used by `model =
//! "auto"`.

use super::choice::Choice;
use super::lit::Lit;
use crate::fabric_file::Fabric;
use crate::representation::EXPLICIT_FIBRES;
use organza_basis::Rgb;
use organza_measure::{Cost, Figure};
use serde::Serialize;

/// The properties by which fabrics are compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Traits {
    /// The narrower spacing of threads.
    pub spacing_mm: f64,
    /// Share of the surface that no thread covers.
    pub openness: f64,
    /// Mean single-scattering albedo of its fibres, as luminance.
    pub albedo: f64,
    /// Mean fibre radius.
    pub fibre_um: f64,
}

impl Traits {
    /// Of a fabric.
    pub fn of(fabric: &Fabric) -> Traits {
        let figures = fabric.cloth.figures();
        let materials = fabric.cloth.materials();
        let count = materials.len().max(1) as f64;
        let luminance = |c: Rgb| f64::from(0.2126 * c.0.x + 0.7152 * c.0.y + 0.0722 * c.0.z);
        let albedo = fabric
            .flake_optics()
            .iter()
            .map(|o| luminance(o.albedo))
            .sum::<f64>()
            / count;
        let radius_mm: f64 = materials.iter().map(|m| f64::from(m.fibre_radius_mm)).sum();
        let per_cm =
            |s: &Option<organza_weave::SystemFigures>| s.as_ref().map(|s| s.threads_per_cm);
        let denser = [
            per_cm(&figures.warp),
            per_cm(&figures.weft),
            figures.wales_per_cm,
        ];
        let min_mm = figures.tile_mm[0].min(figures.tile_mm[1]);
        let densest = denser.into_iter().flatten().fold(10.0 / min_mm, f64::max);
        Traits {
            spacing_mm: 10.0 / densest,
            openness: 1.0 - figures.cover_factor,
            albedo,
            fibre_um: 1e3 * radius_mm / count,
        }
    }

    /// Whether these are, but for rounding in the table, those of a fabric.
    pub fn is_of(&self, fabric: &Traits) -> bool {
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-3 * b.abs().max(0.1);
        same(self.spacing_mm, fabric.spacing_mm)
            && same(self.openness, fabric.openness)
            && same(self.albedo, fabric.albedo)
            && same(self.fibre_um, fabric.fibre_um)
    }

    /// What the distance between fabrics is made of: openness, albedo, and the
    /// logarithm of how many fibres wide a spacing is.
    fn coordinates(&self) -> [f64; 3] {
        let fibres = self.spacing_mm * 1e3 / self.fibre_um.max(1e-3);
        [self.openness, self.albedo, fibres.max(1e-3).ln()]
    }
}

/// One choice in one view of one fabric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the fabric.
    pub fabric: String,
    /// What the fabric is like.
    pub traits: Traits,
    /// Width of a pixel on the cloth.
    pub pixel_mm: f64,
    /// Where light comes from.
    pub lit: Lit,
    /// What was tried.
    pub choice: Choice,
    /// Noise-free error of a pixel, as a share of the picture's mean.
    pub rmse: Figure,
    /// Error of the mean, as a share of it.
    pub bias: Figure,
    /// Time and memory.
    pub cost: Cost,
}

impl Row {
    /// Whether its numbers are such as a bench measures.
    pub(super) fn is_possible(&self) -> bool {
        let t = &self.traits;
        let positive = [t.spacing_mm, t.fibre_um, self.pixel_mm];
        let others = [t.openness, t.albedo];
        let costs = [self.cost.setup_s, self.cost.noise_s];
        let errors = [&self.rmse, &self.bias].map(|f| [f.low, f.value, f.high]);
        let finite = |x: &f64| x.abs() < 1e12;
        let scale = self.choice.voxel_scale;
        positive.iter().all(|x| *x > 0.0 && finite(x))
            && costs.iter().all(|x| *x >= 0.0 && finite(x))
            && others.iter().chain(errors.as_flattened()).all(finite)
            && self.rmse.high >= 0.0
            && (1e-3..=1e3).contains(&scale)
    }
}

/// What is known of a choice for everything that a view asks for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// What is chosen.
    pub choice: Choice,
    /// The largest of its errors.
    pub rmse: Figure,
    /// The largest of its costs.
    pub cost: Cost,
}

/// What to take, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recommendation {
    /// The choice with its errors and costs.
    pub taken: Candidate,
    /// Seconds until the picture is within the tolerance; none when nothing
    /// gets there and the least wrong was taken.
    pub seconds: Option<f64>,
    /// Seconds that explicit fibres take, with the faster of their trackers.
    pub fibres_s: Option<f64>,
}

/// The fastest of some candidates whose error, of model and noise together, is
/// known to get down to `tolerance`: with the upper end of the model's error. The
/// least wrong one when none does. Explicit fibres, whose model has no error,
/// stand for the truth in `fibres_s`.
pub fn recommend(candidates: &[Candidate], tolerance: f64) -> Option<Recommendation> {
    let seconds = |c: &Candidate| c.cost.seconds_within(tolerance, c.rmse.high);
    let fibres = candidates
        .iter()
        .filter(|c| c.choice.model == &EXPLICIT_FIBRES);
    let reaching = candidates.iter().filter_map(|c| Some((c, seconds(c)?)));
    let fastest = reaching.min_by(|a, b| a.1.total_cmp(&b.1));
    let least = || {
        candidates
            .iter()
            .min_by(|a, b| a.rmse.value.total_cmp(&b.rmse.value))
    };
    let taken = fastest.map(|f| f.0).or_else(least)?;
    Some(Recommendation {
        taken: taken.clone(),
        seconds: fastest.map(|f| f.1),
        fibres_s: fibres.filter_map(seconds).min_by(f64::total_cmp),
    })
}

/// The candidates of one fabric for pixels of one width, lit from some sides:
/// choices that were measured for all of them.
pub fn candidates<'a>(rows: impl Iterator<Item = &'a Row>, lit: &[Lit]) -> Vec<Candidate> {
    let mut list: Vec<(Candidate, usize)> = Vec::new();
    for row in rows.filter(|r| lit.contains(&r.lit)) {
        match list.iter_mut().find(|(c, _)| c.choice == row.choice) {
            None => list.push((
                Candidate {
                    choice: row.choice,
                    rmse: row.rmse,
                    cost: row.cost,
                },
                1,
            )),
            Some((c, count)) => {
                *count += 1;
                if row.rmse.high > c.rmse.high {
                    c.rmse = row.rmse;
                }
                c.cost.setup_s = c.cost.setup_s.max(row.cost.setup_s);
                c.cost.noise_s = c.cost.noise_s.max(row.cost.noise_s);
                c.cost.memory_bytes = c.cost.memory_bytes.max(row.cost.memory_bytes);
            }
        }
    }
    list.into_iter()
        .filter(|(_, count)| *count == lit.len())
        .map(|(c, _)| c)
        .collect()
}

/// The measured fabric that is most like one, and the measured width of a pixel
/// that is, in spacings of threads, nearest to `pixel_mm`.
///
/// Likeness is the distance in openness, albedo and the logarithm of the number
/// of fibre radii to a spacing, each in units of its standard deviation over the
/// measured fabrics.
pub fn nearest<'a>(rows: &'a [Row], traits: &Traits, pixel_mm: f64) -> Option<&'a Row> {
    let mut fabrics: Vec<&Row> = Vec::new();
    for row in rows {
        if fabrics.iter().all(|f| f.fabric != row.fabric) {
            fabrics.push(row);
        }
    }
    let n = fabrics.len() as f64;
    let all = || fabrics.iter().map(|f| f.traits.coordinates());
    let spread: [f64; 3] = std::array::from_fn(|k| {
        let mean = all().map(|c| c[k]).sum::<f64>() / n;
        (all().map(|c| (c[k] - mean).powi(2)).sum::<f64>() / n)
            .sqrt()
            .max(1e-6)
    });
    let own = traits.coordinates();
    let distance = |t: &Traits| {
        let c = t.coordinates();
        (0..3)
            .map(|k| ((c[k] - own[k]) / spread[k]).powi(2))
            .sum::<f64>()
    };
    let like = fabrics
        .iter()
        .min_by(|a, b| distance(&a.traits).total_cmp(&distance(&b.traits)))?;
    let wanted = (pixel_mm.max(1e-6) / traits.spacing_mm).ln();
    let off = |r: &Row| ((r.pixel_mm / r.traits.spacing_mm).ln() - wanted).abs();
    rows.iter()
        .filter(|r| r.fabric == like.fabric)
        .min_by(|a, b| off(a).total_cmp(&off(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::representation::{MICROFLAKE, PACKED, Representation, Tracker};

    fn figure(value: f64) -> Figure {
        Figure {
            value,
            low: value,
            high: value,
        }
    }

    fn of(
        fabric: &str,
        pixel_mm: f64,
        lit: Lit,
        model: &'static Representation,
        rmse: f64,
        noise_s: f64,
    ) -> Row {
        let dark = fabric == "dark";
        Row {
            fabric: fabric.into(),
            traits: Traits {
                spacing_mm: if dark { 0.4 } else { 0.2 },
                openness: if dark { 0.1 } else { 0.5 },
                albedo: if dark { 0.2 } else { 0.9 },
                fibre_um: 6.0,
            },
            pixel_mm,
            lit,
            choice: Choice::of(model, Tracker::Woodcock),
            rmse: figure(rmse),
            bias: figure(0.0),
            cost: Cost {
                setup_s: 1.0,
                noise_s,
                memory_bytes: 1 << 20,
            },
        }
    }

    fn rows() -> Vec<Row> {
        let mut list = Vec::new();
        for fabric in ["dark", "light"] {
            for pixel_mm in [0.1, 1.0] {
                for lit in Lit::ALL {
                    let worse = if lit == Lit::Back { 2.0 } else { 1.0 };
                    list.push(of(fabric, pixel_mm, lit, &EXPLICIT_FIBRES, 0.0, 0.1));
                    list.push(of(fabric, pixel_mm, lit, &PACKED, 0.01 * worse, 0.02));
                    list.push(of(fabric, pixel_mm, lit, &MICROFLAKE, 0.05 * worse, 0.001));
                }
            }
        }
        list
    }

    #[test]
    fn the_fastest_within_the_tolerance_is_taken_and_else_the_least_wrong() {
        let rows = rows();
        let take = |lit: &[Lit], tolerance: f64, without: Option<&'static Representation>| {
            let wanted = rows.iter().filter(|r| {
                r.fabric == "dark" && r.pixel_mm == 0.1 && Some(r.choice.model) != without
            });
            recommend(&candidates(wanted, lit), tolerance).unwrap()
        };
        let front = take(&[Lit::Front], 0.06, None);
        assert_eq!(front.taken.choice.model, &MICROFLAKE);
        let expected = 1.0 + 0.001 / (0.06f64.powi(2) - 0.05f64.powi(2));
        assert!((front.seconds.unwrap() - expected).abs() < 4.0 * f64::EPSILON);
        assert!((front.fibres_s.unwrap() - (1.0 + 0.1 / 0.0036)).abs() < 4.0 * f64::EPSILON);
        // Light from behind as well asks for what is right there too.
        assert_eq!(take(&Lit::ALL, 0.06, None).taken.choice.model, &PACKED);
        assert_eq!(
            take(&[Lit::Front], 0.005, None).taken.choice.model,
            &EXPLICIT_FIBRES
        );
        let none = take(&[Lit::Front], 0.005, Some(&EXPLICIT_FIBRES));
        assert_eq!((none.taken.choice.model, none.seconds), (&PACKED, None));
        assert_eq!(recommend(&[], 0.1), None);
    }

    #[test]
    fn fabrics_and_distances_are_taken_by_what_they_are_like() {
        let rows = rows();
        let like = |spacing_mm, openness, albedo, pixel_mm| {
            let traits = Traits {
                spacing_mm,
                openness,
                albedo,
                fibre_um: 6.0,
            };
            let row = nearest(&rows, &traits, pixel_mm).unwrap();
            (row.fabric.clone(), row.pixel_mm)
        };
        assert_eq!(like(0.4, 0.1, 0.2, 0.1), ("dark".into(), 0.1));
        assert_eq!(like(0.2, 0.5, 0.9, 5.0), ("light".into(), 1.0));
        // Ten times as coarse: a pixel of 1 mm shows as much as one of 0.1 mm.
        assert_eq!(like(4.0, 0.1, 0.2, 1.0).1, 0.1);
    }
}
