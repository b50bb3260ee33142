//! CPU twin of process/imagery.wgsl: raw colours to colours.
//! In: a slot of 10-bit codes. Out: codes after exposure, contrast, saturation, gamma and tint, in that order.

use crate::cpu::support::{colour, slot};
use crate::layout::ImageryUniform;

/// Luma of red, green and blue (ITU-R BT.709-6, item 3.2).
const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Runs the stage.
#[must_use]
pub fn run(parameters: &ImageryUniform, inputs: &[&[u32]]) -> Vec<u32> {
    // Codes are gamma encoded: light is their square.
    let exposure = parameters.gain.sqrt();
    slot::every_word(inputs, 0, |word| {
        if word >> 30 == 0 {
            return 0;
        }
        let raw = [word, word >> 10, word >> 20].map(|bits| (bits & 1023) as f32 / 1023.0);
        let exposed = raw.map(|code| code * exposure);
        let contrasted = exposed.map(|code| colour::mix(0.5, code, parameters.contrast));
        let luma = contrasted[0] * LUMA[0] + contrasted[1] * LUMA[1] + contrasted[2] * LUMA[2];
        let saturated = contrasted.map(|code| colour::mix(luma, code, parameters.saturation));
        let mut codes = saturated.map(|code| code.clamp(0.0, 1.0));
        // Powers are not exact on a device, and the exponent 1 is the rule.
        if parameters.inverse_gamma != 1.0 {
            codes = codes.map(|code| code.powf(parameters.inverse_gamma));
        }
        let [red, green, blue, _] = parameters.tint;
        colour::pack([codes[0] * red, codes[1] * green, codes[2] * blue], 1.0)
    })
}
