//! Greys in steps and ramps, with the zones hatched in which channels fade: to judge gamma and blending by.
//! In: what there is to say about an output. Out: its picture. Ramps of channels are shown, not applied.

use super::area::Area;
use super::paper::{BLACK, Colour, Paper, WHITE, grey, ink_on};
use super::text::{LINE_HEIGHT, Side, Style, width_px, write};
use super::{About, ChannelAbout};

/// Grey steps: values 0, 17, 34, … 255.
pub(super) const STEPS: i64 = 16;

/// Lines of the hatch, which no other part of the pattern has.
pub(super) const HATCH: Colour = [255, 112, 0];

/// Pixels between lines of the hatch along a row, and their width.
const HATCH_PX: i64 = 16;
const HATCH_LINE_PX: i64 = 3;

pub(super) fn draw(paper: &mut Paper, about: &About) {
    let whole = paper.area();
    let steps = whole.rows(0, 55, 100);
    for number in 0..STEPS {
        let step = steps.columns(number, number + 1, STEPS);
        let value = u8::try_from(17 * number).unwrap_or(u8::MAX);
        paper.fill(step, grey(value));
        label_step(paper, step, value);
    }
    let below = Area {
        top: steps.bottom,
        ..whole
    };
    let scale = paper.scale();
    // Without room for text there is no band for it.
    let band = if below.height() >= 6 * LINE_HEIGHT {
        (LINE_HEIGHT + 5) * scale
    } else {
        0
    };
    let light = format!("even in light ({})", about.curve());
    let halves = [(0, light.as_str()), (1, "even in value")];
    for (half, text) in halves {
        let half_area = below.columns(half, half + 1, 2);
        let ramp = Area {
            top: half_area.top + band,
            ..half_area
        };
        let last = (ramp.width() - 1).max(1);
        let values = (0..ramp.width()).map(|column| {
            if half == 0 {
                about.value_of(column as f64 / last as f64)
            } else {
                u8::try_from((510 * column + last) / (2 * last)).unwrap_or(u8::MAX)
            }
        });
        for (x, value) in (ramp.left..).zip(values) {
            paper.fill(
                Area {
                    left: x,
                    right: x + 1,
                    ..ramp
                },
                grey(value),
            );
        }
        let caption = Area {
            bottom: ramp.top,
            ..half_area
        };
        caption_line(paper, caption.inset(scale), text);
    }
    blends(paper, about);
}

/// The value of a step in its middle.
fn label_step(paper: &mut Paper, step: Area, value: u8) {
    let text = value.to_string();
    if step.width() > width_px(3, 1) + 4 && step.height() >= LINE_HEIGHT {
        let style = Style {
            scale: paper.scale(),
            colour: ink_on(grey(value)),
            sides: [Side::Middle; 2],
            backing: None,
        };
        write(paper, step.inset(1), &text, style);
    }
}

fn caption_line(paper: &mut Paper, area: Area, text: &str) {
    let style = Style {
        scale: paper.scale(),
        colour: WHITE,
        sides: [Side::Middle; 2],
        backing: Some(BLACK),
    };
    write(paper, area, text, style);
}

/// Hatches where channels fade, and says how far. The hatch is on top: it tells exactly which pixels are in a ramp.
fn blends(paper: &mut Paper, about: &About) {
    let scale = paper.scale();
    let fading = || about.channels.iter().filter(|of| of.ramps_px != [0; 4]);
    for channel in fading() {
        let area = Area::from(channel.rect).and(paper.area());
        let [left, right, _, bottom] = channel.ramps_px;
        let sides = ["left", "right", "top", "bottom"].into_iter();
        let fades: Vec<String> = sides
            .zip(channel.ramps_px)
            .filter(|(_, ramp_px)| *ramp_px > 0)
            .map(|(side, ramp_px)| format!("{side} {ramp_px}"))
            .collect();
        let (screen, eye) = (&channel.screen, &channel.eye);
        let text = format!("{screen}, {eye}: fades {} px", fades.join(", "));
        // Where the channel does not fade, if that is anywhere.
        let clear = Area {
            left: area.left + i64::from(left),
            right: area.right - i64::from(right),
            top: area.top,
            bottom: area.bottom - i64::from(bottom),
        };
        let low = if clear.is_empty() { area } else { clear }.rows(85, 100, 100);
        let line = Area {
            bottom: low.bottom.min(low.top + (LINE_HEIGHT + 4) * scale),
            ..low
        };
        caption_line(paper, line.inset(2 * scale), &text);
    }
    for channel in fading() {
        for zone in zones(channel) {
            paper.paint(zone, |x, y| {
                ((x + y) % HATCH_PX < HATCH_LINE_PX).then_some(HATCH)
            });
        }
        for edge in inner_edges(channel) {
            paper.fill(edge, HATCH);
        }
    }
}

/// The strips of a channel in which it fades: left, right, top, bottom.
fn zones(channel: &ChannelAbout) -> [Area; 4] {
    Area::from(channel.rect).margins(channel.ramps_px.map(i64::from))
}

/// The innermost pixels of each strip.
fn inner_edges(channel: &ChannelAbout) -> [Area; 4] {
    let [left, right, top, bottom] = zones(channel);
    [
        Area {
            left: left.right - 1,
            ..left
        }
        .and(left),
        Area {
            right: right.left + 1,
            ..right
        }
        .and(right),
        Area {
            top: top.bottom - 1,
            ..top
        }
        .and(top),
        Area {
            bottom: bottom.top + 1,
            ..bottom
        }
        .and(bottom),
    ]
}

#[cfg(test)]
mod tests {
    use protocol::wall::Rect;

    use super::*;

    fn drawn(about: &About) -> Vec<Colour> {
        let bytes = super::super::draw(protocol::pattern::Pattern::Ramp, about);
        let pixels = bytes.as_chunks::<4>().0.iter();
        pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    }

    #[test]
    fn the_hatch_covers_the_ramps_and_nothing_else() {
        let channel = |x: u32, y: u32, ramps_px: [u32; 4]| ChannelAbout {
            screen: "front".into(),
            eye: "centre".into(),
            rect: Rect {
                x,
                y,
                width: 300,
                height: 200,
            },
            ramps_px,
        };
        let about = About {
            size_px: [640, 401],
            // The third reaches beyond the output; the ramps of the last one are wider than it is.
            channels: vec![
                channel(0, 0, [0, 70, 0, 31]),
                channel(310, 10, [50, 0, 1, 0]),
                channel(500, 230, [9, 9, 9, 9]),
                channel(20, 201, [0, 0, 0, 0]),
                channel(330, 211, [u32::MAX, 0, 0, 0]),
            ],
            ..About::default()
        };
        // Columns and rows of the zones, by hand.
        let zones = [
            (230..300, 0..200),
            (0..300, 169..200),
            (310..360, 10..210),
            (310..610, 10..11),
            (500..509, 230..430),
            (791..800, 230..430),
            (500..800, 230..239),
            (500..800, 421..430),
            (330..630, 211..411_i64),
        ];
        // The last columns or rows of a zone, where it ends inside its channel.
        let inner = [
            (230..231, 0..200),
            (0..300, 169..170),
            (359..360, 10..210),
            (310..610, 10..11),
            (508..509, 230..430),
            (500..800, 238..239),
            (629..630, 211..411_i64),
        ];
        let picture = drawn(&about);
        let mut bare = about.clone();
        for channel in &mut bare.channels {
            channel.ramps_px = [0; 4];
        }
        let bare = drawn(&bare);
        assert!(!bare.contains(&HATCH));
        for (number, (colour, before)) in (0..).zip(picture.iter().zip(&bare)) {
            let (x, y) = (number % 640, number / 640);
            let within = zones
                .iter()
                .any(|(xs, ys)| xs.contains(&x) && ys.contains(&y));
            let at_end = inner
                .iter()
                .any(|(xs, ys)| xs.contains(&x) && ys.contains(&y));
            let on_line = (x + y) % 16 < 3;
            let expected = within && (on_line || at_end);
            assert_eq!(*colour == HATCH, expected, "{x} {y}");
            // Besides the hatch, only captions are added: black and white.
            assert!(
                expected || colour == before || [BLACK, WHITE].contains(colour),
                "{x} {y}"
            );
        }
    }

    #[test]
    fn steps_and_ramps_have_their_values() {
        let mut about = About {
            size_px: [1024, 300],
            ..About::default()
        };
        for gamma in [None, Some(1.0), Some(2.4)] {
            about.gamma = gamma;
            let picture = drawn(&about);
            for step in 0..16_usize {
                let value = 17 * step as u8;
                assert_eq!(picture[1024 * 5 + 64 * step], grey(value));
                assert_eq!(picture[1024 * 164 + 64 * step + 63], grey(value));
            }
            let last = &picture[1024 * 299..];
            for column in 0..512_usize {
                let share = column as f64 / 511.0;
                let value = last[512 + column][0];
                assert!(
                    (f64::from(value) - 255.0 * share).abs() <= 0.5001,
                    "{column}"
                );
                // The light of the value, by the inverse of the curve, is within that of half a value.
                let light = |value: f64| {
                    let value = value / 255.0;
                    match gamma {
                        Some(gamma) => value.max(0.0).powf(gamma),
                        None if value <= 0.040_45 => value / 12.92,
                        None => ((value + 0.055) / 1.055).powf(2.4),
                    }
                };
                let value = f64::from(last[column][0]);
                let (low, high) = (light(value - 0.501), light(value + 0.501));
                assert!((low..=high).contains(&share), "{gamma:?} {column}: {value}");
            }
        }
    }
}
