//! A lens that focuses at one distance.

use super::{CameraKey, CameraKind, CameraTable};
use glam::DVec3;
use organza_transport::{Projection, aperture_mm};

/// Width of the sensor that f-numbers refer to by default: the
/// 36 mm of small-picture film.
const SENSOR_WIDTH_MM: f64 = 36.0;

/// `kind = "thin-lens"`
pub static THIN_LENS: CameraKind = CameraKind {
    name: "thin-lens",
    keys: &[
        // Horizontal angle of view.
        CameraKey::angle("fov_deg"),
        // Diameter of the lens; or its f-number, focal length over diameter, the former
        // from `fov_deg`, `focus_mm` and `sensor_width_mm`.
        CameraKey::length("aperture_mm"),
        CameraKey::length("f_number"),
        // Distance in focus along the axis; that of the target if none.
        CameraKey::length("focus_mm"),
        // With `f_number`: width of the sensor, 36 if none.
        CameraKey::length("sensor_width_mm"),
    ],
    projection,
};

fn projection(t: &CameraTable) -> Result<Projection, String> {
    let fov_rad = t.own.required("fov_deg")?.to_radians();
    let sensor_width_mm = t.own.get("sensor_width_mm");
    let to_target = DVec3::from(t.target_mm) - DVec3::from(t.origin_mm);
    let focus_mm = t.own.get("focus_mm").unwrap_or(to_target.length());
    let aperture_mm = match (t.own.get("aperture_mm"), t.own.get("f_number")) {
        (Some(d), None) if sensor_width_mm.is_none() => d,
        (Some(_), None) => return Err("sensor_width_mm belongs to f_number".into()),
        (None, Some(n)) if !(n > 0.0 && n.is_finite()) => {
            return Err(format!("f_number must be positive, found {n}"));
        }
        (None, Some(n)) => {
            let sensor_mm = sensor_width_mm.unwrap_or(SENSOR_WIDTH_MM);
            if !(sensor_mm > 0.0 && sensor_mm.is_finite()) {
                return Err(format!(
                    "sensor_width_mm must be positive, found {sensor_mm}"
                ));
            }
            aperture_mm(n, fov_rad, focus_mm, sensor_mm)
        }
        _ => return Err("a thin lens takes either aperture_mm or f_number".into()),
    };
    Ok(Projection::ThinLens {
        fov_rad,
        aperture_mm,
        focus_mm,
    })
}
