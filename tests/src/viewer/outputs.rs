//! Captured outputs as light: each eye's picture out of them, and where its pixels shine.
//!
//! In: PNG files, what the wall says of the display. Out: linear light at places of canvases. It casts no rays.

use std::path::Path;

use glam::DVec3;
use image::RgbImage;
use protocol::Wall;
use protocol::wall::{Eye, Output, Rect, Stereo};
use screens::Shape;

use super::calibrated::Mesh;
use crate::{flip, pictures};

/// Where the pixels of a channel fall.
#[derive(Debug)]
enum Place {
    /// On a part of the canvas.
    Canvas(Rect),
    /// Where a calibration says.
    Mesh(Mesh),
}

/// A point of a screen that an eye looks at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// The eye in room metres.
    pub(super) eye_m: DVec3,
    /// Unit vector from there.
    pub(super) direction: DVec3,
    /// How far away the point is.
    pub(super) distance_m: f64,
    /// Where on the canvas it is, in pixels.
    pub(super) place_px: [f64; 2],
}

/// What one channel lights for an eye.
#[derive(Debug)]
pub(super) struct Lit {
    /// Index of the screen.
    pub(super) screen: usize,
    /// Who sees it.
    pub(super) eye: Eye,
    /// Which components are this eye's.
    pub(super) components: [bool; 3],
    /// Width and height of the channel in pixels.
    size_px: [u32; 2],
    place: Place,
    /// Light of its pixels, row by row.
    light: Vec<DVec3>,
}

/// Everything that the outputs of a wall light, whose screens have these shapes.
pub(super) fn lit(wall: &Wall, shapes: &[Shape], folder: &Path) -> Vec<Lit> {
    let mut all = Vec::new();
    for host in &wall.hosts {
        for output in &host.outputs {
            let file = folder.join(format!("{}-{}.png", host.name, output.name));
            let picture = pictures::load(&file);
            assert_eq!(
                picture.dimensions(),
                output.size_px.into(),
                "{}",
                file.display()
            );
            for channel in &output.channels {
                let eyes = match output.stereo {
                    Stereo::Off => vec![channel.eye],
                    _ => vec![Eye::Left, Eye::Right],
                };
                for eye in eyes {
                    let whole = whole(&picture, output, eye);
                    let rect = channel.output_rect();
                    let pixels = (rect.y..rect.bottom())
                        .flat_map(|y| (rect.x..rect.right()).map(move |x| (x, y)));
                    all.push(Lit {
                        screen: channel.screen,
                        eye,
                        components: components(output, eye),
                        size_px: channel.size_px,
                        place: match &channel.calibration {
                            None => Place::Canvas(channel.canvas_px),
                            Some(named) => {
                                Place::Mesh(Mesh::of(wall, channel, named, &shapes[channel.screen]))
                            }
                        },
                        light: pixels
                            .map(|(x, y)| whole[(y * output.size_px[0] + x) as usize])
                            .collect(),
                    });
                }
            }
        }
    }
    all
}

impl Lit {
    /// The light at a point of the screen, bilinear between the middles of pixels. `None` where the channel does not shine.
    pub(super) fn light(&self, seen: &Seen) -> Option<DVec3> {
        let [width, height] = self.size_px;
        let [x, y] = match &self.place {
            Place::Canvas(rect) => [
                seen.place_px[0] - f64::from(rect.x),
                seen.place_px[1] - f64::from(rect.y),
            ],
            Place::Mesh(mesh) => mesh.place_px(seen.eye_m, seen.direction, seen.distance_m)?,
        };
        let inside = |place: f64, size: u32| (0.0..=f64::from(size)).contains(&place);
        if !(inside(x, width) && inside(y, height)) {
            return None;
        }
        let split = |place: f64, size: u32| {
            let from_first = (place - 0.5).clamp(0.0, f64::from(size - 1));
            let first = (from_first as u32).min(size.saturating_sub(2));
            (
                first,
                (first + 1).min(size - 1),
                from_first - f64::from(first),
            )
        };
        let ((left, right, across), (upper, lower, down)) = (split(x, width), split(y, height));
        let at = |x: u32, y: u32| self.light[(y * width + x) as usize];
        Some(
            at(left, upper)
                .lerp(at(right, upper), across)
                .lerp(at(left, lower).lerp(at(right, lower), across), down),
        )
    }
}

/// Which components of an output are an eye's.
fn components(output: &Output, eye: Eye) -> [bool; 3] {
    let left = match output.stereo {
        Stereo::RedCyan => [true, false, false],
        Stereo::GreenMagenta => [false, true, false],
        Stereo::AmberBlue => [true, true, false],
        _ => return [true; 3],
    };
    left.map(|of_left| of_left == is_first(output, eye))
}

/// Whether an eye's picture is where that of a left eye is due.
fn is_first(output: &Output, eye: Eye) -> bool {
    (eye == Eye::Left) != output.swap_eyes
}

/// One eye's picture of a whole output as light, row by row: as its display and its glasses give it back.
fn whole(picture: &RgbImage, output: &Output, eye: Eye) -> Vec<DVec3> {
    let [width, height] = output.size_px;
    let decode = |value: u8| {
        let value = f64::from(value) / 255.0;
        output
            .gamma
            .map_or_else(|| flip::to_light(value), |gamma| value.powf(gamma))
    };
    let at = |x: u32, y: u32| {
        let [x, y] = [x.min(width - 1), y.min(height - 1)];
        DVec3::from(picture.get_pixel(x, y).0.map(decode))
    };
    let second = u32::from(!is_first(output, eye));
    // Of every other pixel along a line: those between are the mean of their neighbours.
    let between = |place: u32, parity: u32, size: u32, line: &dyn Fn(u32) -> DVec3| {
        if (parity & 1) == second {
            return line(place);
        }
        let before = place.checked_sub(1).unwrap_or(place + 1);
        let after = if place + 1 < size { place + 1 } else { before };
        (line(before) + line(after)) * 0.5
    };
    // Squeezed to half the size: pixels of the half lie in the middle of two.
    let squeezed = |place: u32, size: u32, line: &dyn Fn(u32) -> DVec3| {
        let half = size / 2;
        let from_first = (f64::from(place) * 0.5 - 0.25).clamp(0.0, f64::from(half - 1));
        let first = (from_first as u32).min(half.saturating_sub(2));
        let start = second * half;
        line(start + first).lerp(
            line(start + (first + 1).min(half - 1)),
            from_first - f64::from(first),
        )
    };
    let pixel = |x: u32, y: u32| match output.stereo {
        Stereo::Off | Stereo::RedCyan | Stereo::GreenMagenta | Stereo::AmberBlue => at(x, y),
        Stereo::SideBySide => squeezed(x, width, &|x| at(x, y)),
        Stereo::TopBottom => squeezed(y, height, &|y| at(x, y)),
        Stereo::InterlacedRows => between(y, y, height, &|y| at(x, y)),
        Stereo::InterlacedColumns => between(x, x, width, &|x| at(x, y)),
        Stereo::Checkerboard => between(x, x + y, width, &|x| at(x, y)),
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| pixel(x, y))
        .collect()
}
