//! Channels whose pixels a calibration file puts in place: how dense they are, and what is odd about them.
//!
//! In: a wall, its surfaces. Out: figures and sentences. What it says of densities holds for the resting head.

use glam::DVec3;
use protocol::Wall;
use protocol::wall::{CalibratedChannel, Surfaces};
use screens::{Density, Patch};
use serde::Serialize;

use crate::plan::face::Face;

use super::findings::Range;
use super::meeting::{RATIO, ratio};

/// Patches a side in which channels are compared with what is near.
const PATCHES: usize = 24;
/// The share of what a channel lights that its head must see from the front.
const SEEN_SHARE: f64 = 0.5;
/// How far what a channel lights may be from its screen in the mean, in metres.
const ASTRAY_M: f64 = 0.25;

/// One calibrated channel, as the resting head of its screen's observer sees it.
#[derive(Debug, Serialize)]
pub(super) struct ChannelFindings {
    /// `HOST/OUTPUT`.
    pub(super) output: String,
    pub(super) screen: String,
    /// The file as the wall names it, without its folder.
    pub(super) calibration: String,
    pub(super) region: Option<String>,
    pub(super) size_px: [u32; 2],
    /// `None` where the head sees nothing of it from the front.
    pub(super) pixels_per_radian: Option<Range>,
    /// The share of what it lights that the head sees from the front.
    seen_share: f64,
}

/// A channel with what is measured of it.
pub(super) struct Measured<'a> {
    pub(super) name: String,
    pub(super) screen: usize,
    pub(super) density: Option<Density>,
    head_m: DVec3,
    channel: &'a protocol::wall::Channel,
    patches: Vec<Patch>,
}

impl<'a> Measured<'a> {
    /// All calibrated channels, in the wall's order.
    pub(super) fn all(wall: &'a Wall, surfaces: &Surfaces) -> Vec<Self> {
        let calibrated = surfaces.calibrated().iter();
        calibrated
            .filter_map(|calibrated| Self::new(wall, calibrated))
            .collect()
    }

    fn new(wall: &'a Wall, calibrated: &CalibratedChannel) -> Option<Self> {
        let (output, channel) = calibrated.in_wall(wall)?;
        let screen = wall.screens.get(channel.screen)?;
        let head_m = DVec3::from(wall.observers.get(screen.observer)?.head_m);
        Some(Self {
            name: format!("{}/{}", wall.hosts.get(calibrated.host)?.name, output.name),
            screen: channel.screen,
            density: calibrated.map.density(head_m),
            head_m,
            channel,
            patches: calibrated.map.patches(head_m, PATCHES),
        })
    }

    pub(super) fn findings(&self, wall: &Wall) -> Option<ChannelFindings> {
        let calibration = self.channel.calibration.as_ref()?;
        let file = std::path::Path::new(&calibration.file).file_name()?;
        Some(ChannelFindings {
            output: self.name.clone(),
            screen: wall.screens.get(self.screen)?.name.clone(),
            calibration: file.to_string_lossy().into_owned(),
            region: calibration.region.clone(),
            size_px: self.channel.size_px,
            pixels_per_radian: self.density.map(Range::from),
            seen_share: self.density.map_or(0.0, |density| density.seen_share),
        })
    }
}

/// Whether all that shows a screen is calibrated, so that nobody sees the pixels of its canvas.
pub(super) fn hides_canvas(wall: &Wall, screen: usize) -> bool {
    let outputs = wall.hosts.iter().flat_map(|host| &host.outputs);
    let mut channels = outputs
        .flat_map(|output| &output.channels)
        .filter(|channel| channel.screen == screen)
        .peekable();
    channels.peek().is_some() && channels.all(|channel| channel.calibration.is_some())
}

pub(super) fn warn(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    channels: &[Measured<'_>],
    warnings: &mut Vec<String>,
) {
    for (index, channel) in channels.iter().enumerate() {
        misplaced(wall, faces, channel, warnings);
        for other in channels.iter().skip(index + 1) {
            let pairs = channel.patches.iter().flat_map(|patch| {
                let near = other.patches.iter().filter(|other| touch(patch, other));
                near.filter_map(|other| Some((patch.pixels_per_radian?, other.pixels_per_radian?)))
            });
            let name = format!("output \"{}\"", other.name);
            uneven(&channel.name, &name, pairs, warnings);
        }
        for (screen, (of_wall, face)) in wall.screens.iter().zip(faces).enumerate() {
            let (Some(face), Some(observer)) = (face, wall.observers.get(of_wall.observer)) else {
                continue;
            };
            if hides_canvas(wall, screen) {
                continue;
            }
            let head_m = DVec3::from(observer.head_m);
            let pairs = channel.patches.iter().filter_map(|patch| {
                let near = face.nearest(patch.middle_m, reach_m(patch))?;
                let of_face = face.pixels_per_radian(near.parameters, of_wall.size_px, head_m)?;
                Some((patch.pixels_per_radian?, of_face))
            });
            let name = format!("screen \"{}\"", of_wall.name);
            uneven(&channel.name, &name, pairs, warnings);
        }
    }
}

/// From the middle of a patch to its farthest corner.
fn reach_m(patch: &Patch) -> f64 {
    let corners = patch.corners_m.iter();
    corners.fold(0.0, |most, corner| {
        f64::max(most, corner.distance(patch.middle_m))
    })
}

fn touch(a: &Patch, b: &Patch) -> bool {
    a.middle_m.distance(b.middle_m) <= reach_m(a).max(reach_m(b))
}

/// Neighbours with pixels of very different sizes.
fn uneven(
    channel: &str,
    other: &str,
    pairs: impl Iterator<Item = (f64, f64)>,
    warnings: &mut Vec<String>,
) {
    let worst = pairs.max_by(|x, y| ratio(*x).total_cmp(&ratio(*y)));
    if let Some((own, others)) = worst.filter(|pair| ratio(*pair) > RATIO) {
        let more = if own > others { "more" } else { "fewer" };
        warnings.push(format!(
            "output \"{channel}\" has {:.1} times {more} pixels to a radian than {other} where they meet ({own:.0} and {others:.0}); check their calibrations and size_px",
            ratio((own, others))
        ));
    }
}

/// A channel that lights something else than its screen, or the screen's other side.
fn misplaced(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    channel: &Measured<'_>,
    warnings: &mut Vec<String>,
) {
    let (Some(screen), Some(Some(face))) =
        (wall.screens.get(channel.screen), faces.get(channel.screen))
    else {
        return;
    };
    let apart = channel.patches.iter().filter_map(|patch| {
        let nearest = face.nearest(patch.middle_m, f64::INFINITY)?;
        Some(nearest.point_m.distance(patch.middle_m))
    });
    let mean_m = apart.sum::<f64>() / channel.patches.len().max(1) as f64;
    if mean_m > ASTRAY_M {
        warnings.push(format!(
            "what output \"{}\" lights is {mean_m:.2} m from screen \"{}\" in the mean; check unit, axes and origin of its calibration, or where the screen stands",
            channel.name, screen.name
        ));
    }
    let seen_share = channel.density.map_or(0.0, |density| density.seen_share);
    if seen_share < SEEN_SHARE {
        warnings.push(format!(
            "the head at ({:.2}, {:.2}, {:.2}) m sees only {:.0} % of what output \"{}\" lights from the front; check whether its calibration is mirrored",
            channel.head_m.x,
            channel.head_m.y,
            channel.head_m.z,
            100.0 * seen_share,
            channel.name
        ));
    }
}
