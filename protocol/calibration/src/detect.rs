//! Which format a file has.
//! In: its first bytes and its name. Out: the format; the contents tell it first, the extension second. It reads no
//! further than it must.

use crate::Format;
use crate::text::lines;

/// Most of a text that is looked at.
const LOOKED_AT: usize = 64 << 10;

/// The format of a calibration, where it can be told. `name` is a file name or path, for its extension.
#[must_use]
pub fn detect(bytes: &[u8], name: &str) -> Option<Format> {
    by_mark(bytes)
        .or_else(|| by_text(bytes))
        .or_else(|| by_extension(name))
}

fn by_mark(bytes: &[u8]) -> Option<Format> {
    match bytes {
        [b'P', b'K', 3, 4, ..] | [b'P', b'K', 5, 6, ..] => Some(Format::Mpcdi),
        [b'v', b'w', b'f', b'0'..=b'9', ..] => Some(Format::Vwf),
        [b'P', b'F' | b'f', b' ' | b'\t' | b'\r' | b'\n', ..] => Some(Format::Pfm),
        _ => None,
    }
}

fn by_text(bytes: &[u8]) -> Option<Format> {
    let mut said = lines(bytes.get(..LOOKED_AT).unwrap_or(bytes))
        .map(|(_, line)| line)
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    let first = said.next()?;
    let second = said.next().unwrap_or_default();
    let is_whole = |word: &str| word.parse::<u32>().is_ok();
    let is_vertex = |line: &str| {
        let mut words = line.split(';');
        let coordinates = words
            .by_ref()
            .take(4)
            .filter(|word| word.trim().parse::<f64>().is_ok());
        coordinates.count() == 4 && words.take(2).filter(|word| is_whole(word.trim())).count() == 2
    };
    if is_vertex(&first) || (first.matches(';').count() >= 5 && is_vertex(&second)) {
        return Some(Format::Domeprojection);
    }
    let sizes: Vec<&str> = second.split_whitespace().collect();
    if is_whole(&first) && sizes.len() == 2 && sizes.iter().all(|word| is_whole(word)) {
        return Some(Format::Bourke);
    }
    let keyword = first.split_whitespace().next()?;
    ["v", "vt", "vn", "f", "o", "g", "s", "mtllib", "usemtl"]
        .contains(&keyword)
        .then_some(Format::Obj)
}

fn by_extension(name: &str) -> Option<Format> {
    let (_, extension) = name.rsplit_once('.')?;
    match extension.to_ascii_lowercase().as_str() {
        "mpcdi" => Some(Format::Mpcdi),
        "vwf" => Some(Format::Vwf),
        "pfm" => Some(Format::Pfm),
        "obj" => Some(Format::Obj),
        "csv" => Some(Format::Domeprojection),
        "data" => Some(Format::Bourke),
        _ => None,
    }
}
