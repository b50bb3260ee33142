//! The plan of a room: a wall's screens and observers from above and from the front, as SVG.
//!
//! In: a validated wall. Out: the text of one SVG file. It must not judge the wall.

use std::fmt::Write as _;

use protocol::Wall;
use protocol::wall::{PlanarCorners, Screen};

use crate::plot::escape;

const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 460.0;
const MARGIN: f64 = 50.0;
const COLOURS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

/// Which two room axes a view shows, and how.
struct View {
    title: &'static str,
    /// Room axes to the right and down the page, with the sign of the latter.
    axes: [usize; 2],
    down: f64,
    labels: [&'static str; 2],
}

/// The plan of a wall, in metres.
pub(crate) fn room_plan(wall: &Wall) -> String {
    let views = [
        View {
            title: "from above",
            axes: [0, 2],
            down: 1.0,
            labels: ["x, right", "z, to the viewers"],
        },
        View {
            title: "from the front",
            axes: [0, 1],
            down: -1.0,
            labels: ["x, right", "y, up"],
        },
    ];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{HEIGHT}\" viewBox=\"0 0 {0} {HEIGHT}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        2.0 * WIDTH
    );
    for (index, view) in views.iter().enumerate() {
        let _ = writeln!(
            svg,
            "<g transform=\"translate({} 0)\">",
            WIDTH * index as f64
        );
        draw(&mut svg, wall, view);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// The corners of a part of a screen, from lower left counter-clockwise; `part` holds left, upper, right and lower
/// edge as shares of the canvas, which begins at the upper left.
fn outline(screen: &Screen, [left, upper, right, lower]: [f64; 4]) -> [[f64; 3]; 4] {
    let PlanarCorners {
        bottom_left,
        bottom_right,
        top_left,
    } = screen.corners_m;
    [(left, lower), (right, lower), (right, upper), (left, upper)].map(|(x, y)| {
        std::array::from_fn(|axis| {
            bottom_left[axis]
                + (bottom_right[axis] - bottom_left[axis]) * x
                + (top_left[axis] - bottom_left[axis]) * (1.0 - y)
        })
    })
}

/// A whole canvas.
const WHOLE: [f64; 4] = [0.0, 0.0, 1.0, 1.0];

fn draw(svg: &mut String, wall: &Wall, view: &View) {
    let flat = |point: [f64; 3]| [point[view.axes[0]], point[view.axes[1]] * view.down];
    // The floor's origin is always in sight.
    let mut low = [0.0_f64; 2];
    let mut high = [0.0_f64; 2];
    let heads = wall.observers.iter().map(|observer| observer.head_m);
    let corners = wall
        .screens
        .iter()
        .flat_map(|screen| outline(screen, WHOLE));
    for point in heads.chain(corners) {
        let point = flat(point);
        for axis in 0..2 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let scale = ((WIDTH - 2.0 * MARGIN) / (high[0] - low[0]).max(0.1))
        .min((HEIGHT - 2.0 * MARGIN) / (high[1] - low[1]).max(0.1));
    let page = |point: [f64; 3]| {
        let [x, y] = flat(point);
        (MARGIN + (x - low[0]) * scale, MARGIN + (y - low[1]) * scale)
    };
    let _ = writeln!(
        svg,
        "<text x=\"{MARGIN}\" y=\"20\" font-size=\"15\">{}, {}</text>",
        escape(&wall.name),
        view.title
    );
    let (x, y) = page([0.0; 3]);
    let _ = writeln!(
        svg,
        "<path d=\"M{:.1} {y:.1}h16M{x:.1} {:.1}v16\" stroke=\"#999\"/>\n\
         <text x=\"{MARGIN}\" y=\"{:.1}\" fill=\"#666\">across: {}; along: {}; the bar is 1 m</text>\n\
         <path d=\"M{:.1} {:.1}h{scale:.1}\" stroke=\"black\" stroke-width=\"3\"/>",
        x - 8.0,
        y - 8.0,
        HEIGHT - 8.0,
        view.labels[0],
        view.labels[1],
        WIDTH - MARGIN - scale.min(WIDTH - 2.0 * MARGIN),
        HEIGHT - 22.0
    );
    for (index, screen) in wall.screens.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let corners = outline(screen, WHOLE).map(page);
        if let Some(observer) = wall.observers.get(screen.observer) {
            let (x, y) = page(observer.head_m);
            for (corner_x, corner_y) in corners {
                let _ = writeln!(
                    svg,
                    "<path d=\"M{x:.1} {y:.1}L{corner_x:.1} {corner_y:.1}\" stroke=\"{colour}\" stroke-opacity=\"0.3\"/>"
                );
            }
        }
        let points: Vec<String> = corners
            .iter()
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let (x, y) = corners[3];
        let _ = writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"{colour}\" fill-opacity=\"0.15\" stroke=\"{colour}\" stroke-width=\"2\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{}</text>",
            points.join(" "),
            x + 4.0,
            y - 6.0,
            escape(&screen.name)
        );
    }
    for piece in wall.canvas_layout() {
        let Some(screen) = wall.screens.get(piece.screen) else {
            continue;
        };
        let rect = piece.canvas_px;
        let [width, height] = screen.size_px.map(f64::from);
        let part = [
            f64::from(rect.x) / width,
            f64::from(rect.y) / height,
            f64::from(rect.right()) / width,
            f64::from(rect.bottom()) / height,
        ];
        let points = outline(screen, part).map(|corner| {
            let (x, y) = page(corner);
            format!("{x:.1},{y:.1}")
        });
        let _ = writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"none\" stroke=\"#333\" stroke-width=\"0.7\"/>",
            points.join(" ")
        );
    }
    for observer in &wall.observers {
        let (x, y) = page(observer.head_m);
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\"/>\n<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            x + 10.0,
            y + 4.0,
            escape(&observer.name)
        );
    }
}
