//! From TOML to a wall: keys, types and references between names. What the values mean is checked
//! afterwards, by the same code that checks a wall from the wire.

use super::observer::EYE_SEPARATION_M;
use super::{CacheBudgets, Observer, Tracker, Wall, raw_output, raw_screen, raw_tracker};
use crate::config::{ConfigError, Document, Fault, Table, Value};

/// Reads the whole file.
pub(super) fn read(document: &Document<'_>) -> Result<Wall, ConfigError> {
    let root =
        document
            .root()
            .only(&["wall", "observers", "trackers", "screens", "hosts", "cache"])?;
    let wall = root
        .require("wall", "[wall] with name and fps")?
        .table()?
        .only(&["name", "fps"])?;
    let trackers = match root.get("trackers") {
        Some(list) => list.tables()?,
        None => Vec::new(),
    };
    let trackers = trackers
        .into_iter()
        .map(raw_tracker::read)
        .collect::<Result<Vec<_>, _>>()?;
    let observers = list(&root, "observers", "[[observers]] with name and head_m")?
        .into_iter()
        .map(|table| read_observer(table, &trackers))
        .collect::<Result<Vec<_>, _>>()?;
    let screens = list(
        &root,
        "screens",
        "[[screens]] with name, kind, observer, corners_m, size_px",
    )?
    .into_iter()
    .map(|table| raw_screen::read(&table, &observers))
    .collect::<Result<Vec<_>, _>>()?;
    let hosts = list(&root, "hosts", "[[hosts]] with name and [[hosts.outputs]]")?
        .into_iter()
        .map(|table| raw_output::read_host(table, &screens))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Wall {
        name: wall.require("name", "name = \"powerwall\"")?.text()?,
        fps: wall.require("fps", "fps = 60")?.number()?,
        observers,
        trackers,
        screens,
        hosts,
        cache: root
            .get("cache")
            .map(read_cache)
            .transpose()?
            .unwrap_or_default(),
    })
}

/// The tables of a key that must be there.
pub(super) fn list<'d, 'i>(
    table: &Table<'d, 'i>,
    key: &str,
    example: &str,
) -> Result<Vec<Table<'d, 'i>>, ConfigError> {
    table.require(key, example)?.tables()
}

fn read_observer(table: Table<'_, '_>, trackers: &[Tracker]) -> Result<Observer, ConfigError> {
    let table = table.only(&["name", "head_m", "looks_deg", "eye_separation_m", "tracker"])?;
    let example = "head_m = [0.0, 1.7, 3.0]";
    let tracker = table.get("tracker").map(|reference| {
        let names = trackers.iter().map(|tracker| tracker.name.as_str());
        find(&reference, "tracker", names)
    });
    Ok(Observer {
        name: table.require("name", "name = \"viewer\"")?.text()?,
        head_m: table.require("head_m", example)?.numbers(example)?,
        looks_deg: numbers_or(&table, "looks_deg", "looks_deg = [0.0, 0.0, 0.0]", [0.0; 3])?,
        eye_separation_m: number_or(&table, "eye_separation_m", EYE_SEPARATION_M)?,
        tracker: tracker.transpose()?,
    })
}

/// A number that may be left out.
pub(super) fn number_or(
    table: &Table<'_, '_>,
    key: &str,
    otherwise: f64,
) -> Result<f64, ConfigError> {
    table.get(key).map_or(Ok(otherwise), |value| value.number())
}

/// Numbers that may be left out.
pub(super) fn numbers_or<const N: usize>(
    table: &Table<'_, '_>,
    key: &str,
    example: &str,
    otherwise: [f64; N],
) -> Result<[f64; N], ConfigError> {
    table
        .get(key)
        .map_or(Ok(otherwise), |value| value.numbers(example))
}

/// True or false; what is left out is false.
pub(super) fn flag(table: &Table<'_, '_>, key: &str) -> Result<bool, ConfigError> {
    table.get(key).map_or(Ok(false), |value| value.boolean())
}

fn read_cache(value: Value<'_, '_>) -> Result<CacheBudgets, ConfigError> {
    let table = value
        .table()?
        .only(&["gpu_mib", "ram_mib", "disk_mib", "directory"])?;
    let default = CacheBudgets::default();
    let mib = |key: &str, otherwise: u64| match table.get(key) {
        Some(value) => value.integer(),
        None => Ok(otherwise),
    };
    Ok(CacheBudgets {
        gpu_mib: mib("gpu_mib", default.gpu_mib)?,
        ram_mib: mib("ram_mib", default.ram_mib)?,
        disk_mib: mib("disk_mib", default.disk_mib)?,
        directory: table
            .get("directory")
            .map(|value| value.text())
            .transpose()?,
    })
}

/// The index of the thing that a value names.
pub(super) fn find<'n>(
    reference: &Value<'_, '_>,
    what: &str,
    names: impl Iterator<Item = &'n str>,
) -> Result<usize, ConfigError> {
    let wanted = reference.text()?;
    let names: Vec<&str> = names.collect();
    names
        .iter()
        .position(|name| *name == wanted)
        .ok_or_else(|| {
            let advice = format!("there is no such {what}; write one of {}", names.join(", "));
            reference.error(Fault::Name, advice)
        })
}
