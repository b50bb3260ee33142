//! The tile file: a header that is checked to the last field, then the payload of a codec.
//! In: a tile. Out: bytes, and the same tile again. Nothing but magic, version and lengths is looked at before
//! the checksum holds, and no field can make the reader allocate more than the samples of one tile.
//!
//! All numbers are little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 0–5 | magic `TWTILE` |
//! | 6–7 | format version |
//! | 8 | kind: 0 elevation, 1 imagery, 2 SAR |
//! | 9 | sample type: 0 i32, 1 u8, 2 u16, 3 f32 |
//! | 10 | channels, 1…16 |
//! | 11 | codec of the samples |
//! | 12 | validity: 0 all nodes valid, 1 a mask follows |
//! | 13–15 | zero |
//! | 16–23 | tile number ([`Tile::id`]) |
//! | 24–63 | statistics: lowest, highest, sum, sum of squares (f64), count (u64) |
//! | 64–67 | length of the mask |
//! | 68–71 | length of the samples |
//! | 72–75 | CRC-32 (IEEE 802.3) of everything else |
//! | 76– | the mask (zstd), then the samples |

use geodesy::Tile;
use thiserror::Error;

use super::{Kind, NODE_COUNT, SampleType, Samples, Statistics, TileData, Validity};
use crate::codec::{self, Codec, CodecError, Origin};

/// The version of the tile format that this program writes and reads.
pub const FORMAT_VERSION: u16 = 1;

const MAGIC: &[u8; 6] = b"TWTILE";
const HEADER_BYTES: usize = 76;
const CHECKSUM_AT: usize = 72;

/// Why a tile could not be made or written.
#[derive(Debug, Error)]
pub enum EncodeError {
    /// The parts do not fit together.
    #[error("tile {tile}: {problem}")]
    Inconsistent {
        /// The tile.
        tile: Tile,
        /// What does not fit.
        problem: String,
    },
    /// The compressor gave up.
    #[error("tile {tile}: compression failed: {source}")]
    Compression {
        /// The tile.
        tile: Tile,
        /// What it said.
        source: std::io::Error,
    },
}

/// Why bytes are not a tile.
#[derive(Debug, Error)]
pub enum DecodeError {
    /// The first bytes are not those of a tile file.
    #[error("not a tile file: it does not begin with TWTILE")]
    NotATile,
    /// Made by another version of this program.
    #[error(
        "tile format version {found}, but this program reads version {FORMAT_VERSION}: import the data again with this program, or read it with the one that made it"
    )]
    Version {
        /// The version in the file.
        found: u16,
    },
    /// The file is shorter or longer than its header says.
    #[error(
        "{found} bytes where the header calls for {expected}: the file was cut off or overwritten"
    )]
    Length {
        /// The length found.
        found: usize,
        /// The length that was due.
        expected: usize,
    },
    /// Some byte was changed.
    #[error("checksum {found:08x} where {expected:08x} is due: the file is damaged")]
    Checksum {
        /// The checksum of the bytes as they are.
        found: u32,
        /// The checksum written in the file.
        expected: u32,
    },
    /// A field holds what no writer puts there.
    #[error("field \"{field}\" is out of range: not written by this program")]
    Field {
        /// The field.
        field: &'static str,
    },
    /// The payload does not expand to the samples of a tile.
    #[error("the payload is broken: {0}")]
    Payload(#[from] CodecError),
    /// A good tile, but of another place.
    #[error("this is tile {found}, not {expected}")]
    WrongTile {
        /// The tile in the file.
        found: Tile,
        /// The tile that was asked for.
        expected: Tile,
    },
}

impl TileData {
    /// The tile file, compressed without loss.
    pub fn encode(&self) -> Result<Vec<u8>, EncodeError> {
        self.check()?;
        let codec = Codec::for_samples(self.samples.sample_type());
        let payload = codec::pack(&self.samples, self.channels, &self.validity);
        self.assemble(codec, &payload.map_err(|source| self.failed(source))?)
    }

    /// The tile file of heights that were resampled bilinearly from a raster, compressed without loss. Where
    /// the origin describes the tile well, the file holds little more than the raster's own samples; where it
    /// does not, this is [`TileData::encode`], so a wrong origin costs time and never data.
    pub fn encode_resampled(&self, origin: &Origin) -> Result<Vec<u8>, EncodeError> {
        self.check()?;
        let Samples::I32(heights) = &self.samples else {
            return self.encode();
        };
        let resampled = codec::pack_resampled(heights, &self.validity, origin)
            .map_err(|source| self.failed(source))?;
        if resampled.len() * 2 <= heights.len() {
            return self.assemble(Codec::Resampled, &resampled);
        }
        let plain = codec::pack(&self.samples, self.channels, &self.validity)
            .map_err(|source| self.failed(source))?;
        if resampled.len() <= plain.len() {
            self.assemble(Codec::Resampled, &resampled)
        } else {
            self.assemble(Codec::Gradient, &plain)
        }
    }

    /// The tile file with plain samples, as the disk cache keeps it.
    pub fn encode_plain(&self) -> Result<Vec<u8>, EncodeError> {
        self.check()?;
        self.assemble(Codec::Plain, &codec::pack_plain(&self.samples))
    }

    fn failed(&self, source: std::io::Error) -> EncodeError {
        EncodeError::Compression {
            tile: self.tile,
            source,
        }
    }

    fn check(&self) -> Result<(), EncodeError> {
        check(
            self.tile,
            self.kind,
            self.channels,
            &self.samples,
            &self.validity,
        )
    }

    fn assemble(&self, codec: Codec, payload: &[u8]) -> Result<Vec<u8>, EncodeError> {
        let (validity_code, mask) = match &self.validity {
            Validity::All => (0, Vec::new()),
            Validity::Mask(words) => (
                1,
                codec::pack_mask(words).map_err(|source| self.failed(source))?,
            ),
        };
        let mut file = Vec::with_capacity(HEADER_BYTES + mask.len() + payload.len());
        file.extend_from_slice(MAGIC);
        file.extend_from_slice(&FORMAT_VERSION.to_le_bytes());
        file.extend_from_slice(&[
            self.kind.code(),
            self.samples.sample_type().code(),
            self.channels,
            codec.code(),
            validity_code,
            0,
            0,
            0,
        ]);
        file.extend_from_slice(&self.tile.id().to_le_bytes());
        let Statistics {
            lowest,
            highest,
            sum,
            sum_of_squares,
            count,
        } = self.statistics;
        for number in [lowest, highest, sum, sum_of_squares] {
            file.extend_from_slice(&number.to_le_bytes());
        }
        file.extend_from_slice(&count.to_le_bytes());
        file.extend_from_slice(&(mask.len() as u32).to_le_bytes());
        file.extend_from_slice(&(payload.len() as u32).to_le_bytes());
        let mut checksum = crc32fast::Hasher::new();
        for part in [&file, &mask, payload] {
            checksum.update(part);
        }
        file.extend_from_slice(&checksum.finalize().to_le_bytes());
        file.extend_from_slice(&mask);
        file.extend_from_slice(payload);
        Ok(file)
    }

    /// Reads a tile file. Nothing but magic, version and lengths is looked at before the checksum holds.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let (header, payload) = Header::read(bytes)?;
        let (mask, samples) = payload.split_at(header.mask_bytes);
        let validity = if header.masked {
            let validity = Validity::Mask(codec::unpack_mask(mask)?);
            if !validity.is_well_formed() || validity.count() == NODE_COUNT {
                return Err(DecodeError::Field { field: "mask" });
            }
            validity
        } else {
            Validity::All
        };
        let Header {
            tile,
            kind,
            sample_type,
            channels,
            statistics,
            codec,
            ..
        } = header;
        let samples = codec::unpack(codec, sample_type, channels, &validity, samples)?;
        Ok(Self {
            tile,
            kind,
            channels,
            samples,
            validity,
            statistics,
        })
    }

    /// Reads a tile file that must be that of `tile`.
    pub fn decode_tile(bytes: &[u8], tile: Tile) -> Result<Self, DecodeError> {
        let data = Self::decode(bytes)?;
        if data.tile == tile {
            Ok(data)
        } else {
            Err(DecodeError::WrongTile {
                found: data.tile,
                expected: tile,
            })
        }
    }
}

/// The fields of a header whose checksum held and whose ranges are right.
struct Header {
    tile: Tile,
    kind: Kind,
    sample_type: SampleType,
    channels: u8,
    codec: Codec,
    masked: bool,
    statistics: Statistics,
    mask_bytes: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), DecodeError> {
        if !bytes.starts_with(MAGIC) {
            return Err(DecodeError::NotATile);
        }
        let short = DecodeError::Length {
            found: bytes.len(),
            expected: HEADER_BYTES,
        };
        let Some((header, payload)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
            return Err(short);
        };
        let version = u16::from_le_bytes(field(header, 6));
        if version != FORMAT_VERSION {
            return Err(DecodeError::Version { found: version });
        }
        let mask_bytes = u32::from_le_bytes(field(header, 64)) as usize;
        let sample_bytes = u32::from_le_bytes(field(header, 68)) as usize;
        let expected = HEADER_BYTES
            .saturating_add(mask_bytes)
            .saturating_add(sample_bytes);
        if bytes.len() != expected {
            return Err(DecodeError::Length {
                found: bytes.len(),
                expected,
            });
        }
        let mut checksum = crc32fast::Hasher::new();
        checksum.update(&header[..CHECKSUM_AT]);
        checksum.update(payload);
        let (found, expected) = (
            checksum.finalize(),
            u32::from_le_bytes(field(header, CHECKSUM_AT)),
        );
        if found != expected {
            return Err(DecodeError::Checksum { found, expected });
        }
        Ok((Self::check(header, mask_bytes)?, payload))
    }

    fn check(header: &[u8; HEADER_BYTES], mask_bytes: usize) -> Result<Self, DecodeError> {
        let bad = |field| DecodeError::Field { field };
        let [kind, sample_type, channels, codec, validity, zeros @ ..] = field::<8>(header, 8);
        let kind = Kind::of_code(kind).ok_or(bad("kind"))?;
        let sample_type = SampleType::of_code(sample_type).ok_or(bad("sample type"))?;
        if !kind.takes(sample_type, channels) {
            return Err(bad("channels"));
        }
        let codec = Codec::of_code(codec).ok_or(bad("codec"))?;
        if !codec.takes(sample_type) {
            return Err(bad("codec"));
        }
        if validity > 1 || (validity == 0 && mask_bytes > 0) {
            return Err(bad("validity"));
        }
        if zeros != [0; 3] {
            return Err(bad("reserved bytes"));
        }
        let tile = Tile::from_id(u64::from_le_bytes(field(header, 16))).ok_or(bad("tile"))?;
        let statistics = Statistics {
            lowest: f64::from_le_bytes(field(header, 24)),
            highest: f64::from_le_bytes(field(header, 32)),
            sum: f64::from_le_bytes(field(header, 40)),
            sum_of_squares: f64::from_le_bytes(field(header, 48)),
            count: u64::from_le_bytes(field(header, 56)),
        };
        if !statistics.is_sound(channels) {
            return Err(bad("statistics"));
        }
        let masked = validity == 1;
        Ok(Self {
            tile,
            kind,
            sample_type,
            channels,
            codec,
            masked,
            statistics,
            mask_bytes,
        })
    }
}

/// N bytes of the header from a constant place within it.
fn field<const N: usize>(header: &[u8; HEADER_BYTES], at: usize) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.copy_from_slice(&header[at..at + N]);
    bytes
}

/// Whether the parts of a tile fit together.
pub(super) fn check(
    tile: Tile,
    kind: Kind,
    channels: u8,
    samples: &Samples,
    validity: &Validity,
) -> Result<(), EncodeError> {
    let inconsistent = |problem| Err(EncodeError::Inconsistent { tile, problem });
    let sample_type = samples.sample_type();
    if !kind.takes(sample_type, channels) {
        return inconsistent(format!(
            "{kind} cannot be {channels} channels of {sample_type:?}"
        ));
    }
    let due = NODE_COUNT * usize::from(channels);
    if samples.len() != due {
        return inconsistent(format!("{} samples where {due} are due", samples.len()));
    }
    if !validity.is_well_formed() {
        return inconsistent("the validity mask has the wrong length or stray bits".to_owned());
    }
    Ok(())
}
