//! A photograph of a volume, and the same of a scene.

use super::FitJob;
use super::volume_scene::Draft;
use anyhow::Result;
use glam::{UVec2, Vec3};
use organza_basis::Rgb;
use organza_measure::{MIN_SIDE, MatchedPicture, Measured};
use organza_scene::LoadedScene;
use organza_transport::{
    AnyMedium, Crop, EngineChoice, Plane, RenderSettings, Rendering, Scene, engine,
};
use organza_work::{after_option, of_file, of_option};
use std::cell::OnceCell;
use std::path::Path;
use toml::{Table, Value};

/// Pixels of the longer side of a region at most: larger ones are averaged to it.
const MAX_SIDE: u32 = 128;

/// Samples of a pixel without `--spp`.
const SAMPLES: u64 = 64;

/// Relative difference of proportions that is allowed.
const SKEW: f64 = 0.02;

/// Least distance of the hues of two yarns: about that of 0.30 and 0.33 of a channel.
const MIN_APART: f64 = 0.04;

/// Least part of a picture in which a yarn must be seen.
const MIN_SHARE: f64 = 0.002;

/// Moments of a photograph, and how the same are made of a scene.
pub struct Photograph {
    /// Pixels of the whole picture when it is rendered.
    resolution: UVec2,
    /// The part that is matched.
    crop: Crop,
    picture: MatchedPicture,
    /// Yarns that are distinguished by their hue, with that hue.
    parts: Vec<(String, [f64; 3])>,
    /// Blur of the photograph, in rendered pixels.
    blur_px: Option<f64>,
    /// What white paper has in the photograph, and its radiance in the scene once it is known.
    white: f64,
    paper: OnceCell<[f64; 3]>,
    with_averages: bool,
}

impl Photograph {
    /// Reads the photograph and its regions.
    ///
    /// # Errors
    /// Names the file or the flag.
    pub fn read(args: &FitJob, path: &Path, draft: &Draft) -> Result<Photograph> {
        let (size, pixels) = super::picture::read_picture(path, &args.context)?;
        let whole = Crop::new(UVec2::ZERO, size);
        let check = |flag: &str, yarn: &str, crop: Crop, least: u32| {
            let extent = crop.max.saturating_sub(crop.min);
            let (Crop { min, max }, most) = (crop, size);
            if crop.max.cmpgt(size).any() || extent.min_element() < least {
                return Err(after_option(
                    flag,
                    format!(
                        "{yarn}{},{},{},{}: expected at least {least} x {least} pixels inside the \
                         picture, which has {} x {}",
                        min.x, min.y, max.x, max.y, most.x, most.y
                    ),
                ));
            }
            Ok(())
        };
        let region = args.region.unwrap_or(whole);
        check("region", "", region, MIN_SIDE as u32)?;
        let extent = region.max - region.min;
        let factor = extent.max_element().div_ceil(MAX_SIDE).max(1);
        if extent.min_element() / factor < MIN_SIDE as u32 {
            return Err(of_option(
                "region",
                format!(
                    "{} x {} pixels are too narrow: averaged to {MAX_SIDE} along the longer side, \
                     fewer than {MIN_SIDE} are left along the other",
                    extent.x, extent.y
                ),
            ));
        }
        let noise = args.noise.unwrap_or(0.0);
        let cut = |crop: Crop, factor: u32| {
            let small = (crop.max - crop.min) / factor;
            let list = (0..small.y).flat_map(|y| (0..small.x).map(move |x| UVec2::new(x, y)));
            let average = |at: UVec2| {
                let mut sum = Rgb::BLACK;
                for j in 0..factor {
                    for i in 0..factor {
                        let p = crop.min + at * factor + UVec2::new(i, j);
                        let k = p.y as usize * size.x as usize + p.x as usize;
                        sum += pixels.get(k).copied().unwrap_or(Rgb::BLACK);
                    }
                }
                (sum * (1.0 / (factor * factor) as f32)).0.to_array()
            };
            let pixels: Vec<[f32; 3]> = list.map(average).collect();
            let variance = (noise / f64::from(factor)).powi(2) as f32;
            MatchedPicture {
                width: small.x as usize,
                variance: vec![[variance; 3]; pixels.len()],
                pixels,
            }
        };
        let mut parts = Vec::new();
        for part in &args.region_of {
            let fail = |why: &str| after_option("region_of", format!("{}: {why}", part.name));
            check("region_of", &format!("{} ", part.name), part.crop, 1)?;
            let known = &draft.materials.names;
            if !known.contains(&part.name) {
                let known = match known.len() {
                    0 => "none with names".to_owned(),
                    _ => known.join(", "),
                };
                return Err(fail(&format!(
                    "the volume has no yarn of this name; it has {known}"
                )));
            }
            let shown = cut(part.crop, 1);
            let mut sum = [0.0f64; 3];
            for p in &shown.pixels {
                (0..3).for_each(|c| sum[c] += f64::from(p[c]));
            }
            let hue = hue_of(sum).ok_or_else(|| fail("is black"))?;
            let near = |other: &&(String, [f64; 3])| apart(other.1, hue) < MIN_APART;
            if let Some((other, _)) = parts.iter().find(near) {
                return Err(fail(&format!(
                    "has the hue of {other}; yarns of one hue cannot be told in a picture"
                )));
            }
            parts.push((part.name.clone(), hue));
        }
        let named = |name: &String| parts.iter().filter(|(p, _)| p == name).count();
        let missing = draft.materials.names.iter().find(|name| named(name) != 1);
        if let (false, Some(missing)) = (parts.is_empty(), missing) {
            return Err(of_option(
                "region_of",
                format!(
                    "expected one region for each yarn, {}; {missing} has {}",
                    draft.materials.names.join(", "),
                    named(missing)
                ),
            ));
        }
        if parts.len() == 1 {
            return Err(of_option(
                "region_of",
                "the volume has one yarn; --region says where it is matched",
            ));
        }
        if let Some(own) = draft_resolution(draft) {
            let shape = |v: UVec2| f64::from(v.x) / f64::from(v.y);
            if (shape(own) / shape(size) - 1.0).abs() > SKEW {
                return Err(of_file(
                    path,
                    format!(
                        "has {} x {} pixels; camera.resolution of {} has other proportions, {} x {}",
                        size.x,
                        size.y,
                        draft.path.display(),
                        own.x,
                        own.y
                    ),
                ));
            }
        }
        let small = |v: UVec2| (v.as_dvec2() / f64::from(factor)).round().as_uvec2();
        let resolution = small(size).max(UVec2::ONE);
        let min = small(region.min).min(resolution - extent / factor);
        let photograph = Photograph {
            resolution,
            crop: Crop::new(min, min + extent / factor),
            picture: cut(region, factor),
            parts,
            blur_px: args.blur_px.map(|b| b / f64::from(factor)),
            white: args.white.unwrap_or(1.0),
            paper: OnceCell::new(),
            with_averages: args.fit_density,
        };
        if draft.is_made {
            // The lamp was made so that paper has a radiance of one.
            let _ = photograph.paper.set([1.0; 3]);
        } else if args.white.is_none() {
            // Values are radiances.
            let _ = photograph.paper.set([photograph.white; 3]);
        }
        let mean = photograph.picture.moments(1, &|_| Some(0), false);
        let has_light = |m: &Option<Measured>| m.is_some_and(|m| m.mean.iter().any(|&v| v > 0.0));
        if !mean.first().is_some_and(has_light) {
            return Err(of_file(path, "the region is black"));
        }
        Ok(photograph)
    }

    /// Names of the yarns that have regions.
    pub fn names(&self) -> Vec<String> {
        self.parts.iter().map(|(name, _)| name.clone()).collect()
    }

    /// What the moments are.
    pub fn labels(&self, names: &[String]) -> Vec<String> {
        let mean = |name: &String| match self.parts.is_empty() {
            true => "mean".to_owned(),
            false => format!("mean of {name}"),
        };
        let mut list: Vec<String> = names.iter().map(mean).collect();
        list.push("deviation".into());
        if self.with_averages {
            list.push("deviation of 4 x 4 pixels".into());
        }
        list
    }

    /// The moments of the photograph, in its own values.
    pub fn target(&self) -> Vec<Measured> {
        let class_of = |k: usize| {
            if self.parts.is_empty() {
                return Some(0);
            }
            let hue = hue_of(self.picture.pixels.get(k)?.map(f64::from))?;
            let all = self.parts.iter().enumerate();
            all.min_by(|a, b| apart(a.1.1, hue).total_cmp(&apart(b.1.1, hue)))
                .map(|(number, _)| number)
        };
        let count = self.parts.len().max(1);
        let list = self.picture.moments(count, &class_of, self.with_averages);
        list.into_iter().flatten().collect()
    }

    /// The table with a camera of as many pixels as are compared.
    ///
    /// # Errors
    /// There is no camera.
    pub fn with_camera(&self, mut table: Table, path: &Path) -> Result<Table> {
        let camera = table.get_mut("camera").and_then(Value::as_table_mut);
        let camera = camera.ok_or_else(|| {
            let why = "has no [camera]; describe the one that took the photograph";
            of_file(path, why)
        })?;
        let size = self.resolution.to_array().map(i64::from);
        camera.insert("resolution".into(), Value::from(size.to_vec()));
        Ok(table)
    }

    /// The same moments of a scene, in values of the photograph.
    ///
    /// # Errors
    /// Those of the paths; a yarn that is not seen.
    pub fn simulate(
        &self,
        args: &FitJob,
        draft: &Draft,
        loaded: &LoadedScene,
        mut scene: Scene,
    ) -> Result<Vec<Measured>> {
        let (mut picture, yarns) = self.render(args, loaded, &scene)?;
        let paper = match self.paper.get() {
            Some(&paper) => paper,
            None => {
                let paper = self.render_paper(args, draft, loaded, &mut scene)?;
                *self.paper.get_or_init(|| paper)
            }
        };
        for list in picture.pixels.iter_mut() {
            for c in 0..3 {
                list[c] *= (self.white / paper[c]) as f32;
            }
        }
        for list in picture.variance.iter_mut() {
            for c in 0..3 {
                list[c] *= (self.white / paper[c]).powi(2) as f32;
            }
        }
        if let Some(blur) = self.blur_px {
            picture = picture.blurred(blur);
        }
        if self.parts.is_empty() {
            let all = picture.moments(1, &|_| Some(0), self.with_averages);
            return Ok(all.into_iter().flatten().collect());
        }
        let names = self.names();
        let known = &draft.materials;
        let class_of = |k: usize| {
            let name = known.name_of_yarn.get(yarns.get(k)?.as_ref()?)?;
            names.iter().position(|n| Some(n) == known.names.get(*name))
        };
        let least = MIN_SHARE * yarns.len() as f64;
        for (k, name) in names.iter().enumerate() {
            let seen = (0..yarns.len()).filter(|&p| class_of(p) == Some(k)).count();
            if (seen as f64) < least {
                return Err(after_option(
                    "region_of",
                    format!(
                        "{name}: the scene shows this yarn in {seen} of {} pixels",
                        yarns.len()
                    ),
                ));
            }
        }
        let all = picture.moments(names.len(), &class_of, self.with_averages);
        Ok(all.into_iter().flatten().collect())
    }

    /// Radiances of the part that is matched, with the yarn that each pixel met first.
    fn render(
        &self,
        args: &FitJob,
        loaded: &LoadedScene,
        scene: &Scene,
    ) -> Result<(MatchedPicture, Vec<Option<u32>>)> {
        let file = &loaded.file.render;
        let samples = args.spp.unwrap_or(SAMPLES);
        let settings = RenderSettings {
            integrator: file.integrator.into(),
            samples: 0..samples,
            max_bounces: file.max_bounces.unwrap_or(u32::MAX),
            seed: args.seed,
            crop: Some(self.crop),
        };
        let allowed = args.context.memory_bytes();
        let engine = engine(scene, &settings, EngineChoice::Processor, allowed);
        let mut rendering = Rendering::new(scene, settings)?;
        if let Ok(engine) = engine {
            rendering = rendering.with_engine(engine);
        }
        let host = &args.context;
        let rendering = rendering.take(samples, &|_| host.flow())?;
        let pixels = rendering.film().pixels();
        let picture = MatchedPicture {
            width: rendering.film().size().x as usize,
            pixels: pixels.iter().map(|p| p.mean().0.to_array()).collect(),
            variance: pixels
                .iter()
                .map(|p| p.variance_of_mean().0.to_array())
                .collect(),
        };
        Ok((picture, pixels.iter().map(|p| p.yarn()).collect()))
    }

    /// Mean radiance of white paper in place of the cloth.
    fn render_paper(
        &self,
        args: &FitJob,
        draft: &Draft,
        loaded: &LoadedScene,
        scene: &mut Scene,
    ) -> Result<[f64; 3]> {
        let fail = |why: &str| of_file(&draft.path, why);
        let grid = scene.media.get(draft.index).and_then(AnyMedium::cell_grid);
        let bounds = grid
            .ok_or_else(|| fail("the volume has no extent"))?
            .bounds_mm();
        let top = bounds.centre().with_z(bounds.max.z);
        let paper = Plane::new(top, Vec3::Z, Rgb::WHITE, Rgb::BLACK);
        let paper = paper.ok_or_else(|| fail("the volume has no top"))?;
        scene.media = vec![AnyMedium::Plane(paper)];
        let (picture, _) = self.render(args, loaded, scene)?;
        let count = picture.pixels.len().max(1) as f64;
        let mean: [f64; 3] = std::array::from_fn(|c| {
            let sum: f64 = picture.pixels.iter().map(|p| f64::from(p[c])).sum();
            sum / count
        });
        if mean.iter().any(|&v| v <= 0.0) {
            return Err(of_option(
                "white",
                "paper in place of the cloth is black for this camera; leave it out and give the \
                 photograph in the radiances of the scene",
            ));
        }
        Ok(mean)
    }
}

/// Channels as shares of their sum; none of black.
fn hue_of(colour: [f64; 3]) -> Option<[f64; 3]> {
    let sum: f64 = colour.iter().sum();
    (sum > 0.0).then(|| colour.map(|v| v / sum))
}

/// Distance of two hues.
fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    square.sqrt()
}

/// The pixels that the scene gives its camera, if it does.
fn draft_resolution(draft: &Draft) -> Option<UVec2> {
    let list = draft.table.get("camera")?.get("resolution")?.as_array()?;
    let number = |k: usize| u32::try_from(list.get(k)?.as_integer()?).ok();
    let size = UVec2::new(number(0)?, number(1)?);
    (size.min_element() > 0).then_some(size)
}
