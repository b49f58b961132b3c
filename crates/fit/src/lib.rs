//! Fits: parameters of a cloth that match measured values, a picture or photographs.

mod cloth;
mod colour;
mod descent;
mod fibres;
mod picture;
mod plies;
mod shade;
mod surface;
mod target;
mod volume;
mod volume_picture;
mod volume_scene;

use anyhow::{Context as _, Result};
use clap::Args;
use glam::UVec2;
use organza_measure::Effort;
use organza_measure::fit::Determined;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::file_kind::Wanted;
use organza_scene::loader::{Input, Loader};
use organza_scene::patches::{PatchModel, PatchOptions};
use organza_scene::read;
use organza_scene::representation::Build;
use organza_transport::Crop;
use organza_weave::colour_list::OneColour;
use organza_work::Job;
use organza_work::building::watched;
use organza_work::journal::Work;
use organza_work::keys;
use organza_work::number_journal::NumberJournal;
use organza_work::patch_model::{OWN, patch_model};
use organza_work::values::{
    parse_angles, parse_crop, parse_micrometres, parse_paths, parse_patience, parse_positive,
    parse_seed, parse_share,
};
use organza_work::{Context, Error, Results, identity, of_option, output};
use organza_work::{Output, Place, PlaceKind, Request};
use serde::Deserialize;
use serde::de::Deserializer;
use serde_json::json;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

pub use target::{TARGETS, Target, TargetName};

/// Parameters of a cloth that match measured values, a picture or photographs.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fit {
    /// Fabric file (TOML) from which the search starts, or a scene with one object of kind = "volume", or a volume file. Fits of a cloth take yarns and fibres from it and need none
    pub fabric: Option<PathBuf>,
    /// What is fitted.
    #[arg(skip)]
    #[serde(deserialize_with = "keys::name")]
    pub target: TargetName,
    /// Measured values to fit to: CSV with r,g,b, a WINDOW file (.xml) or, for a picture, an .exr, .hdr or .png [default for a surface: the fabric's volume, for plies: its fibres]
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Colours: what the cloth shall reflect, as sRGB #RRGGBB, a name, or linear R,G,B
    #[arg(long, value_name = "COLOUR", value_parser = colour::parse_colour)]
    pub colour: Option<OneColour>,
    /// Colours: the yarn that is dyed [default: all, in proportion to their own colours]
    #[arg(long, value_name = "NAME")]
    pub yarn: Option<String>,
    /// Model of the volume; what plies are fitted to [default for plies, colours and cloths: fibres]
    #[arg(long, default_value = OWN, value_parser = patch_model())]
    #[serde(deserialize_with = "organza_work::patch_model::named")]
    pub model: PatchModel,
    /// Paths per pair of the volume, or per texel of a picture, at least 2 [default: 1024; 64 for the picture of a volume, 60 for a cloth, 32 for pictures of plies, 16384 for a colour, 32768 for a shade]
    #[arg(long, value_name = "N", value_parser = parse_paths)]
    pub spp: Option<u64>,
    /// Evaluations: of the first scan, and at most of each descent [default: 200,400 for a surface, 0,60 for fibres, 0,120 for plies]
    #[arg(long, value_name = "SCAN,STEPS", allow_hyphen_values = true, value_parser = parse_patience)]
    pub patience: Option<[u32; 2]>,
    /// Cloths and plies: photograph of the face, warp upright within 20 degrees: .png, .jpg, .tif, .exr or .hdr
    #[arg(long, value_name = "FILE")]
    pub front: Option<PathBuf>,
    /// Cloths and plies: photograph against the light, from the same place
    #[arg(long, value_name = "FILE")]
    pub back: Option<PathBuf>,
    /// Cloths and plies: direction towards the lamp of that photograph, polar angle above 90 [default: 135,0]
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles)]
    pub back_light: Option<[f64; 2]>,
    /// Cloths: the weave, by name or as a .wif file [default: recognised]
    #[arg(long, value_name = "NAME|FILE")]
    pub draft: Option<String>,
    /// Cloths: how likely a draft that was not given is at least, a share such as 0.7 [default: any, the likeliest draft is taken]
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub accept: Option<f64>,
    /// Cloths: stop at the first guess: threads, draft, and colours of one comparison
    #[arg(long)]
    pub quick: bool,
    /// Cloths: the part of both photographs that is used, from pixel X0,Y0 at the upper left to before X1,Y1; --width-mm stays that of the whole photograph
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    #[serde(deserialize_with = "keys::crop")]
    pub crop: Option<Crop>,
    /// Cloths: folder for a page with photographs and pictures side by side
    #[arg(long, value_name = "FOLDER")]
    pub report: Option<PathBuf>,
    /// Cloths: distance of the camera from the middle of the cloth; parallel rays without it
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub camera_mm: Option<f64>,
    /// Cloths: distance of the lamp in front from the middle of the cloth; parallel light without it
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub light_mm: Option<f64>,
    /// Cloths: the same of the lamp behind
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub back_light_mm: Option<f64>,
    /// Cloths: by how much both photographs darken away from their middle, coefficients A,B of 1 + A r^2 + B r^4 with r = 1 in the corners, or "fit" [default: 0,0]
    #[arg(long, value_name = "A,B|fit", allow_hyphen_values = true, value_parser = cloth::flags::parse_vignetting)]
    #[serde(deserialize_with = "cloth::flags::vignetting")]
    pub vignetting: Option<cloth::flags::VignettingFlag>,
    /// Cloths: find the exposure as well; --white is where the search starts
    #[arg(long)]
    pub fit_white: bool,
    /// Cloths: find the directions towards the lamps as well; --light and --back-light are where the search starts
    #[arg(long)]
    pub fit_light: bool,
    /// Direction towards the light in the picture, polar angle and azimuth from the weft, degrees; scenes have their own [default: 45,0]
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles)]
    pub light: Option<[f64; 2]>,
    /// Direction towards the camera of the picture; scenes have their own [default: 0,0]
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles)]
    pub view: Option<[f64; 2]>,
    /// Width of the cloth in the picture, mm; scenes have their own [default: that of the fabric's tile or of the volume]
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub width_mm: Option<f64>,
    /// Value that white paper has in the picture [default: 1; for a scene, values are radiances]
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    pub white: Option<f64>,
    /// Volumes: the part of the picture to match, in its pixels [default: all of it]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_crop)]
    #[serde(deserialize_with = "keys::crop")]
    pub region: Option<Crop>,
    /// Volumes: a part of the picture in which only one yarn is seen, so that pixels of its hue give it an albedo of its own; one for each yarn
    #[arg(long, value_name = "YARN=X0,Y0,X1,Y1", value_parser = parse_named_region)]
    #[serde(deserialize_with = "named_regions")]
    pub region_of: Vec<NamedRegion>,
    /// Volumes: standard deviation of the noise of the picture's pixels, in its values [default: 0]
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    pub noise: Option<f64>,
    /// Volumes: blur of the picture, standard deviation in its pixels [default: none]
    #[arg(long, value_name = "PIXELS", value_parser = parse_positive)]
    pub blur_px: Option<f64>,
    /// Volumes: find a factor of density, too
    #[arg(long)]
    pub fit_density: bool,
    /// Save every evaluation to this file, and resume from it
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = Fit::default().seed, value_parser = parse_seed)]
    #[serde(deserialize_with = "keys::seed")]
    pub seed: u64,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
    /// The file that it is for, see [`Request::adapt_to`].
    #[arg(skip)]
    #[serde(skip)]
    pub file: Option<PathBuf>,
}

impl Default for Fit {
    fn default() -> Fit {
        Fit {
            fabric: None,
            target: TargetName::default(),
            data: None,
            colour: None,
            yarn: None,
            model: PatchModel::Own,
            spp: None,
            patience: None,
            front: None,
            back: None,
            back_light: None,
            draft: None,
            accept: None,
            quick: false,
            crop: None,
            report: None,
            camera_mm: None,
            light_mm: None,
            back_light_mm: None,
            vignetting: None,
            fit_white: false,
            fit_light: false,
            light: None,
            view: None,
            width_mm: None,
            white: None,
            region: None,
            region_of: Vec::new(),
            noise: None,
            blur_px: None,
            fit_density: false,
            journal: None,
            seed: 0,
            voxel_um: None,
            set: Vec::new(),
            file: None,
        }
    }
}

type FitJob = Job<Fit>;

/// The file that is written, whose folder other files are named from.
fn output_of(args: &FitJob) -> &Path {
    args.file.as_deref().unwrap_or(Path::new("fitted.toml"))
}

/// Direction towards the light of a picture by default, degrees.
const LIGHT: [f64; 2] = [45.0, 0.0];

/// Direction towards its camera by default, degrees.
const VIEW: [f64; 2] = [0.0, 0.0];

/// Direction towards the lamp behind the cloth by default, degrees.
const BACK_LIGHT: [f64; 2] = [135.0, 0.0];

impl Fit {
    /// The file from which the search starts; an empty path if there is none.
    fn fabric_path(&self) -> &Path {
        self.fabric.as_deref().unwrap_or(Path::new(""))
    }

    /// Paths per pair or texel.
    fn paths(&self) -> u64 {
        self.spp.unwrap_or(1024)
    }
}

/// A part of a picture in which only one yarn is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedRegion {
    /// The yarn.
    pub name: String,
    /// The part.
    pub crop: Crop,
}

fn parse_named_region(text: &str) -> Result<NamedRegion, String> {
    let (name, crop) = text
        .split_once('=')
        .ok_or("expected YARN=X0,Y0,X1,Y1, for example weft=10,10,40,20")?;
    Ok(NamedRegion {
        name: name.trim().to_owned(),
        crop: parse_crop(crop)?,
    })
}

impl Request for Fit {
    const NAME: &'static str = "fit";
    type Output = Fitted;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        output::check_ending(path, &["toml"])?;
        self.file = Some(path.to_owned());
        Ok(vec![path.to_owned()])
    }

    fn further_places(&self) -> Vec<Place> {
        let journal = Place::of_key(self.journal.as_ref(), PlaceKind::Continued);
        let report = Place::of_key(self.report.as_ref(), PlaceKind::Folder);
        journal.into_iter().chain(report).collect()
    }

    fn check(&self, context: &Context) -> Result<()> {
        self.check_values(context)?;
        check_outputs(self, context, &[])?;
        if let PatchModel::Is(model) = self.model
            && matches!(model.build, Build::Surface(_))
        {
            return Err(of_option("model", "a surface cannot stand for the volume"));
        }
        let target = self.target.target();
        target::check_fields(self)?;
        if self.fabric.is_none() && !std::ptr::eq(target, &cloth::TARGET) {
            let why = "<FABRIC>: expected a fabric file, or a scene or a volume file to fit a \
                       volume; only the fit of a cloth needs none";
            return Err(organza_work::input(why));
        }
        (target.check)(self)
    }

    fn work(job: &FitJob) -> Result<Fitted> {
        (job.target.target().run)(job)
    }
}

impl Fit {
    /// Each field that only some targets take, and whether it is given.
    fn given(&self) -> Vec<(&'static str, bool)> {
        vec![
            ("data", self.data.is_some()),
            ("colour", self.colour.is_some()),
            ("yarn", self.yarn.is_some()),
            ("model", self.model != PatchModel::Own),
            ("patience", self.patience.is_some()),
            ("journal", self.journal.is_some()),
            ("front", self.front.is_some()),
            ("back", self.back.is_some()),
            ("back_light", self.back_light.is_some()),
            ("draft", self.draft.is_some()),
            ("accept", self.accept.is_some()),
            ("quick", self.quick),
            ("crop", self.crop.is_some()),
            ("report", self.report.is_some()),
            ("camera_mm", self.camera_mm.is_some()),
            ("light_mm", self.light_mm.is_some()),
            ("back_light_mm", self.back_light_mm.is_some()),
            ("vignetting", self.vignetting.is_some()),
            ("fit_white", self.fit_white),
            ("fit_light", self.fit_light),
            ("light", self.light.is_some()),
            ("view", self.view.is_some()),
            ("width_mm", self.width_mm.is_some()),
            ("white", self.white.is_some()),
            ("region", self.region.is_some()),
            ("region_of", !self.region_of.is_empty()),
            ("noise", self.noise.is_some()),
            ("blur_px", self.blur_px.is_some()),
            ("fit_density", self.fit_density),
            ("voxel_um", self.voxel_um.is_some()),
        ]
    }

    /// Refuses the first of some fields that is given.
    ///
    /// # Errors
    /// Names the field.
    fn refuse(&self, fields: &[&str], why: &str) -> Result<()> {
        let mut given = self.given().into_iter();
        match given.find(|(field, is_given)| *is_given && fields.contains(field)) {
            Some((field, _)) => Err(of_option(field, why)),
            None => Ok(()),
        }
    }

    fn check_values(&self, context: &Context) -> Result<()> {
        keys::check("spp", self.spp, parse_paths)?;
        let patience = self.patience.map(|p| keys::listed(&p));
        keys::check("patience", patience, parse_patience)?;
        for (field, angles) in [
            ("light", self.light),
            ("view", self.view),
            ("back_light", self.back_light),
        ] {
            keys::check(field, angles.map(|a| keys::listed(&a)), parse_angles)?;
        }
        for (field, number) in [
            ("width_mm", self.width_mm),
            ("white", self.white),
            ("noise", self.noise),
            ("blur_px", self.blur_px),
            ("camera_mm", self.camera_mm),
            ("light_mm", self.light_mm),
            ("back_light_mm", self.back_light_mm),
        ] {
            keys::check(field, number, parse_positive)?;
        }
        keys::check("accept", self.accept, parse_share)?;
        keys::check("voxel_um", self.voxel_um, parse_micrometres)?;
        if let Some(journal) = &self.journal {
            context.check_writable(journal)?;
            for path in &context.outputs {
                output::check_distinct(("the journal", journal), ("the fitted fabric", path))?;
            }
        }
        Ok(())
    }
}

/// A fitted fabric or scene.
pub struct Fitted {
    /// The file.
    pub text: String,
    /// What was found.
    pub parameters: Vec<Determined>,
    /// How well it matches, in words.
    pub words: String,
    /// Further figures.
    figures: serde_json::Map<String, serde_json::Value>,
    /// A page with photographs and pictures side by side.
    page: Option<String>,
    /// The folder for it.
    report: Option<PathBuf>,
}

impl Fitted {
    /// All figures.
    pub fn json(&self) -> serde_json::Value {
        let mut figures = self.figures.clone();
        figures.insert("parameters".into(), json!(self.parameters));
        figures.insert("words".into(), json!(self.words));
        figures.into()
    }

    /// What a person reads of it.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![self.words.clone()];
        let loose = self.parameters.iter().filter(|p| !p.is_fixed);
        let loose: Vec<&str> = loose.map(|p| p.name.as_str()).collect();
        if !loose.is_empty() {
            lines.push(format!("not fixed by the data: {}", loose.join(", ")));
        }
        lines
    }
}

impl Output for Fitted {
    fn results(&self) -> Result<Results, Error> {
        let mut files = vec![("fitted.toml".to_owned(), self.text.clone().into_bytes())];
        let page = self.page.clone();
        files.extend(page.map(|page| ("report.html".to_owned(), page.into_bytes())));
        let results = Results {
            files,
            ..Results::default()
        };
        let all = self.json();
        let figures = all.as_object().into_iter().flatten();
        Ok(figures.fold(results, |r, (key, value)| r.with_figure(key, value.clone())))
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let written = |text: &str| -> output::WriteFile<'_> {
            let bytes = text.as_bytes().to_vec();
            Box::new(move |out| out.write_all(&bytes).context("writing failed"))
        };
        let mut files = vec![(path.to_owned(), written(&self.text))];
        if let (Some(folder), Some(page)) = (&self.report, &self.page) {
            output::make_folder(folder)?;
            files.push((folder.join("report.html"), written(page)));
        }
        Ok(output::write_files(files)?)
    }
}

/// Parts of a picture by the names of yarns.
fn named_regions<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<NamedRegion>, D::Error> {
    let table = BTreeMap::<String, [u32; 4]>::deserialize(from)?;
    let parts = table
        .into_iter()
        .map(|(name, [x0, y0, x1, y1])| NamedRegion {
            name,
            crop: Crop::new(UVec2::new(x0, y0), UVec2::new(x1, y1)),
        });
    Ok(parts.collect())
}

/// The fabric that is fitted, and the files it was read from.
fn read_fabric(args: &FitJob) -> Result<(Fabric, Vec<Input>)> {
    watched(&args.context, |loader| {
        let fabric = fabric_file::load(args.fabric_path(), &args.set, loader)?;
        Ok((fabric, loader.inputs()))
    })
}

/// The file of measured values.
fn measured(args: &Fit) -> Result<&Path> {
    let path = args.data.as_deref();
    path.ok_or_else(|| of_option("data", "expected measured values"))
}

/// Refuses outputs that are the fabric, the data, or files that the fabric names.
fn check_outputs(args: &Fit, context: &Context, read: &[Input]) -> Result<()> {
    let read = || {
        let named = read.iter().map(|i| i.path.as_path());
        named
            .chain(args.fabric.as_deref())
            .chain(args.data.as_deref())
            .chain(args.front.as_deref())
            .chain(args.back.as_deref())
    };
    for path in context.outputs.iter().chain(&args.journal) {
        output::check_not_an_input(path, read())?;
    }
    Ok(())
}

/// The journal of a search of this key, if one is asked for.
fn open_journal(args: &FitJob, key: &str) -> Result<NumberJournal> {
    let work = Work {
        command: "fit",
        key,
    };
    NumberJournal::open(args.journal.as_deref(), &work)
}

/// What a search is of: the fabric after all overrides, the bytes of
/// every file that it names and of the measured values, each in its role, and how
/// the places of the search are measured.
fn journal_key(args: &FitJob, shown: &str, read: &[Input]) -> Result<String> {
    let fabric: Table =
        args.context
            .loader()
            .toml_of(args.fabric_path(), &args.set, Wanted::Fabric)?;
    let loader = args.context.loader();
    let data = args.data.as_deref().map(|path| loader.bytes(path));
    let data = data.transpose()?;
    let key = json!({
        "fabric": identity::digest(&Value::Table(fabric)),
        "inputs": identity::named_inputs(args.fabric_path(), read),
        "data": data.map(|bytes| identity::hex(&Sha256::digest(&bytes))),
        "model": shown,
        "voxel_um": args.voxel_um,
        "spp": args.paths(),
        "seed": args.seed,
    });
    Ok(key.to_string())
}

fn options<'a>(args: &FitJob, loader: &'a Loader<'a>) -> PatchOptions<'a> {
    args.context.patch_options(loader, args.voxel_um, 0)
}

fn effort(args: &FitJob) -> Effort {
    Effort::new(args.paths(), args.seed)
}

/// The fabric file as a table, with keys removed and replaced and names of other files
/// made valid beside the new one.
fn table(args: &FitJob, removed: &[String], overrides: &[String]) -> Result<Table> {
    let mut keys = args.set.clone();
    keys.extend_from_slice(overrides);
    let mut table: Table =
        args.context
            .loader()
            .toml_changed(args.fabric_path(), removed, &keys, Wanted::Fabric)?;
    if let Some(Value::Table(draft)) = table.get_mut("draft") {
        for key in ["wif", "curves"] {
            if let Some(Value::String(name)) = draft.get_mut(key) {
                let there = std::path::absolute(read::beside(args.fabric_path(), name))?;
                *name = there.to_string_lossy().into_owned();
            }
        }
    }
    Ok(table)
}

/// A colour, for people.
fn triple([r, g, b]: [f64; 3]) -> String {
    format!("{r:.4} {g:.4} {b:.4}")
}

/// A comment of one line, whatever stands in names of files and yarns.
fn comment(words: &str) -> String {
    let printable = |c: char| if c.is_control() { ' ' } else { c };
    format!("# {}\n", words.chars().map(printable).collect::<String>())
}

fn finish(args: &FitJob, table: &Table, parameters: &[Determined], words: &str) -> Result<Fitted> {
    let lines = [words.to_owned()];
    finish_with(args, table, parameters, &lines, (json!({}), None))
}

/// The same with several lines of words, figures for programs beside the usual ones, and a page
/// for the folder of `--report`.
fn finish_with(
    args: &FitJob,
    table: &Table,
    parameters: &[Determined],
    lines: &[String],
    (figures, page): (serde_json::Value, Option<String>),
) -> Result<Fitted> {
    let mut text = comment(&format!("Fitted by: {}", args.context.command));
    text.extend(lines.iter().map(|line| comment(line)));
    text += "#\n";
    for p in parameters {
        let loose = match p.is_fixed {
            true => "",
            false => ", not fixed by the data",
        };
        let line = format!("{} = {:.4} +- {:.4}{loose}", p.name, p.value, p.se);
        text += &comment(&line);
    }
    let table = toml::to_string(table).context("the fabric cannot be written")?;
    Ok(Fitted {
        text: text + "\n" + &table,
        parameters: parameters.to_vec(),
        words: lines.join("\n"),
        figures: figures.as_object().cloned().unwrap_or_default(),
        page,
        report: args.report.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_stay_on_their_line() {
        let text = comment("a\nname = 1") + &comment("b\u{7f}\r");
        assert_eq!(text, "# a name = 1\n# b  \n");
        assert!(text.parse::<Table>().unwrap().is_empty());
    }
}
