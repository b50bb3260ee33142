//! CPU twin of fuse/fuse_elevation.wgsl: several heights to one, by priority, weight and opacity.
//! In: up to 8 slots of heights, lowest first. Out: one slot of heights, a hole where no input has any.
//! The mesh takes its heights from [`fuse`].

use crate::cpu::support::slot;
use crate::layout::{Blend, FuseUniform, INVALID_WORD};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &FuseUniform, inputs: &[&[u32]]) -> Vec<u32> {
    slot::every_texel(|texel| {
        let heights = [0, 1, 2, 3, 4, 5, 6, 7].map(|input| {
            let word = slot::word(inputs, input, texel, INVALID_WORD);
            (word != INVALID_WORD).then(|| f32::from_bits(word))
        });
        fuse(parameters, &heights).map_or(INVALID_WORD, f32::to_bits)
    })
}

/// A height, and how much of what is below it covers.
#[derive(Clone, Copy, Debug)]
struct Covering {
    height: f32,
    alpha: f32,
}

/// The sums over a group. Heights are counted from the group's first, so that a mean of equal heights, or
/// of one, is that height to the last bit.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    first: f32,
    offsets: f32,
    shares: f32,
    alphas: f32,
}

/// One node: the inputs' heights in metres, `None` for holes, to the fused height. Inputs that are missing
/// at the end are holes.
#[must_use]
pub fn fuse(parameters: &FuseUniform, heights: &[Option<f32>]) -> Option<f32> {
    let mut below = Covering {
        height: 0.0,
        alpha: 0.0,
    };
    let mut sums = Group::default();
    let inputs = parameters.inputs.iter().take(parameters.count as usize);
    let mut before = parameters.inputs[0];
    for (index, input) in inputs.enumerate() {
        if input.group != before.group {
            below = sums.over(below, before.blend);
            sums = Group::default();
        }
        before = *input;
        if let Some(Some(height)) = heights.get(index) {
            sums.add(*height, input.weight, input.opacity);
        }
    }
    below = sums.over(below, before.blend);
    (below.alpha > 0.0).then_some(below.height)
}

impl Group {
    fn add(&mut self, height: f32, weight: f32, opacity: f32) {
        let share = weight * opacity;
        if share <= 0.0 {
            return;
        }
        if self.shares <= 0.0 {
            self.first = height;
        }
        self.offsets += share * (height - self.first);
        self.shares += share;
        self.alphas += share * opacity;
    }

    /// Lays the group over what is below (W3C Compositing and Blending Level 1, §5 and §9.1.4).
    fn over(self, below: Covering, blend: u32) -> Covering {
        if self.shares <= 0.0 {
            return below;
        }
        let height = self.first + self.offsets / self.shares;
        let alpha = self.alphas / self.shares;
        if below.alpha <= 0.0 {
            return Covering { height, alpha };
        }
        let blended = blend_heights(below.height, height, blend);
        let covered = alpha + below.alpha * (1.0 - alpha);
        // (1 − αb)·Cs + αb·B(Cb, Cs), so written that it is Cs to the last bit where B is.
        let source = height + below.alpha * (blended - height);
        let sum = alpha * source + (1.0 - alpha) * below.alpha * below.height;
        Covering {
            height: sum / covered,
            alpha: covered,
        }
    }
}

fn blend_heights(below: f32, above: f32, blend: u32) -> f32 {
    if blend == Blend::Multiply as u32 {
        below * above
    } else if blend == Blend::Add as u32 {
        below + above
    } else {
        above
    }
}
