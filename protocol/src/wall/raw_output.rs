//! Hosts, outputs and channels out of TOML: keys, types, references to screens. What the values mean is checked
//! afterwards.

use super::raw::{find, flag, list, number_or};
use super::{
    Blend, Calibration, Channel, Eye, Host, Output, Rect, Screen, Stereo, WindowPlacement,
};
use crate::config::{ConfigError, Fault, Table, Value};

/// Reads one `[[hosts]]`.
pub(super) fn read_host(table: Table<'_, '_>, screens: &[Screen]) -> Result<Host, ConfigError> {
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
    let table = table.only(&[
        "name",
        "size_px",
        "window",
        "headless",
        "gpu",
        "stereo",
        "swap_eyes",
        "gamma",
        "channels",
    ])?;
    let example = "size_px = [1920, 1080]";
    let stereo = match table.get("stereo") {
        Some(value) => one_of(&value, &Stereo::NAMES)?,
        None => Stereo::Off,
    };
    let channels = list(
        &table,
        "channels",
        "[[hosts.outputs.channels]] with screen and canvas_px",
    )?
    .into_iter()
    .map(|channel| read_channel(channel, screens, stereo))
    .collect::<Result<_, _>>()?;
    Ok(Output {
        name: table.require("name", "name = \"projector\"")?.text()?,
        size_px: table.require("size_px", example)?.integers(example)?,
        window: read_window(&table)?,
        gpu: table.get("gpu").map(|value| value.integer()).transpose()?,
        stereo,
        swap_eyes: flag(&table, "swap_eyes")?,
        gamma: table.get("gamma").map(|value| value.number()).transpose()?,
        channels,
    })
}

/// The thing that a text names.
fn one_of<T: Copy>(value: &Value<'_, '_>, names: &[(T, &str)]) -> Result<T, ConfigError> {
    let text = value.text()?;
    let found = names.iter().find(|(_, name)| *name == text);
    found.map(|(thing, _)| *thing).ok_or_else(|| {
        let known: Vec<String> = names
            .iter()
            .map(|(_, name)| format!("\"{name}\""))
            .collect();
        value.error(
            Fault::OutOfRange,
            format!("write one of {}", known.join(", ")),
        )
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
            let keys = ["position_px", "fullscreen", "monitor", "pointer"];
            let table = window.table()?.only(&keys)?;
            let monitor = table.get("monitor").map(|value| value.integer());
            let monitor = monitor.transpose()?;
            // On a monitor of its own a window fills it from the corner on.
            let position_px = match (table.get("position_px"), monitor) {
                (None, Some(_)) => [0, 0],
                _ => table
                    .require("position_px", "position_px = [0, 0], or monitor = 0")?
                    .integers("position_px = [0, 0]")?,
            };
            let fullscreen = flag(&table, "fullscreen")?;
            Ok(Some(WindowPlacement {
                position_px,
                fullscreen,
                monitor,
                // Nobody wants an arrow on a projection; a window on a desk is steered by it.
                pointer: table
                    .get("pointer")
                    .map_or(Ok(!fullscreen), |value| value.boolean())?,
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

fn read_channel(
    table: Table<'_, '_>,
    screens: &[Screen],
    stereo: Stereo,
) -> Result<Channel, ConfigError> {
    let table = table.only(&[
        "screen",
        "eye",
        "canvas_px",
        "output_px",
        "size_px",
        "blend_px",
        "blend_gamma",
        "black_level",
        "calibration",
    ])?;
    let reference = table.require("screen", "screen = \"front\"")?;
    let screen = find(
        &reference,
        "screen",
        screens.iter().map(|s| s.name.as_str()),
    )?;
    let eye = match table.get("eye") {
        None => Eye::Centre,
        Some(value) if stereo != Stereo::Off => {
            return Err(value.error(
                Fault::OutOfRange,
                "the output shows both eyes; leave eye out, or write stereo = \"off\"",
            ));
        }
        Some(value) => one_of(
            &value,
            &[
                (Eye::Centre, "centre"),
                (Eye::Left, "left"),
                (Eye::Right, "right"),
            ],
        )?,
    };
    let example = "canvas_px = [0, 0, 1920, 1080] (x, y, width, height)";
    let [x, y, width, height] = table.require("canvas_px", example)?.integers(example)?;
    let pair = |key: &str, example: &str, otherwise| match table.get(key) {
        Some(value) => value.integers(example),
        None => Ok(otherwise),
    };
    let plain = Blend::default();
    Ok(Channel {
        screen,
        eye,
        canvas_px: Rect {
            x,
            y,
            width,
            height,
        },
        output_px: pair("output_px", "output_px = [0, 0]", [0, 0])?,
        size_px: pair("size_px", "size_px = [1920, 1080]", [width, height])?,
        blend: Blend {
            ramps_px: table
                .get("blend_px")
                .map_or(Ok(plain.ramps_px), |value| read_ramps(&value))?,
            gamma: number_or(&table, "blend_gamma", plain.gamma)?,
            black_level: number_or(&table, "black_level", plain.black_level)?,
        },
        calibration: table
            .get("calibration")
            .map(|value| read_calibration(&value))
            .transpose()?,
    })
}

fn read_ramps(value: &Value<'_, '_>) -> Result<[u32; 4], ConfigError> {
    let sides = ["left", "right", "top", "bottom"];
    let table = value.table()?.only(&sides)?;
    let mut ramps_px = [0; 4];
    for (ramp, side) in ramps_px.iter_mut().zip(sides) {
        if let Some(value) = table.get(side) {
            *ramp = value.integer()?;
        }
    }
    Ok(ramps_px)
}

fn read_calibration(value: &Value<'_, '_>) -> Result<Calibration, ConfigError> {
    let table = value.table()?.only(&["file", "region"])?;
    let example = "calibration = { file = \"projector.mpcdi\", region = \"left\" }";
    Ok(Calibration {
        file: table.require("file", example)?.text()?,
        region: table.get("region").map(|value| value.text()).transpose()?,
    })
}
