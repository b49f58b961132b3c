//! The kinds of matter in a scene.

use crate::matter::collision::AnySite;
use crate::matter::ray_target::{RayTarget, SceneMedium};
use crate::matter::site::MediumSite;
use crate::{
    ExplicitFibres, FlakeOctreeMedium, GridMedium, HybridFibres, LevelledCloth, Plane, Plies,
    VirtualFibreMedium,
};
use glam::Vec2;
use organza_basis::CellGrid;

/// The closed set of matter. Exports and the choice of the engine match on it; the walk
/// takes each kind as a [`RayTarget`], resolved once per ray.
pub enum AnyMedium {
    /// Dense grids.
    Grid(GridMedium),
    /// An octree of fibres, seen as micro-flakes of any family.
    FlakeOctree(FlakeOctreeMedium),
    /// An octree of fibres that scatter as virtual fibres.
    VirtualFibres(VirtualFibreMedium),
    /// Every fibre as a curve that rays intersect.
    ExplicitFibres(ExplicitFibres),
    /// Every ply as a curve that rays intersect.
    Plies(Plies),
    /// Explicit fibres for the first events of a path, virtual ones for the later.
    HybridFibres(Box<HybridFibres>),
    /// A cloth in several representations, or over a mesh.
    Levelled(Box<LevelledCloth>),
    /// No medium but an opaque plane.
    Plane(Plane),
}

impl AnyMedium {
    /// What a ray meets.
    pub(crate) fn target(&self) -> &dyn RayTarget {
        match self {
            AnyMedium::Grid(m) => m,
            AnyMedium::FlakeOctree(m) => m,
            AnyMedium::VirtualFibres(m) => m,
            AnyMedium::ExplicitFibres(m) => m,
            AnyMedium::Plies(m) => m,
            AnyMedium::HybridFibres(m) => &**m,
            AnyMedium::Levelled(m) => &**m,
            AnyMedium::Plane(m) => m,
        }
    }

    fn target_mut(&mut self) -> &mut dyn RayTarget {
        match self {
            AnyMedium::Grid(m) => m,
            AnyMedium::FlakeOctree(m) => m,
            AnyMedium::VirtualFibres(m) => m,
            AnyMedium::ExplicitFibres(m) => m,
            AnyMedium::Plies(m) => m,
            AnyMedium::HybridFibres(m) => &mut **m,
            AnyMedium::Levelled(m) => &mut **m,
            AnyMedium::Plane(m) => m,
        }
    }

    /// Where the medium is; `None` for a plane, which has no box.
    pub fn cell_grid(&self) -> Option<&CellGrid> {
        self.target().cell_grid()
    }

    /// Cuts a medium to a rectangle of the x-y plane ([`CellGrid::cut_to`]).
    /// `None` when nothing would be left, or it is a plane or over a mesh.
    pub fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        self.target_mut().cut_to(min_mm, max_mm)
    }

    /// True when exact stepping is possible.
    pub fn is_piecewise_constant(&self) -> bool {
        self.target().is_piecewise_constant()
    }
}

/// A medium and its variant among all matter.
macro_rules! scene_medium {
    ($medium:ty, $variant:ident) => {
        impl SceneMedium for $medium {
            fn cell_grid_mut(&mut self) -> &mut CellGrid {
                self.cell_grid_mut()
            }

            fn any_site(site: MediumSite<'_, Self>) -> AnySite<'_> {
                AnySite::$variant(site)
            }
        }
    };
}

scene_medium!(GridMedium, Grid);
scene_medium!(FlakeOctreeMedium, FlakeOctree);
scene_medium!(VirtualFibreMedium, VirtualFibres);
