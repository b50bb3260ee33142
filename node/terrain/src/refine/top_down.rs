//! Refinement top down: from two triangles an edge to as many as the view needs.
//! In: leaves beside leaves, errors and allowances. Out: their marks. The work is proportional to the marks
//! that get set, not to those there are. Integers decide; the compute passes set the same marks.

use geodesy::LATTICE_BITS;

use super::links::Domain;
use super::marks::{MIDDLE, Marks, between, children, node, pair, side_of};

/// The marks of each leaf of `domain`, in their order.
///
/// `errors` and `allowances` hold a leaf's [`pyramid`](crate::pyramid) and table of limits each, in the same order.
/// A triangle fails if its error's code is not below its limit. What is missing in either always fails. A mark
/// is set if a triangle beside it is there and fails, if it is the apex of a pair whose mark is set, or if
/// it is the same vertex as a mark that is set in a leaf beside. Odd ones beside coarser leaves never are.
#[must_use]
pub fn top_down(domain: &Domain, errors: &[&[u32]], allowances: &[&[u32]]) -> Vec<Marks> {
    grow(domain, |place, mark, apex, level| {
        let errors = errors.get(place).copied().unwrap_or_default();
        let allowances = allowances.get(place).copied().unwrap_or_default();
        fails(errors, allowances, mark, apex, level)
    })
}

/// Whether the triangle beside `mark`, of `level`, with its right angle at `apex` deviates too far.
pub(crate) fn fails(
    errors: &[u32],
    allowances: &[u32],
    mark: [u16; 2],
    apex: [u16; 2],
    level: u8,
) -> bool {
    let side = side_of(apex, mark);
    let (word, half) = if level >= 7 {
        // The one block of 16 × 16 cells in which the triangle lies.
        let [x, y] = [0, 1].map(|c| usize::from((mark[c] + apex[c]) >> 5));
        (16 * y + x, usize::from(level <= 8))
    } else {
        let [x, y] = mark.map(|c| usize::from(c / 16));
        (super::BLOCKS + 17 * y + x, side)
    };
    let half_of = |word: u32, half: usize| word >> (16 * half) & 0xffff;
    match (errors.get(node(mark)), allowances.get(word)) {
        (Some(error), Some(limit)) => half_of(*error, side) >= half_of(*limit, half),
        _ => true,
    }
}

/// Splits triangles for as long as `splits` (place of the leaf, mark, apex, level) says so, and what that asks for.
pub(crate) fn grow(
    domain: &Domain,
    splits: impl Fn(usize, [u16; 2], [u16; 2], u8) -> bool,
) -> Vec<Marks> {
    let mut growth = Growth {
        domain,
        marks: domain.leaves.iter().map(|_| Marks::new()).collect(),
        list: Vec::new(),
    };
    for (place, leaf) in (0..).zip(&domain.leaves) {
        growth.list.push((place, [MIDDLE; 2]));
        for middle in leaf.forced() {
            growth.set(place, middle);
        }
    }
    // The order in which the list is worked off decides nothing, so it is a stack, which stays short.
    while let Some((place, mark)) = growth.list.pop() {
        for (beside, twin) in domain.twins(place, mark[0], mark[1]) {
            growth.set(beside, twin);
        }
        let own = pair(LATTICE_BITS, mark[0], mark[1]);
        for apex in own.iter().flat_map(|own| own.apexes).flatten() {
            growth.set(place, apex);
        }
        // The level of the triangles that this mark makes; those of the deepest have no marks of their own.
        let level = own.map_or(0, |own| own.level + 1);
        if level > super::DEEPEST_MARK {
            continue;
        }
        for [from, to] in children(mark) {
            let child = between(from, to);
            if !growth.is_set(place, child) && splits(usize::from(place), child, mark, level) {
                growth.set(place, child);
            }
        }
    }
    growth.marks
}

/// Marks while they grow.
struct Growth<'a> {
    domain: &'a Domain,
    marks: Vec<Marks>,
    /// Marks that were set and whose consequences were not drawn yet.
    list: Vec<(u16, [u16; 2])>,
}

impl Growth<'_> {
    fn is_set(&self, place: u16, [x, y]: [u16; 2]) -> bool {
        let marks = self.marks.get(usize::from(place));
        marks.is_some_and(|marks| marks.is_set(x, y))
    }

    fn set(&mut self, place: u16, mark: [u16; 2]) {
        let number = usize::from(place);
        if let (Some(leaf), Some(marks)) =
            (self.domain.leaves.get(number), self.marks.get_mut(number))
            && leaf.may_have(mark)
            && marks.set(mark[0], mark[1])
        {
            self.list.push((place, mark));
        }
    }
}
