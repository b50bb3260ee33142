//! Trackers out of TOML: keys, types, defaults. What the values mean is checked afterwards.

use super::raw::{number_or, numbers_or};
use super::{Axes, Body, Smoothing, Tracker, TrackerSource};
use crate::config::{ConfigError, Fault, Table, Value};

/// The port of a VRPN server that names none.
const VRPN_PORT: u16 = 3883;
/// Metres in a unit of DTrack, which measures in millimetres.
const DTRACK_UNIT_M: f64 = 0.001;

/// Reads one `[[trackers]]`.
pub(super) fn read(table: Table<'_, '_>) -> Result<Tracker, ConfigError> {
    let table = table.only(&[
        "name",
        "kind",
        "source",
        "body",
        "to_room",
        "unit_m",
        "to_head",
        "smoothing",
        "latency_ms",
    ])?;
    let kind = table.require("kind", "kind = \"vrpn\" or \"dtrack\"")?;
    let (source, unit_m) = match kind.text()?.as_str() {
        "vrpn" => {
            let example = "source = \"DTrack@tracker-host:3883\"";
            (read_vrpn(&table.require("source", example)?)?, 1.0)
        }
        "dtrack" => {
            let example = "source = \"0.0.0.0:5000\"";
            let listen = table.require("source", example)?.text()?;
            (TrackerSource::Dtrack { listen }, DTRACK_UNIT_M)
        }
        _ => {
            return Err(kind.error(
                Fault::OutOfRange,
                "unknown kind of tracker; write \"vrpn\" or \"dtrack\"",
            ));
        }
    };
    Ok(Tracker {
        name: table.require("name", "name = \"glasses\"")?.text()?,
        source,
        body: table.get("body").map_or(Ok(0), |value| value.integer())?,
        to_room: table
            .get("to_room")
            .map_or_else(|| Ok(Axes::default()), |value| read_axes(&value))?,
        unit_m: number_or(&table, "unit_m", unit_m)?,
        to_head: table
            .get("to_head")
            .map_or_else(|| Ok(Body::default()), |value| read_body(&value))?,
        smoothing: table
            .get("smoothing")
            .map_or_else(|| Ok(Smoothing::default()), |value| read_smoothing(&value))?,
        latency_ms: number_or(&table, "latency_ms", 0.0)?,
    })
}

/// `DEVICE@HOST[:PORT]`.
fn read_vrpn(value: &Value<'_, '_>) -> Result<TrackerSource, ConfigError> {
    let text = value.text()?;
    let parts = text.split_once('@').and_then(|(device, at)| {
        let (host, port) = match at.rsplit_once(':') {
            Some((host, port)) => (host, port.parse().ok()?),
            None => (at, VRPN_PORT),
        };
        (!device.is_empty() && !host.is_empty()).then(|| TrackerSource::Vrpn {
            device: device.to_owned(),
            host: host.to_owned(),
            port,
        })
    });
    parts.ok_or_else(|| {
        let advice =
            "write DEVICE@HOST or DEVICE@HOST:PORT, for example \"DTrack@tracker-host:3883\"";
        value.error(Fault::OutOfRange, advice)
    })
}

fn read_axes(value: &Value<'_, '_>) -> Result<Axes, ConfigError> {
    let table = value.table()?.only(&["origin_m", "x", "y", "z"])?;
    let rest = Axes::default();
    let vector = |key: &str, otherwise| numbers_or(&table, key, "[1.0, 0.0, 0.0]", otherwise);
    Ok(Axes {
        origin_m: vector("origin_m", rest.origin_m)?,
        x: vector("x", rest.x)?,
        y: vector("y", rest.y)?,
        z: vector("z", rest.z)?,
    })
}

fn read_body(value: &Value<'_, '_>) -> Result<Body, ConfigError> {
    let table = value.table()?.only(&["offset_m", "looks_deg"])?;
    let vector = |key: &str| numbers_or(&table, key, "[0.0, 0.0, 0.0]", [0.0; 3]);
    Ok(Body {
        offset_m: vector("offset_m")?,
        looks_deg: vector("looks_deg")?,
    })
}

fn read_smoothing(value: &Value<'_, '_>) -> Result<Smoothing, ConfigError> {
    let table = value
        .table()?
        .only(&["minimum_cutoff_hz", "speed_coefficient"])?;
    let rest = Smoothing::default();
    Ok(Smoothing {
        minimum_cutoff_hz: number_or(&table, "minimum_cutoff_hz", rest.minimum_cutoff_hz)?,
        speed_coefficient: number_or(&table, "speed_coefficient", rest.speed_coefficient)?,
    })
}
