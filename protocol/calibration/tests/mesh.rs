//! Triangles at pixel centres: exact values, shared edges, folds, and a bound on the work.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use calibration::{Mesh, RasteriseError, Vertex};
use proptest::prelude::*;

/// A vertex that shows its own place, and 1.
fn own_place(x: f64, y: f64) -> Vertex {
    Vertex {
        place: [x, y],
        values: [x as f32, y as f32, 1.0],
    }
}

fn square() -> Mesh {
    Mesh {
        vertices: vec![
            own_place(0.0, 0.0),
            own_place(1.0, 0.0),
            own_place(0.0, 1.0),
            own_place(1.0, 1.0),
        ],
        triangles: vec![[0, 1, 3], [0, 3, 2]],
    }
}

#[test]
fn a_square_of_two_triangles_fills_every_centre_with_its_own_place() {
    for [width, height] in [[1, 1], [4, 3], [97, 64], [640, 2]] {
        let drawn = square().rasterise(width, height).unwrap();
        for (index, [u, v, one]) in drawn.values.iter().enumerate() {
            let x = (f64::from(index as u32 % width) + 0.5) / f64::from(width);
            let y = (f64::from(index as u32 / width) + 0.5) / f64::from(height);
            assert!((f64::from(*u) - x).abs() < 1e-7 && (f64::from(*v) - y).abs() < 1e-7);
            assert_eq!(*one, 1.0);
        }
    }
}

#[test]
fn a_triangle_covers_the_centres_inside_it_and_on_its_edge() {
    // The lower left half of 4 × 4: the centres on the diagonal belong to it.
    let mesh = Mesh {
        vertices: square().vertices,
        triangles: vec![[0, 2, 3]],
    };
    let drawn = mesh.rasterise(4, 4).unwrap();
    for row in 0..4 {
        for column in 0..4 {
            assert_eq!(
                drawn.at(column, row).is_some(),
                column <= row,
                "{column}, {row}"
            );
        }
    }
}

#[test]
fn what_lies_outside_is_cut_off() {
    let mesh = Mesh {
        vertices: vec![
            own_place(-3.0, -2.0),
            own_place(5.0, -2.0),
            own_place(-3.0, 9.0),
        ],
        triangles: vec![[0, 1, 2]],
    };
    let drawn = mesh.rasterise(3, 3).unwrap();
    let [u, v, _] = drawn.at(1, 2).unwrap();
    assert!((u - 0.5).abs() < 1e-6 && (v - 5.0 / 6.0).abs() < 1e-6);
}

#[test]
fn the_last_of_two_layers_counts_and_flat_triangles_are_nothing() {
    let mut mesh = square();
    mesh.vertices
        .extend(square().vertices.iter().map(|vertex| Vertex {
            values: [9.0; 3],
            ..*vertex
        }));
    mesh.triangles.extend([[4, 5, 7], [0, 1, 1], [0, 3, 0]]);
    let drawn = mesh.rasterise(8, 8).unwrap();
    assert_eq!(drawn.at(7, 0), Some([9.0; 3]));
    assert_ne!(drawn.at(0, 7), Some([9.0; 3]));
}

#[test]
fn faults_are_named() {
    let mut mesh = square();
    assert_eq!(
        mesh.rasterise(0, 4),
        Err(RasteriseError::BadSize {
            width: 0,
            height: 4
        })
    );
    assert_eq!(
        mesh.rasterise(4, 16_385),
        Err(RasteriseError::BadSize {
            width: 4,
            height: 16_385
        })
    );
    mesh.triangles = vec![[0, 1, 3]; 100_000];
    assert_eq!(
        mesh.rasterise(500, 500),
        Err(RasteriseError::TooMuchOverlap)
    );
    mesh.triangles = vec![[0, 1, 4]];
    assert_eq!(
        mesh.rasterise(4, 4),
        Err(RasteriseError::NoVertex { triangle: 0 })
    );
}

proptest! {
    /// A lattice whose inner vertices are moved about covers every centre: triangles leave no crack.
    #[test]
    fn neighbours_leave_no_crack(moves in prop::collection::vec((-0.3_f64..0.3, -0.3_f64..0.3), 16), width in 1_u32..200, height in 1_u32..200) {
        let mut mesh = Mesh::default();
        for row in 0..6_u32 {
            for column in 0..6_u32 {
                let inner = (1..5).contains(&row) && (1..5).contains(&column);
                let (right, down) = if inner { moves[(row as usize - 1) * 4 + column as usize - 1] } else { (0.0, 0.0) };
                mesh.vertices.push(own_place((f64::from(column) + right) / 5.0, (f64::from(row) + down) / 5.0));
            }
        }
        for row in 0..5 {
            for column in 0..5 {
                let corner = row * 6 + column;
                mesh.triangles.push([corner, corner + 1, corner + 7]);
                mesh.triangles.push([corner, corner + 7, corner + 6]);
            }
        }
        let drawn = mesh.rasterise(width, height).unwrap();
        for (index, [u, v, _]) in drawn.values.iter().enumerate() {
            let x = (f64::from(index as u32 % width) + 0.5) / f64::from(width);
            let y = (f64::from(index as u32 / width) + 0.5) / f64::from(height);
            prop_assert!((f64::from(*u) - x).abs() < 1e-6 && (f64::from(*v) - y).abs() < 1e-6, "{index}: {u}, {v}");
        }
    }

    /// Whatever the vertices are, nothing panics.
    #[test]
    fn any_vertices_are_borne(places in prop::collection::vec((any::<f64>(), any::<f64>()), 3..9), triangles in prop::collection::vec([0_u32..10, 0..10, 0..10], 0..20)) {
        let vertices = places.iter().map(|(x, y)| own_place(*x, *y)).collect();
        let _ = Mesh { vertices, triangles }.rasterise(16, 9);
    }
}
