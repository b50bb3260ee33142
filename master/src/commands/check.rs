//! `terrawall check WALL`: is a wall right, and is it odd?
//!
//! In: a wall file. Out: what it describes, what is legal but odd, and a plan of the room. A wall that is wrong
//! fails with the place in the file. It must not start anything.

use protocol::Wall;
use protocol::wall::{Output, Rect};
use serde::Serialize;

use crate::args::Check;
use crate::failure::Failure;
use crate::{output, plan};

use super::files;

/// What was found.
#[derive(Debug, Serialize)]
struct Findings {
    name: String,
    fps: f64,
    hosts: usize,
    outputs: usize,
    pixels: u64,
    pixels_per_radian: f64,
    screens: Vec<ScreenFindings>,
    warnings: Vec<String>,
}

/// One screen, as its observer sees it.
#[derive(Debug, Serialize)]
struct ScreenFindings {
    name: String,
    size_px: [u32; 2],
    size_m: [f64; 2],
    distance_m: f64,
    field_of_view_deg: [f64; 2],
}

/// Validates a wall.
pub(crate) fn run(args: &Check) -> Result<(), Failure> {
    let wall = files::wall(&args.wall)?;
    let findings = findings(&wall);
    if let Some(path) = &args.plan {
        output::file(path, plan::room_plan(&wall).as_bytes())?;
    }
    if args.json {
        return output::json(&findings);
    }
    output::line(format!(
        "{}: {} screens, {} hosts, {} outputs, {:.1} megapixels at {} frames per second",
        findings.name,
        findings.screens.len(),
        findings.hosts,
        findings.outputs,
        findings.pixels as f64 / 1e6,
        findings.fps
    ))?;
    for screen in &findings.screens {
        output::line(format!(
            "  screen {}: {}×{} pixels, {:.2}×{:.2} m, {:.2} m away, {:.0}°×{:.0}° of view",
            screen.name,
            screen.size_px[0],
            screen.size_px[1],
            screen.size_m[0],
            screen.size_m[1],
            screen.distance_m,
            screen.field_of_view_deg[0],
            screen.field_of_view_deg[1]
        ))?;
    }
    for warning in &findings.warnings {
        output::line(format!("  odd: {warning}"))?;
    }
    if findings.warnings.is_empty() {
        output::line("  nothing odd")?;
    }
    Ok(())
}

fn findings(wall: &Wall) -> Findings {
    let outputs = || wall.hosts.iter().flat_map(|host| &host.outputs);
    let screens = wall.screens.iter().filter_map(|screen| {
        let observer = wall.observers.get(screen.observer)?;
        let seen = screen.eye_to_screen(observer.head_m)?;
        let [width, height] = screen.size_px.map(f64::from);
        let at = |x, y| seen.to_canvas_m(screen.size_px, x, y);
        Some(ScreenFindings {
            name: screen.name.clone(),
            size_px: screen.size_px,
            size_m: [seen.width_m, seen.height_m],
            distance_m: seen.distance_m,
            field_of_view_deg: [
                angle_deg(at(0.0, height / 2.0), at(width, height / 2.0)),
                angle_deg(at(width / 2.0, 0.0), at(width / 2.0, height)),
            ],
        })
    });
    Findings {
        name: wall.name.clone(),
        fps: wall.fps,
        hosts: wall.hosts.len(),
        outputs: outputs().count(),
        pixels: outputs()
            .map(|output| u64::from(output.size_px[0]) * u64::from(output.size_px[1]))
            .sum(),
        pixels_per_radian: wall.pixels_per_radian(),
        screens: screens.collect(),
        warnings: warnings(wall),
    }
}

fn angle_deg(a: [f64; 3], b: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt())
        .clamp(-1.0, 1.0)
        .acos()
        .to_degrees()
}

/// What is legal but odd, one sentence each.
fn warnings(wall: &Wall) -> Vec<String> {
    let mut warnings = Vec::new();
    for (index, observer) in wall.observers.iter().enumerate() {
        let height_m = observer.head_m[1];
        if !(0.4..=3.0).contains(&height_m) {
            warnings.push(format!(
                "the head of observer \"{}\" is {height_m} m above the floor; y is up, in metres",
                observer.name
            ));
        }
        if !wall.screens.iter().any(|screen| screen.observer == index) {
            warnings.push(format!("observer \"{}\" looks at no screen", observer.name));
        }
    }
    let pieces = wall.canvas_layout();
    let mut densities = Vec::new();
    for (index, screen) in wall.screens.iter().enumerate() {
        let head_m = wall
            .observers
            .get(screen.observer)
            .map_or([0.0; 3], |observer| observer.head_m);
        if let Some(seen) = screen.eye_to_screen(head_m)
            && let Some(density) = screen.pixels_per_radian(head_m)
        {
            densities.push((density.sparsest, screen.name.as_str()));
            if seen.distance_m < 0.3 {
                warnings.push(format!(
                    "screen \"{}\" is only {:.2} m from the head of its observer; are the corners in metres?",
                    screen.name, seen.distance_m
                ));
            }
            if seen.width_m.max(seen.height_m) > 50.0 || seen.width_m.min(seen.height_m) < 0.1 {
                warnings.push(format!(
                    "screen \"{}\" measures {:.3}×{:.3} m; are the corners in metres?",
                    screen.name, seen.width_m, seen.height_m
                ));
            }
        }
        let shown: Vec<Rect> = pieces
            .iter()
            .filter(|piece| piece.screen == index)
            .map(|piece| piece.canvas_px)
            .collect();
        let all = u64::from(screen.size_px[0]) * u64::from(screen.size_px[1]);
        let covered = covered_pixels(&shown);
        let summed: u64 = shown
            .iter()
            .map(|rect| u64::from(rect.width) * u64::from(rect.height))
            .sum();
        if covered == 0 {
            warnings.push(format!("no output shows screen \"{}\"", screen.name));
        } else if covered < all {
            warnings.push(format!(
                "no output shows {} of the {all} pixels of screen \"{}\": right behind bezels, odd elsewhere",
                all - covered,
                screen.name
            ));
        }
        if summed > covered {
            warnings.push(format!(
                "several outputs show the same {} pixels of screen \"{}\": a seam is visible where they overlap, \
                 because nothing blends them",
                summed - covered,
                screen.name
            ));
        }
    }
    densities.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let (Some(sparse), Some(dense)) = (densities.first(), densities.last())
        && dense.0 > 4.0 * sparse.0
    {
        warnings.push(format!(
            "screen \"{}\" has {:.1} times as many pixels to a radian as screen \"{}\"; detail follows the densest",
            dense.1,
            dense.0 / sparse.0,
            sparse.1
        ));
    }
    for host in &wall.hosts {
        for (index, first) in host.outputs.iter().enumerate() {
            for second in host
                .outputs
                .iter()
                .skip(index + 1)
                .filter(|second| windows_overlap(first, second))
            {
                warnings.push(format!(
                    "the windows of outputs \"{}\" and \"{}\" of host \"{}\" overlap on its desktop",
                    first.name, second.name, host.name
                ));
            }
        }
    }
    warnings
}

/// Pixels in the union of rectangles.
fn covered_pixels(rects: &[Rect]) -> u64 {
    let mut rows: Vec<u32> = rects
        .iter()
        .flat_map(|rect| [rect.y, rect.bottom()])
        .collect();
    rows.sort_unstable();
    rows.dedup();
    let mut covered = 0;
    for (&top, &bottom) in rows.iter().zip(rows.iter().skip(1)) {
        let mut spans: Vec<(u32, u32)> = rects
            .iter()
            .filter(|rect| rect.y <= top && rect.bottom() >= bottom)
            .map(|rect| (rect.x, rect.right()))
            .collect();
        spans.sort_unstable();
        let mut reached = 0;
        for (left, right) in spans {
            let left = left.max(reached);
            if right > left {
                covered += u64::from(right - left) * u64::from(bottom - top);
                reached = right;
            }
        }
    }
    covered
}

fn windows_overlap(first: &Output, second: &Output) -> bool {
    let (Some(first_window), Some(second_window)) = (&first.window, &second.window) else {
        return false;
    };
    let apart = |axis: usize| {
        let end =
            |output: &Output, position: i32| i64::from(position) + i64::from(output.size_px[axis]);
        let (a, b) = (
            first_window.position_px[axis],
            second_window.position_px[axis],
        );
        end(first, a) <= i64::from(b) || end(second, b) <= i64::from(a)
    };
    !apart(0) && !apart(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x: u32, y: u32, width: u32, height: u32) -> Rect {
        Rect {
            x,
            y,
            width,
            height,
        }
    }

    #[test]
    fn overlaps_count_once() {
        assert_eq!(covered_pixels(&[]), 0);
        assert_eq!(covered_pixels(&[rect(0, 0, 4, 4), rect(4, 0, 4, 4)]), 32);
        assert_eq!(covered_pixels(&[rect(0, 0, 4, 4), rect(2, 2, 4, 4)]), 28);
        assert_eq!(
            covered_pixels(&[rect(0, 0, 9, 9), rect(2, 2, 3, 3), rect(0, 4, 9, 1)]),
            81
        );
    }
}
