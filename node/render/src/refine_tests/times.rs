//! What passes take, by the device's clock and by waiting; with `--nocapture` the numbers are shown.

use std::time::Instant;

use shaders::EmitLeaf;
use terrain::Marks;

use super::ground::Ground;
use super::rig::{ANYTHING, Place, Rig, UNIT_M};
use crate::device_tests::device;
use crate::recorder::PassTimes;
use crate::refine::{Marked, Method};

/// The least of several sums of each label, in milliseconds.
fn least(rounds: &[Vec<(&'static str, f64)>]) -> Vec<(&'static str, f64)> {
    let mut labels: Vec<&'static str> = Vec::new();
    for (label, _) in rounds.iter().flatten() {
        if !labels.contains(label) {
            labels.push(label);
        }
    }
    let sum = |round: &Vec<(&'static str, f64)>, label: &str| {
        let of_label = round.iter().filter(|(other, _)| *other == label);
        of_label.map(|(_, ms)| ms).sum::<f64>()
    };
    let least = |label: &'static str| {
        let sums = rounds.iter().map(|round| sum(round, label));
        (label, sums.fold(f64::INFINITY, f64::min))
    };
    labels.into_iter().map(least).collect()
}

#[test]
fn passes_are_timed_and_compute_the_same() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::CubeCorner);
    rig.fill(Ground::Fractal);
    let leaves = rig.leaves.len();
    // Allow so much that some hundred thousand marks are left.
    let table = vec![3500_u32 << 16 | 3500; terrain::ALLOWANCE_WORDS];
    let allowances = vec![table; leaves];
    let untimed = rig.mark(&allowances, &Method::TopDown, ANYTHING).unwrap();
    let untimed_marks = rig.refiner.marks(&rig.gpu).unwrap();
    let Marked::Counts(counts) = untimed.clone() else {
        panic!("too many marks");
    };
    let vertices: u32 = counts.iter().map(|count| count.vertices).sum();
    let triangles: u32 = counts.iter().map(|count| count.triangles).sum();
    let target = |words: u32| {
        rig.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(words) * 4,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let targets = [
        target(vertices * 9),
        target(triangles * 3),
        target(leaves as u32 * 5),
    ];
    let mut emits = Vec::new();
    let (mut first_vertex, mut first_index) = (0, 0);
    for (place, count) in (0..).zip(&counts) {
        emits.push(EmitLeaf {
            place,
            geometry: rig.leaves[place as usize].geometry,
            first_vertex,
            first_index,
            unit_m: UNIT_M as f32,
            argument: place,
            record: place,
            padding: 0,
        });
        first_vertex += count.vertices;
        first_index += 3 * count.triangles;
    }
    let mut clocks = vec![PassTimes::without_device_clock()];
    clocks.push(PassTimes::new(&rig.gpu));
    for clock in clocks {
        rig.times = Some(clock);
        let (mut rounds, mut walls) = (Vec::new(), Vec::new());
        for _ in 0..4 {
            rig.fill(Ground::Fractal);
            rig.gpu.wait().unwrap();
            for method in [Method::BottomUp, Method::TopDown] {
                let before = Instant::now();
                let marked = rig.mark(&allowances, &method, ANYTHING).unwrap();
                walls.push(before.elapsed());
                assert_eq!(marked, untimed);
                assert!(rig.refiner.marks(&rig.gpu).unwrap() == untimed_marks);
            }
            rig.refiner
                .emit(
                    &rig.gpu,
                    &rig.buffers,
                    &emits,
                    &targets[0],
                    &targets[1],
                    &targets[2],
                    &mut rig.times,
                )
                .unwrap();
            rounds.push(rig.times.as_mut().unwrap().take());
        }
        let sums = least(&rounds);
        eprintln!("{leaves} leaves, {vertices} vertices, {triangles} triangles");
        for (label, ms) in &sums {
            eprintln!("  {label}: {ms:.3} ms");
        }
        let labels: Vec<&str> = sums.iter().map(|(label, _)| *label).collect();
        let due = [
            "heights",
            "error pyramid",
            "seed marks",
            "bottom-up marks",
            "count",
            "top-down marks",
            "compact",
            "emit",
        ];
        assert_eq!(labels, due);
        assert!(sums.iter().all(|(_, ms)| *ms > 0.0 && ms.is_finite()));
        assert!(rig.times.as_mut().unwrap().take().is_empty(), "taken once");
    }
    rig.times = None;
    let mut wall = f64::INFINITY;
    for _ in 0..5 {
        let before = Instant::now();
        rig.mark(&allowances, &Method::TopDown, ANYTHING).unwrap();
        wall = wall.min(before.elapsed().as_secs_f64() * 1e3);
    }
    eprintln!("top down, count and read back, not timed: {wall:.3} ms");
    let set: usize = untimed_marks
        .chunks_exact(terrain::MARK_WORDS)
        .map(|words| Marks::from_words(words.to_vec()).unwrap().count())
        .sum();
    assert_eq!(set, vertices as usize);
}
