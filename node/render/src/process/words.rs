//! Raw samples as the processing stages read them: one 32-bit word a node, border included.
//! In: decoded tiles. Out: 275×275 words: bits of f32 for heights and amplitudes, 10:10:10:2 for colours. It
//! knows no device and no parameters but those that choose samples: channels, range, unit.

use geodesy::frame::scalar_f32;
use shaders::INVALID_WORD;
use tiles::{Samples, TileData};

/// Nodes of a tile with its border: words of a slot.
pub(crate) const WORDS: usize = geodesy::STORED_NODES * geodesy::STORED_NODES;

/// The largest value of a raw colour's channel.
const FULL: f64 = 1023.0;
/// The top bits of a raw colour that is there.
const VALID: u32 = 3 << 30;

/// Heights in metres, `unit_m` a quantum.
pub(crate) fn heights(data: &TileData, unit_m: f64) -> Vec<u32> {
    let Some(heights) = data.heights() else {
        return vec![INVALID_WORD; WORDS];
    };
    let metres = heights
        .iter()
        .map(|quanta| scalar_f32(f64::from(*quanta) * unit_m).to_bits());
    mask(metres, data)
}

/// Amplitudes: the first channel.
pub(crate) fn amplitudes(data: &TileData) -> Vec<u32> {
    let step = usize::from(data.channels.max(1));
    match &data.samples {
        Samples::I32(values) => mask(firsts(values, step), data),
        Samples::U8(values) => mask(firsts(values, step), data),
        Samples::U16(values) => mask(firsts(values, step), data),
        Samples::F32(values) => mask(firsts(values, step), data),
    }
}

/// Colours: three channels of the data, samples of `range` spread over ten bits each.
pub(crate) fn colours(data: &TileData, channels: [u8; 3], range: [f64; 2]) -> Vec<u32> {
    let count = usize::from(data.channels.max(1));
    let channels = shown_channels(channels, data.channels).map(usize::from);
    let [low, high] = range;
    let scale = FULL / (high - low).max(f64::MIN_POSITIVE);
    let spread = |value: f64| ((value - low) * scale).clamp(0.0, FULL).round() as u32;
    let mut words = Vec::with_capacity(WORDS);
    match &data.samples {
        Samples::U8(values) => {
            let table: [u32; 256] = std::array::from_fn(|value| spread(value as f64));
            pack(
                values,
                count,
                channels,
                |v| table[usize::from(*v)],
                &mut words,
            );
        }
        Samples::U16(values) => pack(values, count, channels, spread_any(&spread), &mut words),
        Samples::F32(values) => pack(values, count, channels, spread_any(&spread), &mut words),
        Samples::I32(values) => pack(values, count, channels, spread_any(&spread), &mut words),
    }
    if !matches!(data.validity, tiles::Validity::All) {
        for (node, word) in words.iter_mut().enumerate() {
            if !data.validity.is_valid(node) {
                *word = 0;
            }
        }
    }
    words
}

/// Finished colours, RGBA: three channels of bytes as they are.
pub(crate) fn finished(data: &TileData, channels: [u8; 3]) -> Vec<u32> {
    let Samples::U8(values) = &data.samples else {
        // The plan asks for this of bytes only.
        return vec![0; WORDS];
    };
    let count = usize::from(data.channels.max(1));
    let [red, green, blue] = shown_channels(channels, data.channels).map(usize::from);
    let all = matches!(data.validity, tiles::Validity::All);
    values
        .chunks_exact(count)
        .enumerate()
        .map(|(index, node)| {
            let part = |channel: usize| node.get(channel).copied().unwrap_or_default();
            if all || data.validity.is_valid(index) {
                u32::from_le_bytes([part(red), part(green), part(blue), 255])
            } else {
                0
            }
        })
        .collect()
}

/// The channels that are shown: data of one or two channels shows its first in all three, unless it is
/// asked for others.
pub(crate) fn shown_channels(asked: [u8; 3], available: u8) -> [u8; 3] {
    if available < 3 && asked == [0, 1, 2] {
        [0; 3]
    } else {
        asked
    }
}

fn firsts<T: Copy + Into<f64>>(values: &[T], step: usize) -> impl Iterator<Item = u32> {
    let words = values.iter().step_by(step);
    words.map(|value| scalar_f32((*value).into()).to_bits())
}

fn mask(words: impl Iterator<Item = u32>, data: &TileData) -> Vec<u32> {
    if matches!(data.validity, tiles::Validity::All) {
        return words.collect();
    }
    words
        .enumerate()
        .map(|(node, word)| {
            if data.validity.is_valid(node) {
                word
            } else {
                INVALID_WORD
            }
        })
        .collect()
}

/// Any number, spread.
fn spread_any<T: Copy + Into<f64>>(spread: &impl Fn(f64) -> u32) -> impl Fn(&T) -> u32 {
    |value| spread((*value).into())
}

fn pack<T>(
    values: &[T],
    count: usize,
    [red, green, blue]: [usize; 3],
    spread: impl Fn(&T) -> u32,
    words: &mut Vec<u32>,
) {
    words.extend(values.chunks_exact(count).map(|node| {
        let part = |channel: usize| node.get(channel).map_or(0, &spread);
        part(red) | part(green) << 10 | part(blue) << 20 | VALID
    }));
}
