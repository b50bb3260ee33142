//! CPU twin of process/sar_linear.wgsl: radar amplitude to grey by Lambers' eq. 2.3, g = a / t.
//! In: a slot of amplitudes. Out: a slot of tinted greys. t is the upper end of the range.

use crate::cpu::support::amplitude;
use crate::layout::SarUniform;

/// Runs the stage.
#[must_use]
pub fn run(parameters: &SarUniform, inputs: &[&[u32]]) -> Vec<u32> {
    amplitude::run(parameters, inputs, |normalised| normalised)
}
