//! Learning paths: from the camera, over the whole picture, walked to their ends.

use super::error_map::ErrorMap;
use super::error_of_blocks::ErrorOfBlocks;
use super::flow::Flow;
use super::place::Places;
use super::plan::{CacheMode, CachePlan, CacheReport, LearnWatch, Stopped};
use super::table::RadianceTable;
use super::tree::{RadianceTree, Record};
use super::{CacheUse, Note, Notes, RadianceCache};
use crate::fibres::fibre_scene::FibreScene;
use crate::fibres::work::{End, Start, WAVE, Work};
use glam::{DVec3, UVec2, Vec3};
use organza_basis::{PathRng, mix64};
use organza_film::{Camera, Stats};
use organza_lanes::math::pixel_key;
use rayon::prelude::*;

/// Walks some work, with what the walk does at fibres.
pub type Walker<'a> = dyn Fn(CacheUse<'_>, &mut dyn Work) -> Stats + Sync + 'a;

/// Pixels along an edge of a tile of the picture, which is visited as a whole.
const TILE: u32 = CacheReport::BLOCK;
/// Paths of a visit: one a pixel.
pub const VISIT: u64 = (TILE * TILE) as u64;
/// Visits that a thread makes in one go.
pub const VISITS: u64 = 16;
/// Goes between two looks at the clock.
const GOES: u64 = 16;
/// Share of the work that the error of the cache is estimated with.
const TESTED: f64 = 0.15;
/// Share of the rest that fills the bins at the first fibre, if those are used.
const SHARED: f64 = 0.6;
/// Share of the paths of a table in which bins divide.
const DIVIDED: f64 = 0.3;
/// Arrivals after which bins divide.
const SPLIT: u32 = 6;
/// Distance over which the light of a lamp changes, in distances to the lamp.
const LAMP_CHANGE: f64 = 0.1;
/// How often more is learned where the error is too large; each time as much as before.
const MORE: u32 = 3;
/// Visits that may be made for one purpose.
const NAMES: u64 = 1 << 24;

/// Learns a scene's cache.
///
/// # Errors
/// `watch` broke.
pub fn learn(
    scene: &FibreScene,
    plan: &CachePlan,
    walk: &Walker<'_>,
    watch: &LearnWatch<'_>,
) -> Result<RadianceCache, Stopped> {
    let picture = Tiles::new(&scene.camera, scene.seed);
    let (pixel_mm, middle) = picture.seen(walk);
    let light_mm = light_change_mm(scene, middle);
    let columns = scene.camera.resolution().x;
    let places = Places::new(&scene.matter, (pixel_mm, columns), light_mm);
    // Light of other matter is not taken.
    let kept = plan.kept.as_deref();
    let kept = kept.filter(|kept| kept.is_of(&scene.matter));
    let places = kept.map_or(places, |kept| places.with_later(kept.frame));
    let shares = plan.mode == CacheMode::FirstFibre && places.are_shared_at_first();
    let whole_paths = |notes| CacheUse {
        places: Some(&places),
        notes,
        ..CacheUse::default()
    };
    // Tables take up to three times what their tree takes, and the flow as much again.
    let new_tree = |order: u32| {
        let bytes = [plan.bytes / 4, plan.bytes / 8][order as usize];
        RadianceTree::new(places.levels(order), SPLIT, bytes)
    };
    let more = if shares { CachePlan::SHARED } else { 1.0 };
    let usual = more * plan.work as f64;
    let (tested, left) = (TESTED * usual, (1.0 - TESTED) * usual);
    let shared = if shares { SHARED * left } else { 0.0 };
    let later = if kept.is_some() { 0.0 } else { left - shared };
    let mut paths = Paths {
        picture: &picture,
        walk,
        watch,
        all: later + shared + tested,
        done: 0.0,
        made: [0; 3],
    };

    let mut light = Light::default();
    let divided = DIVIDED * later;
    let mut learned = 0;
    let mut at_later = match kept {
        Some(kept) => {
            light.set(kept.picture_mean);
            Later::Kept(kept.table())
        }
        None => {
            let mut tree = new_tree(1);
            learned += paths.walk(0, divided, whole_paths(Notes::From(1)), |go| {
                light.add(go);
                tree.learn(&go.all_records());
            })?;
            Later::Flow(Flow::new(tree.table(), places.levels(1), plan.bytes / 4))
        }
    };
    let mut error = ErrorOfBlocks::new(picture.count);
    let mut rounds = 0;
    loop {
        let whole = CacheUse {
            picture_mean: light.if_any(),
            ..whole_paths(Notes::From(1))
        };
        if let Later::Flow(flow) = &mut at_later {
            let work = later - if rounds == 0 { divided } else { 0.0 };
            learned += paths.walk(0, work, whole, |go| {
                light.add(go);
                go.flow_into(flow);
            })?;
        }
        let second = at_later.table();
        let mut first_paths = 0;
        let mut first = if shares {
            let to_second = CacheUse {
                tables: [None, Some(second)],
                picture_mean: light.if_any(),
                ..whole_paths(Notes::At(0))
            };
            let mut first_tree = new_tree(0);
            let work = shared * f64::from(rounds + 1);
            for part in [DIVIDED * work, (1.0 - DIVIDED) * work] {
                first_paths +=
                    paths.walk(1, part, to_second, |go| first_tree.learn(&go.records))?;
                first_tree.divide_no_more();
            }
            Some(first_tree.table())
        } else {
            None
        };
        let order = u32::from(first.is_none());
        error.restart();
        let mut own = Light::default();
        let work = tested * f64::from(rounds + 1);
        paths.walk(2, work, whole_paths(Notes::From(order)), |go| {
            own.add(go);
            error.add(go, [first.as_ref(), Some(second)], &places);
        })?;
        // What was kept is of another picture.
        let picture_mean = if kept.is_some() { own } else { light }.mean() as f32;
        let [mean_error, block_error_squared] = error.relative_to(f64::from(picture_mean));
        let mut report = CacheReport {
            paths: learned,
            shared_paths: first_paths,
            bins: [
                second.count() as u64,
                first.as_ref().map_or(0, |f| f.count() as u64),
            ],
            mean_error,
            block_error_squared,
            shared_noise: error.noise(picture_mean),
            shared_noise_of_value: error.noises_of_value(),
            error_map: ErrorMap::default(),
            digest: 0,
        };
        if rounds < MORE && kept.is_none() && report.is_surely_above(plan.block_error) {
            rounds += 1;
            paths.all += usual + f64::from(rounds) * (shared + tested);
            continue;
        }
        let mut second = at_later.into_table();
        let sure = report.correct_mean();
        let factor = 1.0 + sure * (error.gain() - 1.0);
        report.error_map = ErrorMap::new(&error.blocks, picture.columns as u32, factor);
        for table in first.iter_mut().chain([&mut second]) {
            table.scale(factor as f32);
        }
        let digest = first.as_ref().map_or(0, RadianceTable::digest);
        report.digest = mix64(second.digest() ^ mix64(digest));
        return Ok(RadianceCache {
            places,
            first,
            second,
            picture_mean,
            report,
        });
    }
}

/// The light at all fibres but the first while it is learned, or as another picture learned it.
enum Later {
    Flow(Flow),
    Kept(RadianceTable),
}

impl Later {
    fn table(&mut self) -> &RadianceTable {
        match self {
            Later::Flow(flow) => flow.table(),
            Later::Kept(table) => table,
        }
    }

    fn into_table(self) -> RadianceTable {
        match self {
            Later::Flow(flow) => flow.into_table(),
            Later::Kept(table) => table,
        }
    }
}

/// Over how many mm the light changes at a place; none if all comes from infinity.
fn light_change_mm(scene: &FibreScene, place: DVec3) -> Option<f64> {
    let near = scene.lights.iter().filter_map(|light| {
        let from = place.as_vec3();
        light.for_kernel().bounds_mm()?;
        // The nearest of some points that are drawn on the lamp.
        let mut rng = PathRng::new(0, 0, 0);
        let drawn = (0..64).filter_map(|_| light.sample_toward(from, &mut rng));
        let rays = drawn.map(|d| organza_basis::Ray::new(from, d.w_in));
        let all = rays.filter_map(|ray| light.distance_along(&ray));
        let near = all.fold(f64::INFINITY, f64::min);
        near.is_finite().then_some(LAMP_CHANGE * near)
    });
    let cut = scene.matter.bodies.iter().filter(|b| b.is_cut).map(|b| {
        let size = b.high_mm - b.low_mm;
        size.x.min(size.y) / 32.0
    });
    near.chain(cut).reduce(f64::min).map(|mm| mm.max(1e-6))
}

/// Paths over the whole picture, of several purposes, each with random numbers of its own.
struct Paths<'a> {
    picture: &'a Tiles,
    walk: &'a Walker<'a>,
    watch: &'a LearnWatch<'a>,
    /// Work that there will be and that is done, see [`CachePlan::work`].
    all: f64,
    done: f64,
    /// Visits made for each purpose.
    made: [u64; 3],
}

impl Paths<'_> {
    /// Walks paths until so much work is done, and gives what they found in the order of
    /// their names; how many they were.
    fn walk(
        &mut self,
        purpose: usize,
        work: f64,
        cache: CacheUse<'_>,
        mut take: impl FnMut(&Go),
    ) -> Result<u64, Stopped> {
        let (mut done, mut count) = (0.0, 0);
        while done < work {
            let first = purpose as u64 * NAMES + self.made[purpose];
            let goes: Vec<(Go, Stats)> = (0..GOES)
                .into_par_iter()
                .map(|n| self.picture.go(first + n * VISITS, cache, self.walk))
                .collect();
            self.made[purpose] += GOES * VISITS;
            for (go, stats) in &goes {
                take(go);
                // Paths that meet nothing take time, too.
                done += ((stats.tentative + stats.shadow_steps) / 16 + stats.paths) as f64;
                count += stats.paths;
            }
            let share = (self.done + done.min(work)) / self.all.max(1.0);
            if (self.watch)(share.min(1.0)).is_break() {
                return Err(Stopped);
            }
        }
        self.done += work;
        Ok(count)
    }
}

/// Light of all paths.
#[derive(Clone, Copy, Default)]
struct Light {
    sum: f64,
    paths: u64,
}

impl Light {
    /// As if one path had found it.
    fn set(&mut self, mean: f32) {
        (self.sum, self.paths) = (f64::from(mean), 1);
    }

    fn add(&mut self, go: &Go) {
        for light in go.lights.iter().flatten() {
            self.sum += f64::from(light.element_sum()) / 3.0;
            self.paths += 1;
        }
    }

    fn mean(&self) -> f64 {
        self.sum / self.paths.max(1) as f64
    }

    fn if_any(&self) -> Option<f32> {
        Some(self.mean() as f32).filter(|mean| *mean > 0.0)
    }
}

/// What the paths of one go found, in the order of their names.
pub struct Go {
    /// Of the first note of every path.
    records: Vec<Option<Record>>,
    /// All notes of paths that ended, and where those of a path lie.
    notes: Vec<Note>,
    notes_of: Vec<std::ops::Range<u32>>,
    /// Radiance of every path; none of those beyond the picture's edge.
    pub lights: Vec<Option<Vec3>>,
    /// The tiles of pairs of visits.
    pub tiles: Vec<usize>,
}

impl Go {
    /// Radiance and notes of a path, if it ended.
    pub fn of_path(&self, path: usize) -> Option<(Vec3, &[Note])> {
        let range = &self.notes_of[path];
        let notes = &self.notes[range.start as usize..range.end as usize];
        Some((self.lights[path]?, notes))
    }

    /// Of all notes.
    fn all_records(&self) -> Vec<Option<Record>> {
        let paths = (0..self.lights.len()).filter_map(|path| self.of_path(path));
        let all = paths.flat_map(|(light, notes)| {
            let records = notes.iter().map(move |note| Record::new(note, light));
            records.map(Some)
        });
        all.collect()
    }

    fn flow_into(&self, flow: &mut Flow) {
        for path in 0..self.lights.len() {
            if let Some((light, notes)) = self.of_path(path) {
                flow.take(light, notes);
            }
        }
    }
}

/// A picture in tiles, which are visited so that few visits are spread over all of it.
struct Tiles {
    camera: Camera,
    seed: u64,
    columns: u64,
    count: u64,
    stride: u64,
}

impl Tiles {
    fn new(camera: &Camera, seed: u64) -> Tiles {
        let size = camera.resolution();
        let columns = u64::from(size.x.div_ceil(TILE));
        let count = columns * u64::from(size.y.div_ceil(TILE));
        // A step of about the golden section that leads to all tiles.
        let mut stride = ((count as f64 * 0.618_034) as u64).max(1);
        while gcd(stride, count) != 1 {
            stride += 1;
        }
        Tiles {
            camera: *camera,
            seed: mix64(seed ^ 0x6c65_6172_6e69_6e67),
            columns,
            count,
            stride,
        }
    }

    /// The visits from `first` on, one after the other; two in a row are to one tile.
    fn go(&self, first: u64, cache: CacheUse<'_>, walk: &Walker<'_>) -> (Go, Stats) {
        let mut work = Learning::new(self, first);
        let stats = walk(cache, &mut work);
        (work.go, stats)
    }

    /// Width of a pixel where paths meet fibres, mm, and a place there.
    fn seen(&self, walk: &Walker<'_>) -> (f64, DVec3) {
        let mut work = Learning::new(self, 0);
        walk(CacheUse::default(), &mut work);
        let depths = &mut work.depths_mm;
        depths.sort_by(f64::total_cmp);
        let pose = self.camera.pose();
        let forward = (pose.target_mm - pose.origin_mm).normalize();
        let depth = depths.get(depths.len() / 2).copied().unwrap_or(1.0);
        let pixel_mm = self.camera.pixel_cone(forward).width_at_mm(depth);
        (pixel_mm, pose.origin_mm + depth * forward)
    }

    /// The tile to which a pair of visits goes.
    fn tile(&self, pair: u64) -> u64 {
        pair % self.count * self.stride % self.count
    }

    /// Pixel and sample of a path; none beyond the edge.
    fn pixel(&self, visit: u64, within: u64) -> Option<(UVec2, u32)> {
        let pair = visit / 2;
        let tile = self.tile(pair);
        let sample = pair / self.count * 2 + visit % 2;
        let corner = UVec2::new(
            (tile % self.columns) as u32 * TILE,
            (tile / self.columns) as u32 * TILE,
        );
        let pixel = corner + UVec2::new(within as u32 % TILE, within as u32 / TILE);
        let is_inside = pixel.cmplt(self.camera.resolution()).all();
        is_inside.then_some((pixel, sample as u32))
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

struct Learning<'a> {
    picture: &'a Tiles,
    first: u64,
    next: u64,
    under_way: [usize; WAVE],
    depths_mm: Vec<f64>,
    go: Go,
}

impl<'a> Learning<'a> {
    fn new(picture: &'a Tiles, first: u64) -> Learning<'a> {
        let paths = (VISITS * VISIT) as usize;
        let pairs = first / 2..(first + VISITS) / 2;
        Learning {
            picture,
            first,
            next: 0,
            under_way: [0; WAVE],
            depths_mm: Vec::new(),
            go: Go {
                records: vec![None; paths],
                notes: Vec::new(),
                notes_of: vec![0..0; paths],
                lights: vec![None; paths],
                tiles: pairs.map(|pair| picture.tile(pair) as usize).collect(),
            },
        }
    }
}

impl Work for Learning<'_> {
    fn begin(&mut self, slot: usize, stats: &mut Stats) -> Option<Start> {
        let found = (self.next..VISITS * VISIT).find_map(|path| {
            let visit = self.first + path / VISIT;
            let (pixel, sample) = self.picture.pixel(visit, path % VISIT)?;
            Some((path, visit, pixel, sample))
        });
        let Some((path, visit, pixel, sample)) = found else {
            self.next = VISITS * VISIT;
            return None;
        };
        self.next = path + 1;
        self.under_way[slot] = path as usize;
        stats.paths += 1;
        let width = u64::from(self.picture.camera.resolution().x);
        let name = u64::from(pixel.y) * width + u64::from(pixel.x);
        // Paths that learn, share and test are others: their visits begin far apart.
        let seed = mix64(self.picture.seed ^ (visit / NAMES));
        let mut rng = PathRng::new(seed, name, u64::from(sample));
        let (origin_mm, direction) = self.picture.camera.ray(pixel, &mut rng);
        Some(Start {
            origin_mm,
            direction,
            key: pixel_key(seed, name),
            index: sample,
        })
    }

    fn end(&mut self, slot: usize, end: &End<'_>, _: &mut Stats) {
        let path = self.under_way[slot];
        // A light that is not finite would make a whole bin so.
        if !end.radiance.is_finite() {
            return;
        }
        self.go.lights[path] = Some(end.radiance);
        let first = end.notes.first();
        self.go.records[path] = first.map(|note| Record::new(note, end.radiance));
        let start = self.go.notes.len() as u32;
        self.go.notes.extend_from_slice(end.notes);
        self.go.notes_of[path] = start..self.go.notes.len() as u32;
        if let Some(first) = end.first {
            self.depths_mm.push(first.depth_mm);
        }
    }
}
