//! The file of a running wall, edited key by key: its comments and its order stay.
//!
//! In: the text of a wall file, patches of its measures as JSON. Out: the text with them, and what there is to be changed
//! as JSON. It judges no measure: whoever parses the text does. Only what a running wall can take may be changed.

use std::path::{Path, PathBuf};

use protocol::Wall;
use serde_json::{Map, Value, json};
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table};

/// Keys that may change of each kind of thing.
const OF_OBSERVERS: &[&str] = &["head_m", "looks_deg", "eye_separation_m"];
const OF_SCREENS: &[&str] = &[
    "corners_m",
    "foot_m",
    "axis",
    "radius_m",
    "azimuth_deg",
    "height_m",
    "aligned_from_m",
    "centre_m",
    "tilt_deg",
    "fisheye_deg",
    "elevation_deg",
];
const OF_OUTPUTS: &[&str] = &["gamma", "swap_eyes"];
const OF_CHANNELS: &[&str] = &["blend_gamma", "black_level"];

/// Why a patch was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {advice}")]
pub(crate) struct PatchError {
    /// Path of the key.
    pub(crate) path: String,
    /// What to do instead.
    pub(crate) advice: String,
}

/// A wall file that is open for changes.
#[derive(Clone, Debug)]
pub struct WallFile {
    path: PathBuf,
    document: DocumentMut,
    /// Whether the file says what the document does.
    saved: bool,
}

impl WallFile {
    /// Takes the text of a file that was read as a wall. `None` where it cannot be edited as TOML.
    #[must_use]
    pub fn open(path: &Path, text: &str) -> Option<Self> {
        Some(Self {
            path: path.to_owned(),
            document: text.parse().ok()?,
            saved: true,
        })
    }

    /// What may be changed, as it stands: observers and screens by name, outputs as `HOST/OUTPUT` with their channels by
    /// number.
    pub(crate) fn to_json(&self) -> Value {
        let mut whole = Map::new();
        for (list, keys) in [("observers", OF_OBSERVERS), ("screens", OF_SCREENS)] {
            let named = tables(self.document.get(list)).map(|table| (name(table), table));
            let things: Map<String, Value> = named
                .map(|(name, table)| (name, Value::Object(values(table, keys))))
                .collect();
            whole.insert(list.to_owned(), Value::Object(things));
        }
        let mut outputs = Map::new();
        for host in tables(self.document.get("hosts")) {
            for output in tables(host.get("outputs")) {
                let mut own = values(output, OF_OUTPUTS);
                let channels: Map<String, Value> = channels(output)
                    .into_iter()
                    .enumerate()
                    .map(|(number, values)| (number.to_string(), Value::Object(values)))
                    .collect();
                own.insert("channels".to_owned(), Value::Object(channels));
                outputs.insert(
                    format!("{}/{}", name(host), name(output)),
                    Value::Object(own),
                );
            }
        }
        whole.insert("outputs".to_owned(), Value::Object(outputs));
        whole.insert("saved".to_owned(), json!(self.saved));
        Value::Object(whole)
    }

    /// The file with a patch of the form of [`WallFile::to_json`], and the wall that it describes.
    pub(crate) fn patched(&self, patch: &Value) -> Result<(Self, Wall), PatchError> {
        let mut file = self.clone();
        let whole = object(patch, "")?;
        for (list, things) in whole {
            let things = object(things, list)?;
            for (thing, changes) in things {
                let path = format!("{list}.{thing}");
                let changes = object(changes, &path)?;
                match list.as_str() {
                    "observers" => file.change(list, thing, changes, OF_OBSERVERS, &path)?,
                    "screens" => file.change(list, thing, changes, OF_SCREENS, &path)?,
                    "outputs" => file.change_output(thing, changes, &path)?,
                    _ => {
                        return Err(refuse(
                            list,
                            "write observers, screens or outputs; anything else needs a restart of the wall",
                        ));
                    }
                }
            }
        }
        let text = file.document.to_string();
        let wall = Wall::parse(&text, &file.path.display().to_string())
            .map_err(|error| refuse(error.key(), &error.to_string()))?;
        file.saved = false;
        Ok((file, wall))
    }

    fn change(
        &mut self,
        list: &str,
        thing: &str,
        changes: &Map<String, Value>,
        keys: &[&str],
        path: &str,
    ) -> Result<(), PatchError> {
        let known: Vec<String> = tables(self.document.get(list)).map(name).collect();
        let tables = tables_mut(self.document.get_mut(list));
        let Some(table) = tables.into_iter().find(|table| name(table) == thing) else {
            return Err(refuse(
                path,
                &format!("there is no such thing; write one of {}", known.join(", ")),
            ));
        };
        apply(table, changes, keys, path)
    }

    fn change_output(
        &mut self,
        thing: &str,
        changes: &Map<String, Value>,
        path: &str,
    ) -> Result<(), PatchError> {
        let none = || refuse(path, "there is no such output; write HOST/OUTPUT");
        let (host, output) = thing.split_once('/').ok_or_else(none)?;
        let hosts = tables_mut(self.document.get_mut("hosts"));
        let host = hosts.into_iter().find(|table| name(table) == host);
        let outputs = tables_mut(host.ok_or_else(none)?.get_mut("outputs"));
        let found = outputs.into_iter().find(|table| name(table) == output);
        let table = found.ok_or_else(none)?;
        let mut own = changes.clone();
        if let Some(of_channels) = own.remove("channels") {
            let path = format!("{path}.channels");
            for (number, changes) in object(&of_channels, &path)? {
                let path = format!("{path}.{number}");
                let changes = object(changes, &path)?;
                let none = || refuse(&path, "there is no such channel; write its number, from 0");
                let number: usize = number.parse().map_err(|_| none())?;
                change_channel(table, number, changes, &path).ok_or_else(none)??;
            }
        }
        apply(table, &own, OF_OUTPUTS, path)
    }

    /// Writes the file, whole or not at all.
    pub(crate) fn save(&mut self) -> std::io::Result<()> {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        let mut partial = tempfile::NamedTempFile::new_in(if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        })?;
        std::io::Write::write_all(&mut partial, self.document.to_string().as_bytes())?;
        if let Ok(known) = std::fs::metadata(&self.path) {
            partial.as_file().set_permissions(known.permissions())?;
        }
        partial.as_file().sync_all()?;
        partial.persist(&self.path).map_err(|error| error.error)?;
        self.saved = true;
        Ok(())
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

fn refuse(path: &str, advice: &str) -> PatchError {
    PatchError {
        path: path.to_owned(),
        advice: advice.to_owned(),
    }
}

fn object<'v>(value: &'v Value, path: &str) -> Result<&'v Map<String, Value>, PatchError> {
    value
        .as_object()
        .ok_or_else(|| refuse(path, "write an object: names, and what changes of each"))
}

fn tables(item: Option<&Item>) -> impl Iterator<Item = &Table> {
    item.and_then(Item::as_array_of_tables)
        .into_iter()
        .flat_map(ArrayOfTables::iter)
}

fn tables_mut(item: Option<&mut Item>) -> Vec<&mut Table> {
    item.and_then(Item::as_array_of_tables_mut)
        .map(|tables| tables.iter_mut().collect())
        .unwrap_or_default()
}

fn name(table: &Table) -> String {
    let name = table.get("name").and_then(Item::as_str);
    name.unwrap_or_default().to_owned()
}

fn values(table: &Table, keys: &[&str]) -> Map<String, Value> {
    let values = keys.iter().filter_map(|key| {
        let value = table.get(key)?.as_value()?;
        Some(((*key).to_owned(), to_json(value)))
    });
    values.collect()
}

/// What may change of each channel of an output: channels are tables of their own, or stand in one line.
fn channels(output: &Table) -> Vec<Map<String, Value>> {
    let item = output.get("channels");
    if let Some(in_line) = item.and_then(Item::as_array) {
        let tables = in_line.iter().filter_map(toml_edit::Value::as_inline_table);
        return tables
            .map(|table| {
                let values = OF_CHANNELS
                    .iter()
                    .filter_map(|key| Some(((*key).to_owned(), to_json(table.get(key)?))));
                values.collect()
            })
            .collect();
    }
    tables(item)
        .map(|table| values(table, OF_CHANNELS))
        .collect()
}

/// `None` where there is no such channel.
fn change_channel(
    output: &mut Table,
    number: usize,
    changes: &Map<String, Value>,
    path: &str,
) -> Option<Result<(), PatchError>> {
    let item = output.get_mut("channels")?;
    if let Some(tables) = item.as_array_of_tables_mut() {
        return Some(apply(tables.get_mut(number)?, changes, OF_CHANNELS, path));
    }
    let table = item
        .as_array_mut()?
        .get_mut(number)?
        .as_inline_table_mut()?;
    Some(changes.iter().try_for_each(|(key, value)| {
        let (value, path) = checked(key, value, OF_CHANNELS, path)?;
        let new = from_json(value, table.get(key), &path)?;
        table.insert(key, new);
        Ok(())
    }))
}

fn apply(
    table: &mut Table,
    changes: &Map<String, Value>,
    keys: &[&str],
    path: &str,
) -> Result<(), PatchError> {
    for (key, value) in changes {
        let (value, path) = checked(key, value, keys, path)?;
        let known = table.get(key).and_then(Item::as_value);
        let mut new = from_json(value, known, &path)?;
        if let Some(known) = known {
            // The comment behind a value stays.
            *new.decor_mut() = known.decor().clone();
        }
        table.insert(key, Item::Value(new));
    }
    Ok(())
}

fn checked<'v>(
    key: &str,
    value: &'v Value,
    keys: &[&str],
    path: &str,
) -> Result<(&'v Value, String), PatchError> {
    let path = format!("{path}.{key}");
    if keys.contains(&key) {
        return Ok((value, path));
    }
    let advice = format!(
        "this cannot change while the wall runs; what can is {}",
        keys.join(", ")
    );
    Err(refuse(&path, &advice))
}

fn to_json(value: &toml_edit::Value) -> Value {
    match value {
        toml_edit::Value::String(text) => json!(text.value()),
        toml_edit::Value::Integer(number) => json!(number.value()),
        toml_edit::Value::Float(number) => json!(number.value()),
        toml_edit::Value::Boolean(flag) => json!(flag.value()),
        toml_edit::Value::Datetime(moment) => json!(moment.value().to_string()),
        toml_edit::Value::Array(list) => list.iter().map(to_json).collect(),
        toml_edit::Value::InlineTable(table) => {
            let entries = table
                .iter()
                .map(|(key, value)| (key.to_owned(), to_json(value)));
            Value::Object(entries.collect())
        }
    }
}

/// A value of a wall file out of JSON. Objects change what `known` has of their keys, and leave the rest.
fn from_json(
    value: &Value,
    known: Option<&toml_edit::Value>,
    path: &str,
) -> Result<toml_edit::Value, PatchError> {
    match value {
        Value::Bool(flag) => Ok((*flag).into()),
        Value::Number(number) => number
            .as_f64()
            .filter(|number| number.is_finite())
            .map(Into::into)
            .ok_or_else(|| refuse(path, "write a finite number")),
        Value::Array(list) => {
            let values = list.iter().map(|value| from_json(value, None, path));
            let values: Vec<toml_edit::Value> = values.collect::<Result<_, _>>()?;
            Ok(toml_edit::Value::Array(values.into_iter().collect()))
        }
        Value::Object(entries) => {
            let known = known.and_then(toml_edit::Value::as_inline_table);
            let mut table = known.cloned().unwrap_or_default();
            for (key, value) in entries {
                let path = format!("{path}.{key}");
                let new = from_json(value, table.get(key), &path)?;
                table.insert(key, new);
            }
            Ok(toml_edit::Value::InlineTable(table))
        }
        Value::Null | Value::String(_) => {
            Err(refuse(path, "write a number, a list, or true or false"))
        }
    }
}
