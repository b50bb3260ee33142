//! One line of a DTrack packet, read from left to right. In: its text. Out: numbers and blocks `[…]`, or what is
//! wrong and where. It knows nothing of what the numbers mean.

use super::PacketError;

/// What is left of a line.
pub(super) struct Line<'a> {
    number: usize,
    pub(super) identifier: &'a str,
    rest: &'a str,
}

impl<'a> Line<'a> {
    /// Line `number`, counted from 1.
    pub(super) fn new(number: usize, text: &'a str) -> Self {
        let text = text.trim();
        let (identifier, rest) = text.split_once([' ', '\t']).unwrap_or((text, ""));
        Self {
            number,
            identifier,
            rest,
        }
    }

    /// The next number outside of blocks.
    pub(super) fn number(&mut self) -> Result<f64, PacketError> {
        let rest = self.rest.trim_start();
        let end = rest
            .find(|letter: char| letter.is_whitespace() || letter == '[')
            .unwrap_or(rest.len());
        let (text, rest) = rest.split_at(end);
        self.rest = rest;
        self.read(text)
    }

    /// The next number outside of blocks, 0, 1, 2, …
    pub(super) fn whole(&mut self) -> Result<u32, PacketError> {
        let number = self.number()?;
        self.as_whole(number)
    }

    /// The next number outside of blocks, which counts something.
    pub(super) fn count(&mut self, most: usize) -> Result<usize, PacketError> {
        let number = self.number()?;
        self.as_count(number, most)
    }

    /// The next block, of exactly `N` numbers.
    pub(super) fn block<const N: usize>(&mut self) -> Result<[f64; N], PacketError> {
        self.block_of(N)?.try_into().map_err(|_| self.bad_block(N))
    }

    /// The next block, of exactly `wanted` numbers.
    pub(super) fn block_of(&mut self, wanted: usize) -> Result<Vec<f64>, PacketError> {
        let inner = self
            .rest
            .trim_start()
            .strip_prefix('[')
            .and_then(|rest| rest.split_once(']'));
        let Some((inner, rest)) = inner else {
            return Err(self.bad_block(wanted));
        };
        let mut numbers = Vec::with_capacity(wanted);
        for text in inner.split_ascii_whitespace() {
            if numbers.len() == wanted {
                return Err(self.bad_block(wanted));
            }
            numbers.push(self.read(text)?);
        }
        if numbers.len() < wanted {
            return Err(self.bad_block(wanted));
        }
        self.rest = rest;
        Ok(numbers)
    }

    /// Nothing may be left.
    pub(super) fn end(&self) -> Result<(), PacketError> {
        if self.rest.trim().is_empty() {
            return Ok(());
        }
        Err(PacketError::Surplus {
            line: self.number,
            identifier: self.short_identifier(),
        })
    }

    pub(super) fn as_whole(&self, number: f64) -> Result<u32, PacketError> {
        if number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number) {
            Ok(number as u32)
        } else {
            Err(self.bad_number(&number.to_string()))
        }
    }

    pub(super) fn as_count(&self, number: f64, most: usize) -> Result<usize, PacketError> {
        let count = self.as_whole(number)?;
        match usize::try_from(count) {
            Ok(fits) if fits <= most => Ok(fits),
            _ => Err(PacketError::TooMany {
                line: self.number,
                identifier: self.short_identifier(),
                count,
                most,
            }),
        }
    }

    /// 32 buttons; the highest may make the number negative.
    pub(super) fn as_bits(&self, number: f64) -> Result<u32, PacketError> {
        if number < 0.0 && number.fract() == 0.0 && number >= f64::from(i32::MIN) {
            return Ok((number as i32).cast_unsigned());
        }
        self.as_whole(number)
    }

    fn read(&self, text: &str) -> Result<f64, PacketError> {
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(self.bad_number(text)),
        }
    }

    fn bad_number(&self, text: &str) -> PacketError {
        PacketError::BadNumber {
            line: self.number,
            identifier: self.short_identifier(),
            text: text.chars().take(40).collect(),
        }
    }

    fn bad_block(&self, wanted: usize) -> PacketError {
        PacketError::BadBlock {
            line: self.number,
            identifier: self.short_identifier(),
            wanted,
        }
    }

    fn short_identifier(&self) -> String {
        self.identifier.chars().take(40).collect()
    }
}
