//! What rays and shares have in common: where a ray meets a quadric, and what counts as on the canvas.
//! In: coefficients, shares, vectors. Out: distances, shares within 0…1. It knows no shape.

use glam::DVec3;

use crate::ShapeError;

/// How far beyond the edge of a canvas a share may be and still counts as on it: a nanometre on a metre, for rounding.
pub(crate) const EDGE_SHARE: f64 = 1e-9;
/// How far a ray goes before it can meet anything, in metres: an eye on the screen does not see the place where it is.
pub(crate) const NEAREST_M: f64 = 1e-9;
/// How far from the origin anything in a room may be, in metres.
pub(crate) const FARTHEST_M: f64 = 1e4;

/// The share, drawn onto the canvas if rounding left it beside its edge. `None` off the canvas.
pub(crate) fn on_canvas(share: f64) -> Option<f64> {
    (-EDGE_SHARE..=1.0 + EDGE_SHARE)
        .contains(&share)
        .then(|| share.clamp(0.0, 1.0))
}

/// Which share of the way from the first azimuth to the second one an azimuth is, all in degrees, and whole turns
/// do not count. `None` where it is not between them.
pub(crate) fn azimuth_share(azimuth_deg: f64, range_deg: [f64; 2]) -> Option<f64> {
    let span = range_deg[1] - range_deg[0];
    let beyond = (azimuth_deg - range_deg[0]).rem_euclid(360.0);
    on_canvas(beyond / span).or_else(|| on_canvas((beyond - 360.0) / span))
}

/// The real roots of a·t² + 2·b·t + c = 0 with a > 0 in ascending order, without cancellation.
pub(crate) fn roots(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - a * c;
    if !(a > 0.0 && discriminant >= 0.0) {
        return None;
    }
    let larger = b.abs() + discriminant.sqrt();
    if larger == 0.0 {
        return Some([0.0; 2]);
    }
    Some(if b > 0.0 {
        [-larger / a, -c / larger]
    } else {
        [c / larger, larger / a]
    })
}

/// Whether a place can be in a room.
pub(crate) fn in_room(point_m: DVec3) -> bool {
    point_m.is_finite() && point_m.abs().max_element() <= FARTHEST_M
}

/// Refuses a place that cannot be in a room.
pub(crate) fn check_place(key: &'static str, point_m: DVec3) -> Result<(), ShapeError> {
    if in_room(point_m) {
        Ok(())
    } else {
        Err(ShapeError::NotInRoom { key })
    }
}

/// Refuses a radius that no screen has.
pub(crate) fn check_radius(radius_m: f64) -> Result<(), ShapeError> {
    if (0.01..=FARTHEST_M).contains(&radius_m) {
        Ok(())
    } else {
        Err(ShapeError::Radius { radius_m })
    }
}

/// Refuses azimuths that are not from left to right, or more than a turn.
pub(crate) fn check_azimuths(azimuth_deg: [f64; 2]) -> Result<(), ShapeError> {
    let key = "azimuth_deg";
    let [from_deg, to_deg] = azimuth_deg;
    for degrees in azimuth_deg {
        check_angle(key, degrees, [-360.0, 360.0], "")?;
    }
    if to_deg - from_deg < 0.01 {
        return Err(ShapeError::AngleOrder {
            key,
            from_deg,
            to_deg,
            effect: "left-handed (mirrored) or have no width",
            remedy: "the left edge",
        });
    }
    check_angle(
        key,
        to_deg - from_deg,
        [0.0, 360.0],
        " between the edges: no more than a whole turn",
    )
}

/// Refuses an angle outside of a range.
pub(crate) fn check_angle(
    key: &'static str,
    degrees: f64,
    [lowest, highest]: [f64; 2],
    note: &'static str,
) -> Result<(), ShapeError> {
    if (lowest..=highest).contains(&degrees) {
        Ok(())
    } else {
        Err(ShapeError::AngleRange {
            key,
            degrees,
            lowest,
            highest,
            note,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_solve_and_ascend() {
        for (a, b, c) in [
            (2.0, 3.0, 1.0),
            (2.0, -3.0, 1.0),
            (1.0, 0.0, -4.0),
            (1.0, 1e8, 1.0),
            (1.0, -1e8, 1.0),
        ] {
            let [first, second] = roots(a, b, c).unwrap();
            assert!(first <= second);
            for t in [first, second] {
                let terms = a * t * t + (2.0 * b * t).abs() + f64::abs(c);
                assert!((a * t * t + 2.0 * b * t + c).abs() <= 1e-14 * terms);
            }
        }
        assert_eq!(roots(1.0, 0.0, 1.0), None);
        assert_eq!(roots(0.0, 1.0, 1.0), None);
    }

    #[test]
    fn azimuths_count_without_turns() {
        assert_eq!(azimuth_share(-170.0, [90.0, 270.0]), Some(100.0 / 180.0));
        assert_eq!(azimuth_share(180.0, [-180.0, 180.0]), Some(0.0));
        assert_eq!(azimuth_share(89.9, [90.0, 270.0]), None);
        // Rounding beside the left edge is the left edge, not a turn farther.
        assert_eq!(azimuth_share(90.0 - 1e-12, [90.0, 270.0]), Some(0.0));
    }
}
