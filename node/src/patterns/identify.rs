//! What an output is called and shows: large text for people, a strip of blocks for machines.
//! In: what there is to say about an output. Out: its picture. The strip is described in [`super::identity`].

use super::About;
use super::area::Area;
use super::identity::{identity, write as write_strip};
use super::paper::{Colour, Paper, WHITE, brightness, grey};
use super::text::{LINE_HEIGHT, Side, Style, write};

/// How bright grounds look, of 255, from the darkest to the lightest: white text is easy to read on all of them.
const GROUND_BRIGHTNESS: [f64; 2] = [44.0, 86.0];

/// Lines for channels; more channels share lines.
const CHANNEL_LINES: usize = 8;

/// Lowest line of text, with the gap to the next one.
const LOWEST_PX: i64 = LINE_HEIGHT + 1;

/// A line of the page.
struct Entry {
    label: &'static str,
    /// Beside each other.
    values: Vec<String>,
    /// Height, in parts of the page.
    weight: i64,
    /// Those with the lowest are left out first where there is no room.
    rank: u32,
}

pub(super) fn draw(paper: &mut Paper, about: &About) {
    let whole = paper.area();
    let ground = ground(&about.host, &about.output);
    paper.fill(whole, ground);
    let frame = 2 * paper.scale();
    paper.outline(whole, frame, lighter(ground));
    let number = identity(&about.wall, &about.host, &about.output);
    let strip = write_strip(paper, number);
    let top = strip.map_or(0, |strip| strip.bottom);
    if let Some(strip) = strip.filter(|strip| strip.height() >= 2 * LINE_HEIGHT) {
        // The number for people, opposite.
        let beside = Area {
            left: strip.right + 6,
            top: frame + 2,
            right: whole.right - frame - 6,
            bottom: frame + 2 + 2 * LINE_HEIGHT,
        };
        let style = Style {
            scale: 2,
            colour: lighter(lighter(ground)),
            sides: [Side::Last, Side::First],
            backing: None,
        };
        if beside.width() >= 60 {
            write(paper, beside, &format!("{number:08x}"), style);
        }
    }
    let margin = (whole.short_side() / 24)
        .min(whole.short_side() / 2 - 5)
        .max(0);
    let page = Area {
        left: margin,
        top: (top + margin / 2).max(margin),
        right: whole.right - margin,
        bottom: whole.bottom - margin,
    };
    write_page(paper, page, entries(about), lighter(lighter(ground)));
}

/// A dark colour whose hue and brightness follow from the names, so that neighbours are told apart at a glance.
pub(super) fn ground(host: &str, output: &str) -> Colour {
    let hash = crc32fast::hash(format!("{host}/{output}").as_bytes());
    // Bits of a CRC that are near each other change together with the end of a text: spread them over the circle.
    let mixed = (hash ^ hash >> 15).wrapping_mul(0x9e37_79b1);
    let hue = f64::from(mixed >> 16) / 65_536.0 * 6.0;
    let wave = |off: f64| {
        let from = (hue + off).rem_euclid(6.0);
        ((from - 3.0).abs() - 1.0).clamp(0.0, 1.0)
    };
    let full = [wave(0.0), wave(4.0), wave(2.0)].map(|share| 40.0 + 215.0 * share);
    let [darkest, lightest] = GROUND_BRIGHTNESS;
    let wanted = darkest + (lightest - darkest) * f64::from(mixed & 0xffff) / 65_536.0;
    let now = f64::from(brightness(full.map(|value| value as u8))).max(1.0);
    full.map(|value| (value * wanted / now).round().min(255.0) as u8)
}

fn lighter(colour: Colour) -> Colour {
    colour.map(|value| value / 2 + 110)
}

fn entries(about: &About) -> Vec<Entry> {
    let one = |label, weight, rank, value: String| Entry {
        label,
        values: vec![value],
        weight,
        rank,
    };
    let mut entries = vec![
        one("wall", 2, 5, about.wall.clone()),
        one("host", 4, 9, about.host.clone()),
        one("output", 4, 8, about.output.clone()),
        one(
            "size",
            2,
            6,
            format!("{} px, {}", about.size(), about.curve()),
        ),
    ];
    let channels: Vec<String> = about
        .channels
        .iter()
        .map(|channel| format!("{}, {}", channel.screen, channel.eye))
        .collect();
    let across = channels.len().div_ceil(CHANNEL_LINES).max(1);
    for (number, values) in channels.chunks(across).enumerate() {
        entries.push(Entry {
            label: match (number, channels.len()) {
                (0, 1) => "channel",
                (0, _) => "channels",
                _ => "",
            },
            values: values.to_vec(),
            weight: 2,
            rank: 7,
        });
    }
    entries.push(one("stereo", 2, 4, about.stereo.clone()));
    entries.push(one("adapter", 2, 3, about.adapter.clone()));
    entries
}

/// Writes as many entries as there is room for, the most important ones first, in their order.
fn write_page(paper: &mut Paper, page: Area, mut entries: Vec<Entry>, label_colour: Colour) {
    let total = |entries: &[Entry]| entries.iter().map(|entry| entry.weight).sum::<i64>();
    // A line of weight 2 must be high enough to be read.
    while entries.len() > 1 && 2 * page.height() < LOWEST_PX * total(&entries) {
        let least = entries.iter().map(|entry| entry.rank).min();
        let last = entries.iter().rposition(|entry| Some(entry.rank) == least);
        if let Some(last) = last {
            entries.remove(last);
        }
    }
    let whole = total(&entries).max(1);
    let labelled = page.width() >= 240;
    let mut done = 0;
    for entry in entries {
        let row = page.rows(done, done + entry.weight, whole);
        done += entry.weight;
        let value = if labelled {
            let label = row.columns(0, 15, 100);
            let style = Style {
                scale: (row.height() / entry.weight / LINE_HEIGHT).max(1),
                colour: label_colour,
                sides: [Side::First, Side::Middle],
                backing: None,
            };
            write(paper, label, entry.label, style);
            row.columns(17, 100, 100)
        } else {
            row
        };
        let beside = i64::try_from(entry.values.len()).unwrap_or(1).max(1);
        for (place, text) in (0..).zip(&entry.values) {
            let style = Style {
                // A fifth of the line stays free.
                scale: row.height() * 4 / (5 * LINE_HEIGHT),
                colour: if entry.rank >= 8 { WHITE } else { grey(236) },
                sides: [Side::First, Side::Middle],
                backing: None,
            };
            let cell = value.columns(place, place + 1, beside);
            let gap = if place + 1 < beside { 6 } else { 0 };
            let cell = Area {
                right: cell.right - gap,
                ..cell
            };
            write(paper, cell, text, style);
        }
    }
}
