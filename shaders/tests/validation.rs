//! Every WGSL file is listed, resolves and passes naga; every compute stage has its CPU twin, the bindings that
//! the list promises, and structs laid out as the CPU writes them.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::mem::{offset_of, size_of};
use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, ImageClass, Module, ScalarKind, StorageFormat, TypeInner};
use shaders::{
    AspectUniform, ElevationUniform, FinishUniform, FrameUniform, FuseInput, FuseUniform,
    HillshadeUniform, ImageryUniform, IsolinesUniform, LensUniform, LitUniform, RampUniform,
    RefineStage, ReliefUniform, ResampleUniform, SarUniform, SlopeUniform, Stage, StereoUniform,
    SurfaceUniform, TileGeometry, TileRecord, WarpUniform,
};

#[test]
fn every_stage_validates() {
    for stage in Stage::ALL {
        let source = stage.source().unwrap();
        let module = naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}: {}", stage.name(), error.emit_to_string(&source)));
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{}: {error:?}", stage.name()));
    }
}

#[test]
fn every_file_is_listed_and_opens_with_its_duty() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("wgsl");
    let mut found = Vec::new();
    for folder in std::fs::read_dir(&root).unwrap() {
        for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(
                text.starts_with("// "),
                "{} does not say its duty",
                path.display()
            );
            let name = path.strip_prefix(&root).unwrap().with_extension("");
            found.push(name.to_string_lossy().into_owned());
        }
    }
    for name in found.iter().filter(|name| !name.starts_with("shared/")) {
        assert!(
            Stage::ALL.iter().any(|stage| stage.name() == name)
                || RefineStage::ALL.iter().any(|stage| stage.name() == name),
            "{name} is in neither list of stages"
        );
    }
}

#[test]
fn every_compute_stage_has_a_twin() {
    for stage in Stage::ALL.into_iter().filter(|stage| stage.is_compute()) {
        let name = stage.name().rsplit('/').next().unwrap();
        let twin = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("src/cpu/{name}.rs"));
        assert!(twin.exists(), "{name} has no CPU twin");
    }
}

#[test]
fn compute_stages_are_exactly_those_with_compute_entry_points() {
    for stage in Stage::ALL {
        assert_eq!(
            stage.source().unwrap().contains("@compute"),
            stage.is_compute(),
            "{}",
            stage.name()
        );
    }
}

/// A struct as the CPU has it: size, and the offset of every field but padding.
struct Layout {
    size: usize,
    fields: Vec<(&'static str, usize)>,
}

macro_rules! layout {
    ($type:ty: $($field:ident),+) => {
        Layout {
            size: size_of::<$type>(),
            fields: vec![$((stringify!($field), offset_of!($type, $field))),+],
        }
    };
}

/// The CPU's struct for a WGSL struct of a stage.
fn layout_of(stage: Stage, name: &str) -> Layout {
    match name {
        "TileGeometry" => layout!(TileGeometry: from_centre, step, radius_m, face),
        "FuseInput" => layout!(FuseInput: weight, opacity, blend, group),
        "Resample" => layout!(ResampleUniform: origin, shift, form),
        "Elevation" => {
            layout!(ElevationUniform: scale, datum_shift_m, offset_m, lowest_m, highest_m)
        }
        "Imagery" => layout!(ImageryUniform: gain, contrast, saturation, inverse_gamma, tint),
        "Sar" => layout!(SarUniform: lowest, highest, strength, exponent, tint),
        "Ramp" => layout!(RampUniform: count, heights, colours),
        "Isolines" => {
            layout!(IsolinesUniform: spacing_m, half_width, bold_half_width, bold_every, colour)
        }
        "Slope" => layout!(SlopeUniform: tile, gentle, steep, range_deg),
        "Aspect" => layout!(AspectUniform: tile, saturation, brightness, flat_sine),
        "Hillshade" => layout!(HillshadeUniform: tile, light, exaggeration),
        "Fuse" => layout!(FuseUniform: count, inputs),
        "Lens" => layout!(LensUniform: degree, coefficients),
        "Relief" => layout!(ReliefUniform: tile, layer),
        "Surface" => layout!(SurfaceUniform: ground, layer),
        "Frame" => {
            layout!(FrameUniform: clip_from_relative, viewer_xy, viewer_z, sun, haze, shading,
            sky_viewer, sky_ray, sky_ray_x, sky_ray_y)
        }
        "TileRecord" => layout!(TileRecord: imagery, relief, face),
        "Finish" => layout!(FinishUniform: place, gamma, has_light, dark, bright),
        "Warp" => {
            layout!(WarpUniform: finish, eye, across, down, ahead, picture_size, texture_size)
        }
        "Lit" => layout!(LitUniform: finish, to_picture),
        "Stereo" => layout!(StereoUniform: mode, swapped, size, left),
        other => panic!(
            "{}: struct {other} has no layout in this test",
            stage.name()
        ),
    }
}

fn parsed(stage: Stage) -> Module {
    naga::front::wgsl::parse_str(&stage.source().unwrap()).unwrap()
}

/// Compares a struct and the structs in it.
fn compare(stage: Stage, module: &Module, handle: naga::Handle<naga::Type>) {
    let described = &module.types[handle];
    let inner = match &described.inner {
        TypeInner::Array { base, .. } => return compare(stage, module, *base),
        TypeInner::Struct { members, span } => (members, *span as usize),
        _ => return,
    };
    let (members, span) = inner;
    let name = described.name.as_deref().unwrap();
    let due = layout_of(stage, name);
    assert_eq!(span, due.size, "{}: size of {name}", stage.name());
    let found: Vec<(&str, usize)> = members
        .iter()
        .map(|member| (member.name.as_deref().unwrap(), member.offset as usize))
        .filter(|(name, _)| !name.starts_with("padding"))
        .collect();
    assert_eq!(found, due.fields, "{}: fields of {name}", stage.name());
    for member in members {
        compare(stage, module, member.ty);
    }
}

#[test]
fn structs_lie_in_memory_as_the_cpu_writes_them() {
    let mut compared = 0;
    for stage in Stage::ALL {
        let module = parsed(stage);
        for (_, global) in module.global_variables.iter() {
            if matches!(
                global.space,
                AddressSpace::Uniform | AddressSpace::Storage { .. }
            ) {
                compare(stage, &module, global.ty);
                compared += 1;
            }
        }
    }
    // Sixteen compute stages have one each; terrain has two, the wireframe, the atmosphere and three that finish
    // outputs one.
    assert_eq!(compared, 23);
}

#[test]
fn uniforms_are_whole_vectors() {
    for size in [
        size_of::<ResampleUniform>(),
        size_of::<ElevationUniform>(),
        size_of::<ImageryUniform>(),
        size_of::<SarUniform>(),
        size_of::<RampUniform>(),
        size_of::<IsolinesUniform>(),
        size_of::<SlopeUniform>(),
        size_of::<AspectUniform>(),
        size_of::<HillshadeUniform>(),
        size_of::<FuseUniform>(),
        size_of::<LensUniform>(),
        size_of::<ReliefUniform>(),
        size_of::<SurfaceUniform>(),
        size_of::<WarpUniform>(),
        size_of::<LitUniform>(),
        size_of::<StereoUniform>(),
    ] {
        assert_eq!(size % 16, 0);
    }
}

#[test]
fn compute_stages_bind_what_the_list_promises() {
    for stage in Stage::ALL.into_iter().filter(|stage| stage.is_compute()) {
        let (name, module) = (stage.name(), parsed(stage));
        let [entry] = &module.entry_points[..] else {
            panic!("{name}: one entry point");
        };
        assert_eq!(
            (entry.name.as_str(), entry.workgroup_size),
            ("main", [8, 8, 1]),
            "{name}"
        );
        let mut bound: Vec<_> = module
            .global_variables
            .iter()
            .filter_map(|(_, global)| Some((global.binding?, global)))
            .collect();
        bound.sort_by_key(|(binding, _)| binding.binding);
        assert_eq!(bound.len(), 2 + stage.inputs(), "{name}");
        for (number, (binding, global)) in (0..).zip(&bound) {
            assert_eq!((binding.group, binding.binding), (0, number), "{name}");
            let inner = &module.types[global.ty].inner;
            match number {
                0 => assert_eq!(global.space, AddressSpace::Uniform, "{name}"),
                1 => {
                    let TypeInner::Image {
                        arrayed,
                        class: ImageClass::Storage { format, .. },
                        ..
                    } = inner
                    else {
                        panic!("{name}: the result is no storage texture");
                    };
                    let due = match stage {
                        Stage::Relief => (true, StorageFormat::Rgba8Snorm),
                        Stage::Surface => (true, StorageFormat::Rgba8Unorm),
                        _ => (false, StorageFormat::R32Uint),
                    };
                    assert_eq!((*arrayed, *format), due, "{name}");
                }
                _ => {
                    let sampled = ImageClass::Sampled {
                        kind: ScalarKind::Uint,
                        multi: false,
                    };
                    let is_slot = matches!(inner, TypeInner::Image { arrayed: false, class, .. } if *class == sampled);
                    assert!(is_slot, "{name}: input {}", number - 2);
                }
            }
        }
    }
}
