//! The one-euro filter and the prediction, by numbers: how calm, how late. In: synthetic motion with noise.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use tracking::{HeadPose, LONGEST_PREDICTION_US, Motion, OneEuro, OneEuroRotation, Smoothing};

/// 60 measurements a second.
const STEP_US: i64 = 16_667;

/// What the wall file gives where it says nothing.
fn calm() -> Smoothing {
    Smoothing::default()
}

/// What follows a walking viewer.
fn quick() -> Smoothing {
    Smoothing {
        minimum_cutoff_hz: 1.0,
        speed_coefficient: 10.0,
    }
}

/// Noise of variance 1, the same in every run: the sum of twelve uniform numbers less 6.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

fn root_mean_square(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn noise_at_rest_shrinks_to_a_third() {
    for (smoothing, most) in [(calm(), 0.30), (quick(), 0.40)] {
        let mut noise = Noise(1);
        let mut filter = OneEuro::new(smoothing);
        let at_rest = DVec3::new(0.3, 1.7, -0.2);
        let mut raw = Vec::new();
        let mut filtered = Vec::new();
        for step in 0..1_200 {
            // 1 mm a component, as optical trackers have at their worst.
            let value = at_rest + noise.vector() * 0.001;
            let out = filter.filter(step * STEP_US, value);
            if step >= 120 {
                raw.push(value.distance(at_rest));
                filtered.push(out.distance(at_rest));
            }
        }
        let ratio = root_mean_square(&filtered) / root_mean_square(&raw);
        eprintln!("{smoothing:?}: noise × {ratio:.3}");
        assert!(ratio < most, "{smoothing:?}: {ratio}");
    }
}

#[test]
fn a_turning_heads_noise_shrinks_and_the_sign_of_a_quaternion_is_no_turn() {
    let mut noise = Noise(2);
    let mut filter = OneEuroRotation::new(calm());
    let at_rest = DQuat::from_rotation_y(0.5);
    let mut raw = Vec::new();
    let mut filtered = Vec::new();
    for step in 0..1_200 {
        let shake = DQuat::from_scaled_axis(noise.vector() * 0.002);
        let value = shake * at_rest;
        let value = if step % 2 == 0 { value } else { -value };
        let out = filter.filter(step * STEP_US, value);
        if step >= 120 {
            raw.push(
                value
                    .angle_between(at_rest)
                    .min((-value).angle_between(at_rest)),
            );
            filtered.push(
                out.angle_between(at_rest)
                    .min((-out).angle_between(at_rest)),
            );
        }
    }
    let ratio = root_mean_square(&filtered) / root_mean_square(&raw);
    eprintln!("turns: noise × {ratio:.3}");
    assert!(ratio < 0.30, "{ratio}");
}

/// How far behind a ramp of `speed` the filter is after two seconds, in metres.
fn ramp_lag_m(smoothing: Smoothing, speed_m_s: f64) -> f64 {
    let mut filter = OneEuro::new(smoothing);
    let mut lag_m = 0.0;
    for step in 0..120 {
        let at_us = step * STEP_US;
        let value = DVec3::X * (speed_m_s * at_us as f64 * 1e-6);
        lag_m = (value - filter.filter(at_us, value)).x;
    }
    lag_m
}

#[test]
fn the_lag_of_a_ramp_is_bounded_and_grows_less_than_speed() {
    for (smoothing, speed_m_s, most_m) in [
        (calm(), 0.1, 0.016),
        (calm(), 1.0, 0.065),
        (quick(), 0.1, 0.005),
        (quick(), 1.0, 0.012),
    ] {
        let lag_m = ramp_lag_m(smoothing, speed_m_s);
        eprintln!(
            "{smoothing:?} at {speed_m_s} m/s: {:.1} mm behind",
            lag_m * 1e3
        );
        assert!(
            lag_m > 0.0 && lag_m < most_m,
            "{smoothing:?} {speed_m_s}: {lag_m}"
        );
    }
    assert!(ramp_lag_m(calm(), 1.0) < 10.0 * ramp_lag_m(calm(), 0.1));
}

#[test]
fn steps_may_be_irregular_and_repeated_moments_change_nothing() {
    let mut noise = Noise(3);
    let mut filter = OneEuro::new(quick());
    let mut at_us = 0;
    let mut worst_m: f64 = 0.0;
    for step in 0..600 {
        at_us += 2_000 + (noise.uniform() * 40_000.0) as i64;
        let value = DVec3::Z * (0.5 * at_us as f64 * 1e-6);
        let out = filter.filter(at_us, value);
        assert_eq!(filter.filter(at_us, value + DVec3::X), out);
        assert_eq!(filter.filter(at_us - 1, value + DVec3::X), out);
        if step > 60 {
            worst_m = worst_m.max(out.distance(value));
        }
    }
    eprintln!(
        "irregular steps at 0.5 m/s: at most {:.1} mm behind",
        worst_m * 1e3
    );
    assert!(worst_m < 0.02, "{worst_m}");
    let velocity = filter.velocity();
    assert!(velocity.distance(DVec3::Z * 0.5) < 0.05, "{velocity}");
    filter.reset();
    assert_eq!(filter.filter(0, DVec3::ONE), DVec3::ONE);
}

/// A head that sways 30 cm and turns 40° every two seconds.
fn swaying(at_us: i64) -> (DVec3, DQuat) {
    let phase = TAU * 0.5 * at_us as f64 * 1e-6;
    (
        DVec3::new(0.3 * phase.sin(), 1.7, 0.0),
        DQuat::from_rotation_y(0.7 * phase.sin()),
    )
}

#[test]
fn prediction_more_than_halves_the_error_of_a_sway() {
    // Two frames at 60 Hz from measurement to light.
    const AHEAD_US: i64 = 33_333;
    let mut noise = Noise(4);
    let mut place = OneEuro::new(quick());
    let mut turn = OneEuroRotation::new(quick());
    let [mut without_m, mut with_m, mut without_rad, mut with_rad] = [const { Vec::new() }; 4];
    for step in 0..1_200 {
        let at_us = step * STEP_US;
        let (position_m, orientation) = swaying(at_us);
        let motion = Motion {
            measured_us: at_us,
            position_m: place.filter(at_us, position_m + noise.vector() * 0.000_5),
            orientation: turn.filter(
                at_us,
                DQuat::from_scaled_axis(noise.vector() * 0.001) * orientation,
            ),
            velocity_m_s: place.velocity(),
            turning_rad_s: turn.velocity(),
        };
        if step < 120 {
            continue;
        }
        let (there_m, there) = swaying(at_us + AHEAD_US);
        let back = there * DVec3::Z;
        let error = |pose: HeadPose| {
            (
                DVec3::from(pose.position_m).distance(there_m),
                DVec3::from(pose.back).angle_between(back),
            )
        };
        let (metres, radians) = error(motion.at(at_us));
        without_m.push(metres);
        without_rad.push(radians);
        let (metres, radians) = error(motion.at(at_us + AHEAD_US));
        with_m.push(metres);
        with_rad.push(radians);
    }
    let [without_mm, with_mm] = [&without_m, &with_m].map(|errors| root_mean_square(errors) * 1e3);
    let [without_deg, with_deg] =
        [&without_rad, &with_rad].map(|errors| root_mean_square(errors).to_degrees());
    eprintln!("sway: {without_mm:.1} mm → {with_mm:.1} mm, {without_deg:.2}° → {with_deg:.2}°");
    assert!(with_mm < 0.5 * without_mm, "{without_mm} {with_mm}");
    assert!(with_deg < 0.5 * without_deg, "{without_deg} {with_deg}");
}

#[test]
fn prediction_is_bounded_and_taken_back() {
    let motion = Motion {
        measured_us: 1_000_000,
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
        velocity_m_s: DVec3::X,
        turning_rad_s: DVec3::Y,
    };
    let reach_m = |age_us: i64| motion.at(1_000_000 + age_us).position_m[0];
    let close = |one: f64, other: f64| assert!((one - other).abs() < 1e-12, "{one} {other}");
    close(reach_m(-100_000), 0.0);
    close(reach_m(20_000), 0.02);
    close(reach_m(LONGEST_PREDICTION_US), 0.05);
    close(reach_m(200_000), 0.05);
    close(reach_m(375_000), 0.025);
    close(reach_m(500_000), 0.0);
    close(reach_m(60_000_000), 0.0);
    assert_eq!(motion.at(i64::MAX).position_m, [0.0; 3]);
    assert_eq!(motion.at(i64::MIN).position_m, [0.0; 3]);
    // Turning about y to the left: the back comes to the right.
    let turned = motion.at(1_050_000);
    close(turned.back[0], 0.05_f64.sin());
    close(turned.right[2], -(0.05_f64.sin()));
}
