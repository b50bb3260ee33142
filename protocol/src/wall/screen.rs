//! Screens: the surfaces in the room that pictures fall on.
//! Plain data of a wall; what a screen looks like from a head is in `geometry.rs`.

use serde::{Deserialize, Serialize};

/// A screen. It is one canvas: a picture of `size_px` from which channels are cut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Screen {
    /// Unique among the screens.
    pub name: String,
    /// Index into [`super::Wall::observers`].
    pub observer: usize,
    /// Where the canvas is in the room.
    pub shape: ScreenShape,
    /// Width and height of the canvas in pixels, each 1…16384. On a planar screen pixels are square within 2 %.
    pub size_px: [u32; 2],
}

/// The surface that a canvas lies on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ScreenShape {
    /// A rectangle.
    Planar(PlanarCorners),
    /// A part of a cylinder, seen from inside.
    Cylinder {
        /// A point of the axis, in room metres. Heights count from it.
        foot_m: [f64; 3],
        /// Direction of the axis, up.
        axis: [f64; 3],
        /// In metres.
        radius_m: f64,
        /// Which part, and where on it pixels lie.
        canvas: CylinderCanvas,
    },
    /// A part of a sphere, seen from inside.
    Sphere {
        /// In room metres.
        centre_m: [f64; 3],
        /// In metres.
        radius_m: f64,
        /// How far the front is lowered, in degrees.
        tilt_deg: f64,
        /// Which part, and where on it pixels lie.
        canvas: SphereCanvas,
    },
    /// Points that a file gives.
    Surface {
        /// An OBJ or PFM file, as nodes find it.
        file: String,
        /// Metres in a unit of the file, > 0.
        unit_m: f64,
    },
}

/// Three corners of a rectangle in room metres, as its observer sees them; the fourth follows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanarCorners {
    /// Lower left corner.
    pub bottom_left: [f64; 3],
    /// Lower right corner.
    pub bottom_right: [f64; 3],
    /// Upper left corner.
    pub top_left: [f64; 3],
}

/// Where the pixels of a canvas lie on a cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum CylinderCanvas {
    /// Columns are equal angles, rows equal heights.
    Arc {
        /// From the left edge to the right one: 0 is straight ahead (−z), positive is to the right (+x).
        azimuth_deg: [f64; 2],
        /// From the lower edge to the upper one, along the axis.
        height_m: [f64; 2],
    },
    /// Pixels lie where they do on the plane of three corners, along rays from a point.
    Chord {
        /// The plane's rectangle, its corners on the cylinder.
        corners_m: PlanarCorners,
        /// Where the rays come from: the place from which projectors were aligned.
        aligned_from_m: [f64; 3],
    },
}

/// Where the pixels of a canvas lie on a sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SphereCanvas {
    /// The angle from the tilted zenith grows with the distance from the middle of the square canvas; the front is at
    /// its bottom. Beyond the circle there is nothing.
    Fisheye {
        /// The angle across the whole circle, up to 360.
        field_deg: f64,
    },
    /// Columns and rows are equal angles.
    Grid {
        /// From left to right, as on a cylinder.
        azimuth_deg: [f64; 2],
        /// From the lower edge to the upper one, above the tilted horizon.
        elevation_deg: [f64; 2],
    },
}
