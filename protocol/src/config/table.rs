//! Tables and values of a TOML text, read key by key.
//! In: a parsed document. Out: typed values, or an error at the place of the value. Every reader says
//! by example what should stand there.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{ConfigError, Document, Fault, key_text, type_name};

/// A table of a document.
pub(crate) struct Table<'d, 'i> {
    document: &'d Document<'i>,
    table: &'d DeTable<'i>,
    span: Range<usize>,
    path: String,
}

/// A value of a document.
pub(crate) struct Value<'d, 'i> {
    document: &'d Document<'i>,
    value: &'d DeValue<'i>,
    span: Range<usize>,
    path: String,
}

impl<'d, 'i> Table<'d, 'i> {
    pub(super) fn new(
        document: &'d Document<'i>,
        table: &'d DeTable<'i>,
        span: Range<usize>,
        path: String,
    ) -> Self {
        Self {
            document,
            table,
            span,
            path,
        }
    }

    /// Refuses every key but `known`, and says which one was probably meant.
    pub(crate) fn only(self, known: &[&str]) -> Result<Self, ConfigError> {
        self.check_only(known).map(|()| self)
    }

    /// The same, for a table whose keys depend on one of them.
    pub(crate) fn check_only(&self, known: &[&str]) -> Result<(), ConfigError> {
        // The first in the order of the text, which is the order of reading.
        let keys = self.table.iter().map(|(key, _)| key);
        let unknown = keys.filter(|key| !known.contains(&key.get_ref().as_ref()));
        let first = unknown.min_by_key(|key| key.span().start);
        let Some(key) = first else { return Ok(()) };
        let name = key.get_ref().as_ref();
        let advice = match nearest(name, known) {
            Some(meant) => format!("unknown key; did you mean {meant}?"),
            None => format!(
                "unknown key; {} can have {}",
                self.title(),
                known.join(", ")
            ),
        };
        Err(self
            .document
            .error(Fault::UnknownKey, key.span(), self.path_of(name), advice))
    }

    /// The value of a key, if it is there.
    pub(crate) fn get(&self, key: &str) -> Option<Value<'d, 'i>> {
        self.table.get(key).map(|value| self.value(key, value))
    }

    /// The value of a key that must be there. `example` shows what to write.
    pub(crate) fn require(&self, key: &str, example: &str) -> Result<Value<'d, 'i>, ConfigError> {
        self.get(key).ok_or_else(|| {
            let advice = format!("missing in {}; write for example {example}", self.title());
            self.document.error(
                Fault::MissingKey,
                self.span.clone(),
                self.path_of(key),
                advice,
            )
        })
    }

    /// An error about the whole table.
    pub(crate) fn error(&self, fault: Fault, advice: impl Into<String>) -> ConfigError {
        self.document
            .error(fault, self.span.clone(), self.path.clone(), advice.into())
    }

    /// Its keys and their values, in the order of the text.
    pub(crate) fn entries(&self) -> Vec<(String, Value<'d, 'i>)> {
        let mut entries: Vec<_> = self.table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let owned = entries.into_iter().map(|(key, value)| {
            let name = key.get_ref().as_ref();
            (name.to_owned(), self.value(name, value))
        });
        owned.collect()
    }

    fn value(&self, key: &str, value: &'d Spanned<DeValue<'i>>) -> Value<'d, 'i> {
        Value {
            document: self.document,
            value: value.get_ref(),
            span: value.span(),
            path: self.path_of(key),
        }
    }

    fn path_of(&self, key: &str) -> String {
        let key = key_text(key);
        if self.path.is_empty() {
            key
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn title(&self) -> String {
        if self.path.is_empty() {
            "the file".to_owned()
        } else {
            self.path.clone()
        }
    }
}

impl<'d, 'i> Value<'d, 'i> {
    /// A text.
    pub(crate) fn text(&self) -> Result<String, ConfigError> {
        self.value
            .as_str()
            .map(str::to_owned)
            .ok_or_else(|| self.wrong_type("a text in quotes"))
    }

    /// True or false.
    pub(crate) fn boolean(&self) -> Result<bool, ConfigError> {
        self.value
            .as_bool()
            .ok_or_else(|| self.wrong_type("true or false"))
    }

    /// A finite number, whole or not.
    pub(crate) fn number(&self) -> Result<f64, ConfigError> {
        let number = match self.value {
            DeValue::Integer(integer) => self.parse_integer(integer).map(|integer| integer as f64),
            DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
            _ => return Err(self.wrong_type("a number")),
        };
        let finite = number.filter(|number| number.is_finite());
        finite.ok_or_else(|| self.error(Fault::OutOfRange, "write a finite number"))
    }

    /// A whole number that fits `T`.
    pub(crate) fn integer<T: TryFrom<i64>>(&self) -> Result<T, ConfigError> {
        let DeValue::Integer(integer) = self.value else {
            return Err(self.wrong_type("a whole number"));
        };
        let fitting = self
            .parse_integer(integer)
            .and_then(|integer| T::try_from(integer).ok());
        fitting.ok_or_else(|| self.error(Fault::OutOfRange, "this number is out of range"))
    }

    /// Exactly `N` finite numbers. `example` shows them.
    pub(crate) fn numbers<const N: usize>(&self, example: &str) -> Result<[f64; N], ConfigError> {
        let mut numbers = [0.0; N];
        for (number, element) in numbers.iter_mut().zip(self.elements(N, example)?) {
            *number = element.number()?;
        }
        Ok(numbers)
    }

    /// Exactly `N` whole numbers that fit `T`. `example` shows them.
    pub(crate) fn integers<T: TryFrom<i64> + Copy + Default, const N: usize>(
        &self,
        example: &str,
    ) -> Result<[T; N], ConfigError> {
        let mut integers = [T::default(); N];
        for (integer, element) in integers.iter_mut().zip(self.elements(N, example)?) {
            *integer = element.integer()?;
        }
        Ok(integers)
    }

    /// A table.
    pub(crate) fn table(&self) -> Result<Table<'d, 'i>, ConfigError> {
        let table = self
            .value
            .as_table()
            .ok_or_else(|| self.wrong_type("a table"))?;
        Ok(Table::new(
            self.document,
            table,
            self.span.clone(),
            self.path.clone(),
        ))
    }

    /// Whether it is a table.
    pub(crate) fn is_table(&self) -> bool {
        self.value.is_table()
    }

    /// Whether it is a text.
    pub(crate) fn is_text(&self) -> bool {
        self.value.is_str()
    }

    /// Whether it is a list.
    pub(crate) fn is_list(&self) -> bool {
        self.value.is_array()
    }

    /// A list of tables.
    pub(crate) fn tables(&self) -> Result<Vec<Table<'d, 'i>>, ConfigError> {
        self.tables_like(&format!("each under [[{}]]", self.path))
    }

    /// A list of tables. `example` shows how they are written.
    pub(crate) fn tables_like(&self, example: &str) -> Result<Vec<Table<'d, 'i>>, ConfigError> {
        if !self.value.is_array() {
            return Err(self.wrong_type(&format!("a list of tables, {example}")));
        }
        self.list().iter().map(Self::table).collect()
    }

    /// An error about this value.
    pub(crate) fn error(&self, fault: Fault, advice: impl Into<String>) -> ConfigError {
        self.document
            .error(fault, self.span.clone(), self.path.clone(), advice.into())
    }

    fn elements(&self, count: usize, example: &str) -> Result<Vec<Self>, ConfigError> {
        let list = self.list();
        if list.len() == count {
            return Ok(list);
        }
        let advice = format!("this must be a list of {count} numbers; write for example {example}");
        Err(self.error(Fault::WrongType, advice))
    }

    fn list(&self) -> Vec<Self> {
        let elements = self
            .value
            .as_array()
            .map(|array| array.iter())
            .into_iter()
            .flatten();
        elements
            .enumerate()
            .map(|(index, element)| Self {
                document: self.document,
                value: element.get_ref(),
                span: element.span(),
                path: format!("{}[{index}]", self.path),
            })
            .collect()
    }

    fn parse_integer(&self, integer: &toml::de::DeInteger<'_>) -> Option<i64> {
        i64::from_str_radix(&integer.as_str().replace('_', ""), integer.radix()).ok()
    }

    fn wrong_type(&self, wanted: &str) -> ConfigError {
        let advice = format!("this is {}; write {wanted}", type_name(self.value));
        self.error(Fault::WrongType, advice)
    }
}

/// Units that end a key.
const UNITS: [&str; 10] = ["m", "km", "mm", "cm", "px", "deg", "rad", "s", "ms", "mib"];

/// Longest key, in bytes, that may be a misspelling of another.
const LONGEST_WORD: usize = 64;

/// The known key that was probably meant: the same word with another unit or none, the same letters in
/// another order, or at most two letters different.
pub(crate) fn nearest<'k>(key: &str, known: &[&'k str]) -> Option<&'k str> {
    if key.len() > LONGEST_WORD {
        return None;
    }
    let same_word = known.iter().find(|candidate| stem(candidate) == stem(key));
    let letters = |word: &str| {
        let mut letters: Vec<char> = word.chars().collect();
        letters.sort_unstable();
        letters
    };
    let swapped = || {
        known
            .iter()
            .find(|candidate| letters(candidate) == letters(key))
    };
    let similar = || {
        let ranked = known
            .iter()
            .map(|candidate| (distance(candidate, key), candidate));
        let limit = if key.len() < 5 { 1 } else { 2 };
        ranked
            .filter(|(letters, _)| *letters <= limit)
            .min()
            .map(|(_, candidate)| candidate)
    };
    same_word.or_else(swapped).or_else(similar).copied()
}

/// A key without its unit.
fn stem(key: &str) -> &str {
    match key.rsplit_once('_') {
        Some((word, unit)) if UNITS.contains(&unit) => word,
        _ => key,
    }
}

/// How many letters must be changed, added or removed (V. Levenshtein, 1966).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = i;
        let mut left = i + 1;
        for (above, other) in row.iter_mut().skip(1).zip(&b) {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = *above;
            left = changed.min(left + 1).min(*above + 1);
            *above = left;
        }
        if let Some(first) = row.first_mut() {
            *first = i + 1;
        }
    }
    row.last().copied().unwrap_or_default()
}
