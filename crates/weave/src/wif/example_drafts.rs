//! Drafts for tests: small files of the project's own in the dialects of several weaving
//! programs, and a generated damask of any size.

/// Name and bytes of every file of `drafts/`; see the README there.
pub const EXAMPLES: [(&str, &[u8]); 10] = [
    (
        "forgiving_liftplan",
        include_bytes!("drafts/forgiving_liftplan.wif"),
    ),
    (
        "liftplan_rising",
        include_bytes!("drafts/liftplan_rising.wif"),
    ),
    (
        "liftplan_sinking",
        include_bytes!("drafts/liftplan_sinking.wif"),
    ),
    (
        "parallel_ends_library",
        include_bytes!("drafts/parallel_ends_library.wif"),
    ),
    (
        "point_twill_library",
        include_bytes!("drafts/point_twill_library.wif"),
    ),
    (
        "private_sections_and_defaults",
        include_bytes!("drafts/private_sections_and_defaults.wif"),
    ),
    (
        "studio_latin_1",
        include_bytes!("drafts/studio_latin_1.wif"),
    ),
    (
        "treadles_rising",
        include_bytes!("drafts/treadles_rising.wif"),
    ),
    (
        "treadles_sinking",
        include_bytes!("drafts/treadles_sinking.wif"),
    ),
    (
        "warn_missing_spacing",
        include_bytes!("drafts/warn_missing_spacing.wif"),
    ),
];

/// A block damask of `size` ends and picks on eight shafts: 3/1 twill against 1/3 twill in
/// blocks of 12 threads whose order does not repeat within 17 blocks.
pub fn damask(size: usize) -> String {
    use std::fmt::Write;
    let in_figure = |thread: usize| [0, 3, 4, 8, 10, 11, 15].contains(&(thread / 12 % 17));
    let mut text = format!(
        "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=8\nTreadles=8\nRising Shed=true\n\
         [WARP]\nThreads={size}\n[WEFT]\nThreads={size}\n[THREADING]\n"
    );
    for end in 0..size {
        let block = if in_figure(end) { 4 } else { 0 };
        let _ = writeln!(text, "{}={}", end + 1, 1 + block + end % 4);
    }
    text.push_str("[LIFTPLAN]\n");
    for pick in 0..size {
        // One shaft of the ground and three of the figure, or the other way round.
        let (one, three) = if in_figure(pick) { (1, 5) } else { (5, 1) };
        let lone = pick % 4;
        let rest = (0..4).filter(|&k| k != lone);
        let lifted: Vec<String> = std::iter::once(one + lone)
            .chain(rest.map(|k| three + k))
            .map(|shaft| shaft.to_string())
            .collect();
        let _ = writeln!(text, "{}={}", pick + 1, lifted.join(","));
    }
    text
}
