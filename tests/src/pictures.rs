//! Pictures that the program wrote: loaded, compared, and looked at coarsely.
//!
//! In: PNG files. Out: pixels and counts. It must not decide what is good enough: tests do.

use std::path::Path;

use image::RgbImage;

/// Loads a PNG.
pub fn load(path: &Path) -> RgbImage {
    image::open(path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        .to_rgb8()
}

/// Pixels that differ between two pictures of one size.
pub fn differing(a: &RgbImage, b: &RgbImage) -> usize {
    assert_eq!(a.dimensions(), b.dimensions());
    a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count()
}

/// Share of the pixels, 0 to 1, whose channels add up to more than `sum`.
pub fn brighter_than(picture: &RgbImage, sum: u32) -> f64 {
    let bright = picture
        .pixels()
        .filter(|pixel| pixel.0.iter().copied().map(u32::from).sum::<u32>() > sum);
    bright.count() as f64 / f64::from(picture.width() * picture.height())
}

/// Mean colour of a rectangle, channels 0 to 255.
pub fn mean(picture: &RgbImage, x: u32, y: u32, width: u32, height: u32) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (dx, dy) in (0..height).flat_map(|dy| (0..width).map(move |dx| (dx, dy))) {
        for (sum, channel) in sum.iter_mut().zip(picture.get_pixel(x + dx, y + dy).0) {
            *sum += f64::from(channel);
        }
    }
    sum.map(|sum| sum / f64::from(width * height))
}

/// Number of distinct colours.
pub fn colours(picture: &RgbImage) -> usize {
    picture
        .pixels()
        .map(|pixel| pixel.0)
        .collect::<std::collections::HashSet<_>>()
        .len()
}
