//! A scene with a value of its own in every field, and what is drawn of it.
//! In: nothing. Out: nothing; a value that is lost or in another field fails.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

use super::*;

const SCENE: &str = r#"
[camera]
mode = "orbit"
place = { latitude_deg = 20.0, longitude_deg = 10.0, altitude_m = 12e6, pitch_deg = -90.0 }
centre = { latitude_deg = 90.0, longitude_deg = 0.0 }
degrees_per_second = 10.0

[light]
ambient = 0.21
relief = 2.5

[atmosphere]
thickness_m = 64000.0
colour = [0.25, 0.36, 0.49]

[mesh]
refine = "bottom-up"
tau = 2.5
wireframe = true
refinement = 5
tile_px = 300.0
deepest_level = 17

[layers.a-height]
kind = "elevation"
repository = "/data/relief"
priority = -3
weight = 1.5
opacity = 0.5
blend = "multiply"
scale = 1.25
offset_m = 11.0
datum_shift_m = -7.0
clamp_m = [-12000.0, 9000.0]

[layers.b-picture]
kind = "imagery"
repository = "/data/picture"
blend = "screen"
exposure_stops = 0.75
contrast = 1.1
saturation = 1.2
gamma = 2.2
channels = [2, 1, 3]
range = [5.0, 250.0]
tint = [0.9, 0.8, 0.7]

[layers.c-radar]
kind = "sar"
repository = "/data/radar"
blend = "add"
mapping = "gamma"
range = [1.0, 400.0]
strength = 50.0
exponent = 0.6
tint = [0.1, 0.2, 0.3]

[layers.d-ramp]
kind = "ramp"
stops = [{ height_m = -5000.0, colour = [0.0, 0.1, 0.4] }, { height_m = 10.0, colour = [0.2, 0.3, 0.5] }]

[layers.e-lines]
kind = "isolines"
spacing_m = 250.0
width_px = 1.5
bold_every = 4
bold_width_px = 3.0
colour = [0.6, 0.7, 0.8]

[layers.f-slope]
kind = "slope"
range_deg = [3.0, 33.0]
gentle = [0.11, 0.12, 0.13]
steep = [0.14, 0.15, 0.16]

[layers.g-aspect]
kind = "aspect"
saturation = 0.71
brightness = 0.72
flat_below_deg = 1.5

[layers.h-shade]
kind = "hillshade"
azimuth_deg = 123.0
altitude_deg = 34.0
exaggeration = 1.75

[layers.i-named]
kind = "ramp"
ramp = "hypsometric"

[lenses.eye]
latitude_deg = 46.0
longitude_deg = 7.0
radius_m = 12000.0
[lenses.eye.layers.e-lines]
spacing_m = 20.0
[lenses.eye.layers.a-height]
scale = 3.0
"#;

#[test]
fn every_value_of_a_scene_is_drawn() {
    let scene = Scene::parse(SCENE, "test").unwrap();
    let sun = DVec3::new(0.6, 0.0, 0.8);
    let data = scene_data(&scene, sun);
    assert_eq!(data.ellipsoid, scene.planet);
    assert_eq!(
        data.light,
        Light {
            sun,
            ambient: 0.21,
            relief: 2.5
        }
    );
    assert_eq!(
        data.air,
        Air {
            thickness_m: 8_000.0,
            colour: [0.5, 0.6, 0.7]
        }
    );
    assert_eq!(
        (data.refinement, data.tile_px, data.deepest_level),
        (5, 300.0, 17)
    );
    assert_eq!(
        (data.refine, data.tau_px, data.wireframe),
        (render::Refine::BottomUp, 2.5, true)
    );
    for (name, refine) in [
        ("off", render::Refine::Off),
        ("fine", render::Refine::Fine),
        ("top-down", render::Refine::TopDown),
    ] {
        let text = SCENE.replacen("bottom-up", name, 1);
        let scene = Scene::parse(&text, "test").unwrap();
        assert_eq!(scene_data(&scene, sun).refine, refine);
    }
    let names: Vec<&str> = data
        .layers
        .iter()
        .map(|layer| layer.name.as_str())
        .collect();
    let known: Vec<&str> = scene
        .layers
        .iter()
        .map(|layer| layer.name.as_str())
        .collect();
    assert_eq!(names, known);
    let repositories: Vec<Option<PathBuf>> = data
        .layers
        .iter()
        .map(|layer| layer.repository.clone())
        .collect();
    assert_eq!(repositories[0], Some(PathBuf::from("/data/relief")));
    assert_eq!(repositories[2], Some(PathBuf::from("/data/radar")));
    assert!(repositories[3..].iter().all(Option::is_none));

    let process = |index: usize| data.layers[index].parameters.process.clone();
    let fusions: Vec<render::Fusion> = data
        .layers
        .iter()
        .map(|layer| layer.parameters.fusion)
        .collect();
    assert_eq!(
        fusions[0],
        render::Fusion {
            priority: -3,
            weight: 1.5,
            opacity: 0.5,
            blend: render::Blend::Multiply
        }
    );
    assert_eq!(fusions[1].blend, render::Blend::Screen);
    assert_eq!(fusions[2].blend, render::Blend::Add);
    assert_eq!(fusions[3].blend, render::Blend::Normal);
    assert_eq!(
        process(0),
        render::Process::Elevation(render::Elevation {
            scale: 1.25,
            offset_m: 11.0,
            datum_shift_m: -7.0,
            clamp_m: [-12_000.0, 9_000.0]
        })
    );
    assert_eq!(
        process(1),
        render::Process::Imagery(render::Imagery {
            exposure_stops: 0.75,
            contrast: 1.1,
            saturation: 1.2,
            gamma: 2.2,
            channels: [2, 1, 3],
            range: Some([5.0, 250.0]),
            tint: [0.9, 0.8, 0.7]
        })
    );
    assert_eq!(
        process(2),
        render::Process::Sar(render::Sar {
            mapping: render::SarMapping::Gamma,
            range: Some([1.0, 400.0]),
            strength: 50.0,
            exponent: 0.6,
            tint: [0.1, 0.2, 0.3]
        })
    );
    let stop = |height_m, colour| render::RampStop { height_m, colour };
    assert_eq!(
        process(3),
        render::Process::Ramp(render::Ramp {
            stops: vec![stop(-5_000.0, [0.0, 0.1, 0.4]), stop(10.0, [0.2, 0.3, 0.5])]
        })
    );
    assert_eq!(
        process(4),
        render::Process::Isolines(render::Isolines {
            spacing_m: 250.0,
            width_px: 1.5,
            bold_every: 4,
            bold_width_px: 3.0,
            colour: [0.6, 0.7, 0.8]
        })
    );
    assert_eq!(
        process(5),
        render::Process::Slope(render::Slope {
            range_deg: [3.0, 33.0],
            gentle: [0.11, 0.12, 0.13],
            steep: [0.14, 0.15, 0.16]
        })
    );
    assert_eq!(
        process(6),
        render::Process::Aspect(render::Aspect {
            saturation: 0.71,
            brightness: 0.72,
            flat_below_deg: 1.5
        })
    );
    assert_eq!(
        process(7),
        render::Process::Hillshade(render::Hillshade {
            azimuth_deg: 123.0,
            altitude_deg: 34.0,
            exaggeration: 1.75
        })
    );
    let named = match process(8) {
        render::Process::Ramp(ramp) => ramp.stops.len(),
        other => panic!("{other:?}"),
    };
    assert!(named >= 2, "a named ramp comes with its stops");
}

#[test]
fn a_lens_has_all_parameters_of_its_layers() {
    let scene = Scene::parse(SCENE, "test").unwrap();
    let data = scene_data(&scene, DVec3::X);
    let [lens] = data.lenses.as_slice() else {
        panic!("{:?}", data.lenses);
    };
    assert_eq!(
        (
            lens.name.as_str(),
            lens.latitude_deg,
            lens.longitude_deg,
            lens.radius_m
        ),
        ("eye", 46.0, 7.0, 12_000.0)
    );
    let of = |index: usize| {
        let found = lens.layers.iter().find(|(layer, _)| *layer == index);
        found.map(|(_, parameters)| parameters.clone()).unwrap()
    };
    assert_eq!(lens.layers.len(), 2);
    let mut heights = data.layers[0].parameters.clone();
    if let render::Process::Elevation(elevation) = &mut heights.process {
        elevation.scale = 3.0;
    }
    assert_eq!(of(0), heights);
    let mut lines = data.layers[4].parameters.clone();
    if let render::Process::Isolines(isolines) = &mut lines.process {
        isolines.spacing_m = 20.0;
    }
    assert_eq!(of(4), lines);
}

#[test]
fn air_that_is_switched_off_has_no_thickness() {
    let off = SCENE.replace("[atmosphere]", "[atmosphere]\nenabled = false");
    let data = scene_data(&Scene::parse(&off, "test").unwrap(), DVec3::X);
    assert_eq!(data.air.thickness_m, 0.0);
}
