//! Names on a plan, each where it covers none that is there already.
//!
//! In: texts and where they would like to be, in page units. Out: SVG text. It knows nothing of rooms.

use std::fmt::Write as _;

use crate::plot::escape;

/// Width of a letter and height of a line, in font sizes: those of common sans-serif fonts.
const LETTER: f64 = 0.56;
const LINE: f64 = 1.15;

/// A text, centred at places in order of preference.
pub(super) struct Label<'a> {
    pub(super) lines: &'a [String],
    pub(super) size: f64,
    pub(super) style: &'static str,
    pub(super) places: Vec<[f64; 2]>,
}

/// What is taken: left, upper, right, lower.
type Area = [f64; 4];

/// The names on one page.
#[derive(Default)]
pub(super) struct Labels {
    taken: Vec<Area>,
}

impl Labels {
    /// Keeps names away from a place.
    pub(super) fn take(&mut self, [x, y]: [f64; 2], radius: f64) {
        self.taken
            .push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// Writes a text at the first place that is free, or at the one where it covers least.
    pub(super) fn write(&mut self, svg: &mut String, label: &Label<'_>) {
        let longest = label.lines.iter().map(|line| line.chars().count()).max();
        let half_width = 0.5 * LETTER * label.size * longest.unwrap_or(0) as f64;
        let half_height = 0.5 * LINE * label.size * label.lines.len() as f64;
        let area = |[x, y]: [f64; 2]| {
            [
                x - half_width,
                y - half_height,
                x + half_width,
                y + half_height,
            ]
        };
        let covered = |place: [f64; 2]| {
            let here = area(place);
            self.taken.iter().map(|taken| shared(here, *taken)).sum()
        };
        let mut best: Option<([f64; 2], f64)> = None;
        for place in &label.places {
            let covers: f64 = covered(*place);
            if best.is_none_or(|(_, least)| covers < least) {
                best = Some((*place, covers));
            }
            if covers <= 0.0 {
                break;
            }
        }
        let Some((place, _)) = best else {
            return;
        };
        self.taken.push(area(place));
        for (index, line) in label.lines.iter().enumerate() {
            let y = place[1] - half_height + LINE * label.size * (index as f64 + 0.78);
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{y:.1}\" font-size=\"{}\" text-anchor=\"middle\" paint-order=\"stroke\" \
                 stroke=\"white\" stroke-opacity=\"0.85\" stroke-width=\"3\" stroke-linejoin=\"round\" {}>{}</text>",
                place[0],
                label.size,
                label.style,
                escape(line)
            );
        }
    }
}

/// The area that two share.
fn shared(a: Area, b: Area) -> f64 {
    let width = a[2].min(b[2]) - a[0].max(b[0]);
    let height = a[3].min(b[3]) - a[1].max(b[1]);
    width.max(0.0) * height.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_goes_where_none_is_yet() {
        let mut labels = Labels::default();
        let mut svg = String::new();
        let lines = ["a < b".to_owned()];
        for _ in 0..3 {
            labels.write(
                &mut svg,
                &Label {
                    lines: &lines,
                    size: 10.0,
                    style: "",
                    places: vec![[50.0, 50.0], [50.0, 54.0], [50.0, 70.0], [50.0, 57.0]],
                },
            );
        }
        // The third one has no free place and takes the one that covers least.
        let heights: Vec<&str> = svg
            .split(" y=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next())
            .collect();
        assert_eq!(heights.len(), 3);
        assert_eq!(heights.first(), Some(&"53.2"));
        assert_eq!(heights.get(1), Some(&"73.2"));
        assert!(svg.contains("a &lt; b"));
    }
}
