//! CPU twin of fuse/fuse_colour.wgsl: several colours to one, by priority, weight and opacity.
//! In: up to 8 slots of colours, lowest first. Out: one slot of colours, a hole where no input covers.

use crate::cpu::support::{colour, slot};
use crate::layout::{Blend, FuseUniform};

/// Runs the stage.
#[must_use]
pub fn run(parameters: &FuseUniform, inputs: &[&[u32]]) -> Vec<u32> {
    slot::every_texel(|texel| {
        let words = [0, 1, 2, 3, 4, 5, 6, 7].map(|input| slot::word(inputs, input, texel, 0));
        fuse(parameters, words)
    })
}

/// A colour, and how much of what is below it covers.
#[derive(Clone, Copy, Debug)]
struct Covering {
    colour: [f32; 3],
    alpha: f32,
}

/// The sums over a group.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    colours: [f32; 3],
    shares: f32,
    alphas: f32,
}

/// One node: the inputs' words to the fused word.
#[must_use]
pub fn fuse(parameters: &FuseUniform, words: [u32; 8]) -> u32 {
    let mut below = Covering {
        colour: [0.0; 3],
        alpha: 0.0,
    };
    let mut sums = Group::default();
    let inputs = parameters.inputs.iter().take(parameters.count as usize);
    let mut before = parameters.inputs[0];
    for (input, word) in inputs.zip(words) {
        if input.group != before.group {
            below = sums.over(below, before.blend);
            sums = Group::default();
        }
        before = *input;
        sums.add(colour::unpack(word), input.weight, input.opacity);
    }
    below = sums.over(below, before.blend);
    colour::pack(below.colour, below.alpha)
}

impl Group {
    fn add(&mut self, [red, green, blue, coverage]: [f32; 4], weight: f32, opacity: f32) {
        let alpha = opacity * coverage;
        let share = weight * alpha;
        if share <= 0.0 {
            return;
        }
        self.colours[0] += share * red;
        self.colours[1] += share * green;
        self.colours[2] += share * blue;
        self.shares += share;
        self.alphas += share * alpha;
    }

    /// Lays the group over what is below (W3C Compositing and Blending Level 1, §5 and §9.1.4).
    fn over(self, below: Covering, blend: u32) -> Covering {
        if self.shares <= 0.0 {
            return below;
        }
        let colour = self.colours.map(|sum| sum / self.shares);
        let alpha = self.alphas / self.shares;
        let covered = alpha + below.alpha * (1.0 - alpha);
        let part = |part: usize| {
            let (above, beneath) = (colour[part], below.colour[part]);
            let sum = alpha * (1.0 - below.alpha) * above
                + alpha * below.alpha * blend_codes(beneath, above, blend)
                + (1.0 - alpha) * below.alpha * beneath;
            sum / covered
        };
        Covering {
            colour: [part(0), part(1), part(2)],
            alpha: covered,
        }
    }
}

fn blend_codes(below: f32, above: f32, blend: u32) -> f32 {
    if blend == Blend::Multiply as u32 {
        below * above
    } else if blend == Blend::Screen as u32 {
        below + above - below * above
    } else if blend == Blend::Add as u32 {
        (below + above).min(1.0)
    } else {
        above
    }
}
