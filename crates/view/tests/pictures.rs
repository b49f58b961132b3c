//! What is rendered: coarse first, then as `organza render` has it, and no longer than it is
//! wanted.

use crate::client::Served;
use organza_picture::{Attributes, Rendered, png};
use organza_scene::loader::Loader;
use organza_transport::{EngineChoice, RenderSettings, Rendering, engine};
use organza_view::Phase;
use serde_json::json;
use std::time::{Duration, Instant};

/// The picture of a scene of the folder, without the page.
fn expected(served: &Served, name: &str) -> Vec<u8> {
    let loader = Loader::new();
    let loaded = organza_scene::load(&served.path(name), &[], &loader).unwrap();
    let scene = loaded.build(None, &loader).unwrap();
    let table = &loaded.file.render;
    let settings = RenderSettings {
        integrator: table.integrator.into(),
        samples: 0..u64::from(table.spp),
        max_bounces: table.max_bounces.unwrap_or(u32::MAX),
        seed: table.seed,
        crop: None,
    };
    let engine = engine(&scene, &settings, EngineChoice::Fastest, u64::MAX).unwrap();
    let rendering = Rendering::new(&scene, settings)
        .unwrap()
        .with_engine(engine);
    let flow = |_| std::ops::ControlFlow::Continue(());
    let rendering = rendering.take(u64::MAX, &flow).unwrap();
    let mut out = std::io::Cursor::new(Vec::new());
    let attributes = Attributes::default();
    let rendered = Rendered::new(rendering.film(), table.display(), &attributes);
    (png::FORMAT.writer.unwrap())(&rendered, &mut out).unwrap();
    out.into_inner()
}

#[test]
fn the_finished_picture_is_that_of_a_render_after_any_changes() {
    let served = Served::of("scene.toml", true);
    served.news_that(|news| news.phase == Phase::Done);
    let picture = served.get("picture.png");
    assert_eq!(picture.status, 200);
    assert!(
        picture.body == expected(&served, "scene.toml"),
        "the first picture"
    );
    // Camera, light and levels change in matter that is kept.
    let revision = served.edit(json!([
        { "op": "scene", "key": ["camera", "origin_mm"], "value": [1.0, 0.5, 3.0] },
        { "op": "scene", "key": ["light", "1", "radiance"], "value": [0.5, 0.4, 0.3] },
        { "op": "scene", "key": ["object", "0", "lod"], "value": "auto" },
    ]));
    served.news_that(|n| n.phase == Phase::Done && n.picture_revision == revision);
    let revision = served.edit(json!([
        { "op": "scene", "key": ["camera", "width_mm"], "value": 30.0 },
    ]));
    let news = served.news_that(|n| n.phase == Phase::Done && n.picture_revision == revision);
    assert_eq!(
        (news.cost.samples, news.size, news.coarseness),
        (6, [40, 30], 1)
    );
    let saved = served.post("save", &json!({ "name": "again" }));
    assert_eq!(saved.status, 200, "{saved:?}");
    let picture = served.get("picture.png").body;
    assert!(picture == expected(&served, "again.toml"), "after changes");
    assert!(picture == std::fs::read(served.path("again.png")).unwrap());
    // Known bad: another seed gives another picture.
    let text = std::fs::read_to_string(served.path("again.toml")).unwrap();
    std::fs::write(
        served.path("other.toml"),
        text.replace("seed = 3", "seed = 4"),
    )
    .unwrap();
    assert!(picture != expected(&served, "other.toml"));
}

#[test]
fn a_change_shows_a_coarse_picture_first_and_stops_the_old_one_at_once() {
    let served = Served::of("scene.toml", true);
    // More samples than a test could wait for.
    let revision = served.edit(json!([
        { "op": "scene", "key": ["render", "spp"], "value": 65_536 },
        { "op": "scene", "key": ["camera", "resolution"], "value": [800, 600] },
    ]));
    let mut shown = served.news_that(|n| n.picture_revision == revision);
    for width in 1..5u64 {
        let began = Instant::now();
        let revision = served.edit(json!([
            { "op": "scene", "key": ["camera", "width_mm"], "value": width },
        ]));
        shown = served.news_that(|n| n.picture_revision == revision);
        let took = began.elapsed();
        // All samples of the old one take hours.
        assert!(took < Duration::from_secs(20), "{took:?}");
    }
    let full =
        served.news_that(|n| n.coarseness == 1 && n.picture_revision == shown.picture_revision);
    let coarse_or_later = full.picture > shown.picture || shown.cost.samples > 0;
    assert!(coarse_or_later, "{shown:?}, then {full:?}");
    let refined = served.news_that(|n| n.coarseness == 1 && n.cost.samples >= 2);
    assert!(refined.cost.noise.is_some_and(|noise| noise > 0.0));
    assert!(refined.cost.seconds_to_5_percent.is_some_and(|s| s > 0.0));
    let later = served.news_that(|n| n.cost.samples > refined.cost.samples);
    assert!(later.picture > refined.picture && later.phase == Phase::Rendering);
}

#[test]
fn what_cannot_be_shown_is_told_and_undone() {
    let served = Served::of("scene.toml", true);
    served.news_that(|news| news.phase == Phase::Done);
    let revision = served.edit(json!([
        { "op": "fabric", "fabric": 0, "key": ["warp", "per_cm"], "value": 900 },
    ]));
    let news = served.news_that(|n| n.revision == revision && n.phase == Phase::Failed);
    let why = news.error.unwrap();
    assert!(
        why.starts_with("fabric.toml: the fabric is jammed"),
        "{why}"
    );
    assert_eq!(news.picture_revision, 1, "the last good picture stays");
    assert_eq!(served.get("picture.png").status, 200);
    let refused = served.post("save", &json!({ "name": "jammed" }));
    assert!(refused.error().contains("no picture"), "{refused:?}");
    let revision = served.post("undo", &json!({})).json()["revision"]
        .as_u64()
        .unwrap();
    let news = served.news_that(|n| n.phase == Phase::Done && n.picture_revision == revision);
    assert!(news.error.is_none());
    let figures = &news.figures[0];
    assert!(
        (figures["warp"]["threads_per_cm"].as_f64().unwrap() - 20.0).abs()
            < 4.0 * f64::from(f32::EPSILON),
        "{figures}"
    );
}

#[test]
fn drafts_and_fabrics_open_in_a_scene_of_their_own() {
    for file in ["plain.wif", "fabric.toml"] {
        let served = Served::of(file, true);
        served.edit(json!([
            { "op": "scene", "key": ["camera", "resolution"], "value": [48, 36] },
            { "op": "scene", "key": ["render", "spp"], "value": 2 },
        ]));
        let news = served.news_that(|n| n.phase == Phase::Done && n.picture_revision == 2);
        assert!(news.error.is_none(), "{news:?}");
        assert_eq!(news.shown.len(), 1, "{news:?}");
    }
}
