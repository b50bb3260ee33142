//! The cube whose six faces carry the quadtrees, with S2's axes and quadratic projection
//! (S2 Geometry, s2coords.h): cell space s, t in 0…1, cube space u, v in −1…1.
//! In: face and coordinates. Out: directions that are read as geodetic normals.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// One of the six cube faces, numbered as in S2: +x, +y, +z, −x, −y, −z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Face(u8);

/// All faces in the order of their numbers.
pub const FACES: [Face; 6] = [Face(0), Face(1), Face(2), Face(3), Face(4), Face(5)];

/// Axis (0 x, 1 y, 2 z) and sign of the directions u, v and outward for each face.
const AXES: [[(usize, i64); 3]; 6] = [
    [(1, 1), (2, 1), (0, 1)],
    [(0, -1), (2, 1), (1, 1)],
    [(0, -1), (1, -1), (2, 1)],
    [(2, -1), (1, -1), (0, -1)],
    [(2, -1), (0, 1), (1, -1)],
    [(1, 1), (0, 1), (2, -1)],
];

impl Face {
    /// The face with this S2 number, `None` above 5.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number < 6 { Some(Self(number)) } else { None }
    }

    /// The S2 number, 0…5.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    fn axes(self) -> &'static [(usize, i64); 3] {
        &AXES[usize::from(self.0)]
    }

    /// Unit vectors of u, v and outward.
    #[must_use]
    pub fn frame(self) -> [DVec3; 3] {
        self.axes().map(|(axis, sign)| {
            let mut vector = DVec3::ZERO;
            vector[axis] = sign as f64;
            vector
        })
    }

    /// The point (u, v) of this face on the cube of half width 1. Exact: components are only permuted
    /// and negated, so a point on a shared edge has the same bits from either face.
    #[must_use]
    pub fn cube_point(self, u: f64, v: f64) -> DVec3 {
        let mut point = DVec3::ZERO;
        for ((axis, sign), value) in self.axes().iter().zip([u, v, 1.0]) {
            point[*axis] = *sign as f64 * value;
        }
        point
    }

    /// The face that a direction falls on; ties go to the lowest number.
    #[must_use]
    pub fn of_direction(direction: DVec3) -> Self {
        let size = direction.abs();
        let largest = size.max_element();
        for face in FACES {
            let (axis, sign) = face.axes()[2];
            if size[axis] == largest && (direction[axis] > 0.0) == (sign > 0) {
                return face;
            }
        }
        FACES[0]
    }

    /// Cube coordinates (u, v) of a direction that points into this face's half space.
    #[must_use]
    pub fn uv_of(self, direction: DVec3) -> (f64, f64) {
        let [(iu, su), (iv, sv), (iw, sw)] = *self.axes();
        let outward = direction[iw] * sw as f64;
        (
            direction[iu] * su as f64 / outward,
            direction[iv] * sv as f64 / outward,
        )
    }

    /// The integer cube point of (u, v) on a cube of half width `half`.
    pub(crate) fn integer_point(self, u: i64, v: i64, half: i64) -> [i64; 3] {
        let mut point = [0; 3];
        for ((axis, sign), value) in self.axes().iter().zip([u, v, half]) {
            point[*axis] = sign * value;
        }
        point
    }

    /// The coordinates (u, v) of an integer cube point of this face.
    pub(crate) fn integer_uv(self, point: [i64; 3]) -> (i64, i64) {
        let [(iu, su), (iv, sv), _] = *self.axes();
        (point[iu] * su, point[iv] * sv)
    }

    /// The lowest-numbered face that an integer cube point lies on; `None` inside the cube.
    pub(crate) fn of_integer_point(point: [i64; 3], half: i64) -> Option<Self> {
        FACES.into_iter().find(|face| {
            let (axis, sign) = face.axes()[2];
            point[axis] == sign * half
        })
    }

    /// Folds a point that may lie beyond this face's edges, in its own plane, around the cube's edges
    /// onto the cube: first along u, then along v. Steps beyond an edge become steps down the next face.
    pub(crate) fn fold(self, u: i64, v: i64, half: i64) -> [i64; 3] {
        let [(iu, su), (iv, sv), (iw, sw)] = *self.axes();
        let mut point = self.integer_point(u.clamp(-half, half), v, half);
        let beyond_u = u.abs() - half;
        let beyond_v = v.abs() - half;
        let mut outward = (iw, sw);
        if beyond_u > 0 {
            point[iw] = sw * (half - beyond_u);
            outward = (iu, su * u.signum());
        }
        if beyond_v > 0 {
            point[iv] = sv * v.signum() * half;
            point[outward.0] = outward.1 * (half - beyond_v);
        }
        point
    }
}

/// Cell space to cube space, S2's quadratic projection. Exactly odd about s = ½ for dyadic s.
#[must_use]
pub fn st_to_uv(s: f64) -> f64 {
    if s >= 0.5 {
        (4.0 * s * s - 1.0) / 3.0
    } else {
        let r = 1.0 - s;
        (1.0 - 4.0 * r * r) / 3.0
    }
}

/// Cube space to cell space, the inverse of [`st_to_uv`].
#[must_use]
pub fn uv_to_st(u: f64) -> f64 {
    if u >= 0.0 {
        0.5 * (1.0 + 3.0 * u).sqrt()
    } else {
        1.0 - 0.5 * (1.0 - 3.0 * u).sqrt()
    }
}
