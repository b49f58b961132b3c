//! Texels: each shows its own place of the cloth, with random numbers of its own.
use glam::{UVec2, Vec2, Vec3};
use organza_basis::{PathRng, Rgb, unwatched};
use organza_measure::{
    Angles, DrawNumbered, Exit, FirstSight, Look, Pair, PatchResponse, PathRun, TexelGrid,
    gather_looks, measure_texture,
};
use organza_transport::Stats;

const GRID: TexelGrid = TexelGrid {
    low_mm: Vec2::new(0.5, -1.0),
    size_mm: Vec2::new(3.0, 0.8),
    texels: UVec2::new(6, 4),
};
const SEED: u64 = 31;

/// A cloth whose brightness and height rise along x and y, or are noise.
struct Painted {
    is_noise: bool,
}

impl Painted {
    fn value(&self, place_mm: Vec2, rng: &mut PathRng) -> f32 {
        match self.is_noise {
            true => rng.unit(),
            false => 2.0 + place_mm.x + 10.0 * place_mm.y,
        }
    }
}

impl PatchResponse for Painted {
    fn estimate_bsdf(&self, _: Vec3, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Rgb {
        unreachable!("texels ask at places")
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        _: Vec3,
        _: Vec3,
        rng: &mut PathRng,
        _: &mut Stats,
    ) -> Rgb {
        Rgb::splat(self.value(place_mm, rng))
    }

    fn estimate_exit(&self, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Exit {
        unreachable!("texels ask at places")
    }

    fn each_look(&self, place: &DrawNumbered<'_, Vec2>, run: PathRun<'_, Look>) {
        for path in run.names.paths.clone() {
            let mut rng = run.names.rng(path);
            let place_mm = place(path, &mut rng);
            (run.found)(Look {
                exit: Exit {
                    escape: Some((Vec3::Z, Rgb::WHITE)),
                    ..Exit::default()
                },
                first: Some(FirstSight {
                    axis: Vec3::X,
                    height_mm: self.value(place_mm, &mut rng),
                }),
                events: 1,
            });
        }
    }
}

/// Value of the middle of every texel, the row of the largest y first; and half of what it
/// changes by over a texel.
fn middles() -> (Vec<f32>, f32) {
    let texel_mm = GRID.size_mm / GRID.texels.as_vec2();
    let rows = (0..GRID.texels.y).rev();
    let places = rows.flat_map(|y| (0..GRID.texels.x).map(move |x| UVec2::new(x, y)));
    let value = |at: UVec2| {
        let place_mm = GRID.low_mm + (at.as_vec2() + 0.5) * texel_mm;
        2.0 + place_mm.x + 10.0 * place_mm.y
    };
    let half = 0.5 * (texel_mm.x + 10.0 * texel_mm.y);
    (places.map(value).collect(), half)
}

fn pictures(cloth: &Painted) -> [Vec<f32>; 2] {
    let toward = |theta_deg| Angles::new(theta_deg, 0.0);
    let pair = Pair::new(toward(30.0), toward(0.0));
    let paths = 16;
    let texture = measure_texture(cloth, pair, &GRID, paths, SEED, &unwatched).unwrap();
    let looks = gather_looks(cloth, &GRID, paths as u32, SEED, &unwatched).unwrap();
    assert!(looks.iter().all(|l| l.count == 16 && l.hits == 16));
    let heights = looks.iter().map(|l| l.height_mm / l.count as f32);
    [
        texture.mean.iter().map(|c| c[1]).collect(),
        heights.collect(),
    ]
}

#[test]
fn every_texel_shows_its_own_place() {
    let (middles, half) = middles();
    for found in pictures(&Painted { is_noise: false }) {
        assert_eq!(found.len(), middles.len());
        for (k, (found, middle)) in found.iter().zip(&middles).enumerate() {
            let off = (found - middle).abs();
            // The mean of 16 places is nearer to the middle than the border is.
            let most = 0.5 * half + 1e-4;
            assert!(off < most, "seed {SEED}, texel {k}: {off} of {half}");
        }
    }
}

#[test]
fn no_two_texels_share_their_random_numbers() {
    for mut found in pictures(&Painted { is_noise: true }) {
        found.sort_by(f32::total_cmp);
        let equal = found.windows(2).filter(|w| w[0] == w[1]).count();
        assert_eq!(equal, 0, "seed {SEED}: {found:?}");
    }
}
