//! Users of SGCT, and what tracks them.
//! In: `users` and `trackers`. Out: observers and trackers of the draft. A measurement p of SGCT becomes a head by
//! offset + orientation⁻¹ · (scale · p) of the tracker, then the device's own offset (src/tracker.cpp,
//! src/trackingdevice.cpp).

use glam::{DMat3, DQuat, DVec3};

use super::{members, vector};
use crate::draft::{Builder, Observer, Tracker};
use crate::error::Trouble;
use crate::room::{looks_of, turn_of};
use crate::source::At;

/// From eye to eye where no user says it.
const EYES_M: f64 = 0.06;

/// The users by name, the default one first.
pub(super) struct Users {
    names: Vec<(String, usize)>,
}

impl Users {
    /// The observer of a viewport.
    pub(super) fn of(&self, viewport: At<'_>) -> Result<usize, Trouble> {
        let Some(user) = viewport.get("user") else {
            return Ok(self.names.first().map_or(0, |(_, index)| *index));
        };
        let wanted = user.text()?;
        let found = self.names.iter().find(|(name, _)| name == wanted);
        found
            .map(|(_, index)| *index)
            .ok_or_else(|| user.expected("the name of a user of this file"))
    }
}

/// Reads all users; a file without any has SGCT's default one.
pub(super) fn read(root: At<'_>, builder: &mut Builder) -> Result<Users, Trouble> {
    let mut names = Vec::new();
    for user in root.get("users").into_iter().flat_map(At::children) {
        let name = user.get("name").map_or(Ok("default"), At::text)?;
        let index = read_user(root, user, name, builder)?;
        names.push((name.to_owned(), index));
    }
    if names.is_empty() {
        builder.ledger.note(
            root,
            "no user is stated",
            "SGCT's default is taken: at the origin, 0.06 m from eye to eye",
            "measure where the head rests, and correct head_m",
        );
        let observer = Observer {
            name: "default".to_owned(),
            head_m: [0.0; 3],
            looks_deg: [0.0; 3],
            eye_separation_m: EYES_M,
            tracker: None,
        };
        names.push(("default".to_owned(), builder.add_observer(root, observer)?));
    }
    Ok(Users { names })
}

fn read_user(
    root: At<'_>,
    at: At<'_>,
    name: &str,
    builder: &mut Builder,
) -> Result<usize, Trouble> {
    at.carry();
    let mut missing = Vec::new();
    let head_m = match at.get("pos") {
        Some(pos) => vector(pos)?,
        None => {
            missing.push("pos");
            [0.0; 3]
        }
    };
    let eye_separation_m = match at.get("eyeseparation") {
        Some(separation) => separation.number()?,
        None => {
            missing.push("eyeseparation");
            EYES_M
        }
    };
    if !missing.is_empty() {
        builder.ledger.note(
            at,
            format!("not stated: {}", missing.join(", ")),
            "SGCT's defaults are taken: the origin, 0.06 m from eye to eye",
            "correct head_m and eye_separation_m",
        );
    }
    let looks_deg = match at.get("orientation") {
        Some(orientation) => looks_of(turn(orientation)?),
        None => [0.0; 3],
    };
    let mut observer = Observer {
        name: name.to_owned(),
        head_m,
        looks_deg,
        eye_separation_m,
        tracker: None,
    };
    if let Some(tracking) = at.get("tracking") {
        // The schema has a list here, the examples one object.
        let first = match tracking.get("tracker") {
            Some(_) => Some(tracking),
            None => tracking.children().next(),
        };
        if let Some(first) = first {
            observer.tracker = read_tracking(root, first, builder)?;
        }
    }
    builder.add_observer(at, observer)
}

/// A rotation: yaw to the right, pitch up and roll clockwise in degrees (y, then x, then z), or x, y, z counter-clockwise
/// about those axes in their order, or a quaternion (src/readconfig.cpp).
pub(super) fn turn(at: At<'_>) -> Result<DMat3, Trouble> {
    if at.get("w").is_some() {
        let [x, y, z, w] = members(at, ["x", "y", "z", "w"])?;
        let quaternion = DQuat::from_xyzw(x, y, z, w);
        if quaternion.length() < 1e-6 {
            return Err(at.expected("a quaternion of length 1"));
        }
        return Ok(DMat3::from_quat(quaternion.normalize()));
    }
    if at.get("x").is_some() {
        let [x, y, z] = vector(at)?.map(f64::to_radians);
        return Ok(DMat3::from_rotation_x(x)
            * DMat3::from_rotation_y(y)
            * DMat3::from_rotation_z(z));
    }
    let mut angles = [0.0; 3];
    for (angle, key) in angles.iter_mut().zip(["yaw", "pitch", "roll"]) {
        if let Some(at) = at.get(key) {
            *angle = at.number()?;
        }
    }
    let [yaw, pitch, roll] = angles;
    Ok(turn_of([-yaw, pitch, -roll]))
}

fn read_tracking(
    root: At<'_>,
    at: At<'_>,
    builder: &mut Builder,
) -> Result<Option<usize>, Trouble> {
    let named = |list: At<'_>, name: &str| {
        let is = |item: &At<'_>| {
            item.get("name")
                .is_some_and(|n| matches!(n.words(), [word] if word.text == name))
        };
        list.children().position(|item| is(&item))
    };
    let (Some(tracker), Some(device)) = (at.get("tracker"), at.get("device")) else {
        return Err(at.expected("an object with tracker and device"));
    };
    let (tracker, device) = (tracker.text()?, device.text()?);
    let nth = |list: Option<At<'_>>, name: &str| -> Option<usize> { named(list?, name) };
    let trackers = root.get("trackers");
    let found = nth(trackers, tracker)
        .and_then(|index| trackers.and_then(|list| list.children().nth(index)));
    let devices = found.and_then(|found| found.get("devices"));
    let found_device =
        nth(devices, device).and_then(|index| devices.and_then(|list| list.children().nth(index)));
    let sensor = found_device
        .and_then(|device| device.get("sensors"))
        .and_then(|sensors| sensors.children().next());
    let (Some(found), Some(found_device), Some(sensor)) = (found, found_device, sensor) else {
        builder.ledger.list(
            at,
            "no tracker of this file has such a device with a sensor",
            "write [[trackers]] by hand; until then the head rests at head_m",
        );
        return Ok(None);
    };
    for named in [found, found_device] {
        if let Some(name) = named.get("name") {
            name.carry();
        }
    }
    let (Some(address), Some(id)) = (sensor.get("vrpnaddress"), sensor.get("id")) else {
        return Err(sensor.expected("an object with vrpnaddress and id"));
    };
    let (address_text, body) = (address.text()?, id.integer(0, 65_535)?);
    let unit_m = found.get("scale").map_or(Ok(1.0), At::number)?;
    if unit_m <= 0.0 {
        return Err(found.expected("a scale above 0"));
    }
    let frame = read_frame(found)?;
    let to_room = frame.map(|(offset, turn)| {
        let inverse = turn.transpose();
        [offset, inverse.x_axis, inverse.y_axis, inverse.z_axis].map(|v| v.to_array())
    });
    let to_head =
        read_frame(found_device)?.map(|(offset, turn)| [offset.to_array(), looks_of(turn)]);
    let Some(source) = builder.vrpn_source(address, address_text) else {
        return Ok(None);
    };
    let tracker = Tracker {
        name: format!("{tracker} {device}"),
        source,
        body,
        to_room,
        unit_m,
        to_head,
    };
    builder.add_tracker(found_device, tracker).map(Some)
}

/// The offset and the orientation of a tracker or a device, where it states one of them.
fn read_frame(at: At<'_>) -> Result<Option<(DVec3, DMat3)>, Trouble> {
    let offset = at.get("offset").map(vector).transpose()?;
    let orientation = at.get("orientation").map(turn).transpose()?;
    Ok(match (offset, orientation) {
        (None, None) => None,
        _ => Some((
            offset.map_or(DVec3::ZERO, DVec3::from),
            orientation.unwrap_or(DMat3::IDENTITY),
        )),
    })
}
