//! The fabrics of the thesis and the files that describe surfaces.

use glam::Vec2;
use organza_surface::SurfaceSpec;
use organza_surface::spec::PRESETS;
use organza_surface::weave::{Tiling, Yarn};

#[test]
fn every_preset_is_complete_and_survives_a_round_trip() {
    for (name, text) in PRESETS {
        let spec = SurfaceSpec::from_toml(text).unwrap();
        let again = SurfaceSpec::from_toml(&toml::to_string(&spec).unwrap()).unwrap();
        assert_eq!(spec, again, "{name}");
        let p = spec.parameters().unwrap();
        assert!(p.warp.segment.beta > 0.0);
        // By name it is the same cloth.
        let by_name = SurfaceSpec::from_toml(&format!("preset = \"{name}\"")).unwrap();
        let q = by_name.parameters().unwrap();
        assert_eq!((p.weave, p.warp, p.weft), (q.weave, q.warp, q.weft));
    }
}

#[test]
fn published_values_stay_visible_where_the_model_cannot_take_them() {
    let weft = SurfaceSpec::preset("cotton-twill").unwrap().weft;
    assert_eq!(weft.u_max_deg, Some(36.0));
}

#[test]
fn what_is_given_replaces_the_preset() {
    let spec = SurfaceSpec::from_toml(
        "preset = \"denim\"\n[warp]\nu_max_deg = 20.0\n[transmission]\nwarp_cover = 0.9\n",
    )
    .unwrap();
    let p = spec.parameters().unwrap();
    assert!((p.warp.segment.u_max_rad.to_degrees() - 20.0).abs() < 4.0 * f64::EPSILON);
    assert!((p.weft.segment.u_max_rad.to_degrees() - 38.0).abs() < 4.0 * f64::EPSILON);
    assert!(p.transmission.is_some());
}

#[test]
fn mistakes_are_named() {
    let build = |text: &str| {
        SurfaceSpec::from_toml(text)
            .and_then(SurfaceSpec::build)
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    for (text, expected) in [
        ("preset = \"denin\"", "did you mean \"denim\"?"),
        ("presett = \"denim\"", "unknown field `presett`"),
        (
            "preset = \"denim\"\n[warp]\nu_max = 3.0",
            "unknown field `u_max`",
        ),
        (
            "preset = \"denim\"\n[warp]\nu_max_deg = 95.0",
            "warp.u_max_deg = 95",
        ),
        ("preset = \"denim\"\n[warp]\nalpha = \"a\"", "line 3"),
        ("preset = \"denim\"\naccuracy = 0.0", "accuracy = 0"),
        (
            "preset = \"denim\"\n[weft]\nspecular = [2.0, 0.0, 0.0]",
            "weft.specular = 2",
        ),
        ("[warp]\npsi_deg = 0.0", "weave is missing"),
        (
            "preset = \"denim\"\n[noise]\ngrain_mm = -1.0",
            "grain_mm = -1",
        ),
        (
            "preset = \"denim\"\n[transmission]\nweft_cover = 1.5",
            "transmission.weft_cover = 1.5",
        ),
        (
            "preset = \"cotton-twill\"\n[weft]\nfit = \"refuse\"",
            "does not fit a segment",
        ),
    ] {
        let message = build(text);
        assert!(message.contains(expected), "{text}: {message}");
    }
}

#[test]
fn tiles_are_those_that_renderers_ship() {
    let json: serde_json::Value =
        serde_json::from_str(include_str!("data/irawan_tiles.json")).unwrap();
    for (name, _) in PRESETS {
        let weave = &json[name];
        let number = |v: &serde_json::Value| v.as_f64().unwrap();
        let tile = [number(&weave["tile"][0]), number(&weave["tile"][1])];
        let ours = Tiling::new(SurfaceSpec::preset(name).unwrap().weave.as_ref().unwrap()).unwrap();
        let cell = ours.period_mm().x / tile[0] as f32;
        let off = (ours.period_mm().y / tile[1] as f32 - cell).abs();
        assert!(off < 4.0 * f32::EPSILON, "{name}");
        // Same rectangles, same share of warp: the tiles agree up to where the
        // repeat is begun.
        let mut expected: Vec<(bool, f32, f32)> = Vec::new();
        for s in ours.segments() {
            let size = ((s.width_mm / cell).round(), (s.length_mm / cell).round());
            expected.push((s.yarn == Yarn::Warp, size.0, size.1));
        }
        expected.dedup();
        for y in weave["rectangles"].as_array().unwrap() {
            let size = (number(&y[1]) as f32, number(&y[2]) as f32);
            let warp = y[0] == "warp";
            assert!(expected.contains(&(warp, size.0, size.1)), "{name} {y}");
        }
        let pattern: Vec<&[u8]> = (weave["rows"].as_array().unwrap().iter())
            .map(|row| row.as_str().unwrap().as_bytes())
            .collect();
        let (columns, rows) = (tile[0] as usize, tile[1] as usize);
        let theirs = |i: usize, j: usize| pattern[rows - 1 - j % rows][i % columns] == b'w';
        let mine = |i: usize, j: usize| {
            let at = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) * cell;
            ours.segments()[ours.locate(at).segment].yarn == Yarn::Warp
        };
        let agree = (0..columns).any(|dx| {
            (0..rows).any(|dy| {
                (0..columns).all(|i| (0..rows).all(|j| mine(i, j) == theirs(i + dx, j + dy)))
            })
        });
        assert!(agree, "{name}: no shift makes the tiles agree");
    }
}
