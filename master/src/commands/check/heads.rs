//! What is odd about heads: where they are, what they see from behind, how far apart their eyes are, what tracks them.
//!
//! In: a wall and its surfaces. Out: sentences. It refuses nothing.

use glam::DVec3;
use protocol::Wall;
use protocol::wall::{Eye, Observer, Screen, ScreenShape};

use crate::plan::face::Face;

/// How high heads of people are, in metres.
const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.0..=3.0;
/// How far above all of the screens a head may be.
const ABOVE_M: f64 = 1.0;
/// A room whose screens reach less far upwards is a floor or a table.
const FLAT_M: f64 = 0.5;
/// How far a head may be from all of its screens, in diagonals of the room.
const FAR: f64 = 3.0;
/// How far a tracked head goes from where it rests, to any side.
const REACH_M: f64 = 0.5;
/// The share of a curved screen that a head within the room sees from the front.
const SEEN_SHARE: f64 = 0.9;
/// How near another observer looks at a screen.
const NEIGHBOUR_M: f64 = 10.0;
/// How far apart eyes are: the vast majority of adults (Dodgson 2004).
const SEPARATIONS_M: std::ops::RangeInclusive<f64> = 0.05..=0.075;

pub(super) fn warn(wall: &Wall, faces: &[Option<Face<'_>>], warnings: &mut Vec<String>) {
    for (index, observer) in wall.observers.iter().enumerate() {
        let own: Vec<(&Screen, &Face<'_>)> = wall
            .screens
            .iter()
            .zip(faces)
            .filter(|(screen, _)| screen.observer == index)
            .filter_map(|(screen, face)| Some((screen, face.as_ref()?)))
            .collect();
        let name = &observer.name;
        let height_m = observer.head_m[1];
        if !HEIGHTS_M.contains(&height_m) {
            warnings.push(format!(
                "the head of observer \"{name}\" is {height_m} m above the floor; correct head_m: y is up, in metres"
            ));
        }
        if own.is_empty() {
            warnings.push(format!(
                "observer \"{name}\" looks at no screen; name it in a screen, or remove it"
            ));
        }
        room(observer, &own, warnings);
        for (screen, face) in &own {
            outside(observer, screen, warnings);
            behind(observer, screen, face, warnings);
        }
        others(wall, faces, index, observer, warnings);
        separation(wall, index, observer, warnings);
    }
    for (index, tracker) in wall.trackers.iter().enumerate() {
        let followed = |observer: &Observer| observer.tracker == Some(index);
        if !wall.observers.iter().any(followed) {
            warnings.push(format!(
                "no observer uses tracker \"{0}\"; write tracker = \"{0}\" in one, or remove it",
                tracker.name
            ));
        }
    }
}

/// A head above or far from all of its screens.
fn room(observer: &Observer, own: &[(&Screen, &Face<'_>)], warnings: &mut Vec<String>) {
    let head_m = DVec3::from(observer.head_m);
    let [low, high] = own.iter().map(|(_, face)| face.bounds_m()).fold(
        [DVec3::INFINITY, DVec3::NEG_INFINITY],
        |[low, high], [from, to]| [low.min(from), high.max(to)],
    );
    let extent = high - low;
    if extent.y > FLAT_M && head_m.y > high.y + ABOVE_M {
        warnings.push(format!(
            "the head of observer \"{}\" is {:.2} m above the top of all of its screens; correct head_m or their corners: y is up, in metres",
            observer.name,
            head_m.y - high.y
        ));
    }
    let away_m = (head_m - head_m.clamp(low, high)).length();
    if extent.is_finite() && away_m > FAR * extent.length() {
        warnings.push(format!(
            "the head of observer \"{}\" is {away_m:.2} m from all of its screens, which measure {:.2} m together; write both in metres",
            observer.name,
            extent.length()
        ));
    }
}

/// A head outside of a cylinder or a sphere.
fn outside(observer: &Observer, screen: &Screen, warnings: &mut Vec<String>) {
    let head_m = DVec3::from(observer.head_m);
    let (from_middle_m, radius_m, what, place) = match &screen.shape {
        ScreenShape::Cylinder {
            foot_m,
            axis,
            radius_m,
            ..
        } => {
            let from_foot = head_m - DVec3::from(*foot_m);
            let axis = DVec3::from(*axis).normalize_or_zero();
            let across = from_foot - axis * from_foot.dot(axis);
            (across.length(), *radius_m, "cylinder", "axis")
        }
        ScreenShape::Sphere {
            centre_m, radius_m, ..
        } => {
            let from_centre = head_m - DVec3::from(*centre_m);
            (from_centre.length(), *radius_m, "sphere", "centre")
        }
        _ => return,
    };
    if from_middle_m > radius_m {
        warnings.push(format!(
            "the head of observer \"{}\" is outside the {what} of screen \"{}\": {from_middle_m:.2} m from its {place}, with a radius of {radius_m} m; move head_m inside, or correct radius_m",
            observer.name, screen.name
        ));
    }
}

/// The share of a screen that is seen from the front.
fn seen_share(screen: &Screen, face: &Face<'_>, eye_m: DVec3) -> f64 {
    screens::pixel_density(face.shape, screen.size_px, eye_m)
        .map_or(0.0, |density| density.seen_share)
}

/// What an observer's own head sees from behind: at rest, with one eye, within the reach of a tracker.
fn behind(observer: &Observer, screen: &Screen, face: &Face<'_>, warnings: &mut Vec<String>) {
    let (name, screen_name) = (&observer.name, &screen.name);
    let head_m = DVec3::from(observer.head_m);
    let seen = seen_share(screen, face, head_m);
    if seen < SEEN_SHARE {
        warnings.push(format!(
            "the head of observer \"{name}\" sees only {:.0} % of screen \"{screen_name}\" from the front; move head_m, or turn the screen: its left edge must be left for its observer",
            100.0 * seen
        ));
        return;
    }
    let head = observer.resting_head();
    for (eye, which) in [(Eye::Left, "left"), (Eye::Right, "right")] {
        let eye_m = DVec3::from(head.eye_m(eye, observer.eye_separation_m));
        if seen_share(screen, face, eye_m) < SEEN_SHARE {
            warnings.push(format!(
                "the {which} eye of observer \"{name}\" is behind screen \"{screen_name}\"; move head_m away from the screen"
            ));
            return;
        }
    }
    let sides = [DVec3::X, DVec3::Y, DVec3::Z];
    let reached = sides
        .iter()
        .flat_map(|side| [head_m + *side * REACH_M, head_m - *side * REACH_M]);
    if observer.tracker.is_some()
        && reached
            .into_iter()
            .any(|head_m| seen_share(screen, face, head_m) < SEEN_SHARE)
    {
        warnings.push(format!(
            "the tracked head of observer \"{name}\" sees screen \"{screen_name}\" from behind when it moves by {REACH_M} m, and then the screen stays black; move head_m to where viewers stand"
        ));
    }
}

/// What an observer sees of the screens of others.
fn others(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    index: usize,
    observer: &Observer,
    warnings: &mut Vec<String>,
) {
    let head_m = DVec3::from(observer.head_m);
    let screens = wall.screens.iter().zip(faces);
    for (screen, face) in screens.filter(|(screen, _)| screen.observer != index) {
        let (Some(face), Some(owner)) = (face, wall.observers.get(screen.observer)) else {
            continue;
        };
        if face.nearest(head_m, NEIGHBOUR_M).is_some() && seen_share(screen, face, head_m) < 0.5 {
            warnings.push(format!(
                "observer \"{}\" sees screen \"{}\" of observer \"{}\" from behind; check which of its corners is left for \"{}\", and where both heads are",
                observer.name, screen.name, owner.name, owner.name
            ));
        }
    }
}

fn separation(wall: &Wall, index: usize, observer: &Observer, warnings: &mut Vec<String>) {
    let (name, separation_m) = (&observer.name, observer.eye_separation_m);
    let sights = wall.sights().into_iter();
    let is_stereo = sights
        .filter(|sight| sight.eye != Eye::Centre)
        .filter_map(|sight| wall.screens.get(sight.screen))
        .any(|screen| screen.observer == index);
    if separation_m == 0.0 {
        // Without stereo it says nothing.
        if is_stereo || observer.tracker.is_some() {
            warnings.push(format!(
                "observer \"{name}\" {} but has no distance between the eyes, so both see the same; write eye_separation_m = 0.063",
                if is_stereo {
                    "has outputs for its left and right eye"
                } else {
                    "is tracked"
                }
            ));
        }
    } else if !SEPARATIONS_M.contains(&separation_m) {
        warnings.push(format!(
            "the eyes of observer \"{name}\" are {separation_m} m apart; write eye_separation_m within 0.05…0.075, in metres"
        ));
    }
}
