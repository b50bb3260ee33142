//! From TOML to a scene: keys and types. What the values mean is checked afterwards, by the same code
//! that checks a scene from the wire.

use geodesy::Ellipsoid;

use super::fields::{self, Keyed};
use super::slot::read_name;
use super::{
    Atmosphere, Layer, LayerKind, LayerParameters, Lens, LensLayer, Light, MeshOptions, Scene, Sun,
    check,
};
use crate::camera::{Camera, Keyframe, Orbit, Path, Place};
use crate::config::{ConfigError, Document, Fault, Table, Value, nearest};

const PLACE: &str = "place = { latitude_deg = 45.8, longitude_deg = 6.9, altitude_m = 9000, heading_deg = 0, pitch_deg = -30 }";
const LAYER: &str = "[layers.relief] with kind = \"elevation\" and a repository";
const LENS: &str =
    "[lenses.loupe] with latitude_deg = 45.8, longitude_deg = 6.9 and radius_m = 20000";

/// The keys of the whole file.
pub(super) const KEYS: [&str; 7] = [
    "planet",
    "camera",
    "layers",
    "lenses",
    "light",
    "atmosphere",
    "mesh",
];

/// Reads the whole file.
pub(super) fn read(document: &Document<'_>) -> Result<Scene, ConfigError> {
    let root = document.root().only(&KEYS)?;
    let camera = root
        .require("camera", "[camera] with mode = \"fixed\" and a place")?
        .table()?;
    let mut layers = Vec::new();
    for (name, table) in named_tables(&root.require("layers", LAYER)?, LAYER)? {
        layers.push(read_layer(name, table)?);
    }
    let mut lenses = Vec::new();
    if let Some(value) = root.get("lenses") {
        for (name, table) in named_tables(&value, LENS)? {
            lenses.push(read_lens(name, table, &layers)?);
        }
    }
    let mut light = Light::default();
    if let Some(value) = root.get("light") {
        let table = only(value.table()?, &light, &["sun"])?;
        light.sun = table
            .get("sun")
            .map_or(Ok(light.sun), |value| read_sun(&value))?;
        fields::read(&table, &mut light)?;
    }
    Ok(Scene {
        planet: root
            .get("planet")
            .map_or(Ok(Ellipsoid::EARTH), |value| read_planet(&value))?,
        camera: read_camera(camera)?,
        layers,
        lenses,
        light,
        atmosphere: read_options(&root, "atmosphere", Atmosphere::default())?,
        mesh: read_options(&root, "mesh", MeshOptions::default())?,
    })
}

/// A table all of whose keys have defaults.
fn read_options<T: Keyed + Clone>(
    root: &Table<'_, '_>,
    key: &str,
    mut options: T,
) -> Result<T, ConfigError> {
    if let Some(value) = root.get(key) {
        fields::read(&only(value.table()?, &options, &[])?, &mut options)?;
    }
    Ok(options)
}

/// Refuses every key but those of `owner` and `further` ones.
fn only<'d, 'i>(
    table: Table<'d, 'i>,
    owner: &(impl Keyed + Clone),
    further: &[&str],
) -> Result<Table<'d, 'i>, ConfigError> {
    table.only(&[further, &fields::keys(owner)].concat())
}

/// Tables under names, sorted by name.
fn named_tables<'d, 'i>(
    value: &Value<'d, 'i>,
    example: &str,
) -> Result<Vec<(String, Table<'d, 'i>)>, ConfigError> {
    if value.is_list() {
        let advice = format!("this is a list; write a table for each name, for example {example}");
        return Err(value.error(Fault::WrongType, advice));
    }
    let mut tables = Vec::new();
    for (name, value) in value.table()?.entries() {
        check::usable_name(&name).map_err(|advice| value.error(Fault::Name, advice))?;
        tables.push((name, value.table()?));
    }
    tables.sort_by(|(a, _), (b, _)| a.cmp(b));
    Ok(tables)
}

fn read_layer(name: String, table: Table<'_, '_>) -> Result<Layer, ConfigError> {
    let kind = table.require("kind", "kind = \"elevation\"")?;
    let kind: LayerKind = read_name("kind of layer", &kind)?;
    let mut parameters = LayerParameters::new(kind);
    let repository = table.get("repository");
    if let (Some(repository), false) = (&repository, kind.has_repository()) {
        let advice = "layers of this kind are made from the elevation of the scene; remove it";
        return Err(repository.error(Fault::UnknownKey, advice));
    }
    let known: &[&str] = if kind.has_repository() {
        &["kind", "repository"]
    } else {
        &["kind"]
    };
    let table = only(table, &parameters, known)?;
    fields::read(&table, &mut parameters)?;
    let repository = if kind.has_repository() {
        let example = "repository = \"data/relief\"";
        Some(table.require("repository", example)?.text()?)
    } else {
        None
    };
    Ok(Layer {
        name,
        repository,
        parameters,
    })
}

fn read_lens(name: String, table: Table<'_, '_>, layers: &[Layer]) -> Result<Lens, ConfigError> {
    let mut lens = Lens {
        name,
        latitude_deg: 0.0,
        longitude_deg: 0.0,
        radius_m: 0.0,
        layers: Vec::new(),
    };
    let table = only(table, &lens, &["layers"])?;
    for key in fields::keys(&lens) {
        table.require(key, LENS)?;
    }
    fields::read(&table, &mut lens)?;
    if let Some(value) = table.get("layers") {
        let example = format!("[lenses.{}.layers.relief] with scale = 2", lens.name);
        for (name, table) in named_tables(&value, &example)? {
            lens.layers.push(read_lens_layer(&name, table, layers)?);
        }
    }
    Ok(lens)
}

/// A layer's parameters within a lens: those of the layer, and then what the lens gives.
fn read_lens_layer(
    name: &str,
    table: Table<'_, '_>,
    layers: &[Layer],
) -> Result<LensLayer, ConfigError> {
    let found = layers
        .iter()
        .enumerate()
        .find(|(_, layer)| layer.name == name);
    let Some((index, layer)) = found else {
        let known: Vec<&str> = layers.iter().map(|layer| layer.name.as_str()).collect();
        let advice = match nearest(name, &known) {
            Some(meant) => format!("there is no such layer; did you mean {meant}?"),
            None if known.is_empty() => "there is no such layer, nor any other".to_owned(),
            None => format!("there is no such layer; write one of {}", known.join(", ")),
        };
        return Err(table.error(Fault::Name, advice));
    };
    for key in ["kind", "repository"] {
        if let Some(value) = table.get(key) {
            let advice = "a lens gives parameters of a layer and no other data; remove it";
            return Err(value.error(Fault::UnknownKey, advice));
        }
    }
    let mut parameters = layer.parameters.clone();
    let table = only(table, &parameters, &[])?;
    let keys = fields::keys(&parameters).into_iter();
    let given = keys.filter(|key| table.get(key).is_some());
    let given = given.map(str::to_owned).collect();
    fields::read(&table, &mut parameters)?;
    Ok(LensLayer {
        layer: index,
        parameters,
        given,
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
    let mut place = Place {
        latitude_deg: 0.0,
        longitude_deg: 0.0,
        altitude_m: 0.0,
        heading_deg: 0.0,
        pitch_deg: 0.0,
        roll_deg: 0.0,
    };
    let table = only(owner.require("place", PLACE)?.table()?, &place, &[])?;
    for key in ["latitude_deg", "longitude_deg", "altitude_m"] {
        table.require(key, PLACE)?;
    }
    fields::read(&table, &mut place)?;
    Ok(place)
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
