//! The stages that map one sample to one sample: elevation, imagery, radar, ramps. Known points of their
//! equations, and what must come out exactly.
#![allow(clippy::float_cmp, reason = "what is exact is compared exactly")]

mod common;

use common::{at, bytes, height_at, heights, words};
use shaders::cpu;
use shaders::{
    ElevationUniform, INVALID_WORD, ImageryUniform, RampUniform, SarUniform, raw_colour,
};

const PLAIN: ImageryUniform = ImageryUniform {
    gain: 1.0,
    contrast: 1.0,
    saturation: 1.0,
    inverse_gamma: 1.0,
    tint: [1.0; 4],
};

const RADAR: SarUniform = SarUniform {
    lowest: 0.0,
    highest: 200.0,
    strength: 100.0,
    exponent: 0.7,
    tint: [1.0; 4],
};

#[test]
fn elevation_is_shifted_scaled_moved_and_clamped_in_that_order() {
    let parameters = ElevationUniform {
        scale: 3.0,
        datum_shift_m: -50.0,
        offset_m: 7.0,
        lowest_m: -100.0,
        highest_m: 9000.0,
        padding: [0; 3],
    };
    assert_eq!(cpu::elevation::height(&parameters, 150.0), 307.0);
    assert_eq!(cpu::elevation::height(&parameters, -500.0), -100.0);
    assert_eq!(cpu::elevation::height(&parameters, 4000.0), 9000.0);
    let mut slot = heights(|i, _| f64::from(i));
    slot[5] = INVALID_WORD;
    let result = cpu::elevation::run(&parameters, &[&slot]);
    assert_eq!(result[5], INVALID_WORD);
    assert_eq!(height_at(&result, 200, 3), 457.0);
}

/// One raw colour through the imagery stage.
fn shown(parameters: &ImageryUniform, red: u32, green: u32, blue: u32) -> [i32; 4] {
    let slot = words(|_, _| raw_colour(red, green, blue));
    bytes(cpu::imagery::run(parameters, &[&slot])[0])
}

#[test]
fn imagery_without_changes_is_the_rounded_code_exactly() {
    let slot = words(|i, j| {
        let code = ((j + 9) * 275 + i + 9) as u32;
        raw_colour(code % 1024, (code + 341) % 1024, (code * 7) % 1024)
    });
    let result = cpu::imagery::run(&PLAIN, &[&slot]);
    for (raw, word) in slot.iter().zip(&result) {
        for (bits, byte) in [0, 10, 20].into_iter().zip(bytes(*word)) {
            let exact = f64::from(raw >> bits & 1023) * 255.0 / 1023.0;
            assert_eq!(f64::from(byte), exact.round());
        }
        assert_eq!(bytes(*word)[3], 255);
    }
    // Bytes that were widened by repeating their bits come back as they were.
    for byte in 0..256 {
        let code = (byte * 1023 + 127) / 255;
        assert_eq!(shown(&PLAIN, code, code, code)[0], byte as i32);
    }
}

#[test]
fn imagery_parameters_do_what_they_say() {
    let with = |change: fn(&mut ImageryUniform)| {
        let mut parameters = PLAIN;
        change(&mut parameters);
        parameters
    };
    // Two stops are four times the light, which is the code's square: the code doubles.
    let brighter = with(|p| p.gain = 4.0);
    assert_eq!(shown(&brighter, 200, 400, 900), [100, 199, 255, 255]);
    let flat = with(|p| p.contrast = 0.0);
    assert_eq!(shown(&flat, 200, 400, 900), [128, 128, 128, 255]);
    let harder = with(|p| p.contrast = 2.0);
    assert_eq!(shown(&harder, 100, 512, 700), [0, 128, 221, 255]);
    let grey = with(|p| p.saturation = 0.0);
    let luma = (0.2126 * 200.0 + 0.7152 * 400.0 + 0.0722 * 900.0) / 1023.0 * 255.0;
    let luma = f64::round(luma) as i32;
    assert_eq!(shown(&grey, 200, 400, 900), [luma, luma, luma, 255]);
    let curved = with(|p| p.inverse_gamma = 0.5);
    assert_eq!(shown(&curved, 0, 256, 1023), [0, 128, 255, 255]);
    let tinted = with(|p| p.tint = [1.0, 0.5, 0.0, 9.0]);
    assert_eq!(shown(&tinted, 1023, 1023, 1023), [255, 128, 0, 255]);
}

#[test]
fn a_hole_in_imagery_stays_one() {
    let result = cpu::imagery::run(&PLAIN, &[&words(|_, _| 0)]);
    assert!(result.iter().all(|word| *word == 0));
}

/// One amplitude through a radar stage.
fn grey(
    run: fn(&SarUniform, &[&[u32]]) -> Vec<u32>,
    parameters: &SarUniform,
    amplitude: f64,
) -> i32 {
    let slot = heights(|_, _| amplitude);
    let [red, green, blue, alpha] = bytes(run(parameters, &[&slot])[0]);
    assert!(red == green && green == blue && alpha == 255);
    red
}

#[test]
fn radar_mappings_are_the_seed_s_equations() {
    // Eq. 2.3: a / t, clipped to 0…1.
    for (amplitude, code) in [
        (-5.0, 0),
        (0.0, 0),
        (50.0, 64),
        (100.0, 128),
        (200.0, 255),
        (1e9, 255),
    ] {
        assert_eq!(grey(cpu::sar_linear::run, &RADAR, amplitude), code);
    }
    // Eq. 2.4 at c = 100: log(1 + 100 a) / log 101.
    for (amplitude, share) in [
        (0.0, 0.0),
        (2.0, 2_f64.ln() / 101_f64.ln()),
        (20.0, 11_f64.ln() / 101_f64.ln()),
        (100.0, 51_f64.ln() / 101_f64.ln()),
        (200.0, 1.0),
    ] {
        let code = (share * 255.0).round() as i32;
        assert_eq!(grey(cpu::sar_logarithmic::run, &RADAR, amplitude), code);
    }
    // Eq. 2.5 at γ = 0.7 and at γ = ½.
    let root = SarUniform {
        exponent: 0.5,
        ..RADAR
    };
    for (amplitude, parameters, share) in [
        (0.0, RADAR, 0.0),
        (2.0, RADAR, 0.039_810_717),
        (100.0, RADAR, 0.615_572_2),
        (200.0, RADAR, 1.0),
        (50.0, root, 0.5),
        (8.0, root, 0.2),
    ] {
        let code = f64::round(share * 255.0) as i32;
        assert_eq!(grey(cpu::sar_gamma::run, &parameters, amplitude), code);
    }
}

#[test]
fn radar_ranges_tints_and_holes() {
    let parameters = SarUniform {
        lowest: 100.0,
        tint: [1.0, 0.5, 0.0, 1.0],
        ..RADAR
    };
    let mut slot = heights(|_, _| 150.0);
    slot[7] = INVALID_WORD;
    for run in [
        cpu::sar_linear::run,
        cpu::sar_logarithmic::run,
        cpu::sar_gamma::run,
    ] {
        let result = run(&parameters, &[&slot]);
        assert_eq!(result[7], 0);
        let [red, green, blue, _] = bytes(result[8]);
        assert!((red - 2 * green).abs() <= 1 && blue == 0 && red > 100);
    }
    assert_eq!(
        bytes(cpu::sar_linear::run(&parameters, &[&slot])[8])[0],
        128
    );
}

/// A ramp with these stops.
fn ramp(stops: &[(f32, u32)]) -> RampUniform {
    let mut parameters = RampUniform {
        count: stops.len() as u32,
        padding: [0; 3],
        heights: [[0.0; 4]; 8],
        colours: [[0; 4]; 8],
    };
    for (n, (height, colour)) in stops.iter().enumerate() {
        parameters.heights[n / 4][n % 4] = *height;
        parameters.colours[n / 4][n % 4] = *colour;
    }
    parameters
}

fn ramp_at(parameters: &RampUniform, height: f64) -> u32 {
    cpu::ramp::run(parameters, &[&heights(|_, _| height)])[0]
}

#[test]
fn a_ramp_hits_its_stops_and_is_linear_between_them() {
    for count in [2, 3, 4, 5, 8, 17, 31, 32] {
        let stops: Vec<(f32, u32)> = (0..count)
            .map(|n: u32| {
                (
                    n as f32 * n as f32 * 10.0 - 500.0,
                    0xFF00_0000 | n.wrapping_mul(0x0030_7F11) & 0x00FF_FFFF,
                )
            })
            .collect();
        let parameters = ramp(&stops);
        for (height, colour) in &stops {
            assert_eq!(ramp_at(&parameters, f64::from(*height)), *colour, "{count}");
        }
        for pair in stops.windows(2) {
            let quarter = f64::from(pair[0].0) * 0.75 + f64::from(pair[1].0) * 0.25;
            let shown = bytes(ramp_at(&parameters, quarter));
            let (low, high) = (bytes(pair[0].1), bytes(pair[1].1));
            for part in 0..4 {
                let exact = f64::from(low[part]) * 0.75 + f64::from(high[part]) * 0.25;
                assert!(
                    (f64::from(shown[part]) - exact).abs() <= 0.51,
                    "{count} {shown:?}"
                );
            }
        }
        assert_eq!(ramp_at(&parameters, -1e5), stops[0].1);
        assert_eq!(ramp_at(&parameters, 1e5), stops[stops.len() - 1].1);
    }
}

#[test]
fn stops_that_f32_cannot_tell_apart_are_a_step() {
    let parameters = ramp(&[
        (0.0, 0xFF00_00FF),
        (5000.0, 0xFF00_FF00),
        (5000.0, 0xFFFF_0000),
        (6000.0, 0xFFFF_FFFF),
    ]);
    assert_eq!(ramp_at(&parameters, 5000.0), 0xFFFF_0000);
    assert_eq!(bytes(ramp_at(&parameters, 4999.0))[1], 255);
}

#[test]
fn a_hole_has_no_colour_in_a_ramp() {
    let parameters = ramp(&[(0.0, 0xFF00_00FF), (1.0, 0xFF00_FF00)]);
    let result = cpu::ramp::run(&parameters, &[&words(|_, _| INVALID_WORD)]);
    assert_eq!(at(&result, 0, 0), 0);
}
