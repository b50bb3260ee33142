//! From the numbers of a file to the samples of a layer: which bands, of which type, which of them hold data.
//! In: raw bands with what the file says about them. Out: one channel of heights or amplitudes, bytes of colour, or
//! up to 16 bands of imagery as their sensor delivered them, with validity. What would come out wrong is refused when
//! the source is opened, with the remedy. It converts no sample by itself; `convert` does.

use tiles::{Kind, MAX_CHANNELS, SampleType};

use super::convert::Converter;
use super::pixels::{Bands, Colour, Number, Pixels, RawSamples};
use crate::error::SourceError;
use crate::options::ImportOptions;

/// What becomes of the chosen bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// One band of heights, to be scaled.
    Heights,
    /// One band of amplitudes as it is.
    Amplitudes,
    /// Red, green and blue in bytes, from three bands or from one: a grey, an index into a table.
    Colours,
    /// Each band in bytes.
    Bytes,
    /// Each band in 16 bits, as it is.
    Words,
    /// Each band as the nearest 32-bit floating-point number: the same for all numbers of up to 24 bits.
    Floats,
}

/// How the bands of one source become channels.
pub(crate) struct Reading {
    form: Form,
    count: usize,
    number: Number,
    chosen: Vec<usize>,
    colour: Colour,
    alpha: Option<usize>,
    nodata: Option<f64>,
    range: Option<[f64; 2]>,
}

impl Reading {
    /// Decides how `bands` of `file` become a layer of the wanted kind, or why they do not.
    pub(crate) fn choose(
        file: &str,
        bands: Bands,
        options: &ImportOptions,
    ) -> Result<Self, SourceError> {
        let mut chosen = Vec::new();
        for band in options.bands.as_deref().unwrap_or(&[]) {
            if *band == 0 || *band > bands.count {
                return Err(SourceError::refused(
                    file,
                    format!(
                        "band {band} was asked for, but it has bands 1 to {}",
                        bands.count
                    ),
                    "Correct --bands.",
                ));
            }
            chosen.push(band - 1);
        }
        let (chosen, form) = match options.kind {
            Kind::Imagery => of_imagery(file, &bands, chosen, options.range.is_some())?,
            Kind::Elevation | Kind::Sar => of_one_band(file, &bands, chosen, options.kind)?,
        };
        let Bands {
            count,
            number,
            colour,
            alpha,
            nodata,
        } = bands;
        Ok(Self {
            form,
            count,
            number,
            chosen,
            colour,
            alpha,
            nodata: options.nodata.or(nodata),
            range: options.range,
        })
    }

    /// Channels a pixel, 1…16.
    pub(crate) const fn channels(&self) -> usize {
        match self.form {
            Form::Heights | Form::Amplitudes => 1,
            Form::Colours => 3,
            Form::Bytes | Form::Words | Form::Floats => self.chosen.len(),
        }
    }

    /// The number type of a layer that is made from this source alone.
    ///
    /// It follows from the file's number type, never from its samples: scenes of one sensor go together, whether or
    /// not one of them happens to hold a negative number. So signed 16-bit imagery becomes floating point, which
    /// holds each of its numbers exactly.
    pub(crate) const fn sample_type(&self) -> SampleType {
        match (self.form, self.number) {
            (Form::Heights, _) => SampleType::I32,
            (Form::Colours | Form::Bytes, _) | (Form::Amplitudes, Number::Bits(_)) => {
                SampleType::U8
            }
            (Form::Words, _) | (Form::Amplitudes, Number::U16) => SampleType::U16,
            (Form::Floats | Form::Amplitudes, _) => SampleType::F32,
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
        match self.form {
            Form::Heights | Form::Amplitudes => self.number.bytes() * 2 + 1,
            Form::Colours | Form::Bytes | Form::Words | Form::Floats => {
                self.channels() * self.sample_type().bytes() + 1
            }
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
        let converter = Converter {
            form: self.form,
            count: self.count,
            number: self.number,
            chosen: &self.chosen,
            colour: &self.colour,
            alpha: self.alpha,
            nodata: self.stored_nodata(),
            range: self.range,
        };
        let samples = converter.samples(raw, &mut valid);
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

    /// The fill value as a sample of the file would hold it: a 32-bit sample rounds it.
    fn stored_nodata(&self) -> Option<f64> {
        match self.number {
            Number::F32 => self.nodata.map(|value| f64::from(value as f32)),
            _ => self.nodata,
        }
    }
}

/// Imagery: every band that is no transparency, unless `chosen` names some; bytes where the file has bytes or a
/// range of samples was given, the file's own numbers otherwise.
fn of_imagery(
    file: &str,
    bands: &Bands,
    mut chosen: Vec<usize>,
    ranged: bool,
) -> Result<(Vec<usize>, Form), SourceError> {
    let refuse = |problem: String, remedy: &str| Err(SourceError::refused(file, problem, remedy));
    let number = bands.number;
    let bytes = matches!(number, Number::Bits(_));
    match bands.colour {
        Colour::Palette(_) => {
            if chosen.is_empty() {
                chosen.push(0);
            }
            if chosen.len() != 1 {
                return refuse(
                    format!(
                        "{} bands were asked for, and its colours come from a table",
                        chosen.len()
                    ),
                    "Name the one band that holds the numbers of the colours, or none.",
                );
            }
            return Ok((chosen, Form::Colours));
        }
        Colour::YCbCr => {
            if !bytes {
                return refuse(
                    format!("it holds YCbCr colours in {number} samples"),
                    "Convert it to RGB: gdal_translate -co COMPRESS=DEFLATE -co TILED=YES IN OUT.",
                );
            }
            if !chosen.is_empty() && chosen != [0, 1, 2] {
                return refuse(
                    format!("{} bands of a YCbCr image were asked for", chosen.len()),
                    "A YCbCr image takes the bands 1,2,3 only: leave out --bands.",
                );
            }
            return Ok((vec![0, 1, 2], Form::Colours));
        }
        Colour::Plain | Colour::WhiteIsZero | Colour::Rgb => {}
    }
    if chosen.is_empty() {
        chosen = (0..bands.count)
            .filter(|band| Some(*band) != bands.alpha)
            .collect();
    }
    if chosen.is_empty() {
        return refuse(
            "it holds transparency and no other band".to_owned(),
            "Name the band to import with --bands N.",
        );
    }
    if chosen.len() > usize::from(MAX_CHANNELS) {
        return refuse(
            format!(
                "{} bands are to be imported, and a repository holds up to {MAX_CHANNELS}",
                chosen.len()
            ),
            "Name those to keep, for example with --bands 4,3,2.",
        );
    }
    let form = if bytes || ranged {
        if matches!(chosen.len(), 1 | 3) {
            Form::Colours
        } else {
            Form::Bytes
        }
    } else if number == Number::U16 {
        Form::Words
    } else if bands.colour == Colour::WhiteIsZero {
        return refuse(
            format!("its lowest sample is white, and {number} samples have no highest for black"),
            "Say with --range LOW,HIGH which samples to show as black and as white.",
        );
    } else {
        Form::Floats
    };
    Ok((chosen, form))
}

/// Heights and amplitudes: the only band, or the one that `chosen` names.
fn of_one_band(
    file: &str,
    bands: &Bands,
    mut chosen: Vec<usize>,
    kind: Kind,
) -> Result<(Vec<usize>, Form), SourceError> {
    let refuse = |problem: String, remedy: &str| Err(SourceError::refused(file, problem, remedy));
    let data_bands = bands.count - usize::from(bands.alpha.is_some());
    if matches!(bands.colour, Colour::Palette(_) | Colour::YCbCr) {
        return refuse(
            format!("its samples are colours, not {kind}"),
            "Import it with --kind imagery.",
        );
    }
    if chosen.is_empty() && data_bands == 1 && bands.colour != Colour::Rgb {
        chosen.push(0);
    }
    if chosen.len() != 1 {
        return refuse(
            format!("it has {data_bands} bands, and {kind} needs one"),
            "Name the band with --bands N.",
        );
    }
    let number = bands.number;
    let fits = matches!(
        number,
        Number::Bits(_) | Number::U16 | Number::F32 | Number::F64
    );
    if kind == Kind::Sar && !fits {
        return refuse(
            format!(
                "it holds {number} samples, and SAR is unsigned 8 or 16 bits or floating point"
            ),
            "Convert it first, for example with gdal_translate -ot Float32.",
        );
    }
    let form = if kind == Kind::Elevation {
        Form::Heights
    } else {
        Form::Amplitudes
    };
    Ok((chosen, form))
}
