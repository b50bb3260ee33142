//! Refinement to a depth, whatever the heights: the coarsest mesh, the finest, and those between.
//! In: leaves beside leaves, a depth. Out: their marks, which conform. It knows no errors and no view.

use super::links::Domain;
use super::marks::Marks;
use super::top_down::grow;

/// The marks of each leaf of `domain`, in their order: all of levels below `levels`, and what conformity and leaves
/// beside ask for. 0 gives the coarsest conforming mesh; 15 and more all marks, but for odd ones beside coarser
/// leaves.
#[must_use]
pub fn uniform(domain: &Domain, levels: u8) -> Vec<Marks> {
    grow(domain, |_, _, _, level| level < levels)
}
