//! One view of a room on a page: grid, screens with densities and parts, lines of sight.
//!
//! In: what is to be drawn, and where. Out: SVG text. It measures nothing.

use std::fmt::Write as _;

use glam::DVec3;

use super::colour::{STEPS, of_step};
use super::labels::{Label, Labels};
use super::people;
use super::scene::{Drawn, Room};

/// Most lines of names of outputs in one part of a canvas.
const MOST_NAMES: usize = 3;
/// The share of its largest view below which a screen is seen from its side.
const EDGE_ON: f64 = 0.05;
/// Grey for what nobody sees.
const UNSEEN: &str = "#bbbbbb";

/// From where a room is seen.
#[derive(Clone, Copy)]
pub(super) struct View {
    key: &'static str,
    title: &'static str,
    /// Room directions to the right and down the page, and towards whoever looks at it.
    right: DVec3,
    down: DVec3,
    towards: DVec3,
    labels: [&'static str; 2],
}

impl View {
    pub(super) const ABOVE: Self = Self {
        key: "above",
        title: "from above",
        right: DVec3::X,
        down: DVec3::Z,
        towards: DVec3::Y,
        labels: ["x in m, to the right →", "← z in m, towards the viewers"],
    };
    pub(super) const FRONT: Self = Self {
        key: "front",
        title: "from the front, looking along −z",
        right: DVec3::X,
        down: DVec3::NEG_Y,
        towards: DVec3::Z,
        labels: ["x in m, to the right →", "y in m, up →"],
    };
    pub(super) const RIGHT: Self = Self {
        key: "right",
        title: "from the right, looking along −x",
        right: DVec3::NEG_Z,
        down: DVec3::NEG_Y,
        towards: DVec3::X,
        labels: ["← z in m, towards the viewers", "y in m, up →"],
    };
}

/// A view at a place of the page.
pub(super) struct Place {
    view: View,
    at: [f64; 2],
    low: [f64; 2],
    size: [f64; 2],
    pub(super) scale: f64,
}

impl Place {
    pub(super) fn new(view: View, room: &Room<'_>, at: [f64; 2], scale: f64) -> Self {
        let ends = room
            .bounds_m
            .map(|end| [end.dot(view.right), end.dot(view.down)]);
        let low = [0, 1].map(|axis: usize| ends[0][axis].min(ends[1][axis]));
        let high = [0, 1].map(|axis: usize| ends[0][axis].max(ends[1][axis]));
        Self {
            view,
            at,
            low,
            size: [0, 1].map(|axis: usize| (high[axis] - low[axis]) * scale),
            scale,
        }
    }

    /// A point of the room on the page.
    pub(super) fn page(&self, point_m: DVec3) -> [f64; 2] {
        [
            self.at[0] + (point_m.dot(self.view.right) - self.low[0]) * self.scale,
            self.at[1] + (point_m.dot(self.view.down) - self.low[1]) * self.scale,
        ]
    }

    /// Points as the `d` of a path.
    pub(super) fn path(&self, points_m: &[DVec3]) -> String {
        let mut path = String::new();
        for (index, point_m) in points_m.iter().enumerate() {
            let [x, y] = self.page(*point_m);
            let _ = write!(path, "{}{x:.1} {y:.1}", if index == 0 { 'M' } else { 'L' });
        }
        path
    }
}

/// A step of 1, 2 or 5 times a power of ten that is at least so large.
pub(super) fn round_step(least: f64) -> f64 {
    let power = 10.0_f64.powf(least.max(1e-6).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    let found = steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9));
    found.unwrap_or(least)
}

pub(super) fn draw(svg: &mut String, room: &Room<'_>, place: &Place) {
    let mut labels = Labels::default();
    let _ = writeln!(svg, "<g id=\"view-{}\">", place.view.key);
    grid(svg, place);
    let depth = |screen: &Drawn<'_>| {
        let corners = screen.cells.iter().flat_map(|cell| cell.corners_m);
        let [sum, count] = corners.fold([0.0, 0.0], |[sum, count], corner| {
            [sum + corner.dot(place.view.towards), count + 1.0]
        });
        sum / f64::max(count, 1.0)
    };
    // What is nearer covers what is behind it.
    let mut order: Vec<&Drawn<'_>> = room.screens.iter().collect();
    order.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
    for screen in &order {
        surface(svg, room, place, screen);
    }
    for screen in &order {
        parts(svg, place, screen);
    }
    people::sight_lines(svg, room, place);
    people::draw(svg, room, place, &mut labels);
    for screen in &room.screens {
        name(svg, room, place, screen, &mut labels);
    }
    for screen in &room.screens {
        outputs(svg, place, screen, &mut labels);
    }
    svg.push_str("</g>\n");
}

/// Lines at round metres, with numbers, and the title.
fn grid(svg: &mut String, place: &Place) {
    let ([left, top], [width, height]) = (place.at, place.size);
    let _ = writeln!(
        svg,
        "<text x=\"{left:.1}\" y=\"{:.1}\" font-size=\"13\" font-weight=\"bold\">{}</text>\n\
         <rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"#fafafa\" stroke=\"#bbb\"/>",
        top - 8.0,
        place.view.title
    );
    let step = round_step(34.0 / place.scale);
    let digits = usize::from(step < 1.0) + usize::from(step < 0.1);
    let signs = [place.view.right, place.view.down].map(DVec3::element_sum);
    for (axis, sign) in signs.into_iter().enumerate() {
        let first = (place.low[axis] / step).ceil() as i64;
        let last = ((place.low[axis] + place.size[axis] / place.scale) / step).floor() as i64;
        for line in first..=last {
            let metres = line as f64 * step;
            let at = place.at[axis] + (metres - place.low[axis]) * place.scale;
            let (d, x, y, anchor) = if axis == 0 {
                let d = format!("M{at:.1} {top:.1}v{height:.1}");
                (d, at, top + height + 13.0, "middle")
            } else {
                let d = format!("M{left:.1} {at:.1}h{width:.1}");
                (d, left - 5.0, at + 4.0, "end")
            };
            let (stroke, weight) = if line == 0 {
                ("#888", 1.0)
            } else {
                ("#ddd", 0.6)
            };
            // Zero has no sign.
            let number = metres * sign + 0.0;
            let _ = writeln!(
                svg,
                "<path d=\"{d}\" stroke=\"{stroke}\" stroke-width=\"{weight}\"/>\n\
                 <text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"#555\" font-size=\"10\" text-anchor=\"{anchor}\">{number:.digits$}</text>"
            );
        }
    }
    let (middle_x, middle_y) = (left + 0.5 * width, top + 0.5 * height);
    let _ = writeln!(
        svg,
        "<text x=\"{middle_x:.1}\" y=\"{:.1}\" fill=\"#555\" text-anchor=\"middle\">{}</text>\n\
         <text transform=\"translate({:.1} {middle_y:.1}) rotate(-90)\" fill=\"#555\" text-anchor=\"middle\">{}</text>",
        top + height + 27.0,
        place.view.labels[0],
        left - 32.0,
        place.view.labels[1]
    );
}

/// Twice the area of a quadrilateral, positive if its corners go clockwise on the page.
fn turn([a, b, c, d]: [[f64; 2]; 4]) -> f64 {
    (c[0] - a[0]) * (d[1] - b[1]) - (c[1] - a[1]) * (d[0] - b[0])
}

/// A screen in the colours of its densities.
fn surface(svg: &mut String, room: &Room<'_>, place: &Place, screen: &Drawn<'_>) {
    // From its side a screen is a line, which must be broad enough for its colours.
    let seen = screen.seen_m2.dot(place.view.towards);
    let weight = if seen < EDGE_ON * screen.seen_m2.max_element() {
        7.0
    } else {
        2.0
    };
    let _ = writeln!(
        svg,
        "<g class=\"screen\" id=\"{}-screen-{}\">\n<g opacity=\"0.7\" stroke-width=\"{weight}\" stroke-linejoin=\"round\">",
        place.view.key, screen.index
    );
    let mut steps: Vec<String> = vec![String::new(); STEPS + 1];
    for cell in &screen.cells {
        let step = room
            .scale
            .filter(|_| cell.density.is_finite())
            .map_or(STEPS, |scale| scale.step(cell.density));
        if let Some(path) = steps.get_mut(step) {
            let mut corners_m = cell.corners_m;
            // All turn the same way, or those seen from behind would cut holes into others of their colour.
            if turn(corners_m.map(|corner_m| place.page(corner_m))) < 0.0 {
                corners_m.reverse();
            }
            path.push_str(&place.path(&corners_m));
            path.push('z');
        }
    }
    for (step, path) in steps
        .iter()
        .enumerate()
        .filter(|(_, path)| !path.is_empty())
    {
        let colour = if step == STEPS {
            UNSEEN.to_owned()
        } else {
            of_step(step)
        };
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" fill=\"{colour}\" stroke=\"{colour}\"/>"
        );
    }
    let _ = writeln!(
        svg,
        "</g>\n<path class=\"outline\" d=\"{}z\" fill=\"none\" stroke=\"black\" stroke-width=\"1.2\" stroke-linejoin=\"round\"/>\n</g>",
        place.path(&screen.outline_m)
    );
}

/// What channels show of a screen: their edges, and dashed where ramps end.
fn parts(svg: &mut String, place: &Place, screen: &Drawn<'_>) {
    for part in &screen.parts {
        if !part.is_whole && !part.outline_m.is_empty() {
            let _ = writeln!(
                svg,
                "<path class=\"part\" d=\"{}z\" fill=\"none\" stroke=\"black\" stroke-width=\"0.7\"/>",
                place.path(&part.outline_m)
            );
        }
        for ramp_m in part.ramps_m.iter().filter(|ramp_m| ramp_m.len() > 1) {
            let _ = writeln!(
                svg,
                "<path class=\"ramp\" d=\"{}\" fill=\"none\" stroke=\"black\" stroke-width=\"0.7\" stroke-dasharray=\"4 3\"/>",
                place.path(ramp_m)
            );
        }
    }
}

/// The middle of a screen on the page, and half of what it takes there.
fn middle(place: &Place, screen: &Drawn<'_>) -> Option<([f64; 2], [f64; 2])> {
    let points = screen.outline_m.iter().map(|point| place.page(*point));
    let [low, high] = points.fold(
        [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]],
        |[low, high], [x, y]| {
            [
                [low[0].min(x), low[1].min(y)],
                [high[0].max(x), high[1].max(y)],
            ]
        },
    );
    let half = [0, 1].map(|axis: usize| 0.5 * (high[axis] - low[axis]));
    let middle = [0, 1].map(|axis: usize| 0.5 * (low[axis] + high[axis]));
    (half[0].is_finite() && half[1].is_finite()).then_some((middle, half))
}

/// The name of a screen, on it where it is seen broadside, otherwise beside it, outwards.
fn name(svg: &mut String, room: &Room<'_>, place: &Place, screen: &Drawn<'_>, labels: &mut Labels) {
    let Some(([x, y], [half_width, half_height])) = middle(place, screen) else {
        return;
    };
    let count = screen.outline_m.len().max(1) as f64;
    let mean = screen.outline_m.iter().sum::<DVec3>() / count;
    let [mean_x, mean_y] = place.page(mean);
    let [low, high] = room.bounds_m;
    let [room_x, room_y] = place.page(0.5 * (low + high));
    let (out_x, out_y) = (mean_x - room_x, mean_y - room_y);
    let length = (out_x * out_x + out_y * out_y).sqrt().max(1.0);
    let mut places = Vec::new();
    if half_width.min(half_height) > 24.0 {
        places.extend([0.0, 16.0, -16.0, 32.0, -32.0].map(|down| [x, y + down]));
    }
    for away in [12.0, 22.0, 34.0, 46.0, 60.0] {
        places.push([
            mean_x + out_x / length * away * 1.6,
            mean_y + out_y / length * away,
        ]);
        let above = y - half_height - away;
        let below = y + half_height + away;
        places.extend([[x, above], [x, below]]);
    }
    // No name leaves its view.
    let ([left, top], [width, height]) = (place.at, place.size);
    let half_name = 3.6 * screen.screen.name.chars().count() as f64;
    for [x, y] in &mut places {
        *x = x.min(left + width - half_name).max(left + half_name);
        *y = y.clamp(top + 9.0, (top + height - 9.0).max(top + 9.0));
    }
    let label = Label {
        lines: std::slice::from_ref(&screen.screen.name),
        size: 12.0,
        style: "font-weight=\"bold\"",
        places,
    };
    labels.write(svg, &label);
}

/// Who shows which part, in the view that sees most of the screen.
fn outputs(svg: &mut String, place: &Place, screen: &Drawn<'_>, labels: &mut Labels) {
    let seen = screen.seen_m2.dot(place.view.towards);
    if seen < screen.seen_m2.max_element() {
        return;
    }
    for part in &screen.parts {
        let Some(middle_m) = part.middle_m else {
            continue;
        };
        let [x, y] = place.page(middle_m);
        let mut lines: Vec<String> = part.names.iter().take(MOST_NAMES).cloned().collect();
        if part.names.len() > MOST_NAMES {
            lines.push(format!("and {} more hosts", part.names.len() - MOST_NAMES));
        }
        let label = Label {
            lines: &lines,
            size: 9.0,
            style: "fill=\"#222\"",
            places: [0.0, 15.0, -15.0, 27.0, -27.0, 39.0, -39.0]
                .map(|down| [x, y + down])
                .to_vec(),
        };
        labels.write(svg, &label);
    }
}
