//! What makes an output one that can be shown: channels within it and within their canvases, none over another.

use super::check::{check_count, check_file, check_name, check_size, out_of_range};
use super::{Channel, MAX_CHANNELS, Output, Wall};
use crate::config::{Fault, Problem};

impl Wall {
    pub(super) fn check_output(&self, key: &str, output: &Output) -> Result<(), Problem> {
        check_size(&format!("{key}.size_px"), output.size_px)?;
        if output
            .gamma
            .is_some_and(|gamma| !(1.0..=4.0).contains(&gamma))
        {
            return Err(out_of_range(
                &format!("{key}.gamma"),
                "write the exponent of the display within 1…4, for example 2.2, or leave it out for sRGB",
            ));
        }
        check_count(
            &format!("{key}.channels"),
            output.channels.len(),
            MAX_CHANNELS,
        )?;
        for (index, channel) in output.channels.iter().enumerate() {
            let key = format!("{key}.channels[{index}]");
            self.check_canvas(&key, channel)?;
            check_place(&key, output, index, channel)?;
            check_blend(&key, channel)?;
            if let Some(calibration) = &channel.calibration {
                check_file(&format!("{key}.calibration.file"), &calibration.file)?;
                if let Some(region) = &calibration.region {
                    check_name(&format!("{key}.calibration.region"), region)?;
                }
            }
        }
        Ok(())
    }

    fn check_canvas(&self, key: &str, channel: &Channel) -> Result<(), Problem> {
        let Some(screen) = self.screens.get(channel.screen) else {
            let advice = "there is no such screen";
            return Err(Problem::new(Fault::Name, format!("{key}.screen"), advice));
        };
        let canvas = channel.canvas_px;
        let [canvas_width, canvas_height] = screen.size_px;
        let fits = canvas.width > 0
            && canvas.height > 0
            && canvas.right() <= canvas_width
            && canvas.bottom() <= canvas_height;
        if fits {
            return Ok(());
        }
        Err(out_of_range(
            &format!("{key}.canvas_px"),
            format!(
                "this rectangle (x, y, width, height) is empty or leaves the canvas of screen \"{}\", which is {canvas_width}×{canvas_height}",
                screen.name
            ),
        ))
    }
}

/// Where a channel lies in its output.
fn check_place(key: &str, output: &Output, index: usize, channel: &Channel) -> Result<(), Problem> {
    let [width, height] = output.size_px;
    let canvas = channel.canvas_px;
    check_size(&format!("{key}.size_px"), channel.size_px)?;
    if channel.calibration.is_none() && channel.size_px != [canvas.width, canvas.height] {
        return Err(out_of_range(
            &format!("{key}.size_px"),
            format!(
                "a channel is as large as its canvas_px, {}×{}, where no calibration says where its pixels fall; leave size_px out",
                canvas.width, canvas.height
            ),
        ));
    }
    let shown = channel.output_rect();
    if shown.right() > width || shown.bottom() > height {
        return Err(out_of_range(
            &format!("{key}.output_px"),
            format!(
                "{}×{} pixels from here leave the output, which is {width}×{height}",
                shown.width, shown.height
            ),
        ));
    }
    let before = output.channels.iter().take(index);
    match before
        .map(Channel::output_rect)
        .position(|rect| rect.overlaps(&shown))
    {
        Some(other) => Err(Problem::new(
            Fault::Geometry,
            format!("{key}.output_px"),
            format!(
                "this channel covers a part of channel {other} of the same output; move one of them"
            ),
        )),
        None => Ok(()),
    }
}

fn check_blend(key: &str, channel: &Channel) -> Result<(), Problem> {
    let blend = &channel.blend;
    let [left, right, top, bottom] = blend.ramps_px;
    let [width, height] = channel.size_px;
    if left.saturating_add(right) > width || top.saturating_add(bottom) > height {
        return Err(out_of_range(
            &format!("{key}.blend_px"),
            format!(
                "the ramps meet: left and right take at most {width} pixels together, top and bottom {height}"
            ),
        ));
    }
    if !(0.2..=5.0).contains(&blend.gamma) {
        return Err(out_of_range(
            &format!("{key}.blend_gamma"),
            "write a number within 0.2…5; 1 is even in linear light",
        ));
    }
    if !(0.0..=0.5).contains(&blend.black_level) {
        return Err(out_of_range(
            &format!("{key}.black_level"),
            "write a share of full light within 0…0.5",
        ));
    }
    Ok(())
}
