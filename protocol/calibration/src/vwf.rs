//! VIOSO warp files. Layout, little-endian: `Include/VWBTypes.h` and `VIOSOWarpBlend/VWF.h` of the VIOSO API (BSD; also
//! tychonaut/VIOSO_API), and paulbourke.net/dataformats/vwf. An optional set header `vwf1`, blocks, offset, 0; then per
//! output a header `vwf0`, as many records of four floats as pixels, and up to three Windows bitmaps: blend, black level,
//! white (not used by anybody yet). In: bytes. Out: a region per output. Zipped and encrypted records are refused; their
//! layout is not public.

mod bitmap;

use crate::grid::{Grid, Placement};
use crate::options::Options;
use crate::read::{check_choice, check_light, check_mapping, check_size};
use crate::{Calibration, Gamma, Map, Mapping, PointOrigin, ReadError, Region, Texels, Uplift};

/// Bytes of `VWB_WarpFileHeader`, the oldest and shortest header: 7 words, 8 + 16 floats, a name of 256.
const HEADER_BYTES: usize = 380;
/// Bytes of a record: x, y, z, w.
const RECORD_BYTES: usize = 16;
/// `FLAG_WARPFILE_HEADER_DATA_ZIP`.
const FLAG_ZIPPED: u32 = 0x1;
/// `FLAG_WARPFILE_HEADER_DISPLAY_SPLIT`.
const FLAG_SPLIT: u32 = 0x2;
/// `FLAG_WARPFILE_HEADER_BLACKLEVEL_CORR`.
const FLAG_BLACK_LEVEL: u32 = 0x20;
/// `FLAG_WARPFILE_HEADER_3D`.
const FLAG_POINTS: u32 = 0x40;
/// All flags whose meaning is public.
const KNOWN_FLAGS: u32 = 0x3FF;

/// A block's header, as far as it is needed.
struct Header {
    bytes: usize,
    flags: u32,
    data_bytes: usize,
    size_px: [u32; 2],
    split: [f32; 4],
    black: [f32; 3],
    name: String,
}

/// An output's blocks: where its records and pictures are.
struct Blocks<'a> {
    header: Header,
    records: &'a [u8],
    pictures: Vec<bitmap::Bitmap<'a>>,
}

/// Reads all outputs, or the chosen one.
pub(crate) fn read(bytes: &[u8], file: &str, options: &Options) -> Result<Calibration, ReadError> {
    let (blocks, mut notes) = scan(bytes, file, options)?;
    let names: Vec<&str> = blocks
        .iter()
        .map(|block| block.header.name.as_str())
        .collect();
    let chosen = check_choice(file, options, &names)?;
    let mut regions = Vec::new();
    for (index, block) in blocks.iter().enumerate() {
        if chosen.is_none_or(|chosen| chosen == index) {
            regions.push(region(block, file, options, &mut notes)?);
        }
    }
    Ok(Calibration {
        regions,
        date: String::new(),
        notes,
    })
}

/// Finds all blocks without decoding them.
fn scan<'a>(
    bytes: &'a [u8],
    file: &str,
    options: &Options,
) -> Result<(Vec<Blocks<'a>>, Vec<String>), ReadError> {
    let mut rest = bytes;
    let mut due_blocks = None;
    if bytes.starts_with(b"vwf1") {
        let count = word(bytes, 4).ok_or_else(|| cut(file, 16, bytes))?;
        let offset = word(bytes, 8).ok_or_else(|| cut(file, 16, bytes))? as usize;
        rest = bytes
            .get(offset..)
            .filter(|_| offset >= 16)
            .ok_or_else(|| cut(file, offset.max(16), bytes))?;
        due_blocks = Some(count);
    }
    let mut outputs: Vec<Blocks<'a>> = Vec::new();
    let mut count = 0_u32;
    while due_blocks.map_or(!rest.is_empty(), |due| count < due) {
        if rest.starts_with(b"BM") {
            let output = outputs
                .last_mut()
                .ok_or_else(|| damaged(file, "a picture comes before its warp map"))?;
            let (picture, after) = bitmap::Bitmap::split(rest, file)?;
            output.pictures.push(picture);
            rest = after;
        } else if matches!(rest, [b'v', b'w', b'f', b'0' | b'2' | b'3', ..]) {
            let (output, after) = split_map(rest, file)?;
            outputs.push(output);
            rest = after;
        } else if rest.is_empty() {
            return Err(damaged(file, "blocks are missing at its end"));
        } else {
            return Err(damaged(
                file,
                "what follows a block is neither a warp map nor a picture",
            ));
        }
        count += 1;
        let limit = options.limits.regions;
        if outputs.len() > limit {
            return Err(ReadError::TooMany {
                file: file.to_owned(),
                what: "warp maps or more",
                count: outputs.len() as u64,
                limit: limit as u64,
            });
        }
    }
    if outputs.is_empty() {
        return Err(damaged(file, "it holds no warp map"));
    }
    let mut notes = Vec::new();
    if !rest.is_empty() {
        notes.push(format!(
            "{file}: {} bytes after its last block are not used",
            rest.len()
        ));
    }
    Ok((outputs, notes))
}

fn split_map<'a>(bytes: &'a [u8], file: &str) -> Result<(Blocks<'a>, &'a [u8]), ReadError> {
    let header = header(bytes, file)?;
    let after_header = bytes
        .get(header.bytes..)
        .ok_or_else(|| cut(file, header.bytes, bytes))?;
    let records = after_header
        .get(..header.data_bytes)
        .ok_or_else(|| cut(file, header.data_bytes, after_header))?;
    let after = after_header.get(header.data_bytes..).unwrap_or_default();
    let blocks = Blocks {
        header,
        records,
        pictures: Vec::new(),
    };
    Ok((blocks, after))
}

fn header(bytes: &[u8], file: &str) -> Result<Header, ReadError> {
    let fixed = bytes
        .get(..HEADER_BYTES)
        .ok_or_else(|| cut(file, HEADER_BYTES, bytes))?;
    let at = |place: usize| word(fixed, place).unwrap_or(0);
    let float = |place: usize| f32::from_bits(at(place));
    let (length, flags, data_bytes) = (at(4) as usize, at(8), at(16) as usize);
    if length < HEADER_BYTES {
        return Err(damaged(
            file,
            &format!("a header of {length} bytes is shorter than {HEADER_BYTES}"),
        ));
    }
    if flags & FLAG_ZIPPED != 0 {
        return Err(refused(file, "a zipped warp map"));
    }
    if flags & !KNOWN_FLAGS != 0 {
        let unknown = flags & !KNOWN_FLAGS;
        return Err(refused(
            file,
            &format!("a warp map that is encrypted or otherwise special (flags {unknown:#x})"),
        ));
    }
    // Negative sizes become larger than any allowed one.
    let size_px = check_size(file, u64::from(at(20)), u64::from(at(24)))?;
    let due = size_px[0] as usize * size_px[1] as usize * RECORD_BYTES;
    if data_bytes != 0 && data_bytes != due {
        let [width, height] = size_px;
        return Err(damaged(
            file,
            &format!(
                "a warp map of {width} × {height} has {data_bytes} bytes of records, {due} are due"
            ),
        ));
    }
    let name = fixed.get(124..HEADER_BYTES).unwrap_or_default();
    let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
    Ok(Header {
        bytes: length,
        flags,
        data_bytes,
        size_px,
        split: [60, 64, 68, 72].map(float),
        black: [96, 100, 104].map(float),
        name: String::from_utf8_lossy(name).into_owned(),
    })
}

fn region(
    blocks: &Blocks<'_>,
    file: &str,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<Region, ReadError> {
    let header = &blocks.header;
    let label = format!("{file}, \"{}\"", header.name);
    let mapping = mapping(blocks, &label, options)?;
    check_mapping(&label, &mapping)?;
    let alpha = light(blocks, 0, &label, "alpha map")?;
    let mut beta = light(blocks, 1, &label, "black level map")?;
    let mut uplift = Uplift::default();
    if let Some(map) = &mut beta
        && header.flags & FLAG_BLACK_LEVEL != 0
    {
        let [scale, dark, bright] = header.black;
        if !(0.0..=1e3).contains(&scale)
            || ![dark, bright]
                .iter()
                .all(|share| (0.0..=1.0).contains(share))
        {
            return Err(damaged(&label, "its black level factors are out of range"));
        }
        uplift = Uplift { dark, bright };
        scale_by(map, scale);
    }
    if alpha.is_some() {
        notes.push(format!(
            "{label}: it does not tell the gamma of its blend picture; 1 is assumed"
        ));
    }
    if blocks.pictures.len() > 2 {
        notes.push(format!("{label}: its white picture is not used"));
    }
    if header.flags & FLAG_SPLIT != 0 {
        let [row, column, rows, columns] = header.split;
        notes.push(format!(
            "{label}: it is the part in row {row}, column {column} of a display of {rows} × {columns} parts"
        ));
    }
    Ok(Region {
        name: header.name.clone(),
        size_px: header.size_px,
        mapping,
        alpha,
        beta,
        gamma: Gamma::default(),
        uplift,
        canvas: None,
        distortion: None,
    })
}

/// Records in rows from the top: u, v (down), 1 if valid, 0; or x, y, z, 1 if valid.
fn mapping(blocks: &Blocks<'_>, label: &str, options: &Options) -> Result<Mapping, ReadError> {
    if blocks.header.data_bytes == 0 {
        return Ok(Mapping::Identity);
    }
    let [width, height] = blocks.header.size_px;
    let records = blocks
        .records
        .as_chunks::<RECORD_BYTES>()
        .0
        .iter()
        .map(|record| {
            let mut values = [0.0_f32; 4];
            for (value, bytes) in values.iter_mut().zip(record.as_chunks::<4>().0) {
                *value = f32::from_le_bytes(*bytes);
            }
            values
        });
    let wrong = || damaged(label, "its records do not fill its size");
    if blocks.header.flags & FLAG_POINTS != 0 {
        let unit_m = options.unit_m;
        let point = |[x, y, z, valid]: [f32; 4]| {
            let point = [x, y, z].map(|value| value * unit_m);
            if valid > 0.0 && point.iter().all(|value| value.is_finite()) {
                point
            } else {
                [f32::NAN; 3]
            }
        };
        let points_m = Grid::new(
            width,
            height,
            Placement::Centres,
            records.map(point).collect(),
        )
        .ok_or_else(wrong)?;
        return Ok(Mapping::Points {
            points_m,
            origin: PointOrigin::Unknown,
            projector: None,
        });
    }
    let place = |[u, v, valid, _]: [f32; 4]| {
        if valid > 0.0 && u.is_finite() && v.is_finite() {
            [u, v]
        } else {
            [f32::NAN; 2]
        }
    };
    Grid::new(
        width,
        height,
        Placement::Centres,
        records.map(place).collect(),
    )
    .map(Mapping::Canvas)
    .ok_or_else(wrong)
}

/// The picture at a place after the warp map; one of 0 × 0 stands for none.
fn light(
    blocks: &Blocks<'_>,
    place: usize,
    label: &str,
    what: &'static str,
) -> Result<Option<Map>, ReadError> {
    let Some(picture) = blocks.pictures.get(place) else {
        return Ok(None);
    };
    let Some(map) = picture.map(label, blocks.header.size_px)? else {
        return Ok(None);
    };
    check_light(label, what, &map)?;
    Ok(Some(map))
}

fn scale_by(map: &mut Map, scale: f32) {
    let scaled = |value: &mut f32| *value = (*value * scale).clamp(0.0, 1.0);
    match &mut map.texels {
        Texels::Grey(values) => values.iter_mut().for_each(scaled),
        Texels::Colour(values) => values.as_flattened_mut().iter_mut().for_each(scaled),
    }
}

/// A little-endian word.
fn word(bytes: &[u8], place: usize) -> Option<u32> {
    let end = place.checked_add(4)?;
    let four: [u8; 4] = bytes.get(place..end)?.try_into().ok()?;
    Some(u32::from_le_bytes(four))
}

fn cut(file: &str, expected: usize, found: &[u8]) -> ReadError {
    ReadError::Truncated {
        file: file.to_owned(),
        expected: expected as u64,
        found: found.len() as u64,
    }
}

fn damaged(file: &str, reason: &str) -> ReadError {
    ReadError::Damaged {
        file: file.to_owned(),
        reason: reason.to_owned(),
    }
}

fn refused(file: &str, what: &str) -> ReadError {
    ReadError::Unsupported {
        file: file.to_owned(),
        what: what.to_owned(),
        remedy: "Export it again without compression and encryption.",
    }
}
