//! Refinement on a device against its twins, stage by stage, over ground of every kind and leaves of several levels across
//! cube faces. In: synthetic heights, a device. Without an adapter tests say so and pass, unless `REQUIRE_GPU=1`.
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::print_stderr,
    reason = "a test that panics has failed, and its times are for reading"
)]

#[path = "refine_tests/emission.rs"]
mod emission;
#[path = "refine_tests/ground.rs"]
mod ground;
#[path = "refine_tests/pyramids.rs"]
mod pyramids;
#[path = "refine_tests/rig.rs"]
mod rig;
#[path = "refine_tests/times.rs"]
mod times;

use terrain::Marks;

use self::ground::{Ground, Noise};
use self::rig::{ANYTHING, Place, Rig};
use super::{Marked, Method};
use crate::device_tests::device;

/// Marks top down and bottom up, and compares both with the reference, counts too.
fn compare_marks(rig: &mut Rig, what: &str, allowances: &[Vec<u32>]) -> Vec<Marks> {
    let errors: Vec<&[u32]> = rig.errors.iter().map(Vec::as_slice).collect();
    let tables: Vec<&[u32]> = allowances.iter().map(Vec::as_slice).collect();
    let references = [
        terrain::top_down(&rig.domain, &errors, &tables),
        terrain::bottom_up(&rig.domain, &errors, &tables),
    ];
    for (method, reference) in [Method::TopDown, Method::BottomUp].iter().zip(&references) {
        let name = match method {
            Method::TopDown => "top down",
            _ => "bottom up",
        };
        let marked = rig.mark(allowances, method, ANYTHING).unwrap();
        let found = rig.refiner.marks(&rig.gpu).unwrap();
        for (place, (found, due)) in found
            .chunks_exact(terrain::MARK_WORDS)
            .zip(reference)
            .enumerate()
        {
            assert!(
                found == due.words(),
                "{what}, {name}: marks of leaf {place} of {}",
                reference.len()
            );
        }
        let due: Vec<_> = reference.iter().map(terrain::count).collect();
        assert_eq!(marked, Marked::Counts(due), "{what}, {name}: counts");
    }
    let [top_down, _] = references;
    top_down
}

#[test]
fn marks_equal_the_reference_on_all_ground_and_across_faces() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    for place in Place::ALL {
        rig.go(place);
        assert!(
            rig.level_range() >= 1,
            "{place:?}: leaves of one level only"
        );
        assert_eq!(rig.faces(), place.faces(), "{place:?}");
        for (seed, ground) in (1..).zip(Ground::ALL) {
            rig.fill(ground);
            let mut noise = Noise(seed);
            // Nested, as the CPU makes them: limits rise with the size of what they limit.
            let nested = rig.nested_allowances(&mut noise);
            compare_marks(&mut rig, &format!("{place:?}, {ground:?}, nested"), &nested);
            // Whatever the tables say, the device does as the reference does.
            let wild = rig.wild_allowances(&mut noise);
            compare_marks(&mut rig, &format!("{place:?}, {ground:?}, wild"), &wild);
        }
    }
}

#[test]
fn nested_errors_and_allowances_give_the_same_marks_both_ways() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::CubeCorner);
    rig.fill(Ground::Fractal);
    let allowances = rig.nested_allowances(&mut Noise(5));
    rig.mark(&allowances, &Method::TopDown, ANYTHING).unwrap();
    let top_down = rig.refiner.marks(&rig.gpu).unwrap();
    rig.mark(&allowances, &Method::BottomUp, ANYTHING).unwrap();
    assert!(top_down == rig.refiner.marks(&rig.gpu).unwrap());
}

#[test]
fn nothing_and_everything_can_be_asked_for() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::FaceEdge);
    rig.fill(Ground::Random);
    let all = vec![vec![0; terrain::ALLOWANCE_WORDS]; rig.leaves.len()];
    let marks = compare_marks(&mut rig, "everything", &all);
    assert_eq!(marks, terrain::uniform(&rig.domain, 15));
    let none = vec![vec![u32::MAX; terrain::ALLOWANCE_WORDS]; rig.leaves.len()];
    let marks = compare_marks(&mut rig, "nothing", &none);
    assert_eq!(marks, terrain::uniform(&rig.domain, 0));
}

#[test]
fn a_worklist_that_is_too_short_grows_and_loses_nothing() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::CubeCorner);
    rig.fill(Ground::Spikes);
    let allowances = rig.nested_allowances(&mut Noise(9));
    rig.refiner.marking.entries = 1;
    let marks = compare_marks(&mut rig, "short list", &allowances);
    let set: usize = marks.iter().map(Marks::count).sum();
    assert!(set > 30 * rig.leaves.len(), "{set} marks make no test");
}

#[test]
fn more_than_the_limits_is_too_many_either_way_and_marks_nothing() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::Face);
    rig.fill(Ground::Random);
    let all = vec![vec![0; terrain::ALLOWANCE_WORDS]; rig.leaves.len()];
    for method in [Method::TopDown, Method::BottomUp] {
        let marked = rig.mark(&all, &method, 1000).unwrap();
        assert_eq!(marked, Marked::TooMany);
        assert!(rig.refiner.marking.counted.is_empty());
    }
    // What was refused does not stand in the way of what fits.
    let none = vec![vec![u32::MAX; terrain::ALLOWANCE_WORDS]; rig.leaves.len()];
    compare_marks(&mut rig, "after too many", &none);
}

#[test]
fn given_marks_are_taken_as_they_are() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::FaceEdge);
    for levels in [0, 6, 15] {
        let due = terrain::uniform(&rig.domain, levels);
        let words: Vec<u32> = due.iter().flat_map(Marks::words).copied().collect();
        let marked = rig.mark(&[], &Method::Given(&words), ANYTHING).unwrap();
        let counts = due.iter().map(terrain::count).collect();
        assert_eq!(marked, Marked::Counts(counts), "{levels} levels");
        assert!(rig.refiner.marks(&rig.gpu).unwrap() == words);
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::Face);
    let short = vec![vec![0; terrain::ALLOWANCE_WORDS]; rig.leaves.len() - 1];
    let error = rig.mark(&short, &Method::TopDown, ANYTHING).unwrap_err();
    assert!(error.to_string().contains("allowances"), "{error}");
    let error = rig.mark(&[], &Method::Given(&[1, 2]), ANYTHING);
    assert!(error.unwrap_err().to_string().contains("2 words"));
    rig.leaves[0].geometry = rig.buffers.slots;
    let tables = vec![vec![0; terrain::ALLOWANCE_WORDS]; rig.leaves.len()];
    let error = rig.mark(&tables, &Method::BottomUp, ANYTHING).unwrap_err();
    assert!(error.to_string().contains("slot"), "{error}");
    // No leaves are no work.
    rig.leaves.clear();
    let marked = rig.mark(&[], &Method::TopDown, ANYTHING).unwrap();
    assert_eq!(marked, Marked::Counts(Vec::new()));
}
