//! Wall files for an eye: a given one with the head elsewhere, and one whose screens are the image planes of cameras.
//!
//! In: tables of wall files, heads, cameras. Out: texts of wall files. It runs nothing. The pose of a scene is that of the
//! first observer's resting head: all walls made from one file keep a first observer whose head rests where it does there.

use std::path::Path;

use glam::DVec3;
use toml::{Table, Value};

use super::Camera;

/// A wall file with a head (metres in the room, degrees by which it looks aside) instead of the first observer's, where one
/// is given. Nothing tracks it, and no black level is added: the eyes of tests see no projector's own black.
///
/// # Panics
/// For what is no wall file.
#[must_use]
pub fn of_test(mut wall: Table, head: Option<([f64; 3], [f64; 3])>) -> String {
    wall.remove("trackers");
    for observer in tables(&mut wall, "observers") {
        observer.remove("tracker");
    }
    for host in tables(&mut wall, "hosts") {
        for output in tables(host, "outputs") {
            for channel in tables(output, "channels") {
                channel.remove("black_level");
            }
        }
    }
    if let Some((head_m, looks_deg)) = head {
        let observers = wall["observers"].as_array_mut().expect("observers");
        let mut rest = observers[0].clone();
        rest["name"] = "rest".into();
        let viewer = observers[0].as_table_mut().expect("an observer");
        viewer.insert("head_m".to_owned(), head_m.to_vec().into());
        viewer.insert("looks_deg".to_owned(), looks_deg.to_vec().into());
        observers.insert(0, rest);
    }
    wall.to_string()
}

/// A wall file that names the files of screens and calibrations in this folder so that they are found from anywhere.
///
/// # Panics
/// For what is no wall file.
#[must_use]
pub fn with_files_from(mut wall: Table, folder: &Path) -> Table {
    let place = |table: &mut Table| {
        if let Some(file) = table.get_mut("file") {
            let name = file.as_str().expect("a file's name");
            *file = folder.join(name).display().to_string().into();
        }
    };
    tables(&mut wall, "screens").for_each(place);
    for host in tables(&mut wall, "hosts") {
        for output in tables(host, "outputs") {
            for channel in tables(output, "channels") {
                let calibration = channel.get_mut("calibration").and_then(Value::as_table_mut);
                calibration.into_iter().for_each(place);
            }
        }
    }
    wall
}

/// A wall without ramps and with a share of the pixels, which must be whole ones: for commands that draw walls as they are.
///
/// # Panics
/// For what is no wall file, and where a share of a size or place is no whole number.
#[must_use]
pub fn with_share(wall: &str, share: f64) -> String {
    let mut wall: Table = wall.parse().expect("a wall file");
    let shrink = |table: &mut Table, key: &str| {
        let values = table.get_mut(key).and_then(Value::as_array_mut);
        for value in values.into_iter().flatten() {
            let pixels = value.as_integer().expect("pixels") as f64 * share;
            assert_eq!(pixels.fract(), 0.0, "{key} has no such share");
            *value = Value::Integer(pixels as i64);
        }
    };
    for screen in tables(&mut wall, "screens") {
        shrink(screen, "size_px");
    }
    for host in tables(&mut wall, "hosts") {
        for output in tables(host, "outputs") {
            shrink(output, "size_px");
            for channel in tables(output, "channels") {
                shrink(channel, "canvas_px");
                shrink(channel, "output_px");
            }
        }
    }
    wall.to_string()
}

/// A planar wall: for each camera a host `eye0`, `eye1` … with one output `picture`, whose screen is the camera's image
/// plane with `samples`² pixels for each of the camera's. `rest_m` is where the scene's pose holds.
#[must_use]
pub fn single(rest_m: [f64; 3], cameras: &[Camera], samples: u32) -> String {
    let numbers = |vector: DVec3| Value::from(vector.to_array().to_vec());
    let rest = [("name", "rest".into()), ("head_m", rest_m.to_vec().into())];
    let mut observers = vec![table(rest)];
    let (mut screens, mut hosts) = (Vec::new(), Vec::new());
    for (number, camera) in cameras.iter().enumerate() {
        let name = Value::from(format!("eye{number}"));
        let [width, height] = camera.size_px.map(|side| i64::from(side * samples));
        let size_px = Value::from(vec![width, height]);
        let [bottom_left, bottom_right, top_left] = camera.corners_m().map(numbers);
        let corners_m = table([
            ("bottom_left", bottom_left),
            ("bottom_right", bottom_right),
            ("top_left", top_left),
        ]);
        observers.push(table([
            ("name", name.clone()),
            ("head_m", numbers(camera.eye_m)),
        ]));
        screens.push(table([
            ("name", name.clone()),
            ("kind", "planar".into()),
            ("observer", name.clone()),
            ("size_px", size_px.clone()),
            ("corners_m", corners_m),
        ]));
        let channel = table([
            ("screen", name.clone()),
            ("canvas_px", vec![0, 0, width, height].into()),
        ]);
        let output = table([
            ("name", "picture".into()),
            ("size_px", size_px),
            ("headless", true.into()),
            ("channels", vec![channel].into()),
        ]);
        // Each on a host of its own: they must not have to share what one device can hold.
        hosts.push(table([("name", name), ("outputs", vec![output].into())]));
    }
    let wall = table([("name", "reference".into()), ("fps", 30.into())]);
    let entries = [
        ("wall", wall),
        ("observers", observers.into()),
        ("screens", screens.into()),
        ("hosts", hosts.into()),
    ];
    entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect::<Table>()
        .to_string()
}

fn table<const N: usize>(entries: [(&str, Value); N]) -> Value {
    let entries = entries.into_iter();
    Value::Table(
        entries
            .map(|(key, value)| (key.to_owned(), value))
            .collect(),
    )
}

/// The tables of an array, none where there is no such array.
fn tables<'t>(table: &'t mut Table, key: &str) -> impl Iterator<Item = &'t mut Table> {
    let all = table.get_mut(key).and_then(Value::as_array_mut);
    all.into_iter().flatten().filter_map(Value::as_table_mut)
}
