//! `kind = "plane"`: an opaque, endless plane.

use super::{At, ObjectKind};
use crate::build_options::BuildOptions;
use crate::error::Result;
use glam::Vec3;
use organza_basis::{Budget, Rgb};
use organza_transport::{AnyMedium, Camera, Plane};
use serde::Deserialize;
use serde_json::{Value, json};

/// An opaque, endless plane.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneTable {
    /// A point of it.
    pub position_mm: [f32; 3],
    /// The side that shines, +z if none.
    pub normal: Option<[f32; 3]>,
    /// Share of light scattered, evenly to all directions; 0 if none.
    pub reflectance: Option<[f32; 3]>,
    /// Light sent out on the side of the normal; 0 if none.
    pub radiance: Option<[f32; 3]>,
}

impl ObjectKind for PlaneTable {
    fn check(&self, at: &At<'_>) -> Result<()> {
        plane(self)
            .map(|_| ())
            .map_err(|why| at.fail(format!(": {why}")))
    }

    fn shines(&self) -> bool {
        self.radiance.is_some()
    }

    fn describe(&self, _: &At<'_>, _: &BuildOptions<'_>) -> Result<Value> {
        Ok(json!({}))
    }

    fn media(
        &self,
        at: &At<'_>,
        _: &Camera,
        _: &BuildOptions<'_>,
        _: &mut Budget,
    ) -> Result<Vec<AnyMedium>> {
        plane(self)
            .map(|plane| vec![AnyMedium::Plane(plane)])
            .map_err(|why| at.fail(format!(": {why}")))
    }
}

fn plane(t: &PlaneTable) -> Result<Plane, String> {
    let black = [0.0; 3];
    let reflectance = colour(t.reflectance.unwrap_or(black), "reflectance")?;
    if reflectance.max_component() > 1.0 {
        return Err(format!(
            "reflectance: expected three numbers from 0 to 1, found {:?}",
            reflectance.0.to_array()
        ));
    }
    let radiance = colour(t.radiance.unwrap_or(black), "radiance")?;
    let normal = Vec3::from_array(t.normal.unwrap_or([0.0, 0.0, 1.0]));
    Plane::new(
        Vec3::from_array(t.position_mm),
        normal,
        reflectance,
        radiance,
    )
    .ok_or_else(|| {
        "position_mm, normal: expected finite vectors, and a normal that is not zero".into()
    })
}

/// A vector of a table, as what it must be.
fn colour(c: [f32; 3], key: &str) -> Result<Rgb, String> {
    let c = Rgb::from(c);
    if c.is_valid() {
        Ok(c)
    } else {
        Err(format!(
            "{key}: expected three finite numbers of at least 0, found {:?}",
            c.0.to_array()
        ))
    }
}
