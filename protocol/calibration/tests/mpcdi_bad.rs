//! Archives that are wrong: each one is refused by a named error that tells its remedy.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::ReadError;
use support::{ALPHA, described, pfm, png, read_as, told, warp, zip};

fn with_alpha(alpha: &[u8]) -> Result<calibration::Calibration, ReadError> {
    let mut description = described("2d");
    description.files += ALPHA;
    let parts = [
        ("mpcdi.xml", description.xml()),
        ("warp.pfm", String::new()),
    ];
    read_as(
        &zip(&[
            (parts[0].0, parts[0].1.as_bytes()),
            ("warp.pfm", &warp()),
            ("a.png", alpha),
        ]),
        "a.mpcdi",
    )
}

#[test]
fn the_good_ones_are_good() {
    for profile in ["2d", "3d", "a3", "sl"] {
        let archive = zip(&[
            ("mpcdi.xml", described(profile).xml().as_bytes()),
            ("warp.pfm", &warp()),
        ]);
        assert!(read_as(&archive, "a.mpcdi").is_ok(), "{profile}");
    }
    assert!(
        with_alpha(&png(
            [2, 2],
            png::ColorType::Grayscale,
            png::BitDepth::Eight,
            &[9; 4]
        ))
        .is_ok()
    );
}

#[test]
fn missing_parts_are_named() {
    let error = read_as(&zip(&[("warp.pfm", &warp())]), "a.mpcdi").unwrap_err();
    assert!(
        matches!(&error, ReadError::MissingPart { part, .. } if part == "mpcdi.xml"),
        "{error}"
    );
    let error = read_as(
        &zip(&[("mpcdi.xml", described("2d").xml().as_bytes())]),
        "a.mpcdi",
    )
    .unwrap_err();
    assert!(
        matches!(&error, ReadError::MissingPart { part, .. } if part == "warp.pfm"),
        "{error}"
    );
    let mut description = described("2d");
    description.files += ALPHA;
    assert!(
        matches!(told(&description.xml()), ReadError::MissingPart { part, .. } if part == "a.png")
    );
}

#[test]
fn missing_elements_and_attributes_are_named_with_their_line() {
    let whole = described("sl").xml();
    for (gone, with, wanted) in [
        ("<display>", "<other>", "<display>"),
        ("<files>", "<other>", "<files>"),
        (
            "<fileset region=\"p1\">",
            "<fileset region=\"p2\">",
            "<fileset region=\"p1\">",
        ),
        ("<geometryWarpFile>", "<warp>", "<geometryWarpFile>"),
        ("<path>warp.pfm</path>", "", "<path>"),
        ("warp.pfm", "", "text"),
        ("<geometricUnit>cm</geometricUnit>", "", "<geometricUnit>"),
        ("<frustum>", "<other>", "<frustum>"),
        ("<coordinateFrame>", "<other>", "<coordinateFrame>"),
        ("<rollz>-1</rollz>", "", "<rollz>"),
        ("<yaw>-30</yaw>", "", "<yaw>"),
        (" Xresolution=\"2\"", "", "attribute Xresolution"),
        (" xsize=\"1\"", "", "attribute xsize"),
        (" id=\"p1\"", "", "attribute id"),
        (" profile=\"sl\"", "", "attribute profile"),
    ] {
        let close = |tag: &str| {
            tag.replacen('<', "</", 1)
                .split(' ')
                .next()
                .unwrap()
                .trim_end_matches('>')
                .to_owned()
                + ">"
        };
        let mut xml = whole.replacen(gone, with, 1);
        if with == "<other>" || with == "<warp>" {
            xml = xml.replacen(&close(gone), &close(with), 1);
        }
        assert_ne!(xml, whole, "{gone}");
        let error = told(&xml);
        let ReadError::MissingElement {
            wanted: found,
            line,
            ..
        } = &error
        else {
            panic!("{gone}: {error}")
        };
        assert_eq!(found, wanted);
        assert!(*line >= 2);
    }
    let no_region = whole
        .replace("<region ", "<area ")
        .replace("</region>", "</area>");
    assert!(matches!(told(&no_region), ReadError::MissingElement { .. }));
}

#[test]
fn values_out_of_range_are_named() {
    let whole = described("sl").xml();
    for (good, bad) in [
        ("profile=\"sl\"", "profile=\"4d\""),
        ("Xresolution=\"2\"", "Xresolution=\"0\""),
        ("Xresolution=\"2\"", "Xresolution=\"16385\""),
        ("Yresolution=\"2\"", "Yresolution=\"-2\""),
        ("x=\"0\"", "x=\"NaN\""),
        ("xsize=\"1\"", "xsize=\"0\""),
        ("ysize=\"1\"", "ysize=\"inf\""),
        ("<yaw>-30", "<yaw>left"),
        ("<rightAngle>20", "<rightAngle>90"),
        ("<leftAngle>-25", "<leftAngle>25"),
        ("<downAngle>-12", "<downAngle>15"),
        ("<pitchx>1", "<pitchx>2"),
        ("<rollz>-1", "<rollz>NaN"),
        ("<geometricUnit>cm", "<geometricUnit>unkown"),
        ("<MPCDI ", "<PCMDI "),
    ] {
        let mut xml = whole.replacen(good, bad, 1);
        assert_ne!(xml, whole, "{good}");
        if bad == "<PCMDI " {
            xml = xml.replace("</MPCDI>", "</PCMDI>");
        }
        let error = told(&xml);
        assert!(
            matches!(error, ReadError::BadValue { .. }),
            "{bad}: {error}"
        );
    }
    assert!(matches!(
        told(&whole.replace("version=\"1.0\">", "version=\"3.0\">")),
        ReadError::Unsupported { .. }
    ));
    let gamma = |value: &str| {
        let mut description = described("2d");
        description.files += &ALPHA.replace(">1.0<", &format!(">{value}<"));
        told(&description.xml())
    };
    for value in ["0", "-1", "NaN", "", "x"] {
        assert!(
            matches!(gamma(value), ReadError::BadValue { .. }),
            "{value}"
        );
    }
    let mut description = described("2d");
    description.files += &ALPHA.replace("<bitDepth>8", "<bitDepth>12");
    assert!(matches!(
        told(&description.xml()),
        ReadError::BadValue { .. }
    ));
}

#[test]
fn regions_must_differ_and_be_few() {
    let xml = described("2d").xml();
    let region = xml
        .split("<region ")
        .nth(1)
        .unwrap()
        .split("</region>")
        .next()
        .unwrap()
        .to_owned();
    let region = format!("<region {region}</region>");
    assert!(matches!(
        told(&xml.replace(&region, &region.repeat(2))),
        ReadError::DuplicateRegion { .. }
    ));
    let many: String = (0..257)
        .map(|index| region.replace("\"p1\"", &format!("\"p{index}\"")))
        .collect();
    let error = told(&xml.replace(&region, &many));
    assert!(
        matches!(
            error,
            ReadError::TooMany {
                count: 257,
                limit: 256,
                ..
            }
        ),
        "{error}"
    );
    let twice = "<fileset region=\"p1\"/></files>";
    assert!(matches!(
        told(&xml.replace("</files>", twice)),
        ReadError::BadValue { .. }
    ));
}

#[test]
fn paths_that_leave_the_archive_are_refused() {
    for path in [
        "../warp.pfm",
        "a/../../warp.pfm",
        "/warp.pfm",
        "maps\\warp.pfm",
        "C:/warp.pfm",
        "a//warp.pfm",
        "maps/",
    ] {
        let mut description = described("2d");
        description.files = description.files.replace("warp.pfm", path);
        let error = told(&description.xml());
        assert!(
            matches!(&error, ReadError::UnsafePath { path: told, .. } if told == path),
            "{path}: {error}"
        );
    }
    // An entry that nobody names is a sign all the same.
    for name in ["../evil", "a\\b", "/etc/passwd"] {
        let xml = described("2d").xml();
        let archive = zip(&[
            ("mpcdi.xml", xml.as_bytes()),
            ("warp.pfm", &warp()),
            (name, b"x"),
        ]);
        let error = read_as(&archive, "a.mpcdi").unwrap_err();
        assert!(
            matches!(error, ReadError::UnsafePath { .. }),
            "{name}: {error}"
        );
    }
    let folders = zip(&[
        ("mpcdi.xml", described("2d").xml().as_bytes()),
        ("warp.pfm", &warp()),
        ("maps/", b""),
    ]);
    assert!(
        read_as(&folders, "a.mpcdi").is_ok(),
        "folders are no offence"
    );
}

#[test]
fn sizes_are_compared() {
    let short = warp();
    let xml = described("2d").xml();
    let archive = zip(&[
        ("mpcdi.xml", xml.as_bytes()),
        ("warp.pfm", &short[..short.len() - 1]),
    ]);
    assert!(matches!(
        read_as(&archive, "a.mpcdi"),
        Err(ReadError::Truncated { .. })
    ));
    let archive = zip(&[
        ("mpcdi.xml", xml.as_bytes()),
        ("warp.pfm", &[&short[..], b"x"].concat()),
    ]);
    assert!(matches!(
        read_as(&archive, "a.mpcdi"),
        Err(ReadError::Overlong { .. })
    ));
    let other = png(
        [3, 2],
        png::ColorType::Grayscale,
        png::BitDepth::Eight,
        &[9; 6],
    );
    let error = with_alpha(&other).unwrap_err();
    assert!(
        matches!(
            error,
            ReadError::WrongSize {
                found_px: [3, 2],
                expected_px: [2, 2],
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn pictures_of_other_kinds_and_broken_ones_are_refused() {
    for (colour, depth, data) in [
        (png::ColorType::Rgba, png::BitDepth::Eight, vec![0; 16]),
        (
            png::ColorType::GrayscaleAlpha,
            png::BitDepth::Eight,
            vec![0; 8],
        ),
        (png::ColorType::Grayscale, png::BitDepth::One, vec![0; 2]),
    ] {
        let error = with_alpha(&png([2, 2], colour, depth, &data)).unwrap_err();
        assert!(matches!(error, ReadError::Unsupported { .. }), "{error}");
    }
    let good = png(
        [2, 2],
        png::ColorType::Grayscale,
        png::BitDepth::Eight,
        &[9; 4],
    );
    let error = with_alpha(&good[..good.len() - 20]).unwrap_err();
    assert!(matches!(error, ReadError::Damaged { .. }), "{error}");
    assert!(matches!(
        with_alpha(b"GIF89a"),
        Err(ReadError::Damaged { .. })
    ));
}

#[test]
fn a_picture_of_another_depth_than_described_is_noted() {
    let calibration = with_alpha(&png(
        [2, 2],
        png::ColorType::Rgb,
        png::BitDepth::Eight,
        &[9; 12],
    ))
    .unwrap();
    assert!(
        calibration
            .notes
            .iter()
            .any(|note| note.contains("other than the description"))
    );
}

#[test]
fn geometry_of_holes_only_is_refused() {
    for (profile, sample) in [
        ("2d", [f32::NAN; 3]),
        ("2d", [2.0, 0.5, 0.0]),
        ("a3", [f32::NAN; 3]),
    ] {
        let xml = described(profile).xml();
        let archive = zip(&[
            ("mpcdi.xml", xml.as_bytes()),
            ("warp.pfm", &pfm(2, &[sample; 4], true)),
        ]);
        let error = read_as(&archive, "a.mpcdi").unwrap_err();
        assert!(
            matches!(error, ReadError::NothingMapped { .. }),
            "{profile}: {error}"
        );
    }
}
