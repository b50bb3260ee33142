//! Wide imagery and amplitudes against their sources: where they lie, what they are, on the finest level and above.
//!
//! Ramps measure the position, the real scenes measure the values, an independent kernel measures the pyramid.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test that panics has failed, and what it prints is its result"
)]

mod support;

use std::path::Path;

use geodesy::Tile;
use proj4rs::Proj;
use proj4rs::transform::transform;
use support::{Placement, Random, Values, options, real, run, write_bands};
use tiff::decoder::{Decoder, DecodingResult};
use tiff::encoder::colortype;
use tiff::tags::ExtraSamples;
use tiles::{Kind, SampleType, Validity};

/// Positions tried in each source.
const TRIES: usize = 10_000;
/// A position may be off by this many samples.
const POSITION_TOLERANCE: f64 = 0.1;
/// Units a sample on the ramps, so that whole numbers are fine enough.
const SLOPE: f64 = 64.0;

const DEGREES: &str = "+proj=longlat +datum=WGS84 +no_defs";

const fn placed(epsg: u16, x: f64, y: f64, dx: f64, dy: f64, point: bool) -> Placement {
    Placement {
        epsg,
        geographic: epsg == 4326,
        x,
        y,
        dx,
        dy,
        point,
    }
}

const CASES: &[(&str, &str, Placement)] = &[
    (
        "degrees, points, across the antimeridian",
        DEGREES,
        placed(4326, 178.5, 52.0, 0.005, 0.005, true),
    ),
    (
        "UTM, wide pixels",
        "+proj=utm +zone=30 +datum=WGS84 +units=m +no_defs",
        placed(32630, 430_000.0, 5_400_000.0, 50.0, 25.0, false),
    ),
    (
        "south pole, stereographic",
        "+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=0 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs",
        placed(3031, -500_000.0, 450_000.0, 2000.0, 2000.0, false),
    ),
];
const SIZE: (u32, u32) = (600, 450);

/// Latitude and longitude of model coordinates.
fn angles(own: &Proj, placement: Placement, (x, y): (f64, f64)) -> (f64, f64) {
    let base = Proj::from_proj_string(DEGREES).unwrap();
    let mut point = if placement.geographic {
        (x.to_radians(), y.to_radians(), 0.0)
    } else {
        (x, y, 0.0)
    };
    transform(own, &base, &mut point).unwrap();
    (point.1.to_degrees(), point.0.to_degrees())
}

/// Bands that rise with the column, with the row, and with both.
fn ramp(column: f64, row: f64, band: usize) -> f64 {
    match band {
        0 => SLOPE * column,
        1 => SLOPE * row,
        _ => 0.5 * SLOPE * (column + row),
    }
}

#[test]
fn positions_are_within_a_tenth_of_a_sample() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("ramp.tif");
    let into = directory.path().join("repository");
    // Three bands and four take different ways through the reading.
    let extra = [ExtraSamples::Unspecified];
    for (name, proj, placement) in CASES.iter().copied() {
        for (sample_type, extra) in [
            (SampleType::U16, &extra[..0]),
            (SampleType::U16, &extra[..]),
            (SampleType::F32, &extra[..0]),
            (SampleType::F32, &extra[..]),
        ] {
            if sample_type == SampleType::U16 {
                write_bands::<colortype::RGB16>(&path, SIZE, placement, None, extra, |c, r, b| {
                    ramp(f64::from(c), f64::from(r), b) as u16
                });
            } else {
                write_bands::<colortype::RGB32Float>(
                    &path,
                    SIZE,
                    placement,
                    None,
                    extra,
                    |c, r, b| ramp(f64::from(c), f64::from(r), b) as f32,
                );
            }
            let _ = std::fs::remove_dir_all(&into);
            let report = run(&options(Kind::Imagery, std::slice::from_ref(&path), &into)).unwrap();
            let mut values = Values::open(&into);
            assert_eq!(values.repository.dataset().sample_type, sample_type);
            let own = Proj::from_proj_string(proj).unwrap();
            let mut random = Random(7);
            let mut worst = 0.0_f64;
            for _ in 0..TRIES / 4 {
                let column = random.within(2.0, f64::from(SIZE.0) - 3.0);
                let row = random.within(2.0, f64::from(SIZE.1) - 3.0);
                let (latitude, longitude) = angles(&own, placement, placement.model(column, row));
                for band in 0..3 + extra.len() {
                    let value = values
                        .at(latitude, longitude, report.levels[0], band as u8)
                        .unwrap_or_else(|| panic!("{name}: no value at {column}, {row}"));
                    worst = worst.max((value - ramp(column, row, band)).abs() / SLOPE);
                }
            }
            println!(
                "{name}, {} bands of {sample_type:?}: {worst:.4} samples",
                3 + extra.len()
            );
            assert!(worst < POSITION_TOLERANCE, "{name}: {worst} samples");
        }
    }
}

/// A real scene, read without this crate.
struct Scene {
    placement: Placement,
    proj: &'static str,
    width: usize,
    height: usize,
    bands: usize,
    samples: Vec<f64>,
}

impl Scene {
    fn of(path: &Path, proj: &'static str) -> Self {
        let mut decoder = Decoder::new(std::fs::File::open(path).unwrap()).unwrap();
        let (width, height) = decoder.dimensions().unwrap();
        let samples: Vec<f64> = match decoder.read_image().unwrap() {
            DecodingResult::U16(values) => values.iter().map(|value| f64::from(*value)).collect(),
            DecodingResult::F32(values) => values.iter().map(|value| f64::from(*value)).collect(),
            _ => panic!("neither 16 bits nor floating point"),
        };
        let tag = |decoder: &mut Decoder<_>, tag| decoder.get_tag_f64_vec(tag).unwrap();
        let scale = tag(&mut decoder, tiff::tags::Tag::ModelPixelScaleTag);
        let tie = tag(&mut decoder, tiff::tags::Tag::ModelTiepointTag);
        let (width, height) = (width as usize, height as usize);
        Self {
            placement: placed(0, tie[3], tie[4], scale[0], scale[1], false),
            proj,
            width,
            height,
            bands: samples.len() / (width * height),
            samples,
        }
    }

    fn get(&self, column: usize, row: usize, band: usize) -> f64 {
        self.samples[(row * self.width + column) * self.bands + band]
    }

    /// The bilinear value, and the largest difference between neighbours among the samples around it.
    fn read(&self, column: f64, row: f64, band: usize) -> (f64, f64) {
        let (c, r) = (column as usize, row as usize);
        let (s, t) = (column - c as f64, row - r as f64);
        let near = self.get(c, r, band) * (1.0 - s) + self.get(c + 1, r, band) * s;
        let far = self.get(c, r + 1, band) * (1.0 - s) + self.get(c + 1, r + 1, band) * s;
        let mut difference = 0.0_f64;
        for row in r - 1..=r + 2 {
            for column in c - 1..=c + 2 {
                let here = self.get(column, row, band);
                if column < c + 2 {
                    difference = difference.max((here - self.get(column + 1, row, band)).abs());
                }
                if row < r + 2 {
                    difference = difference.max((here - self.get(column, row + 1, band)).abs());
                }
            }
        }
        (near * (1.0 - t) + far * t, difference)
    }
}

/// Imports a real scene and compares it with its file; `step` is what rounding may cost.
fn check_scene(kind: Kind, name: &str, proj: &'static str, sample_type: SampleType, step: f64) {
    let path = real(name);
    let scene = Scene::of(&path, proj);
    let directory = tempfile::tempdir().unwrap();
    let into = directory.path().join("scene");
    let report = run(&options(kind, &[path], &into)).unwrap();
    let mut values = Values::open(&into);
    let dataset = values.repository.dataset().clone();
    assert_eq!(dataset.sample_type, sample_type, "{name}");
    assert_eq!(usize::from(dataset.channels), scene.bands, "{name}");
    let own = Proj::from_proj_string(scene.proj).unwrap();
    let mut random = Random(11);
    let mut worst = 0.0_f64;
    let mut mean_error = vec![0.0; scene.bands];
    for _ in 0..TRIES {
        let column = random.within(2.0, scene.width as f64 - 4.0);
        let row = random.within(2.0, scene.height as f64 - 4.0);
        let model = scene.placement.model(column, row);
        let (latitude, longitude) = angles(&own, scene.placement, model);
        for (band, mean_error) in mean_error.iter_mut().enumerate() {
            let (due, difference) = scene.read(column, row, band);
            let value = values
                .at(latitude, longitude, report.levels[0], band as u8)
                .unwrap();
            worst = worst.max((value - due).abs() - 0.5 * difference - step);
            *mean_error += (value - due) / TRIES as f64;
        }
    }
    println!("{name}: {worst} beyond half the local difference, mean errors {mean_error:?}");
    assert!(worst <= 0.0, "{name}: by up to {worst}");
    // Nothing is brighter or darker as a whole: less than a two-hundredth of the mean.
    for (band, mean_error) in mean_error.iter().enumerate() {
        let all = (0..scene.width * scene.height).map(|at| scene.samples[at * scene.bands + band]);
        let mean = all.sum::<f64>() / (scene.width * scene.height) as f64;
        assert!(
            mean_error.abs() < 0.005 * mean,
            "{name}: {mean_error} of {mean}"
        );
    }
    assert!(values.check_shared_nodes() > 10_000);
    check_pyramid(&mut values);
}

#[test]
fn a_real_scene_of_three_16_bit_channels_is_kept() {
    let utm = "+proj=utm +zone=21 +datum=WGS84 +units=m +no_defs";
    check_scene(Kind::Imagery, "iguazu.tif", utm, SampleType::U16, 1.0);
}

#[test]
fn a_real_scene_of_amplitudes_is_kept_in_floating_point() {
    let utm = "+proj=utm +zone=15 +datum=WGS84 +units=m +no_defs";
    check_scene(Kind::Sar, "ironwood.tif", utm, SampleType::F32, 1e-6);
    // As imagery it is one channel of the same numbers.
    check_scene(Kind::Imagery, "ironwood.tif", utm, SampleType::F32, 1e-6);
}

/// Every node that lies inside a child with data all around is the weighted mean of nine: counted, not decoded light.
fn check_pyramid(values: &mut Values) {
    let tiles = values.repository.tiles().unwrap();
    let channels = values.repository.dataset().channels;
    let float = values.repository.dataset().sample_type == SampleType::F32;
    let mut compared = 0;
    for (child, _) in tiles {
        let Some(parent) = child.parent() else {
            continue;
        };
        let fine = values.tile(child).unwrap().clone();
        let coarse = values.tile(parent).unwrap();
        let (first_i, first_j) = (
            i64::from(child.x() & 1) * 128,
            i64::from(child.y() & 1) * 128,
        );
        for j in (2..=254).step_by(2) {
            for i in (2..=254).step_by(2) {
                for channel in 0..channels {
                    let mut sum = 0.0;
                    let mut whole = true;
                    for (dj, row_weight) in [(-1, 1.0), (0, 2.0), (1, 1.0)] {
                        for (di, weight) in [(-1, 1.0), (0, 2.0), (1, 1.0)] {
                            match fine.value(i + di, j + dj, channel) {
                                Some(value) => sum += row_weight * weight * value,
                                None => whole = false,
                            }
                        }
                    }
                    if !whole {
                        continue;
                    }
                    let mean = sum / 16.0;
                    let due = if float {
                        f64::from(mean as f32)
                    } else {
                        (mean + 0.5).floor()
                    };
                    let found = coarse.value(first_i + i / 2, first_j + j / 2, channel);
                    // The order of the terms may move a sum of floats by its last bit before it is rounded.
                    let tolerance = if float { due.abs() * 1.2e-7 } else { 0.0 };
                    assert!(
                        found.is_some_and(|found| (found - due).abs() <= tolerance),
                        "{parent}: {found:?}, due {due}"
                    );
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 1000, "{compared} nodes");
}

/// Rough samples of all sizes without any pattern that a mistake could hide in.
fn rough(column: u32, row: u32, band: usize) -> f64 {
    Random((band as u64) << 60 | u64::from(column) << 30 | u64::from(row)).next()
}

#[test]
fn tiles_agree_over_the_globe_and_over_a_cube_corner_with_holes() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let globe = placed(4326, -180.0, 90.0, 0.25, 0.25, false);
    let extra = [ExtraSamples::Unspecified; 2];
    write_bands::<colortype::RGB16>(
        &path("globe16.tif"),
        (1440, 720),
        globe,
        None,
        &[],
        |c, r, b| (rough(c, r, b) * 65_535.0) as u16,
    );
    write_bands::<colortype::RGB32Float>(
        &path("globe32.tif"),
        (1440, 720),
        globe,
        None,
        &extra,
        |c, r, b| ((rough(c, r, b) - 0.5) * 10.0_f64.powi((c % 12) as i32 - 6)) as f32,
    );
    // A corner of the cube lies at 35.26°N, 45°E.
    let corner = placed(4326, 43.0, 37.0, 0.01, 0.01, false);
    let hole = |c: u32, r: u32| (c / 37 + r / 23).is_multiple_of(5) || (c * r).is_multiple_of(71);
    write_bands::<colortype::RGB16>(
        &path("corner16.tif"),
        (401, 333),
        corner,
        Some(0.0),
        &extra,
        |c, r, b| {
            if hole(c, r) {
                0
            } else {
                (rough(c, r, b) * 65_534.0) as u16 + 1
            }
        },
    );
    write_bands::<colortype::RGB32Float>(
        &path("corner32.tif"),
        (401, 333),
        corner,
        None,
        &[],
        |c, r, b| {
            if hole(c, r) {
                f32::NAN
            } else {
                rough(c, r, b) as f32
            }
        },
    );
    for (name, sample_type, least) in [
        ("globe16", SampleType::U16, 200_000),
        ("globe32", SampleType::F32, 200_000),
        ("corner16", SampleType::U16, 10_000),
        ("corner32", SampleType::F32, 10_000),
    ] {
        let into = path(name);
        run(&options(
            Kind::Imagery,
            &[path(&format!("{name}.tif"))],
            &into,
        ))
        .unwrap();
        let mut values = Values::open(&into);
        assert_eq!(values.repository.dataset().sample_type, sample_type);
        let compared = values.check_shared_nodes();
        println!("{name}: {compared} shared nodes");
        assert!(compared > least);
        check_pyramid(&mut values);
        let tiles: Vec<Tile> = values
            .repository
            .tiles()
            .unwrap()
            .into_iter()
            .map(|t| t.0)
            .collect();
        if name.starts_with("globe") {
            for tile in tiles {
                assert_eq!(values.tile(tile).unwrap().validity, Validity::All, "{tile}");
            }
        } else {
            let faces: std::collections::BTreeSet<u8> =
                tiles.iter().map(|tile| tile.face().number()).collect();
            assert_eq!(faces.len(), 3);
        }
    }
}
