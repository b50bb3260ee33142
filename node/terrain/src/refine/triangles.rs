//! The triangles of a leaf's mesh.
//! In: its marks. Out: corners of right isosceles triangles on its lattice, in a fixed order, that cover it once.

use super::marks::{Marks, between, children, pair};
use geodesy::LATTICE_BITS;

/// The triangles of marks that conform: where a mark is set, so are the apexes of its pair.
///
/// In the order of marks; at each mark in the order side 0 first end, side 0 second end, side 1 first end, side 1 second end
/// of its pair, at the centre left, right, lower, upper edge. Corners are the ends of the hypotenuse, then the apex,
/// counter-clockwise in (x, y), which is so too as seen from outside the planet.
#[must_use]
pub fn triangles(marks: &Marks) -> Vec<[[u16; 2]; 3]> {
    let mut triangles = Vec::with_capacity(2 * marks.count());
    for apex in marks.positions() {
        // Triangles of the deepest marks are the last: they have no mark of their own.
        let deepest = pair(LATTICE_BITS, apex[0], apex[1])
            .is_some_and(|own| own.level == super::DEEPEST_MARK);
        for [from, to] in children(apex) {
            let [x, y] = between(from, to);
            if deepest || !marks.is_set(x, y) {
                triangles.push(counter_clockwise(from, to, apex));
            }
        }
    }
    triangles
}

fn counter_clockwise(from: [u16; 2], to: [u16; 2], apex: [u16; 2]) -> [[u16; 2]; 3] {
    let offset = |c: usize, end: [u16; 2]| i32::from(end[c]) - i32::from(apex[c]);
    let turn = offset(0, from) * offset(1, to) - offset(1, from) * offset(0, to);
    if turn > 0 {
        [from, to, apex]
    } else {
        [to, from, apex]
    }
}
