//! `--layout en14501`: the figures that a shade before a window is sold by.

use super::MeasureArgs;
use super::bands::BandName;
use super::summary::{Summary, write};
use crate::results::Results;
use anyhow::Result;
use organza_basis::Watch;
use organza_measure::{Effort, ShadeClass, ShadeClasses, ShadeFigures, measure_shade};
use organza_scene::patches::AnyPatch;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// The sides on which light arrives.
const SIDES: [&str; 2] = ["face", "back"];

/// Measures every band, and writes the sheet.
///
/// # Errors
/// Those of the measurement and of the output.
pub fn run(
    args: &MeasureArgs,
    patches: &[AnyPatch],
    (effort, watch): (&Effort, Watch<'_>),
    summary: &mut Summary,
) -> Result<()> {
    let mut sheet = Vec::new();
    for (&band, patch) in args.bands.iter().zip(patches) {
        let (sides, stats) = measure_shade(patch, effort, watch)?;
        summary.paths += stats.paths;
        sheet.push((band, sides));
    }
    let visible = sheet.iter().find(|(band, _)| *band == BandName::Visible);
    let classes = visible.map(|(_, sides)| sides.each_ref().map(ShadeClasses::of));
    let rows = rows(&sheet);
    write(args, |out| {
        out.write_all(b"band,side,quantity,value,se\n")?;
        for (band, side, quantity, share) in &rows {
            let (value, se) = (share.value, share.se);
            writeln!(out, "{band},{side},{quantity},{value},{se}")?;
        }
        for (side, classes) in SIDES.iter().zip(classes.iter().flatten()) {
            for (name, class) in classes.named() {
                writeln!(out, "visible,{side},class_{name},{},", class.class)?;
            }
        }
        Ok(())
    })?;
    let list: Vec<Value> = rows
        .iter()
        .map(|(band, side, quantity, share)| {
            json!({"band": band, "side": side, "quantity": quantity,
                "value": share.value, "se": share.se})
        })
        .collect();
    let figures = json!(classes.map(|[face, back]| json!({"face": face, "back": back})));
    args.common.host.give(|| {
        let sheet = Results::default().with_figure("sheet", list.clone());
        sheet
            .with_figure("classes", figures.clone())
            .with_figure("paths", summary.paths)
    });
    summary.what = "sheet";
    summary.list = Value::Array(list);
    summary.extra = vec![("classes", figures)];
    summary.result_line = Some(page(&sheet, classes.as_ref()));
    Ok(())
}

type Sheet = [(BandName, [ShadeFigures; 2])];

fn band_name(band: BandName) -> &'static str {
    organza_scene::optics::Band::from(band).name()
}

/// Band, side, quantity and value.
fn rows(
    sheet: &Sheet,
) -> Vec<(
    &'static str,
    &'static str,
    &'static str,
    organza_measure::Share,
)> {
    let mut rows = Vec::new();
    for (band, sides) in sheet {
        for (side, figures) in SIDES.into_iter().zip(sides) {
            let named = figures.named().into_iter();
            rows.extend(named.map(|(name, share)| (band_name(*band), side, name, share)));
        }
    }
    rows
}

/// The sheet for people.
fn page(sheet: &Sheet, classes: Option<&[ShadeClasses; 2]>) -> String {
    let mut text = format!("{:22}", "");
    for (band, _) in sheet {
        for side in SIDES {
            let _ = write!(text, "{:>18}", format!("{}, {side}", band_name(*band)));
        }
    }
    let names = ShadeFigures::default().named().map(|n| n.0);
    for (place, name) in names.iter().enumerate() {
        let _ = write!(text, "\n{:22}", name.replace('_', "-"));
        for figures in sheet.iter().flat_map(|(_, sides)| sides) {
            let share = figures.named()[place].1;
            let _ = write!(
                text,
                "{:>18}",
                format!("{:.4} +- {:.4}", share.value, share.se)
            );
        }
    }
    let Some(classes) = classes else {
        return text;
    };
    for (place, (name, _)) in classes[0].named().iter().enumerate() {
        let _ = write!(text, "\nclass, {:15}", name.replace('_', " "));
        for side in classes {
            let _ = write!(text, "{:>18}", class_words(side.named()[place].1));
        }
    }
    text
}

/// A class, and what the errors leave open.
fn class_words(class: ShadeClass) -> String {
    if class.lowest == class.highest {
        class.class.to_string()
    } else {
        format!("{} ({} to {})", class.class, class.lowest, class.highest)
    }
}
