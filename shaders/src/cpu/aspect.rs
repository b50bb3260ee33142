//! CPU twin of process/aspect.wgsl: heights to colours of the direction of descent.
//! In: a slot of fused heights. Out: a slot of colours: north red, then clockwise through the hues, so that
//! south is cyan; flat ground has none.

use crate::cpu::support::{colour, slot, tangent};
use crate::layout::{AspectUniform, INVALID_WORD};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &AspectUniform, inputs: &[&[u32]]) -> Vec<u32> {
    slot::every_texel(|texel| {
        if slot::word(inputs, 0, texel, INVALID_WORD) == INVALID_WORD {
            return 0;
        }
        let (frame, [x, y, _]) = tangent::surface(&parameters.tile, inputs, texel);
        if (x * x + y * y).sqrt() <= parameters.flat_sine {
            return 0;
        }
        // An upward normal leans to where the ground falls.
        let [east, north] = frame.east_north(x, y);
        let turn = east.atan2(north) / std::f32::consts::TAU;
        colour::pack(hue(turn, parameters.saturation, parameters.brightness), 1.0)
    })
}

/// The colour of a hue given in turns (Smith 1978, the hexcone model).
fn hue(turn: f32, saturation: f32, brightness: f32) -> [f32; 3] {
    [1.0, 2.0 / 3.0, 1.0 / 3.0].map(|phase| {
        let position = turn + phase;
        let place = position - position.floor();
        let pure = ((place * 6.0 - 3.0).abs() - 1.0).clamp(0.0, 1.0);
        brightness * colour::mix(1.0, pure, saturation)
    })
}
