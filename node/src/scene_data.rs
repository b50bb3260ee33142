//! Scenes in the words of `render`.
//! In: a validated scene of `protocol`, the direction to the sun. Out: the same as [`SceneData`], field by
//! field and without loss. Neither crate knows the other's types: each struct is taken apart here by name, so
//! that a field that is added on one side does not build until it is carried over.

use std::path::PathBuf;

use glam::DVec3;
use protocol::scene::{self, Atmosphere, MeshOptions, Scene};
use render::{Air, LayerData, LensData, Light, SceneData};

/// Scale heights in the height at which the air ends: at eight, density is a three-thousandth.
const SCALE_HEIGHTS: f64 = 8.0;

/// The scene as it is drawn. `sun` is the unit vector towards the sun.
pub(crate) fn scene_data(scene: &Scene, sun: DVec3) -> SceneData {
    let Scene {
        planet,
        camera: _,
        layers,
        lenses,
        light,
        atmosphere,
        mesh,
    } = scene;
    let scene::Light {
        sun: _,
        ambient,
        relief,
    } = *light;
    let MeshOptions {
        refine,
        tau,
        wireframe,
        refinement,
        tile_px,
        deepest_level,
    } = *mesh;
    SceneData {
        ellipsoid: *planet,
        layers: layers.iter().map(layer).collect(),
        lenses: lenses.iter().map(lens).collect(),
        light: Light {
            sun,
            ambient,
            relief,
        },
        air: air(atmosphere),
        refine: match refine {
            scene::Refine::Off => render::Refine::Off,
            scene::Refine::Fine => render::Refine::Fine,
            scene::Refine::BottomUp => render::Refine::BottomUp,
            scene::Refine::TopDown => render::Refine::TopDown,
        },
        tau_px: tau,
        wireframe,
        refinement,
        tile_px,
        deepest_level,
    }
}

fn air(atmosphere: &Atmosphere) -> Air {
    let Atmosphere {
        enabled,
        thickness_m,
        colour,
    } = *atmosphere;
    Air {
        thickness_m: if enabled {
            thickness_m / SCALE_HEIGHTS
        } else {
            0.0
        },
        // Pictures hold the square root of light.
        colour: colour.map(f64::sqrt),
    }
}

fn layer(layer: &scene::Layer) -> LayerData {
    let scene::Layer {
        name,
        repository,
        parameters,
    } = layer;
    LayerData {
        name: name.clone(),
        repository: repository.as_ref().map(PathBuf::from),
        parameters: layer_parameters(parameters),
    }
}

fn lens(lens: &scene::Lens) -> LensData {
    let scene::Lens {
        name,
        latitude_deg,
        longitude_deg,
        radius_m,
        layers,
    } = lens;
    LensData {
        name: name.clone(),
        latitude_deg: *latitude_deg,
        longitude_deg: *longitude_deg,
        radius_m: *radius_m,
        layers: layers.iter().map(lens_layer).collect(),
    }
}

/// Which keys the lens gives is for people: its parameters are complete.
fn lens_layer(lens_layer: &scene::LensLayer) -> (usize, render::LayerParameters) {
    let scene::LensLayer {
        layer,
        parameters,
        given: _,
    } = lens_layer;
    (*layer, layer_parameters(parameters))
}

fn layer_parameters(parameters: &scene::LayerParameters) -> render::LayerParameters {
    let scene::LayerParameters { fusion, process } = parameters;
    let scene::Fusion {
        priority,
        weight,
        opacity,
        blend,
    } = *fusion;
    render::LayerParameters {
        fusion: render::Fusion {
            priority,
            weight,
            opacity,
            blend: match blend {
                scene::Blend::Normal => render::Blend::Normal,
                scene::Blend::Multiply => render::Blend::Multiply,
                scene::Blend::Screen => render::Blend::Screen,
                scene::Blend::Add => render::Blend::Add,
            },
        },
        process: match process {
            scene::Process::Elevation(process) => render::Process::Elevation(elevation(*process)),
            scene::Process::Imagery(process) => render::Process::Imagery(imagery(*process)),
            scene::Process::Sar(process) => render::Process::Sar(sar(*process)),
            scene::Process::Ramp(process) => render::Process::Ramp(ramp(process)),
            scene::Process::Isolines(process) => render::Process::Isolines(isolines(*process)),
            scene::Process::Slope(process) => render::Process::Slope(slope(*process)),
            scene::Process::Aspect(process) => render::Process::Aspect(aspect(*process)),
            scene::Process::Hillshade(process) => render::Process::Hillshade(hillshade(*process)),
        },
    }
}

fn elevation(process: scene::Elevation) -> render::Elevation {
    let scene::Elevation {
        scale,
        offset_m,
        datum_shift_m,
        clamp_m,
    } = process;
    render::Elevation {
        scale,
        offset_m,
        datum_shift_m,
        clamp_m,
    }
}

fn imagery(process: scene::Imagery) -> render::Imagery {
    let scene::Imagery {
        exposure_stops,
        contrast,
        saturation,
        gamma,
        channels,
        range,
        tint,
    } = process;
    render::Imagery {
        exposure_stops,
        contrast,
        saturation,
        gamma,
        channels,
        range,
        tint,
    }
}

fn sar(process: scene::Sar) -> render::Sar {
    let scene::Sar {
        mapping,
        range,
        strength,
        exponent,
        tint,
    } = process;
    render::Sar {
        mapping: match mapping {
            scene::SarMapping::Linear => render::SarMapping::Linear,
            scene::SarMapping::Logarithmic => render::SarMapping::Logarithmic,
            scene::SarMapping::Gamma => render::SarMapping::Gamma,
        },
        range,
        strength,
        exponent,
        tint,
    }
}

/// A ramp's name is for people: its stops are complete.
fn ramp(process: &scene::Ramp) -> render::Ramp {
    let scene::Ramp { name: _, stops } = process;
    let stop = |stop: &scene::RampStop| {
        let scene::RampStop { height_m, colour } = *stop;
        render::RampStop { height_m, colour }
    };
    render::Ramp {
        stops: stops.iter().map(stop).collect(),
    }
}

fn isolines(process: scene::Isolines) -> render::Isolines {
    let scene::Isolines {
        spacing_m,
        width_px,
        bold_every,
        bold_width_px,
        colour,
    } = process;
    render::Isolines {
        spacing_m,
        width_px,
        bold_every,
        bold_width_px,
        colour,
    }
}

fn slope(process: scene::Slope) -> render::Slope {
    let scene::Slope {
        range_deg,
        gentle,
        steep,
    } = process;
    render::Slope {
        range_deg,
        gentle,
        steep,
    }
}

fn aspect(process: scene::Aspect) -> render::Aspect {
    let scene::Aspect {
        saturation,
        brightness,
        flat_below_deg,
    } = process;
    render::Aspect {
        saturation,
        brightness,
        flat_below_deg,
    }
}

fn hillshade(process: scene::Hillshade) -> render::Hillshade {
    let scene::Hillshade {
        azimuth_deg,
        altitude_deg,
        exaggeration,
    } = process;
    render::Hillshade {
        azimuth_deg,
        altitude_deg,
        exaggeration,
    }
}

#[cfg(test)]
mod tests;
