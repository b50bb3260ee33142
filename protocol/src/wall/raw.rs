//! From TOML to a wall: keys, types and references between names. What the values mean is checked
//! afterwards, by the same code that checks a wall from the wire.

use super::{
    CacheBudgets, Channel, Host, Observer, Output, PlanarCorners, Rect, Screen, Wall,
    WindowPlacement,
};
use crate::config::{ConfigError, Document, Fault, Table, Value};

/// Reads the whole file.
pub(super) fn read(document: &Document<'_>) -> Result<Wall, ConfigError> {
    let root = document
        .root()
        .only(&["wall", "observers", "screens", "hosts", "cache"])?;
    let wall = root
        .require("wall", "[wall] with name and fps")?
        .table()?
        .only(&["name", "fps"])?;
    let observers = list(&root, "observers", "[[observers]] with name and head_m")?
        .into_iter()
        .map(read_observer)
        .collect::<Result<Vec<_>, _>>()?;
    let screens = list(
        &root,
        "screens",
        "[[screens]] with name, kind, observer, corners_m, size_px",
    )?
    .into_iter()
    .map(|table| read_screen(table, &observers))
    .collect::<Result<Vec<_>, _>>()?;
    let hosts = list(&root, "hosts", "[[hosts]] with name and [[hosts.outputs]]")?
        .into_iter()
        .map(|table| read_host(table, &screens))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Wall {
        name: wall.require("name", "name = \"powerwall\"")?.text()?,
        fps: wall.require("fps", "fps = 60")?.number()?,
        observers,
        screens,
        hosts,
        cache: root
            .get("cache")
            .map(read_cache)
            .transpose()?
            .unwrap_or_default(),
    })
}

fn list<'d, 'i>(
    table: &Table<'d, 'i>,
    key: &str,
    example: &str,
) -> Result<Vec<Table<'d, 'i>>, ConfigError> {
    table.require(key, example)?.tables()
}

fn read_observer(table: Table<'_, '_>) -> Result<Observer, ConfigError> {
    let table = table.only(&["name", "head_m"])?;
    let example = "head_m = [0.0, 1.7, 3.0]";
    Ok(Observer {
        name: table.require("name", "name = \"viewer\"")?.text()?,
        head_m: table.require("head_m", example)?.numbers(example)?,
    })
}

fn read_screen(table: Table<'_, '_>, observers: &[Observer]) -> Result<Screen, ConfigError> {
    let table = table.only(&["name", "kind", "observer", "corners_m", "size_px"])?;
    let name = table.require("name", "name = \"front\"")?.text()?;
    let kind = table.require("kind", "kind = \"planar\"")?;
    if kind.text()? != "planar" {
        return Err(kind.error(
            Fault::OutOfRange,
            "unknown kind of screen; write \"planar\"",
        ));
    }
    let reference = table.require("observer", "observer = \"viewer\"")?;
    let observer = find(
        &reference,
        "observer",
        observers.iter().map(|o| o.name.as_str()),
    )?;
    let example = "size_px = [1920, 1080]";
    Ok(Screen {
        name,
        observer,
        corners_m: read_corners(&table)?,
        size_px: table.require("size_px", example)?.integers(example)?,
    })
}

fn read_corners(screen: &Table<'_, '_>) -> Result<PlanarCorners, ConfigError> {
    let example = "corners_m = { bottom_left = [-2, 0, 0], bottom_right = [2, 0, 0], top_left = [-2, 2.25, 0] }";
    let table = screen.require("corners_m", example)?.table()?;
    let table = table.only(&["bottom_left", "bottom_right", "top_left"])?;
    let corner = |key: &str| table.require(key, example)?.numbers("[-2.0, 0.0, 0.0]");
    Ok(PlanarCorners {
        bottom_left: corner("bottom_left")?,
        bottom_right: corner("bottom_right")?,
        top_left: corner("top_left")?,
    })
}

fn read_host(table: Table<'_, '_>, screens: &[Screen]) -> Result<Host, ConfigError> {
    let table = table.only(&["name", "outputs"])?;
    let outputs = list(
        &table,
        "outputs",
        "[[hosts.outputs]] with name, size_px and channels",
    )?
    .into_iter()
    .map(|output| read_output(output, screens))
    .collect::<Result<_, _>>()?;
    Ok(Host {
        name: table.require("name", "name = \"left\"")?.text()?,
        outputs,
    })
}

fn read_output(table: Table<'_, '_>, screens: &[Screen]) -> Result<Output, ConfigError> {
    let table = table.only(&["name", "size_px", "window", "headless", "channels"])?;
    let example = "size_px = [1920, 1080]";
    let channels = list(
        &table,
        "channels",
        "[[hosts.outputs.channels]] with screen and canvas_px",
    )?
    .into_iter()
    .map(|channel| read_channel(channel, screens))
    .collect::<Result<_, _>>()?;
    Ok(Output {
        name: table.require("name", "name = \"projector\"")?.text()?,
        size_px: table.require("size_px", example)?.integers(example)?,
        window: read_window(&table)?,
        channels,
    })
}

fn read_window(output: &Table<'_, '_>) -> Result<Option<WindowPlacement>, ConfigError> {
    let example = "window = { position_px = [0, 0], fullscreen = false } or headless = true";
    let headless = output
        .get("headless")
        .map(|value| value.boolean())
        .transpose()?;
    match (output.get("window"), headless) {
        (None, Some(true)) => Ok(None),
        (Some(window), None | Some(false)) => {
            let table = window.table()?.only(&["position_px", "fullscreen"])?;
            let position = table.require("position_px", "position_px = [0, 0]")?;
            let fullscreen = table
                .get("fullscreen")
                .map(|value| value.boolean())
                .transpose()?;
            Ok(Some(WindowPlacement {
                position_px: position.integers("position_px = [0, 0]")?,
                fullscreen: fullscreen.unwrap_or(false),
            }))
        }
        (Some(window), Some(true)) => Err(window.error(
            Fault::OutOfRange,
            "an output has a window or is headless; remove one of the two",
        )),
        (None, None | Some(false)) => Err(output.error(
            Fault::MissingKey,
            format!(
                "the output has neither a window nor headless = true; write for example {example}"
            ),
        )),
    }
}

fn read_channel(table: Table<'_, '_>, screens: &[Screen]) -> Result<Channel, ConfigError> {
    let table = table.only(&["screen", "canvas_px", "output_px"])?;
    let reference = table.require("screen", "screen = \"front\"")?;
    let screen = find(
        &reference,
        "screen",
        screens.iter().map(|s| s.name.as_str()),
    )?;
    let example = "canvas_px = [0, 0, 1920, 1080] (x, y, width, height)";
    let [x, y, width, height] = table.require("canvas_px", example)?.integers(example)?;
    let output_px = match table.get("output_px") {
        Some(value) => value.integers("output_px = [0, 0]")?,
        None => [0, 0],
    };
    Ok(Channel {
        screen,
        canvas_px: Rect {
            x,
            y,
            width,
            height,
        },
        output_px,
    })
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
fn find<'n>(
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
