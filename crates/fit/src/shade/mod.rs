//! Fitting a shade to what a laboratory measured: its openness first, then how much its yarns
//! scatter and their colours, which both sides and the light that passes determine.

mod cloth;
mod target;
mod verdict;

use super::fibres::model;
use super::{
    FitJob, check_outputs, finish_with, journal_key, measured, open_journal, options, read_fabric,
    table,
};
use anyhow::Result;
use cloth::{Cloth, Place, colour};
use nalgebra::{DMatrix, DVector};
use organza_basis::Stopped;
use organza_measure::fit::Determined;
use organza_measure::{Effort, KlemsBand, measure_sides};
use organza_scene::fabric_file;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::optics::Band;
use organza_scene::patches::{Matter, PatchOptions};
use organza_scene::representation::ShownAs;
use organza_work::Progress;
use organza_work::number_journal::NumberJournal;
use organza_work::{InputError, of_file};
use target::{Equation, Seen, Target, from_numbers, mean, straight_of, to_numbers};
use verdict::{LIGHT, SUN, Verdict};

/// Paths of a beam or of diffuse light on a side, by default.
const PATHS: u64 = 32768;
/// How many times more the last look takes.
const LAST: u64 = 4;
/// Looks for the openness, at most, each time.
const OPENINGS: usize = 8;
/// Steps for the rest, each with its derivatives.
const STEPS: usize = 4;
/// Square of a step whose difference is mostly noise.
const NOISY: f64 = 0.01;
/// How near straight light must come, as a logarithm.
const NEAR: f64 = 0.015;
/// Straight light below which nothing is open.
const CLOSED: f64 = 5e-4;
/// Range of the squared width.
const WIDTHS: [f64; 2] = [-1.6, 1.6];
/// Change of an unknown for its derivative.
const STRIDE: [f64; 2] = [0.3, 0.4];
/// Longest step of an unknown.
const LONGEST: f64 = 1.2;
/// How far an unknown may be expected to move, for the damping of a step.
const EXPECTED: f64 = 1.5;
/// How much a unit between the darkness of warp and weft counts, in hundredths of a measured
/// value: where the sides do not tell them apart, they stay alike.
const ALIKE: f64 = 2.0;

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "shade",
    about: "The yarns of a shade before a window: openness, colours and brightness under the sun, from what a laboratory measured (.xml)",
    example: "scenes/fabrics/screen.toml --model fibres --data measured.xml -o fitted.toml",
    fields: &["data", "model", "journal", "voxel_um"],
    check: |args| measured(args).map(drop),
    run,
};

/// Looks at fabrics, and remembers.
struct Looks<'a> {
    args: &'a FitJob,
    cloth: &'a Cloth<'a>,
    shown: ShownAs,
    loader: &'a Loader<'a>,
    options: PatchOptions<'a>,
    beam_sin_squared: f32,
    journal: NumberJournal,
    progress: Progress,
    count: u64,
    most: u64,
    /// The last geometry.
    matter: Option<([f64; 2], Matter)>,
}

impl Looks<'_> {
    /// What a place does with light, or under the sun if it has colours there.
    fn at(&mut self, place: &Place, solar: Option<&[f64]>, factor: u64) -> Result<Seen> {
        let mut key = vec![place.width, place.strength, factor as f64];
        key.extend(place.darkness.iter().flatten());
        key.extend(solar.into_iter().flatten());
        self.count = (self.count + 1).min(self.most);
        Stopped::check(self.progress.at(self.count))?;
        let (args, shown) = (self.args, self.shown);
        let (cloth, loader, options) = (self.cloth, self.loader, &self.options);
        let (beam, matter) = (self.beam_sin_squared, &mut self.matter);
        let found = self.journal.once(&key, target::NUMBERS, || {
            let path = args.fabric_path();
            let keys = cloth.keys(place, solar);
            let mut fabric = fabric_file::load_changed(path, &cloth.given_way, &keys, loader)?;
            if solar.is_some() {
                let shown_in = fabric.show_in(Band::Solar);
                shown_in.map_err(|yarn| {
                    InputError::new("is missing").at_key(format!("optics.{yarn}.solar"))
                })?;
            }
            let geometry = [place.width, place.strength];
            let same = matter.take().filter(|(of, _)| *of == geometry);
            let (_, matter) = matter.insert(match same {
                Some(same) => same,
                None => (geometry, Matter::new(&fabric, path, shown, options)?),
            });
            let patch = matter.patch(&fabric, path, options)?;
            // The last look is another.
            let seed = args.seed.wrapping_add(u64::from(factor > 1));
            let effort = Effort::new(factor * args.spp.unwrap_or(PATHS), seed);
            let stop = |_| args.context.flow();
            let (seen, _) = measure_sides(&patch, beam, &effort, &|c| c, &stop)?;
            Ok(to_numbers(&seen))
        })?;
        Ok(from_numbers(&found))
    }
}

fn run(args: &FitJob) -> Result<super::Fitted> {
    let path = measured(args)?;
    let text = args.context.loader().text_of(path, Wanted::Text)?;
    let light = Target::read(&text, KlemsBand::Visible, path)?;
    let light = light.ok_or_else(|| of_file(path, "has no light"))?;
    let sun = Target::read(&text, KlemsBand::Solar, path)?;
    let loader = args.context.loader();
    let (fabric, read) = read_fabric(args)?;
    check_outputs(args, &args.context, &read)?;
    let (shown, fitted) = model(args, &fabric)?;
    let cloth = Cloth::new(args, &fabric, fitted)?;
    let key = journal_key(args, &format!("{shown} shade"), &read)?;
    let most = OPENINGS + 2 * STEPS + 8;
    let mut looks = Looks {
        args,
        cloth: &cloth,
        shown,
        loader: &loader,
        options: options(args, &loader),
        beam_sin_squared: light.basis.beam_sin_squared() as f32,
        journal: open_journal(args, &key)?,
        progress: Progress::new("fitting", most as u64, &args.context),
        count: 0,
        most: most as u64,
        matter: None,
    };
    let mut place = open(&mut looks, &light, cloth.start())?;
    let mut slopes = None;
    for _ in 0..2 {
        place = solve(&mut looks, &light, place, &mut slopes)?;
        place = open(&mut looks, &light, place)?;
    }
    let errors = errors(&mut looks, &light, &place, slopes)?;
    let seen = looks.at(&place, None, LAST)?;
    let mut verdict = Verdict::new(LIGHT, &light, &seen);
    verdict.explain(&light, &place, &cloth);
    let mut verdicts = vec![verdict];
    let mut solar = None;
    if let Some(sun) = &sun {
        let colours = solve_solar(&mut looks, sun, &place)?;
        let seen = looks.at(&place, Some(&colours), LAST)?;
        let mut verdict = Verdict::new(SUN, sun, &seen);
        verdict.explain(sun, &place, &cloth);
        verdicts.push(verdict);
        solar = Some(colours);
    }
    looks.progress.finish();
    let keys = cloth.keys(&place, solar.as_deref());
    let table = table(args, &cloth.given_way, &keys)?;
    let parameters = parameters(&cloth, (&place, light.straight.is_some()), &errors);
    let lines: Vec<String> = verdicts.iter().flat_map(Verdict::lines).collect();
    let figures = verdict::figures(&verdicts);
    finish_with(args, &table, &parameters, &lines, (figures, None))
}

/// The width of the yarns at which as much light passes straight as was measured.
fn open(looks: &mut Looks<'_>, target: &Target, mut place: Place) -> Result<Place> {
    let Some(wanted) = target.straight else {
        return Ok(place);
    };
    let off = |seen: &Seen| ((straight_of(seen)[0] + CLOSED) / (wanted + CLOSED)).ln();
    let [mut low, mut high] = WIDTHS;
    let mut slope = -2.0;
    let mut before: Option<[f64; 2]> = None;
    let mut best = (f64::INFINITY, place.width);
    for _ in 0..OPENINGS {
        let seen = match looks.at(&place, None, 1) {
            Ok(seen) => seen,
            // Yarns for which there is no room.
            Err(e) if before.is_none() && place.width <= 0.0 => return Err(e),
            Err(e) if e.is::<organza_work::number_journal::JournalError>() => return Err(e),
            Err(e) if looks.args.context.flow().is_break() => return Err(e),
            Err(_) => {
                high = place.width;
                place.width = 0.5 * (place.width + best.1);
                continue;
            }
        };
        let found = off(&seen);
        if found.abs() < best.0 {
            best = (found.abs(), place.width);
        }
        if found.abs() < NEAR {
            break;
        }
        // Wider yarns let less pass.
        if found > 0.0 {
            low = low.max(place.width);
        } else {
            high = high.min(place.width);
        }
        if let Some([width, value]) = before
            && (width - place.width).abs() > 1e-6
        {
            let steep = (found - value) / (place.width - width);
            slope = if steep < -0.2 { steep } else { slope };
        }
        before = Some([place.width, found]);
        let step = (-found / slope).clamp(-0.8, 0.8);
        let next = place.width + step;
        place.width = if next > low && next < high {
            next
        } else if high - low > 1e-3 {
            0.5 * (low + high)
        } else {
            break;
        };
    }
    place.width = best.1;
    Ok(place)
}

/// The unknowns of a place beside the width: strength, then darkness by group and channel.
fn unknowns(place: &Place) -> Vec<f64> {
    let dark = place.darkness.iter().flatten().copied();
    std::iter::once(place.strength).chain(dark).collect()
}

fn placed(place: &Place, unknowns: &[f64], [low, high]: [f64; 2]) -> Place {
    let mut place = place.clone();
    place.strength = unknowns[0].clamp(low, high);
    let range = [cloth::darkness(1.0), cloth::darkness(0.0)];
    for (group, list) in place.darkness.iter_mut().zip(unknowns[1..].chunks(3)) {
        *group = std::array::from_fn(|c| list[c].clamp(range[0], range[1]));
    }
    place
}

/// What is to become zero: the residuals, and differences of the groups' darkness.
fn residuals(
    equations: &[&Equation],
    seen: &Seen,
    darkness: &[f64],
    groups: usize,
) -> DVector<f64> {
    let per_group = darkness.len() / groups.max(1);
    let apart = (0..darkness.len().saturating_sub(per_group))
        .map(|k| ALIKE * (darkness[k] - darkness[k + per_group]));
    let list: Vec<f64> = equations
        .iter()
        .map(|e| e.residual(seen))
        .chain(apart)
        .collect();
    DVector::from_vec(list)
}

/// The largest residual in units of what is near enough.
fn size(equations: &[&Equation], seen: &Seen) -> f64 {
    let one = |e: &&Equation| e.residual(seen).abs() / (1.5 * e.noise(seen)).max(1.0);
    equations.iter().map(one).fold(0.0, f64::max)
}

/// A step that makes residuals small which have these derivatives.
fn step(matrix: &DMatrix<f64>, residuals: &DVector<f64>) -> DVector<f64> {
    let count = matrix.ncols();
    let damping = DMatrix::identity(count, count) / (EXPECTED * EXPECTED);
    let normal = matrix.transpose() * matrix + damping;
    let right = -(matrix.transpose() * residuals);
    let solved = normal.cholesky().map(|c| c.solve(&right));
    let change = solved.unwrap_or_else(|| DVector::zeros(count));
    change.map(|x| x.clamp(-LONGEST, LONGEST))
}

/// Derivatives by the strength and by the darkness of each group, whose channels do not touch each
/// other.
fn derivatives(
    looks: &mut Looks<'_>,
    equations: &[&Equation],
    place: &Place,
    seen: &Seen,
) -> Result<DMatrix<f64>> {
    let groups = place.darkness.len();
    let mut matrix = DMatrix::zeros(equations.len() + 3 * (groups - 1), 1 + 3 * groups);
    let [low, high] = looks.cloth.strengths();
    let stride = if place.strength + STRIDE[0] > high {
        -STRIDE[0]
    } else {
        STRIDE[0]
    };
    let mut moved = place.clone();
    moved.strength = (moved.strength + stride).clamp(low, high);
    let stride = moved.strength - place.strength;
    if stride != 0.0 {
        let there = looks.at(&moved, None, 1)?;
        for (row, e) in equations.iter().enumerate() {
            matrix[(row, 0)] = (e.residual(&there) - e.residual(seen)) / stride;
        }
    }
    for group in 0..groups {
        let mut moved = place.clone();
        moved.darkness[group] = moved.darkness[group].map(|d| d + STRIDE[1]);
        let there = looks.at(&moved, None, 1)?;
        for (row, e) in equations.iter().enumerate() {
            let column = 1 + 3 * group + e.channel();
            matrix[(row, column)] = (e.residual(&there) - e.residual(seen)) / STRIDE[1];
        }
    }
    for k in 0..3 * (groups - 1) {
        matrix[(equations.len() + k, 1 + k)] = ALIKE;
        matrix[(equations.len() + k, 4 + k)] = -ALIKE;
    }
    Ok(matrix)
}

/// Strength and colours at which both sides reflect, and scattered light passes, as measured. The
/// derivatives are taken once, and corrected by every step [Broyden1965].
fn solve(
    looks: &mut Looks<'_>,
    target: &Target,
    mut place: Place,
    slopes: &mut Option<DMatrix<f64>>,
) -> Result<Place> {
    let equations = target.equations();
    let equations: Vec<&Equation> = equations.iter().collect();
    let groups = place.darkness.len();
    let limits = looks.cloth.strengths();
    let mut best: Option<(f64, Place)> = None;
    let mut before: Option<(DVector<f64>, DVector<f64>)> = None;
    for turn in 0..=STEPS {
        let seen = looks.at(&place, None, 1)?;
        let at = DVector::from_vec(unknowns(&place));
        let off = residuals(&equations, &seen, &at.as_slice()[1..], groups);
        let size = size(&equations, &seen);
        if best.as_ref().is_none_or(|(least, _)| size < *least) {
            best = Some((size, place.clone()));
        }
        if size < 1.0 || turn == STEPS {
            break;
        }
        let matrix = match slopes {
            Some(matrix) => matrix,
            None => slopes.insert(derivatives(looks, &equations, &place, &seen)?),
        };
        if let Some((there, was)) = before.take() {
            let moved = &at - there;
            let error = &off - was - &*matrix * &moved;
            let length = moved.norm_squared();
            if length > 0.0 {
                *matrix += error * moved.transpose() / (length + NOISY);
            }
        }
        let next = &at + step(matrix, &off);
        place = placed(&place, next.as_slice(), limits);
        before = Some((at, off));
    }
    Ok(best.map_or(place, |(_, place)| place))
}

/// Darkness of each group under the sun, whose radiation the same cloth reflects as measured.
fn solve_solar(looks: &mut Looks<'_>, target: &Target, place: &Place) -> Result<Vec<f64>> {
    let groups = place.darkness.len();
    let mut dark: Vec<f64> = place.darkness.iter().map(|d| mean(*d)).collect();
    // The channels are alike: one of them counts.
    let equations = target.equations();
    let equations: Vec<&Equation> = equations.iter().filter(|e| e.channel() == 0).collect();
    let mut slopes: Option<DMatrix<f64>> = None;
    for _ in 0..STEPS {
        let seen = looks.at(place, Some(&dark), 1)?;
        let off = residuals(&equations, &seen, &dark, groups);
        if size(&equations, &seen) < 1.0 {
            break;
        }
        let matrix = match &slopes {
            Some(matrix) => matrix,
            None => {
                let mut matrix = DMatrix::zeros(off.len(), groups);
                for group in 0..groups {
                    let mut moved = dark.clone();
                    moved[group] += STRIDE[1];
                    let there = looks.at(place, Some(&moved), 1)?;
                    let there = residuals(&equations, &there, &moved, groups);
                    matrix.set_column(group, &((there - &off) / STRIDE[1]));
                }
                slopes.insert(matrix)
            }
        };
        for (d, c) in dark.iter_mut().zip(step(matrix, &off).iter()) {
            *d += c;
        }
    }
    Ok(dark)
}

/// Standard errors of the unknowns at the answer, from those of a look: strength, then the
/// darkness of each group and channel.
fn errors(
    looks: &mut Looks<'_>,
    target: &Target,
    place: &Place,
    slopes: Option<DMatrix<f64>>,
) -> Result<Vec<f64>> {
    let equations = target.equations();
    let equations: Vec<&Equation> = equations.iter().collect();
    let seen = looks.at(place, None, 1)?;
    let mut scaled = match slopes {
        Some(slopes) => slopes,
        None => derivatives(looks, &equations, place, &seen)?,
    };
    for (row, e) in equations.iter().enumerate() {
        scaled.row_mut(row).unscale_mut(e.noise(&seen).max(0.1));
    }
    let count = scaled.ncols();
    let prior = DMatrix::identity(count, count) / (EXPECTED * EXPECTED);
    let inverse = (scaled.transpose() * &scaled + prior).try_inverse();
    Ok(inverse.map_or(vec![EXPECTED; count], |m| {
        m.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()
    }))
}

/// The answer with its errors; what the prior alone gives is not fixed.
fn parameters(
    cloth: &Cloth<'_>,
    (place, has_width): (&Place, bool),
    errors: &[f64],
) -> Vec<Determined> {
    let one = |name: String, value: f64, slope: f64, se: f64| Determined {
        name,
        value,
        se: slope.abs() * se,
        is_fixed: se < 0.5 * EXPECTED,
    };
    let strength = place.strength.exp();
    let mut list = vec![Determined {
        name: "width".into(),
        value: (0.5 * place.width).exp(),
        se: 0.5 * NEAR * (0.5 * place.width).exp(),
        is_fixed: has_width,
    }];
    list.push(one("scattering".into(), strength, strength, errors[0]));
    for (group, name) in cloth.names().iter().enumerate() {
        for (channel, letter) in ["r", "g", "b"].iter().enumerate() {
            let dark = place.darkness[group][channel];
            let slope = (colour(dark + 0.01) - colour(dark - 0.01)) / 0.02;
            let se = errors[1 + 3 * group + channel];
            list.push(one(
                format!("{name}.colour.{letter}"),
                colour(dark),
                slope,
                se,
            ));
        }
    }
    list
}
