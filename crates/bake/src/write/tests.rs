use super::*;
use crate::model::{OPENPBR, TARGETS};
use crate::texel::Texel;
use glam::{UVec2, Vec2, Vec3};

/// Maps of 8 x 4 texels: every second column a hole, every fourth partly one.
fn maps() -> Maps {
    let texel = |k: usize| Texel {
        coverage: [1.0, 0.0, 1.0, 0.5][k % 4],
        slope: Vec2::new(0.5, 0.0),
        across_rad: std::f32::consts::FRAC_PI_2,
        order: 0.8,
        reflected: Vec3::new(0.4, 0.2, 0.1),
        transmitted: Vec3::new(0.2, 0.1, 0.1),
        gloss: 0.5,
    };
    Maps {
        size: UVec2::new(8, 4),
        tile_mm: Vec2::new(2.0, 1.0),
        texels: (0..32).map(texel).collect(),
        height_mm: (0..32).map(|k| k as f32 * 0.01).collect(),
    }
}

/// The files of one cloth, or of two colourways.
fn files_of(names: &[&str]) -> FolderFiles {
    let start = |target: &crate::model::Target| {
        let place: Vec<f64> = target.bounds(Some(0.2)).iter().map(|b| b.start).collect();
        target.parameters(&place, Some(0.2))
    };
    let [gltf, openpbr, standard_surface, usd_preview] = TARGETS.map(start);
    let maps = maps();
    let folders: Vec<String> = match names {
        [_] => vec![FOLDER.to_owned()],
        _ => names.iter().map(|n| format!("{FOLDER}/{n}")).collect(),
    };
    let colourways: Vec<Baked<'_>> = names
        .iter()
        .zip(&folders)
        .map(|(name, folder)| Baked {
            name,
            folder,
            maps: &maps,
            gltf: &gltf,
            openpbr: &openpbr,
            standard_surface: &standard_surface,
            usd_preview: &usd_preview,
        })
        .collect();
    folder_files(&colourways).unwrap()
}

fn files() -> FolderFiles {
    files_of(&["cloth_1"])
}

fn file(name: &str) -> Vec<u8> {
    let (files, _) = files();
    files.into_iter().find(|(n, _)| n == name).unwrap().1
}

#[test]
fn the_glb_is_read_back_with_its_material_and_textures() {
    let glb = file("material.glb");
    let read = gltf::Gltf::from_slice(&glb).unwrap();
    let material = read.materials().next().unwrap();
    assert_eq!(material.name(), Some("cloth_1"));
    assert!(material.double_sided());
    assert_eq!(material.alpha_mode(), gltf::material::AlphaMode::Blend);
    let normal = material.normal_texture().unwrap();
    assert!((normal.scale() - 0.4).abs() < 4.0 * f32::EPSILON);
    // Every image is a PNG of the right size inside the file.
    let bin = read.blob.as_ref().unwrap();
    let mut count = 0;
    for image in read.images() {
        let gltf::image::Source::View { view, mime_type } = image.source() else {
            panic!("an image outside of the file");
        };
        assert_eq!(mime_type, "image/png");
        let bytes = &bin[view.offset()..view.offset() + view.length()];
        let picture = image::load_from_memory(bytes).unwrap();
        assert_eq!((picture.width(), picture.height()), (8, 4));
        count += 1;
    }
    // Roughness and the others are the same everywhere.
    assert_eq!(count, 2);
    let chunks = gltf::binary::Glb::from_slice(&glb).unwrap();
    let whole: serde_json::Value = serde_json::from_slice(&chunks.json).unwrap();
    let made = &whole["materials"][0]["extensions"];
    let close = |found: &serde_json::Value, value: f64| {
        (found.as_f64().unwrap() - value).abs() < 0.5 / 255.0 + 1e-6
    };
    assert!(close(
        &made["KHR_materials_specular"]["specularFactor"],
        0.25
    ));
    let anisotropy = &made["KHR_materials_anisotropy"];
    let turned = std::f64::consts::FRAC_PI_2;
    assert!((anisotropy["anisotropyRotation"].as_f64().unwrap() - turned).abs() < 0.01);
    // The base colour and its coverage; the angle across the fibres as a vector.
    let pixel = |index: usize, x: u32| {
        let gltf::image::Source::View { view, .. } = read.images().nth(index).unwrap().source()
        else {
            panic!("an image outside of the file");
        };
        let bytes = &bin[view.offset()..view.offset() + view.length()];
        image::load_from_memory(bytes)
            .unwrap()
            .to_rgba8()
            .get_pixel(x, 0)
            .0
    };
    assert_eq!((pixel(0, 0)[3], pixel(0, 1)[3]), (255, 0));
    // The square covers 50 x 100 repeats.
    let primitive = read.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(bin));
    let uv: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
    assert_eq!(uv[1], [1.0, 1.0]);
    for map in [
        &whole["materials"][0]["normalTexture"],
        &whole["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"],
    ] {
        let scale = &map["extensions"]["KHR_texture_transform"]["scale"];
        assert_eq!(*scale, serde_json::json!([50.0, 100.0]));
    }
}

#[test]
fn colourways_are_variants_of_one_cloth() {
    let (files, _) = files_of(&["navy", "wine"]);
    let bytes = |name: &str| &files.iter().find(|(n, _)| n == name).unwrap().1;
    let chunks = gltf::binary::Glb::from_slice(bytes("material.glb")).unwrap();
    let whole: serde_json::Value = serde_json::from_slice(&chunks.json).unwrap();
    assert_eq!(whole["materials"].as_array().unwrap().len(), 2);
    let variants = &whole["extensions"]["KHR_materials_variants"]["variants"];
    assert_eq!(
        *variants,
        serde_json::json!([{ "name": "navy" }, { "name": "wine" }])
    );
    let shown = &whole["meshes"][0]["primitives"][0];
    assert_eq!(shown["material"], 0);
    let second = &shown["extensions"]["KHR_materials_variants"]["mappings"][1];
    assert_eq!(
        *second,
        serde_json::json!({ "material": 1, "variants": [1] })
    );
    let read = gltf::Gltf::from_slice(bytes("material.glb")).unwrap();
    assert_eq!(read.materials().count(), 2);
    // Every file that is named is there, in both formats.
    let named = |text: &str, before: &str| {
        let rest = text.split(before).skip(1);
        let names: Vec<String> = rest
            .map(|r| format!("textures/{}", r.split(['"', '@']).next().unwrap()))
            .collect();
        assert!(!names.is_empty());
        for name in names {
            assert!(files.iter().any(|(n, _)| *n == name), "{name}");
        }
    };
    let text = |name: &str| String::from_utf8(bytes(name).clone()).unwrap();
    named(&text("material.mtlx"), "\"textures/");
    named(&text("material.usda"), "@./textures/");
    let usda = text("material.usda");
    assert!(
        usda.contains("rel material:binding = </navy/wine>"),
        "{usda}"
    );
    for name in ["navy_openpbr", "wine_openpbr", "wine_standard_surface"] {
        assert!(
            text("material.mtlx").contains(&format!("\"{name}\"")),
            "{name}"
        );
    }
}

#[test]
fn materialx_connects_every_input_to_what_is_there() {
    let text = String::from_utf8(file("material.mtlx")).unwrap();
    let (_, textures) = files();
    let names: Vec<&str> = text
        .split("name=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    let quoted = |key: &str| {
        let key = format!("{key}=\"");
        text.split(&key)
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    for target in quoted("nodename").iter().chain(&quoted("output")) {
        assert!(names.contains(&target.as_str()), "{target}");
    }
    for value in quoted("value").iter().filter(|v| v.ends_with(".png")) {
        assert!(textures.iter().any(|(name, _)| name == value), "{value}");
    }
    assert!(text.contains("cloth_1_openpbr") && text.contains("cloth_1_standard_surface"));
    // The text is well-formed XML: every element that is opened is closed.
    let mut reader = quick_xml::Reader::from_str(&text);
    let mut depth = 0;
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Start(_) => depth += 1,
            quick_xml::events::Event::End(_) => depth -= 1,
            quick_xml::events::Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(depth, 0);
}

#[test]
fn usda_names_its_textures_and_connects_prims_that_are_there() {
    let text = String::from_utf8(file("material.usda")).unwrap();
    let (_, textures) = files();
    for asset in text.split("@./").skip(1).step_by(1) {
        let asset = asset.split('@').next().unwrap();
        assert!(textures.iter().any(|(name, _)| name == asset), "{asset}");
    }
    let shaders: Vec<&str> = text
        .split("def Shader \"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    for target in text.split("</cloth_1/Material/").skip(1) {
        let shader = target.split('.').next().unwrap();
        assert!(shaders.contains(&shader), "{shader}");
    }
    assert_eq!(text.matches('{').count(), text.matches('}').count());
}

#[test]
fn textures_hold_what_was_measured() {
    let place: Vec<f64> = OPENPBR.bounds(None).iter().map(|b| b.start).collect();
    let p = OPENPBR.parameters(&place, None);
    let surface = OPENPBR.surface(&p, &maps().texels[0]);
    let pixel = |name: &str| {
        let picture = image::load_from_memory(&file(&format!("{FOLDER}/{name}"))).unwrap();
        picture.to_rgb8().get_pixel(0, 0).0
    };
    let near = |a: u8, b: f32| (f32::from(a) / 255.0 - b).abs() < 0.003;
    assert!(near(pixel("roughness.png")[0], surface.roughness));
    assert!(near(pixel("anisotropy.png")[0], 0.8));
    assert!(near(pixel("diffuse_transmission.png")[0], 0.2));
    assert!(near(pixel("anisotropy_rotation.png")[0], 0.75));
    let normal = pixel("normal.png");
    assert!(
        near(normal[0], 0.5 - 0.5 * 0.5 / 1.25f32.sqrt()),
        "{normal:?}"
    );
    let base = organza_basis::Rgb::linear_from_srgb(f32::from(pixel("base_color.png")[0]) / 255.0);
    assert!((base - 0.5).abs() < 0.005, "{base}");
    // 16 bits of height over its range: the last texel is the highest.
    let height = image::load_from_memory(&file("textures/height.png"))
        .unwrap()
        .to_luma16();
    assert_eq!(
        (height.get_pixel(0, 0).0, height.get_pixel(7, 3).0),
        ([0], [65535])
    );
}

/// Names of the chunks of a PNG, which says what its values are by some of them [PNG2025].
fn chunks(png: &[u8]) -> Vec<String> {
    let mut rest = &png[8..];
    let mut names = Vec::new();
    while let Some((head, after)) = rest.split_first_chunk::<8>() {
        names.push(String::from_utf8_lossy(&head[4..]).into_owned());
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        rest = &after[length + 4..];
    }
    names
}

#[test]
fn colours_are_marked_as_srgb_and_numbers_are_not_marked() {
    const OF_COLOUR: [&str; 6] = ["sRGB", "gAMA", "cHRM", "iCCP", "cICP", "mDCV"];
    let stated = |bytes: &[u8]| {
        let names = chunks(bytes).into_iter();
        names
            .filter(|name| OF_COLOUR.contains(&name.as_str()))
            .collect::<Vec<_>>()
    };
    let (files, textures) = files();
    assert_eq!(textures.len(), 12);
    let mut colours = 0;
    for (name, meaning) in &textures {
        let (_, bytes) = files.iter().find(|(file, _)| file == name).unwrap();
        assert_eq!(chunks(bytes).last().unwrap(), "IEND", "{name}");
        if meaning.contains("sRGB") {
            assert_eq!(stated(bytes), ["sRGB", "gAMA"], "{name}");
            colours += 1;
        } else {
            assert!(stated(bytes).is_empty(), "{name}: {:?}", stated(bytes));
        }
    }
    assert_eq!(colours, 3);
    // The materials say the same of the same files.
    let materialx = String::from_utf8(file("material.mtlx")).unwrap();
    assert_eq!(materialx.matches("srgb_texture").count(), 3);
    // A glTF material gives its images their meaning; they state nothing themselves.
    let glb = file("material.glb");
    let read = gltf::Gltf::from_slice(&glb).unwrap();
    let bin = read.blob.as_ref().unwrap();
    for image in read.images() {
        let gltf::image::Source::View { view, .. } = image.source() else {
            panic!("an image outside of the file");
        };
        let bytes = &bin[view.offset()..view.offset() + view.length()];
        assert!(stated(bytes).is_empty(), "{:?}", image.name());
    }
}

#[test]
fn names_are_those_that_all_formats_allow() {
    assert_eq!(plain_name("silk organza"), "silk_organza");
    assert_eq!(plain_name("3/1 twill"), "cloth_3_1_twill");
    assert_eq!(plain_name(""), "cloth_");
    assert_eq!(number(-0.0000001), "0");
    assert_eq!(number(1.5), "1.5");
}
