//! From regions of outputs and corners in the room to canvases and channels.
//! In: where a window shows what of the room. Out: screens with square pixels, and channels cut from them. A wall file
//! has no stretched pixels: where the source has, the canvas covers as much of the region as stays square.

use crate::draft::{Builder, Channel, MAX_CHANNELS, MAX_SIZE_PX, Output, Screen, Shape};
use crate::error::Trouble;
use crate::room::{Corners, RECTANGLE_TOLERANCE_M};
use crate::source::At;
use crate::stereo::{Eye, Stereo};

/// How much pixels may be off square: a hair less than the 2 % of wall files, since corners are rounded when written.
const PIXEL_ASPECT_TOLERANCE: f64 = 0.0199;
/// How far in front of a screen a head must be, in metres.
const NEAREST_HEAD_M: f64 = 0.01;

/// What a channel shows, and where.
pub(crate) struct Picture<'n> {
    /// For the name of its screen.
    pub(crate) name: &'n str,
    pub(crate) observer: usize,
    pub(crate) eye: Eye,
    /// x, y from the upper left corner of the output, width, height.
    pub(crate) region_px: [i64; 4],
    pub(crate) calibration: Option<String>,
}

/// Whether pixels of a canvas on a rectangle are square enough.
pub(crate) fn is_square([width_m, height_m]: [f64; 2], [width, height]: [i64; 2]) -> bool {
    let (across, along) = (width as f64 / width_m, height as f64 / height_m);
    (across / along - 1.0).abs() <= PIXEL_ASPECT_TOLERANCE
}

/// The size of the largest canvas with square pixels that fits into a region: the whole region if its pixels are square,
/// else as wide or as high as it. `None` where that would be too thin for square pixels.
pub(crate) fn fit(size_m: [f64; 2], region: [i64; 2]) -> Option<[i64; 2]> {
    if is_square(size_m, region) {
        return Some(region);
    }
    let [width_m, height_m] = size_m;
    let density = (region[0] as f64 / width_m).min(region[1] as f64 / height_m);
    let pixels = |length_m: f64| ((length_m * density).round() as i64).clamp(1, MAX_SIZE_PX);
    let size = [pixels(width_m), pixels(height_m)];
    let fits = size[0] <= region[0] && size[1] <= region[1] && is_square(size_m, size);
    fits.then_some(size)
}

impl Builder {
    /// Shows a rectangle of the room in a region of an output. What it cannot do is listed.
    pub(crate) fn show(
        &mut self,
        at: At<'_>,
        output: &mut Output,
        corners: Corners,
        picture: Picture<'_>,
    ) -> Result<(), Trouble> {
        let Some(corners) = self.rectangle(at, corners, picture.observer) else {
            return Ok(());
        };
        let [x, y, width, height] = picture.region_px;
        let size_m = corners.size_m();
        let Some(size_px) = fit(size_m, [width, height]) else {
            self.ledger.list(
                at,
                format!("of {width}×{height} pixels on {:.3} m × {:.3} m no square ones are left, so it is left out", size_m[0], size_m[1]),
                "correct the corners or the size, and write the channel by hand",
            );
            return Ok(());
        };
        if size_px != [width, height] {
            self.ledger.note(
                at,
                format!("{width}×{height} pixels on {:.3} m × {:.3} m", size_m[0], size_m[1]),
                format!(
                    "canvases have square pixels within 2 %, so the canvas is {}×{} in the middle of the region, and nothing is shown beside it",
                    size_px[0], size_px[1]
                ),
                "if the projector stretches its pixels, use a calibration file; else correct the corners or the size",
            );
        }
        let offset = [(width - size_px[0]) / 2, (height - size_px[1]) / 2];
        let screen = Screen {
            name: picture.name.to_owned(),
            observer: picture.observer,
            size_px,
            shape: Shape::Planar(corners),
        };
        if !self.has_room(at, output, picture.region_px) {
            return Ok(());
        }
        let screen = self.screen(at, screen)?;
        output.channels.push(Channel {
            screen,
            eye: picture.eye,
            canvas_px: [0, 0, size_px[0], size_px[1]],
            output_px: [x + offset[0], y + offset[1]],
            calibration: picture.calibration,
        });
        Ok(())
    }

    /// The rectangle next to these corners. `None`, and a line in the list, where there is none.
    pub(crate) fn rectangle(
        &mut self,
        at: At<'_>,
        corners: Corners,
        observer: usize,
    ) -> Option<Corners> {
        if !corners.is_usable() {
            self.ledger.list(
                at,
                "its corners do not span an area, or lie more than 1000 m from the origin, so it is left out",
                "measure the corners again, in metres, and write the screen by hand",
            );
            return None;
        }
        let (corners, moved_m) = corners.right_angled();
        if moved_m > RECTANGLE_TOLERANCE_M {
            self.ledger.note(
                at,
                "its corners",
                format!(
                    "they form a parallelogram and screens are rectangles, so the upper left corner moved by {:.1} mm",
                    moved_m * 1000.0
                ),
                "measure the corners again",
            );
        }
        let head = self.draft.observers.get(observer)?.head_m.into();
        let distance_m = corners.distance_m(head);
        if distance_m < NEAREST_HEAD_M {
            self.ledger.note(
                at,
                "its corners",
                format!(
                    "the resting head is {:.3} m behind the screen or in its plane, which a wall file may not have",
                    -distance_m
                ),
                "move head_m in front of it, or exchange the left and the right corners",
            );
        }
        Some(corners)
    }

    /// Whether one more channel fits into an output, and covers no other one. Tells where not.
    pub(crate) fn has_room(&mut self, at: At<'_>, output: &Output, region_px: [i64; 4]) -> bool {
        let [x, y, width, height] = region_px;
        let place = format!("{x}, {y}, {width}, {height} of the output");
        if output.channels.len() >= MAX_CHANNELS {
            self.ledger.list(
                at,
                format!("an output has at most {MAX_CHANNELS} channels, so {place} is left out"),
                "split the window",
            );
            return false;
        }
        let covers = |channel: &Channel| {
            let ([cx, cy], [_, _, cw, ch]) = (channel.output_px, channel.canvas_px);
            cx < x + width && x < cx + cw && cy < y + height && y < cy + ch
        };
        if output.channels.iter().any(covers) {
            self.ledger.list(
                at,
                format!("channels of an output do not overlap, so {place} is left out"),
                "move one of them, or use two windows",
            );
            return false;
        }
        if x < 0 || y < 0 || x + width > output.size_px[0] || y + height > output.size_px[1] {
            self.ledger.list(
                at,
                format!(
                    "{place} leaves its {}×{} pixels, so it is left out",
                    output.size_px[0], output.size_px[1]
                ),
                "correct its place, and write the channel by hand",
            );
            return false;
        }
        true
    }

    /// Lets one more channel show both eyes in the way `stereo`, or one of them, as far as its output does; returns the
    /// channel's eye. The first channel of an output decides.
    pub(crate) fn join(
        &mut self,
        at: At<'_>,
        output: &mut Output,
        eye: Eye,
        stereo: Stereo,
    ) -> Eye {
        if output.channels.is_empty() {
            output.stereo = stereo;
        } else if output.stereo != stereo {
            self.ledger.note(
                at,
                format!(
                    "stereo {} beside {} in one window",
                    stereo.name(),
                    output.stereo.name()
                ),
                "an output has one way of stereo, that of its first channel",
                "use two windows",
            );
        }
        self.eye_in(at, output.stereo, eye)
    }

    /// The eye for a channel of an output: outputs that show both eyes take none.
    pub(crate) fn eye_in(&mut self, at: At<'_>, stereo: Stereo, eye: Eye) -> Eye {
        if stereo == Stereo::Off || eye == Eye::Centre {
            return eye;
        }
        self.ledger.note(
            at,
            format!("the {} eye alone", eye.name()),
            "its output shows both eyes",
            "set stereo = \"off\" on the output if it shows one eye only",
        );
        Eye::Centre
    }
}

/// A region from shares of a size, y up: x, y, width, height from the upper left corner, in whole pixels. Edges are
/// rounded, so that regions that share an edge still do. `None` where nothing is left.
pub(crate) fn region_of_shares(shares: [f64; 4], size: [i64; 2]) -> Option<[i64; 4]> {
    let [x, y, width, height] = shares;
    if !shares.iter().all(|share| (-1.0..=2.0).contains(share)) {
        return None;
    }
    let [columns, rows] = size.map(|side| side as f64);
    let left = (x * columns).round() as i64;
    let right = ((x + width) * columns).round() as i64;
    let top = ((1.0 - y - height) * rows).round() as i64;
    let bottom = ((1.0 - y) * rows).round() as i64;
    let inside = left >= 0 && top >= 0 && right <= size[0] && bottom <= size[1];
    (inside && right > left && bottom > top).then_some([left, top, right - left, bottom - top])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn canvases_have_square_pixels_and_fit_the_region() {
        assert_eq!(fit([1.6, 0.9], [1920, 1080]), Some([1920, 1080]));
        assert_eq!(fit([3.0, 3.0], [1920, 1080]), Some([1080, 1080]));
        assert_eq!(fit([3.0, 2.25], [1280, 1024]), Some([1280, 960]));
        assert_eq!(fit([100.0, 0.01], [1920, 1080]), None);
    }

    #[test]
    fn shares_count_from_below() {
        assert_eq!(
            region_of_shares([0.0, 0.0, 0.5, 0.25], [400, 200]),
            Some([0, 150, 200, 50])
        );
        assert_eq!(
            region_of_shares([0.3333, 0.0, 0.3334, 1.0], [1200, 400]),
            Some([400, 0, 400, 400])
        );
        assert_eq!(region_of_shares([0.5, 0.0, 0.7, 1.0], [400, 200]), None);
        assert_eq!(region_of_shares([0.0, 0.0, 0.0, 1.0], [400, 200]), None);
    }
}
