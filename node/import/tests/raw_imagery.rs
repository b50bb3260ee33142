//! Imagery as its sensor delivered it: which numbers stay, which bands, what holds no data, what is refused.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use std::path::Path;

use import::inspect::{inspect_repository, value_at};
use import::{Endianness, Extent, ImportOptions, RawLayout, RawSample};
use support::{Placement, Random, Values, options, run, write_bands, write_image};
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::{ExtraSamples, PhotometricInterpretation, SampleFormat, Tag};
use tiles::{Kind, SampleType};

const DEGREES: Placement = Placement {
    epsg: 4326,
    geographic: true,
    x: 7.0,
    y: 46.0,
    dx: 0.01,
    dy: 0.01,
    point: false,
};
const SIZE: (u32, u32) = (120, 90);

/// Latitude and longitude of a sample.
fn place(column: f64, row: f64) -> (f64, f64) {
    let (x, y) = DEGREES.model(column, row);
    (y, x)
}

fn shape(into: &Path) -> (SampleType, u8) {
    let values = Values::open(into);
    let dataset = values.repository.dataset();
    (dataset.sample_type, dataset.channels)
}

/// The value of every channel at a sample, on the finest level.
fn at(into: &Path, column: f64, row: f64) -> Vec<Option<f64>> {
    let mut values = Values::open(into);
    let dataset = values.repository.dataset().clone();
    let (latitude, longitude) = place(column, row);
    (0..dataset.channels)
        .map(|channel| values.at(latitude, longitude, dataset.deepest_level, channel))
        // The weights of the reading above round in the last place.
        .map(|value| Some((value? * 1e6).round() / 1e6))
        .collect()
}

fn refused(asked: &ImportOptions, due: &[&str]) {
    let message = run(asked).unwrap_err().to_string();
    for part in due {
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(message.ends_with('.'), "{message}");
}

/// Planes of another slope for each band; all of them fit into 16 bits.
fn band_plane(column: f64, row: f64, band: usize) -> f64 {
    let slope = band as f64 + 1.0;
    2500.0 * band as f64 + slope * 9.0 * column - slope * 5.0 * row + 8000.0
}

fn check_planes(into: &Path, bands: &[usize], tolerance: f64) {
    let mut values = Values::open(into);
    let level = values.repository.dataset().deepest_level;
    let mut random = Random(3);
    for _ in 0..2000 {
        let column = random.within(2.0, f64::from(SIZE.0) - 3.0);
        let row = random.within(2.0, f64::from(SIZE.1) - 3.0);
        let (latitude, longitude) = place(column, row);
        for (channel, band) in bands.iter().enumerate() {
            let value = values
                .at(latitude, longitude, level, channel as u8)
                .unwrap();
            let due = band_plane(column, row, *band);
            assert!(
                (value - due).abs() <= tolerance,
                "band {band} at {column}, {row}: {value}, due {due}"
            );
        }
    }
}

#[test]
fn up_to_sixteen_bands_stay_as_they_are() {
    let directory = tempfile::tempdir().unwrap();
    let [words, floats, many] =
        ["words.tif", "floats.tif", "many.tif"].map(|n| directory.path().join(n));
    let extra = [ExtraSamples::Unspecified; 16];
    write_bands::<colortype::Gray16>(&words, SIZE, DEGREES, None, &extra[..15], |c, r, band| {
        band_plane(f64::from(c), f64::from(r), band) as u16
    });
    write_bands::<colortype::RGB32Float>(&floats, SIZE, DEGREES, None, &extra[..2], |c, r, b| {
        band_plane(f64::from(c), f64::from(r), b) as f32
    });
    write_bands::<colortype::Gray16>(&many, SIZE, DEGREES, None, &extra, |_, _, band| band as u16);
    let into = |name: &str| directory.path().join(name);
    let (all, five) = (Vec::from_iter(0..16), Vec::from_iter(0..5));

    let mut asked = options(Kind::Imagery, &[words], &into("words"));
    run(&asked).unwrap();
    assert_eq!(shape(&into("words")), (SampleType::U16, 16));
    // Rounding to whole numbers is all that is lost, twice: in the node, and between nodes.
    check_planes(&into("words"), &all, 1.5);
    // The same bands in another order, and one alone, which is no colour.
    asked.into = into("some");
    asked.bands = Some(vec![14, 2]);
    run(&asked).unwrap();
    assert_eq!(shape(&into("some")), (SampleType::U16, 2));
    check_planes(&into("some"), &[13, 1], 1.5);
    asked.into = into("one");
    asked.bands = Some(vec![16]);
    run(&asked).unwrap();
    assert_eq!(shape(&into("one")), (SampleType::U16, 1));
    check_planes(&into("one"), &[15], 1.5);

    run(&options(Kind::Imagery, &[floats], &into("floats"))).unwrap();
    assert_eq!(shape(&into("floats")), (SampleType::F32, 5));
    check_planes(&into("floats"), &five, 1.0);

    let mut asked = options(Kind::Imagery, &[many], &into("many"));
    refused(&asked, &["17 bands", "up to 16", "--bands"]);
    asked.bands = Some(vec![17, 1, 2]);
    run(&asked).unwrap();
    assert_eq!(
        at(&into("many"), 50.0, 40.0),
        [Some(16.0), Some(0.0), Some(1.0)]
    );
}

#[test]
fn bytes_keep_their_bands_and_a_range_makes_bytes() {
    let directory = tempfile::tempdir().unwrap();
    let [words, bytes] = ["words.tif", "bytes.tif"].map(|n| directory.path().join(n));
    let into = |name: &str| directory.path().join(name);
    let infrared = [ExtraSamples::Unspecified];
    write_bands::<colortype::RGB16>(&words, SIZE, DEGREES, None, &infrared, |_, _, band| {
        [1000, 2000, 6000, 60_000][band]
    });
    write_bands::<colortype::RGB8>(&bytes, SIZE, DEGREES, None, &infrared, |_, _, band| {
        [10, 20, 30, 200][band]
    });
    run(&options(Kind::Imagery, &[bytes], &into("bytes"))).unwrap();
    assert_eq!(shape(&into("bytes")), (SampleType::U8, 4));
    let due = [10.0, 20.0, 30.0, 200.0].map(Some);
    assert_eq!(at(&into("bytes"), 50.0, 40.0), due);

    let mut asked = options(Kind::Imagery, &[words], &into("ranged"));
    asked.range = Some([1000.0, 6000.0]);
    run(&asked).unwrap();
    assert_eq!(shape(&into("ranged")), (SampleType::U8, 4));
    let due = [0.0, 51.0, 255.0, 255.0].map(Some);
    assert_eq!(at(&into("ranged"), 50.0, 40.0), due);
    // A single band is a grey, as it is from a file of bytes; it may go into a repository of colours.
    asked.into = into("grey");
    asked.bands = Some(vec![2]);
    run(&asked).unwrap();
    assert_eq!(shape(&into("grey")), (SampleType::U8, 3));
    assert_eq!(at(&into("grey"), 50.0, 40.0), [Some(51.0); 3]);
}

#[test]
fn fill_values_transparency_and_masks_leave_holes() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let hole = |c: u32, r: u32| (40..60).contains(&c) && (30..50).contains(&r);
    // One band of the fill value is a dark pixel; all of them are none.
    write_bands::<colortype::RGB16>(
        &path("fill.tif"),
        SIZE,
        DEGREES,
        Some(0.0),
        &[],
        |c, r, b| {
            if hole(c, r) || b == 0 { 0 } else { 40_000 }
        },
    );
    let fill = f64::from(-3.4e38_f32);
    write_bands::<colortype::RGB32Float>(
        &path("float.tif"),
        SIZE,
        DEGREES,
        Some(fill),
        &[],
        |c, r, b| match b {
            _ if hole(c, r) => fill as f32,
            // Whatever is no number leaves a hole too, in any one band.
            1 if c == 100 && r == 60 => f32::NAN,
            2 if c == 20 && r == 60 => f32::INFINITY,
            0 => -0.25,
            _ => 1.75,
        },
    );
    let alpha = [ExtraSamples::UnassociatedAlpha];
    write_bands::<colortype::RGB16>(
        &path("alpha.tif"),
        SIZE,
        DEGREES,
        None,
        &alpha,
        |c, r, b| match b {
            3 if hole(c, r) => 0,
            3 => 1,
            0 => 0,
            _ => 40_000,
        },
    );
    let file = std::fs::File::create(path("mask.tif")).unwrap();
    let mut encoder = TiffEncoder::new(std::io::BufWriter::new(file)).unwrap();
    write_image::<colortype::RGB16, _>(&mut encoder, SIZE, DEGREES, None, &[], |_, _, b| {
        if b == 0 { 0 } else { 40_000 }
    });
    let mut mask = encoder
        .new_image::<colortype::Gray8>(SIZE.0, SIZE.1)
        .unwrap();
    mask.encoder()
        .write_tag(Tag::NewSubfileType, 4_u32)
        .unwrap();
    let pixels = (0..SIZE.1).flat_map(|r| (0..SIZE.0).map(move |c| (c, r)));
    let bytes: Vec<u8> = pixels
        .map(|(c, r)| if hole(c, r) { 0 } else { 255 })
        .collect();
    mask.write_data(&bytes).unwrap();
    drop(encoder);
    let png = path("alpha.png");
    image::ImageBuffer::<image::Rgba<u16>, Vec<u16>>::from_fn(SIZE.0, SIZE.1, |c, r| {
        image::Rgba([0, 40_000, 40_000, if hole(c, r) { 0 } else { u16::MAX }])
    })
    .save(&png)
    .unwrap();

    for name in [
        "fill.tif",
        "float.tif",
        "alpha.tif",
        "mask.tif",
        "alpha.png",
    ] {
        let into = path(&format!("{name}.into"));
        let mut asked = options(Kind::Imagery, &[path(name)], &into);
        if name.ends_with("png") {
            let (south, east) = (
                46.0 - 0.01 * f64::from(SIZE.1),
                7.0 + 0.01 * f64::from(SIZE.0),
            );
            asked.extent = Some(Extent {
                west: 7.0,
                south,
                east,
                north: 46.0,
            });
        }
        run(&asked).unwrap();
        let float = name == "float.tif";
        let (sample_type, due) = if float {
            (SampleType::F32, [-0.25, 1.75, 1.75])
        } else {
            (SampleType::U16, [0.0, 40_000.0, 40_000.0])
        };
        assert_eq!(shape(&into), (sample_type, 3), "{name}");
        assert_eq!(at(&into, 50.0, 40.0), [None; 3], "{name}");
        // Beside the hole nothing of the fill value is mixed in.
        for (column, row) in [(80.0, 40.0), (37.0, 40.0), (50.0, 27.0), (62.5, 52.5)] {
            assert_eq!(at(&into, column, row), due.map(Some), "{name}");
        }
        if float {
            assert_eq!(at(&into, 100.0, 60.0), [None; 3]);
            assert_eq!(at(&into, 20.0, 60.0), [None; 3]);
        }
    }
}

#[test]
fn every_number_type_has_its_sample_type() {
    let directory = tempfile::tempdir().unwrap();
    let cases: [(RawSample, SampleType, [f64; 2]); 8] = [
        (RawSample::U8, SampleType::U8, [7.0, 255.0]),
        (RawSample::I8, SampleType::F32, [-128.0, 127.0]),
        (RawSample::U16, SampleType::U16, [7.0, 65_535.0]),
        (RawSample::I16, SampleType::F32, [7.0, 32_767.0]),
        (RawSample::U32, SampleType::F32, [7.0, 4_294_967_295.0]),
        (RawSample::I32, SampleType::F32, [-16_777_215.0, 1.0]),
        (RawSample::F32, SampleType::F32, [0.1, 2.0e38]),
        (RawSample::F64, SampleType::F32, [0.1, 2.0e38]),
    ];
    let bytes_of = |sample: RawSample, value: f64| match sample {
        RawSample::U8 => vec![value as u8],
        RawSample::I8 => (value as i8).to_le_bytes().to_vec(),
        RawSample::U16 => (value as u16).to_le_bytes().to_vec(),
        RawSample::I16 => (value as i16).to_le_bytes().to_vec(),
        RawSample::U32 => (value as u32).to_le_bytes().to_vec(),
        RawSample::I32 => (value as i32).to_le_bytes().to_vec(),
        RawSample::F32 => (value as f32).to_le_bytes().to_vec(),
        RawSample::F64 => value.to_le_bytes().to_vec(),
    };
    for (index, (sample, sample_type, pair)) in cases.into_iter().enumerate() {
        let path = directory.path().join(format!("{index}.raw"));
        let into = directory.path().join(format!("{index}"));
        let pixels = SIZE.0 as usize * SIZE.1 as usize;
        let mut bytes: Vec<u8> = (0..2 * pixels)
            .flat_map(|at| bytes_of(sample, pair[at % 2]))
            .collect();
        if sample == RawSample::F64 {
            // More than 32 bits can hold: no number of this layer.
            let at = 2 * (40 * SIZE.0 as usize + 50) * 8;
            bytes[at..at + 8].copy_from_slice(&1.0e300_f64.to_le_bytes());
        }
        std::fs::write(&path, bytes).unwrap();
        let mut asked = options(Kind::Imagery, &[path], &into);
        asked.raw = Some(RawLayout {
            width: SIZE.0,
            height: SIZE.1,
            sample,
            endianness: Endianness::Little,
            header_bytes: 0,
            bands: 2,
        });
        asked.extent = Some(Extent {
            west: 7.0,
            south: 46.0 - 0.01 * f64::from(SIZE.1),
            east: 7.0 + 0.01 * f64::from(SIZE.0),
            north: 46.0,
        });
        run(&asked).unwrap();
        assert_eq!(shape(&into), (sample_type, 2), "{sample:?}");
        let stored = pair.map(|number| {
            if sample_type == SampleType::F32 {
                f64::from(number as f32)
            } else {
                number
            }
        });
        let found = at(&into, 20.0, 20.0);
        for (found, due) in found.iter().zip(stored) {
            assert!(
                (found.unwrap() - due).abs() <= 1e-6 + 1e-12 * due.abs(),
                "{sample:?}: {found:?}, due {due}"
            );
        }
        if sample == RawSample::F64 {
            assert_eq!(at(&into, 50.0, 40.0), [None; 2]);
        }
    }
}

/// Greys whose lowest sample is white.
struct WhiteIsZero<T>(T);

macro_rules! white_is_zero {
    ($inner:ty, $format:expr, $bits:expr) => {
        impl colortype::ColorType for WhiteIsZero<$inner> {
            type Inner = $inner;
            const TIFF_VALUE: PhotometricInterpretation = PhotometricInterpretation::WhiteIsZero;
            const BITS_PER_SAMPLE: &'static [u16] = &[$bits];
            const SAMPLE_FORMAT: &'static [SampleFormat] = &[$format];
            fn horizontal_predict(_: &[Self::Inner], _: &mut Vec<Self::Inner>) {
                panic!("no predictor was asked for");
            }
        }
    };
}
white_is_zero!(u16, SampleFormat::Uint, 16);
white_is_zero!(f32, SampleFormat::IEEEFP, 32);

#[test]
fn low_is_dark_whatever_the_file_calls_white() {
    let directory = tempfile::tempdir().unwrap();
    let [words, floats] = ["words.tif", "floats.tif"].map(|n| directory.path().join(n));
    let into = |name: &str| directory.path().join(name);
    write_bands::<WhiteIsZero<u16>>(&words, SIZE, DEGREES, Some(9.0), &[], |c, _, _| {
        if c < 60 { 9 } else { 535 }
    });
    write_bands::<WhiteIsZero<f32>>(&floats, SIZE, DEGREES, None, &[], |_, _, _| 0.25);
    let mut asked = options(Kind::Imagery, &[words], &into("words"));
    run(&asked).unwrap();
    assert_eq!(at(&into("words"), 80.0, 40.0), [Some(65_000.0)]);
    assert_eq!(at(&into("words"), 30.0, 40.0), [None]);
    // A range names the samples of the file: its first end is black.
    asked.range = Some([535.0, 0.0]);
    asked.into = into("ranged");
    run(&asked).unwrap();
    assert_eq!(at(&into("ranged"), 80.0, 40.0), [Some(0.0); 3]);

    let mut asked = options(Kind::Imagery, &[floats], &into("floats"));
    refused(&asked, &["floats.tif", "white", "--range LOW,HIGH"]);
    asked.range = Some([1.0, 0.0]);
    run(&asked).unwrap();
    assert_eq!(at(&into("floats"), 80.0, 40.0), [Some(191.0); 3]);
}

#[test]
fn sources_of_another_sort_are_refused_with_both_named() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let infrared = [ExtraSamples::Unspecified];
    write_bands::<colortype::RGB8>(&path("bytes.tif"), SIZE, DEGREES, None, &[], |_, _, _| 9);
    write_bands::<colortype::RGB16>(&path("words.tif"), SIZE, DEGREES, None, &[], |_, _, _| 900);
    write_bands::<colortype::RGB16>(
        &path("four.tif"),
        SIZE,
        DEGREES,
        None,
        &infrared,
        |_, _, b| b as u16,
    );
    write_bands::<colortype::RGB32Float>(
        &path("floats.tif"),
        SIZE,
        DEGREES,
        None,
        &[],
        |_, _, _| 0.5,
    );
    let bytes = "3 channels of unsigned 8-bit samples";
    let words = "3 channels of unsigned 16-bit samples";
    let four = "4 channels of unsigned 16-bit samples";
    let floats = "3 channels of 32-bit floating-point samples";
    let other = "hoose another directory.";
    let asked = |names: &[&str], into: &str| {
        let sources: Vec<_> = names.iter().map(|name| path(name)).collect();
        options(Kind::Imagery, &sources, &path(into))
    };
    run(&asked(&["bytes.tif"], "bytes")).unwrap();
    run(&asked(&["words.tif"], "words")).unwrap();
    run(&asked(&["floats.tif"], "floats")).unwrap();
    let range = "--range LOW,HIGH";
    refused(
        &asked(&["words.tif"], "bytes"),
        &["\"bytes\"", bytes, words, range, other],
    );
    refused(
        &asked(&["four.tif"], "bytes"),
        &[bytes, four, range, "3 bands with --bands", other],
    );
    refused(
        &asked(&["floats.tif"], "bytes"),
        &[bytes, floats, range, other],
    );
    refused(&asked(&["bytes.tif"], "words"), &[words, bytes, other]);
    refused(
        &asked(&["four.tif"], "words"),
        &[words, four, "3 bands with --bands", other],
    );
    refused(&asked(&["floats.tif"], "words"), &[words, floats, other]);
    // Floating point holds 16 bits, but half a unit of the one is no half of the other.
    refused(&asked(&["words.tif"], "floats"), &[floats, words, other]);
    let mut ranged = asked(&["words.tif"], "words");
    ranged.range = Some([0.0, 1000.0]);
    refused(&ranged, &[words, bytes, "Leave out --range", other]);
    // All at once are refused before anything is written.
    let mixed = asked(&["bytes.tif", "words.tif"], "mixed");
    refused(&mixed, &["bytes.tif", bytes, "words.tif", words, range]);
    assert!(!path("mixed").exists());
    // The remedies help.
    let mut remedied = asked(&["four.tif"], "bytes");
    remedied.range = Some([0.0, 1000.0]);
    remedied.bands = Some(vec![1, 2, 3]);
    run(&remedied).unwrap();
    remedied.into = path("words");
    remedied.range = None;
    run(&remedied).unwrap();
    assert_eq!(at(&path("words"), 50.0, 40.0), [0.0, 1.0, 2.0].map(Some));
    // Nothing of what was refused has changed the repositories.
    assert_eq!(shape(&path("floats")), (SampleType::F32, 3));
    assert_eq!(
        Values::open(&path("floats")).repository.dataset().revision,
        1
    );
}

#[test]
fn inspection_shows_type_bands_and_values() {
    let directory = tempfile::tempdir().unwrap();
    let (source, into) = (
        directory.path().join("words.tif"),
        directory.path().join("into"),
    );
    let infrared = [ExtraSamples::Unspecified];
    write_bands::<colortype::RGB16>(&source, SIZE, DEGREES, None, &infrared, |_, _, band| {
        [1000, 2000, 6000, 60_000][band]
    });
    run(&options(Kind::Imagery, &[source], &into)).unwrap();
    let summary = inspect_repository(&into, &|_, _| {}).unwrap();
    assert_eq!(summary.dataset.sample_type, SampleType::U16);
    assert_eq!(summary.dataset.channels, 4);
    assert_eq!(
        (summary.lowest, summary.highest),
        (Some(1000.0), Some(60_000.0))
    );
    assert!(summary.broken.is_empty() && summary.unindexed == 0);
    let (latitude, longitude) = place(50.0, 40.0);
    let found = value_at(&into, latitude, longitude, None).unwrap();
    assert_eq!(found.value, [1000.0, 2000.0, 6000.0, 60_000.0]);
}
