//! The strip of blocks by which a machine tells outputs apart, written and read.
//!
//! In: names; pictures, also screenshots of whole desktops. Out: blocks; the numbers found. Numbers are found in any
//! picture, in any channel order; what a number belongs to is the caller's business.
//!
//! The strip: 38 square blocks in a row, white for 1 and black for 0, with 2 px of middle grey (128) all around. The
//! first four blocks are 1, 0, 1, 1, then come the 32 bits of the CRC-32 (IEEE 802.3) of `WALL/HOST/OUTPUT` in UTF-8,
//! highest bit first, then 0, 1. Blocks have a side of 16 px, or of 8, 4, 2 or 1 where the picture is narrower. The
//! reader takes any whole side up to 64 px, so that desktops shown enlarged can be read as well.

#[cfg(test)]
mod tests;

use super::area::Area;
use super::paper::{BLACK, Colour, Paper, WHITE, grey};

/// Blocks before and after the number.
const START: [bool; 4] = [true, false, true, true];
const END: [bool; 2] = [false, true];
const NUMBER_BITS: usize = 32;
const BLOCKS: usize = START.len() + NUMBER_BITS + END.len();

/// Sides of blocks that are written, the preferred one first.
const SIDES_PX: [i64; 5] = [16, 8, 4, 2, 1];

/// Largest side of a block that is read.
const MOST_READ_PX: usize = 64;

/// Grey around the blocks.
const QUIET_PX: i64 = 2;
const QUIET: Colour = grey(128);

/// The number that an output's strip tells: the CRC-32 (IEEE 802.3) of `WALL/HOST/OUTPUT`.
#[must_use]
pub fn identity(wall: &str, host: &str, output: &str) -> u32 {
    crc32fast::hash(format!("{wall}/{host}/{output}").as_bytes())
}

/// A strip that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundIdentity {
    /// The number: [`identity`] of the output's names.
    pub number: u32,
    /// Column and row of the upper left pixel of its first block. In a picture of the output alone: 2, 2.
    pub block_px: [u32; 2],
    /// Side of its blocks in pixels of the picture.
    pub side_px: u32,
}

/// Writes the strip into the upper left corner. Gives what it covers, or nothing where the picture is smaller than the
/// smallest strip: 42 by 5 pixels.
pub(super) fn write(paper: &mut Paper, number: u32) -> Option<Area> {
    let whole = paper.area();
    let strip = SIDES_PX.map(|side| {
        let strip = Area::at(0, 0, BLOCKS as i64 * side, side).inset(-QUIET_PX);
        let strip = Area::at(0, 0, strip.width(), strip.height());
        (side, strip)
    });
    let (side, strip) = strip
        .into_iter()
        .find(|(_, strip)| whole.contains(*strip))?;
    paper.fill(strip, QUIET);
    let bits = (0..NUMBER_BITS).rev().map(|bit| number >> bit & 1 == 1);
    let blocks = START.into_iter().chain(bits).chain(END);
    for (place, is_white) in (0..).zip(blocks) {
        let block = Area::at(QUIET_PX + place * side, QUIET_PX, side, side);
        paper.fill(block, if is_white { WHITE } else { BLACK });
    }
    Some(strip)
}

/// The number of the first strip in a picture, in reading order. See [`read_identities`].
#[must_use]
pub fn read_identity(rgba: &[u8], width: u32, height: u32) -> Option<u32> {
    let picture = Picture::new(rgba, width, height)?;
    let first = picture.strips().next();
    first.map(|found| found.number)
}

/// All strips of identify pages in a picture of 4 bytes a pixel, rows from the top without gaps, in reading order of
/// their first blocks. They may lie anywhere, at any whole enlargement. The order of colours and the fourth byte are of
/// no account. A strip is found where each of its pixels is plainly black or white and the pixels beside it are plainly
/// grey, so that one that is partly covered is not. None where the bytes do not make such a picture.
#[must_use]
pub fn read_identities(rgba: &[u8], width: u32, height: u32) -> Vec<FoundIdentity> {
    let picture = Picture::new(rgba, width, height);
    picture.map_or_else(Vec::new, |picture| picture.strips().collect())
}

/// What a pixel can be in a strip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tone {
    Black,
    Quiet,
    White,
}

/// A picture in which strips are sought.
struct Picture<'bytes> {
    pixels: &'bytes [[u8; 4]],
    width: usize,
}

impl<'bytes> Picture<'bytes> {
    fn new(rgba: &'bytes [u8], width: u32, height: u32) -> Option<Self> {
        let (pixels, rest) = rgba.as_chunks();
        let (width, height) = (usize::try_from(width).ok()?, usize::try_from(height).ok()?);
        let whole = rest.is_empty() && width.checked_mul(height)? == pixels.len() && width > 0;
        whole.then_some(Self { pixels, width })
    }

    /// Nothing beyond the picture, and nothing where a pixel is neither black, middle grey nor white.
    fn tone(&self, x: usize, y: usize) -> Option<Tone> {
        if x >= self.width {
            return None;
        }
        let number = y.checked_mul(self.width)?.checked_add(x)?;
        let [first, second, third, _] = *self.pixels.get(number)?;
        let all = |values: std::ops::RangeInclusive<u8>| {
            values.contains(&first) && values.contains(&second) && values.contains(&third)
        };
        if all(0..=50) {
            Some(Tone::Black)
        } else if all(205..=255) {
            Some(Tone::White)
        } else if all(98..=158) {
            Some(Tone::Quiet)
        } else {
            None
        }
    }

    fn strips(&self) -> impl Iterator<Item = FoundIdentity> {
        let places =
            (0..self.pixels.len()).map(|number| [number % self.width, number / self.width]);
        places.filter_map(|place| self.strip_at(place))
    }

    /// The strip whose first block has its upper left pixel here.
    fn strip_at(&self, [left, top]: [usize; 2]) -> Option<FoundIdentity> {
        let is = |x: usize, y: usize, tone: Tone| self.tone(x, y) == Some(tone);
        let (before, above) = (left.checked_sub(1)?, top.checked_sub(1)?);
        let corner = is(left, top, Tone::White)
            && is(before, top, Tone::Quiet)
            && is(left, above, Tone::Quiet);
        if !corner {
            return None;
        }
        // The second block is black: the first one ends there, and tells how large all are.
        let side = (1..=MOST_READ_PX).find(|side| !is(left + side, top, Tone::White))?;
        let block = |place: usize| {
            let tone = self.tone(left + place * side, top)?;
            (tone != Tone::Quiet).then_some(tone == Tone::White)
        };
        let (number_at, end_at) = (START.len(), START.len() + NUMBER_BITS);
        let at = |from: usize, bits: &[bool]| {
            (from..)
                .zip(bits)
                .all(|(place, bit)| block(place) == Some(*bit))
        };
        if !at(0, &START) || !at(end_at, &END) {
            return None;
        }
        let mut number = 0_u32;
        for place in number_at..end_at {
            number = number << 1 | u32::from(block(place)?);
        }
        let (right, bottom) = (left + BLOCKS * side, top + side);
        let blocks_are_plain = (top..bottom).all(|y| {
            let mut columns = left..right;
            columns.all(|x| self.tone(x, y) == self.tone(x - (x - left) % side, top))
        });
        let quiet_around = (before..=right)
            .all(|x| is(x, above, Tone::Quiet) && is(x, bottom, Tone::Quiet))
            && (top..bottom).all(|y| is(before, y, Tone::Quiet) && is(right, y, Tone::Quiet));
        if !blocks_are_plain || !quiet_around {
            return None;
        }
        Some(FoundIdentity {
            number,
            block_px: [u32::try_from(left).ok()?, u32::try_from(top).ok()?],
            side_px: u32::try_from(side).ok()?,
        })
    }
}
