//! CPU twin of process/hillshade.wgsl: heights to light and shade.
//! In: a slot of fused heights. Out: a slot of greys: the cosine between ground and light (Horn 1981), not
//! gamma encoded, as maps have it; 0 where the ground turns away.

use crate::cpu::support::{colour, slot, tangent};
use crate::layout::{HillshadeUniform, INVALID_WORD};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &HillshadeUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let [light_east, light_north, light_up] = parameters.light;
    slot::every_texel(|texel| {
        if slot::word(inputs, 0, texel, INVALID_WORD) == INVALID_WORD {
            return 0;
        }
        let (frame, [x, y, z]) = tangent::surface(&parameters.tile, inputs, texel);
        let [east, north] = frame.east_north(x, y);
        let (east, north) = (
            east * parameters.exaggeration,
            north * parameters.exaggeration,
        );
        let length = (east * east + north * north + z * z).sqrt();
        let shade = (east * light_east + north * light_north + z * light_up) / length;
        colour::pack([shade; 3], 1.0)
    })
}
