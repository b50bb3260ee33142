//! Keys of a scene with their values, so that reading, checking and writing share one list of keys.
//! In: something that has keys, and a table or nothing. Out: values taken from the table, problems, JSON.
//! How a value is read, checked and written is in `slot`; the lists are in `keys`.

use std::ops::RangeInclusive;

use serde_json::{Map, Value as Json};

use super::ramps::Ramp;
use super::slot::{STOPS_KEY, Slot, Whole};
use crate::config::{ConfigError, Problem, Table};

/// A key and its value.
pub(super) struct Field<'a> {
    pub(super) key: &'static str,
    pub(super) slot: Slot<'a>,
}

/// Something whose values are set by keys.
pub(super) trait Keyed {
    /// Its keys, in the order in which they are told.
    fn fields(&mut self) -> Vec<Field<'_>>;
}

impl<'a> Field<'a> {
    pub(super) fn new(key: &'static str, slot: Slot<'a>) -> Self {
        Self { key, slot }
    }

    pub(super) fn number(
        key: &'static str,
        value: &'a mut f64,
        range: RangeInclusive<f64>,
    ) -> Self {
        Self::new(key, Slot::Number(value, range))
    }

    pub(super) fn whole(
        key: &'static str,
        value: &'a mut dyn Whole,
        range: RangeInclusive<i64>,
    ) -> Self {
        Self::new(key, Slot::Whole(value, range))
    }

    pub(super) fn latitude(value: &'a mut f64) -> Self {
        Self::number("latitude_deg", value, -90.0..=90.0)
    }

    pub(super) fn longitude(value: &'a mut f64) -> Self {
        Self::number("longitude_deg", value, -180.0..=180.0)
    }

    pub(super) fn colour(key: &'static str, value: &'a mut [f64; 3]) -> Self {
        Self::new(key, Slot::Colour(value))
    }

    /// The keys that set it.
    pub(super) fn keys(&self) -> Vec<&'static str> {
        match self.slot {
            Slot::Ramp(_) => vec![self.key, STOPS_KEY],
            _ => vec![self.key],
        }
    }
}

/// Takes all values that a table gives.
pub(super) fn read(table: &Table<'_, '_>, owner: &mut impl Keyed) -> Result<(), ConfigError> {
    let mut fields = owner.fields().into_iter();
    fields.try_for_each(|field| field.slot.read(field.key, table))
}

/// The first problem of a thing at `path`.
pub(super) fn check(path: &str, owner: &(impl Keyed + Clone)) -> Result<(), Problem> {
    // A copy, because one list of keys serves reading, which changes values, and everything else.
    let mut copy = owner.clone();
    let mut fields = copy.fields().into_iter();
    fields.try_for_each(|field| field.slot.check(&format!("{path}.{}", field.key)))
}

/// All values of a thing by their keys. A ramp is its name, or else its stops.
pub(super) fn to_map(owner: &(impl Keyed + Clone)) -> Map<String, Json> {
    let mut map = Map::new();
    for field in owner.clone().fields() {
        let key = match &field.slot {
            Slot::Ramp(Ramp { name: None, .. }) => STOPS_KEY,
            _ => field.key,
        };
        map.insert(key.to_owned(), field.slot.to_json());
    }
    map
}

/// All keys of a thing, in the order of its list.
pub(super) fn keys(owner: &(impl Keyed + Clone)) -> Vec<&'static str> {
    let mut copy = owner.clone();
    let fields = copy.fields();
    fields.iter().flat_map(Field::keys).collect()
}

/// The keys that set the same value as `key`, itself among them.
pub(super) fn keys_beside(owner: &(impl Keyed + Clone), key: &str) -> Vec<&'static str> {
    let mut copy = owner.clone();
    let mut lists = copy.fields().into_iter().map(|field| field.keys());
    lists.find(|keys| keys.contains(&key)).unwrap_or_default()
}
