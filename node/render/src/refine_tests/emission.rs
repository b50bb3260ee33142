//! Vertices, indices and arguments against their twin.

use shaders::EmitLeaf;
use terrain::{Marks, Vertex};

use super::ground::{Ground, Noise};
use super::rig::{ANYTHING, Place, Rig, UNIT_M};
use crate::device_tests::device;
use crate::refine::{Marked, Method};

/// What no stage writes.
const UNTOUCHED: u32 = 0xABAD_1DEA;

struct Target {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    arguments: wgpu::Buffer,
}

fn buffer(rig: &Rig, words: usize) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let buffer = rig.gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: words as u64 * 4,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let bytes = vec![UNTOUCHED; words];
    rig.gpu
        .queue
        .write_buffer(&buffer, 0, bytemuck::cast_slice(&bytes));
    buffer
}

/// Writes the meshes of some leaves with gaps between them, and compares all of it with the twin.
fn compare(rig: &mut Rig, what: &str, marks: &[Marks], places: &[usize]) {
    let counts: Vec<_> = marks.iter().map(terrain::count).collect();
    let (mut first_vertex, mut first_index) = (5, 7);
    let mut emits = Vec::new();
    for (number, place) in places.iter().enumerate() {
        emits.push(EmitLeaf {
            place: *place as u32,
            geometry: rig.leaves[*place].geometry,
            first_vertex,
            first_index,
            unit_m: UNIT_M as f32,
            argument: 2 * number as u32 + 1,
            record: 1000 + number as u32,
            padding: 0,
        });
        first_vertex += counts[*place].vertices + 3;
        first_index += 3 * counts[*place].triangles + 2;
    }
    let target = Target {
        vertices: buffer(rig, first_vertex as usize * 9),
        indices: buffer(rig, first_index as usize),
        arguments: buffer(rig, (2 * emits.len() + 1) * 5),
    };
    rig.refiner
        .emit(
            &rig.gpu,
            &rig.buffers,
            &emits,
            &target.vertices,
            &target.indices,
            &target.arguments,
            &mut rig.times,
        )
        .unwrap();
    let mut vertices = rig.read(&target.vertices);
    let mut indices = rig.read(&target.indices);
    let mut arguments = rig.read(&target.arguments);
    for emit in &emits {
        let place = emit.place as usize;
        let (heights, anchors) = (&rig.heights[place], rig.anchors(place));
        let border = rig.border(place, heights);
        let due = terrain::emit(&marks[place], heights, &anchors, &border, UNIT_M);
        let triangles = take(&mut indices, emit.first_index as usize, due.1.len());
        assert!(triangles == due.1, "{what}: indices of leaf {place}");
        let found = take(
            &mut vertices,
            emit.first_vertex as usize * 9,
            due.0.len() * 9,
        );
        let cell_m = 1.0e7 / f64::from(256 << rig.tiles[place].level());
        for (found, due) in found.chunks_exact(9).zip(&due.0) {
            same_vertex(found, due, cell_m);
        }
        let argument = take(&mut arguments, emit.argument as usize * 5, 5);
        let count = counts[place];
        let due = [
            3 * count.triangles,
            1,
            emit.first_index,
            emit.first_vertex,
            emit.record,
        ];
        assert_eq!(argument, due, "{what}: arguments of leaf {place}");
    }
    for (name, words) in [
        ("vertices", vertices),
        ("indices", indices),
        ("arguments", arguments),
    ] {
        let touched = words.iter().position(|word| *word != UNTOUCHED);
        assert_eq!(touched, None, "{what}: {name} between meshes");
    }
}

/// Takes words out and leaves untouched ones behind.
fn take(words: &mut [u32], first: usize, count: usize) -> Vec<u32> {
    let part = &mut words[first..first + count];
    let taken = part.to_vec();
    part.fill(UNTOUCHED);
    taken
}

/// Border vertices are the same bits; inner ones within two steps and a millionth of a cell, their normals within one.
fn same_vertex(found: &[u32], due: &Vertex, cell_m: f64) {
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&due.to_bytes());
    let [x, y] = due.lattice;
    if terrain::border_index(x, y).is_some() {
        assert_eq!(found, words, "border vertex {x}, {y}");
        return;
    }
    let most = 2 + (cell_m * 1e-6 * 1_048_576.0) as i64;
    for axis in 0..3 {
        let wide = |words: &[u32]| {
            (u64::from(words[2 * axis + 1]) << 32 | u64::from(words[2 * axis])).cast_signed()
        };
        let apart = (wide(found) - wide(&words)).abs();
        assert!(
            apart <= most,
            "vertex {x}, {y}: {apart} steps of {most} off"
        );
    }
    for (found, due) in [(found[6], words[6]), (found[7], words[7])] {
        for shift in [0, 16] {
            let half = |word: u32| i32::from((word >> shift) as u16 as i16);
            assert!((half(found) - half(due)).abs() <= 1, "normal of {x}, {y}");
        }
    }
    assert_eq!(found[8], words[8], "lattice of {x}, {y}");
}

#[test]
fn meshes_equal_their_twin_and_lie_where_they_are_told() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    for (place, ground) in [
        (Place::FaceEdge, Ground::Fractal),
        (Place::CubeCorner, Ground::Spikes),
        (Place::Patchy, Ground::Random),
    ] {
        rig.go(place);
        rig.fill(ground);
        let allowances = rig.nested_allowances(&mut Noise(21));
        let marked = rig.mark(&allowances, &Method::TopDown, ANYTHING).unwrap();
        assert!(matches!(marked, Marked::Counts(_)));
        let errors: Vec<&[u32]> = rig.errors.iter().map(Vec::as_slice).collect();
        let tables: Vec<&[u32]> = allowances.iter().map(Vec::as_slice).collect();
        let marks = terrain::top_down(&rig.domain, &errors, &tables);
        let places: Vec<usize> = (0..rig.leaves.len()).rev().step_by(2).collect();
        compare(&mut rig, &format!("{place:?}"), &marks, &places);
    }
}

#[test]
fn coarsest_and_finest_meshes_equal_their_twin() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::CubeCorner);
    rig.fill(Ground::Cliffs);
    for levels in [0, 15] {
        let marks = terrain::uniform(&rig.domain, levels);
        let words: Vec<u32> = marks.iter().flat_map(Marks::words).copied().collect();
        rig.mark(&[], &Method::Given(&words), ANYTHING).unwrap();
        compare(&mut rig, &format!("{levels} levels"), &marks, &[3, 0, 5]);
    }
    // No meshes are no work.
    compare(&mut rig, "no meshes", &[], &[]);
}

#[test]
fn deep_tiles_have_finer_steps_and_their_meshes_equal_the_twin_too() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::Face);
    // Anchors shift left on wide tiles and right on small ones.
    for (place, tile) in rig.tiles.iter_mut().enumerate() {
        let deep = 9 + place as u8 % 12;
        while let (true, Some(children)) = (tile.level() < deep, tile.children()) {
            *tile = children[place % 4];
        }
    }
    rig.fill(Ground::Random);
    let marks = terrain::uniform(&rig.domain, 9);
    let words: Vec<u32> = marks.iter().flat_map(Marks::words).copied().collect();
    rig.mark(&[], &Method::Given(&words), ANYTHING).unwrap();
    let places: Vec<usize> = (0..rig.leaves.len()).collect();
    compare(&mut rig, "deep tiles", &marks, &places);
}

#[test]
fn meshes_beyond_their_buffers_are_refused() {
    let Some(gpu) = device() else { return };
    let mut rig = Rig::new(gpu);
    rig.go(Place::Face);
    let marks = terrain::uniform(&rig.domain, 0);
    let words: Vec<u32> = marks.iter().flat_map(Marks::words).copied().collect();
    rig.mark(&[], &Method::Given(&words), ANYTHING).unwrap();
    let small = buffer(&rig, 20);
    let emit = EmitLeaf {
        place: 0,
        geometry: 0,
        first_vertex: 0,
        first_index: 0,
        unit_m: 1.0,
        argument: 0,
        record: 0,
        padding: 0,
    };
    let mut refused = |emit: EmitLeaf| {
        let done = rig.refiner.emit(
            &rig.gpu,
            &rig.buffers,
            &[emit],
            &small,
            &small,
            &small,
            &mut None,
        );
        done.unwrap_err().to_string()
    };
    assert!(refused(emit).contains("beyond its buffers"));
    let unknown = EmitLeaf {
        place: 9999,
        ..emit
    };
    assert!(refused(unknown).contains("leaf 9999"));
}
