//! Where surface models meet the walk: neither crate knows of the other.

use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_scatter::LobeSample;
use organza_surface::weave::Yarn;
use organza_surface::{Footprint, SurfaceModel, WovenSurface};
use organza_transport::{Sheet, SheetPoint};

/// A woven surface as a sheet of a scene.
pub struct WovenSheet {
    surface: WovenSurface,
    /// Place of the volume's origin in the surface's tiling, mm.
    origin_mm: Vec2,
}

impl WovenSheet {
    /// `tile_min_mm` is where the volume's first threads begin. The volume has
    /// its yarns in the middle of their pitch, the tiling at its beginning.
    pub fn new(surface: WovenSurface, tile_min_mm: Vec2) -> WovenSheet {
        let tiling = surface.tiling();
        let before = |yarn: Yarn| {
            let (_, pitch) = tiling.yarns(yarn);
            let segments = tiling.segments();
            let placed = segments.iter().find(|s| s.yarn == yarn);
            let width = placed.map_or(pitch, |s| s.width_mm);
            0.5 * (pitch - width)
        };
        let origin_mm = -tile_min_mm - Vec2::new(before(Yarn::Warp), before(Yarn::Weft));
        WovenSheet { surface, origin_mm }
    }

    fn footprint(&self, at: SheetPoint) -> Footprint {
        Footprint {
            position_mm: at.position_mm + self.origin_mm,
            width_mm: at.footprint_mm,
        }
    }
}

impl Sheet for WovenSheet {
    fn gap(&self, w: Vec3) -> f32 {
        self.surface.gap(w)
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3, at: SheetPoint) -> Rgb {
        let met = 1.0 - self.surface.gap(w_out);
        if met <= 0.0 {
            return Rgb::BLACK;
        }
        self.surface.eval(w_in, w_out, self.footprint(at)) * (w_in.z.abs() / met)
    }

    /// The model draws gaps too; those are drawn again, as often as a ray that
    /// met yarn is rare, so that the mean number of draws a ray is one.
    fn sample(&self, w_out: Vec3, at: SheetPoint, rng: &mut PathRng) -> Option<LobeSample> {
        let met = 1.0 - self.surface.gap(w_out);
        if met <= 0.0 {
            return None;
        }
        let at = self.footprint(at);
        loop {
            let drawn = self.surface.sample(w_out, at, rng)?;
            if !drawn.is_straight() {
                return Some(LobeSample {
                    w_in: drawn.w_i,
                    weight: drawn.weight,
                    pdf: drawn.pdf / met,
                });
            }
        }
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: SheetPoint) -> f32 {
        let met = 1.0 - self.surface.gap(w_out);
        if met <= 0.0 {
            return 0.0;
        }
        self.surface.pdf(w_in, w_out, self.footprint(at)) / met
    }

    fn axis(&self, at: SheetPoint) -> Vec3 {
        let tiling = self.surface.tiling();
        let spot = tiling.locate(self.footprint(at).position_mm);
        match tiling.segments().get(spot.segment).map(|s| s.yarn) {
            Some(Yarn::Warp) => Vec3::Y,
            Some(Yarn::Weft) => Vec3::X,
            None => Vec3::ZERO,
        }
    }
}
