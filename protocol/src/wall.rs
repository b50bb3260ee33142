//! A display installation: observers, screens, and the hosts whose outputs show them.
//! In: TOML text. Out: a validated [`Wall`], or an error that names file, line, value and remedy.
//! Room frame: metres, right-handed, x right, y up, z towards the viewers. It opens no file.

mod adjust;
mod check;
mod check_output;
mod check_screen;
mod geometry;
mod observer;
mod output;
mod raw;
mod raw_output;
mod raw_screen;
mod raw_tracker;
mod screen;
mod surfaces;
mod tracker;

use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, Document, Problem};

pub use geometry::{CanvasPiece, EyeToScreen, PixelDensity, Sight};
pub use observer::{Eye, Head, Observer, Viewers};
pub use output::{Blend, Calibration, Channel, Host, Output, Rect, Stereo, WindowPlacement};
pub use screen::{CylinderCanvas, PlanarCorners, Screen, ScreenShape, SphereCanvas};
pub use surfaces::{CalibratedChannel, Surfaces};
pub use tracker::{Axes, Body, Smoothing, Tracker, TrackerSource};

/// Why a wall was refused.
pub type WallError = ConfigError;

/// Most observers a wall may have; it keeps every view message within one datagram.
pub const MAX_OBSERVERS: usize = 16;
/// Most hosts a wall may have.
pub const MAX_HOSTS: usize = 256;
/// Most trackers a wall may have.
pub const MAX_TRACKERS: usize = 16;
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
    /// What follows their heads, up to 16.
    pub trackers: Vec<Tracker>,
    /// The screens, 1…256. Each one is a canvas.
    pub screens: Vec<Screen>,
    /// The machines that draw, 1…256.
    pub hosts: Vec<Host>,
    /// What every node may keep.
    pub cache: CacheBudgets,
}

/// What a node may keep, in MiB. Over budget, quality drops and nothing else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheBudgets {
    /// On each GPU.
    pub gpu_mib: u64,
    /// In main memory, at least 64.
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

    /// The same room with a share of the pixels, for trying a wall on a machine that cannot draw all of them: canvases,
    /// outputs, channels and ramps shrink alike, to whole pixels. `share` is > 0, and usually below 1.
    #[must_use]
    pub fn with_share_of_pixels(&self, share: f64) -> Self {
        let scale =
            |pixels: u32| ((f64::from(pixels) * share).round() as u32).clamp(1, MAX_SIZE_PX);
        let place = |pixels: u32| (f64::from(pixels) * share).round() as u32;
        let mut wall = self.clone();
        for screen in &mut wall.screens {
            screen.size_px = screen.size_px.map(scale);
        }
        for output in wall.hosts.iter_mut().flat_map(|host| &mut host.outputs) {
            output.size_px = output.size_px.map(scale);
            for channel in &mut output.channels {
                // Edges that were one stay one.
                let rect = channel.canvas_px;
                let (x, y) = (place(rect.x), place(rect.y));
                channel.canvas_px = Rect {
                    x,
                    y,
                    width: place(rect.right()).saturating_sub(x).max(1),
                    height: place(rect.bottom()).saturating_sub(y).max(1),
                };
                let shown = channel.output_rect();
                channel.output_px = channel.output_px.map(place);
                let [x, y] = channel.output_px;
                channel.size_px = match channel.calibration {
                    None => [channel.canvas_px.width, channel.canvas_px.height],
                    Some(_) => [
                        place(shown.right()).saturating_sub(x).max(1),
                        place(shown.bottom()).saturating_sub(y).max(1),
                    ],
                };
                // Rounding may have pushed a channel over the edge by a pixel.
                for (axis, size) in channel.size_px.into_iter().enumerate() {
                    let most = output.size_px[axis].saturating_sub(size);
                    channel.output_px[axis] = channel.output_px[axis].min(most);
                }
                channel.blend.ramps_px = channel.blend.ramps_px.map(place);
            }
        }
        wall
    }

    /// The files that the wall names, for the master to say where they are.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let of_screens = self
            .screens
            .iter_mut()
            .filter_map(|screen| match &mut screen.shape {
                ScreenShape::Surface { file, .. } => Some(file),
                _ => None,
            });
        let outputs = self.hosts.iter_mut().flat_map(|host| &mut host.outputs);
        let channels = outputs.flat_map(|output| &mut output.channels);
        let of_channels =
            channels.filter_map(|channel| Some(&mut channel.calibration.as_mut()?.file));
        of_screens.chain(of_channels)
    }

    /// The heads of all observers as long as nothing tracks them.
    #[must_use]
    pub fn heads(&self) -> Vec<Head> {
        self.observers.iter().map(Observer::resting_head).collect()
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
                channels: vec![Channel {
                    screen: index,
                    canvas_px,
                    size_px: screen.size_px,
                    ..Channel::default()
                }],
                ..Output::default()
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
