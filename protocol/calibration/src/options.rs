//! What a reader is told besides the bytes.
//! In: nothing. Out: [`Options`] with defaults that suit files which describe themselves. It reads nothing.

use std::fmt;

/// How to read a calibration. The default reads every region of a file that describes itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The region to read; `None`: all of them. Parts of other regions are not unpacked.
    pub region: Option<Choice>,
    /// The format; `None`: the contents tell it, then the extension.
    pub format: Option<Format>,
    /// The output's size in pixels, for formats that do not tell it: meshes need it; for a PFM alone it
    /// replaces the PFM's own size. MPCDI and VIOSO files tell theirs.
    pub size_px: Option<[u32; 2]>,
    /// What the channels of a PFM alone are.
    pub pfm: PfmMeaning,
    /// Which row of a PFM comes first, alone or in an archive.
    pub pfm_rows: RowOrder,
    /// What the vertices of an OBJ are.
    pub obj: ObjMeaning,
    /// Metres in a unit of the points of a PFM alone, an OBJ or a VIOSO file. (MPCDI tells its unit.)
    pub unit_m: f32,
    /// Bounds on what is read.
    pub limits: Limits,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            region: None,
            format: None,
            size_px: None,
            pfm: PfmMeaning::Points,
            pfm_rows: RowOrder::BottomFirst,
            obj: ObjMeaning::Told,
            unit_m: 1.0,
            limits: Limits::default(),
        }
    }
}

/// Which region of several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// By its name. Where no region has this name and it is a whole number, it is a place in the file, from 0.
    Name(String),
    /// By its place in the file, from 0.
    Number(usize),
}

impl Choice {
    /// The place among `names`, where there is one.
    #[must_use]
    pub fn among(&self, names: &[&str]) -> Option<usize> {
        match self {
            Self::Name(name) => names.iter().position(|known| known == name).or_else(|| {
                let number = name.parse().ok()?;
                (number < names.len()).then_some(number)
            }),
            Self::Number(number) => (*number < names.len()).then_some(*number),
        }
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => write!(formatter, "\"{name}\""),
            Self::Number(number) => write!(formatter, "number {number} (from 0)"),
        }
    }
}

/// A format of calibration files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// VESA Multiple Projection Common Data Interchange: a zip archive.
    Mpcdi,
    /// Portable float map.
    Pfm,
    /// Wavefront OBJ.
    Obj,
    /// The mesh of a domeprojection.com calibration as text.
    Domeprojection,
    /// Paul Bourke's warp mesh as text.
    Bourke,
    /// VIOSO warp file.
    Vwf,
}

/// What the three channels of a PFM alone are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PfmMeaning {
    /// Points of the screen: x, y, z.
    #[default]
    Points,
    /// Points of the source picture: u to the right and v up, as in MPCDI's 2d profile; the third channel
    /// is not used.
    Canvas,
}

/// Which row comes first in a PFM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowOrder {
    /// The bottom row, as the format says.
    #[default]
    BottomFirst,
    /// The top row, as some writers do.
    TopFirst,
}

/// What the vertices of an OBJ are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ObjMeaning {
    /// The file tells: [`ObjMeaning::Warp`] where all z are 0, else [`ObjMeaning::Surface`].
    #[default]
    Told,
    /// `v` is a place on the output, −1…1 to the right and up; `vt` the place in the source picture,
    /// 0…1 to the right and up.
    Warp,
    /// `v` is a point of the screen; `vt` the place on the output, 0…1 to the right and up.
    Surface,
}

/// Bounds on what is read. They hold while unpacking, whatever an archive says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one part. Default 512 MiB: a PFM of 8192 × 4320 has 405 MiB.
    pub part_bytes: u64,
    /// Bytes of all parts that are read together. Default 2 GiB.
    pub total_bytes: u64,
    /// Regions of a file. Default 256.
    pub regions: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            part_bytes: 512 << 20,
            total_bytes: 2 << 30,
            regions: 256,
        }
    }
}
