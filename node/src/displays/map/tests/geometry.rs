//! A projector in front of a screen, by hand: which point each place in its picture lights.
//! In: places in pictures, points. Out: the other one. It uses nothing of the code under test.

use glam::DVec3;

/// Pixels of the output, those of the projector.
pub(super) const SIZE_PX: [u32; 2] = [96, 72];
/// Pixels of the canvas.
pub(super) const CANVAS_PX: [u32; 2] = [480, 360];
/// The head for which calibrations are made: metres in the room.
pub(super) const HEAD_M: [f64; 3] = [0.2, 1.6, 0.4];
/// Radius of the cylinder, whose axis is the room's y axis, in metres.
pub(super) const RADIUS_M: f64 = 2.5;
/// Azimuths of the cylinder's canvas in degrees, from straight ahead to the right.
pub(super) const AZIMUTH_DEG: [f64; 2] = [-50.0, 40.0];
/// Heights of the cylinder's canvas in metres.
pub(super) const HEIGHT_M: [f64; 2] = [0.3, 3.1];

/// What the projector lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Surface {
    /// A rectangle of 4 m × 3 m that is turned by 20° about its left edge.
    Plane,
    /// A part of a cylinder.
    Cylinder,
}

/// A projector and what it lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    pub(super) surface: Surface,
    /// Strength of the lens's distortion: 0 for none.
    pub(super) lens: f64,
}

/// Both surfaces with an ideal lens.
pub(super) const SETTINGS: [Setting; 2] = [
    Setting {
        surface: Surface::Plane,
        lens: 0.0,
    },
    Setting {
        surface: Surface::Cylinder,
        lens: 0.0,
    },
];

/// Lower left corner, direction to the right, upwards, of the plane.
pub(super) fn plane() -> [DVec3; 3] {
    let (sine, cosine) = 20_f64.to_radians().sin_cos();
    [
        DVec3::new(-1.9, 0.3, -2.6),
        DVec3::new(cosine, 0.0, sine),
        DVec3::Y,
    ]
}

impl Surface {
    /// The screen's keys in a wall file.
    pub(super) fn screen(self) -> String {
        match self {
            Self::Plane => {
                let [corner, right, up] = plane();
                let corners = [corner, corner + right * 4.0, corner + up * 3.0];
                let [left, right, top] = corners.map(|corner| corner.to_array());
                format!(
                    "kind = \"planar\"\ncorners_m = {{ bottom_left = {left:?}, bottom_right = {right:?}, top_left = {top:?} }}"
                )
            }
            Self::Cylinder => format!(
                "kind = \"cylinder\"\nfoot_m = [0.0, 0.0, 0.0]\nradius_m = {RADIUS_M:?}\nazimuth_deg = {AZIMUTH_DEG:?}\nheight_m = {HEIGHT_M:?}"
            ),
        }
    }

    /// Where a ray meets the surface, going on beyond the canvas.
    pub(super) fn met_m(self, from_m: DVec3, direction: DVec3) -> Option<DVec3> {
        let distance = match self {
            Self::Plane => {
                let [corner, right, up] = plane();
                let normal = right.cross(up);
                (corner - from_m).dot(normal) / direction.dot(normal)
            }
            Self::Cylinder => {
                // (x + t u)² + (z + t w)² = r², the later meeting: the projector stands inside.
                let square = direction.x * direction.x + direction.z * direction.z;
                let half = from_m.x * direction.x + from_m.z * direction.z;
                let rest = from_m.x * from_m.x + from_m.z * from_m.z - RADIUS_M * RADIUS_M;
                (-half + (half * half - square * rest).sqrt()) / square
            }
        };
        (distance > 0.0 && distance.is_finite()).then(|| from_m + direction * distance)
    }

    /// Shares of the canvas from its upper left corner at a point of the surface; beyond 0…1 for points off the canvas.
    pub(super) fn shares(self, point_m: DVec3) -> [f64; 2] {
        match self {
            Self::Plane => {
                let [corner, right, up] = plane();
                let from_corner = point_m - corner;
                [
                    from_corner.dot(right) / 4.0,
                    1.0 - from_corner.dot(up) / 3.0,
                ]
            }
            Self::Cylinder => {
                let azimuth_deg = point_m.x.atan2(-point_m.z).to_degrees();
                let [left, right] = AZIMUTH_DEG;
                let [low, high] = HEIGHT_M;
                [
                    (azimuth_deg - left) / (right - left),
                    (high - point_m.y) / (high - low),
                ]
            }
        }
    }

    /// The point at shares of the canvas.
    pub(super) fn point_m(self, [x, y]: [f64; 2]) -> DVec3 {
        match self {
            Self::Plane => {
                let [corner, right, up] = plane();
                corner + right * (4.0 * x) + up * (3.0 * (1.0 - y))
            }
            Self::Cylinder => {
                let [left, right] = AZIMUTH_DEG;
                let [low, high] = HEIGHT_M;
                let (sine, cosine) = (left + (right - left) * x).to_radians().sin_cos();
                DVec3::new(RADIUS_M * sine, high + (low - high) * y, -RADIUS_M * cosine)
            }
        }
    }
}

impl Setting {
    /// What the lens makes of a place in the picture: shares of the picture that an ideal projector would have.
    pub(super) fn through_lens(&self, place: [f64; 2]) -> [f64; 2] {
        let [x, y] = place.map(|share| share - 0.5);
        let factor = 1.0 + self.lens * (x * x + y * y);
        [0.5 + x * factor, 0.5 + y * factor]
    }

    /// The point that an ideal projector lights at shares of its picture. It stands askew, and is rolled a little.
    pub(super) fn ideal_m(&self, [x, y]: [f64; 2]) -> Option<DVec3> {
        let from_m = DVec3::new(-0.5, 2.4, 0.7);
        let ahead = (DVec3::new(0.1, 1.5, -2.4) - from_m).normalize();
        let level = ahead.cross(DVec3::Y).normalize();
        let right = level * 0.05_f64.cos() + level.cross(ahead) * 0.05_f64.sin();
        let up = right.cross(ahead);
        let direction = ahead + right * (0.42 * (2.0 * x - 1.0)) - up * (0.315 * (2.0 * y - 1.0));
        self.surface.met_m(from_m, direction)
    }

    /// The point of the canvas that the projector lights at shares of its picture. `None` beyond the canvas.
    pub(super) fn lit_m(&self, place: [f64; 2]) -> Option<DVec3> {
        let point_m = self.ideal_m(self.through_lens(place))?;
        let on_canvas = self.surface.shares(point_m);
        on_canvas
            .iter()
            .all(|share| (0.0..=1.0).contains(share))
            .then_some(point_m)
    }
}

/// A direction as a place in the picture of a frustum, right and down from its upper left corner: a pilot first turns to
/// the right by the yaw, then pulls up by the pitch, then rolls, the left wing up (tvaneerd/mpcdi, `MPCDI_explained.md`).
pub(super) fn in_frustum(frustum: &calibration::Frustum, direction: DVec3) -> [f64; 2] {
    let (mut ahead, mut right, mut up) = (DVec3::NEG_Z, DVec3::X, DVec3::Y);
    let (sine, cosine) = frustum.yaw_deg.to_radians().sin_cos();
    (ahead, right) = (ahead * cosine + right * sine, right * cosine - ahead * sine);
    let (sine, cosine) = frustum.pitch_deg.to_radians().sin_cos();
    (ahead, up) = (ahead * cosine + up * sine, up * cosine - ahead * sine);
    let (sine, cosine) = frustum.roll_deg.to_radians().sin_cos();
    (right, up) = (right * cosine - up * sine, up * cosine + right * sine);
    let depth = direction.dot(ahead);
    let (to_right, to_top) = (direction.dot(right) / depth, direction.dot(up) / depth);
    let edge = |degrees: f64| degrees.to_radians().tan();
    [
        (to_right - edge(frustum.left_deg)) / (edge(frustum.right_deg) - edge(frustum.left_deg)),
        (edge(frustum.up_deg) - to_top) / (edge(frustum.up_deg) - edge(frustum.down_deg)),
    ]
}
