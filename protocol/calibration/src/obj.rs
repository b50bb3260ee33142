//! Wavefront OBJ as a warp or as a screen.
//! Layout: the keywords `v`, `vt` and `f` of "Object Files (.obj)", Wavefront Technologies, Appendix B1; as a warp,
//! `v` is −1…1 over the output and `vt` 0…1 over the source picture, both to the right and up, as SGCT reads it
//! (sgct/sgct, `src/correction/obj.cpp`). In: bytes. Out: a mesh. It reads no materials.

use std::collections::HashMap;

use crate::mesh::{Mesh, Vertex};
use crate::options::{ObjMeaning, Options};
use crate::text::{Line, lines};
use crate::{Mapping, PointOrigin, ReadError};

/// Keywords whose lines say nothing about the mesh's shape.
const SKIPPED: [&str; 10] = [
    "vn", "vp", "l", "p", "mtllib", "usemtl", "o", "g", "s", "cstype",
];

/// An OBJ as it stands in the file.
struct Wavefront {
    positions: Vec<[f64; 3]>,
    textures: Vec<[f64; 2]>,
    /// Position and texture of each corner.
    triangles: Vec<[(u32, u32); 3]>,
}

/// Reads an OBJ as the mesh that [`ObjMeaning`] says: with [`ObjMeaning::Warp`] the values are u, v (down)
/// and 1, with [`ObjMeaning::Surface`] x, y and z times `unit_m`. The second value tells which it is.
///
/// # Errors
/// Lines that are no OBJ, faces of other than three or four corners, corners without `vt`, or no face at all.
pub fn read_mesh(
    bytes: &[u8],
    file: &str,
    meaning: ObjMeaning,
    unit_m: f32,
) -> Result<(Mesh, ObjMeaning), ReadError> {
    let wavefront = parse(bytes, file)?;
    let meaning = match meaning {
        ObjMeaning::Told
            if wavefront
                .positions
                .iter()
                .all(|position| position[2] == 0.0) =>
        {
            ObjMeaning::Warp
        }
        ObjMeaning::Told => ObjMeaning::Surface,
        told => told,
    };
    Ok((wavefront.mesh(meaning, unit_m), meaning))
}

/// An OBJ drawn at the output's size.
pub(crate) fn read(
    bytes: &[u8],
    file: &str,
    options: &Options,
    size_px: [u32; 2],
) -> Result<Mapping, ReadError> {
    let (mesh, meaning) = read_mesh(bytes, file, options.obj, options.unit_m)?;
    let drawn = mesh
        .rasterise(size_px[0], size_px[1])
        .map_err(|source| ReadError::Mesh {
            file: file.to_owned(),
            source,
        })?;
    Ok(if meaning == ObjMeaning::Warp {
        Mapping::Canvas(drawn.map(|[u, v, _]| [u, v]))
    } else {
        Mapping::Points {
            points_m: drawn,
            origin: PointOrigin::Unknown,
            projector: None,
        }
    })
}

fn parse(bytes: &[u8], file: &str) -> Result<Wavefront, ReadError> {
    let mut wavefront = Wavefront {
        positions: Vec::new(),
        textures: Vec::new(),
        triangles: Vec::new(),
    };
    for (number, text) in lines(bytes) {
        let line = Line { file, number };
        let mut words = text.split_whitespace();
        match words.next() {
            None => {}
            Some(comment) if comment.starts_with('#') => {}
            Some("v") => {
                let mut next = |key| line.number(key, words.next());
                wavefront
                    .positions
                    .push([next("x")?, next("y")?, next("z")?]);
            }
            Some("vt") => {
                let mut next = |key| line.number(key, words.next());
                wavefront.textures.push([next("u")?, next("v")?]);
            }
            Some("f") => wavefront.add_face(words, line)?,
            Some(keyword) if SKIPPED.contains(&keyword) => {}
            Some(keyword) => {
                return Err(line.refuse("the keyword", keyword, "an OBJ of v, vt and f"));
            }
        }
    }
    if wavefront.triangles.is_empty() {
        return Err(ReadError::NothingMapped {
            file: file.to_owned(),
        });
    }
    Ok(wavefront)
}

impl Wavefront {
    fn add_face<'a>(
        &mut self,
        words: impl Iterator<Item = &'a str>,
        line: Line<'_>,
    ) -> Result<(), ReadError> {
        let mut corners = [(0, 0); 4];
        let mut count = 0;
        for word in words {
            let Some(place) = corners.get_mut(count) else {
                return Err(line.refuse(
                    "the face",
                    word,
                    "triangles or quadrilaterals; triangulate the mesh",
                ));
            };
            *place = self.corner(word, line)?;
            count += 1;
        }
        let [a, b, c, d] = corners;
        match count {
            3 => self.triangles.push([a, b, c]),
            4 => self.triangles.extend([[a, b, c], [a, c, d]]),
            _ => return Err(line.refuse("the face", "", "three or four corners")),
        }
        Ok(())
    }

    fn corner(&self, word: &str, line: Line<'_>) -> Result<(u32, u32), ReadError> {
        let mut numbers = word.split('/');
        let mut next = |key: &str, count: usize| {
            let text = numbers.next().unwrap_or("");
            index(text, count).ok_or_else(|| {
                let wanted = format!(
                    "a number of 1…{count}, or from −{count} to −1, as in \"f 1/1 2/2 3/3\""
                );
                line.refuse(key, word, &wanted)
            })
        };
        Ok((
            next("the corner's vertex", self.positions.len())?,
            next("the corner's texture", self.textures.len())?,
        ))
    }

    fn mesh(&self, meaning: ObjMeaning, unit_m: f32) -> Mesh {
        let mut mesh = Mesh::default();
        let mut known: HashMap<(u32, u32), u32> = HashMap::new();
        for triangle in &self.triangles {
            let corners = triangle.map(|corner| {
                *known.entry(corner).or_insert_with(|| {
                    mesh.vertices.push(self.vertex(corner, meaning, unit_m));
                    // One vertex takes at least a byte of the file, and files are far below 4 GiB.
                    u32::try_from(mesh.vertices.len() - 1).unwrap_or(u32::MAX)
                })
            });
            mesh.triangles.push(corners);
        }
        mesh
    }

    fn vertex(&self, (position, texture): (u32, u32), meaning: ObjMeaning, unit_m: f32) -> Vertex {
        let [x, y, z] = self
            .positions
            .get(position as usize)
            .copied()
            .unwrap_or([f64::NAN; 3]);
        let [u, v] = self
            .textures
            .get(texture as usize)
            .copied()
            .unwrap_or([f64::NAN; 2]);
        if meaning == ObjMeaning::Surface {
            return Vertex {
                place: [u, 1.0 - v],
                values: [x, y, z].map(|value| (value * f64::from(unit_m)) as f32),
            };
        }
        Vertex {
            place: [(x + 1.0) / 2.0, (1.0 - y) / 2.0],
            values: [u as f32, (1.0 - v) as f32, 1.0],
        }
    }
}

/// An index of the file, 1 for the first or −1 for the latest, as an index from 0.
fn index(word: &str, count: usize) -> Option<u32> {
    let number: i64 = word.parse().ok()?;
    let count = i64::try_from(count).ok()?;
    let from_zero = if number < 0 {
        count + number.max(-count - 1)
    } else {
        number - 1
    };
    (0..count)
        .contains(&from_zero)
        .then(|| u32::try_from(from_zero).ok())?
}
