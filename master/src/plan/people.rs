//! Who is in a room: heads with both eyes and where they look, lines of sight, trackers.
//!
//! In: heads and trackers, and a view. Out: SVG text. It measures nothing.

use std::fmt::Write as _;

use glam::DVec3;

use super::labels::{Label, Labels};
use super::scene::{LOOK_M, Room, TRACKER_AXIS_M};
use super::view::Place;

/// Half the width of a head in metres (DIN 33402: 0.15 to 0.16 m wide), and the least radius on the page.
pub(super) const HEAD_M: f64 = 0.078;
const LEAST_HEAD: f64 = 5.0;
/// The longest arrow on the page.
const LONGEST_LOOK: f64 = 70.0;
/// Left and right eye.
const EYE_COLOURS: [&str; 2] = ["#d55e00", "#0072b2"];
/// Axes x, y, z of a tracker.
const AXIS_COLOURS: [&str; 3] = ["#c00000", "#008000", "#0000c0"];

/// From each head to the corners of its screens.
pub(super) fn sight_lines(svg: &mut String, room: &Room<'_>, place: &Place) {
    svg.push_str(
        "<g class=\"frusta\" stroke=\"#444\" stroke-opacity=\"0.22\" stroke-width=\"0.8\">\n",
    );
    for screen in &room.screens {
        let Some(person) = room.viewer(screen.screen) else {
            continue;
        };
        for corner_m in &screen.corners_m {
            let line = place.path(&[person.pose.position_m, *corner_m]);
            let _ = writeln!(svg, "<path d=\"{line}\"/>");
        }
    }
    svg.push_str("</g>\n");
}

pub(super) fn draw(svg: &mut String, room: &Room<'_>, place: &Place, labels: &mut Labels) {
    for tracker in &room.trackers {
        let origin_m = DVec3::from(tracker.to_room.origin_m);
        let axes = [tracker.to_room.x, tracker.to_room.y, tracker.to_room.z].map(DVec3::from);
        let _ = writeln!(svg, "<g class=\"tracker\" stroke-width=\"1.8\">");
        for (axis, colour) in axes.into_iter().zip(AXIS_COLOURS) {
            let line = place.path(&[origin_m, origin_m + axis * TRACKER_AXIS_M]);
            let _ = writeln!(svg, "<path d=\"{line}\" stroke=\"{colour}\"/>");
        }
        let [x, y] = place.page(origin_m);
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"6\" height=\"6\" fill=\"white\" stroke=\"black\" stroke-width=\"1\"/>\n</g>",
            x - 3.0,
            y - 3.0
        );
        labels.take([x, y], 5.0);
        let aside = 14.0 + 3.0 * tracker.name.chars().count() as f64;
        write(
            svg,
            labels,
            &tracker.name,
            [
                [x + aside, y + 10.0],
                [x - aside, y + 10.0],
                [x + aside, y - 12.0],
            ],
        );
    }
    for person in &room.people {
        let head_m = person.pose.position_m;
        let [x, y] = place.page(head_m);
        let radius = (HEAD_M * place.scale).max(LEAST_HEAD);
        let look_m = LOOK_M.min(LONGEST_LOOK / place.scale);
        let [tip_x, tip_y] = place.page(head_m - person.pose.back * look_m);
        let _ = writeln!(
            svg,
            "<g class=\"head\">\n<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"white\" fill-opacity=\"0.8\" stroke=\"black\"/>"
        );
        let (along_x, along_y) = (tip_x - x, tip_y - y);
        let length = (along_x * along_x + along_y * along_y).sqrt();
        // An arrow that points at the reader is the head itself.
        if length > radius {
            let (unit_x, unit_y) = (along_x / length, along_y / length);
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {y:.1}L{tip_x:.1} {tip_y:.1}M{:.1} {:.1}L{tip_x:.1} {tip_y:.1}L{:.1} {:.1}\" fill=\"none\" stroke=\"black\" stroke-width=\"1.2\"/>",
                tip_x - 7.0 * unit_x + 3.0 * unit_y,
                tip_y - 7.0 * unit_y - 3.0 * unit_x,
                tip_x - 7.0 * unit_x - 3.0 * unit_y,
                tip_y - 7.0 * unit_y + 3.0 * unit_x
            );
        }
        for (eye_m, colour) in person.eyes_m.into_iter().zip(EYE_COLOURS) {
            let [x, y] = place.page(eye_m);
            let _ = writeln!(
                svg,
                "<circle class=\"eye\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.8\" fill=\"{colour}\"/>"
            );
        }
        svg.push_str("</g>\n");
        labels.take([x, y], radius);
        labels.take([0.5 * (x + tip_x), 0.5 * (y + tip_y)], 0.25 * length);
        let aside = radius + 6.0 + 3.2 * person.observer.name.chars().count() as f64;
        write(
            svg,
            labels,
            &person.observer.name,
            [
                [x + aside, y + 2.0],
                [x - aside, y + 2.0],
                [x, y + radius + 9.0],
            ],
        );
    }
}

fn write(svg: &mut String, labels: &mut Labels, text: &str, places: [[f64; 2]; 3]) {
    let label = Label {
        lines: &[text.to_owned()],
        size: 11.0,
        style: "font-style=\"italic\"",
        places: places.to_vec(),
    };
    labels.write(svg, &label);
}
