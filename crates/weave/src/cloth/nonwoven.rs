//! Nonwovens: fibres laid until the mass per area is reached.

mod check;

use super::spun::Spun;
use super::yarns::{Materials, Yarns};
use super::{Centreline, Cloth, ThreadAtRest};
use crate::Error;
use crate::blend::spread;
use crate::curve_file::PolyCurve;
use crate::dye::Dye;
use crate::section::ThreadSection;
use crate::separate::{Line, Room, overlap, separate};
use crate::spec::{FabricGeometry, NeedledSides, NeedlingSpec, NonwovenSpec};
use crate::strand::{radius_of_part_mm, thickest_fibre_mm, unit};
use crate::web::{Bonding, Laying, Needling, lattice};
use crate::yarn::Yarn;
use check::check;
use glam::{DVec2, DVec3, Vec3};
use organza_basis::{Aabb, PathRng, Tile};
use std::f64::consts::PI;
use std::sync::Arc;

/// Families of random numbers.
const LAYING: u64 = 8 << 40;
const PUNCHING: u64 = 9 << 40;
const BLENDING: u64 = 10 << 40;
/// The largest number of points on the fibres of a tile: pushing them apart takes about 200
/// bytes for each.
const MAX_POINTS: f64 = (1u64 << 21) as f64;
/// The largest share of the volume that fibres laid at random may fill.
const MAX_FILL: f64 = 0.5;
/// Length of a step along a fibre in its radii, and steps in a wave of crimp and in a radius of
/// curl.
const STEP_RADII: f64 = 8.0;
const STEPS_PER_WAVE: f64 = 14.0;
const STEPS_PER_CURL: f64 = 4.0;
/// Length of fibre that is laid, over that wanted: what is too much is cut off the ends.
const SPARE: f64 = 1.04;
/// The strongest orientation of directions before crimp turns them.
const MAX_ORIENTATION: f64 = 0.96;
const DEFAULT_FIBRES_PER_PUNCH: u32 = 15;
/// How far punches are off their lattice, as a share of its cell (estimated).
const PUNCH_JITTER: f64 = 0.35;

/// What is known of a nonwoven beyond its fibres.
#[derive(Clone, Debug)]
pub(super) struct Web {
    /// Distance of the faces.
    pub thickness_mm: f64,
    /// Punches, and the share of the fibres' length in tufts.
    pub punches: usize,
    pub carried: f64,
    /// Bonding points.
    pub points: usize,
    /// Mean share by which touching fibres still reach into each other.
    pub overlap: f64,
}

/// The nonwoven of a description.
pub(super) fn build(fabric: &FabricGeometry, seed: u64) -> Result<Cloth, Error> {
    let Some(spec) = &fabric.nonwoven else {
        return Err(Error::spec("nonwoven", "is missing"));
    };
    check(fabric, spec)?;
    if fabric.ideal {
        let mut even = fabric.without_irregularity();
        even.ideal = false;
        return build(&even, seed);
    }
    let mut yarns = Yarns::new(&fabric.yarn);
    let index = yarns.index_of("nonwoven.fibre", &spec.fibre)?;
    let yarns = yarns.built;
    let yarn = &yarns[index];
    let laying = laying(spec, yarn)?;
    let area_mm2 = laying.size_mm.x * laying.size_mm.y;
    let volume_mm3 = 1e-3 * spec.areal_density_g_per_m2 * area_mm2 / yarn.fibre_density_g_per_cm3;
    let fill = volume_mm3 / (area_mm2 * spec.thickness_mm);
    if fill > MAX_FILL {
        let message = format!(
            "fibres of {} g/m2 would fill {:.0} % of {} mm, and laid at random they fill at most \
             {:.0} %",
            spec.areal_density_g_per_m2,
            100.0 * fill,
            spec.thickness_mm,
            100.0 * MAX_FILL
        );
        return Err(Error::spec("nonwoven.thickness_mm", message));
    }
    let length_mm = SPARE * volume_mm3 / (PI * yarn.fibre_radius_mm.powi(2));
    if length_mm / laying.step_mm > MAX_POINTS {
        let message = format!(
            "the fibres of {} x {} mm are {:.0} m long, and at most {:.0} m of them are laid; a \
             smaller tile holds fewer",
            spec.tile_mm[0],
            spec.tile_mm[1],
            1e-3 * length_mm,
            1e-3 * MAX_POINTS * laying.step_mm
        );
        return Err(Error::spec("nonwoven.tile_mm", message));
    }

    let mut rng = PathRng::new(seed, 0, LAYING);
    let count = (length_mm / spec.length_mm).round().max(1.0);
    let parts: Option<Vec<usize>> = yarn.blends_materials.then(|| {
        let mut rng = PathRng::new(seed, 0, BLENDING);
        spread(&yarn.blend, count as usize, &mut rng)
    });
    let part = |i: usize| parts.as_ref().map(|p| p[i]);
    let radii_mm: Vec<f64> = (0..count as usize)
        .map(|i| radius_of_part_mm(yarn, part(i), &mut rng))
        .collect();
    let each_mm = length_mm / count;
    let mut fibres: Vec<Vec<DVec3>> = (0..count as usize)
        .map(|i| {
            // Directions are spread evenly over the fibres.
            let turn = (i as f64 + unit(&mut rng)) / count;
            laying.lay(each_mm, turn, &mut rng)
        })
        .collect();
    let mut web = Web {
        thickness_mm: spec.thickness_mm,
        punches: 0,
        carried: 0.0,
        points: 0,
        overlap: 0.0,
    };
    let mut rng = PathRng::new(seed, 0, PUNCHING);
    if let Some(needling) = &spec.needling {
        refuse_too_many_tufts(needling, spec, &laying, length_mm)?;
        let needling = punches(needling, &laying, &mut rng);
        web.punches = needling.punches.len();
        web.carried = needling.carry(&mut fibres, laying.step_mm, &mut rng);
    }
    let mut lines: Vec<Line> = fibres
        .into_iter()
        .zip(&radii_mm)
        .map(|(points, &radius_mm)| Line {
            points,
            radius_mm,
            period: None,
            held: Vec::new(),
        })
        .collect();
    let room = Room {
        size_mm: laying.size_mm,
        faces_mm: laying.faces_mm,
    };
    separate(&mut lines, room);
    web.overlap = overlap(&lines, room).0;
    web.carried /= lines.iter().map(Line::length_mm).sum::<f64>();
    if let Some(spec) = &spec.bonding {
        let middles = lattice(laying.size_mm, 0.01 * spec.points_per_cm2, 0.0, &mut rng);
        web.points = middles.len();
        let thinness = spec.thickness_mm / web.thickness_mm;
        let share = 0.01 * spec.area_percent;
        let bonding = Bonding::new(&middles, share, thinness, laying.size_mm);
        for p in lines.iter_mut().flat_map(|l| &mut l.points) {
            p.z *= bonding.thickness(p.truncate());
        }
    }
    trim(&mut lines, volume_mm3);
    cloth(spec, yarns, index, (lines, &part), web, seed)
}

/// How the fibres run.
fn laying(spec: &NonwovenSpec, yarn: &Yarn) -> Result<Laying, Error> {
    let radius_mm = yarn.fibre_radius_mm;
    let half = 0.5 * spec.thickness_mm - radius_mm;
    if half <= 0.0 {
        let message = format!(
            "expected more than the fibres' thickness of {:.4} mm, found {}",
            2.0 * radius_mm,
            spec.thickness_mm
        );
        return Err(Error::spec("nonwoven.thickness_mm", message));
    }
    // A normal angle of deviation s makes a line exp(s^2 / 2) times longer than its axis and
    // keeps exp(-2 s^2) of the orientation.
    let crimp = 1.0 + 0.01 * spec.crimp_percent.unwrap_or(0.0);
    let crimp_rad = (2.0 * crimp.ln()).sqrt();
    let ratio = spec.anisotropy.unwrap_or(1.0);
    let wanted = (ratio - 1.0) / (ratio + 1.0);
    let kept = (-2.0 * crimp_rad * crimp_rad).exp();
    if wanted.abs() > MAX_ORIENTATION * kept {
        let most = (1.0 + MAX_ORIENTATION * kept) / (1.0 - MAX_ORIENTATION * kept);
        let message = format!(
            "fibres with {} % of crimp reach a ratio from {:.2} to {most:.2}, found {ratio}",
            spec.crimp_percent.unwrap_or(0.0),
            1.0 / most,
        );
        return Err(Error::spec("nonwoven.anisotropy", message));
    }
    let orientation = wanted / kept;
    let crimp_per_mm = 0.1 * spec.crimps_per_cm.unwrap_or(4.0);
    let mut step_mm = STEP_RADII * radius_mm;
    if crimp_rad > 0.0 {
        step_mm = step_mm.min(1.0 / (STEPS_PER_WAVE * crimp_per_mm));
    }
    if let Some(curl_mm) = spec.curl_mm {
        step_mm = step_mm.min(curl_mm / STEPS_PER_CURL);
    }
    Ok(Laying {
        size_mm: DVec2::from_array(spec.tile_mm),
        faces_mm: [-half, half],
        step_mm: step_mm.max(2.0 * radius_mm).min(0.25 * spec.length_mm),
        stretch: (1.0 + orientation) / (1.0 - orientation),
        elevation_rad: spec.out_of_plane_deg.unwrap_or(3.0).to_radians(),
        curl_per_mm: spec.curl_mm.map_or(0.0, f64::recip),
        crimp_rad,
        crimp_per_mm,
    })
}

/// Tufts consist of the fibres that are laid.
fn refuse_too_many_tufts(
    needling: &NeedlingSpec,
    spec: &NonwovenSpec,
    laying: &Laying,
    length_mm: f64,
) -> Result<(), Error> {
    let area_cm2 = 0.01 * laying.size_mm.x * laying.size_mm.y;
    let fibres = f64::from(
        needling
            .fibres_per_punch
            .unwrap_or(DEFAULT_FIBRES_PER_PUNCH),
    );
    // From the middle of the web, each goes out of the other face and back.
    let each_mm = spec.thickness_mm + 2.0 * needling.depth_mm.unwrap_or(0.0);
    let tufts_mm = needling.punches_per_cm2 * area_cm2 * fibres * each_mm;
    if tufts_mm <= length_mm {
        return Ok(());
    }
    let message = format!(
        "{} punches per cm2 of {fibres} fibres, {each_mm} mm each, need {:.1} m of fibre in a tile \
         that has {:.1} m; fewer punches, fewer fibres a punch or less depth need less",
        needling.punches_per_cm2,
        1e-3 * tufts_mm,
        1e-3 * length_mm
    );
    Err(Error::spec("nonwoven.needling.punches_per_cm2", message))
}

fn punches(spec: &NeedlingSpec, laying: &Laying, rng: &mut PathRng) -> Needling {
    let per_mm2 = 0.01 * spec.punches_per_cm2;
    let both = spec.sides == Some(NeedledSides::Both);
    let places = lattice(laying.size_mm, per_mm2, PUNCH_JITTER, rng);
    let depth_mm = spec.depth_mm.unwrap_or(0.0);
    let [low, high] = laying.faces_mm;
    Needling {
        size_mm: laying.size_mm,
        punches: places
            .into_iter()
            .enumerate()
            .map(|(i, at)| (at, both && i % 2 == 1))
            .collect(),
        fibres: spec.fibres_per_punch.unwrap_or(DEFAULT_FIBRES_PER_PUNCH) as usize,
        tuft_mm: spec.tuft_mm.unwrap_or(0.3),
        ends_mm: [low - depth_mm, high + depth_mm],
    }
}

/// Cuts the ends of all fibres so that together they have a volume.
fn trim(lines: &mut [Line], volume_mm3: f64) {
    let volume = |l: &Line| l.length_mm() * PI * l.radius_mm.powi(2);
    let all: f64 = lines.iter().map(volume).sum();
    let kept = (volume_mm3 / all).min(1.0);
    for line in lines {
        let mut left_mm = kept * line.length_mm();
        let mut end = 1;
        while end < line.points.len() {
            let [a, b] = [line.points[end - 1], line.points[end]];
            let piece_mm = a.distance(b);
            if piece_mm >= left_mm {
                line.points[end] = a.lerp(b, left_mm / piece_mm.max(f64::MIN_POSITIVE));
                break;
            }
            left_mm -= piece_mm;
            end += 1;
        }
        line.points.truncate(end + 1);
    }
}

fn cloth(
    spec: &NonwovenSpec,
    yarns: Vec<Arc<Yarn>>,
    index: usize,
    (lines, part): (Vec<Line>, &dyn Fn(usize) -> Option<usize>),
    web: Web,
    seed: u64,
) -> Result<Cloth, Error> {
    let yarn = &yarns[index];
    let mut materials = Materials::default();
    let colours: Vec<_> = match spec.colours.as_slice() {
        [] => vec![None],
        colours => colours.iter().map(|c| Some(*c)).collect(),
    };
    let dyes = colours.iter().map(|c| materials.dye(yarn, *c));
    let dyes = dyes.collect::<Result<Vec<Dye>, Error>>()?;
    let thickest = thickest_fibre_mm(yarn);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut threads = Vec::with_capacity(lines.len());
    for (i, line) in lines.into_iter().enumerate() {
        let mut rng = PathRng::new(seed, i as u64, LAYING);
        let dye = &dyes[i % dyes.len()];
        let dye = match part(i) {
            Some(part) => dye.of_part(part),
            None => dye.of_fibre(&mut rng),
        };
        let material = dye.at(|| 1.0);
        for p in &line.points {
            low = low.min(p.z - thickest);
            high = high.max(p.z + thickest);
        }
        threads.push(ThreadAtRest {
            line: Centreline::Bare(PolyCurve {
                radii_mm: vec![line.radius_mm as f32; line.points.len()],
                points_mm: line.points.iter().map(|p| p.as_vec3()).collect(),
                closed: false,
            }),
            yarn: index,
            spun: Spun::even(yarn),
            dye: Dye::even(material),
            section: ThreadSection::even(DVec2::ONE),
        });
    }
    let [width, height] = spec.tile_mm.map(|s| s as f32);
    let tile = Tile {
        bounds_mm: Aabb::new(
            Vec3::new(0.0, 0.0, (low as f32).next_down()),
            Vec3::new(width, height, (high as f32).next_up()),
        ),
        repeats: true,
    };
    Ok(Cloth {
        web: Some(web),
        seed,
        ..Cloth::at_rest(yarns, threads, materials, tile)
    })
}
