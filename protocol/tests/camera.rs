//! Cameras: continuity, exactness at keyframes, sound axes everywhere, poles and antimeridian included;
//! and the navigator.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use geodesy::Ellipsoid;
use glam::DVec3;
use proptest::prelude::*;
use protocol::camera::{Camera, Keyframe, Navigator, Orbit, Path, Place, Pose, ground_of_tile};
use protocol::message::{HeldKeys, Steer};

const EARTH: Ellipsoid = Ellipsoid::EARTH;

fn place(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Place {
    Place {
        latitude_deg,
        longitude_deg,
        altitude_m,
        heading_deg: 0.0,
        pitch_deg: -90.0,
        roll_deg: 0.0,
    }
}

fn any_place() -> impl Strategy<Value = Place> {
    let latitude =
        prop_oneof![6 => -90.0..=90.0_f64, 1 => Just(90.0), 1 => Just(-90.0), 1 => Just(0.0)];
    let longitude = prop_oneof![6 => -180.0..=180.0_f64, 1 => Just(180.0), 1 => Just(-180.0)];
    let altitude = (0.0..16.5_f64).prop_map(f64::exp);
    (
        latitude,
        longitude,
        altitude,
        -360.0..=360.0_f64,
        -90.0..=90.0_f64,
        -180.0..=180.0_f64,
    )
        .prop_map(
            |(latitude_deg, longitude_deg, altitude_m, heading_deg, pitch_deg, roll_deg)| Place {
                latitude_deg,
                longitude_deg,
                altitude_m,
                heading_deg,
                pitch_deg,
                roll_deg,
            },
        )
}

fn angle_deg(a: &Pose, b: &Pose) -> f64 {
    let axis = |a: [f64; 3], b: [f64; 3]| DVec3::from(a).angle_between(DVec3::from(b)).to_degrees();
    axis(a.right, b.right)
        .max(axis(a.up, b.up))
        .max(axis(a.back, b.back))
}

/// A valid path through places: those farther than 150° apart from the one before are left out.
fn path_of(places: Vec<Place>, looped: bool) -> Path {
    let mut keyframes: Vec<Keyframe> = Vec::new();
    let normal = |place: &Place| Ellipsoid::normal(place.latitude_deg, place.longitude_deg);
    for place in places {
        let near = keyframes.last().is_none_or(|last: &Keyframe| {
            normal(&last.place).angle_between(normal(&place)) < 149_f64.to_radians()
        });
        if near {
            keyframes.push(Keyframe {
                time_s: keyframes.len() as f64 * 1.5,
                place,
            });
        }
    }
    let first = keyframes[0].place;
    let closes = normal(&keyframes.last().unwrap().place).angle_between(normal(&first)) < 2.6;
    let looped = looped && closes;
    if looped || keyframes.len() < 2 {
        keyframes.push(Keyframe {
            time_s: keyframes.len() as f64 * 1.5,
            place: first,
        });
    }
    Path { keyframes, looped }
}

#[test]
fn a_place_looks_where_it_says() {
    // North at the equator: forward +z, up is away from the planet.
    let north = Place {
        pitch_deg: 0.0,
        ..place(0.0, 0.0, 0.0)
    }
    .pose(&EARTH);
    let close = |a: [f64; 3], b: DVec3| DVec3::from(a).distance(b) < 1e-12;
    assert!(
        close(north.forward(), DVec3::Z)
            && close(north.up, DVec3::X)
            && close(north.right, DVec3::Y)
    );
    let east = Place {
        pitch_deg: 0.0,
        heading_deg: 90.0,
        ..place(0.0, 0.0, 0.0)
    }
    .pose(&EARTH);
    assert!(
        close(east.forward(), DVec3::Y) && close(east.up, DVec3::X) && close(east.right, -DVec3::Z)
    );
    let down = place(0.0, 0.0, 0.0).pose(&EARTH);
    assert!(close(down.forward(), -DVec3::X) && close(down.up, DVec3::Z));
    // Head tilted to the right: its up leans towards what was right.
    let tilted = Place {
        pitch_deg: 0.0,
        roll_deg: 90.0,
        ..place(0.0, 0.0, 0.0)
    }
    .pose(&EARTH);
    assert!(close(tilted.up, DVec3::Y) && close(tilted.right, -DVec3::X));
    // At the pole the meridian decides what heading means.
    let pole = place(90.0, 90.0, 1000.0).pose(&EARTH);
    assert!(close(pole.up, -DVec3::Y) && close(pole.forward(), -DVec3::Z));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn poses_are_sound_everywhere(place in any_place(), time_s in 0.0..1e6_f64, speed in -3600.0..3600.0_f64,
                                  latitude in -90.0..=90.0_f64, longitude in -180.0..=180.0_f64) {
        prop_assert!(place.pose(&EARTH).is_sound());
        let orbit = Camera::Orbit(Orbit {
            place, centre_latitude_deg: latitude, centre_longitude_deg: longitude, degrees_per_second: speed,
        });
        let pose = orbit.pose(&EARTH, time_s);
        prop_assert!(pose.is_sound());
        // The distance from the orbit's axis and along it never changes.
        let axis = Ellipsoid::normal(latitude, longitude);
        let centre = EARTH.point(axis, 0.0);
        let (start, now) = (orbit.pose(&EARTH, 0.0), pose);
        let offset = |pose: &Pose| DVec3::from(pose.position_m) - centre;
        prop_assert!((offset(&start).dot(axis) - offset(&now).dot(axis)).abs() < 1e-3);
        prop_assert!((offset(&start).length() - offset(&now).length()).abs() < 1e-3);
        // So does the angle under which it sees the centre.
        let sees = |pose: &Pose| offset(pose).normalize_or_zero().dot(pose.back.into());
        prop_assert!((sees(&start) - sees(&now)).abs() < 1e-6);
    }

    #[test]
    fn paths_are_exact_at_keyframes(places in prop::collection::vec(any_place(), 2..6), looped: bool) {
        let path = path_of(places, looped);
        let camera = Camera::Path(path.clone());
        let unlooped = path.keyframes.iter().take(path.keyframes.len() - 1);
        for keyframe in unlooped {
            let pose = camera.pose(&EARTH, keyframe.time_s);
            prop_assert_eq!(pose, keyframe.place.pose(&EARTH));
        }
    }

    #[test]
    fn paths_are_continuous_and_do_not_leave_their_heights(
        places in prop::collection::vec(any_place(), 2..6), looped: bool,
    ) {
        let path = path_of(places, looped);
        let camera = Camera::Path(path.clone());
        let end_s = path.keyframes.last().unwrap().time_s;
        let heights = path.keyframes.iter().map(|keyframe| keyframe.place.altitude_m);
        let (lowest, highest) = heights.fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)));
        let step_s = 1e-4;
        for index in 0..120 {
            // Beside keyframes, and in between; beyond both ends too.
            let around_s = if index % 2 == 0 {
                path.keyframes[(index / 2) % path.keyframes.len()].time_s
            } else {
                -0.5 + (end_s + 1.0) * index as f64 / 120.0
            };
            let a = camera.pose(&EARTH, around_s - step_s);
            let b = camera.pose(&EARTH, around_s);
            let c = camera.pose(&EARTH, around_s + step_s);
            for pose in [&a, &b, &c] {
                prop_assert!(pose.is_sound(), "{pose:?}");
                let height = EARTH.to_geodetic(pose.position_m.into()).height_m;
                prop_assert!(height > lowest * 0.999 - 1.0 && height < highest * 1.001 + 1.0, "{height}");
            }
            // Continuous: 0.1 ms moves little.
            let moved = |a: &Pose, b: &Pose| DVec3::from(a.position_m).distance(b.position_m.into());
            let reach = DVec3::from(b.position_m).length();
            prop_assert!(moved(&a, &b) < reach * 2e-3 && moved(&b, &c) < reach * 2e-3);
            prop_assert!(angle_deg(&a, &b) < 0.5 && angle_deg(&b, &c) < 0.5, "{} {}", angle_deg(&a, &b), angle_deg(&b, &c));
            // Without a jump in speed: two steps of a microsecond differ by acceleration alone.
            let [a, b, c] = [-1e-6, 0.0, 1e-6].map(|s| camera.pose(&EARTH, around_s + s));
            let bend = |pick: fn(&Pose) -> [f64; 3]| {
                let [a, b, c] = [pick(&a), pick(&b), pick(&c)].map(DVec3::from);
                ((c - b) - (b - a)).length()
            };
            prop_assert!(bend(|pose| pose.position_m) < reach * 2e-9, "{}", bend(|pose| pose.position_m) / reach);
            prop_assert!(bend(|pose| pose.right) < 2e-9 && bend(|pose| pose.back) < 2e-9, "{} {}", bend(|pose| pose.right), bend(|pose| pose.back));
        }
    }
}

#[test]
fn a_flight_over_the_pole_and_one_over_the_antimeridian_take_the_short_way() {
    let fly = |a: Place, b: Place| {
        let keyframes = vec![
            Keyframe {
                time_s: 0.0,
                place: a,
            },
            Keyframe {
                time_s: 10.0,
                place: b,
            },
        ];
        Camera::Path(Path {
            keyframes,
            looped: false,
        })
        .pose(&EARTH, 5.0)
    };
    let over_pole = fly(place(80.0, 10.0, 1e5), place(80.0, -170.0, 1e5));
    let height = EARTH.to_geodetic(over_pole.position_m.into());
    assert!((height.latitude_deg - 90.0).abs() < 1e-6, "{height:?}");
    let over_line = fly(place(0.0, 179.0, 1e5), place(0.0, -179.0, 1e5));
    let position = EARTH.to_geodetic(over_line.position_m.into());
    assert!(
        (position.longitude_deg.abs() - 180.0).abs() < 1e-6,
        "{position:?}"
    );
}

#[test]
fn altitude_is_logarithmic_between_keyframes() {
    let keyframes = vec![
        Keyframe {
            time_s: 0.0,
            place: place(45.0, 7.0, 1e3),
        },
        Keyframe {
            time_s: 2.0,
            place: place(45.0, 7.0, 1e7),
        },
    ];
    let pose = Camera::Path(Path {
        keyframes,
        looped: false,
    })
    .pose(&EARTH, 1.0);
    let height_m = EARTH.to_geodetic(pose.position_m.into()).height_m;
    // Half way in time is half way in orders of magnitude.
    assert!((height_m.log10() - 5.0).abs() < 0.02, "{height_m}");
}

fn navigator(altitude_m: f64, pitch_deg: f64) -> Navigator {
    let start = Place {
        pitch_deg,
        ..place(46.0, 7.0, altitude_m)
    };
    Navigator::new(EARTH, &start.pose(&EARTH))
}

fn height_m(navigator: &Navigator) -> f64 {
    EARTH
        .to_geodetic(navigator.pose().position_m.into())
        .height_m
}

#[test]
fn dragging_moves_the_ground_with_the_pointer() {
    let mut navigator = navigator(10_000.0, -90.0);
    let before = navigator.pose();
    navigator.steer(
        &Steer {
            drag: [0.1, 0.0],
            ..Steer::default()
        },
        0,
    );
    let moved = DVec3::from(navigator.pose().position_m) - DVec3::from(before.position_m);
    // 0.1 rad at 10 km is 1 km of ground; the viewer goes left.
    assert!((moved.length() - 1000.0).abs() < 5.0, "{}", moved.length());
    assert!(moved.dot(before.right.into()) < -990.0);
    assert!((height_m(&navigator) - 10_000.0).abs() < 1e-3);
    // Dragging back undoes it.
    navigator.steer(
        &Steer {
            drag: [-0.1, 0.0],
            ..Steer::default()
        },
        0,
    );
    let back = DVec3::from(navigator.pose().position_m).distance(before.position_m.into());
    assert!(back < 1.0, "{back}");
}

#[test]
fn the_wheel_goes_by_shares_of_the_height_and_never_through_the_ground() {
    let mut navigator = navigator(10_000.0, -90.0);
    navigator.steer(
        &Steer {
            zoom: 1.0,
            ..Steer::default()
        },
        0,
    );
    assert!(
        (height_m(&navigator) - 8_500.0).abs() < 1.0,
        "{}",
        height_m(&navigator)
    );
    navigator.steer(
        &Steer {
            zoom: -1.0,
            ..Steer::default()
        },
        0,
    );
    assert!((height_m(&navigator) - 10_000.0).abs() < 1.0);
    navigator.advance(0, 1234.0);
    for _ in 0..200 {
        navigator.steer(
            &Steer {
                zoom: 20.0,
                ..Steer::default()
            },
            0,
        );
        assert!(
            height_m(&navigator) >= 1236.0 - 1e-6,
            "{}",
            height_m(&navigator)
        );
    }
    for _ in 0..200 {
        navigator.steer(
            &Steer {
                zoom: -20.0,
                ..Steer::default()
            },
            0,
        );
    }
    assert!(height_m(&navigator) < 21.0 * EARTH.semi_major_m);
    // Ground that rises lifts the viewer.
    let mut low = self::navigator(10.0, 0.0);
    low.advance(0, 500.0);
    assert!((height_m(&low) - 502.0).abs() < 1e-6);
}

#[test]
fn keys_move_by_time_and_not_by_frames() {
    let travel = |frames: i64| {
        let mut navigator = navigator(1_000.0, 0.0);
        let start = navigator.pose();
        navigator.advance(0, 0.0);
        for frame in 1..=frames {
            let now_us = frame * 1_000_000 / frames;
            let held = HeldKeys::FORWARD.with(HeldKeys::LOOK_RIGHT, true);
            navigator.steer(
                &Steer {
                    held,
                    ..Steer::default()
                },
                now_us,
            );
            navigator.advance(now_us, 0.0);
        }
        DVec3::from(navigator.pose().position_m).distance(start.position_m.into())
    };
    let (slow, fast) = (travel(15), travel(240));
    assert!((slow / fast - 1.0).abs() < 0.05, "{slow} {fast}");
    assert!(fast > 500.0, "{fast}");
}

#[test]
fn keys_of_a_silent_window_count_as_released() {
    let mut navigator = navigator(1_000.0, 0.0);
    navigator.advance(0, 0.0);
    navigator.steer(
        &Steer {
            held: HeldKeys::FORWARD,
            ..Steer::default()
        },
        0,
    );
    assert!(navigator.is_moving(100_000));
    assert!(!navigator.is_moving(400_000));
    let before = navigator.pose();
    navigator.advance(500_000, 0.0);
    assert_eq!(navigator.pose(), before);
}

proptest! {
    /// Whatever the windows say, the viewer stays sound, above ground and near the planet.
    #[test]
    fn steering_keeps_the_viewer_sound(
        start in any_place(), ground_m in -500.0..9000.0_f64,
        moves in prop::collection::vec((prop::array::uniform6(-1e3..1e3_f64), 0..8192_u16, 0..200_000_i64), 1..40),
    ) {
        let mut navigator = Navigator::new(EARTH, &start.pose(&EARTH));
        let mut now_us = 0;
        for ([a, b, c, d, e, f], keys, passed_us) in moves {
            now_us += passed_us;
            let steer = Steer { drag: [a / 100.0, b / 100.0], look: [c, d], roll: e, zoom: f / 50.0, held: HeldKeys(keys) };
            navigator.steer(&steer, now_us);
            navigator.advance(now_us, ground_m);
            prop_assert!(navigator.pose().is_sound());
            let height = height_m(&navigator);
            prop_assert!(height >= ground_m + 2.0 - 1e-3 && height < 1.4e8, "{height}");
        }
    }
}

#[test]
fn the_ground_of_a_tile_is_where_the_tile_is() {
    // Whole faces: the north face around its pole, and its corners between two faces around the equator.
    let [latitude_deg, _] = ground_of_tile(8 + 2, [0.5, 0.5]).unwrap();
    assert_eq!(latitude_deg, 90.0);
    let corner_deg = (1.0_f64 / 2.0_f64.sqrt()).atan().to_degrees();
    for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        let [latitude_deg, longitude_deg] = ground_of_tile(8 + 2, corner).unwrap();
        assert!((latitude_deg - corner_deg).abs() < 1e-12);
        assert!((longitude_deg.abs() % 90.0 - 45.0).abs() < 1e-12);
    }
    // The middle of any tile lies on its own node 128, 128.
    for (face, level, x, y) in [(0, 0, 0, 0), (3, 9, 17, 500), (5, 22, 1 << 21, 77)] {
        let tile = geodesy::Tile::new(face, level, x, y).unwrap();
        let middle = geodesy::LatticePoint::of_tile(tile, 128, 128).normal();
        let [latitude_deg, longitude_deg] = ground_of_tile(tile.id(), [0.5, 0.5]).unwrap();
        let found = Ellipsoid::normal(latitude_deg, longitude_deg);
        assert!((found - middle).length() < 1e-15, "{tile}");
    }
    assert_eq!(ground_of_tile(0, [0.5, 0.5]), None);
    assert_eq!(ground_of_tile(u64::MAX, [0.5, 0.5]), None);
}
