//! Rectangles of pixels that may reach beyond a picture, and how they are divided.
//! In: edges. Out: parts of rectangles. It touches no pixel.

use protocol::wall::Rect;

/// The columns `left..right` and rows `top..bottom`. Empty where an end is not beyond its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Area {
    pub(super) left: i64,
    pub(super) top: i64,
    pub(super) right: i64,
    pub(super) bottom: i64,
}

impl Area {
    /// An area by its upper left corner and its size.
    pub(super) const fn at(left: i64, top: i64, width: i64, height: i64) -> Self {
        Self {
            left,
            top,
            right: left + width,
            bottom: top + height,
        }
    }

    /// A square around a point, reaching as far to all sides.
    pub(super) const fn around([x, y]: [i64; 2], reach: i64) -> Self {
        Self::at(x - reach, y - reach, 2 * reach, 2 * reach)
    }

    /// Never negative.
    pub(super) fn width(self) -> i64 {
        (self.right - self.left).max(0)
    }

    /// Never negative.
    pub(super) fn height(self) -> i64 {
        (self.bottom - self.top).max(0)
    }

    pub(super) fn short_side(self) -> i64 {
        self.width().min(self.height())
    }

    pub(super) fn is_empty(self) -> bool {
        self.short_side() == 0
    }

    /// The middle; of an even number of pixels the one after it.
    pub(super) fn centre(self) -> [i64; 2] {
        [self.left + self.width() / 2, self.top + self.height() / 2]
    }

    pub(super) fn and(self, other: Self) -> Self {
        Self {
            left: self.left.max(other.left),
            top: self.top.max(other.top),
            right: self.right.min(other.right),
            bottom: self.bottom.min(other.bottom),
        }
    }

    pub(super) fn contains(self, other: Self) -> bool {
        self.and(other) == other
    }

    /// Without so many pixels at every edge.
    pub(super) const fn inset(self, by: i64) -> Self {
        Self {
            left: self.left + by,
            top: self.top + by,
            right: self.right - by,
            bottom: self.bottom - by,
        }
    }

    /// From one share of its width to another, both of `whole`. Neighbours leave no gap and do not overlap.
    pub(super) fn columns(self, from: i64, to: i64, whole: i64) -> Self {
        Self {
            left: self.left + self.width() * from / whole,
            right: self.left + self.width() * to / whole,
            ..self
        }
    }

    /// From one share of its height to another, as [`Self::columns`].
    pub(super) fn rows(self, from: i64, to: i64, whole: i64) -> Self {
        Self {
            top: self.top + self.height() * from / whole,
            bottom: self.top + self.height() * to / whole,
            ..self
        }
    }

    /// The four lines of outermost pixels.
    pub(super) fn edges(self, thickness: i64) -> [Self; 4] {
        self.margins([thickness; 4])
    }

    /// The strips along the left, right, upper and lower edge, each as wide as given, but within the area.
    pub(super) fn margins(self, [left, right, top, bottom]: [i64; 4]) -> [Self; 4] {
        [
            Self {
                right: self.left + left,
                ..self
            },
            Self {
                left: self.right - right,
                ..self
            },
            Self {
                bottom: self.top + top,
                ..self
            },
            Self {
                top: self.bottom - bottom,
                ..self
            },
        ]
        .map(|strip| strip.and(self))
    }
}

impl From<Rect> for Area {
    fn from(rect: Rect) -> Self {
        Self {
            left: i64::from(rect.x),
            top: i64::from(rect.y),
            right: i64::from(rect.right()),
            bottom: i64::from(rect.bottom()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_leave_no_gap() {
        let whole = Area::at(3, 5, 1001, 77);
        let mut right = whole.left;
        for part in 0..16 {
            let column = whole.columns(part, part + 1, 16);
            assert_eq!(column.left, right);
            assert_eq!((column.top, column.bottom), (5, 82));
            right = column.right;
        }
        assert_eq!(right, whole.right);
    }

    #[test]
    fn margins_stay_inside() {
        let area = Area::at(10, 20, 30, 40);
        let [left, right, top, bottom] = area.margins([5, 100, 0, 1]);
        assert_eq!(left, Area::at(10, 20, 5, 40));
        assert_eq!(right, area);
        assert!(top.is_empty());
        assert_eq!(bottom, Area::at(10, 59, 30, 1));
    }
}
