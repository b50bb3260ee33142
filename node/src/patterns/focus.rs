//! Stars, fine lines and small text, to focus projectors by and to see whether pixels arrive one to one.
//! In: what there is to say about an output. Out: its picture.

use std::f64::consts::PI;

use super::About;
use super::area::Area;
use super::paper::{BLACK, Colour, Paper, WHITE, grey};
use super::strokes::ring;
use super::text::{LINE_HEIGHT, Side, Style, width_px, write};

/// White spokes of a Siemens star; as many black ones are between them.
const SPOKES: f64 = 36.0;

/// What is set small.
const SAMPLE: [&str; 3] = [
    "The quick brown fox jumps",
    "over the lazy dog 0123456789",
    "il1I| o0OQ aeo 8B 5S rn m nn",
];

/// Hundredths of the shorter side: radii of the stars, half the sides of fields of lines, and what is left free at the
/// edges.
const MIDDLE_STAR: i64 = 31;
const CORNER_STAR: i64 = 14;
const SMALL_FIELD: i64 = 7;
const LARGE_FIELD: i64 = 11;
const EDGE: i64 = 3;

pub(super) fn draw(paper: &mut Paper, about: &About) {
    let whole = paper.area();
    let scale = paper.scale();
    let part = |hundredths: i64| whole.short_side() * hundredths / 100;
    paper.outline(whole, 1, grey(160));
    let centre = whole.centre();
    star(paper, about, centre, part(MIDDLE_STAR));
    let corner = part(CORNER_STAR + EDGE);
    for x in [corner, whole.right - corner] {
        for y in [corner, whole.bottom - corner] {
            star(paper, about, [x, y], part(CORNER_STAR));
        }
    }
    let [middle_x, middle_y] = centre;
    // Where there is much room beside the middle star, fields of lines are larger and stand below the corner stars.
    let field = |length: i64| {
        if length / 2 - part(MIDDLE_STAR) > corner + part(LARGE_FIELD + EDGE) {
            (part(LARGE_FIELD), corner)
        } else {
            (part(SMALL_FIELD), part(SMALL_FIELD + EDGE))
        }
    };
    let (reach_x, from_side) = field(whole.width());
    let (reach_y, from_top) = field(whole.height());
    for x in [from_side, whole.right - from_side] {
        line_pairs(paper, Area::around([x, middle_y], reach_x), scale);
    }
    for y in [from_top, whole.bottom - from_top] {
        line_pairs(paper, Area::around([middle_x, y], reach_y), scale);
    }
    // Between the corner stars and the fields beside the middle star.
    let gap = (corner + part(CORNER_STAR), middle_y - reach_x);
    let halfway = (gap.0 + gap.1) / 2;
    for x in [corner, whole.right - corner] {
        for (y, ink, ground) in [
            (halfway, WHITE, BLACK),
            (whole.bottom - halfway, BLACK, WHITE),
        ] {
            let area = sample_area([x, y]);
            let off = |from: i64, to: i64, at: i64| (at - at.clamp(from, to)) as f64;
            let to_star =
                off(area.left, area.right, middle_x).hypot(off(area.top, area.bottom, middle_y));
            let room = gap.1 - gap.0 > area.height() + 4;
            if room && whole.contains(area) && to_star > (part(MIDDLE_STAR) + 4) as f64 {
                sample(paper, area, ink, ground);
            }
        }
    }
}

/// A Siemens star: spokes as wide as the gaps between them, down to where they are finer than pixels and turn into the
/// grey of half the light.
fn star(paper: &mut Paper, about: &About, [x, y]: [i64; 2], radius: i64) {
    if radius < 2 {
        return;
    }
    let radius_px = radius as f64;
    // How much light a pixel gets, to its value, in steps that are finer than those of values.
    let values: Vec<u8> = (0..=1024)
        .map(|light| about.value_of(f64::from(light) / 1024.0))
        .collect();
    paper.paint(Area::around([x, y], radius), |column, row| {
        let (dx, dy) = ((column - x) as f64 + 0.5, (row - y) as f64 + 0.5);
        let from_middle = dx.hypot(dy);
        if from_middle > radius_px - 1.0 {
            return None;
        }
        // Where between the middles of two black spokes, −1…1, the white one's middle being 0.
        let turn = dy.atan2(dx) / (2.0 * PI) * SPOKES;
        let off = 2.0 * (turn - turn.round());
        let spoke_px = PI * from_middle / SPOKES;
        // What is left of a spoke finer than a pixel, averaged over a pixel: nothing from half a pixel on.
        let seen_px = spoke_px.min((2.0 * spoke_px - 1.0).max(0.0));
        let into_white_px = (0.5 - off.abs()) * seen_px;
        let light = (0.5 + into_white_px).clamp(0.0, 1.0);
        values.get((1024.0 * light) as usize).copied().map(grey)
    });
    ring(paper, [x as f64, y as f64], radius_px, 1.5, WHITE);
}

/// Lines of one and two pixels, upright and level: four fields in a frame.
fn line_pairs(paper: &mut Paper, area: Area, scale: i64) {
    if area.short_side() < 8 {
        return;
    }
    paper.fill(area, BLACK);
    let gap = scale + 1;
    for (across, thickness) in [(0, 1), (1, 2)] {
        for (down, upright) in [(0, true), (1, false)] {
            let field = area.columns(across, across + 1, 2).rows(down, down + 1, 2);
            let field = field.inset(gap);
            paper.paint(field, |x, y| {
                let along = if upright {
                    x - field.left
                } else {
                    y - field.top
                };
                let is_white = along / thickness % 2 == 0;
                Some(if is_white { WHITE } else { BLACK })
            });
        }
    }
    paper.outline(area, 1, grey(160));
}

/// The pixels that small text takes around a point.
fn sample_area([x, y]: [i64; 2]) -> Area {
    let longest = SAMPLE.iter().map(|line| line.len()).max().unwrap_or(0);
    let (width, height) = (
        width_px(longest, 1) + 8,
        (LINE_HEIGHT + 2) * SAMPLE.len() as i64 + 6,
    );
    Area::at(x - width / 2, y - height / 2, width, height)
}

/// Small text, one pixel a dot.
fn sample(paper: &mut Paper, area: Area, ink: Colour, ground: Colour) {
    paper.fill(area, ground);
    let lines = SAMPLE.len() as i64;
    for (number, line) in (0..).zip(SAMPLE) {
        let row = area.inset(3).rows(number, number + 1, lines);
        let style = Style {
            scale: 1,
            colour: ink,
            sides: [Side::Middle; 2],
            backing: None,
        };
        write(paper, row, line, style);
    }
}
