//! Writers of calibration files for tests: each writes the layout that the reader's module cites.
//! In: known mappings. Out: bytes. They share no code with the readers.
#![allow(
    dead_code,
    clippy::unwrap_used,
    reason = "a test that panics has failed, and each test uses its own part"
)]

use std::io::{Cursor, Write as _};

use calibration::{Calibration, Options, ReadError, read};
use zip::write::{SimpleFileOptions, ZipWriter};

/// A PFM: rows of three channels from the top; the file starts with the bottom row.
pub(crate) fn pfm(width: u32, rows_from_top: &[[f32; 3]], is_little_endian: bool) -> Vec<u8> {
    let height = rows_from_top.len() / width as usize;
    let scale = if is_little_endian { "-1.0" } else { "1.0" };
    let mut bytes = format!("PF\n{width} {height}\n{scale}\n").into_bytes();
    for row in rows_from_top.chunks(width as usize).rev() {
        for value in row.iter().flatten() {
            bytes.extend(if is_little_endian {
                value.to_le_bytes()
            } else {
                value.to_be_bytes()
            });
        }
    }
    bytes
}

/// A PNG of whatever kind, from raw rows.
pub(crate) fn png(
    size: [u32; 2],
    colour: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

/// An archive of these parts.
pub(crate) fn zip(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in parts {
        writer
            .start_file(*name, SimpleFileOptions::default())
            .unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// What a description of one region is made of. The names are spelled as the reference code spells them.
#[derive(Clone)]
pub(crate) struct Description {
    pub(crate) profile: &'static str,
    pub(crate) size: [u32; 2],
    pub(crate) place: [f64; 4],
    pub(crate) inside_region: String,
    pub(crate) files: String,
}

impl Description {
    pub(crate) fn new(profile: &'static str, size: [u32; 2]) -> Self {
        let files = "<geometryWarpFile><path>warp.pfm</path><geometricUnit>cm</geometricUnit>\
                     <interpolation>linear</interpolation><originOf3DData>floorCenter</originOf3DData>\
                     </geometryWarpFile>";
        Self {
            profile,
            size,
            place: [0.0, 0.0, 1.0, 1.0],
            inside_region: String::new(),
            files: files.to_owned(),
        }
    }

    pub(crate) fn xml(&self) -> String {
        let Self {
            profile,
            size: [width, height],
            place: [x, y, xsize, ysize],
            inside_region,
            files,
        } = self;
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <MPCDI profile=\"{profile}\" level=\"1\" date=\"2026-11-23 03:00:00\" version=\"1.0\">\n\
             <display>\n<buffer id=\"b\" Xresolution=\"4000\" Yresolution=\"1000\">\n\
             <region id=\"p1\" Xresolution=\"{width}\" Yresolution=\"{height}\" x=\"{x}\" y=\"{y}\" \
             xsize=\"{xsize}\" ysize=\"{ysize}\">{inside_region}</region>\n\
             </buffer>\n</display>\n<files>\n<fileset region=\"p1\">{files}</fileset>\n</files>\n</MPCDI>\n"
        )
    }
}

pub(crate) const FRUSTUM: &str = "<frustum><yaw>-30</yaw><pitch>10</pitch><roll>5</roll><rightAngle>20</rightAngle>\
                           <leftAngle>-25</leftAngle><upAngle>15</upAngle><downAngle>-12</downAngle></frustum>";

/// A picture that follows a VIOSO warp map: bits a pixel, whether the top row comes first, and its rows from the
/// top without padding.
pub(crate) struct Bitmap {
    pub(crate) bits: u16,
    pub(crate) top_down: bool,
    pub(crate) size: [u32; 2],
    pub(crate) pixels: Vec<u8>,
}

impl Bitmap {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let [width, height] = self.size;
        let row = width as usize * usize::from(self.bits) / 8;
        let padded = row.div_ceil(4) * 4;
        let mut rows: Vec<&[u8]> = self.pixels.chunks(row.max(1)).collect();
        if !self.top_down {
            rows.reverse();
        }
        let mut bytes = b"BM".to_vec();
        bytes.extend((54 + padded as u32 * height).to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend(54_u32.to_le_bytes());
        bytes.extend(40_u32.to_le_bytes());
        bytes.extend(width.to_le_bytes());
        let height = height as i32;
        bytes.extend(if self.top_down { -height } else { height }.to_le_bytes());
        bytes.extend(1_u16.to_le_bytes());
        bytes.extend(self.bits.to_le_bytes());
        bytes.extend([0; 24]);
        for row in rows {
            bytes.extend(row);
            bytes.extend(std::iter::repeat_n(0, padded - row.len()));
        }
        bytes
    }
}

/// A VIOSO warp map: the header of 380 bytes (`extra` more), then records.
pub(crate) struct WarpMap {
    pub(crate) name: &'static str,
    pub(crate) flags: u32,
    pub(crate) size: [u32; 2],
    pub(crate) black: [f32; 3],
    pub(crate) extra: usize,
    pub(crate) records: Vec<[f32; 4]>,
}

impl WarpMap {
    pub(crate) fn new(name: &'static str, size: [u32; 2], records: Vec<[f32; 4]>) -> Self {
        Self {
            name,
            flags: 0,
            size,
            black: [1.0; 3],
            extra: 0,
            records,
        }
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut bytes = b"vwf0".to_vec();
        let words = [
            380 + self.extra as u32,
            self.flags,
            7,
            self.records.len() as u32 * 16,
        ];
        for word in words.into_iter().chain(self.size) {
            bytes.extend(word.to_le_bytes());
        }
        let mut reserved = [0.0_f32; 16];
        reserved[9..12].copy_from_slice(&self.black);
        let white_and_black = [1.0_f32, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        for value in white_and_black.into_iter().chain(reserved) {
            bytes.extend(value.to_le_bytes());
        }
        let mut name = [0; 256];
        name[..self.name.len()].copy_from_slice(self.name.as_bytes());
        bytes.extend(name);
        bytes.extend(std::iter::repeat_n(0xEE, self.extra));
        for value in self.records.iter().flatten() {
            bytes.extend(value.to_le_bytes());
        }
        bytes
    }
}

/// A set of VIOSO blocks.
pub(crate) fn vwf_set(blocks: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"vwf1".to_vec();
    for word in [blocks.len() as u32, 16, 0] {
        bytes.extend(word.to_le_bytes());
    }
    blocks.iter().for_each(|block| bytes.extend(block));
    bytes
}

/// Reads with the default options.
pub(crate) fn read_as(bytes: &[u8], name: &str) -> Result<Calibration, ReadError> {
    read(bytes, name, &Options::default())
}

/// The places of the pixels themselves.
pub(crate) fn even(width: u32, height: u32) -> Vec<[f32; 2]> {
    let share = |index: u32, size: u32| (index as f32 + 0.5) / size as f32;
    (0..height)
        .flat_map(|row| (0..width).map(move |column| [share(column, width), share(row, height)]))
        .collect()
}

/// Equal as bits, so that holes are equal too.
pub(crate) fn same<const N: usize>(one: &[[f32; N]], other: &[[f32; N]]) -> bool {
    let bits = |values: &[[f32; N]]| -> Vec<u32> {
        values
            .iter()
            .flatten()
            .map(|value| {
                if value.is_nan() {
                    u32::MAX
                } else {
                    value.to_bits()
                }
            })
            .collect()
    };
    bits(one) == bits(other)
}

const FRAME: &str = "<coordinateFrame><posx>0</posx><posy>0</posy><posz>0</posz><yawx>0</yawx><yawy>-1</yawy><yawz>0</yawz>\
    <pitchx>1</pitchx><pitchy>0</pitchy><pitchz>0</pitchz><rollx>0</rollx><rolly>0</rolly><rollz>-1</rollz></coordinateFrame>";
pub(crate) const ALPHA: &str = "<alphaMap><path>a.png</path><componentDepth>1</componentDepth><bitDepth>8</bitDepth>\
                     <gammaEmbedded>1.0</gammaEmbedded></alphaMap>";

pub(crate) fn warp() -> Vec<u8> {
    pfm(2, &[[0.25, 0.5, 0.0]; 4], true)
}

pub(crate) fn described(profile: &'static str) -> Description {
    let mut description = Description::new(profile, [2, 2]);
    description.inside_region = match profile {
        "3d" => FRUSTUM.to_owned(),
        "sl" => format!("{FRUSTUM}{FRAME}"),
        _ => String::new(),
    };
    description
}

/// What becomes of an archive with this description and a good warp.
pub(crate) fn told(xml: &str) -> ReadError {
    let error = read_as(
        &zip(&[("mpcdi.xml", xml.as_bytes()), ("warp.pfm", &warp())]),
        "a.mpcdi",
    )
    .unwrap_err();
    assert!(
        error.to_string().starts_with("a.mpcdi"),
        "it names the file: {error}"
    );
    assert!(
        error.to_string().ends_with('.'),
        "it ends with the remedy: {error}"
    );
    error
}
