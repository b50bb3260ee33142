//! The numbers of a source before and after they are read: as its file holds them, and as layers are made from them.
//! In: decoded numbers with what the file says about its bands. Out: the types that carry them. It decides nothing;
//! `reading` does.

/// Raw numbers of one chunk, bands interleaved by pixel.
pub(crate) enum RawSamples {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl RawSamples {
    /// The first `samples` of each row of `row_samples`, of the first `rows` rows.
    pub(crate) fn cut(self, row_samples: usize, samples: usize, rows: usize) -> Self {
        fn each<T: Copy>(
            mut values: Vec<T>,
            row_samples: usize,
            samples: usize,
            rows: usize,
        ) -> Vec<T> {
            if samples < row_samples {
                for row in 1..rows {
                    let start = row * row_samples;
                    if start + samples <= values.len() {
                        values.copy_within(start..start + samples, row * samples);
                    }
                }
            }
            values.truncate(samples * rows);
            values
        }
        match self {
            Self::U8(v) => Self::U8(each(v, row_samples, samples, rows)),
            Self::I8(v) => Self::I8(each(v, row_samples, samples, rows)),
            Self::U16(v) => Self::U16(each(v, row_samples, samples, rows)),
            Self::I16(v) => Self::I16(each(v, row_samples, samples, rows)),
            Self::U32(v) => Self::U32(each(v, row_samples, samples, rows)),
            Self::I32(v) => Self::I32(each(v, row_samples, samples, rows)),
            Self::F32(v) => Self::F32(each(v, row_samples, samples, rows)),
            Self::F64(v) => Self::F64(each(v, row_samples, samples, rows)),
        }
    }
}

/// The number type of a file's samples, without their storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    /// Unsigned integers of so many bits, 1…8, kept as bytes.
    Bits(u8),
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
    F64,
}

/// What the bands of a file show.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Colour {
    /// Numbers or greys, low is dark.
    Plain,
    /// Greys, low is bright.
    WhiteIsZero,
    /// Red, green, blue in the first three bands.
    Rgb,
    /// Luma and two chroma bands, as JPEG keeps them.
    YCbCr,
    /// Indices into a colour table.
    Palette(Vec<[u8; 3]>),
}

/// What a file says about its bands.
#[derive(Clone, Debug)]
pub(crate) struct Bands {
    pub(crate) count: usize,
    pub(crate) number: Number,
    pub(crate) colour: Colour,
    /// The band that is 0 where there is no data. Colours that were multiplied by it are kept as they are stored.
    pub(crate) alpha: Option<usize>,
    pub(crate) nodata: Option<f64>,
}

/// Samples of one chunk as the layer wants them, rows from the first, channels interleaved.
pub(crate) struct Pixels {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) samples: Samples,
    /// One answer a pixel; `None` where all hold data.
    pub(crate) valid: Option<Vec<bool>>,
}

/// The number types that layers are made from.
pub(crate) enum Samples {
    U8(Vec<u8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Number {
    /// Bytes of one sample in memory.
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Bits(_) | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// True for whole numbers.
    pub(crate) const fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl std::fmt::Display for Number {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = match self {
            Self::Bits(bits) => return write!(formatter, "unsigned {bits}-bit"),
            Self::I8 => "signed 8-bit",
            Self::U16 => "unsigned 16-bit",
            Self::I16 => "signed 16-bit",
            Self::U32 => "unsigned 32-bit",
            Self::I32 => "signed 32-bit",
            Self::F32 => "32-bit floating-point",
            Self::F64 => "64-bit floating-point",
        };
        formatter.write_str(name)
    }
}
