//! The photographs of a fit, read and made even.

use super::flags::VignettingFlag;
use super::sides::without_vignetting;
use crate::commands::fit::{BACK_LIGHT, FitArgs, LIGHT, picture};
use crate::error::input;
use anyhow::Result;
use glam::DVec2;
use organza_photograph::Photograph;
use std::path::Path;

/// A photograph from a file.
fn read(args: &FitArgs, path: &Path) -> Result<Photograph> {
    let (size, pixels) = picture::read_picture(path, &args.common.host, args.memory.max_memory)?;
    let rows: Vec<[f32; 3]> = pixels.iter().map(|p| p.0.to_array()).collect();
    Photograph::new(size.x as usize, size.y as usize, &rows)
        .map_err(|e| input(format!("{}: {e}", path.display())))
}

/// The photographs, without vignetting, and the vignetting that was found.
pub struct Photographs {
    /// That of the face.
    pub front: Photograph,
    /// That against the light.
    pub back: Option<Photograph>,
    /// Size of the cloth in them.
    pub size_mm: DVec2,
    /// What is printed of the vignetting.
    pub vignetting: Vec<String>,
}

impl Photographs {
    /// Reads those that the arguments name.
    ///
    /// # Errors
    /// Names the file or the flag.
    pub fn read(args: &FitArgs, front: &Path) -> Result<Photographs> {
        let Some(width_mm) = args.width_mm else {
            return Err(input(
                "--width-mm: expected the width of the cloth in the photograph, mm",
            ));
        };
        let photograph = read(args, front)?;
        let [w, h] = photograph.size();
        let size_mm = DVec2::new(width_mm, width_mm * h as f64 / w as f64);
        let back = args.back.as_deref();
        let back = back.map(|path| read(args, path).map(|p| (path, p)));
        let back = back.transpose()?;
        if let Some((path, back)) = &back
            && back.size() != photograph.size()
        {
            return Err(input(format!(
                "{}: has {} x {} pixels; expected {w} x {h}, as the front has",
                path.display(),
                back.size()[0],
                back.size()[1]
            )));
        }
        let mut vignetting = Vec::new();
        let mut flat = |photograph, name: &str, lamp| {
            let (flat, found) = without_vignetting(args, photograph, lamp, size_mm);
            if let (Some(v), Some(VignettingFlag::Fit)) = (found, args.cloth.vignetting) {
                vignetting.push(format!(
                    "{name}: vignetting 1 {:+.4} r^2 {:+.4} r^4",
                    v.a, v.b
                ));
            }
            flat
        };
        let light = (args.light.unwrap_or(LIGHT), args.cloth.light_mm);
        let front = flat(photograph, "front", light);
        let light = (
            args.back_light.unwrap_or(BACK_LIGHT),
            args.cloth.back_light_mm,
        );
        let back = back.map(|(_, b)| flat(b, "back", light));
        Ok(Photographs {
            front,
            back,
            size_mm,
            vignetting,
        })
    }

    /// Both, the front first.
    pub fn all(&self) -> impl Iterator<Item = &Photograph> {
        std::iter::once(&self.front).chain(&self.back)
    }
}
