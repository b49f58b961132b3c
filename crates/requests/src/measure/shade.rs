//! `en14501`: the figures that a shade before a window is sold by.

use super::bands::BandName;
use super::layout::{BothBands, Found, Kind, Layout, Whole};
use super::{Measuring, Values};
use anyhow::Result;
use organza_measure::{ShadeClass, ShadeClasses, ShadeFigures, measure_shade};
use organza_work::Results;
use organza_work::output::SeekWrite;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "en14501",
    help: "What a shade before a window is sold by, and its classes of visual comfort by EN 14501:2005",
    kind: Kind::Whole(Whole {
        ending: None,
        needs_ending: false,
        takes_target_error: true,
        both_bands: BothBands::Always,
        check: |_| Ok(()),
        // A beam and diffuse light, on both sides.
        count: |_| 4,
        measure,
    }),
};

/// The sides on which light arrives.
const SIDES: [&str; 2] = ["face", "back"];

fn measure(m: &Measuring<'_>) -> Result<Found> {
    let (mut sheet, mut paths) = (Vec::new(), 0);
    for (&band, patch) in m.job.bands.iter().zip(&m.subject.patches) {
        let (sides, stats) = measure_shade(patch, &m.effort, m.watch)?;
        paths += stats.paths;
        sheet.push((band, sides));
    }
    let visible = sheet.iter().find(|(band, _)| *band == BandName::Visible);
    let classes = visible.map(|(_, sides)| sides.each_ref().map(ShadeClasses::of));
    Ok(Found {
        values: Box::new(Shade { sheet, classes }),
        paths,
        heavy_tails: 0,
        count: m.count(),
    })
}

/// The sheet, and the classes of face and back if light was measured.
struct Shade {
    sheet: Vec<(BandName, [ShadeFigures; 2])>,
    classes: Option<[ShadeClasses; 2]>,
}

impl Shade {
    fn class_figures(&self) -> Value {
        let of = |[face, back]: &[ShadeClasses; 2]| json!({"face": face, "back": back});
        json!(self.classes.as_ref().map(of))
    }
}

impl Values for Shade {
    fn what(&self) -> &'static str {
        "sheet"
    }

    fn results(&self, paths: u64) -> Results {
        Results::default()
            .with_figure("sheet", self.list())
            .with_figure("classes", self.class_figures())
            .with_figure("paths", paths)
    }

    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        out.write_all(b"band,side,quantity,value,se\n")?;
        for (band, side, quantity, share) in rows(&self.sheet) {
            let (value, se) = (share.value, share.se);
            writeln!(out, "{band},{side},{quantity},{value},{se}")?;
        }
        for (side, classes) in SIDES.iter().zip(self.classes.iter().flatten()) {
            for (name, class) in classes.named() {
                writeln!(out, "visible,{side},class_{name},{},", class.class)?;
            }
        }
        Ok(())
    }

    fn list(&self) -> Value {
        let rows = rows(&self.sheet).into_iter();
        let rows = rows.map(|(band, side, quantity, share)| {
            json!({"band": band, "side": side, "quantity": quantity,
                "value": share.value, "se": share.se})
        });
        rows.collect()
    }

    fn extra(&self) -> Vec<(&'static str, Value)> {
        vec![("classes", self.class_figures())]
    }

    fn line(&self) -> Option<String> {
        Some(page(&self.sheet, self.classes.as_ref()))
    }
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
