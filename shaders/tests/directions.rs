//! The stages that know directions: slope, aspect, hill shade, on many tiles of all faces, against an
//! independent computation in f64 from latitudes and longitudes.

mod common;

use common::{at, bytes, words};
use shaders::cpu;
use shaders::{AspectUniform, HillshadeUniform, SlopeUniform, TileGeometry};

const RADIUS_M: f64 = 6_371_000.0;

/// A tile, and a node of it to look at.
#[derive(Clone, Copy, Debug)]
struct Place {
    face: u8,
    level: u8,
    x: u32,
    y: u32,
    node: (i32, i32),
}

/// The unit vector of a node, by the definition of S2's quadratic projection and axes.
fn unit_vector(place: Place, i: i32, j: i32) -> [f64; 3] {
    let nodes = 256.0 * f64::from(1_u32 << place.level);
    let cube = |cells: f64| {
        let s = cells / nodes;
        if s >= 0.5 {
            (4.0 * s * s - 1.0) / 3.0
        } else {
            (1.0 - 4.0 * (1.0 - s) * (1.0 - s)) / 3.0
        }
    };
    let u = cube(f64::from(place.x) * 256.0 + f64::from(i));
    let v = cube(f64::from(place.y) * 256.0 + f64::from(j));
    let point = match place.face {
        0 => [1.0, u, v],
        1 => [-u, 1.0, v],
        2 => [-u, -v, 1.0],
        3 => [-1.0, -v, -u],
        4 => [v, -1.0, -u],
        _ => [v, u, -1.0],
    };
    let length = dot(point, point).sqrt();
    point.map(|c| c / length)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A slot of a hill side that at the place's node falls with `tangent` (rise over run) towards `azimuth_deg`.
fn hill_side(place: Place, tangent: f64, azimuth_deg: f64) -> Vec<u32> {
    let [x, y, z] = unit_vector(place, place.node.0, place.node.1);
    let (longitude, latitude) = (y.atan2(x), z.atan2(x.hypot(y)));
    let (sin_lon, cos_lon) = longitude.sin_cos();
    let (sin_lat, cos_lat) = latitude.sin_cos();
    let east = [-sin_lon, cos_lon, 0.0];
    let north = [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat];
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let descent = [0, 1, 2].map(|axis| sin * east[axis] + cos * north[axis]);
    words(|i, j| {
        // Only the neighbourhood matters.
        if (i - place.node.0).abs() > 1 || (j - place.node.1).abs() > 1 {
            return 0;
        }
        let height = -tangent * RADIUS_M * dot(unit_vector(place, i, j), descent);
        (height as f32).to_bits()
    })
}

fn geometry(place: Place) -> TileGeometry {
    TileGeometry::new(place.face, place.level, place.x, place.y, RADIUS_M as f32)
}

/// Tiles of all faces from the coarsest to the finest level, the poles' own tiles among them.
fn places() -> Vec<Place> {
    let mut places = Vec::new();
    for face in 0..6 {
        for (level, x, y, node) in [
            (0, 0, 0, (30, 200)),
            (0, 0, 0, (256, 0)),
            (1, 1, 0, (17, 100)),
            (3, 2, 7, (-1, 257)),
            (6, 33, 20, (128, 128)),
            (11, 5, 2000, (200, 40)),
            // Beside the face's middle: a pole on faces 2 and 5.
            (6, 32, 32, (3, 5)),
            (14, 8192, 8191, (1, 250)),
            (22, 1 << 21, 1 << 21, (3, 5)),
            (22, (1 << 21) - 1, 1 << 21, (255, 1)),
            (22, 4_000_001, 123_456, (64, 192)),
        ] {
            places.push(Place {
                face,
                level,
                x,
                y,
                node,
            });
        }
    }
    places
}

/// The hue of a colour in degrees.
fn hue_deg(word: u32) -> f64 {
    let [red, green, blue, _] = bytes(word).map(f64::from);
    let most = red.max(green).max(blue);
    let range = most - red.min(green).min(blue);
    let sixth = if most == red {
        (green - blue) / range
    } else if most == green {
        (blue - red) / range + 2.0
    } else {
        (red - green) / range + 4.0
    };
    (sixth * 60.0).rem_euclid(360.0)
}

#[test]
fn aspect_is_the_compass_direction_of_descent() {
    for place in places() {
        let parameters = AspectUniform {
            tile: geometry(place),
            saturation: 1.0,
            brightness: 1.0,
            flat_sine: 0.01,
            padding: 0,
        };
        for azimuth_deg in [0.0, 90.0, 180.0, 270.0, 33.0, 301.0] {
            let slot = hill_side(place, 0.3, azimuth_deg);
            let word = at(
                &cpu::aspect::run(&parameters, &[&slot]),
                place.node.0,
                place.node.1,
            );
            let turned = (hue_deg(word) - azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
            // A byte of hue is 0.24°; at level 0 the lattice bends within a step.
            let tolerance = if place.level == 0 { 0.6 } else { 0.3 };
            assert!(
                turned.abs() < tolerance,
                "{place:?} {azimuth_deg}°: {turned}° off"
            );
        }
    }
}

#[test]
fn aspect_colours_are_red_north_and_cyan_south_and_flat_ground_has_none() {
    let place = places()[4];
    let mut parameters = AspectUniform {
        tile: geometry(place),
        saturation: 0.8,
        brightness: 0.9,
        flat_sine: 1_f32.to_radians().sin(),
        padding: 0,
    };
    let shown = |parameters: &AspectUniform, tangent: f64, azimuth: f64| {
        let slot = hill_side(place, tangent, azimuth);
        bytes(at(
            &cpu::aspect::run(parameters, &[&slot]),
            place.node.0,
            place.node.1,
        ))
    };
    // 0.9 · 255 and 0.9 · (1 − 0.8) · 255.
    let near = |a: [i32; 4], b: [i32; 4]| a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1);
    let (north, south) = (shown(&parameters, 1.0, 0.0), shown(&parameters, 1.0, 180.0));
    assert!(near(north, [230, 46, 46, 255]), "{north:?}");
    assert!(near(south, [46, 230, 230, 255]), "{south:?}");
    assert_eq!(
        shown(&parameters, 0.99 * 1_f64.to_radians().tan(), 45.0),
        [0; 4]
    );
    assert_ne!(
        shown(&parameters, 1.01 * 1_f64.to_radians().tan(), 45.0),
        [0; 4]
    );
    parameters.flat_sine = 0.0;
    assert_eq!(
        shown(&parameters, 0.0, 0.0),
        [0; 4],
        "level ground has no direction"
    );
}

#[test]
fn slope_is_the_angle_from_the_horizontal() {
    for place in places() {
        let parameters = SlopeUniform {
            tile: geometry(place),
            gentle: [0.0, 1.0, 0.5, 1.0],
            steep: [1.0, 0.0, 0.5, 1.0],
            range_deg: [0.0, 90.0],
            padding: [0; 2],
        };
        for (angle_deg, azimuth_deg) in [
            (0.0, 0.0),
            (5.0, 10.0),
            (30.0, 100.0),
            (45.0, 215.0),
            (80.0, 340.0),
        ] {
            let slot = hill_side(place, f64::to_radians(angle_deg).tan(), azimuth_deg);
            let word = at(
                &cpu::slope::run(&parameters, &[&slot]),
                place.node.0,
                place.node.1,
            );
            let [red, green, blue, alpha] = bytes(word);
            let exact = angle_deg / 90.0 * 255.0;
            assert!(
                (f64::from(red) - exact).abs() <= 1.0,
                "{place:?} {angle_deg}°: {red} for {exact}"
            );
            assert!((red + green - 255).abs() <= 1 && blue == 128 && alpha == 255);
        }
    }
}

#[test]
fn slope_colours_are_kept_beyond_their_range() {
    let place = places()[4];
    let parameters = SlopeUniform {
        tile: geometry(place),
        gentle: [0.2, 0.2, 0.2, 1.0],
        steep: [1.0, 0.0, 0.0, 1.0],
        range_deg: [10.0, 20.0],
        padding: [0; 2],
    };
    let shown = |angle_deg: f64| {
        let slot = hill_side(place, angle_deg.to_radians().tan(), 77.0);
        bytes(at(
            &cpu::slope::run(&parameters, &[&slot]),
            place.node.0,
            place.node.1,
        ))
    };
    assert_eq!(shown(9.0), [51, 51, 51, 255]);
    assert_eq!(shown(21.0), [255, 0, 0, 255]);
}

#[test]
fn hill_shade_is_the_cosine_between_ground_and_light() {
    for place in places() {
        for (azimuth_deg, altitude_deg, exaggeration) in
            [(315.0, 45.0, 1.0), (90.0, 20.0, 1.0), (200.0, 60.0, 3.0)]
        {
            let (sin_az, cos_az) = f64::to_radians(azimuth_deg).sin_cos();
            let (sin_alt, cos_alt) = f64::to_radians(altitude_deg).sin_cos();
            let light = [sin_az * cos_alt, cos_az * cos_alt, sin_alt];
            let parameters = HillshadeUniform {
                tile: geometry(place),
                light: light.map(|c| c as f32),
                exaggeration: exaggeration as f32,
            };
            for (tangent, descent_deg) in [(0.0, 0.0), (0.5, 315.0), (0.5, 135.0), (1.0, 60.0)] {
                let slot = hill_side(place, tangent, descent_deg);
                let word = at(
                    &cpu::hillshade::run(&parameters, &[&slot]),
                    place.node.0,
                    place.node.1,
                );
                let (sin, cos) = f64::to_radians(descent_deg).sin_cos();
                let steep = tangent * exaggeration;
                let normal = [steep * sin, steep * cos, 1.0];
                let exact = dot(light, normal).max(0.0) / dot(normal, normal).sqrt() * 255.0;
                let [grey, _, _, alpha] = bytes(word);
                // At level 0 the lattice bends within a step.
                let tolerance = if place.level == 0 { 1.6 } else { 0.6 };
                assert!(
                    (f64::from(grey) - exact).abs() <= tolerance,
                    "{place:?}: {grey} for {exact}"
                );
                assert_eq!(alpha, 255);
            }
        }
    }
}
