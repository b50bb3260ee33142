//! The wall file as text.
//! In: a draft and the list of what it cannot say. Out: TOML with that list as comments at its head. It writes keys of
//! the wall file's schema and no others.

use glam::DVec3;
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value, value};

use crate::draft::{Channel, Draft, Host, Observer, Output, Screen, Shape, Tracker};
use crate::stereo::{Eye, Stereo};
use crate::{Format, Lost};

/// Where comments break, in characters.
const LINE_CHARACTERS: usize = 118;

/// The whole file.
pub(crate) fn toml(draft: &Draft, lost: &[Lost], origin_name: &str, format: Format) -> String {
    let mut document = DocumentMut::new();
    let root = document.as_table_mut();
    let mut wall = Table::new();
    wall.insert("name", value(&draft.name));
    wall.insert("fps", number(draft.fps));
    root.insert("wall", Item::Table(wall));
    let tables = [
        ("observers", list(&draft.observers, |o| observer(draft, o))),
        ("trackers", list(&draft.trackers, tracker)),
        ("screens", list(&draft.screens, |s| screen(draft, s))),
        ("hosts", list(&draft.hosts, |h| host(draft, h))),
    ];
    for (key, tables) in tables {
        if !tables.is_empty() {
            root.insert(key, Item::ArrayOfTables(tables));
        }
    }
    format!("{}\n{document}", head(lost, origin_name, format))
}

/// The comments at the head.
fn head(lost: &[Lost], origin_name: &str, format: Format) -> String {
    let mut text = String::new();
    comment(
        &mut text,
        "",
        &format!("Converted from {origin_name} ({}).", format.title()),
    );
    match lost.len() {
        0 => comment(&mut text, "", "All of it is carried over."),
        1 => comment(
            &mut text,
            "",
            "One thing is not carried over as it was, or was assumed:",
        ),
        count => comment(
            &mut text,
            "",
            &format!("{count} things are not carried over as they were, or were assumed:"),
        ),
    }
    for (index, lost) in lost.iter().enumerate() {
        let Lost {
            place,
            what,
            why,
            remedy,
        } = lost;
        comment(
            &mut text,
            &format!("{}. ", index + 1),
            &format!("{place}: {what}"),
        );
        comment(&mut text, "   Why: ", why);
        comment(&mut text, "   To do: ", remedy);
    }
    text
}

/// Appends a comment, broken into lines. Control characters become blanks, so that a source cannot end a comment.
fn comment(text: &mut String, mark: &str, words: &str) {
    let clean: String = words
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    let mut line = format!("# {mark}");
    let mut length = line.chars().count();
    let mut fresh = true;
    for word in clean.split_whitespace() {
        let word_length = word.chars().count();
        if !fresh && length + 1 + word_length > LINE_CHARACTERS {
            text.push_str(line.trim_end());
            text.push('\n');
            "#      ".clone_into(&mut line);
            length = 7;
            fresh = true;
        }
        if !fresh {
            line.push(' ');
            length += 1;
        }
        line.push_str(word);
        length += word_length;
        fresh = false;
    }
    text.push_str(line.trim_end());
    text.push('\n');
}

fn list<T>(things: &[T], write: impl Fn(&T) -> Table) -> ArrayOfTables {
    let mut tables = ArrayOfTables::new();
    for thing in things {
        tables.push(write(thing));
    }
    tables
}

/// To the micrometre, or the millionth of a degree.
fn rounded(number: f64) -> f64 {
    let rounded = (number * 1e6).round() / 1e6;
    // Not −0.
    if rounded == 0.0 { 0.0 } else { rounded }
}

fn number(number: f64) -> Item {
    if number.fract() == 0.0 && number.abs() < 1e9 {
        return value(number as i64);
    }
    value(rounded(number))
}

fn numbers(numbers: impl IntoIterator<Item = f64>) -> Value {
    numbers.into_iter().map(rounded).collect::<Array>().into()
}

fn integers(integers: &[i64]) -> Value {
    integers.iter().copied().collect::<Array>().into()
}

fn inline(pairs: impl IntoIterator<Item = (&'static str, Value)>) -> Item {
    let mut table = InlineTable::new();
    for (key, value) in pairs {
        table.insert(key, value);
    }
    value(table)
}

fn observer(draft: &Draft, observer: &Observer) -> Table {
    let mut table = Table::new();
    table.insert("name", value(&observer.name));
    table.insert("head_m", value(numbers(observer.head_m)));
    if observer.looks_deg.map(rounded) != [0.0; 3] {
        table.insert("looks_deg", value(numbers(observer.looks_deg)));
    }
    table.insert(
        "eye_separation_m",
        value(rounded(observer.eye_separation_m)),
    );
    if let Some(tracker) = observer.tracker.and_then(|index| draft.trackers.get(index)) {
        table.insert("tracker", value(&tracker.name));
    }
    table
}

fn tracker(tracker: &Tracker) -> Table {
    let mut table = Table::new();
    table.insert("name", value(&tracker.name));
    table.insert("kind", value("vrpn"));
    table.insert("source", value(&tracker.source));
    table.insert("body", value(tracker.body));
    if let Some(axes) = tracker.to_room {
        let keys = ["origin_m", "x", "y", "z"];
        let pairs = keys.into_iter().zip(axes.map(numbers));
        table.insert("to_room", inline(pairs));
    }
    if tracker.unit_m != 1.0 {
        table.insert("unit_m", value(tracker.unit_m));
    }
    if let Some(body) = tracker.to_head {
        let pairs = ["offset_m", "looks_deg"].into_iter().zip(body.map(numbers));
        table.insert("to_head", inline(pairs));
    }
    table
}

fn screen(draft: &Draft, screen: &Screen) -> Table {
    let mut table = Table::new();
    table.insert("name", value(&screen.name));
    if let Some(observer) = draft.observers.get(screen.observer) {
        table.insert("observer", value(&observer.name));
    }
    table.insert("size_px", value(integers(&screen.size_px)));
    match screen.shape {
        Shape::Planar(corners) => {
            let corner = |point: DVec3| numbers(point.to_array());
            let pairs = [
                ("bottom_left", corner(corners.bottom_left)),
                ("bottom_right", corner(corners.bottom_right)),
                ("top_left", corner(corners.top_left)),
            ];
            table.insert("kind", value("planar"));
            table.insert("corners_m", inline(pairs));
        }
        Shape::Dome {
            centre_m,
            radius_m,
            tilt_deg,
            fisheye_deg,
        } => {
            table.insert("kind", value("sphere"));
            table.insert("centre_m", value(numbers(centre_m)));
            table.insert("radius_m", value(rounded(radius_m)));
            table.insert("tilt_deg", value(rounded(tilt_deg)));
            table.insert("fisheye_deg", value(rounded(fisheye_deg)));
        }
    }
    table
}

fn host(draft: &Draft, host: &Host) -> Table {
    let mut table = Table::new();
    table.insert("name", value(&host.name));
    let outputs = list(&host.outputs, |o| output(draft, o));
    table.insert("outputs", Item::ArrayOfTables(outputs));
    table
}

fn output(draft: &Draft, output: &Output) -> Table {
    let mut table = Table::new();
    table.insert("name", value(&output.name));
    table.insert("size_px", value(integers(&output.size_px)));
    match &output.window {
        None => {
            table.insert("headless", value(true));
        }
        Some(window) => {
            let mut pairs = vec![
                ("position_px", integers(&window.position_px)),
                ("fullscreen", window.fullscreen.into()),
            ];
            if let Some(monitor) = window.monitor {
                pairs.push(("monitor", monitor.into()));
            }
            table.insert("window", inline(pairs));
        }
    }
    if let Some(gpu) = output.gpu {
        table.insert("gpu", value(gpu));
    }
    if output.stereo != Stereo::Off {
        table.insert("stereo", value(output.stereo.name()));
    }
    if output.swap_eyes {
        table.insert("swap_eyes", value(true));
    }
    let channels = list(&output.channels, |c| channel(draft, c));
    table.insert("channels", Item::ArrayOfTables(channels));
    table
}

fn channel(draft: &Draft, channel: &Channel) -> Table {
    let mut table = Table::new();
    if let Some(screen) = draft.screens.get(channel.screen) {
        table.insert("screen", value(&screen.name));
    }
    if channel.eye != Eye::Centre {
        table.insert("eye", value(channel.eye.name()));
    }
    table.insert("canvas_px", value(integers(&channel.canvas_px)));
    table.insert("output_px", value(integers(&channel.output_px)));
    if let Some(file) = &channel.calibration {
        table.insert("calibration", inline([("file", file.as_str().into())]));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_break_at_blanks_and_stay_comments() {
        let mut text = String::new();
        comment(
            &mut text,
            "1. ",
            &format!("evil\n[wall]\u{7} {}", "long ".repeat(60)),
        );
        assert!(text.lines().all(|line| line.starts_with('#')));
        assert!(
            text.lines()
                .all(|line| line.chars().count() <= LINE_CHARACTERS)
        );
        assert!(text.starts_with("# 1. evil [wall] long"));
    }

    #[test]
    fn numbers_are_tidy() {
        assert_eq!(
            numbers([0.1 + 0.2, -1e-9, 1.0]).to_string(),
            "[0.3, 0.0, 1.0]"
        );
    }
}
