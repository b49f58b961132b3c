//! What finishes of a yarn do to the optics of its fibres.
//!
//! Cotton fibres are collapsed tubes, which swell in the lye of mercerising. The lustre of cotton
//! depends on the shape of their sections alone, and mercerised fibres come nearest to circles
//! without becoming ones [Adderley1924]. The other finishes change yarns and which fibres stand
//! out, which is geometry.

use crate::optics::{EVERY_YARN, OpticsFile, OpticsTable};
use organza_weave::spec::YarnSpec;
use std::collections::BTreeMap;

/// The finish that makes fibres rounder.
const MERCERISED: &str = "mercerised";
/// The section of fibres that swell.
const BEFORE: &str = "bean";
/// What it becomes: nearly round. The ratio is estimated.
const AFTER: &str = "ellipse:1.25";

/// The optics of a file after the finishes of its yarns, highest precedence first: the tables
/// of single yarns, then those for every yarn.
pub(crate) fn finished(file: &OpticsFile, yarns: &BTreeMap<String, YarnSpec>) -> Vec<OpticsFile> {
    let mut single = file.clone();
    let mut every: OpticsFile = single.remove_entry(EVERY_YARN).into_iter().collect();
    let is_swollen = |yarn: &YarnSpec| yarn.finish.iter().any(|f| f == MERCERISED);
    for (name, _) in yarns.iter().filter(|(_, yarn)| is_swollen(yarn)) {
        if let Some(list) = single.get_mut(name) {
            list.0.iter_mut().for_each(swell);
        }
        // What holds for every yarn holds for this one in another form.
        if let Some(list) = file.get(EVERY_YARN) {
            let mut own = list.clone();
            own.0.iter_mut().for_each(swell);
            every.insert(name.clone(), own);
        }
    }
    vec![single, every]
}

fn swell(table: &mut OpticsTable) {
    if table.section.as_deref() == Some(BEFORE) {
        table.section = Some(AFTER.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::of_material;
    use organza_weave::Material;

    /// The section and the width of the highlight of the fibres of a yarn that is called cotton.
    fn optics(yarn: &str, optics: &str) -> (Option<String>, Option<f32>) {
        let yarns: BTreeMap<String, YarnSpec> =
            toml::from_str(&format!("[cotton]\n{yarn}\n[wool]\n")).unwrap();
        let files = finished(&toml::from_str(optics).unwrap(), &yarns);
        let of = |yarn: &str| {
            let material = Material {
                yarn: yarn.into(),
                fibre: None,
                colour: None,
                fibre_radius_mm: 0.008,
            };
            of_material(&files, &material)
        };
        let raw = of_material(
            &[toml::from_str(optics).unwrap()],
            &Material {
                yarn: "wool".into(),
                fibre: None,
                colour: None,
                fibre_radius_mm: 0.008,
            },
        );
        assert_eq!(of("wool").section, raw.section, "other yarns stay");
        let table = of("cotton");
        (table.section, table.longitudinal_deg)
    }

    #[test]
    fn mercerised_cotton_is_rounder() {
        let after = (Some(AFTER.to_owned()), Some(5.0));
        let lye = "finish = ['singed', 'mercerised']";
        for file in [
            "[cotton]\nsection = 'bean'\nlongitudinal_deg = 5.0\n",
            "['*']\nsection = 'bean'\nlongitudinal_deg = 5.0\n",
            "['*']\nsection = 'bean'\n[cotton]\nlongitudinal_deg = 5.0\n",
        ] {
            assert_eq!(optics(lye, file), after, "{file}");
            let before = (Some(BEFORE.to_owned()), Some(5.0));
            assert_eq!(optics("finish = 'calendered'", file), before, "{file}");
            assert_eq!(optics("", file), before, "{file}");
        }
    }

    #[test]
    fn other_sections_and_round_fibres_stay() {
        let lye = "finish = 'mercerised'";
        let ribbon = optics(
            lye,
            "['*']\nsection = 'bean'\n[cotton]\nsection = 'ribbon'\n",
        );
        assert_eq!(ribbon.0.as_deref(), Some("ribbon"));
        assert_eq!(optics(lye, "").0, None);
        let fitted = optics(lye, "['*']\nsection = 'bean'\n[cotton]\nfitted = 'silk'\n");
        assert_eq!(fitted.0, None);
    }
}
