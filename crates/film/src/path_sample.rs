//! The result of one path.

use glam::Vec3;
use organza_basis::Rgb;

/// What a picture may show of a point in a medium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SiteInfo {
    /// Unit fibre axis, or zero where the medium has none.
    pub axis: Vec3,
    /// Yarn number, where the medium has yarns.
    pub yarn: Option<u32>,
}

impl SiteInfo {
    /// An axis, and the yarn.
    pub const fn new(axis: Vec3, yarn: Option<u32>) -> SiteInfo {
        SiteInfo { axis, yarn }
    }
}

/// The first event of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstEvent {
    /// What is there.
    pub info: SiteInfo,
    /// Distance from the camera.
    pub depth_mm: f64,
}

/// How a path left the matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Escape {
    /// Unit direction in which it went.
    pub direction: Vec3,
    /// What it still carried.
    pub throughput: Rgb,
}

/// What one path found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathSample {
    /// Radiance toward the camera.
    pub radiance: Rgb,
    /// The part of it that came straight to the camera or by one event.
    pub direct: Rgb,
    /// Scattering events along the path.
    pub bounces: u32,
    /// Its first event, `None` when the camera saw straight through the cloth
    /// (to a plane behind it, if there is one).
    pub first: Option<FirstEvent>,
    /// Estimate of the share that was absorbed along the way.
    pub absorbed: Rgb,
    /// How it left the matter, unless it ended inside.
    pub escape: Option<Escape>,
}
