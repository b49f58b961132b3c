//! Axes: their ends and the numbers beside them.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// A linear axis with lines at places of its own choice. (`plotters` can give places to
/// axes of whole numbers and to logarithmic ones, but writes no numbers beside linear
/// ones of `f64` then.)
pub(crate) struct LinearAxis {
    range: RangedCoordf64,
    ticks: Vec<f64>,
}

impl LinearAxis {
    pub(crate) fn new(range: Range<f64>, ticks: &[f64]) -> LinearAxis {
        LinearAxis {
            range: range.into(),
            ticks: ticks.to_vec(),
        }
    }
}

impl Ranged for LinearAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.range.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.range.range()
    }
}

/// The quantity of a logarithmic axis.
pub(crate) struct LogAxis {
    /// The unit, written at the end of a horizontal axis.
    pub title: &'static str,
    /// The format of its numbers.
    pub number: fn(f64) -> String,
    /// The smallest value that is distinguished from zero.
    pub least: f64,
}

/// Share of its length, in decades, by which an axis exceeds the data at each end.
const MARGIN: f64 = 0.08;
/// Up to this many decades, 1, 2 and 5 of each have a line; beyond, 1 alone.
const FEW_DECADES: f64 = 2.2;

/// The range of a logarithmic axis that some values need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogSpan {
    /// Decimal logarithms of its ends.
    from: f64,
    to: f64,
    least: f64,
}

impl LogSpan {
    /// The range of all finite values; a decade about 1 if there are none.
    pub(crate) fn over(values: impl Iterator<Item = f64>, least: f64) -> LogSpan {
        let logarithms = values
            .filter(|v| v.is_finite())
            .map(|v| v.max(least).log10());
        let (low, high) = logarithms.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(v), b.max(v))
        });
        let (from, to) = if low > high {
            (-1.0, 1.0)
        } else {
            let margin = MARGIN * (high - low).max(1.0);
            (low - margin, high + margin)
        };
        LogSpan { from, to, least }
    }

    /// The values at its ends.
    pub(crate) fn range(&self) -> Range<f64> {
        10f64.powf(self.from)..10f64.powf(self.to)
    }

    /// The value clamped to the range.
    pub(crate) fn place(&self, value: f64) -> f64 {
        let range = self.range();
        value.max(self.least).clamp(range.start, range.end)
    }

    /// The values that have a line and a number.
    pub(crate) fn ticks(&self) -> Vec<f64> {
        let steps: &[f64] = if self.to - self.from < FEW_DECADES {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let decades = self.from.floor() as i32..=self.to.ceil() as i32;
        let all = decades.flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
        all.filter(|t| (self.from..=self.to).contains(&t.log10()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_hold_their_values_and_ticks_lie_within() {
        let span = LogSpan::over([0.02, f64::NAN, 0.5].into_iter(), 1e-3);
        let range = span.range();
        assert!(range.start < 0.02 && range.end > 0.5, "{range:?}");
        assert_eq!(span.ticks(), [0.02, 0.05, 0.1, 0.2, 0.5]);
        let wide = LogSpan::over([1.0, 1e4].into_iter(), 1e-3);
        assert_eq!(wide.ticks(), [1.0, 10.0, 100.0, 1000.0, 10000.0]);
        assert_eq!(
            wide.place(f64::INFINITY),
            wide.range().end,
            "put at the end"
        );
        let none = LogSpan::over(std::iter::empty(), 1e-3);
        assert_eq!(none.range(), 0.1..10.0);
        assert_eq!(LogSpan::over([0.0].into_iter(), 1e-3).place(0.0), 1e-3);
    }
}
