//! Heights and error pyramids, word for word.

use shaders::{INVALID_WORD, LeafHeightsUniform, cpu};

use super::ground::{Ground, Noise};
use super::rig::{Place, Rig, UNIT_M, slot_words, texture};
use crate::device_tests::device;
use crate::refine::HeightsJob;

#[test]
fn heights_and_pyramids_equal_their_twins_word_for_word() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::FaceEdge);
    for ground in Ground::ALL {
        rig.fill(ground);
        let heights = rig.read(&rig.buffers.heights);
        let errors = rig.read(&rig.buffers.errors);
        for (place, leaf) in rig.leaves.iter().enumerate() {
            let first = leaf.geometry as usize * terrain::LATTICE_NODES;
            let slot = first..first + terrain::LATTICE_NODES;
            let found: &[i32] = bytemuck::cast_slice(&heights[slot.clone()]);
            assert!(found == rig.heights[place], "{ground:?}: heights {place}");
            let due = &rig.errors[place];
            // Corners and centre are no marks: nothing writes or reads them.
            let differs = errors[slot]
                .iter()
                .zip(due)
                .position(|(found, due)| found != due);
            assert_eq!(
                differs.map(|n| [n % 257, n / 257]),
                None,
                "{ground:?}: errors {place}"
            );
        }
    }
}

#[test]
fn heights_between_coarser_samples_equal_their_twin_and_holes_are_flat() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::Face);
    let heights = Ground::Fractal.heights(4);
    let mut words = slot_words(&heights);
    let mut noise = Noise(3);
    for word in &mut words {
        if noise.next().is_multiple_of(7) {
            *word = INVALID_WORD;
        }
    }
    let view = texture(&rig.gpu, &words);
    let border = rig.border(0, &Ground::Random.heights(8));
    for shift in [0, 1, 3, 8, 16] {
        let origin = [(5 << shift) - 9, (1 << shift) / 2];
        let uniform = LeafHeightsUniform {
            origin,
            shift,
            units_per_m: (1.0 / UNIT_M) as f32,
            slot: 2,
            padding: [0; 3],
        };
        for input in [Some(&view), None] {
            rig.refiner
                .write_border(&rig.gpu, &rig.buffers, 2, &border, &[]);
            let job = HeightsJob {
                slot: 2,
                input,
                origin,
                shift,
                units_per_m: uniform.units_per_m,
            };
            rig.refiner
                .make_geometry(&rig.gpu, &rig.buffers, &[job], true, &mut None)
                .unwrap();
            let due = cpu::leaf_heights::run(&uniform, input.map(|_| &words[..]), &border);
            let found = rig.read(&rig.buffers.heights);
            let found: &[i32] = bytemuck::cast_slice(&found[2 * terrain::LATTICE_NODES..]);
            let mut inner = 0;
            for (n, (found, due)) in found.iter().zip(&due).enumerate() {
                let at_border = [n % 257, n / 257].iter().any(|c| *c == 0 || *c == 256);
                // What is copied or read as it is has the same bits; a mean in f32 may be a rounding off.
                let apart = if at_border || shift == 0 {
                    0
                } else {
                    1 + due.abs() / (1 << 21)
                };
                assert!(
                    (found - due).abs() <= apart,
                    "shift {shift}, node {n}: {found} for {due}"
                );
                inner += usize::from(!at_border && *found != 0);
            }
            let flat = input.is_none();
            assert_eq!(inner == 0, flat, "shift {shift}: {inner} heights are not 0");
        }
    }
}

#[test]
fn a_slot_that_is_not_there_is_refused() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    let job = HeightsJob {
        slot: rig.buffers.slots,
        input: None,
        origin: [0; 2],
        shift: 0,
        units_per_m: 1.0,
    };
    let refused = rig
        .refiner
        .make_geometry(&rig.gpu, &rig.buffers, &[job], true, &mut None);
    assert!(refused.unwrap_err().to_string().contains("slot"));
    let nothing = rig
        .refiner
        .make_geometry(&rig.gpu, &rig.buffers, &[], true, &mut None);
    assert!(nothing.is_ok());
}
