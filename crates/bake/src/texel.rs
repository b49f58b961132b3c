//! One texel of the maps, as the material models see it.

use glam::{Vec2, Vec3};

/// The geometry and colour of one texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texel {
    /// Share of the texel that fibres cover, seen along the normal.
    pub coverage: f32,
    /// Slope of the visible surface: height per length along x and y.
    pub slope: Vec2,
    /// Direction across the visible fibres, the rough one, radians from x.
    pub across_rad: f32,
    /// How well the fibres agree in direction, 0 to 1.
    pub order: f32,
    /// Share of light that the covered part reflects, from a bright sky.
    pub reflected: Vec3,
    /// Share of light that the covered part scatters to the other side.
    pub transmitted: Vec3,
    /// Light reflected by one fibre, as a share of five quarters of its mean; at most one.
    pub gloss: f32,
}

/// Normal, rough direction and the third axis of a texel.
#[derive(Clone, Copy, Debug)]
pub struct TexelFrame {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl Texel {
    /// A flat texel that is covered and reflects a share of light, for tests and for maps
    /// without relief.
    pub fn flat(reflected: Vec3) -> Texel {
        Texel {
            coverage: 1.0,
            slope: Vec2::ZERO,
            across_rad: 0.0,
            order: 1.0,
            reflected,
            transmitted: Vec3::ZERO,
            gloss: 1.0,
        }
    }

    /// Share of light that is transmitted by scattering, in its strongest channel.
    pub fn transmission(&self) -> f32 {
        self.transmitted.max_element().min(0.98)
    }

    /// Colour of the transmitted light, its strongest channel one.
    pub fn transmission_hue(&self) -> Vec3 {
        self.transmitted / self.transmitted.max_element().max(1e-6)
    }

    /// Colour of diffuse reflection below a share of transmission.
    pub fn base(&self) -> Vec3 {
        (self.reflected / (1.0 - self.transmission())).min(Vec3::ONE)
    }

    /// Colour of the reflected light, its strongest channel one.
    pub fn hue(&self) -> Vec3 {
        self.reflected / self.reflected.max_element().max(1e-6)
    }

    /// The unit normal when slopes count `relief` times.
    pub fn normal(&self, relief: f32) -> Vec3 {
        (-relief * self.slope).extend(1.0).normalize()
    }

    /// The frame of the texel.
    pub fn frame(&self, relief: f32) -> TexelFrame {
        let z = self.normal(relief);
        let (sin, cos) = self.across_rad.sin_cos();
        let across = Vec3::new(cos, sin, 0.0);
        let x = (across - z * across.dot(z)).normalize();
        TexelFrame {
            x,
            y: z.cross(x),
            z,
        }
    }
}

impl TexelFrame {
    /// A direction in the coordinates of the frame.
    pub fn local(&self, w: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(w), self.y.dot(w), self.z.dot(w))
    }
}
