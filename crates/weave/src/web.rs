//! Fibres of a web: laid at random, carried through it by needles, pressed together at points.

use crate::spline::catmull_rom;
use crate::strand::{normal, unit};
use glam::{DVec2, DVec3};
use organza_basis::PathRng;
use std::f64::consts::{PI, TAU};

/// Length over which the angle of a fibre to the plane forgets itself (estimated).
const ELEVATION_MM: f64 = 0.8;
/// Waves over which the crimp of a fibre forgets its phase (estimated).
const CRIMP_WAVES: f64 = 2.0;
/// Length of fibre on either side of a punch that goes into the tuft, in its diameters
/// (estimated).
const CARRIED: f64 = 1.5;
/// How far from a punch's middle fibres are caught, in diameters of the tuft.
const CAUGHT: f64 = 0.7;
/// Share of a bonding point's radius over which the cloth thins.
const BOND_EDGE: f64 = 0.35;

/// How fibres run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Laying {
    pub size_mm: DVec2,
    /// Lowest and highest centres of fibres.
    pub faces_mm: [f64; 2],
    pub step_mm: f64,
    /// Factor by which random directions are stretched along y. Their orientation tensor then
    /// has components in this ratio.
    pub stretch: f64,
    /// Root mean square angle to the plane.
    pub elevation_rad: f64,
    /// Root mean square curvature in the plane.
    pub curl_per_mm: f64,
    /// Root mean square angle of the crimp, and its waves per length.
    pub crimp_rad: f64,
    pub crimp_per_mm: f64,
}

impl Laying {
    /// A fibre of some length from a random place, in the direction that the share `turn` of a
    /// turn gives before it is stretched.
    pub fn lay(&self, length_mm: f64, turn: f64, rng: &mut PathRng) -> Vec<DVec3> {
        let [low, high] = self.faces_mm;
        let steps = (length_mm / self.step_mm).ceil().max(2.0) as usize;
        let step_mm = length_mm / steps as f64;
        let mut at = DVec3::new(
            self.size_mm.x * unit(rng),
            self.size_mm.y * unit(rng),
            low + (high - low) * unit(rng),
        );
        let mut draw = |deviation: f64| normal(rng, [0.0, deviation], 1.0);
        let mut heading = TAU * turn;
        let mut bend = draw(self.curl_per_mm);
        let mut elevation = draw(self.elevation_rad);
        let mut wave = DVec2::new(draw(1.0), draw(1.0));
        // Each forgets itself over a length, and keeps its deviation.
        let keep = |over_mm: f64| {
            let kept = (-step_mm / over_mm).exp();
            (kept, (1.0 - kept * kept).sqrt())
        };
        let of_bend = keep(0.5 / self.curl_per_mm.max(1e-9));
        let of_elevation = keep(ELEVATION_MM);
        let of_wave = keep(CRIMP_WAVES / self.crimp_per_mm);
        let mut points = Vec::with_capacity(steps + 1);
        points.push(at);
        for i in 0..steps {
            let phase = TAU * self.crimp_per_mm * (i as f64 + 0.5) * step_mm;
            let crimp = self.crimp_rad * wave.dot(DVec2::from_angle(phase));
            let plain = DVec2::from_angle(heading) * DVec2::new(1.0, self.stretch);
            let plane = plain.normalize().rotate(DVec2::from_angle(crimp));
            let (up, level) = elevation.sin_cos();
            at += step_mm * (level * plane).extend(up);
            // The faces reflect fibres.
            if at.z > high || at.z < low {
                let face = if at.z > high { high } else { low };
                at.z = (2.0 * face - at.z).clamp(low, high);
                elevation = -elevation;
            }
            points.push(at);
            heading += step_mm * bend;
            bend = of_bend.0 * bend + of_bend.1 * draw(self.curl_per_mm);
            elevation = of_elevation.0 * elevation + of_elevation.1 * draw(self.elevation_rad);
            wave = of_wave.0 * wave + of_wave.1 * DVec2::new(draw(1.0), draw(1.0));
        }
        points
    }
}

/// Punches in the tile.
#[derive(Clone, Debug)]
pub(crate) struct Needling {
    pub size_mm: DVec2,
    /// Middles of the punches, and whether they come from the back.
    pub punches: Vec<(DVec2, bool)>,
    pub fibres: usize,
    pub tuft_mm: f64,
    /// Where tufts that come from the face end, and those from the back.
    pub ends_mm: [f64; 2],
}

/// A lattice of about `per_mm2` places over the tile, each moved by up to `jitter` of its cell.
pub(crate) fn lattice(size_mm: DVec2, per_mm2: f64, jitter: f64, rng: &mut PathRng) -> Vec<DVec2> {
    let wanted = (per_mm2 * size_mm.x * size_mm.y).max(1.0);
    // Rows are offset by half a cell in turns, so there is an even number of them.
    let rows = (0.5 * (wanted * size_mm.y / size_mm.x).sqrt()).round() * 2.0;
    let rows = if wanted < 3.0 { 1.0 } else { rows.max(2.0) };
    let columns = (wanted / rows).round().max(1.0);
    let cell = size_mm / DVec2::new(columns, rows);
    let mut places = Vec::new();
    for row in 0..rows as usize {
        for column in 0..columns as usize {
            let move_by = DVec2::new(unit(rng) - 0.5, unit(rng) - 0.5);
            let half = 0.5 * (row % 2) as f64;
            let at = DVec2::new(column as f64 + 0.25 + half, row as f64 + 0.5);
            places.push(cell * (at + 2.0 * jitter * move_by));
        }
    }
    places
}

/// Cells of the plane, which repeats, as wide as a distance or wider.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    size_mm: DVec2,
    counts: [usize; 2],
}

impl Cells {
    pub fn new(size_mm: DVec2, reach_mm: f64) -> Cells {
        let count = |size: f64| ((size / reach_mm) as usize).clamp(1, 1024);
        Cells {
            size_mm,
            counts: [count(size_mm.x), count(size_mm.y)],
        }
    }

    /// Number of cells.
    pub fn count(self) -> usize {
        self.counts[0] * self.counts[1]
    }

    fn column_and_row(self, at: DVec2) -> [usize; 2] {
        let [nx, ny] = self.counts;
        let share = at / self.size_mm;
        let share = share - share.floor();
        let [x, y] = [share.x * nx as f64, share.y * ny as f64].map(|v| v as usize);
        [x % nx, y % ny]
    }

    pub fn index(self, at: DVec2) -> usize {
        let [x, y] = self.column_and_row(at);
        y * self.counts[0] + x
    }

    /// The cells around a place, each once.
    pub fn around(self, at: DVec2) -> Vec<usize> {
        let [nx, ny] = self.counts;
        let [x, y] = self.column_and_row(at);
        let mut cells: Vec<usize> = (0..9)
            .map(|k| (y + ny + k / 3 - 1) % ny * nx + (x + nx + k % 3 - 1) % nx)
            .collect();
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    /// The distance of two places or of their nearest copies, squared.
    fn square_mm2(self, a: DVec2, b: DVec2) -> f64 {
        let apart = a - b;
        (apart - (apart / self.size_mm).round() * self.size_mm).length_squared()
    }
}

/// The points of fibres by the cells in which they lie.
struct Points {
    cells: Cells,
    /// Fibre and point.
    of_cell: Vec<Vec<(u32, u32)>>,
}

impl Points {
    fn new(fibres: &[Vec<DVec3>], size_mm: DVec2, reach_mm: f64) -> Points {
        let cells = Cells::new(size_mm, reach_mm);
        let mut of_cell = vec![Vec::new(); cells.count()];
        for (f, line) in fibres.iter().enumerate() {
            for (p, at) in line.iter().enumerate() {
                of_cell[cells.index(at.truncate())].push((f as u32, p as u32));
            }
        }
        Points { cells, of_cell }
    }

    /// The points within the distance for which the cells were made: the distance, and fibre and
    /// point.
    fn within(
        &self,
        fibres: &[Vec<DVec3>],
        middle: DVec2,
        reach_mm: f64,
    ) -> Vec<(f64, (u32, u32))> {
        let cells = self.cells.around(middle).into_iter();
        cells
            .flat_map(|c| &self.of_cell[c])
            .map(|&(f, p)| {
                let at = fibres[f as usize][p as usize].truncate();
                (self.cells.square_mm2(at, middle).sqrt(), (f, p))
            })
            .filter(|(distance, _)| *distance < reach_mm)
            .collect()
    }
}

/// A piece of a fibre that a tuft replaces.
struct Carried {
    fibre: usize,
    from: usize,
    to: usize,
    path: Vec<DVec3>,
}

impl Needling {
    /// Carries fibres through the web. Returns the length of fibre in tufts.
    pub fn carry(&self, fibres: &mut [Vec<DVec3>], step_mm: f64, rng: &mut PathRng) -> f64 {
        let reach_mm = CAUGHT * self.tuft_mm;
        let points = Points::new(fibres, self.size_mm, reach_mm);
        let half = (CARRIED * self.tuft_mm / step_mm).ceil().max(1.0) as usize;
        let mut taken: Vec<Vec<(usize, usize)>> = vec![Vec::new(); fibres.len()];
        let mut all: Vec<Carried> = Vec::new();
        for (middle, from_back) in &self.punches {
            let mut near = points.within(fibres, *middle, reach_mm);
            // Nearest first; each fibre is caught once by a punch.
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut carried = 0;
            for (_, (fibre, point)) in near {
                let line = &fibres[fibre as usize];
                let (from, to) = ((point as usize).saturating_sub(half), point as usize + half);
                let is_free = |&(a, b): &(usize, usize)| to < a || b < from;
                if carried == self.fibres
                    || to >= line.len()
                    || from + half != point as usize
                    || !taken[fibre as usize].iter().all(is_free)
                {
                    continue;
                }
                taken[fibre as usize].push((from, to));
                let path = self.path(
                    *middle,
                    *from_back,
                    [from, point as usize, to],
                    line,
                    step_mm,
                    rng,
                );
                all.push(Carried {
                    fibre: fibre as usize,
                    from,
                    to,
                    path,
                });
                carried += 1;
            }
        }
        let length = |p: &[DVec3]| p.windows(2).map(|p| p[0].distance(p[1])).sum::<f64>();
        let carried_mm = all.iter().map(|c| length(&c.path)).sum();
        all.sort_by(|a, b| (a.fibre, b.from).cmp(&(b.fibre, a.from)));
        for c in all {
            fibres[c.fibre].splice(c.from..=c.to, c.path);
        }
        carried_mm
    }

    /// The way of a fibre down one leg of a tuft and up the other.
    fn path(
        &self,
        middle: DVec2,
        from_back: bool,
        [from, point, to]: [usize; 3],
        line: &[DVec3],
        step_mm: f64,
        rng: &mut PathRng,
    ) -> Vec<DVec3> {
        let at = line[point];
        let apart = middle - at.truncate();
        let copy = -(apart / self.size_mm).round() * self.size_mm;
        let middle = middle + copy;
        let place = |rng: &mut PathRng| {
            let radius = 0.5 * self.tuft_mm * unit(rng).sqrt();
            middle + radius * DVec2::from_angle(TAU * unit(rng))
        };
        let legs = [place(rng), place(rng)];
        let end = self.ends_mm[usize::from(from_back)];
        let end = end + 0.15 * (at.z - end) * unit(rng);
        let height = |s: f64| at.z + s * (end - at.z);
        let bottom = (0.5 * (legs[0] + legs[1])).extend(end);
        let knots = [
            line[from.saturating_sub(1)],
            line[from],
            legs[0].extend(height(0.08)),
            legs[0].extend(height(0.5)),
            legs[0].extend(height(0.9)),
            bottom,
            legs[1].extend(height(0.9)),
            legs[1].extend(height(0.5)),
            legs[1].extend(height(0.08)),
            line[to],
            line[(to + 1).min(line.len() - 1)],
        ];
        let spans = knots.len() - 3;
        let mut path = Vec::new();
        for span in 0..spans {
            let around = [0, 1, 2, 3].map(|k| knots[span + k]);
            let steps = (around[1].distance(around[2]) / step_mm).ceil().max(1.0);
            path.extend((0..steps as usize).map(|k| catmull_rom(around, k as f64 / steps)));
        }
        path.push(line[to]);
        path
    }
}

/// Points at which the web is pressed thin.
#[derive(Clone, Debug)]
pub(crate) struct Bonding {
    radius_mm: f64,
    /// Thickness in a point over that of the web.
    thinness: f64,
    cells: Cells,
    /// Middles by cell.
    of_cell: Vec<Vec<DVec2>>,
}

impl Bonding {
    /// Points around `middles` that together take a share of the area.
    pub fn new(middles: &[DVec2], share: f64, thinness: f64, size_mm: DVec2) -> Bonding {
        let radius_mm = (share * size_mm.x * size_mm.y / (PI * middles.len() as f64)).sqrt();
        // The cloth thins over half of the edge outside of the radius; the cells are wider.
        let cells = Cells::new(size_mm, (1.0 + BOND_EDGE) * radius_mm);
        let mut of_cell = vec![Vec::new(); cells.count()];
        for middle in middles {
            of_cell[cells.index(*middle)].push(*middle);
        }
        Bonding {
            radius_mm,
            thinness,
            cells,
            of_cell,
        }
    }

    /// The thickness at a place, relative to the web's.
    pub fn thickness(&self, at: DVec2) -> f64 {
        let near = self.cells.around(at).into_iter();
        let nearest = near
            .flat_map(|c| &self.of_cell[c])
            .map(|middle| self.cells.square_mm2(at, *middle))
            .fold(f64::INFINITY, f64::min);
        // Half of the fall lies within the radius.
        let inside = 0.5 + (1.0 - nearest.sqrt() / self.radius_mm) / BOND_EDGE;
        let s = inside.clamp(0.0, 1.0);
        1.0 - (1.0 - self.thinness) * s * s * (3.0 - 2.0 * s)
    }
}
