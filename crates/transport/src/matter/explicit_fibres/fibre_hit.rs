//! Where a ray meets a fibre, and what light does there.

use super::{ExplicitFibres, Found};
use crate::SiteInfo;
use glam::Vec3;
use organza_basis::PathRng;
use organza_scatter::{Fibre, FibreFrame, NearEvent, NearField};

/// Where a ray meets a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FibreHit {
    piece: u32,
    /// Unit tangent there.
    pub(super) tangent: Vec3,
    /// Where across its width, in `[-1, 1]`.
    pub(super) offset: f32,
    /// From the point met to the axis.
    to_axis_mm: Vec3,
    radius_mm: f32,
    near: NearEvent,
}

impl ExplicitFibres {
    /// A hit of a ray along `direction`. Light arrives along `light_direction`, which
    /// differs where a map of places turns rays otherwise than directions.
    pub(crate) fn describe(
        &self,
        found: &Found,
        direction: Vec3,
        light_direction: Vec3,
    ) -> FibreHit {
        let (tangent, out) = (found.entry.tangent, found.entry.out_mm);
        let frame = FibreFrame::new(tangent, -direction);
        // Across the tangent, which at a bend is not that of the cylinder.
        let across = out - tangent * tangent.dot(out);
        let normal = across.try_normalize().unwrap_or(-frame.forward);
        let offset = frame.offset(normal);
        let light_frame = FibreFrame::new(tangent, -light_direction);
        let fibre = self.fibre(found.entry.piece);
        FibreHit {
            piece: found.entry.piece,
            tangent,
            offset,
            to_axis_mm: found.to_axis_mm,
            radius_mm: out.length(),
            near: *fibre.near_field(light_frame, offset).event(),
        }
    }

    fn fibre(&self, piece: u32) -> &Fibre {
        &self.fibres[usize::from(self.curves.curve_of(piece).material)]
    }

    /// What light does at a hit.
    pub(crate) fn near(&self, hit: &FibreHit) -> NearField<'_> {
        self.fibre(hit.piece).near_field_of(hit.near)
    }

    /// From the point met to where light leaves toward `w_in`, by a lobe drawn in
    /// proportion to what it sends there, mm.
    pub(crate) fn exit_mm(&self, hit: &FibreHit, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        let normal = self.near(hit).exit_normal(w_in, rng);
        hit.to_axis_mm + hit.radius_mm * normal
    }

    /// How each material scatters.
    pub(crate) fn fibres(&self) -> &[Fibre] {
        &self.fibres
    }

    /// The material of the fibre that is hit.
    pub(crate) fn material(&self, hit: &FibreHit) -> u16 {
        self.curves.curve_of(hit.piece).material
    }

    /// What to show of a hit.
    pub(crate) fn info(&self, hit: &FibreHit) -> SiteInfo {
        SiteInfo::new(hit.tangent, Some(self.curves.curve_of(hit.piece).yarn))
    }
}
