//! Zip archives of SRTM cells.
//! In: an archive. Out: one source a cell. Entries are only believed up to the size of a cell, whatever they claim,
//! so that a bomb costs no more than one; nothing is written to disk.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use super::hgt;
use super::reading::Reading;
use super::{Pixels, Raster, Source};
use crate::error::SourceError;
use crate::options::ImportOptions;

/// More cells than the planet has.
const MOST_ENTRIES: usize = 100_000;

/// Opens every `.hgt` entry of an archive.
pub(super) fn open(
    path: &Path,
    file: &str,
    options: &ImportOptions,
) -> Result<Vec<Source>, SourceError> {
    let mut archive = open_archive(path, file)?;
    if archive.len() > MOST_ENTRIES {
        return Err(SourceError::refused(
            file,
            format!("it has {} entries", archive.len()),
            "An archive of SRTM cells has at most 100000; split it.",
        ));
    }
    let mut sources = Vec::new();
    for index in 0..archive.len() {
        let entry = archive
            .by_index(index)
            .map_err(|error| broken(file, &error))?;
        let name = entry
            .name()
            .map_err(|error| broken(file, &error))?
            .into_owned();
        let size = entry.size();
        if !entry.is_file() || !name.to_ascii_lowercase().ends_with(".hgt") {
            continue;
        }
        drop(entry);
        let inner = format!("{file}/{name}");
        let (mut description, reading) = hgt::describe(&inner, &name, size, options)?;
        // A packed cell has no rows to jump to: all of it is one chunk.
        let side = description.grid.width;
        description.chunk = (side, side);
        description.chunk_bytes = size * 2;
        let raster = PackedCell {
            path: path.to_owned(),
            file: inner,
            index,
            side,
            reading,
        };
        sources.push(Source::new(description, Box::new(raster)));
    }
    if sources.is_empty() {
        return Err(SourceError::refused(
            file,
            "the archive holds no .hgt cell",
            "Unpack it and import the files in it.",
        ));
    }
    Ok(sources)
}

fn open_archive(path: &Path, file: &str) -> Result<ZipArchive<BufReader<File>>, SourceError> {
    let opened = File::open(path).map_err(|error| SourceError::unreadable(file, error))?;
    ZipArchive::new(BufReader::new(opened)).map_err(|error| broken(file, &error))
}

fn broken(file: &str, error: &zip::result::ZipError) -> SourceError {
    SourceError::damaged(file, format!("the archive cannot be unpacked: {error}"))
}

struct PackedCell {
    path: PathBuf,
    file: String,
    index: usize,
    side: u32,
    reading: Reading,
}

impl Raster for PackedCell {
    fn read(&self, _column: u32, _row: u32) -> Result<Pixels, SourceError> {
        let mut archive = open_archive(&self.path, &self.file)?;
        let entry = archive
            .by_index(self.index)
            .map_err(|error| broken(&self.file, &error))?;
        let due = 2 * self.side as usize * self.side as usize;
        let mut bytes = Vec::with_capacity(due);
        entry
            .take(due as u64 + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| {
                SourceError::damaged(&self.file, format!("it cannot be unpacked: {error}"))
            })?;
        if bytes.len() != due {
            let problem = format!(
                "it unpacks to {} bytes or more instead of {due}",
                bytes.len()
            );
            return Err(SourceError::damaged(&self.file, problem));
        }
        Ok(self
            .reading
            .pixels(self.side, self.side, hgt::numbers(&bytes), None))
    }
}
