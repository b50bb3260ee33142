//! The stages that look at places: resampling an ancestor, isolines, the lens.
#![allow(clippy::float_cmp, reason = "what is exact is compared exactly")]

mod common;

use common::{at, bytes, height_at, heights, words};
use shaders::cpu;
use shaders::{
    INVALID_WORD, IsolinesUniform, LensUniform, ResampleUniform, SampleForm, raw_colour,
};

fn numbers(origin: [i32; 2], shift: u32) -> ResampleUniform {
    ResampleUniform {
        origin,
        shift,
        form: SampleForm::Number as u32,
    }
}

#[test]
fn even_nodes_are_the_parent_s_and_the_others_means() {
    let parent = heights(|i, j| f64::from(i * i * 3 - j * 16 + i * j));
    let result = cpu::resample::run(&numbers([256, 0], 1), &[&parent]);
    let parent_at = |i, j| height_at(&parent, i, j);
    for j in -4..132 {
        for i in -4..132 {
            let (x, y) = (128 + i, j);
            assert_eq!(height_at(&result, 2 * i, 2 * j), parent_at(x, y));
            let along = 0.5 * (parent_at(x, y) + parent_at(x + 1, y));
            assert_eq!(height_at(&result, 2 * i + 1, 2 * j), along);
            let up = 0.5 * (parent_at(x, y) + parent_at(x, y + 1));
            assert_eq!(height_at(&result, 2 * i, 2 * j + 1), up);
        }
    }
    let middle =
        0.25 * (parent_at(128, 0) + parent_at(129, 0) + parent_at(128, 1) + parent_at(129, 1));
    assert_eq!(height_at(&result, 1, 1), middle);
}

#[test]
fn ancestors_far_above_are_met_exactly_too() {
    let ancestor = heights(|i, j| f64::from(i) * 7.0 + f64::from(j));
    // Six levels up, the last tile of the ancestor; twenty-two levels up, its first.
    for (origin, shift) in [
        ([63 * 256, 17 * 256], 6),
        ([0, 0], 22),
        ([4_194_303 * 256, 256], 22),
    ] {
        let result = cpu::resample::run(&numbers(origin, shift), &[&ancestor]);
        for (i, j) in [(0, 0), (64, 128), (256, 256), (-9, 265), (77, 3)] {
            let x = f64::from(origin[0] + i) / f64::from(1 << shift);
            let y = f64::from(origin[1] + j) / f64::from(1 << shift);
            let exact = x * 7.0 + y;
            assert!(
                (height_at(&result, i, j) - exact).abs() < 1e-3,
                "{shift} {i} {j}"
            );
        }
    }
}

#[test]
fn holes_are_left_out_and_weights_made_up() {
    let mut parent = heights(|_, _| 100.0);
    let mut hole = |i: i32, j: i32| parent[((j + 9) * 275 + i + 9) as usize] = INVALID_WORD;
    hole(10, 10);
    for (i, j) in [(50, 50), (51, 50), (50, 51), (51, 51)] {
        hole(i, j);
    }
    let result = cpu::resample::run(&numbers([0, 0], 1), &[&parent]);
    assert_eq!(at(&result, 20, 20), INVALID_WORD, "the hole's own node");
    assert_eq!(height_at(&result, 21, 21), 100.0, "three of four");
    assert_eq!(height_at(&result, 21, 20), 100.0, "one of two");
    assert_eq!(at(&result, 101, 101), INVALID_WORD, "none of four");
    assert_eq!(at(&result, 100, 101), INVALID_WORD, "none of two");
    assert_eq!(height_at(&result, 99, 100), 100.0);
}

#[test]
fn colours_are_resampled_channel_by_channel() {
    let parent = words(|i, j| match (i, j) {
        (7, 7) => 0,
        _ if i % 2 == 0 => raw_colour(1000, 20, 0),
        _ => raw_colour(500, 23, 1023),
    });
    let parameters = ResampleUniform {
        form: SampleForm::RawColour as u32,
        ..numbers([0, 0], 1)
    };
    let result = cpu::resample::run(&parameters, &[&parent]);
    assert_eq!(at(&result, 4, 4), raw_colour(1000, 20, 0));
    assert_eq!(
        at(&result, 5, 4),
        raw_colour(750, 22, 512),
        "halves round up"
    );
    assert_eq!(at(&result, 14, 14), 0);
    assert_eq!(at(&result, 15, 14), raw_colour(1000, 20, 0));
}

const LINES: IsolinesUniform = IsolinesUniform {
    spacing_m: 100.0,
    half_width: 1.0,
    bold_half_width: 2.5,
    bold_every: 0,
    colour: [0.2, 0.4, 0.6, 1.0],
};

/// Mean width in samples of the lines of a plane that rises by `gradient` metres a sample towards `angle`.
fn mean_width(parameters: &IsolinesUniform, gradient: f64, angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let slot = heights(|i, j| gradient * (f64::from(i) * cos + f64::from(j) * sin) + 13.7);
    let result = cpu::isolines::run(parameters, &[&slot]);
    let covered: f64 = (0..256)
        .flat_map(|j| (0..256).map(move |i| (i, j)))
        .map(|(i, j)| f64::from(bytes(at(&result, i, j))[3]) / 255.0)
        .sum();
    let period = f64::from(parameters.spacing_m) / gradient;
    covered / (256.0 * 256.0) * period
}

#[test]
fn isolines_of_a_plane_are_as_wide_as_they_say() {
    for half_width in [0.05, 0.25, 0.5, 1.0, 2.0, 4.0] {
        let parameters = IsolinesUniform {
            half_width: half_width as f32,
            ..LINES
        };
        // Periods of 32, 16 and 64 samples divide the 256 that are counted.
        for gradient in [100.0 / 32.0, 100.0 / 16.0, 100.0 / 64.0] {
            for angle in [0.0, std::f64::consts::FRAC_PI_2, std::f64::consts::PI] {
                let width = mean_width(&parameters, gradient, angle);
                assert!(
                    (width - 2.0 * half_width).abs() < 0.1,
                    "{half_width} {gradient}: {width}"
                );
            }
        }
        // Askew, over many lines, the count is right but for the picture's corners.
        for angle in [0.3, 0.785, 1.2, 2.5] {
            let width = mean_width(&parameters, 100.0 / 16.0, angle);
            assert!(
                (width - 2.0 * half_width).abs() < 0.1 + 0.02 * half_width,
                "{half_width} {angle}: {width}"
            );
        }
    }
}

#[test]
fn every_fifth_line_is_bold() {
    let parameters = IsolinesUniform {
        bold_every: 5,
        ..LINES
    };
    // Line n lies at i = 20 n.
    let result = cpu::isolines::run(&parameters, &[&heights(|i, _| f64::from(i) * 5.0)]);
    let coverage = |i| bytes(at(&result, i, 100))[3];
    for line in 0..12 {
        let (near, far) = (coverage(20 * line + 2), coverage(20 * line + 4));
        assert_eq!(near, if line % 5 == 0 { 255 } else { 0 }, "line {line}");
        assert_eq!(far, 0);
        assert_eq!(coverage(20 * line), 255);
    }
    let below_zero =
        cpu::isolines::run(&parameters, &[&heights(|i, _| f64::from(i) * 5.0 - 2000.0)]);
    assert_eq!(bytes(at(&below_zero, 2, 0))[3], 255, "line −20 is bold");
    assert_eq!(bytes(at(&below_zero, 22, 0))[3], 0, "line −19 is not");
    assert_eq!(bytes(at(&result, 0, 0)), [51, 102, 153, 255]);
}

#[test]
fn flat_ground_and_holes_have_no_lines() {
    for level in [0.0, 100.0, 33.0, -500.0] {
        let result = cpu::isolines::run(&LINES, &[&heights(|_, _| level)]);
        assert!(result.iter().all(|word| *word == 0), "{level}");
    }
    let mut slot = heights(|i, _| f64::from(i) * 5.0);
    slot[100 * 275 + 29] = INVALID_WORD;
    let result = cpu::isolines::run(&LINES, &[&slot]);
    assert_eq!(result[100 * 275 + 29], 0);
    assert_ne!(
        result[101 * 275 + 29],
        0,
        "its neighbour on the line is drawn"
    );
}

#[test]
fn a_lens_takes_the_inside_within_its_circle() {
    // (x − 0.1)² + (y + 0.2)² − 0.25, of degree 2 and again padded to degree 8.
    for degree in [2, 8] {
        let mut parameters = LensUniform {
            degree,
            padding: [0; 3],
            coefficients: [[0.0; 4]; 21],
        };
        let mut set = |n: u32, m: u32, value: f32| {
            let index = (m * (degree + 1) + n) as usize;
            parameters.coefficients[index / 4][index % 4] = value;
        };
        set(0, 0, 0.01 + 0.04 - 0.25);
        set(1, 0, -0.2);
        set(0, 1, 0.4);
        set(2, 0, 1.0);
        set(0, 2, 1.0);
        let (outside, inside) = (
            words(|i, _| i as u32),
            words(|_, j| 0xFF00_0000 | j as u32 & 0xFFFF),
        );
        let result = cpu::lens::run(&parameters, &[&outside, &inside]);
        let mut counts = [0, 0];
        for j in -9..266 {
            for i in -9..266 {
                let (x, y) = (f64::from(i - 128) / 137.0, f64::from(j - 128) / 137.0);
                let exact = (x - 0.1).powi(2) + (y + 0.2).powi(2) - 0.25;
                if exact.abs() < 1e-6 {
                    continue;
                }
                let side = usize::from(exact <= 0.0);
                counts[side] += 1;
                assert_eq!(
                    at(&result, i, j),
                    at([&outside, &inside][side], i, j),
                    "{i} {j}"
                );
            }
        }
        assert!(counts[0] > 1000 && counts[1] > 1000);
    }
}
