//! Prints outlines and azimuthal lobes of fibre sections as CSV, for `scenes/sections/sections.py`:
//! name, `outline`, x, y in mean radii, 0; and name, azimuth in degrees, light of R, TT and
//! what comes later, per radian.

#![allow(clippy::print_stdout)] // Its output is its purpose.

use organza_basis::Rgb;
use organza_scatter::{DielectricFibre, DielectricParameters, Fibre, Section};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for name in ["ellipse:1", "bean", "trilobal", "triangle", "ribbon"] {
        let section = Section::from_name(name)?;
        for corner in section.outline() {
            println!("{name},outline,{},{},0", corner.x, corner.y);
        }
        let parameters = DielectricParameters {
            ior: 1.55,
            absorption_radii: Rgb::BLACK,
            longitudinal_rad: 0.1,
            azimuthal_rad: 4f32.to_radians(),
        };
        let fibre = DielectricFibre::with_section(parameters, Some(section))?;
        let fibre = Fibre::from(fibre);
        let parts = fibre.far_parts();
        for degree in 0..=180u8 {
            let azimuth = f32::from(degree).to_radians();
            let [r, tt, later] = [0, 1, 2].map(|p| parts.azimuthal(p, 1.0, azimuth).0.x);
            println!("{name},{degree},{r},{tt},{later}");
        }
    }
    Ok(())
}
