//! What is odd about single screens, and about the whole of them: sizes, coverage, densities that are far apart.
//!
//! In: a wall and its surfaces. Out: sentences. It compares no neighbours.

use glam::DVec3;
use protocol::Wall;
use protocol::wall::{Rect, ScreenShape, SphereCanvas};

use crate::plan::face::Face;

use super::calibrated::{Measured, hides_canvas};

/// How near a head is to a screen at least, and what a screen measures, in metres.
const NEAREST_M: f64 = 0.3;
const LARGEST_M: f64 = 50.0;
const SMALLEST_M: f64 = 0.1;
/// How much densities of a wall may differ at all.
const RATIO: f64 = 4.0;

pub(super) fn warn(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    channels: &[Measured<'_>],
    warnings: &mut Vec<String>,
) {
    let of_channels = channels.iter().filter_map(|channel| {
        let name = format!("output \"{}\"", channel.name);
        Some((channel.density?.sparsest, name))
    });
    let mut densities: Vec<(f64, String)> = of_channels.collect();
    for (index, (screen, face)) in wall.screens.iter().zip(faces).enumerate() {
        let (Some(face), Some(observer)) = (face, wall.observers.get(screen.observer)) else {
            continue;
        };
        let head_m = DVec3::from(observer.head_m);
        if !hides_canvas(wall, index)
            && let Some(density) = screens::pixel_density(face.shape, screen.size_px, head_m)
        {
            densities.push((density.sparsest, format!("screen \"{}\"", screen.name)));
        }
        if let Some(near) = face.nearest(head_m, NEAREST_M) {
            warnings.push(format!(
                "screen \"{}\" is only {:.2} m from the head of observer \"{}\"; write its place and head_m in metres",
                screen.name,
                near.point_m.distance(head_m),
                observer.name
            ));
        }
        let [low, high] = face.bounds_m();
        let diagonal_m = (high - low).length();
        if !(SMALLEST_M..=LARGEST_M).contains(&diagonal_m) {
            warnings.push(format!(
                "screen \"{}\" measures {diagonal_m:.3} m across; write its place in metres",
                screen.name
            ));
        }
        let [width, height] = screen.size_px;
        if let ScreenShape::Sphere {
            canvas: SphereCanvas::Fisheye { .. },
            ..
        } = screen.shape
            && width != height
        {
            warnings.push(format!(
                "the fisheye canvas of screen \"{}\" is {width}×{height} pixels, which are not square on the dome; write size_px = [{height}, {height}]",
                screen.name
            ));
        }
        coverage(wall, index, warnings);
    }
    densities.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let (Some(sparse), Some(dense)) = (densities.first(), densities.last())
        && dense.0 > RATIO * sparse.0
    {
        warnings.push(format!(
            "{} has {:.1} times as many pixels to a radian as {}, and detail follows the densest; check size_px and where they stand",
            dense.1,
            dense.0 / sparse.0,
            sparse.1
        ));
    }
}

/// Pixels of a canvas that no output shows.
fn coverage(wall: &Wall, index: usize, warnings: &mut Vec<String>) {
    let Some(screen) = wall.screens.get(index) else {
        return;
    };
    let outputs = wall.hosts.iter().flat_map(|host| &host.outputs);
    // What a calibration puts elsewhere is somewhere in its part of the canvas.
    let shown: Vec<Rect> = outputs
        .flat_map(|output| &output.channels)
        .filter(|channel| channel.screen == index)
        .map(|channel| channel.canvas_px)
        .collect();
    let all = u64::from(screen.size_px[0]) * u64::from(screen.size_px[1]);
    let covered = covered_pixels(&shown);
    if covered == 0 {
        warnings.push(format!(
            "no output shows screen \"{}\"; give it a channel, or remove it",
            screen.name
        ));
    } else if covered < all {
        warnings.push(format!(
            "no output shows {} of the {all} pixels of screen \"{}\": right behind bezels, odd elsewhere; check canvas_px",
            all - covered,
            screen.name
        ));
    }
}

/// Pixels in the union of rectangles.
pub(super) fn covered_pixels(rects: &[Rect]) -> u64 {
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
