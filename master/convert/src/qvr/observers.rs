//! Observers of QVR, and the devices that track them.
//! In: `observer` and `device` blocks. Out: observers and trackers of the draft. Devices that track nobody stay
//! unread, and are listed.

use glam::DVec3;

use super::block_name;
use crate::draft::{Builder, Observer, Tracker};
use crate::error::Trouble;
use crate::room::{looks_of, turn_towards};
use crate::source::{At, parse_number};

/// Where QVR puts a head that no line places: the height of eyes.
const HEAD_M: [f64; 3] = [0.0, 1.61, 0.0];
/// From eye to eye where no line says it.
const EYES_M: f64 = 0.064;

/// Reads an observer and returns its number.
pub(super) fn read(root: At<'_>, at: At<'_>, builder: &mut Builder) -> Result<usize, Trouble> {
    at.carry();
    let either = |new, old| at.get(new).or_else(|| at.get(old));
    let mut observer = Observer {
        name: block_name(at).to_owned(),
        head_m: HEAD_M,
        looks_deg: [0.0; 3],
        eye_separation_m: EYES_M,
        tracker: None,
    };
    match either("tracking_position", "position") {
        Some(position) => observer.head_m = position.numbers()?,
        None => builder.ledger.note(
            at,
            "tracking_position is not stated",
            "QVR's resting head, 1.61 m above the floor, is taken",
            "measure where the head rests, and correct head_m",
        ),
    }
    let forward = either("tracking_forward", "forward")
        .map(At::numbers::<3>)
        .transpose()?;
    let up = either("tracking_up", "up")
        .map(At::numbers::<3>)
        .transpose()?;
    let turn = turn_towards(
        forward.map_or(DVec3::NEG_Z, DVec3::from),
        up.map_or(DVec3::Y, DVec3::from),
    );
    match turn {
        Some(turn) => observer.looks_deg = looks_of(turn),
        None => builder.ledger.note(
            at,
            format!("forward {forward:?} and up {up:?}"),
            "the two do not span a plane, so the head looks along −z",
            "write looks_deg",
        ),
    }
    match at.get("eye_distance") {
        Some(distance) => observer.eye_separation_m = distance.number()?,
        None => builder.ledger.note(
            at,
            "eye_distance is not stated",
            "QVR's 0.064 m are taken",
            "correct eye_separation_m",
        ),
    }
    if let Some(tracking) = at.get("tracking").or_else(|| at.get("type")) {
        let rest = (observer.head_m, observer.looks_deg);
        track(root, tracking, &mut observer, builder)?;
        if (observer.head_m, observer.looks_deg) != rest {
            list_rest(at, builder);
        }
    }
    builder.add_observer(at, observer)
}

/// Lists where an observer rests whom a device places that never moves.
fn list_rest(at: At<'_>, builder: &mut Builder) {
    let keys = [
        "tracking_position",
        "position",
        "tracking_forward",
        "forward",
        "tracking_up",
        "up",
    ];
    for key in keys {
        if let Some(rest) = at.get(key) {
            builder.ledger.list(
                rest,
                "the observer follows a device that never moves, and is where that is",
                "nothing, unless the head should rest here",
            );
        }
    }
}

fn track(
    root: At<'_>,
    tracking: At<'_>,
    observer: &mut Observer,
    builder: &mut Builder,
) -> Result<(), Trouble> {
    let mut words = tracking.words().iter().map(|word| word.text.as_str());
    match (words.next(), words.next(), words.next()) {
        (Some("stationary"), None, _) => {
            tracking.carry();
        }
        (Some("device"), Some(name), None) => {
            let device = root.all("device").find(|device| block_name(*device) == name);
            let Some(device) = device else {
                return Err(tracking.expected("device and the name of a device of this file"));
            };
            tracking.carry();
            follow(device, observer, builder)?;
        }
        (Some("device"), Some(_), Some(_)) => builder.ledger.list(
            tracking,
            "a wall file tracks the middle between the eyes, not each of them",
            "write one [[trackers]] for the head",
        ),
        _ => builder.ledger.list(
            tracking,
            "this way of tracking is the application's own, or that of a head-mounted display",
            "write [[trackers]] if the head is tracked by VRPN or DTrack; else the head rests at head_m",
        ),
    }
    Ok(())
}

/// Lets an observer follow a device.
fn follow(device: At<'_>, observer: &mut Observer, builder: &mut Builder) -> Result<(), Trouble> {
    let Some(tracking) = device.get("tracking") else {
        builder.ledger.note(
            device,
            "tracking is not stated",
            "the device has no place, so the head rests at head_m",
            "write [[trackers]] if the head is tracked",
        );
        return Ok(());
    };
    let words = tracking.words();
    let kind = words.first().map_or("", |word| word.text.as_str());
    match (kind, words.get(1)) {
        ("vrpn", Some(address)) if words.len() <= 3 => {
            let body = match words.get(2) {
                Some(sensor) => sensor
                    .text
                    .parse::<u16>()
                    .map_err(|_| tracking.expected("a number within 0…65535 as the sensor"))?,
                None => {
                    builder.ledger.note(
                        tracking,
                        "the sensor is not stated",
                        "the first one, 0, is taken",
                        "write the sensor of the glasses as body",
                    );
                    0
                }
            };
            device.carry();
            tracking.carry();
            let Some(source) = builder.vrpn_source(tracking, &address.text) else {
                return Ok(());
            };
            let tracker = Tracker {
                name: block_name(device).to_owned(),
                source,
                body: body.into(),
                to_room: None,
                unit_m: 1.0,
                to_head: None,
            };
            observer.tracker = Some(builder.add_tracker(device, tracker)?);
        }
        ("static", _) => {
            let numbers: Option<Vec<f64>> = words.iter().skip(1).map(parse_number).collect();
            match numbers.as_deref() {
                Some([x, y, z, pitch, yaw, roll]) => {
                    observer.head_m = [*x, *y, *z];
                    observer.looks_deg = [*yaw, *pitch, *roll];
                }
                Some([x, y, z]) => observer.head_m = [*x, *y, *z],
                _ => {
                    return Err(
                        tracking.expected("static and 3 or 6 numbers: x y z pitch yaw roll")
                    );
                }
            }
            device.carry();
            tracking.carry();
            builder.ledger.note(
                device,
                "a device that never moves",
                "the observer's head rests where it is",
                "nothing",
            );
        }
        _ => builder.ledger.list(
            tracking,
            "only VRPN devices and static ones are converted",
            "write [[trackers]] with kind = \"vrpn\" or \"dtrack\" if the head is tracked",
        ),
    }
    Ok(())
}
