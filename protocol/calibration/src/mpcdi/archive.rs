//! The zip archive around an MPCDI description.
//! In: bytes in memory. Out: the bytes of named parts. Sizes are counted while unpacking, whatever the archive says of
//! itself; paths that leave the archive are refused; nothing is written to disk.

use std::io::{self, Cursor, Read};

use zip::ZipArchive;
use zip::result::ZipError;

use crate::ReadError;
use crate::options::Limits;

/// Most entries: a region has four files at most, and producers add some of their own.
const MOST_ENTRIES: usize = 16_384;
/// Most bytes of a description: regions take about 2 KiB each.
const DESCRIPTION_BYTES: u64 = 4 << 20;

/// An open archive.
pub(super) struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    file: &'a str,
    limits: Limits,
    /// Bytes unpacked so far.
    spent: u64,
}

/// A reader that stops at a number of bytes and remembers that it did.
struct Counted<'a> {
    inner: &'a mut dyn Read,
    left: u64,
    read: u64,
    is_over: bool,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.is_over {
            return Err(io::Error::other("too large"));
        }
        // One byte more than is left tells whether there is more.
        let most = usize::try_from(self.left.saturating_add(1))
            .unwrap_or(usize::MAX)
            .min(buffer.len());
        let count = self
            .inner
            .read(buffer.get_mut(..most).unwrap_or_default())?;
        self.read += count as u64;
        if count as u64 > self.left {
            self.is_over = true;
            return Err(io::Error::other("too large"));
        }
        self.left -= count as u64;
        Ok(count)
    }
}

impl<'a> Archive<'a> {
    pub(super) fn open(bytes: &'a [u8], file: &'a str, limits: Limits) -> Result<Self, ReadError> {
        let zip = ZipArchive::new(Cursor::new(bytes))
            .map_err(|error| damaged(file, &error.to_string()))?;
        if zip.len() > MOST_ENTRIES {
            return Err(ReadError::TooMany {
                file: file.to_owned(),
                what: "entries",
                count: zip.len() as u64,
                limit: MOST_ENTRIES as u64,
            });
        }
        for name in zip.file_names_raw() {
            let name = String::from_utf8_lossy(name);
            // Folders end in a slash.
            check_path(file, name.strip_suffix('/').unwrap_or(&name))?;
        }
        Ok(Self {
            zip,
            file,
            limits,
            spent: 0,
        })
    }

    /// The first of these descriptions that is there, and its text.
    pub(super) fn description(
        &mut self,
        names: &[&'static str],
    ) -> Result<(&'static str, String), ReadError> {
        let name = names
            .iter()
            .copied()
            .find(|name| self.zip.index_for_name(name).is_some());
        let name = name.ok_or_else(|| self.missing(names.first().copied().unwrap_or_default()))?;
        let file = format!("{}/{name}", self.file);
        let bytes = self.bounded(name, DESCRIPTION_BYTES.min(self.limits.part_bytes))?;
        let text = String::from_utf8(bytes).map_err(|error| {
            damaged(
                &file,
                &format!("its text is not UTF-8: {}", error.utf8_error()),
            )
        })?;
        Ok((name, text))
    }

    /// A part that is kept packed: a picture.
    pub(super) fn bytes(&mut self, path: &str) -> Result<Vec<u8>, ReadError> {
        self.bounded(path, self.limits.part_bytes)
    }

    fn bounded(&mut self, path: &str, limit_bytes: u64) -> Result<Vec<u8>, ReadError> {
        let label = format!("{}/{path}", self.file);
        self.read_up_to(path, limit_bytes, |reader| {
            let mut bytes = Vec::new();
            reader
                .read_to_end(&mut bytes)
                .map_err(|error| damaged(&label, &error.to_string()))?;
            Ok(bytes)
        })
    }

    /// Lets `take` read a part. What it gives back counts only if the bounds held.
    pub(super) fn read<T>(
        &mut self,
        path: &str,
        take: impl FnOnce(&mut dyn Read) -> Result<T, ReadError>,
    ) -> Result<T, ReadError> {
        // A header of a float map comes on top of its data.
        self.read_up_to(path, self.limits.part_bytes.saturating_add(1024), take)
    }

    fn read_up_to<T>(
        &mut self,
        path: &str,
        limit_bytes: u64,
        take: impl FnOnce(&mut dyn Read) -> Result<T, ReadError>,
    ) -> Result<T, ReadError> {
        check_path(self.file, path)?;
        let index = self
            .zip
            .index_for_name(path)
            .ok_or_else(|| self.missing(path))?;
        let label = format!("{}/{path}", self.file);
        let mut entry = self
            .zip
            .by_index(index)
            .map_err(|error| unpacking(&label, &error))?;
        let total_left = self.limits.total_bytes.saturating_sub(self.spent);
        let mut counted = Counted {
            inner: &mut entry,
            left: limit_bytes.min(total_left),
            read: 0,
            is_over: false,
        };
        let taken = take(&mut counted);
        let (read, is_over) = (counted.read, counted.is_over);
        self.spent = self.spent.saturating_add(read);
        match is_over {
            false => taken,
            true if total_left < limit_bytes => Err(ReadError::TotalTooLarge {
                file: self.file.to_owned(),
                limit_bytes: self.limits.total_bytes,
            }),
            true => Err(ReadError::TooLarge {
                file: label,
                limit_bytes,
            }),
        }
    }

    fn missing(&self, part: &str) -> ReadError {
        ReadError::MissingPart {
            file: self.file.to_owned(),
            part: part.to_owned(),
        }
    }
}

/// A path must be plain and relative. Nothing is ever unpacked to disk; a path that tries to leave is still a sign
/// of an archive that nobody should trust.
fn check_path(file: &str, path: &str) -> Result<(), ReadError> {
    let is_plain = !path.is_empty()
        && !path.contains(['\\', ':', '\0'])
        && path.split('/').all(|step| !step.is_empty() && step != "..");
    if is_plain {
        return Ok(());
    }
    Err(ReadError::UnsafePath {
        file: file.to_owned(),
        path: path.to_owned(),
    })
}

fn unpacking(file: &str, error: &ZipError) -> ReadError {
    match error {
        ZipError::CompressionMethodNotSupported(_) | ZipError::UnsupportedArchive(_) => {
            ReadError::Unsupported {
                file: file.to_owned(),
                what: format!("the packing of this part ({error})"),
                remedy: "Pack the archive with the method \"deflate\" or \"store\", without a password.",
            }
        }
        _ => damaged(file, &error.to_string()),
    }
}

fn damaged(file: &str, reason: &str) -> ReadError {
    ReadError::Damaged {
        file: file.to_owned(),
        reason: format!("it cannot be unpacked: {reason}"),
    }
}
