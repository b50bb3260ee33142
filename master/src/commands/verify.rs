//! `terrawall verify WALL`: is the tiled wall, pixel for pixel, one picture?
//!
//! In: a wall and a scene whose camera is held. Out: how many pixels differ. Both pictures come from real node
//! processes, started as `up` starts them. How far the surface is from the data (`--error`) is `error`'s.

mod error;
mod findings;
mod places;
mod survey;

use anyhow::Context as _;
use image::GrayImage;
use protocol::report::ErrorReport;
use protocol::{Camera, Place, Scene, Wall};
use serde::Serialize;

use crate::args::Verify;
use crate::compare::{Comparison, compare};
use crate::failure::Failure;
use crate::output;

use super::{files, local, pictures};

/// What was found.
#[derive(Debug, Serialize)]
struct Findings {
    wall: String,
    scene: String,
    #[serde(flatten)]
    comparison: Comparison,
    /// Pixels of the canvas that no output shows; they are not compared.
    hidden: u64,
    /// Of the tiled wall's picture.
    error_px: ErrorReport,
    achieved_tau: Option<f64>,
}

/// Verifies a wall.
pub(crate) fn run(args: &Verify) -> Result<(), Failure> {
    if args.error {
        return error::run(args);
    }
    let (wall, mut scene) = (files::wall(&args.wall)?, files::scene(&args.scene)?);
    hold(&mut scene);
    let tiled = picture(&wall, &scene, true)
        .context("the tiled wall")
        .map_err(Failure::Failed)?;
    let single = picture(&wall.single(), &scene, false)
        .context("the single picture")
        .map_err(Failure::Failed)?;
    let mut comparison = Comparison::default();
    let mut differences: Vec<GrayImage> = Vec::new();
    let mut hidden = 0;
    for (index, (tiled, single)) in tiled.screens.iter().zip(&single.screens).enumerate() {
        let mut single = single.clone();
        hidden += hide(&wall, index, &mut single);
        let (found, difference) = compare(tiled, &single);
        comparison = comparison.and(found);
        differences.push(difference);
    }
    comparison.pixels -= hidden;
    let findings = Findings {
        wall: args.wall.display().to_string(),
        scene: args.scene.display().to_string(),
        comparison,
        hidden,
        error_px: tiled.report.error_px,
        achieved_tau: tiled.report.achieved_tau,
    };
    if let Some(path) = &args.report {
        output::json_file(path, &findings)?;
    }
    if let Some(path) = &args.difference {
        pictures::grey_png(path, stack(&differences))?;
    }
    if let Some(directory) = &args.keep {
        pictures::write(&directory.join("tiled"), &wall, &tiled.outputs)?;
        pictures::write(&directory.join("single"), &wall.single(), &single.outputs)?;
    }
    if args.json {
        output::json(&findings)?;
    } else {
        output::line(format!(
            "{} of {} pixels differ, by at most {} of 255",
            comparison.differing, comparison.pixels, comparison.max_channel_difference
        ))?;
    }
    if comparison.differing > 0 {
        return Err(Failure::failed(format!(
            "the tiled wall is not the single picture: {} of {} pixels differ",
            comparison.differing, comparison.pixels
        )));
    }
    Ok(())
}

/// What a run has shown.
struct Shown {
    outputs: Vec<master::CapturedOutput>,
    screens: Vec<image::RgbaImage>,
    report: protocol::report::Report,
}

/// Holds the camera where it begins.
fn hold(scene: &mut Scene) {
    if let Some(place) = places_of(&scene.camera).first() {
        scene.camera = Camera::Fixed(*place);
    }
}

/// The places that a camera is told to be at.
fn places_of(camera: &Camera) -> Vec<Place> {
    match camera {
        Camera::Fixed(place) => vec![*place],
        Camera::Orbit(orbit) => vec![orbit.place],
        Camera::Path(path) => path
            .keyframes
            .iter()
            .map(|keyframe| keyframe.place)
            .collect(),
    }
}

/// Renders a wall by node processes.
fn picture(wall: &Wall, scene: &Scene, measure_error: bool) -> Result<Shown, anyhow::Error> {
    let run = local::Run {
        headless: true,
        fps: None,
        frames: Some(1),
        capture: true,
        measure_error,
        digests: None,
    };
    let outcome = local::run(wall, scene, run, None)
        .map_err(Failure::into_error)?
        .outcome;
    if outcome.stopped {
        anyhow::bail!("interrupted");
    }
    let screens = pictures::compose(wall, &outcome.captures).map_err(Failure::into_error)?;
    Ok(Shown {
        outputs: outcome.captures,
        screens,
        report: outcome.report,
    })
}

/// Blackens what no output of the wall shows, as behind bezels. Returns how many pixels those are.
fn hide(wall: &Wall, screen: usize, picture: &mut image::RgbaImage) -> u64 {
    let pieces: Vec<_> = wall
        .canvas_layout()
        .into_iter()
        .filter(|piece| piece.screen == screen)
        .collect();
    let mut hidden = 0;
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let shown = pieces.iter().any(|piece| {
            let rect = piece.canvas_px;
            (rect.x..rect.right()).contains(&x) && (rect.y..rect.bottom()).contains(&y)
        });
        if !shown {
            *pixel = image::Rgba([0, 0, 0, 255]);
            hidden += 1;
        }
    }
    hidden
}

/// Pictures of differences, one below the other.
fn stack(pictures: &[GrayImage]) -> GrayImage {
    let width = pictures.iter().map(GrayImage::width).max().unwrap_or(1);
    let height = pictures.iter().map(GrayImage::height).sum();
    let mut all = GrayImage::new(width, height);
    let mut top = 0;
    for picture in pictures {
        image::imageops::replace(&mut all, picture, 0, i64::from(top));
        top += picture.height();
    }
    all
}
