//! Scenes made for a cloth: a camera, lights and a background that suit any, framed by what the
//! cloth is.

use crate::error::InputError;
use crate::fabric_file::Fabric;
use crate::representation::{EXPLICIT_FIBRES, MICROFLAKE, Representation};
use glam::{DVec3, Vec3Swizzles};
use organza_basis::SegmentSource;
use std::fmt::Write;

/// Length of the fibres of a tile at most, in their radii. With the cells in which rays find them
/// they take about 110 bytes for each (measured on a twill of cotton and on thick wool, estimated
/// to grow in proportion): 1.2 GB in all.
pub(crate) const MAX_FIBRE_LENGTH: f64 = 1.1e7;

/// A kind of studio.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Studio {
    /// The cloth from nearby, obliquely, in the light of a soft box.
    #[default]
    Swatch,
    /// Some threads through a macro lens.
    Macro,
    /// A length of cloth in folds.
    Drape,
    /// The cloth before a window.
    Window,
    /// The whole repeat from above, in even light.
    Flat,
}

/// A view of a cloth: how many of its threads a picture shows.
struct View {
    /// Threads across the picture at least and at most.
    threads: [f64; 2],
    /// Repeats of the draft across the picture, if so many threads are within these.
    repeats: f64,
    /// Width of the picture where cloth has no threads that lie at distances, mm.
    usual_mm: f64,
    /// Share of the width that the picture shows beyond its middle, in depth and at the far edge.
    beyond: f64,
}

impl Studio {
    /// Every studio with its name and a line for help, the usual one first.
    pub const ALL: [(Studio, &'static str, &'static str); 5] = [
        (
            Studio::Swatch,
            "swatch",
            "A piece of the cloth, seen obliquely, in the light of a soft box",
        ),
        (Studio::Macro, "macro", "Some threads through a macro lens"),
        (Studio::Drape, "drape", "A length of the cloth in folds"),
        (Studio::Window, "window", "The cloth before a bright window"),
        (
            Studio::Flat,
            "flat",
            "The whole repeat from straight above, in even light",
        ),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        let found = Studio::ALL.iter().find(|(studio, ..)| *studio == self);
        found.map_or("", |(_, name, _)| name)
    }

    fn view(self) -> View {
        let (threads, repeats, usual_mm, beyond) = match self {
            Studio::Swatch => ([22.0, 40.0], 1.6, 8.0, 1.4),
            Studio::Macro => ([7.0, 12.0], 1.6, 3.0, 1.7),
            Studio::Drape => ([140.0, 220.0], 1.6, 70.0, 2.0),
            Studio::Window => ([30.0, 44.0], 1.6, 14.0, 1.2),
            Studio::Flat => ([40.0, 4000.0], 1.0, 12.0, 1.0),
        };
        View {
            threads,
            repeats,
            usual_mm,
            beyond,
        }
    }

    /// Threads of each system that a picture of a cloth with this repeat meets, at most.
    pub fn threads_met(self, repeat: [usize; 2]) -> usize {
        let view = self.view();
        (across(&view, repeat) * view.beyond).ceil() as usize
    }
}

/// Threads across the picture: as many repeats as fit, and no fewer threads than can be seen.
fn across(view: &View, repeat: [usize; 2]) -> f64 {
    let [least, most] = view.threads;
    let repeat = repeat[0].max(repeat[1]) as f64;
    (view.repeats * repeat).clamp(least, most)
}

/// What a scene is made for.
pub struct Subject<'a> {
    /// The fabric's name in the scene.
    pub fabric: &'a str,
    /// The cloth.
    pub cloth: &'a Fabric,
    /// Ends and picks of its draft's repeat; `None` without a draft.
    pub repeat: Option<[usize; 2]>,
}

/// The files of a scene: its text, and what that names beside it.
pub struct StudioScene {
    /// The scene.
    pub text: String,
    /// A mesh, by its name.
    pub mesh: Option<(String, String)>,
}

/// A light that is a rectangle, turned to the middle of the cloth.
struct Panel {
    /// Where it stands as the camera sees it: degrees from the direction behind the cloth
    /// towards the left, and degrees above the cloth.
    azimuth_deg: f64,
    elevation_deg: f64,
    /// Angles that it takes up, degrees.
    size_deg: [f64; 2],
    radiance: [f64; 3],
}

/// Samples of a pixel, and pixels along the longer edge: some 40 seconds of two processors.
const SPP: u32 = 16;
/// The same of micro-flakes, whose samples share nothing.
const FLAKE_SPP: u32 = 64;
const PIXELS: u32 = 512;
/// How much the cache of radiance learns, in multiples of the usual.
const LEARNING: f64 = 0.8;
/// Lamps stand so many widths of the picture away.
const LAMP_DISTANCE: f64 = 8.0;
/// Cells of the mesh of folds, each way.
const CELLS: usize = 96;

/// The light of a studio: the key from the left behind, a strip on the right as the rim, and a
/// weak broad fill from the front. The environment adds [`AMBIENT`].
const STUDIO: [Panel; 3] = [
    Panel {
        azimuth_deg: 62.0,
        elevation_deg: 40.0,
        size_deg: [60.0, 44.0],
        radiance: [5.2, 4.9, 4.5],
    },
    Panel {
        azimuth_deg: -74.0,
        elevation_deg: 24.0,
        size_deg: [20.0, 44.0],
        radiance: [2.2, 2.4, 2.8],
    },
    Panel {
        azimuth_deg: 180.0,
        elevation_deg: 52.0,
        size_deg: [90.0, 44.0],
        radiance: [0.55, 0.56, 0.58],
    },
];
/// Radiance of what is no lamp in a studio.
const AMBIENT: [f64; 3] = [0.13, 0.135, 0.145];

/// The scene of a studio.
///
/// # Errors
/// The cloth cannot be shown so: it cannot be draped.
pub fn scene(studio: Studio, subject: &Subject<'_>) -> Result<StudioScene, InputError> {
    let view = studio.view();
    let cloth = subject.cloth;
    let spacing_mm = f64::from(cloth.thread_spacing_mm());
    let spacing_mm = Some(spacing_mm).filter(|s| s.is_finite());
    let width_mm = spacing_mm.map_or(view.usual_mm, |s| {
        s * across(&view, subject.repeat.unwrap_or([1, 1]))
    });
    let thickness_mm = f64::from(cloth.cloth.tile().bounds_mm.size().z);
    let width_mm = width_mm.max(2.0 * thickness_mm);
    // A corner of the tile lies at the origin, where the borders of a part would be seen.
    let size_mm = cloth.cloth.tile().bounds_mm.size();
    let frame = Frame {
        middle_mm: (0.5 * size_mm).xy().as_dvec2().extend(0.0),
        width_mm,
    };
    let representation = representation(studio, subject)?;
    let spp = match representation == &MICROFLAKE {
        true => FLAKE_SPP,
        false => SPP,
    };
    let mut text = format!(
        "# The studio \"{}\" for {}, written by organza.\n\n[render]\nspp = {spp}\n\
         cache_learning = {LEARNING}\nexposure = \"auto\"\n\n",
        studio.name(),
        subject.fabric
    );
    let mut mesh = None;
    match studio {
        Studio::Swatch => frame.oblique(&mut text, 42.0, 16.0, 0.012),
        Studio::Macro => frame.oblique(&mut text, 46.0, 14.0, 0.03),
        Studio::Drape => frame.oblique(&mut text, 48.0, 22.0, 0.0),
        Studio::Window => frame.oblique(&mut text, 72.0, 16.0, 0.004),
        Studio::Flat => frame.flat(&mut text, subject),
    }
    match studio {
        Studio::Window => frame.window(&mut text),
        Studio::Flat => {
            let even = Panel {
                azimuth_deg: 45.0,
                elevation_deg: 42.0,
                size_deg: [30.0, 30.0],
                radiance: [9.0, 8.7, 8.2],
            };
            frame.panel(&mut text, &even);
            environment(&mut text, [0.62, 0.64, 0.67], "front");
        }
        _ => {
            STUDIO.iter().for_each(|lamp| frame.panel(&mut text, lamp));
            environment(&mut text, AMBIENT, "front");
        }
    }
    let name = toml::Value::String(subject.fabric.to_owned());
    let _ = write!(text, "[[object]]\nkind = \"cloth\"\nfabric = {name}\n");
    let _ = writeln!(text, "model = {:?}", representation.name);
    if representation == &MICROFLAKE {
        let _ = writeln!(text, "voxel_um = {:.1}", voxel_um(subject));
    }
    if studio == Studio::Drape {
        let file = format!("{}_folds.obj", subject.fabric.trim_end_matches(".toml"));
        let named = toml::Value::String(file.clone());
        let _ = write!(text, "mesh = {named}\nmm_per_uv = 1.0\n");
        mesh = Some((file, frame.folds()));
        let _ = write!(
            text,
            "\n[[object]]\nkind = \"plane\"\nposition_mm = [0.0, 0.0, {:.4}]\n\
             reflectance = [0.14, 0.13, 0.12]\n",
            -0.2 * width_mm
        );
    }
    Ok(StudioScene { text, mesh })
}

/// Length of all fibres of a tile of woven cloth, in their radii (estimated from its threads).
pub(crate) fn fibre_length(cloth: &Fabric) -> f64 {
    let Some(draft) = cloth.cloth.draft() else {
        return 0.0;
    };
    let size_mm = cloth.cloth.tile().bounds_mm.size();
    let thread_mm =
        draft.ends() as f64 * f64::from(size_mm.y) + draft.picks() as f64 * f64::from(size_mm.x);
    let yarns = cloth.cloth.yarns();
    let fibres = yarns.iter().map(|yarn| {
        let ratio = yarn.radius_mm() / yarn.fibre_radius_mm;
        yarn.fibre_volume_fraction() * ratio * ratio / yarn.fibre_radius_mm
    });
    thread_mm * fibres.sum::<f64>() / yarns.len().max(1) as f64
}

/// Edge of the voxels of a cloth that is shown by micro-flakes: as the fabric has them, or so
/// wide that the tile has no more than can be built in some seconds.
fn voxel_um(subject: &Subject<'_>) -> f64 {
    const MOST: f64 = 6.0e6;
    let own_um = f64::from(subject.cloth.file.voxel.size_um);
    if subject.cloth.synthesis.is_some() {
        return own_um;
    }
    let size_mm = subject.cloth.cloth.tile().bounds_mm.size().as_dvec3();
    let least_um = 1e3 * (size_mm.element_product() / MOST).cbrt();
    own_um.max(least_um)
}

/// How the cloth is shown: by its fibres; where it is made of blocks or has too many fibres, by
/// micro-flakes.
fn representation(
    studio: Studio,
    subject: &Subject<'_>,
) -> Result<&'static Representation, InputError> {
    let cloth = subject.cloth;
    let shown = match (&cloth.synthesis, fibre_length(cloth) <= MAX_FIBRE_LENGTH) {
        (None, true) => &EXPLICIT_FIBRES,
        _ => &MICROFLAKE,
    };
    if studio == Studio::Drape && !cloth.cloth.tile().repeats {
        return Err(InputError::of_file(
            subject.fabric,
            "a cloth that does not repeat cannot be draped; choose another studio",
        ));
    }
    Ok(shown)
}

/// What a picture shows.
struct Frame {
    /// The point in its middle.
    middle_mm: DVec3,
    width_mm: f64,
}

impl Frame {
    /// A camera that looks down at the middle of the cloth from below in the picture. The aperture
    /// is a share of its distance; 0 for a pinhole.
    fn oblique(&self, text: &mut String, elevation_deg: f64, fov_deg: f64, aperture: f64) {
        let width_mm = self.width_mm;
        let distance_mm = width_mm / (2.0 * (0.5 * fov_deg.to_radians()).tan());
        let (sin, cos) = elevation_deg.to_radians().sin_cos();
        let kind = match aperture > 0.0 {
            true => format!(
                "kind = \"thin-lens\"\naperture_mm = {:.4}\n",
                aperture * distance_mm
            ),
            false => "kind = \"perspective\"\n".to_owned(),
        };
        let origin = self.middle_mm + distance_mm * DVec3::new(-0.06, -cos, sin);
        let _ = write!(
            text,
            "[camera]\n{kind}origin_mm = {}\ntarget_mm = {}\nfov_deg = {fov_deg:?}\n\
         resolution = [{PIXELS}, {PIXELS}]\nfilter = \"gaussian\"\n\n",
            list(origin),
            list(self.middle_mm)
        );
    }

    /// A camera straight above whole repeats.
    fn flat(&self, text: &mut String, subject: &Subject<'_>) {
        let width_mm = self.width_mm;
        let size = subject.cloth.tile_mm();
        let aspect = match subject.repeat {
            Some([ends, picks]) if ends.max(picks) > 24 => {
                f64::from(size.y / size.x).clamp(0.25, 4.0)
            }
            _ => 1.0,
        };
        let (width_mm, height_mm) = match aspect > 1.0 {
            true => (width_mm / aspect, width_mm),
            false => (width_mm, width_mm * aspect),
        };
        let pixels =
            |mm: f64| ((f64::from(PIXELS) * mm / width_mm.max(height_mm)).round() as u32).max(1);
        let target = (0.5 * size).as_dvec2().extend(0.0);
        let _ = write!(
            text,
            "[camera]\nkind = \"orthographic\"\norigin_mm = {}\ntarget_mm = {}\n\
         width_mm = {width_mm:.4}\nresolution = [{}, {}]\nfilter = \"gaussian\"\n\n",
            list(target + 10.0 * width_mm * DVec3::Z),
            list(target),
            pixels(width_mm),
            pixels(height_mm),
        );
    }

    /// A lamp.
    fn panel(&self, text: &mut String, panel: &Panel) {
        let (sin_a, cos_a) = panel.azimuth_deg.to_radians().sin_cos();
        let (sin_e, cos_e) = panel.elevation_deg.to_radians().sin_cos();
        let away = DVec3::new(-sin_a * cos_e, cos_a * cos_e, sin_e);
        let distance_mm = LAMP_DISTANCE * self.width_mm;
        let half = |deg: f64| distance_mm * (0.5 * deg.to_radians()).tan();
        let right = away.cross(DVec3::Z).normalize();
        let up = right.cross(away);
        // The side to which `u x v` points shines.
        let (u, v) = (
            up * 2.0 * half(panel.size_deg[1]),
            right * 2.0 * half(panel.size_deg[0]),
        );
        let corner = self.middle_mm + away * distance_mm - 0.5 * (u + v);
        rectangle(text, [corner, u, v], panel.radiance);
    }

    /// A window of panes behind the cloth, and the pale room in front of it.
    fn window(&self, text: &mut String) {
        let width_mm = self.width_mm;
        let (pane, bar) = (0.46 * width_mm, 0.05 * width_mm);
        let depth_mm = -1.2 * width_mm;
        for row in -2..2 {
            for column in -2..2 {
                let place = |n: i32| f64::from(n) * (pane + bar) + 0.5 * bar;
                let corner = DVec3::new(place(column), place(row) + 0.35 * width_mm, depth_mm);
                let high = f64::from(row + 2) / 3.0;
                let radiance = [1.7 - 0.3 * high, 1.75 - 0.05 * high, 1.7 + 0.5 * high];
                let corner = corner + self.middle_mm;
                rectangle(text, [corner, DVec3::X * pane, DVec3::Y * pane], radiance);
            }
        }
        environment(text, [0.16, 0.15, 0.135], "all");
    }

    /// A mesh in OBJ: a sheet with folds that fan out, in texture coordinates of its arc length in
    /// millimetres.
    fn folds(&self) -> String {
        let width_mm = self.width_mm;
        let half = 0.95 * width_mm;
        let height = |x: f64, y: f64| {
            // x and y from -1 to 1. Folds run upwards and fan out; a wave crosses them.
            let fan = x * (1.0 - 0.28 * y) + 0.10 * (2.2 * y).sin();
            let deep = 0.5 + 0.5 * (0.5 - 0.5 * y);
            let folds = 0.085 * (7.6 * fan + 0.5).sin() + 0.03 * (13.1 * fan + 1.9 + 0.6 * y).sin();
            width_mm * (deep * folds + 0.03 * (2.4 * y + 1.3 * x).sin())
        };
        let at = |i: usize| 2.0 * i as f64 / CELLS as f64 - 1.0;
        let point = |i: usize, j: usize| {
            let (x, y) = (at(i), at(j));
            DVec3::new(half * x, half * y, height(x, y))
        };
        let mut text = String::from("# Folds, written by organza.\n");
        // Lengths along rows and along columns, so that the cloth is hardly stretched.
        let mut rows = vec![vec![DVec3::ZERO; CELLS + 1]; CELLS + 1];
        for (j, row) in rows.iter_mut().enumerate() {
            let (mut u, middle) = (0.0, CELLS / 2);
            let lengths: Vec<f64> = (0..=CELLS)
                .map(|i| {
                    if i > 0 {
                        u += point(i, j).distance(point(i - 1, j));
                    }
                    u
                })
                .collect();
            for (i, slot) in row.iter_mut().enumerate() {
                slot.x = lengths[i] - lengths[middle];
            }
        }
        for i in 0..=CELLS {
            let mut v = 0.0;
            for (j, row) in rows.iter_mut().enumerate() {
                if j > 0 {
                    v += point(i, j).distance(point(i, j - 1));
                }
                row[i].y = v;
            }
        }
        for (j, row) in rows.iter().enumerate() {
            for (i, uv) in row.iter().enumerate() {
                let p = point(i, j);
                let (p, uv) = (p + self.middle_mm, *uv + self.middle_mm);
                let _ = writeln!(text, "v {:.4} {:.4} {:.4}", p.x, p.y, p.z);
                let _ = writeln!(text, "vt {:.5} {:.5}", uv.x, uv.y);
            }
        }
        for j in 0..CELLS {
            for i in 0..CELLS {
                let n = |i: usize, j: usize| j * (CELLS + 1) + i + 1;
                let [a, b, c, d] = [n(i, j), n(i + 1, j), n(i + 1, j + 1), n(i, j + 1)];
                let _ = writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}\nf {a}/{a} {c}/{c} {d}/{d}");
            }
        }
        text
    }
}

/// A point or direction as a file has it.
fn list(v: DVec3) -> String {
    format!("[{:.4}, {:.4}, {:.4}]", v.x, v.y, v.z)
}

/// Light from a half of all directions: nothing shines behind a cloth that lies there, so that
/// gaps are dark.
fn environment(text: &mut String, radiance: [f64; 3], hemisphere: &str) {
    let _ = write!(
        text,
        "[[light]]\nkind = \"environment\"\nradiance = {radiance:?}\n\
         hemisphere = {hemisphere:?}\n\n"
    );
}

fn rectangle(text: &mut String, corner_and_edges_mm: [DVec3; 3], radiance: [f64; 3]) {
    let [corner, u, v] = corner_and_edges_mm.map(list);
    let _ = write!(
        text,
        "[[light]]\nkind = \"rectangle\"\ncorner_mm = {corner}\nedge_u_mm = {u}\nedge_v_mm = {v}\n\
         radiance = {radiance:?}\n\n"
    );
}
