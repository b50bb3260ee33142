//! Blending: what projectors add up to, and what calibration files say of light.
//! In: walls and calibrations that these tests write. Out: verdicts on numbers. It draws nothing.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use super::*;

#[test]
fn two_projectors_add_up_to_one_over_their_overlap() {
    for gamma in [0.3, 1.0, 2.0, 4.5] {
        let blend = |ramps_px| Blend {
            ramps_px,
            gamma,
            black_level: 0.02,
        };
        let left = ramps(&blend([0, 40, 0, 0]), [100, 3], None).unwrap();
        let right = ramps(&blend([40, 0, 0, 0]), [100, 3], None).unwrap();
        for column in 0..160_usize {
            let of = |map: &LightMap, first: usize| {
                let own = column.checked_sub(first).filter(|own| *own < 100)?;
                Some((map.alpha[100 + own][1], map.beta[100 + own][1]))
            };
            let parts = [of(&left, 0), of(&right, 60)];
            let light: f32 = parts.iter().flatten().map(|(alpha, _)| alpha).sum();
            assert!((light - 1.0).abs() < 1e-6, "{column}: {light}");
            // Each projector's own black, and what is added to it.
            let black: f32 = parts.iter().flatten().map(|(_, beta)| 0.02 + beta).sum();
            assert!((black - 0.04).abs() < 1e-6, "{column}: {black}");
        }
    }
}

#[test]
fn where_four_meet_all_blacks_are_alike() {
    let blend = Blend {
        ramps_px: [0, 10, 0, 10],
        gamma: 1.0,
        black_level: 0.01,
    };
    let map = ramps(&blend, [30, 30], None).unwrap();
    let black = |x: usize, y: usize, projectors: f32| projectors * (0.01 + map.beta[30 * y + x][0]);
    for (x, y, projectors) in [(5, 5, 1.0), (25, 5, 2.0), (5, 25, 2.0), (25, 25, 4.0)] {
        assert!((black(x, y, projectors) - 0.04).abs() < 1e-6, "{x} {y}");
    }
    assert!(ramps(&Blend::default(), [30, 30], None).is_none());
}

/// Where a room point lies in the picture of a chord segment, by hand: along the ray from the place of alignment back onto
/// the plane of the corners (`warping.cpp` of ecmview, as cited in `screens`), in pixels of the canvas.
fn chord_place_px(screen: &Screen, point_m: DVec3) -> Option<[f64; 2]> {
    let ScreenShape::Cylinder {
        canvas: CylinderCanvas::Chord {
            corners_m,
            aligned_from_m,
        },
        ..
    } = &screen.shape
    else {
        return None;
    };
    let [origin, right, upper] = [
        corners_m.bottom_left,
        corners_m.bottom_right,
        corners_m.top_left,
    ]
    .map(DVec3::from);
    let (u, v) = (right - origin, upper - origin);
    let (from, normal) = (DVec3::from(*aligned_from_m), u.cross(v));
    let along = point_m - from;
    let distance = normal.dot(origin - from) / normal.dot(along);
    let on_plane = from + along * distance - origin;
    let x = on_plane.dot(u) / u.length_squared();
    let y = 1.0 - on_plane.dot(v) / v.length_squared();
    let [width, height] = screen.size_px.map(f64::from);
    let is_on = distance > 0.0 && (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y);
    is_on.then_some([x * width, y * height])
}

/// The light of a channel at a place in pixels, bilinear between the middles of pixels.
fn alpha_at(light: Option<&LightMap>, [x, y]: [f64; 2]) -> f64 {
    let Some(light) = light else { return 1.0 };
    let [width, height] = light.size_px;
    let split = |place: f64, size: u32| {
        let place = (place - 0.5).clamp(0.0, f64::from(size - 1));
        let first = (place as u32).min(size - 2);
        (first as usize, place - f64::from(first))
    };
    let ((column, right), (row, down)) = (split(x, width), split(y, height));
    let at = |x: usize, y: usize| f64::from(light.alpha[y * width as usize + x][0]);
    let line = |row: usize| at(column, row) * (1.0 - right) + at(column + 1, row) * right;
    line(row) * (1.0 - down) + line(row + 1) * down
}

/// Light of the four segments of Siegen's cylinder and of the two of its floor, as the left eye sees them: nowhere more or
/// less than one by more than a hundredth. Even in pixels, the ramps of the cylinder would be off by 2.7 %.
#[test]
fn projectors_of_siegen_add_up_to_one_on_their_cylinder() {
    let text = include_str!("../../../../configs/walls/vrlab-siegen.toml");
    let wall = protocol::Wall::parse(text, "vrlab-siegen.toml").unwrap();
    let outputs = wall.hosts.iter().flat_map(|host| &host.outputs);
    let of_left = |channel: &&Channel| channel.eye == protocol::wall::Eye::Left;
    let lit: Vec<(&Screen, &Channel, Option<LightMap>, Option<LightMap>)> = outputs
        .flat_map(|output| &output.channels)
        .filter(of_left)
        .map(|channel| {
            let screen = &wall.screens[channel.screen];
            let in_pixels = ramps(&channel.blend, channel.size_px, None);
            (screen, channel, of_channel(screen, channel), in_pixels)
        })
        .collect();
    let mut worst = [0.0_f64; 2];
    let mut blended = 0;
    // On the cylinder, from the middle of the first segment to that of the last one.
    for step in 0..=4000 {
        let azimuth = f64::to_radians(-70.0 + 140.0 * f64::from(step) / 4000.0);
        for height_m in [0.35, 1.0, 1.78, 2.2] {
            let point_m = DVec3::new(2.4912 * azimuth.sin(), height_m, -2.4912 * azimuth.cos());
            let mut sums = [0.0_f64; 2];
            let mut count = 0;
            for (screen, channel, light, in_pixels) in &lit {
                let Some(place) = chord_place_px(screen, point_m) else {
                    continue;
                };
                assert_eq!(channel.canvas_px.x + channel.canvas_px.y, 0);
                sums[0] += alpha_at(light.as_ref(), place);
                sums[1] += alpha_at(in_pixels.as_ref(), place);
                count += 1;
            }
            assert!((1..=2).contains(&count), "{azimuth} {height_m}: {count}");
            blended += usize::from(count == 2);
            for (worst, sum) in worst.iter_mut().zip(sums) {
                *worst = worst.max((sum - 1.0).abs());
            }
        }
    }
    assert!(blended > 1000, "{blended} places are in overlaps");
    assert!(worst[0] < 0.01, "off by {}", worst[0]);
    // What this is for.
    assert!(worst[1] > 0.02, "in pixels off by {}", worst[1]);
    let floor: Vec<_> = lit
        .iter()
        .filter(|(screen, ..)| screen.shape.planar().is_some())
        .collect();
    assert_eq!(floor.len(), 2);
    for step in 0..=1000 {
        let x_m = -2.4 + 4.8 * f64::from(step) / 1000.0;
        let sum: f64 = floor
            .iter()
            .filter_map(|(screen, _, light, _)| {
                let corners = screen.shape.planar()?;
                let share = (x_m - corners.bottom_left[0])
                    / (corners.bottom_right[0] - corners.bottom_left[0]);
                let place = [share * 1400.0, 500.0];
                (0.0..=1.0)
                    .contains(&share)
                    .then(|| alpha_at(light.as_ref(), place))
            })
            .sum();
        assert!((sum - 1.0).abs() < 0.01, "{x_m}: {sum}");
    }
}

/// A map of light of an archive, as `gammaEmbedded` of MPCDI wants it: light = (value / 65535) ^ gamma.
#[test]
fn light_of_an_archive_is_its_values_to_the_power_of_its_gamma() {
    use calibration::{Calibration, Gamma, Grid, Mapping, Options, Placement, Texels, mpcdi, read};
    let size_px = [4_u32, 2];
    let greys: Vec<f32> = (0..8_u16).map(|k| f32::from(k) / 7.0).collect();
    let colours: Vec<[f32; 3]> = (0..8_u16)
        .map(|k| [0.1, 0.2, 0.3].map(|share: f32| share * f32::from(k) / 14.0))
        .collect();
    let written = Calibration {
        regions: vec![Region {
            name: "a".to_owned(),
            size_px,
            mapping: Mapping::Canvas(
                Grid::new(2, 2, Placement::Centres, vec![[0.5; 2]; 4]).unwrap(),
            ),
            alpha: Map::new(4, 2, Texels::Grey(greys.clone())),
            beta: Map::new(4, 2, Texels::Colour(colours.clone())),
            gamma: Gamma {
                alpha: 2.2,
                beta: 1.7,
            },
            uplift: calibration::Uplift::default(),
            canvas: None,
            distortion: None,
        }],
        ..Calibration::default()
    };
    let bytes = mpcdi::write(&written).unwrap();
    let region = read(&bytes, "a.mpcdi", &Options::default()).unwrap();
    let region = &region.regions[0];
    let blend = Blend {
        ramps_px: [2, 0, 0, 0],
        gamma: 1.0,
        black_level: 0.1,
    };
    let ramp = [0.25, 0.75, 1.0, 1.0];
    for own in [None, ramps(&blend, size_px, None)] {
        let has_ramp = own.is_some();
        let light = calibrated(region, size_px, own).unwrap();
        assert_eq!(light.size_px, size_px);
        assert_eq!((light.uplift.dark, light.uplift.bright), (1.0, 1.0));
        for index in 0..8 {
            // What 16 bits keep of a value.
            let kept = |value: f32| (f64::from(value) * 65_535.0).round() / 65_535.0;
            let factor = if has_ramp { ramp[index % 4] } else { 1.0 };
            let alpha = kept(greys[index]).powf(2.2) * factor;
            for (part, colour) in colours[index].into_iter().enumerate() {
                let beta = kept(colour).powf(1.7);
                let found = [light.alpha[index][part], light.beta[index][part]].map(f64::from);
                assert!(
                    (found[0] - alpha).abs() < 1e-5,
                    "{index}: {found:?} {alpha}"
                );
                assert!((found[1] - beta).abs() < 1e-5, "{index}: {found:?} {beta}");
            }
        }
    }
    // Of a channel of half the size, each pixel lies amid four of the map: the mean of their values, then the power.
    let light = calibrated(region, [2, 1], None).unwrap();
    for (index, four) in [[0, 1, 4, 5], [2, 3, 6, 7]].into_iter().enumerate() {
        let mean: f32 = four.iter().map(|k| greys[*k]).sum::<f32>() / 4.0;
        let found = f64::from(light.alpha[index][0]);
        assert!((found - f64::from(mean).powf(2.2)).abs() < 1e-4, "{found}");
    }
}
