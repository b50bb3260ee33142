//! Fusion of heights and colours: order, weights, holes, opacity, and the W3C's compositing formulas against
//! an independent computation in f64.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use common::{at, bytes, code_difference, height_at, heights, words};
use proptest::prelude::*;
use shaders::cpu::{fuse_colour, fuse_elevation};
use shaders::{Blend, FuseInput, FuseUniform, INVALID_WORD};

/// One input of either fusion; `sample` is a height's bits or a colour.
#[derive(Clone, Copy, Debug)]
struct Input {
    sample: u32,
    weight: f32,
    opacity: f32,
    blend: u32,
    group: u32,
}

const NORMAL: u32 = Blend::Normal as u32;

fn uniform(inputs: &[Input]) -> FuseUniform {
    let unused = FuseInput {
        weight: 1.0,
        opacity: 1.0,
        blend: 0,
        group: 77,
    };
    let mut parameters = FuseUniform {
        count: inputs.len() as u32,
        padding: [0; 3],
        inputs: [unused; 8],
    };
    for (slot, input) in parameters.inputs.iter_mut().zip(inputs) {
        *slot = FuseInput {
            weight: input.weight,
            opacity: input.opacity,
            blend: input.blend,
            group: input.group,
        };
    }
    parameters
}

fn fused_height(inputs: &[Input]) -> Option<f32> {
    let samples: Vec<Option<f32>> = inputs
        .iter()
        .map(|input| (input.sample != INVALID_WORD).then(|| f32::from_bits(input.sample)))
        .collect();
    fuse_elevation::fuse(&uniform(inputs), &samples)
}

fn fused_colour(inputs: &[Input]) -> u32 {
    // What lies beyond the count must not be read.
    let mut samples = [0xFF12_3456; 8];
    for (sample, input) in samples.iter_mut().zip(inputs) {
        *sample = input.sample;
    }
    fuse_colour::fuse(&uniform(inputs), samples)
}

/// The W3C's formulas on one component, with colours not premultiplied: (colour, alpha) over (colour, alpha).
fn composite(below: (f64, f64), above: (f64, f64), blend: u32, colours: bool) -> (f64, f64) {
    let ((cb, ab), (cs, alpha)) = (below, above);
    let mixed = match blend {
        1 => cb * cs,
        2 if colours => cb + cs - cb * cs,
        3 if colours => (cb + cs).min(1.0),
        3 => cb + cs,
        _ => cs,
    };
    let source = (1.0 - ab) * cs + ab * mixed;
    let covered = alpha + ab * (1.0 - alpha);
    let premultiplied = alpha * source + (1.0 - alpha) * ab * cb;
    (
        if covered > 0.0 {
            premultiplied / covered
        } else {
            0.0
        },
        covered,
    )
}

/// One component of the fusion in f64: inputs as (value, coverage; `None` is a hole), group by group.
fn reference(
    inputs: &[Input],
    sample: impl Fn(u32) -> Option<(f64, f64)>,
    colours: bool,
) -> (f64, f64) {
    let mut below = (0.0, 0.0);
    for group in inputs.chunk_by(|a, b| a.group == b.group) {
        let (mut value, mut shares, mut alphas) = (0.0, 0.0, 0.0);
        for input in group {
            let Some((v, coverage)) = sample(input.sample) else {
                continue;
            };
            let alpha = f64::from(input.opacity) * coverage;
            let share = f64::from(input.weight) * alpha;
            if share > 0.0 {
                value += share * v;
                shares += share;
                alphas += share * alpha;
            }
        }
        if shares > 0.0 {
            below = composite(
                below,
                (value / shares, alphas / shares),
                group[0].blend,
                colours,
            );
        }
    }
    below
}

fn height_sample(word: u32) -> Option<(f64, f64)> {
    (word != INVALID_WORD).then(|| (f64::from(f32::from_bits(word)), 1.0))
}

/// Red, green, blue 0…1 and alpha 0…255 in f64.
fn reference_colour(inputs: &[Input]) -> ([f64; 3], f64) {
    let part = |part: usize| {
        let sample = |word: u32| {
            let codes = bytes(word).map(|code| f64::from(code) / 255.0);
            Some((codes[part], codes[3]))
        };
        reference(inputs, sample, true)
    };
    let [red, green, blue] = [part(0), part(1), part(2)];
    ([red.0, green.0, blue.0], red.1 * 255.0)
}

/// Numbers that are often at their ends.
fn share() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0_f32), Just(1.0), 0.01_f32..1.0]
}

fn weight() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0_f32), Just(1.0), 0.01_f32..1000.0]
}

/// 1…`most` inputs in groups that each have one blend. Groups have even numbers, so that others fit between.
fn inputs(most: usize, sample: BoxedStrategy<u32>) -> impl Strategy<Value = Vec<Input>> {
    let input = (sample, weight(), share(), any::<bool>());
    let blends = prop::collection::vec(0_u32..4, 8);
    (prop::collection::vec(input, 1..=most), blends).prop_map(|(inputs, blends)| {
        let mut group = 0;
        inputs
            .into_iter()
            .map(|(sample, weight, opacity, next)| {
                group += usize::from(next);
                Input {
                    sample,
                    weight,
                    opacity,
                    blend: blends[group % 8],
                    group: group as u32 * 2,
                }
            })
            .collect()
    })
}

fn some_height() -> BoxedStrategy<u32> {
    prop_oneof![
        1 => Just(INVALID_WORD),
        5 => (-11_000.0_f32..9000.0).prop_map(f32::to_bits),
    ]
    .boxed()
}

fn some_colour() -> BoxedStrategy<u32> {
    prop_oneof![
        1 => Just(0_u32),
        2 => any::<u32>().prop_map(|word| word | 0xFF00_0000),
        2 => any::<u32>().prop_filter("a colour", |word| word >> 24 > 0),
    ]
    .boxed()
}

/// The inputs with those of each group in another order.
fn shuffled(inputs: &[Input], keys: &[u32]) -> Vec<Input> {
    let mut moved: Vec<(u32, u32, Input)> = inputs
        .iter()
        .zip(keys)
        .map(|(input, key)| (input.group, *key, *input))
        .collect();
    moved.sort_by_key(|(group, key, _)| (*group, *key));
    moved.into_iter().map(|(_, _, input)| input).collect()
}

/// The inputs with one more at `place`: in the group before it, in the one after it, or in its own.
fn with(inputs: &[Input], place: usize, side: u8, mut added: Input) -> Vec<Input> {
    let place = place % (inputs.len() + 1);
    let before = place.checked_sub(1).and_then(|index| inputs.get(index));
    let joined = match side {
        0 => before,
        1 => inputs.get(place),
        _ => None,
    };
    let between = match (before, inputs.get(place)) {
        (Some(before), Some(after)) if before.group == after.group => Some(before),
        _ => None,
    };
    // A group of its own would cut one group into two.
    if let Some(neighbour) = joined.or(between) {
        (added.group, added.blend) = (neighbour.group, neighbour.blend);
    } else {
        added.group = before.map_or(inputs[0].group.wrapping_sub(1), |before| before.group + 1);
    }
    let mut more = inputs.to_vec();
    more.insert(place, added);
    more
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn the_order_of_equal_heights_does_not_matter(
        base in -9000.0_f32..9000.0,
        offsets in prop::collection::vec((-50.0_f32..50.0, weight(), share(), any::<bool>()), 1..=8),
        keys in prop::collection::vec(any::<u32>(), 8),
    ) {
        let mut group = 0;
        let inputs: Vec<Input> = offsets
            .into_iter()
            .map(|(offset, weight, opacity, next)| {
                group += u32::from(next);
                Input { sample: (base + offset).to_bits(), weight, opacity, blend: NORMAL, group }
            })
            .collect();
        let (one, other) = (fused_height(&inputs), fused_height(&shuffled(&inputs, &keys)));
        prop_assert_eq!(one.is_some(), other.is_some());
        if let (Some(one), Some(other)) = (one, other) {
            // Two steps of f32 are more than a tenth of a millimetre from 512 m on.
            let step = one.next_up() - one;
            prop_assert!((one - other).abs() <= 1e-4_f32.max(2.0 * step), "{} {}", one, other);
        }
    }

    #[test]
    fn the_order_of_equal_colours_does_not_matter(
        inputs in inputs(8, some_colour()),
        keys in prop::collection::vec(any::<u32>(), 8),
    ) {
        let (one, other) = (fused_colour(&inputs), fused_colour(&shuffled(&inputs, &keys)));
        prop_assert!(code_difference(one, other) <= 1, "{:08x} {:08x}", one, other);
    }

    #[test]
    fn what_has_no_weight_no_opacity_or_no_data_changes_no_height(
        inputs in inputs(7, some_height()),
        place in 0_usize..8,
        side in 0_u8..3,
        nothing in 0_u8..3,
        sample in -11_000.0_f32..9000.0,
        blend in 0_u32..4,
    ) {
        let mut added = Input { sample: sample.to_bits(), weight: 2.0, opacity: 0.5, blend, group: 0 };
        match nothing {
            0 => added.weight = 0.0,
            1 => added.opacity = 0.0,
            _ => added.sample = INVALID_WORD,
        }
        let before = fused_height(&inputs).map(f32::to_bits);
        let after = fused_height(&with(&inputs, place, side, added)).map(f32::to_bits);
        prop_assert_eq!(before, after);
    }

    #[test]
    fn what_has_no_weight_no_opacity_or_no_data_changes_no_colour(
        inputs in inputs(7, some_colour()),
        place in 0_usize..8,
        side in 0_u8..3,
        nothing in 0_u8..4,
        sample in any::<u32>(),
        blend in 0_u32..4,
    ) {
        let mut added = Input { sample: sample | 0xFF00_0000, weight: 2.0, opacity: 0.5, blend, group: 0 };
        match nothing {
            0 => added.weight = 0.0,
            1 => added.opacity = 0.0,
            2 => added.sample = 0,
            _ => added.sample = sample & 0x00FF_FFFF,
        }
        prop_assert_eq!(fused_colour(&inputs), fused_colour(&with(&inputs, place, side, added)));
    }

    #[test]
    fn heights_follow_the_formulas(inputs in inputs(8, some_height())) {
        let (exact, alpha) = reference(&inputs, height_sample, false);
        let Some(height) = fused_height(&inputs) else {
            prop_assert!(alpha <= 0.0);
            return Ok(());
        };
        prop_assert!(alpha > 0.0);
        // Products and sums may cancel: the measure is the largest number on the way.
        let mut largest: f64 = 0.0;
        for end in 1..=inputs.len() {
            largest = largest.max(reference(&inputs[..end], height_sample, false).0.abs());
            largest = largest.max(height_sample(inputs[end - 1].sample).map_or(0.0, |(h, _)| h.abs()));
        }
        let multiplied = inputs.chunk_by(|a, b| a.group == b.group).filter(|group| group[0].blend == 1).count();
        let reach = largest * 9000_f64.powi(multiplied.min(1) as i32);
        prop_assert!((f64::from(height) - exact).abs() <= reach * 2e-6, "{} for {}", height, exact);
    }

    #[test]
    fn colours_follow_the_w3c_s_formulas(inputs in inputs(8, some_colour())) {
        let (exact, alpha) = reference_colour(&inputs);
        let shown = bytes(fused_colour(&inputs));
        if alpha < 0.4999 {
            prop_assert_eq!(shown, [0; 4]);
        } else if alpha > 0.5001 {
            prop_assert!((f64::from(shown[3]) - alpha).abs() <= 0.501, "{:?} for {}", shown, alpha);
            for part in 0..3 {
                let error = (f64::from(shown[part]) - exact[part] * 255.0).abs();
                prop_assert!(error <= 0.51, "{:?} for {:?}", shown, exact.map(|c| c * 255.0));
            }
        }
    }

    #[test]
    fn one_opaque_layer_hides_what_is_below(
        inputs in inputs(7, some_height()),
        height in -11_000.0_f32..9000.0,
        weight in 0.01_f32..1000.0,
    ) {
        let top = Input { sample: height.to_bits(), weight, opacity: 1.0, blend: NORMAL, group: 99 };
        let mut more = inputs.clone();
        more.push(top);
        prop_assert_eq!(fused_height(&more), Some(height));
    }
}

fn colour_input(sample: u32, blend: Blend, group: u32) -> Input {
    Input {
        sample,
        weight: 1.0,
        opacity: 1.0,
        blend: blend as u32,
        group,
    }
}

#[test]
fn blend_modes_on_opaque_colours() {
    let (below, above) = (0xFF20_40C0, 0xFF80_8080);
    for (blend, exact) in [
        (Blend::Normal, 0xFF80_8080),
        (Blend::Multiply, 0xFF10_2060),
        (Blend::Screen, 0xFF90_A0E0),
        (Blend::Add, 0xFFA0_C0FF),
    ] {
        let inputs = [
            colour_input(below, Blend::Normal, 0),
            colour_input(above, blend, 1),
        ];
        let fused = fused_colour(&inputs);
        assert!(code_difference(fused, exact) <= 1, "{blend:?}: {fused:08x}");
    }
}

#[test]
fn every_mode_shows_the_upper_colour_where_nothing_is_below() {
    for blend in [Blend::Normal, Blend::Multiply, Blend::Screen, Blend::Add] {
        let inputs = [
            colour_input(0, Blend::Normal, 0),
            colour_input(0x8012_3456, blend, 1),
        ];
        assert_eq!(fused_colour(&inputs), 0x8012_3456, "{blend:?}");
    }
}

#[test]
fn eight_inputs_of_one_group_have_their_weighted_mean() {
    let inputs: Vec<Input> = (0..8_u32)
        .map(|n| Input {
            sample: (100.0 * n as f32).to_bits(),
            weight: (n + 1) as f32,
            opacity: 1.0,
            blend: NORMAL,
            group: 0,
        })
        .collect();
    // Σ 100 n (n + 1) / Σ (n + 1) = 16800 / 36.
    let mean = fused_height(&inputs).unwrap();
    assert!((f64::from(mean) - 16_800.0 / 36.0).abs() < 1e-4, "{mean}");
    let layers: Vec<Input> = (0..8_u32)
        .map(|n| colour_input(0xFF00_0000 | (20 * n), Blend::Add, n))
        .collect();
    // 20 · (1 + … + 7) = 560 is white; the first alone is black.
    assert_eq!(fused_colour(&layers), 0xFF00_00FF);
    assert_eq!(fused_colour(&layers[..4]), 0xFF00_0000 | 120);
}

#[test]
fn whole_slots_are_fused_node_by_node() {
    let low = heights(|i, j| f64::from(i + j));
    let mut high = heights(|_, _| 500.0);
    high[0] = INVALID_WORD;
    let inputs = [
        Input {
            sample: 0,
            weight: 1.0,
            opacity: 1.0,
            blend: NORMAL,
            group: 0,
        },
        Input {
            sample: 0,
            weight: 1.0,
            opacity: 0.5,
            blend: NORMAL,
            group: 1,
        },
    ];
    let parameters = uniform(&inputs);
    let fused = fuse_elevation::run(&parameters, &[&low, &high]);
    assert_eq!(fused[0], low[0]);
    assert!((height_at(&fused, 100, 50) - 325.0).abs() < 1e-9);
    let nothing = fuse_elevation::run(&parameters, &[]);
    assert!(nothing.iter().all(|word| *word == INVALID_WORD));
    let (red, clear) = (
        words(|_, _| 0xFF00_00FF),
        words(|i, _| if i < 0 { 0 } else { 0xFFFF_0000 }),
    );
    let colours = fuse_colour::run(&parameters, &[&red, &clear]);
    assert_eq!(at(&colours, -1, 0), 0xFF00_00FF);
    assert_eq!(at(&colours, 0, 0), 0xFF80_0080);
    assert!(
        fuse_colour::run(&parameters, &[])
            .iter()
            .all(|word| *word == 0)
    );
}
