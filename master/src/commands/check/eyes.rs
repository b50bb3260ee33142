//! Eyes that see less than the other one: outputs that are missing for one of them.
//!
//! In: a wall. Out: sentences. It knows nothing of the room.

use protocol::Wall;
use protocol::wall::{Eye, Rect, Stereo};

use super::canvases::covered_pixels;

pub(super) fn warn(wall: &Wall, warnings: &mut Vec<String>) {
    for (index, screen) in wall.screens.iter().enumerate() {
        let mut shown: [Vec<Rect>; 2] = [Vec::new(), Vec::new()];
        for output in wall.hosts.iter().flat_map(|host| &host.outputs) {
            let both = output.stereo != Stereo::Off;
            for channel in output
                .channels
                .iter()
                .filter(|channel| channel.screen == index)
            {
                for (eye, shown) in [Eye::Left, Eye::Right].into_iter().zip(&mut shown) {
                    if both || channel.eye == eye {
                        shown.push(channel.canvas_px);
                    }
                }
            }
        }
        let either = covered_pixels(&shown.concat());
        let [left, right] = shown.map(|shown| covered_pixels(&shown));
        for (here, there, has, lacks) in [
            (left, right, "left", "right"),
            (right, left, "right", "left"),
        ] {
            if here > 0 && there == 0 {
                warnings.push(format!(
                    "screen \"{}\" has outputs for the {has} eye but none for the {lacks} one; add a channel with eye = \"{lacks}\", or write eye = \"centre\"",
                    screen.name
                ));
            } else if here > 0 && either > there {
                warnings.push(format!(
                    "{} pixels of screen \"{}\" are shown to the {has} eye but not to the {lacks} one; give both the same canvas_px",
                    either - there,
                    screen.name
                ));
            }
        }
    }
}
