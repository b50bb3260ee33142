//! The one place where f64 becomes f32, and where positions become exact fixed point.
//! In: ECEF metres in f64. Out: 64-bit fixed-point positions that a GPU subtracts without rounding, and
//! f32 matrices and vectors that are already relative to a viewer or dimensionless.

use glam::{DMat4, DVec3, Mat4, Vec3};

/// Fixed-point steps in a metre: 2^20, about one micrometre each.
pub const STEPS_PER_M: f64 = 1_048_576.0;

/// An ECEF position in whole steps of 2^-20 m. Two tiles that share a point hold the same integers, and
/// the difference of two such points is exact in 64-bit integers, on a CPU and on any GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FixedPoint(pub [i64; 3]);

impl FixedPoint {
    /// The nearest fixed point to ECEF metres. Saturates beyond 8.7·10^12 m.
    #[must_use]
    #[inline]
    pub fn from_ecef(position: DVec3) -> Self {
        // Adding 1.5·2^52 leaves no bits for a fraction, so the addition itself rounds, ties to even. A
        // library call would cost more than the rest of a vertex.
        const INTEGERS_ONLY: f64 = 6_755_399_441_055_744.0;
        let round = |c: f64| {
            if c.abs() < 1_125_899_906_842_624.0 {
                ((c + INTEGERS_ONLY) - INTEGERS_ONLY) as i64
            } else {
                c.round_ties_even() as i64
            }
        };
        Self((position * STEPS_PER_M).to_array().map(round))
    }

    /// Back to ECEF metres.
    #[must_use]
    pub fn to_ecef(self) -> DVec3 {
        let [x, y, z] = self.0;
        DVec3::new(x as f64, y as f64, z as f64) / STEPS_PER_M
    }

    /// Low and high 32-bit words of x, y, z: (x low, x high, y low, y high, z low, z high).
    #[must_use]
    #[inline]
    pub fn words(self) -> [u32; 6] {
        let [x, y, z] = self.0.map(|c| c as u64);
        [
            x as u32,
            (x >> 32) as u32,
            y as u32,
            (y >> 32) as u32,
            z as u32,
            (z >> 32) as u32,
        ]
    }

    /// The vector from `viewer` to this point in metres, computed as the vertex shader does: an exact
    /// integer difference as sign and magnitude, its high and low words to f32, then their sum. The
    /// error is that of one f32 rounding: relative to the distance, whatever the distance.
    #[must_use]
    pub fn relative_to(self, viewer: Self) -> Vec3 {
        let component = |a: i64, b: i64| {
            let difference = a.wrapping_sub(b);
            let magnitude = difference.unsigned_abs();
            let metres = ((magnitude >> 32) as f32) * 4096.0
                + (magnitude as u32 as f32) * (1.0 / 1_048_576.0);
            if difference < 0 { -metres } else { metres }
        };
        let ([ax, ay, az], [bx, by, bz]) = (self.0, viewer.0);
        Vec3::new(component(ax, bx), component(ay, by), component(az, bz))
    }
}

/// A matrix for the GPU. It must hold no absolute position: rotation and projection only.
#[must_use]
pub fn matrix_f32(matrix: DMat4) -> Mat4 {
    matrix.as_mat4()
}

/// A dimensionless or viewer-relative vector for the GPU.
#[must_use]
pub fn vector_f32(vector: DVec3) -> Vec3 {
    vector.as_vec3()
}

/// A dimensionless or small number for the GPU.
#[must_use]
pub fn scalar_f32(number: f64) -> f32 {
    number as f32
}
