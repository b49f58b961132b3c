//! The views of a cloth: one sample, three distances, two lights.

use crate::ReportError;
use crate::write_file::WriteFile;
use glam::UVec2;
use organza_basis::{Rgb, nearest_name};
use organza_picture::{Picture, exr};
use organza_scene::InputError;
use organza_scene::auto::lit::Lit;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Fabrics that are built into the program, the same as in `scenes/fabrics`, which a package of this
/// crate does not have; `tests/bench.rs` compares them.
const NAMED: [(&str, &str); 3] = [
    ("denim", include_str!("fabrics/denim.toml")),
    ("charmeuse", include_str!("fabrics/charmeuse.toml")),
    ("organza", include_str!("fabrics/organza.toml")),
];

/// A fabric to be tried.
pub struct Sample {
    /// Its name, short enough for files.
    pub name: String,
    /// The fabric file, absolute.
    pub path: PathBuf,
    /// The contents of the file.
    pub fabric: Fabric,
}

impl Sample {
    /// Names of the built-in fabrics.
    pub fn names() -> [&'static str; 3] {
        NAMED.map(|(name, _)| name)
    }

    fn read(name: &str, path: &Path) -> Result<Sample, ReportError> {
        let fabric = fabric_file::load(path, &[], &Loader::new())?;
        let path = path
            .canonicalize()
            .map_err(|e| ReportError::Run(format!("{}: {e}", path.display())))?;
        let name = name.to_owned();
        Ok(Sample { name, path, fabric })
    }
}

/// A fabric that is known to exist, before any file is written.
pub enum SampleSource {
    /// A built-in fabric: name and text.
    Carried(&'static str, &'static str),
    /// A file of the user's.
    File(Box<Sample>),
}

impl SampleSource {
    /// A fabric by name or by its file.
    ///
    /// # Errors When there is no such fabric, or it is invalid.
    pub fn named(named: &str) -> Result<SampleSource, ReportError> {
        if let Some((name, text)) = NAMED.iter().find(|(name, _)| *name == named) {
            return Ok(SampleSource::Carried(name, text));
        }
        if !named.ends_with(".toml") {
            let near = nearest_name(named, Sample::names())
                .map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
            return Err(ReportError::Input(InputError::new(format!(
                "{named}: expected the name of a fabric file (.toml) or one of {}{near}",
                Sample::names().join(", ")
            ))));
        }
        let path = PathBuf::from(named);
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Sample::read(&name, &path).map(|s| SampleSource::File(Box::new(s)))
    }

    /// Its name, short enough for files.
    pub fn name(&self) -> &str {
        match self {
            SampleSource::Carried(name, _) => name,
            SampleSource::File(sample) => &sample.name,
        }
    }

    /// The fabric; a built-in fabric is written to `folder`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn sample(self, write_file: WriteFile<'_>, folder: &Path) -> Result<Sample, ReportError> {
        match self {
            SampleSource::Carried(name, text) => {
                let path = folder.join(format!("{name}.toml"));
                write_file(&path, text.as_bytes()).map_err(ReportError::Write)?;
                Sample::read(name, &path)
            }
            SampleSource::File(sample) => Ok(*sample),
        }
    }
}

/// The picture file of the room that lights the cloth from a side.
fn room_file(lit: Lit) -> String {
    format!("room-{}.exr", lit.name())
}

/// Width and height of the pictures of rooms.
const ROOM: UVec2 = UVec2::new(64, 32);

/// Radiance of a room all around, rows from the zenith down: a window of radiance 1,
/// 26 to 60 degrees off the cloth's normal, in walls of 0.2.
fn radiance(lit: Lit) -> Vec<Rgb> {
    let pixel = |i: u32| {
        let (column, row) = (i % ROOM.x, i / ROOM.x);
        let off_normal = match lit {
            Lit::Front => row,
            Lit::Back => ROOM.y - 1 - row,
        };
        let is_window = (42..54).contains(&column) && (5..11).contains(&off_normal);
        match off_normal < ROOM.y / 2 {
            true if is_window => Rgb::WHITE,
            true => Rgb::splat(0.2),
            false => Rgb::BLACK,
        }
    };
    (0..ROOM.element_product()).map(pixel).collect()
}

/// Writes the rooms that scenes in a folder show.
///
/// # Errors
/// A file that cannot be written.
pub fn write_rooms(write_file: WriteFile<'_>, folder: &Path) -> Result<(), ReportError> {
    for lit in Lit::ALL {
        let picture = Picture::new(ROOM, radiance(lit));
        let mut bytes = Cursor::new(Vec::new());
        exr::write_colours(&picture, &mut bytes)?;
        let path = folder.join(room_file(lit));
        write_file(&path, bytes.get_ref()).map_err(ReportError::Write)?;
    }
    Ok(())
}

/// Width of a pixel at the cloth, mm. For an eye that resolves one arc minute, a pixel is 0.29
/// mm wide at one metre.
pub const QUICK_PIXELS_MM: [f64; 2] = [0.1, 1.0];
/// The same for the whole bench.
pub const PIXELS_MM: [f64; 3] = [0.03, 0.1, 1.0];

/// The distance in metres at which a pixel spans an arc minute.
pub fn distance_m(pixel_mm: f64) -> f64 {
    1e-3 * pixel_mm / (1.0f64 / 60.0).to_radians().tan()
}

/// A cloth seen from one distance under one light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Width of a pixel where the cloth is.
    pub pixel_mm: f64,
    /// The direction of the light.
    pub lit: Lit,
}

impl View {
    /// Its name in files.
    pub fn slug(&self, sample: &str) -> String {
        format!("{sample}-{}mm-{}", self.pixel_mm, self.lit.name())
    }

    /// A description.
    pub fn description(&self) -> String {
        format!(
            "pixels of {} mm ({} away), lit from {}",
            self.pixel_mm,
            describe_distance(self.pixel_mm),
            match self.lit {
                Lit::Front => "the front",
                Lit::Back => "behind",
            }
        )
    }

    /// The scene: a window in a dim room on one side of the cloth, darkness on the other, the
    /// camera aslant by 30 degrees. The light is wide, because paths that must find a small
    /// light through reflections from mirror-like fibres need eight times as many samples.
    pub fn scene(&self, fabric: &str, resolution: u32) -> String {
        let width_mm = self.pixel_mm * f64::from(resolution);
        let far_mm = 1000.0f64;
        let (y, z) = (-0.5 * far_mm, far_mm * 0.75f64.sqrt());
        format!(
            "# Made by `organza bench`: {}.\n\
             [render]\nspp = 64\n\n\
             [camera]\nkind = \"orthographic\"\norigin_mm = [0.0, {y:.3}, {z:.3}]\n\
             target_mm = [0.0, 0.0, 0.0]\nwidth_mm = {width_mm}\n\
             resolution = [{resolution}, {resolution}]\n\n\
             [[light]]\nkind = \"environment\"\nfile = {:?}\n\n\
             [[object]]\nkind = \"cloth\"\nfabric = {fabric:?}\n",
            self.description(),
            room_file(self.lit),
        )
    }
}

/// "34 cm" or "3.4 m".
pub(super) fn describe_distance(pixel_mm: f64) -> String {
    let metres = distance_m(pixel_mm);
    if metres < 1.0 {
        format!("{:.0} cm", 100.0 * metres)
    } else {
        format!("{metres:.1} m")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_scene::scene_file::SceneFile;

    #[test]
    fn scenes_are_scenes_and_a_pixel_is_an_arc_minute() {
        for lit in Lit::ALL {
            let view = View { pixel_mm: 0.1, lit };
            let text = view.scene("denim.toml", 32);
            let scene: SceneFile = toml::from_str(&text).unwrap();
            assert_eq!((scene.light.len(), scene.object.len()), (1, 1), "{text}");
            assert_eq!(scene.camera.unwrap().own.get("width_mm"), Some(3.2));
        }
        assert!((distance_m(0.290_888) - 1.0).abs() < 16.0 * f64::from(f32::EPSILON));
        assert_eq!(describe_distance(0.1), "34 cm");
        assert_eq!(describe_distance(1.0), "3.4 m");
    }

    #[test]
    fn the_window_is_on_one_side() {
        for lit in Lit::ALL {
            let pixels = radiance(lit);
            let bright = |p: &[Rgb]| p.iter().filter(|v| **v == Rgb::WHITE).count();
            let (front, back) = pixels.split_at(pixels.len() / 2);
            let expected = if lit == Lit::Front { (72, 0) } else { (0, 72) };
            assert_eq!((bright(front), bright(back)), expected);
        }
    }

    #[test]
    fn the_error_of_an_unknown_name_gives_the_nearest() {
        let error = SampleSource::named("denin").err().unwrap().to_string();
        assert!(error.ends_with("did you mean \"denim\"?"), "{error}");
    }
}
