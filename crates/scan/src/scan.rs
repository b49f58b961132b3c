//! A scan from the first look at a volume to the field, slab by slab.
//!
//! More than 450 lines: what is surveyed and what slabs are made with are the same windows,
//! scales and levels.

use crate::ScanError;
use crate::disk::unblurred;
use crate::field::{BRICK, BRICK_VOXELS, ScannedField, StoredBrick, StoredVoxel};
use crate::input::Slices;
use crate::interior::TWISTS;
use crate::levels::{Histogram, Levels};
use crate::noise;
use crate::orientation::{Analysed, CORE, Core, Scales, analyse};
use crate::rays::{FibreSection, median};
use crate::sections::{sections, single_fibres};
use crate::settings::{Denoise, ScanSettings};
use crate::window::{Window, window_bytes};
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use glam::UVec3;
use organza_basis::{Budget, Stopped};
use rayon::prelude::*;
use std::io::{Read, Write};
use std::ops::{ControlFlow, Range};

/// Slices of a slab, where memory allows it: as many as a block has.
const SLAB: usize = CORE;

/// Windows in which radius and noise are measured.
const PROBES: usize = 3;

/// Slices of such a window.
const PROBE_SLICES: usize = 40;

/// Fewest round sections that a radius is taken from.
const LEAST_SECTIONS: usize = 24;

/// Least length of a fibre, in diameters, in the median over its sections.
const LEAST_LENGTH: f32 = 1.5;

/// Voxels whose residues tell the noise.
const RESIDUES: usize = 20_000;

/// Difference of the grey values of fibre and air, in deviations of noise, above which it is not
/// one of noise.
const CLEAR: f32 = 4.0;

/// Share of the voxels of noise whose residues may be below the median residue of fibre.
const NOISE_SHARE: f32 = 0.05;

/// The share of these voxels that counts as straight fibre.
const STRAIGHT: f32 = 0.2;

/// Least [`Survey::inner_deviation`] of bundles, fitted to phantoms: about midway between those of
/// single fibres (up to 0.016) and of bundles (from 0.024 in twisted yarns, from 0.052 in gauzes).
const BUNDLE: f32 = 0.02;

/// A part of the work, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The range of grey values.
    Range,
    /// Threshold and levels of air and fibre.
    Levels,
    /// Fibre radius and noise.
    Radius,
    /// Density and orientation of a slab.
    Slab,
}

/// Follows the work: told the stage and the share of it that is done; may break to stop.
pub type Watch<'a> = &'a (dyn Fn(Stage, f32) -> ControlFlow<()> + Sync);

/// What is found before the slabs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// Grey values of air and fibre.
    pub levels: Levels,
    /// Fibre radius, mm: measured, or as given.
    pub fibre_radius_mm: f32,
    /// Half the distance between the quartiles of the measured radii, mm.
    pub radius_deviation_mm: f32,
    /// Cross-sections that the radius is the median of.
    pub sections: usize,
    /// Deviation of the blur of scanner and noise filter together, mm.
    pub blur_mm: f32,
    /// Deviation of the grey values inside sections that continues along fibres, as a share of the
    /// difference between air and fibre: near zero in single fibres, as noise does not
    /// continue. Zero where sections are too small to say.
    pub inner_deviation: f32,
    /// Share of the tensor's trace that noise leaves along straight fibres.
    pub residue: f32,
}

/// A scan in progress.
pub struct Scan {
    settings: ScanSettings,
    survey: Survey,
    scales: Scales,
    dims: UVec3,
    slab: usize,
}

/// The bricks of a slab.
#[derive(Clone, Debug, PartialEq)]
pub struct Slab {
    index: usize,
    /// Number of each brick in the field, rising, and its voxels.
    bricks: Vec<(u32, Box<StoredBrick>)>,
}

fn tell(watch: Watch<'_>, stage: Stage, share: f32) -> Result<(), ScanError> {
    Ok(Stopped::check(watch(stage, share))?)
}

impl Scan {
    /// Looks at the whole volume: grey values, fibre radius, noise.
    ///
    /// Memory, beside what the reader has: a window of at most 40 slices, with 2 or 3 more that
    /// the noise filter reaches, twice.
    ///
    /// # Errors
    /// Settings or slices that cannot be used, grey values that hold no fibre, more memory than
    /// the budget.
    pub fn survey(
        slices: &mut dyn Slices,
        settings: &ScanSettings,
        budget: &mut Budget,
        watch: Watch<'_>,
    ) -> Result<Survey, ScanError> {
        settings.check()?;
        let shape = slices.shape();
        let dims = shape.dims;
        let probe = PROBE_SLICES.min(dims.z as usize);
        let bytes = window_bytes(dims.x, dims.y, probe, settings.denoise);
        budget.take(bytes, "slices")?;
        let (least, greatest) = range(slices, settings, watch)?;
        let mut histogram = Histogram::new(least, greatest);
        for_each_window(slices, settings, |window, share| {
            histogram.add(&window.data);
            tell(watch, Stage::Levels, share)
        })?;
        let levels = histogram.levels(settings.threshold, settings.air, settings.fibre)?;
        let mut survey = Survey {
            levels,
            fibre_radius_mm: settings.fibre_radius_mm.unwrap_or(0.0),
            radius_deviation_mm: 0.0,
            sections: 0,
            blur_mm: 0.0,
            inner_deviation: 0.0,
            residue: 0.0,
        };
        let windows = probes(dims.z as usize, probe);
        let count = windows.len() as f32;
        // The second look is at the outline that the first one found.
        let mut shrunk_mm = 0.0;
        for round in 0..2 {
            let (mut found, mut tried) = (Vec::new(), 0);
            for (i, range) in windows.iter().enumerate() {
                let window = Window::read(slices, range.clone(), settings.denoise)?;
                let (threshold, air) = (survey.levels.threshold, survey.levels.air);
                let (own, places) = sections(
                    &window,
                    threshold,
                    air,
                    settings.voxel_mm,
                    shrunk_mm,
                    noise_reach(settings),
                    i as u64,
                );
                found.extend(own);
                tried += places;
                let done = round as f32 + (i + 1) as f32 / count;
                tell(watch, Stage::Radius, 0.35 * done)?;
            }
            shrunk_mm = survey.take_sections(settings, &found, tried)?;
        }
        let scales = survey.scales(settings);
        budget.take(scales.block_bytes(probe), "blocks")?;
        let (mut residues, mut deviation) = (Vec::new(), 0.0f32);
        for (i, range) in windows.iter().enumerate() {
            let window = Window::read(slices, range.clone(), settings.denoise)?;
            deviation = deviation.max(noise::deviation(&window, survey.levels.air));
            residues.extend(residues_of(&window, dims, &survey, &scales));
            tell(watch, Stage::Radius, 0.7 + 0.3 * (i + 1) as f32 / count)?;
        }
        residues.sort_by(f32::total_cmp);
        let at = |list: &[f32], share: f32| list.get((share * list.len() as f32) as usize).copied();
        survey.residue = at(&residues, STRAIGHT).unwrap_or(0.0).min(0.3);
        budget.give_back(bytes + scales.block_bytes(probe));
        // Crossed fibres that touch may vary along all directions, but stand out from noise.
        let contrast = survey.levels.fibre - survey.levels.air;
        let radius_mm = survey.fibre_radius_mm;
        if contrast < CLEAR * deviation {
            let noise = noise::residues(&survey.levels, &scales, settings.voxel_mm, radius_mm);
            if at(&residues, 0.5) > at(&noise, NOISE_SHARE) {
                return Err(ScanError::Content(format!(
                    "no fibre was found at the threshold of {}: grey values vary along any \
                     direction nearly as much as along the others, as in noise",
                    survey.levels.threshold
                )));
            }
        }
        Ok(survey)
    }

    /// A scan of what was surveyed.
    ///
    /// Memory: a slab of 64 slices, or fewer where the budget does not suffice, with those that
    /// filters reach on both sides, twice; a block of 64 x 64 voxels of the slab, fourteen times,
    /// for each thread. The field takes its own, see [`ScannedField::memory_bytes`].
    ///
    /// # Errors
    /// More memory than the budget even for slabs of eight slices.
    pub fn new(
        slices: &dyn Slices,
        settings: &ScanSettings,
        survey: &Survey,
        budget: &mut Budget,
    ) -> Result<Scan, ScanError> {
        settings.check()?;
        let dims = slices.shape().dims;
        let scales = survey.scales(settings);
        let threads = rayon::current_num_threads() as u64;
        let bytes = |slab: usize| {
            let whole = slab + 2 * scales.reach()[2];
            window_bytes(dims.x, dims.y, whole, settings.denoise)
                + threads * scales.block_bytes(slab)
        };
        let mut slab = SLAB;
        while slab > BRICK as usize && bytes(slab) > budget.left() / 2 {
            slab -= BRICK as usize;
        }
        budget.take(bytes(slab), "slabs")?;
        Ok(Scan {
            settings: *settings,
            survey: *survey,
            scales,
            dims,
            slab,
        })
    }

    /// Number of slabs.
    pub fn slab_count(&self) -> usize {
        (self.dims.z as usize).div_ceil(self.slab)
    }

    /// Slices of a slab.
    pub fn slab_slices(&self) -> usize {
        self.slab
    }

    /// The field without any slab.
    ///
    /// # Errors
    /// A table of bricks larger than the budget.
    pub fn field(&self, budget: &mut Budget) -> Result<ScannedField, ScanError> {
        let bricks = self.dims.map(|n| n.div_ceil(BRICK));
        budget.take(bricks.as_u64vec3().element_product() * 8, "bricks")?;
        let mut field = ScannedField::empty(
            self.dims,
            self.settings.voxel_mm,
            self.survey.fibre_radius_mm,
        );
        field.min_mm = glam::DVec3::ZERO;
        Ok(field)
    }

    /// Finds the fibre of a slab. The result does not depend on the number of threads, nor on
    /// how the volume is cut into slabs.
    ///
    /// # Errors
    /// Those of the reader; [`ScanError::Stopped`].
    pub fn slab(
        &self,
        slices: &mut dyn Slices,
        index: usize,
        watch: Watch<'_>,
    ) -> Result<Slab, ScanError> {
        let first = (index * self.slab) as i64;
        let count = self.slab.min(self.dims.z as usize - index * self.slab);
        let r = self.scales.reach()[2] as i64;
        let window = Window::read(
            slices,
            first - r..first + count as i64 + r,
            self.settings.denoise,
        )?;
        let cores = cores(self.dims, first, count);
        let done = std::sync::atomic::AtomicUsize::new(0);
        let parts: Vec<Vec<(u32, Box<StoredBrick>)>> = cores
            .par_iter()
            .map(|core| {
                let found = analyse(
                    &window,
                    *core,
                    &self.survey.levels,
                    &self.scales,
                    self.survey.residue,
                );
                let at = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                tell(watch, Stage::Slab, at as f32 / cores.len() as f32)?;
                Ok(self.bricks(core, found))
            })
            .collect::<Result<_, ScanError>>()?;
        let mut bricks: Vec<_> = parts.into_iter().flatten().collect();
        bricks.sort_unstable_by_key(|b| b.0);
        Ok(Slab { index, bricks })
    }

    /// The bricks of a core; cores begin at bricks.
    fn bricks(&self, core: &Core, found: Analysed) -> Vec<(u32, Box<StoredBrick>)> {
        let low = UVec3::new(core.x as u32, core.y as u32, core.z as u32);
        let grid = self.dims.map(|n| n.div_ceil(BRICK));
        let mut bricks: std::collections::BTreeMap<u32, Box<StoredBrick>> = Default::default();
        for (at, voxel) in &found.voxels {
            let stored = StoredVoxel::new(voxel);
            if stored.is_empty() {
                continue;
            }
            let cell = low + *at;
            let b = cell / BRICK;
            let number = b.x + grid.x * (b.y + grid.y * b.z);
            let brick = bricks
                .entry(number)
                .or_insert_with(|| Box::new([StoredVoxel::default(); BRICK_VOXELS]));
            let c = cell % BRICK;
            brick[(c.x + BRICK * (c.y + BRICK * c.z)) as usize] = stored;
        }
        bricks.into_iter().collect()
    }
}

impl Survey {
    /// Whether grey values inside sections vary along whole fibres as they do between the
    /// fibres of a bundle, so that the measured radius may be that of the bundle.
    pub fn shows_bundles(&self) -> bool {
        self.inner_deviation >= BUNDLE
    }

    /// Takes radius and grey values from sections, if they are those of fibres. What the
    /// settings give stays. Returns how far blur moves outlines at the middle
    /// between air and fibre inward, mm.
    fn take_sections(
        &mut self,
        settings: &ScanSettings,
        found: &[FibreSection],
        tried: usize,
    ) -> Result<f32, ScanError> {
        let threshold = self.levels.threshold;
        let none = |why: String| {
            Err(ScanError::Content(format!(
                "no fibre was found at the threshold of {threshold}: {why}"
            )))
        };
        if found.len() < LEAST_SECTIONS {
            return none(format!(
                "of {tried} places inside, {} have a round section; expected {LEAST_SECTIONS} or \
                 more",
                found.len()
            ));
        }
        let found = single_fibres(found);
        let of = |value: &dyn Fn(&FibreSection) -> f32| median(found.iter().map(value));
        let middle = FibreSection {
            radius_mm: of(&|s| s.radius_mm),
            length_mm: of(&|s| s.length_mm / (2.0 * s.radius_mm)),
            middle: of(&|s| s.middle),
            slope_per_mm: of(&|s| s.slope_per_mm),
            ..found[0]
        };
        if middle.length_mm < LEAST_LENGTH {
            return none(format!(
                "what exceeds it is {:.3} um wide and only {:.2} times as long",
                2e3 * middle.radius_mm,
                middle.length_mm
            ));
        }
        let mut radii: Vec<f32> = found.iter().map(|s| s.radius_mm).collect();
        radii.sort_by(f32::total_cmp);
        let of = |share: f32| radii[(share * radii.len() as f32) as usize];
        self.radius_deviation_mm = 0.5 * (of(0.75) - of(0.25));
        self.sections = found.len();
        let levels = &mut self.levels;
        let fibre = unblurred(&middle, levels.air, threshold, settings.fibre);
        levels.fibre = fibre.grey;
        if settings.threshold.is_none() {
            levels.threshold = 0.5 * (levels.air + levels.fibre);
        }
        self.blur_mm = fibre.blur_mm;
        let inner: Vec<_> = found.iter().filter_map(|s| s.inner_covariance).collect();
        let count = inner.len().max(1) as f32;
        // Yarns of one cloth have one twist, mostly.
        let mean = |twist: usize| inner.iter().map(|c| c[twist]).sum::<f32>() / count;
        let most = (0..TWISTS.len()).map(mean).fold(0.0, f32::max);
        self.inner_deviation = most.sqrt() / (levels.fibre - levels.air);
        self.fibre_radius_mm = settings.fibre_radius_mm.unwrap_or(fibre.radius_mm);
        Ok(fibre.shrunk_mm())
    }

    fn scales(&self, settings: &ScanSettings) -> Scales {
        Scales::new(
            settings.voxel_mm,
            self.fibre_radius_mm,
            settings.gradient_radii,
            settings.tensor_radii,
        )
    }
}

impl Slab {
    /// Its bytes, packed, for a journal.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Writing to memory does not fail.
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::fast());
        for (number, brick) in &self.bricks {
            let _ = packed.write_all(&number.to_le_bytes());
            let _ = packed.write_all(bytemuck::bytes_of(&**brick));
        }
        packed.finish().unwrap_or_default()
    }

    /// The slab of this index from its bytes; `None` unless they are those of a slab of this
    /// scan.
    pub fn from_bytes(scan: &Scan, index: usize, bytes: &[u8]) -> Option<Slab> {
        let grid = scan.dims.map(|n| n.div_ceil(BRICK));
        let plane = grid.x * grid.y;
        let layers = scan.slab as u32 / BRICK;
        let first = u32::try_from(index).ok()?.checked_mul(layers)?;
        let range = first * plane..(first + layers).min(grid.z) * plane;
        let mut unpacked = ZlibDecoder::new(bytes);
        let mut bricks: Vec<(u32, Box<StoredBrick>)> = Vec::new();
        let mut number = [0u8; 4];
        // Bricks rise in number, so there are no more than the slab has.
        while unpacked.read(&mut number[..1]).ok()? == 1 {
            unpacked.read_exact(&mut number[1..]).ok()?;
            let number = u32::from_le_bytes(number);
            let after = bricks.last().is_none_or(|b| b.0 < number);
            if !(range.contains(&number) && after) {
                return None;
            }
            let mut brick = Box::new([StoredVoxel::default(); BRICK_VOXELS]);
            let voxels = bytemuck::bytes_of_mut(&mut *brick);
            unpacked.read_exact(voxels).ok()?;
            bricks.push((number, brick));
        }
        Some(Slab { index, bricks })
    }

    /// Its number.
    pub fn index(&self) -> usize {
        self.index
    }

    /// Bytes that its bricks take.
    pub fn memory_bytes(&self) -> u64 {
        self.bricks.len() as u64 * size_of::<StoredBrick>() as u64
    }

    /// Puts its bricks into the field.
    pub fn add_to(self, field: &mut ScannedField) {
        for (number, brick) in self.bricks {
            field.put_brick(number, brick);
        }
    }
}

/// Least and greatest grey value after the noise filter.
fn range(
    slices: &mut dyn Slices,
    settings: &ScanSettings,
    watch: Watch<'_>,
) -> Result<(f32, f32), ScanError> {
    let (mut least, mut greatest) = (f32::INFINITY, f32::NEG_INFINITY);
    for_each_window(slices, settings, |window, share| {
        let both = window
            .data
            .par_chunks(1 << 16)
            .map(|part| {
                part.iter()
                    .fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), &v| {
                        (a.min(v), b.max(v))
                    })
            })
            .reduce(
                || (f32::INFINITY, f32::NEG_INFINITY),
                |a, b| (a.0.min(b.0), a.1.max(b.1)),
            );
        (least, greatest) = (least.min(both.0), greatest.max(both.1));
        tell(watch, Stage::Range, share)
    })?;
    // Rounding of the filter makes tiny differences of equal values.
    let tiny = 1e-5 * least.abs().max(greatest.abs());
    if greatest - least <= tiny || !(greatest - least).is_finite() {
        return Err(ScanError::Content(format!(
            "every voxel has the grey value {least}; nothing tells fibre from air"
        )));
    }
    Ok((least, greatest))
}

/// Calls `visit` with consecutive windows that cover the volume.
fn for_each_window(
    slices: &mut dyn Slices,
    settings: &ScanSettings,
    mut visit: impl FnMut(&Window, f32) -> Result<(), ScanError>,
) -> Result<(), ScanError> {
    let nz = i64::from(slices.shape().dims.z);
    let mut first = 0;
    while first < nz {
        let end = (first + PROBE_SLICES as i64).min(nz);
        let window = Window::read(slices, first..end, settings.denoise)?;
        visit(&window, end as f32 / nz as f32)?;
        first = end;
    }
    Ok(())
}

/// Windows of so many slices, spread over all.
fn probes(nz: usize, probe: usize) -> Vec<Range<i64>> {
    let count = nz.div_ceil(probe).min(PROBES);
    let spare = nz - probe;
    let first = |i: usize| match count {
        1 => spare / 2,
        _ => i * spare / (count - 1),
    };
    (0..count)
        .map(|i| first(i) as i64..(first(i) + probe) as i64)
        .collect()
}

/// Distance at which the noise of two filtered values hardly depends on each other, in the least
/// edges of a voxel: scanners smooth noise over a voxel or two, too.
fn noise_reach(settings: &ScanSettings) -> f32 {
    match settings.denoise {
        Denoise::Gaussian(sigma) => (6.0 * sigma).max(4.0),
        Denoise::None | Denoise::Median => 4.0,
    }
}

/// The blocks of a slab.
fn cores(dims: UVec3, z: i64, slices: usize) -> Vec<Core> {
    let (nx, ny) = (dims.x as usize, dims.y as usize);
    let starts = |n: usize| (0..n).step_by(CORE);
    starts(ny)
        .flat_map(|y| {
            starts(nx).map(move |x| Core {
                x,
                y,
                z,
                size: [CORE.min(nx - x), CORE.min(ny - y), slices],
            })
        })
        .collect()
}

/// Residues of voxels with fibre in up to nine blocks of a window.
fn residues_of(window: &Window, dims: UVec3, survey: &Survey, scales: &Scales) -> Vec<f32> {
    let all = cores(dims, window.first, window.count());
    let step = all.len().div_ceil(9);
    let chosen: Vec<Core> = all.into_iter().step_by(step).collect();
    let parts: Vec<Vec<f32>> = chosen
        .iter()
        .map(|core| {
            // Only where the window holds all that the result depends on, if there is such.
            let inner = inner(core, scales);
            analyse(window, inner, &survey.levels, scales, 0.0).residues
        })
        .collect();
    let all: Vec<f32> = parts.into_iter().flatten().collect();
    let step = all.len().div_ceil(RESIDUES).max(1);
    all.into_iter().step_by(step).collect()
}

/// The slices of a core whose neighbours lie in it as well, at least a third of them.
fn inner(core: &Core, scales: &Scales) -> Core {
    let cut = scales.reach()[2].min(core.size[2] / 3);
    Core {
        z: core.z + cut as i64,
        size: [core.size[0], core.size[1], core.size[2] - 2 * cut],
        ..*core
    }
}
