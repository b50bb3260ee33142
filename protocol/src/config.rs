//! Reading TOML so that every complaint names file, line, column, key, value and what to write instead; and JSON
//! of the same shape, whose complaints name the path of the key.
//! In: text. Out: values, or the first [`ConfigError`]. It knows neither walls nor scenes.

use std::fmt;
use std::ops::Range;

use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

mod json;
mod table;

pub(crate) use json::{check_depth, toml_of_json};
pub(crate) use table::{Table, Value, nearest};

/// What kind of fault a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The text is not TOML.
    Syntax,
    /// A key that does not exist there.
    UnknownKey,
    /// A key that must be there and is not.
    MissingKey,
    /// A value of the wrong type.
    WrongType,
    /// A value outside its range.
    OutOfRange,
    /// A name that is taken, empty, or refers to nothing.
    Name,
    /// A geometry that cannot be shown.
    Geometry,
}

/// A fault of a wall or scene file. Boxed: errors are rare and should not make results large.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ConfigError(Box<Details>);

/// Everything that a [`ConfigError`] says.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Details {
    fault: Fault,
    origin: Option<String>,
    line: usize,
    column: usize,
    key: String,
    value: String,
    advice: String,
}

impl ConfigError {
    /// What kind of fault it is.
    #[must_use]
    pub fn fault(&self) -> Fault {
        self.0.fault
    }

    /// Line and column of the fault, both from 1; (0, 0) where there is no text.
    #[must_use]
    pub fn position(&self) -> (usize, usize) {
        (self.0.line, self.0.column)
    }

    /// The key in question, for example `hosts[1].outputs[0].size_px`.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.0.key
    }
}

impl fmt::Display for Details {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(origin) = &self.origin {
            formatter.write_str(origin)?;
            if self.line > 0 {
                write!(formatter, ":{}:{}", self.line, self.column)?;
            }
            formatter.write_str(": ")?;
        }
        if !self.key.is_empty() {
            write!(formatter, "{}", self.key)?;
            if !self.value.is_empty() {
                write!(formatter, " = {}", self.value)?;
            }
            formatter.write_str(": ")?;
        }
        formatter.write_str(&self.advice)
    }
}

/// Something wrong with validated values, before it is known where they stand in a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Problem {
    /// What kind of fault it is.
    pub(crate) fault: Fault,
    /// Path of the key, for example `screens[0].corners_m`.
    pub(crate) key: String,
    /// What is wrong and what to write instead.
    pub(crate) advice: String,
}

impl Problem {
    /// A problem of a kind with the value at `key`.
    pub(crate) fn new(fault: Fault, key: impl Into<String>, advice: impl Into<String>) -> Self {
        Self {
            fault,
            key: key.into(),
            advice: advice.into(),
        }
    }

    /// The error for values that came from no file.
    pub(crate) fn without_origin(self) -> ConfigError {
        self.into_error(None)
    }

    /// The error for values that came from somewhere, but from no line of a text.
    pub(crate) fn into_error(self, origin: Option<&str>) -> ConfigError {
        ConfigError(Box::new(Details {
            fault: self.fault,
            origin: origin.map(str::to_owned),
            line: 0,
            column: 0,
            key: self.key,
            value: String::new(),
            advice: self.advice,
        }))
    }
}

/// A TOML text with the places of its values.
pub(crate) struct Document<'i> {
    text: &'i str,
    origin: Option<String>,
    /// Whether lines and columns mean something to whoever wrote the values.
    has_lines: bool,
    root: Spanned<DeTable<'i>>,
}

impl<'i> Document<'i> {
    /// Parses a text. `origin` names it in errors.
    pub(crate) fn parse(text: &'i str, origin: &str) -> Result<Self, ConfigError> {
        Self::new(text, Some(origin), true)
    }

    /// Parses a text that nobody has seen, made by [`toml_of_json`]. Errors name no lines of it.
    pub(crate) fn parse_rewritten(
        text: &'i str,
        origin: Option<&str>,
    ) -> Result<Self, ConfigError> {
        Self::new(text, origin, false)
    }

    fn new(text: &'i str, origin: Option<&str>, has_lines: bool) -> Result<Self, ConfigError> {
        let origin = origin.map(str::to_owned);
        match DeTable::parse(text) {
            Ok(root) => Ok(Self {
                text,
                origin,
                has_lines,
                root,
            }),
            Err(error) => {
                let (line, column) = match has_lines {
                    true => position(text, error.span().unwrap_or(0..0).start),
                    false => (0, 0),
                };
                Err(ConfigError(Box::new(Details {
                    fault: Fault::Syntax,
                    origin,
                    line,
                    column,
                    key: String::new(),
                    value: String::new(),
                    advice: format!("this is not TOML: {}", error.message()),
                })))
            }
        }
    }

    /// The table of the whole text.
    pub(crate) fn root(&self) -> Table<'_, 'i> {
        Table::new(self, self.root.get_ref(), self.root.span(), String::new())
    }

    /// The error for a problem, placed where its key stands, or the nearest table around it.
    pub(crate) fn error_at(&self, problem: Problem) -> ConfigError {
        let span = self.locate(&problem.key);
        self.error(problem.fault, span, problem.key, problem.advice)
    }

    /// An error about the text at `span`.
    fn error(&self, fault: Fault, span: Range<usize>, key: String, advice: String) -> ConfigError {
        let (line, column) = match self.has_lines {
            true => position(self.text, span.start),
            false => (0, 0),
        };
        let value = self.text.get(span).map(shorten).unwrap_or_default();
        // A missing key has no value, and a table header says nothing that the key does not say.
        let value = match fault {
            Fault::MissingKey | Fault::UnknownKey => String::new(),
            _ if is_header(&value, &key) => String::new(),
            _ => value,
        };
        let origin = self.origin.clone();
        ConfigError(Box::new(Details {
            fault,
            origin,
            line,
            column,
            key,
            value,
            advice,
        }))
    }

    /// The span of the value at a path, or of the innermost value around it that exists.
    fn locate(&self, path: &str) -> Range<usize> {
        let mut span = 0..0;
        let mut table = Some(self.root.get_ref());
        for step in path.split('.') {
            let (name, indices) = step.split_once('[').unwrap_or((step, ""));
            let Some(mut value) = table.and_then(|table| table.get(name)) else {
                break;
            };
            span = value.span();
            for index in indices
                .split('[')
                .filter_map(|index| index.trim_end_matches(']').parse().ok())
            {
                let index: usize = index;
                let Some(element) = value.get_ref().get(index) else {
                    return span;
                };
                value = element;
                span = value.span();
            }
            table = value.get_ref().as_table();
        }
        span
    }
}

/// Line and column, both from 1, of a byte offset. Columns count characters.
fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |index| index + 1);
    let line = before.matches('\n').count() + 1;
    (
        line,
        before.get(line_start..).unwrap_or("").chars().count() + 1,
    )
}

/// A value as it stands in the text, on one line and not longer than a terminal's.
fn shorten(text: &str) -> String {
    let line: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= 72 {
        return line;
    }
    line.chars().take(69).chain("...".chars()).collect()
}

/// Whether the text of a value is the header of the table at `key`: `[[hosts.outputs]]` of `hosts[1].outputs[0]`.
fn is_header(text: &str, key: &str) -> bool {
    let steps = key
        .split('.')
        .map(|step| step.split_once('[').map_or(step, |(name, _)| name));
    let name = text.trim_start_matches('[').trim_end_matches(']');
    text.starts_with('[') && steps.eq(name.split('.').map(str::trim))
}

/// A key as it stands in a path: in quotes where it is no bare word, and cut where it is long.
fn key_text(key: &str) -> String {
    let bare = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
    if !key.is_empty() && key.chars().all(bare) {
        shorten(key)
    } else {
        shorten(&quoted(key))
    }
}

/// A text in quotes, as TOML writes it.
fn quoted(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            _ if letter.is_control() => quoted.push_str(&format!("\\u{:04X}", u32::from(letter))),
            _ => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

/// What a value is, for messages.
fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
