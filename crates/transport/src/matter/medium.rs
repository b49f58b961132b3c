//! The waist between matter and trackers.

use crate::SiteInfo;
use glam::Vec3;
use organza_basis::{CellGrid, CellSpan, LocalRay, PathRng, Rgb};
use organza_scatter::LobeSample;
use std::ops::ControlFlow;

/// Matter that scatters light, as a tracker sees it.
///
/// Points are given in the *local* coordinates of [`Medium::cell_grid`], one
/// unit a voxel; directions are unit vectors in the world. `w_out` points back
/// along the walk, toward the camera; `w_in` toward the light.
pub trait Medium: Sync {
    /// What one look-up gives; everything else is computed from it.
    type Site: Copy + Send;

    /// Where the medium is, and how it repeats.
    fn cell_grid(&self) -> &CellGrid;

    /// Visits stretches of the ray in order, each with a bound in 1/mm on the
    /// extinction over that stretch **and over all directions**, until `visit`
    /// breaks. Empty stretches are left out.
    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B>;

    /// Visits the voxels along the ray, `[t0, t1]` and what is there, in order,
    /// until `visit` breaks: the exact version of [`Medium::for_each_span`]
    /// where [`Medium::is_piecewise_constant`].
    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(f32, f32, Self::Site) -> ControlFlow<B>,
    ) -> ControlFlow<B>;

    /// True when [`Medium::site`] is constant within voxels, so that exact
    /// stepping is possible.
    fn is_piecewise_constant(&self) -> bool;

    /// The medium at a local point inside the cell grid's box.
    fn site(&self, p: Vec3) -> Self::Site;

    /// A bound in 1/mm on the extinction of whatever [`Medium::meet`] finds at a
    /// local point, over all directions, where one is known with less trouble than
    /// meeting takes.
    fn majorant_at(&self, _p: Vec3) -> f32 {
        f32::INFINITY
    }

    /// What a tentative collision at a local point of a ray finds: [`Medium::site`],
    /// unless the medium draws something there. Its mean extinction over what is drawn
    /// is the medium's.
    fn meet(&self, p: Vec3, _ray: &LocalRay, _rng: &mut PathRng) -> Self::Site {
        self.site(p)
    }

    /// Draws, once for a real collision, which part of the site the light meets, a
    /// fibre or a flake. The methods below then describe scattering at that part.
    /// Media that scatter as the whole site return it unchanged.
    fn draw_event(&self, site: Self::Site, _w_out: Vec3, _rng: &mut PathRng) -> Self::Site {
        site
    }

    /// From the collision to where a ray toward `w_in` starts, mm: not zero
    /// where light leaves matter elsewhere than it came in.
    fn exit_mm(&self, _site: &Self::Site, _w_out: Vec3, _w_in: Vec3, _rng: &mut PathRng) -> Vec3 {
        Vec3::ZERO
    }

    /// Extinction in 1/mm of light that travels along `w` (either sense).
    fn sigma_t(&self, site: &Self::Site, w: Vec3) -> f32;

    /// Albedo times phase function, per channel, 1/sr: reciprocal as
    /// `sigma_t(w_out) eval(w_out, w_in) = sigma_t(w_in) eval(w_in, w_out)`.
    fn eval(&self, site: &Self::Site, w_out: Vec3, w_in: Vec3) -> Rgb;

    /// Draws `w_in`; `None` when the light is absorbed.
    fn sample(&self, site: &Self::Site, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample>;

    /// Density with which [`Medium::sample`] draws `w_in`, 1/sr.
    fn pdf(&self, site: &Self::Site, w_out: Vec3, w_in: Vec3) -> f32;

    /// Visibility, within the cell around a collision at `at_mm`, of light from `w_in`, and
    /// the distance in mm to the cell's face; `None` without tables of it.
    fn local_visibility(
        &self,
        _site: &Self::Site,
        _at_mm: Vec3,
        _w_out: Vec3,
        _w_in: Vec3,
    ) -> Option<(f32, f32)> {
        None
    }

    /// What to show of the site.
    fn info(&self, site: &Self::Site) -> SiteInfo;

    /// The yarn of [`Medium::info`], which every event asks for: without the axis, where that
    /// takes long to find.
    fn yarn(&self, site: &Self::Site) -> Option<u32> {
        self.info(site).yarn
    }
}
