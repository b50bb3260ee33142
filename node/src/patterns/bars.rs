//! Colour bars, grey steps, and patches near black and near white, to set colours, contrast and brightness by.
//! In: an empty picture. Out: the pattern. The arrangement follows SMPTE EG 1-1990 (bars at 75 % over reversed blue
//! bars over near-black patches); values are those of the display, not of a television signal.

use super::area::Area;
use super::paper::{BLACK, Colour, Paper, WHITE, grey, ink_on};
use super::text::{LINE_HEIGHT, Side, Style, width_px, write};

/// 75 % of the largest value.
const THREE_QUARTERS: u8 = 191;

/// The bars, and below each the bar that blue alone shows alike.
pub(super) const BARS: [(Colour, Colour, &str); 7] = {
    const ON: u8 = THREE_QUARTERS;
    [
        ([ON, ON, ON], [0, 0, ON], "grey"),
        ([ON, ON, 0], BLACK, "yellow"),
        ([0, ON, ON], [ON, 0, ON], "cyan"),
        ([0, ON, 0], BLACK, "green"),
        ([ON, 0, ON], [0, ON, ON], "magenta"),
        ([ON, 0, 0], BLACK, "red"),
        ([0, 0, ON], [ON, ON, ON], "blue"),
    ]
};

/// Grey steps, in per cent of the largest value.
const STEPS: i64 = 11;

/// Values of the patches on black. Those on white are as far from white.
pub(super) const NEAR_BLACK: [u8; 8] = [1, 2, 4, 6, 8, 12, 16, 24];

/// Where the parts are, in hundredths of the height.
const BARS_END: i64 = 58;
const REVERSED_END: i64 = 66;
const STEPS_END: i64 = 80;

pub(super) fn draw(paper: &mut Paper) {
    let whole = paper.area();
    let [bars, reversed, steps, patches] = [
        (0, BARS_END),
        (BARS_END, REVERSED_END),
        (REVERSED_END, STEPS_END),
        (STEPS_END, 100),
    ]
    .map(|(from, to)| whole.rows(from, to, 100));
    for (number, (colour, below, name)) in (0..).zip(BARS) {
        let bar = bars.columns(number, number + 1, 7);
        paper.fill(bar, colour);
        label(
            paper,
            bar,
            &format!("75% {name}"),
            "75% magenta",
            ink_on(colour),
        );
        paper.fill(reversed.columns(number, number + 1, 7), below);
    }
    for number in 0..STEPS {
        let step = steps.columns(number, number + 1, STEPS);
        let colour = grey(step_value(number));
        paper.fill(step, colour);
        label(
            paper,
            step,
            &format!("{}%", 10 * number),
            "100%",
            ink_on(colour),
        );
    }
    near(paper, patches.columns(0, 1, 2), BLACK, grey(72), |off| off);
    near(paper, patches.columns(1, 2, 2), WHITE, grey(160), |off| {
        255 - off
    });
}

/// The value of a grey step, rounded.
fn step_value(number: i64) -> u8 {
    u8::try_from((510 * number + STEPS - 1) / (2 * (STEPS - 1))).unwrap_or(u8::MAX)
}

/// Patches on a ground from which they differ little, with their values below.
fn near(paper: &mut Paper, area: Area, ground: Colour, ink: Colour, value: impl Fn(u8) -> u8) {
    paper.fill(area, ground);
    let whole = 1 + 3 * NEAR_BLACK.len() as i64;
    for (number, off) in (0..).zip(NEAR_BLACK) {
        let column = area.columns(1 + 3 * number, 3 + 3 * number, whole);
        let value = value(off);
        paper.fill(column.rows(15, 70, 100), grey(value));
        let below = Area {
            left: column.left - 2,
            right: column.right + 2,
            ..column.rows(70, 100, 100)
        };
        write_in(paper, below, &value.to_string(), "255", ink, Side::Middle);
    }
}

/// Text at the lower edge of an area.
fn label(paper: &mut Paper, area: Area, text: &str, longest: &str, ink: Colour) {
    let scale = paper.scale();
    write_in(paper, area.inset(2 * scale), text, longest, ink, Side::Last);
}

/// Text that is left out where the longest one of its kind would be cut: all of a kind or none.
fn write_in(paper: &mut Paper, area: Area, text: &str, longest: &str, ink: Colour, down: Side) {
    let style = Style {
        scale: paper.scale(),
        colour: ink,
        sides: [Side::Middle, down],
        backing: None,
    };
    // Columns of one kind differ by up to a pixel.
    if area.width() > width_px(longest.len(), 1) && area.height() >= LINE_HEIGHT {
        write(paper, area, text, style);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The colour in the middle of an area.
    fn colour_at(bytes: &[u8], width: usize, area: Area) -> Colour {
        let [x, y] = area.centre().map(|place| place as usize);
        let pixel = &bytes[4 * (y * width + x)..][..4];
        assert_eq!(pixel[3], 255);
        [pixel[0], pixel[1], pixel[2]]
    }

    #[test]
    fn bars_steps_and_patches_have_their_values() {
        for size in [[1920_u32, 1080], [640, 480], [333, 201], [1001, 97]] {
            let mut paper = Paper::new(size);
            draw(&mut paper);
            let whole = paper.area();
            let bytes = paper.into_bytes();
            let width = size[0] as usize;
            // From the definition, not from the table: red, green and blue of the seven, brightest first.
            for (number, [red, green, blue]) in (0..).zip([
                [1, 1, 1],
                [1, 1, 0],
                [0, 1, 1],
                [0, 1, 0],
                [1, 0, 1],
                [1, 0, 0],
                [0, 0, 1_u8],
            ]) {
                let bar = whole.rows(0, 58, 100).columns(number, number + 1, 7);
                let expected = [191 * red, 191 * green, 191 * blue];
                assert_eq!(
                    colour_at(&bytes, width, bar),
                    expected,
                    "{size:?} bar {number}"
                );
                let below = whole.rows(58, 66, 100).columns(number, number + 1, 7);
                let reversed = colour_at(&bytes, width, below);
                // Blue alone shows both the other way round: bars with blue are over bars without it.
                let own_order = 6 - number;
                assert_eq!(
                    reversed[2] > 0,
                    own_order % 2 == 0,
                    "{size:?} below {number}"
                );
            }
            let steps = [0, 26, 51, 77, 102, 128, 153, 179, 204, 230, 255];
            for (number, value) in (0..).zip(steps) {
                let step = whole
                    .rows(66, 80, 100)
                    .columns(number, number + 1, 11)
                    .rows(0, 1, 4);
                assert_eq!(
                    colour_at(&bytes, width, step),
                    grey(value),
                    "{size:?}: {number}"
                );
            }
            let patches = whole.rows(80, 100, 100);
            for (number, value) in (0..).zip([1, 2, 4, 6, 8, 12, 16, 24]) {
                let place = |half: i64| {
                    let half = patches.columns(half, half + 1, 2);
                    half.columns(1 + 3 * number, 3 + 3 * number, 25)
                        .rows(15, 70, 100)
                };
                assert_eq!(colour_at(&bytes, width, place(0)), grey(value), "{size:?}");
                assert_eq!(
                    colour_at(&bytes, width, place(1)),
                    grey(255 - value),
                    "{size:?}"
                );
            }
            let corner = Area::at(0, whole.bottom - 1, 1, 1);
            assert_eq!(colour_at(&bytes, width, corner), BLACK);
            let corner = Area::at(whole.right - 1, whole.bottom - 1, 1, 1);
            assert_eq!(colour_at(&bytes, width, corner), WHITE);
        }
    }
}
