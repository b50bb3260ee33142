//! What the tests of the twins share: slots made on the spot and read back.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part")]

use shaders::{LAYER_SIDE, SLOT_SIDE};

/// Texels along a slot's side.
pub const SIDE: usize = SLOT_SIDE as usize;
/// Texels along a layer's side.
pub const LAYER: usize = LAYER_SIDE as usize;

/// A slot of heights or amplitudes of nodes (i, j).
pub fn heights(height: impl Fn(i32, i32) -> f64) -> Vec<u32> {
    words(|i, j| (height(i, j) as f32).to_bits())
}

/// A slot of words of nodes (i, j).
pub fn words(word: impl Fn(i32, i32) -> u32) -> Vec<u32> {
    let nodes = -9..SLOT_SIDE as i32 - 9;
    nodes
        .clone()
        .flat_map(|j| nodes.clone().map(move |i| (i, j)))
        .map(|(i, j)| word(i, j))
        .collect()
}

/// The word of node (i, j).
pub fn at(slot: &[u32], i: i32, j: i32) -> u32 {
    slot[(j + 9) as usize * SIDE + (i + 9) as usize]
}

/// The height of node (i, j).
pub fn height_at(slot: &[u32], i: i32, j: i32) -> f64 {
    f64::from(f32::from_bits(at(slot, i, j)))
}

/// Red, green, blue, alpha of a word, 0…255.
pub fn bytes(word: u32) -> [i32; 4] {
    word.to_le_bytes().map(i32::from)
}

/// The largest difference between two words' bytes.
pub fn code_difference(a: u32, b: u32) -> i32 {
    let pairs = bytes(a).into_iter().zip(bytes(b));
    pairs.map(|(a, b)| (a - b).abs()).max().unwrap_or(0)
}
