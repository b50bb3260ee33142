//! VIOSO files: places, points, pictures of every depth, several outputs, and every way to be wrong.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::{Choice, Mapping, Options, ReadError, Texels, Uplift, read};
use support::{Bitmap, WarpMap, read_as, vwf_set};

/// 3 × 2 pixels, each at its own place; pixel (1, 0) is not valid.
fn warp(name: &'static str) -> WarpMap {
    let mut records: Vec<[f32; 4]> = support::even(3, 2)
        .iter()
        .map(|[u, v]| [*u, *v, 1.0, 0.0])
        .collect();
    records[1][2] = 0.0;
    WarpMap::new(name, [3, 2], records)
}

/// Grey levels of 8 bits, 3 × 2.
fn grey(levels: [u8; 6]) -> Bitmap {
    Bitmap {
        bits: 24,
        top_down: true,
        size: [3, 2],
        pixels: levels.iter().flat_map(|level| [*level; 3]).collect(),
    }
}

#[test]
fn places_count_from_the_upper_left_corner_and_invalid_ones_are_holes() {
    let calibration = read_as(&warp("left").bytes(), "a.vwf").unwrap();
    let region = &calibration.regions[0];
    assert_eq!((region.name.as_str(), region.size_px), ("left", [3, 2]));
    let Mapping::Canvas(uv) = &region.mapping else {
        panic!("a canvas is due")
    };
    let mut wanted = support::even(3, 2);
    wanted[1] = [f32::NAN; 2];
    assert!(support::same(&uv.values, &wanted), "{:?}", uv.values);
    assert!(region.alpha.is_none() && region.beta.is_none());
}

#[test]
fn points_and_their_unit() {
    let records = vec![
        [100.0, 200.0, -300.0, 1.0],
        [1.0, 1.0, 1.0, 0.0],
        [0.0, f32::NAN, 0.0, 1.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let map = WarpMap {
        flags: 0x40,
        ..WarpMap::new("a", [2, 2], records)
    };
    let options = Options {
        unit_m: 0.01,
        ..Options::default()
    };
    let calibration = read(&map.bytes(), "a.vwf", &options).unwrap();
    let Mapping::Points { points_m, .. } = &calibration.regions[0].mapping else {
        panic!("points are due")
    };
    assert_eq!(points_m.at(0, 0), Some([1.0, 2.0, -3.0]));
    assert_eq!((points_m.at(1, 0), points_m.at(0, 1)), (None, None));
    assert_eq!(points_m.at(1, 1), Some([0.0; 3]));
}

#[test]
fn a_set_of_two_outputs_with_pictures_and_longer_headers() {
    let mut left = warp("left");
    left.flags = 0x20;
    left.black = [0.5, 0.25, 0.75];
    left.extra = 4000;
    let blocks = vec![
        left.bytes(),
        grey([0, 51, 102, 153, 204, 255]).bytes(),
        grey([255, 0, 0, 0, 0, 51]).bytes(),
        warp("right").bytes(),
        Bitmap {
            size: [0, 0],
            pixels: vec![],
            ..grey([0; 6])
        }
        .bytes(),
    ];
    let bytes = vwf_set(&blocks);
    let calibration = read_as(&bytes, "a.vwf").unwrap();
    let [left, right] = calibration.regions.as_slice() else {
        panic!("two regions are due")
    };
    let Some(Texels::Grey(alpha)) = left.alpha.as_ref().map(|map| &map.texels) else {
        panic!("grey is due")
    };
    assert_eq!(alpha, &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
    let Some(Texels::Grey(beta)) = left.beta.as_ref().map(|map| &map.texels) else {
        panic!("grey is due")
    };
    assert_eq!(beta, &[0.5, 0.0, 0.0, 0.0, 0.0, 0.1]);
    assert_eq!(
        left.uplift,
        Uplift {
            dark: 0.25,
            bright: 0.75
        }
    );
    assert!(right.alpha.is_none() && right.beta.is_none());
    assert!(
        calibration.notes.iter().any(|note| note.contains("gamma")),
        "{:?}",
        calibration.notes
    );
    for choice in [Choice::Name("right".to_owned()), Choice::Number(1)] {
        let options = Options {
            region: Some(choice),
            ..Options::default()
        };
        let chosen = read(&bytes, "a.vwf", &options).unwrap();
        assert_eq!(chosen.regions.len(), 1);
        assert_eq!(chosen.regions[0].name, "right");
    }
}

#[test]
fn bitmaps_of_every_depth_and_row_order_are_the_same_picture() {
    let colours: [[f32; 3]; 6] = [
        [0.0, 0.2, 1.0],
        [0.4, 0.6, 0.8],
        [1.0, 1.0, 0.0],
        [0.2, 0.4, 0.6],
        [0.8, 0.0, 0.2],
        [0.6, 0.8, 0.4],
    ];
    let short = |value: f32| ((value * 65535.0).round() as u16).to_le_bytes();
    let byte = |value: f32| (value * 255.0).round() as u8;
    let pack = |bits: u16, [red, green, blue]: [f32; 3]| -> Vec<u8> {
        match bits {
            24 => vec![byte(blue), byte(green), byte(red)],
            32 => vec![byte(blue), byte(green), byte(red), 9],
            48 => [blue, green, red].map(short).concat(),
            64 => [red, green, blue, 0.3].map(short).concat(),
            _ => [blue, green, red].map(f32::to_le_bytes).concat(),
        }
    };
    for bits in [24, 32, 48, 64, 96] {
        for top_down in [true, false] {
            let pixels = colours
                .iter()
                .flat_map(|colour| pack(bits, *colour))
                .collect();
            let picture = Bitmap {
                bits,
                top_down,
                size: [3, 2],
                pixels,
            };
            let bytes = [warp("a").bytes(), picture.bytes()].concat();
            let calibration = read_as(&bytes, "a.vwf").unwrap();
            let map = calibration.regions[0].alpha.clone().unwrap();
            let Texels::Colour(found) = &map.texels else {
                panic!("colours are due")
            };
            let near = found
                .iter()
                .flatten()
                .zip(colours.iter().flatten())
                .all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(near, "{bits} {top_down}: {found:?}");
        }
    }
}

#[test]
fn a_map_without_records_shows_every_pixel_its_own_place() {
    let empty = WarpMap::new("a", [3, 2], vec![]);
    let bytes = [empty.bytes(), grey([255; 6]).bytes()].concat();
    let region = &read_as(&bytes, "a.vwf").unwrap().regions[0];
    assert_eq!(region.mapping, Mapping::Identity);
    assert!(region.alpha.is_some());
}

#[test]
fn what_is_wrong_is_named() {
    let whole = vwf_set(&[warp("a").bytes(), grey([0; 6]).bytes()]);
    for cut in [1, 20, 60, 100, 200, whole.len() - 16, whole.len() - 30] {
        let error = read_as(&whole[..whole.len() - cut], "a.vwf").unwrap_err();
        assert!(
            matches!(
                error,
                ReadError::Truncated { .. } | ReadError::Damaged { .. }
            ),
            "{cut}: {error}"
        );
    }
    let with = |place: usize, value: u32| {
        let mut bytes = warp("a").bytes();
        bytes[place..place + 4].copy_from_slice(&value.to_le_bytes());
        read_as(&bytes, "a.vwf").unwrap_err()
    };
    assert!(
        matches!(with(4, 379), ReadError::Damaged { .. }),
        "a short header"
    );
    assert!(
        matches!(with(4, u32::MAX), ReadError::Truncated { .. }),
        "a long header"
    );
    assert!(
        matches!(with(8, 1), ReadError::Unsupported { .. }),
        "zipped"
    );
    assert!(
        matches!(with(8, 0x400), ReadError::Unsupported { .. }),
        "an unknown flag"
    );
    assert!(
        matches!(with(16, 95), ReadError::Damaged { .. }),
        "another size of records"
    );
    assert!(matches!(with(20, 0), ReadError::BadSize { .. }), "no width");
    assert!(
        matches!(with(20, 20_000), ReadError::BadSize { .. }),
        "a huge width"
    );
    assert!(
        matches!(with(24, -2_i32 as u32), ReadError::BadSize { .. }),
        "a negative height"
    );
    assert!(
        matches!(
            read_as(&grey([0; 6]).bytes(), "a.vwf"),
            Err(ReadError::Damaged { .. })
        ),
        "no warp map"
    );
    assert!(
        matches!(
            read_as(&vwf_set(&[]), "a.vwf"),
            Err(ReadError::Damaged { .. })
        ),
        "an empty set"
    );
    let picture_first = vwf_set(&[grey([0; 6]).bytes()]);
    assert!(
        matches!(
            read_as(&picture_first, "a.vwf"),
            Err(ReadError::Damaged { .. })
        ),
        "a picture first"
    );
}

#[test]
fn wrong_pictures_are_named() {
    let after =
        |picture: &[u8]| read_as(&[&warp("a").bytes(), picture].concat(), "a.vwf").unwrap_err();
    let other_size = Bitmap {
        size: [2, 3],
        ..grey([0; 6])
    };
    let error = after(&other_size.bytes());
    assert!(
        matches!(
            error,
            ReadError::WrongSize {
                found_px: [2, 3],
                expected_px: [3, 2],
                ..
            }
        ),
        "{error}"
    );
    let mut compressed = grey([0; 6]).bytes();
    compressed[30] = 1;
    assert!(matches!(after(&compressed), ReadError::Unsupported { .. }));
    let mut palette = grey([0; 6]).bytes();
    palette[28] = 8;
    assert!(matches!(after(&palette), ReadError::Unsupported { .. }));
    let mut huge = grey([0; 6]).bytes();
    huge[18..22].copy_from_slice(&40_000_u32.to_le_bytes());
    assert!(matches!(after(&huge), ReadError::BadSize { .. }));
    let floats = Bitmap {
        bits: 96,
        top_down: true,
        size: [3, 2],
        pixels: [
            [1.0_f32; 3],
            [1.0; 3],
            [1.0; 3],
            [1.0; 3],
            [1.0, f32::NAN, 1.0],
            [1.0; 3],
        ]
        .as_flattened()
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect(),
    };
    let error = after(&floats.bytes());
    let ReadError::NotANumber {
        what, column, row, ..
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!((what, column, row), ("alpha map", 1, 1));
}

#[test]
fn maps_of_holes_only_and_too_many_maps_are_refused() {
    let empty = WarpMap::new("a", [2, 2], vec![[0.5, 0.5, 0.0, 0.0]; 4]);
    let error = read_as(&empty.bytes(), "a.vwf").unwrap_err();
    assert!(matches!(error, ReadError::NothingMapped { .. }), "{error}");
    let many = vwf_set(&vec![warp("a").bytes(); 257]);
    let error = read_as(&many, "a.vwf").unwrap_err();
    assert!(matches!(error, ReadError::TooMany { .. }), "{error}");
}
