//! The plan of a room as engineers draw it: from above, from the front and from the right, to one scale, as SVG.
//!
//! In: a validated wall and its surfaces. Out: the text of one SVG file. It must not judge the wall.

mod channels;
mod colour;
pub(crate) mod face;
mod labels;
mod legend;
mod people;
mod scene;
mod view;

use std::fmt::Write as _;

use protocol::Wall;
use protocol::wall::Surfaces;

use scene::Room;
use view::{Place, View};

/// Room for the titles of views, and for the numbers at their axes.
const MARGIN: f64 = 46.0;
/// What a view has at most: widths of both columns, heights of both rows.
const COLUMNS: [f64; 2] = [640.0, 470.0];
const ROWS: [f64; 2] = [470.0, 360.0];

/// The plan of a wall, in metres.
pub(crate) fn room_plan(wall: &Wall, surfaces: &Surfaces) -> String {
    let room = Room::new(wall, surfaces);
    let [low, high] = room.bounds_m;
    let extent = high - low;
    // The third-angle projection: the view from above is above, the view from the right is at the right.
    let scale = (COLUMNS[0] / extent.x)
        .min(COLUMNS[1] / extent.z)
        .min(ROWS[0] / extent.z)
        .min(ROWS[1] / extent.y);
    let left = 1.4 * MARGIN;
    let right = left + extent.x * scale + 2.0 * MARGIN;
    let top = 1.2 * MARGIN;
    let legend = legend::Legend::new(&room, scale);
    let below = top + (extent.z * scale).max(legend.height) + 2.0 * MARGIN;
    let width = right + (extent.z * scale).max(legend::WIDTH) + MARGIN;
    let height = below + extent.y * scale + 1.3 * MARGIN;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let above_at = [left, below - 2.0 * MARGIN - extent.z * scale];
    for (view, at) in [
        (View::ABOVE, above_at),
        (View::FRONT, [left, below]),
        (View::RIGHT, [right, below]),
    ] {
        view::draw(&mut svg, &room, &Place::new(view, &room, at, scale));
    }
    let _ = writeln!(svg, "<g transform=\"translate({right:.1} {top:.1})\">");
    svg.push_str(&legend.svg);
    svg.push_str("</g>\n</svg>\n");
    svg
}
