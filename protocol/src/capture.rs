//! Captured pictures on their way to the master: cut into messages of whole rows, and put together.
//! In: RGBA pictures. Out: messages; and from messages, pictures. Every size that a peer states is
//! checked against the wall before memory is taken.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::wall::Host;

/// Most bytes of pixels in one message.
pub const MAX_ROW_BYTES: usize = 512 * 1024;

/// Some rows of a captured picture, top row first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CaptureRows {
    /// Number of the capture.
    pub id: u32,
    /// Index into the host's outputs.
    pub output: u32,
    /// First row of the picture in this message.
    pub first_row: u32,
    /// Whole rows, four bytes a pixel: red, green, blue, alpha.
    #[serde(with = "bytes")]
    pub rgba: Vec<u8>,
}

/// A whole captured picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CapturedPicture {
    /// Index into the host's outputs.
    pub output: usize,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Top row first, four bytes a pixel.
    pub rgba: Vec<u8>,
}

/// Why rows were refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CaptureError {
    /// The rows belong to another capture.
    #[error("rows of capture {found} arrived during capture {expected}")]
    OtherCapture {
        /// The capture under way.
        expected: u32,
        /// The capture that the rows name.
        found: u32,
    },
    /// The host has no such output.
    #[error("rows of output {output} arrived from host \"{host}\", which has {outputs} outputs")]
    UnknownOutput {
        /// The host's name.
        host: String,
        /// The output that the rows name.
        output: u32,
        /// How many it has.
        outputs: usize,
    },
    /// The rows do not follow the ones before, or are no whole rows of the output.
    #[error(
        "{bytes} bytes from row {first_row} of output {output} of host \"{host}\" do not continue a picture of {width}×{height} at row {next_row}"
    )]
    Misplaced {
        /// The host's name.
        host: String,
        /// The output that the rows name.
        output: u32,
        /// First row of the message.
        first_row: u32,
        /// Bytes in the message.
        bytes: usize,
        /// The row that was due.
        next_row: u32,
        /// The output's width.
        width: u32,
        /// The output's height.
        height: u32,
    },
    /// A picture is not complete.
    #[error(
        "the capture of output \"{output}\" of host \"{host}\" ended after {rows} of {height} rows"
    )]
    Incomplete {
        /// The host's name.
        host: String,
        /// The output's name.
        output: String,
        /// Rows that arrived.
        rows: u32,
        /// Rows that it has.
        height: u32,
    },
}

/// Cuts a picture of `width` pixels a row into messages of at most [`MAX_ROW_BYTES`].
pub fn split_rows(
    id: u32,
    output: u32,
    width: u32,
    rgba: &[u8],
) -> impl Iterator<Item = CaptureRows> + '_ {
    let row_bytes = (width.max(1) as usize) * 4;
    let rows = (MAX_ROW_BYTES / row_bytes).max(1);
    rgba.chunks(rows * row_bytes)
        .enumerate()
        .map(move |(index, chunk)| CaptureRows {
            id,
            output,
            first_row: (index * rows) as u32,
            rgba: chunk.to_vec(),
        })
}

/// Puts the pictures of one host together.
#[derive(Clone, Debug)]
pub struct CaptureAssembly {
    id: u32,
    host: Host,
    pictures: Vec<Vec<u8>>,
}

impl CaptureAssembly {
    /// An assembly for capture `id` of a host.
    #[must_use]
    pub fn new(id: u32, host: &Host) -> Self {
        Self {
            id,
            host: host.clone(),
            pictures: vec![Vec::new(); host.outputs.len()],
        }
    }

    /// Adds rows; they must come in order for each output.
    ///
    /// # Errors
    /// Rows of another capture, of an unknown output, or that do not fit.
    pub fn add(&mut self, rows: &CaptureRows) -> Result<(), CaptureError> {
        if rows.id != self.id {
            return Err(CaptureError::OtherCapture {
                expected: self.id,
                found: rows.id,
            });
        }
        let index = rows.output as usize;
        let (Some(output), Some(picture)) =
            (self.host.outputs.get(index), self.pictures.get_mut(index))
        else {
            return Err(CaptureError::UnknownOutput {
                host: self.host.name.clone(),
                output: rows.output,
                outputs: self.host.outputs.len(),
            });
        };
        let [width, height] = output.size_px;
        let row_bytes = width as usize * 4;
        let next_row = picture.len() / row_bytes;
        let room = (height as usize - next_row) * row_bytes;
        let fits = !rows.rgba.is_empty()
            && rows.first_row as usize == next_row
            && rows.rgba.len().is_multiple_of(row_bytes)
            && rows.rgba.len() <= room;
        if !fits {
            return Err(CaptureError::Misplaced {
                host: self.host.name.clone(),
                output: rows.output,
                first_row: rows.first_row,
                bytes: rows.rgba.len(),
                next_row: next_row as u32,
                width,
                height,
            });
        }
        picture.extend_from_slice(&rows.rgba);
        Ok(())
    }

    /// The pictures, one for each output of the host.
    ///
    /// # Errors
    /// A picture whose rows have not all arrived.
    pub fn finish(self) -> Result<Vec<CapturedPicture>, CaptureError> {
        let outputs = self.host.outputs.iter().zip(self.pictures).enumerate();
        outputs
            .map(|(index, (output, rgba))| {
                let [width, height] = output.size_px;
                let row_bytes = width as usize * 4;
                if rgba.len() == row_bytes * height as usize {
                    return Ok(CapturedPicture {
                        output: index,
                        width,
                        height,
                        rgba,
                    });
                }
                Err(CaptureError::Incomplete {
                    host: self.host.name.clone(),
                    output: output.name.clone(),
                    rows: (rgba.len() / row_bytes) as u32,
                    height,
                })
            })
            .collect()
    }
}

/// Pixels as one block of bytes instead of one number after the other.
mod bytes {
    use serde::de::{SeqAccess, Visitor};
    use serde::{Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(bytes)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<u8>, D::Error> {
        deserializer.deserialize_byte_buf(Bytes)
    }

    struct Bytes;

    impl<'de> Visitor<'de> for Bytes {
        type Value = Vec<u8>;

        fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            formatter.write_str("bytes")
        }

        fn visit_byte_buf<E>(self, bytes: Vec<u8>) -> Result<Vec<u8>, E> {
            Ok(bytes)
        }

        fn visit_bytes<E>(self, bytes: &[u8]) -> Result<Vec<u8>, E> {
            Ok(bytes.to_vec())
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Vec<u8>, A::Error> {
            let mut bytes = Vec::new();
            while let Some(byte) = sequence.next_element()? {
                bytes.push(byte);
            }
            Ok(bytes)
        }
    }
}
