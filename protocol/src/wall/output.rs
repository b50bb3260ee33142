//! Hosts, their outputs, and what each output shows of which screen.
//! Plain data of a wall.

use serde::{Deserialize, Serialize};

use super::Eye;

/// A machine that draws. Its name is the name of its node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Host {
    /// Unique among the hosts.
    pub name: String,
    /// Its pictures, 1…256.
    pub outputs: Vec<Output>,
}

/// One picture of a host: a window, or an image that only exists in memory.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Unique within the host.
    pub name: String,
    /// Width and height in pixels, each 1…16384.
    pub size_px: [u32; 2],
    /// Where its window goes; `None` for an output that is always headless.
    pub window: Option<WindowPlacement>,
    /// Number of the graphics adapter that draws it, from 0: fastest kinds first. `None`: the one that the node opens.
    pub gpu: Option<u32>,
    /// How the pictures of both eyes share it.
    pub stereo: Stereo,
    /// The right eye's picture goes where the left one's is due, and the other way round.
    pub swap_eyes: bool,
    /// The exponent by which the display turns values into light, where that is not the sRGB curve. 1…4.
    pub gamma: Option<f64>,
    /// What it shows, 1…64. Channels of one output do not overlap.
    pub channels: Vec<Channel>,
}

/// How the pictures of both eyes share one output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Stereo {
    /// They do not: each channel is for the eye that it names.
    #[default]
    Off,
    /// The left half is the left eye's, squeezed to half its width.
    SideBySide,
    /// The upper half is the left eye's, squeezed to half its height.
    TopBottom,
    /// Red is the left eye's, green and blue are the right one's.
    RedCyan,
    /// Green is the left eye's, red and blue are the right one's.
    GreenMagenta,
    /// Red and green are the left eye's, blue is the right one's.
    AmberBlue,
    /// Even rows from the top are the left eye's.
    InterlacedRows,
    /// Even columns from the left are the left eye's.
    InterlacedColumns,
    /// Pixels whose row and column add up to an even number are the left eye's.
    Checkerboard,
}

impl Stereo {
    /// Every way, with its name in wall files.
    pub const NAMES: [(Self, &'static str); 9] = [
        (Self::Off, "off"),
        (Self::SideBySide, "side-by-side"),
        (Self::TopBottom, "top-bottom"),
        (Self::RedCyan, "anaglyph-red-cyan"),
        (Self::GreenMagenta, "anaglyph-green-magenta"),
        (Self::AmberBlue, "anaglyph-amber-blue"),
        (Self::InterlacedRows, "interlaced-rows"),
        (Self::InterlacedColumns, "interlaced-columns"),
        (Self::Checkerboard, "checkerboard"),
    ];
}

/// Where a window goes on the desktop of its host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WindowPlacement {
    /// Upper left corner in desktop pixels, or in those of the monitor where one is named.
    pub position_px: [i32; 2],
    /// Whether it covers the whole monitor.
    pub fullscreen: bool,
    /// Which monitor, from 0 in the window system's order.
    pub monitor: Option<u32>,
    /// Whether the pointer is to be seen in it.
    pub pointer: bool,
}

/// A rectangle of a canvas that an output shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// Index into [`super::Wall::screens`].
    pub screen: usize,
    /// The eye that it is for. Of no account where the output shows both.
    pub eye: Eye,
    /// The part of that screen's canvas.
    pub canvas_px: Rect,
    /// Where its upper left corner goes in the output.
    pub output_px: [u32; 2],
    /// Width and height in the output: those of `canvas_px`, unless a calibration says where pixels fall.
    pub size_px: [u32; 2],
    /// How it fades into neighbours that show the same.
    pub blend: Blend,
    /// What a file says of where its pixels fall, and how bright they are to be.
    pub calibration: Option<Calibration>,
}

impl Channel {
    /// What it covers of its output.
    #[must_use]
    pub const fn output_rect(&self) -> Rect {
        let ([x, y], [width, height]) = (self.output_px, self.size_px);
        Rect {
            x,
            y,
            width,
            height,
        }
    }
}

/// How a channel fades into neighbours that show the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Blend {
    /// Pixels over which it fades at its left, right, upper and lower edge.
    pub ramps_px: [u32; 4],
    /// Shape of the ramps, 0.2…5: 1 is even in linear light.
    pub gamma: f64,
    /// Linear light that is added where no ramp is, 0…0.5: what overlapping projectors add of their own where there
    /// are ramps.
    pub black_level: f64,
}

impl Default for Blend {
    fn default() -> Self {
        Self {
            ramps_px: [0; 4],
            gamma: 1.0,
            black_level: 0.0,
        }
    }
}

impl Blend {
    /// Whether it changes anything.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.ramps_px == [0; 4] && self.black_level <= 0.0
    }
}

/// A region of a calibration file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Calibration {
    /// The file, as nodes find it.
    pub file: String,
    /// Its name or number in the file, where that has several.
    pub region: Option<String>,
}

/// A rectangle of pixels. The origin is the upper left corner of the canvas, y points down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Rect {
    /// Left edge.
    pub x: u32,
    /// Upper edge.
    pub y: u32,
    /// Width, ≥ 1.
    pub width: u32,
    /// Height, ≥ 1.
    pub height: u32,
}

impl Rect {
    /// The column just right of the rectangle. Saturates.
    #[must_use]
    pub const fn right(&self) -> u32 {
        self.x.saturating_add(self.width)
    }

    /// The row just below the rectangle. Saturates.
    #[must_use]
    pub const fn bottom(&self) -> u32 {
        self.y.saturating_add(self.height)
    }

    /// Whether the two share a pixel.
    #[must_use]
    pub const fn overlaps(&self, other: &Self) -> bool {
        self.x < other.right()
            && other.x < self.right()
            && self.y < other.bottom()
            && other.y < self.bottom()
    }
}
