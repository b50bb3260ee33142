//! Why a shape is refused: what is wrong with which measure, and what to do about it.
//! In: measures that make no screen. Out: errors that name the key of a wall file. It checks nothing itself.

use thiserror::Error;

/// Why a shape is no screen.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ShapeError {
    /// Not a number, infinite, or farther than a room reaches.
    #[error("{key} is not a place in a room; write finite numbers, at most 10 km from the origin")]
    NotInRoom {
        /// The key of the wall file.
        key: &'static str,
    },
    /// Corners that coincide or lie on one line.
    #[error(
        "the corners span {width_m} m by {height_m} m, so the screen has no area; write three different corners"
    )]
    NoArea {
        /// Length of the lower edge.
        width_m: f64,
        /// Length of the left edge.
        height_m: f64,
    },
    /// Edges that are not at right angles.
    #[error(
        "the corners do not form a rectangle: the lower and the left edge are off a right angle by {aside_mm:.1} mm, at most 1 mm is allowed; measure them again"
    )]
    NotARectangle {
        /// How far the shorter edge's end lies beside the corner of a rectangle.
        aside_mm: f64,
    },
    /// A radius that no screen has.
    #[error("a radius of {radius_m} m is out of range; write 0.01 to 10000 m")]
    Radius {
        /// As given.
        radius_m: f64,
    },
    /// An axis without a direction.
    #[error("the axis has no direction; write a vector along it, for example [0.0, 1.0, 0.0]")]
    NoAxis,
    /// An axis for which no azimuth is straight ahead.
    #[error(
        "the axis points within 3° of the z axis, so no azimuth is straight ahead; turn the room's axes, or give the screen as a surface of points"
    )]
    AxisAhead,
    /// Angles that run backwards, or not at all.
    #[error(
        "the angles run from {from_deg}° to {to_deg}°, so the picture would be {effect}; write the smaller one first ({remedy})"
    )]
    AngleOrder {
        /// The key of the wall file.
        key: &'static str,
        /// The first one.
        from_deg: f64,
        /// The second one.
        to_deg: f64,
        /// What the viewers would see.
        effect: &'static str,
        /// Which edge the first one belongs to.
        remedy: &'static str,
    },
    /// Angles outside what they can be.
    #[error("{degrees}° is out of range; write {lowest} to {highest}{note}")]
    AngleRange {
        /// The key of the wall file.
        key: &'static str,
        /// As given.
        degrees: f64,
        /// The least that is allowed.
        lowest: f64,
        /// The most that is allowed.
        highest: f64,
        /// What the limit is about.
        note: &'static str,
    },
    /// Heights that run downwards, or not at all.
    #[error(
        "the heights run from {from_m} m to {to_m} m; write the lower edge first, at least 1 mm below the upper one"
    )]
    HeightOrder {
        /// The first one.
        from_m: f64,
        /// The second one.
        to_m: f64,
    },
    /// A corner that is not on the surface.
    #[error(
        "the corner {corner} is {off_mm:.1} mm off the cylinder, at most 1 % of its radius is allowed; correct corners_m, radius_m, foot_m or axis"
    )]
    CornerOffSurface {
        /// Which one.
        corner: &'static str,
        /// Distance to the surface.
        off_mm: f64,
    },
    /// A place of alignment from which rays do not meet the surface from inside.
    #[error(
        "aligned_from_m is {distance_m:.3} m from the axis of a cylinder with a radius of {radius_m} m; write a place inside it"
    )]
    AlignedOutside {
        /// Distance from the axis.
        distance_m: f64,
        /// Of the cylinder.
        radius_m: f64,
    },
    /// Corners that are left-handed for the place of alignment.
    #[error(
        "aligned_from_m is not in front of the plane of the corners (at {distance_m:.3} m, at least 0.01 m is needed): they are left-handed; name them as seen from there (exchange left and right), or move it"
    )]
    LeftHanded {
        /// Signed distance from the plane.
        distance_m: f64,
    },
    /// A plane that bulges out of the cylinder, so that a part of the canvas has no place on it.
    #[error(
        "the plane of the corners leaves the cylinder at its upper right corner by {off_mm:.1} mm; its lower and upper edges must be chords of it"
    )]
    ChordOutside {
        /// Distance from the surface, outwards.
        off_mm: f64,
    },
    /// Fewer or more points than width × height.
    #[error("{width} × {height} points are announced, but {count} are there; write the file anew")]
    PointCount {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// How many there are.
        count: usize,
    },
    /// A grid that is too small or too large.
    #[error(
        "a surface of {width} × {height} points is out of range; write 2 to 16384 a side, at most 67108864 in all"
    )]
    PointSize {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A point that is infinite or farther than a room reaches.
    #[error(
        "the point in column {column}, row {row} (from 0, from the upper left) is infinite or more than 10 km away; correct it or the unit, or write NaN where nothing is"
    )]
    PointNotInRoom {
        /// From the left.
        column: usize,
        /// From the top.
        row: usize,
    },
    /// No four neighbouring points that span an area.
    #[error(
        "no four neighbouring points are there and span an area, so the surface shows nothing; write the file anew"
    )]
    NoSurface,
}

impl ShapeError {
    /// The key of the screen in a wall file that is to be corrected.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Self::NotInRoom { key }
            | Self::AngleOrder { key, .. }
            | Self::AngleRange { key, .. } => key,
            Self::NoArea { .. }
            | Self::NotARectangle { .. }
            | Self::CornerOffSurface { .. }
            | Self::ChordOutside { .. } => "corners_m",
            Self::Radius { .. } => "radius_m",
            Self::NoAxis | Self::AxisAhead => "axis",
            Self::HeightOrder { .. } => "height_m",
            Self::AlignedOutside { .. } | Self::LeftHanded { .. } => "aligned_from_m",
            Self::PointCount { .. }
            | Self::PointSize { .. }
            | Self::PointNotInRoom { .. }
            | Self::NoSurface => "file",
        }
    }
}
