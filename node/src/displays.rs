//! What a host's outputs show: plans for the renderer, and with every view the eyes and the planar views.
//!
//! In: a wall, the files that it names, views. Out: the same in the words of `render`. Eyes of planar screens are derived
//! with the four basic operations and square roots only, so that every node computes the same bits. It draws nothing.

mod light;
mod map;

use std::sync::Arc;

use glam::{DMat3, DVec3};
use protocol::wall::{CalibratedChannel, Channel, Eye, Output, Screen, Sight, Stereo, Surfaces};
use protocol::{View, Wall};
use render::{
    ChannelPlan, ChannelSource, EyeView, OutputPlan, PixelRect, PlanarScreen, StereoMode,
    StereoPlan, ViewPoint, WarpPart,
};
use screens::{CoverLimits, SampledMap};

use crate::patterns::{About, ChannelAbout};
use crate::picture::PictureError;

/// The outputs of one host.
pub(crate) struct Displays {
    wall: Wall,
    /// Eyes by observer: what [`ViewPoint::eyes`] holds.
    eyes: Vec<(usize, Eye)>,
    /// What is shown pixel for pixel: the first of [`ViewPoint::views`].
    planar: Vec<Sight>,
    /// Channels that are warped: what [`ViewPoint::warps`] holds.
    warps: Vec<Warp>,
    limits: CoverLimits,
}

/// A channel that is warped for an eye.
struct Warp {
    sight: Sight,
    map: Arc<SampledMap>,
}

impl Displays {
    /// Reads what the outputs of a host need, and plans them. `most_px` is the largest side of a picture on the device.
    pub(crate) fn open(
        wall: &Wall,
        host: usize,
        most_px: u32,
    ) -> Result<(Self, Vec<OutputPlan>), PictureError> {
        let Some(of_host) = wall.hosts.get(host) else {
            let reason = format!("the wall has no host {host}");
            return Err(PictureError::Unavailable(reason));
        };
        let surfaces = shapes(wall)?;
        let mut displays = Self {
            wall: wall.clone(),
            eyes: Vec::new(),
            planar: Vec::new(),
            warps: Vec::new(),
            limits: CoverLimits {
                most_px,
                ..CoverLimits::default()
            },
        };
        let plans = of_host
            .outputs
            .iter()
            .map(|output| displays.plan(output, &surfaces))
            .collect::<Result<_, _>>()?;
        Ok((displays, plans))
    }

    fn plan(&mut self, output: &Output, surfaces: &Surfaces) -> Result<OutputPlan, PictureError> {
        let stereo = stereo_plan(output);
        let mut channels = Vec::new();
        for channel in &output.channels {
            let made = match stereo {
                None => vec![(0, channel.eye)],
                Some(_) => vec![(0, Eye::Left), (1, Eye::Right)],
            };
            channels.extend(self.plan_channel(output, channel, surfaces, &made)?);
        }
        Ok(OutputPlan {
            name: output.name.clone(),
            size_px: output.size_px,
            stereo,
            gamma: output.gamma,
            channels,
        })
    }

    /// The plans of one channel, one for each picture and eye.
    fn plan_channel(
        &mut self,
        output: &Output,
        channel: &Channel,
        surfaces: &Surfaces,
        pictures: &[(usize, Eye)],
    ) -> Result<Vec<ChannelPlan>, PictureError> {
        let refuse = |reason| refusal(output, reason);
        let screen = self.wall.screens.get(channel.screen).cloned();
        let screen = screen.ok_or_else(|| refuse(NO_SCREEN.to_owned()))?;
        let light = light::of_channel(&screen, channel);
        let (light, mapped) =
            map::of_channel(&self.wall, &screen, channel, surfaces, light).map_err(refuse)?;
        let rect = channel.output_rect();
        let output_px = PixelRect {
            x: rect.x,
            y: rect.y,
            width: rect.width,
            height: rect.height,
        };
        let mut plans = Vec::with_capacity(pictures.len());
        for (picture, eye) in pictures {
            let sight = Sight {
                screen: channel.screen,
                eye: *eye,
            };
            let source = match &mapped {
                None => ChannelSource::Canvas {
                    view: number_of(&mut self.planar, sight),
                    origin_px: [channel.canvas_px.x, channel.canvas_px.y],
                },
                Some((map, sampled)) => {
                    self.warps.push(Warp {
                        sight,
                        map: Arc::clone(sampled),
                    });
                    ChannelSource::Warped {
                        warp: self.warps.len() - 1,
                        map: Arc::clone(map),
                    }
                }
            };
            number_of(&mut self.eyes, (screen.observer, *eye));
            plans.push(ChannelPlan {
                picture: *picture,
                output_px,
                source,
                light: light.clone(),
            });
        }
        Ok(plans)
    }

    /// What the renderer draws for a view.
    pub(crate) fn view_point(&self, view: &View) -> ViewPoint {
        let pose = &view.pose;
        let room = DMat3::from_cols(
            DVec3::from(pose.right),
            DVec3::from(pose.up),
            DVec3::from(pose.back),
        );
        let position = DVec3::from(pose.position_m);
        // The pose is that of the first observer's resting head; every eye moves relative to it.
        let rest = self
            .wall
            .observers
            .first()
            .map_or(DVec3::ZERO, |first| DVec3::from(first.head_m));
        let eyes = self.eyes.iter().map(|(observer, eye)| {
            let of_observer = self.wall.observers.get(*observer);
            let eye_m = of_observer.map_or([0.0; 3], |of| {
                let head = view.viewers.heads.get(*observer).copied();
                head.unwrap_or_else(|| of.resting_head())
                    .eye_m(*eye, of.eye_separation_m)
            });
            position + room * (DVec3::from(eye_m) - rest)
        });
        let mut views: Vec<EyeView> = self
            .planar
            .iter()
            .map(|sight| EyeView {
                eye: self.eye_of(*sight),
                screen: self
                    .wall
                    .screens
                    .get(sight.screen)
                    .map_or(NOTHING, |screen| {
                        planar(screen, self.wall.eye_m(*sight, &view.viewers.heads))
                    }),
            })
            .collect();
        let mut warps = Vec::with_capacity(self.warps.len());
        for warp in &self.warps {
            let eye_m = DVec3::from(self.wall.eye_m(warp.sight, &view.viewers.heads));
            let cover = warp.map.cover(eye_m, &self.limits);
            let parts = cover.parts.into_iter().map(|part| {
                views.push(EyeView {
                    eye: self.eye_of(warp.sight),
                    screen: PlanarScreen {
                        lower_left_m: part.view.lower_left_m,
                        right: part.view.right,
                        up: part.view.up,
                        size_m: part.view.size_m,
                        size_px: part.view.size_px,
                    },
                });
                let [x, y, width, height] = part.rect_px;
                WarpPart {
                    rect_px: PixelRect {
                        x,
                        y,
                        width,
                        height,
                    },
                    view: views.len() - 1,
                    eye_m,
                }
            });
            warps.push(parts.collect());
        }
        ViewPoint {
            eyes: eyes.collect(),
            room,
            views,
            warps,
            pixels_per_radian: view.viewers.pixels_per_radian,
        }
    }

    /// What test patterns tell of each output of a host.
    pub(crate) fn about(&self, host: usize, adapter: &str) -> Vec<About> {
        let Some(of_host) = self.wall.hosts.get(host) else {
            return Vec::new();
        };
        let name_of = |channel: &Channel| {
            let screen = self.wall.screens.get(channel.screen);
            screen.map_or_else(String::new, |screen| screen.name.clone())
        };
        let about = |output: &Output| About {
            wall: self.wall.name.clone(),
            host: of_host.name.clone(),
            output: output.name.clone(),
            adapter: adapter.to_owned(),
            size_px: output.size_px,
            channels: output
                .channels
                .iter()
                .map(|channel| ChannelAbout {
                    screen: name_of(channel),
                    eye: match (output.stereo, channel.eye) {
                        (Stereo::Off, Eye::Centre) => "centre",
                        (Stereo::Off, Eye::Left) => "left",
                        (Stereo::Off, Eye::Right) => "right",
                        _ => "both",
                    }
                    .to_owned(),
                    rect: channel.output_rect(),
                    ramps_px: channel.blend.ramps_px,
                })
                .collect(),
            stereo: Stereo::NAMES
                .iter()
                .find(|(stereo, _)| *stereo == output.stereo)
                .map_or_else(String::new, |(_, name)| (*name).to_owned()),
            gamma: output.gamma,
        };
        of_host.outputs.iter().map(about).collect()
    }

    fn eye_of(&self, sight: Sight) -> usize {
        let observer = self
            .wall
            .screens
            .get(sight.screen)
            .map_or(0, |screen| screen.observer);
        let known = self.eyes.iter();
        let mut known = known.enumerate();
        known
            .find(|(_, eye)| **eye == (observer, sight.eye))
            .map_or(0, |(number, _)| number)
    }
}

/// The surfaces of a wall's screens, with the points of the files that it names.
fn shapes(wall: &Wall) -> Result<Surfaces, PictureError> {
    Surfaces::load(wall, map::surface).map_err(PictureError::Unavailable)
}

/// The same with all calibrated channels.
pub(crate) fn surfaces(wall: &Wall) -> Result<Surfaces, PictureError> {
    let surfaces = shapes(wall)?;
    let mut calibrated = Vec::new();
    for (host, of_host) in wall.hosts.iter().enumerate() {
        for (output, of_output) in of_host.outputs.iter().enumerate() {
            for (channel, of_channel) in of_output.channels.iter().enumerate() {
                let Some(named) = &of_channel.calibration else {
                    continue;
                };
                let refuse = |reason| refusal(of_output, reason);
                let screen = wall.screens.get(of_channel.screen);
                let screen = screen.ok_or_else(|| refuse(NO_SCREEN.to_owned()))?;
                let map = map::of_calibrated(wall, screen, of_channel, named, &surfaces);
                calibrated.push(CalibratedChannel {
                    host,
                    output,
                    channel,
                    map: map.map_err(refuse)?,
                });
            }
        }
    }
    Ok(surfaces.with_calibrated(wall, calibrated))
}

const NO_SCREEN: &str = "a channel has no screen";

fn refusal(output: &Output, reason: String) -> PictureError {
    PictureError::Unavailable(format!("output \"{}\": {reason}", output.name))
}

/// The number of a thing in a list, to which it is added where it is not in it.
fn number_of<T: PartialEq>(list: &mut Vec<T>, thing: T) -> usize {
    let known = list.iter().position(|known| *known == thing);
    known.unwrap_or_else(|| {
        list.push(thing);
        list.len() - 1
    })
}

/// A screen of no size, on which nothing is drawn.
const NOTHING: PlanarScreen = PlanarScreen {
    lower_left_m: DVec3::NEG_Z,
    right: DVec3::X,
    up: DVec3::Y,
    size_m: [1.0, 1.0],
    size_px: [0, 0],
};

/// A planar screen from an eye. An eye behind it, which only a tracker can report, sees nothing.
fn planar(screen: &Screen, eye_m: [f64; 3]) -> PlanarScreen {
    screen
        .eye_to_screen(eye_m)
        .map_or(NOTHING, |seen| PlanarScreen {
            lower_left_m: DVec3::from(seen.lower_left_m),
            right: DVec3::from(seen.right),
            up: DVec3::from(seen.up),
            size_m: [seen.width_m, seen.height_m],
            size_px: screen.size_px,
        })
}

fn stereo_plan(output: &Output) -> Option<StereoPlan> {
    let anaglyph = |left| StereoMode::Anaglyph { left };
    let mode = match output.stereo {
        Stereo::Off => return None,
        Stereo::SideBySide => StereoMode::SideBySide,
        Stereo::TopBottom => StereoMode::TopBottom,
        Stereo::RedCyan => anaglyph([true, false, false]),
        Stereo::GreenMagenta => anaglyph([false, true, false]),
        Stereo::AmberBlue => anaglyph([true, true, false]),
        Stereo::InterlacedRows => StereoMode::Rows,
        Stereo::InterlacedColumns => StereoMode::Columns,
        Stereo::Checkerboard => StereoMode::Checkerboard,
    };
    Some(StereoPlan {
        mode,
        swapped: output.swap_eyes,
    })
}
