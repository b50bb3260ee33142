//! Emitted vertices against f64: places to a hundredth of a pixel, normals, counts.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]
#![allow(
    clippy::print_stdout,
    reason = "prints what it measured, for those who ask with --nocapture"
)]

mod common;

use common::{Random, mix};
use geodesy::{Ellipsoid, LatticePoint, Tile};
use glam::DVec3;
use terrain::{
    ANCHOR_WORDS, BLOCKS, BORDER_NODES, BORDER_WORDS, DEEPEST_MARK, LATTICE_NODES, MARK_WORDS,
    Marks, Vertex, anchors, border_index, border_positions, border_words, count, emit, height_unit,
    pair, prefix_sums, quantise, triangles,
};

/// Wall pixels per radian.
const PIXELS_PER_RADIAN: f64 = 1500.0;
/// What a vertex may be off on the screen.
const MOST_PX: f64 = 0.01;

/// A leaf that is emitted with every mark set.
struct Leaf {
    ellipsoid: Ellipsoid,
    tile: Tile,
    unit_m: f64,
    heights: Vec<i32>,
    references: Vec<i32>,
}

impl Leaf {
    /// Heights in metres by node; reference heights in metres by block.
    fn new(
        ellipsoid: Ellipsoid,
        tile: Tile,
        height_m: impl FnMut(usize) -> f64,
        reference_m: impl FnMut(usize) -> f64,
    ) -> Self {
        let heights_m: Vec<f64> = (0..LATTICE_NODES).map(height_m).collect();
        let (low, high) = heights_m
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), h| {
                (low.min(*h), high.max(*h))
            });
        let unit_m = height_unit((low, high));
        let units = |metres: f64| quantise(metres, unit_m);
        Self {
            ellipsoid,
            tile,
            unit_m,
            heights: heights_m.into_iter().map(units).collect(),
            references: (0..BLOCKS).map(reference_m).map(units).collect(),
        }
    }

    fn normal(&self, [x, y]: [u16; 2]) -> DVec3 {
        LatticePoint::of_tile(self.tile, i64::from(x), i64::from(y)).normal()
    }

    fn height_m(&self, [x, y]: [u16; 2]) -> f64 {
        f64::from(self.heights[usize::from(y) * 257 + usize::from(x)]) * self.unit_m
    }

    /// Where the vertex should be.
    fn exact(&self, place: [u16; 2]) -> DVec3 {
        self.ellipsoid
            .point(self.normal(place), self.height_m(place))
    }

    /// The inner vertices.
    fn vertices(&self) -> Vec<Vertex> {
        let words = anchors(&self.ellipsoid, self.tile, &self.references, self.unit_m);
        assert_eq!(words.len(), BLOCKS * ANCHOR_WORDS);
        let border = vec![0; BORDER_NODES * BORDER_WORDS];
        let (mut vertices, indices) = emit(&all(), &self.heights, &words, &border, self.unit_m);
        assert_eq!(vertices.len(), LATTICE_NODES);
        assert_eq!(indices.len(), 3 * 2 * 256 * 256);
        vertices.retain(|vertex| vertex.position != [0; 6]);
        assert_eq!(vertices.len(), LATTICE_NODES - BORDER_NODES);
        vertices
    }

    /// The width of the narrowest cell at the corners and in the middle.
    fn cell_m(&self) -> f64 {
        let places = [[0, 0], [255, 0], [0, 255], [255, 255], [127, 127]];
        places
            .into_iter()
            .flat_map(|[x, y]| [([x, y], [x + 1, y]), ([x, y], [x, y + 1])])
            .map(|(from, to)| {
                let at = |place| self.ellipsoid.point(self.normal(place), 0.0);
                at(from).distance(at(to))
            })
            .fold(f64::MAX, f64::min)
    }
}

fn all() -> Marks {
    let mut marks = Marks::new();
    for y in 0..=256 {
        for x in 0..=256 {
            marks.set(x, y);
        }
    }
    marks
}

/// A tile of a face and level at random; every third time one at a corner of the face.
fn some_tile(random: &mut Random, face: u8, level: u8) -> Tile {
    let last = (1_u64 << level) - 1;
    let mut along = |corner: bool| {
        let any = random.below(last + 1);
        (if corner { any & 1 } else { any }).min(last) as u32 * if corner { last as u32 } else { 1 }
    };
    let corner = (face + level).is_multiple_of(3);
    let (x, y) = (along(corner), along(corner));
    Tile::new(face, level, x.min(last as u32), y.min(last as u32)).unwrap()
}

#[test]
fn inner_vertices_are_where_the_ellipsoid_has_them() {
    let mut random = Random(41);
    let mut worst_px = [[0.0_f64; 2]; 21];
    let mut worst_steps = [0.0_f64; 21];
    for level in 0..=20 {
        for face in 0..6 {
            let tile = some_tile(&mut random, face, level);
            let ellipsoid =
                [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS][usize::from(level) % 3];
            for wild in [false, true] {
                let seed = random.next();
                let middle_m = random.between(-11_000.0, 9_000.0);
                let unit = |node: usize| (mix(seed ^ node as u64) >> 11) as f64 / 2_f64.powi(53);
                // Spikes from trench to summit in every block, or heights within 500 m of their reference.
                let leaf = Leaf::new(
                    ellipsoid,
                    tile,
                    |node| match wild {
                        true => -11_000.0 + 20_000.0 * unit(node),
                        false => middle_m + 1_000.0 * (unit(node) - 0.5),
                    },
                    |_| if wild { -1_000.0 } else { middle_m },
                );
                let cell_m = leaf.cell_m();
                for vertex in leaf.vertices() {
                    let error_m = vertex
                        .point()
                        .to_ecef()
                        .distance(leaf.exact(vertex.lattice));
                    // A cell is a pixel wide.
                    let worst = &mut worst_px[usize::from(level)][usize::from(wild)];
                    *worst = worst.max(error_m / cell_m);
                    let steps = &mut worst_steps[usize::from(level)];
                    *steps = steps.max(error_m * 1_048_576.0);
                }
            }
        }
    }
    for (level, ([calm, wild], steps)) in worst_px.iter().zip(worst_steps).enumerate() {
        println!("level {level}: {calm:.1e} px, wild {wild:.1e} px, {steps:.1} steps");
    }
    for (level, [calm, wild]) in worst_px.into_iter().enumerate() {
        assert!(
            calm <= MOST_PX && wild <= MOST_PX,
            "level {level}: {calm} {wild}"
        );
    }
    // In small tiles only the rounding of three parts and of the place itself is left.
    for (level, steps) in worst_steps.into_iter().enumerate().skip(15) {
        assert!(steps <= 4.0, "level {level}: {steps} steps");
    }
}

#[test]
fn close_vertices_are_within_a_hundredth_of_a_pixel() {
    let mut random = Random(42);
    let ellipsoid = Ellipsoid::EARTH;
    for level in 8..=17 {
        let mut worst_px = [0.0_f64; 3];
        let mut seen = 0;
        for face in 0..6 {
            let tile = some_tile(&mut random, face, level);
            let middle_m = random.between(-11_000.0, 9_000.0);
            let (phase, slope) = (random.between(0.0, 6.0), random.between(0.0, 1.0));
            for (kind, worst) in worst_px.iter_mut().enumerate() {
                let seed = random.next();
                let mut own = Random(seed);
                let cell_m = 78_000.0 / f64::from(1_u32 << level) * 0.7;
                let leaf = Leaf::new(
                    ellipsoid,
                    tile,
                    |node| {
                        let (x, y) = ((node % 257) as f64, (node / 257) as f64);
                        let rolling = 20.0 * (0.05 * x + phase).sin() * (0.07 * y).cos();
                        let spike = kind == 2 && mix(seed ^ node as u64).is_multiple_of(50);
                        let ground_m = middle_m + slope * cell_m * rolling;
                        if spike { 9_000.0 } else { ground_m }
                    },
                    |_| match kind {
                        0 => middle_m,
                        1 => middle_m + own.between(-500.0, 500.0),
                        // As far as a block of trench and summit puts it.
                        _ => f64::midpoint(-11_000.0, 9_000.0),
                    },
                );
                let vertices = leaf.vertices();
                let cell_m = leaf.cell_m();
                assert!((0.2..200.0).contains(&cell_m), "{cell_m}");
                for _ in 0..6 {
                    // Over ground that is flat between the nodes, or straight over a node.
                    let place = [random.below(256), random.below(256)].map(|c| c as u16);
                    let [x, y] = place;
                    let corners = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]];
                    let lowest = corners
                        .map(|c| leaf.height_m(c))
                        .into_iter()
                        .fold(f64::MAX, f64::min);
                    let eye = match random.below(2) {
                        0 => ellipsoid.point(leaf.normal(place), leaf.height_m(place) + 2.0),
                        _ => {
                            let normal = corners.map(|c| leaf.normal(c)).iter().sum::<DVec3>();
                            ellipsoid.point(normal.normalize(), lowest + 2.0)
                        }
                    };
                    for vertex in &vertices {
                        let exact = leaf.exact(vertex.lattice);
                        let distance_m = exact.distance(eye);
                        if distance_m < 0.5 * cell_m {
                            continue;
                        }
                        let error_m = vertex.point().to_ecef().distance(exact);
                        *worst = worst.max(error_m / distance_m * PIXELS_PER_RADIAN);
                        seen += 1;
                    }
                }
            }
        }
        let [own, near, far] = worst_px;
        println!("level {level}: {own:.1e} px, 500 m from reference {near:.1e}, spikes {far:.1e}");
        assert!(
            worst_px.iter().all(|px| *px <= MOST_PX),
            "{level}: {worst_px:?}"
        );
        assert!(seen > 1_000_000);
    }
}

#[test]
fn heights_of_any_unit_are_raised() {
    let mut random = Random(46);
    let mut units = Vec::new();
    for highest_m in [1.0, 1e5, 1e6, 1e7, 1e8, 2e11] {
        let tile = some_tile(&mut random, 1, 12);
        let mut height_m = |_: usize| random.between(-highest_m, highest_m);
        let references: Vec<f64> = (0..BLOCKS).map(&mut height_m).collect();
        let leaf = Leaf::new(Ellipsoid::MARS, tile, height_m, |block| references[block]);
        units.push(leaf.unit_m);
        for vertex in leaf.vertices() {
            let error_m = vertex
                .point()
                .to_ecef()
                .distance(leaf.exact(vertex.lattice));
            // Normals at this level are within 10^-9 before they are rounded.
            assert!(
                error_m <= 6e-6 + 1e-9 * highest_m,
                "{error_m} m of {highest_m}"
            );
        }
    }
    // Below, at and above what products are steps of.
    assert_eq!(units.first(), Some(&(1.0 / 8192.0)));
    assert!(units.contains(&1.0) && units.last() > Some(&1024.0));
}

#[test]
fn normals_are_those_of_the_ellipsoid() {
    let mut random = Random(43);
    for level in 0..=20 {
        let (mut worst, mut turned) = (0.0_f64, 0.0_f64);
        for face in 0..6 {
            let tile = some_tile(&mut random, face, level);
            let leaf = Leaf::new(Ellipsoid::EARTH, tile, |_| 100.0, |_| 0.0);
            for vertex in leaf.vertices() {
                let [x, y, z, none] = vertex.normal;
                let stored = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) / 32_767.0;
                worst = worst.max(stored.distance(leaf.normal(vertex.lattice)));
                turned = turned.max(stored.normalize().distance(leaf.normal(vertex.lattice)));
                assert_eq!(none, 0);
            }
        }
        println!("level {level}: normals within {worst:.1e}, directions {turned:.1e}");
        let most = if level < 3 { 2e-3 } else { 1e-4 };
        assert!(worst <= most, "level {level}: {worst}");
    }
}

/// Random marks with all that they ask for inside a leaf.
fn conforming(random: &mut Random, marks: usize) -> Marks {
    let mut grown = Marks::new();
    let mut list = Vec::new();
    for _ in 0..marks {
        list.push([0, 0].map(|_: u16| random.below(257) as u16));
        while let Some([x, y]) = list.pop() {
            if grown.set(x, y)
                && let Some(pair) = pair(8, x, y)
            {
                list.extend(pair.apexes.into_iter().flatten());
            }
        }
    }
    grown
}

#[test]
fn counts_are_what_is_emitted() {
    let mut random = Random(44);
    let mut meshes: Vec<Marks> = [0, 1, 2, 10, 100, 1_000, 10_000]
        .into_iter()
        .cycle()
        .take(70)
        .map(|marks| conforming(&mut random, marks))
        .collect();
    meshes.push(all());
    let mut deepest = 0;
    for marks in meshes {
        let (vertices, indices) = emit(&marks, &[], &[], &[], 1.0);
        let counted = count(&marks);
        assert_eq!(counted.vertices as usize, vertices.len());
        assert_eq!(counted.triangles as usize, indices.len() / 3);
        assert_eq!(vertices.len(), marks.count());
        // Marks of words before, and the triangles at them: the apex is the last corner.
        let sums = prefix_sums(&marks);
        assert_eq!([sums.vertices.len(), sums.triangles.len()], [MARK_WORDS; 2]);
        let word = |[x, y]: [u16; 2]| usize::from(y) * 9 + usize::from(x) / 32;
        let mut before = vec![[0; 2]; MARK_WORDS];
        let listed = triangles(&marks);
        for [_, _, apex] in &listed {
            before[word(*apex)][1] += 1;
        }
        for place in (0..=256).flat_map(|y| (0..=256).map(move |x| [x, y])) {
            if marks.is_set(place[0], place[1]) {
                before[word(place)][0] += 1;
            }
        }
        let mut running = [0; 2];
        for (number, own) in before.into_iter().enumerate() {
            assert_eq!([sums.vertices[number], sums.triangles[number]], running);
            running = [running[0] + own[0], running[1] + own[1]];
        }
        // Triangles cover the leaf once, and indices name their corners.
        let mut twice_area = 0;
        for (corners, triple) in listed.iter().zip(indices.chunks(3)) {
            for ([x, y], index) in corners.iter().zip(triple) {
                assert_eq!(sums.vertex(&marks, *x, *y), Some(*index));
            }
            let [a, b, c] = corners.map(|corner| corner.map(i64::from));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            assert!(area > 0);
            deepest += usize::from(area == 1);
            twice_area += area;
        }
        assert_eq!(twice_area, 2 * 256 * 256);
        let unset = (0..=256)
            .map(|c| [c, 256 - c])
            .find(|[x, y]| !marks.is_set(*x, *y));
        if let Some([x, y]) = unset {
            assert_eq!(sums.vertex(&marks, x, y), None);
        }
    }
    assert!(deepest > 2 * 256 * 256);
    assert_eq!(pair(8, 1, 0).unwrap().level, DEEPEST_MARK);
}

#[test]
fn border_nodes_are_in_their_order() {
    let positions = border_positions();
    assert_eq!(positions.len(), BORDER_NODES);
    let mut seen = 0;
    for y in 0..=300 {
        for x in 0..=300 {
            let on_border =
                x <= 256 && y <= 256 && ([0, 256].contains(&x) || [0, 256].contains(&y));
            let index = border_index(x, y);
            assert_eq!(index.is_some(), on_border, "{x}, {y}");
            if let Some(index) = index {
                assert_eq!(positions[index], [x, y]);
                seen += 1;
            }
        }
    }
    assert_eq!(seen, BORDER_NODES);
}

#[test]
fn heights_are_rounded_to_units() {
    for (height_m, unit_m, units) in [
        (0.0, 1.0, 0),
        (2.5, 1.0, 2),
        (3.5, 1.0, 4),
        (-2.5, 1.0, -2),
        (1.25, 0.125, 10),
        (8848.0, 1.0 / 8192.0, 72_482_816),
        (1e300, 1.0, 1 << 27),
        (-1e300, 1.0, -(1 << 27)),
        (f64::INFINITY, 1.0, 1 << 27),
    ] {
        assert_eq!(quantise(height_m, unit_m), units, "{height_m} in {unit_m}");
    }
    // Beside a coarser leaf odd nodes lie between their neighbours.
    let mut random = Random(45);
    let vertex = Vertex {
        position: [1, 2, 3, 4, 5, 6],
        normal: [-7, 8, -9, 0],
        lattice: [10, 11],
    };
    let heights_m: Vec<f64> = (0..BORDER_NODES)
        .map(|_| random.between(-9e3, 9e3))
        .collect();
    for coarser in 0..16_u8 {
        let words = border_words(&vec![vertex; BORDER_NODES], &heights_m, 0.25, coarser);
        assert_eq!(words.len(), BORDER_NODES * BORDER_WORDS);
        let height = |x: u16, y: u16| words[border_index(x, y).unwrap() * BORDER_WORDS + 9] as i32;
        for (node, [x, y]) in border_positions().iter().enumerate() {
            let bytes: Vec<u8> = words[node * BORDER_WORDS..][..9]
                .iter()
                .flat_map(|word| word.to_le_bytes())
                .collect();
            assert_eq!(bytes, vertex.to_bytes());
            let beside = [*x == 0, *x == 256, *y == 0, *y == 256];
            let edge = beside.iter().position(|beside| *beside).unwrap();
            let straight = (x | y) & 1 == 1 && coarser >> edge & 1 == 1;
            let expected = match (straight, edge < 2) {
                (false, _) => (heights_m[node] * 4.0).round_ties_even() as i32,
                (true, true) => (height(*x, y - 1) + height(*x, y + 1)).div_euclid(2),
                (true, false) => (height(x - 1, *y) + height(x + 1, *y)).div_euclid(2),
            };
            assert_eq!(height(*x, *y), expected);
        }
    }
}
