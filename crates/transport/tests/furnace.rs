//! The furnace again, but gathered in a way that a wrong sampler cannot pass.
//!
//! A walk that only escapes returns one for albedo one whatever directions it
//! draws. Here every event also looks for the light in a uniformly drawn
//! direction, combined with the drawn direction by the balance heuristic, so
//! that the sampler's directions, its density and the phase function must all
//! belong together. A well-known renderer samples visible normals in a
//! transposed frame and returns 0.57 in such a furnace; its twin is below.

use glam::{UVec3, Vec3};
use organza_basis::{Aabb, Frame, Moments, PathRng, Ray, Rgb, Sym3, warp};
use organza_scatter::LobeSample;
use organza_transport::{
    CellGrid, CellSpan, Grid, GridMedium, Interpolation, LocalRay, Medium, SiteInfo, Stats,
    sample_collision, transmittance,
};
use std::ops::ControlFlow;

fn slab() -> GridMedium {
    let axis = Vec3::new(1.0, 0.3, 0.6).normalize();
    let bounds = Aabb::new(Vec3::new(0.0, 0.0, -0.1), Vec3::new(0.2, 0.2, 0.1));
    GridMedium::new(
        bounds,
        true,
        Interpolation::Nearest,
        Grid::new(UVec3::new(2, 2, 2), vec![[20.0]; 8]).unwrap(),
        Grid::constant(Sym3::axial(axis, 1.0, 0.09).to_array()),
        Grid::constant([1.0; 3]),
    )
    .unwrap()
}

/// The slab with visible normals drawn in a transposed frame: right where the
/// walk runs along z, wrong elsewhere.
struct TransposedFrame(GridMedium);

impl Medium for TransposedFrame {
    type Site = <GridMedium as Medium>::Site;

    fn cell_grid(&self) -> &CellGrid {
        self.0.cell_grid()
    }
    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.0.for_each_span(ray, visit)
    }
    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(f32, f32, Self::Site) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.0.for_each_voxel(ray, visit)
    }
    fn is_piecewise_constant(&self) -> bool {
        true
    }
    fn site(&self, p: Vec3) -> Self::Site {
        self.0.site(p)
    }
    fn sigma_t(&self, site: &Self::Site, w: Vec3) -> f32 {
        self.0.sigma_t(site, w)
    }
    fn eval(&self, site: &Self::Site, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.0.eval(site, w_out, w_in)
    }
    fn sample(&self, site: &Self::Site, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let right = self.0.sample(site, w_out, rng)?;
        let frame = Frame::from_normal(w_out);
        let normal = (w_out + right.w_in).normalize_or(w_out);
        let local = frame.frame_from_world(normal);
        // The rows of the frame's matrix taken for its columns.
        let wrong = frame.frame_from_world(local);
        let w_in = (2.0 * w_out.dot(wrong) * wrong - w_out).normalize();
        Some(LobeSample::new(
            w_in,
            right.weight,
            self.0.pdf(site, w_out, w_in),
        ))
    }
    fn pdf(&self, site: &Self::Site, w_out: Vec3, w_in: Vec3) -> f32 {
        self.0.pdf(site, w_out, w_in)
    }
    fn info(&self, site: &Self::Site) -> SiteInfo {
        self.0.info(site)
    }
}

/// One path of a furnace of radiance one.
pub fn gather<M: Medium>(medium: &M, mut ray: Ray, rng: &mut PathRng) -> f64 {
    let mut stats = Stats::default();
    let (mut sum, mut throughput) = (0.0f64, 1.0f64);
    let mut drawn_pdf = None::<f32>;
    let balance = |a: f32, b: f32| f64::from(a / (a + b));
    loop {
        let local = medium.cell_grid().clip(&ray, f64::INFINITY);
        let hit = local
            .as_ref()
            .and_then(|l| sample_collision(medium, l, rng, &mut stats).map(|h| (l, h)));
        let Some((local, (t, site))) = hit else {
            assert_eq!(stats.majorant_violations, 0);
            // Seen directly, or by a drawn direction that escaped.
            let weight = drawn_pdf.map_or(1.0, |p| balance(p, warp::UNIFORM_SPHERE_PDF));
            return sum + throughput * weight;
        };
        let at = ray.at(local.t_entry + f64::from(t));
        let w_out = -ray.direction;
        let site = medium.draw_event(site, w_out, rng);
        let w_light = warp::uniform_sphere(rng.unit2());
        let shadow = Ray::new(at, w_light);
        let through = medium
            .cell_grid()
            .clip(&shadow, f64::INFINITY)
            .map_or(1.0, |l| transmittance(medium, &l, rng, &mut stats));
        let value = medium.eval(&site, w_out, w_light).0.x;
        let weight = balance(warp::UNIFORM_SPHERE_PDF, medium.pdf(&site, w_out, w_light));
        sum += throughput * weight * f64::from(value * through / warp::UNIFORM_SPHERE_PDF);
        let Some(scatter) = medium.sample(&site, w_out, rng) else {
            return sum;
        };
        throughput *= f64::from(scatter.weight.0.x);
        if throughput < 1e-3 {
            return sum;
        }
        drawn_pdf = Some(scatter.pdf);
        ray = Ray::new(at, scatter.w_in);
    }
}

fn furnace<M: Medium>(medium: &M) -> Moments {
    let mut rng = PathRng::from_seed(21);
    let w = -Vec3::new(1.0, 0.5, 3.0).normalize();
    let ray = Ray::new(Vec3::new(0.1, 0.1, 0.0) - 5.0 * w, w);
    let one = |_| gather(medium, ray, &mut rng);
    (0..40_000).map(one).collect()
}

#[test]
fn the_furnace_is_one_and_the_transposed_frame_is_rejected() {
    let right = furnace(&slab());
    let far = |m: &Moments| (m.mean - 1.0).abs() / m.standard_error();
    let (mean, se) = (right.mean, right.standard_error());
    assert!(far(&right) < 4.0, "seed 21: {mean} +- {se}");
    let wrong = furnace(&TransposedFrame(slab()));
    let (mean, se) = (wrong.mean, wrong.standard_error());
    assert!(far(&wrong) > 10.0, "the twin passed: {mean} +- {se}");
}
