//! Geometry of screens and heads: corners from fields of view, right angles, angles of heads.
//! In: what the formats state. Out: corners in room metres, angles in degrees. It knows no format.

use glam::{DMat3, DVec3, EulerRot};

/// How far corners may be off a rectangle, in metres; wall files allow as much.
pub(crate) const RECTANGLE_TOLERANCE_M: f64 = 0.001;
/// Below this, corners are written as they stand, in metres: half of the last digit that is written.
const EXACT_M: f64 = 5e-7;
/// How far anything may be from the room's origin, in metres.
pub(crate) const ROOM_M: f64 = 1000.0;

/// Three corners of a screen in room metres, as its observer sees them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corners {
    pub(crate) bottom_left: DVec3,
    pub(crate) bottom_right: DVec3,
    pub(crate) top_left: DVec3,
}

impl Corners {
    pub(crate) fn new(bottom_left: [f64; 3], bottom_right: [f64; 3], top_left: [f64; 3]) -> Self {
        Self {
            bottom_left: bottom_left.into(),
            bottom_right: bottom_right.into(),
            top_left: top_left.into(),
        }
    }

    /// The rectangle that a field of view cuts out of the plane at `distance_m` before a viewpoint that looks along the
    /// −z of `turn`: its edges are at distance·tan(angle) to the left, right, down and up of the axis. Angles in
    /// degrees, to the left and down negative. `None` where an angle reaches 90°.
    pub(crate) fn from_field(
        [left, right, down, up]: [f64; 4],
        distance_m: f64,
        turn: DMat3,
        viewpoint: DVec3,
    ) -> Option<Self> {
        if [left, right, down, up]
            .iter()
            .any(|angle| angle.abs() > 89.9)
        {
            return None;
        }
        let edge = |angle: f64| distance_m * angle.to_radians().tan();
        let corner = |x, y| viewpoint + turn * DVec3::new(edge(x), edge(y), -distance_m);
        Some(Self {
            bottom_left: corner(left, down),
            bottom_right: corner(right, down),
            top_left: corner(left, up),
        })
    }

    pub(crate) fn map(&self, change: impl Fn(DVec3) -> DVec3) -> Self {
        Self {
            bottom_left: change(self.bottom_left),
            bottom_right: change(self.bottom_right),
            top_left: change(self.top_left),
        }
    }

    fn right(&self) -> DVec3 {
        self.bottom_right - self.bottom_left
    }

    fn up(&self) -> DVec3 {
        self.top_left - self.bottom_left
    }

    /// Width and height in metres.
    pub(crate) fn size_m(&self) -> [f64; 2] {
        [self.right().length(), self.up().length()]
    }

    /// Whether it has an area and lies in the room.
    pub(crate) fn is_usable(&self) -> bool {
        let points = [self.bottom_left, self.bottom_right, self.top_left];
        let near = |p: &DVec3| p.is_finite() && p.abs().max_element() <= ROOM_M;
        let [width, height] = self.size_m();
        points.iter().all(near)
            && width.min(height) > RECTANGLE_TOLERANCE_M
            && self.right().cross(self.up()).length() > 1e-3 * width * height
    }

    /// The rectangle with the same lower edge and the same height, and how far the upper left corner moved for it, in
    /// metres: the part of the left edge that runs along the lower one is taken from it.
    pub(crate) fn right_angled(&self) -> (Self, f64) {
        let (right, up) = (self.right(), self.up());
        let upright = up - right * (up.dot(right) / right.length_squared());
        let straight = upright.normalize_or_zero() * up.length();
        let moved_m = (straight - up).length();
        if moved_m <= EXACT_M {
            return (*self, 0.0);
        }
        let top_left = self.bottom_left + straight;
        (Self { top_left, ..*self }, moved_m)
    }

    /// The part from the lower left corner on: x, y, width and height as shares of the whole.
    pub(crate) fn part(&self, [x, y, width, height]: [f64; 4]) -> Self {
        let point =
            |across: f64, along: f64| self.bottom_left + self.right() * across + self.up() * along;
        Self {
            bottom_left: point(x, y),
            bottom_right: point(x + width, y),
            top_left: point(x, y + height),
        }
    }

    /// How far a head is in front of the plane, in metres; behind it the distance is negative.
    pub(crate) fn distance_m(&self, head: DVec3) -> f64 {
        let back = self.right().cross(self.up()).normalize_or_zero();
        (head - self.bottom_left).dot(back)
    }
}

/// Turns a head by yaw to the left about y, then pitch up about x, then roll about z, all in degrees.
pub(crate) fn turn_of([yaw, pitch, roll]: [f64; 3]) -> DMat3 {
    DMat3::from_euler(
        EulerRot::YXZ,
        yaw.to_radians(),
        pitch.to_radians(),
        roll.to_radians(),
    )
}

/// The angles of [`turn_of`] that give this rotation.
pub(crate) fn looks_of(turn: DMat3) -> [f64; 3] {
    let (yaw, pitch, roll) = turn.to_euler(EulerRot::YXZ);
    [yaw, pitch, roll].map(f64::to_degrees)
}

/// The rotation of a head that looks along `forward` with `up` above it. `None` where they do not span a plane.
pub(crate) fn turn_towards(forward: DVec3, up: DVec3) -> Option<DMat3> {
    let back = -forward.try_normalize()?;
    let right = up.cross(back).try_normalize()?;
    Some(DMat3::from_cols(right, back.cross(right), back))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_90_degrees_is_as_wide_as_twice_its_distance() {
        let corners =
            Corners::from_field([-45.0, 45.0, -45.0, 0.0], 2.0, DMat3::IDENTITY, DVec3::Y).unwrap();
        let expected = Corners::new([-2.0, -1.0, -2.0], [2.0, -1.0, -2.0], [-2.0, 1.0, -2.0]);
        assert!((corners.bottom_left - expected.bottom_left).length() < 1e-12);
        assert!((corners.bottom_right - expected.bottom_right).length() < 1e-12);
        assert!((corners.top_left - expected.top_left).length() < 1e-12);
        assert!(
            Corners::from_field([-90.0, 45.0, -1.0, 1.0], 2.0, DMat3::IDENTITY, DVec3::Y).is_none()
        );
    }

    #[test]
    fn leaning_walls_are_set_upright_at_the_same_height() {
        let leaning = Corners::new([0.0; 3], [2.0, 0.0, 0.0], [0.3, 0.4, 0.0]);
        let (upright, moved_m) = leaning.right_angled();
        assert!((upright.top_left - DVec3::new(0.0, 0.5, 0.0)).length() < 1e-12);
        assert!((moved_m - DVec3::new(0.3, -0.1, 0.0).length()).abs() < 1e-12);
        let exact = Corners::new([0.1; 3], [2.1, 0.1, 0.1], [0.1, 0.7, 0.1]);
        assert_eq!(exact.right_angled(), (exact, 0.0));
    }

    #[test]
    fn heads_are_turned_and_read_back() {
        for looks in [[0.0; 3], [90.0, 0.0, 0.0], [-30.0, 20.0, 10.0]] {
            let turn = turn_of(looks);
            let back = looks_of(turn);
            assert!(
                looks.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9),
                "{looks:?} {back:?}"
            );
            let again = turn_towards(turn * DVec3::NEG_Z, turn * DVec3::Y).unwrap();
            assert!(again.abs_diff_eq(turn, 1e-12));
        }
        // To the left is −x.
        let left = turn_towards(DVec3::NEG_X, DVec3::Y).unwrap();
        assert!((looks_of(left)[0] - 90.0).abs() < 1e-9);
        assert!(turn_towards(DVec3::Y, DVec3::Y).is_none());
    }

    #[test]
    fn distance_is_positive_on_the_side_that_sees_left_as_left() {
        let front = Corners::new([-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]);
        assert!((front.distance_m(DVec3::ZERO) - 1.0).abs() < 1e-12);
        assert!((front.distance_m(DVec3::NEG_Z * 3.0) + 2.0).abs() < 1e-12);
    }
}
