//! Describes the surface of the cloth of a fabric file.

use crate::catalogue::{ClothSurface, SurfaceKind};
use crate::error::Error;
use crate::spec::SurfaceSpec;
use crate::weave::{Tiling, Weave};
use organza_basis::SegmentSource;
use organza_weave::{Cloth, Draft, SystemFigures};

impl Weave {
    /// The smallest repeat of a draft, in yarns as wide as their pitch. `size_mm` is that of
    /// the whole draft, along the weft and along the warp; uneven spacings of threads are
    /// averaged.
    pub fn from_draft(draft: &Draft, size_mm: [f64; 2]) -> Weave {
        let repeat = draft.smallest_repeat();
        let row = |pick| {
            (0..repeat.ends())
                .map(|end| repeat.warp_up(end, pick))
                .collect()
        };
        let rows: Vec<Vec<bool>> = (0..repeat.picks()).map(row).collect();
        Weave::from_warp_up(
            &rows,
            size_mm[0] / draft.ends() as f64,
            size_mm[1] / draft.picks() as f64,
        )
    }
}

impl SurfaceSpec {
    /// The same with the weave of a cloth, unless a weave is given.
    ///
    /// # Errors When the cloth has no draft: knits, openwork, nonwovens and imported curves do
    /// not consist of the straight visible segments that the model supports. They are not
    /// approximated, because the weave of a preset would be another cloth.
    pub fn for_cloth(mut self, cloth: &Cloth) -> Result<SurfaceSpec, Error> {
        let given = self.weave.take();
        if let Some(whole) = given.as_ref().filter(|w| !w.draft.is_empty()) {
            self.weave = Some(whole.clone());
        } else {
            let draft = cloth.draft().ok_or_else(|| {
                Error::Draft(
                    "knits, openwork, nonwovens and imported curves have none, and the surface model \
                     knows woven cloth alone; give surface.weave for a woven cloth that looks alike"
                        .into(),
                )
            })?;
            let size = cloth.tile().bounds_mm.size();
            let mut weave = Weave::from_draft(draft, [size.x.into(), size.y.into()]);
            let figures = cloth.figures();
            if let (Some(warp), Some(weft)) = (&figures.warp, &figures.weft) {
                // Side by side, threads of the denser system hide all but the
                // width of the others.
                if warp.cover_factor > weft.cover_factor {
                    weave.weft_width_mm = Some(visible_width_mm(weft, weave.weft_pitch_mm));
                } else if weft.cover_factor > warp.cover_factor {
                    weave.warp_width_mm = Some(visible_width_mm(warp, weave.warp_pitch_mm));
                }
            }
            self.weave = Some(match given {
                Some(spacing) => Weave {
                    draft: weave.draft,
                    ..spacing
                },
                None => weave,
            });
        }
        Ok(self)
    }
}

/// The width at which threads of one width at equal distances cover as much as the threads of a
/// system do: less than their mean width where uneven threads lie over each other in some places
/// and leave gaps in others.
fn visible_width_mm(system: &SystemFigures, pitch_mm: f64) -> f64 {
    let (mean_mm, covering_mm) = (system.width_mm, system.cover_factor * pitch_mm);
    // Of even threads both are the same but for rounding.
    if (mean_mm - covering_mm).abs() < 1e-6 * pitch_mm {
        return mean_mm;
    }
    covering_mm.min(pitch_mm)
}

impl SurfaceKind for SurfaceSpec {
    const NAME: &'static str = "irawan";

    fn of_cloth(&self, cloth: &Cloth) -> Result<ClothSurface, Error> {
        let surface = self.clone().for_cloth(cloth)?.build()?;
        Ok(ClothSurface {
            origin_mm: surface.origin_mm(cloth.tile().bounds_mm.min.truncate()),
            repeat_mm: surface.period_mm().max_element(),
            surface: Box::new(surface),
        })
    }

    fn repeat_mm(&self, cloth: &Cloth) -> Result<f32, Error> {
        let parameters = self.clone().for_cloth(cloth)?.parameters()?;
        parameters.check()?;
        Ok(Tiling::new(&parameters.weave)?.period_mm().max_element())
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)] // reads shipped fabrics
mod tests {
    use super::*;
    use organza_scatter::{Footprint, Surface};
    use organza_weave::FabricGeometry;

    #[test]
    fn knits_are_refused_and_weaves_are_taken() {
        let cloth = |text: &str| {
            let geometry: FabricGeometry = toml::from_str(text).unwrap();
            let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
            Cloth::build(&geometry, &none, 1).unwrap()
        };
        let yarn = "\n[yarn.y]\npreset = \"cotton\"\ntex = 30.0\n";
        let twill = format!(
            "[draft]\nweave = \"twill-3-1-z\"\n[warp]\nyarn = \"y\"\nper_cm = 25.0\n[weft]\nyarn = \
             \"y\"\nper_cm = 17.0\n{yarn}"
        );
        let spec = SurfaceSpec::preset("denim").unwrap();
        let bare = SurfaceSpec {
            weave: None,
            ..spec.clone()
        };
        let weave = bare.clone().for_cloth(&cloth(&twill)).unwrap().weave;
        let weave = weave.unwrap();
        assert_eq!(weave.draft.len(), 4);
        assert!((weave.warp_pitch_mm - 0.4).abs() < 4.0 * f64::from(f32::EPSILON));
        assert!((weave.weft_pitch_mm - 10.0 / 17.0).abs() < 4.0 * f64::from(f32::EPSILON));
        // If only the spacing is given, the draft is that of the cloth.
        let spaced = SurfaceSpec {
            weave: toml::from_str("warp_pitch_mm = 0.5\nweft_pitch_mm = 0.7").ok(),
            ..spec.clone()
        };
        let spaced = spaced.for_cloth(&cloth(&twill)).unwrap().weave.unwrap();
        assert_eq!((&spaced.draft, spaced.warp_pitch_mm), (&weave.draft, 0.5));
        // The repeat is known without the surface.
        let whole = bare.of_cloth(&cloth(&twill)).unwrap();
        assert_eq!(bare.repeat_mm(&cloth(&twill)).unwrap(), whole.repeat_mm);
        // A given weave is kept.
        let given = spec.clone().for_cloth(&cloth(&twill)).unwrap();
        assert_eq!(given, spec);
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../scenes/fabrics/jersey.toml"
        );
        let mut file: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
        file.retain(|key, _| {
            ["draft", "warp", "weft", "yarn", "relaxation", "tile"].contains(&key)
        });
        let jersey = cloth(&toml::to_string(&file).unwrap());
        let message = bare.for_cloth(&jersey).unwrap_err().to_string();
        assert!(message.contains("knits"), "{message}");
    }

    /// The surface model sees the widths of the uneven, flattened threads that the figures and
    /// the fibres have: its narrower system covers what the cloth's does.
    #[test]
    fn uneven_threads_have_their_cover_in_the_surface() {
        let cloth = |keys: &str, threads: &str| {
            let text = format!(
                "[draft]\nweave = \"twill-2-2\"\n[tile]\nrepeats = [6, 6]\n[warp]\nyarn = \
                 \"y\"\nper_cm = 24.0\n[weft]\nyarn = \"y\"\nper_cm = 20.0\n{threads}\n[yarn.y]\n\
                 preset = \"cotton\"\ntex = 30.0\n{keys}\n"
            );
            let geometry: FabricGeometry = toml::from_str(&text).unwrap();
            let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
            Cloth::build(&geometry, &none, 1).unwrap()
        };
        let bare = SurfaceSpec {
            weave: None,
            ..SurfaceSpec::preset("denim").unwrap()
        };
        let cover = |cloth: &Cloth| {
            let weave = bare.clone().for_cloth(cloth).unwrap().weave.unwrap();
            assert_eq!(weave.warp_width_mm, None);
            weave.weft_width_mm.unwrap() / weave.weft_pitch_mm
        };
        let uneven = cloth(
            "evenness = { mass_cv_percent = 25.0, fibre_length_mm = 10.0 }\nflattening = { crossing \
             = 1.3 }",
            "spacing_cv_percent = 12.0",
        );
        let even = cloth("", "");
        for cloth in [&even, &uneven] {
            let weft = cloth.figures().weft.unwrap();
            assert!((cover(cloth) - weft.cover_factor).abs() < 1e-6, "{weft:?}");
        }
        // The twin: the even yarn is narrower than the flattened one.
        assert!((cover(&even) - cover(&uneven)).abs() > 0.01);
        assert!(bare.for_cloth(&uneven).unwrap().build().is_ok());
    }

    #[test]
    fn real_drafts_become_surfaces() {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../scenes/drafts/first_light.wif"
        );
        let wif = std::fs::read(path).unwrap();
        let named = ["plain", "twill-2-1-s", "twill-3-1-z", "satin-8-3"];
        let drafts = named.map(|name| (name, Draft::named(name).unwrap()));
        let mut built = 0;
        for (name, draft) in [("first_light.wif", Draft::from_wif(&wif).unwrap())]
            .into_iter()
            .chain(drafts)
        {
            let size = [draft.ends() as f64 * 0.3, draft.picks() as f64 * 0.3];
            let mut spec = SurfaceSpec::preset("wool-gabardine").unwrap();
            spec.weave = Some(Weave::from_draft(&draft, size));
            // For any draft, the rectangles cover the repeat and show the drawdown.
            let weave = spec.weave.as_ref().unwrap();
            let tiling = Tiling::new(weave).unwrap();
            for k in 0..2000usize {
                let (end, pick) = (7919 * k % draft.ends(), 104_729 * k % draft.picks());
                let at = glam::Vec2::new(end as f32 + 0.5, pick as f32 + 0.5) * 0.3;
                let seen = tiling.segments()[tiling.locate(at).segment].yarn;
                let warp = seen == crate::weave::Yarn::Warp;
                assert_eq!(warp, draft.warp_up(end, pick), "{name}");
            }
            // Every kind of segment costs the construction an integral.
            if draft.smallest_repeat().ends() <= 64 && built < 3 {
                let cloth = spec.build().unwrap();
                let w = glam::Vec3::new(0.36, 0.48, 0.8);
                assert!(cloth.eval(glam::Vec3::Z, w, Footprint::FAR).is_valid());
                built += 1;
            }
        }
        assert_eq!(built, 3);
    }
}
