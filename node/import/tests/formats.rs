//! Each kind of source from end to end, and what is said about bad ones.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use std::io::Write;
use std::path::{Path, PathBuf};

use import::{Endianness, Extent, ImportError, RawLayout, RawSample};
use support::{Placement, Values, embedded, options, run, shared, write_geotiff};
use tiles::{Kind, SampleType};

const WEST: f64 = 7.0;
const NORTH: f64 = 46.9;
const SIZE: (u32, u32) = (30, 20);
const STEP: f64 = 0.1;

/// The plane that the grids of these tests show: rows count from the north.
fn plane(column: f64, row: f64) -> f64 {
    100.0 + 3.0 * column - 2.0 * (f64::from(SIZE.1 - 1) - row)
}

/// Checks a repository against the plane at its samples and between them.
fn check_plane(into: &Path, void: Option<(u32, u32)>) {
    let mut values = Values::open(into);
    let level = values.repository.dataset().deepest_level;
    for row in 0..2 * SIZE.1 - 1 {
        for column in 0..2 * SIZE.0 - 1 {
            let (column, row) = (f64::from(column) / 2.0, f64::from(row) / 2.0);
            let near = |(c, r): (u32, u32)| {
                (column - f64::from(c)).abs() < 2.0 && (row - f64::from(r)).abs() < 2.0
            };
            let edge = column < 1.5 || row < 1.5 || column > 27.5 || row > 17.5;
            if void.is_some_and(near) || edge {
                continue;
            }
            let value = values
                .at(NORTH - STEP * row, WEST + STEP * column, level, 0)
                .unwrap();
            assert!(
                (value - plane(column, row)).abs() < 0.1,
                "{column}, {row}: {value}"
            );
        }
    }
    if let Some((column, row)) = void {
        let (column, row) = (f64::from(column), f64::from(row));
        assert_eq!(
            values.at(NORTH - STEP * row, WEST + STEP * column, level, 0),
            None
        );
    }
}

const EXTENT: Extent = Extent {
    west: WEST,
    south: NORTH - STEP * (SIZE.1 - 1) as f64,
    east: WEST + STEP * (SIZE.0 - 1) as f64,
    north: NORTH,
};

#[test]
fn netcdf_grids_of_both_formats() {
    for name in ["grid_nc4.nc", "grid_classic.nc"] {
        let directory = tempfile::tempdir().unwrap();
        run(&options(
            Kind::Elevation,
            &[embedded(name)],
            directory.path(),
        ))
        .unwrap();
        check_plane(directory.path(), Some((6, 14)));
    }
}

#[test]
fn headerless_grids_of_every_number_type() {
    let directory = tempfile::tempdir().unwrap();
    let samples =
        || (0..SIZE.1).flat_map(|r| (0..SIZE.0).map(move |c| plane(f64::from(c), f64::from(r))));
    let cases: [(RawSample, Endianness, Vec<u8>); 6] = [
        (
            RawSample::U8,
            Endianness::Little,
            samples().map(|v| v as u8).collect(),
        ),
        (
            RawSample::I16,
            Endianness::Big,
            samples().flat_map(|v| (v as i16).to_be_bytes()).collect(),
        ),
        (
            RawSample::U16,
            Endianness::Little,
            samples().flat_map(|v| (v as u16).to_le_bytes()).collect(),
        ),
        (
            RawSample::I32,
            Endianness::Big,
            samples().flat_map(|v| (v as i32).to_be_bytes()).collect(),
        ),
        (
            RawSample::F32,
            Endianness::Little,
            samples().flat_map(|v| (v as f32).to_le_bytes()).collect(),
        ),
        (
            RawSample::F64,
            Endianness::Big,
            samples().flat_map(f64::to_be_bytes).collect(),
        ),
    ];
    for (index, (sample, endianness, bytes)) in cases.into_iter().enumerate() {
        let path = directory.path().join(format!("{index}.raw"));
        std::fs::write(&path, [&b"head"[..], &bytes].concat()).unwrap();
        let into = directory.path().join(format!("{index}"));
        let mut asked = options(Kind::Elevation, &[path], &into);
        let (width, height) = SIZE;
        asked.raw = Some(RawLayout {
            width,
            height,
            sample,
            endianness,
            header_bytes: 4,
            bands: 1,
        });
        asked.extent = Some(EXTENT);
        asked.node_registered = Some(true);
        run(&asked).unwrap();
        check_plane(&into, None);
        asked.raw = Some(RawLayout {
            width,
            height,
            sample,
            endianness,
            header_bytes: 5,
            bands: 1,
        });
        assert!(
            run(&asked)
                .unwrap_err()
                .to_string()
                .contains("layout calls for")
        );
    }
}

#[test]
fn pictures_keep_their_colours_and_their_transparency() {
    let directory = tempfile::tempdir().unwrap();
    let picture = image::RgbaImage::from_fn(64, 32, |x, y| {
        image::Rgba([x as u8 * 4, y as u8 * 8, 99, if x < 16 { 0 } else { 255 }])
    });
    let path = directory.path().join("picture.png");
    picture.save(&path).unwrap();
    let into = directory.path().join("into");
    let mut asked = options(Kind::Imagery, std::slice::from_ref(&path), &into);
    let message = run(&asked).unwrap_err().to_string();
    assert!(
        message.contains("picture.png") && message.contains("--extent"),
        "{message}"
    );
    assert!(!into.exists());
    asked.extent = Some(Extent {
        west: 0.0,
        south: 0.0,
        east: 64.0,
        north: 32.0,
    });
    run(&asked).unwrap();
    let mut values = Values::open(&into);
    let level = values.repository.dataset().deepest_level;
    assert_eq!(values.at(16.0, 8.0, level, 0), None);
    let at = |values: &mut Values, channel| values.at(31.5 - 10.0, 40.5, level, channel).unwrap();
    for (channel, due) in [(0, 160.0), (1, 80.0), (2, 99.0)] {
        let value = at(&mut values, channel);
        assert!((value - due).abs() < 2.0, "channel {channel}: {value}");
    }

    // The same as a JPEG is opaque, and refused once cut off.
    let jpeg = directory.path().join("picture.jpg");
    image::DynamicImage::ImageRgba8(picture)
        .to_rgb8()
        .save(&jpeg)
        .unwrap();
    let into = directory.path().join("jpeg");
    asked.sources = vec![jpeg.clone()];
    asked.into = into.clone();
    run(&asked).unwrap();
    let mut values = Values::open(&into);
    assert!(values.at(16.0, 8.0, level, 0).is_some());
    let bytes = std::fs::read(&jpeg).unwrap();
    std::fs::write(&jpeg, &bytes[..bytes.len() / 2]).unwrap();
    assert!(run(&asked).unwrap_err().to_string().contains("cut off"));
}

#[test]
fn a_picture_larger_than_the_memory_is_unpacked_row_by_row() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("large.png");
    // 6000 × 4000 × 3 bytes are more than half of 64 MiB.
    image::RgbImage::from_fn(6000, 4000, |x, y| {
        image::Rgb([(x / 24) as u8, (y / 16) as u8, 7])
    })
    .save(&path)
    .unwrap();
    let into = directory.path().join("into");
    let mut asked = options(Kind::Imagery, &[path], &into);
    asked.extent = Some(Extent {
        west: 10.0,
        south: 40.0,
        east: 16.0,
        north: 44.0,
    });
    asked.memory_bytes = 64 << 20;
    asked.level = Some(4);
    run(&asked).unwrap();
    let mut values = Values::open(&into);
    let red = values.at(42.0, 13.0, 4, 0).unwrap();
    assert!((red - 125.0).abs() < 4.0, "{red}");
}

/// A cell of 1201² heights that rise by one a column.
fn cell() -> Vec<u8> {
    (0..1201_u32 * 1201)
        .flat_map(|index| ((index % 1201) as i16).to_be_bytes())
        .collect()
}

fn archive(path: &Path, entries: &[(&str, &[u8])]) {
    let mut writer = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in entries {
        writer
            .start_file(*name, zip::write::SimpleFileOptions::default())
            .unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn srtm_cells_plain_and_packed_meet_without_a_gap() {
    let directory = tempfile::tempdir().unwrap();
    let plain = directory.path().join("S01W072.hgt");
    std::fs::write(&plain, cell()).unwrap();
    let packed = directory.path().join("cells.zip");
    archive(
        &packed,
        &[("deep/S01W071.hgt", &cell()), ("readme.txt", b"x")],
    );
    let into = directory.path().join("into");
    let report = run(&options(Kind::Elevation, &[plain, packed], &into)).unwrap();
    assert_eq!((report.sources, report.levels.len()), (2, 1));
    let mut values = Values::open(&into);
    let value = values.at(-0.4, -71.5, report.levels[0], 0).unwrap();
    assert!((value - 600.0).abs() < 0.1, "{value}");
    for step in 0..100 {
        let longitude = -71.0 - 0.001 + 0.00002 * f64::from(step);
        assert!(
            values.at(-0.4, longitude, report.levels[0], 0).is_some(),
            "{longitude}"
        );
    }
}

#[test]
fn bad_cells_and_archives_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let into = directory.path().join("into");
    let refused = |path: &Path, kind: Kind, due: &str| {
        let message = run(&options(kind, &[path.to_owned()], &into))
            .unwrap_err()
            .to_string();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        assert!(
            message.contains(&name) && message.contains(due),
            "{message}"
        );
        assert!(!into.exists());
    };
    let file = |name: &str, bytes: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    refused(
        &file("N00E000.hgt", &cell()[..1000]),
        Kind::Elevation,
        "2884802",
    );
    refused(
        &file("hills.hgt", &cell()),
        Kind::Elevation,
        "placed by its name",
    );
    refused(
        &file("N01E000.hgt", &cell()),
        Kind::Imagery,
        "--kind elevation",
    );
    refused(&file("empty.tif", b""), Kind::Elevation, "empty");
    refused(
        &file("text.tif", b"height,width\n"),
        Kind::Elevation,
        "none of the formats",
    );
    refused(
        &file("short.zip", b"PK\x03\x04"),
        Kind::Elevation,
        "cannot be unpacked",
    );
    refused(
        &directory.path().join("absent.tif"),
        Kind::Elevation,
        "cannot be read",
    );
    let path = directory.path().join("other.zip");
    archive(&path, &[("a.txt", b"x")]);
    refused(&path, Kind::Elevation, "no .hgt");
    // A bomb: 30 MB of zeros that call themselves a cell of 2.9.
    let path = directory.path().join("bomb.zip");
    archive(&path, &[("N00E000.hgt", &vec![0; 30_000_000])]);
    refused(&path, Kind::Elevation, "2884802");
    let mut bytes = std::fs::read(&path).unwrap();
    let (claim, truth) = (2_884_802_u32.to_le_bytes(), 30_000_000_u32.to_le_bytes());
    for at in 0..bytes.len() - 4 {
        if bytes[at..at + 4] == truth {
            bytes[at..at + 4].copy_from_slice(&claim);
        }
    }
    std::fs::write(&path, bytes).unwrap();
    refused(&path, Kind::Elevation, "unpack");
}

const DEGREES: Placement = Placement {
    epsg: 4326,
    geographic: true,
    x: 7.0,
    y: 46.0,
    dx: 0.01,
    dy: 0.01,
    point: false,
};

#[test]
fn bad_georeferences_are_named_with_the_remedy() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("source.tif");
    let into = directory.path().join("into");
    let refused = |placement: Placement, crs: Option<&str>, due: &[&str]| {
        write_geotiff(&path, 40, 30, placement, None, |_, _| 1.0);
        let mut asked = options(Kind::Elevation, std::slice::from_ref(&path), &into);
        asked.crs = crs.map(str::to_owned);
        let error = run(&asked).unwrap_err();
        assert!(matches!(error, ImportError::Source(_)), "{error}");
        let message = error.to_string();
        assert!(
            message.contains("source.tif") && due.iter().all(|part| message.contains(part)),
            "{message}"
        );
        assert!(!into.exists());
    };
    refused(
        Placement {
            epsg: 9999,
            ..DEGREES
        },
        None,
        &["EPSG:9999", "--crs"],
    );
    refused(
        Placement {
            epsg: 4267,
            ..DEGREES
        },
        None,
        &["datum grid", "gdalwarp"],
    );
    refused(
        Placement {
            y: 120.0,
            ..DEGREES
        },
        None,
        &["beyond a pole"],
    );
    refused(
        Placement {
            dx: 20.0,
            ..DEGREES
        },
        None,
        &["360 degrees"],
    );
    refused(Placement { dx: 0.0, ..DEGREES }, None, &["no area"]);
    refused(DEGREES, Some("utm33"), &["utm33", "EPSG:4326"]);
    // Cut off.
    write_geotiff(&path, 400, 300, DEGREES, None, |_, _| 1.0);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let message = run(&options(Kind::Elevation, &[path], &into))
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("source.tif")
            && (message.contains("cut off") || message.contains("cannot be read")),
        "{message}"
    );
}

#[test]
fn a_source_without_data_leaves_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("void.tif");
    write_geotiff(&path, 40, 30, DEGREES, Some(5.0), |_, _| 5.0);
    let into = directory.path().join("into");
    let message = run(&options(Kind::Elevation, &[path], &into))
        .unwrap_err()
        .to_string();
    assert!(message.contains("no data"), "{message}");
    assert!(!into.exists());
}

#[test]
fn radar_keeps_its_number_type() {
    for (name, band, sample_type) in [
        ("gloucester_spot5_ers.tif", Some(4), SampleType::U16),
        ("umbra_sydney_sar.tif", None, SampleType::U8),
        ("sentinel1_sigma0_db.tif", None, SampleType::F32),
    ] {
        let Some(path) = shared(name) else { return };
        let directory = tempfile::tempdir().unwrap();
        let mut asked = options(Kind::Sar, &[path], directory.path());
        asked.bands = band.map(|band| vec![band]);
        run(&asked).unwrap();
        let values = Values::open(directory.path());
        assert_eq!(
            values.repository.dataset().sample_type,
            sample_type,
            "{name}"
        );
    }
}

#[test]
fn every_fixture_can_be_tried_as_imagery() {
    let Some(fixtures) = shared("tiff-fixtures") else {
        return;
    };
    let mut imported = 0;
    let mut paths: Vec<PathBuf> = std::fs::read_dir(fixtures)
        .unwrap()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    paths.sort();
    for path in paths {
        let directory = tempfile::tempdir().unwrap();
        let into = directory.path().join("into");
        let mut asked = options(Kind::Imagery, std::slice::from_ref(&path), &into);
        asked.extent = Some(Extent {
            west: 20.0,
            south: 10.0,
            east: 21.0,
            north: 11.0,
        });
        match run(&asked) {
            Ok(report) => {
                assert!(report.tiles > 0, "{}", path.display());
                imported += 1;
            }
            Err(error) => {
                // One is the corner of a map and holds no data at all.
                let void = path.to_string_lossy().contains("nlcd")
                    && error.to_string().contains("no data");
                assert!(
                    void || matches!(error, ImportError::Source(_)),
                    "{}: {error}",
                    path.display()
                );
                assert!(!into.exists());
            }
        }
    }
    assert_eq!(imported, 69);
}
