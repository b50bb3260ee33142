//! Portable float maps: distinct numbers in both byte orders, line ends, sizes, and every way to be wrong.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::{Choice, Format, Grid, Mapping, Options, PfmMeaning, ReadError, RowOrder, read};
use support::{pfm, read_as};

/// 3 × 2 with distinct numbers; the first three are the upper row.
const ROWS: [[f32; 3]; 6] = [
    [1.0, 2.0, 3.0],
    [4.0, 5.0, 6.0],
    [7.0, 8.0, 9.0],
    [-1.5, -2.5, -3.5],
    [-4.5, -5.5, -6.5],
    [-7.5, -8.5, 1e-3],
];

fn points(bytes: &[u8], options: &Options) -> Grid<[f32; 3]> {
    let calibration = read(bytes, "screen.pfm", options).unwrap();
    let [region] = calibration.regions.as_slice() else {
        panic!("one region is due")
    };
    assert_eq!(region.size_px, [3, 2]);
    let Mapping::Points { points_m, .. } = &region.mapping else {
        panic!("points are due")
    };
    points_m.clone()
}

#[test]
fn both_byte_orders_give_the_same_rows_from_the_top() {
    for is_little_endian in [true, false] {
        let grid = points(&pfm(3, &ROWS, is_little_endian), &Options::default());
        assert_eq!(grid.values, ROWS);
        assert_eq!(grid.at(2, 1), Some([-7.5, -8.5, 1e-3]));
        // Pixel (1, 0) of 3 × 2 has its centre at (½, ¼).
        assert_eq!(grid.sample(0.5, 0.25), Some([4.0, 5.0, 6.0]));
    }
}

#[test]
fn the_bytes_are_as_the_format_says() {
    let mut bytes = b"PF 3\t2 -2.5\n".to_vec();
    for row in [&ROWS[3..], &ROWS[..3]] {
        row.iter()
            .flatten()
            .for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    assert_eq!(points(&bytes, &Options::default()).values, ROWS);
}

#[test]
fn all_line_ends_are_one() {
    let unix = pfm(3, &ROWS, true);
    let data = &unix[unix.len() - 72..];
    for header in ["PF\r\n3 2\r\n-1.0\r\n", "PF\r3 2\r-1.0\r", "PF\n3 2\n-1.0 "] {
        let bytes = [header.as_bytes(), data].concat();
        assert_eq!(
            points(&bytes, &Options::default()).values,
            ROWS,
            "{header:?}"
        );
    }
}

#[test]
fn rows_from_the_top_units_and_holes() {
    let options = Options {
        pfm_rows: RowOrder::TopFirst,
        unit_m: 0.5,
        ..Options::default()
    };
    assert_eq!(
        points(&pfm(3, &ROWS, true), &options).at(0, 0),
        Some([-0.75, -1.25, -1.75])
    );
    let mut rows = ROWS;
    rows[1][2] = f32::NAN;
    rows[2][0] = f32::INFINITY;
    let grid = points(&pfm(3, &rows, true), &Options::default());
    assert_eq!(grid.at(0, 0), Some(ROWS[0]));
    assert_eq!((grid.at(1, 0), grid.at(2, 0)), (None, None));
    assert!(
        grid.values[1].iter().all(|value| value.is_nan()),
        "a hole is one in all channels"
    );
}

#[test]
fn as_canvas_v_counts_from_the_lower_edge_and_the_third_channel_is_not_used() {
    let rows = [[0.25, 0.75, f32::NAN], [0.75, 0.25, 5.0]];
    let options = Options {
        pfm: PfmMeaning::Canvas,
        size_px: Some([200, 100]),
        ..Options::default()
    };
    let calibration = read(&pfm(2, &rows, true), "warp", &options).unwrap();
    assert_eq!(calibration.regions[0].size_px, [200, 100]);
    let Mapping::Canvas(uv) = &calibration.regions[0].mapping else {
        panic!("a canvas is due")
    };
    assert_eq!(uv.values, [[0.25, 0.25], [0.75, 0.75]]);
}

#[test]
fn the_one_region_is_number_0() {
    let bytes = pfm(3, &ROWS, true);
    let with = |choice| Options {
        region: Some(choice),
        format: Some(Format::Pfm),
        ..Options::default()
    };
    assert!(read(&bytes, "a", &with(Choice::Number(0))).is_ok());
    assert!(read(&bytes, "a", &with(Choice::Name("0".to_owned()))).is_ok());
    let error = read(&bytes, "a", &with(Choice::Number(1))).unwrap_err();
    assert!(matches!(error, ReadError::NoRegion { .. }), "{error}");
}

#[test]
fn a_wrong_length_is_told_in_bytes() {
    let bytes = pfm(3, &ROWS, true);
    for cut in [1, 12, 71, 72] {
        let error = read_as(&bytes[..bytes.len() - cut], "a.pfm").unwrap_err();
        let ReadError::Truncated {
            expected, found, ..
        } = error
        else {
            panic!("{error}")
        };
        assert_eq!((expected, found), (72, 72 - cut as u64));
    }
    let error = read_as(&[&bytes[..], &[0]].concat(), "a.pfm").unwrap_err();
    assert!(
        matches!(error, ReadError::Overlong { expected: 72, .. }),
        "{error}"
    );
}

#[test]
fn what_the_header_says_is_checked() {
    for header in [
        "PF\n0 2\n-1\n",
        "PF\n3 16385\n-1\n",
        "PF\n-3 2\n-1\n",
        "PF\n3 x\n-1\n",
        "PF\n3 2\n0\n",
        "PF\n3 2\nnan\n",
    ] {
        let error = read_as(header.as_bytes(), "a.pfm").unwrap_err();
        assert!(
            matches!(error, ReadError::BadValue { .. }),
            "{header:?}: {error}"
        );
        assert!(error.to_string().contains("Write "), "the remedy: {error}");
    }
    for header in ["PF\n3", "PF\n3 2\n-1", "PF\n\u{7}3 2\n-1\n"] {
        let error = read_as(header.as_bytes(), "a.pfm").unwrap_err();
        assert!(
            matches!(error, ReadError::Damaged { .. }),
            "{header:?}: {error}"
        );
    }
    let error = read_as(b"Pf\n1 1\n-1\n\0\0\0\0", "a.pfm").unwrap_err();
    assert!(matches!(error, ReadError::Unsupported { .. }), "{error}");
    let error = read_as(b"PF\n16384 16384\n-1\n", "a.pfm").unwrap_err();
    assert!(matches!(error, ReadError::TooLarge { .. }), "{error}");
}

#[test]
fn geometry_of_holes_only_is_refused() {
    let error = read_as(&pfm(2, &[[f32::NAN; 3]; 4], true), "a.pfm").unwrap_err();
    assert!(matches!(error, ReadError::NothingMapped { .. }), "{error}");
}
