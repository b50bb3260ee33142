//! The arguments of `terrawall bench refine`.
//!
//! In: the arguments of the process. Out: [`BenchRefine`], its numbers in their ranges. It reads no file.

use std::path::PathBuf;

use clap::{Args as ArgumentGroup, ValueEnum};

use super::values::seconds;

/// How meshes are made, as the scene's `refine` and `--methods` name it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum RefineMethod {
    /// The smallest mesh without gaps, whatever error that leaves
    Off,
    /// Every sample is a vertex
    Fine,
    /// Triangles are split from the coarsest on
    TopDown,
    /// Every mark is tested, short edges first
    BottomUp,
}

/// What a glance at `terrawall bench refine --help` should teach.
const NOTES: &str = "\
The sequence zooms from space onto the Mont Blanc massif, and then changes the scale, the opacity and the weight of \
elevation, as the test of Lambers (2011, section 3.6) did around Rome. Every picture is drawn until nothing is missing. \
Methods run one after another, each with empty memory. Brute force (fine) is measured in every other second of the sequence only.";

/// `terrawall bench refine`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = NOTES)]
pub(crate) struct BenchRefine {
    /// Pixels across
    #[arg(long, value_name = "PX", default_value_t = 1280, value_parser = clap::value_parser!(u32).range(64..=8192))]
    pub(crate) width: u32,
    /// Pixels down
    #[arg(long, value_name = "PX", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(64..=8192))]
    pub(crate) height: u32,
    /// How long the sequence is; two thirds of it are the zoom
    #[arg(long, value_name = "S", default_value = "24", value_parser = seconds)]
    pub(crate) seconds: f64,
    /// Pictures of each second of the sequence
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=60))]
    pub(crate) frames: u32,
    /// Side in pixels beyond which a tile is split: larger ones are fewer, and brute force needs less memory
    #[arg(long, value_name = "PX", default_value_t = 257, value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub(crate) tile_px: u32,
    /// What is measured
    #[arg(
        long,
        value_enum,
        value_name = "M,M",
        value_delimiter = ',',
        default_value = "off,fine,top-down,bottom-up"
    )]
    pub(crate) methods: Vec<RefineMethod>,
    /// Directory with the repositories etopo5/, srtm/ and imagery/, as `make data` leaves them
    #[arg(long, value_name = "DIR", default_value = "out/data")]
    pub(crate) data: PathBuf,
    /// Where refine.json, refine-rates.svg and refine-times.svg go
    #[arg(long, value_name = "DIR", default_value = "out/bench")]
    pub(crate) out: PathBuf,
    /// A short look: 6 seconds, one picture of each, 400×320 pixels
    #[arg(long, conflicts_with_all = ["width", "height", "seconds", "frames"])]
    pub(crate) quick: bool,
    /// Print the report as JSON instead of tables
    #[arg(long)]
    pub(crate) json: bool,
}

impl BenchRefine {
    /// The short form, for `bench all`: everything measured, in less than a minute on two processors.
    pub(crate) fn short(data: PathBuf, out: PathBuf) -> Self {
        Self {
            width: 0,
            height: 0,
            seconds: 0.0,
            frames: 0,
            tile_px: 257,
            methods: RefineMethod::value_variants().to_vec(),
            data,
            out,
            quick: true,
            json: false,
        }
        .settled()
    }

    /// With the numbers of the short form where that is asked for, and each method once.
    pub(crate) fn settled(mut self) -> Self {
        if self.quick {
            (self.width, self.height) = (400, 320);
            (self.seconds, self.frames) = (6.0, 1);
        }
        self.methods.sort_unstable();
        self.methods.dedup();
        self
    }
}
