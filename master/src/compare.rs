//! Two pictures, pixel for pixel.
//!
//! In: two pictures of one size. Out: how many pixels differ, by how much, and where.

use image::{Luma, RgbaImage};
use serde::{Deserialize, Serialize};

/// How two pictures differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Comparison {
    /// Pixels compared.
    pub(crate) pixels: u64,
    /// Pixels of which any channel differs.
    pub(crate) differing: u64,
    /// The largest difference of any channel, 0 to 255.
    pub(crate) max_channel_difference: u8,
}

impl Comparison {
    /// Both comparisons as one.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            differing: self.differing + other.differing,
            max_channel_difference: self
                .max_channel_difference
                .max(other.max_channel_difference),
        }
    }
}

/// Compares two pictures. Where one has no pixel, the other's counts as different. The second result is white
/// where pixels differ.
pub(crate) fn compare(a: &RgbaImage, b: &RgbaImage) -> (Comparison, image::GrayImage) {
    let (width, height) = (a.width().max(b.width()), a.height().max(b.height()));
    let mut comparison = Comparison {
        pixels: u64::from(width) * u64::from(height),
        ..Comparison::default()
    };
    let difference = image::GrayImage::from_fn(width, height, |x, y| {
        let largest = match (a.get_pixel_checked(x, y), b.get_pixel_checked(x, y)) {
            (Some(a), Some(b)) => {
                a.0.iter()
                    .zip(b.0)
                    .map(|(a, b)| a.abs_diff(b))
                    .max()
                    .unwrap_or(0)
            }
            _ => u8::MAX,
        };
        comparison.differing += u64::from(largest > 0);
        comparison.max_channel_difference = comparison.max_channel_difference.max(largest);
        Luma([if largest > 0 { u8::MAX } else { 0 }])
    });
    (comparison, difference)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn every_difference_counts_once() {
        let a = RgbaImage::from_pixel(4, 3, Rgba([10, 20, 30, 255]));
        let mut b = a.clone();
        assert_eq!(
            compare(&a, &b).0,
            Comparison {
                pixels: 12,
                differing: 0,
                max_channel_difference: 0
            }
        );
        b.put_pixel(1, 2, Rgba([10, 24, 29, 255]));
        let (comparison, difference) = compare(&a, &b);
        assert_eq!(
            comparison,
            Comparison {
                pixels: 12,
                differing: 1,
                max_channel_difference: 4
            }
        );
        assert_eq!(
            (difference.get_pixel(1, 2).0, difference.get_pixel(0, 0).0),
            ([255], [0])
        );
        // A picture of another size is not silently cut.
        assert_eq!(compare(&a, &RgbaImage::new(4, 2)).0.differing, 12);
    }
}
