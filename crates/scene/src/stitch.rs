//! `[[object.stitch]]`: rows of lockstitches on a cloth that lies on a mesh.

use crate::fabric_file::Fabric;
use crate::stroke::check_places;
use glam::{DVec2, DVec3, Vec2};
use organza_basis::{Budget, Rgb};
use organza_mesh::{Chart, Mesh};
use organza_weave::{Cloth, Lockstitch, LockstitchSpec, Yarn};
use serde::Deserialize;
use std::fmt::Write;

/// The most stitches in a row.
const MAX_STITCHES: f32 = 1e5;
/// Length of a mesh's edges beside a row, in radii of the thread: as fine as the cloth sinks.
const EDGE: f64 = 2.2;

/// A row of lockstitches, straight on the cloth.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Stitch {
    /// Where it begins, on the cloth: mm along weft and warp.
    pub from_mm: [f32; 2],
    /// Where it ends.
    pub to_mm: [f32; 2],
    /// The thread: a yarn of the fabric, or a preset.
    pub yarn: String,
    /// Its colour.
    #[serde(default = "undyed")]
    pub colour: Rgb,
    /// Length of a stitch, mm.
    #[serde(default = "usual_stitch_mm")]
    pub stitch_mm: f32,
    /// Width of a zigzag, mm; 0 for a straight row.
    #[serde(default)]
    pub zigzag_mm: f32,
    /// Heights over the mesh of the lower and the upper side of all that is sewn, mm; those of the
    /// cloth alone if none.
    pub layers_mm: Option<[f32; 2]>,
    /// How far the cloth's upper side sinks at the needle's holes, mm.
    #[serde(default = "usual_sink_mm")]
    pub sink_mm: f32,
    /// Diameter of the needle's holes, from which yarns are pushed aside, mm; 0 for none.
    #[serde(default)]
    pub hole_mm: f32,
    /// Whether the threads are laid; the lower layers of what is sewn together have holes alone.
    #[serde(default = "has_threads")]
    pub threads: bool,
}

fn undyed() -> Rgb {
    Rgb::new(0.8, 0.8, 0.8)
}

fn usual_stitch_mm() -> f32 {
    3.0
}

fn usual_sink_mm() -> f32 {
    0.1
}

fn has_threads() -> bool {
    true
}

impl Stitch {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn check(&self) -> Result<(), String> {
        check_places(self.from_mm, self.to_mm)?;
        let number = |key: &str, found: f32, from: f32, to: f32| match (from..=to).contains(&found)
        {
            true => Ok(()),
            false => Err(format!(".{key}: expected {from} to {to}, found {found}")),
        };
        number("stitch_mm", self.stitch_mm, 0.2, 100.0)?;
        number("zigzag_mm", self.zigzag_mm, 0.0, 100.0)?;
        number("sink_mm", self.sink_mm, 0.0, 10.0)?;
        // Farther apart, so that yarns between two holes have room.
        let apart_mm = self.stitch_mm.hypot(self.zigzag_mm);
        number("hole_mm", self.hole_mm, 0.0, 0.25 * apart_mm)?;
        for channel in self.colour.0.to_array() {
            number("colour", channel, 0.0, 1.0)?;
        }
        if let Some([low, high]) = self.layers_mm
            && !(low < high && low.abs().max(high.abs()) <= 1e3)
        {
            return Err(format!(
                ".layers_mm: expected two heights within 1000 mm, the lower first, found [{low}, {high}]"
            ));
        }
        let length_mm = Vec2::from(self.from_mm).distance(self.to_mm.into());
        if length_mm > MAX_STITCHES * self.stitch_mm {
            let found = length_mm / self.stitch_mm;
            return Err(format!(
                ".stitch_mm: gives {found:e} stitches, expected at most {MAX_STITCHES:e}"
            ));
        }
        Ok(())
    }
}

/// A row of stitches on a cloth.
pub struct Row<'a> {
    stitch: &'a Stitch,
    lock: Lockstitch,
    radius_mm: f64,
    along: DVec2,
}

impl<'a> Row<'a> {
    /// The row on a cloth of this fabric; `thickness_mm` is that of the cloth, and rows of different
    /// `seed` are not alike.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn new(
        stitch: &'a Stitch,
        fabric: &Fabric,
        thickness_mm: f64,
        seed: u64,
    ) -> Result<Row<'a>, String> {
        let yarn = Yarn::named(&stitch.yarn, &fabric.file.yarn, "yarn");
        let radius_mm = yarn.map_err(|e| format!(".{e}"))?.radius_mm();
        if f64::from(stitch.stitch_mm) < 6.0 * radius_mm {
            let (found, least) = (stitch.stitch_mm, 6.0 * radius_mm);
            return Err(format!(
                ".stitch_mm: expected at least {least:.2}, thrice the thickness of the thread, \
                 found {found}"
            ));
        }
        let half = 0.5 * thickness_mm;
        let spec = LockstitchSpec {
            stitch_mm: stitch.stitch_mm.into(),
            zigzag_mm: stitch.zigzag_mm.into(),
            layers_mm: stitch.layers_mm.map_or([-half, half], |l| l.map(f64::from)),
            sink_mm: stitch.sink_mm.into(),
            hole_mm: stitch.hole_mm.into(),
        };
        let [from, to] = [stitch.from_mm, stitch.to_mm].map(|p| Vec2::from(p).as_dvec2());
        Ok(Row {
            stitch,
            lock: Lockstitch::new(&spec, from.distance(to), radius_mm, seed),
            radius_mm,
            along: (to - from).normalize(),
        })
    }

    /// A place of the cloth, along the row and across it.
    fn own_mm(&self, cloth_mm: Vec2) -> DVec2 {
        let from = Vec2::from(self.stitch.from_mm).as_dvec2();
        let away = cloth_mm.as_dvec2() - from;
        DVec2::new(away.dot(self.along), self.along.perp_dot(away))
    }

    /// How long the edges of the mesh may be at a place of the cloth.
    fn longest_edge_mm(&self, cloth_mm: Vec2) -> f32 {
        let own = self.own_mm(cloth_mm);
        let reach = self.lock.reach_mm() + 0.5 * f64::from(self.stitch.zigzag_mm);
        let beyond = own.x.max(0.0).min(self.row_mm());
        let away = own.distance(DVec2::new(beyond, 0.0));
        // Longer, the farther away, so that wide faces do not meet narrow ones.
        let fine = (EDGE * self.radius_mm).min(f64::from(self.stitch.stitch_mm) / 8.0);
        let edge = fine + (away - reach).max(0.0);
        edge.min(self.lock.longest_edge_mm(own)) as f32
    }

    /// Where cloth that lay at a place is pushed by the needle; `None` in the middle of a hole.
    fn pushed_mm(&self, cloth_mm: Vec2) -> Option<Vec2> {
        let pushed = self.lock.pushed_mm(self.own_mm(cloth_mm))?;
        let pushed = pushed.x * self.along + pushed.y * self.along.perp();
        Some(cloth_mm + pushed.as_vec2())
    }

    fn row_mm(&self) -> f64 {
        let [from, to] = [self.stitch.from_mm, self.stitch.to_mm].map(Vec2::from);
        f64::from(from.distance(to))
    }

    /// The threads in the world: of the needle and of the bobbin.
    ///
    /// # Errors
    /// `.key: why`: the row leaves the mesh.
    fn threads_mm(&self, charts: &[Chart]) -> Result<[Vec<DVec3>; 2], String> {
        let from = Vec2::from(self.stitch.from_mm).as_dvec2();
        let lifted = |points: Vec<DVec3>| {
            let (mut face, mut chart) = (0, 0);
            let lift = |p: DVec3| {
                let cloth = from + p.x * self.along + p.y * self.along.perp();
                let place = cloth.extend(p.z);
                let found = (0..charts.len()).find_map(|k| {
                    let own = (chart + k) % charts.len();
                    let found = charts[own].lift_mm(place, &mut face)?;
                    chart = own;
                    Some(found)
                });
                found.ok_or_else(|| {
                    format!(
                        ": leaves the mesh at {:.2}, {:.2} mm of the cloth",
                        cloth.x, cloth.y
                    )
                })
            };
            points.into_iter().map(lift).collect::<Result<Vec<_>, _>>()
        };
        Ok([
            lifted(self.lock.needle_thread_mm())?,
            lifted(self.lock.bobbin_thread_mm())?,
        ])
    }
}

/// Cloths of the threads in the world, one for each row, over a mesh that is not [pressed](press) yet.
///
/// # Errors
/// `[row].key: why`.
pub fn threads(
    rows: &[Row<'_>],
    mesh: &Mesh,
    fabric: &Fabric,
    max_bytes: u64,
) -> Result<Vec<Cloth>, String> {
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let bytes = mesh.triangles().len() as u64 * Chart::BYTES_PER_FACE;
    let taken = Budget::new(max_bytes).take(bytes, "charts of the mesh");
    taken.map_err(|e| format!(": {e}"))?;
    let charts = Chart::all(mesh);
    let of_row = |(i, row): (usize, &Row<'_>)| {
        let threads = row.threads_mm(&charts);
        let threads = threads.map_err(|why| format!("[{i}]{why}"))?;
        let mut text = String::new();
        for p in threads
            .iter()
            .flat_map(|t| t.iter().map(Some).chain([None]))
        {
            // Writing to a string cannot fail.
            let _ = match p {
                Some(p) => writeln!(text, "{} {} {} {}", p.x, p.y, p.z, row.radius_mm),
                None => writeln!(text),
            };
        }
        let made = fabric.threads(&row.stitch.yarn, row.stitch.colour, text.into_bytes());
        made.map_err(|e| format!("[{i}].yarn: {e}"))
    };
    let sewn = rows
        .iter()
        .enumerate()
        .filter(|(_, row)| row.stitch.threads);
    sewn.map(of_row).collect()
}

/// How long the edges of the mesh may be at a place of the cloth, so that rows show.
pub fn longest_edge_mm(rows: &[Row<'_>], cloth_mm: Vec2) -> f32 {
    let (mut place, mut least) = (cloth_mm, f32::INFINITY);
    for row in rows {
        least = least.min(row.longest_edge_mm(place));
        // Rows that are near each other push cloth one after the other.
        place = row.pushed_mm(place).unwrap_or(place);
    }
    least
}

/// Opens the holes of the needle in a mesh.
///
/// # Errors
/// `: why`, when nothing is left of the mesh.
pub fn pierce(rows: &[Row<'_>], mesh: &mut Mesh) -> Result<(), String> {
    if !rows.iter().any(|row| row.lock.has_holes()) {
        return Ok(());
    }
    let shift = |at_mm: Vec2| {
        let place = rows.iter().try_fold(at_mm, |p, row| row.pushed_mm(p))?;
        Some(place - at_mm)
    };
    mesh.shift(shift).map_err(|e| format!(": {e}"))
}

/// Presses a cloth of that thickness on its mesh where it is stitched.
pub fn press(rows: &[Row<'_>], mesh: &mut Mesh, thickness_mm: f64) {
    if rows.is_empty() {
        return;
    }
    mesh.press(thickness_mm as f32, |at_mm| {
        let depths = rows.iter().map(|row| row.lock.depth_mm(row.own_mm(at_mm)));
        depths.fold(0.0, f64::max) as f32
    });
}

#[cfg(test)]
mod tests {
    use crate::Result;
    use crate::from_str;
    use crate::loader::Loader;
    use glam::{DVec2, DVec3};
    use organza_basis::PathRng;
    use organza_transport::{Integrator, Scene, Stats, trace_from};
    use std::path::Path;

    const FABRIC: &str = "draft = { weave = 'plain' }\nwarp = { per_cm = 10.0 }\n\
        weft = { per_cm = 10.0 }\nyarn.cotton = { tex = 30.0 }\nyarn.thread = { preset = 'polyester', tex = 40.0 }";
    /// 20 x 20 mm that lie at a height of 3 mm.
    const MESH: &str = "v 0 0 3\nv 20 0 3\nv 20 20 3\nv 0 20 3\nvt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\n\
        f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";

    fn sewn(stitch: &str) -> Result<Scene> {
        sewn_with(stitch, "")
    }

    /// The same with more keys of the object.
    fn sewn_with(stitch: &str, more: &str) -> Result<Scene> {
        let text = format!(
            "[[object]]\nkind = 'cloth'\nfabric = 'cloth.toml'\nmodel = 'fibres'\n\
             mesh = 'square.obj'\nmm_per_uv = 10.0\nstitch = [{{ {stitch} }}]\n{more}"
        );
        let mut loader = Loader::new();
        loader.give("sewn/cloth.toml", FABRIC);
        loader.give("sewn/square.obj", MESH);
        from_str(&text, Path::new("sewn/scene.toml"), &[], &loader)?.build(None, &loader)
    }

    #[test]
    fn threads_lie_on_both_sides_of_the_cloth_along_the_row() {
        let row = "from_mm = [4.0, 10.0], to_mm = [16.0, 10.0], yarn = 'thread'";
        let scene = sewn(row).unwrap();
        assert_eq!(scene.media.len(), 2);
        let bounds = scene.media[1].cell_grid().unwrap().bounds_mm();
        assert!(bounds.min.x < 4.0 && bounds.max.x > 16.0, "{bounds:?}");
        assert!(bounds.size().y < 2.0 && bounds.size().z < 3.0, "{bounds:?}");
        assert!(bounds.min.z < 2.8 && bounds.max.z > 3.2, "{bounds:?}");
        // The yarn of the thread has optics, which the cloth's own yarns do not ask for.
        sewn_with(row, "optics.thread.ior = 1.6").unwrap();
        let wrong = sewn_with(row, "optics.tread.ior = 1.6").err().unwrap();
        let wrong = wrong.to_string();
        assert!(wrong.contains("did you mean `thread`"), "{wrong}");
        // What is sewn may be thicker than the cloth.
        let scene = sewn(&format!("{row}, layers_mm = [-2.0, 0.3]")).unwrap();
        let bounds = scene.media[1].cell_grid().unwrap().bounds_mm();
        assert!(bounds.min.z < 1.1, "{bounds:?}");
    }

    /// Light comes through the holes of the needle, and no more of it where there are none.
    #[test]
    fn light_comes_through_holes() {
        let row = "from_mm = [4.0, 10.0], to_mm = [16.0, 10.0], yarn = 'thread', threads = false";
        let passed = |stitch: &str| {
            let scene = sewn(stitch).unwrap();
            assert_eq!(scene.media.len(), 1);
            let mut stats = Stats::default();
            let by = Integrator::Woodcock;
            let rays = (0..1200).filter(|&k| {
                // Over a strip of 13 by 0.9 mm.
                let at = DVec2::new(
                    3.5 + 0.065 * f64::from(k % 200),
                    9.55 + 0.15 * f64::from(k / 200),
                );
                let from = (at.extend(9.0), DVec3::NEG_Z);
                let mut rng = PathRng::new(1, 0, u64::from(k as u32));
                let seen = trace_from(&scene, &[], from, by, 1, &mut rng, &mut stats);
                seen.bounces == 0
            });
            rays.count() as f64
        };
        let [without, with] = [row.to_owned(), format!("{row}, hole_mm = 0.7")].map(|s| passed(&s));
        // Five holes of the strip's 11.7 mm2: where threads cross, they stopped at least as much of
        // the light as elsewhere, and at most all of it.
        let holes = 1200.0 * 5.0 * 0.25 * std::f64::consts::PI * 0.49 / 11.7;
        let least = holes * (1.0 - without / 1200.0);
        // Margin: four standard errors of a count. Cloth that opens no holes gains nothing.
        let more = with - without;
        let bounds = least - 4.0 * least.sqrt()..holes + 4.0 * holes.sqrt();
        assert!(
            bounds.start > 0.0 && bounds.contains(&more),
            "seed 1: {more} more, expected {bounds:?}"
        );
    }

    #[test]
    fn wrong_rows_are_refused_with_their_key() {
        let row = "from_mm = [4.0, 10.0], to_mm = [16.0, 10.0]";
        for (stitch, expected) in [
            (
                format!("{row}, yarn = 'tread'"),
                "object[0].stitch[0].yarn: there is no",
            ),
            (format!("{row}, yarn = 'tread'"), "did you mean \"thread\""),
            (
                format!("{row}, yarn = 'thread', sink_mm = 11.0"),
                "stitch[0].sink_mm: expected 0 to 10",
            ),
            (
                format!("{row}, yarn = 'thread', hole_mm = 0.8"),
                "stitch[0].hole_mm: expected 0 to 0.75",
            ),
            (
                format!("{row}, yarn = 'thread', stitch_mm = 0.3"),
                "stitch_mm: expected at least",
            ),
            (
                format!("{row}, yarn = 'thread', layers_mm = [1.0, 0.0]"),
                "layers_mm: expected two heights",
            ),
            (
                "from_mm = [4.0, 10.0], to_mm = [26.0, 10.0], yarn = 'thread'".into(),
                "leaves the mesh at 2",
            ),
            (
                "from_mm = [4.0, 1.0], to_mm = [4.0, 1.0], yarn = 'thread'".into(),
                "stitch[0].to_mm",
            ),
        ] {
            let found = sewn(&stitch).err().unwrap().to_string();
            assert!(found.contains(expected), "{stitch}: {found}");
        }
    }
}
