//! What a word names that is to be seen: a scene, or a cloth that a studio shows. A cloth is a
//! fabric, a draft or a named weave.

use crate::bare_fabric::{self, DraftName};
use crate::draft_picture;
use crate::error::{InputError, Result};
use crate::fabric_file::{self, Fabric, FabricFile};
use crate::file_kind::{self, Wanted};
use crate::given_files::GivenFiles;
use crate::loader::Loader;
use crate::read;
use crate::scene_file;
use crate::studio::{self, MAX_FIBRE_LENGTH, Studio, Subject, fibre_length};
use organza_weave::Draft;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A scene made for a cloth. It is on no disk.
#[derive(Debug)]
pub struct Made {
    /// Where the scene would be: names in it are relative to its folder.
    pub scene_path: PathBuf,
    /// The scene.
    pub scene: String,
    /// Where its fabric is, or would be.
    pub fabric_path: PathBuf,
    /// The text of the fabric where it is not that of a file.
    pub fabric: Option<String>,
    /// A mesh with its path.
    mesh: Option<(PathBuf, String)>,
}

impl Made {
    /// The files, for a loader.
    pub fn given(&self) -> GivenFiles {
        let mut given = GivenFiles::default();
        given.insert(self.scene_path.clone(), self.scene.clone().into_bytes());
        if let Some(fabric) = &self.fabric {
            given.insert(self.fabric_path.clone(), fabric.clone().into_bytes());
        }
        if let Some((path, mesh)) = &self.mesh {
            given.insert(path.clone(), mesh.clone().into_bytes());
        }
        given
    }
}

/// How a cloth is made.
#[derive(Clone, Copy, Debug, Default)]
pub struct Making<'a> {
    /// The studio; the usual one if none, and a scene needs none.
    pub studio: Option<Studio>,
    /// `key.path=value` overrides of the fabric.
    pub overrides: &'a [String],
}

/// The scene that a studio makes for what a word names; `None` where it names a scene.
///
/// # Errors
/// There is nothing of this name, or it is none of these; the cloth cannot be made.
pub fn scene_for(word: &Path, making: Making<'_>, loader: &Loader<'_>) -> Result<Option<Made>> {
    let studio = making.studio.unwrap_or_default();
    if let Some(draft) = draft_of(word, loader)? {
        return of_draft(&draft, studio, making.overrides, loader).map(Some);
    }
    let text = loader.text_of(word, Wanted::Either)?;
    if scene_file::is_scene_text(word, &text)? {
        return match making.studio {
            None => Ok(None),
            Some(studio) => Err(InputError::after_option(
                "studio",
                format!(
                    "{}: {} is a scene, which has its own camera and lights; name a fabric, a \
                     draft or a weave",
                    studio.name(),
                    word.display()
                ),
            )),
        };
    }
    of_fabric(word, studio, making.overrides, loader).map(Some)
}

/// A draft that comes alone.
#[derive(Debug)]
pub struct BareDraft {
    /// Its WIF file, or the name of the weave.
    pub source: PathBuf,
    /// Whether it is a file.
    pub is_file: bool,
    /// The draft.
    pub draft: Draft,
}

impl BareDraft {
    fn name(&self) -> String {
        let name = match self.is_file {
            true => self.source.file_name().unwrap_or_default(),
            false => self.source.as_os_str(),
        };
        name.to_string_lossy().into_owned()
    }

    /// The text of a fabric in a folder.
    ///
    /// # Errors
    /// No cloth can be woven from the draft.
    pub fn fabric_in(&self, folder: &Path) -> Result<String> {
        let real = |folder: &Path| match folder.as_os_str().is_empty() {
            true => Path::new(".").canonicalize(),
            false => folder.canonicalize(),
        };
        let own = self.source.parent().unwrap_or(Path::new(""));
        if !self.is_file || real(own).ok() == real(folder).ok() {
            return self.fabric(None);
        }
        let whole = std::path::absolute(&self.source);
        let whole = whole.map_err(|e| InputError::of_file(&self.source, e))?;
        let name = whole.display().to_string();
        bare_fabric::of_draft(DraftName::Wif(&name), &self.draft, None)
    }

    /// The text of a fabric beside it, for all of it or for a part.
    ///
    /// # Errors
    /// No cloth can be woven from the draft.
    pub fn fabric(&self, part: Option<[u32; 4]>) -> Result<String> {
        let name = self.name();
        let name = match self.is_file {
            true => DraftName::Wif(&name),
            false => DraftName::Weave(&name),
        };
        bare_fabric::of_draft(name, &self.draft, part)
    }

    /// A path beside it, with this end of the name.
    fn beside(&self, end: &str) -> PathBuf {
        let stem = match self.is_file {
            true => self
                .source
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy(),
            false => self.source.to_string_lossy(),
        };
        self.source.with_file_name(format!("{stem}{end}"))
    }
}

/// The draft that a word names, as a WIF file or a named weave; `None` for other files.
///
/// # Errors
/// The file cannot be read, or is a draft that is wrong; there is no such weave.
pub fn draft_of(word: &Path, loader: &Loader<'_>) -> Result<Option<BareDraft>> {
    let text = word.to_string_lossy();
    let is_wif = word
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("wif"));
    let made = |draft, is_file| BareDraft {
        source: word.to_owned(),
        is_file,
        draft,
    };
    let missing = loader.unreachable(word);
    if missing.is_some() && !is_wif && !text.contains(['.', '/', '\\']) {
        let draft = Draft::named(&text).map_err(|e| InputError {
            is_missing: true,
            ..InputError::of_file(word, format!("no such file, and no named weave: {e}"))
        })?;
        return Ok(Some(made(draft, false)));
    }
    if let Some(why) = missing {
        return Err(why);
    }
    let bytes = match is_wif {
        true => loader.bytes(word)?,
        false => {
            let is_toml = word
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
            let bytes = match is_toml {
                true => return Ok(None),
                false => loader.bytes(word)?,
            };
            if !file_kind::is_wif(&String::from_utf8_lossy(&bytes)) {
                return Ok(None);
            }
            bytes
        }
    };
    let draft = Draft::from_wif(&bytes).map_err(|e| InputError::of_file(word, e))?;
    Ok(Some(made(draft, true)))
}

fn of_draft(
    bare: &BareDraft,
    studio: Studio,
    overrides: &[String],
    loader: &Loader<'_>,
) -> Result<Made> {
    let repeat = repeat_of(&bare.draft);
    let path = bare.beside("_cloth.toml");
    let text = |part| {
        let text = bare.fabric(part)?;
        changed(&path, &text, overrides).map(Some)
    };
    let mut parts = Parts::new(&bare.draft, repeat, studio, [1, 1]);
    let cloth = shown(&path, text, Some(&mut parts), studio, loader)?;
    let scene = bare.beside(&format!("_{}.toml", studio.name()));
    finish(&path, cloth, Some(repeat), studio, &scene)
}

fn of_fabric(
    path: &Path,
    studio: Studio,
    overrides: &[String],
    loader: &Loader<'_>,
) -> Result<Made> {
    let source = loader.text_of(path, Wanted::Fabric)?;
    let file: FabricFile = loader.parse_changed(path, &source, &[], overrides, Wanted::Fabric)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let scene_path = path.with_file_name(format!("{stem}_{}.toml", studio.name()));
    let draft = woven_draft(path, &file, loader)?;
    let repeat = draft.as_ref().map(|draft| {
        let colours = [&file.warp.colours, &file.weft.colours].map(|c| c.len().max(1));
        let own = repeat_of(draft);
        [0, 1].map(|i| own[i].max(colours[i]))
    });
    let text = |part: Option<[u32; 4]>| match (part, overrides) {
        (None, []) => Ok(None),
        (None, _) => changed(path, &source, overrides).map(Some),
        (Some(part), _) => {
            let text = changed(path, &source, overrides)?;
            with_part(path, &text, &file, part).map(Some)
        }
    };
    let of_a_place = file.print.is_some() || file.wear.is_some();
    let is_plain = file.synthesis.is_none() && file.pile.is_none() && !of_a_place;
    let yarns = [&file.warp.yarn, &file.weft.yarn].map(|y| y.len().max(1));
    let mut parts = match (&draft, repeat) {
        (Some(draft), Some(repeat)) if is_plain => Some(Parts::new(draft, repeat, studio, yarns)),
        _ => None,
    };
    let cloth = shown(path, text, parts.as_mut(), studio, loader)?;
    finish(path, cloth, repeat, studio, &scene_path)
}

/// A cloth, and the text of its fabric where it is not that of a file.
type Shown = (Fabric, Option<String>);

/// The cloth of a fabric, of which `text` gives the text of a part: all of it, or the largest part
/// that the studio needs and whose fibres fit into memory.
fn shown(
    path: &Path,
    text: impl Fn(Option<[u32; 4]>) -> Result<Option<String>>,
    mut parts: Option<&mut Parts>,
    studio: Studio,
    loader: &Loader<'_>,
) -> Result<Shown> {
    loop {
        let part = parts.as_ref().and_then(|p| p.part());
        let text = text(part)?;
        // What is odd about the cloth is reported when it is built for the picture.
        let mut silent = loader.silent();
        if let Some(text) = &text {
            silent.give(path.to_owned(), text.clone());
        }
        let cloth = fabric_file::load(path, &[], &silent)?;
        let excess = fibre_length(&cloth) / MAX_FIBRE_LENGTH;
        let is_whole = matches!(studio, Studio::Drape | Studio::Flat);
        let may_shrink = cloth.synthesis.is_none() && !is_whole && excess > 1.0;
        let shrinks = parts
            .as_mut()
            .is_some_and(|p| may_shrink && p.shrink(excess));
        if !shrinks {
            return Ok((cloth, text));
        }
    }
}

/// The part of a draft that a studio shows.
struct Parts {
    all: [usize; 2],
    /// Threads of the part; all of the draft's repeats where `None`.
    shown: Option<[usize; 2]>,
    /// Yarns that take turns, which go on without a break.
    yarns: [usize; 2],
    /// The repeat that is woven where all is.
    repeat: [usize; 2],
}

impl Parts {
    fn new(draft: &Draft, repeat: [usize; 2], studio: Studio, yarns: [usize; 2]) -> Parts {
        let met = studio.threads_met(repeat);
        let is_whole = matches!(studio, Studio::Drape | Studio::Flat);
        let shown =
            (!is_whole && repeat.iter().any(|n| *n > met)).then(|| repeat.map(|n| n.min(met)));
        Parts {
            all: [draft.ends(), draft.picks()],
            shown,
            yarns,
            repeat,
        }
    }

    fn part(&self) -> Option<[u32; 4]> {
        let shown = self.shown?;
        let [[first_end, ends], [first_pick, picks]] = [0, 1].map(|i| {
            let count = shown[i].next_multiple_of(self.yarns[i]);
            let first = (self.all[i].saturating_sub(count) / 2) / self.yarns[i] * self.yarns[i];
            [first as u32, count as u32]
        });
        Some([first_end, first_pick, ends, picks])
    }

    /// Shows fewer threads, for fibres that are too long by a factor; false where there are few.
    fn shrink(&mut self, excess: f64) -> bool {
        let now = self.shown.unwrap_or(self.repeat);
        let fewer = now.map(|n| ((n as f64 / excess.sqrt() * 0.97) as usize).max(8).min(n));
        self.shown = Some(fewer);
        fewer != now
    }
}

/// The draft of a fabric that is woven.
fn woven_draft(path: &Path, file: &FabricFile, loader: &Loader<'_>) -> Result<Option<Draft>> {
    let spec = &file.draft;
    if spec.weave.is_none()
        && spec.wif.is_none()
        && spec.drawdown.is_none()
        && spec.picture.is_none()
    {
        return Ok(None);
    }
    let open = |name: &str| loader.bytes_or_why(&read::beside(path, name));
    let spec = draft_picture::resolved(spec, &open).map_err(|e| e.in_file(path))?;
    Draft::of_spec(&spec, &open)
        .map(Some)
        .map_err(|e| InputError::from(e).in_file(path))
}

/// Ends and picks after which interlacing and colours repeat.
fn repeat_of(draft: &Draft) -> [usize; 2] {
    let smallest = draft.smallest_repeat();
    [smallest.ends(), smallest.picks()]
}

/// The text of a fabric with overrides.
fn changed(path: &Path, source: &str, overrides: &[String]) -> Result<String> {
    if overrides.is_empty() {
        return Ok(source.to_owned());
    }
    // Mistakes in keys are found here.
    let _: FabricFile = read::toml_changed(path, source, &[], overrides, Wanted::Fabric)?;
    let table: Table = read::toml_changed(path, source, &[], overrides, Wanted::Fabric)?;
    toml::to_string(&table).map_err(|e| InputError::of_file(path, e))
}

/// The text of a fabric with a part of its draft, and the colours of that part.
fn with_part(path: &Path, text: &str, file: &FabricFile, part: [u32; 4]) -> Result<String> {
    let fail = |e: String| InputError::of_file(path, e);
    let mut table: Table = toml::from_str(text).map_err(|e| fail(e.to_string()))?;
    let numbers = |n: &[u32]| Value::Array(n.iter().map(|n| Value::Integer((*n).into())).collect());
    let mut set = |section: &str, key: &str, value: Value| {
        if let Some(Value::Table(section)) = table.get_mut(section) {
            section.insert(key.to_owned(), value);
        }
    };
    set("draft", "part", numbers(&part));
    for (system, threads, first, count) in [
        ("warp", &file.warp, part[0], part[2]),
        ("weft", &file.weft, part[1], part[3]),
    ] {
        if threads.colours.len() > 1 {
            let all = threads
                .colours
                .iter()
                .cycle()
                .skip(first as usize % threads.colours.len());
            let shown = all.take(count as usize).map(|c| {
                let channels = c.0.to_array().map(|c| Value::Float(f64::from(c)));
                Value::Array(channels.to_vec())
            });
            set(system, "colours", Value::Array(shown.collect()));
        }
    }
    if let Some(Value::Table(tile)) = table.get_mut("tile") {
        tile.remove("repeats");
    }
    toml::to_string(&table).map_err(|e| fail(e.to_string()))
}

fn finish(
    fabric_path: &Path,
    (cloth, fabric): Shown,
    repeat: Option<[usize; 2]>,
    studio: Studio,
    scene_path: &Path,
) -> Result<Made> {
    let name = fabric_path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy();
    let subject = Subject {
        fabric: &name,
        cloth: &cloth,
        repeat,
    };
    let made = studio::scene(studio, &subject)?;
    Ok(Made {
        scene_path: scene_path.to_owned(),
        scene: made.text,
        mesh: made
            .mesh
            .map(|(name, text)| (read::beside(scene_path, &name), text)),
        fabric_path: fabric_path.to_owned(),
        fabric,
    })
}
