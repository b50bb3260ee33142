//! Base patches: conforming, right isosceles, counter-clockwise, on the lattice, friendly to caches.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use std::collections::{HashMap, VecDeque};

use geodesy::{Direction, FACES};
use terrain::{LATTICE_STEPS, MAX_REFINEMENT, Patch, PatchError};

fn corners(patch: &Patch, triangle: &[u16]) -> [(i64, i64); 3] {
    [0, 1, 2].map(|n| {
        let [i, j] = patch.positions[usize::from(triangle[n])];
        (i64::from(i), i64::from(j))
    })
}

#[test]
fn counts_follow_the_rule() {
    for refinement in 0..=MAX_REFINEMENT {
        let patch = Patch::new(refinement).unwrap();
        let n = 1_usize << refinement;
        assert_eq!(patch.positions.len(), (n + 1) * (n + 1) + n * n + 4 * n);
        assert!(patch.positions.is_sorted_by_key(|[i, j]| (*j, *i)));
        for variant in 0..16_u8 {
            assert_eq!(
                patch.triangles(variant),
                4 * n * n + n * variant.count_ones() as usize
            );
        }
    }
    assert_eq!(
        Patch::new(MAX_REFINEMENT + 1),
        Err(PatchError::TooFine(MAX_REFINEMENT + 1))
    );
}

#[test]
fn triangles_are_right_isosceles_and_counter_clockwise_and_fill_the_tile() {
    for refinement in 0..=5 {
        let patch = Patch::new(refinement).unwrap();
        for indices in &patch.indices {
            let mut twice_area = 0;
            for triangle in indices.chunks(3) {
                let points = corners(&patch, triangle);
                let mut sides: Vec<i64> = (0..3)
                    .map(|n| {
                        let (a, b) = (points[n], points[(n + 1) % 3]);
                        (a.0 - b.0).pow(2) + (a.1 - b.1).pow(2)
                    })
                    .collect();
                sides.sort_unstable();
                assert!(
                    sides[0] == sides[1] && sides[2] == 2 * sides[0],
                    "{points:?}"
                );
                let [a, b, c] = points;
                let area = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
                assert!(area > 0, "{points:?} turns the wrong way");
                twice_area += area;
            }
            assert_eq!(twice_area, 2 * i64::from(LATTICE_STEPS).pow(2));
        }
    }
    // Counter-clockwise in (u, v) is counter-clockwise seen from outside on every face.
    for face in FACES {
        let [u, v, outward] = face.frame();
        assert_eq!(u.cross(v), outward);
    }
}

#[test]
fn inner_edges_are_shared_by_two_and_border_edges_match_the_neighbour() {
    for refinement in 0..=4 {
        let patch = Patch::new(refinement).unwrap();
        let last = i64::from(LATTICE_STEPS);
        for (variant, indices) in patch.indices.iter().enumerate() {
            let mut edges = HashMap::new();
            for triangle in indices.chunks(3) {
                let points = corners(&patch, triangle);
                for n in 0..3 {
                    *edges.entry((points[n], points[(n + 1) % 3])).or_insert(0) += 1;
                }
            }
            let mut border = [0; 4];
            for ((from, to), count) in &edges {
                assert_eq!(*count, 1);
                let on = [
                    from.0 == 0 && to.0 == 0,
                    from.0 == last && to.0 == last,
                    from.1 == 0 && to.1 == 0,
                    from.1 == last && to.1 == last,
                ];
                match on.iter().position(|on| *on) {
                    Some(edge) => {
                        border[edge] += 1;
                        assert!(!edges.contains_key(&(*to, *from)));
                    }
                    None => assert!(
                        edges.contains_key(&(*to, *from)),
                        "{from:?} to {to:?} is open"
                    ),
                }
            }
            for (bit, count) in border.into_iter().enumerate() {
                let finer = variant >> bit & 1;
                assert_eq!(
                    count,
                    1 << (usize::from(refinement) + finer),
                    "{:?}",
                    Direction::EDGES[bit]
                );
            }
        }
    }
}

#[test]
fn vertices_are_fetched_about_once() {
    for refinement in [3, 4, 5, 7] {
        let patch = Patch::new(refinement).unwrap();
        for variant in [0_u8, 15] {
            let mut cache = VecDeque::new();
            let mut misses = 0;
            for index in &patch.indices[usize::from(variant)] {
                if !cache.contains(index) {
                    misses += 1;
                    cache.push_back(*index);
                    if cache.len() > 32 {
                        cache.pop_front();
                    }
                }
            }
            let per_triangle = f64::from(misses) / patch.triangles(variant) as f64;
            assert!(
                per_triangle < 0.65,
                "refinement {refinement}: {per_triangle} misses a triangle"
            );
        }
    }
}
