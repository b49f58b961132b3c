//! Fitting the optics of a volume: a scene with an object of `kind = "volume"`, or a volume
//! file alone.

use super::fibres::Observed;
use super::flag_groups::picture_flags;
use super::volume_picture::Photograph;
use super::volume_scene::{Draft, START};
use super::{FitArgs, FitWhat, check_outputs, finish};
use crate::building::watched;
use crate::error::{after_option, of_file, of_option};
use crate::output::note;
use crate::progress::Progress;
use anyhow::Result;
use organza_basis::Stopped;
use organza_measure::{
    Appearance, AppearanceFit, AppearanceSearch, Measured, VolumePatch, fit_appearance,
};
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::optics::EVERY_YARN;
use organza_scene::patches::AnyPatch;
use organza_scene::scene_file::is_scene_text;
use organza_volume::format;
use toml::Table;

/// Least and greatest width of the flakes, as `gamma`.
const GAMMA: [f64; 2] = [0.02, 0.8];

/// Least and greatest factor of density.
const DENSITY: [f64; 2] = [0.2, 5.0];

/// Most steps of the descent.
const STEPS: u32 = 10;

/// Whether the input is a volume or a scene, and not a fabric.
///
/// # Errors
/// A file that cannot be read.
pub fn is_volume(args: &FitArgs) -> Result<bool> {
    if format::by_name(&args.fabric_path().to_string_lossy()).is_some() {
        return Ok(true);
    }
    let loader = args.common.host.loader();
    let text = loader.text_of(args.fabric_path(), Wanted::Either)?;
    Ok(is_scene_text(args.fabric_path(), &text)?)
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    refuse_flags(args)?;
    let (draft, inputs) = watched(&args.common, &args.cache, |loader| {
        let draft = Draft::new(args, loader)?;
        Ok((draft, loader.inputs()))
    })?;
    check_outputs(args, &inputs)?;
    if !draft.is_made {
        for (flag, is_given) in picture_flags(args).into_iter().take(3) {
            if is_given {
                return Err(of_option(
                    flag,
                    format!(
                        "{} has a camera and lights of its own",
                        draft.path.display()
                    ),
                ));
            }
        }
    }
    let path = args.data.as_deref();
    let path = path.ok_or_else(|| of_option("data", "expected measured values or a picture"))?;
    let data = match args.what {
        FitWhat::Picture => Data::Picture(Photograph::read(args, path, &draft)?),
        _ => Data::Pairs(Observed::read(path, &args.common.host)?),
    };
    let names = match &data {
        Data::Picture(photograph) => photograph.names(),
        Data::Pairs(_) => draft.materials.names.clone(),
    };
    let names = match names.len() {
        0 | 1 => vec![EVERY_YARN.to_owned()],
        _ => names,
    };
    let density = if args.fit_density { DENSITY } else { [1.0; 2] };
    let search = AppearanceSearch {
        start: Appearance {
            albedo: vec![[START; 3]; names.len()],
            gamma: 0.15,
            density: 1.0,
        },
        names,
        gamma: GAMMA,
        density,
        steps: STEPS,
    };
    let progress = Progress::new("fitting", 60, &args.common);
    let mut count = 0;
    let loader = args.common.host.loader();
    let mut simulate = |optics: &Appearance| -> Result<Vec<Measured>> {
        count += 1;
        Stopped::check(progress.at(count))?;
        data.simulate(args, &draft, draft.with(&search.names, optics)?, &loader)
    };
    let target = data.target();
    let found = fit_appearance(&target, &search, &mut simulate)?;
    progress.finish();
    let fitted = draft.with(&search.names, &found.appearance)?;
    let table = draft.portable(fitted, &args.outfile)?;
    let labels = data.labels(&search.names);
    let words = words(&found, &target, &labels);
    if !args.common.quiet {
        for (label, (k, wanted)) in labels.iter().zip(target.iter().enumerate()) {
            let [simulated, wanted] = [&found.simulated[k], wanted].map(|m| triple(m.mean));
            let off = found.residuals[k].map(|r| format!("{r:+.1}")).join(" ");
            note!("{label}: {simulated}, wanted {wanted} ({off} expected errors)");
        }
        for p in &found.parameters {
            note!("{} = {:.4} +- {:.4}", p.name, p.value, p.se);
        }
    }
    finish(args, &table, &found.parameters, &words)
}

fn refuse_flags(args: &FitArgs) -> Result<()> {
    let refuse = |flag: &str, is_given: bool, why: &str| {
        if is_given {
            return Err(of_option(flag, why));
        }
        Ok(())
    };
    if args.what == FitWhat::Surface {
        let why = "a volume has no [surface] section; take fibres, for measured pairs, or picture";
        return Err(after_option("what", format!("surface: {why}")));
    }
    if args.what == FitWhat::Plies {
        return Err(after_option(
            "what",
            "plies: a volume has no plies; give a fabric",
        ));
    }
    let fabrics = "applies only to fits of a fabric";
    refuse("--journal", args.journal.is_some(), fabrics)?;
    refuse("--patience", args.patience.is_some(), fabrics)?;
    refuse("--voxel-um", args.voxel.voxel_um.is_some(), fabrics)?;
    let picture = args.what == FitWhat::Picture;
    for (flag, is_given) in picture_flags(args) {
        refuse(flag, is_given && !picture, "applies only to --what picture")?;
    }
    Ok(())
}

fn words(found: &AppearanceFit, target: &[Measured], labels: &[String]) -> String {
    let all = found.residuals.iter().zip(labels);
    let worst = all
        .flat_map(|(r, label)| r.iter().map(move |r| (r.abs(), label)))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let (most, label) = worst.map_or((0.0, ""), |(r, label)| (r, label.as_str()));
    format!(
        "{} after {} simulations: {} values, the greatest difference is {most:.1} expected \
         errors ({label}).",
        if found.is_met { "Met" } else { "Not met" },
        found.simulations,
        3 * target.len(),
    )
}

fn triple([r, g, b]: [f64; 3]) -> String {
    format!("{r:.4} {g:.4} {b:.4}")
}

/// What was observed.
enum Data {
    Picture(Photograph),
    Pairs(Observed),
}

impl Data {
    fn target(&self) -> Vec<Measured> {
        match self {
            Data::Picture(photograph) => photograph.target(),
            Data::Pairs(observed) => observed.list(),
        }
    }

    fn labels(&self, names: &[String]) -> Vec<String> {
        match self {
            Data::Picture(photograph) => photograph.labels(names),
            Data::Pairs(observed) => observed.labels(),
        }
    }

    fn simulate(
        &self,
        args: &FitArgs,
        draft: &Draft,
        table: Table,
        loader: &Loader<'_>,
    ) -> Result<Vec<Measured>> {
        let table = match self {
            Data::Picture(photograph) => photograph.with_camera(table, &draft.path)?,
            Data::Pairs(_) => table,
        };
        let loaded = draft.load(&table, loader)?;
        let scene = loaded.build(args.memory.max_memory, loader)?;
        match self {
            Data::Picture(photograph) => photograph.simulate(args, draft, &loaded, scene),
            Data::Pairs(observed) => {
                let integrator = loaded.file.render.integrator.into();
                let patch =
                    VolumePatch::new(scene, integrator).map_err(|e| of_file(&draft.path, e))?;
                let patch: AnyPatch = Box::new(patch);
                Ok(observed.simulate(args, &patch)?.list())
            }
        }
    }
}
