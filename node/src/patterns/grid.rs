//! Lines at known pixels, circles and diagonals, to align geometry and bezels by.
//! In: what there is to say about an output. Out: its picture.

use super::About;
use super::area::Area;
use super::paper::{BLACK, Colour, Paper, WHITE, grey};
use super::strokes::{line, ring};
use super::text::{LINE_HEIGHT, Side, Style, width_px, write};

/// Pixels between thin lines, and between bold ones.
const FINE_PX: i64 = 64;
const COARSE_PX: i64 = 256;

const GROUND: Colour = [10, 12, 18];
const FINE: Colour = [62, 66, 78];
const COARSE: Colour = [150, 156, 170];
const DIAGONAL: Colour = [96, 72, 150];
const CIRCLE: Colour = [250, 200, 60];
const CROSS: Colour = [255, 80, 64];

/// The lines of outermost pixels: of channels, then of the output.
pub(super) const CHANNEL_BORDER: Colour = [0, 230, 118];
pub(super) const OUTPUT_BORDER: Colour = WHITE;

pub(super) fn draw(paper: &mut Paper, about: &About) {
    let whole = paper.area();
    let scale = paper.scale();
    paper.fill(whole, GROUND);
    lines(paper, whole);
    diagonals(paper, whole, scale);
    circles(paper, about, scale);
    cross(paper, whole);
    numbers(paper, whole, scale);
    captions(paper, about, scale);
    // Last, so that nothing hides them.
    for channel in &about.channels {
        paper.outline(channel.rect.into(), 1, CHANNEL_BORDER);
    }
    paper.outline(whole, 1, OUTPUT_BORDER);
}

/// Thin lines are one pixel wide; bold ones three, the middle one at the coordinate.
fn lines(paper: &mut Paper, whole: Area) {
    let multiples = |length: i64, spacing: i64| (0..length).step_by(spacing as usize);
    for (spacing, reach, colour) in [(FINE_PX, 0, FINE), (COARSE_PX, 1, COARSE)] {
        let thickness = 1 + 2 * reach;
        for x in multiples(whole.right, spacing) {
            paper.fill(Area::at(x - reach, 0, thickness, whole.bottom), colour);
        }
        for y in multiples(whole.bottom, spacing) {
            paper.fill(Area::at(0, y - reach, whole.right, thickness), colour);
        }
    }
}

fn diagonals(paper: &mut Paper, whole: Area, scale: i64) {
    let [right, bottom] = [whole.right as f64, whole.bottom as f64];
    let width_px = scale as f64;
    line(paper, [0.0, 0.0], [right, bottom], width_px, DIAGONAL);
    line(paper, [0.0, bottom], [right, 0.0], width_px, DIAGONAL);
}

/// One around the middle that nearly touches the longer edges and one in each corner; of several channels each its own.
fn circles(paper: &mut Paper, about: &About, scale: i64) {
    let thickness_px = (2 * scale) as f64;
    let whole = paper.area();
    let mut circle = |area: Area, share: f64| {
        let middle = [
            0.5 * (area.left + area.right) as f64,
            0.5 * (area.top + area.bottom) as f64,
        ];
        let radius_px = share * area.short_side() as f64;
        ring(paper, middle, radius_px, thickness_px, CIRCLE);
    };
    if about.channels.len() > 1 {
        for channel in &about.channels {
            circle(Area::from(channel.rect).and(whole), 0.45);
        }
        return;
    }
    circle(whole, 0.48);
    let corner = whole.short_side() / 3;
    for x in [0, whole.right - corner] {
        for y in [0, whole.bottom - corner] {
            circle(Area::at(x, y, corner, corner), 0.42);
        }
    }
}

/// Through the middle, and short marks in the middle of each edge. As wide as it takes to be symmetrical: one pixel in
/// odd, two in even sizes.
fn cross(paper: &mut Paper, whole: Area) {
    let [width, height] = [whole.width(), whole.height()];
    let [thick_x, thick_y] = [2 - width % 2, 2 - height % 2];
    let [x, y] = [(width - thick_x) / 2, (height - thick_y) / 2];
    let (arm, mark) = (whole.short_side() / 10, whole.short_side() / 24);
    paper.fill(Area::at(x, y - arm, thick_x, 2 * arm + thick_y), CROSS);
    paper.fill(Area::at(x - arm, y, 2 * arm + thick_x, thick_y), CROSS);
    paper.fill(Area::at(x, 0, thick_x, mark), CROSS);
    paper.fill(Area::at(x, height - mark, thick_x, mark), CROSS);
    paper.fill(Area::at(0, y, mark, thick_y), CROSS);
    paper.fill(Area::at(width - mark, y, mark, thick_y), CROSS);
}

/// Column and row at every crossing of bold lines, on its lower right where there is room.
fn numbers(paper: &mut Paper, whole: Area, scale: i64) {
    // So that five digits twice never reach the next crossing.
    let scale = scale.min(3);
    let gap = 2 + 2 * scale;
    for y in (0..whole.bottom).step_by(COARSE_PX as usize) {
        for x in (0..whole.right).step_by(COARSE_PX as usize) {
            let text = format!("{x},{y}");
            let (width, height) = (width_px(text.len(), scale), LINE_HEIGHT * scale);
            let beside = |at: i64, length: i64, end: i64| {
                if at + gap + length + gap <= end {
                    at + gap
                } else {
                    at - gap - length
                }
            };
            let left = beside(x, width, whole.right);
            let top = beside(y, height, whole.bottom);
            let style = Style {
                scale,
                colour: WHITE,
                sides: [Side::First; 2],
                backing: None,
            };
            let place = Area::at(left, top, width, height);
            if whole.inset(2).contains(place) {
                write(paper, place, &text, style);
            }
        }
    }
}

/// The output below the middle, and each of several channels at its lower edge. Rows with numbers are avoided.
fn captions(paper: &mut Paper, about: &About, scale: i64) {
    let whole = paper.area();
    let style = |colour| Style {
        scale,
        colour,
        sides: [Side::Middle; 2],
        backing: Some(BLACK),
    };
    let height = (LINE_HEIGHT + 2) * scale;
    let clear = |top: i64| {
        let above = top.rem_euclid(COARSE_PX);
        let numbered = 6 + (LINE_HEIGHT + 3) * scale;
        if above < numbered || above + height > COARSE_PX - 4 {
            top - (above + height + 4) % COARSE_PX
        } else {
            top
        }
    };
    let line_in = |area: Area, top: i64| {
        let line = Area::at(area.left, clear(top), area.width(), height);
        line.and(area.inset(2 * scale))
    };
    if about.channels.len() > 1 {
        for channel in &about.channels {
            let area = Area::from(channel.rect).and(whole);
            let text = format!("{}, {}", channel.screen, channel.eye);
            let place = line_in(area, area.bottom - 2 * height);
            write(paper, place, &text, style(CHANNEL_BORDER));
        }
    }
    let text = format!("{} / {}  {}", about.host, about.output, about.size());
    let [_, middle] = whole.centre();
    let place = line_in(whole, middle + whole.height() / 7);
    write(paper, place, &text, style(grey(230)));
}
