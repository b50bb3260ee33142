//! MPCDI archives: the conventions of every profile by hand-computed values. In: archives written by hand.
//! Out: regions whose values were computed by hand.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::{Frustum, Gamma, Mapping, Placement, PointOrigin, Texels};
use support::{Description, FRUSTUM, pfm, read_as, zip};

/// 2 × 2: u and v as an archive counts them, from the lower left corner.
const PLACES: [[f32; 3]; 4] = [
    [0.25, 1.0, 0.0],
    [0.5, 0.875, 0.0],
    [0.0, 0.25, 0.0],
    [1.0, 0.0, 0.0],
];

#[test]
fn pictures_count_from_the_upper_corner_here_and_from_the_lower_one_there() {
    let mut description = Description::new("2d", [2, 2]);
    description.place = [0.25, 0.125, 0.5, 0.25];
    let archive = zip(&[
        ("mpcdi.xml", description.xml().as_bytes()),
        ("warp.pfm", &pfm(2, &PLACES, false)),
    ]);
    let calibration = read_as(&archive, "a.mpcdi").unwrap();
    assert_eq!(calibration.date, "2026-11-23 03:00:00");
    assert!(calibration.notes.is_empty(), "{:?}", calibration.notes);
    let [region] = calibration.regions.as_slice() else {
        panic!("one region is due")
    };
    let Mapping::Canvas(uv) = &region.mapping else {
        panic!("a canvas is due")
    };
    assert_eq!(uv.placement, Placement::Centres);
    assert_eq!(
        uv.values,
        [[0.25, 0.0], [0.5, 0.125], [0.0, 0.75], [1.0, 1.0]]
    );
    let place = region.canvas.as_ref().unwrap();
    assert_eq!(
        (place.x, place.y, place.width, place.height),
        (0.25, 0.625, 0.5, 0.25)
    );
    assert_eq!(
        (place.buffer.as_str(), place.size_px),
        ("b", Some([4000, 1000]))
    );
    assert_eq!(
        (region.name.as_str(), region.size_px, region.gamma),
        ("p1", [2, 2], Gamma::default())
    );
}

#[test]
fn a_frustum_and_maps_of_light() {
    let mut description = Description::new("3d", [2, 2]);
    description.inside_region = FRUSTUM.to_owned();
    description.files += "<alphaMap><path>maps/a.png</path><componentDepth>1</componentDepth><bitDepth>8</bitDepth>\
                          <gammaEmbedded>2.2</gammaEmbedded></alphaMap>\
                          <betaMap><path>maps/b.png</path><componentDepth>3</componentDepth><bitDepth>16</bitDepth></betaMap>";
    let alpha = support::png(
        [2, 2],
        png::ColorType::Grayscale,
        png::BitDepth::Eight,
        &[0, 51, 102, 255],
    );
    let levels: Vec<u8> = (0..12_u16)
        .flat_map(|level| (level * 1000).to_be_bytes())
        .collect();
    let beta = support::png([2, 2], png::ColorType::Rgb, png::BitDepth::Sixteen, &levels);
    let archive = zip(&[
        ("mpcdi.xml", description.xml().as_bytes()),
        ("warp.pfm", &pfm(2, &PLACES, true)),
        ("maps/a.png", &alpha),
        ("maps/b.png", &beta),
    ]);
    let calibration = read_as(&archive, "a.mpcdi").unwrap();
    let region = &calibration.regions[0];
    let Mapping::Frustum { frustum, uv } = &region.mapping else {
        panic!("a frustum is due")
    };
    let wanted = Frustum {
        yaw_deg: -30.0,
        pitch_deg: 10.0,
        roll_deg: 5.0,
        left_deg: -25.0,
        right_deg: 20.0,
        up_deg: 15.0,
        down_deg: -12.0,
    };
    assert_eq!(*frustum, wanted);
    assert_eq!(uv.at(0, 1), Some([0.0, 0.75]));
    assert_eq!(
        region.alpha.as_ref().unwrap().texels,
        Texels::Grey(vec![0.0, 0.2, 0.4, 1.0])
    );
    let Texels::Colour(beta) = &region.beta.as_ref().unwrap().texels else {
        panic!("colours are due")
    };
    assert_eq!(
        beta[1],
        [3000.0 / 65535.0, 4000.0 / 65535.0, 5000.0 / 65535.0]
    );
    assert_eq!((region.gamma.alpha, region.gamma.beta), (2.2, 1.0));
}

#[test]
fn points_come_in_every_unit() {
    let points = [
        [1.0, 2.0, -3.0],
        [f32::NAN, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [4.0, 5.0, 6.0],
    ];
    for (unit, metres) in [
        ("mm", 0.001),
        ("cm", 0.01),
        ("dm", 0.1),
        ("m", 1.0),
        ("in", 0.0254),
        ("ft", 0.3048),
        ("yd", 0.9144),
    ] {
        let mut description = Description::new("a3", [2, 2]);
        description.files = description.files.replace("cm", unit);
        let archive = zip(&[
            ("mpcdi.xml", description.xml().as_bytes()),
            ("warp.pfm", &pfm(2, &points, true)),
        ]);
        let calibration = read_as(&archive, "a.mpcdi").unwrap();
        let Mapping::Points {
            points_m,
            origin,
            projector,
        } = &calibration.regions[0].mapping
        else {
            panic!()
        };
        assert_eq!((*origin, projector), (PointOrigin::FloorCentre, &None));
        let [x, y, z] = points_m.at(1, 1).unwrap();
        for (found, wanted) in [(x, 4.0), (y, 5.0), (z, 6.0)] {
            assert!(
                (f64::from(found) - wanted * metres).abs() < 1e-6,
                "{unit}: {found}"
            );
        }
        assert!(points_m.at(1, 0).is_none());
    }
}

/// "Surveyor" coordinates: x right, y ahead, z up.
const SURVEYOR: &str = "<coordinateFrame><posx>100</posx><posy>-200</posy><posz>300</posz>\
    <yawx>0</yawx><yawy>0</yawy><yawz>-1</yawz><pitchx>1</pitchx><pitchy>0</pitchy><pitchz>0</pitchz>\
    <rollx>0</rollx><rolly>1</rolly><rollz>0</rollz></coordinateFrame>";

#[test]
fn a_shader_lamp_is_turned_from_its_own_axes() {
    let mut description = Description::new("sl", [2, 2]);
    description.inside_region = format!("{FRUSTUM}{SURVEYOR}");
    description.files += "<distortionMap><path>lens.pfm</path></distortionMap>";
    let archive = zip(&[
        ("mpacs.xml", description.xml().as_bytes()),
        ("warp.pfm", &pfm(2, &[[100.0, 250.0, 50.0]; 4], true)),
        ("lens.pfm", &pfm(2, &PLACES, true)),
    ]);
    let calibration = read_as(&archive, "a.mpcdi").unwrap();
    let region = &calibration.regions[0];
    let Mapping::Points {
        points_m,
        projector,
        ..
    } = &region.mapping
    else {
        panic!("points are due")
    };
    // Ahead is −z, up is y: (1, 2.5 ahead, 0.5 up) is (1, 0.5, −2.5).
    assert_eq!(points_m.at(0, 0), Some([1.0, 0.5, -2.5]));
    let projector = projector.as_ref().unwrap();
    assert_eq!(projector.position_m, [1.0, 3.0, 2.0]);
    assert_eq!(projector.frustum.up_deg, 15.0);
    assert_eq!(
        region.distortion.as_ref().unwrap().at(1, 0),
        Some([0.5, 0.125])
    );
}

#[test]
fn names_are_read_in_any_case_and_what_is_not_read_is_noted() {
    let mut description = Description::new("2d", [2, 2]);
    description.inside_region = "<frustum/><lens/>".to_owned();
    let xml = description
        .xml()
        .replace("Xresolution", "xResolution")
        .replace("Yresolution", "YRESOLUTION")
        .replace("xsize", "xSize")
        .replace("originOf3DData", "originof3DData")
        .replace("linear", "smooth")
        .replace("version=\"1.0\">", "version=\"2.0\" geometry=\"1\">")
        .replace("</files>", "</files><extensionSet/>");
    let archive = zip(&[
        ("mpcdi.xml", xml.as_bytes()),
        ("warp.pfm", &pfm(2, &PLACES, true)),
    ]);
    let notes = read_as(&archive, "a.mpcdi").unwrap().notes;
    for wanted in ["<extensionSet>", "<lens>", "<frustum>", "smooth"] {
        assert!(
            notes.iter().any(|note| note.contains(wanted)),
            "{wanted}: {notes:?}"
        );
    }
}
