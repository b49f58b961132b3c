//! Matter as laid out for lanes against the general medium, and tables against
//! exact rays.

use super::lanes::{Ints, one};
use super::tests::{cloth, grid, parallel};
use super::*;
use crate::*;
use glam::{IVec3, UVec3};
use organza_basis::{PathRng, warp};

/// Laid out and general medium, everywhere and toward many directions.
#[test]
fn laid_out_matter_is_the_medium() {
    let mut rng = PathRng::from_seed(4);
    let grid = grid(false);
    let cloth = cloth();
    let flat_grid = FlatMedium::from_grid(&grid).unwrap();
    let flat_cloth = FlatMedium::from_cloth(&cloth).unwrap();
    fn check<M: Medium>(medium: &M, flat: &FlatMedium, rng: &mut PathRng) {
        let dims = medium.lattice().dims();
        for i in 0..dims.element_product() {
            let c = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
            let w = warp::uniform_sphere(rng.unit2());
            let site = medium.site(c.as_vec3() + 0.5);
            let (a, b) = (
                medium.sigma_t(&site, w),
                flat.populations_of(i as usize)
                    .map(|p| p.extinction_per_mm(w))
                    .sum::<f32>(),
            );
            // The axis is off by at most 1e-3 rad, which matters most where it
            // is seen nearly end-on: at an end-on ratio e, by 1/(2 e) of it.
            assert!((a - b).abs() <= 5e-3 * a, "seed 4: {a}, {b} at {c}");
            if a > 0.0 {
                let first = flat.place(i as usize).0 as u32;
                let shown = flat.first_event(first, 1.0).unwrap().info;
                let info = medium.info(&site);
                assert!(shown.axis.dot(info.axis).abs() > 0.9999, "seed 4: {c}");
                assert_eq!(shown.yarn, info.yarn);
            }
        }
    }
    check(&grid, &flat_grid, &mut rng);
    check(&cloth, &flat_cloth, &mut rng);
    assert!(flat_grid.places.is_empty());
    let several = |i: usize| flat_cloth.populations_of(i).count() > 1;
    assert!((0..flat_cloth.places.len()).any(several), "no mixtures");
}

/// Words give back what was packed, to the errors that they state.
#[test]
fn words_of_voxels_keep_what_they_state() {
    use super::voxel_words::{MOST, bound_code, bound_of, pack};
    let mut rng = PathRng::from_seed(5);
    let (mut turned, mut off) = (0.0f32, 0.0f32);
    for _ in 0..20_000 {
        let axis = warp::uniform_sphere(rng.unit2());
        let broadside = MOST * 10f32.powf(-4.0 * rng.unit());
        let end_on = 0.01 + 0.99 * rng.unit();
        let words = pack(broadside, axis, end_on).map(one::U::splat);
        let words = voxel_words::VoxelWords(words);
        let stored = words.axis();
        let stored = Vec3::new(stored.x.0, stored.y.0, stored.z.0);
        assert!(stored.length() > 0.57 && stored.length() < 1.0005);
        turned = turned.max(stored.normalize().cross(axis).length());
        let apart = (words.broadside().0 - broadside).abs();
        off = off.max(apart / (broadside + 1.0 / 32_768.0));
        assert!((words.end_on().0 / end_on - 1.0).abs() < 2.5e-3);
        let bound = bound_of(bound_code(broadside));
        assert!(bound >= broadside && bound < 1.07 * broadside + 1e-6);
    }
    assert!(turned < 1.2e-3, "seed 5: {turned}");
    assert!(off < 1.0 / 8192.0 + 1e-6, "seed 5: {off}");
    assert_eq!(bound_of(bound_code(0.0)), 0.0);
    assert_eq!(bound_of(255), MOST);
    assert_eq!(voxel_words::VoxelWords::<one::U>::unknown().bound().0, MOST);
}

/// Every voxel within the reach of another is below its bound.
#[test]
fn reaches_bound_what_they_hold() {
    for medium in [
        FlatMedium::from_grid(&grid(false)).unwrap(),
        FlatMedium::from_grid(&grid(true)).unwrap(),
    ] {
        let lattice = medium.lattice;
        let dims = lattice.dims();
        let number = |c: UVec3| ((c.z * dims.y + c.y) * dims.x + c.x) as usize;
        let mut widest = 0;
        for i in 0..dims.element_product() {
            let c = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
            let words = medium.words_at(medium.place(number(c)).0);
            let bound = words.bound().0 * medium.scale_per_mm;
            let reach = words.reach().0;
            let around = reach as i32 - 1;
            widest = widest.max(around);
            for dz in -around..=around {
                for dy in -around..=around {
                    for dx in -around..=around {
                        let n = c.as_ivec3() + IVec3::new(dx, dy, dz);
                        let inside = lattice.wrap(n, dims);
                        let beyond = inside.as_ivec3() != n;
                        let is_matter = inside.z as i32 == n.z && (lattice.repeats() || !beyond);
                        if is_matter {
                            let own: f32 = medium
                                .populations_of(number(inside))
                                .map(|p| p.broadside_per_mm)
                                .sum();
                            assert!(own <= bound, "{own} > {bound} at {n} from {c}");
                        }
                    }
                }
            }
        }
        assert!(widest > 1, "no voxel reaches beyond its neighbours");
    }
}

/// The nodes of a table against exact rays from the same places.
#[test]
fn tables_hold_exact_depths() {
    for repeats in [false, true] {
        let medium = FlatMedium::from_grid(&grid(repeats)).unwrap();
        for light in parallel() {
            let Light::Directional {
                direction,
                irradiance,
            } = light
            else {
                continue;
            };
            let extinctions = extinctions(&medium, -direction);
            let nodes = Nodes::new(&medium.lattice, std::iter::once(&extinctions[..]));
            let table = LightTable::new(medium.lattice, nodes, direction, irradiance, extinctions);
            let n = table.nodes.dims;
            for (i, &word) in table.depths.iter().enumerate() {
                let i = i as u32;
                let c = UVec3::new(i / n.z % n.x, i / (n.z * n.x), i % n.z);
                let p = (c.as_vec3() + 0.5) / table.nodes.per_voxel as f32;
                let mut ray = shadow_ray::ShadowRay {
                    lattice: &medium.lattice,
                    at: p,
                    toward: table.to_light,
                    reach_mm: f32::INFINITY,
                    sure_depth: f32::INFINITY,
                    chance: 0.0,
                };
                let exact = -table.transmittance(&medium, &ray).0.ln();
                if i.is_multiple_of(97) {
                    // Stopped by chance, it is that on average; and so without
                    // the extinctions of the table.
                    ray.sure_depth = 0.5;
                    let mut stopped = |k: u32| {
                        ray.chance = (k as f32 + 0.5) / 500.0;
                        let own = |voxel| medium.extinction_per_mm(voxel, ray.toward);
                        ray.transmittance(own).0
                    };
                    let mean = (0..500).map(&mut stopped).sum::<f32>() / 500.0;
                    assert!((mean - (-exact).exp()).abs() < 2e-3, "{mean}, {exact}");
                }
                let depth = (word & 0xff) as f32 * (light_table::MOST_DEPTH / 255.0);
                let least = exact.min(light_table::MOST_DEPTH);
                assert!((depth - least).abs() < 0.025, "{depth}, {exact} at {p}");
            }
        }
    }
}
