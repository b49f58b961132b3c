//! Several cloths, cloths over meshes, and planes as words: see `bodies.wgsl`.

use super::cell_tables::CellTables;
use super::numbers::Numbers;
use super::scene_words::put;
use super::tables::Tables;
use crate::fibres::Plane;
use crate::fibres::body::Body;
use crate::fibres::matter::FibreMatter;
use crate::refusal::Refusal;
use glam::{DVec3, Mat3, Vec3};
use organza_mesh::{NOBODY, ShellBox, ShellTetrahedron};

const BODY_WORDS: usize = 28;
const BOX_WORDS: usize = 8;
const TETRAHEDRON_WORDS: usize = 60;
/// Most tetrahedra that a box names, and places of the first.
const MOST_IN_BOX: u32 = 15;
const MOST_TETRAHEDRA: u32 = 1 << 28;
const PLANE_WORDS: usize = 12;
/// What stands for infinity: infinite numbers are none of the shading language.
pub const FAR_MM: f64 = 1e30;

/// A place from a point, or as far away as numbers allow.
pub fn place_from(point_mm: DVec3, world_mm: DVec3) -> Vec3 {
    let far = DVec3::splat(FAR_MM);
    (world_mm - point_mm).clamp(-far, far).as_vec3()
}

/// A point among the matter, from which places of the world are counted.
pub fn middle_mm(matter: &FibreMatter) -> DVec3 {
    let shells = matter.bodies.iter().filter_map(|b| b.shell.as_ref());
    let draped = shells
        .map(|s| s.bounds_mm())
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    draped.map_or(matter.middle_mm().as_dvec3(), |(low, high)| {
        0.5 * (low + high)
    })
}

/// Adds the numbers and tables of all bodies and planes of some matter.
///
/// # Errors
/// See [`CellTables::add`].
pub fn add_bodies<'a>(
    matter: &'a FibreMatter,
    middle_mm: DVec3,
    numbers: &mut Numbers,
    tables: &mut Tables<'a>,
) -> Result<(), Refusal> {
    let (mut bodies, mut tetrahedra) = (Vec::new(), Vec::new());
    for body in matter.bodies.iter() {
        bodies.extend(body_words(body, middle_mm, &mut tetrahedra, tables)?);
    }
    let planes = matter.planes.iter();
    let planes = planes.flat_map(|plane| plane_words(plane, middle_mm));
    let planes: Vec<u32> = planes.collect();
    numbers.whole("body_count", matter.bodies.len() as u32);
    numbers.whole("bodies_table", tables.add(bodies));
    numbers.whole("tetrahedra_table", tables.add(tetrahedra));
    numbers.whole("plane_count", matter.planes.len() as u32);
    numbers.whole("planes_table", tables.add(planes));
    Ok(())
}

fn body_words<'a>(
    body: &'a Body,
    middle_mm: DVec3,
    tetrahedra: &mut Vec<u32>,
    tables: &mut Tables<'a>,
) -> Result<[u32; BODY_WORDS], Refusal> {
    let (cells, grid) = (&body.cells, &body.cells.grid);
    let mut words = [0; BODY_WORDS];
    put(&mut words, 0, (grid.corner_mm() - middle_mm).as_vec3());
    put(&mut words, 3, grid.cell_mm().as_vec3());
    words[6..9].copy_from_slice(&grid.dims.as_uvec3().to_array());
    let lengths = [
        cells.lead_mm,
        cells.slack_mm,
        cells.min_edge_mm,
        body.start_mm,
    ];
    words[9..13].copy_from_slice(&lengths.map(f32::to_bits));
    put(&mut words, 13, place_from(grid.corner_mm(), body.low_mm));
    put(&mut words, 16, place_from(grid.corner_mm(), body.high_mm));
    words[19] = u32::from(grid.repeats);
    words[20] = u32::from(body.is_cut);
    let of_cells = CellTables::add(cells, tables)?;
    words[21..24].copy_from_slice(&[of_cells.heads, of_cells.pieces, of_cells.hulls]);
    words[26] = of_cells.ends;
    if let Some(shell) = &body.shell {
        let shell = shell.tables(middle_mm);
        let before = (tetrahedra.len() / TETRAHEDRON_WORDS) as u32;
        let count = before as usize + shell.tetrahedra.len();
        let fullest = shell.boxes.iter().map(|b| b.count).max();
        if count >= MOST_TETRAHEDRA as usize || fullest > Some(MOST_IN_BOX) {
            return Err(Refusal::NotYet("a mesh of so many faces"));
        }
        let boxes = shell.boxes.iter().flat_map(|b| box_words(b, before));
        let boxes: Vec<u32> = boxes.collect();
        words[24] = tables.add(boxes);
        words[25] = shell.boxes.len() as u32;
        for tetrahedron in &shell.tetrahedra {
            tetrahedra.extend(tetrahedron_words(tetrahedron, body, before));
        }
    }
    Ok(words)
}

fn box_words(b: &ShellBox, before: u32) -> [u32; BOX_WORDS] {
    let mut words = [0; BOX_WORDS];
    put(&mut words, 0, b.min_mm);
    words[3] = b.skip;
    put(&mut words, 4, b.max_mm);
    words[7] = (before + b.first) | (b.count << 28);
    words
}

fn tetrahedron_words(t: &ShellTetrahedron, body: &Body, before: u32) -> [u32; TETRAHEDRON_WORDS] {
    let mut words = [0; TETRAHEDRON_WORDS];
    put_columns(&mut words, 0, &t.weights_from_world, t.corner_mm);
    let corner = body.cells.grid.locate(t.cloth_corner_mm);
    put_columns(&mut words, 12, &t.cloth_from_world, corner.at_mm);
    words[24..27].copy_from_slice(&corner.cell.to_array().map(i32::cast_unsigned));
    words[27] = u32::from(t.is_alone);
    words[28..30].copy_from_slice(&corner.period.to_array().map(i32::cast_unsigned));
    put_columns(&mut words, 32, &t.world_from_cloth, Vec3::ZERO);
    put_columns(&mut words, 44, &t.stretch, Vec3::ZERO);
    for (word, neighbour) in words[56..].iter_mut().zip(t.neighbours) {
        *word = match neighbour {
            NOBODY => NOBODY,
            own => before + own,
        };
    }
    words
}

fn plane_words(plane: &Plane, middle_mm: DVec3) -> [u32; PLANE_WORDS] {
    let mut words = [0; PLANE_WORDS];
    let place = plane.position_mm.as_dvec3() - middle_mm;
    for (at, v) in [
        (0, place.as_vec3()),
        (3, plane.normal),
        (6, plane.reflectance.0),
        (9, plane.radiance.0),
    ] {
        put(&mut words, at, v);
    }
    words
}

/// Columns of four: those of a matrix, and a place below them.
fn put_columns(words: &mut [u32], at: usize, m: &Mat3, place: Vec3) {
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    for (k, (column, below)) in columns.into_iter().zip(place.to_array()).enumerate() {
        put(words, at + 4 * k, column);
        words[at + 4 * k + 3] = below.to_bits();
    }
}
