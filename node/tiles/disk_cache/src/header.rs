//! What stands before the payload of a cached file, and how a bad file is told from a good one.
//!
//! In: the bytes of a file and the name it was found under. Out: where the payload begins, or what is wrong, by name.
//! It must not read files.
//!
//! Layout, version 1, little-endian; the header's length is a multiple of 64 bytes so that a mapped payload is aligned:
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 8 | magic `TWcache\n` |
//! | 8 | 4 | version, 1 |
//! | 12 | 4 | length H of the header in bytes, padding included |
//! | 16 | 8 | length of the payload in bytes |
//! | 24 | 4 | CRC-32 (IEEE 802.3) of the payload |
//! | 28 | 4 | length N of the name in bytes, 3…512 |
//! | 32 | 4 | CRC-32 of the bytes 0…31 and 36…H−1 |
//! | 36 | N | name in ASCII: group, then the path, strokes between |
//! | 36 + N | | zeros up to H |

use std::ops::Range;

use thiserror::Error;

use crate::name::{MAX_NAME_BYTES, Name};

const MAGIC: [u8; 8] = *b"TWcache\n";
const VERSION: u32 = 1;
const FIXED_BYTES: usize = 36;
const ALIGNMENT: usize = 64;
/// Longest header in bytes.
pub(crate) const MAX_HEADER_BYTES: u64 =
    ((FIXED_BYTES + MAX_NAME_BYTES).next_multiple_of(ALIGNMENT)) as u64;
/// Largest payload in bytes: what is larger is no tile, and nobody allocates or maps more for one file.
pub const MAX_PAYLOAD_BYTES: u64 = 1 << 30;

/// What is wrong with a cached file. The file is removed, and the name becomes a miss.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Broken {
    /// It ends too early.
    #[error("truncated: {found} bytes of {expected}")]
    Truncated {
        /// Bytes that are there.
        found: u64,
        /// Bytes that its header promises, or that any header needs.
        expected: u64,
    },
    /// It does not begin as cached files do.
    #[error("not a cached file: it begins with other bytes")]
    Magic,
    /// It is of another version of this program.
    #[error("of version {found}, and this program reads version 1")]
    Version {
        /// The version it states.
        found: u32,
    },
    /// The header does not match its own checksum, or contradicts itself.
    #[error("its header is damaged")]
    Header,
    /// There is more than its header promises, or more than any file may have.
    #[error("oversized: {found} bytes of {expected}")]
    Oversized {
        /// Bytes that are there.
        found: u64,
        /// Bytes that its header promises, or the most allowed.
        expected: u64,
    },
    /// A good file in the wrong place.
    #[error("it belongs to {found:?}")]
    Name {
        /// The name it states.
        found: String,
    },
    /// The payload does not match its checksum.
    #[error("its payload is damaged: checksum {found:08x}, stated {stated:08x}")]
    Payload {
        /// CRC-32 of what is there.
        found: u32,
        /// CRC-32 that the header states.
        stated: u32,
    },
    /// The reader found it broken at its own level.
    #[error("{reason}")]
    Reader {
        /// What the reader said.
        reason: String,
    },
}

impl Broken {
    /// A word for reports.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Truncated { .. } => "truncated",
            Self::Magic => "not a cached file",
            Self::Version { .. } => "wrong version",
            Self::Header => "damaged header",
            Self::Oversized { .. } => "oversized",
            Self::Name { .. } => "wrong name",
            Self::Payload { .. } => "damaged payload",
            Self::Reader { .. } => "refused by its reader",
        }
    }
}

/// The bytes of a file before a payload of at most [`MAX_PAYLOAD_BYTES`].
pub(crate) fn encode(name: &Name, payload: &[u8]) -> Vec<u8> {
    let name = name.whole().as_bytes();
    let length = (FIXED_BYTES + name.len()).next_multiple_of(ALIGNMENT);
    let mut header = Vec::with_capacity(length);
    header.extend_from_slice(&MAGIC);
    header.extend_from_slice(&VERSION.to_le_bytes());
    // Names have at most 512 bytes.
    header.extend_from_slice(&(length as u32).to_le_bytes());
    header.extend_from_slice(&(payload.len() as u64).to_le_bytes());
    header.extend_from_slice(&crc32fast::hash(payload).to_le_bytes());
    header.extend_from_slice(&(name.len() as u32).to_le_bytes());
    let mut rest = name.to_vec();
    rest.resize(length - FIXED_BYTES, 0);
    let checksum = checksum(&header, &rest);
    header.extend_from_slice(&checksum.to_le_bytes());
    header.extend_from_slice(&rest);
    header
}

fn checksum(before: &[u8], after: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(before);
    hasher.update(after);
    hasher.finalize()
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(four.try_into().ok()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    let eight = bytes.get(at..at.checked_add(8)?)?;
    Some(u64::from_le_bytes(eight.try_into().ok()?))
}

/// The place of the payload in `file`, the whole file that was found where `name` belongs; everything is checked.
pub(crate) fn check(file: &[u8], name: &Name) -> Result<Range<usize>, Broken> {
    let found = file.len() as u64;
    let truncated = |expected: u64| Broken::Truncated { found, expected };
    let (Some(magic), Some(version)) = (file.get(..8), u32_at(file, 8)) else {
        return Err(truncated(FIXED_BYTES as u64));
    };
    if magic != MAGIC {
        return Err(Broken::Magic);
    }
    if version != VERSION {
        return Err(Broken::Version { found: version });
    }
    let short = || truncated(FIXED_BYTES as u64);
    let header_bytes = u32_at(file, 12).ok_or_else(short)? as usize;
    let payload_bytes = u64_at(file, 16).ok_or_else(short)?;
    let stated = u32_at(file, 24).ok_or_else(short)?;
    let name_bytes = u32_at(file, 28).ok_or_else(short)? as usize;
    let header_checksum = u32_at(file, 32).ok_or_else(short)?;
    if header_bytes as u64 > MAX_HEADER_BYTES || name_bytes > MAX_NAME_BYTES {
        return Err(Broken::Header);
    }
    let before = file.get(..32).ok_or_else(short)?;
    let rest = file
        .get(FIXED_BYTES.min(header_bytes)..header_bytes)
        .ok_or_else(|| truncated(header_bytes as u64))?;
    if checksum(before, rest) != header_checksum {
        return Err(Broken::Header);
    }
    let found_name = rest.get(..name_bytes).ok_or(Broken::Header)?;
    if found_name != name.whole().as_bytes() {
        return Err(Broken::Name {
            found: String::from_utf8_lossy(found_name).into_owned(),
        });
    }
    if payload_bytes > MAX_PAYLOAD_BYTES {
        return Err(Broken::Oversized {
            found: payload_bytes,
            expected: MAX_PAYLOAD_BYTES,
        });
    }
    let expected = payload_bytes + header_bytes as u64;
    match found.cmp(&expected) {
        std::cmp::Ordering::Less => return Err(truncated(expected)),
        std::cmp::Ordering::Greater => return Err(Broken::Oversized { found, expected }),
        std::cmp::Ordering::Equal => {}
    }
    let payload = file.get(header_bytes..).ok_or(Broken::Header)?;
    let found = crc32fast::hash(payload);
    if found != stated {
        return Err(Broken::Payload { found, stated });
    }
    Ok(header_bytes..file.len())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use std::path::Path;

    use super::*;
    use proptest::prelude::*;

    fn name(path: &str) -> Name {
        Name::new("dem-3", Path::new(path)).unwrap()
    }

    fn file(path: &str, payload: &[u8]) -> Vec<u8> {
        let mut file = encode(&name(path), payload);
        file.extend_from_slice(payload);
        file
    }

    #[test]
    fn golden_bytes() {
        let header = encode(&name("7/0a.tile"), b"123456789");
        let mut golden = Vec::new();
        golden.extend_from_slice(b"TWcache\n");
        golden.extend_from_slice(&[1, 0, 0, 0, 64, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0]);
        // The check value of CRC-32 for these nine digits.
        golden.extend_from_slice(&0xcbf4_3926_u32.to_le_bytes());
        golden.extend_from_slice(&[15, 0, 0, 0]);
        // By another implementation, zlib's.
        golden.extend_from_slice(&0x8832_5bb6_u32.to_le_bytes());
        golden.extend_from_slice(b"dem-3/7/0a.tile");
        golden.resize(64, 0);
        assert_eq!(header, golden);
    }

    #[test]
    fn every_fault_has_its_name() {
        let (name, good) = (name("1/2"), file("1/2", b"payload"));
        assert_eq!(
            check(&good, &name).map(|place| good[place].to_vec()),
            Ok(b"payload".to_vec())
        );
        let changed = |at: usize, by: u8| {
            let mut bad = good.clone();
            bad[at] ^= by;
            check(&bad, &name).unwrap_err()
        };
        assert_eq!(changed(0, 1), Broken::Magic);
        assert_eq!(changed(8, 3), Broken::Version { found: 2 });
        assert_eq!(changed(16, 1), Broken::Header);
        assert_eq!(changed(40, 1), Broken::Header);
        assert!(matches!(
            changed(good.len() - 1, 16),
            Broken::Payload { .. }
        ));
        let whole = good.len() as u64;
        assert_eq!(
            check(&good[..good.len() - 1], &name),
            Err(Broken::Truncated {
                found: whole - 1,
                expected: whole
            })
        );
        assert!(matches!(
            check(b"", &name),
            Err(Broken::Truncated { found: 0, .. })
        ));
        let longer = [good.clone(), vec![0]].concat();
        assert_eq!(
            check(&longer, &name),
            Err(Broken::Oversized {
                found: whole + 1,
                expected: whole
            })
        );
        assert_eq!(
            check(&file("1/3", b"payload"), &name),
            Err(Broken::Name {
                found: "dem-3/1/3".to_owned()
            })
        );
    }

    #[test]
    fn a_promise_of_terabytes_allocates_nothing() {
        let mut header = encode(&name("1/2"), b"");
        header[16..24].copy_from_slice(&(1_u64 << 42).to_le_bytes());
        let sum = checksum(&header[..32], &header[36..]);
        header[32..36].copy_from_slice(&sum.to_le_bytes());
        assert!(matches!(
            check(&header, &name("1/2")),
            Err(Broken::Oversized { .. })
        ));
    }

    proptest! {
        #[test]
        fn no_flipped_bit_and_no_cut_passes(payload in proptest::collection::vec(any::<u8>(), 0..200), at: prop::sample::Index, bit in 0..8_u8, cut: prop::sample::Index) {
            let good = file("a/b", &payload);
            let mut bad = good.clone();
            bad[at.index(good.len())] ^= 1 << bit;
            prop_assert!(check(&bad, &name("a/b")).is_err());
            prop_assert!(check(&good[..cut.index(good.len())], &name("a/b")).is_err());
        }

        #[test]
        fn noise_does_no_harm(noise in proptest::collection::vec(any::<u8>(), 0..300), valid_start: bool) {
            let mut bytes = noise;
            if valid_start {
                bytes.splice(..bytes.len().min(12), file("a/b", b"").into_iter().take(12));
            }
            prop_assert!(check(&bytes, &name("a/b")).is_err());
        }
    }
}
