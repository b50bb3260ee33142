//! Refinement bottom up: every mark of every leaf is asked once, from the smallest triangles to the largest.
//! In: leaves beside leaves, errors and allowances. Out: their marks, the same as top down. It trusts
//! nothing about larger triangles: a mark is set for its own sake, its children's or its twin's.

use geodesy::LATTICE_BITS;

use super::links::Domain;
use super::marks::{DEEPEST_MARK, Marks, between, marks_of_level, pair};
use super::top_down::fails;

/// The marks of each leaf of `domain`, in their order; the parameters are those of [`top_down`](crate::top_down).
///
/// Levels of refinement are counted over the planet, two for each level of a leaf, so that a mark that two leaves of
/// different levels share is asked in both at once, after everything smaller in either.
#[must_use]
pub fn bottom_up(domain: &Domain, errors: &[&[u32]], allowances: &[&[u32]]) -> Vec<Marks> {
    let mut marks: Vec<Marks> = domain.leaves.iter().map(|_| Marks::new()).collect();
    let tile_levels = domain.leaves.iter().map(|leaf| 2 * leaf.tile.level());
    let (Some(first), Some(last)) = (tile_levels.clone().max(), tile_levels.min()) else {
        return marks;
    };
    for (leaf, marks) in domain.leaves.iter().zip(&mut marks) {
        for [x, y] in leaf.forced() {
            marks.set(x, y);
        }
    }
    for planet_level in (last..=first + DEEPEST_MARK).rev() {
        for (place, leaf) in domain.leaves.iter().enumerate() {
            let Some(level) = planet_level.checked_sub(2 * leaf.tile.level()) else {
                continue;
            };
            if level > DEEPEST_MARK {
                continue;
            }
            let errors = errors.get(place).copied().unwrap_or_default();
            let allowances = allowances.get(place).copied().unwrap_or_default();
            for mark in marks_of_level(level).filter(|mark| leaf.may_have(*mark)) {
                let Some(own) = marks.get_mut(place) else {
                    continue;
                };
                if !splits(own, errors, allowances, mark) {
                    continue;
                }
                own.set(mark[0], mark[1]);
                for (beside, [x, y]) in domain.twins(place as u16, mark[0], mark[1]) {
                    if let Some(marks) = marks.get_mut(usize::from(beside)) {
                        marks.set(x, y);
                    }
                }
            }
        }
    }
    marks
}

/// Whether a triangle beside the mark fails or one of its legs is split.
fn splits(marks: &Marks, errors: &[u32], allowances: &[u32], mark: [u16; 2]) -> bool {
    let Some(own) = pair(LATTICE_BITS, mark[0], mark[1]) else {
        return false;
    };
    own.apexes.into_iter().flatten().any(|apex| {
        let leg_is_split = |end| {
            let [x, y] = between(apex, end);
            own.level < DEEPEST_MARK && marks.is_set(x, y)
        };
        own.ends.into_iter().any(leg_is_split) || fails(errors, allowances, mark, apex, own.level)
    })
}
