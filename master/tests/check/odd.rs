//! Every warning, provoked by a small change of a shipped wall.

use super::{findings, shipped, walls, warnings};

/// A wall with one mistake: which one, what is replaced (everywhere) by what, words of one sentence that must be said,
/// and how many are said.
struct Mistake {
    wall: &'static str,
    changes: &'static [(&'static str, &'static str)],
    words: &'static [&'static str],
    count: usize,
}

const RIGHT_OF_CAVE: &str = "{ bottom_left = [1.5, 0.0, -1.5], bottom_right = [1.5, 0.0, 1.5], top_left = [1.5, 2.4, -1.5] }";
const RIGHT_TOP: &str = "canvas_px = [640, 0, 640, 360]";
const LEFT_TOP: &str = "canvas_px = [0, 0, 640, 360]";

const MISTAKES: &[Mistake] = &[
    // How screens meet.
    Mistake {
        wall: "cave-4",
        changes: &[(
            RIGHT_OF_CAVE,
            "{ bottom_left = [1.53, 0.0, -1.5], bottom_right = [1.53, 0.0, 1.5], top_left = [1.53, 2.4, -1.5] }",
        )],
        words: &["\"front\"", "\"right\"", "nearly meet but do not", "3.0 cm"],
        // The floor does not reach it either.
        count: 2,
    },
    Mistake {
        wall: "cave-4",
        changes: &[(
            RIGHT_OF_CAVE,
            "{ bottom_left = [1.47, 0.0, -1.5], bottom_right = [1.47, 0.0, 1.5], top_left = [1.47, 2.4, -1.5] }",
        )],
        words: &[
            "\"front\"",
            "\"right\"",
            "go through each other",
            "3.0 cm behind \"right\"",
        ],
        count: 2,
    },
    Mistake {
        wall: "cave-4",
        changes: &[(
            RIGHT_OF_CAVE,
            "{ bottom_left = [1.0, 0.0, -2.5], bottom_right = [1.0, 0.0, 0.5], top_left = [1.0, 2.4, -2.5] }",
        )],
        words: &[
            "\"front\"",
            "\"right\"",
            "cross each other",
            "0.50 m",
            "1.00,",
        ],
        count: 1,
    },
    Mistake {
        wall: "dome-5",
        changes: &[("fisheye_deg = 76.0", "fisheye_deg = 74.0")],
        words: &["\"front\" and \"top\" nearly meet but do not", "7.0 cm"],
        count: 4,
    },
    // Densities.
    Mistake {
        wall: "cave-4",
        changes: &[("1200, 1200]", "500, 500]")],
        words: &[
            "\"front\" has 2.8 times as many pixels",
            "neighbour \"floor\"",
        ],
        count: 3,
    },
    Mistake {
        wall: "cave-4",
        changes: &[("1200, 1200]", "200, 200]")],
        words: &["detail follows the densest", "\"floor\""],
        count: 4,
    },
    // Heads.
    Mistake {
        wall: "demo-2x2",
        changes: &[("head_m = [0.0, 1.7, 3.0]", "head_m = [0.0, -0.1, 3.0]")],
        words: &["\"viewer\"", "-0.1 m above the floor"],
        count: 1,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[("head_m = [0.0, 1.7, 3.0]", "head_m = [0.0, 3.2, 3.0]")],
        words: &["\"viewer\"", "3.2 m above the floor"],
        count: 1,
    },
    Mistake {
        wall: "powerwall-3x2-bezels",
        changes: &[("head_m = [0.0, 1.7, 2.5]", "head_m = [0.0, 3.4, 2.5]")],
        words: &["1.20 m above the top"],
        // Above 3 m as well, and the bezels.
        count: 3,
    },
    Mistake {
        wall: "single",
        changes: &[("head_m = [0.0, 0.0, 0.6]", "head_m = [0.0, 0.0, 60.0]")],
        words: &["60.00 m from all of its screens"],
        count: 1,
    },
    Mistake {
        wall: "single",
        changes: &[("head_m = [0.0, 0.0, 0.6]", "head_m = [0.0, 0.0, 0.2]")],
        words: &["only 0.20 m from the head"],
        count: 1,
    },
    Mistake {
        wall: "single",
        changes: &[(
            "head_m = [0.0, 0.0, 0.6]",
            "head_m = [0.0, 0.0, 0.02]\nlooks_deg = [90.0, 0.0, 0.0]",
        )],
        words: &["the right eye", "behind screen \"monitor\""],
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[(
            "[-2.0, 0.5, 0.0], bottom_right = [2.0, 0.5, 0.0], top_left = [-2.0, 2.75, 0.0]",
            "[-200.0, 50.0, 0.0], bottom_right = [200.0, 50.0, 0.0], top_left = [-200.0, 275.0, 0.0]",
        )],
        words: &["\"front\" measures 458.9", "in metres"],
        count: 1,
    },
    Mistake {
        wall: "vrlab-siegen",
        changes: &[("head_m = [0.0, 1.78, 0.0]", "head_m = [0.0, 1.78, 2.6]")],
        words: &[
            "outside the cylinder of screen \"wall-2\"",
            "2.60 m from its axis",
        ],
        count: 4,
    },
    Mistake {
        wall: "dome-5",
        changes: &[("head_m = [0.0, 1.4, 0.6]", "head_m = [0.0, 1.5, 4.4]")],
        words: &[
            "outside the sphere of screen \"top\"",
            "4.40 m from its centre",
        ],
        count: 5,
    },
    Mistake {
        wall: "dome-5",
        changes: &[("head_m = [0.0, 1.4, 0.6]", "head_m = [0.0, 3.5, 3.8]")],
        words: &["sees only 78 % of screen \"back\" from the front"],
        // Above 3 m, outside of five spheres, and so near to one that its pixels are large.
        count: 9,
    },
    Mistake {
        wall: "cave-4",
        changes: &[("head_m = [0.0, 1.7, 0.4]", "head_m = [0.0, 1.7, -1.1]")],
        words: &["tracked head", "\"front\" from behind", "0.5 m"],
        // So near the front wall its pixels are small.
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[(
            "[[screens]]",
            "[[observers]]\nname = \"guest\"\nhead_m = [0.0, 1.7, -1.0]\n[[screens]]",
        )],
        words: &["\"guest\" sees screen \"front\" of observer \"viewer\" from behind"],
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[(
            "[[screens]]",
            "[[observers]]\nname = \"guest\"\nhead_m = [0.0, 1.7, 2.0]\n[[screens]]",
        )],
        words: &["\"guest\" looks at no screen"],
        count: 1,
    },
    // Eyes and trackers.
    Mistake {
        wall: "cave-4",
        changes: &[("tracker = \"glasses\"", "")],
        words: &["no observer uses tracker \"glasses\""],
        count: 1,
    },
    Mistake {
        wall: "cave-4",
        changes: &[("eye_separation_m = 0.063", "eye_separation_m = 0.0")],
        words: &["no distance between the eyes"],
        count: 1,
    },
    Mistake {
        wall: "cave-4",
        changes: &[("eye_separation_m = 0.063", "eye_separation_m = 0.1")],
        words: &["0.1 m apart", "0.05…0.075"],
        count: 1,
    },
    Mistake {
        wall: "cave-4",
        changes: &[(
            "eye = \"right\", canvas_px = [0, 0, 1200, 1200]",
            "eye = \"centre\", canvas_px = [0, 0, 1200, 1200]",
        )],
        words: &["\"floor\"", "for the left eye but none for the right one"],
        count: 1,
    },
    Mistake {
        wall: "cave-4",
        changes: &[(
            "eye = \"left\", canvas_px = [0, 0, 1200, 1200]",
            "eye = \"left\", canvas_px = [0, 0, 1200, 1000]",
        )],
        words: &[
            "240000 pixels of screen \"floor\"",
            "to the right eye but not to the left one",
        ],
        count: 1,
    },
    // What outputs show.
    Mistake {
        wall: "demo-2x2",
        changes: &[(RIGHT_TOP, "canvas_px = [600, 0, 640, 360]")],
        words: &["same 14400 pixels", "without blend ramps", "right = 40"],
        // Nobody shows the 40 columns at the right.
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[
            (
                LEFT_TOP,
                "blend_px = { right = 40 }, canvas_px = [0, 0, 640, 360]",
            ),
            (RIGHT_TOP, "canvas_px = [600, 0, 640, 360]"),
        ],
        words: &["host \"right-top\" has no ramp there", "left = 40"],
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[
            (
                LEFT_TOP,
                "blend_px = { right = 40 }, canvas_px = [0, 0, 640, 360]",
            ),
            (
                RIGHT_TOP,
                "blend_px = { left = 46 }, canvas_px = [600, 0, 640, 360]",
            ),
        ],
        words: &["left ramp", "46 pixels wide, but 40 pixels"],
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[(RIGHT_TOP, LEFT_TOP)],
        words: &["same 230400 pixels", "one over the other"],
        count: 2,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[(
            LEFT_TOP,
            "blend_px = { top = 20 }, canvas_px = [0, 0, 640, 360]",
        )],
        words: &["top ramp", "host \"left-top\"", "fades into black"],
        count: 1,
    },
    Mistake {
        wall: "cave-4",
        changes: &[(
            "screen = \"front\", eye = \"left\",",
            "screen = \"front\", eye = \"left\", blend_px = { left = 50 },",
        )],
        // The left wall meets it there, and shows nothing on it.
        words: &[
            "left ramp of output \"left-eye\" of host \"front\"",
            "fades into black",
        ],
        count: 1,
    },
    Mistake {
        wall: "demo-2x2",
        changes: &[(RIGHT_TOP, "canvas_px = [640, 0, 640, 300]")],
        words: &["no output shows 38400 of the 921600 pixels"],
        count: 1,
    },
    Mistake {
        wall: "dome-5",
        changes: &[(
            "canvas_px = [0, 0, 1920, 1000]\noutput_px = [0, 40]\nblend_px = { left = 192, right = 192 }",
            "canvas_px = [0, 0, 1920, 1000]\noutput_px = [0, 40]\nblend_px = { left = 192 }",
        )],
        words: &[
            "\"front\" and \"right\" overlap at the right edge of \"front\"",
            "no ramp",
        ],
        count: 4,
    },
    Mistake {
        wall: "dome-5",
        changes: &[
            ("[1200, 1200]", "[1200, 1000]"),
            ("0, 0, 1200, 1200]", "0, 0, 1200, 1000]"),
        ],
        words: &["fisheye canvas of screen \"top\"", "1200×1000"],
        count: 1,
    },
    Mistake {
        wall: "single",
        changes: &[(
            "[[hosts]]",
            "[[screens]]\nname = \"spare\"\nkind = \"planar\"\nobserver = \"viewer\"\nsize_px = [64, 36]\n\
             corners_m = { bottom_left = [0.7, -0.18, 0.0], bottom_right = [1.34, -0.18, 0.0], top_left = [0.7, 0.18, 0.0] }\n[[hosts]]",
        )],
        words: &["no output shows screen \"spare\""],
        // It is coarse as well.
        count: 2,
    },
    // Windows.
    Mistake {
        wall: "cave-4",
        changes: &[("monitor = 1", "monitor = 0")],
        words: &["\"left-eye\" and \"right-eye\" of host \"floor\" overlap on monitor 0"],
        count: 4,
    },
    Mistake {
        wall: "powerwall-3x2-bezels",
        changes: &[("position_px = [0, 1080]", "position_px = [0, 1000]")],
        words: &["\"top\" and \"bottom\" of host \"middle\" overlap on its desktop"],
        count: 4,
    },
];

#[test]
fn every_mistake_is_named() {
    let mut wrong = Vec::new();
    for Mistake {
        wall,
        changes,
        words,
        count,
    } in MISTAKES
    {
        let mut text = shipped(wall);
        for (from, to) in *changes {
            assert!(text.contains(from), "{wall} has no {from}");
            text = text.replace(from, to);
        }
        let said = warnings(&text);
        let named = said
            .iter()
            .filter(|sentence| words.iter().all(|word| sentence.contains(word)));
        if named.count() != 1 || said.len() != *count {
            wrong.push(format!(
                "{wall} {changes:?}: {words:?} once, in {count}: {said:#?}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn calibrated_neighbours_of_other_densities_are_named() {
    let archive = walls().join("pair.mpcdi");
    let pair = shipped("pair-mpcdi").replace("\"pair.mpcdi\"", &format!("{archive:?}"));
    assert_eq!(warnings(&pair), Vec::<String>::new());
    let channel = "size_px = [1280, 800]\ncalibration";
    let coarse = pair.replacen(channel, "size_px = [400, 250]\ncalibration", 1);
    let said = warnings(&coarse);
    assert_eq!(said.len(), 1, "{said:#?}");
    for words in [
        "output \"projection/left\" has 3.",
        "times fewer pixels to a radian than output \"projection/right\"",
    ] {
        assert!(said[0].contains(words), "{said:#?}");
    }
    // The right projector without a calibration shows pixels of the canvas.
    let plain = format!(
        "{}[[hosts.outputs.channels]]\nscreen = \"front\"\ncanvas_px = [900, 0, 1148, 768]\n",
        &coarse[..coarse.rfind("[[hosts.outputs.channels]]").unwrap()]
    );
    let said = warnings(&plain);
    let named = said.iter().filter(|sentence| {
        sentence.contains("output \"projection/left\" has")
            && sentence.contains("fewer pixels to a radian than screen \"front\"")
    });
    assert_eq!(named.count(), 1, "{said:#?}");
}

#[test]
fn what_is_right_is_not_named() {
    for (wall, changes) in [
        // Ramps as wide as the overlap, or nearly, in both directions.
        (
            "demo-2x2",
            vec![
                ("size_px = [1280, 720]", "size_px = [1200, 700]"),
                (
                    "[2.0, 0.5, 0.0], top_left = [-2.0, 2.75, 0.0]",
                    "[1.75, 0.5, 0.0], top_left = [-2.0, 2.6875, 0.0]",
                ),
                (
                    LEFT_TOP,
                    "blend_px = { right = 80, bottom = 20 }, canvas_px = [0, 0, 640, 360]",
                ),
                (
                    RIGHT_TOP,
                    "blend_px = { left = 78, bottom = 20 }, canvas_px = [560, 0, 640, 360]",
                ),
                (
                    "canvas_px = [0, 360, 640, 360]",
                    "blend_px = { right = 80, top = 20 }, canvas_px = [0, 340, 640, 360]",
                ),
                (
                    "canvas_px = [640, 360, 640, 360]",
                    "blend_px = { left = 80, top = 20 }, canvas_px = [560, 340, 640, 360]",
                ),
            ],
        ),
        // Both eyes in one output.
        (
            "single",
            vec![(
                "name = \"window\"",
                "name = \"window\"\nstereo = \"side-by-side\"",
            )],
        ),
        // A guest beside the viewer, before the same screen's front.
        (
            "single",
            vec![(
                "[[hosts]]",
                "[[observers]]\nname = \"guest\"\nhead_m = [0.3, 0.0, 0.6]\n[[screens]]\nname = \"other\"\nkind = \"planar\"\nobserver = \"guest\"\n\
                 size_px = [1280, 720]\ncorners_m = { bottom_left = [0.32, -0.18, 0.0], bottom_right = [0.96, -0.18, 0.0], top_left = [0.32, 0.18, 0.0] }\n\
                 [[hosts]]\nname = \"other\"\n[[hosts.outputs]]\nname = \"window\"\nsize_px = [1280, 720]\nheadless = true\n\
                 channels = [{ screen = \"other\", canvas_px = [0, 0, 1280, 720] }]\n[[hosts]]",
            )],
        ),
        // The walls of a cave 3 mm apart.
        (
            "cave-4",
            vec![(
                RIGHT_OF_CAVE,
                "{ bottom_left = [1.503, 0.0, -1.5], bottom_right = [1.503, 0.0, 1.5], top_left = [1.503, 2.4, -1.5] }",
            )],
        ),
    ] {
        let mut text = shipped(wall);
        for (from, to) in &changes {
            assert!(text.contains(from), "{wall} has no {from}");
            text = text.replace(from, to);
        }
        let said = warnings(&text);
        assert!(said.is_empty(), "{wall} {changes:?}: {said:#?}");
    }
}

#[test]
fn a_surface_of_points_is_measured_and_its_wrong_side_is_named() {
    // A square metre, 1 m ahead; then with left and right exchanged.
    let surface = |left: f64, right: f64| {
        format!(
            "v {left} -0.5 -1\nv {right} -0.5 -1\nv {right} 0.5 -1\nv {left} 0.5 -1\n\
             vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("screen.obj");
    let corners = "kind = \"planar\"\nobserver = \"viewer\"\ncorners_m = { bottom_left = [-0.32, -0.18, 0.0], bottom_right = [0.32, -0.18, 0.0], top_left = [-0.32, 0.18, 0.0] }\nsize_px = [1280, 720]";
    let text = shipped("single");
    assert!(text.contains(corners));
    let text = text.replace(
        corners,
        &format!(
            "kind = \"surface\"\nobserver = \"viewer\"\nfile = '{}'\nsize_px = [1280, 1280]",
            file.display()
        ),
    );
    let text = text.replace("[0, 0, 1280, 720]", "[0, 0, 1280, 1280]");
    let text = text.replace("size_px = [1280, 720]", "size_px = [1280, 1280]");
    let text = text.replace("head_m = [0.0, 0.0, 0.6]", "head_m = [0.0, 0.0, 0.5]");
    std::fs::write(&file, surface(-0.5, 0.5)).unwrap();
    let found = findings(&text);
    let screen = &found["screens"][0];
    assert_eq!(screen["kind"], "surface");
    assert!(
        (screen["size_m"][0].as_f64().unwrap() - 1.0).abs() < 0.01,
        "{screen}"
    );
    assert!((screen["distance_m"].as_f64().unwrap() - 1.5).abs() < 1e-3);
    assert!(found["pixels_per_radian"].as_f64().unwrap() > 1900.0);
    assert_eq!(found["warnings"].as_array().unwrap().len(), 0, "{found}");
    std::fs::write(&file, surface(0.5, -0.5)).unwrap();
    let said = warnings(&text);
    let named = |said: &String| said.contains("sees only 0 % of screen \"monitor\" from the front");
    assert!(said.iter().any(named), "{said:#?}");
}
