//! Writers of calibration files, by the layouts that the readers' modules cite.
//! In: values at places. Out: bytes. They share no code with the readers.

use std::fmt::Write as _;

/// A PFM of three channels: rows from the top, written from the bottom, little-endian (Debevec, "PFM Portable Float Map").
pub(super) fn pfm(width: u32, rows_from_top: &[[f32; 3]]) -> Vec<u8> {
    let height = rows_from_top.len() / width as usize;
    let mut bytes = format!("PF\n{width} {height}\n-1.0\n").into_bytes();
    for row in rows_from_top.chunks(width as usize).rev() {
        bytes.extend(row.iter().flatten().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

/// A VIOSO file of one output: `vwf0`, header length, flags, machine, bytes of records, width, height, white and black,
/// 16 reserved values (of which 9…11 scale the black level), a name of 256 bytes, then records.
pub(super) fn vwf(
    name: &str,
    flags: u32,
    black: [f32; 3],
    size: [u32; 2],
    records: &[[f32; 4]],
) -> Vec<u8> {
    let mut bytes = b"vwf0".to_vec();
    for word in [380, flags, 7, records.len() as u32 * 16, size[0], size[1]] {
        bytes.extend(word.to_le_bytes());
    }
    let mut reserved = [0.0_f32; 16];
    reserved[9..12].copy_from_slice(&black);
    let white_and_black = [1.0_f32, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    for value in white_and_black.into_iter().chain(reserved) {
        bytes.extend(value.to_le_bytes());
    }
    let mut padded = [0; 256];
    padded[..name.len()].copy_from_slice(name.as_bytes());
    bytes.extend(padded);
    bytes.extend(
        records
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes()),
    );
    bytes
}

/// A set of VIOSO blocks: `vwf1`, their number, where the first one is, 0.
pub(super) fn vwf_set(blocks: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"vwf1".to_vec();
    for word in [blocks.len() as u32, 16, 0] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(blocks.concat());
    bytes
}

/// A Windows bitmap of 24 bits a pixel from greys in rows from the top, stored from the bottom.
pub(super) fn bitmap([width, height]: [u32; 2], greys: &[u8]) -> Vec<u8> {
    let padded = (width as usize * 3).div_ceil(4) * 4;
    let mut bytes = b"BM".to_vec();
    bytes.extend((54 + padded as u32 * height).to_le_bytes());
    bytes.extend([0; 4]);
    for word in [54, 40, width, height] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(1_u16.to_le_bytes());
    bytes.extend(24_u16.to_le_bytes());
    bytes.extend([0; 24]);
    for row in greys.chunks(width as usize).rev() {
        let before = bytes.len();
        bytes.extend(row.iter().flat_map(|grey| [*grey; 3]));
        bytes.resize(before + padded, 0);
    }
    bytes
}

/// Nodes of a lattice: shares of the output, both edges included, in rows from the top.
pub(super) fn nodes([columns, rows]: [u32; 2]) -> impl Iterator<Item = ([u32; 2], [f64; 2])> {
    let share = |number: u32, count: u32| f64::from(number) / f64::from(count - 1);
    (0..rows).flat_map(move |row| {
        (0..columns).map(move |column| ([column, row], [share(column, columns), share(row, rows)]))
    })
}

/// The mesh of a domeprojection.com calibration: `x;y;u;v;column;row`.
pub(super) fn domeprojection(size: [u32; 2], uv: impl Fn([f64; 2]) -> [f64; 2]) -> String {
    let mut text = String::from("x;y;u;v;column;row\n");
    for ([column, row], place) in nodes(size) {
        // Not regular, so that places are read.
        let place = bent(place);
        let [u, v] = uv(place);
        writeln!(text, "{};{};{u};{v};{column};{row}", place[0], place[1]).unwrap();
    }
    text
}

/// Paul Bourke's mesh, rectangular: `x y u v i`, x −aspect…aspect, y −1…1, u, v, all to the right and up.
pub(super) fn bourke(
    size: [u32; 2],
    aspect: f64,
    node: impl Fn([f64; 2]) -> ([f64; 2], f64),
) -> String {
    let mut text = format!("2\n{} {}\n", size[0], size[1]);
    for (_, place) in nodes(size) {
        let place = bent(place);
        let ([u, v], light) = node(place);
        let (x, y) = ((2.0 * place[0] - 1.0) * aspect, 1.0 - 2.0 * place[1]);
        writeln!(text, "{x} {y} {u} {} {light}", 1.0 - v).unwrap();
    }
    text
}

/// An OBJ of quadrilaterals: a position and a texture coordinate for each node.
pub(super) fn obj(size: [u32; 2], node: impl Fn([f64; 2]) -> ([f64; 3], [f64; 2])) -> String {
    let (mut positions, mut textures) = (String::new(), String::new());
    let mut faces = String::new();
    for ([column, row], place) in nodes(size) {
        let ([x, y, z], [u, v]) = node(place);
        writeln!(positions, "v {x} {y} {z}").unwrap();
        writeln!(textures, "vt {u} {v}").unwrap();
        if column > 0 && row > 0 {
            // Nodes count from 1.
            let here = row * size[0] + column + 1;
            let corners = [here, here - 1, here - 1 - size[0], here - size[0]];
            let corners = corners.map(|corner| format!("{corner}/{corner}"));
            writeln!(faces, "f {}", corners.join(" ")).unwrap();
        }
    }
    positions + &textures + &faces
}

/// A place moved a little within the output; edges stay edges.
fn bent([x, y]: [f64; 2]) -> [f64; 2] {
    [x + 0.1 * x * (1.0 - x), y - 0.1 * y * (1.0 - y)]
}
