//! What a tile is: its samples on the lattice, which of them hold data, and figures over them.
//!
//! In: samples with validity. Out: a [`TileData`], and by [`file`] the bytes of its file. It must not know where
//! tiles are kept.

mod file;
mod statistics;
mod validity;

use geodesy::{BORDER, CELLS, STORED_NODES, Tile};
use serde::{Deserialize, Serialize};

use crate::codec::clear_invalid;

pub use file::{DecodeError, EncodeError, FORMAT_VERSION};
pub use statistics::Statistics;
pub use validity::{MASK_WORDS, Validity};

/// The most channels a tile may have.
pub const MAX_CHANNELS: u8 = 16;
/// Nodes in the stored array, border included: 275².
pub const NODE_COUNT: usize = STORED_NODES * STORED_NODES;

/// What the samples of a data set mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Heights in quanta above the ellipsoid, one channel of i32.
    Elevation,
    /// Pictures: any number of channels of u8, u16 or f32.
    Imagery,
    /// Radar amplitude or backscatter: u8, u16 or f32.
    Sar,
}

/// The number type of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleType {
    /// Signed 32-bit integers: elevation quanta.
    I32,
    /// Unsigned bytes.
    U8,
    /// Unsigned 16-bit integers.
    U16,
    /// 32-bit floating point; every valid sample is finite.
    F32,
}

/// The samples of a tile: 275 × 275 × channels numbers, rows along v (j) outside, along u (i) inside,
/// channels interleaved.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Elevation quanta.
    I32(Vec<i32>),
    /// Bytes.
    U8(Vec<u8>),
    /// 16-bit samples.
    U16(Vec<u16>),
    /// Floating-point samples.
    F32(Vec<f32>),
}

/// One decoded tile.
#[derive(Clone, Debug, PartialEq)]
pub struct TileData {
    /// Where it lies.
    pub tile: Tile,
    /// What it means.
    pub kind: Kind,
    /// Channels a node, 1…16.
    pub channels: u8,
    /// The samples; 0 at invalid nodes.
    pub samples: Samples,
    /// Which nodes hold data.
    pub validity: Validity,
    /// Figures over the samples.
    pub statistics: Statistics,
}

impl SampleType {
    /// Bytes of one sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::I32 | Self::F32 => 4,
        }
    }

    const fn code(self) -> u8 {
        match self {
            Self::I32 => 0,
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 3,
        }
    }

    const fn of_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::I32),
            1 => Some(Self::U8),
            2 => Some(Self::U16),
            3 => Some(Self::F32),
            _ => None,
        }
    }
}

impl Kind {
    const fn code(self) -> u8 {
        match self {
            Self::Elevation => 0,
            Self::Imagery => 1,
            Self::Sar => 2,
        }
    }

    const fn of_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Elevation),
            1 => Some(Self::Imagery),
            2 => Some(Self::Sar),
            _ => None,
        }
    }

    /// Whether tiles of this kind may hold these samples: elevation is one channel of i32, the others
    /// are anything else.
    #[must_use]
    pub const fn takes(self, sample_type: SampleType, channels: u8) -> bool {
        let integer = matches!(sample_type, SampleType::I32);
        match self {
            Self::Elevation => integer && channels == 1,
            Self::Imagery | Self::Sar => !integer && channels >= 1 && channels <= MAX_CHANNELS,
        }
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Elevation => "elevation",
            Self::Imagery => "imagery",
            Self::Sar => "sar",
        })
    }
}

impl Samples {
    /// The number type.
    #[must_use]
    pub const fn sample_type(&self) -> SampleType {
        match self {
            Self::I32(_) => SampleType::I32,
            Self::U8(_) => SampleType::U8,
            Self::U16(_) => SampleType::U16,
            Self::F32(_) => SampleType::F32,
        }
    }

    /// How many numbers, all channels counted.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self {
            Self::I32(values) => values.len(),
            Self::U8(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::F32(values) => values.len(),
        }
    }

    /// True without any number.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number at a place of the array; `None` beyond its end.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<f64> {
        match self {
            Self::I32(values) => values.get(index).map(|v| f64::from(*v)),
            Self::U8(values) => values.get(index).map(|v| f64::from(*v)),
            Self::U16(values) => values.get(index).map(|v| f64::from(*v)),
            Self::F32(values) => values.get(index).map(|v| f64::from(*v)),
        }
    }
}

impl TileData {
    /// A tile from its samples; computes the statistics, sets invalid samples to 0 and simplifies the
    /// validity. Fails where array length, mask, kind and sample type do not fit, and for f32 samples that
    /// are not finite although valid.
    pub fn new(
        tile: Tile,
        kind: Kind,
        channels: u8,
        mut samples: Samples,
        validity: Validity,
    ) -> Result<Self, EncodeError> {
        file::check(tile, kind, channels, &samples, &validity)?;
        let validity = validity.simplified();
        match &mut samples {
            Samples::I32(values) => clear_invalid(values, channels, &validity),
            Samples::U8(values) => clear_invalid(values, channels, &validity),
            Samples::U16(values) => clear_invalid(values, channels, &validity),
            Samples::F32(values) => {
                clear_invalid(values, channels, &validity);
                if values.iter().any(|value| !value.is_finite()) {
                    let problem = "a valid sample is not a finite number".to_owned();
                    return Err(EncodeError::Inconsistent { tile, problem });
                }
            }
        }
        let statistics = Statistics::of(&samples, channels, &validity);
        Ok(Self {
            tile,
            kind,
            channels,
            samples,
            validity,
            statistics,
        })
    }

    /// The place of node (i, j), both −9…265, in the stored array, counted in nodes: multiply by the
    /// channels to find its first sample. Nodes further out count as the nearest stored one.
    #[must_use]
    pub fn index(i: i64, j: i64) -> usize {
        let clamp = |k: i64| (k.clamp(-BORDER, CELLS + BORDER) + BORDER) as usize;
        clamp(j) * STORED_NODES + clamp(i)
    }

    /// Whether node (i, j) is stored and holds data.
    #[must_use]
    pub fn is_valid(&self, i: i64, j: i64) -> bool {
        let stored = -BORDER..=CELLS + BORDER;
        stored.contains(&i) && stored.contains(&j) && self.validity.is_valid(Self::index(i, j))
    }

    /// The height of node (i, j) in quanta; `None` where it is invalid or not stored, or where the tile is
    /// not elevation.
    #[must_use]
    pub fn height(&self, i: i64, j: i64) -> Option<i32> {
        let heights = self.heights()?;
        if self.is_valid(i, j) {
            heights.get(Self::index(i, j)).copied()
        } else {
            None
        }
    }

    /// All heights in quanta, 275² of them, 0 at invalid nodes; `None` where the tile is not elevation.
    #[must_use]
    pub fn heights(&self) -> Option<&[i32]> {
        match &self.samples {
            Samples::I32(heights) => Some(heights),
            _ => None,
        }
    }

    /// The sample of a channel at node (i, j) in sample units; `None` where it is invalid or absent.
    #[must_use]
    pub fn value(&self, i: i64, j: i64, channel: u8) -> Option<f64> {
        if channel >= self.channels || !self.is_valid(i, j) {
            return None;
        }
        self.samples
            .get(Self::index(i, j) * usize::from(self.channels) + usize::from(channel))
    }

    /// Bytes that a tile without holes takes in memory.
    #[must_use]
    pub const fn full_size(sample_type: SampleType, channels: u8) -> usize {
        size_of::<Self>() + NODE_COUNT * channels as usize * sample_type.bytes()
    }

    /// Bytes that this tile takes in memory.
    #[must_use]
    pub fn byte_size(&self) -> usize {
        let mask = match &self.validity {
            Validity::All => 0,
            Validity::Mask(words) => words.len() * 8,
        };
        Self::full_size(self.samples.sample_type(), self.channels) + mask
    }
}
