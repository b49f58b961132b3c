//! How the free threads of fringes curl, and how those of selvedges turn back.

use crate::fabric_file::Fabric;
use glam::{Vec2, Vec3};
use organza_basis::PathRng;
use organza_mesh::{Error, Mesh};
use organza_weave::{Cloth, ThreadSystem};
use std::collections::HashSet;
use std::f32::consts::FRAC_PI_2;

/// Random numbers of curls.
const CURL: u64 = 21 << 40;
/// Bends of a thread repeat after about so many of its spacings, and so many neighbours bend alike
/// (estimated).
const ALONG: f32 = 10.0;
const NEIGHBOURS: f32 = 3.0;
/// Shares of what neighbours do alike and of what a thread does alone, of which the squares add up
/// to 1 (estimated).
const ALIKE: f32 = 0.8;
const ALONE: f32 = 0.6;
/// How far a thread rises, as a share of how far it goes aside (estimated): its weight bends it down.
const RISE: f32 = 0.25;
/// Steps in which the course of a thread is found.
const STEPS: usize = 64;
/// Nearer to an end of a fringe than this share of its length, a corner lies on it.
const ON_END: f32 = 0.01;
/// Edges of the mesh of threads that turn back are at most this share of their spacing.
const TURN_EDGE: f32 = 0.12;
/// The share of its width that such a thread takes with it: a little of it lies inside every bow.
const TURN_WIDTH: f32 = 0.96;

/// A rectangle of a fringe whose threads curl: its least and greatest corner, how far the free ends go
/// aside, whether they turn back instead, and which fringe it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curled {
    pub corners_mm: [Vec2; 2],
    pub curl_mm: f32,
    pub turns: bool,
    pub index: usize,
}

impl Curled {
    /// Whether a place of the cloth lies in it.
    pub fn holds(&self, at: Vec2) -> bool {
        let [low, high] = self.corners_mm;
        at.cmpge(low).all() && at.cmple(high).all()
    }
}

/// Which way threads run: the axes along and across them.
fn axes(keep: ThreadSystem) -> [usize; 2] {
    match keep {
        ThreadSystem::Warp => [1, 0],
        ThreadSystem::Weft => [0, 1],
    }
}

/// The strips of its mesh on which the threads of a fringe lie.
struct Strips {
    curled: Curled,
    /// Between its threads, mm across them, and the mean distance of threads.
    gaps_mm: Vec<f32>,
    spacing_mm: f32,
    /// Where the fringe ends along its threads, mm, and at which end cloth holds it.
    ends_mm: [f32; 2],
    is_held: [bool; 2],
    /// The number of its first thread among those of all fringes, from 1.
    first: usize,
}

/// A thread: from which place along it, mm, to which side, how long it is, the share of its width
/// that turns with it, and points on its way.
struct Thread {
    from_mm: f32,
    side: f32,
    length_mm: f32,
    across_mm: f32,
    width: f32,
    points: Vec<Point>,
}

/// Where a place of a thread goes: across, along and up, mm, and how it turns aside, rad.
#[derive(Clone, Copy, Default)]
struct Point {
    moved_mm: Vec3,
    turned_rad: f32,
}

/// Bends the threads of fringes on their mesh, beside `cloth_mesh`, from which it was taken: more, the
/// farther from the edge at which the cloth holds them.
///
/// # Errors
/// More than `most_faces` would be needed.
pub(crate) fn curl(
    all: &[Curled],
    keep: ThreadSystem,
    fabric: &Fabric,
    cloth_mesh: &Mesh,
    mesh: &mut Mesh,
    most_faces: usize,
) -> Result<(), Error> {
    let [along, across] = axes(keep);
    let held: HashSet<u32> = cloth_mesh.corners().iter().flatten().copied().collect();
    let (mut fringes, mut first) = (Vec::new(), 1);
    for curled in all.iter().filter(|c| c.curl_mm > 0.0 || c.turns) {
        let mut fringe = Strips::new(*curled, keep, &fabric.cloth, &held, mesh, first, most_faces);
        let held = fringe.is_held.iter().filter(|held| **held).count();
        // Threads turn back at a free end alone.
        if held == 1 || (held == 2 && !curled.turns) {
            if curled.turns {
                fringe.shorten(keep, &fabric.cloth, mesh, most_faces)?;
            }
            first += fringe.gaps_mm.len() + 1;
            fringes.push(fringe);
        }
    }
    if fringes.is_empty() {
        return Ok(());
    }
    let mut lines: Vec<f32> = fringes.iter().flat_map(|f| f.gaps_mm.clone()).collect();
    lines.sort_by(f32::total_cmp);
    mesh.cut(|at| at[across], &lines, most_faces)?;
    let longest = |at: Vec2| {
        let inside = fringes.iter().filter(|f| f.curled.holds(at));
        inside
            .map(|f| f.spacing_mm * if f.curled.turns { TURN_EDGE } else { 1.5 })
            .fold(f32::INFINITY, f32::min)
    };
    mesh.refine(longest, most_faces)?;
    let threads: Vec<Thread> = fringes
        .iter()
        .flat_map(|f| f.threads(fabric.file.seed))
        .collect();
    let part_at = |middle: Vec2| {
        let fringe = fringes.iter().find(|f| f.curled.holds(middle));
        fringe.map_or(0, |f| {
            f.first + f.gaps_mm.partition_point(|gap| *gap < middle[across])
        })
    };
    mesh.tear(part_at, |part, at| {
        let moved = match part {
            0 => Vec3::ZERO,
            _ => threads[part - 1].moved_mm(at[along], at[across]),
        };
        match keep {
            ThreadSystem::Warp => moved,
            ThreadSystem::Weft => Vec3::new(moved.y, moved.x, moved.z),
        }
    });
    Ok(())
}

impl Strips {
    fn new(
        curled: Curled,
        keep: ThreadSystem,
        cloth: &Cloth,
        held: &HashSet<u32>,
        mesh: &Mesh,
        first: usize,
        most: usize,
    ) -> Strips {
        let [along, across] = axes(keep);
        let faces = mesh.triangles().iter().zip(mesh.corners());
        let inside = faces.filter(|(t, _)| {
            let middle = t.iter().map(|v| v.uv_mm).sum::<Vec2>() / 3.0;
            curled.holds(middle)
        });
        let inside: Vec<_> = inside.collect();
        let range = |axis: usize| {
            let places = inside.iter().flat_map(|(t, _)| t.map(|v| v.uv_mm[axis]));
            places.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], p| {
                [low.min(p), high.max(p)]
            })
        };
        let [ends_mm, sides_mm] = [range(along), range(across)];
        let near_mm = ON_END * (ends_mm[1] - ends_mm[0]);
        // An edge: its corner alone may belong to cloth beside the fringe.
        let is_held = ends_mm.map(|end_mm| {
            inside.iter().any(|(t, ids)| {
                let on = t.iter().zip(*ids).filter(|(v, id)| {
                    held.contains(*id) && (v.uv_mm[along] - end_mm).abs() <= near_mm
                });
                on.count() >= 2
            })
        });
        let mut gaps_mm: Vec<f32> = match is_held.contains(&true) {
            true => cloth
                .gaps_between_mm(keep, sides_mm.map(f64::from), most)
                .iter()
                .map(|gap| *gap as f32)
                .collect(),
            false => Vec::new(),
        };
        // Those at the sides part nothing.
        let aside_mm = 1e-3 * (sides_mm[1] - sides_mm[0]) / (gaps_mm.len() + 1) as f32;
        gaps_mm.retain(|g| *g > sides_mm[0] + aside_mm && *g < sides_mm[1] - aside_mm);
        Strips {
            curled,
            spacing_mm: (sides_mm[1] - sides_mm[0]) / (gaps_mm.len() + 1) as f32,
            gaps_mm,
            ends_mm,
            is_held,
            first,
        }
    }

    /// Its threads from the least place across them.
    fn threads(&self, seed: u64) -> Vec<Thread> {
        let count = self.gaps_mm.len() + 1;
        (0..count).map(|k| self.thread(k, seed)).collect()
    }

    fn thread(&self, k: usize, seed: u64) -> Thread {
        let [low, high] = self.ends_mm;
        let length_mm = high - low;
        // From the end that is held.
        let (from_mm, side) = match self.is_held {
            [false, true] => (high, -1.0),
            _ => (low, 1.0),
        };
        if self.curled.turns {
            return Thread {
                from_mm,
                side,
                length_mm,
                across_mm: self.across_mm(k),
                width: TURN_WIDTH,
                points: self.bow(k, length_mm),
            };
        }
        // Aside and up, before the thread keeps its length.
        let aimed = |step: usize| {
            let t = step as f32 / STEPS as f32;
            let weight = match self.is_held {
                [true, true] => (4.0 * t * (1.0 - t)).powi(2),
                _ => t * t,
            };
            // Farther, a whole number could not tell places apart.
            let along = (t * length_mm / (ALONG * self.spacing_mm)).min(1e6);
            let bend = |kind: u64| {
                let stream = CURL + 4 * self.curled.index as u64 + kind;
                let neighbours = k as f32 / NEIGHBOURS;
                ALIKE * smooth(seed, stream, Vec2::new(neighbours, along))
                    + ALONE * smooth_along(seed, stream + 2, k, along)
            };
            self.curled.curl_mm * weight * Vec2::new(bend(0), RISE * bend(1).powi(2))
        };
        let both = self.is_held == [true, true];
        let step_mm = length_mm / STEPS as f32;
        let mut points = vec![Point::default()];
        let mut place_mm = Vec3::ZERO;
        for step in 0..STEPS {
            let slope = (aimed(step + 1) - aimed(step)) / step_mm;
            let heading = match both {
                // Held at its other end, it becomes a little longer instead.
                true => Vec3::new(slope.x, 1.0, slope.y),
                false => Vec3::new(slope.x, 1.0, slope.y).normalize(),
            };
            place_mm += step_mm * heading;
            let straight_mm = Vec3::Y * ((step + 1) as f32 * step_mm);
            points.push(Point {
                moved_mm: place_mm - straight_mm,
                turned_rad: slope.x.atan(),
            });
        }
        if let Some(last) = points.last_mut().filter(|_| both) {
            // The cloth holds it straight.
            last.turned_rad = 0.0;
        }
        Thread {
            from_mm,
            side,
            length_mm,
            across_mm: self.across_mm(k),
            width: 1.0,
            points,
        }
    }

    /// The middle of a thread, across it.
    fn across_mm(&self, k: usize) -> f32 {
        let before = k.checked_sub(1).map(|k| self.gaps_mm[k]);
        match (before, self.gaps_mm.get(k)) {
            (Some(a), Some(b)) => 0.5 * (a + b),
            (None, Some(b)) => b - 0.5 * self.spacing_mm,
            (Some(a), None) => a + 0.5 * self.spacing_mm,
            (None, None) => 0.0,
        }
    }

    /// Takes from threads that turn back what lies beyond one thread of the other system, around
    /// which they bend.
    ///
    /// # Errors
    /// More than `most_faces` would be needed.
    fn shorten(
        &mut self,
        keep: ThreadSystem,
        cloth: &Cloth,
        mesh: &mut Mesh,
        most_faces: usize,
    ) -> Result<(), Error> {
        let [along, _] = axes(keep);
        let other = match keep {
            ThreadSystem::Warp => ThreadSystem::Weft,
            ThreadSystem::Weft => ThreadSystem::Warp,
        };
        let ([low, high], is_low) = (self.ends_mm, self.is_held[0]);
        let near_mm = ON_END * (high - low);
        let gaps = cloth.gaps_between_mm(other, self.ends_mm.map(f64::from), most_faces);
        let mut gaps = gaps.iter().map(|gap| *gap as f32);
        let end = match is_low {
            true => gaps.find(|gap| *gap > low + near_mm),
            false => gaps.rfind(|gap| *gap < high - near_mm),
        };
        if let Some(end) = end {
            mesh.cut(|at| at[along], &[end], most_faces)?;
            let is_beyond = |at: Vec2| (at[along] > end) == is_low && self.curled.holds(at);
            mesh.take(is_beyond);
            self.ends_mm[usize::from(is_low)] = end;
        }
        Ok(())
    }

    /// Half of a bow of a thread to its neighbour, which has the other half; straight without one.
    fn bow(&self, k: usize, length_mm: f32) -> Vec<Point> {
        // At the other edge of the cloth the threads turn to their other neighbours.
        let neighbour = match (k + usize::from(self.is_held[0])) % 2 {
            0 => k.checked_sub(1),
            _ => Some(k + 1).filter(|next| *next <= self.gaps_mm.len()),
        };
        let to_mm = neighbour.map_or(0.0, |n| self.across_mm(n) - self.across_mm(k));
        if to_mm == 0.0 {
            return vec![Point::default(); STEPS + 1];
        }
        let radius_mm = 0.5 * to_mm;
        let at = |step: usize| {
            let t = step as f32 / STEPS as f32;
            let angle = t * FRAC_PI_2;
            let ahead_mm = radius_mm.abs() * angle.sin() - t * length_mm;
            Point {
                moved_mm: Vec3::new(radius_mm * (1.0 - angle.cos()), ahead_mm, 0.0),
                turned_rad: angle * to_mm.signum(),
            }
        };
        (0..=STEPS).map(at).collect()
    }
}

impl Thread {
    /// How far a place of the thread goes: across, along and up, mm.
    fn moved_mm(&self, along_mm: f32, across_mm: f32) -> Vec3 {
        let share = (self.side * (along_mm - self.from_mm) / self.length_mm).clamp(0.0, 1.0);
        let at = share * STEPS as f32;
        let k = (at as usize).min(STEPS - 1);
        let [a, b] = [self.points[k], self.points[k + 1]];
        let mut moved = a.moved_mm.lerp(b.moved_mm, at - k as f32);
        // What lies beside the middle of the thread turns with it.
        let turned_rad = a.turned_rad + (at - k as f32) * (b.turned_rad - a.turned_rad);
        let beside = self.width * (across_mm - self.across_mm);
        let (sin, cos) = turned_rad.sin_cos();
        moved.x += beside * (cos - 1.0);
        moved.y -= beside * sin;
        moved.y *= self.side;
        moved
    }
}

/// A random number of variance 1 for a point of a lattice, within the square root of 3.
fn at_lattice(seed: u64, stream: u64, [x, y]: [u32; 2]) -> f32 {
    let index = (u64::from(x) << 32) | u64::from(y);
    3f32.sqrt() * (2.0 * PathRng::new(seed, stream, index).unit() - 1.0)
}

/// Variance that is left between two points of a lattice, on average.
const BETWEEN: f32 = 26.0 / 35.0;

/// Smooth noise of variance 1 over positive places.
fn smooth(seed: u64, stream: u64, at: Vec2) -> f32 {
    let (cell, share) = (at.floor().as_uvec2(), ease(at.fract()));
    let corner = |x, y| at_lattice(seed, stream, [cell.x + x, cell.y + y]);
    let low = mix(corner(0, 0), corner(1, 0), share.x);
    let high = mix(corner(0, 1), corner(1, 1), share.x);
    mix(low, high, share.y) / BETWEEN
}

/// The same along one thread.
fn smooth_along(seed: u64, stream: u64, thread: usize, along: f32) -> f32 {
    let (cell, share) = (along.floor() as u32, ease(Vec2::splat(along.fract())).x);
    let corner = |y| at_lattice(seed, stream, [thread as u32, cell + y]);
    mix(corner(0), corner(1), share) / BETWEEN.sqrt()
}

fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + share * (b - a)
}

fn ease(share: Vec2) -> Vec2 {
    share * share * (3.0 - 2.0 * share)
}

#[cfg(test)]
mod tests {
    use crate::fabric_file::load;
    use crate::fringe::{Fringe, cut, take};
    use crate::loader::Loader;
    use glam::Vec3;
    use organza_basis::Budget;
    use organza_mesh::{Mesh, Placement, Vertex, read_obj};
    use organza_weave::ThreadSystem;
    use std::path::Path;

    const FABRIC: &str = "draft = { weave = 'plain' }\nwarp = { per_cm = 10.0 }\n\
        weft = { per_cm = 10.0 }\nyarn.cotton = { tex = 30.0 }";
    const MESH: &str = "v 0 0 3\nv 100 0 3\nv 100 20 3\nv 0 20 3\nvt 0 0\nvt 100 0\nvt 100 20\n\
        vt 0 20\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";

    /// The mesh of a fringe of 100 threads of the warp from one place along them to another.
    fn fringe(curl_mm: f32, [from, to]: [f32; 2], seed: u64) -> Mesh {
        laid(
            ThreadSystem::Warp,
            curl_mm,
            [[-1.0, from], [101.0, to]],
            seed,
        )
    }

    /// The mesh of a fringe with those corners; with `curl_mm` below 0, its threads turn back.
    fn laid(keep: ThreadSystem, curl_mm: f32, corners: [[f32; 2]; 2], seed: u64) -> Mesh {
        let mut loader = Loader::new();
        loader.give("curled/cloth.toml", FABRIC);
        let path = Path::new("curled/cloth.toml");
        let fabric = load(path, &[format!("seed={seed}")], &loader).unwrap();
        let placement = Placement {
            mm_per_unit: 1.0,
            mm_per_uv: 1.0,
        };
        let budget = &mut Budget::new(1 << 20);
        let mut mesh = read_obj(MESH.as_bytes(), placement, budget).unwrap();
        let fringes = [Fringe {
            from_mm: corners[0],
            to_mm: corners[1],
            keep,
            curl_mm: curl_mm.max(0.0),
            turn: curl_mm < 0.0,
        }];
        cut(&fringes, &fabric.cloth, &mut mesh, 1 << 20).unwrap();
        let mut taken = take(&fringes, &fabric, &mut mesh, 1 << 20).unwrap();
        taken.remove(0).1
    }

    /// How far points went that lay near a place along the threads, mm.
    fn moved(mesh: &Mesh, along_mm: f32, within_mm: f32) -> Vec<Vec3> {
        let corners = mesh.triangles().iter().flatten();
        let near = corners.filter(|v| (v.uv_mm.y - along_mm).abs() < within_mm);
        near.map(|v| v.position_mm - v.uv_mm.extend(3.0)).collect()
    }

    /// How far aside the end of every thread went, in their order.
    fn ends_aside_mm(mesh: &Mesh, along_mm: f32) -> Vec<f32> {
        let of_face = |t: &[Vertex; 3]| {
            let at = t.iter().filter(|v| (v.uv_mm.y - along_mm).abs() < 0.01);
            let at: Vec<_> = at.map(|v| (v.uv_mm.x, v.position_mm.x)).collect();
            let [a, b] = at.as_slice() else { return None };
            Some((0.5 * (a.0 + b.0), 0.5 * (a.1 + b.1 - a.0 - b.0)))
        };
        let mut found: Vec<_> = mesh.triangles().iter().filter_map(of_face).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|end| end.1).collect()
    }

    fn mean(all: &[Vec3], of: impl Fn(&Vec3) -> f32) -> f32 {
        all.iter().map(of).sum::<f32>() / all.len() as f32
    }

    /// Threads lie still where the cloth holds them, and their free ends go aside and up.
    #[test]
    fn free_ends_curl_and_held_ones_do_not() {
        // Edges go to the nearest gap between picks.
        for (place, held, free) in [([10.0, 21.0], 10.0, 20.0), ([-1.0, 10.0], 10.0, 0.0)] {
            let curled = fringe(1.0, place, 7);
            let at_held = moved(&curled, held, 0.01);
            assert!(at_held.len() >= 200);
            assert!(at_held.iter().all(|by| by.length() < 1e-4));
            let ends = moved(&curled, free, 0.01);
            // A hundred threads, of which some four are alike: the root mean square of 25.
            let aside = mean(&ends, |by| by.x * by.x).sqrt();
            assert!((0.6..1.6).contains(&aside), "seed 7: {aside}");
            let middle = moved(&curled, 0.5 * (held + free), 1.0);
            let middle = mean(&middle, |by| by.x * by.x).sqrt();
            assert!(middle < 0.6 * aside, "seed 7: {middle} {aside}");
            assert!(mean(&ends, |by| by.z) > 0.05 && ends.iter().all(|by| by.z > -0.05));
            // They keep their length, so that the ends come back.
            let inwards = (held - free).signum();
            assert!(mean(&ends, |by| by.y * inwards) > 0.01);
        }
    }

    /// Neighbours move nearly alike, and threads afar do not.
    #[test]
    fn neighbours_curl_alike() {
        let threads = ends_aside_mm(&fringe(1.0, [10.0, 21.0], 7), 20.0);
        assert!((100..=101).contains(&threads.len()), "{}", threads.len());
        let square = threads.iter().map(|x| x * x).sum::<f32>() / threads.len() as f32;
        let alike = |apart: usize| {
            let pairs = threads.iter().zip(&threads[apart..]);
            pairs.map(|(a, b)| a * b).sum::<f32>() / (threads.len() - apart) as f32 / square
        };
        // Of independent threads: 0 +- 0.1.
        assert!(alike(1) > 0.2, "seed 7: {}", alike(1));
        assert!(alike(30).abs() < 0.5, "seed 7: {}", alike(30));
        assert!(alike(1) < 0.95, "seed 7: each has a course of its own");
    }

    #[test]
    fn curls_depend_on_the_seed_alone_and_end_where_none_is_asked_for() {
        let ends = |curl_mm, seed| moved(&fringe(curl_mm, [10.0, 21.0], seed), 20.0, 0.01);
        assert_eq!(ends(2.0, 7), ends(2.0, 7));
        assert_ne!(ends(2.0, 7), ends(2.0, 8));
        assert!(ends(0.0, 7).iter().all(|by| by.length() < 1e-4));
        // Held at both ends, threads bend between them.
        let both = fringe(1.0, [5.0, 15.0], 7);
        for end in [5.0, 15.0] {
            assert!(moved(&both, end, 0.01).iter().all(|by| by.length() < 1e-4));
        }
        let farthest = both.triangles().iter().flatten();
        let farthest = farthest.map(|v| (v.position_mm.x - v.uv_mm.x).abs());
        assert!(farthest.fold(0.0, f32::max) > 0.5);
    }

    #[test]
    fn threads_of_the_weft_curl_along_the_warp() {
        let corners = [[90.0, -1.0], [101.0, 21.0]];
        let curled = laid(ThreadSystem::Weft, 1.0, corners, 7);
        let (mut aside, mut back) = (0.0f32, 0.0);
        for vertex in curled.triangles().iter().flatten() {
            let by = vertex.position_mm - vertex.uv_mm.extend(3.0);
            assert!(vertex.uv_mm.x > 90.01 || by.length() < 1e-4);
            back -= by.x;
            aside = aside.max(by.y.abs());
        }
        assert!((0.5..4.0).contains(&aside), "seed 7: {aside}");
        assert!(back > 0.0, "ends come back: {back}");
    }

    /// Where the cloth holds both ends, nothing turns back, and nothing is taken away.
    #[test]
    fn threads_held_at_both_ends_do_not_turn_back() {
        let places = |curl_mm: f32| {
            let mesh = fringe(curl_mm, [5.0, 15.0], 7);
            let corners = mesh.triangles().iter().flatten();
            corners.map(|v| v.position_mm).collect::<Vec<_>>()
        };
        assert_eq!(places(-1.0), places(0.0));
        assert_ne!(places(1.0), places(0.0));
    }

    /// Threads turn back to their neighbours: the ends of two meet, beyond the cloth's edge.
    #[test]
    fn ends_of_threads_that_turn_back_meet() {
        // Of 40 threads a millimetre apart, one at either side of the fringe may have no neighbour.
        let ends = |curl_mm: f32, [from, to]: [f32; 2], end_mm: f32| {
            let corners = [[-1.0, from], [40.0, to]];
            let mesh = laid(ThreadSystem::Warp, curl_mm, corners, 7);
            let corners = mesh.triangles().iter().flatten();
            let at = corners.filter(move |v| {
                (v.uv_mm.y - end_mm).abs() < 0.01 && (1.6..38.4).contains(&v.uv_mm.x)
            });
            at.map(|v| v.position_mm).collect::<Vec<_>>()
        };
        // How far they are from the middle between two threads, of every other two.
        let off_mm = |ends: &[Vec3]| {
            assert!(ends.len() >= 70);
            let off = |pair: f32| {
                let off = ends.iter().map(|p| p.x - pair);
                off.fold(0.0, |most: f32, x| {
                    most.max((x - 2.0 * (0.5 * x).round()).abs())
                })
            };
            off(0.0).min(off(1.0))
        };
        for (place, held, end) in [([10.0, 21.0], 10.0, 11.0), ([-1.0, 10.0], 10.0, 9.0)] {
            let turned = ends(-1.0, place, end);
            // What of half a width lies inside the bow, 0.02, and how far a point within 0.01 of
            // the end has yet to turn aside, 0.016.
            assert!(off_mm(&turned) < 0.04, "{}", off_mm(&turned));
            // Within a spacing of the edge.
            let beyond = |p: &Vec3| (p.y - held) * (end - held);
            assert!(turned.iter().all(|p| (0.0..1.0).contains(&beyond(p))));
            let straight = ends(1e-3, place, if end > held { 20.0 } else { 0.0 });
            assert!(off_mm(&straight) > 0.2);
        }
    }
}
