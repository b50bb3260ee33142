//! Which nodes of a tile hold data.
//! In: a question for each node, or a mask. Out: answers by node.

use super::NODE_COUNT;

/// 64-bit words in a validity mask.
pub const MASK_WORDS: usize = NODE_COUNT.div_ceil(64);

/// Which nodes of a tile hold data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Validity {
    /// Every one, border included.
    All,
    /// Bit (j+9)·275 + (i+9), counted from the lowest bit of the first word, is 1 where node (i, j) holds
    /// data. 1182 words; the bits beyond the last node are 0.
    Mask(Box<[u64]>),
}

impl Validity {
    /// From a question asked for each node in the order of the array. [`Validity::All`] where every
    /// answer is yes.
    pub fn from_nodes(mut valid: impl FnMut(usize) -> bool) -> Self {
        let mut words = vec![0_u64; MASK_WORDS].into_boxed_slice();
        for (w, word) in words.iter_mut().enumerate() {
            let first = w * 64;
            for bit in 0..(NODE_COUNT - first).min(64) {
                *word |= u64::from(valid(first + bit)) << bit;
            }
        }
        Self::Mask(words).simplified()
    }

    /// Whether a node holds data, by its place in the array ([`TileData::index`]); false beyond the end.
    #[must_use]
    pub fn is_valid(&self, node: usize) -> bool {
        match self {
            Self::All => node < NODE_COUNT,
            Self::Mask(words) => words
                .get(node / 64)
                .is_some_and(|word| word >> (node % 64) & 1 == 1),
        }
    }

    /// How many nodes hold data, 0…275².
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::All => NODE_COUNT,
            Self::Mask(words) => words.iter().map(|word| word.count_ones() as usize).sum(),
        }
    }

    /// [`Validity::All`] in place of a mask with every bit set, so that equal sets compare equal.
    #[must_use]
    pub fn simplified(self) -> Self {
        if self.count() == NODE_COUNT {
            Self::All
        } else {
            self
        }
    }

    /// True for a mask of the right length without a bit beyond the last node.
    pub(super) fn is_well_formed(&self) -> bool {
        match self {
            Self::All => true,
            Self::Mask(words) => {
                let spare = words.last().map_or(0, |word| word >> (NODE_COUNT % 64));
                words.len() == MASK_WORDS && spare == 0
            }
        }
    }
}
