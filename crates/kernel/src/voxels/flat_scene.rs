//! A scene of voxels laid out as plain buffers, for any engine.

use super::blocks::grid_of;
use super::borders::Borders;
use super::camera_rays::CameraRays;
use super::environment::Sky;
use super::even_fibres;
use super::fibre_tables::FibreTables;
use super::flat_medium::FlatMedium;
use super::light_groups::{DirectLight, LightGroups};
use super::optical_depth_table::{
    self, Nodes, OpticalDepthTable, RESIDUAL_FLOOR_OF_GUESSES, extinctions,
};
use crate::matter::{Matter, Scatterers, Unsuited};
use crate::refusal::Refusal;
use glam::Vec3;
use organza_film::{Brightness, Camera};
use organza_light::Light;

/// Words in a table: lanes look words up by signed numbers.
const MAX_WORDS: u64 = 1 << 31;

/// What a picture is made of: matter, what lights it, and the camera that looks at it.
pub struct View<'a, M> {
    /// Matter.
    pub matter: &'a M,
    /// Lights; their light adds.
    pub lights: &'a [Light],
    /// The camera.
    pub camera: &'a Camera,
}

/// A view of matter in voxels, laid out as plain buffers. It knows no back end.
///
/// # Units and frames
/// Places are in voxels from the least corner of the first period of the matter.
/// Directions are unit vectors in the world. Extinctions in words are shares of
/// [`FlatMedium::scale_per_mm`]; a walk measures its lengths in units of one over that.
/// Radiances, irradiances and throughputs are linear red, green and blue.
///
/// # Buffers
/// Elements are `u32`; "bits" means the bits of an `f32`. A voxel has the index
/// `x + nx (y + ny z)`, a node of an optical depth table the index
/// `(x + mx y) mz + z`.
///
/// | buffer | index | what it holds |
/// |---|---|---|
/// | `medium.words` | 2 x place | a population of fibres, and how far around it a bound on the extinction holds: see [`voxel_words`](super::voxel_words) |
/// | `medium.places` | voxel | place of its first population (29 bits), number of populations less one (the upper 3 bits); empty where every voxel is its own place |
/// | `medium.materials` | place | index into `medium.substances`; empty where there is one |
/// | `medium.substances` | 4 x substance | red, green and blue albedo of micro-flakes as bits and their material, or the number of a virtual fibre; the rest unused |
/// | `medium.yarns`, `medium.densest` | place | what films note of a first event |
/// | `fibres.words` | see [`fibre_tables`](super::fibre_tables) | far fields of virtual fibres; empty of micro-flakes |
/// | `fibres.spreads`, `fibres.shown` | code of the end-on ratio | how tangents spread, and what they show |
/// | `depths` | node x lights + light | four optical depths toward a light, 8 bits each: see [`OpticalDepthTable::depths`] |
/// | `lights[i].extinction_per_mm` (`f32`) | voxel | extinction toward the light, 1/mm, for exact rays |
/// | `skies[i].texels` | 3 x texel | radiance of a picture's sky as bits; then that of the whole picture |
/// | `skies[i].lamps[j].places` | 8 x slot | alias table of a lamp's texels |
/// | `skies[i].lamps[j].table.depths` | node | as `depths`, of one light |
///
/// Everything else is a few numbers: the [grid](organza_basis::CellGrid) and its
/// [`Borders`], the [`Nodes`] of the tables, one [`OpticalDepthTable`] and perhaps a
/// [`PlacedLight`](super::placed_light::PlacedLight) for each light, the radiance of two hemispheres, [`CameraRays`], and the
/// limits.
///
/// # What an engine must do
/// - **Random numbers** depend on seed, pixel and sample alone.
/// - **Exact shadow rays.** Depths of a table are approximate; for lights with a place and cut matter
///   they are guesses. Every event adds `(exact - table) / keep` with probability
///   `keep`, and without this term the picture is biased. The engine for processors
///   follows these rays lane by lane on the host
///   ([`ShadowRay`](super::shadow_ray::ShadowRay)). Another engine follows them itself:
///   through `extinction_per_mm` where the ray goes in the table's own direction,
///   otherwise (placed lights, lamps) through `medium.words`; up to the light, to the borders of
///   cut matter, or out of the grid.
/// - **Lights in sight.** A camera ray sees a light directly, before or behind the
///   matter. The engine for processors intersects these rays lane by lane on the host.
///   Another engine intersects panels itself, with the plain numbers of
///   [`Panel`](super::panel::Panel), where a path begins and where an unscattered one leaves.
/// - **Sums** of a pixel are whole numbers ([`organza_film::Tally`]), so they are the same
///   bits in whatever order its samples end.
pub struct FlatScene {
    pub(crate) medium: FlatMedium,
    /// Of a medium of micro-flakes empty.
    pub(crate) fibres: FibreTables,
    /// For lengths in units of one over the medium's scale.
    pub(crate) voxels_per_length: Vec3,
    /// Rays rise or fall by so many voxels in a unit of length at least, so that all leave
    /// endless matter: see [`MAX_PERIODS`].
    pub(crate) least_rise: f32,
    pub(crate) nodes: Nodes,
    /// Parallel lights, then those with a place.
    pub(crate) lights: Vec<OpticalDepthTable>,
    /// Optical depths toward them.
    pub(crate) depths: Vec<u32>,
    /// Radiance from directions with z below zero, and from others.
    pub(crate) environment: [Vec3; 2],
    pub(crate) skies: Vec<Sky>,
    /// Where the matter ends in x and y; `None` of endless matter.
    pub(crate) borders: Option<Borders>,
    pub(crate) camera_rays: CameraRays,
    /// Pixels across the whole picture, which name random numbers.
    pub(crate) film_width: u32,
    /// Names all random numbers.
    pub(crate) seed: u64,
    /// Longest path in events.
    pub(crate) max_bounces: u32,
    /// The unit in which samples are summed.
    pub(crate) brightness: Brightness,
    /// An exact shadow ray is traced with a probability of the light scattered
    /// toward the camera, over the irradiance, per steradian, times this,
    /// times what the table lets through, plus a little.
    pub(crate) residual_scale: f32,
}

impl FlatScene {
    /// Lays out matter, lights and camera. `seed` names all random numbers, paths have
    /// at most `max_bounces` events, and all tables together have at most `max_bytes`.
    ///
    /// # Errors
    /// Why the general walk must render the view.
    pub fn new(
        view: &View<'_, impl Matter>,
        seed: u64,
        max_bounces: u32,
        max_bytes: u64,
    ) -> Result<FlatScene, Refusal> {
        let (cell_grid, blocks) = grid_of(view.matter).ok_or(Unsuited::TooWide)?;
        let tables = blocks.as_ref().map_or(1, |b| b.count());
        let voxels = tables as u64 * cell_grid.dims().as_u64vec3().element_product();
        let groups = LightGroups::new(view.lights, &cell_grid)?;
        let bytes = FlatMedium::min_bytes(voxels) + groups.max_bytes(voxels);
        if bytes > max_bytes {
            return Err(Refusal::Memory(bytes, max_bytes));
        }
        let medium = FlatMedium::new(view.matter)?;
        let fibres = match view.matter.scatterers() {
            Scatterers::Flakes(_) => FibreTables::none(),
            Scatterers::Fibres(all) => even_fibres::tables(&medium, all)?,
        };
        let directions = groups.direct.iter().map(|light| light.direction);
        let extinctions = directions.map(|direction| extinctions(&medium, -direction));
        let extinctions: Vec<Vec<f32>> = extinctions.collect();
        // Lights with a place are wide: a fine table toward their middles would be no better.
        let nodes = Nodes::new(&cell_grid, tables, extinctions.iter().map(Vec::as_slice));
        check_words(&groups, &nodes, &fibres)?;
        let skies = groups.pictures.iter();
        let skies: Vec<Sky> = skies
            .map(|(image, parts)| Sky::new(&medium, nodes, image, parts))
            .collect();
        let brightness = Brightness::of(brightest(&groups, &skies));
        let environment = groups.environment;
        let voxels_per_length = 1.0 / (cell_grid.voxel_mm() * medium.scale_per_mm);
        let longest = cell_grid.most_mm() * f64::from(medium.scale_per_mm);
        let least_rise = (f64::from(cell_grid.dims().z) / longest) as f32;
        let mut lights = optical_depth_tables(groups.direct, extinctions, &medium, nodes);
        Ok(FlatScene {
            depths: optical_depth_table::side_by_side(&mut lights),
            lights,
            nodes,
            voxels_per_length,
            least_rise,
            medium,
            fibres,
            environment,
            skies,
            borders: Borders::of(&cell_grid),
            camera_rays: CameraRays::new(view.camera, view.matter.cell_grid()),
            film_width: view.camera.resolution().x,
            seed,
            max_bounces,
            brightness,
            residual_scale: 3.0,
        })
    }

    /// Bytes of the matter and tables.
    pub fn memory_bytes(&self) -> u64 {
        let tables = self.lights.iter().map(OpticalDepthTable::memory_bytes);
        let tables: u64 = tables.sum();
        let skies: u64 = self.skies.iter().map(Sky::memory_bytes).sum();
        let matter = self.medium.memory_bytes() + self.fibres.memory_bytes();
        matter + skies + tables + 4 * self.depths.len() as u64
    }

    pub(crate) fn has_placed_lights(&self) -> bool {
        self.lights.iter().any(|light| light.placed.is_some())
    }

    /// What a ray from the camera sees of lights before the matter, or behind. The depth is in
    /// lengths of the walk.
    pub(crate) fn lights_in_sight(
        &self,
        at: Vec3,
        direction: Vec3,
        depth: f32,
        behind: bool,
    ) -> Vec3 {
        let cell_grid = &self.medium.cell_grid;
        let depth_mm = depth / self.medium.scale_per_mm;
        let placed = self.lights.iter().filter_map(|light| light.placed.as_ref());
        placed
            .map(|light| light.in_sight(cell_grid, at, direction, depth_mm, behind))
            .sum()
    }
}

/// Refuses tables that are too long to be addressed.
fn check_words(
    groups: &LightGroups<'_>,
    nodes: &Nodes,
    fibres: &FibreTables,
) -> Result<(), Refusal> {
    let of_lights = nodes.words() * groups.direct.len().max(1) as u64;
    let words = of_lights
        .max(groups.picture_words())
        .max(fibres.words.len() as u64);
    if words >= MAX_WORDS {
        return Err(Refusal::Words(words));
    }
    Ok(())
}

/// The brightest that a light can make a pixel, roughly.
fn brightest(groups: &LightGroups<'_>, skies: &[Sky]) -> f32 {
    let direct = groups.direct.iter().map(DirectLight::brightness);
    direct
        .chain(groups.environment.iter().map(|e| e.max_element()))
        .chain(skies.iter().map(|s| s.brightest))
        .fold(0.0, f32::max)
}

/// The tables of lights toward which voxels have these extinctions.
fn optical_depth_tables(
    lights: Vec<DirectLight>,
    extinctions: Vec<Vec<f32>>,
    medium: &FlatMedium,
    nodes: Nodes,
) -> Vec<OpticalDepthTable> {
    let cell_grid = &medium.cell_grid;
    let is_cut = cell_grid.repeats() && !cell_grid.is_endless();
    let tables = lights.into_iter().zip(extinctions);
    let tables = tables.map(|(light, extinctions)| {
        let (direction, irradiance) = (light.direction, light.irradiance);
        let matter = (*cell_grid, medium.blocks.clone());
        let mut table = OpticalDepthTable::new(matter, nodes, direction, irradiance, extinctions);
        table.residual_floor = match &light.placed {
            // Near light the guess is often far off.
            Some(placed) if placed.panel.is_none() => 1.0,
            Some(_) => RESIDUAL_FLOOR_OF_GUESSES,
            None if is_cut => RESIDUAL_FLOOR_OF_GUESSES,
            None => table.residual_floor,
        };
        table.placed = light.placed;
        table
    });
    tables.collect()
}
