//! Fitting the optics of a volume: a scene with an object of `kind = "volume"`, or a volume
//! file alone.

use super::fibres::Observed;
use super::volume_picture::Photograph;
use super::volume_scene::{Draft, START};
use super::{Fit, FitJob, check_outputs, finish, output_of};
use crate::triple;
use anyhow::Result;
use organza_basis::Stopped;
use organza_measure::{
    Appearance, AppearanceFit, AppearanceSearch, Measured, VolumePatch, fit_appearance,
};
use organza_scene::loader::Loader;
use organza_scene::optics::EVERY_YARN;
use organza_scene::patches::AnyPatch;
use organza_work::Progress;
use organza_work::building::watched;
use organza_work::{of_file, of_option};
use std::path::Path;
use toml::Table;

/// Least and greatest width of the flakes, as `gamma`.
const GAMMA: [f64; 2] = [0.02, 0.8];

/// Least and greatest factor of density.
const DENSITY: [f64; 2] = [0.2, 5.0];

/// Most steps of the descent.
const STEPS: u32 = 10;

/// Whether it is fitted to a picture, and not to measured values.
pub fn has_picture(args: &Fit) -> bool {
    let ending = args.data.as_deref().and_then(Path::extension);
    let ending = ending.and_then(|e| e.to_str()).unwrap_or_default();
    organza_picture::format_of_ending(ending).is_some()
}

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "volume",
    about: "Colours, flakes and density of a volume file, or of the volume in a scene, from a picture or measured values",
    example: "scanned.ovox --data photograph.exr --light 30,0 --width-mm 4 --fit-density -o fitted.toml",
    fields: &[
        "data",
        "light",
        "view",
        "width_mm",
        "white",
        "region",
        "region_of",
        "noise",
        "blur_px",
        "fit_density",
    ],
    check,
    run,
};

/// The file of measured values, or of a picture.
fn data(args: &Fit) -> Result<&Path> {
    let path = args.data.as_deref();
    path.ok_or_else(|| of_option("data", "expected measured values or a picture"))
}

fn check(args: &Fit) -> Result<()> {
    data(args)?;
    if has_picture(args) {
        return Ok(());
    }
    // All but the data itself and what is found.
    let of_pictures = TARGET.fields.iter().copied();
    let of_pictures = of_pictures.filter(|f| !["data", "fit_density"].contains(f));
    let of_pictures: Vec<&str> = of_pictures.collect();
    args.refuse(&of_pictures, "applies only to a picture")
}

fn run(args: &FitJob) -> Result<super::Fitted> {
    let (draft, inputs) = watched(&args.context, |loader| {
        let draft = Draft::new(args, loader)?;
        Ok((draft, loader.inputs()))
    })?;
    check_outputs(args, &args.context, &inputs)?;
    if !draft.is_made {
        let scene = draft.path.display();
        let why = format!("{scene} has a camera and lights of its own");
        args.refuse(&["light", "view", "width_mm"], &why)?;
    }
    let path = data(args)?;
    let data = match has_picture(args) {
        true => Data::Picture(Photograph::read(args, path, &draft)?),
        false => Data::Pairs(Observed::read(path, &args.context)?),
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
    let progress = Progress::new("fitting", 60, &args.context);
    let mut count = 0;
    let loader = args.context.loader();
    let mut simulate = |optics: &Appearance| -> Result<Vec<Measured>> {
        count += 1;
        Stopped::check(progress.at(count))?;
        data.simulate(args, &draft, draft.with(&search.names, optics)?, &loader)
    };
    let target = data.target();
    let found = fit_appearance(&target, &search, &mut simulate)?;
    progress.finish();
    let fitted = draft.with(&search.names, &found.appearance)?;
    let table = draft.portable(fitted, output_of(args))?;
    let labels = data.labels(&search.names);
    let words = words(&found, &target, &labels);
    for (label, (k, wanted)) in labels.iter().zip(target.iter().enumerate()) {
        let [simulated, wanted] = [&found.simulated[k], wanted].map(|m| triple(m.mean));
        let off = found.residuals[k].map(|r| format!("{r:+.1}")).join(" ");
        let line = format!("{label}: {simulated}, wanted {wanted} ({off} expected errors)");
        args.context.note(line);
    }
    for p in &found.parameters {
        let line = format!("{} = {:.4} +- {:.4}", p.name, p.value, p.se);
        args.context.note(line);
    }
    finish(args, &table, &found.parameters, &words)
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
        args: &FitJob,
        draft: &Draft,
        table: Table,
        loader: &Loader<'_>,
    ) -> Result<Vec<Measured>> {
        let table = match self {
            Data::Picture(photograph) => photograph.with_camera(table, &draft.path)?,
            Data::Pairs(_) => table,
        };
        let loaded = draft.load(&table, loader)?;
        let scene = loaded.build(args.context.max_memory_bytes, loader)?;
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
