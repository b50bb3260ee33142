//! What the pictures of a wall fall on: the surfaces of its screens, and pixels that calibration files put in place.
//! In: a validated wall, what the files say that it names. Out: shapes, and how dense pixels are for heads. It opens no file.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec3;
use screens::{SampledMap, Shape};

use super::geometry::of_surface;
use super::{Channel, Head, Output, ScreenShape, Sight, Viewers, Wall};

/// A channel whose pixels a calibration file puts in place, wherever its canvas is.
#[derive(Clone, Debug)]
pub struct CalibratedChannel {
    /// Index into [`Wall::hosts`].
    pub host: usize,
    /// Index into that host's outputs.
    pub output: usize,
    /// Index into that output's channels.
    pub channel: usize,
    /// From its pixels to room points.
    pub map: Arc<SampledMap>,
}

/// The surfaces of a wall's screens, with what their files say, and its calibrated channels.
#[derive(Clone, Debug)]
pub struct Surfaces {
    shapes: Vec<Option<Shape>>,
    calibrated: Vec<CalibratedChannel>,
    /// Every screen with every eye for which some channel shows its canvas.
    canvases: Vec<Sight>,
}

impl CalibratedChannel {
    /// Its output and itself. `None` in another wall than its own.
    #[must_use]
    pub fn in_wall<'w>(&self, wall: &'w Wall) -> Option<(&'w Output, &'w Channel)> {
        let output = wall.hosts.get(self.host)?.outputs.get(self.output)?;
        Some((output, output.channels.get(self.channel)?))
    }
}

impl Surfaces {
    /// All surfaces, without calibrated channels. `load` reads the points of a file whose unit is so many metres.
    ///
    /// # Errors
    /// What `load` fails with.
    pub fn load<E>(
        wall: &Wall,
        mut load: impl FnMut(&str, f64) -> Result<screens::Points, E>,
    ) -> Result<Self, E> {
        let mut shapes = Vec::with_capacity(wall.screens.len());
        for screen in &wall.screens {
            shapes.push(match (screen.shape.smooth(), &screen.shape) {
                (None, ScreenShape::Surface { file, unit_m }) => {
                    Some(Shape::Points(load(file, *unit_m)?))
                }
                (smooth, _) => smooth,
            });
        }
        Ok(Self {
            shapes,
            calibrated: Vec::new(),
            canvases: wall.sights(),
        })
    }

    /// The same with these channels of that wall, whose pixels are then no longer counted as those of their canvas.
    #[must_use]
    pub fn with_calibrated(self, wall: &Wall, calibrated: Vec<CalibratedChannel>) -> Self {
        let places = calibrated
            .iter()
            .map(|calibrated| (calibrated.host, calibrated.output, calibrated.channel));
        let places: BTreeSet<(usize, usize, usize)> = places.collect();
        let mut canvases = Vec::new();
        for (host, of_host) in wall.hosts.iter().enumerate() {
            for (output, of_output) in of_host.outputs.iter().enumerate() {
                let channels = of_output.channels.iter().enumerate();
                let plain = channels
                    .filter(|(channel, _)| !places.contains(&(host, output, *channel)))
                    .flat_map(|(_, channel)| of_output.sights_of(channel));
                canvases.extend(plain);
            }
        }
        canvases.sort_unstable();
        canvases.dedup();
        Self {
            calibrated,
            canvases,
            ..self
        }
    }

    /// The channels that calibration files put in place.
    #[must_use]
    pub fn calibrated(&self) -> &[CalibratedChannel] {
        &self.calibrated
    }

    /// The surface of a screen, by its index into [`Wall::screens`].
    #[must_use]
    pub fn shape(&self, screen: usize) -> Option<&Shape> {
        self.shapes.get(screen)?.as_ref()
    }

    /// The viewers of a wall with these heads.
    #[must_use]
    pub fn viewers(&self, wall: &Wall, heads: Vec<Head>) -> Viewers {
        // Where nobody sees anything, any number will do.
        let pixels_per_radian = self.pixels_per_radian_from(wall, &heads).max(1.0);
        Viewers {
            heads,
            pixels_per_radian,
        }
    }

    /// The most pixels there are to a radian of view anywhere on the wall, for heads in the order of its observers: of
    /// canvases, and of calibrated channels where they fall. Eyes without a view of their screen do not count. An error
    /// of one part in this many of a radian is at most one pixel on every channel.
    #[must_use]
    pub fn pixels_per_radian_from(&self, wall: &Wall, heads: &[Head]) -> f64 {
        let of_canvases = self.canvases.iter().filter_map(|sight| {
            let screen = wall.screens.get(sight.screen)?;
            let eye_m = wall.eye_m(*sight, heads);
            let density = match screen.shape {
                ScreenShape::Surface { .. } => {
                    of_surface(self.shape(sight.screen)?, screen.size_px, eye_m)?
                }
                _ => screen.pixels_per_radian(eye_m)?,
            };
            Some(density.densest)
        });
        let of_channels = self.calibrated.iter().flat_map(|calibrated| {
            let sights = calibrated
                .in_wall(wall)
                .map(|(output, channel)| output.sights_of(channel));
            sights.into_iter().flatten().filter_map(|sight| {
                let eye_m = DVec3::from(wall.eye_m(sight, heads));
                Some(calibrated.map.density(eye_m)?.densest)
            })
        });
        of_canvases.chain(of_channels).fold(0.0, f64::max)
    }
}
