//! Places on screens: rays find the places that points come from, normals look at the viewers, corners are where they
//! were measured.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use common::{Random, arc, fisheye, grid, planar, points_of, siegen, smooth_screens};
use common::{SIEGEN_HEAD, SIEGEN_RADIUS_M, SIEGEN_WALLS};
use glam::DVec3;
use screens::{PlanarView, Points, PointsAt, Shape};

#[test]
fn rays_find_the_places_that_points_come_from() {
    let mut random = Random(7);
    for (name, shape, room_m, radius_m) in smooth_screens() {
        assert_eq!(shape.check(), Ok(()), "{name}");
        let mut found_count = 0;
        for round in 0..4000 {
            // Now and then on an edge or in a corner.
            let mut share = || match round % 8 {
                0 => random.between(0.0, 2.0).floor(),
                _ => random.between(0.0, 1.0),
            };
            let place = [share(), share()];
            let Some(point_m) = shape.point_m(place[0], place[1]) else {
                assert!(shape.is_empty_at(place), "{name} {place:?}");
                continue;
            };
            let eye_m = room_m + random.within(radius_m);
            let found = shape.locate(eye_m, (point_m - eye_m) * 0.37).unwrap();
            let there_m = shape.point_m(found[0], found[1]).unwrap();
            assert!(
                there_m.distance(point_m) < 1e-9,
                "{name} {place:?}: {found:?}"
            );
            // Seen from inside every point is the first that a ray meets, and nothing else has this place.
            let off = (found[0] - place[0]).abs().max((found[1] - place[1]).abs());
            let wraps = name == "ring" && (place[0] == 0.0 || place[0] == 1.0);
            assert!(off < 1e-9 || wraps, "{name} {place:?}: {found:?}");
            found_count += 1;
        }
        assert!(found_count > 2500, "{name}: {found_count}");
    }
}

trait Empty {
    fn is_empty_at(&self, place: [f64; 2]) -> bool;
}

impl Empty for Shape {
    /// Only a fisheye is empty anywhere: beyond its circle.
    fn is_empty_at(&self, [x, y]: [f64; 2]) -> bool {
        let (x, y) = (x - 0.5, y - 0.5);
        matches!(self, Self::Sphere(_)) && x * x + y * y > 0.25
    }
}

#[test]
fn rays_beside_a_screen_find_nothing() {
    let head = DVec3::new(0.0, 1.5, 0.0);
    let aside = [
        (planar(), DVec3::new(0.0, 0.0, 1.0)),
        (planar(), DVec3::new(0.0, 1.0, -0.1)),
        (siegen(0), DVec3::Z),
        (siegen(0), DVec3::Y),
        (siegen(1), DVec3::X),
        (arc([-115.0, 80.0]), DVec3::new(0.1, 0.0, 1.0)),
        (fisheye(180.0), DVec3::new(0.0, -1.0, 0.1)),
        (grid([-120.0, 120.0], [-10.0, 60.0]), DVec3::Z),
    ];
    for (shape, direction) in aside {
        assert_eq!(shape.locate(head, direction), None, "{shape:?} {direction}");
        assert_eq!(shape.locate(head, DVec3::ZERO), None);
        assert_eq!(shape.locate(head, DVec3::NAN), None);
        assert_eq!(
            shape.locate(DVec3::new(f64::INFINITY, 0.0, 0.0), DVec3::X),
            None
        );
        for share in [-0.01, 1.01, f64::NAN] {
            assert_eq!(shape.point_m(share, 0.5), None);
            assert_eq!(shape.point_m(0.5, share), None);
        }
    }
}

#[test]
fn eyes_outside_meet_the_near_side_first() {
    // A ring is met from behind where it is nearest; a half ring through its opening.
    let eye = DVec3::new(0.0, 1.2, 10.0);
    let [x, _] = arc([-180.0, 180.0]).locate(eye, DVec3::NEG_Z).unwrap();
    assert!(x.min(1.0 - x) < 0.02, "{x}");
    let [x, _] = arc([-90.0, 90.0]).locate(eye, DVec3::NEG_Z).unwrap();
    assert!((x - 0.5).abs() < 0.02, "{x}");
    // An eye on the surface does not see the place where it is.
    let ring = arc([-180.0, 180.0]);
    let on_it = ring.point_m(0.5, 0.5).unwrap();
    let [x, _] = ring.locate(on_it, DVec3::Z).unwrap();
    assert!(x.min(1.0 - x) < 0.02, "{x}");
}

#[test]
fn normals_look_at_the_viewers_and_stand_on_the_surface() {
    let mut random = Random(11);
    let mut screens = smooth_screens();
    screens.push((
        "points",
        points_of(&siegen(1), 300, 200, PointsAt::CellCentres),
        DVec3::new(0.0, 1.5, 0.0),
        0.5,
    ));
    for (name, shape, room_m, _) in screens {
        for _ in 0..500 {
            let [x, y] = [random.between(0.1, 0.9), random.between(0.1, 0.9)];
            let (Some(point_m), Some(normal)) = (shape.point_m(x, y), shape.normal(x, y)) else {
                assert!(shape.is_empty_at([x, y]));
                continue;
            };
            assert!((normal.length() - 1.0).abs() < 1e-12);
            assert!((room_m - point_m).dot(normal) > 0.0, "{name}");
            for (dx, dy) in [(1e-6, 0.0), (0.0, 1e-6)] {
                let [after, before] =
                    [1.0, -1.0].map(|side| shape.point_m(x + side * dx, y + side * dy).unwrap());
                let slope = (after - before) / 2e-6;
                assert!(
                    slope.dot(normal).abs() < 1e-5 * slope.length(),
                    "{name} {x} {y}"
                );
            }
        }
    }
}

#[test]
fn canvases_lie_as_their_viewers_see_them() {
    let near = |shape: &Shape, x: f64, y: f64, place: [f64; 3]| {
        let point_m = shape.point_m(x, y).unwrap();
        assert!(point_m.distance(place.into()) < 1e-12, "{x} {y}: {point_m}");
    };
    let shape = planar();
    near(&shape, 0.0, 1.0, [-2.0, 0.3, -1.0]);
    near(&shape, 1.0, 1.0, [1.0, 0.3, -2.0]);
    near(&shape, 0.0, 0.0, [-2.0, 2.4, -1.0]);
    // Azimuth −90° is at the left (−x), 0 ahead (−z); heights count from the foot.
    let Shape::Cylinder(cylinder) = arc([-90.0, 0.0]) else {
        panic!("a cylinder")
    };
    let upright = Shape::Cylinder(screens::Cylinder {
        axis: DVec3::Y * 3.0,
        ..cylinder
    });
    near(&upright, 0.0, 1.0, [-2.9, -0.2, 0.3]);
    near(&upright, 1.0, 0.0, [0.1, 2.4, -2.7]);
    // A dome: the middle is the zenith, lowered to the front by 20°; the front is at the bottom, right is right.
    let (sine, cosine) = 20_f64.to_radians().sin_cos();
    let dome = fisheye(180.0);
    near(&dome, 0.5, 0.5, [0.0, 1.5 + 5.0 * cosine, -5.0 * sine]);
    near(&dome, 0.5, 1.0, [0.0, 1.5 - 5.0 * sine, -5.0 * cosine]);
    near(&dome, 0.5, 0.0, [0.0, 1.5 + 5.0 * sine, 5.0 * cosine]);
    near(&dome, 1.0, 0.5, [5.0, 1.5, 0.0]);
    assert_eq!(dome.point_m(0.0, 0.0), None);
    let part = grid([0.0, 90.0], [0.0, 90.0]);
    near(&part, 0.0, 1.0, [0.0, 1.5 - 5.0 * sine, -5.0 * cosine]);
    near(&part, 1.0, 1.0, [5.0, 1.5, 0.0]);
    near(&part, 0.3, 0.0, [0.0, 1.5 + 5.0 * cosine, -5.0 * sine]);
}

#[test]
fn siegens_corners_are_where_they_were_measured() {
    for (wall, [bottom_left, bottom_right, top_left]) in SIEGEN_WALLS.into_iter().enumerate() {
        let shape = siegen(wall);
        let top_right = [bottom_right[0], top_left[1], bottom_right[2]];
        let corners = [
            (0.0, 1.0, bottom_left),
            (1.0, 1.0, bottom_right),
            (0.0, 0.0, top_left),
            (1.0, 0.0, top_right),
        ];
        for (x, y, corner) in corners {
            // The table is rounded to some micrometres.
            let off_m = shape.point_m(x, y).unwrap().distance(corner.into());
            assert!(off_m < 1e-5, "wall {wall}: {off_m}");
        }
    }
}

/// Pixel → chord plane → along the ray from P₀ onto the cylinder, found by bisection.
fn siegen_by_bisection(corners: [[f64; 3]; 3], x: f64, y: f64) -> DVec3 {
    let [origin, right, top] = corners.map(DVec3::from);
    let on_plane = origin + (right - origin) * x + (top - origin) * (1.0 - y);
    let radius = |t: f64| {
        let place = SIEGEN_HEAD + (on_plane - SIEGEN_HEAD) * t;
        (place.x * place.x + place.z * place.z).sqrt()
    };
    let (mut inside, mut outside) = (0.0, 50.0);
    while outside - inside > 1e-15 * outside {
        let middle = 0.5 * (inside + outside);
        if middle <= inside || middle >= outside {
            break;
        }
        if radius(middle) < SIEGEN_RADIUS_M {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    SIEGEN_HEAD + (on_plane - SIEGEN_HEAD) * inside
}

#[test]
fn siegens_warp_is_one_case_of_screen_points_and_views() {
    let mut random = Random(13);
    for (wall, corners) in SIEGEN_WALLS.into_iter().enumerate() {
        let shape = siegen(wall);
        let [origin, right, top] = corners.map(DVec3::from);
        let (along_width, along_height) = (right - origin, top - origin);
        for _ in 0..500 {
            let [x, y] = [random.between(0.0, 1.0), random.between(0.0, 1.0)];
            let point_m = siegen_by_bisection(corners, x, y);
            assert!(shape.point_m(x, y).unwrap().distance(point_m) < 1e-9);
            // From there along the ray to a head that moved, back onto the chord plane: texture coordinates.
            let head = DVec3::new(0.0, 1.5, 0.0) + random.within(0.8);
            let normal = along_width.cross(along_height);
            let t = (origin - head).dot(normal) / (point_m - head).dot(normal);
            let on_plane = head + (point_m - head) * t - origin;
            let texture = [
                on_plane.dot(along_width) / along_width.length_squared(),
                on_plane.dot(along_height) / along_height.length_squared(),
            ];
            // The view through the chord plane, which this warp renders.
            let view = PlanarView {
                lower_left_m: origin - head,
                right: along_width.normalize(),
                up: along_height.normalize(),
                size_m: [along_width.length(), along_height.length()],
                size_px: [1920, 1200],
                sampling: 1.0,
            };
            let seen = view.project(point_m - head);
            assert!((seen[0] / 1920.0 - texture[0]).abs() < 1e-12);
            assert!((seen[1] / 1200.0 - (1.0 - texture[1])).abs() < 1e-12);
        }
    }
}

#[test]
fn outlines_go_around_the_canvas() {
    for (name, shape, ..) in smooth_screens() {
        let outline = shape.outline_m(16);
        assert_eq!(outline.len(), 64, "{name}");
        let longest = outline
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .fold(0.0, f64::max);
        assert!(longest < 2.0, "{name}: {longest}");
    }
    for point_m in fisheye(180.0).outline_m(8) {
        let dome_m = point_m - DVec3::new(0.0, 1.5, 0.0);
        let zenith = DVec3::new(0.0, 20_f64.to_radians().cos(), -20_f64.to_radians().sin());
        assert!(dome_m.dot(zenith).abs() < 1e-9, "the horizon");
    }
    assert_eq!(planar().outline_m(0).len(), 4);
    assert_eq!(planar().outline_m(u32::MAX).len(), 4 * 4096);
}

#[test]
fn surfaces_of_points_are_met_where_they_are() {
    let smooth = siegen(2);
    let mut random = Random(17);
    for at in [PointsAt::CellCentres, PointsAt::Corners] {
        // Odd sizes, so that boxes at the ends are not full; and the smallest one.
        for (width, height) in [(61, 43), (2, 2), (3, 2)] {
            let shape = points_of(&smooth, width, height, at);
            for _ in 0..2000 {
                let [x, y] = [random.between(0.0, 1.0), random.between(0.0, 1.0)];
                let point_m = shape.point_m(x, y).unwrap();
                let eye_m = DVec3::new(0.0, 1.4, 0.0) + random.within(0.5);
                let [found_x, found_y] = shape.locate(eye_m, point_m - eye_m).unwrap();
                let found_m = shape.point_m(found_x, found_y).unwrap();
                assert!(
                    found_m.distance(point_m) < 1e-9,
                    "{at:?} {width} {x} {y}: {found_x} {found_y}"
                );
                if width > 60 {
                    let off_m = smooth.point_m(x, y).unwrap().distance(point_m);
                    assert!(off_m < 1e-3, "{at:?} {x} {y}: {off_m}");
                }
            }
            assert_eq!(shape.locate(DVec3::Y, DVec3::Z), None);
        }
    }
}

/// A surface with waves, so that rays meet it several times, and a hole.
fn waves() -> Shape {
    let mut points_m = Vec::new();
    for row in 0..90_u8 {
        for column in 0..120_u8 {
            let (x, y) = (f32::from(column) * 0.02, f32::from(row) * 0.02);
            let there = !((40..50).contains(&column) && (30..45).contains(&row));
            let z = if there {
                0.3 * (x * 12.0).sin() * (y * 9.0).cos() - 2.0
            } else {
                f32::NAN
            };
            points_m.push([x, 1.8 - y, z]);
        }
    }
    Shape::Points(Points::new(120, 90, points_m, PointsAt::CellCentres).unwrap())
}

#[test]
fn rays_meet_the_nearest_wave() {
    let shape = waves();
    let mut random = Random(19);
    let (mut first_count, mut hidden_count) = (0, 0);
    for _ in 0..5000 {
        let [x, y] = [random.between(0.0, 1.0), random.between(0.0, 1.0)];
        let Some(point_m) = shape.point_m(x, y) else {
            continue;
        };
        // From aside, flat over the waves.
        let eye_m = DVec3::new(-0.5, 0.9, -1.4) + random.within(0.2);
        let direction = (point_m - eye_m).normalize();
        let [found_x, found_y] = shape.locate(eye_m, direction).unwrap();
        let found_m = shape.point_m(found_x, found_y).unwrap() - eye_m;
        assert!(found_m.cross(direction).length() < 1e-4, "beside the ray");
        let farther_m = (point_m - eye_m).length() - found_m.length();
        assert!(farther_m > -1e-9, "behind: {farther_m}");
        if farther_m < 1e-6 {
            first_count += 1;
        } else {
            hidden_count += 1;
        }
    }
    assert!(
        first_count > 1000 && hidden_count > 500,
        "{first_count} {hidden_count}"
    );
}

#[test]
fn holes_between_points_show_nothing() {
    let shape = waves();
    let place = |column: f64, row: f64| [(column + 0.5) / 120.0, (row + 0.5) / 90.0];
    let [x, y] = place(44.0, 35.0);
    assert_eq!(shape.point_m(x, y), None);
    assert_eq!(shape.normal(x, y), None);
    // Half a cell beside the last point before the hole; but that point itself, for pixels that lie on points.
    let [x, y] = place(39.5, 35.0);
    assert_eq!(shape.point_m(x, y), None);
    let [x, y] = place(39.0, 35.0);
    assert!(shape.point_m(x, y).is_some());
    let through = DVec3::new(44.5 * 0.02, 1.8 - 37.0 * 0.02, 0.0);
    assert_eq!(shape.locate(through, DVec3::NEG_Z), None);
    assert!(shape.locate(through, DVec3::new(0.2, 0.0, -1.0)).is_some());
}
