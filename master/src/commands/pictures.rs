//! Captured outputs as files: one PNG an output, and the composed wall.
//!
//! In: a wall and the pixels of its outputs. Out: pictures of its screens, and PNG files.

use std::io::Cursor;
use std::path::Path;

use anyhow::Context as _;
use image::{DynamicImage, GenericImage as _, GenericImageView as _, ImageFormat, RgbaImage};
use master::CapturedOutput;
use protocol::Wall;

use crate::failure::Failure;
use crate::output;

/// Writes `HOST-OUTPUT.png` for every output and `wall.png`. With several screens, `screen-NAME.png` for
/// each of them, and `wall.png` shows them side by side.
pub(crate) fn write(
    directory: &Path,
    wall: &Wall,
    outputs: &[CapturedOutput],
) -> Result<(), Failure> {
    for output in outputs {
        let name = file_name(&format!("{}-{}", output.host, output.output), "png");
        png(&directory.join(name), &picture(output)?)?;
    }
    let screens = compose(wall, outputs)?;
    if screens.len() > 1 {
        for (screen, picture) in wall.screens.iter().zip(&screens) {
            png(
                &directory.join(file_name(&format!("screen-{}", screen.name), "png")),
                picture,
            )?;
        }
    }
    png(&directory.join("wall.png"), &side_by_side(&screens)?)
}

/// One picture for each screen, put together from the outputs that show it; black where none does.
pub(crate) fn compose(wall: &Wall, outputs: &[CapturedOutput]) -> Result<Vec<RgbaImage>, Failure> {
    let mut screens: Vec<RgbaImage> = wall
        .screens
        .iter()
        .map(|screen| {
            RgbaImage::from_pixel(
                screen.size_px[0],
                screen.size_px[1],
                image::Rgba([0, 0, 0, 255]),
            )
        })
        .collect();
    for piece in wall.canvas_layout() {
        let belongs = |output: &&CapturedOutput| {
            output.host_index == piece.host && output.output_index == piece.output
        };
        let (Some(output), Some(screen)) =
            (outputs.iter().find(belongs), screens.get_mut(piece.screen))
        else {
            return Err(Failure::failed("the capture lacks an output of the wall"));
        };
        let (rect, [x, y]) = (piece.canvas_px, piece.output_px);
        let picture = picture(output)?;
        let part = picture.try_view(x, y, rect.width, rect.height)?;
        screen.copy_from(&*part, rect.x, rect.y)?;
    }
    Ok(screens)
}

/// Pictures from left to right, upper edges aligned.
fn side_by_side(pictures: &[RgbaImage]) -> Result<RgbaImage, Failure> {
    let width = pictures.iter().map(RgbaImage::width).sum();
    let height = pictures.iter().map(RgbaImage::height).max().unwrap_or(0);
    let mut all = RgbaImage::from_pixel(width, height, image::Rgba([0, 0, 0, 255]));
    let mut left = 0;
    for picture in pictures {
        all.copy_from(picture, left, 0)?;
        left += picture.width();
    }
    Ok(all)
}

fn picture(output: &CapturedOutput) -> Result<RgbaImage, Failure> {
    let picture = RgbaImage::from_raw(output.width, output.height, output.rgba.clone());
    Ok(picture.with_context(|| {
        format!(
            "output {} of {} sent too few pixels",
            output.output, output.host
        )
    })?)
}

/// Writes a PNG, whole or not at all. Walls have no transparency, and viewers should not invent any.
pub(crate) fn png(path: &Path, picture: &RgbaImage) -> Result<(), Failure> {
    encode(
        path,
        DynamicImage::ImageRgba8(picture.clone()).to_rgb8().into(),
    )
}

/// Writes a grey PNG, whole or not at all.
pub(crate) fn grey_png(path: &Path, picture: image::GrayImage) -> Result<(), Failure> {
    encode(path, picture.into())
}

fn encode(path: &Path, picture: DynamicImage) -> Result<(), Failure> {
    let mut bytes = Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, ImageFormat::Png)
        .with_context(|| format!("cannot encode {}", path.display()))?;
    output::file(path, bytes.get_ref())
}

/// A name that is one file's on every system.
pub(super) fn file_name(name: &str, ending: &str) -> String {
    let safe = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '_'
        }
    };
    format!("{}.{ending}", name.chars().map(safe).collect::<String>())
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::panic,
        reason = "a test that panics has failed"
    )]
    use super::*;
    use crate::commands::synthetic;

    #[test]
    fn outputs_land_at_their_place_on_the_canvas() {
        let wall = Wall::parse(&synthetic::wall_text(3, [4, 2], 60.0), "test").unwrap();
        let output = |index: usize, value: u8| CapturedOutput {
            host: format!("node{index}"),
            host_index: index,
            output: "out".to_owned(),
            output_index: 0,
            width: 4,
            height: 2,
            rgba: vec![value; 4 * 2 * 4],
        };
        let outputs = [output(2, 30), output(0, 10), output(1, 20)];
        let screens = compose(&wall, &outputs).unwrap();
        assert_eq!(screens.len(), 1);
        assert_eq!(screens[0].dimensions(), (12, 2));
        assert_eq!(
            [0, 3, 4, 11].map(|x| screens[0].get_pixel(x, 1).0[0]),
            [10, 10, 20, 30]
        );
        assert!(compose(&wall, &outputs[..2]).is_err());

        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &wall, &outputs).unwrap();
        let written = image::open(folder.path().join("wall.png"))
            .unwrap()
            .to_rgb8();
        assert_eq!(written.get_pixel(5, 0).0, [20; 3]);
        assert!(folder.path().join("node1-out.png").is_file());
        assert_eq!(file_name("a/b:c d", "png"), "a_b_c_d.png");
    }
}
