//! Changes, undo, dropped drafts and saving.

use crate::client::{DRAFT, FABRIC, SCENE, Served};
use organza_testing::table_rows;
use organza_view::Phase;
use serde_json::{Value, json};

fn scene(key: &[&str], value: Value) -> Value {
    json!([{ "op": "scene", "key": key, "value": value }])
}

fn fabric(key: &[&str], value: Value) -> Value {
    json!([{ "op": "fabric", "fabric": 0, "key": key, "value": value }])
}

#[test]
fn values_change_and_comments_stay() {
    let served = Served::new();
    served.edit(scene(
        &["light", "0", "irradiance"],
        json!([1.0, 0.5, 0.25]),
    ));
    served.edit(scene(&["render", "exposure"], json!(1)));
    served.edit(scene(&["camera", "resolution"], json!([64, 48])));
    served.edit(fabric(&["warp", "per_cm"], json!(25.5)));
    served.edit(fabric(&["warp", "colours"], json!([[0.1, 0.2, 0.3]])));
    served.edit(fabric(&["weft", "colours"], json!("B/24 R4 K24 Y/4")));
    served.edit(fabric(&["yarn", "cotton", "plies"], json!(2)));
    served.edit(fabric(
        &["yarn", "cotton", "twist", "direction"],
        json!("S"),
    ));
    let (document, _, [undo, redo]) = served.session.document();
    assert_eq!((undo, redo), (8, 0));
    let scene = document.scene.to_string();
    for line in [
        "# A small scene.",
        "irradiance = [1.0, 0.5, 0.25] # a lamp",
        "exposure = 1.0",
        "resolution = [64, 48]",
    ] {
        assert!(scene.contains(line), "{line}: {scene}");
    }
    let fabric = document.fabrics[0].text.to_string();
    for line in [
        "# A cloth of few voxels.",
        "weave = \"plain\" # over and under",
        "per_cm = 25.5",
        "colours = [[0.1, 0.2, 0.3]]",
        "colours = \"B/24 R4 K24 Y/4\"",
        "plies = 2",
        "[yarn.cotton.twist]\ndirection = \"S\"",
    ] {
        assert!(fabric.contains(line), "{line}: {fabric}");
    }
    for _ in 0..9 {
        served.post("undo", &json!({}));
    }
    let (document, _, [undo, redo]) = served.session.document();
    assert_eq!((undo, redo), (0, 8));
    assert_eq!(document.scene.to_string(), SCENE);
    assert_eq!(document.fabrics[0].text.to_string(), FABRIC);
    served.post("redo", &json!({}));
    let (document, _, steps) = served.session.document();
    assert_eq!(steps, [1, 7]);
    assert!(document.scene.to_string().contains("[1.0, 0.5, 0.25]"));
}

#[test]
fn yarns_are_finished_and_cloth_gets_pile_and_print() {
    let served = Served::new();
    std::fs::write(served.path("rose.png"), "").unwrap();
    let text = || served.session.document().0.fabrics[0].text.to_string();
    let irregularity = ["yarn", "cotton", "irregularity"];
    let finish = ["yarn", "cotton", "finish"];
    served.edit(fabric(&irregularity, json!("ring-spun cotton")));
    served.edit(fabric(&finish, json!(["singed", "mercerised"])));
    assert!(text().contains("irregularity = \"ring-spun cotton\""));
    assert!(text().contains("finish = [\"singed\", \"mercerised\"]"));
    served.edit(fabric(&irregularity, Value::Null));
    served.edit(fabric(&finish, Value::Null));
    assert_eq!(text(), FABRIC);

    let pile = |kind: &str| json!([{ "op": "pile", "fabric": 0, "kind": kind }]);
    served.edit(pile("wale"));
    served.edit(fabric(&["pile", "height_mm"], json!(0.8)));
    assert!(text().contains("wales_per_cm"), "{}", text());
    served.edit(pile("cut"));
    let found = text();
    assert!(!found.contains("wales_per_cm"), "{found}");
    for line in ["kind = \"cut\"", "yarn = \"cotton\"", "height_mm = 0.8"] {
        assert!(found.contains(line), "{line}: {found}");
    }
    served.edit(pile(""));
    assert_eq!(text(), FABRIC);

    let print = |image: &str| json!([{ "op": "print", "fabric": 0, "image": image }]);
    served.edit(print("rose.png"));
    served.edit(fabric(&["print", "side"], json!("both")));
    served.edit(fabric(&["print", "size_mm"], json!([5, 5])));
    served.edit(fabric(&["print", "size_mm"], Value::Null));
    assert!(text().ends_with("[print]\nimage = \"rose.png\"\nside = \"both\"\n"));
    served.edit(print(""));
    assert_eq!(text(), FABRIC);

    let revision = served.session.revision();
    for (edits, words) in [
        (pile("shag"), "pile.kind: expected one of cut, loop, wale"),
        (fabric(&finish, json!(["ironed"])), "a list of mercerised"),
        (
            fabric(&finish, json!(vec!["singed"; 9])),
            "a list of mercerised",
        ),
        (fabric(&["yarn", "cotton", "tex"], Value::Null), "a number"),
        // A pile needs its kind, a print its image.
        (fabric(&["pile", "height_mm"], json!(1)), "kind"),
        (print("lily.png"), "there is no such picture"),
        (print("../secret.txt"), "expected a picture"),
        (print("../secret.png"), "there is no such picture"),
        (
            fabric(&["print", "image"], json!("/etc/passwd")),
            "cannot be set from the page",
        ),
    ] {
        let message = served.refused(edits.clone());
        assert!(message.contains(words), "{edits}: {message}");
    }
    assert_eq!(served.session.revision(), revision);
}

#[test]
fn the_exposure_in_use_gives_the_same_picture() {
    let served = Served::of("scene.toml", true);
    let finished = |exposure: Value| {
        served.edit(scene(&["render", "exposure"], exposure));
        let revision = served.session.revision();
        let news = served.news_that(|n| n.phase == Phase::Done && n.picture_revision == revision);
        let picture = served.request("GET", "picture.png", "", b"");
        assert_eq!(picture.status, 200);
        (news.exposure_stops, picture.body)
    };
    let (stops, automatic) = finished(json!("auto"));
    let stops = stops.unwrap();
    assert_eq!(finished(json!(stops)), (None, automatic.clone()));
    assert_ne!(finished(json!(stops + 0.5)).1, automatic);
}

#[test]
fn moves_of_the_camera_are_no_steps() {
    let served = Served::new();
    served.edit(scene(
        &["camera", "origin_mm"],
        json!([0.1, 0.2, 7.123456789012]),
    ));
    let (document, revision, steps) = served.session.document();
    assert_eq!((revision, steps), (2, [0, 0]));
    assert!(
        document
            .scene
            .to_string()
            .contains("[0.1, 0.2, 7.123456789]")
    );
}

#[test]
fn other_representations_drop_the_keys_of_the_old_one() {
    let served = Served::new();
    let model = |model: &str| json!([{ "op": "model", "object": 0, "model": model }]);
    served.edit(model("auto"));
    served.edit(scene(&["object", "0", "tolerance"], json!(0.2)));
    let text = served.session.document().0.scene.to_string();
    assert!(
        text.contains("model = \"auto\"") && !text.contains("lod"),
        "{text}"
    );
    served.edit(model("fibres"));
    let text = served.session.document().0.scene.to_string();
    assert!(!text.contains("tolerance"), "{text}");
    let message = served.refused(model("fibre"));
    assert!(message.contains("expected auto, fibres"), "{message}");
}

/// A change of the scene or the fabric, its key, the value, and a part of the message. Keys that name
/// files are out of reach.
const WRONG: &str = r#"
scene | render.spp | 0 | render.spp: expected a whole number from 1
scene | render.spp | 1.5 | render.spp: expected a whole number
scene | render.exposure | 300 | render.exposure: expected a number from
scene | render.exposure | "bright" | render.exposure: expected a number
scene | camera.fov_deg | 20 | camera: fov_deg belongs to kind
scene | camera.up | [0, 0, 0] | camera: up is zero
scene | camera.resolution | [9000, 9000] | from 1 to 4096
scene | light.7.radiance | [1, 1, 1] | there is no [[light]] number 7
scene | light.0.direction | [1, 2] | expected a list of 3 numbers
scene | object.0.fabric | "/etc/passwd" | cannot be set from the page
scene | object.0.mesh | "/etc/passwd" | cannot be set from the page
scene | light.1.file | "/etc/passwd" | cannot be set from the page
fabric | draft.wif | "/etc/passwd" | cannot be set from the page
fabric | draft.curves | "/etc/passwd" | cannot be set from the page
fabric | yarn.cotton | "x" | cannot be set from the page
fabric | yarn.cotton.preset | "tin" | expected one of cotton
fabric | warp.colours | [] | colours of three numbers
fabric | warp.colours | "8 red, 8 bleu" | there is no colour "bleu"; did you mean "blue"
"#;

#[test]
fn wrong_changes_are_refused_with_their_key_and_change_nothing() {
    let served = Served::new();
    let before = served.session.document().0;
    for [op, key, value, expected] in table_rows(WRONG) {
        let key: Vec<&str> = key.split('.').collect();
        let value: Value = serde_json::from_str(value).unwrap();
        let edits = match op {
            "scene" => scene(&key, value),
            _ => fabric(&key, value),
        };
        let message = served.refused(edits);
        assert!(message.contains(expected), "{key:?}: {message}");
    }
    for (edits, expected) in [
        (
            json!([{ "op": "draft", "fabric": 0, "draft": "twil-2-1" }]),
            "did you mean \"twill-",
        ),
        (
            json!([{ "op": "draft", "fabric": 5, "draft": "plain" }]),
            "fabric 5 does not exist",
        ),
        (
            json!([{ "op": "remove-light", "light": 2 }]),
            "light 2 does not exist",
        ),
        (
            json!([{ "op": "add-light", "kind": "neon" }]),
            "expected one of directional",
        ),
    ] {
        let message = served.refused(edits.clone());
        assert!(message.contains(expected), "{edits}: {message}");
    }
    // One that is wrong takes the others with it.
    let both = json!([
        { "op": "scene", "key": ["render", "seed"], "value": 9 },
        { "op": "scene", "key": ["render", "spp"], "value": -1 },
    ]);
    served.refused(both);
    let after = served.session.document();
    assert_eq!(after.0.scene.to_string(), before.scene.to_string());
    assert_eq!(after.1, 1);
}

#[test]
fn a_dropped_draft_shows_cloth_and_a_bad_one_a_message() {
    let served = Served::of("scene.toml", true);
    // The yarns of a bare draft are fine: their own voxels would take seconds to fill.
    served.edit(scene(&["object", "0", "voxel_um"], json!(100)));
    let drop = |name: &str, bytes: &[u8]| {
        let path = format!("draft?fabric=0&name={name}");
        served.request("POST", &path, "", bytes)
    };
    let answered = drop("two_by_two", DRAFT.as_bytes());
    assert_eq!(answered.status, 200, "{answered:?}");
    let revision = answered.json()["revision"].as_u64().unwrap();
    served.news_that(|n| n.phase == Phase::Done && n.picture_revision == revision);
    let bad = drop("cat", b"\x89PNG\r\n");
    assert_eq!(bad.status, 422);
    assert!(bad.error().starts_with("cat.wif: "), "{}", bad.error());
    let broken = DRAFT.replace("1=1\n2=2\n[LIFT", "1=1\n2=x\n[LIFT");
    let bad = drop("broken", broken.as_bytes());
    assert!(bad.error().contains("[THREADING] 2"), "{}", bad.error());
    assert_eq!(drop("a/../b", DRAFT.as_bytes()).status, 422);
    assert_eq!(
        served.session.revision(),
        revision,
        "bad drafts change nothing"
    );

    let saved = served.post("save", &json!({ "name": "from_draft" })).json();
    let names = [
        "from_draft.toml",
        "from_draft.wif",
        "from_draft_fabric.toml",
    ];
    let files = saved["files"].as_array().unwrap();
    for name in names {
        assert!(files.contains(&name.into()), "{saved}");
    }
    assert_eq!(
        std::fs::read(served.path("from_draft.wif")).unwrap(),
        DRAFT.as_bytes()
    );
    organza_view::open(&served.path("from_draft.toml"), &[]).unwrap();
}

#[test]
fn saved_files_open_again_and_replace_no_others() {
    let served = Served::of("fabric.toml", true);
    served.edit(json!([
        { "op": "scene", "key": ["camera", "resolution"], "value": [40, 30] },
        { "op": "scene", "key": ["render", "spp"], "value": 2 },
        { "op": "model", "object": 0, "model": "microflake" },
        { "op": "fabric", "fabric": 0, "key": ["warp", "colours"], "value": [[0.5, 0.1, 0.1]] },
    ]));
    let save = |name: &str| served.post("save", &json!({ "name": name }));
    let saved = save("red");
    assert_eq!(saved.status, 200, "{saved:?}");
    let expected = json!(["red.toml", "red_fabric.toml", "red.png", "red.exr"]);
    assert_eq!(saved.json()["files"], expected);
    let opened = organza_view::open(&served.path("red.toml"), &[]).unwrap();
    assert!(
        opened.fabrics[0]
            .text
            .to_string()
            .contains("[[0.5, 0.1, 0.1]]")
    );
    // Its own files are replaced, those of others are not.
    assert_eq!(save("red").status, 200);
    std::fs::write(served.path("mine.png"), "mine").unwrap();
    let refused = save("mine");
    assert_eq!(
        refused.error(),
        "mine.png is already there; choose another name"
    );
    assert_eq!(std::fs::read(served.path("mine.png")).unwrap(), b"mine");
    assert!(!served.path("mine.toml").exists());
    for name in ["../red", "a b", "", "a.toml", "-x", &"a".repeat(61)] {
        assert!(
            save(name).error().starts_with("the name: expected 1 to 60"),
            "{name}"
        );
    }
    let left = organza_testing::file_names(&served.folder);
    assert_eq!(left.len(), 8, "{left:?}");
}
