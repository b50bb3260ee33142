//! `terrawall cache`: looking after the disk caches that nodes share.
//!
//! In: directories, or a wall that names one. Out: what is in them, what is broken, what was removed. Nothing here needs
//! the nodes to stop. It must not touch files that are not the cache's.

mod stat;
mod warm;

use std::io::{BufRead as _, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use node::cache::{self, MaintenanceError};

use crate::args::{Cache, CachePlaces, ClearCache, VerifyCache};
use crate::failure::{Failure, OrConfiguration as _};
use crate::{interrupt, output};

use super::files;

/// Runs the command.
pub(crate) fn run(args: Cache) -> Result<(), Failure> {
    match args {
        Cache::Stat(args) => stat::run(&args),
        Cache::Verify(args) => verify(&args),
        Cache::Clear(args) => clear(&args),
        Cache::Warm(args) => warm::run(&args),
    }
}

/// Megabytes, for people.
fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// A bar on standard error.
fn bar(template: &str) -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// The directories that were asked for, each of which is there.
fn directories(places: &CachePlaces) -> Result<Vec<PathBuf>, Failure> {
    let directories = match &places.wall {
        Some(wall) => vec![of_wall(wall)?],
        None if places.directories.is_empty() => {
            vec![cache::user_directory().ok_or_else(homeless)?]
        }
        None => places.directories.clone(),
    };
    for directory in &directories {
        let metadata = std::fs::metadata(directory)
            .with_context(|| {
                format!(
                    "there is no cache directory {}; nodes make it when they first show a wall: name that \
                     of a wall ([cache] directory), or the wall itself with --wall",
                    directory.display()
                )
            })
            .or_configuration()?;
        if !metadata.is_dir() {
            return Err(Failure::configuration(format!(
                "{} is a file, no cache directory; name the directory above its groups, or a wall with --wall",
                directory.display()
            )));
        }
    }
    Ok(directories)
}

/// Where a wall keeps its cache.
fn of_wall(file: &Path) -> Result<PathBuf, Failure> {
    cache::directory(&files::wall(file)?).ok_or_else(homeless)
}

fn homeless() -> Failure {
    Failure::configuration(
        "neither XDG_CACHE_HOME nor HOME is set, so this user has no cache directory; name one, or write \
         directory = \"/where/it/is\" under [cache] in the wall file",
    )
}

/// A directory that cannot be looked through was asked for wrongly more often than it is broken.
fn refused(error: MaintenanceError) -> Failure {
    Failure::configuration(error)
}

/// Reads all files and names the broken ones.
fn verify(args: &VerifyCache) -> Result<(), Failure> {
    let mut bad = 0;
    for directory in directories(&args.places)? {
        bad += verify_one(&directory, args.remove)?;
    }
    match bad {
        0 => Ok(()),
        _ if args.remove => Err(Failure::failed(format!(
            "{bad} files cannot be read or removed: remove them by hand, and check the disk and the permissions"
        ))),
        _ => Err(Failure::failed(format!(
            "{bad} files are broken or cannot be read; add --remove, and nodes fetch them again"
        ))),
    }
}

/// How many files of a directory are still bad at the end.
fn verify_one(directory: &Path, remove: bool) -> Result<u64, Failure> {
    let bar = bar("verifying [{bar:40}] {bytes}/{total_bytes} {eta} left {msg}");
    let mut read = 0;
    let mut of = 0;
    let found = cache::verify(directory, remove, |done, all| {
        bar.set_length(all.bytes);
        bar.set_position(done.bytes);
        (read, of) = (done.files, all.files);
        !interrupt::requested()
    });
    bar.finish_and_clear();
    let found = found.map_err(refused)?;
    for (name, broken) in &found.broken {
        let path = directory.join(name.file());
        output::line(format!("{}: {broken}", path.display()))?;
    }
    for (name, problem) in &found.unreadable {
        let path = directory.join(name.file());
        output::line(format!("{}: {problem}", path.display()))?;
    }
    if read < of {
        return Err(Failure::failed(format!(
            "stopped after {read} of {of} files of {}",
            directory.display()
        )));
    }
    // What could not be removed is named twice: as broken, and with what the system said.
    let stays = |name| found.unreadable.iter().any(|(other, _)| other == name);
    let removed = match remove {
        true => found.broken.iter().filter(|(name, _)| !stays(name)).count(),
        false => 0,
    };
    output::line(format!(
        "{}: {} files ({}) good, {} broken ({removed} removed), {} unreadable",
        directory.display(),
        found.good.files,
        megabytes(found.good.bytes),
        found.broken.len(),
        found.unreadable.len(),
    ))?;
    let broken = if remove { 0 } else { found.broken.len() };
    Ok((broken + found.unreadable.len()) as u64)
}

/// Removes all cached files, after having asked.
fn clear(args: &ClearCache) -> Result<(), Failure> {
    let directories = directories(&args.places)?;
    for directory in &directories {
        if !args.yes && !agreed(directory)? {
            output::line(format!("{}: left as it is", directory.display()))?;
            continue;
        }
        let removed = cache::clear(directory)?;
        output::line(format!(
            "{}: removed {} files ({})",
            directory.display(),
            removed.files,
            megabytes(removed.bytes)
        ))?;
    }
    Ok(())
}

/// Asks whether a directory is to be cleared.
fn agreed(directory: &Path) -> Result<bool, Failure> {
    let input = std::io::stdin();
    if !input.is_terminal() {
        return Err(Failure::configuration(format!(
            "nobody can be asked here whether {} is to be emptied; add --yes",
            directory.display()
        )));
    }
    let all = cache::statistics(directory).map_err(refused)?.all;
    eprint!(
        "terrawall: remove {} files ({}) from {}? [y/N] ",
        all.files,
        megabytes(all.bytes),
        directory.display()
    );
    std::io::stderr().flush().context("cannot ask")?;
    let mut answer = String::new();
    input
        .lock()
        .read_line(&mut answer)
        .context("cannot read the answer")?;
    let answer = answer.trim();
    Ok(answer.eq_ignore_ascii_case("y") || answer.eq_ignore_ascii_case("yes"))
}
