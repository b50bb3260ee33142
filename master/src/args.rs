//! The command line of `terrawall`: what can be asked, with its units and defaults.
//!
//! In: the arguments of the process. Out: [`Args`]. It must not read files or check what needs a file:
//! commands do.

mod cache;
mod control;
mod import;
mod refine;
mod serve;
mod values;
mod verify;

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args as ArgumentGroup, Parser, Subcommand};

pub(crate) use cache::{Cache, CachePlaces, ClearCache, StatCache, VerifyCache, WarmCache};
pub(crate) use control::{Adjust, Control, RunningMaster, Set, ShowPattern};
pub(crate) use import::{ByteOrder, DataKind, Import, Planet, RawType, Registration};
pub(crate) use refine::{BenchRefine, RefineMethod};
pub(crate) use serve::Serve;
pub(crate) use values::{Position, Size};
use values::{frames_per_second, pixel_share, seconds, wall_system};
pub(crate) use verify::Verify;

/// Renders the real Earth on walls of many displays, in step.
///
/// One program for every host: the master holds the state, nodes draw it, importers build the data.
/// Exit status: 0 fine, 1 a failure, 2 wrong usage or configuration. RUST_LOG=info shows what happens.
#[derive(Debug, Parser)]
#[command(name = "terrawall", version, max_term_width = 100)]
pub(crate) struct Args {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Runs a whole wall on this machine: the master, and every host of the wall as a node process
    Up(Up),
    /// Runs the master of a wall whose nodes are started on their hosts
    Master(Master),
    /// Changes the scene of a running wall, on all nodes at the same frame
    Set(Set),
    /// Measures a running wall anew: heads, corners, tilts, gamma; and saves its file with the comments kept
    Adjust(Adjust),
    /// Shows a test pattern on one output of a running wall or on all of them
    Pattern(ShowPattern),
    /// Runs one render node: the outputs of one host of the wall
    Node(Node),
    /// Builds or extends a repository of tiles from source rasters
    Import(Import),
    /// Validates a wall file, explains what is wrong or odd, and draws a plan of the room
    Check(Check),
    /// Turns a configuration of QVR, SGCT or Equalizer into a wall file, and lists what it cannot say
    Convert(Convert),
    /// Renders a wall tiled and as one picture, and compares the pixels; with --error, measures how far the drawn
    /// surface is from the data
    Verify(Verify),
    /// Tells what is in a repository or a tile, checksums and single values included
    Inspect(Inspect),
    /// Serves a repository, or a directory of them, over HTTP to the nodes of walls
    Serve(Serve),
    /// Looks through the disk cache that the nodes of walls share: what is in it, whether it is whole; empties or
    /// fills it
    #[command(subcommand)]
    Cache(Cache),
    /// Measures this build on this machine
    #[command(subcommand)]
    Bench(Bench),
    /// Makes the certificates by which the hosts of a wall know each other
    #[command(subcommand)]
    Identity(Identity),
}

/// What both `up` and `master` take.
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Show {
    /// Wall file: observers, screens, hosts and their outputs
    pub(crate) wall: PathBuf,
    /// Scene file: planet, layers, light and camera
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// Render without windows, even where there is a display
    #[arg(long)]
    pub(crate) headless: bool,
    /// Draw only this share of the pixels along each side, 0.01…1: to try a large wall on a small machine
    #[arg(long, value_name = "SHARE", value_parser = pixel_share)]
    pub(crate) pixels: Option<f64>,
    /// Stop after this many frames; without it, run until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Frames per second [default: the wall file's]
    #[arg(long, value_name = "F", value_parser = frames_per_second)]
    pub(crate) fps: Option<f64>,
    /// At the end, wait until all nodes say that the picture has converged, then write every output
    /// as a PNG and the composed wall as wall.png into this directory
    #[arg(long, value_name = "DIR")]
    pub(crate) capture: Option<PathBuf>,
    /// Write what was measured as JSON; at the end every node measures the error of its last picture for it, which may
    /// take seconds
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print the same as JSON on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// Leave the error of the last picture unmeasured, and the run ends at once
    #[arg(long)]
    pub(crate) no_error: bool,
    /// Who may change the scene while it is shown.
    #[command(flatten)]
    pub(crate) control: Control,
}

impl Show {
    /// Whether somebody will read the error of the last picture.
    pub(crate) fn wants_error(&self) -> bool {
        (self.report.is_some() || self.json) && !self.no_error
    }
}

/// `terrawall up`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Up {
    /// What to show.
    #[command(flatten)]
    pub(crate) show: Show,
    /// Let every node write a digest of each of its outputs after every frame to NAME.tsv in this directory:
    /// proof of what was shown at every frame; costs a read-back per frame
    #[arg(long, value_name = "DIRECTORY")]
    pub(crate) digests: Option<PathBuf>,
}

/// `terrawall master`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Master {
    /// What to show.
    #[command(flatten)]
    pub(crate) show: Show,
    /// Address and UDP port at which nodes find the master
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "0.0.0.0:7400")]
    pub(crate) listen: SocketAddr,
    /// Directory of the cluster's identity, made by `terrawall identity create`
    #[arg(long, value_name = "DIR")]
    pub(crate) identity: PathBuf,
    /// Begin with the nodes that are there after this time; the others may come later
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    pub(crate) wait: f64,
}

/// `terrawall node`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Node {
    /// Where the master listens
    #[arg(long, value_name = "HOST:PORT")]
    pub(crate) master: String,
    /// Name of this host in the wall file
    #[arg(long, value_name = "NAME")]
    pub(crate) name: String,
    /// Directory of the cluster's identity, copied from the master's host
    #[arg(long, value_name = "DIR")]
    pub(crate) identity: PathBuf,
    /// Render without windows, even where there is a display
    #[arg(long)]
    pub(crate) headless: bool,
    /// Write a line per output after every frame to this file: frame, revision of the scene, output, digest of
    /// its pixels (first 16 bytes of the SHA-256), whether it was redrawn and had converged. It is proof of what
    /// was shown at every frame; costs a read-back per frame
    #[arg(long, value_name = "FILE")]
    pub(crate) digests: Option<PathBuf>,
    /// End when standard input closes: set for the nodes that `terrawall up` starts
    #[arg(long, hide = true)]
    pub(crate) leave_with_parent: bool,
}

/// `terrawall check`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Check {
    /// Wall file
    pub(crate) wall: PathBuf,
    /// Draw the room from above, from the front and from the right
    #[arg(long, value_name = "SVG")]
    pub(crate) plan: Option<PathBuf>,
    /// Print the findings as JSON on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall convert`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Convert {
    /// Configuration of QVR (.qvr), SGCT (.json) or Equalizer (.eqc)
    pub(crate) file: PathBuf,
    /// The system it is of, where the ending does not tell: qvr, sgct or eqc
    #[arg(long, value_name = "SYSTEM", value_parser = wall_system)]
    pub(crate) format: Option<convert::Format>,
    /// Wall file to write; without it, it goes to standard output
    #[arg(long, value_name = "TOML")]
    pub(crate) into: Option<PathBuf>,
    /// Write over a file that is there
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// `terrawall inspect`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct Inspect {
    /// Repository directory or tile file
    #[arg(value_name = "DIR|TILE")]
    pub(crate) path: PathBuf,
    /// Read the value at a geodetic position in degrees, bilinear on the lattice
    #[arg(long, value_name = "LAT,LON", allow_hyphen_values = true)]
    pub(crate) at: Option<Position>,
    /// Read at this level of the pyramid [default: the finest with data there]
    #[arg(long, value_name = "L", requires = "at")]
    pub(crate) level: Option<u8>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench`
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Swap skew and state latency across real node processes
    Sync(BenchSync),
    /// Cold starts of a wall: how many give a complete wall, and how fast
    Starts(BenchStarts),
    /// Frame times of one 1280×720 output on the local adapter
    Frame(BenchFrame),
    /// Tiles a second of every processing stage, beside copies of the same bytes on the same adapter
    Process(BenchProcess),
    /// Cost, triangles and error of refined meshes over a zoom and changes of elevation, beside brute force
    Refine(BenchRefine),
    /// CPU time and bytes of imports, beside gdal2tiles where GDAL is installed
    Import(BenchImport),
    /// Reads of the repository by nodes that share one disk cache, and times from wanted to drawable
    Cache(BenchCache),
    /// All of the above, with plots
    All(BenchAll),
}

/// `terrawall bench sync`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchSync {
    /// Node processes
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub(crate) nodes: u32,
    /// Pixels of each node
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "96x54")]
    pub(crate) size: Size,
    /// Frames per second
    #[arg(long, value_name = "F", default_value = "60", value_parser = frames_per_second)]
    pub(crate) fps: f64,
    /// How long to measure
    #[arg(long, value_name = "S", default_value = "30", value_parser = seconds)]
    pub(crate) seconds: f64,
    /// Scene to draw [default: a bare turning Earth]
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// Write the report as JSON, with the keys of `terrawall up --report`
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print the report as JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench starts`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchStarts {
    /// Node processes of each start
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub(crate) nodes: u32,
    /// Starts
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) runs: u32,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench frame`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchFrame {
    /// Directory with the repositories elevation/ and imagery/, as `make data` leaves them
    #[arg(long, value_name = "DIR", default_value = "out/data")]
    pub(crate) data: PathBuf,
    /// Frames to time of each view
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) frames: u32,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench process`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchProcess {
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench import`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchImport {
    /// Directory with etopo5.tif and bmng.jpg
    #[arg(long, value_name = "DIR", default_value = "tests/data")]
    pub(crate) sources: PathBuf,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench cache`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchCache {
    /// Directory with the repositories elevation/ and imagery/, as `make data` leaves them
    #[arg(long, value_name = "DIR", default_value = "out/data")]
    pub(crate) data: PathBuf,
    /// Node processes
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) nodes: u32,
    /// Frames per second; the path takes a minute at any
    #[arg(long, value_name = "F", default_value = "10", value_parser = frames_per_second)]
    pub(crate) fps: f64,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// `terrawall bench all`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct BenchAll {
    /// Where reports and plots go
    #[arg(long, value_name = "DIR", default_value = "out/bench")]
    pub(crate) out: PathBuf,
}

/// `terrawall identity`
#[derive(Debug, Subcommand)]
pub(crate) enum Identity {
    /// Makes a new cluster: keep ca.key at home, copy ca.pem, member.pem and member.key to every host
    Create {
        /// Directory to make; must not hold an identity
        #[arg(value_name = "DIR")]
        directory: PathBuf,
    },
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn negative_numbers_need_no_quotes() {
        let args =
            Args::try_parse_from(["terrawall", "inspect", "out", "--at", "-33.9,151.2"]).unwrap();
        let Command::Inspect(inspect) = args.command else {
            panic!("another command")
        };
        assert_eq!(
            inspect.at,
            Some(Position {
                latitude_deg: -33.9,
                longitude_deg: 151.2
            })
        );
        for extent in ["--extent=-180,-90,180,90", "--extent -180,-90,180,90"] {
            let words = "terrawall import a.png --into o --kind imagery"
                .split(' ')
                .chain(extent.split(' '));
            let Command::Import(import) = Args::try_parse_from(words).unwrap().command else {
                panic!()
            };
            assert_eq!(import.extent.unwrap().west, -180.0);
        }
    }

    #[test]
    fn wrong_values_are_refused_with_what_to_write() {
        for (line, hint) in [
            ("inspect out --at 91,0", "latitude (-90 to 90)"),
            ("inspect out --at 1", "2 numbers"),
            (
                "import a.png --into o --kind imagery --extent 0,10,20,5",
                "west,south,east,north",
            ),
            (
                "import a.png --into o --kind imagery --extent 0,nan,10,10",
                "4 numbers",
            ),
            ("import a.png --into o --kind relief", "elevation"),
            ("bench sync --size 96", "WIDTHxHEIGHT"),
            ("verify w.toml --scene s.toml --views 9", "--error"),
            ("verify w.toml --scene s.toml --seed 9", "--error"),
            (
                "verify w.toml --scene s.toml --error --views 0",
                "1..=1000000",
            ),
            (
                "verify w.toml --scene s.toml --error --keep d",
                "cannot be used with",
            ),
            ("up w.toml --scene s.toml --fps 0", "frames per second"),
            ("up w.toml", "--scene"),
            ("up w.toml --scene s.toml --control 4680", "--control"),
            (
                "up w.toml --scene s.toml --no-control --control 127.0.0.1:1",
                "--no-control",
            ),
            ("set", "LAYER.PARAM=VALUE"),
        ] {
            let error =
                Args::try_parse_from(["terrawall"].into_iter().chain(line.split(' '))).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{line}");
            assert!(error.to_string().contains(hint), "{line}: {error}");
        }
    }
}
