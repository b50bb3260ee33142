//! ꟻLIP: how different two pictures look to somebody who flips between them.
//!
//! In: two pictures of one size in sRGB. Out: an error of 0 to 1 for each pixel. It must not decide what is good enough:
//! tests do. Source: P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, "FLIP: A
//! Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020; sections below.

use std::f64::consts::PI;

use image::RgbImage;

/// Pixels to a degree of view of somebody 0.7 m before a monitor 0.7 m wide with 3840 pixels: the paper's default.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// White of the standard illuminant D65 in XYZ: what the matrix of sRGB makes of (1, 1, 1).
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
/// Linear sRGB to XYZ (IEC 61966-2-1 from its primaries).
const TO_XYZ: [[f64; 3]; 3] = [
    [0.412_386_564, 0.357_591_491, 0.180_450_490],
    [0.212_636_824, 0.715_182_981, 0.072_180_196],
    [0.019_330_620, 0.119_197_164, 0.950_372_587],
];
/// Its inverse.
const FROM_XYZ: [[f64; 3]; 3] = [
    [3.241_003_275, -1.537_398_934, -0.498_615_861],
    [-0.969_224_334, 1.875_930_071, 0.041_554_224],
    [0.055_639_423, -0.204_011_202, 1.057_148_933],
];
/// Contrast sensitivity as sums of Gaussians (section 4.1.1, table 1): a₁, b₁, a₂, b₂ for luminance, red-green, blue-yellow.
const SENSITIVITY: [[f64; 4]; 3] = [
    [1.0, 0.0047, 0.0, 1e-5],
    [1.0, 0.0053, 0.0, 1e-5],
    [34.1, 0.04, 13.5, 0.025],
];
/// Exponent of colour differences (section 4.1.4).
const COLOUR_EXPONENT: f64 = 0.7;
/// Differences up to this share of the largest one …
const COMPRESSED_FROM: f64 = 0.4;
/// … make up errors up to this one (section 4.1.4).
const COMPRESSED_TO: f64 = 0.95;
/// Width of a feature in degrees (section 4.2.1).
const FEATURE_DEG: f64 = 0.082;
/// Exponent of feature differences (section 4.2.2).
const FEATURE_EXPONENT: f64 = 0.5;

/// A plane of numbers, row by row.
#[derive(Clone)]
struct Plane {
    width: usize,
    values: Vec<f64>,
}

/// Weights along a line, the middle one for the pixel itself.
type Kernel = Vec<f64>;

/// The error of each pixel, row by row, 0 to 1; symmetric in both pictures.
///
/// # Panics
/// For pictures of different sizes.
#[must_use]
pub fn map(reference: &RgbImage, seen: &RgbImage, pixels_per_degree: f64) -> Vec<f64> {
    assert_eq!(
        reference.dimensions(),
        seen.dimensions(),
        "two pictures of one size"
    );
    let [first, second] = [reference, seen].map(opponent);
    let colours = {
        let [first, second] =
            [&first, &second].map(|picture| perceived(picture, pixels_per_degree));
        let largest = largest_difference();
        let pairs = first.into_iter().zip(second);
        pairs.map(move |(a, b)| redistributed(hyab(a, b).powf(COLOUR_EXPONENT), largest))
    };
    let [first, second] =
        [&first[0], &second[0]].map(|luminance| features(luminance, pixels_per_degree));
    let features = first.into_iter().zip(second).map(|(a, b)| {
        let most = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        (most / 2.0_f64.sqrt()).powf(FEATURE_EXPONENT)
    });
    // Section 4.3: a difference of features makes a difference of colours larger.
    let both = colours.zip(features);
    both.map(|(colour, feature)| colour.powf(1.0 - feature))
        .collect()
}

/// Mean error over all pixels.
#[must_use]
pub fn mean(reference: &RgbImage, seen: &RgbImage) -> f64 {
    let errors = map(reference, seen, PIXELS_PER_DEGREE);
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// From a value of 0 to 1 to linear light (IEC 61966-2-1).
#[must_use]
pub fn to_light(value: f64) -> f64 {
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

/// The way back.
#[must_use]
pub fn to_value(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        light * 12.92
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

fn times(matrix: &[[f64; 3]; 3], vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2])
}

/// Luminance, red-green and blue-yellow of a picture (YCxCz, section 4.1.1).
fn opponent(picture: &RgbImage) -> [Plane; 3] {
    let mut planes = [(); 3].map(|()| Plane {
        width: picture.width() as usize,
        values: Vec::with_capacity(picture.len() / 3),
    });
    for pixel in picture.pixels() {
        let light = pixel.0.map(|value| to_light(f64::from(value) / 255.0));
        let xyz = times(&TO_XYZ, light);
        let [x, y, z] = [0, 1, 2].map(|axis| xyz[axis] / WHITE[axis]);
        let colour = [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)];
        for (plane, value) in planes.iter_mut().zip(colour) {
            plane.values.push(value);
        }
    }
    planes
}

/// What an eye at that distance sees of it: L*a*b* with the Hunt effect, pixel by pixel (sections 4.1.1 and 4.1.2).
fn perceived(planes: &[Plane; 3], pixels_per_degree: f64) -> Vec<[f64; 3]> {
    let widest = SENSITIVITY.iter().map(|[_, b, _, d]| b.max(*d));
    let deviation = (widest.fold(0.0, f64::max) / (2.0 * PI * PI)).sqrt();
    let radius = (3.0 * deviation * pixels_per_degree).ceil() as i32;
    let filtered: Vec<Plane> = planes
        .iter()
        .zip(SENSITIVITY)
        .map(|(plane, of)| filter(plane, &of, radius, pixels_per_degree))
        .collect();
    (0..filtered[0].values.len())
        .map(|at| {
            let [y, cx, cz] = [0, 1, 2].map(|channel| filtered[channel].values[at]);
            let y = (y + 16.0) / 116.0;
            let xyz = [y + cx / 500.0, y, y - cz / 200.0];
            let light = times(&FROM_XYZ, [0, 1, 2].map(|axis| xyz[axis] * WHITE[axis]));
            hunt(light.map(|part| part.clamp(0.0, 1.0)))
        })
        .collect()
}

/// A plane after the filter of the eye's sensitivity. The two Gaussians are separable, their sum is not.
fn filter(plane: &Plane, of: &[f64; 4], radius: i32, pixels_per_degree: f64) -> Plane {
    let mut parts = Vec::new();
    for (a, b) in [(of[0], of[1]), (of[2], of[3])] {
        if a <= 0.0 {
            continue;
        }
        let along: Kernel = (-radius..=radius)
            .map(|pixel| {
                let degrees = f64::from(pixel) / pixels_per_degree;
                (-PI * PI * degrees * degrees / b).exp()
            })
            .collect();
        let weight = a * (PI / b).sqrt();
        let sum = along.iter().sum::<f64>();
        parts.push((weight * sum * sum, convolve(plane, &along, &along), weight));
    }
    let total: f64 = parts.iter().map(|(mass, _, _)| mass).sum();
    let mut out = Plane {
        width: plane.width,
        values: vec![0.0; plane.values.len()],
    };
    for (_, part, weight) in parts {
        for (out, value) in out.values.iter_mut().zip(part.values) {
            *out += value * weight / total;
        }
    }
    out
}

/// Weighted sums of neighbours, first along rows, then along columns. Beyond the edge the picture goes on as it ends.
fn convolve(plane: &Plane, across: &[f64], down: &[f64]) -> Plane {
    let (width, height) = (
        plane.width as i32,
        (plane.values.len() / plane.width) as i32,
    );
    let pass = |from: &[f64], kernel: &[f64], [step_x, step_y]: [i32; 2]| -> Vec<f64> {
        let radius = (kernel.len() / 2) as i32;
        let mut to = Vec::with_capacity(from.len());
        for y in 0..height {
            for x in 0..width {
                let sum = kernel.iter().zip(-radius..).map(|(weight, offset)| {
                    let column = (x + step_x * offset).clamp(0, width - 1);
                    let row = (y + step_y * offset).clamp(0, height - 1);
                    weight * from[(row * width + column) as usize]
                });
                to.push(sum.sum());
            }
        }
        to
    };
    let rows = pass(&plane.values, across, [1, 0]);
    Plane {
        width: plane.width,
        values: pass(&rows, down, [0, 1]),
    }
}

/// L*a*b* whose colours fade with their lightness (section 4.1.2).
fn hunt(light: [f64; 3]) -> [f64; 3] {
    let xyz = times(&TO_XYZ, light);
    // CIE 15: a cube root, and a line where it would be too steep.
    let curve = |t: f64| {
        let delta: f64 = 6.0 / 29.0;
        if t > delta.powi(3) {
            t.cbrt()
        } else {
            t / (3.0 * delta * delta) + 4.0 / 29.0
        }
    };
    let [x, y, z] = [0, 1, 2].map(|axis| curve(xyz[axis] / WHITE[axis]));
    let lightness = 116.0 * y - 16.0;
    let faded = 0.01 * lightness;
    [lightness, faded * 500.0 * (x - y), faded * 200.0 * (y - z)]
}

/// Distance of large differences of colour (section 4.1.3).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// The largest difference of colours there is on a display: of green and blue.
fn largest_difference() -> f64 {
    hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(COLOUR_EXPONENT)
}

/// From 0 … `largest` to 0 … 1, such that large differences take only a little of it (section 4.1.4).
fn redistributed(difference: f64, largest: f64) -> f64 {
    let from = COMPRESSED_FROM * largest;
    if difference < from {
        COMPRESSED_TO / from * difference
    } else {
        COMPRESSED_TO + (difference - from) / (largest - from) * (1.0 - COMPRESSED_TO)
    }
}

/// How much of an edge and of a point there is at each pixel (section 4.2.1).
fn features(luminance: &Plane, pixels_per_degree: f64) -> Vec<[f64; 2]> {
    let deviation = 0.5 * FEATURE_DEG * pixels_per_degree;
    let radius = (3.0 * deviation).ceil() as i32;
    let gaussian = |pixel: i32| {
        let ratio = f64::from(pixel) / deviation;
        (-0.5 * ratio * ratio).exp()
    };
    let line = |of: &dyn Fn(i32) -> f64| -> Kernel { (-radius..=radius).map(of).collect() };
    let smooth = line(&gaussian);
    let sum: f64 = smooth.iter().sum();
    let smooth: Kernel = smooth.into_iter().map(|weight| weight / sum).collect();
    let slope = balanced(line(&|pixel| -f64::from(pixel) * gaussian(pixel)));
    let bend = balanced(line(&|pixel| {
        let ratio = f64::from(pixel) / deviation;
        (ratio * ratio - 1.0) * gaussian(pixel)
    }));
    let grey = Plane {
        width: luminance.width,
        values: luminance
            .values
            .iter()
            .map(|y| (y + 16.0) / 116.0)
            .collect(),
    };
    let strength = |kernel: &Kernel| -> Vec<f64> {
        let across = convolve(&grey, kernel, &smooth).values;
        let down = convolve(&grey, &smooth, kernel).values;
        across.iter().zip(down).map(|(x, y)| x.hypot(y)).collect()
    };
    let (edges, points) = (strength(&slope), strength(&bend));
    edges.into_iter().zip(points).map(|(e, p)| [e, p]).collect()
}

/// Weights of which the positive ones add up to 1 and the negative ones to −1.
fn balanced(kernel: Kernel) -> Kernel {
    let sum = |sign: f64| -> f64 { kernel.iter().map(|weight| (weight * sign).max(0.0)).sum() };
    let (positive, negative) = (sum(1.0), sum(-1.0));
    let scaled = kernel.iter().map(|weight| {
        if *weight < 0.0 {
            weight / negative
        } else {
            weight / positive
        }
    });
    scaled.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn picture(colour: impl Fn(u32, u32) -> [u32; 3]) -> RgbImage {
        RgbImage::from_fn(64, 48, |x, y| Rgb(colour(x, y).map(|part| part as u8)))
    }

    fn flat(colour: [u32; 3]) -> RgbImage {
        picture(move |_, _| colour)
    }

    fn edge(at: u32) -> RgbImage {
        picture(move |x, _| if x < at { [230; 3] } else { [20; 3] })
    }

    /// What the authors' own program (flip-evaluator 1.7, LDR, 67 pixels per degree, no colour map) says of pictures that a
    /// formula gives: mean, least and largest error.
    #[test]
    fn errors_are_those_of_the_authors_program() {
        let stripes =
            |x: u32, y: u32| [(x * 7 + y * 13) % 256, (x * x + 3 * y) % 256, (x * y) % 256];
        let others = |x: u32, y: u32| {
            let [_, green, _] = stripes(x, y);
            [(x * 7 + y * 13 + 20) % 256, green, (x * y + x) % 256]
        };
        let waves = |x: u32, y: u32| [(x * 4) % 256, (y * 5) % 256, ((x + y) * 2) % 256];
        let brighter = |x: u32, y: u32| {
            let [red, green, blue] = waves(x, y);
            [red, (green + 6).min(255), blue]
        };
        let dot = |x: u32, y: u32| {
            if [x, y] == [20, 17] {
                [255; 3]
            } else {
                [40; 3]
            }
        };
        let cases = [
            (
                flat([0; 3]),
                flat([255; 3]),
                [0.967_392, 0.967_392, 0.967_392],
            ),
            (flat([0, 255, 0]), flat([0, 0, 255]), [1.0, 1.0, 1.0]),
            (
                flat([128; 3]),
                flat([138, 128, 118]),
                [0.163_242, 0.163_242, 0.163_242],
            ),
            (edge(32), edge(33), [0.045_636, 0.0, 0.717_056]),
            (edge(32), edge(36), [0.116_611, 0.0, 0.980_686]),
            (picture(dot), flat([40; 3]), [0.003_338, 0.0, 0.708_272]),
            (
                picture(stripes),
                picture(others),
                [0.282_582, 0.044_244, 0.863_458],
            ),
            (
                picture(waves),
                picture(brighter),
                [0.152_485, 0.026_640, 0.215_795],
            ),
        ];
        for (case, (first, second, told)) in cases.iter().enumerate() {
            let errors = map(first, second, PIXELS_PER_DEGREE);
            let found = [
                errors.iter().sum::<f64>() / errors.len() as f64,
                errors.iter().copied().fold(f64::INFINITY, f64::min),
                errors.iter().copied().fold(0.0, f64::max),
            ];
            for (found, told) in found.iter().zip(told) {
                assert!((found - told).abs() < 2e-4, "{case}: {found} for {told}");
            }
            // Who comes first does not count, and nothing is worse than 1.
            let turned = map(second, first, PIXELS_PER_DEGREE);
            for (error, turned) in errors.iter().zip(turned) {
                assert!((error - turned).abs() < 1e-12 && (0.0..=1.0 + 1e-9).contains(error));
            }
            assert_eq!(mean(first, first), 0.0);
        }
    }

    #[test]
    fn from_farther_away_a_shifted_edge_matters_less() {
        let mean_at = |pixels_per_degree| {
            let errors = map(&edge(32), &edge(33), pixels_per_degree);
            // In degrees: the same picture is smaller.
            errors.iter().sum::<f64>() / pixels_per_degree
        };
        assert!(mean_at(30.0) > mean_at(67.0) && mean_at(67.0) > mean_at(200.0));
        assert!(mean(&edge(32), &edge(36)) > 2.0 * mean(&edge(32), &edge(33)));
    }

    #[test]
    fn light_and_values_are_inverse() {
        for value in 0..=255 {
            let value = f64::from(value) / 255.0;
            assert!((to_value(to_light(value)) - value).abs() < 1e-6);
        }
        assert!((to_light(0.5) - 0.214_041).abs() < 1e-6);
    }
}
