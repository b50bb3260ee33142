//! Samples of a layer from the raw numbers of one chunk, pixel by pixel.
//! In: numbers as the file holds them, bands interleaved, and what was decided about them. Out: samples of the chosen
//! bands, and which pixels hold data. Raw forms change no number; only colours are computed. It decides nothing.

use super::pixels::{Colour, Number, RawSamples, Samples};
use super::reading::Form;

/// What [`super::reading::Reading`] decided, for one chunk.
pub(super) struct Converter<'reading> {
    pub(super) form: Form,
    /// Bands a pixel in the file.
    pub(super) count: usize,
    pub(super) number: Number,
    /// Bands that are wanted, counted from 0.
    pub(super) chosen: &'reading [usize],
    pub(super) colour: &'reading Colour,
    pub(super) alpha: Option<usize>,
    /// The fill value as the file holds it.
    pub(super) nodata: Option<f64>,
    /// Samples that become 0 and 255.
    pub(super) range: Option<[f64; 2]>,
}

/// Numbers beyond this are no heights of a planet, not even in millimetres, but fill values.
const HIGHEST_SENSIBLE: f64 = 1.0e9;
/// What a 16-bit sample is subtracted from where low is bright.
const WHITEST_WORD: u16 = u16::MAX;

/// Hands `$samples` to `$method` whatever its number type.
macro_rules! of_any_type {
    ($samples:expr, $values:ident => $result:expr) => {
        match $samples {
            RawSamples::U8($values) => $result,
            RawSamples::I8($values) => $result,
            RawSamples::U16($values) => $result,
            RawSamples::I16($values) => $result,
            RawSamples::U32($values) => $result,
            RawSamples::I32($values) => $result,
            RawSamples::F32($values) => $result,
            RawSamples::F64($values) => $result,
        }
    };
}

impl Converter<'_> {
    /// The samples of a chunk. `valid` has one answer a pixel and loses those without data.
    pub(super) fn samples(&self, raw: RawSamples, valid: &mut [bool]) -> Samples {
        match (self.form, raw) {
            (Form::Amplitudes, RawSamples::U8(v)) => Samples::U8(self.one(&v, valid)),
            (Form::Heights | Form::Amplitudes, raw) => match raw {
                RawSamples::U8(v) => Samples::I16(widened(&self.one(&v, valid))),
                RawSamples::I8(v) => Samples::I16(widened(&self.one(&v, valid))),
                RawSamples::U16(v) => Samples::U16(self.one(&v, valid)),
                RawSamples::I16(v) => Samples::I16(self.one(&v, valid)),
                RawSamples::U32(v) => Samples::F64(widened(&self.one(&v, valid))),
                RawSamples::I32(v) => Samples::F64(widened(&self.one(&v, valid))),
                RawSamples::F32(v) => Samples::F32(self.one(&v, valid)),
                RawSamples::F64(v) => Samples::F64(self.one(&v, valid)),
            },
            (Form::Colours, RawSamples::U8(bytes)) if self.keeps_all() => Samples::U8(bytes),
            (Form::Colours, raw) => Samples::U8(of_any_type!(raw, v => self.paint(&v, valid))),
            (Form::Bytes, raw) => {
                let most = self.most();
                Samples::U8(of_any_type!(raw, v => self.each(&v, valid, |number| {
                    (!number.is_nan()).then(|| self.byte(number, most))
                })))
            }
            (Form::Words, RawSamples::U16(words)) if self.keeps_all() => Samples::U16(words),
            (Form::Words, raw) => {
                let inverted = *self.colour == Colour::WhiteIsZero;
                // Only 16-bit numbers are read in this form, and f64 holds them exactly.
                let word = |number: f64| {
                    let word = number as u16;
                    Some(if inverted { WHITEST_WORD - word } else { word })
                };
                Samples::U16(of_any_type!(raw, v => self.each(&v, valid, word)))
            }
            (Form::Floats, raw) => {
                let float = |number: f64| Some(number as f32).filter(|float| float.is_finite());
                Samples::F32(of_any_type!(raw, v => self.each(&v, valid, float)))
            }
        }
    }

    /// Whether the bands are taken as they are, all of them in their order, and every pixel holds data.
    fn keeps_all(&self) -> bool {
        let in_order = self.chosen.iter().copied().eq(0..self.count);
        let colour = match self.form {
            Form::Words => *self.colour != Colour::WhiteIsZero,
            _ => *self.colour == Colour::Rgb && self.chosen.len() == 3 && self.range.is_none(),
        };
        in_order && colour && self.nodata.is_none()
    }

    /// The first chosen band alone.
    fn one<T: Copy + Default + Into<f64>>(&self, raw: &[T], valid: &mut [bool]) -> Vec<T> {
        let band = self.chosen.first().copied().unwrap_or(0);
        let limit = if self.form == Form::Heights {
            HIGHEST_SENSIBLE
        } else {
            // Amplitudes of 64 bits are kept in 32.
            f64::from(f32::MAX)
        };
        let mut values = Vec::with_capacity(valid.len());
        for (pixel, valid) in raw.chunks_exact(self.count).zip(valid.iter_mut()) {
            let value = pixel.get(band).copied().unwrap_or_default();
            let number: f64 = value.into();
            // NaN fails the comparison with the limit.
            let holds = number.abs() <= limit && self.nodata != Some(number);
            *valid &= holds && self.alpha_of(pixel).is_none_or(|alpha| alpha > 0.0);
            values.push(if holds { value } else { T::default() });
        }
        values
    }

    fn alpha_of<T: Copy + Into<f64>>(&self, pixel: &[T]) -> Option<f64> {
        pixel.get(self.alpha?).map(|value| (*value).into())
    }

    /// The chosen bands, each number by `make`. A pixel is empty where every band holds the fill value, where it is
    /// transparent, and where `make` has nothing for one of its numbers.
    fn each<T: Copy + Into<f64>, U: Copy + Default>(
        &self,
        raw: &[T],
        valid: &mut [bool],
        make: impl Fn(f64) -> Option<U>,
    ) -> Vec<U> {
        let mut values = Vec::with_capacity(valid.len() * self.chosen.len());
        for (pixel, valid) in raw.chunks_exact(self.count).zip(valid.iter_mut()) {
            let mut empty = self.nodata.is_some();
            let mut whole = true;
            for band in self.chosen {
                let number = pixel.get(*band).map_or(f64::NAN, |value| (*value).into());
                empty &= self.nodata == Some(number);
                let value = make(number);
                whole &= value.is_some();
                values.push(value.unwrap_or_default());
            }
            let opaque = self.alpha_of(pixel).is_none_or(|alpha| alpha > 0.0);
            *valid &= opaque && !empty && whole;
        }
        values
    }

    /// Red, green and blue.
    fn paint<T: Copy + Into<f64>>(&self, raw: &[T], valid: &mut [bool]) -> Vec<u8> {
        let most = self.most();
        let mut colours = Vec::with_capacity(valid.len() * 3);
        for (pixel, valid) in raw.chunks_exact(self.count).zip(valid.iter_mut()) {
            let band = |index: usize| {
                let band = self.chosen.get(index).or_else(|| self.chosen.first());
                band.and_then(|band| pixel.get(*band))
                    .map_or(0.0, |value| (*value).into())
            };
            let numbers = [band(0), band(1), band(2)];
            // A pixel is empty where every band holds the fill value.
            let empty = self
                .nodata
                .is_some_and(|fill| numbers.iter().all(|number| *number == fill));
            let opaque = self.alpha_of(pixel).is_none_or(|alpha| alpha > 0.0);
            *valid &= opaque && !empty && numbers.iter().all(|number| !number.is_nan());
            let colour = match self.colour {
                Colour::Palette(table) => {
                    let entry = table.get(numbers[0] as usize).copied();
                    *valid &= entry.is_some();
                    entry.unwrap_or_default()
                }
                Colour::YCbCr => rgb_of_ycbcr(numbers),
                Colour::Plain | Colour::WhiteIsZero | Colour::Rgb => {
                    numbers.map(|number| self.byte(number, most))
                }
            };
            colours.extend_from_slice(&colour);
        }
        colours
    }

    /// The highest number that the file's samples can be; of use for bytes only.
    fn most(&self) -> f64 {
        match self.number {
            Number::Bits(bits) => f64::from((1_u32 << bits) - 1),
            _ => 255.0,
        }
    }

    /// A byte by the given range, whose first end is black whatever the file says, else of the samples up to `most`.
    #[inline]
    fn byte(&self, number: f64, most: f64) -> u8 {
        let scaled = match self.range {
            Some([low, high]) => 255.0 * (number - low) / (high - low),
            None if *self.colour == Colour::WhiteIsZero => 255.0 * (most - number) / most,
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
