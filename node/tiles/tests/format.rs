//! The tile file against its definition: golden bytes, round trips, damage of every kind.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::path::PathBuf;

use geodesy::Tile;
use proptest::prelude::*;
use tiles::{DecodeError, Kind, NODE_COUNT, Origin, SampleType, Samples, TileData, Validity};

const SIDE: usize = 275;

/// Hills with some grain, by integer arithmetic alone.
fn height(i: i64, j: i64) -> i32 {
    let hills = (i * i * 3 - j * j * 2 + i * j) / 64 + 40 * ((i / 32 + j / 32) % 3);
    (hills + ((i * 7919) ^ (j * 104_729)) % 3) as i32
}

fn heights() -> Vec<i32> {
    (0..NODE_COUNT)
        .map(|n| height((n % SIDE) as i64, (n / SIDE) as i64))
        .collect()
}

/// All nodes but a disc.
fn holed() -> Validity {
    Validity::from_nodes(|n| {
        (n % SIDE).abs_diff(100).pow(2) + (n / SIDE).abs_diff(150).pow(2) > 900
    })
}

fn elevation(validity: Validity) -> TileData {
    let tile = Tile::new(4, 3, 5, 2).unwrap();
    TileData::new(tile, Kind::Elevation, 1, Samples::I32(heights()), validity).unwrap()
}

fn picture(channels: u8, validity: Validity) -> TileData {
    let tile = Tile::new(1, 7, 100, 3).unwrap();
    let sample = |h: i32, c: u8| (h / 8) as u8 ^ (c * 3);
    let samples = heights()
        .into_iter()
        .flat_map(|h| (0..channels).map(move |c| sample(h, c)));
    TileData::new(
        tile,
        Kind::Imagery,
        channels,
        Samples::U8(samples.collect()),
        validity,
    )
    .unwrap()
}

fn radar(channels: u8, validity: Validity) -> TileData {
    let samples = heights()
        .into_iter()
        .flat_map(|h| (0..channels).map(move |c| h as u16 + u16::from(c)));
    TileData::new(
        Tile::ROOTS[3],
        Kind::Sar,
        channels,
        Samples::U16(samples.collect()),
        validity,
    )
    .unwrap()
}

fn decibels(channels: u8, validity: Validity) -> TileData {
    let samples = heights()
        .into_iter()
        .flat_map(|h| (0..channels).map(move |c| h as f32 / 8.0 - f32::from(c) - 90.0));
    TileData::new(
        Tile::ROOTS[2],
        Kind::Sar,
        channels,
        Samples::F32(samples.collect()),
        validity,
    )
    .unwrap()
}

/// A raster whose samples lie two nodes apart, slightly turned.
fn origin() -> Origin {
    let place = |i: i64, j: i64| {
        let (i, j) = (i as f64 + 9.0, j as f64 + 9.0);
        Some([0.5 * i + 0.01 * j, 0.5 * j - 0.01 * i + i * i / 65_536.0])
    };
    Origin::gather(place, None, |column, row| 16 * height(3 * column, 3 * row)).unwrap()
}

fn every_kind() -> Vec<TileData> {
    let mut all = Vec::new();
    for validity in [
        Validity::All,
        holed(),
        Validity::from_nodes(|_| false),
        Validity::from_nodes(|n| n == 0),
    ] {
        all.push(elevation(validity.clone()));
        for channels in [1, 2, 3, 4] {
            all.push(picture(channels, validity.clone()));
            all.push(radar(channels, validity.clone()));
            all.push(decibels(channels, validity.clone()));
        }
    }
    all
}

#[test]
fn every_kind_comes_back() {
    for data in every_kind() {
        assert_eq!(TileData::decode(&data.encode().unwrap()).unwrap(), data);
        assert_eq!(
            TileData::decode(&data.encode_plain().unwrap()).unwrap(),
            data
        );
        let resampled = data.encode_resampled(&origin()).unwrap();
        assert_eq!(TileData::decode(&resampled).unwrap(), data);
    }
}

/// Written once by format version 1; later programs must read the same from them for ever.
#[test]
fn golden_files_are_read_for_ever() {
    let golden: [(&str, &[u8], TileData); 4] = [
        (
            "gradient",
            include_bytes!("data/golden-gradient.tile"),
            elevation(holed()),
        ),
        (
            "resampled",
            include_bytes!("data/golden-resampled.tile"),
            resampled(),
        ),
        (
            "picture",
            include_bytes!("data/golden-picture.tile"),
            picture(3, holed()),
        ),
        (
            "float",
            include_bytes!("data/golden-float.tile"),
            decibels(1, Validity::All),
        ),
    ];
    for (name, bytes, data) in golden {
        assert_eq!(TileData::decode(bytes).unwrap(), data, "{name}");
    }
}

/// What [`origin`] gives the nodes, with a few changed.
fn resampled() -> TileData {
    // The heights are those that a plain bilinear reading gives, written down apart from the codec.
    let mut heights = Vec::with_capacity(NODE_COUNT);
    for j in 0..SIDE {
        for i in 0..SIDE {
            let (x, y) = (i as f64, j as f64);
            let (column, row) = (0.5 * x + 0.01 * y, 0.5 * y - 0.01 * x + x * x / 65_536.0);
            let (c, r) = (column.floor() as i64, row.floor() as i64);
            let (s, t) = (column - column.floor(), row - row.floor());
            let at = |dc: i64, dr: i64| f64::from(16 * height(3 * (c + dc), 3 * (r + dr)));
            let near = at(0, 0) * (1.0 - s) + at(1, 0) * s;
            let far = at(0, 1) * (1.0 - s) + at(1, 1) * s;
            heights.push((near * (1.0 - t) + far * t).round() as i32);
        }
    }
    heights[5000] += 77;
    let tile = Tile::new(0, 9, 300, 301).unwrap();
    TileData::new(tile, Kind::Elevation, 1, Samples::I32(heights), holed()).unwrap()
}

#[test]
#[ignore = "writes the golden files anew: only for a new format version"]
fn write_golden_files() {
    let directory = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let write = |name: &str, bytes: Vec<u8>| std::fs::write(directory.join(name), bytes).unwrap();
    write("golden-gradient.tile", elevation(holed()).encode().unwrap());
    write(
        "golden-resampled.tile",
        resampled().encode_resampled(&origin()).unwrap(),
    );
    write("golden-picture.tile", picture(3, holed()).encode().unwrap());
    write(
        "golden-float.tile",
        decibels(1, Validity::All).encode().unwrap(),
    );
}

#[test]
fn golden_header() {
    let tile = Tile::new(1, 1, 1, 0).unwrap();
    let samples = Samples::U16(vec![3; 2 * NODE_COUNT]);
    let data = TileData::new(tile, Kind::Imagery, 2, samples, Validity::All).unwrap();
    let bytes = data.encode_plain().unwrap();
    let mut due = b"TWTILE\x01\x00\x01\x02\x02\x00\x00\0\0\0".to_vec();
    // Tile number: 1, face 001, y 0, x 1.
    due.extend(0b10_0101_u64.to_le_bytes());
    let count = 2.0 * 257.0 * 257.0;
    for number in [3.0, 3.0, 3.0 * count, 9.0 * count] {
        due.extend(f64::to_le_bytes(number));
    }
    due.extend((count as u64).to_le_bytes());
    due.extend(0_u32.to_le_bytes());
    due.extend((4 * NODE_COUNT as u32).to_le_bytes());
    assert_eq!(bytes[..72], due);
    assert_eq!(bytes.len(), 76 + 4 * NODE_COUNT);
    let mut rest = bytes.clone();
    rest.drain(72..76);
    assert_eq!(bytes[72..76], crc32fast::hash(&rest).to_le_bytes());
}

#[test]
fn the_resampled_codec_is_chosen_where_it_helps() {
    let data = resampled();
    let (with, without) = (
        data.encode_resampled(&origin()).unwrap(),
        data.encode().unwrap(),
    );
    assert_eq!((with[11], without[11]), (2, 1));
    assert!(
        with.len() < without.len() / 2,
        "{} against {}",
        with.len(),
        without.len()
    );
}

#[test]
fn invalid_nodes_cost_nothing_and_read_zero() {
    let full = elevation(Validity::All).encode().unwrap().len();
    let holed = elevation(holed());
    assert_eq!(holed.height(100 - 9, 150 - 9), None);
    assert_eq!(holed.heights().unwrap()[TileData::index(91, 141)], 0);
    // Noise in the hole must not matter.
    let mut noisy = holed.clone();
    if let Samples::I32(values) = &mut noisy.samples {
        for (n, value) in values
            .iter_mut()
            .enumerate()
            .filter(|(n, _)| !holed.validity.is_valid(*n))
        {
            *value = (n as i32).wrapping_mul(0x9E37_79B9_u32 as i32);
        }
    }
    let bytes = noisy.encode().unwrap();
    assert!(bytes.len() < full);
    assert_eq!(TileData::decode(&bytes).unwrap(), holed);
    let none = elevation(Validity::from_nodes(|_| false)).encode().unwrap();
    assert!(none.len() < 250, "{}", none.len());
}

#[test]
fn statistics_leave_the_border_and_holes_out() {
    let mut samples = vec![5; NODE_COUNT];
    samples[TileData::index(-9, 0)] = 1_000;
    samples[TileData::index(0, 257)] = -1_000;
    samples[TileData::index(256, 256)] = 9;
    samples[TileData::index(0, 0)] = -4;
    samples[TileData::index(7, 7)] = 77;
    let hole = TileData::index(7, 7);
    let validity = Validity::from_nodes(|n| n != hole);
    let data = TileData::new(
        Tile::ROOTS[0],
        Kind::Elevation,
        1,
        Samples::I32(samples),
        validity,
    )
    .unwrap();
    let statistics = data.statistics;
    assert_eq!((statistics.lowest, statistics.highest), (-4.0, 9.0));
    assert_eq!(statistics.count, 257 * 257 - 1);
    let rest = f64::from(257 * 257 - 3);
    assert_eq!(statistics.sum, 5.0 * rest + 5.0);
    assert_eq!(statistics.sum_of_squares, 25.0 * rest + 81.0 + 16.0);
}

#[test]
fn inconsistent_parts_are_refused() {
    let root = Tile::ROOTS[0];
    let new =
        |kind, channels, samples, validity| TileData::new(root, kind, channels, samples, validity);
    let bytes = || Samples::U8(vec![0; NODE_COUNT]);
    assert!(new(Kind::Elevation, 1, bytes(), Validity::All).is_err());
    assert!(new(Kind::Imagery, 2, bytes(), Validity::All).is_err());
    assert!(new(Kind::Imagery, 0, Samples::U8(vec![]), Validity::All).is_err());
    assert!(
        new(
            Kind::Sar,
            1,
            Samples::I32(vec![0; NODE_COUNT]),
            Validity::All
        )
        .is_err()
    );
    assert!(new(Kind::Sar, 1, bytes(), Validity::Mask(vec![0; 5].into())).is_err());
    assert!(
        new(
            Kind::Sar,
            1,
            bytes(),
            Validity::Mask(vec![u64::MAX; 1182].into())
        )
        .is_err()
    );
    let mut floats = vec![1.0_f32; NODE_COUNT];
    floats[3] = f32::NAN;
    assert!(new(Kind::Sar, 1, Samples::F32(floats.clone()), Validity::All).is_err());
    let masked = new(
        Kind::Sar,
        1,
        Samples::F32(floats),
        Validity::from_nodes(|n| n != 3),
    )
    .unwrap();
    assert_eq!(TileData::decode(&masked.encode().unwrap()).unwrap(), masked);
    assert_eq!(masked.samples.sample_type(), SampleType::F32);
}

/// Writes the checksum that a forger would.
fn seal(bytes: &mut [u8]) {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..72]);
    hasher.update(&bytes[76..]);
    bytes[72..76].copy_from_slice(&hasher.finalize().to_le_bytes());
}

fn small_files() -> &'static [Vec<u8>; 5] {
    static FILES: std::sync::OnceLock<[Vec<u8>; 5]> = std::sync::OnceLock::new();
    FILES.get_or_init(|| {
        [
            elevation(holed()).encode().unwrap(),
            resampled().encode_resampled(&origin()).unwrap(),
            picture(3, holed()).encode().unwrap(),
            radar(1, holed()).encode().unwrap(),
            decibels(1, Validity::All).encode().unwrap(),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_changed_byte_is_noticed(file in 0_usize..5, at in any::<prop::sample::Index>(), flip in 1_u8..) {
        let mut bytes = small_files()[file].clone();
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        prop_assert!(TileData::decode(&bytes).is_err());
    }

    #[test]
    fn a_cut_file_is_noticed(file in 0_usize..5, at in any::<prop::sample::Index>()) {
        let bytes = &small_files()[file];
        prop_assert!(TileData::decode(&bytes[..at.index(bytes.len())]).is_err());
    }

    #[test]
    fn forged_files_never_panic(file in 0_usize..5, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4), head: bool) {
        let mut bytes = small_files()[file].clone();
        let size = if head { 200 } else { bytes.len() };
        for (at, to) in changes {
            bytes[at.index(size)] = to;
        }
        seal(&mut bytes);
        if let Ok(data) = TileData::decode(&bytes) {
            prop_assert_eq!(data.samples.len(), NODE_COUNT * usize::from(data.channels));
        }
    }

    #[test]
    fn arbitrary_samples_come_back(seed: u64, step in 1_i32..100_000) {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as i32
        };
        let heights: Vec<i32> = (0..NODE_COUNT).map(|_| next().wrapping_mul(step)).collect();
        let data = TileData::new(Tile::ROOTS[1], Kind::Elevation, 1, Samples::I32(heights), holed()).unwrap();
        prop_assert_eq!(&TileData::decode(&data.encode().unwrap()).unwrap(), &data);
        let floats: Vec<f32> = (0..NODE_COUNT).map(|_| f32::from_bits(next() as u32))
            .map(|f| if f.is_finite() { f } else { 0.5 }).collect();
        let data = TileData::new(Tile::ROOTS[1], Kind::Sar, 1, Samples::F32(floats), Validity::All).unwrap();
        prop_assert_eq!(&TileData::decode(&data.encode().unwrap()).unwrap(), &data);
    }
}

#[test]
fn errors_say_what_is_wrong() {
    let good = &small_files()[0];
    assert!(matches!(
        TileData::decode(b"GIF89a"),
        Err(DecodeError::NotATile)
    ));
    let mut newer = good.clone();
    newer[6] = 2;
    let message = TileData::decode(&newer).unwrap_err().to_string();
    assert!(
        message.contains("version 2") && message.contains("version 1"),
        "{message}"
    );
    let elsewhere = TileData::decode_tile(good, Tile::ROOTS[0])
        .unwrap_err()
        .to_string();
    assert!(
        elsewhere.contains("4/3/5/2") && elsewhere.contains("0/0/0/0"),
        "{elsewhere}"
    );
}
