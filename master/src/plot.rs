//! Line plots as SVG, for figures over frames.
//!
//! In: series of points. Out: the text of one SVG file. It must not measure or write anything.

use std::fmt::Write as _;

const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 44.0;
const BOTTOM: f64 = 46.0;
/// Okabe and Ito's colours: told apart by everybody.
const COLOURS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

/// One line of a plot.
#[derive(Debug, Clone, Default)]
pub(crate) struct Series {
    /// Name in the legend.
    pub(crate) name: String,
    /// Points from left to right; those that are not finite break the line.
    pub(crate) points: Vec<(f64, f64)>,
}

/// A plot whose axes begin at zero on the left and, where it is not logarithmic, below.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plot {
    /// What it shows.
    pub(crate) title: String,
    /// Meaning and unit of the horizontal axis.
    pub(crate) x_label: String,
    /// Meaning and unit of the vertical axis.
    pub(crate) y_label: String,
    /// The lines.
    pub(crate) series: Vec<Series>,
}

/// An axis: where its ticks are, and how values lie between its ends.
#[derive(Debug, Clone, PartialEq)]
struct Axis {
    ticks: Vec<f64>,
    /// Digits after the point that tell ticks apart; none: as many as each tick has.
    digits: Option<usize>,
    first: f64,
    last: f64,
    logarithmic: bool,
}

impl Axis {
    /// From zero to the highest value or beyond.
    fn linear(highest: f64) -> Self {
        let (step, end) = axis(highest);
        let count = (end / step * 1.000_001) as u32;
        let digits = if step < 1.0 {
            (-step.log10()).ceil() as usize
        } else {
            0
        };
        Self {
            ticks: (0..=count).map(|index| step * f64::from(index)).collect(),
            digits: Some(digits),
            first: 0.0,
            last: end,
            logarithmic: false,
        }
    }

    /// Around all values above zero, with ticks at 1, 2 and 5 times powers of ten.
    fn logarithmic(values: impl Iterator<Item = f64>) -> Self {
        let (lowest, highest) = values
            .filter(|value| value.is_finite() && *value > 0.0)
            .fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        let (lowest, highest) = if highest > 0.0 {
            (lowest, highest)
        } else {
            (1.0, 1.0)
        };
        let powers = (lowest.log10().floor() as i32)..=(highest.log10().floor() as i32 + 1);
        let ticks: Vec<f64> = powers
            .flat_map(|power| [1.0, 2.0, 5.0].map(|step| step * 10.0_f64.powi(power)))
            .collect();
        // The nearest ticks on either side of all values, and never just one.
        let first = ticks.iter().rposition(|tick| *tick <= lowest).unwrap_or(0);
        let last = ticks
            .iter()
            .position(|tick| *tick >= highest)
            .unwrap_or(ticks.len() - 1)
            .max(first + 1);
        let ticks: Vec<f64> = ticks.into_iter().take(last + 1).skip(first).collect();
        Self {
            first: ticks.first().copied().unwrap_or(1.0),
            last: ticks.last().copied().unwrap_or(10.0),
            ticks,
            digits: None,
            logarithmic: true,
        }
    }

    /// Where a value lies: 0 at the first end, 1 at the last; no number where a logarithmic axis has no place for it.
    fn share(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value / self.first).ln() / (self.last / self.first).ln()
        } else {
            (value - self.first) / (self.last - self.first)
        }
    }

    fn label(&self, tick: f64) -> String {
        match self.digits {
            Some(digits) => format!("{tick:.digits$}"),
            None => format!("{}", (tick * 1e9).round() / 1e9),
        }
    }
}

impl Plot {
    /// The SVG file.
    pub(crate) fn svg(&self) -> String {
        let highest = self
            .values(|point| point.1)
            .filter(|value| value.is_finite());
        self.draw(&Axis::linear(highest.fold(0.0, f64::max)))
    }

    /// The SVG file with a logarithmic vertical axis. Values that are not above zero break the line.
    pub(crate) fn svg_logarithmic(&self) -> String {
        self.draw(&Axis::logarithmic(self.values(|point| point.1)))
    }

    fn values(&self, pick: fn(&(f64, f64)) -> f64) -> impl Iterator<Item = f64> {
        let points = self.series.iter().flat_map(|series| &series.points);
        points.map(pick)
    }

    fn draw(&self, y_axis: &Axis) -> String {
        let highest = self
            .values(|point| point.0)
            .filter(|value| value.is_finite());
        let x_axis = Axis::linear(highest.fold(0.0, f64::max));
        let x_at = |x: f64| LEFT + x_axis.share(x) * (WIDTH - LEFT - RIGHT);
        let y_at = |y: f64| HEIGHT - BOTTOM - y_axis.share(y) * (HEIGHT - TOP - BOTTOM);

        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
             viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{LEFT}\" y=\"18\" font-size=\"15\">{}</text>\n",
            escape(&self.title)
        );
        for (axis, horizontal) in [(&x_axis, false), (y_axis, true)] {
            for &value in &axis.ticks {
                let (x1, y1, x2, y2) = if horizontal {
                    (LEFT, y_at(value), WIDTH - RIGHT, y_at(value))
                } else {
                    (x_at(value), TOP, x_at(value), HEIGHT - BOTTOM)
                };
                let _ = writeln!(
                    svg,
                    "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"#ddd\"/>"
                );
                let (x, y, anchor) = if horizontal {
                    (LEFT - 6.0, y1 + 4.0, "end")
                } else {
                    (x1, HEIGHT - BOTTOM + 16.0, "middle")
                };
                let _ = writeln!(
                    svg,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>",
                    axis.label(value)
                );
            }
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
             <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            (LEFT + WIDTH - RIGHT) / 2.0,
            HEIGHT - 8.0,
            escape(&self.x_label),
            (TOP + HEIGHT - BOTTOM) / 2.0,
            escape(&self.y_label)
        );
        let mut legend_x = LEFT;
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            for run in series
                .points
                .split(|(x, y)| !x_at(*x).is_finite() || !y_at(*y).is_finite())
            {
                if !run.is_empty() {
                    let path: Vec<String> = run
                        .iter()
                        .map(|&(x, y)| format!("{:.1},{:.1}", x_at(x), y_at(y)))
                        .collect();
                    let _ = writeln!(
                        svg,
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1\"/>",
                        path.join(" ")
                    );
                }
                // A line needs two points to be seen.
                if let [(x, y)] = run {
                    let _ = writeln!(
                        svg,
                        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2\" fill=\"{colour}\"/>",
                        x_at(*x),
                        y_at(*y)
                    );
                }
            }
            let _ = writeln!(
                svg,
                "<rect x=\"{legend_x:.1}\" y=\"27\" width=\"12\" height=\"4\" fill=\"{colour}\"/>\n\
                 <text x=\"{:.1}\" y=\"34\">{}</text>",
                legend_x + 16.0,
                escape(&series.name)
            );
            legend_x += 40.0 + 7.0 * series.name.chars().count() as f64;
        }
        svg.push_str("</svg>\n");
        svg
    }
}

/// Distance of ticks (1, 2 or 5 times a power of ten) and the end of an axis that reaches `highest`.
fn axis(highest: f64) -> (f64, f64) {
    let highest = if highest > 0.0 { highest } else { 1.0 };
    let rough = highest / 6.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|step| step * power)
        .find(|step| *step >= rough);
    let step = step.unwrap_or(rough);
    (step, (highest / step).ceil() * step)
}

/// Text that is safe between tags.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_ticks_and_reach_the_highest_value() {
        for highest in [0.003, 0.7, 1.0, 6.0, 61.0, 999.0, 12_345.0] {
            let (step, end) = axis(highest);
            assert!(
                end >= highest * 0.999_999 && end < highest + step,
                "{highest}: {step} {end}"
            );
            assert!(
                (3.0..=10.0).contains(&(end / step).round()),
                "{highest}: {step} {end}"
            );
        }
        assert_eq!(axis(0.0), axis(1.0));
    }

    #[test]
    fn gaps_break_the_line_and_text_is_escaped() {
        let plot = Plot {
            title: "a < b".into(),
            series: vec![Series {
                name: "s".into(),
                points: vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)],
            }],
            ..Plot::default()
        };
        let svg = plot.svg();
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert!(svg.contains("a &lt; b") && !svg.contains("NaN"));
    }

    #[test]
    fn logarithmic_axes_hold_all_values_between_round_ticks() {
        for (values, first, last) in [
            (vec![0.3, 7.0, 45.0], 0.2, 50.0),
            (vec![1.0], 1.0, 2.0),
            (vec![10.0, 1000.0], 10.0, 1000.0),
            (vec![0.0, f64::NAN, 3.0], 2.0, 5.0),
            (vec![], 1.0, 2.0),
        ] {
            let axis = Axis::logarithmic(values.iter().copied());
            assert!(
                (axis.first / first - 1.0).abs() < 1e-9,
                "{values:?}: {axis:?}"
            );
            assert!(
                (axis.last / last - 1.0).abs() < 1e-9,
                "{values:?}: {axis:?}"
            );
            assert_eq!(axis.share(axis.first), 0.0);
            assert_eq!(axis.share(axis.last), 1.0);
        }
        let axis = Axis::logarithmic([0.02, 3e4].into_iter());
        assert_eq!(axis.label(axis.ticks[0]), "0.02");
        assert_eq!(axis.label(axis.last), "50000");
    }

    #[test]
    fn what_a_logarithmic_axis_cannot_show_breaks_the_line() {
        let plot = Plot {
            series: vec![Series {
                name: "s".into(),
                points: vec![(0.0, 1.0), (1.0, 0.0), (2.0, 30.0), (3.0, 90.0)],
            }],
            ..Plot::default()
        };
        let svg = plot.svg_logarithmic();
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
