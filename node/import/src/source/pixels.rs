//! From the numbers of a file to the samples of a layer: which bands, what they mean, which of them hold data.
//! In: raw bands with what the file says about them. Out: one channel of heights or amplitudes, or three of colour,
//! with validity. What would come out wrong is refused when the source is opened, with the remedy.

use tiles::Kind;

use crate::error::SourceError;
use crate::options::ImportOptions;

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

/// How the bands of one source become channels.
pub(crate) struct Reading {
    kind: Kind,
    count: usize,
    number: Number,
    chosen: Vec<usize>,
    colour: Colour,
    alpha: Option<usize>,
    nodata: Option<f64>,
    range: Option<[f64; 2]>,
}

/// Numbers beyond this are no heights of a planet, not even in millimetres, but fill values.
const HIGHEST_SENSIBLE: f64 = 1.0e9;

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

impl Reading {
    /// Decides how `bands` of `file` become a layer of the wanted kind, or why they do not.
    pub(crate) fn choose(
        file: &str,
        bands: Bands,
        options: &ImportOptions,
    ) -> Result<Self, SourceError> {
        let refuse =
            |problem: String, remedy: &str| Err(SourceError::refused(file, problem, remedy));
        let Bands {
            count,
            number,
            colour,
            alpha,
            nodata,
        } = bands;
        let nodata = options.nodata.or(nodata);
        let data_bands = count - usize::from(alpha.is_some());
        let mut chosen = Vec::new();
        for band in options.bands.as_deref().unwrap_or(&[]) {
            if *band == 0 || *band > count {
                return refuse(
                    format!("band {band} was asked for, but it has bands 1 to {count}"),
                    "Correct --bands.",
                );
            }
            chosen.push(band - 1);
        }
        let wide_colour = matches!(colour, Colour::Rgb | Colour::YCbCr);
        match options.kind {
            Kind::Imagery => {
                if !matches!(number, Number::Bits(_)) && options.range.is_none() {
                    return refuse(
                        format!(
                            "it holds {number} samples, and imagery is unsigned 8 bits a channel"
                        ),
                        "Say with --range LOW,HIGH which samples to show as black and as white.",
                    );
                }
                if chosen.is_empty() {
                    chosen = match (&colour, data_bands) {
                        (Colour::Rgb | Colour::YCbCr, _) => vec![0, 1, 2],
                        (_, 1) => vec![0],
                        _ => {
                            return refuse(
                                format!(
                                    "it has {data_bands} bands and does not say which are red, green and blue"
                                ),
                                "Name them, for example with --bands 3,2,1, or one band for grey.",
                            );
                        }
                    };
                }
                let in_order = chosen == [0, 1, 2];
                if (colour == Colour::YCbCr && !in_order) || !matches!(chosen.len(), 1 | 3) {
                    return refuse(
                        format!("{} bands were asked for", chosen.len()),
                        "Name one band for grey or three for colour; a YCbCr image takes 1,2,3 only.",
                    );
                }
            }
            Kind::Elevation | Kind::Sar => {
                if matches!(colour, Colour::Palette(_) | Colour::YCbCr) {
                    return refuse(
                        format!("its samples are colours, not {}", options.kind),
                        "Import it with --kind imagery.",
                    );
                }
                if chosen.is_empty() && data_bands == 1 && !wide_colour {
                    chosen.push(0);
                }
                if chosen.len() != 1 {
                    return refuse(
                        format!("it has {data_bands} bands, and {} needs one", options.kind),
                        "Name the band with --bands N.",
                    );
                }
                let fits = matches!(
                    number,
                    Number::Bits(_) | Number::U16 | Number::F32 | Number::F64
                );
                if options.kind == Kind::Sar && !fits {
                    return refuse(
                        format!(
                            "it holds {number} samples, and SAR is unsigned 8 or 16 bits or floating point"
                        ),
                        "Convert it first, for example with gdal_translate -ot Float32.",
                    );
                }
            }
        }
        let Bands { colour, alpha, .. } = Bands {
            count,
            number,
            colour,
            alpha,
            nodata,
        };
        let (kind, range) = (options.kind, options.range);
        Ok(Self {
            kind,
            count,
            number,
            chosen,
            colour,
            alpha,
            nodata,
            range,
        })
    }

    /// Channels a pixel.
    pub(crate) const fn channels(&self) -> usize {
        match self.kind {
            Kind::Imagery => 3,
            Kind::Elevation | Kind::Sar => 1,
        }
    }

    /// The number type of the file.
    pub(crate) const fn number(&self) -> Number {
        self.number
    }

    /// Bands a pixel in the file.
    pub(crate) const fn band_count(&self) -> usize {
        self.count
    }

    /// The bands that are looked at, for files that keep each band apart.
    pub(crate) fn needs(&self, band: usize) -> bool {
        self.chosen.contains(&band) || self.alpha == Some(band)
    }

    /// Bytes of one pixel once read, at most.
    pub(crate) const fn bytes_a_pixel(&self) -> usize {
        match self.kind {
            Kind::Imagery => 4,
            Kind::Elevation | Kind::Sar => self.number.bytes() * 2 + 1,
        }
    }

    /// One chunk. `mask` is the file's own answer to which pixels hold data.
    pub(crate) fn pixels(
        &self,
        width: u32,
        height: u32,
        raw: RawSamples,
        mask: Option<Vec<bool>>,
    ) -> Pixels {
        let pixel_count = width as usize * height as usize;
        let mut valid = mask.unwrap_or_else(|| vec![true; pixel_count]);
        let samples = match self.kind {
            Kind::Imagery => Samples::U8(self.colours(raw, &mut valid)),
            Kind::Elevation | Kind::Sar => match raw {
                RawSamples::U8(v) if self.kind == Kind::Sar => {
                    Samples::U8(self.one(&v, &mut valid))
                }
                RawSamples::U8(v) => Samples::I16(widened(&self.one(&v, &mut valid))),
                RawSamples::I8(v) => Samples::I16(widened(&self.one(&v, &mut valid))),
                RawSamples::U16(v) => Samples::U16(self.one(&v, &mut valid)),
                RawSamples::I16(v) => Samples::I16(self.one(&v, &mut valid)),
                RawSamples::U32(v) => Samples::F64(widened(&self.one(&v, &mut valid))),
                RawSamples::I32(v) => Samples::F64(widened(&self.one(&v, &mut valid))),
                RawSamples::F32(v) => Samples::F32(self.one(&v, &mut valid)),
                RawSamples::F64(v) => Samples::F64(self.one(&v, &mut valid)),
            },
        };
        let valid = if valid.iter().all(|v| *v) {
            None
        } else {
            Some(valid)
        };
        Pixels {
            width,
            height,
            samples,
            valid,
        }
    }

    /// The chosen band alone.
    fn one<T: Copy + Default + Into<f64>>(&self, raw: &[T], valid: &mut [bool]) -> Vec<T> {
        let band = self.chosen.first().copied().unwrap_or(0);
        let limit = if self.kind == Kind::Elevation {
            HIGHEST_SENSIBLE
        } else {
            f64::MAX
        };
        let nodata = self.stored_nodata();
        let mut values = Vec::with_capacity(valid.len());
        for (pixel, valid) in raw.chunks_exact(self.count).zip(valid.iter_mut()) {
            let value = pixel.get(band).copied().unwrap_or_default();
            let number: f64 = value.into();
            // NaN fails the comparison with the limit.
            let holds = number.abs() <= limit && nodata != Some(number);
            *valid &= holds && self.alpha_of(pixel).is_none_or(|alpha| alpha > 0.0);
            values.push(if holds { value } else { T::default() });
        }
        values
    }

    fn alpha_of<T: Copy + Into<f64>>(&self, pixel: &[T]) -> Option<f64> {
        pixel.get(self.alpha?).map(|value| (*value).into())
    }

    /// The fill value as a sample of the file would hold it: a 32-bit sample rounds it.
    fn stored_nodata(&self) -> Option<f64> {
        match self.number {
            Number::F32 => self.nodata.map(|value| f64::from(value as f32)),
            _ => self.nodata,
        }
    }

    fn colours(&self, raw: RawSamples, valid: &mut [bool]) -> Vec<u8> {
        match raw {
            RawSamples::U8(bytes) => {
                let untouched = self.count == 3
                    && self.chosen == [0, 1, 2]
                    && self.colour == Colour::Rgb
                    && self.nodata.is_none()
                    && self.range.is_none();
                if untouched {
                    bytes
                } else {
                    self.paint(&bytes, valid)
                }
            }
            RawSamples::I8(v) => self.paint(&v, valid),
            RawSamples::U16(v) => self.paint(&v, valid),
            RawSamples::I16(v) => self.paint(&v, valid),
            RawSamples::U32(v) => self.paint(&v, valid),
            RawSamples::I32(v) => self.paint(&v, valid),
            RawSamples::F32(v) => self.paint(&v, valid),
            RawSamples::F64(v) => self.paint(&v, valid),
        }
    }

    fn paint<T: Copy + Into<f64>>(&self, raw: &[T], valid: &mut [bool]) -> Vec<u8> {
        let most = match self.number {
            Number::Bits(bits) => f64::from((1_u32 << bits) - 1),
            _ => 255.0,
        };
        let nodata = self.stored_nodata();
        let mut colours = Vec::with_capacity(valid.len() * 3);
        for (pixel, valid) in raw.chunks_exact(self.count).zip(valid.iter_mut()) {
            let band = |index: usize| {
                let band = self.chosen.get(index).or_else(|| self.chosen.first());
                band.and_then(|band| pixel.get(*band))
                    .map_or(0.0, |value| (*value).into())
            };
            let numbers = [band(0), band(1), band(2)];
            // A pixel is empty where every band holds the fill value.
            let empty = nodata.is_some_and(|fill| numbers.iter().all(|number| *number == fill));
            let opaque = self.alpha_of(pixel).is_none_or(|alpha| alpha > 0.0);
            *valid &= opaque && !empty && numbers.iter().all(|number| !number.is_nan());
            let colour = match &self.colour {
                Colour::Palette(table) => {
                    let entry = table.get(numbers[0] as usize).copied();
                    *valid &= entry.is_some();
                    entry.unwrap_or_default()
                }
                Colour::YCbCr => rgb_of_ycbcr(numbers),
                Colour::WhiteIsZero => numbers.map(|n| self.byte(most - n, most)),
                Colour::Plain | Colour::Rgb => numbers.map(|n| self.byte(n, most)),
            };
            colours.extend_from_slice(&colour);
        }
        colours
    }

    fn byte(&self, number: f64, most: f64) -> u8 {
        let scaled = match self.range {
            Some([low, high]) => 255.0 * (number - low) / (high - low),
            None => 255.0 * number / most,
        };
        // `as` clamps to 0…255 and turns NaN into 0.
        scaled.round() as u8
    }
}

fn widened<A: Copy + Into<B>, B>(values: &[A]) -> Vec<B> {
    values.iter().map(|value| (*value).into()).collect()
}

/// JFIF (ITU-T T.871, section 7): full-range YCbCr by the weights of BT.601.
fn rgb_of_ycbcr([y, cb, cr]: [f64; 3]) -> [u8; 3] {
    let (cb, cr) = (cb - 128.0, cr - 128.0);
    [
        y + 1.402 * cr,
        y - 0.344_136 * cb - 0.714_136 * cr,
        y + 1.772 * cb,
    ]
    .map(|v| v.round() as u8)
}
