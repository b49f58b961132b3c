//! Where the texels of a table's texture are.

use glam::{UVec2, Vec2, Vec3};

/// Most texels of a texture.
pub const MAX_TEXELS: u32 = 4096;
/// The smallest cosine of the angle of sight with which places are moved between the planes.
const LEAST_COSINE: f32 = 0.1;

/// A grid of texels over the period of a cloth.
///
/// Texels lie in two planes, one for lines of sight that come from the face and one for those
/// from the back, at the mean height of what such lines meet. A thread is then at the same
/// texels from all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureLayout {
    /// Texels along the weft and along the warp, powers of two.
    pub size: UVec2,
    /// A corner of a period, mm.
    pub origin_mm: Vec2,
    /// The period, mm.
    pub period_mm: Vec2,
    /// Heights of the planes above the middle of the cloth, mm: for directions of the face and
    /// of the back.
    pub heights_mm: [f32; 2],
}

impl TextureLayout {
    /// Whether its numbers can be used.
    pub fn is_sound(&self) -> bool {
        let good = |x: f32| x > 0.0 && x.is_finite();
        self.size.x.is_power_of_two()
            && self.size.y.is_power_of_two()
            && self.size.x <= MAX_TEXELS
            && self.size.y <= MAX_TEXELS / self.size.x.max(1)
            && good(self.period_mm.x)
            && good(self.period_mm.y)
            && self.origin_mm.is_finite()
            && self.heights_mm.iter().all(|h| h.is_finite())
    }

    /// The number of texels.
    pub fn texels(&self) -> usize {
        (self.size.x * self.size.y) as usize
    }

    /// The wider side of a texel, mm.
    pub fn texel_mm(&self) -> f32 {
        (self.period_mm / self.size.as_vec2()).max_element()
    }

    /// From the middle plane to the plane of the texels, along a direction away from the cloth.
    fn shift_mm(&self, w: Vec3) -> Vec2 {
        let height = self.heights_mm[usize::from(w.z < 0.0)];
        let cosine = w.z.abs().max(LEAST_COSINE).copysign(w.z);
        w.truncate() * (height / cosine)
    }

    /// The place in the plane of the texels that is seen from `w` at a place of the middle
    /// plane, mm.
    pub fn texels_from_middle(&self, middle_mm: Vec2, w: Vec3) -> Vec2 {
        middle_mm + self.shift_mm(w)
    }

    /// The place of the middle plane behind a place in the plane of the texels, seen from `w`,
    /// mm.
    pub fn middle_from_texels(&self, place_mm: Vec2, w: Vec3) -> Vec2 {
        place_mm - self.shift_mm(w)
    }

    /// A place within a texel, mm, from two numbers between 0 and 1.
    pub fn place_mm(&self, texel: usize, within: Vec2) -> Vec2 {
        let x = texel as u32 % self.size.x.max(1);
        let y = texel as u32 / self.size.x.max(1);
        let corner = Vec2::new(x as f32, y as f32);
        self.origin_mm + (corner + within) / self.size.as_vec2() * self.period_mm
    }
}
