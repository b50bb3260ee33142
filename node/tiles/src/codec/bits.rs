//! Bit strings: numbers of a few bits each, one after the other, lowest bit first.
//! In: numbers and widths. Out: bytes, and the numbers again. Reading beyond the end gives zeros and is
//! remembered, so that a broken string is an error and never a panic.

/// Collects bits.
#[derive(Default)]
pub(super) struct BitWriter {
    bytes: Vec<u8>,
    pending: u64,
    filled: u32,
}

impl BitWriter {
    /// Appends the low `width` bits of `value`, 0…32; bits above must be 0.
    #[inline]
    pub(super) fn push(&mut self, value: u32, width: u32) {
        self.pending |= u64::from(value) << self.filled;
        self.filled += width;
        if self.filled >= 32 {
            self.bytes
                .extend_from_slice(&(self.pending as u32).to_le_bytes());
            self.pending >>= 32;
            self.filled -= 32;
        }
    }

    /// The bytes; the last one is filled up with zeros.
    pub(super) fn finish(mut self) -> Vec<u8> {
        let rest = self.filled.div_ceil(8) as usize;
        self.bytes
            .extend_from_slice(&self.pending.to_le_bytes()[..rest]);
        self.bytes
    }
}

/// Hands bits out again.
pub(super) struct BitReader<'a> {
    words: std::slice::Iter<'a, [u8; 4]>,
    tail: &'a [u8],
    pending: u64,
    filled: u32,
    overrun: bool,
}

impl<'a> BitReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        let (words, tail) = bytes.as_chunks::<4>();
        Self {
            words: words.iter(),
            tail,
            pending: 0,
            filled: 0,
            overrun: false,
        }
    }

    /// The next `width` bits, 0…32.
    #[inline]
    pub(super) fn pull(&mut self, width: u32) -> u32 {
        if self.filled < width {
            self.refill();
        }
        let value = self.pending & ((1_u64 << width) - 1);
        self.pending >>= width;
        self.filled -= width;
        value as u32
    }

    fn refill(&mut self) {
        let word = if let Some(word) = self.words.next() {
            u32::from_le_bytes(*word)
        } else if self.tail.is_empty() {
            self.overrun = true;
            0
        } else {
            let mut word = [0; 4];
            for (place, byte) in word.iter_mut().zip(self.tail) {
                *place = *byte;
            }
            self.tail = &[];
            u32::from_le_bytes(word)
        };
        self.pending |= u64::from(word) << self.filled;
        self.filled += 32;
    }

    /// True where every byte was used and none was missing.
    pub(super) fn is_exhausted(&self) -> bool {
        !self.overrun && self.tail.is_empty() && self.words.len() == 0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_come_back(numbers in prop::collection::vec((any::<u32>(), 0_u32..=32), 0..200)) {
            let trimmed = |value: u32, width: u32| (u64::from(value) & ((1 << width) - 1)) as u32;
            let mut writer = BitWriter::default();
            for (value, width) in &numbers {
                writer.push(trimmed(*value, *width), *width);
            }
            let bytes = writer.finish();
            let mut reader = BitReader::new(&bytes);
            for (value, width) in &numbers {
                prop_assert_eq!(reader.pull(*width), trimmed(*value, *width));
            }
            prop_assert!(reader.is_exhausted());
        }
    }

    #[test]
    fn reading_beyond_the_end_is_noticed() {
        let mut reader = BitReader::new(&[0xff]);
        assert_eq!(reader.pull(8), 0xff);
        assert!(reader.is_exhausted());
        reader.pull(32);
        assert!(!reader.is_exhausted());
    }
}
