//! Text on patterns: scaled by whole factors, shrunk and then cut until it fits.
//! In: text, an area, how it is to look. Out: changed pixels, all within the area and the picture, and where they are.

use super::area::Area;
use super::font::{ADVANCE, CAPITAL_HEIGHT, ELLIPSIS, GLYPH_HEIGHT, GLYPH_WIDTH, is_ink};
use super::paper::{Colour, Paper};

/// Where text goes along one direction of its area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Left or at the top.
    First,
    Middle,
    /// Right or at the bottom.
    Last,
}

/// How text looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    /// Pixels of a pixel of its characters, at most.
    pub(super) scale: i64,
    pub(super) colour: Colour,
    /// Along the line, and down.
    pub(super) sides: [Side; 2],
    /// A box behind the text, which reaches one pixel of its characters further, within the area.
    pub(super) backing: Option<Colour>,
}

/// Height of a line of text in its own pixels, with what is below the line it stands on.
pub(super) const LINE_HEIGHT: i64 = GLYPH_HEIGHT as i64;

/// Width of text of so many characters, in pixels.
pub(super) fn width_px(characters: usize, scale: i64) -> i64 {
    // Beyond any picture, and far from the end of numbers.
    let characters = characters.min(1 << 20);
    ((characters * ADVANCE).saturating_sub(ADVANCE - GLYPH_WIDTH)) as i64 * scale
}

/// Writes one line. What is even then too long at scale 1 ends with an ellipsis; an area that is too small for one
/// character stays as it is. Gives the pixels that the line takes, its backing included.
pub(super) fn write(paper: &mut Paper, area: Area, text: &str, style: Style) -> Option<Area> {
    let area = area.and(paper.area());
    // More characters fit into no picture.
    let mut text: Vec<char> = text.chars().take(1 << 14).collect();
    let fits = |scale: i64, length: usize| {
        width_px(length, scale) <= area.width() && LINE_HEIGHT * scale <= area.height()
    };
    if text.is_empty() || !fits(1, 1) {
        return None;
    }
    let by_width = area.width() / width_px(text.len(), 1);
    let scale = style
        .scale
        .min(by_width)
        .min(area.height() / LINE_HEIGHT)
        .max(1);
    if !fits(scale, text.len()) {
        let most = (area.width() + 1) / ADVANCE as i64;
        text.truncate(usize::try_from(most).unwrap_or(0));
        text.pop();
        text.push(ELLIPSIS);
    }
    let (width, height) = (width_px(text.len(), scale), LINE_HEIGHT * scale);
    let [along, down] = style.sides;
    let left = match along {
        Side::First => area.left,
        Side::Middle => area.left + (area.width() - width) / 2,
        Side::Last => area.right - width,
    };
    let top = match down {
        Side::First => area.top,
        // Capitals are in the middle; what hangs below them is not counted.
        Side::Middle => {
            let top = area.top + (area.height() - CAPITAL_HEIGHT as i64 * scale) / 2;
            top.min(area.bottom - height)
        }
        Side::Last => area.bottom - height,
    };
    let mut taken = Area::at(left, top, width, height);
    if let Some(backing) = style.backing {
        taken = taken.inset(-scale).and(area);
        paper.fill(taken, backing);
    }
    for (number, character) in (0..).zip(text) {
        let left = left + number * ADVANCE as i64 * scale;
        for row in 0..GLYPH_HEIGHT {
            for column in 0..GLYPH_WIDTH {
                if is_ink(character, column, row) {
                    let (x, y) = (left + column as i64 * scale, top + row as i64 * scale);
                    paper.fill(Area::at(x, y, scale, scale), style.colour);
                }
            }
        }
    }
    Some(taken)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;
    use crate::patterns::paper::{BLACK, WHITE};

    const STYLE: Style = Style {
        scale: 1,
        colour: WHITE,
        sides: [Side::First, Side::First],
        backing: None,
    };

    /// A picture of the text, '#' where it is white.
    fn written(size_px: [u32; 2], area: Area, text: &str, style: Style) -> Vec<String> {
        let mut paper = Paper::new(size_px);
        write(&mut paper, area, text, style);
        let bytes = paper.into_bytes();
        let rows = bytes.chunks_exact(4 * size_px[0] as usize);
        rows.map(|row| {
            let pixels = row.as_chunks::<4>().0.iter();
            pixels
                .map(|pixel| if pixel[0] > 0 { '#' } else { '.' })
                .collect()
        })
        .collect()
    }

    #[test]
    fn a_glyph_is_drawn_pixel_by_pixel() {
        let picture = written([9, 11], Area::at(1, 1, 8, 10), "R", STYLE);
        let expected = [
            ".........",
            ".####....",
            ".#...#...",
            ".#...#...",
            ".####....",
            ".#.#.....",
            ".#..#....",
            ".#...#...",
            ".........",
            ".........",
            ".........",
        ];
        assert_eq!(picture, expected);
        let twice = Style { scale: 2, ..STYLE };
        let doubled = written([10, 18], Area::at(0, 0, 10, 18), "R", twice);
        for (y, row) in doubled.iter().enumerate() {
            for (x, pixel) in row.chars().enumerate() {
                let once = expected[1 + y / 2].as_bytes()[1 + x / 2];
                assert_eq!(pixel, char::from(once), "{x} {y}");
            }
        }
    }

    #[test]
    fn text_shrinks_is_cut_and_never_leaves_its_area() {
        let text = "a rather long name, gjpqy";
        for width in 0..200 {
            for height in [0, 8, 9, 17, 18, 40] {
                for side in [Side::First, Side::Middle, Side::Last] {
                    let area = Area::at(7, 3, width, height);
                    let style = Style {
                        scale: 3,
                        sides: [side; 2],
                        backing: Some([9, 0, 0]),
                        ..STYLE
                    };
                    let mut paper = Paper::new([150, 35]);
                    let taken = write(&mut paper, area, text, style);
                    assert_eq!(
                        taken.is_some(),
                        width >= 5 && height >= 9,
                        "{width} {height}"
                    );
                    if let Some(taken) = taken {
                        assert!(area.contains(taken) && paper.area().contains(taken));
                        paper.fill(taken, BLACK);
                    }
                    let bytes = paper.into_bytes();
                    let mut rest = bytes.as_chunks::<4>().0.iter();
                    assert!(
                        rest.all(|pixel| *pixel == [0, 0, 0, 255]),
                        "{width} {height}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_cut_off_leaves_an_ellipsis() {
        let cut = written([17, 9], Area::at(0, 0, 17, 9), "LLLL", STYLE);
        assert_eq!(cut[5], "#.....#..........");
        assert_eq!(cut[6], "#####.#####.#.#.#");
        let whole = written([23, 9], Area::at(0, 0, 23, 9), "LLLL", STYLE);
        assert_eq!(whole[6], "#####.#####.#####.#####");
        let alone = written([5, 9], Area::at(0, 0, 5, 9), "LLLL", STYLE);
        assert_eq!(alone[6], "#.#.#");
        let nothing = written([4, 9], Area::at(0, 0, 4, 9), "L", STYLE);
        assert!(nothing.concat().bytes().all(|pixel| pixel == b'.'));
    }
}
