//! What makes a wall one that can be shown: names, ranges and geometry.
//! In: a wall from a file or from the wire. Out: nothing, or the first problem and what to do about it.

use std::collections::HashSet;

use glam::DVec3;

use super::{
    MAX_HOSTS, MAX_OBSERVERS, MAX_OUTPUTS, MAX_SCREENS, MAX_SIZE_PX, MAX_TRACKERS, Observer,
    Tracker, TrackerSource, Wall,
};
use crate::config::{Fault, Problem};

/// How far apart eyes may be, in metres.
const MOST_SEPARATION_M: f64 = 0.2;
/// How far a tracker's axes may be off unit vectors at right angles.
const AXES_TOLERANCE: f64 = 1e-3;
/// Longest path of a file in bytes.
const MAX_PATH_BYTES: usize = 4096;
/// How far anything may be from the room's origin, in metres.
const ROOM_M: f64 = 1000.0;
/// Longest name in bytes.
const MAX_NAME_BYTES: usize = 64;
/// Largest cache budget: one exbibyte keeps byte counts within 64 bits.
const MAX_MIB: u64 = 1 << 40;
/// Least main memory: the tiles of all layers of a scene at one place are needed at the same time, at most 16 of 1.2 MB.
const MIN_RAM_MIB: u64 = 64;

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
        if self.trackers.len() > MAX_TRACKERS {
            return Err(out_of_range(
                "trackers",
                format!(
                    "there are {}; write at most {MAX_TRACKERS}",
                    self.trackers.len()
                ),
            ));
        }
        check_names("trackers", self.trackers.iter().map(|t| t.name.as_str()))?;
        for (index, tracker) in self.trackers.iter().enumerate() {
            check_tracker(&format!("trackers[{index}]"), tracker)?;
        }
        for (index, observer) in self.observers.iter().enumerate() {
            self.check_observer(&format!("observers[{index}]"), observer)?;
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
            ("cache.gpu_mib", 1, self.cache.gpu_mib),
            ("cache.ram_mib", MIN_RAM_MIB, self.cache.ram_mib),
            ("cache.disk_mib", 1, self.cache.disk_mib),
        ];
        for (key, least, mib) in budgets {
            if !(least..=MAX_MIB).contains(&mib) {
                let advice = format!("write a number of MiB, at least {least}");
                return Err(out_of_range(key, advice));
            }
        }
        Ok(())
    }

    fn check_observer(&self, key: &str, observer: &Observer) -> Result<(), Problem> {
        check_point(&format!("{key}.head_m"), observer.head_m)?;
        check_angles(&format!("{key}.looks_deg"), &observer.looks_deg)?;
        if !(0.0..=MOST_SEPARATION_M).contains(&observer.eye_separation_m) {
            return Err(out_of_range(
                &format!("{key}.eye_separation_m"),
                format!("write metres within 0…{MOST_SEPARATION_M}, for example 0.063"),
            ));
        }
        if observer
            .tracker
            .is_some_and(|tracker| tracker >= self.trackers.len())
        {
            let advice = "there is no such tracker";
            return Err(Problem::new(Fault::Name, format!("{key}.tracker"), advice));
        }
        Ok(())
    }
}

fn check_tracker(key: &str, tracker: &Tracker) -> Result<(), Problem> {
    let source = format!("{key}.source");
    match &tracker.source {
        TrackerSource::Vrpn { device, host, .. } => {
            check_name(&source, device)?;
            check_file(&source, host)?;
        }
        TrackerSource::Dtrack { listen } => {
            if listen.parse::<std::net::SocketAddr>().is_err() {
                return Err(out_of_range(
                    &source,
                    "write an address and a port of this machine, for example \"0.0.0.0:5000\"",
                ));
            }
        }
    }
    check_point(&format!("{key}.to_room.origin_m"), tracker.to_room.origin_m)?;
    let [x, y, z] = [tracker.to_room.x, tracker.to_room.y, tracker.to_room.z].map(DVec3::from);
    let off = [
        x.length_squared() - 1.0,
        y.length_squared() - 1.0,
        x.dot(y),
        // Of the wrong sign for left-handed axes.
        (x.cross(y) - z).length(),
    ];
    if !off.iter().all(|off| off.abs() <= AXES_TOLERANCE) {
        return Err(Problem::new(
            Fault::Geometry,
            format!("{key}.to_room"),
            "x, y and z must be unit vectors at right angles, right-handed: z = x × y; write the directions of the tracker's axes in the room",
        ));
    }
    check_point(&format!("{key}.to_head.offset_m"), tracker.to_head.offset_m)?;
    check_angles(
        &format!("{key}.to_head.looks_deg"),
        &tracker.to_head.looks_deg,
    )?;
    let ranges = [
        (
            "unit_m",
            tracker.unit_m,
            1e-6..=1e3,
            "metres in a unit of the tracker, for example 0.001",
        ),
        (
            "smoothing.minimum_cutoff_hz",
            tracker.smoothing.minimum_cutoff_hz,
            1e-3..=1e3,
            "hertz, for example 1.0",
        ),
        (
            "smoothing.speed_coefficient",
            tracker.smoothing.speed_coefficient,
            0.0..=1e3,
            "a number from 0 on, for example 10.0",
        ),
        (
            "latency_ms",
            tracker.latency_ms,
            0.0..=1e3,
            "milliseconds within 0…1000",
        ),
    ];
    match ranges
        .iter()
        .find(|(_, value, range, _)| !range.contains(value))
    {
        Some((name, _, _, advice)) => Err(out_of_range(
            &format!("{key}.{name}"),
            format!("write {advice}"),
        )),
        None => Ok(()),
    }
}

pub(super) fn out_of_range(key: &str, advice: impl Into<String>) -> Problem {
    Problem::new(Fault::OutOfRange, key, advice)
}

pub(super) fn check_count(key: &str, count: usize, most: usize) -> Result<(), Problem> {
    if (1..=most).contains(&count) {
        return Ok(());
    }
    Err(out_of_range(
        key,
        format!("there are {count}; write at least one and at most {most}"),
    ))
}

pub(super) fn check_size(key: &str, size_px: [u32; 2]) -> Result<(), Problem> {
    if size_px.iter().all(|side| (1..=MAX_SIZE_PX).contains(side)) {
        return Ok(());
    }
    Err(out_of_range(
        key,
        format!("write width and height in pixels, each within 1…{MAX_SIZE_PX}"),
    ))
}

pub(super) fn check_point(key: &str, point_m: [f64; 3]) -> Result<(), Problem> {
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

/// Checks degrees.
pub(super) fn check_angles(key: &str, angles_deg: &[f64]) -> Result<(), Problem> {
    if angles_deg.iter().all(|angle| angle.abs() <= 360.0) {
        return Ok(());
    }
    Err(out_of_range(key, "write degrees, each within −360…360"))
}

/// Checks the path of a file, or the name of a host.
pub(super) fn check_file(key: &str, path: &str) -> Result<(), Problem> {
    let usable = !path.trim().is_empty()
        && path.len() <= MAX_PATH_BYTES
        && !path.chars().any(char::is_control);
    if usable {
        return Ok(());
    }
    let advice = format!("write 1…{MAX_PATH_BYTES} bytes without control characters");
    Err(Problem::new(Fault::Name, key, advice))
}

pub(super) fn check_name(key: &str, name: &str) -> Result<(), Problem> {
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
