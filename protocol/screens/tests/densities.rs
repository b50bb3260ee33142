//! Pixels per radian, against slopes of directions taken pixel by pixel.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use common::{Random, arc, fisheye, grid, planar, points_of, siegen, smooth_screens};
use glam::DVec3;
use screens::{Density, PointsAt, SampledMap, Shape, pixel_density};

/// Sparsest and densest over every place of a fine grid on the canvas, and which share is seen at all.
fn brute_force(shape: &Shape, size_px: [u32; 2], head_m: DVec3) -> Option<(f64, f64)> {
    let places: u32 = 400;
    let mut range: Option<(f64, f64)> = None;
    for row in 0..=places {
        for column in 0..=places {
            // Half a step from the edges there are slopes.
            let share = |index: u32| (f64::from(index) / f64::from(places)).clamp(1e-6, 1.0 - 1e-6);
            let (x, y) = (share(column), share(row));
            let step = 5e-7;
            let ends = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)];
            let points = ends.map(|(dx, dy)| shape.point_m(x + dx, y + dy));
            let ([Some(right), Some(left), Some(below), Some(above)], Some(here), Some(normal)) =
                (points, shape.point_m(x, y), shape.normal(x, y))
            else {
                continue;
            };
            if (head_m - here).normalize().dot(normal) <= 0.02 {
                continue;
            }
            let angle = |to: DVec3, from: DVec3, pixels: u32| {
                ((to - head_m).normalize() - (from - head_m).normalize())
                    / (2.0 * step)
                    / f64::from(pixels)
            };
            let (x, y) = (
                angle(right, left, size_px[0]),
                angle(below, above, size_px[1]),
            );
            let turn = 0.5 * (2.0 * x.dot(y)).atan2(x.length_squared() - y.length_squared());
            let (sine, cosine) = turn.sin_cos();
            let (first, second) = (
                (x * cosine + y * sine).length(),
                (y * cosine - x * sine).length(),
            );
            let (sparse, dense) = (1.0 / first.max(second), 1.0 / first.min(second));
            let (sparsest, densest) = range.unwrap_or((f64::INFINITY, 0.0));
            range = Some((sparsest.min(sparse), densest.max(dense)));
        }
    }
    range
}

fn close(name: &str, head_m: DVec3, found: &Density, (sparsest, densest): (f64, f64)) {
    let (dense, sparse) = (found.densest / densest, found.sparsest / sparsest);
    // Not less than brute force, and at most its reserve more; brute force itself is off by what lies between.
    assert!(
        (0.9999..1.011).contains(&dense),
        "{name} {head_m}: densest is {dense} of the truth"
    );
    assert!(
        (0.99..1.005).contains(&sparse),
        "{name} {head_m}: sparsest is {sparse} of the truth"
    );
}

#[test]
fn densities_are_those_of_brute_force() {
    let mut random = Random(31);
    for (name, shape, room_m, radius_m) in smooth_screens() {
        let size_px = if name.contains("fisheye") {
            [2048; 2]
        } else {
            [1920, 1200]
        };
        for _ in 0..6 {
            let head_m = room_m + random.within(radius_m);
            let found = pixel_density(&shape, size_px, head_m).unwrap();
            let truth = brute_force(&shape, size_px, head_m).unwrap();
            if name == "planar" {
                // Its sparsest place is that of the plane, on the canvas or beside it.
                assert!(found.sparsest <= truth.0 * 1.0001);
                // Its pixels are off square by 6 %, and so much may densities be more than they are.
                let dense = found.densest / truth.1;
                assert!((0.9999..1.0625).contains(&dense), "{head_m}: {dense}");
            } else {
                close(name, head_m, &found, truth);
            }
            assert_eq!(found.seen_share, 1.0, "{name}");
        }
    }
}

#[test]
fn square_pixels_on_a_plane_have_exact_densities() {
    let mut random = Random(41);
    let shape = planar();
    // 3.162 m by 2.1 m.
    let size_px = [3162, 2100];
    for _ in 0..6 {
        let head_m = DVec3::new(0.0, 1.5, 1.0) + random.within(1.5);
        let found = pixel_density(&shape, size_px, head_m).unwrap();
        let truth = brute_force(&shape, size_px, head_m).unwrap();
        assert!((found.densest / truth.1 - 1.0).abs() < 1e-4, "{head_m}");
    }
}

#[test]
fn densities_near_a_wall_are_found() {
    // Half a hand from the surface: what is nearest is sparse, and that place is small.
    for (name, shape) in [
        ("Siegen", siegen(1)),
        ("arc", arc([-115.0, 80.0])),
        ("dome", fisheye(180.0)),
    ] {
        for [x, y] in [[0.3, 0.6], [0.52, 0.41], [0.61, 0.7]] {
            let head_m = shape.point_m(x, y).unwrap() + shape.normal(x, y).unwrap() * 0.15;
            let found = pixel_density(&shape, [1920, 1920], head_m).unwrap();
            let truth = brute_force(&shape, [1920, 1920], head_m).unwrap();
            let dense = found.densest / truth.1;
            assert!(
                (0.995..1.02).contains(&dense),
                "{name} {x} {y}: densest is {dense} of the truth"
            );
            let sparse = found.sparsest / truth.0;
            assert!(
                (0.9..1.03).contains(&sparse),
                "{name} {x} {y}: sparsest is {sparse} of the truth"
            );
        }
    }
}

#[test]
fn from_the_centre_densities_are_known() {
    let centre = DVec3::new(0.0, 1.5, 0.0);
    // Rows: 1024 over 180°. Around the middle of a fisheye both directions are alike, at its edge π/2 pixels are across one.
    let found = pixel_density(&fisheye(180.0), [1024; 2], centre).unwrap();
    let across = 1024.0 / std::f64::consts::PI;
    assert!((found.sparsest / across - 1.0).abs() < 1e-6);
    assert!((found.densest / (across * std::f64::consts::FRAC_PI_2) - 1.005).abs() < 1e-4);
    let found = pixel_density(&grid([-90.0, 90.0], [0.0, 60.0]), [900, 300], centre).unwrap();
    let across = 900.0 / std::f64::consts::PI;
    assert!((found.sparsest / across - 1.0).abs() < 1e-6);
    assert!((found.densest / (2.0 * across) - 1.005).abs() < 1e-4);
    // At a pole columns meet; they count up to 3:1.
    let found = pixel_density(&grid([-180.0, 180.0], [-90.0, 90.0]), [2000, 1000], centre).unwrap();
    let rows = 1000.0 / std::f64::consts::PI;
    assert!(
        (found.densest / (3.0 * rows) - 1.0).abs() < 0.05,
        "{}",
        found.densest / rows
    );
}

#[test]
fn channels_know_their_density_too() {
    let mut random = Random(37);
    for (name, shape, room_m, radius_m) in smooth_screens()
        .into_iter()
        .filter(|screen| screen.0 != "planar")
    {
        let size_px = if name.contains("fisheye") {
            [1024; 2]
        } else {
            [1920, 1200]
        };
        let map = shape.channel_map(size_px, [0, 0, size_px[0], size_px[1]]);
        let sampled = SampledMap::new(&map, size_px).unwrap();
        for _ in 0..3 {
            let head_m = room_m + random.within(0.8 * radius_m);
            let found = sampled.density(head_m).unwrap();
            let truth = brute_force(&shape, size_px, head_m).unwrap();
            let (dense, sparse) = (found.densest / truth.1, found.sparsest / truth.0);
            assert!(
                (0.995..1.015).contains(&dense) && (0.99..1.01).contains(&sparse),
                "{name} {dense} {sparse}"
            );
        }
        assert_eq!(sampled.density(DVec3::NAN), None);
    }
}

#[test]
fn points_have_the_density_of_what_they_stand_for() {
    let smooth = siegen(2);
    let head_m = DVec3::new(0.2, 1.5, 0.3);
    let truth = brute_force(&smooth, [1920, 1200], head_m).unwrap();
    for at in [PointsAt::CellCentres, PointsAt::Corners] {
        let points = points_of(&smooth, 200, 150, at);
        let found = pixel_density(&points, [1920, 1200], head_m).unwrap();
        assert!(
            (found.densest / truth.1 - 1.0).abs() < 0.02
                && (found.sparsest / truth.0 - 1.0).abs() < 0.02
        );
    }
}

#[test]
fn heads_behind_a_screen_see_nothing_and_those_beside_it_a_part() {
    let size_px = [1920, 1200];
    let behind = [
        (planar(), DVec3::new(0.0, 1.0, -5.0)),
        (siegen(1), DVec3::new(-1.0, 1.0, -5.0)),
        (
            points_of(&siegen(1), 20, 20, PointsAt::Corners),
            DVec3::new(-1.0, 1.0, -5.0),
        ),
        (planar(), DVec3::NAN),
        (siegen(1), DVec3::NAN),
    ];
    for (shape, head_m) in behind {
        assert_eq!(pixel_density(&shape, size_px, head_m), None, "{shape:?}");
    }
    assert_eq!(pixel_density(&siegen(1), [0, 1200], DVec3::Y), None);
    // Outside a ring: the far half is seen from the front, the near one is not.
    let found = pixel_density(&arc([-180.0, 180.0]), size_px, DVec3::new(0.0, 1.2, 9.0)).unwrap();
    assert!(
        (0.5..0.7).contains(&found.seen_share),
        "{}",
        found.seen_share
    );
    let truth = brute_force(&arc([-180.0, 180.0]), size_px, DVec3::new(0.0, 1.2, 9.0)).unwrap();
    assert!((found.sparsest / truth.0 - 1.0).abs() < 0.02);
    // What is seen most flatly counts most, but not without bound.
    assert!(found.densest.is_finite() && found.densest < 60.0 * truth.0 * 10.0);
}

#[test]
fn canvases_of_left_handed_points_are_seen_by_nobody_inside() {
    let Shape::Points(points) = points_of(&siegen(1), 30, 20, PointsAt::Corners) else {
        panic!("points")
    };
    let mirrored = points
        .points_m()
        .chunks(30)
        .flat_map(|row| row.iter().rev().copied())
        .collect();
    let mirrored =
        Shape::Points(screens::Points::new(30, 20, mirrored, PointsAt::Corners).unwrap());
    assert!(pixel_density(&Shape::Points(points), [640, 480], DVec3::Y).is_some());
    assert_eq!(pixel_density(&mirrored, [640, 480], DVec3::Y), None);
}
