//! Paul Bourke's warp mesh as text.
//! Layout: "Mesh format for image warping", paulbourke.net/dataformats/meshwarp (2006): line 1 the mesh type
//! (2 rectangular, 1 polar), line 2 `nx ny`, then nx · ny lines `x y u v i` with x fastest. y is −1…1 upwards, x
//! −aspect…aspect to the right; u, v are 0…1 to the right and up; i multiplies the light, and a node with negative i
//! is not drawn. SGCT reads the same (`src/correction/paulbourke.cpp`). In: bytes. Out: a mapping and its light.

use crate::map::{Map, Texels};
use crate::mesh::{Lattice, Vertex};
use crate::text::{Line, lines};
use crate::{MAX_SIZE_PX, Mapping, ReadError};

/// How far the seam of a polar mesh may gape, as a share of the output.
const SEAM: f64 = 1e-4;

/// Reads the mesh at the output's size.
pub(crate) fn read(
    bytes: &[u8],
    file: &str,
    size_px: [u32; 2],
) -> Result<(Mapping, Option<Map>), ReadError> {
    let [width, height] = size_px;
    let (polar, lattice) = parse(bytes, file, f64::from(width) / f64::from(height.max(1)))?;
    if polar && !is_closed(&lattice) {
        return Err(ReadError::Unsupported {
            file: file.to_owned(),
            what: "a polar mesh (type 1) whose seam is open".to_owned(),
            remedy: "Repeat its first column as the last one, or write type 2 if it is rectangular.",
        });
    }
    let all_bright = lattice
        .vertices
        .iter()
        .flatten()
        .all(|vertex| vertex.values[2] == 1.0);
    if all_bright && let Some(regular) = lattice.regular() {
        return Ok((Mapping::Canvas(regular.map(|[u, v, _]| [u, v])), None));
    }
    let drawn = lattice
        .mesh()
        .rasterise(width, height)
        .map_err(|source| ReadError::Mesh {
            file: file.to_owned(),
            source,
        })?;
    // Where nothing is drawn, there is no light: maps of light have no holes.
    let light = |[_, _, light]: &[f32; 3]| {
        if light.is_nan() {
            0.0
        } else {
            light.clamp(0.0, 1.0)
        }
    };
    let alpha = (!all_bright)
        .then(|| {
            Map::new(
                width,
                height,
                Texels::Grey(drawn.values.iter().map(light).collect()),
            )
        })
        .flatten();
    Ok((Mapping::Canvas(drawn.map(|[u, v, _]| [u, v])), alpha))
}

fn parse(bytes: &[u8], file: &str, aspect: f64) -> Result<(bool, Lattice), ReadError> {
    let mut rows = lines(bytes).filter(|(_, line)| !line.is_empty());
    let mut next = || rows.next().unwrap_or_default();
    let (number, text) = next();
    let head = Line { file, number };
    let polar = match text.as_ref() {
        "1" => true,
        "2" => false,
        other => return Err(head.refuse("the mesh type", other, "1 (polar) or 2 (rectangular)")),
    };
    let (number, text) = next();
    let head = Line { file, number };
    let mut words = text.split_whitespace();
    let columns = head.whole("nx", words.next())?;
    let count = head.whole("ny", words.next())?;
    if !(2..=MAX_SIZE_PX).contains(&columns) || !(2..=MAX_SIZE_PX).contains(&count) {
        return Err(head.refuse("nx ny", &text, "two numbers of 2…16384"));
    }
    let due = columns as usize * count as usize;
    let mut vertices = Vec::new();
    for (number, text) in rows {
        if vertices.len() == due {
            return Err(Line { file, number }.refuse(
                "a further node",
                &text,
                "nx · ny nodes, no more",
            ));
        }
        vertices.push(node(&text, Line { file, number }, aspect)?);
    }
    if vertices.len() != due {
        // A line has at least ten bytes; what counts is that nodes are missing.
        return Err(ReadError::Damaged {
            file: file.to_owned(),
            reason: format!("{} nodes of {due} are there", vertices.len()),
        });
    }
    if vertices.iter().all(Option::is_none) {
        return Err(ReadError::NothingMapped {
            file: file.to_owned(),
        });
    }
    let lattice = Lattice {
        columns,
        rows: count,
        vertices,
    };
    Ok((polar, lattice))
}

fn node(text: &str, line: Line<'_>, aspect: f64) -> Result<Option<Vertex>, ReadError> {
    let mut words = text.split_whitespace();
    let mut next = |key| line.number(key, words.next());
    let [x, y, u, v, light] = [next("x")?, next("y")?, next("u")?, next("v")?, next("i")?];
    if let Some(word) = words.next() {
        return Err(line.refuse("a sixth number", word, "five numbers: x y u v i"));
    }
    Ok((light >= 0.0).then_some(Vertex {
        place: [(x / aspect + 1.0) / 2.0, (1.0 - y) / 2.0],
        values: [u as f32, (1.0 - v) as f32, light as f32],
    }))
}

/// Whether the first column lies on the last, or the first row on the last.
fn is_closed(lattice: &Lattice) -> bool {
    let at = |column: u32, row: u32| {
        let index = row as usize * lattice.columns as usize + column as usize;
        lattice.vertices.get(index).copied().flatten()
    };
    let near = |one: Option<Vertex>, other: Option<Vertex>| match (one, other) {
        (Some(one), Some(other)) => one
            .place
            .iter()
            .zip(other.place)
            .all(|(a, b)| (a - b).abs() <= SEAM),
        (one, other) => one.is_none() && other.is_none(),
    };
    (0..lattice.rows).all(|row| near(at(0, row), at(lattice.columns - 1, row)))
        || (0..lattice.columns).all(|column| near(at(column, 0), at(column, lattice.rows - 1)))
}
