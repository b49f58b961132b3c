//! Light that flows from bin to bin: the radiances of all bins at once.
//!
//! A path that arrives in a bin finds some light there, and arrives in another bin with what it
//! then carries. The radiance of a bin is what its arrivals found, plus what they carried on
//! times the radiance of the bins where they came to, over what they brought \[Bradtke1996\],
//! \[Dahm2017\]. A path so teaches with each of its events, where the light that it finds to its
//! end alone is one number. What bins do not tell apart, they share: in the sum over all bins no
//! light is gained or lost, whichever bins there are.

use super::Note;
use super::place::Level;
use super::table::{RadianceTable, is_known};
use glam::Vec3;
use rayon::prelude::*;

/// What paths carried from one bin to another.
#[derive(Clone, Copy, Debug)]
struct Move {
    from: u32,
    to: u32,
    carried: Vec3,
}

/// Change of the light of all bins, as a share of it, at which they are solved.
const SOLVED: f64 = 5e-5;
/// Times that light flows on at most.
const STEPS: u32 = 200;
/// Bins that a task solves.
const BINS: usize = 4096;

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// What arrivals brought, and the light that they found before their next ones.
    carried: Vec3,
    found: Vec3,
    /// The light that they found to the ends of their paths.
    whole: Vec3,
    /// The same over all that was solved before, the light to the ends of paths.
    carried_before: Vec3,
    light_before: Vec3,
}

impl Sums {
    /// The share of the light of a bin that flows there, where its arrivals carry on so much; the
    /// rest is that to the ends of their paths. Few arrivals may by chance carry on more than they
    /// brought, and would shine by what they hand on if all of it counted.
    fn flowing(&self, on: Vec3) -> Vec3 {
        let share = self.carried / on;
        Vec3::select(on.cmple(self.carried), Vec3::ONE, share * share)
    }
}

/// Bins at all fibres but the first, and how light flows between them.
pub struct Flow {
    table: RadianceTable,
    levels: &'static [Level],
    /// Of all bins, by their numbers.
    sums: Vec<Sums>,
    moves: Vec<Move>,
    /// Most moves that are kept: then the bins are solved, and others follow.
    room: usize,
}

impl Flow {
    /// Between these bins, with so many bytes for what is kept of paths.
    pub fn new(table: RadianceTable, levels: &'static [Level], bytes: u64) -> Flow {
        Flow {
            sums: vec![Sums::default(); table.room()],
            table,
            levels,
            moves: Vec::new(),
            // They are sorted into a copy to be solved.
            room: bytes as usize / (size_of::<Move>() + size_of::<(u32, Vec3)>()),
        }
    }

    /// Takes a path that found so much light, with its arrivals from the second fibre on.
    pub fn take(&mut self, light: Vec3, arrivals: &[Note]) {
        let mut last: Option<(usize, &Note)> = None;
        for arrival in arrivals {
            // What has no bin is taken as a part of the way.
            let Some(bin) = self.table.find(&arrival.place, self.levels) else {
                continue;
            };
            self.sums[bin].whole += arrival.light_until(light);
            if let Some((from, before)) = last {
                self.add(from, before, arrival.found);
                self.moves.push(Move {
                    from: from as u32,
                    to: bin as u32,
                    carried: arrival.carried,
                });
            }
            last = Some((bin, arrival));
        }
        if let Some((from, before)) = last {
            self.add(from, before, light);
        }
        if self.moves.len() >= self.room {
            self.solve();
        }
    }

    fn add(&mut self, from: usize, arrival: &Note, light: Vec3) {
        self.sums[from].carried += arrival.carried;
        self.sums[from].found += arrival.light_until(light);
    }

    /// What is read at all fibres but the first.
    pub fn table(&mut self) -> &RadianceTable {
        self.solve();
        &self.table
    }

    /// What is read, for good.
    pub fn into_table(mut self) -> RadianceTable {
        self.solve();
        self.table
    }

    /// Solves the bins for what was taken since the last time, and gives all that up.
    fn solve(&mut self) {
        if self.sums.iter().all(|s| s.carried == Vec3::ZERO) {
            return;
        }
        let (starts, moves) = by_source(&self.moves, self.sums.len());
        let moves_of = |bin: usize| &moves[starts[bin] as usize..starts[bin + 1] as usize];
        let flowing: Vec<Vec3> = (0..self.sums.len())
            .into_par_iter()
            .with_min_len(BINS)
            .map(|bin| {
                let on = moves_of(bin).iter().map(|(_, carried)| *carried).sum();
                self.sums[bin].flowing(on)
            })
            .collect();
        let mut radiance: Vec<Vec3> = self.table.radiances().collect();
        for _ in 0..STEPS {
            let one = |bin: usize| {
                let Sums {
                    carried,
                    found,
                    whole,
                    ..
                } = self.sums[bin];
                let flows = moves_of(bin)
                    .iter()
                    .map(|(to, carried)| *carried * radiance[*to as usize]);
                let light = found + flows.sum::<Vec3>();
                let light = whole + flowing[bin] * (light - whole);
                Vec3::select(is_known(carried), light / carried, radiance[bin])
            };
            let bins = (0..radiance.len()).into_par_iter().with_min_len(BINS);
            let next: Vec<Vec3> = bins.map(one).collect();
            let (mut change, mut all) = (0.0, 0.0);
            for ((a, b), sums) in radiance.iter().zip(&next).zip(&self.sums) {
                let light = |q: Vec3| f64::from((q * sums.carried).element_sum());
                change += (light(*b) - light(*a)).abs();
                all += light(*b);
            }
            radiance = next;
            if change <= SOLVED * all {
                break;
            }
        }
        for (bin, (sums, q)) in self.sums.iter_mut().zip(radiance).enumerate() {
            sums.carried_before += sums.carried;
            sums.light_before += q * sums.carried;
            (sums.carried, sums.found, sums.whole) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
            let (before, light) = (sums.carried_before, sums.light_before);
            let mean = Vec3::select(is_known(before), light / before, q);
            self.table.set_radiance(bin, mean);
        }
        // The tables of the first fibre take their room.
        self.moves = Vec::new();
    }
}

/// Where moves from every bin begin, in an array in which they lie side by side in the order
/// in which they were made.
fn by_source(moves: &[Move], bins: usize) -> (Vec<u32>, Vec<(u32, Vec3)>) {
    let mut starts = vec![0u32; bins + 1];
    for m in moves {
        starts[m.from as usize + 1] += 1;
    }
    for bin in 0..bins {
        starts[bin + 1] += starts[bin];
    }
    let mut next = starts.clone();
    let mut sorted = vec![(0, Vec3::ZERO); moves.len()];
    for m in moves {
        let at = &mut next[m.from as usize];
        sorted[*at as usize] = (m.to, m.carried);
        *at += 1;
    }
    (starts, sorted)
}

#[cfg(test)]
mod tests {
    use super::super::place::{LINE, Place};
    use super::super::tree::{RadianceTree, Record};
    use super::*;
    use organza_basis::PathRng;

    const SEED: u64 = 77;

    /// Paths that step along a line to the left or right and lose some of what they carry, past
    /// places which shine. The first arrivals are at the brighter end.
    fn paths(count: u32, rng: &mut PathRng) -> Vec<(Vec3, Vec<Note>)> {
        let path = |rng: &mut PathRng| {
            let (mut x, mut carried) = ((rng.unit() * 8.0) as i32, Vec3::splat(rng.unit()));
            let (mut found, mut notes) = (Vec3::ZERO, Vec::new());
            while (0..64).contains(&x) && rng.unit() < 0.9 {
                notes.push(Note {
                    place: Place::on_a_line(x),
                    carried,
                    found,
                });
                let shines = Vec3::new(1.0, 0.1, if x < 8 { 3.0 } else { 0.0 });
                found += carried * shines * 2.0 * rng.unit();
                carried *= 0.95 + 0.1 * rng.unit();
                x += (rng.unit() * 9.0) as i32 - 4;
            }
            (found, notes)
        };
        (0..count).map(|_| path(rng)).collect()
    }

    /// Light that the first arrivals of paths get from a table, over that which they found.
    fn gain(table: &RadianceTable, paths: &[(Vec3, Vec<Note>)]) -> Vec3 {
        let (mut got, mut there) = (Vec3::ZERO, Vec3::ZERO);
        for (light, notes) in paths {
            let read = notes.iter().find_map(|note| {
                let bin = table.find(&note.place, LINE)?;
                Some((note.carried * table.radiance_of(bin), *light - note.found))
            });
            let (read, found) = read.unwrap_or_default();
            got += read;
            there += found;
        }
        got / there - 1.0
    }

    /// The first arrivals get what their paths found, to rounding, though all arrivals of a bin
    /// share its radiance; not so if a bin takes the light to the ends of paths from all of them.
    #[test]
    fn light_is_neither_gained_nor_lost() {
        let mut rng = PathRng::from_seed(SEED);
        // One bin for all places.
        let mut tree = RadianceTree::new(LINE, 4_200, 64 << 20);
        let of_paths = |paths: &[(Vec3, Vec<Note>)]| -> Vec<Option<Record>> {
            let of = |(light, notes): &(Vec3, Vec<Note>)| {
                let light = *light;
                let records = notes.iter().map(move |n| Some(Record::new(n, light)));
                records.collect::<Vec<_>>()
            };
            paths.iter().flat_map(of).collect()
        };
        tree.learn(&of_paths(&paths(600, &mut rng)));
        tree.divide_no_more();
        let mut flow = Flow::new(tree.table(), LINE, 64 << 20);
        let all = paths(20_000, &mut rng);
        tree.learn(&of_paths(&all));
        for (light, notes) in &all {
            flow.take(*light, notes);
        }
        let right = gain(flow.table(), &all).abs().max_element();
        assert!(right < 2e-3, "seed {SEED}: {right}");
        let twin = gain(&tree.table(), &all).abs().max_element();
        assert!(twin > 2e-2, "seed {SEED}, twin: {twin}");
    }

    /// Arrivals that carry on much more than they brought take the light that their paths found.
    #[test]
    fn what_grows_by_chance_is_bounded() {
        let note = |x: i32, carried: f32, found: f32| Note {
            place: Place::on_a_line(512 * x),
            carried: Vec3::splat(carried),
            found: Vec3::splat(found),
        };
        let solved = |paths: &[(f32, &[Note])]| {
            let mut tree = RadianceTree::new(LINE, 3, 1 << 20);
            let arrivals = [0, 0, 1, 1].map(|x| Some(Record::new(&note(x, 1.0, 0.0), Vec3::ONE)));
            tree.learn(&arrivals);
            let mut flow = Flow::new(tree.table(), LINE, 1 << 20);
            for (light, notes) in paths {
                flow.take(Vec3::splat(*light), notes);
            }
            let table = flow.into_table();
            [0, 1].map(|x| table.radiance(&Place::on_a_line(512 * x), LINE).unwrap().x)
        };
        let [dark, lit] = solved(&[
            (2e-6, &[note(0, 1e-6, 0.0), note(1, 0.8, 1e-6)]),
            (1.0, &[note(1, 1.0, 0.0)]),
        ]);
        // It would be 0.8 times the light of the other over 1e-6.
        assert!((dark - 2.0).abs() < 1e-2, "{dark}");
        assert!((lit - 1.0 / 1.8).abs() < 1e-2, "{lit}");
    }

    /// Two places that send light to and fro: the closed form.
    #[test]
    fn two_bins_are_solved() {
        let at = |x: i32| Place::on_a_line(512 * x);
        let mut tree = RadianceTree::new(LINE, 3, 1 << 20);
        let note = |x: i32, carried: f32, found: f32| Note {
            place: at(x),
            carried: Vec3::splat(carried),
            found: Vec3::splat(found),
        };
        let arrivals = [note(0, 1.0, 0.0), note(1, 0.5, 1.0), note(0, 0.25, 1.0)];
        tree.learn(&arrivals.map(|n| Some(Record::new(&n, Vec3::ONE))));
        let mut flow = Flow::new(tree.table(), LINE, 1 << 20);
        flow.take(Vec3::ONE, &arrivals);
        let table = flow.table();
        let [a, b] = [0, 1].map(|x| table.radiance(&at(x), LINE).unwrap().x);
        // 1.25 a = 1 + 0.5 b and 0.5 b = 0.25 a.
        assert!((a - 1.0).abs() < 1e-3 && (b - 0.5).abs() < 1e-3, "{a} {b}");
    }
}
