//! The arguments of `terrawall verify`.
//!
//! In: the arguments of the process. Out: [`Verify`], its numbers in their ranges. It reads no file.

use std::path::PathBuf;

use clap::Args as ArgumentGroup;

/// What a glance at `terrawall verify --help` should teach.
const NOTES: &str = "\
Without --error, real node processes render the wall twice, tiled and as one picture, which must not differ in any pixel.

With --error, the wall's outputs are drawn in this process, one host after the other, from N views: first the scene's own \
camera, then places drawn at random: anywhere, at the poles, on the edges and corners of the cube, and where the data is \
finest; from three radii away down to 2 m above the ground, from straight down to above the horizon. Every third view the \
elevation's parameters and the lenses change. Each view is measured as soon as it is drawn, while its tiles still arrive, \
again once nothing is missing, and, where parameters change, right after that: every sample of elevation in view, its true \
place on the wall against the drawn surface. A sample further off than the scene's mesh.tau, or one that no triangle covers, \
is a failure (exit status 1) that names the view. The same seed gives the same views.";

/// `terrawall verify`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = NOTES)]
pub(crate) struct Verify {
    /// Wall file; its screens must be planar
    pub(crate) wall: PathBuf,
    /// Scene file; its camera is held at its first pose
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// Measure how far the drawn surface is from the data, in pixels, instead of comparing pictures
    #[arg(long, conflicts_with_all = ["difference", "keep"])]
    pub(crate) error: bool,
    /// Views to measure
    #[arg(long, value_name = "N", default_value_t = 20, requires = "error", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) views: u32,
    /// What random views and changes are drawn from
    #[arg(long, value_name = "S", default_value_t = 1, requires = "error")]
    pub(crate) seed: u64,
    /// Write pixels, differing, max_channel_difference and error_px as JSON; with --error, error_px, the worst view and
    /// figures by height
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Print the same as JSON on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// Write a picture of the differences, white where pixels differ
    #[arg(long, value_name = "PNG")]
    pub(crate) difference: Option<PathBuf>,
    /// Keep the two pictures, tiled/ and single/, in this directory
    #[arg(long, value_name = "DIR")]
    pub(crate) keep: Option<PathBuf>,
}
