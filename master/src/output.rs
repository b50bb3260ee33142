//! Results: lines and JSON on standard output, and files that are there whole or not at all.
//!
//! In: values. Out: text and files. Progress and logs do not pass here: they go to standard error.

use std::io::Write as _;
use std::path::Path;

use anyhow::Context as _;
use serde::Serialize;

use crate::failure::Failure;

/// A number of things, in words: `1 frame`, `2 frames`.
pub(crate) fn counted(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

/// Prints text and a newline. A reader that has closed its end (`| head`) is no failure.
pub(crate) fn line(text: impl std::fmt::Display) -> Result<(), Failure> {
    match writeln!(std::io::stdout().lock(), "{text}") {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")?
        }
        _ => Ok(()),
    }
}

/// Prints a value as indented JSON.
pub(crate) fn json(value: &impl Serialize) -> Result<(), Failure> {
    line(serde_json::to_string_pretty(value).context("cannot express the result as JSON")?)
}

/// Writes a value as indented JSON into a file.
pub(crate) fn json_file(path: &Path, value: &impl Serialize) -> Result<(), Failure> {
    let mut text =
        serde_json::to_string_pretty(value).context("cannot express the result as JSON")?;
    text.push('\n');
    file(path, text.as_bytes())
}

/// Writes a file whole or not at all, making its folder where needed.
pub(crate) fn file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let write = || -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        let name = path
            .file_name()
            .ok_or(std::io::ErrorKind::InvalidFilename)?
            .to_string_lossy();
        let partial = folder.join(format!(".{name}.{}", std::process::id()));
        let written =
            std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, path));
        if written.is_err() {
            // The first error is the one to tell; the partial file may not even exist.
            let _ = std::fs::remove_file(&partial);
        }
        written
    };
    write().with_context(|| format!("cannot write {}", path.display()))?;
    Ok(())
}

/// Prints rows as a table: first column to the left, numbers to the right.
pub(crate) fn table(head: &[&str], rows: &[Vec<String>]) -> Result<(), Failure> {
    let width = |column: usize| {
        let cells = rows
            .iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count());
        cells
            .chain(head.get(column).map(|cell| cell.chars().count()))
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let print = |cells: &[&str]| {
        let cells = cells
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(column, (cell, width))| {
                if column == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        line(cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    print(head)?;
    for row in rows {
        print(&row.iter().map(String::as_str).collect::<Vec<_>>())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn a_file_is_there_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/report.json");
        json_file(&path, &[1, 2]).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "[\n  1,\n  2\n]\n");
        // A folder stands where the file should go: nothing is left beside it.
        std::fs::create_dir(folder.path().join("taken")).unwrap();
        let failure = file(&folder.path().join("taken"), b"x")
            .unwrap_err()
            .to_string();
        assert!(failure.contains("taken"), "{failure}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
