//! Protruding fibres that are followed in short steps.

use super::irregular::{ALL_KINDS, irregular};
use super::*;

/// Smooth hairs of a fine yarn turn gently from segment to segment; the twin, which follows the
/// curl alone, has kinks. Both have the length that was asked for.
#[test]
fn smooth_hairs_of_fine_yarns_have_no_kinks() {
    let turns = |smooth: bool| {
        let hairs = format!("curl_mm = 1, smooth = {smooth}");
        let keys = ALL_KINDS.replace("curl_mm = 0.4", &hairs);
        let cloth = build(&irregular(4, &format!("tex = 5\n{keys}")));
        let (mut turns, mut length_mm) = (Vec::new(), 0.0);
        for_each_strand(&cloth, |_, strand| {
            let mut last: Option<(u32, DVec3)> = None;
            strand.emit_hairs(0, &mut |s| {
                let along = (s.end_mm - s.start_mm).as_dvec3().normalize();
                length_mm += f64::from(s.length_mm());
                if let Some((fibre, before)) = last
                    && fibre == s.fibre
                {
                    turns.push(before.angle_between(along).to_degrees());
                }
                last = Some((s.fibre, along));
            });
        });
        turns.sort_by(f64::total_cmp);
        (turns[turns.len() * 99 / 100], length_mm)
    };
    let ((fine, fine_mm), (coarse, coarse_mm)) = (turns(true), turns(false));
    // An eighth of a radius at LEAD over the radius is 21 degrees; curl and faces add to it.
    assert!(fine < 35.0 && coarse > 60.0, "{fine} {coarse} degrees");
    assert!(
        (fine_mm / coarse_mm - 1.0).abs() < 0.2,
        "{fine_mm} {coarse_mm}"
    );
}
