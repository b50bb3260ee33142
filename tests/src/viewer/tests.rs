//! The viewer's eye in rooms whose pictures are known.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use protocol::wall::Stereo;

use super::*;

/// Two projectors side by side on one screen of 4 m × 2 m, 3 m ahead of an eye at 1 m height; they share the canvas from
/// column 90 to 110.
fn wall(display: &str) -> Wall {
    let text = format!(
        "[wall]\nname = \"test\"\nfps = 30\n[[observers]]\nname = \"viewer\"\nhead_m = [0.0, 1.0, 0.0]\n\
         [[screens]]\nname = \"front\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [200, 100]\n\
         corners_m = {{ bottom_left = [-2.0, 0.0, -3.0], bottom_right = [2.0, 0.0, -3.0], top_left = [-2.0, 2.0, -3.0] }}\n\
         [[hosts]]\nname = \"a\"\n\
         [[hosts.outputs]]\nname = \"l\"\nsize_px = [110, 100]\nheadless = true\n{display}\
         channels = [{{ screen = \"front\", canvas_px = [0, 0, 110, 100], blend_px = {{ right = 20 }} }}]\n\
         [[hosts.outputs]]\nname = \"r\"\nsize_px = [110, 100]\nheadless = true\n{display}\
         channels = [{{ screen = \"front\", canvas_px = [90, 0, 110, 100], blend_px = {{ left = 20 }} }}]\n"
    );
    Wall::parse(&text, "test").unwrap()
}

/// Writes what both outputs show of a light that depends on the canvas's column and row.
fn captured(wall: &Wall, light: impl Fn(u32, u32) -> f64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (output, first) in wall.hosts[0].outputs.iter().zip([0, 90]) {
        let picture = RgbImage::from_fn(110, 100, |x, y| {
            let place = f64::from(x + first) + 0.5;
            let right = ((place - 90.0) / 20.0).clamp(0.0, 1.0);
            let share = if first == 0 { 1.0 - right } else { right };
            let light = light(x + first, y) * share;
            let value = output
                .gamma
                .map_or_else(|| flip::to_value(light), |gamma| light.powf(1.0 / gamma));
            Rgb([(value * 255.0).round() as u8; 3])
        });
        let file = format!("a-{}.png", output.name);
        picture.save(folder.path().join(file)).unwrap();
    }
    folder
}

fn camera() -> Camera {
    Camera::new(DVec3::new(0.0, 1.0, 0.0), 0.0, 0.0, 90.0, [80, 40])
}

#[test]
fn overlapping_projectors_add_up_whatever_their_gamma() {
    for display in ["", "gamma = 2.2\n"] {
        let wall = wall(display);
        let folder = captured(&wall, |_, _| 0.5);
        let seen = Room::load(&wall, folder.path()).seen(&camera(), Eye::Left, 3);
        let value = (flip::to_value(0.5) * 255.0).round();
        let mut lit = 0;
        for (pixel, complete) in seen.picture.pixels().zip(&seen.complete) {
            if *complete {
                lit += 1;
                let off = pixel.0.map(|part| (f64::from(part) - value).abs());
                assert!(off.iter().all(|off| *off <= 1.5), "{pixel:?} for {value}");
            } else {
                assert_eq!(pixel.0, [0; 3]);
            }
        }
        // The screen is 4 m of 6 m wide and 2 m of 3 m high. Pixels on its edge are seen in part.
        let [least, most] = [52 * 26, 54 * 27];
        assert!((least..=most).contains(&lit), "{lit} pixels");
        let compared = seen.compare(&seen.picture);
        assert_eq!(compared.flip, 0.0);
        assert!((compared.masked - 5.0 / 9.0).abs() < 0.03);
    }
}

#[test]
fn light_is_seen_where_it_shines() {
    let wall = wall("");
    // A spot around canvas column 150, row 25: 1 m to the right, 0.5 m above the eye, 3 m ahead.
    let spot = |x: u32, y: u32| f64::from(u8::from(x.abs_diff(150) < 3 && y.abs_diff(25) < 3));
    let folder = captured(&wall, spot);
    let room = Room::load(&wall, folder.path());
    let brightest = |camera: &Camera| {
        let seen = room.seen(camera, Eye::Centre, 2).picture;
        let lit = seen
            .enumerate_pixels()
            .max_by_key(|(_, _, pixel)| pixel.0[0]);
        let (x, y, _) = lit.unwrap();
        [x, y]
    };
    // 40 pixels to the tangent of 45°.
    assert_eq!(brightest(&camera()), [40 + 13, 20 - 7]);
    // From 1 m nearer, and from 1 m to the right.
    let at = |eye_m| camera().moved_to(DVec3::from_array(eye_m));
    assert_eq!(brightest(&at([0.0, 1.0, -1.0])), [40 + 20, 20 - 10]);
    assert_eq!(brightest(&at([1.0, 1.0, 0.0]))[1], 20 - 7);
    // Its image plane seen from its eye is its picture.
    let [bottom_left, bottom_right, top_left] = camera().corners_m();
    assert!(bottom_left.distance(DVec3::new(-1.0, 0.5, -1.0)) < 1e-12);
    assert!(bottom_right.distance(DVec3::new(1.0, 0.5, -1.0)) < 1e-12);
    assert!(top_left.distance(DVec3::new(-1.0, 1.5, -1.0)) < 1e-12);
}

#[test]
fn eyes_see_their_own_pictures() {
    let shared = |(stereo, _): &(Stereo, &str)| *stereo != Stereo::Off;
    for (stereo, name) in Stereo::NAMES.into_iter().filter(shared) {
        for swapped in [false, true] {
            let wall = wall(&format!("stereo = \"{name}\"\nswap_eyes = {swapped}\n"));
            // 0.8 of light for the one eye, 0.2 for the other one.
            let folder = tempfile::tempdir().unwrap();
            for output in ["l", "r"] {
                let picture = RgbImage::from_fn(110, 100, |x, y| {
                    let is_left = match stereo {
                        Stereo::Off | Stereo::RedCyan => [true, false, false],
                        Stereo::SideBySide => [x < 55; 3],
                        Stereo::TopBottom => [y < 50; 3],
                        Stereo::GreenMagenta => [false, true, false],
                        Stereo::AmberBlue => [true, true, false],
                        Stereo::InterlacedRows => [y % 2 == 0; 3],
                        Stereo::InterlacedColumns => [x % 2 == 0; 3],
                        Stereo::Checkerboard => [(x + y) % 2 == 0; 3],
                    };
                    Rgb(is_left.map(|left| if left != swapped { 230 } else { 120 }))
                });
                picture
                    .save(folder.path().join(format!("a-{output}.png")))
                    .unwrap();
            }
            let room = Room::load(&wall, folder.path());
            for (eye, value) in [(Eye::Left, 230), (Eye::Right, 120)] {
                let seen = room.seen(&camera(), eye, 1);
                // Left of both projectors' overlap.
                let pixel = seen.picture.get_pixel(20, 20).0;
                for part in (0..3).filter(|part| seen.components[*part]) {
                    assert_eq!(pixel[part], value, "{name}, swapped {swapped}, {eye:?}");
                }
                assert!(seen.components.contains(&true), "{name}");
            }
        }
    }
}
