//! The surface model that a list of measured pairs asks for.
//!
//! The model is linear in its colours: for every shape of the yarns they come
//! from non-negative least squares, and only the shape is searched for. What
//! pairs of a whole patch cannot tell apart, the diffuse colours of warp and
//! weft, keeps the proportion that it had; so does the width of the forward
//! transmission.

use crate::PairValue;
use crate::fit::{Bound, Determined, Patience, determine, non_negative, search};
use organza_basis::Rgb;
use organza_surface::spec::{TransmissionSpec, YarnSpec};
use organza_surface::{Footprint, SurfaceModel, SurfaceSpec, WovenSurface};
use rayon::prelude::*;

/// A fitted surface.
#[derive(Clone, Debug)]
pub struct FittedSurface {
    /// The whole section, without preset.
    pub spec: SurfaceSpec,
    /// Every parameter with what the data says of it.
    pub parameters: Vec<Determined>,
    /// Root mean square of the weighted residuals: about one tenth of it is a
    /// relative error.
    pub residual: f64,
}

/// Remembers the costs of places, so that a search can go on.
pub trait Journal {
    /// The cost of a place that was looked at before.
    fn recall(&self, place: &[f64]) -> Option<f64>;
    /// Keeps one.
    fn keep(&mut self, place: &[f64], cost: f64);
}

/// Why there is no fit.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Nothing to fit to.
    #[error("the data has no pair with light and exitant direction on the face")]
    NoReflection,
    /// The start is no surface.
    #[error("{0}")]
    Surface(#[from] organza_surface::Error),
    /// What the optimiser says.
    #[error("the search failed: {0}")]
    Search(String),
}

/// Share of a value that the model is not expected to know: what pairs weigh
/// is their relative error once noise is below it.
const RELATIVE_WEIGHT: f64 = 0.1;

/// Share of the mean value below which errors count absolutely.
const FLOOR: f64 = 0.02;

/// Level of a component in the models that are evaluated: low enough that the
/// energy bound has nothing to do.
const LEVEL: f32 = 0.25;

const RED: Rgb = Rgb::new(LEVEL, 0.0, 0.0);
const GREEN: Rgb = Rgb::new(0.0, LEVEL, 0.0);
const BLUE: Rgb = Rgb::new(0.0, 0.0, LEVEL);

/// Diffuse light of both yarns, highlights of warp and weft, two kinds of
/// transmission.
const COMPONENTS: usize = 5;

/// Fits a surface, starting from a complete section.
///
/// # Errors
/// See [`FitError`].
pub fn fit_surface(
    start: &SurfaceSpec,
    data: &[PairValue],
    patience: &Patience,
    journal: &mut dyn Journal,
    watch: &mut dyn FnMut(f64),
) -> Result<FittedSurface, FitError> {
    let start = SurfaceSpec {
        accuracy: Some(0.01),
        noise: None,
        ..start.clone().resolved()?
    };
    let is_front =
        |v: &PairValue| v.pair.incident.theta_deg < 90.0 && v.pair.exitant.theta_deg < 90.0;
    if !data.iter().any(is_front) {
        return Err(FitError::NoReflection);
    }
    let problem = Problem::new(&start, data)?;
    let bounds = problem.bounds();
    let mut cost = |place: &[f64]| {
        let known = journal.recall(place);
        let cost = known.unwrap_or_else(|| {
            let cost = problem.solve(place).map_or(f64::MAX, |s| s.1);
            journal.keep(place, cost);
            cost
        });
        watch(cost);
        cost
    };
    let (place, _) = search(&bounds, patience, &mut cost).map_err(FitError::Search)?;
    let (colours, cost) = problem
        .solve(&place)
        .ok_or_else(|| FitError::Search("the best place is no surface".into()))?;
    let spec = problem.spec(&place, &colours);
    let parameters = problem.determined(&bounds, &place, &colours, cost);
    Ok(FittedSurface {
        spec: buildable(spec)?,
        parameters,
        residual: (cost / (3 * data.len()) as f64).sqrt(),
    })
}

/// The same with colours lowered until the cloth gives back no more light than
/// it gets.
fn buildable(mut spec: SurfaceSpec) -> Result<SurfaceSpec, FitError> {
    for _ in 0..100 {
        match spec.clone().build() {
            Ok(_) => return Ok(spec),
            Err(organza_surface::Error::Energy { .. }) => {
                let lower = |c: &mut Option<Rgb>| *c = c.map(|c| c * 0.98);
                for yarn in [&mut spec.warp, &mut spec.weft] {
                    lower(&mut yarn.diffuse);
                    lower(&mut yarn.specular);
                }
                if let Some(t) = &mut spec.transmission {
                    t.diffuse *= 0.98;
                    t.forward *= 0.98;
                }
            }
            Err(e) => return Err(e.into()),
        }
    }
    Ok(spec)
}

struct Problem<'a> {
    start: &'a SurfaceSpec,
    data: &'a [PairValue],
    /// One over the expected error, per pair and channel.
    weights: Vec<[f64; 3]>,
    /// Share of the diffuse light of each channel that warp and weft have.
    diffuse: [[f64; 3]; 2],
    has_transmission: bool,
    /// What does not depend on the shape of the yarns, per pair: diffuse light
    /// of warp and weft, then both kinds of transmission, for unit colours.
    still: Vec<[f64; 4]>,
}

/// Colours per channel and component.
type Colours = [[f64; COMPONENTS]; 3];

impl<'a> Problem<'a> {
    fn new(start: &'a SurfaceSpec, data: &'a [PairValue]) -> Result<Problem<'a>, FitError> {
        let count = (3 * data.len()).max(1) as f64;
        let total: f64 = data.iter().flat_map(|v| v.bsdf.mean).sum();
        let floor = FLOOR * total / count;
        let weight = |v: &PairValue| {
            std::array::from_fn(|c| {
                let (mean, se) = (v.bsdf.mean[c], v.bsdf.se[c]);
                1.0 / (se * se + (RELATIVE_WEIGHT * mean).powi(2) + floor * floor).sqrt()
            })
        };
        let own = |y: &YarnSpec| {
            let colour = y.diffuse.unwrap_or(Rgb::WHITE).0.to_array();
            colour.map(|c| f64::from(c).max(1e-3))
        };
        let (warp, weft) = (own(&start.warp), own(&start.weft));
        let share = |a: [f64; 3]| std::array::from_fn(|c| a[c] / warp[c].max(weft[c]));
        let crosses =
            |v: &PairValue| (v.pair.incident.theta_deg < 90.0) != (v.pair.exitant.theta_deg < 90.0);
        let mut problem = Problem {
            start,
            data,
            weights: data.iter().map(weight).collect(),
            diffuse: [share(warp), share(weft)],
            has_transmission: data.iter().any(crosses),
            still: Vec::new(),
        };
        let place: Vec<f64> = problem.bounds().iter().map(|b| b.start).collect();
        let shape = problem.shape(&place);
        let [mut warp, mut weft] = [shape.clone(), shape];
        warp.warp.diffuse = Some(RED);
        weft.weft.diffuse = Some(RED);
        if let Some(t) = &mut weft.transmission {
            (t.diffuse, t.forward) = (GREEN, BLUE);
        }
        let (warp, weft) = (
            problem.values(&warp.build()?),
            problem.values(&weft.build()?),
        );
        let all = warp.into_iter().zip(weft);
        problem.still = all.map(|([w, _, _], [f, d, a])| [w, f, d, a]).collect();
        Ok(problem)
    }

    /// Values of a model at all pairs, for colours of one.
    fn values(&self, model: &WovenSurface) -> Vec<[f64; 3]> {
        let value = |v: &PairValue| {
            let w_i = v.pair.incident.direction();
            let w_o = v.pair.exitant.direction();
            let value = model.eval(w_i, w_o, Footprint::FAR).0.to_array();
            value.map(|x| f64::from(x / LEVEL))
        };
        self.data.par_iter().map(value).collect()
    }

    fn bounds(&self) -> Vec<Bound> {
        let mut list = Vec::new();
        for (yarn, spec) in [("warp", &self.start.warp), ("weft", &self.start.weft)] {
            let mut add = |key: &str, low: f64, high: f64, start: Option<f64>| {
                list.push(Bound {
                    name: format!("{yarn}.{key}"),
                    low,
                    high,
                    start: start.unwrap_or(0.5 * (low + high)).clamp(low, high),
                });
            };
            add("u_max_deg", 3.0, 75.0, spec.u_max_deg);
            let psi = spec.psi_deg.unwrap_or(0.0);
            if psi == 0.0 {
                add("smoothing", 0.0, 1.0, spec.smoothing);
            } else {
                add("psi_deg", 3.0, 75.0, Some(psi.abs()));
            }
            add("kappa", -0.95, 5.0, spec.kappa);
            add("alpha", 0.0, 0.5, spec.alpha);
            add("beta", 0.0, 15.0, spec.beta);
        }
        list
    }

    /// The section at a place, with colours to come.
    fn shape(&self, place: &[f64]) -> SurfaceSpec {
        let mut next = place.iter().copied();
        let mut next = || next.next().unwrap_or_default();
        let mut spec = self.start.clone();
        for yarn in [&mut spec.warp, &mut spec.weft] {
            yarn.u_max_deg = Some(next());
            let psi = yarn.psi_deg.unwrap_or(0.0);
            if psi == 0.0 {
                yarn.smoothing = Some(next());
            } else {
                yarn.psi_deg = Some(psi.signum() * next());
            }
            yarn.kappa = Some(next());
            yarn.alpha = Some(next());
            yarn.beta = Some(next());
            yarn.fit = Some(organza_surface::segment::Fit::Narrow);
            yarn.diffuse = Some(Rgb::BLACK);
            yarn.specular = Some(Rgb::BLACK);
            yarn.u_max_noise_own_deg = None;
            yarn.u_max_noise_cross_deg = None;
        }
        if self.has_transmission {
            let old = spec.transmission.take();
            spec.transmission = Some(TransmissionSpec {
                warp_cover: old.as_ref().map_or(1.0, |t| t.warp_cover),
                weft_cover: old.as_ref().map_or(1.0, |t| t.weft_cover),
                diffuse: Rgb::BLACK,
                forward: Rgb::BLACK,
                concentration: old.map_or(3.0, |t| t.concentration),
            });
        }
        spec
    }

    /// Weighted values of each component for each channel: one column after the
    /// other.
    fn columns(&self, place: &[f64]) -> Option<[Vec<Vec<f64>>; 3]> {
        let mut shape = self.shape(place);
        shape.warp.specular = Some(GREEN);
        shape.weft.specular = Some(BLUE);
        let lobes = self.values(&shape.build().ok()?);
        Some(std::array::from_fn(|channel| {
            let [warp, weft] = self.diffuse.map(|d| d[channel]);
            (0..COMPONENTS)
                .map(|k| {
                    let entry = |((s, l), w): ((&[f64; 4], &[f64; 3]), &[f64; 3])| {
                        let value = match k {
                            0 => warp * s[0] + weft * s[1],
                            1 => l[1],
                            2 => l[2],
                            k => s[k - 1],
                        };
                        value * w[channel]
                    };
                    let pairs = self.still.iter().zip(&lobes);
                    pairs.zip(&self.weights).map(entry).collect()
                })
                .collect()
        }))
    }

    fn target(&self, channel: usize) -> Vec<f64> {
        let pairs = self.data.iter().zip(&self.weights);
        pairs
            .map(|(v, w)| v.bsdf.mean[channel] * w[channel])
            .collect()
    }

    /// The best colours at a place and the sum of squares that is left.
    fn solve(&self, place: &[f64]) -> Option<(Colours, f64)> {
        let columns = self.columns(place)?;
        let mut colours = [[0.0; COMPONENTS]; 3];
        let mut cost = 0.0;
        for (channel, columns) in columns.iter().enumerate() {
            let (x, rest) = non_negative(columns, &self.target(channel));
            for (c, x) in colours[channel].iter_mut().zip(x) {
                *c = x.min(1.0);
            }
            cost += rest;
        }
        Some((colours, cost))
    }

    fn spec(&self, place: &[f64], colours: &Colours) -> SurfaceSpec {
        let rgb = |k: usize, share: [f64; 3]| {
            let value = |c: usize| (colours[c][k] * share[c]) as f32;
            Rgb::new(value(0), value(1), value(2))
        };
        let mut spec = self.shape(place);
        spec.preset = None;
        spec.accuracy = None;
        spec.warp.diffuse = Some(rgb(0, self.diffuse[0]));
        spec.weft.diffuse = Some(rgb(0, self.diffuse[1]));
        spec.warp.specular = Some(rgb(1, [1.0; 3]));
        spec.weft.specular = Some(rgb(2, [1.0; 3]));
        if let (Some(t), true) = (&mut spec.transmission, self.has_transmission) {
            t.diffuse = rgb(3, [1.0; 3]);
            t.forward = rgb(4, [1.0; 3]);
        }
        spec
    }

    /// Weighted values of the whole model, channel after channel.
    fn model(&self, place: &[f64], colours: &Colours) -> Option<Vec<f64>> {
        let columns = self.columns(place)?;
        let mut list = Vec::with_capacity(3 * self.data.len());
        for (columns, colours) in columns.iter().zip(colours) {
            list.extend((0..self.data.len()).map(|i| {
                columns
                    .iter()
                    .zip(colours)
                    .map(|(column, colour)| colour * column.get(i).copied().unwrap_or(0.0))
                    .sum::<f64>()
            }));
        }
        Some(list)
    }

    fn determined(
        &self,
        bounds: &[Bound],
        place: &[f64],
        colours: &Colours,
        cost: f64,
    ) -> Vec<Determined> {
        let n = self.data.len();
        let (Some(base), Some(basis)) = (self.model(place, colours), self.columns(place)) else {
            return Vec::new();
        };
        let mut bounds = bounds.to_vec();
        let mut values = place.to_vec();
        let mut columns = Vec::new();
        for k in 0..place.len() {
            let Some(b) = bounds.get(k) else { continue };
            let step = 0.01 * (b.high - b.low);
            let step = if values[k] + step > b.high {
                -step
            } else {
                step
            };
            let mut moved = place.to_vec();
            moved[k] += step;
            let column = self.model(&moved, colours).map_or(vec![0.0; 3 * n], |m| {
                m.iter().zip(&base).map(|(a, b)| (a - b) / step).collect()
            });
            columns.push(column);
        }
        let names = [
            "diffuse",
            "warp.specular",
            "weft.specular",
            "transmission.diffuse",
            "transmission.forward",
        ];
        for (channel, letter) in ["r", "g", "b"].into_iter().enumerate() {
            for (k, name) in names.into_iter().enumerate() {
                if k > 2 && !self.has_transmission {
                    continue;
                }
                let mut column = vec![0.0; 3 * n];
                for (to, from) in column.iter_mut().skip(channel * n).zip(&basis[channel][k]) {
                    *to = *from;
                }
                bounds.push(Bound {
                    name: format!("{name}.{letter}"),
                    low: 0.0,
                    high: 1.0,
                    start: 0.5,
                });
                values.push(colours[channel][k]);
                columns.push(column);
            }
        }
        let freedom = (3 * n).saturating_sub(bounds.len()).max(1);
        let variance = (cost / freedom as f64).max(1e-12);
        determine(&bounds, &values, &columns, variance)
    }
}
