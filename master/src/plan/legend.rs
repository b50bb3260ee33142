//! The legend of a plan: the wall's name, its screens and densities, colours, signs, a bar of a metre.
//!
//! In: what the plan shows, and its scale. Out: SVG text and its height. It draws no room.

use std::fmt::Write as _;

use super::colour::{STEPS, of_step};
use super::scene::Room;
use super::view::round_step;
use crate::output::counted;
use crate::plot::escape;

/// Width of the legend.
pub(super) const WIDTH: f64 = 440.0;
/// Screens and calibrated channels that are listed at most.
const MOST_ROWS: usize = 24;
/// From line to line.
const LINE: f64 = 15.0;
/// Columns of the list.
const NAME: f64 = 0.0;
const PIXELS: f64 = 235.0;
const SPARSEST: f64 = 330.0;
const DENSEST: f64 = 430.0;
/// Letters of a name that fit.
const LETTERS: usize = 26;

/// Text of a legend at the origin.
pub(super) struct Legend {
    pub(super) svg: String,
    pub(super) height: f64,
}

impl Legend {
    pub(super) fn new(room: &Room<'_>, scale: f64) -> Self {
        let mut legend = Self {
            svg: String::new(),
            height: 0.0,
        };
        legend.title(room);
        legend.bar(scale);
        legend.screens(room);
        legend.colours(room);
        legend.signs(room);
        legend
    }

    fn text(&mut self, x: f64, style: &str, text: &str) {
        let _ = writeln!(
            self.svg,
            "<text x=\"{x:.1}\" y=\"{:.1}\" {style}>{}</text>",
            self.height,
            escape(text)
        );
    }

    fn title(&mut self, room: &Room<'_>) {
        self.text(
            0.0,
            "font-size=\"18\" font-weight=\"bold\"",
            &room.wall.name,
        );
        self.height += 18.0;
        let outputs = room.wall.hosts.iter().map(|host| host.outputs.len());
        let subtitle = format!(
            "{}, {}, {}; the room in metres, x right, y up, z towards the viewers",
            counted(room.wall.screens.len(), "screen"),
            counted(room.wall.hosts.len(), "host"),
            counted(outputs.sum(), "output")
        );
        self.text(0.0, "fill=\"#555\"", &subtitle);
        self.height += 24.0;
    }

    fn bar(&mut self, scale: f64) {
        // A metre, unless the room is too small or too large for it.
        let metres = if (40.0..=300.0).contains(&scale) {
            1.0
        } else {
            round_step(60.0 / scale)
        };
        let length = metres * scale;
        let _ = writeln!(
            self.svg,
            "<path class=\"bar\" d=\"M0 {0:.1}v-7M0 {1:.1}h{length:.2}M{length:.2} {0:.1}v-7\" stroke=\"black\" stroke-width=\"2\" fill=\"none\"/>",
            self.height,
            self.height - 3.5
        );
        self.text(length + 8.0, "", &format!("{metres} m"));
        self.height += 26.0;
    }

    fn screens(&mut self, room: &Room<'_>) {
        let grey = "fill=\"#555\"";
        self.text(NAME, grey, "screen, calibrated output");
        self.text(PIXELS, "fill=\"#555\" text-anchor=\"end\"", "pixels");
        self.text(
            DENSEST,
            "fill=\"#555\" text-anchor=\"end\"",
            "to a radian: sparsest … densest",
        );
        self.height += 4.0;
        let _ = writeln!(
            self.svg,
            "<path d=\"M0 {0:.1}h{DENSEST}\" stroke=\"#999\"/>",
            self.height
        );
        self.height += LINE - 2.0;
        let bold = "font-weight=\"bold\"";
        let rows = room.screens.iter().flat_map(|drawn| {
            let screen = drawn.screen;
            let of_screen = (bold, screen.name.as_str(), screen.size_px, drawn.density);
            let channels = drawn.calibrated.iter();
            let channels = channels
                .map(|channel| ("", channel.name.as_str(), channel.size_px, channel.density));
            std::iter::once(of_screen).chain(channels)
        });
        let count = rows.clone().count();
        for (style, name, [width, height], density) in rows.take(MOST_ROWS) {
            let name = if name.chars().count() > LETTERS {
                let start: String = name.chars().take(LETTERS - 1).collect();
                format!("{start}…")
            } else {
                name.to_owned()
            };
            self.text(NAME, style, &name);
            let end = "text-anchor=\"end\"";
            self.text(PIXELS, end, &format!("{width} × {height}"));
            match density {
                Some(density) => {
                    self.text(SPARSEST, end, &format!("{:.0}", density.sparsest));
                    self.text(DENSEST, end, &format!("{:.0}", density.densest));
                }
                None => self.text(DENSEST, end, "not seen from the front"),
            }
            self.height += LINE;
        }
        if count > MOST_ROWS {
            let more = count - MOST_ROWS;
            self.text(NAME, grey, &format!("and {more} more"));
            self.height += LINE;
        }
        self.height += 12.0;
    }

    fn colours(&mut self, room: &Room<'_>) {
        let Some(scale) = room.scale else {
            return;
        };
        self.text(
            0.0,
            "fill=\"#555\"",
            "pixels to a radian at the head at rest, mean of both directions",
        );
        self.height += 6.0;
        let width = 300.0 / STEPS as f64;
        let _ = writeln!(self.svg, "<g class=\"colours\" opacity=\"0.75\">");
        for step in 0..STEPS {
            let _ = writeln!(
                self.svg,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"12\" fill=\"{}\"/>",
                width * step as f64,
                self.height,
                width + 0.3,
                of_step(step)
            );
        }
        self.svg.push_str("</g>\n");
        self.height += 24.0;
        let middle = 0.5 * (scale.sparsest + scale.densest);
        for (x, anchor, density) in [
            (0.0, "start", scale.sparsest),
            (150.0, "middle", middle),
            (300.0, "end", scale.densest),
        ] {
            let style = format!("text-anchor=\"{anchor}\"");
            self.text(x, &style, &format!("{density:.0}"));
        }
        self.height += 20.0;
    }

    fn signs(&mut self, room: &Room<'_>) {
        let mut lines = vec![
            "thin lines: parts that outputs show; dashed: where blend ramps end".to_owned(),
            "faint lines: from the head to the corners of its screens".to_owned(),
            "○→ a head at rest, with its left (orange) and right (blue) eye".to_owned(),
        ];
        if !room.trackers.is_empty() {
            lines.push("□ origin of a tracker, with its axes x red, y green, z blue".to_owned());
        }
        for tracker in &room.far_trackers {
            let [x, y, z] = tracker.to_room.origin_m;
            lines.push(format!(
                "the origin of tracker {} is off the plan, at ({x:.2}, {y:.2}, {z:.2})",
                tracker.name
            ));
        }
        for line in lines {
            self.text(0.0, "fill=\"#555\" font-size=\"10\"", &line);
            self.height += 14.0;
        }
    }
}
