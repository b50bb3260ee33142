//! Rings and slanted lines with smooth edges.
//! In: centres, ends and widths in pixels. Out: changed pixels. Only pixels near a stroke are visited, so that strokes
//! through the largest picture cost no more than their length.

use super::area::Area;
use super::paper::{Colour, Paper};

/// A circle's line. The centre counts from the upper left corner of the first pixel, so that that of a picture of an
/// even side lies between two pixels; the line lies inside the radius.
pub(super) fn ring(
    paper: &mut Paper,
    centre_px: [f64; 2],
    radius_px: f64,
    width_px: f64,
    colour: Colour,
) {
    let [middle_x, middle_y] = centre_px;
    let inner_px = radius_px - width_px;
    if inner_px <= 0.0 {
        return;
    }
    let half_chord = |radius: f64, dy: f64| (radius * radius - dy * dy).max(0.0).sqrt();
    let rows = (middle_y - radius_px - 1.0) as i64..(middle_y + radius_px + 2.0) as i64;
    for y in rows {
        let dy = y as f64 + 0.5 - middle_y;
        // A pixel more than the line to either side: there its edges fade out.
        let far = half_chord(radius_px + 1.0, dy) + 1.0;
        let near = half_chord(inner_px - 1.0, dy.abs() + 1.0) - 1.0;
        let cover = |x: i64, _: i64| {
            let dx = x as f64 + 0.5 - middle_x;
            let from_middle = dx.hypot(dy);
            (radius_px - from_middle + 0.5).min(from_middle - inner_px + 0.5)
        };
        let span = |from: f64, to: f64| Area {
            left: (middle_x + from).floor() as i64,
            top: y,
            right: (middle_x + to).ceil() as i64,
            bottom: y + 1,
        };
        if near <= 1.0 {
            paper.glaze(span(-far, far), colour, cover);
        } else {
            let (left, right) = (span(-far, -near), span(near, far));
            paper.glaze(left, colour, cover);
            let left_end = left.right;
            let right = Area {
                left: right.left.max(left_end),
                ..right
            };
            paper.glaze(right, colour, cover);
        }
    }
}

/// A line from one point to another, which count as the centre of [`ring`] does.
pub(super) fn line(
    paper: &mut Paper,
    from_px: [f64; 2],
    to_px: [f64; 2],
    width_px: f64,
    colour: Colour,
) {
    let ([x0, y0], [x1, y1]) = (from_px, to_px);
    let length_px = (x1 - x0).hypot(y1 - y0);
    if length_px <= 0.0 {
        return;
    }
    let [along_x, along_y] = [(x1 - x0) / length_px, (y1 - y0) / length_px];
    let reach = 0.5 * width_px + 1.0;
    for y in (y0.min(y1) - reach) as i64..(y0.max(y1) + reach + 1.0) as i64 {
        let dy = y as f64 + 0.5 - y0;
        // The columns in which this row, half a pixel up and down, comes near the line.
        let [left, right] = if along_y.abs() < 1e-9 {
            [x0.min(x1) - reach, x0.max(x1) + reach]
        } else {
            let half = (0.5 * along_x.abs() + reach) / along_y.abs();
            let middle = x0 + dy * along_x / along_y;
            [
                (middle - half).max(x0.min(x1) - reach),
                (middle + half).min(x0.max(x1) + reach),
            ]
        };
        let span = Area {
            left: (left - 1.0).floor() as i64,
            top: y,
            right: (right + 1.0).ceil() as i64,
            bottom: y + 1,
        };
        paper.glaze(span, colour, |x, _| {
            let dx = x as f64 + 0.5 - x0;
            let along = dx * along_x + dy * along_y;
            let across = (dx * along_y - dy * along_x).abs();
            let within = (along + 0.5).min(length_px - along + 0.5);
            (0.5 * width_px + 0.5 - across).min(within)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patterns::paper::WHITE;

    /// The red values of a picture, row by row.
    fn drawn(size: u32, draw: impl Fn(&mut Paper)) -> Vec<Vec<u8>> {
        let mut paper = Paper::new([size; 2]);
        draw(&mut paper);
        let bytes = paper.into_bytes();
        let rows = bytes.chunks_exact(4 * size as usize);
        rows.map(|row| row.iter().step_by(4).copied().collect())
            .collect()
    }

    #[test]
    fn rings_cover_what_lies_between_their_radii_and_nothing_else() {
        for (radius, width) in [(20.0, 3.0), (30.5, 1.0), (3.0, 2.0), (29.0, 20.0)] {
            let picture = drawn(64, |paper| ring(paper, [32.0; 2], radius, width, WHITE));
            for (y, row) in picture.iter().enumerate() {
                for (x, value) in row.iter().enumerate() {
                    let from_middle = (x as f64 - 31.5).hypot(y as f64 - 31.5);
                    let inside = (radius - from_middle).min(from_middle - radius + width);
                    let expected = 255.0 * (inside + 0.5).clamp(0.0, 1.0);
                    let off = (f64::from(*value) - expected).abs();
                    assert!(
                        off <= 0.51,
                        "{radius} {width}: {x} {y}: {value}, not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn lines_of_every_slope_are_as_wide_as_they_should_be() {
        for [dx, dy] in [
            [50.0, 0.0],
            [50.0, 3.0],
            [40.0, 40.0],
            [7.0, -30.0],
            [0.0, 50.0],
        ] {
            let from = [8.0, if dy < 0.0 { 50.0 } else { 8.0 }];
            let to = [from[0] + dx, from[1] + dy];
            let picture = drawn(64, |paper| line(paper, from, to, 4.0, WHITE));
            let light: f64 = picture
                .iter()
                .flatten()
                .map(|v| f64::from(*v) / 255.0)
                .sum();
            let expected = 4.0 * f64::hypot(dx, dy);
            assert!(
                (light - expected).abs() < 0.03 * expected,
                "{dx} {dy}: {light}"
            );
        }
    }
}
