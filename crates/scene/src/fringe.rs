//! `[[object.fringe]]`: where a cloth on a mesh is unravelled.

use crate::build_options::BuildOptions;
use crate::cloth_place::ClothPlace;
use crate::curl::{Curled, curl};
use crate::error::{InputError, Result};
use crate::fabric_file::Fabric;
use crate::level::Levels;
use crate::memory::free_memory_bytes;
use crate::stroke::check_places;
use glam::{DVec2, Vec2};
use organza_mesh::{Error, Mesh};
use organza_transport::AnyMedium;
use organza_weave::{Cloth, ThreadSystem};
use serde::Deserialize;
use std::path::Path;

/// A fringe: a rectangle of the cloth in which the threads of one system alone are left.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Fringe {
    /// A corner of the rectangle, on the cloth: mm along weft and warp.
    pub from_mm: [f32; 2],
    /// The corner across.
    pub to_mm: [f32; 2],
    /// The threads that are left.
    pub keep: ThreadSystem,
    /// How far their free ends curl aside, about, mm: 0 to 10.
    #[serde(default)]
    pub curl_mm: f32,
    /// Whether they turn back at the edge of the cloth, each to its neighbour: a selvedge.
    #[serde(default)]
    pub turn: bool,
}

impl Fringe {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn check(&self) -> Result<(), String> {
        check_places(self.from_mm, self.to_mm)?;
        if !(0.0..=10.0).contains(&self.curl_mm) {
            let found = self.curl_mm;
            return Err(format!(".curl_mm: expected 0 to 10, found {found}"));
        }
        if self.turn && self.curl_mm > 0.0 {
            return Err(".turn: threads that turn back do not curl; leave out curl_mm".into());
        }
        match Vec2::from(self.from_mm).cmpeq(self.to_mm.into()).any() {
            true => Err(".to_mm: expected the corner across of a rectangle".into()),
            false => Ok(()),
        }
    }

    /// Its least and greatest corner, moved to where no thread lies.
    fn between_threads_mm(&self, cloth: &Cloth) -> [Vec2; 2] {
        let [a, b] = [self.from_mm, self.to_mm].map(Vec2::from);
        [a.min(b), a.max(b)].map(|corner| {
            let x = cloth.gap_near_mm(ThreadSystem::Warp, corner.x.into());
            let y = cloth.gap_near_mm(ThreadSystem::Weft, corner.y.into());
            DVec2::new(x, y).as_vec2()
        })
    }
}

/// The first fringe for which the cloth has no threads.
pub fn without_threads(fringes: &[Fringe], cloth: &Cloth) -> Option<usize> {
    let has_none = |fringe: &Fringe| cloth.unravelled(fringe.keep).is_none();
    fringes.iter().position(has_none)
}

/// Divides the faces of a mesh at the edges of fringes.
///
/// # Errors
/// More than `most_faces` would be needed.
pub fn cut(
    fringes: &[Fringe],
    cloth: &Cloth,
    mesh: &mut Mesh,
    most_faces: usize,
) -> Result<(), Error> {
    for corner in fringes.iter().flat_map(|f| f.between_threads_mm(cloth)) {
        mesh.cut(|at| at.x, &[corner.x], most_faces)?;
        mesh.cut(|at| at.y, &[corner.y], most_faces)?;
    }
    Ok(())
}

/// Takes the faces of fringes from a mesh that was [cut] and then refined: those with each system of
/// threads, which curl. Where fringes of both systems overlap no thread is left.
///
/// # Errors
/// `: why`; more than `most_faces` would be needed.
pub fn take(
    fringes: &[Fringe],
    fabric: &Fabric,
    mesh: &mut Mesh,
    most_faces: usize,
) -> Result<Vec<(ThreadSystem, Mesh)>, String> {
    let both = [ThreadSystem::Warp, ThreadSystem::Weft];
    let [warp, weft] = both.map(|keep| {
        let own = fringes.iter().enumerate().filter(|(_, f)| f.keep == keep);
        let curled = own.map(|(index, fringe)| Curled {
            corners_mm: fringe.between_threads_mm(&fabric.cloth),
            curl_mm: fringe.curl_mm,
            turns: fringe.turn,
            index,
        });
        curled.collect::<Vec<_>>()
    });
    let is_inside = |own: &[Curled], at: Vec2| own.iter().any(|curled| curled.holds(at));
    mesh.take(|at| is_inside(&warp, at) && is_inside(&weft, at));
    let mut taken = Vec::new();
    for (keep, own) in both.into_iter().zip([&warp, &weft]) {
        if !own.is_empty() {
            taken.push((keep, mesh.take(|at| is_inside(own, at))));
        }
    }
    let is_empty = |part: &Mesh| part.triangles().is_empty();
    if is_empty(mesh) || taken.iter().any(|part| is_empty(&part.1)) {
        return Err(": expected parts of the mesh, found none or all of it".into());
    }
    let left = most_faces.saturating_sub(mesh.triangles().len());
    for (keep, part) in &mut taken {
        let own = match keep {
            ThreadSystem::Warp => &warp,
            ThreadSystem::Weft => &weft,
        };
        curl(own, *keep, fabric, mesh, part, left)
            .map_err(|e| format!(": with a strip for each thread that curls: {e}"))?;
    }
    Ok(taken)
}

/// The threads that are left in fringes, on their meshes, beside a cloth at `place`.
///
/// # Errors
/// A fabric without such threads, or more memory needed than allowed.
pub fn media(
    fringes: &[(ThreadSystem, Mesh)],
    fabric: &Fabric,
    path: &Path,
    place: &ClothPlace<'_>,
    options: &BuildOptions<'_>,
) -> Result<Vec<AnyMedium>> {
    let of_fringe = |(keep, mesh): &(ThreadSystem, Mesh)| {
        let place = ClothPlace {
            mesh: Some(mesh),
            // What is free once the cloth has been traced.
            max_memory_bytes: options.max_memory_bytes.unwrap_or_else(free_memory_bytes),
            ..*place
        };
        let allowed = place.max_memory_bytes;
        let fibres = fabric.explicit_system(*keep, path, allowed, place.loader)?;
        let mut once = Some(AnyMedium::ExplicitFibres(fibres));
        let laid = Levels::only(0).medium(&place, None, |_| Ok(once.take()))?;
        laid.ok_or_else(|| {
            let why = "cannot be laid over the mesh";
            InputError::of_key(place.scene_path, "object.fringe", why)
        })
    };
    fringes.iter().map(of_fringe).collect()
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
        weft = { per_cm = 10.0 }\nyarn.cotton = { tex = 30.0 }";
    const MESH: &str = "v 0 0 3\nv 20 0 3\nv 20 20 3\nv 0 20 3\nvt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\n\
        f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";

    fn scene(more: &str) -> Result<Scene> {
        let text = format!(
            "[[object]]\nkind = 'cloth'\nfabric = 'cloth.toml'\nmesh = 'square.obj'\n\
             mm_per_uv = 10.0\n{more}"
        );
        let mut loader = Loader::new();
        loader.give("frayed/cloth.toml", FABRIC);
        loader.give("frayed/square.obj", MESH);
        from_str(&text, Path::new("frayed/scene.toml"), &[], &loader)?.build(None, &loader)
    }

    /// Whether each of 900 rays over the cloth meets no fibre, and where they go.
    fn passed(scene: &Scene) -> Vec<(DVec2, bool)> {
        let rays = (0..900u32).map(|k| {
            let at = DVec2::new(f64::from(k % 30), f64::from(k / 30)) * 0.65 + 0.41;
            let from = (at.extend(9.0), DVec3::NEG_Z);
            let mut rng = PathRng::new(1, 0, k.into());
            let by = Integrator::Woodcock;
            let seen = trace_from(scene, &[], from, by, 1, &mut rng, &mut Stats::default());
            (at, seen.bounces == 0)
        });
        rays.collect()
    }

    /// In a fringe the cloth is open where only the other threads lay; beside it, it is as before.
    #[test]
    fn a_fringe_lacks_the_other_threads() {
        let whole = passed(&scene("model = 'fibres'").unwrap());
        for keep in ["warp", "weft"] {
            let key = format!(
                "fringe = [{{ from_mm = [-1.0, 12.1], to_mm = [9.8, 30.0], keep = '{keep}' }}]"
            );
            let frayed = scene(&format!("model = 'fibres'\n{key}")).unwrap();
            assert_eq!(frayed.media.len(), 2);
            let mut opened = 0;
            for ((at, before), (_, now)) in whole.iter().zip(passed(&frayed)) {
                // Edges go to the nearest gap.
                let [inside, near] = [-0.5, 0.5].map(|by| at.x < 9.8 + by && at.y > 12.1 - by);
                assert!(now || !before || !inside, "{at}: closed");
                assert!(near || now == *before, "{at}: changed beside the fringe");
                opened += usize::from(inside && now && !before);
            }
            // Threads cover a fifth each: some 26 of the 154 rays inside meet the others alone.
            assert!(
                (8..60).contains(&opened),
                "{keep}: {opened} of {}",
                whole.len()
            );
        }
    }

    /// Where fringes of both systems overlap the cloth is open.
    #[test]
    fn crossing_fringes_leave_no_thread() {
        let of = |keep: &str, to_mm: &str| {
            format!("{{ from_mm = [-1.0, -1.0], to_mm = {to_mm}, keep = '{keep}' }}")
        };
        let [warp, weft] = [of("warp", "[21.0, 8.0]"), of("weft", "[8.0, 21.0]")];
        let of_rays = |fringes: &str| {
            let scene = scene(&format!("model = 'fibres'\nfringe = [{fringes}]")).unwrap();
            let met = passed(&scene).into_iter().filter(|(at, passed)| {
                // Edges go to the nearest gap.
                at.max_element() < 7.5 && !passed
            });
            met.count()
        };
        assert_eq!(of_rays(&format!("{weft}, {warp}")), 0);
        assert!(of_rays(&warp) > 10, "the twin");
    }

    #[test]
    fn fringes_that_cannot_be_are_refused() {
        let at = |x: f32| {
            format!("fringe = [{{ from_mm = [{x:?}, 0.0], to_mm = [50.0, 9.0], keep = 'warp' }}]")
        };
        for (more, expected) in [
            (
                at(5.0) + "\nmodel = 'microflake'",
                "fringe: needs model = \"fibres\"",
            ),
            (
                at(30.0) + "\nmodel = 'fibres'",
                "fringe: expected parts of the mesh",
            ),
            (
                at(50.0) + "\nmodel = 'fibres'",
                "fringe[0].to_mm: expected the corner across",
            ),
            (
                at(5.0).replace("}]", ", turn = true, curl_mm = 1.0}]"),
                "fringe[0].turn: threads that turn back do not curl",
            ),
            (
                at(5.0).replace("}]", ", curl_mm = 11.0}]"),
                "fringe[0].curl_mm: expected 0 to 10",
            ),
        ] {
            let found = scene(&more).err().unwrap().to_string();
            assert!(found.contains(expected), "{more}: {found}");
        }
    }
}
