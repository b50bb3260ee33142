//! The command line of `terrawall cache`.
//!
//! In: the arguments of the process. Out: [`Cache`]. Which directories there are, and what is in them, is the commands'
//! business.

use std::path::PathBuf;

use clap::{Args as ArgumentGroup, Subcommand};

use super::values::{seconds, seconds_or_none};

/// What a glance at `terrawall cache stat --help` should teach.
const OF_STAT: &str = "\
A disk cache keeps tiles as they are when decoded, one file each, in groups: one for each import into a repository. A \
group is named by the id of its data set and the number of the import; --scene and --repository tell which data set that \
is. Groups of earlier imports are of no use any more, and go first when room is needed. Unfinished files and leases are \
those of processes that write now, or were killed; the cache clears them up by itself. Foreign files are no part of \
the cache: nobody touches them.

Examples:
  terrawall cache stat
  terrawall cache stat --wall wall.toml --scene scene.toml
  terrawall cache stat /shared/terrawall --json";

/// What a glance at `terrawall cache verify --help` should teach.
const OF_VERIFY: &str = "\
Every file is read as it is on the disk and held against the checksums in its header, its name included. No tile is \
decoded: a file whose checksums hold is what was written. Nodes do the same whenever they read a file and fetch anew \
what is broken, so this is for disks that are in doubt. It may run while walls run.

Exit status: 0 where all files are good, or --remove has removed all that are not; else 1.

Examples:
  terrawall cache verify
  terrawall cache verify /shared/terrawall --remove";

/// What a glance at `terrawall cache clear --help` should teach.
const OF_CLEAR: &str = "\
Removes the cached files and nothing else: foreign files stay, and so do the directory and the books of processes that \
use it. Nothing is lost but time: nodes fetch what they need from its repository again. It may run while walls run.

Examples:
  terrawall cache clear --wall wall.toml
  terrawall cache clear /shared/terrawall --yes";

/// What a glance at `terrawall cache warm --help` should teach.
const OF_WARM: &str = "\
Flies the scene's camera along its path without drawing, and brings every tile into the wall's disk cache that any \
channel of any host would show on the way, with the viewers' heads at rest. Run it on one of the wall's hosts, or on \
any machine that sees the same cache directory, with the same wall file: the budgets of the GPU decide how fine the \
tiles are. A graphics driver is needed, a software one will do. What is in the cache already is not read from its \
repository again, so it may be stopped and started at will, and run while the wall runs.

The path ends at its last keyframe; where the camera circles, after one turn; where it stands still, at once. Between \
two steps of a fast path, tiles may be needed for a moment that neither step needs: take smaller steps then. The \
tiles have to fit: cache.disk_mib of the wall is the budget.

Exit status: 0 where every tile is on the disk; 1 where some are not, with the reasons; 2 where wall or scene are wrong.

Examples:
  terrawall cache warm wall.toml --scene alps.toml
  terrawall cache warm wall.toml --scene alps.toml --seconds 0";

/// `terrawall cache`
#[derive(Debug, Subcommand)]
pub(crate) enum Cache {
    /// Tells what is in a disk cache, by data set, and who uses it
    Stat(StatCache),
    /// Holds every file of a disk cache against its checksums
    Verify(VerifyCache),
    /// Empties a disk cache
    Clear(ClearCache),
    /// Fills a wall's disk cache with all that a scene's camera path shows
    Warm(WarmCache),
}

/// Which caches.
#[derive(Debug, ArgumentGroup)]
pub(crate) struct CachePlaces {
    /// Cache directories [default: that of this user, terrawall in $XDG_CACHE_HOME or ~/.cache]
    #[arg(value_name = "DIR")]
    pub(crate) directories: Vec<PathBuf>,
    /// The cache directory of this wall instead
    #[arg(long, value_name = "WALL", conflicts_with = "directories")]
    pub(crate) wall: Option<PathBuf>,
}

/// `terrawall cache stat`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = OF_STAT)]
pub(crate) struct StatCache {
    /// Which.
    #[command(flatten)]
    pub(crate) places: CachePlaces,
    /// Name groups by the data sets of this scene's layers
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// Name groups by this repository's data set: a directory or an address; may be repeated
    #[arg(long, value_name = "PLACE")]
    pub(crate) repository: Vec<PathBuf>,
    /// Print JSON: a list with an object for each directory
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall cache verify`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = OF_VERIFY)]
pub(crate) struct VerifyCache {
    /// Which.
    #[command(flatten)]
    pub(crate) places: CachePlaces,
    /// Remove what is broken; nodes fetch it again
    #[arg(long)]
    pub(crate) remove: bool,
}

/// `terrawall cache clear`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = OF_CLEAR)]
pub(crate) struct ClearCache {
    /// Which.
    #[command(flatten)]
    pub(crate) places: CachePlaces,
    /// Do not ask first; needed where there is no terminal to ask on
    #[arg(long)]
    pub(crate) yes: bool,
}

/// `terrawall cache warm`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = OF_WARM)]
pub(crate) struct WarmCache {
    /// Wall file: its hosts decide which tiles, its [cache] where they go
    pub(crate) wall: PathBuf,
    /// Scene file: its camera is the path, its layers the data
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// Seconds of the path between two views
    #[arg(long, value_name = "S", default_value = "0.25", value_parser = seconds)]
    pub(crate) step: f64,
    /// Seconds of the path, from its beginning; 0 is the first view alone [default: the path's length]
    #[arg(long, value_name = "S", value_parser = seconds_or_none)]
    pub(crate) seconds: Option<f64>,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
