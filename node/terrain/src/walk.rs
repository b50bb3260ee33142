//! The edge walker: proof that a set of meshes has no gap.
//! In: vertices and triangles of tiles. Out: how many edges are not shared by exactly two triangles with
//! the same fixed-point end points. For tests and reports; it is too slow for every frame.

use std::collections::HashMap;

use geodesy::frame::FixedPoint;

use crate::mesh::Vertex;

/// What the walk found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Walk {
    /// Distinct positions.
    pub vertices: usize,
    /// Distinct pairs of positions that are a side of some triangle.
    pub edges: usize,
    /// Triangles with three distinct corners.
    pub triangles: usize,
    /// Edges that are the side of one triangle only: the border of the meshes, and every gap in them.
    pub open_edges: usize,
    /// Edges of more than two triangles, or of two that run along it the same way.
    pub tangled_edges: usize,
    /// Triangles with two corners at one position.
    pub degenerate_triangles: usize,
}

impl Walk {
    /// True if the meshes form one or more closed, consistently oriented surfaces.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0 && self.tangled_edges == 0 && self.degenerate_triangles == 0
    }

    /// Vertices − edges + triangles: 2 for a closed surface like a ball's.
    #[must_use]
    pub fn euler_characteristic(&self) -> i64 {
        self.vertices as i64 - self.edges as i64 + self.triangles as i64
    }
}

/// Collects meshes, then walks their edges.
#[derive(Debug, Default)]
pub struct Walker {
    vertices: HashMap<FixedPoint, u32>,
    /// For each pair (smaller, larger) of vertices, how many triangles run along it up and down.
    edges: HashMap<(u32, u32), [u32; 2]>,
    triangles: usize,
    degenerate_triangles: usize,
}

impl Walker {
    /// Adds the triangles of one mesh: triples of indices (`u16` or `u32`) into `vertices`. Triples with an index out
    /// of range are counted as degenerate.
    pub fn add<I: Copy + Into<u32>>(&mut self, vertices: &[Vertex], indices: &[I]) {
        let numbers: Vec<u32> = vertices
            .iter()
            .map(|vertex| {
                let next = self.vertices.len() as u32;
                *self.vertices.entry(vertex.point()).or_insert(next)
            })
            .collect();
        for triangle in indices.chunks(3) {
            let corner = |n: usize| numbers.get((*triangle.get(n)?).into() as usize).copied();
            match (corner(0), corner(1), corner(2)) {
                (Some(a), Some(b), Some(c)) if a != b && b != c && c != a => {
                    self.triangles += 1;
                    for (from, to) in [(a, b), (b, c), (c, a)] {
                        let way = usize::from(from > to);
                        self.edges.entry((from.min(to), from.max(to))).or_default()[way] += 1;
                    }
                }
                _ => self.degenerate_triangles += 1,
            }
        }
    }

    /// Walks all edges. Vertices that no triangle uses do not count.
    #[must_use]
    pub fn finish(&self) -> Walk {
        let mut used = vec![false; self.vertices.len()];
        let mut walk = Walk {
            edges: self.edges.len(),
            triangles: self.triangles,
            degenerate_triangles: self.degenerate_triangles,
            ..Walk::default()
        };
        for ((from, to), ways) in &self.edges {
            for end in [from, to] {
                if let Some(flag) = used.get_mut(*end as usize) {
                    *flag = true;
                }
            }
            match ways {
                [1, 1] => {}
                [1, 0] | [0, 1] => walk.open_edges += 1,
                _ => walk.tangled_edges += 1,
            }
        }
        walk.vertices = used.iter().filter(|used| **used).count();
        walk
    }
}
