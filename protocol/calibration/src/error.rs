//! Why a calibration was refused.
//! In: what went wrong while reading. Out: one enum; every message names the file, the thing in it and the
//! remedy. It decides nothing.

use std::io;

use crate::MAX_SIZE_PX;

/// Why a calibration file was refused. `file` is the name that the caller gave, followed by the part of an
/// archive where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("{file}: cannot be read: {source}. Check the path and its permissions.")]
    Unreadable {
        /// The file.
        file: String,
        /// Why.
        source: io::Error,
    },
    /// Neither the contents nor the extension tell the format.
    #[error(
        "{file}: this is no calibration that is known here. Give MPCDI, VIOSO .vwf, PFM, OBJ, \
         domeprojection .csv or a warp mesh .data, or name the format."
    )]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// More than may be read of one file or one part of an archive.
    #[error(
        "{file}: it is larger than {limit_bytes} bytes. Export it at a lower resolution, or raise the limit of a part."
    )]
    TooLarge {
        /// The file or part.
        file: String,
        /// The bound.
        limit_bytes: u64,
    },
    /// More than may be read of all parts together.
    #[error(
        "{file}: its parts together are larger than {limit_bytes} bytes. Read one region alone, split the \
         archive, or raise the limit of the whole."
    )]
    TotalTooLarge {
        /// The archive.
        file: String,
        /// The bound.
        limit_bytes: u64,
    },
    /// The bytes contradict themselves.
    #[error("{file}: it is damaged: {reason}. Export or copy it again.")]
    Damaged {
        /// The file or part.
        file: String,
        /// What is wrong.
        reason: String,
    },
    /// It ends too early.
    #[error(
        "{file}: it has {found} bytes of data, {expected} are due. Copy it again; it was cut off."
    )]
    Truncated {
        /// The file or part.
        file: String,
        /// Bytes that its header promises.
        expected: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// It goes on after its end.
    #[error(
        "{file}: it goes on after the {expected} bytes of data that its header promises. Its width or height is \
         wrong; export it again."
    )]
    Overlong {
        /// The file or part.
        file: String,
        /// Bytes that its header promises.
        expected: u64,
    },
    /// The archive names a part that it does not have.
    #[error("{file}: the archive has no part \"{part}\". Export it again with all of its files.")]
    MissingPart {
        /// The archive.
        file: String,
        /// The part.
        part: String,
    },
    /// A path that would leave the archive.
    #[error(
        "{file}: the path \"{path}\" leaves the archive. Name parts by plain relative paths with forward slashes, \
         without \"..\"."
    )]
    UnsafePath {
        /// The archive.
        file: String,
        /// The path.
        path: String,
    },
    /// More entries, regions or vertices than are read.
    #[error(
        "{file}: it has {count} {what}, at most {limit} are read. Split it, or raise the limit."
    )]
    TooMany {
        /// The file.
        file: String,
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        count: u64,
        /// The bound.
        limit: u64,
    },
    /// The chosen region is not there.
    #[error("{file}: it has no region {wanted}. It has: {known}.")]
    NoRegion {
        /// The file.
        file: String,
        /// What was asked for.
        wanted: String,
        /// The names that it has.
        known: String,
    },
    /// Two regions of one name.
    #[error("{file}: two regions are named \"{region}\". Give each region its own id.")]
    DuplicateRegion {
        /// The file.
        file: String,
        /// The name.
        region: String,
    },
    /// The description is no XML.
    #[error("{file}:{line}: {reason}. Repair the XML.")]
    Xml {
        /// The part.
        file: String,
        /// The line, from 1.
        line: u32,
        /// What is wrong.
        reason: String,
    },
    /// The description has a document type, with which entities can grow without bound.
    #[error("{file}: a document type or entity is not read. Remove the <!DOCTYPE …> from it.")]
    XmlDocumentType {
        /// The part.
        file: String,
    },
    /// Something that must be there is not.
    #[error("{file}:{line}: <{parent}> has no {wanted}. Add it, or export the file again.")]
    MissingElement {
        /// The part.
        file: String,
        /// The line of the parent, from 1.
        line: u32,
        /// The element that lacks it.
        parent: String,
        /// What it lacks.
        wanted: String,
    },
    /// A value that makes no sense.
    #[error("{file}:{line}: {key} is \"{value}\". Write {wanted}.")]
    BadValue {
        /// The file or part.
        file: String,
        /// The line, from 1.
        line: u32,
        /// What the value is for.
        key: String,
        /// The value.
        value: String,
        /// What it should be.
        wanted: String,
    },
    /// A width or height of 0 or too large.
    #[error("{file}: {width} × {height} is no size. Sizes are 1…{MAX_SIZE_PX}; export it again.")]
    BadSize {
        /// The file or part.
        file: String,
        /// Its width.
        width: u64,
        /// Its height.
        height: u64,
    },
    /// Another size than the region's.
    #[error(
        "{file}: it has {} × {} pixels, its region {} × {}. Export it at the size of the region.",
        found_px[0], found_px[1], expected_px[0], expected_px[1]
    )]
    WrongSize {
        /// The part.
        file: String,
        /// Its size.
        found_px: [u32; 2],
        /// The region's size.
        expected_px: [u32; 2],
    },
    /// A value that must be a number is none.
    #[error(
        "{file}: the {what} at column {column}, row {row} is not a number. Only geometry may have holes; export it again."
    )]
    NotANumber {
        /// The part.
        file: String,
        /// The map.
        what: &'static str,
        /// Column from the left, from 0.
        column: u32,
        /// Row from the top, from 0.
        row: u32,
    },
    /// Geometry of holes only.
    #[error("{file}: no pixel of it shows anything. Calibrate again, or choose another region.")]
    NothingMapped {
        /// The part.
        file: String,
    },
    /// A variant that is not read.
    #[error("{file}: {what} is not read. {remedy}")]
    Unsupported {
        /// The file or part.
        file: String,
        /// The variant.
        what: String,
        /// What to do instead.
        remedy: &'static str,
    },
    /// The format does not tell the output's size, and nobody else did.
    #[error(
        "{file}: a mesh does not tell the size of its output. Give the output's size in pixels with it."
    )]
    SizeNeeded {
        /// The file.
        file: String,
    },
    /// The mesh cannot be drawn.
    #[error("{file}: {source}")]
    Mesh {
        /// The file.
        file: String,
        /// Why.
        source: crate::RasteriseError,
    },
}
