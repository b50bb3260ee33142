//! CPU twin of process/sar_gamma.wgsl: radar amplitude to grey by Lambers' eq. 2.5, g = a^γ.
//! In: a slot of amplitudes. Out: a slot of tinted greys.

use crate::cpu::support::amplitude;
use crate::layout::SarUniform;

/// Runs the stage.
#[must_use]
pub fn run(parameters: &SarUniform, inputs: &[&[u32]]) -> Vec<u32> {
    amplitude::run(parameters, inputs, |normalised| {
        // Powers of 0 are left to the driver.
        if normalised > 0.0 {
            normalised.powf(parameters.exponent)
        } else {
            0.0
        }
    })
}
