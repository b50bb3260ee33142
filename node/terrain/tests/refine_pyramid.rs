//! Proof that the error pyramid bounds every sample of every triangle, is exact where it says so, and is nested.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]
#![allow(clippy::print_stdout, reason = "one test prints what it measures")]

mod common;
mod refined;

use std::time::Instant;

use common::Random;
use geodesy::Tile;
use refined::{adversarial, fractal, nodes};
use terrain::{LATTICE_NODES, code_up, decode, pair, pyramid};

type Mark = [u16; 2];

fn node([x, y]: Mark) -> usize {
    257 * usize::from(y) + usize::from(x)
}

/// A triangle: its mark, level, side, ends of the hypotenuse, apex.
struct Triangle {
    mark: Mark,
    level: u8,
    side: usize,
    ends: [Mark; 2],
    apex: Mark,
}

/// All triangles that have a mark.
fn hierarchy() -> Vec<Triangle> {
    let all = nodes().filter_map(|mark| Some((mark, pair(8, mark[0], mark[1])?)));
    all.flat_map(|(mark, own)| {
        let side = move |side: usize| {
            let apex = own.apexes[side]?;
            Some(Triangle {
                mark,
                level: own.level,
                side,
                ends: own.ends,
                apex,
            })
        };
        (0..2).filter_map(side)
    })
    .collect()
}

impl Triangle {
    /// The triangle of a hypotenuse.
    fn new(from: Mark, to: Mark, apex: Mark) -> Self {
        let mark = middle(from, to);
        let own = pair(8, mark[0], mark[1]).unwrap();
        let side = usize::from(own.apexes[0] != Some(apex));
        assert_eq!(own.apexes[side], Some(apex));
        Self {
            mark,
            level: own.level,
            side,
            ends: own.ends,
            apex,
        }
    }

    fn children(&self) -> [Self; 2] {
        self.ends.map(|end| Self::new(self.apex, end, self.mark))
    }

    fn code(&self, errors: &[u32]) -> u16 {
        (errors[node(self.mark)] >> (16 * self.side)) as u16
    }

    /// The samples inside, borders included.
    fn samples(&self) -> Vec<Mark> {
        let corners = [self.ends[0], self.ends[1], self.apex];
        let span = |c: usize| {
            let low = corners.iter().map(|corner| corner[c]).min().unwrap();
            let high = corners.iter().map(|corner| corner[c]).max().unwrap();
            low..=high
        };
        span(1)
            .flat_map(|y| span(0).map(move |x| [x, y]))
            .filter(|point| self.weights(*point).iter().all(|weight| *weight >= 0))
            .collect()
    }

    /// Barycentric weights of a point for ends and apex; they sum to twice the area.
    fn weights(&self, point: Mark) -> [i64; 3] {
        let cross = |a: Mark, b: Mark, c: Mark| {
            let [ax, ay, bx, by, cx, cy] = [a[0], a[1], b[0], b[1], c[0], c[1]].map(i64::from);
            (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        };
        let ([a, b], c) = (self.ends, self.apex);
        let weights = [cross(b, c, point), cross(c, a, point), cross(a, b, point)];
        let sign = cross(a, b, c).signum();
        weights.map(|weight| weight * sign)
    }

    /// How far a sample is off the plane, as numerator and denominator.
    fn deviation(&self, heights: &[i32], point: Mark) -> (i64, i64) {
        let weights = self.weights(point);
        let area: i64 = weights.iter().sum();
        let height = |mark: Mark| i64::from(heights[node(mark)]);
        let corners = [self.ends[0], self.ends[1], self.apex];
        let plane: i64 = weights
            .iter()
            .zip(corners)
            .map(|(w, corner)| w * height(corner))
            .sum();
        ((area * height(point) - plane).abs(), area)
    }

    /// The largest deviation of these, rounded up.
    fn largest(&self, heights: &[i32], points: &[Mark]) -> u32 {
        let each = points.iter().map(|point| {
            let (numerator, denominator) = self.deviation(heights, *point);
            (numerator as u64).div_ceil(denominator as u64)
        });
        each.max().unwrap() as u32
    }
}

fn middle(from: Mark, to: Mark) -> Mark {
    [u16::midpoint(from[0], to[0]), u16::midpoint(from[1], to[1])]
}

/// Bounds, nested, and equal to their definition, everywhere.
fn check(heights: &[i32], triangles: &[Triangle]) {
    let errors = pyramid(heights);
    assert_eq!(errors.len(), LATTICE_NODES);
    for triangle in triangles {
        let code = triangle.code(&errors);
        let truth = triangle.largest(heights, &triangle.samples());
        assert!(
            decode(code) >= truth,
            "{:?} {}: {truth}",
            triangle.mark,
            triangle.level
        );
        let inside = if triangle.level < 14 {
            triangle
                .children()
                .map(|child| child.code(&errors))
                .into_iter()
                .max()
                .unwrap()
        } else {
            0
        };
        assert!(code >= inside);
        let own = if triangle.level >= 11 {
            truth
        } else {
            // Four levels down, child by child.
            let mut parts = vec![Triangle::new(
                triangle.ends[0],
                triangle.ends[1],
                triangle.apex,
            )];
            for _ in 0..4 {
                parts = parts.iter().flat_map(Triangle::children).collect();
            }
            assert!(parts.iter().all(|part| part.level == triangle.level + 4));
            let bound = |part: &Triangle| {
                let corners = [part.ends[0], part.ends[1], part.apex];
                triangle.largest(heights, &corners) + decode(part.code(&errors))
            };
            parts.iter().map(bound).max().unwrap()
        };
        assert_eq!(
            code,
            code_up(own.max(decode(inside))),
            "{:?} {}",
            triangle.mark,
            triangle.level
        );
    }
    // Nothing is said of what does not exist.
    for [x, y] in nodes() {
        let word = errors[node([x, y])];
        for side in 0..2 {
            let exists = pair(8, x, y).is_some_and(|own| own.apexes[side].is_some());
            assert!(exists || word >> (16 * side) & 0xffff == 0);
        }
    }
}

#[test]
fn it_bounds_every_sample_and_is_what_it_says() {
    let mut random = Random(6);
    let triangles = hierarchy();
    assert_eq!(triangles.len(), 4 * ((1 << 15) - 1));
    for kind in 0..4 {
        for _ in 0..3 {
            check(&adversarial(&mut random, kind), &triangles);
        }
    }
    let tile = Tile::new(2, 9, 100, 200).unwrap();
    check(&fractal(tile, 5e6, 0.5, 1), &triangles);
    check(&fractal(tile, 9000.0, 0.7, 2), &triangles);
}

#[test]
fn planes_have_no_error_and_ends_of_range_no_overflow() {
    let plane: Vec<i32> = nodes()
        .map(|[x, y]| 70 * i32::from(x) - 33 * i32::from(y))
        .collect();
    assert_eq!(pyramid(&plane), vec![0; LATTICE_NODES]);
    let mut ends: Vec<i32> = nodes()
        .map(|[x, y]| if (x ^ y) & 1 == 0 { 1 << 27 } else { -1 << 27 })
        .collect();
    let errors = pyramid(&ends);
    let largest = errors
        .iter()
        .flat_map(|word| [word & 0xffff, word >> 16])
        .max()
        .unwrap();
    assert!(decode(largest as u16) < 1 << 31);
    // Beyond what is allowed the bound still holds, as far as a code can say.
    ends.fill(i32::MIN);
    ends[node([90, 77])] = i32::MAX;
    let errors = pyramid(&ends);
    assert_eq!(decode((errors[node([128, 0])] >> 16) as u16), u32::MAX);
    // Too few heights are never drawn as if they were flat.
    assert!(pyramid(&[0; 5]).iter().all(|word| *word == u32::MAX));
}

#[test]
#[ignore = "measures"]
fn looseness_and_time() {
    let triangles = hierarchy();
    for (name, heights) in [
        (
            "hills, halved",
            fractal(Tile::new(2, 9, 100, 200).unwrap(), 8e6, 0.5, 1),
        ),
        (
            "hills, rough",
            fractal(Tile::new(2, 9, 100, 200).unwrap(), 8e6, 0.6, 1),
        ),
    ] {
        let mut fastest = f64::INFINITY;
        let mut errors = Vec::new();
        for _ in 0..100 {
            let start = Instant::now();
            errors = pyramid(&heights);
            fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
        }
        println!(
            "{name}: {fastest:.2} ms; level, mean of bound / exact, sum of bounds / sum of exact"
        );
        let mut sums = [[0.0; 4]; 15];
        for triangle in &triangles {
            let exact = f64::from(triangle.largest(&heights, &triangle.samples()));
            let bound = f64::from(decode(triangle.code(&errors)));
            let [count, ratio, bounds, truths] = &mut sums[usize::from(triangle.level)];
            *bounds += bound;
            *truths += exact;
            if exact > 0.0 {
                *count += 1.0;
                *ratio += bound / exact;
            }
        }
        for (level, [count, ratio, bounds, truths]) in sums.iter().enumerate() {
            println!("{level:2} {:.3} {:.3}", ratio / count, bounds / truths);
        }
    }
}
