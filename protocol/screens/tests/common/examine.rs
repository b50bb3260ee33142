//! Covers held against brute force: all pixels of an output, with slopes taken anew.
//! In: maps, covers, eyes. Out: failed tests, or how many views and pixels it took.

use glam::DVec3;
use screens::{Cover, CoverLimits, Part, SampledMap};

use super::Random;

/// Step of slopes in pixels.
const STEP_PX: f64 = 1e-3;

pub type Map<'a> = &'a dyn Fn(f64, f64) -> Option<DVec3>;

/// A pixel of an output.
pub struct Pixel {
    pub x: u32,
    pub y: u32,
    /// In its middle, a little to the right of it, and a little below.
    pub points_m: [DVec3; 3],
    /// How much longer than wide it is on the surface.
    pub stretch: f64,
}

/// Smallest and largest singular value of two columns, by the angle that makes them orthogonal (one-sided Jacobi).
pub fn singular(x: DVec3, y: DVec3) -> [f64; 2] {
    let angle = 0.5 * (2.0 * x.dot(y)).atan2(x.length_squared() - y.length_squared());
    let (sine, cosine) = angle.sin_cos();
    let (first, second) = (
        (x * cosine + y * sine).length(),
        (y * cosine - x * sine).length(),
    );
    [first.min(second), first.max(second)]
}

/// Every so many pixels in both directions.
pub fn pixels(map: Map<'_>, size_px: [u32; 2], every: usize) -> Vec<Pixel> {
    let mut pixels = Vec::new();
    for y in (0..size_px[1]).step_by(every) {
        for x in (0..size_px[0]).step_by(every) {
            let (middle_x, middle_y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let places = [(0.0, 0.0), (STEP_PX, 0.0), (0.0, STEP_PX)];
            let [Some(here), Some(right), Some(below)] =
                places.map(|(dx, dy)| map(middle_x + dx, middle_y + dy))
            else {
                continue;
            };
            let [narrow, long] = singular(right - here, below - here);
            pixels.push(Pixel {
                x,
                y,
                points_m: [here, right, below],
                stretch: long / narrow,
            });
        }
    }
    pixels
}

/// What was found in one cover.
pub struct Found {
    pub view_px: f64,
    pub parts: usize,
}

/// Holds a cover against all pixels.
pub fn examine(
    name: &str,
    cover: &Cover,
    pixels: &[Pixel],
    size_px: [u32; 2],
    eye_m: DVec3,
    limits: &CoverLimits,
) -> Found {
    // Whose pixel is whose, and no two parts overlap.
    let mut owners = vec![None; (size_px[0] * size_px[1]) as usize];
    for (index, part) in cover.parts.iter().enumerate() {
        let [x, y, width, height] = part.rect_px;
        assert!(part.whole, "{name}");
        let view = &part.view;
        assert!(
            view.size_px
                .iter()
                .all(|side| side % 16 == 0 && *side <= limits.most_px)
        );
        assert!(
            (view.right.length() - 1.0).abs() < 1e-12 && (view.up.length() - 1.0).abs() < 1e-12
        );
        assert!(view.right.dot(view.up).abs() < 1e-12 && (view.distance_m() - 1.0).abs() < 1e-12);
        let [across, along] =
            [0, 1].map(|axis: usize| f64::from(view.size_px[axis]) / view.size_m[axis]);
        assert!((across / along - 1.0).abs() < 1e-12, "pixels are square");
        for row in y..y + height {
            for column in x..x + width {
                let owner = &mut owners[(row * size_px[0] + column) as usize];
                assert!(owner.replace(index).is_none(), "{name}: parts overlap");
            }
        }
    }
    let mut least = vec![f64::INFINITY; cover.parts.len()];
    for pixel in pixels {
        let owner = owners[(pixel.y * size_px[0] + pixel.x) as usize].unwrap();
        let Part { view, .. } = &cover.parts[owner];
        let [true_direction, right, below] = pixel.points_m.map(|point| point - eye_m);
        let seen = view.project(true_direction);
        for axis in 0..2 {
            let end = f64::from(view.size_px[axis]) - 2.0;
            assert!(
                (2.0..=end).contains(&seen[axis]),
                "{name} {} {}: {seen:?} of {:?}",
                pixel.x,
                pixel.y,
                view.size_px
            );
        }
        // The direction that the view's pixel has is the true one.
        let back = view.direction(seen);
        let pixel_angle = singular(right - true_direction, below - true_direction)[0]
            / STEP_PX
            / true_direction.length();
        let off = back.normalize().cross(true_direction.normalize()).length();
        assert!(off < 1e-6 * pixel_angle.max(1e-7), "{name}: off by {off}");
        assert!(
            back.normalize().dot(view.forward()) > (limits.half_angle_deg + 0.5).to_radians().cos(),
            "{name}: cone"
        );
        let [right, below] = [right, below].map(|direction| {
            let [x, y] = view.project(direction);
            DVec3::new(x - seen[0], y - seen[1], 0.0) / STEP_PX
        });
        let relief = (pixel.stretch / 3.0).max(1.0);
        least[owner] = least[owner].min(singular(right, below)[0] * relief);
    }
    // The middles of a few pixels say little about their edges, which samples reach.
    let fine = size_px.iter().all(|side| *side >= 100);
    for (part, least) in cover.parts.iter().zip(&least) {
        if part.view.is_undersampled() {
            continue;
        }
        assert!(
            *least >= 0.99,
            "{name}: {least} view pixels to an output pixel"
        );
        if fine && least.is_finite() {
            assert!(*least <= 1.06, "{name}: views are too large by {least}");
        }
    }
    // What is told is what is; but where a surface turns its back, one place between samples sees a pixel flat.
    for (part, least) in cover
        .parts
        .iter()
        .zip(&least)
        .filter(|(_, least)| fine && (0.3..1e9).contains(*least))
    {
        assert!(
            (part.view.sampling / least - 1.0).abs() < 0.06,
            "{name}: {} told, {least} found",
            part.view.sampling
        );
    }
    let view_px = cover
        .parts
        .iter()
        .map(|part| part.view.size_px.map(f64::from).iter().product::<f64>())
        .sum();
    Found {
        view_px,
        parts: cover.parts.len(),
    }
}

pub fn examine_heads(
    name: &str,
    map: Map<'_>,
    size_px: [u32; 2],
    room_m: DVec3,
    radius_m: f64,
    heads: usize,
) -> (usize, f64) {
    let limits = CoverLimits::default();
    let sampled = SampledMap::new(map, size_px).unwrap();
    // All pixels, or of a large channel one in nine.
    let every = if size_px[0] * size_px[1] > 1_000_000 {
        3
    } else {
        1
    };
    let pixels = pixels(map, size_px, every);
    let mut random = Random(23);
    let (mut most_parts, mut most_px) = (0, 0.0_f64);
    for _ in 0..heads {
        let eye_m = room_m + random.within(radius_m);
        let cover = sampled.cover(eye_m, &limits);
        assert_eq!(cover, sampled.cover(eye_m, &limits));
        assert!(
            cover.parts.iter().all(|part| !part.view.is_undersampled()),
            "{name} {eye_m}"
        );
        let found = examine(name, &cover, &pixels, size_px, eye_m, &limits);
        most_parts = most_parts.max(found.parts);
        most_px = most_px.max(found.view_px / (pixels.len() * every * every) as f64);
    }
    (most_parts, most_px)
}
