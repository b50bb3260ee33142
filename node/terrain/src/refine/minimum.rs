//! The smallest conforming mesh whose drawn triangles all show no more than τ: what meshes by bounds are compared with.
//! In: true heights of the leaves of a domain, an eye. Out: marks. It tests every sample of every triangle, and is
//! slow: for tests and reports only.

use geodesy::{Ellipsoid, LATTICE_BITS};
use glam::DVec3;

use super::links::Domain;
use super::marks::{Marks, pair};
use super::oracle::{Samples, Worst};

/// The marks of the smallest such mesh, one for each leaf of `domain` and in their order.
///
/// Top down from two triangles a leaf and more where finer leaves are beside: a triangle is split if it exists and
/// some sample in it is more than `tau_px` off, or if conformity or a leaf beside asks for it, and for no other
/// reason. `heights_m` has for each leaf the true heights of its 257 · 257 nodes, row by row, in metres; a node
/// that is not a number is not measured, but must not become a vertex. `eye` in ECEF metres.
#[must_use]
pub fn minimum(
    domain: &Domain,
    ellipsoid: &Ellipsoid,
    heights_m: &[&[f64]],
    eye: DVec3,
    pixels_per_radian: f64,
    tau_px: f64,
) -> Vec<Marks> {
    let samples: Vec<Samples> = domain
        .leaves
        .iter()
        .zip(heights_m)
        .map(|(leaf, heights)| Samples::new(ellipsoid, leaf.tile, heights, eye))
        .collect();
    let most = tau_px / pixels_per_radian;
    let mut growth = Growth {
        domain,
        marks: domain.leaves.iter().map(|_| Marks::new()).collect(),
        new: Vec::new(),
    };
    for place in 0..domain.leaves.len().min(samples.len()) {
        let place = place as u16;
        growth.new.push((place, [128, 128]));
        let finer = domain
            .leaves
            .get(usize::from(place))
            .map_or(0, |leaf| leaf.finer);
        for (bit, midpoint) in [[0, 128], [256, 128], [128, 0], [128, 256]]
            .into_iter()
            .enumerate()
        {
            if finer >> bit & 1 == 1 {
                growth.set(place, midpoint);
            }
        }
    }
    let mut next = 0;
    while let Some((place, mark)) = growth.new.get(next).copied() {
        next += 1;
        for (beside, twin) in domain.twins(place, mark[0], mark[1]).collect::<Vec<_>>() {
            growth.set(beside, twin);
        }
        let own = pair(LATTICE_BITS, mark[0], mark[1]);
        for apex in own.iter().flat_map(|own| own.apexes).flatten() {
            growth.set(place, apex);
        }
        let Some(samples) = samples.get(usize::from(place)) else {
            continue;
        };
        for hypotenuse in children(mark) {
            let middle = middle(hypotenuse);
            let corners = [hypotenuse[0], hypotenuse[1], mark];
            let mut worst = Worst::default();
            samples.measure(
                corners.map(|corner| samples.point(corner)),
                corners,
                &mut worst,
                None,
            );
            if worst.angle > most {
                growth.set(place, middle);
            }
        }
    }
    growth.marks
}

/// The hypotenuses of the triangles inside the leaf whose apex is `mark`: the legs of its pair, or the leaf's four
/// edges. None for marks whose triangles have no marks of their own.
fn children(mark: [u16; 2]) -> Vec<[[u16; 2]; 2]> {
    if mark == [128, 128] {
        let corners = [[0, 0], [256, 0], [256, 256], [0, 256]];
        return (0..4).map(|n| [corners[n], corners[(n + 1) % 4]]).collect();
    }
    let Some(own) = pair(LATTICE_BITS, mark[0], mark[1]).filter(|own| own.level < 14) else {
        return Vec::new();
    };
    let apexes = own.apexes.into_iter().flatten();
    apexes
        .flat_map(|apex| own.ends.map(|end| [apex, end]))
        .collect()
}

fn middle([from, to]: [[u16; 2]; 2]) -> [u16; 2] {
    [u16::midpoint(from[0], to[0]), u16::midpoint(from[1], to[1])]
}

/// Marks while they grow.
struct Growth<'a> {
    domain: &'a Domain,
    marks: Vec<Marks>,
    /// Every mark that was set, in the order of setting.
    new: Vec<(u16, [u16; 2])>,
}

impl Growth<'_> {
    /// Sets a mark, unless it is an odd one beside a coarser leaf, which has no such vertex.
    fn set(&mut self, place: u16, [x, y]: [u16; 2]) {
        let coarser = self
            .domain
            .leaves
            .get(usize::from(place))
            .map_or(0, |leaf| leaf.coarser);
        let edges = [x == 0, x == 256, y == 0, y == 256];
        let odd = x % 2 == 1 || y % 2 == 1;
        if odd
            && edges
                .iter()
                .enumerate()
                .any(|(bit, on)| *on && coarser >> bit & 1 == 1)
        {
            return;
        }
        if let Some(marks) = self.marks.get_mut(usize::from(place))
            && marks.set(x, y)
        {
            self.new.push((place, [x, y]));
        }
    }
}
