//! Maps of light: alpha and beta.
//! In: one or three values a pixel, 0…1. Out: the value at any place, between pixels bilinear. It applies no
//! gamma.

use crate::MAX_SIZE_PX;

/// Values of a map.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// One value for all colours.
    Grey(Vec<f32>),
    /// Red, green and blue.
    Colour(Vec<[f32; 3]>),
}

impl Texels {
    fn len(&self) -> usize {
        match self {
            Self::Grey(values) => values.len(),
            Self::Colour(values) => values.len(),
        }
    }

    fn get(&self, index: usize) -> Option<[f32; 3]> {
        match self {
            Self::Grey(values) => values.get(index).map(|value| [*value; 3]),
            Self::Colour(values) => values.get(index).copied(),
        }
    }
}

/// A map over an output: pixels in rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Columns, 1…16384.
    pub width: u32,
    /// Rows, 1…16384.
    pub height: u32,
    /// `width · height` values, 0…1.
    pub texels: Texels,
}

impl Map {
    /// A map; `None` where the number of values is not `width · height` or a size is out of range.
    #[must_use]
    pub fn new(width: u32, height: u32, texels: Texels) -> Option<Self> {
        let map = Self {
            width,
            height,
            texels,
        };
        map.is_full().then_some(map)
    }

    /// Whether its sizes are in range and filled.
    pub(crate) fn is_full(&self) -> bool {
        let sizes = [self.width, self.height];
        sizes.iter().all(|size| (1..=MAX_SIZE_PX).contains(size))
            && self.texels.len() == self.width as usize * self.height as usize
    }

    /// A pixel as red, green and blue; `None` outside.
    #[must_use]
    pub fn at(&self, column: u32, row: u32) -> Option<[f32; 3]> {
        if column >= self.width || row >= self.height {
            return None;
        }
        self.texels
            .get(row as usize * self.width as usize + column as usize)
    }

    /// The value at a place on the output, shares 0…1 to the right and down, as red, green and blue. Pixel
    /// (column, row) lies at `((column + ½) / width, (row + ½) / height)`; beyond the outermost pixel centres
    /// the outermost pixels go on. `None` outside 0…1.
    #[must_use]
    pub fn sample(&self, x_share: f64, y_share: f64) -> Option<[f32; 3]> {
        let (left, right, across) = neighbours(x_share, self.width)?;
        let (top, bottom, along) = neighbours(y_share, self.height)?;
        let mut sum = [0.0_f64; 3];
        for (column, row, weight) in [
            (left, top, (1.0 - across) * (1.0 - along)),
            (right, top, across * (1.0 - along)),
            (left, bottom, (1.0 - across) * along),
            (right, bottom, across * along),
        ] {
            for (total, value) in sum.iter_mut().zip(self.at(column, row)?) {
                *total += f64::from(value) * weight;
            }
        }
        Some(sum.map(|total| total as f32))
    }

    /// The place of the first value that is not a number.
    pub(crate) fn first_not_a_number(&self) -> Option<(u32, u32)> {
        let index = match &self.texels {
            Texels::Grey(values) => values.iter().position(|value| !value.is_finite()),
            Texels::Colour(values) => values
                .iter()
                .position(|colour| !colour.iter().all(|value| value.is_finite())),
        }? as u64;
        let width = u64::from(self.width);
        Some(((index % width) as u32, (index / width) as u32))
    }
}

fn neighbours(share: f64, size: u32) -> Option<(u32, u32, f64)> {
    if !(0.0..=1.0).contains(&share) || size == 0 {
        return None;
    }
    let last = size - 1;
    let place = (share * f64::from(size) - 0.5).clamp(0.0, f64::from(last));
    let first = place.floor();
    Some((first as u32, (first as u32 + 1).min(last), place - first))
}
