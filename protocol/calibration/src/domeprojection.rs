//! The mesh of a domeprojection.com calibration as text.
//! Layout: a line `x;y;u;v;column;row` a vertex, as SGCT reads it (sgct/sgct, `src/correction/domeprojection.cpp`):
//! x, y are 0…1 over the output and u, v 0…1 over the source picture, all to the right and down; a first line of
//! titles is allowed. In: bytes. Out: a mapping. A vertex that is missing is an error, not a hole.

use crate::mesh::{Lattice, Vertex};
use crate::text::{Line, lines};
use crate::{MAX_SIZE_PX, Mapping, ReadError};

/// Reads the mesh at the output's size.
pub(crate) fn read(bytes: &[u8], file: &str, size_px: [u32; 2]) -> Result<Mapping, ReadError> {
    let lattice = parse(bytes, file)?;
    if let Some(regular) = lattice.regular() {
        return Ok(Mapping::Canvas(regular.map(|[u, v, _]| [u, v])));
    }
    let drawn = lattice
        .mesh()
        .rasterise(size_px[0], size_px[1])
        .map_err(|source| ReadError::Mesh {
            file: file.to_owned(),
            source,
        })?;
    Ok(Mapping::Canvas(drawn.map(|[u, v, _]| [u, v])))
}

fn parse(bytes: &[u8], file: &str) -> Result<Lattice, ReadError> {
    let mut found: Vec<(u32, u32, Vertex, u32)> = Vec::new();
    for (number, text) in lines(bytes).filter(|(_, text)| !text.is_empty()) {
        let line = Line { file, number };
        let mut words = text.split(';');
        let is_title =
            |word: &str| word.chars().any(char::is_alphabetic) && word.parse::<f64>().is_err();
        if found.is_empty() && number == 1 && text.split(';').next().is_some_and(is_title) {
            continue;
        }
        let mut next = |key| line.number(key, words.next());
        let place = [next("x")?, next("y")?];
        let values = [next("u")? as f32, next("v")? as f32, 1.0];
        let column = line.whole("column", words.next())?;
        let row = line.whole("row", words.next())?;
        found.push((column, row, Vertex { place, values }, number));
    }
    let first = |of: fn(&(u32, u32, Vertex, u32)) -> u32| found.iter().map(of).min().unwrap_or(0);
    let last = |of: fn(&(u32, u32, Vertex, u32)) -> u32| found.iter().map(of).max().unwrap_or(0);
    let (left, top) = (first(|vertex| vertex.0), first(|vertex| vertex.1));
    let columns = u64::from(last(|vertex| vertex.0) - left) + 1;
    let rows = u64::from(last(|vertex| vertex.1) - top) + 1;
    let largest = u64::from(MAX_SIZE_PX);
    if !(2..=largest).contains(&columns) || !(2..=largest).contains(&rows) {
        return Err(ReadError::BadSize {
            file: file.to_owned(),
            width: columns,
            height: rows,
        });
    }
    let due = columns * rows;
    if due != found.len() as u64 {
        return Err(ReadError::Damaged {
            file: file.to_owned(),
            reason: format!(
                "a mesh of {columns} columns and {rows} rows has {} vertices",
                found.len()
            ),
        });
    }
    let mut vertices = vec![None; found.len()];
    for (column, row, vertex, number) in found {
        let index = u64::from(row - top) * columns + u64::from(column - left);
        let place = usize::try_from(index)
            .ok()
            .and_then(|index| vertices.get_mut(index));
        if place.and_then(|place| place.replace(vertex)).is_some() {
            let value = format!("{column};{row}");
            return Err(Line { file, number }.refuse("column;row", &value, "each vertex once"));
        }
    }
    Ok(Lattice {
        columns: columns as u32,
        rows: rows as u32,
        vertices,
    })
}
