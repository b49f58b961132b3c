//! Orthonormal frames.

use glam::Vec3;

/// An orthonormal frame, right-handed (`s x t = n`) but where cloth lies mirrored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal, the frame's own z.
    pub n: Vec3,
}

impl Frame {
    /// A frame whose z is the unit vector `n`, without branches that lose
    /// precision near the poles [Duff2017].
    pub fn from_normal(n: Vec3) -> Frame {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// The frame of cloth with the unit normal `n`: s is along the weft, and t on the side of the
    /// warp. Left-handed where these mirror the cloth; `from_normal` where the weft is along `n`.
    pub fn of_cloth([weft, warp]: [Vec3; 2], n: Vec3) -> Frame {
        let Some(s) = (weft - n * weft.dot(n)).try_normalize() else {
            return Frame::from_normal(n);
        };
        let t = n.cross(s);
        let t = if t.dot(warp) < 0.0 { -t } else { t };
        Frame { s, t, n }
    }

    /// The frame's coordinates of a vector given in the world.
    pub fn frame_from_world(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// The world's coordinates of a vector given in the frame.
    pub fn world_from_frame(&self, v: Vec3) -> Vec3 {
        v.x * self.s + v.y * self.t + v.z * self.n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed_everywhere() {
        for i in 0..2000 {
            let z = -1.0 + (i as f32 + 0.5) / 1000.0;
            let phi = i as f32 * 2.399_963_2;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            let f = Frame::from_normal(n);
            assert!((f.s.cross(f.t) - f.n).length() < 2e-6, "{n}");
            assert!(f.s.dot(f.n).abs() < 1e-6 && f.t.dot(f.n).abs() < 1e-6);
            let back = f.world_from_frame(f.frame_from_world(Vec3::new(0.1, -0.7, 0.4)));
            assert!((back - Vec3::new(0.1, -0.7, 0.4)).length() < 1e-6);
        }
        for n in [Vec3::Z, Vec3::NEG_Z] {
            let f = Frame::from_normal(n);
            assert_eq!(f.s.cross(f.t), f.n);
        }
    }
}
