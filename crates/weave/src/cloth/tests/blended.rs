//! Yarns of several materials: shares, mass, and the place of single fibres.

use super::*;
use crate::blend::mass_shares;
use crate::protruding::Beside;
use std::f64::consts::PI;

/// A plain weave of one yarn, given as keys of `[yarn.blend]`.
fn cloth(keys: &str) -> Cloth {
    build(&geometry(keys))
}

fn geometry(keys: &str) -> FabricGeometry {
    parsed(&format!(
        "[draft]\nweave = \"plain\"\n[warp]\nyarn = \"blend\"\nper_cm = 10\n[weft]\nyarn = \
         \"blend\"\nper_cm = 9\n[tile]\nrepeats = [4, 4]\n[yarn.blend]\n{keys}\n"
    ))
}

/// Length, volume and mass of the fibres of each material, from the segments: millimetres, cubic
/// millimetres, milligrams.
fn sums(cloth: &Cloth) -> Vec<[f64; 3]> {
    let yarn = &cloth.yarns()[0];
    let mut sums = vec![[0.0; 3]; cloth.materials().len()];
    for s in segments(cloth) {
        let length = f64::from(s.length_mm());
        let [a, b] = [s.start_radius_mm, s.end_radius_mm].map(f64::from);
        let volume = length * PI * 0.5 * (a * a + b * b);
        let material = &cloth.materials()[usize::from(s.material)];
        let part = yarn.blend.iter().find(|p| p.fibre == material.fibre);
        let density = part.unwrap().fibre_density_g_per_cm3;
        let sum = &mut sums[usize::from(s.material)];
        for (sum, more) in sum.iter_mut().zip([length, volume, volume * density]) {
            *sum += more;
        }
    }
    sums
}

const WOOL_AND_NYLON: &str = "preset = \"wool\"\ntex = 60\nblend = [\n\
    { mass_share = 70, fibre = \"wool\" },\n{ mass_share = 30, fibre = \"nylon\", \
    fibre_radius_um = 7.5 },\n]\n";

/// The fibres have the shares of the label by mass, `tex` is their mass per length of yarn, and
/// the figures of the cloth weigh what the fibres weigh.
#[test]
fn shares_and_mass_of_the_fibres_are_those_of_the_label() {
    let cloth = cloth(&format!("{WOOL_AND_NYLON}{NO_FUZZ}"));
    let yarn = &cloth.yarns()[0];
    assert!(yarn.blends_materials && yarn.blend.len() == 2);
    let by_mass = mass_shares(&yarn.blend);
    assert!((by_mass[0] - 0.7).abs() < 4.0 * f64::EPSILON, "{by_mass:?}");
    // Nylon is finer and lighter, so its fibres are more than a third by number.
    let by_number = 0.3 / (1.14 * 7.5 * 7.5) / (0.3 / (1.14 * 7.5 * 7.5) + 0.7 / (1.31 * 144.0));
    assert!((yarn.blend[1].share - by_number).abs() < 4.0 * f64::EPSILON);

    let sums = sums(&cloth);
    let names = cloth.materials().iter().map(|m| m.fibre.as_deref());
    assert!(names.eq([Some("wool"), Some("nylon")]));
    let total = |k: usize| sums.iter().map(|s| s[k]).sum::<f64>();
    // Each of 16 threads has its share of some 25 independent fibres, rounded up or down at
    // random: 0.5 / 25 a thread.
    let error = 4.0 * 0.5 / 25.0 / 16f64.sqrt();
    let nylon = sums[1][0] / total(0);
    assert!(
        (nylon - by_number).abs() < error,
        "{nylon} for {by_number}; seed 7"
    );
    let wool = sums[0][2] / total(2);
    assert!((wool - 0.7).abs() < error, "{wool}; seed 7");
    // The twin: shares by number taken for shares by mass.
    assert!((sums[0][0] / total(0) - 0.7).abs() > 2.0 * error);

    let figures = cloth.figures();
    let tex = 1e3 * total(2) / figures.yarn_length_mm;
    // Besides the shares, the number of fibres is rounded by the closure of the tile: 2 %.
    let mass_error = error + 0.02;
    assert!((tex / 60.0 - 1.0).abs() < mass_error, "{tex} tex for 60");
    assert!((yarn.tex() / 60.0 - 1.0).abs() < 0.01, "{}", yarn.tex());
    let area = figures.tile_mm[0] * figures.tile_mm[1];
    let weight = 1e3 * total(2) / area / figures.areal_density_g_per_m2;
    assert!((weight - 1.0).abs() < mass_error, "{weight}");
    // The twin: all of it wool.
    let all_wool = 1e3 * total(1) * 1.31 / figures.yarn_length_mm;
    assert!((all_wool / tex - 1.0).abs() > 0.03, "{all_wool} {tex}");
}

/// Single fibres have the radius of their material, and thick ones stay inside the ply.
#[test]
fn fibres_have_their_own_radii_and_stay_in_the_ply() {
    let cloth = cloth(&format!(
        "preset = \"cotton\"\ntex = 40\naspect = 1\n{NO_FUZZ}blend = [\n{{ share = 8, fibre = \
         \"cotton\" }},\n{{ share = 2, fibre = \"coarse\", fibre_radius_um = 22, \
         fibre_density_g_per_cm3 = 1.2 }},\n]"
    ));
    let radius_mm = [0.008f32, 0.022];
    let mut seen = [0, 0];
    for_each_strand(&cloth, |_, strand| {
        let ply_mm = strand.yarn.ply_radius_mm;
        let flatten = strand.section.at(0.0);
        let mut beside = Beside { strand, nearest: 0 };
        let mut fibre = None;
        strand.emit_fibres(&mut |s| {
            let part = usize::from(s.material);
            assert_eq!(s.start_radius_mm, radius_mm[part]);
            seen[part] += 1;
            let at = s.start_mm.as_dvec3();
            if fibre.replace(s.fibre) != Some(s.fibre) {
                beside.search(at);
            }
            let radii = beside.follow(at).1;
            // The section is flattened, fibres are not.
            let beyond = radii + f64::from(radius_mm[part]) / (ply_mm * flatten.max_element());
            // Between the sections in which they are pushed apart fibres lie a little farther out;
            // at the place of a thin fibre coarse ones would be 1.08 radii out.
            assert!(beyond < 1.05, "{beyond} radii out");
        });
    });
    assert!(seen.iter().all(|&n| n > 1000), "{seen:?}");
}

/// Hairs and protruding fibres are of the same materials.
#[test]
fn hairs_are_of_the_materials_too() {
    let protruding =
        "hairiness = { index = 8.0, length_mm = 0.7, reach_mm = 0.25, curl_mm = 0.4 }\n";
    for fuzz in ["", protruding] {
        let cloth = cloth(&format!("{WOOL_AND_NYLON}{fuzz}"));
        let share = cloth.yarns()[0].blend[1].share;
        let (mut hairs, mut nylon) = (0.0, 0.0);
        for_each_strand(&cloth, |_, strand| {
            let mut last = None;
            strand.emit_hairs(0, &mut |s| {
                if last.replace(s.fibre) != Some(s.fibre) {
                    hairs += 1.0;
                    nylon += f64::from(s.material);
                }
            });
        });
        let error = 4.0 * (share * (1.0 - share) / hairs).sqrt();
        assert!(
            hairs > 100.0 && (nylon / hairs - share).abs() < error,
            "{nylon} of {hairs}"
        );
    }
}

/// A heather of dyed and undyed wool differs by colour alone: one material of fibre.
#[test]
fn a_heather_of_one_material_has_the_fibres_of_its_yarn() {
    let heather = "preset = \"wool\"\ntex = 60\nblend = [{ share = 3 }, { share = 1, colour = \
                   [0.1, 0.2, 0.3] }]\n";
    let cloth = cloth(heather);
    assert!(!cloth.yarns()[0].blends_materials);
    assert_eq!(cloth.plies().unfit(), None);
    assert!(cloth.materials().iter().all(|m| m.fibre.is_none()));
    let plain = self::cloth("preset = \"wool\"\ntex = 60\n");
    let ends = |cloth: &Cloth| -> Vec<(Vec3, f32)> {
        let all = segments_of(cloth, [0]).into_iter();
        all.map(|s| (s.start_mm, s.start_radius_mm)).collect()
    };
    assert_eq!(ends(&cloth), ends(&plain));
    // A material of its own makes it a blend of materials.
    let named = heather.replace("{ share = 3 }", "{ share = 3, fibre = \"wool\" }");
    let named = self::cloth(&named);
    assert!(named.yarns()[0].blends_materials);
    assert_eq!(named.plies().unfit(), Some("blends of fibre materials"));
}

#[test]
fn felt_of_several_materials_has_their_shares() {
    let text = "[nonwoven]\nfibre = \"felt\"\nareal_density_g_per_m2 = 120\nthickness_mm = 1.0\n\
                tile_mm = [2.5, 2.5]\nlength_mm = 12\n[yarn.felt]\npreset = \"wool\"\nblend = [\n{ \
                mass_share = 60, fibre = \"wool\" },\n{ mass_share = 40, fibre = \"polyester\" },\n]\n";
    let felt = Cloth::build(&parsed(text), &no_files, 3).unwrap();
    let sums = sums(&felt);
    let wool = sums[0][2] / (sums[0][2] + sums[1][2]);
    // The number of each is rounded up or down, of all fibres of the tile.
    let fibres = felt.threads.len() as f64;
    assert!(
        fibres > 50.0 && (wool - 0.6).abs() < 2.0 / fibres + 0.01,
        "{wool} {fibres}"
    );
    let radii = felt.materials().iter().map(|m| m.fibre_radius_mm);
    assert!(radii.eq([0.012, 0.0065]));
}

const WRONG: &str = r#"
{ share = 1, fibre = "nilon" } | yarn.blend.blend[0].fibre: no fibre is named "nilon"; did you mean "nylon"?
{ colour = [0, 0, 0] } | blend[0].share: is missing
{ share = 1 }, { mass_share = 1 } | blend[1].mass_share: give share in all parts or mass_share in all parts
{ share = 1, fibre_radius_um = 0 } | blend[0].fibre_radius_um: expected a number from 0.1 to 10000, found 0
{ share = 1, fibre_density_g_per_cm3 = 40 } | blend[0].fibre_density_g_per_cm3: expected a number from 0.1 to 30
{ share = 1, fibre_radius_cv_percent = 51 } | blend[0].fibre_radius_cv_percent: expected a number from 0 to 50
{ share = 1, colour = [0, 2, 0] } | blend[0].colour: expected
"#;

#[test]
fn wrong_blends_name_their_key() {
    for [blend, expected] in table_rows(WRONG) {
        let error = refusal(&geometry(&format!("blend = [{blend}]")));
        assert_contains(&error, expected);
    }
}
