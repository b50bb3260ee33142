//! Imported values against a direct bilinear read of the source.
//!
//! Ramps measure the position: on a ramp of one unit a sample, an error in the value is an error in the position. Real
//! data measures the values.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test that panics has failed, and what it prints is its result"
)]

mod support;

use proj4rs::Proj;
use proj4rs::transform::transform;
use support::{Placement, Random, Values, embedded, options, run, shared, write_geotiff};
use tiles::Kind;

/// Positions tried in each source.
const TRIES: usize = 10_000;
/// A position may be off by this many samples.
const POSITION_TOLERANCE: f64 = 0.1;

/// A source that is placed by numbers alone, and the PROJ string of its system.
struct Case {
    name: &'static str,
    proj: &'static str,
    placement: Placement,
    size: (u32, u32),
}

const UTM_30: &str = "+proj=utm +zone=30 +datum=WGS84 +units=m +no_defs";
const WEB: &str =
    "+proj=merc +a=6378137 +b=6378137 +lat_ts=0 +lon_0=0 +x_0=0 +y_0=0 +k=1 +units=m +no_defs";
const SOUTH: &str =
    "+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=0 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs";
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

const CASES: &[Case] = &[
    Case {
        name: "degrees, areas",
        proj: DEGREES,
        placement: placed(4326, 7.0, 47.0, 0.001, 0.001, false),
        size: (600, 500),
    },
    Case {
        name: "degrees, points",
        proj: DEGREES,
        placement: placed(4326, 7.0, 47.0, 0.001, 0.001, true),
        size: (600, 500),
    },
    Case {
        name: "narrow pixels",
        proj: DEGREES,
        placement: placed(4326, -70.0, -20.0, 0.0005, 0.002, false),
        size: (900, 300),
    },
    Case {
        name: "UTM",
        proj: UTM_30,
        placement: placed(32630, 430_000.0, 5_400_000.0, 25.0, 25.0, false),
        size: (500, 700),
    },
    Case {
        name: "UTM, wide pixels, points",
        proj: UTM_30,
        placement: placed(32630, 300_000.0, 4_000_000.0, 90.0, 30.0, true),
        size: (400, 700),
    },
    Case {
        name: "Web Mercator",
        proj: WEB,
        placement: placed(3857, 800_000.0, 8_400_000.0, 150.0, 150.0, false),
        size: (600, 600),
    },
    Case {
        name: "across the antimeridian",
        proj: DEGREES,
        placement: placed(4326, 178.5, 52.0, 0.005, 0.005, false),
        size: (700, 500),
    },
    Case {
        name: "south pole, stereographic",
        proj: SOUTH,
        placement: placed(3031, -500_000.0, 450_000.0, 2000.0, 2000.0, false),
        size: (501, 451),
    },
    Case {
        name: "north pole, degrees",
        proj: DEGREES,
        placement: placed(4326, -180.0, 90.0, 0.5, 0.5, false),
        size: (720, 60),
    },
];

/// The largest position error over a case, along columns or rows.
fn position_error(case: &Case, along_columns: bool, directory: &std::path::Path) -> f64 {
    let source = directory.join("ramp.tif");
    let into = directory.join("repository");
    let (width, height) = case.size;
    // A ramp along columns would break where the grid meets itself: fold it up.
    let wraps = f64::from(width) * case.placement.dx == 360.0 && case.placement.geographic;
    let fold = |column: f64| {
        if wraps {
            (column - 0.5 * f64::from(width)).abs()
        } else {
            column
        }
    };
    write_geotiff(
        &source,
        width,
        height,
        case.placement,
        None,
        |column, row| {
            if along_columns {
                fold(f64::from(column)) as f32
            } else {
                row as f32
            }
        },
    );
    let _ = std::fs::remove_dir_all(&into);
    let report = run(&options(Kind::Elevation, &[source], &into)).unwrap();
    let level = report.levels[0];
    let mut values = Values::open(&into);
    let (own, base) = (
        Proj::from_proj_string(case.proj).unwrap(),
        Proj::from_proj_string(DEGREES).unwrap(),
    );
    let mut random = Random(7);
    let (mut worst, mut found) = (0.0_f64, 0);
    while found < TRIES {
        let column = random.within(2.0, f64::from(width) - 3.0);
        let row = random.within(2.0, f64::from(height) - 3.0);
        let (x, y) = case.placement.model(column, row);
        let mut point = if case.placement.geographic {
            (x.to_radians(), y.to_radians(), 0.0)
        } else {
            (x, y, 0.0)
        };
        transform(&own, &base, &mut point).unwrap();
        let (latitude, longitude) = (point.1.to_degrees(), point.0.to_degrees());
        let middle = (fold(column) - fold(column.round())).abs();
        if wraps
            && along_columns
            && (fold(column) < 2.0 || fold(column) > f64::from(width) / 2.0 - 2.0)
        {
            // The tip of the fold.
            assert!(middle <= 0.5);
            continue;
        }
        let value = values.at(latitude, longitude, level, 0).unwrap_or_else(|| {
            panic!(
                "{}: no value at {latitude}, {longitude} ({column}, {row})",
                case.name
            )
        });
        let due = if along_columns { fold(column) } else { row };
        worst = worst.max((value - due).abs());
        found += 1;
    }
    worst
}

#[test]
fn positions_are_within_a_tenth_of_a_sample() {
    let directory = tempfile::tempdir().unwrap();
    for case in CASES {
        for along_columns in [true, false] {
            // Near a pole a column is next to nothing wide, and a lattice cell spans many.
            if along_columns && case.name == "north pole, degrees" {
                continue;
            }
            let error = position_error(case, along_columns, directory.path());
            println!(
                "{}: {error:.4} samples ({})",
                case.name,
                if along_columns { "columns" } else { "rows" }
            );
            assert!(error < POSITION_TOLERANCE, "{}: {error} samples", case.name);
        }
    }
}

/// A grid of heights in degrees, read without this crate.
struct Reference {
    width: usize,
    height: usize,
    /// Longitude and latitude of the first sample, and the step.
    west: f64,
    north: f64,
    step: f64,
    wraps: bool,
    samples: Vec<i16>,
}

impl Reference {
    fn get(&self, column: usize, row: usize) -> f64 {
        f64::from(self.samples[row * self.width + column % self.width])
    }

    /// The bilinear value, and the largest difference between neighbours among the samples within a lattice cell of
    /// the position. Towards the poles a cell spans more and more columns.
    fn read(&self, latitude: f64, longitude: f64) -> Option<(f64, f64)> {
        let (column, row) = (
            (longitude - self.west) / self.step,
            (self.north - latitude) / self.step,
        );
        let (c, r) = (column.floor() as usize, row.floor() as usize);
        if r + 1 >= self.height || (!self.wraps && c + 1 >= self.width) {
            return None;
        }
        let (s, t) = (column - c as f64, row - r as f64);
        let [a, b] = [self.get(c, r), self.get(c + 1, r)];
        let [d, e] = [self.get(c, r + 1), self.get(c + 1, r + 1)];
        if [a, b, d, e].contains(&-32768.0) {
            return None;
        }
        let value = (a * (1.0 - s) + b * s) * (1.0 - t) + (d * (1.0 - s) + e * s) * t;
        let mut difference = 0.0_f64;
        let reach = (1.0 / latitude.to_radians().cos())
            .ceil()
            .min(self.width as f64 / 2.0) as usize;
        for row in r.saturating_sub(1)..=(r + 2).min(self.height - 1) {
            let first = if self.wraps {
                c + self.width - reach
            } else {
                c.saturating_sub(reach)
            };
            let last = if self.wraps {
                c + self.width + 1 + reach
            } else {
                (c + 1 + reach).min(self.width - 1)
            };
            for column in first..=last {
                let here = self.get(column, row);
                if row + 1 < self.height && row < r + 2 {
                    difference = difference.max((here - self.get(column, row + 1)).abs());
                }
                if column < last {
                    difference = difference.max((here - self.get(column + 1, row)).abs());
                }
            }
        }
        Some((value, difference))
    }
}

/// Compares a repository with its source at random positions; returns how many were beyond the tolerance of half
/// the local difference and one quantum, and the largest excess in metres.
fn compare(values: &mut Values, level: u8, reference: &Reference) -> (usize, f64) {
    let quantum = values.repository.dataset().unit();
    let mut random = Random(11);
    let (mut found, mut beyond, mut worst) = (0, 0, 0.0_f64);
    while found < TRIES {
        let latitude =
            reference.north - reference.step * random.within(0.0, reference.height as f64 - 1.0);
        let longitude =
            reference.west + reference.step * random.within(0.0, reference.width as f64 - 1.0);
        // Nearer to the poles the columns of a global grid are closer than a quarter of a lattice cell.
        if latitude.abs() > 80.0 {
            continue;
        }
        let Some((due, difference)) = reference.read(latitude, longitude) else {
            continue;
        };
        let Some(value) = values.at(latitude, longitude, level, 0) else {
            continue;
        };
        let excess = (value - due).abs() - 0.5 * difference - quantum;
        if excess > 0.0 {
            beyond += 1;
            worst = worst.max(excess);
        }
        found += 1;
    }
    (beyond, worst)
}

fn cell(bytes: &[u8], north: f64, west: f64) -> Reference {
    let samples = bytes
        .chunks_exact(2)
        .map(|pair| i16::from_be_bytes([pair[0], pair[1]]))
        .collect();
    Reference {
        width: 1201,
        height: 1201,
        west,
        north,
        step: 1.0 / 1200.0,
        wraps: false,
        samples,
    }
}

#[test]
fn real_heights_are_within_half_the_local_difference() {
    let Some(etopo5) = shared("etopo5.tif") else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let into = directory.path().join("globe");
    let report = run(&options(
        Kind::Elevation,
        std::slice::from_ref(&etopo5),
        &into,
    ))
    .unwrap();
    println!("etopo5: {report:?}");
    let mut decoder = tiff::decoder::Decoder::new(std::fs::File::open(&etopo5).unwrap()).unwrap();
    let tiff::decoder::DecodingResult::I16(samples) = decoder.read_image().unwrap() else {
        panic!("not 16 bits");
    };
    let step = 1.0 / 12.0;
    let tie = decoder
        .get_tag_f64_vec(tiff::tags::Tag::ModelTiepointTag)
        .unwrap();
    let globe = Reference {
        width: 4320,
        height: 2161,
        west: tie[3],
        north: tie[4],
        step,
        wraps: true,
        samples,
    };
    let (beyond, worst) = compare(&mut Values::open(&into), report.levels[0], &globe);
    println!("etopo5: {beyond} of {TRIES} beyond, by up to {worst} m");
    assert_eq!(beyond, 0, "by up to {worst} m");

    let alps = shared("alps_srtm3.zip").unwrap();
    let into = directory.path().join("alps");
    let report = run(&options(
        Kind::Elevation,
        std::slice::from_ref(&alps),
        &into,
    ))
    .unwrap();
    println!("alps: {report:?}");
    let mut archive = zip::ZipArchive::new(std::fs::File::open(alps).unwrap()).unwrap();
    let mut values = Values::open(&into);
    for (name, north, west) in [("N45E006.hgt", 46.0, 6.0), ("N44E008.hgt", 45.0, 8.0)] {
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut archive.by_name(name).unwrap(), &mut bytes).unwrap();
        let (beyond, worst) = compare(&mut values, report.levels[0], &cell(&bytes, north, west));
        println!("{name}: {beyond} of {TRIES} beyond, by up to {worst} m");
        assert_eq!(beyond, 0, "{name}: by up to {worst} m");
    }
}

#[test]
fn a_cloud_optimised_source_is_within_half_the_local_difference() {
    let Some(path) = shared("srtm90_sierra_cog.tif") else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let into = directory.path().join("sierra");
    let report = run(&options(
        Kind::Elevation,
        std::slice::from_ref(&path),
        &into,
    ))
    .unwrap();
    let mut decoder = tiff::decoder::Decoder::new(std::fs::File::open(&path).unwrap()).unwrap();
    let (width, height) = decoder.dimensions().unwrap();
    let tiff::decoder::DecodingResult::I16(samples) = decoder.read_image().unwrap() else {
        panic!("not 16 bits");
    };
    let scale = decoder
        .get_tag_f64_vec(tiff::tags::Tag::ModelPixelScaleTag)
        .unwrap();
    let tie = decoder
        .get_tag_f64_vec(tiff::tags::Tag::ModelTiepointTag)
        .unwrap();
    let sierra = Reference {
        width: width as usize,
        height: height as usize,
        west: tie[3] + 0.5 * scale[0],
        north: tie[4] - 0.5 * scale[1],
        step: scale[0],
        wraps: false,
        samples,
    };
    assert!((scale[0] - scale[1]).abs() < 1e-12);
    let (beyond, worst) = compare(&mut Values::open(&into), report.levels[0], &sierra);
    println!("sierra: {beyond} of {TRIES} beyond, by up to {worst} m");
    assert_eq!(beyond, 0, "by up to {worst} m");
}

/// Latitude, longitude and the sample there, by rasterio and pyproj, of sources with unusual places.
#[test]
fn fixtures_lie_where_gdal_says() {
    let Some(fixtures) = shared("tiff-fixtures") else {
        return;
    };
    let table = std::fs::read_to_string(embedded("tiff_places.tsv")).unwrap();
    for line in table.lines() {
        let fields: Vec<&str> = line.split('\t').collect();
        let directory = tempfile::tempdir().unwrap();
        let mut asked = options(
            Kind::Elevation,
            &[fixtures.join(fields[0])],
            directory.path(),
        );
        asked.bands = Some(vec![1]);
        // Palettes and JPEG colours are no heights: their reds are looked at.
        let imagery = fields[1] == "imagery";
        if imagery {
            asked.kind = Kind::Imagery;
            asked.bands = None;
        }
        let report = run(&asked).unwrap();
        let mut values = Values::open(directory.path());
        for place in &fields[3..] {
            let numbers: Vec<f64> = place.split(',').map(|n| n.parse().unwrap()).collect();
            let [latitude, longitude, due, difference] = numbers[..] else {
                panic!("{place}")
            };
            let value = values.at(latitude, longitude, report.levels[0], 0);
            let value = value
                .unwrap_or_else(|| panic!("{}: nothing at {latitude}, {longitude}", fields[0]));
            let tolerance = 0.5 * difference + if imagery { 3.0 } else { 0.1 };
            assert!(
                (value - due).abs() <= tolerance,
                "{}: {value} at {latitude}, {longitude}, due {due}",
                fields[0]
            );
        }
    }
}
