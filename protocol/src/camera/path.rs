//! Smooth flight through keyframes. In: keyframes, a time. Out: a pose.
//!
//! Every quantity is a cubic in Bézier form through the keyframes, with one tangent at each keyframe, so
//! position, height and orientation have no jump in speed:
//! - the geodetic normal by de Casteljau's algorithm on the sphere, every step along a great circle
//!   (K. Shoemake, "Animating Rotation with Quaternion Curves", 1985, §4),
//! - the altitude as asinh(altitude / 100 m): logarithmic above some hundred metres, and defined below 0,
//! - the orientation by the same algorithm on quaternions, after both keyframes' orientations were
//!   carried along great circles to the current position. Carrying needs no north, so poles are ordinary.
//!
//! Tangents are limited (after Fritsch and Carlson, 1980) so that nothing overshoots; at the ends of a
//! path that is not looped, the flight starts and stops softly.

use geodesy::Ellipsoid;
use glam::{DQuat, DVec3};

use super::{Keyframe, Path, Place, Pose};

/// Below about this altitude in metres, flight in height is linear, above it is logarithmic.
const LINEAR_ALTITUDE_M: f64 = 100.0;
/// Most that a tangent may be of the slower neighbouring segment's mean speed.
const STEEPEST: f64 = 1.5;

/// What is interpolated at a keyframe.
#[derive(Clone, Copy)]
struct Knot {
    time_s: f64,
    normal: DVec3,
    height: f64,
    orientation: DQuat,
}

/// Speeds at a keyframe, per second.
#[derive(Clone, Copy, Default)]
struct Speeds {
    normal: DVec3,
    height: f64,
    turn: DVec3,
}

impl Path {
    /// The pose at a time; at a keyframe's time, exactly that of its place.
    pub(super) fn pose(&self, planet: &Ellipsoid, time_s: f64) -> Pose {
        let (Some(first), Some(last)) = (self.keyframes.first(), self.keyframes.last()) else {
            return RESTING.pose(planet);
        };
        let duration_s = last.time_s - first.time_s;
        let time_s = if self.looped && duration_s > 0.0 {
            first.time_s + (time_s - first.time_s).rem_euclid(duration_s)
        } else {
            time_s.clamp(first.time_s, last.time_s)
        };
        let after = self
            .keyframes
            .partition_point(|keyframe| keyframe.time_s <= time_s);
        let before = after.saturating_sub(1);
        let Some(keyframe) = self.keyframes.get(before) else {
            return first.place.pose(planet);
        };
        if keyframe.time_s == time_s || after >= self.keyframes.len() {
            return keyframe.place.pose(planet);
        }
        let (Some(start), Some(end)) = (self.knot(before as isize), self.knot(after as isize))
        else {
            return keyframe.place.pose(planet);
        };
        let speed_at_start = self.speeds(before as isize, &start);
        let speed_at_end = self.speeds(after as isize, &end);
        interpolate(
            planet,
            (&start, &speed_at_start),
            (&end, &speed_at_end),
            time_s,
        )
    }

    /// The knot of a keyframe. On a looped path, indices beyond the ends go round; the last keyframe
    /// repeats the first.
    fn knot(&self, index: isize) -> Option<Knot> {
        let count = self.keyframes.len() as isize;
        if (0..count).contains(&index) {
            return self.keyframes.get(index as usize).map(Knot::new);
        }
        if !self.looped || count < 2 {
            return None;
        }
        let duration_s = self.keyframes.last()?.time_s - self.keyframes.first()?.time_s;
        let turns = index.div_euclid(count - 1);
        let keyframe = self.keyframes.get(index.rem_euclid(count - 1) as usize)?;
        let knot = Knot::new(keyframe);
        Some(Knot {
            time_s: knot.time_s + turns as f64 * duration_s,
            ..knot
        })
    }

    fn speeds(&self, index: isize, knot: &Knot) -> Speeds {
        let (Some(previous), Some(next)) = (self.knot(index - 1), self.knot(index + 1)) else {
            return Speeds::default();
        };
        let before_s = knot.time_s - previous.time_s;
        let after_s = next.time_s - knot.time_s;
        let turn = |other: &Knot| {
            let carried = carry(other.normal, knot.normal) * other.orientation;
            shortest(knot.orientation.conjugate() * carried).to_scaled_axis()
        };
        let height = limited(
            DVec3::X * ((knot.height - previous.height) / before_s),
            DVec3::X * ((next.height - knot.height) / after_s),
            before_s,
            after_s,
        );
        Speeds {
            normal: limited(
                -way(knot.normal, previous.normal) / before_s,
                way(knot.normal, next.normal) / after_s,
                before_s,
                after_s,
            ),
            height: height.x,
            turn: limited(
                -turn(&previous) / before_s,
                turn(&next) / after_s,
                before_s,
                after_s,
            ),
        }
    }
}

/// What a path without keyframes shows. No validated path is one.
const RESTING: Place = Place {
    latitude_deg: 0.0,
    longitude_deg: 0.0,
    altitude_m: 1e7,
    heading_deg: 0.0,
    pitch_deg: -90.0,
    roll_deg: 0.0,
};

impl Knot {
    fn new(keyframe: &Keyframe) -> Self {
        let place = &keyframe.place;
        Self {
            time_s: keyframe.time_s,
            normal: place.normal(),
            height: (place.altitude_m / LINEAR_ALTITUDE_M).asinh(),
            orientation: place.orientation(),
        }
    }
}

fn interpolate(
    planet: &Ellipsoid,
    (start, speed_at_start): (&Knot, &Speeds),
    (end, speed_at_end): (&Knot, &Speeds),
    time_s: f64,
) -> Pose {
    let duration_s = end.time_s - start.time_s;
    let t = (time_s - start.time_s) / duration_s;
    let third_s = duration_s / 3.0;
    let normal = de_casteljau(
        [
            start.normal,
            go(start.normal, speed_at_start.normal * third_s),
            go(end.normal, -speed_at_end.normal * third_s),
            end.normal,
        ],
        t,
        slerp_normals,
    );
    let height = de_casteljau(
        [
            start.height,
            start.height + speed_at_start.height * third_s,
            end.height - speed_at_end.height * third_s,
            end.height,
        ],
        t,
        |a, b, t| a + (b - a) * t,
    );
    // One sign for the whole segment: choosing the shorter way anew at every moment could jump.
    let across = carry(start.normal, end.normal);
    let same_side = (across * start.orientation).dot(end.orientation) >= 0.0;
    let end_orientation = if same_side {
        end.orientation
    } else {
        -end.orientation
    };
    let from_start = carry(start.normal, normal);
    let from_end = carry(end.normal, normal);
    let turned = |orientation, turn| orientation * DQuat::from_scaled_axis(turn);
    let orientation = de_casteljau(
        [
            from_start * start.orientation,
            from_start * turned(start.orientation, speed_at_start.turn * third_s),
            from_end * turned(end_orientation, -speed_at_end.turn * third_s),
            from_end * end_orientation,
        ],
        t,
        slerp_same_side,
    );
    Pose::new(
        planet.point(normal, height.sinh() * LINEAR_ALTITUDE_M),
        orientation,
    )
}

/// A point of the cubic Bézier curve with these control points.
fn de_casteljau<T: Copy>([a, b, c, d]: [T; 4], t: f64, mix: impl Fn(T, T, f64) -> T) -> T {
    let (ab, bc, cd) = (mix(a, b, t), mix(b, c, t), mix(c, d, t));
    mix(mix(ab, bc, t), mix(bc, cd, t), t)
}

/// The rotation along the great circle from one unit vector to another, at most 150° or so away. Exact
/// for the smallest angles, so that motion is smooth near keyframes.
fn carry(from: DVec3, to: DVec3) -> DQuat {
    let axis = from.cross(to);
    let rotation = DQuat::from_xyzw(axis.x, axis.y, axis.z, 1.0 + from.dot(to));
    if rotation.length_squared() > 1e-12 {
        rotation.normalize()
    } else {
        DQuat::IDENTITY
    }
}

/// The mean of the speeds before and after a knot, weighted towards the shorter segment; zero where
/// the direction turns back, and never much faster than the slower of the two.
fn limited(before: DVec3, after: DVec3, before_s: f64, after_s: f64) -> DVec3 {
    if before.dot(after) <= 0.0 {
        return DVec3::ZERO;
    }
    let mean = (before * after_s + after * before_s) / (before_s + after_s);
    mean.clamp_length_max(STEEPEST * before.length().min(after.length()))
}

/// The tangent at unit vector `from` that leads to `to`: its length is the angle between them.
fn way(from: DVec3, to: DVec3) -> DVec3 {
    let aside = to - from * from.dot(to);
    let sine = aside.length();
    if sine == 0.0 {
        return DVec3::ZERO;
    }
    aside * (sine.atan2(from.dot(to)) / sine)
}

/// The unit vector reached from `from` along a tangent; the inverse of [`way`].
fn go(from: DVec3, tangent: DVec3) -> DVec3 {
    let angle = tangent.length();
    if angle == 0.0 {
        return from;
    }
    (from * angle.cos() + tangent * (angle.sin() / angle)).normalize()
}

fn slerp_normals(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    go(a, way(a, b) * t)
}

/// Of the two quaternions of a rotation, the one that turns by at most 180°.
fn shortest(rotation: DQuat) -> DQuat {
    if rotation.w < 0.0 {
        -rotation
    } else {
        rotation
    }
}

/// Spherical interpolation that keeps the signs it is given.
fn slerp_same_side(a: DQuat, b: DQuat, t: f64) -> DQuat {
    let cosine = a.dot(b).clamp(-1.0, 1.0);
    let angle = cosine.acos();
    let sine = angle.sin();
    if sine < 1e-6 {
        return (a * (1.0 - t) + b * t).normalize();
    }
    let (first, second) = (((1.0 - t) * angle).sin() / sine, (t * angle).sin() / sine);
    (a * first + b * second).normalize()
}
