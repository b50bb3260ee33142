//! A grid of samples over an output.
//! In: samples in rows from the top. Out: the value at any place, between samples bilinear. It never makes up a
//! value next to a hole.

use crate::MAX_SIZE_PX;

mod private {
    pub trait Sealed {}
    impl<const N: usize> Sealed for [f32; N] {}
}

/// Something that a grid holds: a few numbers. A sample with a number that is not finite is a hole.
pub trait Sample: Copy + private::Sealed {
    /// A hole.
    const HOLE: Self;
    /// Whether nothing is known here.
    fn is_hole(&self) -> bool;
    /// The sum of samples times weights.
    fn weighted(samples: &[(Self, f64)]) -> Self;
}

impl<const N: usize> Sample for [f32; N] {
    const HOLE: Self = [f32::NAN; N];

    fn is_hole(&self) -> bool {
        !self.iter().all(|value| value.is_finite())
    }

    fn weighted(samples: &[(Self, f64)]) -> Self {
        let mut sum = [0.0_f64; N];
        for (sample, weight) in samples {
            for (total, value) in sum.iter_mut().zip(sample) {
                *total += f64::from(*value) * weight;
            }
        }
        sum.map(|total| total as f32)
    }
}

/// Where the samples of a grid lie on the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// Sample (column, row) lies at the share `((column + ½) / width, (row + ½) / height)`. In a grid of the
    /// output's size that is the centre of pixel (column, row). Per-pixel maps are like this.
    #[default]
    Centres,
    /// Sample (column, row) lies at the share `(column / (width − 1), row / (height − 1))`: the outer samples
    /// lie on the output's edges. Meshes with vertices on the corners are like this.
    Corners,
}

/// Samples over an output, in rows from the top and from left to right. It may have another resolution than the
/// output.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    /// Columns, 1…16384.
    pub width: u32,
    /// Rows, 1…16384.
    pub height: u32,
    /// Where the samples lie.
    pub placement: Placement,
    /// `width · height` samples.
    pub values: Vec<T>,
}

impl<T: Sample> Grid<T> {
    /// A grid; `None` where the number of values is not `width · height` or a size is out of range.
    #[must_use]
    pub fn new(width: u32, height: u32, placement: Placement, values: Vec<T>) -> Option<Self> {
        let sizes_fit = [width, height]
            .iter()
            .all(|size| (1..=MAX_SIZE_PX).contains(size));
        (sizes_fit && values.len() == width as usize * height as usize).then_some(Self {
            width,
            height,
            placement,
            values,
        })
    }

    /// A sample; `None` outside and where it is a hole.
    #[must_use]
    pub fn at(&self, column: u32, row: u32) -> Option<T> {
        if column >= self.width || row >= self.height {
            return None;
        }
        let index = row as usize * self.width as usize + column as usize;
        self.values
            .get(index)
            .copied()
            .filter(|sample| !sample.is_hole())
    }

    /// The value at a place on the output: shares 0…1 to the right and down. The centre of output pixel
    /// (x, y) of an output of w × h pixels is at `((x + ½) / w, (y + ½) / h)`.
    ///
    /// Between samples it is bilinear. Beyond the outermost samples of [`Placement::Centres`], half a cell at
    /// most, the outermost cell is continued: a mapping that is linear stays exact up to the edge.
    ///
    /// `None` outside 0…1, and where a sample that counts is a hole.
    #[must_use]
    pub fn sample(&self, x_share: f64, y_share: f64) -> Option<T> {
        let (column, right) = self.cell(x_share, self.width)?;
        let (row, down) = self.cell(y_share, self.height)?;
        let corners = [
            (0, 0, (1.0 - right) * (1.0 - down)),
            (1, 0, right * (1.0 - down)),
            (0, 1, (1.0 - right) * down),
            (1, 1, right * down),
        ];
        let mut count = 0;
        let mut weighted = [(T::HOLE, 0.0); 4];
        for (across, along, weight) in corners {
            if weight != 0.0 {
                let sample = self.at(column.checked_add(across)?, row.checked_add(along)?)?;
                *weighted.get_mut(count)? = (sample, weight);
                count += 1;
            }
        }
        Some(T::weighted(weighted.get(..count)?))
    }

    /// The left or upper sample of the cell at a share, and the place in that cell.
    fn cell(&self, share: f64, size: u32) -> Option<(u32, f64)> {
        if !(0.0..=1.0).contains(&share) {
            return None;
        }
        if size < 2 {
            return Some((0, 0.0));
        }
        let place = match self.placement {
            Placement::Centres => share * f64::from(size) - 0.5,
            Placement::Corners => share * f64::from(size - 1),
        };
        let first = place.floor().clamp(0.0, f64::from(size - 2));
        let within = place - first;
        // A place that rounding alone moved off its sample must not need the neighbour.
        let within = if (within - within.round()).abs() < 1e-9 {
            within.round()
        } else {
            within
        };
        Some((first as u32, within))
    }

    /// The same at the pixel centres of an output of this size, with holes where nothing is known. `None`
    /// where a size is out of range.
    #[must_use]
    pub fn resampled(&self, width: u32, height: u32) -> Option<Self> {
        if !(1..=MAX_SIZE_PX).contains(&width) || !(1..=MAX_SIZE_PX).contains(&height) {
            return None;
        }
        if self.placement == Placement::Centres && [width, height] == [self.width, self.height] {
            return Some(self.clone());
        }
        let share = |index: u32, size: u32| (f64::from(index) + 0.5) / f64::from(size);
        let mut values = Vec::with_capacity(width as usize * height as usize);
        for row in 0..height {
            for column in 0..width {
                let sample = self.sample(share(column, width), share(row, height));
                values.push(sample.unwrap_or(T::HOLE));
            }
        }
        Self::new(width, height, Placement::Centres, values)
    }

    /// Every sample changed.
    pub(crate) fn map<U: Sample>(self, change: impl Fn(T) -> U) -> Grid<U> {
        Grid {
            width: self.width,
            height: self.height,
            placement: self.placement,
            values: self.values.into_iter().map(change).collect(),
        }
    }

    /// Whether it holds nothing but holes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.iter().all(Sample::is_hole)
    }
}

impl Grid<[f32; 2]> {
    /// Whether no sample lies in the source picture.
    pub(crate) fn shows_nothing(&self) -> bool {
        !self
            .values
            .iter()
            .any(|uv| uv.iter().all(|share| (0.0..=1.0).contains(share)))
    }
}
