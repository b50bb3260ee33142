//! Where the viewer is: places in geodetic terms, poses in ECEF, and how a camera moves over time.
//! In: a camera of the scene, a time in seconds. Out: a [`Pose`]. Only the master computes poses, so
//! nodes need no trigonometry and cannot disagree about it.

mod navigator;
mod path;

use geodesy::Ellipsoid;
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

pub use navigator::Navigator;

/// How the viewer moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Camera {
    /// Not at all.
    Fixed(Place),
    /// In circles around a place.
    Orbit(Orbit),
    /// Along keyframes.
    Path(Path),
}

/// Latitude and longitude in degrees of the point (s, t) of a tile, both 0…1 along its sides. `tile` is its number, by
/// which data sets know it; `None` for numbers of no tile.
#[must_use]
pub fn ground_of_tile(tile: u64, [s, t]: [f64; 2]) -> Option<[f64; 2]> {
    let tile = geodesy::Tile::from_id(tile)?;
    let side = (1_u64 << tile.level()) as f64;
    let along = |index: u32, share: f64| geodesy::st_to_uv((f64::from(index) + share) / side);
    let direction = tile
        .face()
        .cube_point(along(tile.x(), s), along(tile.y(), t));
    let (latitude_deg, longitude_deg) = Ellipsoid::angles_deg(direction.normalize());
    Some([latitude_deg, longitude_deg])
}

/// A viewpoint and where it looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Geodetic latitude, −90…90.
    pub latitude_deg: f64,
    /// Longitude, −180…180.
    pub longitude_deg: f64,
    /// Height above the ellipsoid.
    pub altitude_m: f64,
    /// 0 north, 90 east, −360…360. At a pole, north is where the place's meridian points.
    pub heading_deg: f64,
    /// 0 horizontal, −90 straight down, −90…90.
    pub pitch_deg: f64,
    /// Head tilted to the right, −180…180.
    pub roll_deg: f64,
}

/// A circle around the vertical of a place. Over a pole, the planet turns under the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Orbit {
    /// Where the circle starts, and where the viewer looks there.
    pub place: Place,
    /// Latitude of the vertical, −90…90.
    pub centre_latitude_deg: f64,
    /// Longitude of the vertical, −180…180.
    pub centre_longitude_deg: f64,
    /// Speed, counter-clockwise seen from above, −3600…3600.
    pub degrees_per_second: f64,
}

/// A smooth flight through keyframes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// 2…4096 keyframes with rising times. Neighbours are at most 150° of arc apart.
    pub keyframes: Vec<Keyframe>,
    /// Whether it starts again after the last keyframe, which is then the same place as the first.
    pub looped: bool,
}

/// A place and when the viewer is there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Keyframe {
    /// Seconds since the camera's start, ≥ 0.
    pub time_s: f64,
    /// Where the viewer is then.
    pub place: Place,
}

/// Position and orientation in ECEF. `right`, `up` and `back` are orthonormal and right-handed: the
/// room's axes x, y and z laid on the planet. All observers' eyes are at `position_m`; where a head is
/// in the room shapes its frusta and does not move it over the planet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// ECEF metres.
    pub position_m: [f64; 3],
    /// Unit vector of the room's x.
    pub right: [f64; 3],
    /// Unit vector of the room's y.
    pub up: [f64; 3],
    /// Unit vector of the room's z, against the direction of view.
    pub back: [f64; 3],
}

impl Place {
    /// The pose of a viewer at this place.
    #[must_use]
    pub fn pose(&self, planet: &Ellipsoid) -> Pose {
        Pose::new(
            planet.point(self.normal(), self.altitude_m),
            self.orientation(),
        )
    }

    /// The geodetic normal.
    pub(crate) fn normal(&self) -> DVec3 {
        Ellipsoid::normal(self.latitude_deg, self.longitude_deg)
    }

    /// The rotation from room axes to ECEF axes.
    pub(crate) fn orientation(&self) -> DQuat {
        let normal = self.normal();
        let (sin_longitude, cos_longitude) = self.longitude_deg.to_radians().sin_cos();
        // From the longitude and not from the normal: this stays exact at the poles.
        let east = DVec3::new(-sin_longitude, cos_longitude, 0.0);
        let north = normal.cross(east);
        let (sin_heading, cos_heading) = self.heading_deg.to_radians().sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch_deg.to_radians().sin_cos();
        let (sin_roll, cos_roll) = self.roll_deg.to_radians().sin_cos();
        let ahead = north * cos_heading + east * sin_heading;
        let forward = ahead * cos_pitch + normal * sin_pitch;
        let level_right = east * cos_heading - north * sin_heading;
        let level_up = level_right.cross(forward);
        let right = level_right * cos_roll - level_up * sin_roll;
        let up = level_up * cos_roll + level_right * sin_roll;
        DQuat::from_mat3(&DMat3::from_cols(right, up, -forward)).normalize()
    }
}

impl Pose {
    /// A pose from a position in ECEF metres and the rotation from room axes to ECEF axes.
    pub(crate) fn new(position_m: DVec3, orientation: DQuat) -> Self {
        let axes = DMat3::from_quat(orientation.normalize());
        Self {
            position_m: position_m.to_array(),
            right: axes.x_axis.to_array(),
            up: axes.y_axis.to_array(),
            back: axes.z_axis.to_array(),
        }
    }

    /// The rotation from room axes to ECEF axes.
    pub(crate) fn orientation(&self) -> DQuat {
        let axes = DMat3::from_cols(self.right.into(), self.up.into(), self.back.into());
        DQuat::from_mat3(&axes).normalize()
    }

    /// The unit vector of view.
    #[must_use]
    pub fn forward(&self) -> [f64; 3] {
        self.back.map(|component| -component)
    }

    /// Whether all numbers are finite and the axes orthonormal and right-handed within 10⁻⁶.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let [right, up, back] = [self.right, self.up, self.back].map(DVec3::from);
        let close = |value: f64, target: f64| (value - target).abs() < 1e-6;
        self.position_m
            .iter()
            .all(|component| component.is_finite())
            && close(right.length_squared(), 1.0)
            && close(up.length_squared(), 1.0)
            && close(right.dot(up), 0.0)
            && right.cross(up).distance(back) < 1e-6
    }
}

impl Camera {
    /// The pose at `time_s` seconds after the camera's start. Before the first and after the last
    /// keyframe of a path that is not looped, the viewer rests there.
    #[must_use]
    pub fn pose(&self, planet: &Ellipsoid, time_s: f64) -> Pose {
        match self {
            Self::Fixed(place) => place.pose(planet),
            Self::Orbit(orbit) => orbit.pose(planet, time_s),
            Self::Path(path) => path.pose(planet, time_s),
        }
    }

    /// After how many seconds the camera has come to rest; `None` if it never does.
    #[must_use]
    pub fn rests_after_s(&self) -> Option<f64> {
        match self {
            Self::Fixed(_) => Some(0.0),
            Self::Orbit(orbit) => (orbit.degrees_per_second == 0.0).then_some(0.0),
            Self::Path(path) if path.looped => None,
            Self::Path(path) => Some(path.keyframes.last().map_or(0.0, |last| last.time_s)),
        }
    }
}

impl Orbit {
    fn pose(&self, planet: &Ellipsoid, time_s: f64) -> Pose {
        let axis = Ellipsoid::normal(self.centre_latitude_deg, self.centre_longitude_deg);
        let centre = planet.point(axis, 0.0);
        let angle_deg = (self.degrees_per_second * time_s) % 360.0;
        let turn = DQuat::from_axis_angle(axis, angle_deg.to_radians());
        let start = planet.point(self.place.normal(), self.place.altitude_m);
        Pose::new(
            centre + turn * (start - centre),
            turn * self.place.orientation(),
        )
    }
}
