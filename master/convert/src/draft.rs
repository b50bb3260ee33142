//! A wall file before it is written.
//! In: observers, trackers, hosts and outputs as readers find them. Out: a draft whose names are usable and unique and
//! whose counts are within what a wall file may have.

use std::collections::HashSet;

use crate::error::Trouble;
use crate::ledger::{Ledger, Lost};
use crate::room::{Corners, ROOM_M};
use crate::source::At;
use crate::stereo::{Eye, Stereo};
use crate::{MAX_HOSTS, MAX_SCREENS};

/// Largest width or height of a canvas or an output in pixels.
pub(crate) const MAX_SIZE_PX: i64 = 16_384;
/// Farthest that a window is placed from the desktop's corner, in pixels.
pub(crate) const MAX_POSITION_PX: i64 = 1 << 20;
/// Most observers, and most trackers.
const MAX_OBSERVERS: usize = 16;
/// Most outputs that a host may have.
const MAX_OUTPUTS: usize = 256;
/// Most channels that an output may have.
pub(crate) const MAX_CHANNELS: usize = 64;
/// Longest name in bytes.
const MAX_NAME_BYTES: usize = 64;
/// Largest distance between the eyes in metres.
const MAX_EYES_M: f64 = 0.2;

#[derive(Debug)]
pub(crate) struct Draft {
    pub(crate) name: String,
    pub(crate) fps: f64,
    pub(crate) observers: Vec<Observer>,
    pub(crate) trackers: Vec<Tracker>,
    pub(crate) screens: Vec<Screen>,
    pub(crate) hosts: Vec<Host>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Observer {
    pub(crate) name: String,
    pub(crate) head_m: [f64; 3],
    pub(crate) looks_deg: [f64; 3],
    pub(crate) eye_separation_m: f64,
    pub(crate) tracker: Option<usize>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tracker {
    pub(crate) name: String,
    /// `DEVICE@HOST[:PORT]`.
    pub(crate) source: String,
    pub(crate) body: i64,
    /// Origin and axes in the room.
    pub(crate) to_room: Option<[[f64; 3]; 4]>,
    pub(crate) unit_m: f64,
    /// Offset in metres and angles in degrees.
    pub(crate) to_head: Option<[[f64; 3]; 2]>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Screen {
    pub(crate) name: String,
    pub(crate) observer: usize,
    pub(crate) size_px: [i64; 2],
    pub(crate) shape: Shape,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    Planar(Corners),
    Dome {
        centre_m: [f64; 3],
        radius_m: f64,
        tilt_deg: f64,
        fisheye_deg: f64,
    },
}

#[derive(Debug)]
pub(crate) struct Host {
    pub(crate) name: String,
    pub(crate) outputs: Vec<Output>,
}

#[derive(Debug, Default)]
pub(crate) struct Output {
    pub(crate) name: String,
    pub(crate) size_px: [i64; 2],
    /// `None`: headless.
    pub(crate) window: Option<Window>,
    pub(crate) gpu: Option<i64>,
    pub(crate) stereo: Stereo,
    pub(crate) swap_eyes: bool,
    pub(crate) channels: Vec<Channel>,
}

#[derive(Debug, Default)]
pub(crate) struct Window {
    pub(crate) position_px: [i64; 2],
    pub(crate) fullscreen: bool,
    pub(crate) monitor: Option<i64>,
}

#[derive(Debug)]
pub(crate) struct Channel {
    pub(crate) screen: usize,
    pub(crate) eye: Eye,
    /// x, y from the upper left corner, width, height.
    pub(crate) canvas_px: [i64; 4],
    pub(crate) output_px: [i64; 2],
    pub(crate) calibration: Option<String>,
}

/// A draft, and the list of what it cannot say.
#[derive(Debug)]
pub(crate) struct Builder {
    pub(crate) draft: Draft,
    pub(crate) ledger: Ledger,
}

impl Builder {
    /// An empty wall, named after the file.
    pub(crate) fn new(origin_name: &str) -> Self {
        let file = origin_name.rsplit(['/', '\\']).next().unwrap_or_default();
        let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
        let name = usable(stem, "wall");
        Self {
            draft: Draft {
                name,
                fps: 60.0,
                observers: Vec::new(),
                trackers: Vec::new(),
                screens: Vec::new(),
                hosts: Vec::new(),
            },
            ledger: Ledger::default(),
        }
    }

    /// Makes the wall's name usable; tells where it had to change.
    pub(crate) fn tidy_name(&mut self, at: At<'_>) {
        let wanted = std::mem::take(&mut self.draft.name);
        self.draft.name = self.unique(at, &wanted, &HashSet::new());
    }

    /// A name like `wanted` that none of `taken` has; tells where it had to change.
    fn unique(&mut self, at: At<'_>, wanted: &str, taken: &HashSet<String>) -> String {
        let base = usable(wanted, "unnamed");
        let mut name = base.clone();
        let mut number = 2_u32;
        while taken.contains(&name) {
            let suffix = format!("-{number}");
            name = format!("{}{suffix}", cut(&base, MAX_NAME_BYTES - suffix.len()));
            number += 1;
        }
        if name != wanted {
            self.ledger.note(
                at,
                format!("the name {}", crate::error::shown(wanted)),
                format!(
                    "names are unique and have 1…{MAX_NAME_BYTES} bytes without control characters, so it is \"{name}\" now"
                ),
                "rename it if another name is better",
            );
        }
        name
    }

    /// Adds an observer and returns its number. An eye separation out of range is listed and left out.
    pub(crate) fn add_observer(
        &mut self,
        at: At<'_>,
        mut observer: Observer,
    ) -> Result<usize, Trouble> {
        let taken: HashSet<_> = self
            .draft
            .observers
            .iter()
            .map(|o| o.name.clone())
            .collect();
        count("observers", taken.len(), MAX_OBSERVERS)?;
        observer.name = self.unique(at, &observer.name, &taken);
        if !observer.head_m.iter().all(|m| m.abs() <= ROOM_M) {
            return Err(Trouble::Value {
                place: at.place(),
                expected: format!("a head at most {ROOM_M} m from the origin"),
                found: format!("{:?}", observer.head_m),
            });
        }
        if !(0.0..=MAX_EYES_M).contains(&observer.eye_separation_m) {
            self.ledger.note(
                at,
                format!("{} m from eye to eye", observer.eye_separation_m),
                format!(
                    "eyes are 0…{MAX_EYES_M} m apart, so the mean of adults, 0.063 m, is taken"
                ),
                "write eye_separation_m in metres",
            );
            observer.eye_separation_m = 0.063;
        }
        self.draft.observers.push(observer);
        Ok(taken.len())
    }

    /// Adds a tracker and returns its number; one that is there already is shared.
    pub(crate) fn add_tracker(
        &mut self,
        at: At<'_>,
        mut tracker: Tracker,
    ) -> Result<usize, Trouble> {
        if let Some(same) = self
            .draft
            .trackers
            .iter()
            .position(|other| *other == tracker)
        {
            return Ok(same);
        }
        let taken: HashSet<_> = self.draft.trackers.iter().map(|t| t.name.clone()).collect();
        count("trackers", taken.len(), MAX_OBSERVERS)?;
        tracker.name = self.unique(at, &tracker.name, &taken);
        self.draft.trackers.push(tracker);
        Ok(taken.len())
    }

    /// The number of this screen, which is added unless it is there already.
    pub(crate) fn screen(&mut self, at: At<'_>, mut screen: Screen) -> Result<usize, Trouble> {
        let same = |other: &Screen| {
            (other.observer, other.size_px, other.shape)
                == (screen.observer, screen.size_px, screen.shape)
        };
        if let Some(same) = self.draft.screens.iter().position(same) {
            return Ok(same);
        }
        let taken: HashSet<_> = self.draft.screens.iter().map(|s| s.name.clone()).collect();
        count("screens", taken.len(), MAX_SCREENS)?;
        screen.name = self.unique(at, &screen.name, &taken);
        self.draft.screens.push(screen);
        Ok(taken.len())
    }

    pub(crate) fn add_host(&mut self, at: At<'_>, mut host: Host) -> Result<(), Trouble> {
        if host.outputs.is_empty() {
            self.ledger.list(
                at,
                "no picture of this machine can be carried over, so it is left out",
                "nothing, if it shows nothing; else see what is listed about its windows",
            );
            return Ok(());
        }
        let taken: HashSet<_> = self.draft.hosts.iter().map(|h| h.name.clone()).collect();
        count("hosts", taken.len(), MAX_HOSTS)?;
        host.name = self.unique(at, &host.name, &taken);
        self.draft.hosts.push(host);
        Ok(())
    }

    /// Adds an output to a host, unless it shows nothing.
    pub(crate) fn add_output(
        &mut self,
        at: At<'_>,
        host: &mut Host,
        mut output: Output,
    ) -> Result<(), Trouble> {
        if output.channels.is_empty() {
            self.ledger.list(
                at,
                "nothing that this window shows can be carried over, so it is left out",
                "see what is listed about it",
            );
            return Ok(());
        }
        let taken: HashSet<_> = host.outputs.iter().map(|o| o.name.clone()).collect();
        count("outputs of a host", taken.len(), MAX_OUTPUTS)?;
        output.name = self.unique(at, &output.name, &taken);
        host.outputs.push(output);
        Ok(())
    }

    /// The wall and the list.
    pub(crate) fn finish(self) -> (Draft, Vec<Lost>) {
        (self.draft, self.ledger.into_lost())
    }

    /// Notes what no format states.
    pub(crate) fn assume_fps(&mut self, at: At<'_>) {
        self.ledger.note(
            at,
            "the frame rate is not stated",
            "60 frames a second are assumed",
            "write fps as the projectors have it",
        );
    }
}

/// Refuses one more than `most`.
fn count(what: &'static str, have: usize, most: usize) -> Result<(), Trouble> {
    if have < most {
        return Ok(());
    }
    Err(Trouble::TooMany { what, most })
}

/// A name without control characters, of at most [`MAX_NAME_BYTES`]; `otherwise` where nothing is left.
fn usable(wanted: &str, otherwise: &str) -> String {
    let clean: String = wanted.chars().filter(|c| !c.is_control()).collect();
    match cut(clean.trim(), MAX_NAME_BYTES).trim() {
        "" => otherwise.to_owned(),
        name => name.to_owned(),
    }
}

/// The first `most` bytes, less where a character would be cut.
fn cut(text: &str, most: usize) -> &str {
    let mut end = text.len().min(most);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text.get(..end).unwrap_or_default()
}
