//! Heads and eyes in the room.
//! In: where a head is and how it is turned. Out: its axes and eyes. It tracks nobody.

use glam::{DMat3, DVec3};

/// A head in the room. The axes are unit vectors at right angles to each other, in room axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadPose {
    /// The middle between the eyes, in room metres.
    pub position_m: DVec3,
    /// To the head's right.
    pub right: DVec3,
    /// Up from the head.
    pub up: DVec3,
    /// Away from what the head looks at.
    pub back: DVec3,
}

impl HeadPose {
    /// A head that is turned in degrees: yaw to the left about the room's y, then pitch up about its own x, then roll
    /// counter-clockwise (to the left shoulder) about its own z. All zero: it looks along −z.
    #[must_use]
    pub fn new(position_m: DVec3, looks_deg: [f64; 3]) -> Self {
        let [yaw, pitch, roll] = looks_deg.map(f64::to_radians);
        let turned = DMat3::from_rotation_y(yaw)
            * DMat3::from_rotation_x(pitch)
            * DMat3::from_rotation_z(roll);
        Self {
            position_m,
            right: turned.x_axis,
            up: turned.y_axis,
            back: turned.z_axis,
        }
    }
}

/// The left and the right eye of a head in room metres, each half of the separation (in metres) from the middle.
#[must_use]
pub fn eyes(head: &HeadPose, separation_m: f64) -> [DVec3; 2] {
    let aside = head.right * (0.5 * separation_m);
    [head.position_m - aside, head.position_m + aside]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_turn_left_up_and_to_the_left_shoulder() {
        // Yaw, pitch, roll; then what the head looks at, and its right.
        let cases = [
            ([0.0, 0.0, 0.0], DVec3::NEG_Z, DVec3::X),
            ([90.0, 0.0, 0.0], DVec3::NEG_X, DVec3::NEG_Z),
            ([0.0, 90.0, 0.0], DVec3::Y, DVec3::X),
            ([0.0, 0.0, 90.0], DVec3::NEG_Z, DVec3::Y),
            // First to the left, then up about the head's own x.
            ([90.0, 90.0, 0.0], DVec3::Y, DVec3::NEG_Z),
            ([90.0, 0.0, 90.0], DVec3::NEG_X, DVec3::Y),
        ];
        for (looks_deg, ahead, right) in cases {
            let head = HeadPose::new(DVec3::new(1.0, 2.0, 3.0), looks_deg);
            assert!(head.back.distance(-ahead) < 1e-15, "{looks_deg:?}");
            assert!(head.right.distance(right) < 1e-15, "{looks_deg:?}");
            assert!(head.right.cross(head.up).distance(head.back) < 1e-15);
            let [left_m, right_m] = eyes(&head, 0.064);
            assert!((right_m - left_m).distance(right * 0.064) < 1e-15);
            assert!((left_m + right_m).distance(head.position_m * 2.0) < 1e-15);
        }
    }
}
