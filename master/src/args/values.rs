//! Values on the command line that are more than a number or a word, each with its unit.
//!
//! In: one argument's text. Out: a value in its range, or what to write instead.

use std::str::FromStr;

/// `--extent`: degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    /// Western edge, degrees.
    pub(crate) west: f64,
    /// Southern edge, degrees.
    pub(crate) south: f64,
    /// Eastern edge, degrees.
    pub(crate) east: f64,
    /// Northern edge, degrees.
    pub(crate) north: f64,
}

impl FromStr for Extent {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [west, south, east, north] = numbers(text)?;
        let wide = [west, east]
            .iter()
            .all(|side| (-360.0..=360.0).contains(side))
            && west != east;
        if !wide || east - west > 360.0 || south >= north || south < -90.0 || north > 90.0 {
            return Err(format!(
                "{west} {south} {east} {north} is no extent: write west,south,east,north in degrees, south \
                 below north, west and east at most 360 apart; west greater than east crosses the antimeridian"
            ));
        }
        Ok(Self {
            west,
            south,
            east,
            north,
        })
    }
}

/// `--range`: source samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    /// Shown as black.
    pub(crate) low: f64,
    /// Shown as white.
    pub(crate) high: f64,
}

impl FromStr for Range {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [low, high] = numbers(text)?;
        if low >= high {
            return Err(format!(
                "{low} is not below {high}: write the darkest sample, then the brightest"
            ));
        }
        Ok(Self { low, high })
    }
}

/// `--at`: degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Position {
    /// Geodetic latitude, degrees north.
    pub(crate) latitude_deg: f64,
    /// Longitude, degrees east.
    pub(crate) longitude_deg: f64,
}

impl FromStr for Position {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [latitude_deg, longitude_deg] = numbers(text)?;
        if !(-90.0..=90.0).contains(&latitude_deg) || !(-360.0..=360.0).contains(&longitude_deg) {
            return Err(format!(
                "{latitude_deg},{longitude_deg} is no position: write latitude (-90 to 90), then longitude"
            ));
        }
        Ok(Self {
            latitude_deg,
            longitude_deg,
        })
    }
}

/// `--size`: pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    /// Pixels across.
    pub(crate) width: u32,
    /// Pixels down.
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(['x', '×']).and_then(|(width, height)| {
            let pixels = |side: &str| side.parse().ok().filter(|side| (1..=16384).contains(side));
            Some(Self {
                width: pixels(width)?,
                height: pixels(height)?,
            })
        });
        parsed.ok_or_else(|| "write WIDTHxHEIGHT in pixels, each from 1 to 16384".to_owned())
    }
}

/// `--raw-size`: samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RawSize {
    /// Samples a row.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
}

impl FromStr for RawSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(['x', '×']).and_then(|(width, height)| {
            let samples = |side: &str| side.parse().ok().filter(|side| *side >= 2);
            Some(Self {
                width: samples(width)?,
                height: samples(height)?,
            })
        });
        parsed.ok_or_else(|| "write WIDTHxHEIGHT in samples, each at least 2".to_owned())
    }
}

/// Exactly `N` finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|number| number.trim().parse().ok().filter(|n: &f64| n.is_finite()))
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("write {N} numbers separated by commas, without spaces"))
}

/// `--format` of `convert`.
pub(super) fn wall_system(text: &str) -> Result<convert::Format, String> {
    let names = convert::Format::NAMES;
    let found = names.iter().find(|(_, name)| *name == text);
    found
        .map(|(format, _)| *format)
        .ok_or_else(|| format!("write one of {}", names.map(|(_, name)| name).join(", ")))
}

/// `--pixels`.
pub(super) fn pixel_share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok();
    share
        .filter(|share| (0.01..=1.0).contains(share))
        .ok_or_else(|| "write a number within 0.01…1".to_owned())
}

/// `--fps`: frames per second.
pub(super) fn frames_per_second(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|fps| (1.0..=240.0).contains(fps))
        .ok_or_else(|| "write frames per second, from 1 to 240".to_owned())
}

/// `--seconds`.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.1..=86_400.0).contains(seconds))
        .ok_or_else(|| "write seconds, from 0.1 to 86400".to_owned())
}

/// The same where nought is something to ask for.
pub(super) fn seconds_or_none(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.0..=86_400.0).contains(seconds))
        .ok_or_else(|| "write seconds, from 0 to 86400".to_owned())
}
