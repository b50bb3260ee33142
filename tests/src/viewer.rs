//! A viewer's eye in the room: what it sees of a wall whose outputs were captured.
//!
//! In: a wall, the PNG files of its outputs, a virtual camera at an eye. Out: the picture that light from all screens makes
//! there. It knows where screens stand and nothing of how pictures for them are made; tests decide what is good enough.

mod calibrated;
mod camera;
pub mod made;
mod outputs;
pub mod walls;

use std::convert::Infallible;
use std::path::Path;

use glam::DVec3;
use image::{Rgb, RgbImage};
use protocol::Wall;
use protocol::wall::{Eye, Surfaces};
use screens::Shape;

use crate::flip;

pub use camera::Camera;
use outputs::{Lit, lit};

/// Screens whose surfaces are this near to each other along a ray are one surface, in metres.
const SAME_SURFACE_M: f64 = 0.001;

/// A wall with the light of its outputs.
#[derive(Debug)]
pub struct Room {
    wall: Wall,
    shapes: Vec<Shape>,
    lit: Vec<Lit>,
}

/// What an eye sees.
#[derive(Debug)]
pub struct Seen {
    /// In sRGB; black where [`Seen::complete`] is false.
    pub picture: RgbImage,
    /// For each pixel, row by row: whether light comes from all of it.
    pub complete: Vec<bool>,
    /// Which of red, green and blue reach the eye: not all of them through coloured glasses.
    pub components: [bool; 3],
}

/// How what an eye sees differs from what it should see.
#[derive(Debug)]
pub struct Compared {
    /// ꟻLIP's mean over the pixels that are compared, 0 to 1.
    pub flip: f64,
    /// Share of the pixels that are not compared, as no light comes from them.
    pub masked: f64,
    /// What is seen, with the reference where nothing is.
    pub filled: RgbImage,
}

impl Room {
    /// Loads the captured outputs of a wall, `HOST-OUTPUT.png` in a folder. The wall is what the program had: with the
    /// same share of pixels, and names its files as this process finds them.
    ///
    /// # Panics
    /// For pictures that are missing or of another size, and for files of screens and calibrations that cannot be read.
    #[must_use]
    pub fn load(wall: &Wall, folder: &Path) -> Self {
        let points = |file: &str, unit_m| Ok::<_, Infallible>(calibrated::surface(file, unit_m));
        let Ok(surfaces) = Surfaces::load(wall, points);
        let shapes: Vec<Shape> = (0..wall.screens.len())
            .map(|screen| surfaces.shape(screen).expect("a shape").clone())
            .collect();
        Self {
            wall: wall.clone(),
            lit: lit(wall, &shapes, folder),
            shapes,
        }
    }

    /// What `eye` sees through a virtual camera that stands there: `samples`² rays for each pixel, averaged as light.
    #[must_use]
    pub fn seen(&self, camera: &Camera, eye: Eye, samples: u32) -> Seen {
        let [width, height] = camera.size_px;
        let mut components = [true; 3];
        let visible: Vec<&Lit> = self
            .lit
            .iter()
            .filter(|lit| lit.eye == eye || lit.eye == Eye::Centre)
            .collect();
        for lit in &visible {
            components = [0, 1, 2].map(|part| components[part] && lit.components[part]);
        }
        let mut picture = RgbImage::new(width, height);
        let mut complete = Vec::with_capacity((width * height) as usize);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let mut sum = Some(DVec3::ZERO);
            for (i, j) in (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j))) {
                let share = |pixel: u32, of: u32| {
                    f64::from(pixel) + (f64::from(of) + 0.5) / f64::from(samples)
                };
                let direction = camera.direction([share(x, i), share(y, j)]);
                let light = self.light(&visible, camera.eye_m, direction);
                sum = sum.zip(light).map(|(sum, light)| sum + light);
            }
            complete.push(sum.is_some());
            let light = sum.unwrap_or_default() / f64::from(samples * samples);
            picture.put_pixel(x, y, encoded(light));
        }
        Seen {
            picture,
            complete,
            components,
        }
    }

    /// The light that comes to an eye along a ray, from all channels that shine on the surface it meets first. `None`
    /// where it meets none, or a place that no channel lights.
    fn light(&self, visible: &[&Lit], eye_m: DVec3, direction: DVec3) -> Option<DVec3> {
        let met: Vec<(usize, [f64; 2], f64)> = self
            .shapes
            .iter()
            .enumerate()
            .filter_map(|(screen, shape)| {
                let shares = shape.locate(eye_m, direction)?;
                let point_m = shape.point_m(shares[0], shares[1])?;
                Some((screen, shares, point_m.distance(eye_m)))
            })
            .collect();
        let nearest = met.iter().map(|(_, _, distance_m)| *distance_m);
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        let first = met
            .into_iter()
            .filter(|(_, _, distance_m)| *distance_m <= nearest + SAME_SURFACE_M);
        let mut light = None;
        for (screen, shares, distance_m) in first {
            let size_px = self.wall.screens[screen].size_px.map(f64::from);
            let seen = outputs::Seen {
                eye_m,
                direction: direction.normalize(),
                distance_m,
                place_px: [shares[0] * size_px[0], shares[1] * size_px[1]],
            };
            for lit in visible.iter().filter(|lit| lit.screen == screen) {
                if let Some(from_here) = lit.light(&seen) {
                    light = Some(light.unwrap_or_default() + from_here);
                }
            }
        }
        light
    }
}

impl Seen {
    /// Compares with what should be seen. Pixels that are not complete, and components that do not reach the eye, are
    /// taken from the reference and do not count.
    ///
    /// # Panics
    /// For a reference of another size, and if nothing is seen.
    #[must_use]
    pub fn compare(&self, reference: &RgbImage) -> Compared {
        let mut filled = reference.clone();
        let pixels = filled.pixels_mut().zip(self.picture.pixels());
        for ((to, from), _) in pixels
            .zip(&self.complete)
            .filter(|(_, complete)| **complete)
        {
            for part in (0..3).filter(|part| self.components[*part]) {
                to.0[part] = from.0[part];
            }
        }
        let errors = flip::map(reference, &filled, flip::PIXELS_PER_DEGREE);
        let counted = errors.iter().zip(&self.complete);
        let counted: Vec<f64> = counted
            .filter_map(|(error, complete)| complete.then_some(*error))
            .collect();
        assert!(!counted.is_empty(), "the eye sees nothing of the wall");
        Compared {
            flip: counted.iter().sum::<f64>() / counted.len() as f64,
            masked: 1.0 - counted.len() as f64 / errors.len() as f64,
            filled,
        }
    }
}

/// A picture with a pixel for each `samples`² pixels of another one, averaged as light.
#[must_use]
pub fn reduced(picture: &RgbImage, samples: u32) -> RgbImage {
    RgbImage::from_fn(
        picture.width() / samples,
        picture.height() / samples,
        |x, y| {
            let mut sum = DVec3::ZERO;
            for (i, j) in (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j))) {
                let pixel = picture.get_pixel(x * samples + i, y * samples + j).0;
                sum += DVec3::from(pixel.map(|value| flip::to_light(f64::from(value) / 255.0)));
            }
            encoded(sum / f64::from(samples * samples))
        },
    )
}

/// Light as an sRGB pixel.
fn encoded(light: DVec3) -> Rgb<u8> {
    let value = |light: f64| (flip::to_value(light.clamp(0.0, 1.0)) * 255.0).round() as u8;
    Rgb(light.to_array().map(value))
}

#[cfg(test)]
mod calibrated_tests;
#[cfg(test)]
mod tests;
