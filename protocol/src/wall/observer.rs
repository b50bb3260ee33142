//! Observers: who looks at a wall, and where their eyes are.
//! In: heads, resting or tracked. Out: eyes in room metres, by the four basic operations alone, so that all machines
//! compute the same bits. It tracks nobody.

use glam::{DMat3, DVec3, EulerRot};
use serde::{Deserialize, Serialize};

/// The distance between the eyes where a wall file does not state it: the mean of adults (Dodgson 2004).
pub(super) const EYE_SEPARATION_M: f64 = 0.063;

/// A viewer for whom pictures are rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observer {
    /// Unique among the observers.
    pub name: String,
    /// Where the middle between the eyes is while nothing tracks it, in room metres.
    pub head_m: [f64; 3],
    /// How the resting head is turned, in degrees: first to its left about the room's y, then up about its own x, then
    /// counter-clockwise about its own z. Zero looks along −z.
    pub looks_deg: [f64; 3],
    /// From eye to eye in metres, 0…0.2. Channels of one eye are drawn from half of it to the side.
    pub eye_separation_m: f64,
    /// Index into [`super::Wall::trackers`], of what follows the head.
    pub tracker: Option<usize>,
}

/// For which eye a channel is drawn.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub enum Eye {
    /// The middle between the eyes.
    #[default]
    Centre,
    /// The observer's left eye.
    Left,
    /// The observer's right eye.
    Right,
}

/// A head in the room.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// The middle between the eyes, in room metres.
    pub position_m: [f64; 3],
    /// The direction of the head's right, a unit vector in room axes.
    pub right: [f32; 3],
}

/// Who looks at a wall in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Viewers {
    /// Head of each observer, in the wall's order, at most 16.
    pub heads: Vec<Head>,
    /// The most pixels there are to a radian of view anywhere on the wall, seen from these heads. It is the same on all
    /// nodes, > 0.
    pub pixels_per_radian: f64,
}

impl Viewers {
    /// Whether heads are somewhere, and there are pixels.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.pixels_per_radian.is_finite()
            && self.pixels_per_radian > 0.0
            && self.heads.iter().all(Head::is_sound)
    }
}

impl Head {
    /// A head that looks along −z.
    #[must_use]
    pub const fn upright(position_m: [f64; 3]) -> Self {
        Self {
            position_m,
            right: [1.0, 0.0, 0.0],
        }
    }

    /// Where an eye of this head is, in room metres.
    #[must_use]
    pub fn eye_m(&self, eye: Eye, separation_m: f64) -> [f64; 3] {
        let aside = match eye {
            Eye::Centre => return self.position_m,
            Eye::Left => -0.5 * separation_m,
            Eye::Right => 0.5 * separation_m,
        };
        let right = DVec3::from(self.right.map(f64::from));
        (DVec3::from(self.position_m) + right * aside).to_array()
    }

    /// Whether the position is finite and the direction of unit length.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let length_squared: f32 = self.right.iter().map(|part| part * part).sum();
        self.position_m.iter().all(|part| part.is_finite()) && (length_squared - 1.0).abs() < 1e-3
    }
}

impl Observer {
    /// The head while nothing tracks it.
    #[must_use]
    pub fn resting_head(&self) -> Head {
        let [yaw, pitch, roll] = self.looks_deg.map(f64::to_radians);
        let turned = DMat3::from_euler(EulerRot::YXZ, yaw, pitch, roll);
        Head {
            position_m: self.head_m,
            right: turned.x_axis.as_vec3().to_array(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observer(looks_deg: [f64; 3]) -> Observer {
        Observer {
            name: "viewer".to_owned(),
            head_m: [1.0, 1.7, 2.0],
            looks_deg,
            eye_separation_m: 0.06,
            tracker: None,
        }
    }

    #[test]
    fn eyes_stand_half_the_separation_to_each_side_of_a_turned_head() {
        // Looking along −z; to the left, along −x; upright but leaning to the left shoulder.
        let cases = [
            ([0.0, 0.0, 0.0], [0.97, 1.7, 2.0], [1.03, 1.7, 2.0]),
            ([90.0, 0.0, 0.0], [1.0, 1.7, 2.03], [1.0, 1.7, 1.97]),
            ([90.0, 40.0, 0.0], [1.0, 1.7, 2.03], [1.0, 1.7, 1.97]),
            ([0.0, 0.0, 90.0], [1.0, 1.67, 2.0], [1.0, 1.73, 2.0]),
        ];
        for (looks_deg, left, right) in cases {
            let observer = observer(looks_deg);
            let head = observer.resting_head();
            assert!(head.is_sound());
            assert_eq!(
                head.eye_m(Eye::Centre, observer.eye_separation_m),
                observer.head_m
            );
            for (eye, place) in [(Eye::Left, left), (Eye::Right, right)] {
                let found = DVec3::from(head.eye_m(eye, observer.eye_separation_m));
                assert!(
                    found.distance(DVec3::from(place)) < 1e-8,
                    "{looks_deg:?} {eye:?}: {found}"
                );
            }
        }
    }

    #[test]
    fn a_head_without_place_or_direction_is_not_sound() {
        let head = Head::upright([0.0, 1.7, 0.0]);
        assert!(head.is_sound());
        let bad = [
            Head {
                position_m: [0.0, f64::NAN, 0.0],
                ..head
            },
            Head {
                right: [0.9, 0.0, 0.0],
                ..head
            },
            Head {
                right: [f32::NAN, 0.0, 0.0],
                ..head
            },
        ];
        assert!(bad.iter().all(|head| !head.is_sound()));
    }
}
