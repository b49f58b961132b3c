//! The photographs of a fit, and what makes them uneven.

use super::flags::VignettingFlag;
use super::sides::direction;
use crate::{BACK_LIGHT, Fit, FitJob, LIGHT, picture};
use anyhow::Result;
use glam::{DVec2, DVec3, UVec2};
use organza_photograph::{Photograph, Shading, ShadingSums, Straightened, Vignetting};
use organza_work::{of_file, of_option};
use std::path::Path;
use std::rc::Rc;

/// The width of the cloth in the photographs, mm.
pub fn width_mm(args: &Fit) -> Result<f64> {
    let why = "expected the width of the cloth in the photograph, mm";
    args.width_mm.ok_or_else(|| of_option("width_mm", why))
}

/// The wanted part of a photograph from a file, and its share of the width.
fn read(args: &FitJob, path: &Path) -> Result<(Photograph, f64)> {
    let (size, pixels) = picture::read_picture(path, &args.context)?;
    let (min, max) = match args.crop {
        None => (UVec2::ZERO, size),
        Some(crop) if crop.min.cmplt(crop.max).all() && crop.max.cmple(size).all() => {
            (crop.min, crop.max)
        }
        Some(crop) => {
            return Err(of_option(
                "crop",
                format!(
                    "{},{},{},{} is no part of {}, which has {} x {} pixels",
                    crop.min.x,
                    crop.min.y,
                    crop.max.x,
                    crop.max.y,
                    path.display(),
                    size.x,
                    size.y
                ),
            ));
        }
    };
    let of_row = |y: u32| {
        let row = (y * size.x) as usize;
        &pixels[row + min.x as usize..row + max.x as usize]
    };
    let part = (min.y..max.y).flat_map(of_row);
    let part: Vec<[f32; 3]> = part.map(|p| p.0.to_array()).collect();
    let part_size = (max - min).as_usizevec2();
    let photograph =
        Photograph::new(part_size.x, part_size.y, &part).map_err(|e| of_file(path, e))?;
    Ok((photograph, part_size.x as f64 / f64::from(size.x)))
}

/// A photograph, and what makes it uneven.
#[derive(Clone)]
pub struct Shot {
    /// As it was read.
    pub photograph: Rc<Photograph>,
    /// How light and view shade it.
    pub shading: Shading,
    /// Its vignetting, if that is known.
    pub vignetting: Option<Vignetting>,
}

impl Shot {
    /// One of a cloth that a lamp shades as it does paper.
    fn new(
        args: &FitJob,
        photograph: Photograph,
        (light, light_mm): ([f64; 2], Option<f64>),
        size_mm: DVec2,
    ) -> Shot {
        Shot {
            shading: light_mm.map_or_else(Shading::default, |distance_mm| {
                shading_of_paper(&photograph, direction(light) * distance_mm, size_mm)
            }),
            photograph: Rc::new(photograph),
            vignetting: match args.vignetting {
                None => Some(Vignetting::default()),
                Some(VignettingFlag::Known(vignetting)) => Some(vignetting),
                Some(VignettingFlag::Fit) => None,
            },
        }
    }

    /// The photograph without what makes it uneven.
    pub fn flat(&self) -> Photograph {
        let shaded = self.shading.removed(&self.photograph);
        let vignetting = self.vignetting;
        let vignetting = vignetting.unwrap_or_else(|| Vignetting::find(&shaded, |_, _| true));
        vignetting.removed(&shaded)
    }
}

/// How a lamp at a place, mm from the middle of a photograph of this size, shades paper.
fn shading_of_paper(photograph: &Photograph, lamp_mm: DVec3, size_mm: DVec2) -> Shading {
    let mut sums = ShadingSums::default();
    let [w, h] = photograph.size();
    for i in 0..=12 {
        for j in 0..=12 {
            let place = photograph.place(i * (w - 1) / 12, j * (h - 1) / 12);
            let at_mm = (place * 0.5 * size_mm.length()).extend(0.0);
            let light = (lamp_mm.length() / lamp_mm.distance(at_mm)).powi(3);
            sums.add(place, [light; 3]);
        }
    }
    sums.shading()
}

/// The photographs of a fit.
#[derive(Clone)]
pub struct Photographs {
    /// That of the face.
    pub front: Shot,
    /// That against the light.
    pub back: Option<Shot>,
    /// Size of the cloth in them.
    pub size_mm: DVec2,
    /// Whether they were straightened, which takes out what makes them uneven.
    pub is_even: bool,
}

impl Photographs {
    /// Reads those that the arguments name.
    ///
    /// # Errors
    /// Names the file or the flag.
    pub fn read(args: &FitJob, front: &Path) -> Result<Photographs> {
        let width_mm = width_mm(args)?;
        let (photograph, share) = read(args, front)?;
        let [w, h] = photograph.size();
        let size_mm = share * DVec2::new(width_mm, width_mm * h as f64 / w as f64);
        let back = args.back.as_deref();
        let back = back.map(|path| read(args, path).map(|(p, _)| (path, p)));
        let back = back.transpose()?;
        if let Some((path, back)) = &back
            && back.size() != photograph.size()
        {
            return Err(of_file(
                path,
                format!(
                    "has {} x {} pixels; expected {w} x {h}, as the front has",
                    back.size()[0],
                    back.size()[1]
                ),
            ));
        }
        let light = (args.light.unwrap_or(LIGHT), args.light_mm);
        let front = Shot::new(args, photograph, light, size_mm);
        let light = args.back_light.unwrap_or(BACK_LIGHT);
        let light = (light, args.back_light_mm);
        Ok(Photographs {
            front,
            back: back.map(|(_, photograph)| Shot::new(args, photograph, light, size_mm)),
            size_mm,
            is_even: false,
        })
    }

    /// The same, straightened.
    pub fn straightened(&self, by: &Straightened) -> Photographs {
        let mut shots = by.photographs.iter().map(|photograph| Shot {
            photograph: Rc::new(photograph.clone()),
            shading: Shading::default(),
            vignetting: Some(Vignetting::default()),
        });
        let front = shots.next().unwrap_or_else(|| self.front.clone());
        Photographs {
            front,
            back: shots.next(),
            size_mm: self.size_mm * by.share,
            is_even: true,
        }
    }

    /// Both, the front first.
    pub fn all(&self) -> impl Iterator<Item = &Photograph> {
        let shots = std::iter::once(&self.front).chain(&self.back);
        shots.map(|shot| &*shot.photograph)
    }
}
