//! The picture that patterns are drawn on.
//! In: areas and colours; whatever lies beyond the picture is cut off. Out: RGBA bytes. It knows no pattern.

use super::area::Area;

/// Red, green and blue as the display gets them.
pub(super) type Colour = [u8; 3];

pub(super) const BLACK: Colour = [0; 3];
pub(super) const WHITE: Colour = [255; 3];

/// A grey.
pub(super) const fn grey(value: u8) -> Colour {
    [value; 3]
}

/// How bright a colour looks, 0…255: the weights of ITU-R BT.709 in thousandths, applied to values.
pub(super) fn brightness(colour: Colour) -> u32 {
    let [red, green, blue] = colour.map(u32::from);
    (213 * red + 715 * green + 72 * blue) / 1000
}

/// Black or white, whichever is easier to read on a colour.
pub(super) fn ink_on(colour: Colour) -> Colour {
    if brightness(colour) >= 100 {
        BLACK
    } else {
        WHITE
    }
}

/// An opaque picture.
pub(super) struct Paper {
    size_px: [u32; 2],
    bytes: Vec<u8>,
}

impl Paper {
    /// A black picture of at least one pixel.
    pub(super) fn new(size_px: [u32; 2]) -> Self {
        let size_px = size_px.map(|side| side.max(1));
        let [width, height] = size_px.map(|side| side as usize);
        let mut paper = Self {
            size_px,
            bytes: vec![0; 4 * width * height],
        };
        paper.fill(paper.area(), BLACK);
        paper
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// All of it.
    pub(super) fn area(&self) -> Area {
        let [width, height] = self.size_px.map(i64::from);
        Area::at(0, 0, width, height)
    }

    /// Pixels of a pixel of text or of a thick line: 1 up to 1079 rows or columns, 2 from 1080 on, and so forth.
    pub(super) fn scale(&self) -> i64 {
        (self.area().short_side() / 540).max(1)
    }

    pub(super) fn fill(&mut self, area: Area, colour: Colour) {
        let [red, green, blue] = colour;
        for row in self.rows(area) {
            for pixel in row.as_chunks_mut::<4>().0 {
                *pixel = [red, green, blue, 255];
            }
        }
    }

    /// The outermost pixels of an area.
    pub(super) fn outline(&mut self, area: Area, thickness: i64, colour: Colour) {
        for edge in area.edges(thickness) {
            self.fill(edge, colour);
        }
    }

    /// Gives pixels of an area the colour that a function of column and row has for them, if any.
    pub(super) fn paint(&mut self, area: Area, colour: impl Fn(i64, i64) -> Option<Colour>) {
        let drawn = area.and(self.area());
        for (row, y) in self.rows(area).zip(drawn.top..) {
            for (pixel, x) in row.as_chunks_mut::<4>().0.iter_mut().zip(drawn.left..) {
                if let Some([red, green, blue]) = colour(x, y) {
                    *pixel = [red, green, blue, 255];
                }
            }
        }
    }

    /// Lays a colour over pixels of an area, as opaque as a function of column and row says: 0…1.
    pub(super) fn glaze(&mut self, area: Area, colour: Colour, cover: impl Fn(i64, i64) -> f64) {
        let drawn = area.and(self.area());
        for (row, y) in self.rows(area).zip(drawn.top..) {
            for (pixel, x) in row.as_chunks_mut::<4>().0.iter_mut().zip(drawn.left..) {
                let share = cover(x, y).clamp(0.0, 1.0);
                for (under, over) in pixel.iter_mut().zip(colour) {
                    let mixed = f64::from(*under) * (1.0 - share) + f64::from(over) * share;
                    *under = mixed.round() as u8;
                }
            }
        }
    }

    /// The pixels of an area row by row, as far as they are in the picture.
    fn rows(&mut self, area: Area) -> impl Iterator<Item = &mut [u8]> {
        let area = area.and(self.area());
        let [width, _] = self.size_px.map(|side| side as usize);
        let (rows, from, to) = if area.is_empty() {
            (0..0, 0, 0)
        } else {
            // Within the picture, so that neither is negative nor beyond what memory can hold.
            let [left, top, right, bottom] =
                [area.left, area.top, area.right, area.bottom].map(|edge| edge as usize);
            (top..bottom, 4 * left, 4 * right)
        };
        let bytes = self.bytes.chunks_exact_mut(4 * width);
        let bytes = bytes.skip(rows.start).take(rows.len());
        bytes.filter_map(move |row| row.get_mut(from..to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_beyond_the_picture_is_cut_off() {
        let mut paper = Paper::new([3, 2]);
        paper.fill(Area::at(-5, -5, 6, 6), WHITE);
        paper.fill(Area::at(2, 1, 1 << 40, 1 << 40), [1, 2, 3]);
        paper.fill(Area::at(7, 0, 5, 5), WHITE);
        paper.fill(Area::at(2, 2, -2, -2), WHITE);
        paper.glaze(Area::at(1, 0, 1, 1), [200, 100, 0], |x, y| {
            if (x, y) == (1, 0) { 0.5 } else { 1.0 }
        });
        let black = [0, 0, 0, 255];
        let expected = [
            [255; 4],
            [100, 50, 0, 255],
            black,
            black,
            black,
            [1, 2, 3, 255],
        ];
        assert_eq!(paper.into_bytes(), expected.concat());
    }
}
