//! CPU twin of process/sar_logarithmic.wgsl: radar amplitude to grey by Lambers' eq. 2.4,
//! g = log(1 + c·a) / log(1 + c). In: a slot of amplitudes. Out: a slot of tinted greys.

use crate::cpu::support::amplitude;
use crate::layout::SarUniform;

/// Runs the stage.
#[must_use]
pub fn run(parameters: &SarUniform, inputs: &[&[u32]]) -> Vec<u32> {
    let strength = parameters.strength;
    amplitude::run(parameters, inputs, |normalised| {
        (1.0 + strength * normalised).ln() / (1.0 + strength).ln()
    })
}
