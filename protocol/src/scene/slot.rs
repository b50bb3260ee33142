//! Values of a scene that keys set: how each is read, written and checked.
//! In: values of TOML, or values to be checked or written. Out: values, problems, JSON.
//! It knows no key by name but `stops`, which shares its value with `ramp`; the lists are in `keys`.

use std::fmt::Display;
use std::ops::RangeInclusive;

use serde_json::{Value as Json, json};

use super::ramps::{Ramp, RampName, RampStop};
use crate::config::{ConfigError, Fault, Problem, Table, Value, nearest};

/// The start of a range that begins just above 0.
pub(super) const ABOVE_ZERO: f64 = f64::MIN_POSITIVE;

/// The second key of a ramp.
pub(super) const STOPS_KEY: &str = "stops";
/// Fewest and most stops of a ramp.
const STOP_COUNTS: RangeInclusive<usize> = 2..=32;
/// Parts of colours.
const SHARES: RangeInclusive<f64> = 0.0..=1.0;
/// Heights of stops, metres.
const STOP_HEIGHTS_M: RangeInclusive<f64> = -500_000.0..=500_000.0;
/// What stands in place of a range that is taken from the data.
const AUTOMATIC: &str = "automatic";

/// A value that a key can set, with its range.
pub(super) enum Slot<'a> {
    Flag(&'a mut bool),
    Number(&'a mut f64, RangeInclusive<f64>),
    Whole(&'a mut dyn Whole, RangeInclusive<i64>),
    /// Three shares, each 0…1.
    Colour(&'a mut [f64; 3]),
    /// Three whole numbers, each at most the last.
    Channels(&'a mut [u8; 3], u8),
    /// A low and a high end.
    Interval(&'a mut [f64; 2], RangeInclusive<f64>),
    /// The same, or none, which is written "automatic".
    OptionalInterval(&'a mut Option<[f64; 2]>, RangeInclusive<f64>),
    Choice(&'a mut dyn Choice),
    /// The keys `ramp` and `stops`.
    Ramp(&'a mut Ramp),
}

/// Whole numbers of any width.
pub(super) trait Whole {
    fn get(&self) -> i64;
    /// Whether the number fits.
    fn set(&mut self, number: i64) -> bool;
}

/// Types whose values have names.
pub(super) trait Named: Copy + PartialEq + 'static {
    const NAMES: &'static [(Self, &'static str)];

    fn from_name(name: &str) -> Option<Self> {
        let found = Self::NAMES.iter().find(|(_, known)| *known == name);
        found.map(|(value, _)| *value)
    }

    fn as_name(self) -> &'static str {
        let found = Self::NAMES.iter().find(|(value, _)| *value == self);
        found.map_or("", |(_, name)| name)
    }
}

/// A value of some [`Named`] type.
pub(super) trait Choice {
    fn name(&self) -> &'static str;
    fn read(&mut self, key: &str, value: &Value<'_, '_>) -> Result<(), ConfigError>;
}

impl<T: Copy + Into<i64> + TryFrom<i64>> Whole for T {
    fn get(&self) -> i64 {
        (*self).into()
    }

    fn set(&mut self, number: i64) -> bool {
        let fitting = Self::try_from(number).ok();
        fitting.map(|fitting| *self = fitting).is_some()
    }
}

impl<T: Named> Choice for T {
    fn name(&self) -> &'static str {
        self.as_name()
    }

    fn read(&mut self, key: &str, value: &Value<'_, '_>) -> Result<(), ConfigError> {
        *self = read_name(key, value)?;
        Ok(())
    }
}

impl Slot<'_> {
    /// Takes the value of `key` from a table that has it; without it, the value stays.
    pub(super) fn read(self, key: &str, table: &Table<'_, '_>) -> Result<(), ConfigError> {
        if let Self::Ramp(ramp) = self {
            return read_ramp(ramp, key, table);
        }
        let Some(value) = table.get(key) else {
            return Ok(());
        };
        let example = format!("{key} = {}", self.to_json());
        match self {
            Self::Flag(flag) => *flag = value.boolean()?,
            Self::Number(number, _) => *number = value.number()?,
            Self::Whole(number, range) => {
                if !number.set(value.integer()?) {
                    let advice = within("whole number", range.start(), range.end());
                    return Err(value.error(Fault::OutOfRange, advice));
                }
            }
            Self::Colour(colour) => *colour = value.numbers(&example)?,
            Self::Channels(channels, _) => {
                // A number that is no byte becomes one that no range holds, so that the check tells where it is.
                let read: [i64; 3] = value.integers(&example)?;
                *channels = read.map(|channel| u8::try_from(channel).unwrap_or(u8::MAX));
            }
            Self::Interval(interval, _) => *interval = value.numbers(&example)?,
            Self::OptionalInterval(interval, _) => *interval = read_interval(key, &value)?,
            Self::Choice(choice) => choice.read(key, &value)?,
            Self::Ramp(_) => {}
        }
        Ok(())
    }

    /// The value as it is written.
    pub(super) fn to_json(&self) -> Json {
        match self {
            Self::Flag(flag) => json!(**flag),
            Self::Number(number, _) => json!(**number),
            Self::Whole(number, _) => json!(number.get()),
            Self::Colour(colour) => json!(**colour),
            Self::Channels(channels, _) => json!(**channels),
            Self::Interval(interval, _) => json!(**interval),
            Self::OptionalInterval(interval, _) => {
                interval.map_or(json!(AUTOMATIC), |ends| json!(ends))
            }
            Self::Choice(choice) => json!(choice.name()),
            Self::Ramp(ramp) => match ramp.name {
                Some(name) => json!(name.as_name()),
                None => ramp.stops.iter().map(stop_to_json).collect(),
            },
        }
    }

    /// The first problem of the value, whose key is `key`.
    pub(super) fn check(&self, key: &str) -> Result<(), Problem> {
        match self {
            Self::Flag(_) | Self::Choice(_) => Ok(()),
            Self::Number(number, range) => check_range(key, **number, range),
            Self::Whole(number, range) if range.contains(&number.get()) => Ok(()),
            Self::Whole(_, range) => {
                let advice = within("whole number", range.start(), range.end());
                Err(Problem::new(Fault::OutOfRange, key, advice))
            }
            Self::Colour(colour) => check_each(key, *colour, &SHARES),
            Self::Channels(channels, most) => {
                let beyond = channels.iter().position(|channel| channel > most);
                let Some(index) = beyond else { return Ok(()) };
                let advice = within("whole number", &0, most);
                let key = format!("{key}[{index}]");
                Err(Problem::new(Fault::OutOfRange, key, advice))
            }
            Self::Interval(ends, range) => check_interval(key, **ends, range),
            Self::OptionalInterval(ends, range) => {
                ends.map_or(Ok(()), |ends| check_interval(key, ends, range))
            }
            Self::Ramp(ramp) => check_ramp(key, ramp),
        }
    }
}

/// A value with a name.
pub(super) fn read_name<T: Named>(key: &str, value: &Value<'_, '_>) -> Result<T, ConfigError> {
    let name = value.text()?;
    T::from_name(&name).ok_or_else(|| {
        let known: Vec<&str> = T::NAMES.iter().map(|(_, known)| *known).collect();
        let meant = nearest(&name, &known);
        let question = meant.map_or(String::new(), |meant| format!("did you mean \"{meant}\"? "));
        let list = known.join("\", \"");
        let advice = format!("unknown {key}; {question}write one of \"{list}\"");
        value.error(Fault::OutOfRange, advice)
    })
}

fn read_interval(key: &str, value: &Value<'_, '_>) -> Result<Option<[f64; 2]>, ConfigError> {
    if value.is_text() {
        if value.text()? == AUTOMATIC {
            return Ok(None);
        }
        let advice = format!("write {key} = [0.0, 255.0] or {key} = \"{AUTOMATIC}\"");
        return Err(value.error(Fault::OutOfRange, advice));
    }
    value.numbers(&format!("{key} = [0.0, 255.0]")).map(Some)
}

fn read_ramp(ramp: &mut Ramp, key: &str, table: &Table<'_, '_>) -> Result<(), ConfigError> {
    match (table.get(key), table.get(STOPS_KEY)) {
        (None, None) => Ok(()),
        (Some(name), None) => {
            *ramp = Ramp::named(read_name::<RampName>(key, &name)?);
            Ok(())
        }
        (None, Some(stops)) => {
            let stops = stops.tables_like("[{ height_m = 0, colour = [0.3, 0.5, 0.3] }, …]")?;
            *ramp = Ramp {
                name: None,
                stops: stops.into_iter().map(read_stop).collect::<Result<_, _>>()?,
            };
            Ok(())
        }
        (Some(_), Some(stops)) => {
            let advice = "a ramp has a name or stops of its own; remove one of the two";
            Err(stops.error(Fault::OutOfRange, advice))
        }
    }
}

fn read_stop(table: Table<'_, '_>) -> Result<RampStop, ConfigError> {
    let table = table.only(&["height_m", "colour"])?;
    let example = "colour = [0.3, 0.5, 0.3]";
    Ok(RampStop {
        height_m: table.require("height_m", "height_m = 1000")?.number()?,
        colour: table.require("colour", example)?.numbers(example)?,
    })
}

fn stop_to_json(stop: &RampStop) -> Json {
    json!({ "height_m": stop.height_m, "colour": stop.colour })
}

fn check_ramp(key: &str, ramp: &Ramp) -> Result<(), Problem> {
    // The path of `ramp` without its last word is that of the table that holds both keys.
    let owner = key.rsplit_once('.').map_or("", |(owner, _)| owner);
    let key_of_stops = format!("{owner}.{STOPS_KEY}");
    let stops = &ramp.stops;
    if !STOP_COUNTS.contains(&stops.len()) {
        let (least, most) = (STOP_COUNTS.start(), STOP_COUNTS.end());
        let advice = format!("there are {}; write {least}…{most} stops", stops.len());
        return Err(Problem::new(Fault::OutOfRange, key_of_stops, advice));
    }
    let mut below_m = f64::NEG_INFINITY;
    for (index, stop) in stops.iter().enumerate() {
        let path = format!("{key_of_stops}[{index}]");
        check_range(&format!("{path}.height_m"), stop.height_m, &STOP_HEIGHTS_M)?;
        check_each(&format!("{path}.colour"), &stop.colour, &SHARES)?;
        if !is_below(below_m, stop.height_m) {
            let advice = format!("stops must rise; write clearly more than {below_m} m");
            let path = format!("{path}.height_m");
            return Err(Problem::new(Fault::OutOfRange, path, advice));
        }
        below_m = stop.height_m;
    }
    if ramp.name.is_some_and(|name| name.stops() != *stops) {
        let advice = "the stops are not those of the name; give the name or the stops alone";
        return Err(Problem::new(Fault::OutOfRange, key, advice));
    }
    Ok(())
}

fn check_interval(key: &str, ends: [f64; 2], range: &RangeInclusive<f64>) -> Result<(), Problem> {
    check_each(key, &ends, range)?;
    let [low, high] = ends;
    if is_below(low, high) {
        return Ok(());
    }
    let advice = "the first number must be clearly smaller than the second";
    Err(Problem::new(Fault::OutOfRange, key, advice))
}

/// Whether a number is smaller than another in the single precision of the graphics hardware, too, which divides by
/// their difference.
fn is_below(low: f64, high: f64) -> bool {
    (low as f32) < (high as f32)
}

fn check_each(key: &str, numbers: &[f64], range: &RangeInclusive<f64>) -> Result<(), Problem> {
    let mut numbered = numbers.iter().enumerate();
    numbered.try_for_each(|(index, number)| check_range(&format!("{key}[{index}]"), *number, range))
}

/// Checks a number; one that is not finite is in no range.
pub(super) fn check_range(
    key: &str,
    number: f64,
    range: &RangeInclusive<f64>,
) -> Result<(), Problem> {
    if range.contains(&number) {
        return Ok(());
    }
    let advice = if *range.start() == ABOVE_ZERO {
        format!("write a number above 0, at most {}", range.end())
    } else {
        within("number", range.start(), range.end())
    };
    Err(Problem::new(Fault::OutOfRange, key, advice))
}

fn within(what: &str, least: &impl Display, most: &impl Display) -> String {
    format!("write a {what} within {least}…{most}")
}
