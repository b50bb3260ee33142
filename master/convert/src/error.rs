//! Why a text cannot be converted.
//! In: what a reader found and where. Out: an error that names file, place, what was expected and what was found.

use crate::{Lost, MAX_TEXT_BYTES};

/// Why a configuration was not converted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConvertError {
    /// The text is not of the format.
    #[error("{origin}, line {line}, column {column}: expected {expected}, found {found}")]
    Syntax {
        /// The text's name.
        origin: String,
        /// From 1.
        line: usize,
        /// From 1, in characters.
        column: usize,
        /// What may stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A value has the wrong type or leaves its range.
    #[error("{origin}, {place}: expected {expected}, found {found}")]
    Value {
        /// The text's name.
        origin: String,
        /// Line and path of the value.
        place: String,
        /// What may stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The text is longer than [`MAX_TEXT_BYTES`].
    #[error(
        "{origin}: {bytes} bytes are too many for a wall configuration, at most {MAX_TEXT_BYTES} are read; is it the right file?"
    )]
    TooLong {
        /// The text's name.
        origin: String,
        /// Its length.
        bytes: usize,
    },
    /// There is more of something than a wall file may have.
    #[error(
        "{origin}: there are more than {most} {what}; split the configuration into several walls"
    )]
    TooMany {
        /// The text's name.
        origin: String,
        /// Of what, in the plural.
        what: &'static str,
        /// How many there may be.
        most: usize,
    },
    /// No picture of the source can be carried over.
    #[error("{origin}: no window of it can be carried over{}", last_of(.lost))]
    NothingLeft {
        /// The text's name.
        origin: String,
        /// Why.
        lost: Vec<Lost>,
    },
}

/// The end of a sentence that tells the last reason for which nothing is left, and how many there are.
fn last_of(lost: &[Lost]) -> String {
    match lost.last() {
        Some(last) => format!("; the last of {} reasons: {last}", lost.len()),
        None => String::new(),
    }
}

/// A [`ConvertError`] of a reader that does not know the text's name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Trouble {
    Syntax {
        line: usize,
        column: usize,
        expected: String,
        found: String,
    },
    Value {
        place: String,
        expected: String,
        found: String,
    },
    TooMany {
        what: &'static str,
        most: usize,
    },
}

impl Trouble {
    /// The error with the text's name.
    pub(crate) fn at_origin(self, origin: &str) -> ConvertError {
        let origin = origin.to_owned();
        match self {
            Self::Syntax {
                line,
                column,
                expected,
                found,
            } => ConvertError::Syntax {
                origin,
                line,
                column,
                expected,
                found,
            },
            Self::Value {
                place,
                expected,
                found,
            } => ConvertError::Value {
                origin,
                place,
                expected,
                found,
            },
            Self::TooMany { what, most } => ConvertError::TooMany { origin, what, most },
        }
    }
}

/// A piece of the source for an error message: quoted, without control characters, not longer than a line.
pub(crate) fn shown(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut clean: String = text
        .chars()
        .take(LONGEST)
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        clean.push('…');
    }
    format!("\"{clean}\"")
}
