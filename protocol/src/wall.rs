//! A display installation: observers, screens, and the hosts whose outputs show them.
//! In: TOML text. Out: a validated [`Wall`], or an error that names file, line, value and remedy.
//! Room frame: metres, right-handed, x right, y up, z towards the viewers. It opens no file.

mod check;
mod geometry;
mod raw;

use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, Document, Problem};

pub use geometry::{CanvasPiece, EyeToScreen, PixelDensity};

/// Why a wall was refused.
pub type WallError = ConfigError;

/// Most observers a wall may have; it keeps every view message within one datagram.
pub const MAX_OBSERVERS: usize = 16;
/// Most hosts a wall may have.
pub const MAX_HOSTS: usize = 256;
/// Most screens a wall may have.
pub const MAX_SCREENS: usize = 256;
/// Most outputs a host may have.
pub const MAX_OUTPUTS: usize = 256;
/// Most channels an output may have.
pub const MAX_CHANNELS: usize = 64;
/// Largest width or height of a canvas or an output in pixels.
pub const MAX_SIZE_PX: u32 = 16_384;

/// A validated display installation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wall {
    /// Its name in reports.
    pub name: String,
    /// Pictures a second that the wall paces itself at, 1…240.
    pub fps: f64,
    /// Who looks at it, 1…16.
    pub observers: Vec<Observer>,
    /// The screens, 1…256. Each one is a canvas.
    pub screens: Vec<Screen>,
    /// The machines that draw, 1…256.
    pub hosts: Vec<Host>,
    /// What every node may keep.
    pub cache: CacheBudgets,
}

/// A viewer for whom pictures are rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observer {
    /// Unique among the observers.
    pub name: String,
    /// Where the head is while nothing tracks it, in room metres.
    pub head_m: [f64; 3],
}

/// A planar screen. It is one canvas: a picture of `size_px` from which channels are cut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Screen {
    /// Unique among the screens.
    pub name: String,
    /// Index into [`Wall::observers`].
    pub observer: usize,
    /// Where the canvas is in the room.
    pub corners_m: PlanarCorners,
    /// Width and height of the canvas in pixels, each 1…16384. Pixels are square within 2 %.
    pub size_px: [u32; 2],
}

/// Three corners of a rectangle in room metres, as its observer sees them; the fourth follows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanarCorners {
    /// Lower left corner.
    pub bottom_left: [f64; 3],
    /// Lower right corner.
    pub bottom_right: [f64; 3],
    /// Upper left corner.
    pub top_left: [f64; 3],
}

/// A machine that draws. Its name is the name of its node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Host {
    /// Unique among the hosts.
    pub name: String,
    /// Its pictures, 1…256.
    pub outputs: Vec<Output>,
}

/// One picture of a host: a window, or an image that only exists in memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Output {
    /// Unique within the host.
    pub name: String,
    /// Width and height in pixels, each 1…16384.
    pub size_px: [u32; 2],
    /// Where its window goes; `None` for an output that is always headless.
    pub window: Option<WindowPlacement>,
    /// What it shows, 1…64. Channels of one output do not overlap.
    pub channels: Vec<Channel>,
}

/// Where a window goes on the desktop of its host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WindowPlacement {
    /// Upper left corner in desktop pixels.
    pub position_px: [i32; 2],
    /// Whether it covers the whole monitor.
    pub fullscreen: bool,
}

/// A rectangle of a canvas that an output shows, pixel for pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Channel {
    /// Index into [`Wall::screens`].
    pub screen: usize,
    /// The part of that screen's canvas.
    pub canvas_px: Rect,
    /// Where its upper left corner goes in the output.
    pub output_px: [u32; 2],
}

/// A rectangle of pixels. The origin is the upper left corner of the canvas, y points down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
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

/// What a node may keep, in MiB. Over budget, quality drops and nothing else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheBudgets {
    /// On each GPU.
    pub gpu_mib: u64,
    /// In main memory.
    pub ram_mib: u64,
    /// On disk, shared by all nodes that share the directory.
    pub disk_mib: u64,
    /// Where the disk cache lives; `None`: the node chooses.
    pub directory: Option<String>,
}

impl Default for CacheBudgets {
    fn default() -> Self {
        Self {
            gpu_mib: 2048,
            ram_mib: 1024,
            disk_mib: 4096,
            directory: None,
        }
    }
}

impl Wall {
    /// Reads and validates a wall. `origin` names the text in errors, usually the file's path.
    ///
    /// # Errors
    /// The first thing that is wrong, with its line and column and what to write instead.
    pub fn parse(text: &str, origin: &str) -> Result<Self, WallError> {
        let document = Document::parse(text, origin)?;
        let wall = raw::read(&document)?;
        wall.check().map_err(|problem| document.error_at(problem))?;
        Ok(wall)
    }

    /// Checks a wall that did not come from [`Wall::parse`], for example one from the wire.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn validate(&self) -> Result<(), WallError> {
        self.check().map_err(Problem::without_origin)
    }

    /// The index of the host with this name.
    #[must_use]
    pub fn host_index(&self, name: &str) -> Option<usize> {
        self.hosts.iter().position(|host| host.name == name)
    }

    /// The heads of all observers in room metres, as long as nothing tracks them.
    #[must_use]
    pub fn heads_m(&self) -> Vec<[f64; 3]> {
        self.observers
            .iter()
            .map(|observer| observer.head_m)
            .collect()
    }

    /// The same canvases on one host "single": one output per screen, of the canvas's size, that shows
    /// all of it. For one screen that is one output.
    #[must_use]
    pub fn single(&self) -> Self {
        let whole = |(index, screen): (usize, &Screen)| {
            let [width, height] = screen.size_px;
            let canvas_px = Rect {
                x: 0,
                y: 0,
                width,
                height,
            };
            Output {
                name: screen.name.clone(),
                size_px: screen.size_px,
                window: None,
                channels: vec![Channel {
                    screen: index,
                    canvas_px,
                    output_px: [0, 0],
                }],
            }
        };
        let outputs = self.screens.iter().enumerate().map(whole).collect();
        Self {
            hosts: vec![Host {
                name: "single".to_owned(),
                outputs,
            }],
            ..self.clone()
        }
    }
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
