//! How screens meet in the room: gaps, crossings, densities that differ between neighbours, edges that overlap.
//!
//! In: a wall and its surfaces. Out: sentences, and the edges on which another screen goes on. Of outputs it knows only
//! whether anybody sees a canvas.

use glam::DVec3;
use protocol::Wall;

use crate::plan::face::{Edge, Face};

use super::calibrated::hides_canvas;

/// Edges so near are meant to meet, in metres.
const NEAR_M: f64 = 0.2;
/// Edges so near do meet, in metres.
const MEET_M: f64 = 0.005;
/// How far surfaces on which pictures blend are apart at most, in metres: projectors are not measured better.
const SHARED_M: f64 = 0.02;
/// Samples along an edge, and over a surface in search of crossings.
const EDGE_STEPS: u32 = 32;
const GRID_STEPS: u32 = 16;
/// The share of an edge that must lie on another screen where pictures blend.
const SHARED_SHARE: f64 = 0.9;
/// Below this cosine of the angle between normals surfaces go through each other, and not along each other.
const ALONG_COSINE: f64 = 0.9;
/// How much pixel densities of neighbours may differ.
pub(super) const RATIO: f64 = 2.0;

/// An edge on which another screen shows a picture, too.
pub(super) struct SharedEdge {
    /// Indices into [`Wall::screens`].
    pub(super) screen: usize,
    pub(super) other: usize,
    pub(super) edge: Edge,
}

/// A place of an edge, and the nearest one of the other screen.
struct Near {
    point_m: DVec3,
    here: [f64; 2],
    there: [f64; 2],
    distance_m: f64,
}

/// An edge of a screen along another one.
struct Along {
    edge: Edge,
    /// How many places the edge has.
    places: usize,
    near: Vec<Near>,
}

/// How an edge that does not meet looks from the head.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Look {
    /// There is nothing behind it.
    Open,
    /// The other screen hides it.
    Hidden,
    /// The other screen goes on behind it.
    Before,
}

/// One of two screens.
#[derive(Clone, Copy)]
struct Side<'a> {
    index: usize,
    name: &'a str,
    observer: usize,
    size_px: [u32; 2],
    head_m: DVec3,
    face: &'a Face<'a>,
}

pub(super) fn warn(
    wall: &Wall,
    faces: &[Option<Face<'_>>],
    warnings: &mut Vec<String>,
) -> Vec<SharedEdge> {
    let sides: Vec<Side<'_>> = wall
        .screens
        .iter()
        .zip(faces)
        .enumerate()
        .filter_map(|(index, (screen, face))| {
            Some(Side {
                index,
                name: &screen.name,
                observer: screen.observer,
                size_px: screen.size_px,
                head_m: DVec3::from(wall.observers.get(screen.observer)?.head_m),
                face: face.as_ref()?,
            })
        })
        .collect();
    let mut shared = Vec::new();
    for (index, a) in sides.iter().enumerate() {
        let others = sides.iter().skip(index + 1);
        for b in others.filter(|b| a.face.is_near(b.face, NEAR_M)) {
            let along = [(a, b, edges(a, b)), (b, a, edges(b, a))];
            gap(&along, warnings);
            crossing(a, b, warnings);
            // Channels that calibrations put in place are compared by what they light.
            if ![a, b].iter().any(|side| hides_canvas(wall, side.index)) {
                density(a, b, &along, warnings);
            }
            for (a, b, edges) in &along {
                shared.extend(
                    edges
                        .iter()
                        .filter(|along| is_shared(a, b, along))
                        .map(|along| SharedEdge {
                            screen: a.index,
                            other: b.index,
                            edge: along.edge,
                        }),
                );
            }
        }
    }
    shared
}

/// All edges of a screen that come near another one.
fn edges(a: &Side<'_>, b: &Side<'_>) -> Vec<Along> {
    let edges = a.face.edges().into_iter();
    edges
        .map(|edge| {
            let places = a.face.along(&edge, EDGE_STEPS);
            let near = places.iter().filter_map(|place| {
                let there = b.face.nearest(place.point_m, NEAR_M)?;
                Some(Near {
                    point_m: place.point_m,
                    here: place.parameters,
                    there: there.parameters,
                    distance_m: there.point_m.distance(place.point_m),
                })
            });
            Along {
                edge,
                places: places.len(),
                near: near.collect(),
            }
        })
        .filter(|along| !along.near.is_empty())
        .collect()
}

impl Along {
    /// Whether all of it is near.
    fn is_near(&self) -> bool {
        self.near.len() == self.places
    }

    /// The places that do not touch the other screen.
    fn apart(&self) -> impl Iterator<Item = &Near> {
        self.near.iter().filter(|near| near.distance_m > MEET_M)
    }

    fn meets(&self) -> bool {
        self.is_near() && 2 * self.apart().count() <= self.places
    }

    fn mean_m(&self) -> f64 {
        let sum: f64 = self.near.iter().map(|near| near.distance_m).sum();
        sum / self.near.len().max(1) as f64
    }

    /// An end that does not touch the other screen.
    fn has_loose_end(&self) -> bool {
        let ends = [self.near.first(), self.near.last()];
        ends.into_iter()
            .flatten()
            .any(|near| near.distance_m > MEET_M)
    }

    /// What most of the places that are apart look like.
    fn look(&self, a: &Side<'_>, b: &Side<'_>) -> Look {
        let mut counts = [(Look::Open, 0), (Look::Hidden, 0), (Look::Before, 0)];
        for near in self.apart() {
            let along = near.point_m - a.head_m;
            let hit = b.face.shape.locate(a.head_m, along);
            let hit_m = hit.and_then(|[x, y]| b.face.shape.point_m(x, y));
            let look = match hit_m.map(|point_m| point_m.distance(a.head_m)) {
                None => Look::Open,
                Some(distance_m) if distance_m < along.length() => Look::Hidden,
                Some(_) => Look::Before,
            };
            for (counted, count) in &mut counts {
                *count += usize::from(*counted == look);
            }
        }
        counts
            .into_iter()
            .max_by_key(|(_, count)| *count)
            .map_or(Look::Open, |(look, _)| look)
    }

    /// How far apart it is, in words.
    fn range(&self) -> String {
        let (low, high) = self.near.iter().fold((f64::INFINITY, 0.0), |range, near| {
            (near.distance_m.min(range.0), near.distance_m.max(range.1))
        });
        let [low, high] = [low, high].map(|metres: f64| 100.0 * metres);
        if high - low < 0.1 {
            format!("{high:.1} cm")
        } else {
            format!("{low:.1}…{high:.1} cm")
        }
    }
}

/// Screens that nearly meet: with a gap that the head sees, or with an edge behind the other screen.
fn gap(along: &[(&Side<'_>, &Side<'_>, Vec<Along>); 2], warnings: &mut Vec<String>) {
    let all = || {
        along
            .iter()
            .flat_map(|(a, b, edges)| edges.iter().map(move |edge| (*a, *b, edge)))
    };
    let loose: Vec<_> = all()
        .filter(|(_, _, edge)| edge.is_near() && !edge.meets())
        .map(|(a, b, edge)| (a, b, edge, edge.look(a, b)))
        .collect();
    let nearest = |look: Look| {
        let of_look = loose.iter().filter(move |(.., found)| *found == look);
        of_look.min_by(|x, y| x.2.mean_m().total_cmp(&y.2.mean_m()))
    };
    // An edge between two ends that meet follows the shape of its screen: a picture that is aligned on a chord
    // bulges beyond the floor.
    if let Some((a, b, edge, _)) = nearest(Look::Hidden)
        && edge.has_loose_end()
    {
        warnings.push(format!(
            "screens \"{}\" and \"{}\" go through each other: the {} edge of \"{}\" is {} behind \"{}\"; measure where both stand again",
            a.name,
            b.name,
            edge.edge.name,
            a.name,
            edge.range(),
            b.name
        ));
    } else if let Some((a, b, edge, _)) = nearest(Look::Open)
        && !all().any(|(_, _, edge)| edge.meets())
    {
        warnings.push(format!(
            "screens \"{}\" and \"{}\" nearly meet but do not: the {} edge of \"{}\" is {} from \"{}\"; measure where both stand again, or leave it where a frame is between them",
            a.name,
            b.name,
            edge.edge.name,
            a.name,
            edge.range(),
            b.name
        ));
    }
}

/// Screens that go through each other, away from the edges of both.
fn crossing(a: &Side<'_>, b: &Side<'_>, warnings: &mut Vec<String>) {
    let share = |step: u32| f64::from(step) / f64::from(GRID_STEPS);
    let place = |column: u32, row: u32| a.face.point_m([share(column), share(row)]);
    let mut deepest: Option<(f64, DVec3)> = None;
    for row in 0..=GRID_STEPS {
        for column in 0..=GRID_STEPS {
            let Some(from) = place(column, row) else {
                continue;
            };
            for to in [
                (column < GRID_STEPS).then(|| place(column + 1, row)),
                (row < GRID_STEPS).then(|| place(column, row + 1)),
            ] {
                let Some(at) = to.flatten().and_then(|to| through(b.face, from, to)) else {
                    continue;
                };
                let normal = a.face.normal([share(column), share(row)]);
                let is_along = normal
                    .zip(at.1)
                    .is_none_or(|(a, b)| a.dot(b).abs() > ALONG_COSINE);
                let depth_m = a.face.to_edges_m(at.0).min(b.face.to_edges_m(at.0));
                if !is_along && deepest.is_none_or(|(most_m, _)| depth_m > most_m) {
                    deepest = Some((depth_m, at.0));
                }
            }
        }
    }
    if let Some((depth_m, at_m)) = deepest.filter(|(depth_m, _)| *depth_m > NEAR_M) {
        warnings.push(format!(
            "screens \"{}\" and \"{}\" cross each other, {:.2} m from the edges of both, near ({:.2}, {:.2}, {:.2}) m; measure where both stand again",
            a.name, b.name, depth_m, at_m.x, at_m.y, at_m.z
        ));
    }
}

/// Where the way between two points meets a surface, and its normal there.
fn through(face: &Face<'_>, from: DVec3, to: DVec3) -> Option<(DVec3, Option<DVec3>)> {
    let [x, y] = face.shape.locate(from, to - from)?;
    let at = face.shape.point_m(x, y)?;
    (at.distance_squared(from) <= to.distance_squared(from)).then(|| (at, face.shape.normal(x, y)))
}

/// Neighbours with pixels of very different sizes where they are nearest.
fn density(
    a: &Side<'_>,
    b: &Side<'_>,
    along: &[(&Side<'_>, &Side<'_>, Vec<Along>); 2],
    warnings: &mut Vec<String>,
) {
    let places = || {
        let [(_, _, from_a), (_, _, from_b)] = along;
        let from_a = from_a.iter().flat_map(|along| &along.near);
        let from_b = from_b.iter().flat_map(|along| &along.near);
        let from_a = from_a.map(|near| (near.distance_m, near.here, near.there));
        from_a.chain(from_b.map(|near| (near.distance_m, near.there, near.here)))
    };
    let nearest_m = places().fold(f64::INFINITY, |least, (metres, ..)| least.min(metres));
    let worst = places()
        .filter(|(distance_m, ..)| *distance_m <= nearest_m + MEET_M)
        .filter_map(|(_, in_a, in_b)| {
            let of_a = a.face.pixels_per_radian(in_a, a.size_px, a.head_m)?;
            let of_b = b.face.pixels_per_radian(in_b, b.size_px, b.head_m)?;
            Some((of_a, of_b))
        })
        .max_by(|x, y| ratio(*x).total_cmp(&ratio(*y)));
    if let Some((of_a, of_b)) = worst
        && ratio((of_a, of_b)) > RATIO
    {
        let (dense, sparse) = if of_a > of_b { (a, b) } else { (b, a) };
        warnings.push(format!(
            "screen \"{}\" has {:.1} times as many pixels to a radian as its neighbour \"{}\" where they are nearest ({:.0} and {:.0}); check size_px and corners of both",
            dense.name,
            ratio((of_a, of_b)),
            sparse.name,
            of_a.max(of_b),
            of_a.min(of_b)
        ));
    }
}

pub(super) fn ratio((a, b): (f64, f64)) -> f64 {
    a.max(b) / a.min(b)
}

/// Whether another screen of the same observer goes on beyond an edge, on the same surface.
fn is_shared(a: &Side<'_>, b: &Side<'_>, along: &Along) -> bool {
    if a.observer != b.observer {
        return false;
    }
    let shares = along.near.iter().filter(|near| {
        near.distance_m <= SHARED_M
            && b.face.to_edges_m(near.point_m) > SHARED_M
            && a.face
                .normal(near.here)
                .zip(b.face.normal(near.there))
                .is_some_and(|(a, b)| a.dot(b) > ALONG_COSINE)
    });
    shares.count() as f64 >= SHARED_SHARE * along.places as f64
}
