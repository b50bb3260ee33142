//! Nodes, pipes, windows and channels of Equalizer.
//! In: their blocks. Out: hosts with outputs that show nothing yet, and the channels into which canvases and compounds
//! put pictures. A pipe is a graphics adapter, a window an output.

use super::{global_of, name_of};
use crate::draft::{Builder, Host, MAX_POSITION_PX, MAX_SIZE_PX, Output, Window};
use crate::error::Trouble;
use crate::place::region_of_shares;
use crate::source::{At, parse_number};

/// The pixels of a pipe that states none.
const PIPE_PX: [i64; 2] = [1920, 1080];

/// All machines.
#[derive(Default)]
pub(super) struct Machines<'t> {
    hosts: Vec<(At<'t>, Host)>,
    windows: Vec<WindowBlock<'t>>,
    pub(super) channels: Vec<ChannelBlock<'t>>,
}

struct WindowBlock<'t> {
    at: At<'t>,
    host: usize,
    output: Output,
    /// Whether the window asks its driver for pairs of pictures.
    is_quad_buffered: bool,
}

/// A part of a window.
#[derive(Clone)]
pub(super) struct ChannelBlock<'t> {
    pub(super) at: At<'t>,
    pub(super) name: Option<&'t str>,
    window: usize,
    /// x, y from the upper left corner of the window, width, height.
    pub(super) region_px: [i64; 4],
    /// Whether a canvas or a compound puts a picture into it.
    is_used: bool,
}

/// Reads the machines of a configuration.
pub(super) fn read<'t>(
    config: At<'t>,
    global: Option<At<'t>>,
    builder: &mut Builder,
) -> Result<Machines<'t>, Trouble> {
    let mut machines = Machines::default();
    let nodes = config
        .children()
        .filter(|at| matches!(at.key(), "node" | "appNode"));
    for node in nodes {
        node.carry();
        let connection = node.get("connection").and_then(|at| at.get("hostname"));
        let name = match (node.get("name"), connection.or_else(|| node.get("host"))) {
            (Some(name), _) | (None, Some(name)) => name.text()?.to_owned(),
            (None, None) if node.key() == "appNode" => "application".to_owned(),
            (None, None) => format!("node-{}", machines.hosts.len() + 1),
        };
        let host = machines.hosts.len();
        machines.hosts.push((
            node,
            Host {
                name,
                outputs: Vec::new(),
            },
        ));
        for pipe in node.all("pipe") {
            machines.read_pipe(pipe, host, global, builder)?;
        }
    }
    Ok(machines)
}

/// Whether an attribute is on: `ON`, `QUAD` or a number above 0. `AUTO` is not.
fn is_on(at: At<'_>) -> Result<bool, Trouble> {
    match at.text()? {
        "ON" | "QUAD" => Ok(true),
        "OFF" | "AUTO" => Ok(false),
        number => number
            .parse::<i32>()
            .map(|number| number > 0)
            .map_err(|_| at.expected("one of ON, OFF, AUTO, QUAD or a whole number")),
    }
}

impl<'t> Machines<'t> {
    fn read_pipe(
        &mut self,
        pipe: At<'t>,
        host: usize,
        global: Option<At<'t>>,
        builder: &mut Builder,
    ) -> Result<(), Trouble> {
        pipe.carry();
        let gpu = pipe
            .get("device")
            .map(|device| device.integer(0, 255))
            .transpose()?;
        let mut uses_place = false;
        let uses_size = pipe
            .all("window")
            .any(|window| match window.get("viewport") {
                Some(viewport) => !is_in_pixels(viewport),
                None => true,
            });
        let [x, y, width, height] = match pipe.get("viewport") {
            Some(viewport) => pixels(viewport)?,
            None => {
                if uses_size {
                    builder.ledger.note(
                        pipe,
                        "viewport is not stated",
                        format!("Equalizer asks the monitor; {}×{} pixels are assumed", PIPE_PX[0], PIPE_PX[1]),
                        "write the projector's pixels as size_px of the output, the screen and canvas_px",
                    );
                }
                [0, 0, PIPE_PX[0], PIPE_PX[1]]
            }
        };
        for window in pipe.all("window") {
            let number = self
                .windows
                .iter()
                .filter(|other| other.host == host)
                .count()
                + 1;
            let region = match window.carry().get("viewport") {
                Some(viewport) => region_of(viewport, [width, height], false)?,
                None => [0, 0, width, height],
            };
            let attributes = window.get("attributes");
            let attribute = |key: &'static str, default: &'static str| {
                attributes
                    .and_then(|attributes| attributes.get(key))
                    .or_else(|| global_of(global, default))
            };
            let drawable = attribute("hint_drawable", "EQ_WINDOW_IATTR_HINT_DRAWABLE");
            let headless = match drawable {
                Some(at) => at.one_of(&[
                    ("window", false),
                    ("FBO", true),
                    ("pbuffer", true),
                    ("OFF", true),
                    ("AUTO", false),
                ])?,
                None => false,
            };
            uses_place |= !headless;
            if headless && let Some(viewport) = window.get("viewport") {
                builder.ledger.note(
                    viewport,
                    viewport.source(),
                    "its window is not on a desktop, so its size is carried over and its place is not",
                    "nothing",
                );
            }
            let fullscreen = attribute("hint_fullscreen", "EQ_WINDOW_IATTR_HINT_FULLSCREEN");
            let output = Output {
                name: match name_of(window)? {
                    Some(name) => name.to_owned(),
                    None => format!("window-{number}"),
                },
                size_px: [region[2], region[3]],
                window: (!headless).then_some(Window {
                    position_px: [x + region[0], y + region[1]],
                    fullscreen: fullscreen.map_or(Ok(false), is_on)?,
                    monitor: None,
                }),
                gpu,
                ..Output::default()
            };
            let stereo = attribute("hint_stereo", "EQ_WINDOW_IATTR_HINT_STEREO");
            let is_quad_buffered = stereo.map_or(Ok(false), is_on)?;
            let block = self.windows.len();
            for channel in window.all("channel") {
                let size = output.size_px;
                self.channels.push(ChannelBlock {
                    at: channel.carry(),
                    name: name_of(channel)?,
                    window: block,
                    region_px: match channel.get("viewport") {
                        Some(viewport) => region_of(viewport, size, true)?,
                        None => [0, 0, size[0], size[1]],
                    },
                    is_used: false,
                });
            }
            self.windows.push(WindowBlock {
                at: window,
                host,
                output,
                is_quad_buffered,
            });
        }
        if let Some(viewport) = pipe.get("viewport").filter(|_| !(uses_size && uses_place)) {
            builder.ledger.note(
                viewport,
                viewport.source(),
                "its windows have sizes in pixels, or no place on a desktop, so they do not need all of it",
                "nothing",
            );
        }
        Ok(())
    }

    /// The first channel of that name.
    pub(super) fn channel(&self, name: &str) -> Option<ChannelBlock<'t>> {
        self.channels
            .iter()
            .find(|channel| channel.name == Some(name))
            .cloned()
    }

    /// Whether a canvas or a compound has put a picture into the first channel of that name.
    pub(super) fn is_used(&self, name: &str) -> bool {
        self.channel(name).is_some_and(|channel| channel.is_used)
    }

    /// Remembers that a picture is put into the first channel of that name.
    pub(super) fn set_used(&mut self, name: &str) {
        if let Some(channel) = self.channels.iter_mut().find(|c| c.name == Some(name)) {
            channel.is_used = true;
        }
    }

    /// The output of a channel, and whether its window asks for pairs of pictures.
    pub(super) fn output(&mut self, channel: &ChannelBlock<'t>) -> Option<(&mut Output, bool)> {
        let window = self.windows.get_mut(channel.window)?;
        Some((&mut window.output, window.is_quad_buffered))
    }

    /// Hands all hosts to the draft. Windows that show nothing are listed.
    pub(super) fn finish(mut self, builder: &mut Builder) -> Result<(), Trouble> {
        for channel in self.channels.iter().filter(|channel| !channel.is_used) {
            builder.ledger.list(
                channel.at,
                "no canvas and no compound with a wall shows anything in it: it draws for others",
                "nothing: every node draws what it shows",
            );
        }
        for window in self.windows {
            let Some((_, host)) = self.hosts.get_mut(window.host) else {
                continue;
            };
            builder.add_output(window.at, host, window.output)?;
        }
        for (at, host) in self.hosts {
            builder.add_host(at, host)?;
        }
        Ok(())
    }
}

/// x, y, width and height in whole pixels.
fn pixels(at: At<'_>) -> Result<[i64; 4], Trouble> {
    let expected = "[ x y width height ] in pixels, or as shares of what it lies in";
    let numbers = at.numbers::<4>()?.map(|number| number as i64);
    let [x, y, width, height] = numbers;
    let is_sound = [x, y].iter().all(|p| p.abs() <= MAX_POSITION_PX)
        && [width, height]
            .iter()
            .all(|p| (1..=MAX_SIZE_PX).contains(p));
    is_sound
        .then_some(numbers)
        .ok_or_else(|| at.expected(expected))
}

/// Whether a viewport is in pixels: Equalizer tells it from shares by a side above 1.
fn is_in_pixels(at: At<'_>) -> bool {
    at.words()
        .iter()
        .skip(2)
        .filter_map(parse_number)
        .any(|number| number > 1.0)
}

/// A viewport in pixels, or in shares where neither side is above 1, as Equalizer tells them apart. Those of channels
/// count from below.
fn region_of(at: At<'_>, size: [i64; 2], from_below: bool) -> Result<[i64; 4], Trouble> {
    let [x, y, width, height] = at.numbers::<4>()?;
    if is_in_pixels(at) {
        let [x, y, width, height] = pixels(at)?;
        let y = if from_below { size[1] - y - height } else { y };
        return Ok([x, y, width, height]);
    }
    let y = if from_below { y } else { 1.0 - y - height };
    region_of_shares([x, y, width, height], size)
        .ok_or_else(|| at.expected("[ x y width height ] within 0…1 that is not empty"))
}
