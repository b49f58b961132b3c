//! Two surface models compared in process: figures, tables and the page.

use glam::{UVec2, Vec2};
use organza_basis::unwatched;
use organza_measure::{Effort, MeasureError, SurfacePatch, TexelGrid, irawan_layout};
use organza_report::ReportError;
use organza_report::comparison::{Comparison, ComparisonPlan, Measurement, judge};
use organza_surface::SurfaceSpec;
use std::ops::ControlFlow;

fn measured(plan: &ComparisonPlan, name: &str) -> Measurement {
    let model = SurfaceSpec::preset(name).unwrap().build().unwrap();
    plan.measure(name, &SurfacePatch(model), &unwatched)
        .unwrap()
}

fn plan() -> ComparisonPlan {
    ComparisonPlan {
        layout: irawan_layout(),
        effort: Effort::new(2, 1),
        grid: TexelGrid {
            low_mm: Vec2::ZERO,
            size_mm: Vec2::ONE,
            texels: UVec2::splat(16),
        },
        texel_paths: 2,
    }
}

fn comparison() -> Comparison {
    let plan = plan();
    let measured = vec![measured(&plan, "denim"), measured(&plan, "cotton-twill")];
    Comparison {
        name: "<b> & co".into(),
        command: "organza compare".into(),
        judged: judge(&measured, 1),
        measured,
        limit: 0.15,
    }
}

#[test]
fn every_pair_is_in_the_table_and_the_figures() {
    let comparison = comparison();
    let csv = comparison.pairs_csv().unwrap();
    let of_each = comparison.measured[0].layout.len() + comparison.measured[0].in_plane.len();
    assert_eq!(csv.lines().count(), 1 + 2 * of_each);
    let header = "model,theta_i,phi_i,theta_o,phi_o,r,g,b,se_r,se_g,se_b\n";
    assert!(csv.starts_with(header), "{}", &csv[..80]);
    let json = comparison.json();
    assert_eq!(json["reference"], "denim");
    assert_eq!(
        json["measured"][1]["layout"].as_array().unwrap().len(),
        1575
    );
    let flip = json["differences"][0]["flip"].as_array().unwrap();
    assert_eq!(flip.len(), json["lights"].as_array().unwrap().len());
    // The twin: against itself a model has no error.
    let again = [&comparison.measured[0]; 2].map(|m| Measurement::of_data("x", m.layout.clone()));
    assert_eq!(judge(&again, 1)[0].layout.median.value, 0.0);
    assert!(comparison.judged[0].layout.median.value > 0.05, "seed 1");
}

#[test]
fn the_page_stands_alone_and_shows_everything() {
    let page = comparison().html().unwrap();
    for part in [
        "<title>&#60;b&#62; &#38; co</title>",
        "The cloth itself",
        "Hemispheres",
        "In the planes of weft and warp",
        "Where the light goes",
        "cosine-weighted RMSE",
        "prefers-color-scheme: dark",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for link in ["http", "<script", "<link", "url("] {
        assert!(!page.contains(link), "{link}");
    }
    // Two hemispheres, four planes, one plot of shares; three pictures of each model
    // and three of their difference.
    assert_eq!(page.matches("<svg").count(), 7);
    assert_eq!(page.matches("<img").count(), 9);
}

#[test]
fn a_stop_ends_the_measurement() {
    let model = SurfaceSpec::preset("denim").unwrap().build().unwrap();
    let stop = |_| ControlFlow::Break(());
    let stopped = plan().measure("denim", &SurfacePatch(model), &stop);
    let stopped = stopped.map(drop).unwrap_err();
    assert!(matches!(
        stopped,
        ReportError::Measure(MeasureError::Stopped(_))
    ));
}
