//! The surface model that matches a list of measured pairs.
//!
//! The model is linear in its colours: for every shape of the yarns, non-negative least squares
//! gives the colours, and only the shape is searched for [Golub1973]. Pairs of a whole patch
//! cannot distinguish the diffuse colours of warp and weft, so these keep the proportion of the
//! start.

use crate::PairValue;
use crate::fit::{Bound, Determined, Patience, determine, non_negative, search};
use organza_basis::{Rgb, Stopped};
use organza_surface::components::{Components, Parts};
use organza_surface::spec::{ShadowingSpec, SurfaceSpec, SurfaceYarnSpec, TransmissionSpec};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// A fitted surface.
#[derive(Clone, Debug)]
pub struct FittedSurface {
    /// The whole section, without preset.
    pub spec: SurfaceSpec,
    /// Every parameter with its uncertainty from the data.
    pub parameters: Vec<Determined>,
    /// Root mean square of the weighted residuals; a tenth of it is about the relative error.
    pub residual: f64,
    /// Median relative error of all channels of all pairs that reflect.
    pub median_relative: f64,
}

/// Why a fit failed.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// There is no data to fit to.
    #[error("the data has no pair with light and exitant direction on the face")]
    NoReflection,
    /// The start is not a valid surface.
    #[error("{0}")]
    Surface(#[from] organza_surface::Error),
    /// No shape within the bounds can be built.
    #[error("no shape of the yarns within its bounds makes a surface")]
    Shape,
    /// Whoever watched the fit stopped it.
    #[error("{0}")]
    Stopped(#[from] Stopped),
}

/// Relative error that the model is expected to have: once the noise is smaller, the weight of
/// a pair is that of its relative error.
const RELATIVE_WEIGHT: f64 = 0.1;

/// Share of the mean value below which errors count absolutely.
const FLOOR: f64 = 0.02;

/// Initial twist of fibres along the yarn, degrees.
const SMALL_TWIST_DEG: f64 = 8.0;

/// The components: flat diffuse light of both yarns, highlights of warp and weft, their round
/// diffuse light, two kinds of transmission.
const COMPONENTS: usize = 7;

/// Index of the first component of transmission.
const FIRST_TRANSMITTED: usize = 5;

/// Fits a surface, starting from a complete section. `watch` is called after every evaluated
/// place.
///
/// # Errors
/// See [`FitError`].
pub fn fit_surface(
    start: &SurfaceSpec,
    data: &[PairValue],
    patience: &Patience,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
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
    // Fibres along the yarn, as in the start, or slightly across it, which also represents
    // rough fibres: the data decides.
    let mut twisted = start.clone();
    for yarn in [&mut twisted.warp, &mut twisted.weft] {
        let psi = yarn.psi_deg.filter(|&p| p != 0.0);
        yarn.psi_deg = Some(psi.unwrap_or(SMALL_TWIST_DEG));
    }
    let first = descend(&start, data, patience, watch);
    if let Err(FitError::Stopped(_)) = first {
        return first;
    }
    if start.warp.psi_deg == twisted.warp.psi_deg && start.weft.psi_deg == twisted.weft.psi_deg {
        return first;
    }
    let second = descend(&twisted, data, patience, watch);
    match (first, second) {
        (_, Err(FitError::Stopped(stopped))) => Err(stopped.into()),
        (Ok(a), Ok(b)) if b.residual < a.residual => Ok(b),
        (Err(_), Ok(b)) => Ok(b),
        (first, _) => first,
    }
}

/// The best surface with the kinds of yarn of the start.
fn descend(
    start: &SurfaceSpec,
    data: &[PairValue],
    patience: &Patience,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<FittedSurface, FitError> {
    let problem = Problem::new(start, data);
    let bounds = problem.bounds();
    // After a stop no place has a value, which ends the search at once.
    let mut flow = ControlFlow::Continue(());
    let (place, least) = search(&bounds, patience, &mut |place| {
        if flow.is_continue() {
            flow = watch();
        }
        Stopped::check(flow).ok()?;
        let columns = problem.columns(place).ok()?;
        Some(problem.solve(&columns).1)
    });
    Stopped::check(flow)?;
    // Without any place, the error of the start is the most helpful one.
    let columns = problem.columns(&place)?;
    if !least.is_finite() {
        return Err(FitError::Shape);
    }
    let (colours, residuals) = problem.solve(&columns);
    let cost = residuals.iter().map(|r| r * r).sum::<f64>();
    let gain = problem.components(&place)?.specular_gain().into();
    let spec = problem.spec(&place, &colours, gain);
    Ok(FittedSurface {
        spec: buildable(spec)?,
        parameters: problem.determined(&bounds, &place, &columns, &colours, gain, cost),
        residual: (cost / (3 * data.len()) as f64).sqrt(),
        median_relative: problem.median_relative(&residuals),
    })
}

/// The same with colours reduced until the cloth returns no more light than it receives.
fn buildable(mut spec: SurfaceSpec) -> Result<SurfaceSpec, FitError> {
    for _ in 0..100 {
        match spec.clone().build() {
            Ok(_) => return Ok(spec),
            Err(organza_surface::Error::Energy { .. }) => {
                let lower = |c: &mut Option<Rgb>| *c = c.map(|c| c * 0.98);
                for yarn in [&mut spec.warp, &mut spec.weft] {
                    lower(&mut yarn.diffuse);
                    lower(&mut yarn.round);
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
    /// Shares of warp and weft in the diffuse light of each channel.
    diffuse: [[f64; 3]; 2],
    has_transmission: bool,
}

/// Colours per channel and component; highlights without their gain.
type Colours = [[f64; COMPONENTS]; 3];

/// Weighted values for colours of one, per channel and component.
type Columns = [Vec<Vec<f64>>; 3];

impl<'a> Problem<'a> {
    fn new(start: &'a SurfaceSpec, data: &'a [PairValue]) -> Problem<'a> {
        let count = (3 * data.len()).max(1) as f64;
        let total: f64 = data.iter().flat_map(|v| v.bsdf.mean).sum();
        let floor = FLOOR * total / count;
        let weight = |v: &PairValue| {
            std::array::from_fn(|c| {
                let (mean, se) = (v.bsdf.mean[c], v.bsdf.se[c]);
                1.0 / (se * se + (RELATIVE_WEIGHT * mean).powi(2) + floor * floor).sqrt()
            })
        };
        let own = |y: &SurfaceYarnSpec| {
            let colour = y.diffuse.unwrap_or(Rgb::WHITE).0.to_array();
            colour.map(|c| f64::from(c).max(1e-3))
        };
        let (warp, weft) = (own(&start.warp), own(&start.weft));
        let share = |a: [f64; 3]| std::array::from_fn(|c| a[c] / warp[c].max(weft[c]));
        let crosses =
            |v: &PairValue| (v.pair.incident.theta_deg < 90.0) != (v.pair.exitant.theta_deg < 90.0);
        Problem {
            start,
            data,
            weights: data.iter().map(weight).collect(),
            diffuse: [share(warp), share(weft)],
            has_transmission: data.iter().any(crosses),
        }
    }

    fn bounds(&self) -> Vec<Bound> {
        let mut list = Vec::new();
        let mut add = |name: String, low: f64, high: f64, start: Option<f64>| {
            list.push(Bound {
                name,
                low,
                high,
                start: start.unwrap_or(0.5 * (low + high)).clamp(low, high),
            });
        };
        for (yarn, spec) in [("warp", &self.start.warp), ("weft", &self.start.weft)] {
            let key = |key| format!("{yarn}.{key}");
            add(key("u_max_deg"), 3.0, 80.0, spec.u_max_deg);
            let psi = spec.psi_deg.unwrap_or(0.0);
            if psi == 0.0 {
                add(key("smoothing"), 0.0, 1.0, spec.smoothing);
            } else {
                add(key("psi_deg"), 1.5, 80.0, Some(psi.abs()));
            }
            add(key("kappa"), -0.95, 5.0, spec.kappa);
            add(key("alpha"), 0.0, 0.5, spec.alpha);
            add(key("beta"), -5.0, 15.0, spec.beta);
        }
        if let Some(weave) = &self.start.weave {
            // Crowns stand at most half a yarn above the other system.
            let most = 0.5 * weave.warp_pitch_mm.min(weave.weft_pitch_mm);
            let own = self.start.shadowing.as_ref();
            let height = own.map_or(0.1 * most, |s| s.warp_above_weft_mm);
            let name = "shadowing.warp_above_weft_mm".into();
            add(name, -most, most, Some(height));
        }
        if self.has_transmission {
            let own = self.start.transmission.as_ref().map(|t| t.concentration);
            let name = "transmission.concentration".into();
            add(name, 0.0, 40.0, own.or(Some(3.0)));
        }
        list
    }

    /// The section at a place, without colours.
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
            yarn.round = None;
            yarn.specular = Some(Rgb::BLACK);
            yarn.u_max_noise_own_deg = None;
            yarn.u_max_noise_cross_deg = None;
        }
        if spec.weave.is_some() {
            let warp_above_weft_mm = next();
            spec.shadowing = Some(ShadowingSpec { warp_above_weft_mm });
        }
        if self.has_transmission {
            let old = spec.transmission.take();
            spec.transmission = Some(TransmissionSpec {
                warp_cover: old.as_ref().map_or(1.0, |t| t.warp_cover),
                weft_cover: old.as_ref().map_or(1.0, |t| t.weft_cover),
                diffuse: Rgb::BLACK,
                forward: Rgb::BLACK,
                concentration: next(),
            });
        }
        spec
    }

    fn components(&self, place: &[f64]) -> Result<Components, organza_surface::Error> {
        Components::new(&self.shape(place).parameters()?)
    }

    /// The factors of each colour at a place.
    fn columns(&self, place: &[f64]) -> Result<Columns, organza_surface::Error> {
        let components = self.components(place)?;
        let eval = |v: &PairValue| {
            let pair = v.pair;
            components.eval(pair.incident.direction(), pair.exitant.direction())
        };
        let parts: Vec<Parts> = self.data.par_iter().map(eval).collect();
        let column = |channel: usize, k: usize| {
            let [warp, weft] = self.diffuse.map(|d| d[channel]);
            let entry = |(p, w): (&Parts, &[f64; 3])| {
                let value = match k {
                    0 => warp * f64::from(p.diffuse[0]) + weft * f64::from(p.diffuse[1]),
                    1 | 2 => f64::from(p.specular[k - 1]),
                    3 | 4 => f64::from(p.round[k - 3]),
                    _ => f64::from(p.transmitted[k - FIRST_TRANSMITTED]),
                };
                value * w[channel]
            };
            parts.iter().zip(&self.weights).map(entry).collect()
        };
        Ok(std::array::from_fn(|channel| {
            (0..COMPONENTS).map(|k| column(channel, k)).collect()
        }))
    }

    fn target(&self, channel: usize) -> Vec<f64> {
        let pairs = self.data.iter().zip(&self.weights);
        pairs
            .map(|(v, w)| v.bsdf.mean[channel] * w[channel])
            .collect()
    }

    /// The best colours and their weighted residuals, channel after channel.
    fn solve(&self, columns: &Columns) -> (Colours, Vec<f64>) {
        let mut colours = [[0.0; COMPONENTS]; 3];
        let mut residuals = Vec::with_capacity(3 * self.data.len());
        for (channel, columns) in columns.iter().enumerate() {
            let target = self.target(channel);
            let (x, _) = non_negative(columns, &target);
            colours[channel].copy_from_slice(&x);
            let combined = combine(columns, &colours[channel]);
            residuals.extend(combined.zip(target).map(|(t, v)| t - v));
        }
        (colours, residuals)
    }

    /// Median over reflected values of the residuals, as shares of the values.
    fn median_relative(&self, residuals: &[f64]) -> f64 {
        let mut list = Vec::new();
        for (channel, residuals) in residuals.chunks(self.data.len()).enumerate() {
            for ((v, w), r) in self.data.iter().zip(&self.weights).zip(residuals) {
                let value = v.bsdf.mean[channel];
                let [i, o] = [v.pair.incident, v.pair.exitant].map(|a| a.theta_deg < 90.0);
                if i == o && value > 0.0 {
                    list.push((r / (w[channel] * value)).abs());
                }
            }
        }
        list.sort_by(f64::total_cmp);
        list.get(list.len() / 2).copied().unwrap_or(f64::NAN)
    }

    fn spec(&self, place: &[f64], colours: &Colours, gain: f64) -> SurfaceSpec {
        let rgb = |k: usize, share: [f64; 3]| {
            let value = |c: usize| (colours[c][k] * share[c]).min(1.0) as f32;
            Rgb::new(value(0), value(1), value(2))
        };
        let specular = [1.0 / gain.max(1e-30); 3];
        let mut spec = self.shape(place);
        spec.preset = None;
        spec.accuracy = None;
        spec.warp.diffuse = Some(rgb(0, self.diffuse[0]));
        spec.weft.diffuse = Some(rgb(0, self.diffuse[1]));
        spec.warp.specular = Some(rgb(1, specular));
        spec.weft.specular = Some(rgb(2, specular));
        spec.warp.round = Some(rgb(3, [1.0; 3]));
        spec.weft.round = Some(rgb(4, [1.0; 3]));
        if let (Some(t), true) = (&mut spec.transmission, self.has_transmission) {
            t.diffuse = rgb(5, [1.0; 3]);
            t.forward = rgb(6, [1.0; 3]);
        }
        spec
    }

    fn determined(
        &self,
        bounds: &[Bound],
        place: &[f64],
        basis: &Columns,
        colours: &Colours,
        gain: f64,
        cost: f64,
    ) -> Vec<Determined> {
        let n = self.data.len();
        let whole = |columns: &Columns| -> Vec<f64> {
            let channels = columns.iter().zip(colours);
            channels.flat_map(|(c, x)| combine(c, x)).collect()
        };
        let base = whole(basis);
        let mut bounds = bounds.to_vec();
        let mut values = place.to_vec();
        let mut columns = Vec::new();
        for (k, b) in bounds.iter().enumerate() {
            let mut moved = place.to_vec();
            let step = 0.01 * (b.high - b.low);
            let is_beyond = moved[k] + step > b.high;
            let step = if is_beyond { -step } else { step };
            moved[k] += step;
            let column = self.columns(&moved).map_or(vec![0.0; 3 * n], |m| {
                let pairs = whole(&m).into_iter().zip(&base);
                pairs.map(|(a, b)| (a - b) / step).collect()
            });
            columns.push(column);
        }
        let names = [
            ("diffuse", 1.0),
            ("warp.specular", gain),
            ("weft.specular", gain),
            ("warp.round", 1.0),
            ("weft.round", 1.0),
            ("transmission.diffuse", 1.0),
            ("transmission.forward", 1.0),
        ];
        for (channel, letter) in ["r", "g", "b"].into_iter().enumerate() {
            for (k, (name, gain)) in names.into_iter().enumerate() {
                if k >= FIRST_TRANSMITTED && !self.has_transmission {
                    continue;
                }
                let mut column = vec![0.0; 3 * n];
                for (to, from) in column.iter_mut().skip(channel * n).zip(&basis[channel][k]) {
                    *to = *from * gain;
                }
                bounds.push(Bound {
                    name: format!("{name}.{letter}"),
                    low: 0.0,
                    high: 1.0,
                    start: 0.5,
                });
                values.push(colours[channel][k] / gain);
                columns.push(column);
            }
        }
        let freedom = (3 * n).saturating_sub(bounds.len()).max(1);
        let variance = (cost / freedom as f64).max(1e-12);
        determine(&bounds, &values, &columns, variance)
    }
}

/// Columns times their colours, summed.
fn combine<'a>(columns: &'a [Vec<f64>], colours: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let count = columns.first().map_or(0, Vec::len);
    (0..count).map(move |i| {
        let terms = columns.iter().zip(colours);
        terms.map(|(column, x)| column[i] * x).sum()
    })
}
