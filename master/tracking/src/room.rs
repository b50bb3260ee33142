//! From a tracker's frame to heads in the room. In: axes, units, offsets, as the wall file gives them. Out: a
//! checked transform. Left-handed axes are refused. It knows nothing of time.

use glam::{DMat3, DQuat, DVec3, EulerRot};
use thiserror::Error;

use crate::head::RawPose;

/// How far axes may be from unit length and from right angles.
const TOLERANCE: f64 = 1e-3;
/// Longest unit, in metres.
const LONGEST_UNIT_M: f64 = 1_000.0;
/// Farthest that anything may be from an origin, in metres.
const FARTHEST_M: f64 = 10_000.0;

/// Origin and axes of the tracker's frame, in the room: a rotation, right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Where its origin is, in metres.
    pub origin_m: [f64; 3],
    /// Its x axis, a unit vector.
    pub x: [f64; 3],
    /// Its y axis, a unit vector.
    pub y: [f64; 3],
    /// Its z axis, a unit vector.
    pub z: [f64; 3],
}

impl Default for Axes {
    fn default() -> Self {
        Self {
            origin_m: [0.0; 3],
            x: [1.0, 0.0, 0.0],
            y: [0.0, 1.0, 0.0],
            z: [0.0, 0.0, 1.0],
        }
    }
}

/// Where the head is on the tracked body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body {
    /// From the body's origin to the middle between the eyes, along the body's axes, in metres.
    pub offset_m: [f64; 3],
    /// How the head is turned on the body, in degrees: yaw (to the left, about y), then pitch (up, about
    /// x), then roll (counter-clockwise, about z).
    pub looks_deg: [f64; 3],
}

/// Why a tracker's frame is refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RoomError {
    /// NaN, infinity, or kilometres.
    #[error("`{key}` is {value:?}: give three finite numbers, at most {FARTHEST_M} from 0")]
    OutOfRange {
        /// The key in the wall file.
        key: &'static str,
        /// What it says.
        value: [f64; 3],
    },
    /// An axis is not as long as 1.
    #[error("axis `{axis}` of `to_room` is {length} long: give a unit vector; scale by `unit_m`")]
    NotUnit {
        /// `x`, `y` or `z`.
        axis: &'static str,
        /// Its length.
        length: f64,
    },
    /// Two axes do not stand at right angles.
    #[error(
        "axes `{0}` and `{1}` of `to_room` do not stand at right angles: their product is {2}, not 0"
    )]
    NotPerpendicular(&'static str, &'static str, f64),
    /// A mirror, not a rotation.
    #[error(
        "the axes of `to_room` are left-handed (their determinant is {determinant:.3}, not +1): turn one of \
         them round"
    )]
    LeftHanded {
        /// Of the matrix of the three axes.
        determinant: f64,
    },
    /// Not a unit of length.
    #[error(
        "`unit_m` is {0}: give the metres in a unit of the tracker, more than 0, at most {LONGEST_UNIT_M}"
    )]
    BadUnit(f64),
}

/// From a tracker's frame to heads in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToRoom {
    origin_m: DVec3,
    rotation: DQuat,
    unit_m: f64,
    offset_m: DVec3,
    looks: DQuat,
}

impl ToRoom {
    /// Checks axes, unit and offset.
    pub fn new(to_room: &Axes, unit_m: f64, to_head: &Body) -> Result<Self, RoomError> {
        for (key, value) in [
            ("to_room.origin_m", to_room.origin_m),
            ("to_room.x", to_room.x),
            ("to_room.y", to_room.y),
            ("to_room.z", to_room.z),
            ("to_head.offset_m", to_head.offset_m),
            ("to_head.looks_deg", to_head.looks_deg),
        ] {
            if !value.iter().all(|value| value.abs() <= FARTHEST_M) {
                return Err(RoomError::OutOfRange { key, value });
            }
        }
        if !(unit_m > 0.0 && unit_m <= LONGEST_UNIT_M) {
            return Err(RoomError::BadUnit(unit_m));
        }
        let axes = [
            ("x", DVec3::from(to_room.x)),
            ("y", DVec3::from(to_room.y)),
            ("z", DVec3::from(to_room.z)),
        ];
        for (axis, vector) in axes {
            let length = vector.length();
            if (length - 1.0).abs() > TOLERANCE {
                return Err(RoomError::NotUnit { axis, length });
            }
        }
        let [(_, x), (_, y), (_, z)] = axes;
        for (one, other, product) in [
            ("x", "y", x.dot(y)),
            ("y", "z", y.dot(z)),
            ("z", "x", z.dot(x)),
        ] {
            if product.abs() > TOLERANCE {
                return Err(RoomError::NotPerpendicular(one, other, product));
            }
        }
        let matrix = DMat3::from_cols(x, y, z);
        let determinant = matrix.determinant();
        if (determinant - 1.0).abs() > 10.0 * TOLERANCE {
            return Err(RoomError::LeftHanded { determinant });
        }
        let [yaw, pitch, roll] = to_head.looks_deg.map(f64::to_radians);
        Ok(Self {
            origin_m: to_room.origin_m.into(),
            rotation: DQuat::from_mat3(&matrix).normalize(),
            unit_m,
            offset_m: to_head.offset_m.into(),
            looks: DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll),
        })
    }

    /// The head of a tracked body: metres in the room, and a unit quaternion from a head at rest to this
    /// one. `raw` must be finite and its orientation a unit quaternion.
    #[must_use]
    pub fn head(&self, raw: &RawPose) -> (DVec3, DQuat) {
        let body = self.rotation * DQuat::from_array(raw.orientation).normalize();
        let body_m = self.origin_m + self.rotation * (DVec3::from(raw.position) * self.unit_m);
        (
            body_m + body * self.offset_m,
            (body * self.looks).normalize(),
        )
    }
}
