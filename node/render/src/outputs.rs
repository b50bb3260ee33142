//! What outputs show: which part of which view goes where, through which map, in which light, for which eye.
//! Plain data that the node fills in. It touches no device.

use std::sync::Arc;

use glam::DVec3;

use crate::canvas::PixelRect;

/// One output: a window or a headless picture.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputPlan {
    /// Its name, for captures and errors.
    pub name: String,
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// How the pictures of both eyes share it; `None` for an output with one picture.
    pub stereo: Option<StereoPlan>,
    /// The exponent of the display, where that is not the sRGB curve.
    pub gamma: Option<f64>,
    /// What it shows.
    pub channels: Vec<ChannelPlan>,
}

/// How the pictures of both eyes share an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StereoPlan {
    /// Which pixels are whose.
    pub mode: StereoMode,
    /// Each picture takes the other's place.
    pub swapped: bool,
}

/// Which pixels of an output are which eye's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StereoMode {
    /// Halves, the left eye's on the left.
    SideBySide,
    /// Halves, the left eye's above.
    TopBottom,
    /// Components of colour: which of red, green and blue are the left eye's.
    Anaglyph {
        /// Red, green, blue.
        left: [bool; 3],
    },
    /// Rows, the first one the left eye's.
    Rows,
    /// Columns, the first one the left eye's.
    Columns,
    /// As a chessboard, the first pixel the left eye's.
    Checkerboard,
}

/// A rectangle of an output, and what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelPlan {
    /// In which picture it lies: 0, or 1 for the right eye's of a stereo output.
    pub picture: usize,
    /// Where it lies in that picture.
    pub output_px: PixelRect,
    /// What it shows.
    pub source: ChannelSource,
    /// How bright its pixels are to be; `None` where they stay as they are.
    pub light: Option<Arc<LightMap>>,
}

/// What a channel shows.
#[derive(Clone, Debug, PartialEq)]
pub enum ChannelSource {
    /// A part of a planar view, pixel for pixel.
    Canvas {
        /// Index into [`ViewPoint::views`](crate::ViewPoint::views).
        view: usize,
        /// Upper left corner of the part.
        origin_px: [u32; 2],
    },
    /// Points of a screen, through the planar views that cover it.
    Warped {
        /// Index into [`ViewPoint::warps`](crate::ViewPoint::warps).
        warp: usize,
        /// Which point each pixel lights.
        map: Arc<WarpMap>,
    },
}

/// The point of the room that each pixel of a channel lights, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpMap {
    /// Width and height in pixels: those of the channel.
    pub size_px: [u32; 2],
    /// Room metres at the pixels' centres; not a number where a pixel lights nothing.
    pub points_m: Vec<[f32; 3]>,
}

impl WarpMap {
    /// The point that a pixel lights.
    #[must_use]
    pub fn point_m(&self, x: u32, y: u32) -> Option<DVec3> {
        let index =
            (x < self.size_px[0]).then_some(y as usize * self.size_px[0] as usize + x as usize)?;
        let point = DVec3::from(self.points_m.get(index)?.map(f64::from));
        point.is_finite().then_some(point)
    }
}

/// How bright each pixel of a channel is to be, in linear light, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct LightMap {
    /// Width and height in pixels: those of the channel.
    pub size_px: [u32; 2],
    /// The share of its light that a pixel keeps: red, green, blue, each 0…1.
    pub alpha: Vec<[f32; 3]>,
    /// The black level that it is raised to, each 0…1; empty for none.
    pub beta: Vec<[f32; 3]>,
    /// How: with black k, light c becomes the larger of k and c·(1 − dark·bright·k) + dark·k.
    pub uplift: Uplift,
}

/// How black is lifted. 1 and 1 lift the whole range and keep it within full light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uplift {
    /// 0: what is darker than the black level is set to it; 1: everything is raised by it.
    pub dark: f32,
    /// 1: what is raised is scaled to stay within full light.
    pub bright: f32,
}

impl Default for Uplift {
    fn default() -> Self {
        Self {
            dark: 1.0,
            bright: 1.0,
        }
    }
}

/// A part of a channel, and the planar view that covers it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarpPart {
    /// The part, in pixels of the channel.
    pub rect_px: PixelRect,
    /// Index into [`ViewPoint::views`](crate::ViewPoint::views).
    pub view: usize,
    /// The eye of that view in room metres.
    pub eye_m: DVec3,
}

impl OutputPlan {
    /// How many pictures are drawn for it.
    pub(crate) const fn pictures(&self) -> usize {
        match self.stereo {
            Some(_) => 2,
            None => 1,
        }
    }
}

impl ChannelPlan {
    /// Whether the pixels of its view are its own, unchanged.
    pub(crate) const fn is_plain(&self, output: &OutputPlan) -> bool {
        matches!(self.source, ChannelSource::Canvas { .. })
            && self.light.is_none()
            && output.gamma.is_none()
    }
}
