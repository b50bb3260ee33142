//! Test patterns, drawn on the CPU in the pixels of one output: neither warped nor blended.
//!
//! In: which pattern, and what there is to say about the output. Out: an RGBA picture, the same for the same input.
//! It decides nothing about when a pattern is shown, and knows no GPU.

mod area;
mod bars;
mod focus;
mod font;
mod grid;
mod identify;
mod identity;
mod paper;
mod ramp;
mod strokes;
#[cfg(test)]
mod tests;
mod text;

use protocol::pattern::Pattern;
use protocol::wall::Rect;

use paper::Paper;

pub use identity::{FoundIdentity, identity, read_identities, read_identity};

/// Largest side of a picture in pixels: that of an output in a wall file. It bounds a picture to 1 GiB.
const MOST_PX: u32 = 16_384;

/// What patterns tell about an output.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct About {
    /// The wall's name.
    pub(crate) wall: String,
    /// The host's name.
    pub(crate) host: String,
    /// The output's name.
    pub(crate) output: String,
    /// The graphics adapter that draws it, in words.
    pub(crate) adapter: String,
    /// Width and height in pixels, each 1…16384.
    pub(crate) size_px: [u32; 2],
    /// What it shows, in the order of the wall file.
    pub(crate) channels: Vec<ChannelAbout>,
    /// How both eyes share it: a name of [`protocol::wall::Stereo::NAMES`].
    pub(crate) stereo: String,
    /// The exponent by which the display turns values into light; `None` for the sRGB curve.
    pub(crate) gamma: Option<f64>,
}

/// What patterns tell about a channel of an output.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ChannelAbout {
    /// The screen's name.
    pub(crate) screen: String,
    /// The eye's name.
    pub(crate) eye: String,
    /// What it covers of the output, in pixels. What lies beyond the output is not drawn.
    pub(crate) rect: Rect,
    /// Pixels over which it fades at its left, right, upper and lower edge.
    pub(crate) ramps_px: [u32; 4],
}

/// Draws a pattern: opaque RGBA, 8 bits each, in the display's own values, rows from the top, without gaps. Where the
/// output is too small for a part of a pattern, that part is left out. A size outside 1…16384 gives an empty picture.
pub(crate) fn draw(pattern: Pattern, about: &About) -> Vec<u8> {
    let [width, height] = about.size_px;
    if !(1..=MOST_PX).contains(&width) || !(1..=MOST_PX).contains(&height) {
        return Vec::new();
    }
    let mut paper = Paper::new([width, height]);
    match pattern {
        Pattern::Grid => grid::draw(&mut paper, about),
        Pattern::Bars => bars::draw(&mut paper),
        Pattern::Ramp => ramp::draw(&mut paper, about),
        Pattern::Focus => focus::draw(&mut paper, about),
        Pattern::Identify => identify::draw(&mut paper, about),
    }
    paper.into_bytes()
}

impl About {
    /// The value that makes a share of full light, 0…1, on the output's display (the sRGB curve: IEC 61966-2-1).
    fn value_of(&self, light: f64) -> u8 {
        let light = light.clamp(0.0, 1.0);
        let value = match self.gamma {
            Some(gamma) => light.powf(1.0 / gamma),
            None if light <= 0.003_130_8 => 12.92 * light,
            None => 1.055 * light.powf(1.0 / 2.4) - 0.055,
        };
        (255.0 * value).round() as u8
    }

    /// How the display turns values into light, in words.
    fn curve(&self) -> String {
        self.gamma.map_or_else(
            || "sRGB curve".to_owned(),
            |gamma| format!("gamma {gamma:.2}"),
        )
    }

    /// The output's size, in words.
    fn size(&self) -> String {
        let [width, height] = self.size_px;
        format!("{width} x {height}")
    }
}
