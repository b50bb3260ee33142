//! Lines and numbers of text formats.
//! In: bytes. Out: words with their line numbers, and numbers in range, or an error that names line and word.
//! It knows no format.

use std::borrow::Cow;

use crate::ReadError;

/// Largest magnitude of a coordinate in a text file. Beyond it, arithmetic on areas is no longer exact.
const LARGEST: f64 = 1e9;

/// The lines of a text, from 1, without blanks around them. Bytes that are no UTF-8 are kept readable.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (u32, Cow<'_, str>)> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    bytes
        .split(|byte| *byte == b'\n')
        .enumerate()
        .map(|(index, line)| {
            let number = u32::try_from(index).unwrap_or(u32::MAX).saturating_add(1);
            (number, String::from_utf8_lossy(line.trim_ascii()))
        })
}

/// Where a number stands.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    /// The file.
    pub(crate) file: &'a str,
    /// The line, from 1.
    pub(crate) number: u32,
}

impl Line<'_> {
    /// What is wrong with a word of this line.
    pub(crate) fn refuse(&self, key: &str, value: &str, wanted: &str) -> ReadError {
        const LONGEST: usize = 60;
        ReadError::BadValue {
            file: self.file.to_owned(),
            line: self.number,
            key: key.to_owned(),
            value: value.chars().take(LONGEST).collect(),
            wanted: wanted.to_owned(),
        }
    }

    /// A finite number.
    pub(crate) fn number(&self, key: &str, word: Option<&str>) -> Result<f64, ReadError> {
        let word = word.unwrap_or("").trim();
        word.parse()
            .ok()
            .filter(|value: &f64| value.abs() <= LARGEST)
            .ok_or_else(|| self.refuse(key, word, "a number between −1e9 and 1e9"))
    }

    /// A whole number.
    pub(crate) fn whole(&self, key: &str, word: Option<&str>) -> Result<u32, ReadError> {
        let word = word.unwrap_or("").trim();
        word.parse()
            .map_err(|_| self.refuse(key, word, "a whole number"))
    }
}
