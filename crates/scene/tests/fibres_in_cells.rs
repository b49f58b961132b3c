//! Shipped fabrics in the cells of the kernel: hits against trying every piece of fibre in
//! double precision, and transmission against the general walk.
//!
//! `ORGANZA_FULL=1 cargo test --release -p organza-scene --test main fibres_in_cells --
//! --nocapture` takes 100,000 rays, and paths for 0.2 % of the transmission.

use glam::{DVec2, DVec3, Vec2, Vec3};
use organza_basis::{PathRng, Rgb, unwatched, warp};
use organza_kernel::fibres::exhaustive::{Compared, Exhaustive};
use organza_kernel::fibres::{FibreEntry, FibreMatter};
use organza_measure::{Albedo, Angles, Effort, Exit, PatchResponse, VolumePatch, measure_albedos};
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_testing::{is_full, sized};
use organza_transport::{AnyMedium, ExplicitFibres, Integrator, Stats};
use std::path::Path;

fn fibres_of(name: &str, overrides: &[String]) -> ExplicitFibres {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics/");
    let path = Path::new(folder).join(name).with_extension("toml");
    let loader = Loader::new();
    let fabric = fabric_file::load(&path, overrides, &loader).unwrap();
    fabric.explicit_fibres(&path, None, &loader).unwrap()
}

/// How far rays are followed from near a place, mm.
const REACH_MM: f64 = 0.25;

/// Rays about a fibre, from near its surface, from within it or from farther away: any,
/// nearly along it, exactly along it, and in the plane of the cloth.
fn ray(axis: DVec3, radius_mm: f64, at: DVec3, i: u64, rng: &mut PathRng) -> (DVec3, DVec3) {
    let any = warp::uniform_sphere(rng.unit2()).as_dvec3();
    let d = match i % 6 {
        0 => axis,
        1 => (axis + 1e-3 * any).normalize(),
        2 => (axis + 0.03 * any).normalize(),
        3 => (any * DVec3::new(1.0, 1.0, 0.02)).normalize(),
        _ => any,
    };
    let aside =
        2.0 * radius_mm * f64::from(rng.unit()) * warp::uniform_sphere(rng.unit2()).as_dvec3();
    let back = if i % 4 == 3 { 0.1 } else { 0.0 };
    (at + aside - back * d, d)
}

/// None missed, none extra, none wrong, but for rays that graze a fibre, which rounding
/// decides. The twin: the fibres of another seed.
#[test]
fn rays_meet_what_trying_every_piece_finds() {
    let rays: u64 = sized(1_200, 100_000);
    let fabrics = [
        "denim",
        "jersey",
        "organza",
        "charmeuse",
        "towel",
        "wool_tweed",
    ];
    let fabrics = &fabrics[..sized(2, 6)];
    let places = 16;
    for (seed, &name) in (1..).zip(fabrics) {
        let fibres = fibres_of(name, &[]);
        let body = fibres.body(None);
        let (strands, origin_mm) = (body.strands, body.origin_mm.as_dvec3());
        let bounds = fibres.cell_grid().bounds_mm();
        let period: DVec2 = bounds.size().truncate().as_dvec2();
        let matter = FibreMatter::new(&[body], Vec::new(), u64::MAX).unwrap();
        let radii = strands.joints.iter().map(|j| f64::from(j.radius_mm));
        let start_mm = 1e-3 * radii.fold(f64::INFINITY, f64::min);
        let (mut wrong, mut grazing, mut met, mut twins) = (0, 0, 0, 0);
        for place in 0..places {
            let mut rng = PathRng::new(seed, 0, place);
            let pieces = strands.joints.len() - 1;
            let joint = (rng.unit() * pieces as f32) as usize;
            let [a, b] = [&strands.joints[joint], &strands.joints[joint + 1]];
            let along = (b.position - a.position).as_dvec3();
            let axis = along.try_normalize().filter(|_| a.strand == b.strand);
            let axis = axis.unwrap_or(DVec3::X);
            let at = origin_mm + a.position.as_dvec3();
            let tried = Exhaustive::near(strands, origin_mm, period, at, REACH_MM + 0.15);
            for i in 0..rays / 6 / places {
                let (from, d) = ray(axis, f64::from(a.radius_mm), at, i, &mut rng);
                let is_inside =
                    (f64::from(bounds.min.z)..=f64::from(bounds.max.z)).contains(&from.z);
                let least = if is_inside { start_mm } else { 0.0 };
                let within = |h: &FibreEntry| h.distance_mm < REACH_MM && h.distance_mm > least;
                let own = matter.first_hit(from, d).filter(within);
                let ends = (least, REACH_MM);
                met += u64::from(tried.first(from, d, ends).is_some());
                let hair = 1e-4 * f64::from(a.radius_mm);
                let aside = DVec3::new(0.0, 0.0, 2.0 * f64::from(a.radius_mm));
                let compare = |from| tried.compare(own.as_ref(), (from, d), ends, hair);
                twins += u64::from(compare(from + aside) != Compared::Same);
                match compare(from) {
                    Compared::Same => {}
                    Compared::Grazing => grazing += 1,
                    Compared::Wrong => {
                        wrong += 1;
                        println!("{name}, place {place}, ray {i}: {from} {d}: {own:?}");
                    }
                }
            }
        }
        let all = rays / 6 / places * places;
        println!("{name}: {all} rays, {met} meet fibres, {grazing} graze, {wrong} are wrong");
        assert_eq!(wrong, 0, "seed {seed}, {name}");
        assert!(
            grazing <= all / 50,
            "seed {seed}, {name}: {grazing} of {all} graze"
        );
        assert!(
            met > all / 4,
            "seed {seed}, {name}: {met} of {all} meet fibres"
        );
        assert!(
            twins > all / 4,
            "seed {seed}, {name}: the twin differs in {twins}"
        );
    }
}

/// Where explicit fibres overlap they are one body, and less than the volume that stands for
/// them: how much less is a property of our yarns. Margin: half of the bounds.
#[test]
fn fibres_of_the_projects_fabrics_overlap_little() {
    for (name, most) in [("denim", 0.05), ("organza", 0.015)] {
        let fibres = fibres_of(name, &[]);
        let (body, bounds) = (fibres.body(None), fibres.cell_grid().bounds_mm());
        let period = bounds.size().truncate().as_dvec2();
        let (mut union, mut sum) = (0, 0);
        for place in 0..512 {
            let mut rng = PathRng::new(1, 0, place);
            let mut unit = || Vec3::new(rng.unit(), rng.unit(), rng.unit());
            let at = bounds.min + unit() * bounds.size();
            let origin_mm = body.origin_mm.as_dvec3();
            let near = Exhaustive::near(body.strands, origin_mm, period, at.as_dvec3(), 0.05);
            for _ in 0..64 {
                let held = near.holding((at + 0.05 * (unit() - 0.5)).as_dvec3());
                union += usize::from(held > 0);
                sum += held;
            }
        }
        let shared = 1.0 - union as f64 / sum as f64;
        println!(
            "{name}: {union} of {} points in fibres, {shared:.4} shared",
            512 * 64
        );
        assert!(union > 1000 && shared < most, "seed 1, {name}: {shared}");
    }
}

/// A patch whose paths the general walk traces, one at a time.
struct ByWalk<'a>(&'a VolumePatch);

impl PatchResponse for ByWalk<'_> {
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
        self.0.estimate_bsdf(w_in, w_out, rng, stats)
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        self.0.estimate_at(place_mm, w_in, w_out, rng, stats)
    }

    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        self.0.estimate_exit(w, rng, stats)
    }

    fn is_exact(&self) -> bool {
        false
    }
}

fn patch(name: &str, overrides: &[String]) -> VolumePatch {
    let fibres = AnyMedium::ExplicitFibres(fibres_of(name, overrides));
    VolumePatch::of_media(vec![fibres], Integrator::Woodcock).unwrap()
}

fn albedo(patch: &impl PatchResponse, paths: u64, seed: u64) -> Albedo {
    let straight = Angles {
        theta_deg: 0.0,
        phi_deg: 0.0,
    };
    let effort = Effort {
        paths,
        seed,
        target_error: None,
    };
    let measured = measure_albedos(patch, &[straight], &effort, &unwatched);
    measured.unwrap().list.remove(0)
}

/// All light that passes and its standard error, per channel: a fibre that is met again by
/// the light that leaves it would take some of it, which a white furnace does not show. The
/// twins have threads of another colour.
#[test]
fn a_dark_and_a_clear_fabric_transmit_what_the_walk_transmits() {
    let (white, dark) = (
        "warp.colours=[[0.9,0.9,0.9]]",
        "weft.colours=[[0.1,0.1,0.1]]",
    );
    for (seed, name, other, paths) in [
        (7, "denim", white, [8_000, 4_000_000]),
        (9, "organza", dark, [8_000, 700_000]),
    ] {
        let paths = sized(paths[0], paths[1]);
        let cloth = patch(name, &[]);
        let own = albedo(&cloth, paths, seed);
        let walked = albedo(&ByWalk(&cloth), paths, seed + 1);
        let twin = albedo(&patch(name, &[other.to_owned()]), paths, seed);
        let mut rejected = false;
        for c in 0..3 {
            let parts = |a: &Albedo| {
                let (t, d) = (&a.transmitted, &a.direct);
                (t.mean[c] + d.mean[c], t.se[c].hypot(d.se[c]))
            };
            let (a, b, twin) = (parts(&own), parts(&walked), parts(&twin));
            let z = |a: (f64, f64)| (a.0 - b.0) / a.1.hypot(b.1);
            println!(
                "{name}, channel {c}: {a:?} in cells, {b:?} walked, {:.2} apart; twin {:.1}",
                z(a),
                z(twin)
            );
            assert!(z(a).abs() < 4.0, "seed {seed}, {name}: {a:?} for {b:?}");
            assert!(!is_full() || b.1 < 4e-3 * b.0, "seed {seed}, {name}: {b:?}");
            rejected |= z(twin).abs() > 4.0;
        }
        assert!(rejected, "seed {seed}, {name}: the twin passes");
    }
}
