//! Where the pixels of a wall are: screens as seen from a head, pixel density, and which output shows
//! which part of a canvas. In: a validated wall, heads in room metres. Out: room vectors and rectangles.
//! Only the four basic operations and square roots, so that all machines compute the same bits.

use glam::DVec3;

use super::{Rect, Screen, Wall};

/// A screen as seen from a head: what an off-axis frustum is made of. All vectors in room axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeToScreen {
    /// From the head to the lower left corner of the canvas, in metres.
    pub lower_left_m: [f64; 3],
    /// Unit vector along the lower edge.
    pub right: [f64; 3],
    /// Unit vector along the left edge, at right angles to `right`.
    pub up: [f64; 3],
    /// Unit normal of the screen, on the viewer's side.
    pub back: [f64; 3],
    /// Width of the canvas in metres.
    pub width_m: f64,
    /// Height of the canvas in metres.
    pub height_m: f64,
    /// From the head to the screen's plane in metres, > 0.
    pub distance_m: f64,
}

/// How many pixels there are to a radian of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelDensity {
    /// The fewest on the canvas's plane: at the foot of the perpendicular from the head.
    pub sparsest: f64,
    /// The most on the canvas: at the corner farthest from that foot, in radial direction.
    pub densest: f64,
}

/// A piece of a canvas and the place in an output where it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanvasPiece {
    /// Index into [`Wall::screens`].
    pub screen: usize,
    /// Index into [`Wall::hosts`].
    pub host: usize,
    /// Index into that host's outputs.
    pub output: usize,
    /// The part of the canvas.
    pub canvas_px: Rect,
    /// Upper left corner of the piece in the output's picture.
    pub output_px: [u32; 2],
}

impl EyeToScreen {
    /// From the head to a point of the canvas in metres. `x_px`, `y_px` count from the upper left corner
    /// of the canvas; the middle of its first pixel is (0.5, 0.5).
    #[must_use]
    pub fn to_canvas_m(&self, size_px: [u32; 2], x_px: f64, y_px: f64) -> [f64; 3] {
        let x_m = x_px / f64::from(size_px[0]) * self.width_m;
        let y_m = (1.0 - y_px / f64::from(size_px[1])) * self.height_m;
        let corner = DVec3::from(self.lower_left_m);
        (corner + DVec3::from(self.right) * x_m + DVec3::from(self.up) * y_m).to_array()
    }
}

impl Screen {
    /// The screen from a head in room metres. `None` for a head on or behind the screen's plane, which
    /// a tracker can report: such a head sees no picture.
    #[must_use]
    pub fn eye_to_screen(&self, head_m: [f64; 3]) -> Option<EyeToScreen> {
        let bottom_left = DVec3::from(self.corners_m.bottom_left);
        let along_width = DVec3::from(self.corners_m.bottom_right) - bottom_left;
        let along_height = DVec3::from(self.corners_m.top_left) - bottom_left;
        let (width_m, height_m) = (along_width.length(), along_height.length());
        let right = along_width / width_m;
        // The corners may be off a rectangle by a millimetre; the frustum must not be.
        let back = right.cross(along_height / height_m).normalize();
        let up = back.cross(right);
        let lower_left = bottom_left - DVec3::from(head_m);
        let distance_m = -lower_left.dot(back);
        (distance_m > 0.0 && distance_m.is_finite()).then(|| EyeToScreen {
            lower_left_m: lower_left.to_array(),
            right: right.to_array(),
            up: up.to_array(),
            back: back.to_array(),
            width_m,
            height_m,
            distance_m,
        })
    }

    /// Pixels per radian of view from a head. At distance ρ from the foot of the perpendicular of
    /// length d, a radian covers (d² + ρ²)/d metres in radial direction and √(d² + ρ²) across: least at
    /// the foot, and convex, so most at a corner. `None` for a head on or behind the screen's plane.
    #[must_use]
    pub fn pixels_per_radian(&self, head_m: [f64; 3]) -> Option<PixelDensity> {
        let seen = self.eye_to_screen(head_m)?;
        let [width, height] = self.size_px.map(f64::from);
        let (across, along) = (width / seen.width_m, height / seen.height_m);
        let d = seen.distance_m;
        let farthest_squared = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
            .map(|(x, y)| DVec3::from(seen.to_canvas_m(self.size_px, x, y)).length_squared())
            .into_iter()
            .fold(0.0, f64::max);
        Some(PixelDensity {
            sparsest: across.min(along) * d,
            densest: across.max(along) * farthest_squared / d,
        })
    }
}

impl Wall {
    /// The most pixels there are to a radian of view anywhere on the wall, seen from its observers.
    /// An error of one part in this many of a radian is at most one pixel on every channel.
    #[must_use]
    pub fn pixels_per_radian(&self) -> f64 {
        self.pixels_per_radian_from(&self.heads_m())
    }

    /// As [`Wall::pixels_per_radian`], for tracked heads in the order of the observers. Heads without a
    /// view of their screen do not count.
    #[must_use]
    pub fn pixels_per_radian_from(&self, heads_m: &[[f64; 3]]) -> f64 {
        let density = |screen: &Screen| {
            let head_m = heads_m.get(screen.observer)?;
            Some(screen.pixels_per_radian(*head_m)?.densest)
        };
        self.screens.iter().filter_map(density).fold(0.0, f64::max)
    }

    /// Where each piece of each canvas is shown: what composes the outputs' pictures into one picture
    /// per screen, of [`Screen::size_px`]. What no piece covers lies behind bezels.
    #[must_use]
    pub fn canvas_layout(&self) -> Vec<CanvasPiece> {
        let mut pieces = Vec::new();
        for (host_index, host) in self.hosts.iter().enumerate() {
            for (output_index, output) in host.outputs.iter().enumerate() {
                pieces.extend(output.channels.iter().map(|channel| CanvasPiece {
                    screen: channel.screen,
                    host: host_index,
                    output: output_index,
                    canvas_px: channel.canvas_px,
                    output_px: channel.output_px,
                }));
            }
        }
        pieces
    }
}
