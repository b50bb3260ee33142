//! How a map stretches pixels: singular values of a Jacobian, and pixels that a surface squeezes.
//! In: how far one pixel to the right and one down lead. Out: squares of lengths. Only basic operations and square roots.

use glam::DVec3;

/// Pixels whose length is more than this many times their width on the surface itself, whoever looks at them, compared to
/// the least oblong pixels of the same map, count as if they were only so oblong: around the pole of a grid columns converge
/// to a point, and no picture could be fine enough for them.
pub(crate) const MOST_SQUEEZED: f64 = 3.0;
/// Pixels that are narrower than this share of their length are no area at all and do not count.
const NO_AREA: f64 = 1e-5;

/// The squares of the smallest and the largest singular value of the matrix with columns `x` and `y`.
fn stretch_squared(x: DVec3, y: DVec3) -> [f64; 2] {
    singular_squared(
        x.length_squared(),
        x.dot(y),
        y.length_squared(),
        x.cross(y).length_squared(),
    )
}

/// The squares of the singular values of a matrix from the products of its columns and its squared determinant. The smaller
/// one is free of cancellation.
pub(crate) fn singular_squared(xx: f64, xy: f64, yy: f64, determinant_squared: f64) -> [f64; 2] {
    let difference = xx - yy;
    let largest = 0.5 * (xx + yy + (difference * difference + 4.0 * xy * xy).sqrt());
    let smallest = if largest > 0.0 {
        determinant_squared / largest
    } else {
        0.0
    };
    [smallest, largest]
}

/// The square of how many times longer than wide a pixel is on the surface, 1 or more; infinite for one without an area.
pub(crate) fn oblong_squared(x: DVec3, y: DVec3) -> f64 {
    let [smallest, largest] = stretch_squared(x, y);
    if smallest > NO_AREA * NO_AREA * largest && largest.is_finite() {
        largest / smallest
    } else {
        f64::INFINITY
    }
}

/// By how much the square of a pixel's smaller stretch is to be increased because the surface squeezes it: 1 for ordinary
/// pixels; infinite for those without an area, which so do not count. `least_squared` is that of the least oblong pixel.
pub(crate) fn relief_squared(oblong_squared: f64, least_squared: f64) -> f64 {
    if oblong_squared.is_infinite() {
        return f64::INFINITY;
    }
    (oblong_squared / (MOST_SQUEEZED * MOST_SQUEEZED * least_squared)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_those_of_an_ellipse() {
        // A rotation by 30°, stretches 5 and 0.2, and another rotation.
        let (s, c) = (0.5, 0.75_f64.sqrt());
        let (x, y) = (
            DVec3::new(5.0 * c, 0.2 * s, 0.0),
            DVec3::new(-5.0 * s, 0.2 * c, 0.0),
        );
        let [smallest, largest] = stretch_squared(x, y);
        assert!((smallest.sqrt() - 0.2).abs() < 1e-14 && (largest.sqrt() - 5.0).abs() < 1e-14);
        assert!((oblong_squared(x, y).sqrt() - 25.0).abs() < 1e-12);
        assert_eq!(oblong_squared(DVec3::X, DVec3::NEG_Y * 2.0), 4.0);
        assert_eq!(oblong_squared(DVec3::X, DVec3::X * 2.0), f64::INFINITY);
        assert_eq!(oblong_squared(DVec3::ZERO, DVec3::ZERO), f64::INFINITY);
        assert_eq!(oblong_squared(DVec3::NAN, DVec3::Y), f64::INFINITY);
        // Twelve times as oblong as the others is four times too much.
        assert_eq!(relief_squared(24.0 * 24.0, 2.0 * 2.0), 16.0);
        assert_eq!(relief_squared(5.0, 1.0), 1.0);
        assert_eq!(relief_squared(f64::INFINITY, f64::INFINITY), f64::INFINITY);
    }
}
