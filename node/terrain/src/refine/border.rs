//! The nodes on a leaf's border, whose vertices are those of `build` to the bit.
//! In: vertices and heights of the 1024 nodes. Out: words for the device, which copies vertices and takes heights.
//! Vertices of leaves side by side are bit-equal because `build` makes them so; nothing here may touch their bits.

use crate::mesh::Vertex;

/// Nodes on a leaf's border.
pub const BORDER_NODES: usize = 1024;

/// Words of a border node: the nine of its [`Vertex`] as a vertex buffer holds it, then its height in units (an i32).
pub const BORDER_WORDS: usize = 10;

/// The largest height in units, either way.
const MOST_UNITS: f64 = 134_217_728.0;

/// The lattice coordinate of the far edges.
const LAST: u16 = 256;

const POSITIONS: [[u16; 2]; BORDER_NODES] = positions();

const fn positions() -> [[u16; 2]; BORDER_NODES] {
    let mut positions = [[0; 2]; BORDER_NODES];
    let mut along = 0;
    while along <= LAST {
        positions[along as usize] = [along, 0];
        positions[257 + along as usize] = [along, LAST];
        along += 1;
    }
    along = 1;
    while along < LAST {
        positions[513 + along as usize] = [0, along];
        positions[768 + along as usize] = [LAST, along];
        along += 1;
    }
    positions
}

/// The border nodes (x, y) in their order: y = 0 with x 0…256, y = 256 likewise, then x = 0 with y 1…255, x = 256
/// likewise.
#[must_use]
pub fn border_positions() -> &'static [[u16; 2]] {
    &POSITIONS
}

/// Where node (x, y) is in [`border_positions`]; `None` inside and outside the leaf.
#[must_use]
pub const fn border_index(x: u16, y: u16) -> Option<usize> {
    if x > LAST || y > LAST {
        return None;
    }
    let (x_at, y_at) = (x as usize, y as usize);
    match (x, y) {
        (_, 0) => Some(x_at),
        (_, LAST) => Some(257 + x_at),
        (0, _) => Some(513 + y_at),
        (LAST, _) => Some(768 + y_at),
        _ => None,
    }
}

/// A height in units of `unit_m` metres: the nearest, ties to even, at most ±2^27. What is no number is 0.
#[must_use]
pub fn quantise(height_m: f64, unit_m: f64) -> i32 {
    (height_m / unit_m)
        .round_ties_even()
        .clamp(-MOST_UNITS, MOST_UNITS) as i32
}

/// The words of a leaf's border: [`BORDER_WORDS`] for each of [`border_positions`].
///
/// `vertices` are those that [`build`](crate::build) makes of these positions, `heights_m` the heights it made them
/// with, `unit_m` the leaf's unit of height. Where bit n of `coarser` says that a coarser leaf lies beyond edge n
/// of [`Direction::EDGES`](geodesy::Direction::EDGES), odd nodes of the edge get the mean of their two neighbours'
/// units, rounded down: no vertex is ever made of them, and the surface is straight there. Nodes that the slices do
/// not reach are all zero.
#[must_use]
pub fn border_words(vertices: &[Vertex], heights_m: &[f64], unit_m: f64, coarser: u8) -> Vec<u32> {
    let mut units: Vec<i32> = heights_m
        .iter()
        .map(|height_m| quantise(*height_m, unit_m))
        .collect();
    units.resize(BORDER_NODES, 0);
    let node = |edge: usize, along: u16| match edge {
        0 => border_index(0, along),
        1 => border_index(LAST, along),
        2 => border_index(along, 0),
        _ => border_index(along, LAST),
    };
    for edge in (0..4).filter(|edge| coarser >> edge & 1 == 1) {
        let of = |units: &[i32], along: u16| {
            let at = node(edge, along)?;
            units.get(at).copied()
        };
        for along in (1..LAST).step_by(2) {
            let (before, after) = (of(&units, along - 1), of(&units, along + 1));
            if let (Some(before), Some(after)) = (before, after)
                && let Some(own) = node(edge, along).and_then(|at| units.get_mut(at))
            {
                // Within ±2^27, so the sum fits.
                *own = (before + after) >> 1;
            }
        }
    }
    let mut words = Vec::with_capacity(BORDER_NODES * BORDER_WORDS);
    for (vertex, height) in vertices.iter().zip(&units) {
        words.extend(vertex_words(vertex));
        words.push(height.cast_unsigned());
    }
    words.resize(BORDER_NODES * BORDER_WORDS, 0);
    words
}

/// A vertex as nine words, in the order of a vertex buffer.
fn vertex_words(vertex: &Vertex) -> [u32; 9] {
    let [x0, x1, y0, y1, z0, z1] = vertex.position;
    let pair = |low: u16, high: u16| u32::from(low) | u32::from(high) << 16;
    let [nx, ny, nz, nw] = vertex.normal.map(i16::cast_unsigned);
    let [i, j] = vertex.lattice;
    [
        x0,
        x1,
        y0,
        y1,
        z0,
        z1,
        pair(nx, ny),
        pair(nz, nw),
        pair(i, j),
    ]
}

/// The vertex of nine words: what [`vertex_words`] undoes.
pub(crate) fn vertex_of(words: &[u32; 9]) -> Vertex {
    let [x0, x1, y0, y1, z0, z1, n0, n1, place] = *words;
    let low = |word: u32| (word & 0xffff) as u16;
    let high = |word: u32| (word >> 16) as u16;
    Vertex {
        position: [x0, x1, y0, y1, z0, z1],
        normal: [low(n0), high(n0), low(n1), high(n1)].map(u16::cast_signed),
        lattice: [low(place), high(place)],
    }
}
