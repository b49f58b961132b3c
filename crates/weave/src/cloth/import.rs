//! Curves from files as yarns or fibres.

mod collide;

use super::spun::Spun;
use super::yarns::{Materials, Yarns};
use super::{Centreline, Cloth, ThreadAtRest};
use crate::curve_file::CurveSet;
use crate::protruding::longest_protruding_mm;
use crate::section::ThreadSection;
use crate::spec::{CurveKind, FabricGeometry};
use crate::strand::{reach_mm, thickest_fibre_mm};
use crate::{Error, Loader};
use glam::{DVec2, DVec3, Vec2};
use organza_basis::{Aabb, Tile};

/// A cloth of the curves in the file called `name`.
pub(super) fn imported(
    fabric: &FabricGeometry,
    name: &str,
    load: Loader,
    seed: u64,
) -> Result<Cloth, Error> {
    let bytes = load(name).map_err(|source| Error::Load {
        key: "draft.curves".to_owned(),
        name: name.to_owned(),
        source,
    })?;
    let unit_mm = fabric.draft.curve_unit_mm.unwrap_or(1.0);
    if !(1e-6..=1e6).contains(&unit_mm) {
        let message = format!("expected a length from 1e-6 to 1e6 mm, found {unit_mm}");
        return Err(Error::spec("draft.curve_unit_mm", message));
    }
    if let Some(sides) = fabric.draft.curve_tile_mm
        && !sides.iter().all(|side| (1e-3..=1e6).contains(side))
    {
        let message = format!("expected lengths from 0.001 to 1e6 mm, found {sides:?}");
        return Err(Error::spec("draft.curve_tile_mm", message));
    }
    let collide = fabric.draft.curves_collide;
    if collide && fabric.draft.curves_are == CurveKind::Fibres {
        let message = "belongs to curves that are \"yarns\" (draft.curves_are)";
        return Err(Error::spec("draft.curves_collide", message));
    }
    let mut yarns = Yarns::new(&fabric.yarn);
    let used = yarns.of_system("weft", &fabric.weft)?;
    let yarns = yarns.built;
    let set = if bytes.starts_with(b"BCC") {
        let radius_mm = yarns[used[0]].fibre_radius_mm;
        CurveSet::read_bcc(&bytes, unit_mm as f32, radius_mm as f32)
    } else {
        CurveSet::read_text(&String::from_utf8_lossy(&bytes), unit_mm as f32)
    };
    let mut set = set.map_err(|e| match e {
        Error::Curves { place, message } => Error::Curves {
            place: format!("draft.curves: {name}: {place}"),
            message,
        },
        other => other,
    })?;
    let tile_mm = fabric.draft.curve_tile_mm.map(DVec2::from_array);
    if collide {
        let of_curve = |i: usize| yarns[used[i % used.len()]].radius_mm();
        let radii_mm: Vec<f64> = (0..set.curves.len()).map(of_curve).collect();
        collide::push_apart(&mut set.curves, &radii_mm, tile_mm)?;
    }
    let mut materials = Materials::default();
    let mut threads = Vec::with_capacity(set.curves.len());
    let mut bounds_mm = Aabb::EMPTY;
    for (i, curve) in set.curves.into_iter().enumerate() {
        let yarn = used[i % used.len()];
        let colours = &fabric.weft.colours;
        let colour = colours.get(i % colours.len().max(1)).copied();
        let line = match fabric.draft.curves_are {
            CurveKind::Fibres => Centreline::Bare(curve.clone()),
            CurveKind::Yarns => Centreline::Imported {
                points: curve.points_mm.iter().map(|p| p.as_dvec3()).collect(),
                closed: curve.closed,
            },
        };
        let pieces = curve.points_mm.windows(2);
        let length_mm: f64 = pieces.map(|p| f64::from(p[0].distance(p[1]))).sum();
        let spun = Spun::new(&yarns[yarn], length_mm.max(f64::MIN_POSITIVE), seed, i);
        let thread = ThreadAtRest {
            line,
            yarn,
            spun,
            dye: materials.dye(&yarns[yarn], colour)?,
            section: ThreadSection::even(DVec2::ONE),
        };
        match &thread.line {
            Centreline::Imported { points, closed } => {
                // The smooth line may bulge beyond its points, by less than
                // an eighth of its longest span and the two beside it.
                let ends = points.windows(2).map(|w| w[0].distance(w[1]));
                let closing = points[0].distance(points[points.len() - 1]);
                let longest = ends.fold(if *closed { closing } else { 0.0 }, f64::max);
                let spun = &thread.spun.yarn;
                let hairs = spun.radius_mm() + longest_protruding_mm(spun);
                let reach = reach_mm(spun).max(hairs) + thickest_fibre_mm(spun) + 0.25 * longest;
                for &p in &curve.points_mm {
                    bounds_mm = bounds_mm.union(&Aabb::new(p, p).grown(reach as f32));
                }
            }
            _ => {
                for (&p, &r) in curve.points_mm.iter().zip(&curve.radii_mm) {
                    bounds_mm = bounds_mm.union(&Aabb::new(p, p).grown(r));
                }
            }
        }
        threads.push(thread);
    }
    if let Some(sides_mm) = tile_mm.map(|sides| sides.as_vec2()) {
        bounds_mm.min = Vec2::ZERO.extend(bounds_mm.min.z);
        bounds_mm.max = sides_mm.extend(bounds_mm.max.z);
    }
    let tile = Tile {
        bounds_mm,
        repeats: tile_mm.is_some(),
    };
    Ok(Cloth::at_rest(yarns, threads, materials, tile))
}

/// The sharpest bend between neighbouring pieces of a line, per millimetre.
pub(super) fn bend_per_mm(points: &[DVec3]) -> f64 {
    let bend = |w: &[DVec3]| {
        let (a, b) = (w[1] - w[0], w[2] - w[1]);
        let length = 0.5 * (a.length() + b.length());
        if length > 0.0 {
            a.angle_between(b) / length
        } else {
            0.0
        }
    };
    points
        .windows(3)
        .map(bend)
        .filter(|b| b.is_finite())
        .fold(0.0, f64::max)
}
