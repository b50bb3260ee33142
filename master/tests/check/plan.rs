//! The plans of the shipped walls: whole, finite, and with everything that is in the room.

use roxmltree::{Document, Node};

use super::{all, check, walls};

/// The plan of a shipped wall.
fn plan(wall: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plan.svg");
    check(
        &walls().join(format!("{wall}.toml")),
        &["--plan", file.to_str().unwrap()],
    );
    std::fs::read_to_string(file).unwrap()
}

fn of_class<'a, 'i>(document: &'a Document<'i>, class: &str) -> Vec<Node<'a, 'i>> {
    let nodes = document.descendants();
    nodes
        .filter(|node| node.attribute("class") == Some(class))
        .collect()
}

/// The points of a path of moves and lines.
fn points(path: &str) -> Vec<[f64; 2]> {
    let pairs = path.split(['M', 'L', 'z']).filter(|pair| !pair.is_empty());
    let points = pairs.map(|pair| {
        let (x, y) = pair.split_once(' ').unwrap();
        [x, y].map(|number| number.parse::<f64>().unwrap())
    });
    points.collect()
}

#[test]
fn plans_hold_every_screen_head_and_eye_in_three_views() {
    for (wall, screens, observers, trackers) in [
        ("vrlab-siegen", 6, 1, 1),
        ("dome-5", 5, 1, 0),
        ("cave-4", 4, 1, 1),
        ("powerwall-4x3-bezels", 1, 1, 0),
        ("powerwall-3x2-bezels", 1, 1, 0),
        ("demo-2x2", 1, 1, 0),
        ("single", 1, 1, 0),
        ("pair-mpcdi", 1, 1, 0),
    ] {
        let svg = plan(wall);
        let document = Document::parse(&svg).unwrap();
        for view in ["view-above", "view-front", "view-right"] {
            let named = |node: &Node<'_, '_>| node.attribute("id") == Some(view);
            assert_eq!(
                document.descendants().filter(named).count(),
                1,
                "{wall}: {view}"
            );
        }
        for (class, count) in [
            ("screen", screens),
            ("outline", screens),
            ("head", observers),
            ("eye", 2 * observers),
            ("tracker", trackers),
            ("frusta", 1),
        ] {
            let found = of_class(&document, class).len();
            assert_eq!(found, 3 * count, "{wall}: {class}");
        }
        assert_eq!(of_class(&document, "bar").len(), 1);
        assert_eq!(of_class(&document, "colours").len(), 1);
        let mut ids: Vec<&str> = document
            .descendants()
            .filter_map(|node| node.attribute("id"))
            .collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count, "{wall}: ids are there twice");
    }
}

#[test]
fn curves_are_curves_and_nothing_leaves_the_page() {
    for wall in all() {
        let svg = plan(&wall);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{wall}");
        let document = Document::parse(&svg).unwrap();
        let page = ["width", "height"].map(|side| {
            let side = document.root_element().attribute(side).unwrap();
            side.parse::<f64>().unwrap()
        });
        for class in ["outline", "part", "ramp"] {
            for node in of_class(&document, class) {
                for point in points(node.attribute("d").unwrap()) {
                    let within = (0..2).all(|axis| (0.0..=page[axis]).contains(&point[axis]));
                    assert!(within, "{wall}: {point:?} is off the page {page:?}");
                }
            }
        }
        for node in of_class(&document, "outline") {
            let count = points(node.attribute("d").unwrap()).len();
            let screen = node.parent().unwrap().attribute("id").unwrap();
            let is_curved = wall.starts_with("dome")
                || wall.starts_with("vrlab") && !screen.ends_with(['4', '5']);
            if is_curved {
                assert!(count >= 48, "{wall} {screen}: {count} points");
            } else {
                assert_eq!(count, 4, "{wall} {screen}");
            }
        }
    }
}

/// The parts of projectors that an archive puts in place are where it says, and in the colours of their own densities.
#[test]
fn calibrated_channels_are_drawn_where_they_fall() {
    let svg = plan("pair-mpcdi");
    let document = Document::parse(&svg).unwrap();
    let extent = |node: &Node<'_, '_>| {
        let points = points(node.attribute("d").unwrap());
        let across = points.iter().map(|point| point[0]);
        (
            across.clone().fold(f64::MAX, f64::min),
            across.fold(f64::MIN, f64::max),
        )
    };
    let screen = of_class(&document, "outline")[1];
    let (left, right) = extent(&screen);
    let in_front = of_class(&document, "part");
    let shares: Vec<(f64, f64)> = in_front[2..4]
        .iter()
        .map(|part| {
            let (from, to) = extent(part);
            let share = |x: f64| (x - left) / (right - left);
            (share(from), share(to))
        })
        .collect();
    // The overlap is a sixth of the canvas: 5/12 to 7/12.
    let near = |a: f64, b: f64| (a - b).abs() < 0.02;
    assert!(
        near(shares[0].0, 0.0) && near(shares[0].1, 7.0 / 12.0),
        "{shares:?}"
    );
    assert!(
        near(shares[1].0, 5.0 / 12.0) && near(shares[1].1, 1.0),
        "{shares:?}"
    );
    for name in ["projection/left<", "projection: right<"] {
        assert!(svg.contains(name), "{name}");
    }
}

#[test]
fn views_are_to_one_scale_and_the_bar_is_a_metre() {
    let svg = plan("powerwall-4x3-bezels");
    let document = Document::parse(&svg).unwrap();
    let bar = of_class(&document, "bar")[0].attribute("d").unwrap();
    let metre: f64 = bar
        .split(['h', 'M'])
        .nth(3)
        .and_then(|length| length.parse().ok())
        .unwrap();
    // The wall is 4.2636 m wide and 1.8084 m high; from above and from the right it is a line.
    for (id, width_m, height_m) in [
        ("above-screen-0", 4.2636, 0.0),
        ("front-screen-0", 4.2636, 1.8084),
        ("right-screen-0", 0.0, 1.8084),
    ] {
        let outlines = of_class(&document, "outline");
        let outline = outlines
            .iter()
            .find(|node| node.parent().unwrap().attribute("id") == Some(id))
            .unwrap();
        let points = points(outline.attribute("d").unwrap());
        for (axis, metres) in [width_m, height_m].into_iter().enumerate() {
            let values = || points.iter().map(|point| point[axis]);
            let extent = values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min);
            assert!(
                (extent / metre - metres).abs() < 0.002,
                "{id}: {}",
                extent / metre
            );
        }
    }
    // One name for each of the outputs.
    for host in 1..=4 {
        for panel in 1..=3 {
            assert!(svg.contains(&format!("column-{host}: panel-{panel}<")));
        }
    }
    // The parts: twelve in each view.
    assert_eq!(of_class(&document, "part").len(), 36);
}
