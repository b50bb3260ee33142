//! Meshes as text: OBJ, domeprojection and Bourke, with hand-computed pixels, and every way to be wrong.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use std::fmt::Write as _;

use calibration::{
    Format, Grid, Mapping, ObjMeaning, Options, Placement, ReadError, Texels, detect, load, read,
};

fn sized(width: u32, height: u32) -> Options {
    Options {
        size_px: Some([width, height]),
        ..Options::default()
    }
}

fn canvas(text: &str, name: &str, options: &Options) -> Grid<[f32; 2]> {
    let calibration = read(text.as_bytes(), name, options).unwrap();
    let Mapping::Canvas(uv) = &calibration.regions[0].mapping else {
        panic!("a canvas is due")
    };
    uv.clone()
}

/// The places of the pixels of 4 × 2, turned by 180°.
fn turned() -> Vec<[f32; 2]> {
    support::even(4, 2).into_iter().rev().collect()
}

fn near(found: &[[f32; 2]], wanted: &[[f32; 2]]) -> bool {
    found.len() == wanted.len()
        && found
            .iter()
            .flatten()
            .zip(wanted.iter().flatten())
            .all(|(a, b)| (a - b).abs() < 1e-6)
}

/// The picture turned by 180°: the output's lower left shows the picture's upper right.
const OBJ: &str = "# a warp\no mesh\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n\
                   vt 1 1\nvt 0 1\nvt 0 0\nvt 1 0\nvn 0 0 1\n";

#[test]
fn an_obj_of_a_quadrilateral_of_triangles_and_of_relative_numbers_is_the_same_warp() {
    for faces in [
        "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
        "f 1/1 2/2 3/3\r\nf 1/1 3/3 4/4\r\n",
        "f -4/-4 -3/-3 -2/-2 -1/-1",
    ] {
        let uv = canvas(&format!("{OBJ}{faces}"), "warp.obj", &sized(4, 2));
        assert_eq!(uv.placement, Placement::Centres);
        assert!(near(&uv.values, &turned()), "{faces}: {:?}", uv.values);
    }
}

#[test]
fn what_an_obj_does_not_cover_is_a_hole() {
    let uv = canvas(&format!("{OBJ}f 1/1 2/2 3/3\n"), "warp.obj", &sized(4, 4));
    // The triangle is the output's lower right half.
    assert!(uv.at(3, 3).is_some() && uv.at(3, 1).is_some());
    assert!(uv.at(0, 0).is_none() && uv.at(0, 2).is_none());
}

#[test]
fn an_obj_with_depth_is_a_screen() {
    let text = "v 0 0 -1\nv 200 0 -1\nv 200 100 -3\nv 0 100 -3\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    let options = Options {
        unit_m: 0.01,
        ..sized(2, 2)
    };
    let calibration = read(text.as_bytes(), "screen.obj", &options).unwrap();
    let Mapping::Points { points_m, .. } = &calibration.regions[0].mapping else {
        panic!("points are due")
    };
    // The upper left pixel's centre is a quarter from the left and three quarters up.
    let wanted = [0.5, 0.75, -0.025];
    let found = points_m.at(0, 0).unwrap();
    assert!(
        found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6),
        "{found:?}"
    );
    let told = Options {
        obj: ObjMeaning::Warp,
        ..options
    };
    let calibration = read(text.as_bytes(), "screen.obj", &told).unwrap();
    assert!(matches!(calibration.regions[0].mapping, Mapping::Canvas(_)));
}

#[test]
fn a_wrong_obj_is_told_by_its_line() {
    for (added, line) in [
        ("f 1/1 2/2 3/5\n", 12),
        ("f 1/1 2/2 -5/1\n", 12),
        ("f 1/1 2/2 0/1\n", 12),
        ("f 1 2 3\n", 12),
        ("f 1/1 2/2\n", 12),
        ("f 1/1 2/2 3/3 4/4 1/1\n", 12),
        ("v 1 2\n", 12),
        ("v 1 2 nan\n", 12),
        ("vt 1e300 0\n", 12),
        ("\nsurf 0 1\n", 13),
    ] {
        let error = read(format!("{OBJ}{added}").as_bytes(), "warp.obj", &sized(4, 2)).unwrap_err();
        let ReadError::BadValue { line: found, .. } = error else {
            panic!("{added}: {error}")
        };
        assert_eq!(found, line, "{added}");
    }
    let error = read(OBJ.as_bytes(), "warp.obj", &sized(4, 2)).unwrap_err();
    assert!(matches!(error, ReadError::NothingMapped { .. }), "{error}");
    let error = support::read_as(OBJ.as_bytes(), "warp.obj").unwrap_err();
    assert!(matches!(error, ReadError::SizeNeeded { .. }), "{error}");
    let error = read(OBJ.as_bytes(), "warp.obj", &sized(0, 2)).unwrap_err();
    assert!(matches!(error, ReadError::BadSize { .. }), "{error}");
}

/// A mesh of vertices on the output's corners and in its middle, u = x² and v = y.
fn dome(columns: u32, rows: u32, first: u32, bend: f32) -> String {
    let mut text = String::from("x;y;u;v;column;row\n");
    for row in 0..rows {
        for column in 0..columns {
            let x = column as f32 / (columns - 1) as f32;
            let y = row as f32 / (rows - 1) as f32;
            let bent = y + bend * x * (1.0 - x);
            writeln!(
                text,
                "{x};{bent};{};{y};{};{}",
                x * x,
                column + first,
                row + first
            )
            .unwrap();
        }
    }
    text
}

#[test]
fn a_regular_domeprojection_mesh_stays_a_mesh_on_the_corners() {
    for first in [0, 1] {
        let uv = canvas(&dome(3, 2, first, 0.0), "a.csv", &sized(1920, 1080));
        assert_eq!(
            (uv.width, uv.height, uv.placement),
            (3, 2, Placement::Corners)
        );
        assert_eq!(
            uv.values,
            [
                [0.0, 0.0],
                [0.25, 0.0],
                [1.0, 0.0],
                [0.0, 1.0],
                [0.25, 1.0],
                [1.0, 1.0]
            ]
        );
        assert_eq!(uv.sample(0.25, 0.0), Some([0.125, 0.0]));
    }
}

#[test]
fn a_bent_domeprojection_mesh_is_drawn_at_pixel_centres() {
    let uv = canvas(&dome(3, 2, 0, 0.4), "a.csv", &sized(8, 10));
    assert_eq!(
        (uv.width, uv.height, uv.placement),
        (8, 10, Placement::Centres)
    );
    // In the left half u = x/2 and the mesh lies 0.2 x too low: (¼ + 1/16, 0.35) shows v = 0.35 − 0.2 · 5/16.
    let [u, v] = uv.at(2, 3).unwrap();
    assert!(
        (u - 0.5 * 5.0 / 16.0).abs() < 1e-6 && (v - (0.35 - 0.2 * 5.0 / 16.0)).abs() < 1e-6,
        "{u} {v}"
    );
    assert!(uv.at(3, 0).is_none(), "above the mesh is nothing");
}

#[test]
fn a_wrong_domeprojection_mesh_is_told() {
    let text = dome(3, 3, 0, 0.0);
    let without_last = text.trim_end().rsplit_once('\n').unwrap().0;
    let error = read(without_last.as_bytes(), "a.csv", &sized(8, 8)).unwrap_err();
    assert!(matches!(error, ReadError::Damaged { .. }), "{error}");
    let twice = text.replace("1;1;1;1;2;2", "1;1;1;1;1;2");
    let error = read(twice.as_bytes(), "a.csv", &sized(8, 8)).unwrap_err();
    assert!(
        matches!(error, ReadError::BadValue { line: 10, .. }),
        "{error}"
    );
    let far = text.replace("1;1;1;1;2;2", "1;1;1;1;2;4000000000");
    let error = read(far.as_bytes(), "a.csv", &sized(8, 8)).unwrap_err();
    assert!(matches!(error, ReadError::BadSize { .. }), "{error}");
    let error = read(
        text.replace("0.25", "NaN").as_bytes(),
        "a.csv",
        &sized(8, 8),
    )
    .unwrap_err();
    assert!(
        matches!(error, ReadError::BadValue { line: 3, .. }),
        "{error}"
    );
}

/// A rectangular mesh over an output of 2 : 1, from the bottom; `light` of each node.
fn bourke(kind: u32, light: [f32; 6]) -> String {
    let mut text = format!("{kind}\n3 2\n");
    for (index, light) in light.into_iter().enumerate() {
        let (column, row) = (index % 3, index / 3);
        let (x, y) = (2.0 * (column as f32 - 1.0), row as f32 * 2.0 - 1.0);
        writeln!(
            text,
            "{x} {y} {} {} {light}",
            column as f32 / 2.0,
            row as f32
        )
        .unwrap();
    }
    text
}

#[test]
fn a_bourke_mesh_counts_upwards_and_over_the_aspect() {
    let calibration = read(bourke(2, [1.0; 6]).as_bytes(), "a.data", &sized(200, 100)).unwrap();
    let region = &calibration.regions[0];
    assert!(region.alpha.is_none());
    let Mapping::Canvas(uv) = &region.mapping else {
        panic!("a canvas is due")
    };
    assert_eq!(uv.placement, Placement::Corners);
    assert_eq!(
        uv.values,
        [
            [0.0, 0.0],
            [0.5, 0.0],
            [1.0, 0.0],
            [0.0, 1.0],
            [0.5, 1.0],
            [1.0, 1.0]
        ]
    );
}

#[test]
fn the_light_of_a_bourke_mesh_is_its_alpha_and_hidden_nodes_are_left_out() {
    let calibration = read(
        bourke(2, [1.0, 1.0, -1.0, 0.0, 1.0, 1.0]).as_bytes(),
        "a.data",
        &sized(4, 2),
    )
    .unwrap();
    let region = &calibration.regions[0];
    let Mapping::Canvas(uv) = &region.mapping else {
        panic!("a canvas is due")
    };
    assert!(uv.at(0, 0).is_some() && uv.at(1, 1).is_some());
    assert!(
        uv.at(2, 0).is_none() && uv.at(3, 1).is_none(),
        "its lower right node is hidden"
    );
    let Some(Texels::Grey(alpha)) = region.alpha.as_ref().map(|map| &map.texels) else {
        panic!("grey is due")
    };
    // Pixel (0, 0) lies a quarter into its cell and three quarters up, in the triangle of the nodes at the lower
    // left (light 1, share ¼), the upper middle (1, ¼) and the upper left (0, ½).
    assert!((alpha[0] - 0.5).abs() < 1e-6, "{alpha:?}");
    assert_eq!(alpha[2], 0.0, "no light where nothing is drawn");
}

#[test]
fn polar_bourke_meshes_must_be_closed() {
    let error = read(bourke(1, [1.0; 6]).as_bytes(), "a.data", &sized(4, 2)).unwrap_err();
    assert!(matches!(error, ReadError::Unsupported { .. }), "{error}");
    // Three rays of two nodes; the last ray is the first.
    let closed = "1\n4 2\n0 0 .5 .5 1\n0 0 .5 .5 1\n0 0 .5 .5 1\n0 0 .5 .5 1\n\
                  0 1 .5 1 1\n.8 -.6 1 0 1\n-.8 -.6 0 0 1\n0 1 .5 1 1\n";
    let uv = canvas(closed, "a.data", &sized(20, 20));
    let [u, v] = uv.at(9, 9).unwrap();
    assert!((u - 0.5).abs() < 0.1 && (v - 0.5).abs() < 0.1);
}

#[test]
fn a_wrong_bourke_mesh_is_told() {
    let text = bourke(2, [1.0; 6]);
    for (from, to) in [
        ("2\n3 2", "3\n3 2"),
        ("3 2\n", "3\n"),
        ("3 2\n", "1 6\n"),
        ("3 2\n", "20000 2\n"),
        ("0 -1 0.5 0 1", "0 -1 0.5 0"),
        ("0 -1 0.5 0 1", "0 -1 0.5 0 1 1"),
        ("0 -1 0.5 0 1", "0 -1 0.5 0 NaN"),
    ] {
        let wrong = text.replacen(from, to, 1);
        assert_ne!(wrong, text, "{from}");
        let options = Options {
            format: Some(Format::Bourke),
            ..sized(4, 2)
        };
        let error = read(wrong.as_bytes(), "a.data", &options).unwrap_err();
        assert!(matches!(error, ReadError::BadValue { .. }), "{to}: {error}");
    }
    let error = read(
        format!("{text}1 1 1 1 1\n").as_bytes(),
        "a.data",
        &sized(4, 2),
    )
    .unwrap_err();
    assert!(
        matches!(error, ReadError::BadValue { line: 9, .. }),
        "{error}"
    );
    let cut = text.trim_end().rsplit_once('\n').unwrap().0;
    let error = read(cut.as_bytes(), "a.data", &sized(4, 2)).unwrap_err();
    assert!(matches!(error, ReadError::Damaged { .. }), "{error}");
    let error = read(bourke(2, [-1.0; 6]).as_bytes(), "a.data", &sized(4, 2)).unwrap_err();
    assert!(matches!(error, ReadError::NothingMapped { .. }), "{error}");
}

#[test]
fn the_contents_tell_the_format_before_the_name_does() {
    let pfm = support::pfm(1, &[[0.0; 3]], true);
    for (bytes, format) in [
        (&pfm[..], Format::Pfm),
        (OBJ.as_bytes(), Format::Obj),
        (dome(2, 2, 0, 0.0).as_bytes(), Format::Domeprojection),
        (
            dome(2, 2, 0, 0.0).split_once('\n').unwrap().1.as_bytes(),
            Format::Domeprojection,
        ),
        (bourke(2, [1.0; 6]).as_bytes(), Format::Bourke),
        (&support::zip(&[]), Format::Mpcdi),
        (b"vwf1", Format::Vwf),
    ] {
        assert_eq!(detect(bytes, "misleading.xyz"), Some(format));
        assert_eq!(detect(bytes, "misleading.mpcdi"), Some(format));
    }
    assert_eq!(detect(b"", "warp.OBJ"), Some(Format::Obj));
    assert_eq!(detect(b"hello", "hello"), None);
    let error = support::read_as(b"hello", "hello.txt").unwrap_err();
    assert!(matches!(error, ReadError::UnknownFormat { .. }), "{error}");
    let error = support::read_as(b"<?xml version=\"1.0\"?><MPCDI/>", "a.xml").unwrap_err();
    assert!(matches!(error, ReadError::Unsupported { .. }), "{error}");
}

#[test]
fn a_file_is_read_up_to_the_bound() {
    let path = std::env::temp_dir().join(format!("calibration-{}.pfm", std::process::id()));
    std::fs::write(&path, support::pfm(2, &[[1.0; 3]; 4], true)).unwrap();
    let calibration = load(&path, &Options::default());
    let mut small = Options::default();
    small.limits.total_bytes = 20;
    let bounded = load(&path, &small);
    std::fs::remove_file(&path).unwrap();
    assert_eq!(calibration.unwrap().regions[0].size_px, [2, 2]);
    assert!(matches!(
        bounded.unwrap_err(),
        ReadError::TooLarge {
            limit_bytes: 20,
            ..
        }
    ));
    let error = load(&path, &Options::default()).unwrap_err();
    assert!(matches!(error, ReadError::Unreadable { .. }), "{error}");
}
