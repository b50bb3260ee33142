//! The stages that refine meshes pass naga, have the twin that they name, fit what every device can bind, and lay
//! structs out as the CPU writes them.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::mem::{offset_of, size_of};
use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module, TypeInner};
use shaders::{Emission, LeafHeightsUniform, RefineLeaf, RefineLevelUniform, RefineStage};

/// Storage buffers that any device binds for one stage, and invocations that it runs in one workgroup.
const MOST_BUFFERS: usize = 8;
const MOST_INVOCATIONS: u32 = 256;

fn parsed(stage: RefineStage) -> Module {
    let source = stage.source().unwrap();
    naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}: {}", stage.name(), error.emit_to_string(&source)))
}

#[test]
fn every_stage_validates() {
    for stage in RefineStage::ALL {
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&parsed(stage))
            .unwrap_or_else(|error| panic!("{}: {error:?}", stage.name()));
    }
}

#[test]
fn every_stage_has_the_twin_that_it_names() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for stage in RefineStage::ALL {
        let file = root.join(stage.twin());
        assert!(file.is_file(), "{}: {}", stage.name(), file.display());
        let named = Path::new(stage.twin()).file_name().unwrap();
        let source = stage.source().unwrap();
        assert!(
            source.contains(named.to_str().unwrap()),
            "{} does not name its twin",
            stage.name()
        );
    }
}

#[test]
fn stages_have_one_entry_point_and_bind_what_devices_can() {
    for stage in RefineStage::ALL {
        let (name, module) = (stage.name(), parsed(stage));
        let [entry] = &module.entry_points[..] else {
            panic!("{name}: one entry point");
        };
        assert_eq!(entry.name, "main", "{name}");
        assert!(entry.workgroup_size.iter().product::<u32>() <= MOST_INVOCATIONS);
        let mut bindings: Vec<u32> = Vec::new();
        let mut buffers = 0;
        for (_, global) in module.global_variables.iter() {
            buffers += usize::from(matches!(global.space, AddressSpace::Storage { .. }));
            if let Some(binding) = global.binding {
                assert_eq!(binding.group, 0, "{name}");
                bindings.push(binding.binding);
            }
        }
        bindings.sort_unstable();
        let numbers: Vec<u32> = (0..).take(bindings.len()).collect();
        assert_eq!(bindings, numbers, "{name}: bindings are numbered through");
        assert!(buffers <= MOST_BUFFERS, "{name}: {buffers} buffers");
    }
}

/// Size of a struct and the offsets of its fields but padding, as the CPU has it; `None` for structs that only stages
/// write and read.
fn layout_of(name: &str) -> Option<(usize, Vec<(&'static str, usize)>)> {
    macro_rules! layout {
        ($type:ty: $($field:ident),+) => {
            Some((size_of::<$type>(), vec![$((stringify!($field), offset_of!($type, $field))),+]))
        };
    }
    match name {
        "LeafHeights" => layout!(LeafHeightsUniform: origin, shift, units_per_m, slot),
        "Level" => layout!(RefineLevelUniform: level),
        "Step" => layout!(RefineLevelUniform: level, first_place),
        "Leaf" => layout!(RefineLeaf: links, flags, geometry, level),
        "Emission" => {
            layout!(Emission: place, geometry, first_vertex, first_index, unit_m, argument, record,
            first_entry, vertices, triangles, entries, window_vertex, window_index)
        }
        "Worklist" | "Window" => None,
        other => panic!("struct {other} has no layout in this test"),
    }
}

#[test]
fn structs_lie_in_memory_as_the_cpu_writes_them() {
    let mut compared = 0;
    for stage in RefineStage::ALL {
        let module = parsed(stage);
        for (_, global) in module.global_variables.iter() {
            let outer = &module.types[global.ty];
            let described = match outer.inner {
                TypeInner::Array { base, .. } => &module.types[base],
                _ => outer,
            };
            let TypeInner::Struct { members, span } = &described.inner else {
                continue;
            };
            let name = described.name.as_deref().unwrap();
            let Some((size, fields)) = layout_of(name) else {
                continue;
            };
            let found: Vec<(&str, usize)> = members
                .iter()
                .map(|member| (member.name.as_deref().unwrap(), member.offset as usize))
                .filter(|(name, _)| !name.starts_with("padding"))
                .collect();
            assert_eq!(
                (*span as usize, found),
                (size, fields),
                "{}: {name}",
                stage.name()
            );
            compared += 1;
        }
    }
    // The heights' and the pyramid's uniforms, the step of bottom up, leaves in three stages, emissions in two.
    assert_eq!(compared, 8);
}
