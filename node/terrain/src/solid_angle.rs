//! How much of the view the hull of a tile covers.
//! In: an eye, eight points. Out: whether the solid angle of their convex hull exceeds a threshold. The
//! answer uses only operations that round alike on every machine, because all nodes must agree.

use glam::{DVec2, DVec3};

/// Squared cosine of 80°: hull points farther than that from the hull's centre direction count as around
/// the eye.
const WIDEST_COSINE_SQUARED: f64 = 0.030_153_689_607_045_8;

/// A viewer and the solid angle that a tile may cover before it is split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Criterion {
    eye: DVec3,
    threshold_sr: f64,
    /// Sine and cosine of half the threshold.
    half_sine: f64,
    half_cosine: f64,
}

impl Criterion {
    pub(crate) fn new(eye: DVec3, threshold_sr: f64) -> Self {
        let (half_sine, half_cosine) =
            sine_cosine((0.5 * threshold_sr).clamp(0.0, std::f64::consts::TAU));
        Self {
            eye,
            threshold_sr,
            half_sine,
            half_cosine,
        }
    }

    /// True if the convex hull of `corners` covers more than the threshold. An eye in or next to the hull
    /// counts as surrounded: 4π.
    pub(crate) fn exceeded_by(&self, corners: &[DVec3; 8]) -> bool {
        if self.threshold_sr >= 2.0 * std::f64::consts::TAU {
            return false;
        }
        let rays = corners.map(|corner| corner - self.eye);
        let Some(centre) = rays.iter().sum::<DVec3>().try_normalize() else {
            return true;
        };
        // Central projection onto the plane one unit along the centre direction.
        let (right, up) = centre.any_orthonormal_pair();
        let mut points = [DVec2::ZERO; 8];
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for (ray, point) in rays.iter().zip(&mut points) {
            let depth = ray.dot(centre);
            if depth <= 0.0 || depth * depth < WIDEST_COSINE_SQUARED * ray.length_squared() {
                return true;
            }
            *point = DVec2::new(ray.dot(right), ray.dot(up)) / depth;
            low = low.min(*point);
            high = high.max(*point);
        }
        // The plane touches the unit sphere, so areas on it are never smaller than solid angles: two
        // cheap bounds that settle most tiles.
        let extent = high - low;
        if extent.x * extent.y <= self.threshold_sr {
            return false;
        }
        let mut ring = [DVec2::ZERO; 16];
        let ring = convex_ring(&mut points, &mut ring);
        let [first, others @ ..] = ring else {
            return false;
        };
        let spokes = others.iter().zip(others.iter().skip(1));
        let area = 0.5
            * spokes
                .clone()
                .map(|(a, b)| (*a - *first).perp_dot(*b - *first))
                .sum::<f64>();
        if area <= self.threshold_sr {
            return false;
        }
        // Half the solid angle of a triangle is the argument of a complex number (A. van Oosterom and
        // J. Strackee, "The Solid Angle of a Plane Triangle", 1983); half that of a fan is the argument of the product.
        let (mut real, mut imaginary) = (1.0_f64, 0.0_f64);
        let lift = |p: &DVec2| DVec3::new(p.x, p.y, 1.0);
        let a = lift(first);
        let a_length = a.length();
        for (b, c) in spokes {
            let (b, c) = (lift(b), lift(c));
            let (b_length, c_length) = (b.length(), c.length());
            let i = a.dot(b.cross(c));
            let r = a_length * b_length * c_length
                + a.dot(b) * c_length
                + a.dot(c) * b_length
                + b.dot(c) * a_length;
            (real, imaginary) = (real * r - imaginary * i, real * i + imaginary * r);
        }
        // All directions lie within 80° of the centre, so half the solid angle is below π: compare angles
        // in 0…π by the sign of the sine of their difference, without an arc tangent.
        let half_threshold = 0.5 * self.threshold_sr;
        half_threshold < std::f64::consts::PI
            && imaginary * self.half_cosine - real * self.half_sine > 0.0
    }
}

/// The convex hull of eight points, counter-clockwise (A. M. Andrew's monotone chain, 1979).
fn convex_ring<'a>(points: &mut [DVec2; 8], ring: &'a mut [DVec2; 16]) -> &'a [DVec2] {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut length = 0;
    let mut push = |point: DVec2, floor: usize, length: &mut usize| {
        while *length >= floor + 2
            && (ring[*length - 1] - ring[*length - 2]).perp_dot(point - ring[*length - 2]) <= 0.0
        {
            *length -= 1;
        }
        ring[*length] = point;
        *length += 1;
    };
    for point in points.iter() {
        push(*point, 0, &mut length);
    }
    let floor = length - 1;
    for point in points.iter().rev().skip(1) {
        push(*point, floor, &mut length);
    }
    // The chain ends where it began.
    &ring[..length - 1]
}

/// Sine and cosine of 0…2π from + and × alone: Taylor series at an eighth of the angle, doubled thrice.
fn sine_cosine(angle: f64) -> (f64, f64) {
    let x = angle / 8.0;
    let square = x * x;
    let (mut sine, mut cosine) = (0.0, 0.0);
    for n in (0..10).rev() {
        let n = f64::from(n);
        cosine = 1.0 - square * cosine / ((2.0 * n + 1.0) * (2.0 * n + 2.0));
        sine = 1.0 - square * sine / ((2.0 * n + 2.0) * (2.0 * n + 3.0));
    }
    sine *= x;
    for _ in 0..3 {
        (sine, cosine) = (2.0 * sine * cosine, 1.0 - 2.0 * sine * sine);
    }
    (sine, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat box seen face on, whose solid angle has a closed form: that of a rectangular pyramid,
    /// 4·asin(sin(α/2)·sin(β/2)).
    fn slab(width: f64, height: f64, distance: f64) -> [DVec3; 8] {
        let mut corners = [DVec3::ZERO; 8];
        for (index, corner) in corners.iter_mut().enumerate() {
            let sign = |bit: usize| if index >> bit & 1 == 0 { -0.5 } else { 0.5 };
            *corner = DVec3::new(
                distance + (sign(2) + 0.5) * 1e-9,
                sign(0) * width,
                sign(1) * height,
            );
        }
        corners
    }

    #[test]
    fn agrees_with_the_closed_form_of_a_pyramid() {
        let mut tested = 0;
        for distance in [0.2, 0.5, 1.0, 3.0, 100.0, 1e5] {
            for (width, height) in [(1.0, 1.0), (2.0, 0.5), (1.5, 0.3)] {
                let half_angle = |side: f64| (0.5 * side / distance).atan();
                let exact = 4.0 * (half_angle(width).sin() * half_angle(height).sin()).asin();
                for (factor, expected) in [(1.0 - 1e-6, true), (1.0 + 1e-6, false)] {
                    let criterion = Criterion::new(DVec3::ZERO, exact * factor);
                    assert_eq!(
                        criterion.exceeded_by(&slab(width, height, distance)),
                        expected
                    );
                    tested += 1;
                }
            }
        }
        assert_eq!(tested, 36);
    }

    #[test]
    fn an_eye_inside_or_close_by_is_surrounded() {
        let around = slab(1.0, 1.0, 0.0);
        assert!(Criterion::new(DVec3::ZERO, 12.0).exceeded_by(&around));
        assert!(Criterion::new(DVec3::ZERO, 12.0).exceeded_by(&slab(1.0, 1.0, 0.01)));
        assert!(!Criterion::new(DVec3::ZERO, 4.1 * std::f64::consts::PI).exceeded_by(&around));
    }

    #[test]
    fn sine_and_cosine_match_the_library() {
        for step in 0..=1000 {
            let angle = f64::from(step) * std::f64::consts::TAU / 1000.0;
            let (sine, cosine) = sine_cosine(angle);
            assert!((sine - angle.sin()).abs() < 2e-15, "sin {angle}: {sine}");
            assert!(
                (cosine - angle.cos()).abs() < 2e-15,
                "cos {angle}: {cosine}"
            );
        }
    }
}
