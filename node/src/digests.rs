//! What a node has shown, frame by frame, as a file that can be compared with other nodes' files.
//! In: presented frames and the pixels of the outputs. Out: a file of lines of fields separated by tabs: frame,
//! revision of the scene, output, digest of the pixels, whether redrawn, whether converged. It draws nothing, and it
//! does not decide what is shown.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use crate::picture::OutputImage;

/// First line of the file: the names of its columns.
const COLUMNS: &str = "frame\trevision\toutput\tdigest\tredrawn\tconverged\n";
/// Bytes of a SHA-256 that are kept: enough that two pictures of a run never share them by chance.
const DIGEST_BYTES: usize = 16;

/// The file could not be written.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot write the digests of what is shown to {path}: {source}; name a file in a folder that exists and has room, \
     or leave --digests out",
    path = path.display()
)]
pub struct DigestError {
    /// The file.
    pub path: PathBuf,
    /// What the operating system said.
    pub source: std::io::Error,
}

/// A presented frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ShownFrame {
    /// Its number. Another master counts anew.
    pub(crate) frame: u64,
    /// The revision of the scene that its view bore.
    pub(crate) scene_revision: u64,
    /// Something had to be drawn for it.
    pub(crate) redrawn: bool,
    /// Nothing was missing in it.
    pub(crate) converged: bool,
}

/// The open file.
#[derive(Debug)]
pub(crate) struct DigestFile {
    path: PathBuf,
    file: File,
    lines: String,
}

impl DigestFile {
    /// Begins a file, in the place of an older one of this name.
    pub(crate) fn create(path: &Path) -> Result<Self, DigestError> {
        let failed = |source| DigestError {
            path: path.to_owned(),
            source,
        };
        let mut file = File::create(path).map_err(failed)?;
        file.write_all(COLUMNS.as_bytes()).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            lines: String::new(),
        })
    }

    /// Appends a line for each output. All lines of a frame leave this process at once, so that a node that is
    /// killed leaves whole frames.
    pub(crate) fn append(
        &mut self,
        shown: ShownFrame,
        outputs: &[OutputImage],
    ) -> Result<(), DigestError> {
        self.lines.clear();
        for output in outputs {
            // Writing to a text cannot fail.
            let _ = writeln!(
                self.lines,
                "{}\t{}\t{}\t{}\t{}\t{}",
                shown.frame,
                shown.scene_revision,
                output.output.escape_default(),
                digest(output),
                u8::from(shown.redrawn),
                u8::from(shown.converged),
            );
        }
        let written = self.file.write_all(self.lines.as_bytes());
        written.map_err(|source| DigestError {
            path: self.path.clone(),
            source,
        })
    }
}

/// The first bytes of the SHA-256 of the pixels, in hexadecimal digits.
fn digest(image: &OutputImage) -> String {
    let mut digits = String::with_capacity(2 * DIGEST_BYTES);
    for byte in Sha256::digest(&image.rgba).iter().take(DIGEST_BYTES) {
        let _ = write!(digits, "{byte:02x}");
    }
    digits
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use super::*;

    fn image(name: &str, width: u32, height: u32, grey: u8) -> OutputImage {
        OutputImage {
            output: name.to_owned(),
            width,
            height,
            rgba: vec![grey; (width * height * 4) as usize],
        }
    }

    fn frame(frame: u64, scene_revision: u64) -> ShownFrame {
        ShownFrame {
            frame,
            scene_revision,
            redrawn: frame == 1,
            converged: frame != 1,
        }
    }

    #[test]
    fn every_output_of_every_frame_has_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node.tsv");
        std::fs::write(&path, "what an earlier run has left\n").unwrap();
        let mut file = DigestFile::create(&path).unwrap();
        let outputs = [image("left", 4, 2, 7), image("a\tb", 4, 2, 8)];
        file.append(frame(1, 5), &outputs).unwrap();
        file.append(frame(2, 6), &outputs[..1]).unwrap();
        // Nothing waits in memory: the file is read while it is open.
        let text = std::fs::read_to_string(&path).unwrap();
        let rows: Vec<Vec<&str>> = text
            .lines()
            .map(|line| line.split('\t').collect())
            .collect();
        assert_eq!(rows[0].join("\t") + "\n", COLUMNS);
        assert_eq!(rows.len(), 4);
        assert!(rows.iter().all(|row| row.len() == 6), "{text}");
        assert_eq!(rows[1][..3], ["1", "5", "left"]);
        assert_eq!(rows[1][4..], ["1", "0"]);
        assert_eq!(rows[2][..3], ["1", "5", "a\\tb"]);
        assert_eq!(rows[3][..3], ["2", "6", "left"]);
        assert_eq!(rows[3][4..], ["0", "1"]);
        assert_eq!(rows[1][3], rows[3][3]);
        assert_ne!(rows[1][3], rows[2][3]);
    }

    #[test]
    fn a_digest_is_that_of_the_pixels_alone() {
        let picture = image("left", 4, 2, 7);
        // Of 32 bytes 07, by another program.
        assert_eq!(digest(&picture), "4bb06f8e4e3a7715d201d573d0aa4237");
        assert_eq!(digest(&picture), digest(&image("right", 4, 2, 7)));
        let mut other = picture.clone();
        other.rgba[31] ^= 1;
        assert_ne!(digest(&picture), digest(&other));
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("absent").join("node.tsv");
        let error = DigestFile::create(&path).unwrap_err().to_string();
        assert!(
            error.contains(path.to_str().unwrap()) && error.contains("--digests"),
            "{error}"
        );
        // Opened, but without room for a byte.
        let full = Path::new("/dev/full");
        if full.exists() {
            let error = DigestFile::create(full).unwrap_err().to_string();
            assert!(error.contains("/dev/full"), "{error}");
        }
    }
}
