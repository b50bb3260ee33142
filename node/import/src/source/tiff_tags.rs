//! The tags of a TIFF that the import looks at.
//! In: a decoder that stands at an image. Out: numbers, text, the georeference, colour tables, GDAL's metadata. Broken
//! tags are errors that name the file.

use tiff::TiffError;
use tiff::decoder::{Decoder, ifd};
use tiff::tags::Tag;

use super::tiff_directory::Plain;
use crate::error::SourceError;
use crate::geokeys::GeoTags;

pub(super) fn cut_off(file: &str, error: &std::io::Error) -> SourceError {
    SourceError::damaged(
        file,
        format!("its TIFF directories cannot be read ({error})"),
    )
}

pub(super) fn explain(file: &str, error: TiffError) -> SourceError {
    match error {
        TiffError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            SourceError::damaged(file, "the TIFF is cut off")
        }
        TiffError::IoError(error) => {
            SourceError::damaged(file, format!("it cannot be unpacked ({error})"))
        }
        TiffError::FormatError(error) => SourceError::damaged(file, format!("bad TIFF: {error}")),
        other => SourceError::refused(
            file,
            format!("this kind of TIFF is not read by this program ({other})"),
            "Convert it: gdal_translate -co COMPRESS=DEFLATE -co TILED=YES IN OUT.",
        ),
    }
}

/// A colour table: all reds, all greens, all blues, 16 bits each, full at 65535 = 255·257. Some writers shift bytes up
/// by 8 bits, and some leave them where they are.
pub(super) fn palette(numbers: &[u32]) -> Vec<[u8; 3]> {
    let entries = numbers.len() / 3;
    let unit = if numbers.iter().all(|n| *n < 256) {
        1
    } else if numbers.iter().all(|n| n % 256 == 0) {
        256
    } else {
        257
    };
    let part = |index: usize| numbers.get(index).map_or(0, |n| (n / unit) as u8);
    (0..entries)
        .map(|i| [part(i), part(entries + i), part(2 * entries + i)])
        .collect()
}

/// The text of an item of GDAL's metadata with this role and band (counted from 0).
pub(super) fn gdal_item<'text>(
    metadata: &'text str,
    role: &str,
    band: usize,
) -> Option<&'text str> {
    let role = format!("role=\"{role}\"");
    let sample = format!("sample=\"{band}\"");
    for item in metadata.split("<Item").skip(1) {
        let (attributes, rest) = item.split_once('>')?;
        if attributes.contains(&role) && attributes.contains(&sample) {
            return rest.split_once("</Item>").map(|(text, _)| text);
        }
    }
    None
}

/// Tags of the image that a decoder stands at.
pub(super) struct Tags<'name, 'decoder> {
    pub(super) file: &'name str,
    pub(super) decoder: &'decoder mut Decoder<Plain>,
}

impl Tags<'_, '_> {
    pub(super) fn value(&mut self, number: u16) -> Result<Option<ifd::Value>, SourceError> {
        self.decoder
            .find_tag(Tag::from_u16_exhaustive(number))
            .map_err(|error| explain(self.file, error))
    }

    pub(super) fn numbers(&mut self, number: u16) -> Result<Vec<u32>, SourceError> {
        let Some(value) = self.value(number)? else {
            return Ok(Vec::new());
        };
        value
            .into_u32_vec()
            .map_err(|error| explain(self.file, error))
    }

    pub(super) fn number(&mut self, number: u16) -> Result<Option<u32>, SourceError> {
        Ok(self.numbers(number)?.first().copied())
    }

    pub(super) fn doubles(&mut self, number: u16) -> Result<Vec<f64>, SourceError> {
        let Some(value) = self.value(number)? else {
            return Ok(Vec::new());
        };
        value
            .into_f64_vec()
            .map_err(|error| explain(self.file, error))
    }

    pub(super) fn text(&mut self, number: u16) -> Result<Option<String>, SourceError> {
        let Some(value) = self.value(number)? else {
            return Ok(None);
        };
        let text = match value {
            ifd::Value::Ascii(text) => text,
            other => match other.into_u8_vec() {
                Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
                Err(_) => return Ok(None),
            },
        };
        Ok(Some(text.trim_end_matches('\0').to_owned()))
    }

    pub(super) fn nodata(&mut self) -> Result<Option<f64>, SourceError> {
        Ok(self.text(42113)?.and_then(|text| text.trim().parse().ok()))
    }

    pub(super) fn geo_tags(&mut self) -> Result<GeoTags, SourceError> {
        let directory = self.numbers(34735)?.into_iter().map(|n| n as u16).collect();
        Ok(GeoTags {
            pixel_scale: self.doubles(33550)?,
            tie_points: self.doubles(33922)?,
            transformation: self.doubles(34264)?,
            directory,
            doubles: self.doubles(34736)?,
            ascii: self.text(34737)?.unwrap_or_default(),
        })
    }

    pub(super) fn chunk_places(
        &mut self,
        tiled: bool,
    ) -> Result<(Vec<u64>, Vec<u64>), SourceError> {
        let (offsets, counts) = if tiled { (324, 325) } else { (273, 279) };
        let mut list = |number| {
            let Some(value) = self.value(number)? else {
                return Ok(Vec::new());
            };
            value
                .into_u64_vec()
                .map_err(|error| explain(self.file, error))
        };
        Ok((list(offsets)?, list(counts)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gdal_items_are_found_by_role_and_band() {
        let text = "<GDALMetadata>\n <Item name=\"OFFSET\" sample=\"0\" role=\"offset\">100</Item>\n\
                    <Item name=\"SCALE\" sample=\"1\" role=\"scale\">0.01</Item></GDALMetadata>";
        assert_eq!(gdal_item(text, "offset", 0), Some("100"));
        assert_eq!(gdal_item(text, "scale", 1), Some("0.01"));
        assert_eq!(gdal_item(text, "scale", 0), None);
    }

    #[test]
    fn colour_tables_of_all_writers() {
        assert_eq!(
            palette(&[65535, 0, 0, 65535, 257, 0]),
            [[255, 0, 1], [0, 255, 0]]
        );
        assert_eq!(
            palette(&[0xff00, 0, 0, 0x0100, 0, 0]),
            [[255, 0, 0], [0, 1, 0]]
        );
        assert_eq!(palette(&[255, 0, 0, 1, 7, 0]), [[255, 0, 7], [0, 1, 0]]);
    }
}
