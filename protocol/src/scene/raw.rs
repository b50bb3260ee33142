//! From TOML to a scene: keys and types. What the values mean is checked afterwards, by the same code
//! that checks a scene from the wire.

use geodesy::Ellipsoid;

use super::{Atmosphere, Layer, LayerKind, Light, MeshOptions, Scene, Sun};
use crate::camera::{Camera, Keyframe, Orbit, Path, Place};
use crate::config::{ConfigError, Document, Fault, Table, Value};

const PLACE: &str = "place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000, heading_deg = 0, pitch_deg = -30 }";

/// Reads the whole file.
pub(super) fn read(document: &Document<'_>) -> Result<Scene, ConfigError> {
    let keys = ["planet", "camera", "layers", "light", "atmosphere", "mesh"];
    let root = document.root().only(&keys)?;
    let camera = root
        .require("camera", "[camera] with mode = \"fixed\" and a place")?
        .table()?;
    let layers = root
        .require("layers", "[[layers]] with name, kind and repository")?
        .tables()?;
    Ok(Scene {
        planet: root
            .get("planet")
            .map_or(Ok(Ellipsoid::EARTH), |value| read_planet(&value))?,
        camera: read_camera(camera)?,
        layers: layers
            .into_iter()
            .map(read_layer)
            .collect::<Result<_, _>>()?,
        light: root
            .get("light")
            .map_or(Ok(Light::default()), |value| read_light(&value))?,
        atmosphere: root
            .get("atmosphere")
            .map_or(Ok(Atmosphere::default()), |value| read_atmosphere(&value))?,
        mesh: root
            .get("mesh")
            .map_or(Ok(MeshOptions::default()), |value| read_mesh(&value))?,
    })
}

fn read_planet(value: &Value<'_, '_>) -> Result<Ellipsoid, ConfigError> {
    let planet = if value.is_table() {
        let table = value.table()?.only(&["semi_major_m", "semi_minor_m"])?;
        let axis = |key: &str| table.require(key, &format!("{key} = 3396190.0"))?.number();
        Ellipsoid::new(axis("semi_major_m")?, axis("semi_minor_m")?)
    } else {
        Ellipsoid::by_name(&value.text()?)
    };
    planet.map_err(|error| value.error(Fault::OutOfRange, error.to_string()))
}

fn read_camera(table: Table<'_, '_>) -> Result<Camera, ConfigError> {
    let mode = table.require("mode", "mode = \"fixed\"")?;
    match mode.text()?.as_str() {
        "fixed" => {
            let table = table.only(&["mode", "place"])?;
            Ok(Camera::Fixed(read_place(&table)?))
        }
        "orbit" => {
            let table = table.only(&["mode", "place", "centre", "degrees_per_second"])?;
            let example = "centre = { latitude_deg = 90, longitude_deg = 0 }";
            let centre = table.require("centre", example)?.table()?;
            let centre = centre.only(&["latitude_deg", "longitude_deg"])?;
            let speed = table.require("degrees_per_second", "degrees_per_second = 6.0")?;
            Ok(Camera::Orbit(Orbit {
                place: read_place(&table)?,
                centre_latitude_deg: centre.require("latitude_deg", example)?.number()?,
                centre_longitude_deg: centre.require("longitude_deg", example)?.number()?,
                degrees_per_second: speed.number()?,
            }))
        }
        "path" => {
            let table = table.only(&["mode", "keyframes", "looped"])?;
            let example = "[[camera.keyframes]] with time_s and place";
            let keyframes = table.require("keyframes", example)?.tables()?;
            let looped = table
                .get("looped")
                .map(|value| value.boolean())
                .transpose()?;
            Ok(Camera::Path(Path {
                keyframes: keyframes
                    .into_iter()
                    .map(read_keyframe)
                    .collect::<Result<_, _>>()?,
                looped: looped.unwrap_or(false),
            }))
        }
        _ => Err(mode.error(
            Fault::OutOfRange,
            "unknown mode; write \"fixed\", \"orbit\" or \"path\"",
        )),
    }
}

fn read_keyframe(table: Table<'_, '_>) -> Result<Keyframe, ConfigError> {
    let table = table.only(&["time_s", "place"])?;
    let time_s = table.require("time_s", "time_s = 2.5")?.number()?;
    Ok(Keyframe {
        time_s,
        place: read_place(&table)?,
    })
}

fn read_place(owner: &Table<'_, '_>) -> Result<Place, ConfigError> {
    let table = owner.require("place", PLACE)?.table()?.only(&[
        "latitude_deg",
        "longitude_deg",
        "altitude_m",
        "heading_deg",
        "pitch_deg",
        "roll_deg",
    ])?;
    let required = |key: &str| table.require(key, PLACE)?.number();
    let optional = |key: &str| table.get(key).map_or(Ok(0.0), |value| value.number());
    Ok(Place {
        latitude_deg: required("latitude_deg")?,
        longitude_deg: required("longitude_deg")?,
        altitude_m: required("altitude_m")?,
        heading_deg: optional("heading_deg")?,
        pitch_deg: required("pitch_deg")?,
        roll_deg: optional("roll_deg")?,
    })
}

fn read_layer(table: Table<'_, '_>) -> Result<Layer, ConfigError> {
    let table = table.only(&["name", "kind", "repository"])?;
    let kind = table.require("kind", "kind = \"elevation\" or kind = \"imagery\"")?;
    Ok(Layer {
        name: table.require("name", "name = \"relief\"")?.text()?,
        kind: match kind.text()?.as_str() {
            "elevation" => LayerKind::Elevation,
            "imagery" => LayerKind::Imagery,
            _ => {
                let advice = "unknown kind of layer; write \"elevation\" or \"imagery\"";
                return Err(kind.error(Fault::OutOfRange, advice));
            }
        },
        repository: table
            .require("repository", "repository = \"data/relief\"")?
            .text()?,
    })
}

fn read_light(value: &Value<'_, '_>) -> Result<Light, ConfigError> {
    let table = value.table()?.only(&["sun", "ambient", "relief"])?;
    let default = Light::default();
    let number = |key: &str, otherwise: f64| table.get(key).map_or(Ok(otherwise), |v| v.number());
    Ok(Light {
        sun: table
            .get("sun")
            .map_or(Ok(default.sun), |value| read_sun(&value))?,
        ambient: number("ambient", default.ambient)?,
        relief: number("relief", default.relief)?,
    })
}

fn read_sun(value: &Value<'_, '_>) -> Result<Sun, ConfigError> {
    let example = "sun = \"camera\" or sun = { latitude_deg = 23.4, longitude_deg = 0 }";
    if value.is_table() {
        let table = value.table()?.only(&["latitude_deg", "longitude_deg"])?;
        return Ok(Sun::Fixed {
            latitude_deg: table.require("latitude_deg", example)?.number()?,
            longitude_deg: table.require("longitude_deg", example)?.number()?,
        });
    }
    if value.text()? == "camera" {
        return Ok(Sun::Camera);
    }
    Err(value.error(Fault::OutOfRange, format!("unknown sun; write {example}")))
}

fn read_atmosphere(value: &Value<'_, '_>) -> Result<Atmosphere, ConfigError> {
    let table = value.table()?.only(&["enabled", "thickness_m", "colour"])?;
    let default = Atmosphere::default();
    Ok(Atmosphere {
        enabled: table
            .get("enabled")
            .map_or(Ok(default.enabled), |value| value.boolean())?,
        thickness_m: table
            .get("thickness_m")
            .map_or(Ok(default.thickness_m), |v| v.number())?,
        colour: table.get("colour").map_or(Ok(default.colour), |value| {
            value.numbers("colour = [0.3, 0.55, 1.0]")
        })?,
    })
}

fn read_mesh(value: &Value<'_, '_>) -> Result<MeshOptions, ConfigError> {
    let table = value
        .table()?
        .only(&["refinement", "tile_px", "deepest_level"])?;
    let default = MeshOptions::default();
    let level = |key: &str, otherwise: u8| table.get(key).map_or(Ok(otherwise), |v| v.integer());
    Ok(MeshOptions {
        refinement: level("refinement", default.refinement)?,
        tile_px: table
            .get("tile_px")
            .map_or(Ok(default.tile_px), |value| value.number())?,
        deepest_level: level("deepest_level", default.deepest_level)?,
    })
}
