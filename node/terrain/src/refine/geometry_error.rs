//! How far flat triangles depart from the curved surface of one tile, whatever its heights.
//! In: an ellipsoid, a tile. Out: where its blocks and coarse triangles are, how wide, and how far chords pass
//! from the surface. Made once for a tile and kept by whoever keeps the tile. It knows no heights and no view.

use geodesy::{Ellipsoid, LATTICE_BITS, Tile};
use glam::{DVec3, Vec3};

use super::BLOCKS;
use super::marks::{Pair, pair};
use super::normals::Normals;

/// From this level on a tile is so small a part of its face that one set of second derivatives does for all of it.
const EVEN_LEVEL: u8 = 6;
/// The largest third derivative of the unit normal as a function of cell space (s, t) in 0…1 along any direction,
/// away from the lines s = ½ and t = ½ where the second one jumps. Measured: 19.9.
const THIRD_DERIVATIVE: f64 = 21.0;
/// The largest second derivative of the same. Measured: 3.34.
const SECOND_DERIVATIVE: f64 = 3.5;
/// A quadratic through corners and edge midpoints of a right isosceles triangle whose circumscribed circle has
/// radius 1 misses a function with third derivatives up to 1 by at most this: the largest Σ|φₖ||vₖ − x|³/6
/// over the triangle, φₖ being the quadratic's six basis functions.
const CUBIC_REMAINDER: f64 = 0.131;

/// How far the surface point of a node may be from the drawn triangle's point at the same lattice place, for heights
/// that are all the same. Over a triangle a quadratic surface departs from the plane through the corners by
/// 4 Σ bowᵢⱼ λᵢ λⱼ, where bowᵢⱼ is how far the middle of edge ij is from the mean of its ends.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Chord {
    /// Bows of the legs at height 0, ECEF metres. A block's are its sides.
    pub(crate) legs: [Vec3; 2],
    /// The bow of the hypotenuse. For a block: of the diagonal that is one, and of the other.
    pub(crate) diagonals: [Vec3; 2],
    /// What all of these make at most, whatever their directions, in metres.
    pub(crate) norm_m: f32,
    /// What is not quadratic or not the same at parallel edges, in metres, and what each metre of height above
    /// or below 0 adds to all of it.
    pub(crate) rest: [f32; 2],
    /// The same for a block's triangles of levels 9 … 14.
    pub(crate) fine_rest: [f32; 2],
}

/// A block, or the two triangles of a coarse mark.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    /// The surface point at height 0 in the middle, in ECEF metres.
    pub(crate) base: DVec3,
    /// The unit normal there.
    pub(crate) normal: DVec3,
    /// No surface point of the place is farther than this from the axis through `base` along `normal`, in
    /// metres …
    pub(crate) radius_m: f64,
    /// … and this for each metre of height. It is also the largest sine between `normal` and another normal of
    /// the place.
    pub(crate) turn: f64,
    /// No surface point is farther than this below the plane through `base`, in metres.
    pub(crate) sag_m: f64,
    /// For the largest triangles of the place.
    pub(crate) chord: Chord,
}

/// What [`allowances`](super::allowances) needs to know of a tile beside its heights. About 55 kB.
#[derive(Clone, Debug)]
pub struct TileGeometryError {
    tile: Tile,
    pub(crate) blocks: Vec<Place>,
    /// By (y / 16) · 17 + x / 16; corners and centre of the tile are there, but empty.
    pub(crate) coarse: Vec<Place>,
}

impl TileGeometryError {
    /// Bounds for `tile` of `ellipsoid`. Takes some tens of microseconds; keep it with the tile.
    #[must_use]
    pub fn new(ellipsoid: &Ellipsoid, tile: Tile) -> Self {
        let surface = Surface::new(ellipsoid, tile);
        let mut blocks = Vec::with_capacity(BLOCKS);
        for y in 0..16_u16 {
            for x in 0..16_u16 {
                let chord = surface.block(x, y);
                let (x0, y0) = (16 * x, 16 * y);
                let corners = [[0, 0], [16, 0], [0, 16], [16, 16]];
                let corners = corners.map(|[x, y]| surface.node([x0 + x, y0 + y]));
                blocks.push(place(surface.node([x0 + 8, y0 + 8]), &corners, chord));
            }
        }
        let mut coarse = vec![Place::default(); 17 * 17];
        for y in 0..17_u16 {
            for x in 0..17_u16 {
                let mark = [16 * x, 16 * y];
                let Some(pair) = pair(LATTICE_BITS, mark[0], mark[1]) else {
                    continue;
                };
                let corners = pair
                    .ends
                    .into_iter()
                    .chain(pair.apexes.into_iter().flatten());
                let mut nodes = [surface.node(mark); 4];
                for (node, corner) in nodes.iter_mut().zip(corners) {
                    *node = surface.node(corner);
                }
                let chord = surface.coarse(&pair);
                if let Some(slot) = coarse.get_mut(usize::from(y * 17 + x)) {
                    *slot = place(surface.node(mark), &nodes, chord);
                }
            }
        }
        Self {
            tile,
            blocks,
            coarse,
        }
    }

    /// The tile.
    #[must_use]
    pub const fn tile(&self) -> Tile {
        self.tile
    }
}

/// A node of the lattice: its surface point at height 0, and its normal.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    base: DVec3,
    normal: DVec3,
}

/// The bounds of a place in the middle of the polygon of `corners`: all of it lies in triangles of the middle and two
/// corners each, so it leaves the corners' hull by no more than a chord.
fn place(middle: Node, corners: &[Node], chord: Chord) -> Place {
    let (mut radius_m, mut turn, mut sag_m) = (0.0_f64, 0.0_f64, 0.0_f64);
    for corner in corners {
        let step = corner.base - middle.base;
        let upwards = step.dot(middle.normal);
        radius_m = radius_m.max((step - middle.normal * upwards).length());
        sag_m = sag_m.max(-upwards);
        turn =
            turn.max((corner.normal - middle.normal * corner.normal.dot(middle.normal)).length());
    }
    let turn = (turn + f64::from(chord.rest[1])).min(1.0);
    let aside = f64::from(chord.norm_m) + f64::from(chord.rest[0]);
    Place {
        base: middle.base,
        normal: middle.normal,
        radius_m: (radius_m + aside) * (1.0 + 1e-9),
        turn,
        sag_m: sag_m + aside,
        chord,
    }
}

/// How far a middle is from the mean of two ends: the surface point in metres, and the unit normal.
#[derive(Clone, Copy, Debug, Default)]
struct Bow {
    base: DVec3,
    normal: DVec3,
}

impl Bow {
    fn new(from: &Node, to: &Node, middle: &Node) -> Self {
        Self {
            base: middle.base - from.base.midpoint(to.base),
            normal: middle.normal - from.normal.midpoint(to.normal),
        }
    }

    fn scaled(self, factor: f64) -> Self {
        Self {
            base: self.base * factor,
            normal: self.normal * factor,
        }
    }

    /// The mean of two parallel edges' bows, and how far each is from it.
    fn mean(self, other: Self) -> (Self, [f64; 2]) {
        let mean = Self {
            base: self.base.midpoint(other.base),
            normal: self.normal.midpoint(other.normal),
        };
        let apart = [
            self.base.distance(mean.base),
            self.normal.distance(mean.normal),
        ];
        (mean, apart)
    }
}

/// The chord of these bows and of what they leave out. The numbers are a little larger than the true ones, for
/// the rounding of f64 positions and of f32.
fn chord(legs: [Bow; 2], diagonals: [Bow; 2], rest: [f64; 2], fine_rest: [f64; 2]) -> Chord {
    let vector = |bow: Bow| (bow.base * (1.0 + 1e-6)).as_vec3();
    let turn = legs
        .iter()
        .chain(&diagonals)
        .map(|bow| bow.normal.length())
        .fold(0.0, f64::max);
    // Normals have no directions here, so their largest bow stands for all three, of which 4/3 is the most.
    let with_turn = |[base, normal]: [f64; 2], turn: f64| {
        [base + 4e-9, normal + 4.0 / 3.0 * turn].map(|part| (part * (1.0 + 1e-6)) as f32)
    };
    let [first, second] = legs.map(|bow| bow.base.length());
    let [hypotenuse, other] = diagonals.map(|bow| bow.base.length());
    // Halves of diagonals may be legs at the next level, and sides hypotenuses.
    let side = first.max(second);
    let norm_m = largest(side, side, hypotenuse.max(other)).max(largest(
        0.25 * hypotenuse,
        0.25 * other,
        side,
    ));
    Chord {
        norm_m: (norm_m * (1.0 + 1e-6)) as f32,
        legs: legs.map(vector),
        diagonals: diagonals.map(vector),
        rest: with_turn(rest, turn),
        fine_rest: with_turn(fine_rest, 0.25 * turn),
    }
}

/// The largest of 4 (p λ₁λ₂ + q λ₂λ₃ + r λ₃λ₁) over λ ≥ 0 with sum 1, for p, q, r ≥ 0: at an edge's midpoint, or at the
/// stationary point where that is inside.
pub(crate) fn largest(p: f64, q: f64, r: f64) -> f64 {
    let edge = p.max(q).max(r);
    if p + q > r && q + r > p && r + p > q {
        let below = 2.0 * (p * q + q * r + r * p) - p * p - q * q - r * r;
        if below > 0.0 {
            return edge.max(4.0 * p * q * r / below);
        }
    }
    edge
}

/// A tile's surface at height 0.
struct Surface {
    ellipsoid: Ellipsoid,
    normals: Normals,
    /// Every 16th node, then the middles of blocks.
    nodes: Vec<Node>,
    middles: Vec<Node>,
    /// Third derivatives of the surface point and the normal, per cell³.
    third: [f64; 2],
    second: [f64; 2],
    is_root: bool,
    /// For small tiles: bows across the tile along its sides, and along its two diagonals.
    even: Option<Even>,
}

/// Bows through the middle of a tile at its whole length, and how far those of any parallel line are from them.
struct Even {
    sides: [Bow; 2],
    diagonals: [Bow; 2],
    rest: [f64; 2],
}

impl Surface {
    fn new(ellipsoid: &Ellipsoid, tile: Tile) -> Self {
        let normals = Normals::new(tile);
        let node = |x, y| {
            let normal = normals.at(x, y);
            Node {
                base: ellipsoid.point(normal, 0.0),
                normal,
            }
        };
        let grid = |count: u16, start: u16| {
            (0..count)
                .flat_map(|y| (0..count).map(move |x| (16 * x + start, 16 * y + start)))
                .map(|(x, y)| node(x, y))
                .collect::<Vec<_>>()
        };
        let (nodes, middles) = (grid(17, 0), grid(16, 8));
        // The further from a sphere, the stronger the third derivatives: measured, 4.5 times for axes of 1 : 2.
        let (large, small) = (ellipsoid.largest_radius_m(), ellipsoid.smallest_radius_m());
        let size_m = large * (1.0 + 4.0 * (large / small - 1.0));
        let cell = 1.0 / f64::from(256_u32 << tile.level());
        let per_cell = |derivative: f64, power: i32| {
            let unit = (0..power).fold(derivative, |unit, _| unit * cell);
            [unit * size_m, unit]
        };
        let mut surface = Self {
            ellipsoid: *ellipsoid,
            normals,
            nodes,
            middles,
            third: per_cell(THIRD_DERIVATIVE, 3),
            second: per_cell(SECOND_DERIVATIVE, 2),
            is_root: tile.level() == 0,
            even: None,
        };
        if tile.level() >= EVEN_LEVEL {
            surface.even = Some(surface.across());
        }
        surface
    }

    fn node(&self, [x, y]: [u16; 2]) -> Node {
        let (list, width, x0, y0) = match (x % 16, y % 16) {
            (0, 0) => (&self.nodes, 17, x, y),
            (8, 8) => (&self.middles, 16, x - 8, y - 8),
            _ => return self.compute(x, y),
        };
        let index = usize::from(y0 / 16 * width + x0 / 16);
        list.get(index)
            .copied()
            .unwrap_or_else(|| self.compute(x, y))
    }

    fn compute(&self, x: u16, y: u16) -> Node {
        let normal = self.normals.at(x, y);
        Node {
            base: self.ellipsoid.point(normal, 0.0),
            normal,
        }
    }

    fn bow(&self, from: [u16; 2], to: [u16; 2]) -> Bow {
        let middle = [u16::midpoint(from[0], to[0]), u16::midpoint(from[1], to[1])];
        Bow::new(&self.node(from), &self.node(to), &self.node(middle))
    }

    fn across(&self) -> Even {
        // Second derivatives anywhere in the tile differ from those on a line through its middle by no more than
        // the third ones over half the tile's diagonal. Diagonals are √2 as long.
        let aside = 2.0 * 256.0 * 256.0 / 8.0 * (182.0 + 64.0);
        Even {
            sides: [
                self.bow([0, 128], [256, 128]),
                self.bow([128, 0], [128, 256]),
            ],
            diagonals: [self.bow([0, 0], [256, 256]), self.bow([0, 256], [256, 0])],
            rest: self.third.map(|third| aside * third),
        }
    }

    /// The remainder of a quadratic over a triangle whose hypotenuse is `length` cells.
    fn remainder(&self, length: f64) -> [f64; 2] {
        let radius = 0.5 * length;
        self.third
            .map(|third| CUBIC_REMAINDER * third * radius * radius * radius)
    }

    /// The chord of both triangles of a coarse mark.
    fn coarse(&self, pair: &Pair) -> Chord {
        let [from, to] = pair.ends;
        let size = f64::from(pair.size);
        let even_level = pair.level.is_multiple_of(2);
        let none = Bow::default();
        if let Some(even) = &self.even {
            let share = size / 256.0 * (size / 256.0);
            let rest = even.rest.map(|rest| rest * share);
            let [horizontal, vertical] = even.sides.map(|bow| bow.scaled(share));
            let [rising, falling] = even.diagonals.map(|bow| bow.scaled(share));
            return if even_level {
                let hypotenuse = if from[1] == to[1] {
                    horizontal
                } else {
                    vertical
                };
                let legs = [rising.scaled(0.25), falling.scaled(0.25)];
                chord(legs, [hypotenuse, none], rest, rest)
            } else {
                let hypotenuse = if from[1] < to[1] { rising } else { falling };
                chord([horizontal, vertical], [hypotenuse, none], rest, rest)
            };
        }
        let length = if even_level {
            size
        } else {
            size * std::f64::consts::SQRT_2
        };
        if self.is_root && pair.level == 0 {
            // A root's largest triangles lie across the jump of the second derivative. Taylor's theorem asks only
            // that it is bounded.
            let rest = self
                .second
                .map(|second| 0.5 * second * (0.25 * length * length));
            return chord([none; 2], [none; 2], rest, rest);
        }
        // Opposite sides of the square of both triangles are parallel.
        let [first, second] = pair.apexes;
        let sides =
            |apex: Option<[u16; 2]>| apex.map(|apex| [self.bow(from, apex), self.bow(apex, to)]);
        let (legs, apart) = match (sides(first), sides(second)) {
            (Some([a, b]), Some([c, d])) => {
                let ((a, apart_a), (b, apart_b)) = (a.mean(d), b.mean(c));
                let apart = [0, 1].map(|part| 4.0 / 3.0 * f64::max(apart_a[part], apart_b[part]));
                ([a, b], apart)
            }
            (Some(legs), None) | (None, Some(legs)) => (legs, [0.0; 2]),
            (None, None) => ([none; 2], [0.0; 2]),
        };
        let rest = add(self.remainder(length), apart);
        chord(legs, [self.bow(from, to), none], rest, rest)
    }

    /// The chord of a block's triangles.
    fn block(&self, x: u16, y: u16) -> Chord {
        let rises = x % 2 == y % 2;
        let order = |[rising, falling]: [Bow; 2]| {
            if rises {
                [rising, falling]
            } else {
                [falling, rising]
            }
        };
        if let Some(even) = &self.even {
            let rest = even.rest.map(|rest| rest / 256.0);
            return chord(
                even.sides.map(|bow| bow.scaled(1.0 / 256.0)),
                order(even.diagonals.map(|bow| bow.scaled(1.0 / 256.0))),
                rest,
                rest.map(|rest| 0.25 * rest),
            );
        }
        let (x0, y0) = (16 * x, 16 * y);
        let (x1, y1) = (x0 + 16, y0 + 16);
        let (horizontal, apart_u) = self
            .bow([x0, y0], [x1, y0])
            .mean(self.bow([x0, y1], [x1, y1]));
        let (vertical, apart_v) = self
            .bow([x0, y0], [x0, y1])
            .mean(self.bow([x1, y0], [x1, y1]));
        let diagonals = [self.bow([x0, y0], [x1, y1]), self.bow([x0, y1], [x1, y0])];
        let apart = [0, 1].map(|part| 4.0 / 3.0 * f64::max(apart_u[part], apart_v[part]));
        let length = 16.0 * std::f64::consts::SQRT_2;
        // Shorter edges lie up to 17 cells from the measured ones. Those of level 9 are half as long as those of
        // level 7, and weigh a quarter.
        let vary = self.third.map(|third| 128.0 / 8.0 * third * 17.0);
        chord(
            [horizontal, vertical],
            order(diagonals),
            add(
                self.remainder(length),
                [0, 1].map(|part| apart[part].max(4.0 / 3.0 * vary[part])),
            ),
            add(
                self.remainder(0.5 * length),
                vary.map(|vary| 4.0 / 3.0 * vary),
            ),
        )
    }
}

fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}
