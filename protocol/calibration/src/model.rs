//! The neutral form of a calibration.
//! In: nothing. Out: what each output pixel shows, with conventions that hold for every format. It knows no
//! format and no bytes.

use crate::grid::Grid;
use crate::map::Map;

/// All regions of a file, or the one that was chosen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    /// The regions in the order of the file, at least one after reading.
    pub regions: Vec<Region>,
    /// When it was made, as the file says; empty where it does not.
    pub date: String,
    /// What the file has and this form cannot carry, and what had to be assumed, in sentences.
    pub notes: Vec<String>,
}

/// What one output, or one part of it, shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Its name; empty where the format has none.
    pub name: String,
    /// Size of the output in pixels, 1…16384.
    pub size_px: [u32; 2],
    /// What its pixels show.
    pub mapping: Mapping,
    /// Share of the light that a pixel gives, 0…1, for blending; `None`: all of it. The light is
    /// `value ^ gamma.alpha`.
    pub alpha: Option<Map>,
    /// Black level: light to which a pixel is lifted, 0…1, so that dark areas match where projectors
    /// overlap. The light is `value ^ gamma.beta`. See [`Uplift`].
    pub beta: Option<Map>,
    /// Exponents from the values of the maps to light.
    pub gamma: Gamma,
    /// How the black level is applied.
    pub uplift: Uplift,
    /// Where the region's picture lies on the whole canvas; `None` where the format has no canvas.
    pub canvas: Option<CanvasPlace>,
    /// Only MPCDI's `sl`: a further mapping of output pixels to places in the picture that the projector's
    /// frustum shows, for its lens: u to the right, v down, 0…1; holes are NaN.
    pub distortion: Option<Grid<[f32; 2]>>,
}

/// What the pixels of a region show. In a `uv`, u goes to the right and v **down** from the upper left
/// corner of the source picture, 0…1. NaN, or a place outside 0…1: nothing is shown.
#[derive(Clone, Debug, PartialEq)]
pub enum Mapping {
    /// Places in the region's picture, which lies on the canvas at [`Region::canvas`].
    Canvas(Grid<[f32; 2]>),
    /// Places in a picture that is rendered through this frustum from the middle of the screen.
    Frustum {
        /// The frustum.
        frustum: Frustum,
        /// Places in its picture.
        uv: Grid<[f32; 2]>,
    },
    /// Points of the screen.
    Points {
        /// The points in metres; x to the right, y up, z towards the viewers, from `origin`; holes are NaN.
        points_m: Grid<[f32; 3]>,
        /// Where they count from.
        origin: PointOrigin,
        /// The projector that lights them, where the file has it (MPCDI's `sl`).
        projector: Option<Box<Projector>>,
    },
    /// Every pixel shows its own place in the source picture.
    Identity,
}

/// A viewing frustum. Yaw, then pitch, then roll turn a look along −z: positive yaw to the **right**,
/// positive pitch up, positive roll raises the left side. As a rotation of a right-handed frame with y up:
/// `R_y(−yaw) · R_x(pitch) · R_z(−roll)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frustum {
    /// Turn to the right in degrees.
    pub yaw_deg: f64,
    /// Turn up in degrees.
    pub pitch_deg: f64,
    /// Turn about the look in degrees, raising the left side.
    pub roll_deg: f64,
    /// The left edge, usually negative, in degrees, −90…90.
    pub left_deg: f64,
    /// The right edge in degrees, larger than the left.
    pub right_deg: f64,
    /// The upper edge in degrees.
    pub up_deg: f64,
    /// The lower edge, usually negative, in degrees, smaller than the upper.
    pub down_deg: f64,
}

/// Where points count from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointOrigin {
    /// The file does not tell.
    #[default]
    Unknown,
    /// The centre of mass of the screen.
    CentreOfMass,
    /// The eye for which the screen was made.
    IdealEyePoint,
    /// The middle of the floor.
    FloorCentre,
}

/// A projector in the room.
#[derive(Clone, Debug, PartialEq)]
pub struct Projector {
    /// Its place in metres, in the frame of the points.
    pub position_m: [f64; 3],
    /// Where it looks and how wide.
    pub frustum: Frustum,
    /// The axes of the file's coordinates, from which points and position were turned.
    pub axes: Axes,
}

/// Axes of a file's coordinates, as unit vectors in these coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// The yaw axis: down.
    pub yaw: [f64; 3],
    /// The pitch axis: to the right.
    pub pitch: [f64; 3],
    /// The roll axis: ahead, towards the screen.
    pub roll: [f64; 3],
}

impl Axes {
    /// The axes of this form: x to the right, y up, z towards the viewers.
    pub const ROOM: Self = Self {
        yaw: [0.0, -1.0, 0.0],
        pitch: [1.0, 0.0, 0.0],
        roll: [0.0, 0.0, -1.0],
    };

    /// A point of the file in this form's frame. Adding 0 makes −0 to 0.
    #[must_use]
    pub fn to_room(&self, point: [f64; 3]) -> [f64; 3] {
        let along = |axis: [f64; 3]| -> f64 {
            axis.iter()
                .zip(point)
                .map(|(share, value)| share * value)
                .sum()
        };
        [
            along(self.pitch) + 0.0,
            0.0 - along(self.yaw),
            0.0 - along(self.roll),
        ]
    }

    /// A point of this form's frame in the file's coordinates. The inverse of [`Axes::to_room`] where the
    /// axes are orthonormal.
    #[must_use]
    pub fn from_room(&self, point: [f64; 3]) -> [f64; 3] {
        let [right, up, back] = point;
        let mut turned = [0.0; 3];
        for (place, ((pitch, yaw), roll)) in turned
            .iter_mut()
            .zip(self.pitch.iter().zip(self.yaw).zip(self.roll))
        {
            *place = right * pitch - up * yaw - back * roll + 0.0;
        }
        turned
    }

    /// Whether they are unit vectors at right angles, within 0.001. Left-handed coordinates are allowed.
    #[must_use]
    pub fn are_orthonormal(&self) -> bool {
        let dot = |a: [f64; 3], b: [f64; 3]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let near = |value: f64, wanted: f64| (value - wanted).abs() <= 1e-3;
        [self.yaw, self.pitch, self.roll]
            .iter()
            .all(|axis| near(dot(*axis, *axis), 1.0))
            && near(dot(self.yaw, self.pitch), 0.0)
            && near(dot(self.pitch, self.roll), 0.0)
            && near(dot(self.roll, self.yaw), 0.0)
    }
}

/// Exponents from the values of the maps to light, larger than 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gamma {
    /// Of the alpha map. 1 where the file has none.
    pub alpha: f32,
    /// Of the beta map. 1 where the file has none.
    pub beta: f32,
}

impl Default for Gamma {
    fn default() -> Self {
        Self {
            alpha: 1.0,
            beta: 1.0,
        }
    }
}

/// How the black level is applied: with black `k`, a colour `c` becomes
/// `max(c · (1 − dark · bright · k) + dark · k, k)`. 1 and 1 lift the whole range, as MPCDI wants it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uplift {
    /// 0: colours below the black are set to it; 1: all are lifted by it.
    pub dark: f32,
    /// 0: what is lifted may exceed 1; 1: it is scaled to stay within.
    pub bright: f32,
}

impl Default for Uplift {
    fn default() -> Self {
        Self {
            dark: 1.0,
            bright: 1.0,
        }
    }
}

/// Where a region's picture lies on the canvas: shares of the canvas from its upper **left** corner, to the
/// right and **down**.
#[derive(Clone, Debug, PartialEq)]
pub struct CanvasPlace {
    /// The left edge.
    pub x: f64,
    /// The upper edge.
    pub y: f64,
    /// The width, larger than 0.
    pub width: f64,
    /// The height, larger than 0.
    pub height: f64,
    /// The canvas's name; a file may have several.
    pub buffer: String,
    /// The canvas's size in pixels, where the file tells it.
    pub size_px: Option<[u32; 2]>,
}
