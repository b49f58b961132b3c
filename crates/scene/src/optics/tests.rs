//! Which table holds for which fibres, and mistakes in them.

use super::*;

fn read(text: &str) -> Result<OpticsFile, String> {
    toml::from_str(text).map_err(|e| e.message().to_owned())
}

fn material(yarn: &str, colour: Option<[f32; 3]>) -> Material {
    Material {
        yarn: yarn.into(),
        fibre: None,
        colour: colour.map(Rgb::from),
        fibre_radius_mm: 0.008,
    }
}

const RED: [f32; 3] = [0.8, 0.1, 0.1];

#[test]
fn tables_hold_for_all_for_a_yarn_and_for_a_colour() {
    let fabric = read(
        "['*']\ngamma = 0.3\nior = 1.4\n\
         [silk]\nsin_power = 90.0\n\
         [[wool]]\nlongitudinal_deg = 9.0\n\
         [[wool]]\nthread = [0.8, 0.1, 0.1]\nfitted = { preset = 'silk', colour_tt = [1.0, 0.0, 0.0] }\n",
    )
    .unwrap();
    let materials = [
        material("silk", None),
        material("wool", Some(RED)),
        material("wool", Some([0.1; 3])),
    ];
    check(&fabric, &materials, [].iter()).unwrap();
    let files = [fabric];
    let [silk, red, wool] = [0, 1, 2].map(|i| of_material(&files, &materials[i]));
    assert_eq!((silk.gamma, silk.sin_power), (None, Some(90.0)));
    assert_eq!((silk.ior, wool.ior, red.ior), (Some(1.4), Some(1.4), None));
    assert_eq!(wool.longitudinal_deg, Some(9.0));
    assert_eq!(red.longitudinal_deg, None, "gives way to `fitted`");
    assert!(wool.fitted.is_none() && red.fitted.is_some());
    assert_eq!(red.gamma, Some(0.3));
    let scene = read("['*']\nend_on_ratio = 0.5\n").unwrap();
    let both = [scene, files[0].clone()];
    assert_eq!(
        of_material(&both, &materials[0]).flakes(None).end_on_ratio,
        0.5
    );
}

#[test]
fn widths_of_all_families_mean_the_same_ratio() {
    for gamma in [0.01, 0.1, 0.5] {
        let table = OpticsTable {
            gamma: Some(gamma),
            ..Default::default()
        };
        let ratio = table.flakes(None).end_on_ratio;
        let back = GaussianBand::with_end_on_ratio(ratio).gamma();
        assert!(
            (back / gamma - 1.0).abs() < 4.0 * f32::EPSILON,
            "{gamma} {back}"
        );
    }
}

#[test]
fn mistakes_are_reported() {
    let silk = [material("silk", Some(RED))];
    for (text, words) in [
        (
            "[slik]\n",
            ".slik: no yarn of the cloth has this name; did you mean `silk`?",
        ),
        (
            "[silk]\ngamma = 0.0\n",
            ".silk.gamma: expected a number from 0.0001 to 10, found 0",
        ),
        (
            "[silk]\ngamma = 0.1\nsin_power = 3.0\n",
            ".silk.sin_power: sets the same property as `gamma`; give one of them",
        ),
        ("[silk]\nfitted = 'coton'\n", "did you mean `cotton`?"),
        (
            "[silk]\nsection = 'trilobel'\n",
            "ellipse:RATIO, found `trilobel`; did you mean `trilobal`?",
        ),
        (
            "[silk]\nfitted = { colour_r = [1.0, 1.0, 1.0] }\n",
            ".silk.fitted.colour_tt: is missing, and there is no `preset`",
        ),
        (
            "[silk]\nfitted = { preset = 'silk', colour_r = [2.0, 1.0, 1.0] }\n",
            ".silk.fitted: colour_r is 2, expected 0 to 1 in every channel",
        ),
        (
            "[silk.nir]\ncolour = 1.5\n",
            ".silk.nir.colour: expected a number from 0 to 1, found 1.5",
        ),
        (
            "[silk.solar]\n",
            ".silk.solar.colour: is missing, as is `albedo`",
        ),
        (
            "[[silk]]\nthread = [0.0, 0.0, 1.0]\n",
            ".silk.thread: no thread has this colour; there are [0.800, 0.100, 0.100]",
        ),
        (
            "[silk]\nfitted = 'silk'\nior = 1.5\n",
            ".silk.ior: does not go with `fitted`, which has its own",
        ),
    ] {
        let got = check(&read(text).unwrap(), &silk, [].iter()).unwrap_err();
        assert!(got.ends_with(words), "{got}");
    }
    let got = read("[silk]\ngama = 0.1\n").unwrap_err();
    assert!(got.starts_with("unknown field `gama`"), "{got}");
    let got = read("[silk]\nfitted = { colour_x = 1 }\n").unwrap_err();
    assert!(got.starts_with("unknown field `colour_x`"), "{got}");
}

#[test]
fn colours_and_albedos_invert_each_other() {
    for i in 0..=20 {
        let r = i as f32 / 20.0;
        let albedo = albedo_for_colour(Rgb::splat(r)).0.x;
        let back = colour_for_albedo(Rgb::splat(albedo)).0.x;
        assert!(
            (back - r).abs() < 16.0 * f32::EPSILON,
            "{r}: {albedo} gives {back}"
        );
    }
}

/// In a band fibres keep their widths and lose their colours; tables of a yarn go before those of
/// all.
#[test]
fn bands_have_their_own_brightness() {
    let file = read(
        "['*']\nior = 1.4\nnir = { colour = 0.5 }\n\
         [silk]\ncolour = [0.9, 0.1, 0.1]\nlongitudinal_deg = 9.0\n\
         [wool]\nfitted = 'silk'\nnir = { albedo = 0.9 }\n",
    )
    .unwrap();
    let materials = [material("silk", Some(RED)), material("wool", Some(RED))];
    check(&file, &materials, [].iter()).unwrap();
    let files = [file];
    let [silk, wool] = [0, 1].map(|i| of_material(&files, &materials[i]));
    assert_eq!(silk.clone().in_band(Band::Solar).colour, silk.colour);
    let seen = silk.in_band(Band::Nir);
    assert_eq!(seen.colour, Some([0.5; 3]));
    assert_eq!((seen.ior, seen.longitudinal_deg), (Some(1.4), Some(9.0)));
    assert_eq!(
        seen.flakes(Some(RED.into())).albedo,
        albedo_for_colour(Rgb::splat(0.5))
    );
    let seen = wool.in_band(Band::Nir);
    assert!(seen.fitted.is_none() && seen.albedo == Some([0.9; 3]));
    let heap = colour_for_albedo(Rgb::splat(0.9)).0.to_array();
    assert_eq!(seen.colour, Some(heap));
}
