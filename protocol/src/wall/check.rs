//! What makes a wall one that can be shown: names, ranges and geometry.
//! In: a wall from a file or from the wire. Out: nothing, or the first problem and what to do about it.

use std::collections::HashSet;

use glam::DVec3;

use super::{
    MAX_CHANNELS, MAX_HOSTS, MAX_OBSERVERS, MAX_OUTPUTS, MAX_SCREENS, MAX_SIZE_PX, Output, Screen,
    Wall,
};
use crate::config::{Fault, Problem};

/// How far corners may be off a rectangle, in metres.
const RECTANGLE_TOLERANCE_M: f64 = 0.001;
/// How far from a screen's plane a head must be, in metres.
const NEAREST_HEAD_M: f64 = 0.01;
/// How far anything may be from the room's origin, in metres.
const ROOM_M: f64 = 1000.0;
/// How much pixels may be off square.
const PIXEL_ASPECT_TOLERANCE: f64 = 0.02;
/// Longest name in bytes.
const MAX_NAME_BYTES: usize = 64;
/// Largest cache budget: one exbibyte keeps byte counts within 64 bits.
const MAX_MIB: u64 = 1 << 40;

impl Wall {
    /// The first problem of the wall.
    pub(super) fn check(&self) -> Result<(), Problem> {
        check_name("wall.name", &self.name)?;
        if !(1.0..=240.0).contains(&self.fps) {
            return Err(out_of_range(
                "wall.fps",
                "write a number of frames a second within 1…240",
            ));
        }
        check_count("observers", self.observers.len(), MAX_OBSERVERS)?;
        check_count("screens", self.screens.len(), MAX_SCREENS)?;
        check_count("hosts", self.hosts.len(), MAX_HOSTS)?;
        check_names("observers", self.observers.iter().map(|o| o.name.as_str()))?;
        check_names("screens", self.screens.iter().map(|s| s.name.as_str()))?;
        check_names("hosts", self.hosts.iter().map(|h| h.name.as_str()))?;
        for (index, observer) in self.observers.iter().enumerate() {
            check_point(&format!("observers[{index}].head_m"), observer.head_m)?;
        }
        for (index, screen) in self.screens.iter().enumerate() {
            self.check_screen(&format!("screens[{index}]"), screen)?;
        }
        for (index, host) in self.hosts.iter().enumerate() {
            let outputs = format!("hosts[{index}].outputs");
            check_count(&outputs, host.outputs.len(), MAX_OUTPUTS)?;
            check_names(&outputs, host.outputs.iter().map(|o| o.name.as_str()))?;
            for (index, output) in host.outputs.iter().enumerate() {
                self.check_output(&format!("{outputs}[{index}]"), output)?;
            }
        }
        let budgets = [
            ("cache.gpu_mib", self.cache.gpu_mib),
            ("cache.ram_mib", self.cache.ram_mib),
            ("cache.disk_mib", self.cache.disk_mib),
        ];
        match budgets.iter().find(|(_, mib)| !(1..=MAX_MIB).contains(mib)) {
            Some((key, _)) => Err(out_of_range(key, "write a number of MiB, at least 1")),
            None => Ok(()),
        }
    }

    fn check_screen(&self, key: &str, screen: &Screen) -> Result<(), Problem> {
        let Some(observer) = self.observers.get(screen.observer) else {
            let advice = "there is no such observer";
            return Err(Problem::new(Fault::Name, format!("{key}.observer"), advice));
        };
        check_size(&format!("{key}.size_px"), screen.size_px)?;
        let corners_key = format!("{key}.corners_m");
        let corners = screen.corners_m;
        for (name, corner) in [
            ("bottom_left", corners.bottom_left),
            ("bottom_right", corners.bottom_right),
            ("top_left", corners.top_left),
        ] {
            check_point(&format!("{corners_key}.{name}"), corner)?;
        }
        let bottom_left = DVec3::from(corners.bottom_left);
        let right = DVec3::from(corners.bottom_right) - bottom_left;
        let up = DVec3::from(corners.top_left) - bottom_left;
        let (width_m, height_m) = (right.length(), up.length());
        let geometry =
            |advice: String| Err(Problem::new(Fault::Geometry, corners_key.clone(), advice));
        if width_m.min(height_m) < RECTANGLE_TOLERANCE_M {
            return geometry(format!(
                "the screen is {width_m} m wide and {height_m} m high, so it has no area; write three different corners"
            ));
        }
        // How far the shorter edge's end lies beside the corner of a rectangle.
        let aside_m = right.dot(up).abs() / width_m.max(height_m);
        if aside_m > RECTANGLE_TOLERANCE_M {
            return geometry(format!(
                "the corners do not form a rectangle: the lower and the left edge are off a right angle by {:.1} mm, at most 1 mm is allowed; measure them again",
                aside_m * 1000.0
            ));
        }
        let back = right.cross(up).normalize();
        let distance_m = (DVec3::from(observer.head_m) - bottom_left).dot(back);
        if distance_m < -NEAREST_HEAD_M {
            return geometry(format!(
                "the head of observer \"{}\" is {:.3} m behind the screen; name the corners as that observer sees them (exchange left and right), or move head_m",
                observer.name, -distance_m
            ));
        }
        if distance_m < NEAREST_HEAD_M {
            return geometry(format!(
                "the head of observer \"{}\" is in the plane of the screen; move head_m at least {NEAREST_HEAD_M} m in front of it",
                observer.name
            ));
        }
        let [across, along] = [
            f64::from(screen.size_px[0]) / width_m,
            f64::from(screen.size_px[1]) / height_m,
        ];
        if (across / along - 1.0).abs() > PIXEL_ASPECT_TOLERANCE {
            let height_px = (across * height_m).round();
            return Err(Problem::new(
                Fault::Geometry,
                format!("{key}.size_px"),
                format!(
                    "pixels are not square: {across:.1} a metre across, {along:.1} a metre up, at most 2 % apart is allowed; for {width_m:.3} m × {height_m:.3} m write size_px = [{}, {height_px}], or correct corners_m",
                    screen.size_px[0]
                ),
            ));
        }
        Ok(())
    }

    fn check_output(&self, key: &str, output: &Output) -> Result<(), Problem> {
        check_size(&format!("{key}.size_px"), output.size_px)?;
        check_count(
            &format!("{key}.channels"),
            output.channels.len(),
            MAX_CHANNELS,
        )?;
        let [width, height] = output.size_px;
        for (index, channel) in output.channels.iter().enumerate() {
            let key = format!("{key}.channels[{index}]");
            let Some(screen) = self.screens.get(channel.screen) else {
                let advice = "there is no such screen";
                return Err(Problem::new(Fault::Name, format!("{key}.screen"), advice));
            };
            let canvas = channel.canvas_px;
            let [canvas_width, canvas_height] = screen.size_px;
            let fits = canvas.width > 0
                && canvas.height > 0
                && canvas.right() <= canvas_width
                && canvas.bottom() <= canvas_height;
            if !fits {
                return Err(out_of_range(
                    &format!("{key}.canvas_px"),
                    format!(
                        "this rectangle (x, y, width, height) is empty or leaves the canvas of screen \"{}\", which is {canvas_width}×{canvas_height}",
                        screen.name
                    ),
                ));
            }
            let shown = output_rect(channel);
            if shown.right() > width || shown.bottom() > height {
                return Err(out_of_range(
                    &format!("{key}.output_px"),
                    format!(
                        "{}×{} pixels from here leave the output, which is {width}×{height}",
                        canvas.width, canvas.height
                    ),
                ));
            }
            let before = output.channels.iter().take(index);
            if let Some(other) = before
                .map(output_rect)
                .position(|rect| rect.overlaps(&shown))
            {
                return Err(Problem::new(
                    Fault::Geometry,
                    format!("{key}.output_px"),
                    format!(
                        "this channel covers a part of channel {other} of the same output; move one of them"
                    ),
                ));
            }
        }
        Ok(())
    }
}

/// What a channel covers of its output.
fn output_rect(channel: &super::Channel) -> super::Rect {
    let [x, y] = channel.output_px;
    super::Rect {
        x,
        y,
        ..channel.canvas_px
    }
}

fn out_of_range(key: &str, advice: impl Into<String>) -> Problem {
    Problem::new(Fault::OutOfRange, key, advice)
}

fn check_count(key: &str, count: usize, most: usize) -> Result<(), Problem> {
    if (1..=most).contains(&count) {
        return Ok(());
    }
    Err(out_of_range(
        key,
        format!("there are {count}; write at least one and at most {most}"),
    ))
}

fn check_size(key: &str, size_px: [u32; 2]) -> Result<(), Problem> {
    if size_px.iter().all(|side| (1..=MAX_SIZE_PX).contains(side)) {
        return Ok(());
    }
    Err(out_of_range(
        key,
        format!("write width and height in pixels, each within 1…{MAX_SIZE_PX}"),
    ))
}

fn check_point(key: &str, point_m: [f64; 3]) -> Result<(), Problem> {
    if point_m
        .iter()
        .all(|component| component.is_finite() && component.abs() <= ROOM_M)
    {
        return Ok(());
    }
    Err(out_of_range(
        key,
        format!(
            "write metres (x right, y up, z towards the viewers), each at most {ROOM_M} from the origin"
        ),
    ))
}

fn check_name(key: &str, name: &str) -> Result<(), Problem> {
    let usable = !name.trim().is_empty()
        && name.len() <= MAX_NAME_BYTES
        && !name.chars().any(char::is_control);
    if usable {
        return Ok(());
    }
    let advice = format!("write a name of 1…{MAX_NAME_BYTES} bytes without control characters");
    Err(Problem::new(Fault::Name, key, advice))
}

/// Checks that names are usable and that none appears twice.
fn check_names<'n>(list: &str, names: impl Iterator<Item = &'n str>) -> Result<(), Problem> {
    let mut taken = HashSet::new();
    for (index, name) in names.enumerate() {
        let key = format!("{list}[{index}].name");
        check_name(&key, name)?;
        if !taken.insert(name) {
            let advice = format!(
                "\"{name}\" is already the name of another of the {list}; write a name of its own"
            );
            return Err(Problem::new(Fault::Name, key, advice));
        }
    }
    Ok(())
}
