//! What the `tiff` crate does not tell about a TIFF: where its directories stand, so that masks are found and the
//! stored numbers come out untouched.
//!
//! The crate interprets colours on reading, and drops bands or refuses palettes and masks that way; and it cuts
//! tiles to the image, which fails for some LZW streams and for the later planes of images in planes. A reader that
//! shows it every image as plain greys, as wide and high as its tiles together, makes it return all bands as they
//! are stored.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Tags that are looked at here.
pub(super) mod tag {
    pub(in super::super) const SUBFILE_TYPE: u16 = 254;
    pub(in super::super) const WIDTH: u16 = 256;
    pub(in super::super) const HEIGHT: u16 = 257;
    pub(in super::super) const COMPRESSION: u16 = 259;
    pub(in super::super) const PHOTOMETRIC: u16 = 262;
    pub(in super::super) const TILE_WIDTH: u16 = 322;
    pub(in super::super) const TILE_HEIGHT: u16 = 323;
}

/// Photometric interpretation "black is zero".
const BLACK_IS_ZERO: u32 = 1;
/// More directories than any pyramid of overviews and masks needs.
const MOST_DIRECTORIES: usize = 256;
/// More tags than any writer puts in one directory.
const MOST_TAGS: u64 = 4096;

/// One directory: its tags with a single short or long value.
#[derive(Debug, Default)]
pub(super) struct Directory {
    singles: BTreeMap<u16, Single>,
}

/// A value and where in the file it stands.
#[derive(Clone, Copy, Debug)]
struct Single {
    at: u64,
    value: u32,
    is_short: bool,
}

impl Directory {
    /// The value of a tag that has exactly one.
    pub(super) fn single(&self, tag: u16) -> Option<u32> {
        self.singles.get(&tag).map(|single| single.value)
    }
}

/// The directories of a file, in their order.
#[derive(Debug)]
pub(super) struct Directories {
    pub(super) list: Vec<Directory>,
    big_endian: bool,
}

impl Directories {
    /// Walks the chain of directories.
    pub(super) fn scan(path: &Path) -> io::Result<Self> {
        let mut file = BufReader::new(File::open(path)?);
        let mut head = [0; 4];
        file.read_exact(&mut head)?;
        let big_endian = head.starts_with(b"MM");
        let mut reader = Numbers { file, big_endian };
        let big = head.contains(&43);
        if big {
            reader.file.seek(SeekFrom::Start(8))?;
        }
        let mut next = if big {
            reader.long8()?
        } else {
            u64::from(reader.long()?)
        };
        let mut list = Vec::new();
        let mut seen = Vec::new();
        while next != 0 {
            if seen.contains(&next) || list.len() >= MOST_DIRECTORIES {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "directories run in a circle",
                ));
            }
            seen.push(next);
            reader.file.seek(SeekFrom::Start(next))?;
            let count = if big {
                reader.long8()?
            } else {
                u64::from(reader.short()?)
            };
            if count > MOST_TAGS {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "a directory has no end",
                ));
            }
            let mut directory = Directory::default();
            for index in 0..count {
                let (size, first) = if big { (20, next + 8) } else { (12, next + 2) };
                let at = first + index * size;
                let number = reader.short()?;
                let kind = reader.short()?;
                let (values, field) = if big {
                    (reader.long8()?, at + 12)
                } else {
                    (u64::from(reader.long()?), at + 8)
                };
                let value = match kind {
                    3 => {
                        let value = reader.short()?;
                        reader.short()?;
                        u32::from(value)
                    }
                    _ => reader.long()?,
                };
                if big {
                    reader.long()?;
                }
                if values == 1 && matches!(kind, 3 | 4) {
                    let single = Single {
                        at: field,
                        value,
                        is_short: kind == 3,
                    };
                    directory.singles.insert(number, single);
                }
            }
            next = if big {
                reader.long8()?
            } else {
                u64::from(reader.long()?)
            };
            list.push(directory);
        }
        Ok(Self { list, big_endian })
    }

    /// Columns and rows of an image.
    pub(super) fn size(&self, image: usize) -> Option<(u32, u32)> {
        let directory = self.list.get(image)?;
        Some((
            directory.single(tag::WIDTH)?,
            directory.single(tag::HEIGHT)?,
        ))
    }

    /// Opens the file so that every image in it appears as plain greys that fill its tiles.
    pub(super) fn open_plain(&self, path: &Path) -> io::Result<Plain> {
        let mut patches = Vec::new();
        for directory in &self.list {
            let single = |tag| directory.singles.get(&tag).copied();
            if let Some(photometric) = single(tag::PHOTOMETRIC) {
                self.patch(photometric, BLACK_IS_ZERO, &mut patches);
            }
            for (side, tile) in [
                (tag::WIDTH, tag::TILE_WIDTH),
                (tag::HEIGHT, tag::TILE_HEIGHT),
            ] {
                if let (Some(side), Some(tile)) = (single(side), single(tile))
                    && let Some(filled) = side.value.checked_next_multiple_of(tile.value)
                {
                    self.patch(side, filled, &mut patches);
                }
            }
        }
        let file = BufReader::with_capacity(1 << 16, File::open(path)?);
        Ok(Plain {
            file,
            at: 0,
            patches,
        })
    }

    /// Lists the bytes that replace a value.
    fn patch(&self, single: Single, value: u32, patches: &mut Vec<(u64, u8)>) {
        let mut bytes = value.to_le_bytes().to_vec();
        if single.is_short {
            if value > u32::from(u16::MAX) {
                return;
            }
            bytes.truncate(2);
        }
        if self.big_endian {
            bytes.reverse();
        }
        patches.extend((single.at..).zip(bytes));
    }
}

/// A file some bytes of which are replaced.
pub(super) struct Plain {
    file: BufReader<File>,
    at: u64,
    patches: Vec<(u64, u8)>,
}

impl Read for Plain {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        for (place, byte) in &self.patches {
            let offset = place
                .checked_sub(self.at)
                .filter(|offset| *offset < count as u64);
            if let Some(target) = offset.and_then(|offset| buffer.get_mut(offset as usize)) {
                *target = *byte;
            }
        }
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Plain {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

struct Numbers {
    file: BufReader<File>,
    big_endian: bool,
}

impl Numbers {
    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes)?;
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn short(&mut self) -> io::Result<u16> {
        self.bytes().map(u16::from_le_bytes)
    }

    fn long(&mut self) -> io::Result<u32> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn long8(&mut self) -> io::Result<u64> {
        self.bytes().map(u64::from_le_bytes)
    }
}
