use super::*;
use organza_basis::PathRng;

const ROOM: Room = Room {
    size_mm: DVec2::new(2.0, 1.5),
    faces_mm: [-0.15, 0.15],
};

/// Straight lines at random, which cross the borders of the room; some close over it.
fn lines(seed: u64) -> Vec<Line> {
    let mut rng = PathRng::from_seed(seed);
    let mut unit = || f64::from(rng.unit());
    (0..60)
        .map(|i| {
            let start = DVec3::new(2.0 * unit(), 1.5 * unit(), 0.2 * unit() - 0.1);
            let along = DVec2::from_angle(std::f64::consts::TAU * unit());
            let period = (i % 3 == 0).then_some(2.0 * DVec3::X);
            let step = match period {
                Some(p) => p / 40.0,
                None => 0.05 * along.extend(0.05 * unit()),
            };
            Line {
                points: (0..40).map(|k| start + f64::from(k) * step).collect(),
                radius_mm: 0.01,
                period,
                held: Vec::new(),
            }
        })
        .collect()
}

/// The same lines before are the twin that fails.
#[test]
fn lines_that_share_room_are_pushed_apart() {
    for seed in [1, 2, 3] {
        let mut lines = lines(seed);
        let before = overlap(&lines, ROOM);
        separate(&mut lines, ROOM);
        let after = overlap(&lines, ROOM);
        assert!(before.0 > 0.3 && before.2 > 50, "seed {seed}: {before:?}");
        let [b, a] = [before, after].map(|o| o.0 * o.2 as f64);
        assert!(
            a < 4.0 * f64::from(f32::EPSILON) * b,
            "seed {seed}: {before:?}, {after:?}"
        );
    }
}

#[test]
fn neighbours_are_found_across_the_border_and_each_pair_once() {
    let lines = lines(4);
    let pieces = pieces_of(&lines);
    let found = pairs_of(&lines, &pieces, ROOM, 1.0);
    let mut expected = 0;
    for i in 0..pieces.len() {
        for j in i + 1..pieces.len() {
            let (p, q) = (&pieces[i], &pieces[j]);
            if p.line == q.line {
                continue;
            }
            let pair = Pair {
                pieces: [i as u32, j as u32],
                shift: ROOM.nearest(q.middle - p.middle),
            };
            let near = gap(&lines, &pieces, &pair).2.length() < 0.02;
            expected += usize::from(near);
        }
    }
    let own = found.iter().filter(|p| {
        let [a, b] = p.pieces.map(|i| pieces[i as usize].line);
        a == b
    });
    assert!(expected > 50, "{expected}");
    assert_eq!(found.len() - own.count(), expected);
}
