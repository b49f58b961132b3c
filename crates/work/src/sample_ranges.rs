//! Which sample indices a picture holds.

use crate::error::input;
use anyhow::Result;
use std::ops::Range;

/// Disjoint ranges in rising order, neighbours joined; as text `0..16,32..64`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SampleRanges(Vec<Range<u64>>);

impl SampleRanges {
    /// One range.
    pub fn one(range: Range<u64>) -> SampleRanges {
        SampleRanges(vec![range])
    }

    /// From text.
    pub fn parse(text: &str) -> Option<SampleRanges> {
        let mut ranges = SampleRanges::default();
        for part in text.split(',') {
            let range = parse_range(part).ok()?;
            ranges = ranges.joined(&SampleRanges::one(range)).ok()?;
        }
        Some(ranges)
    }

    /// How many samples.
    pub fn count(&self) -> u64 {
        self.0.iter().map(|r| r.end - r.start).sum()
    }

    /// The samples between the first and the last that are missing, if any are.
    pub fn gaps(&self) -> Option<SampleRanges> {
        let between = self.0.windows(2).map(|pair| pair[0].end..pair[1].start);
        let gaps: Vec<Range<u64>> = between.collect();
        (!gaps.is_empty()).then_some(SampleRanges(gaps))
    }

    /// The samples of both.
    ///
    /// # Errors
    /// The samples that both have, or the error that there are too many.
    pub fn joined(&self, o: &SampleRanges) -> Result<SampleRanges> {
        let mut all: Vec<Range<u64>> = self.0.iter().chain(&o.0).cloned().collect();
        all.sort_by_key(|r| r.start);
        let mut joined: Vec<Range<u64>> = Vec::new();
        for range in all {
            match joined.last_mut() {
                Some(last) if range.start < last.end => {
                    let end = last.end.min(range.end);
                    return Err(input(format!("samples {}..{end} twice", range.start)));
                }
                Some(last) if range.start == last.end => last.end = range.end,
                _ => joined.push(range),
            }
        }
        Ok(SampleRanges(joined))
    }
}

impl std::fmt::Display for SampleRanges {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts: Vec<String> = self
            .0
            .iter()
            .map(|r| format!("{}..{}", r.start, r.end))
            .collect();
        f.write_str(&parts.join(","))
    }
}

/// A range from "A..B".
///
/// # Errors
/// Says what was expected.
pub fn parse_range(text: &str) -> Result<Range<u64>, String> {
    let ends = text.split_once("..");
    let range = ends.and_then(|(a, b)| Some(a.trim().parse().ok()?..b.trim().parse().ok()?));
    match range {
        Some(r) if r.start < r.end && r.end < u64::from(u32::MAX) => Ok(r),
        _ => Err(format!(
            "expected A..B, sample indices with A < B < {}",
            u32::MAX
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_join_and_overlaps_are_reported() {
        let of = |text: &str| SampleRanges::parse(text).unwrap();
        let joined = of("8..16").joined(&of("0..8")).unwrap();
        assert_eq!(joined.to_string(), "0..16");
        let joined = joined.joined(&of("32..40")).unwrap();
        assert_eq!(joined.to_string(), "0..16,32..40");
        assert_eq!(joined.count(), 24);
        assert_eq!(of(&joined.to_string()), joined);
        let twice = joined.joined(&of("12..33")).unwrap_err();
        assert_eq!(twice.to_string(), "samples 12..16 twice");
        for wrong in [
            "",
            "4",
            "4..4",
            "5..4",
            "a..b",
            "0..4,2..3",
            "0..5000000000",
        ] {
            assert!(SampleRanges::parse(wrong).is_none(), "{wrong}");
        }
    }
}
