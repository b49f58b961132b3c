//! Plots over two logarithmic axes.

use std::fmt::Write;

/// A point with an interval upward and downward.
pub struct Mark {
    pub x: f64,
    pub y: f64,
    pub low: f64,
    pub high: f64,
    pub colour: String,
    /// Filled, on the line of the front, and with its label.
    pub on_front: bool,
    pub label: String,
}

/// A line.
pub struct Line {
    pub points: Vec<[f64; 2]>,
    pub colour: String,
    pub faint: bool,
}

/// An axis: what it shows, how its numbers are written, and the least that is
/// distinguished from zero.
pub struct Axis {
    pub title: &'static str,
    pub number: fn(f64) -> String,
    pub least: f64,
}

const WIDTH: f64 = 340.0;
const HEIGHT: f64 = 250.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 22.0;
const BOTTOM: f64 = 38.0;

/// Where an axis begins and ends, in decades.
struct Scale {
    from: f64,
    to: f64,
}

impl Scale {
    fn over(values: impl Iterator<Item = f64>, least: f64) -> Scale {
        let used = values
            .filter(|v| v.is_finite())
            .map(|v| v.max(least).log10());
        let (from, to) = used.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(v), b.max(v))
        });
        if from > to {
            return Scale {
                from: -1.0,
                to: 1.0,
            };
        }
        Scale {
            from: from - 0.08 * (to - from).max(1.0),
            to: to + 0.08 * (to - from).max(1.0),
        }
    }

    fn share(&self, value: f64, least: f64) -> f64 {
        let v = value.max(least).log10();
        ((v - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }

    /// One, two and five of every decade, or the decades alone where there are
    /// many.
    fn ticks(&self) -> Vec<f64> {
        let steps: &[f64] = if self.to - self.from < 2.2 {
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

/// The plot as inline SVG.
pub fn log_log(
    title: &str,
    x_axis: &Axis,
    y_axis: &Axis,
    marks: &[Mark],
    lines: &[Line],
) -> String {
    let along = || lines.iter().flat_map(|l| &l.points);
    let xs = Scale::over(
        marks.iter().map(|m| m.x).chain(along().map(|p| p[0])),
        x_axis.least,
    );
    let ys = Scale::over(
        marks
            .iter()
            .flat_map(|m| [m.y, m.high])
            .chain(along().map(|p| p[1])),
        y_axis.least,
    );
    let x = |v: f64| LEFT + xs.share(v, x_axis.least) * (WIDTH - LEFT - RIGHT);
    let y = |v: f64| HEIGHT - BOTTOM - ys.share(v, y_axis.least) * (HEIGHT - BOTTOM - TOP);
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}\"><text x=\"{LEFT}\" y=\"12\" class=\"t\">{title}</text>"
    );
    for tick in xs.ticks() {
        let at = x(tick);
        let _ = write!(
            svg,
            "<path class=\"g\" d=\"M{at:.1} {TOP}V{:.1}\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            HEIGHT - BOTTOM,
            HEIGHT - BOTTOM + 13.0,
            (x_axis.number)(tick)
        );
    }
    for tick in ys.ticks() {
        let at = y(tick);
        let _ = write!(
            svg,
            "<path class=\"g\" d=\"M{LEFT} {at:.1}H{}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            WIDTH - RIGHT,
            LEFT - 4.0,
            at + 4.0,
            (y_axis.number)(tick)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
        WIDTH - RIGHT,
        HEIGHT - 6.0,
        x_axis.title
    );
    for line in lines {
        let points: Vec<String> = line
            .points
            .iter()
            .map(|p| format!("{:.1} {:.1}", x(p[0]), y(p[1])))
            .collect();
        let _ = write!(
            svg,
            "<path d=\"M{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-opacity=\"{}\"/>",
            points.join("L"),
            line.colour,
            if line.faint { 1.0 } else { 2.0 },
            if line.faint { 0.35 } else { 1.0 },
        );
    }
    let mut front: Vec<&Mark> = marks.iter().filter(|m| m.on_front).collect();
    front.sort_by(|a, b| a.x.total_cmp(&b.x));
    if let Some(first) = front.first() {
        let mut path = format!("M{:.1} {:.1}", x(first.x), y(first.y));
        for m in front.iter().skip(1) {
            let _ = write!(path, "H{:.1}V{:.1}", x(m.x), y(m.y));
        }
        let _ = write!(
            svg,
            "<path d=\"{path}\" fill=\"none\" stroke=\"currentColor\" stroke-opacity=\"0.5\" stroke-dasharray=\"3 3\"/>"
        );
    }
    for m in marks {
        let (cx, cy) = (x(m.x), y(m.y));
        let fill = if m.on_front { &m.colour } else { "none" };
        let _ = write!(
            svg,
            "<path d=\"M{cx:.1} {:.1}V{:.1}\" stroke=\"{}\" stroke-opacity=\"0.6\"/>\
             <circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"4\" fill=\"{fill}\" stroke=\"{}\" \
             stroke-width=\"1.5\"><title>{}</title></circle>",
            y(m.high),
            y(m.low),
            m.colour,
            m.colour,
            m.label,
        );
    }
    svg + "</svg>"
}
