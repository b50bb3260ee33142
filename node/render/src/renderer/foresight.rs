//! What will be wanted soon: along the viewer's motion, or one level further in where the viewer rests.
//!
//! In: the views that were drawn. Out: wishes that the tile cache serves when nothing else is to be loaded. It makes no
//! result, draws nothing and costs a selection ten times a second at most.

use std::time::{Duration, Instant};

use geodesy::{Ellipsoid, Tile};
use glam::{DMat3, DQuat, DVec3};
use tiles::Wish;

use crate::gather::priority;
use crate::loaded::LoadedScene;
use crate::renderer::blocks::plan_blocks;
use crate::renderer::{Renderer, ViewPoint};
use crate::room::Most;

/// How far ahead motion is followed.
const LOOK_AHEAD: Duration = Duration::from_secs(1);
/// Motion is measured and followed this often.
const INTERVAL: Duration = Duration::from_millis(100);
/// A sample that is older tells nothing about motion.
const STALE: Duration = Duration::from_secs(1);
/// Of the height above the ground, at least this share is left after motion downwards: the ground stops it anyway.
const LEAST_HEIGHT: f64 = 0.4;
/// No turn is followed further, in radians: a head that turns fast stops soon.
const MOST_TURN: f64 = 0.7;

/// Where the viewers were.
#[derive(Debug, Default)]
pub(crate) struct Foresight {
    before: Option<Sample>,
    /// The view of a resting viewer whose next level is wished for.
    rested: Option<ViewPoint>,
}

#[derive(Debug)]
struct Sample {
    at: Instant,
    eyes: Vec<DVec3>,
    room: DMat3,
}

/// What to look for.
enum Outlook {
    /// It is not time yet, or nothing has changed since the last time.
    AsBefore,
    /// There.
    At(ViewPoint),
    /// Nothing can be told.
    Unknown,
}

impl Foresight {
    /// Where the viewers of a picture will be. `rests`: everything that the picture needs is there.
    fn outlook(
        &mut self,
        ellipsoid: &Ellipsoid,
        view: &ViewPoint,
        rests: bool,
        now: Instant,
    ) -> Outlook {
        let age = self
            .before
            .as_ref()
            .map(|before| now.duration_since(before.at));
        if age.is_some_and(|age| age < INTERVAL) {
            return Outlook::AsBefore;
        }
        let sample = Sample {
            at: now,
            eyes: view.eyes.clone(),
            room: view.room,
        };
        let Some(before) = self.before.replace(sample) else {
            return Outlook::Unknown;
        };
        if before.eyes.len() != view.eyes.len() || now.duration_since(before.at) > STALE {
            self.rested = None;
            return Outlook::Unknown;
        }
        if before.eyes == view.eyes && before.room == view.room {
            if !rests || self.rested.as_ref() == Some(view) {
                return Outlook::AsBefore;
            }
            self.rested = Some(view.clone());
            return Outlook::At(further_in(ellipsoid, view));
        }
        self.rested = None;
        let times = LOOK_AHEAD.as_secs_f64() / now.duration_since(before.at).as_secs_f64();
        Outlook::At(further_on(ellipsoid, &before, view, times))
    }
}

/// The view after `times` more steps like the last one.
fn further_on(ellipsoid: &Ellipsoid, before: &Sample, view: &ViewPoint, times: f64) -> ViewPoint {
    let turn = DQuat::from_mat3(&(view.room * before.room.transpose())).normalize();
    let (axis, angle) = turn.to_axis_angle();
    let angle = if angle > std::f64::consts::PI {
        angle - std::f64::consts::TAU
    } else {
        angle
    };
    let turned = (angle * times).clamp(-MOST_TURN, MOST_TURN);
    let eyes = view.eyes.iter().zip(&before.eyes);
    ViewPoint {
        eyes: eyes
            .map(|(now, before)| {
                let there = *now + (*now - *before) * times;
                above_ground(ellipsoid, *now, there)
            })
            .collect(),
        room: DMat3::from_axis_angle(axis, turned) * view.room,
        ..view.clone()
    }
}

/// The view from half the height, on the way that the viewers look.
fn further_in(ellipsoid: &Ellipsoid, view: &ViewPoint) -> ViewPoint {
    let gaze = -view.room.z_axis;
    let eyes = view.eyes.iter().map(|eye| {
        let height_m = ellipsoid.to_geodetic(*eye).height_m;
        // Towards the horizon the way to half the height is long; nobody flies it at once.
        let descent = -gaze.dot(ellipsoid.normal_below(*eye));
        let way_m = height_m / 2.0 / descent.max(0.25);
        above_ground(ellipsoid, *eye, *eye + gaze * way_m)
    });
    ViewPoint {
        eyes: eyes.collect(),
        ..view.clone()
    }
}

/// A place on the way from here to there, lifted where it lies too low.
fn above_ground(ellipsoid: &Ellipsoid, here: DVec3, there: DVec3) -> DVec3 {
    let least_m = ellipsoid.to_geodetic(here).height_m * LEAST_HEIGHT;
    let there_m = ellipsoid.to_geodetic(there).height_m;
    if there_m >= least_m {
        return there;
    }
    there + ellipsoid.normal_below(there) * (least_m - there_m)
}

impl Renderer {
    /// Wishes for what the viewers of the last picture will want soon.
    pub(crate) fn look_ahead(&mut self) {
        let (Some(last), Some(scene)) = (&self.last, &self.scene) else {
            return;
        };
        let rests = last.statistics.converged && last.pending.is_empty();
        let ellipsoid = &scene.data.ellipsoid;
        let now = Instant::now();
        match self.foresight.outlook(ellipsoid, &last.view, rests, now) {
            Outlook::AsBefore => {}
            Outlook::Unknown => self.wishes.request_ahead(&[]),
            Outlook::At(view) => {
                let wishes = self.wishes_of(scene, &view);
                self.wishes.request_ahead(&wishes);
            }
        }
    }

    /// The data of all leaves that a view would show.
    fn wishes_of(&self, scene: &LoadedScene, view: &ViewPoint) -> Vec<Wish> {
        let blocks = plan_blocks(&self.outputs, view);
        let most = Most::here(&self.geometries, &self.textures);
        let gaze = -view.room.z_axis;
        let mut wishes = Vec::new();
        for (eye, _, sight) in scene.sights(view, &blocks, most).of_eyes {
            let layers = || scene.elevation_layers.iter().chain(&scene.colour_layers);
            for source in layers().filter_map(|layer| scene.source(*layer)) {
                let mut tiles: Vec<Tile> = sight
                    .visible
                    .iter()
                    .filter_map(|leaf| source.best(*leaf))
                    .collect();
                tiles.sort_unstable();
                tiles.dedup();
                wishes.extend(tiles.into_iter().map(|tile| {
                    let urgency = priority(&scene.data.ellipsoid, (eye, gaze), tile);
                    (source.id, tile, urgency)
                }));
            }
        }
        wishes
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    const EARTH: Ellipsoid = Ellipsoid::EARTH;

    fn view(eye: DVec3, room: DMat3) -> ViewPoint {
        ViewPoint {
            eyes: vec![eye],
            room,
            views: Vec::new(),
            warps: Vec::new(),
            pixels_per_radian: 1000.0,
        }
    }

    fn at(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> DVec3 {
        EARTH.point(Ellipsoid::normal(latitude_deg, longitude_deg), height_m)
    }

    fn down(eye: DVec3) -> DMat3 {
        let [east, north, up] = Ellipsoid::east_north_up(EARTH.normal_below(eye));
        DMat3::from_cols(east, north, up)
    }

    fn seen(outlook: Outlook) -> ViewPoint {
        match outlook {
            Outlook::At(view) => view,
            Outlook::AsBefore => panic!("nothing new"),
            Outlook::Unknown => panic!("nothing known"),
        }
    }

    #[test]
    fn motion_goes_on_and_stops_above_the_ground() {
        let begin = Instant::now();
        let mut foresight = Foresight::default();
        let room = down(at(45.0, 7.0, 5e5));
        let path = |seconds: f64| at(45.0, 7.0 + 0.1 * seconds, 5e5);
        let mut look = |eye, after: f64| {
            let now = begin + Duration::from_secs_f64(after);
            foresight.outlook(&EARTH, &view(eye, room), false, now)
        };
        assert!(matches!(look(path(0.0), 0.0), Outlook::Unknown));
        assert!(matches!(look(path(0.05), 0.05), Outlook::AsBefore));
        let there = seen(look(path(0.125), 0.125)).eyes[0];
        // A chord of an eighth of a degree's tenth leaves the circle by less than a metre a second later.
        assert!(there.distance(path(1.125)) < 20.0, "{there}");
        // Falling at three heights a second.
        let fallen = seen(look(at(45.0, 7.0125, 3e5), 0.250)).eyes[0];
        let height_m = EARTH.to_geodetic(fallen).height_m;
        assert!((height_m - 0.4 * 3e5).abs() < 100.0, "{height_m}");
    }

    #[test]
    fn turns_go_on_but_not_for_ever() {
        let begin = Instant::now();
        let eye = at(10.0, 20.0, 1e4);
        let turned = |radians: f64| DMat3::from_axis_angle(DVec3::Z, radians) * down(eye);
        for (step, due) in [(0.02, 0.02 * 11.0), (0.3, 0.3 + MOST_TURN), (-0.02, -0.22)] {
            let mut foresight = Foresight::default();
            let _ = foresight.outlook(&EARTH, &view(eye, turned(0.0)), false, begin);
            let now = begin + Duration::from_millis(100);
            let found = seen(foresight.outlook(&EARTH, &view(eye, turned(step)), false, now));
            let off = (found.room - turned(due)).to_cols_array();
            assert!(off.iter().all(|value| value.abs() < 1e-9), "{step}");
        }
    }

    #[test]
    fn who_rests_may_come_nearer_and_is_foreseen_once() {
        let begin = Instant::now();
        let eye = at(-30.0, 100.0, 8e4);
        let mut foresight = Foresight::default();
        let mut look = |rests, after| {
            let now = begin + Duration::from_millis(after);
            foresight.outlook(&EARTH, &view(eye, down(eye)), rests, now)
        };
        assert!(matches!(look(true, 0), Outlook::Unknown));
        assert!(matches!(look(false, 100), Outlook::AsBefore));
        let near = seen(look(true, 200)).eyes[0];
        assert!((EARTH.to_geodetic(near).height_m - 4e4).abs() < 1.0);
        assert!(matches!(look(true, 300), Outlook::AsBefore));
    }
}
