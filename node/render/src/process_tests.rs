//! Live changes of a made-up planet's layers: what a change shows does not depend on what was shown before, nothing
//! of it shows early, lenses show their parameters inside and the scene's outside. Needs a device, as in `device_tests`.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::time::{Duration, Instant};

use glam::DVec3;

use crate::canvas::PixelRect;
use crate::layer::{Blend, Hillshade, Imagery, Isolines, LensData, Process, Ramp, RampStop, Slope};
use crate::renderer::{Renderer, ViewPoint};
use crate::scene::SceneData;
use crate::target::Picture;
use crate::test_planet::{
    CANVAS, COLOURS, HEIGHTS, Planet, output, picture, plain, repository, settle_on, views,
};

const COLOUR_LAYER: usize = 0;
const HEIGHT_LAYER: usize = 1;

fn whole() -> PixelRect {
    PixelRect {
        x: 0,
        y: 0,
        width: CANVAS[0],
        height: CANVAS[1],
    }
}

/// The picture that a new renderer makes of a scene.
fn fresh(planet: &Planet, scene: SceneData, view: &ViewPoint) -> Picture {
    let mut renderer = planet.renderer(&[output(whole())], 64 << 20);
    renderer.prepare_scene(2, scene).unwrap();
    settle_on(&mut renderer, view, 2);
    picture(&renderer)
}

/// Draws revision `shown` until `revision` is prepared; every picture on the way must be `before`.
fn prepare(
    renderer: &mut Renderer,
    view: &ViewPoint,
    shown: u64,
    revision: u64,
    before: &Picture,
) -> u32 {
    let start = Instant::now();
    let mut frames = 0;
    loop {
        let statistics = renderer.draw(view, shown).unwrap();
        frames += 1;
        assert!(
            picture(renderer).rgba == before.rgba,
            "frame {frames} shows something of the change"
        );
        if statistics.prepared == Some(revision) {
            return frames;
        }
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "never prepared: {statistics:?}"
        );
    }
}

fn with(planet: &Planet, change: impl FnOnce(&mut SceneData)) -> SceneData {
    let mut scene = planet.scene();
    change(&mut scene);
    scene
}

/// Scenes that differ from the planet's own in one way each.
fn changes(planet: &Planet) -> Vec<(&'static str, SceneData)> {
    let from_heights = |process| plain("z", None, process);
    let over = |scene: &mut SceneData, process, blend| {
        let mut layer = from_heights(process);
        layer.parameters.fusion.priority = 1;
        layer.parameters.fusion.blend = blend;
        scene.layers.push(layer);
    };
    let ramp = Process::Ramp(Ramp {
        stops: vec![
            RampStop {
                height_m: -6000.0,
                colour: [0.1, 0.1, 0.5],
            },
            RampStop {
                height_m: 6000.0,
                colour: [1.0, 0.9, 0.6],
            },
        ],
    });
    vec![
        (
            "exposure",
            with(planet, |scene| {
                scene.layers[COLOUR_LAYER].parameters.process = Process::Imagery(Imagery {
                    exposure_stops: 0.7,
                    tint: [1.0, 0.6, 0.4],
                    ..COLOURS
                });
            }),
        ),
        (
            "opacity",
            with(planet, |scene| {
                scene.layers[COLOUR_LAYER].parameters.fusion.opacity = 0.4;
            }),
        ),
        (
            "scale",
            with(planet, |scene| {
                scene.layers[HEIGHT_LAYER].parameters.process =
                    Process::Elevation(crate::layer::Elevation {
                        scale: 8.0,
                        offset_m: 500.0,
                        ..HEIGHTS
                    });
            }),
        ),
        (
            "no imagery",
            with(planet, |scene| {
                scene.layers[COLOUR_LAYER].parameters.fusion.weight = 0.0;
            }),
        ),
        (
            "ramp",
            with(planet, |scene| over(scene, ramp, Blend::Normal)),
        ),
        (
            "isolines",
            with(planet, |scene| {
                let lines = Isolines {
                    spacing_m: 1000.0,
                    width_px: 1.5,
                    bold_every: 5,
                    bold_width_px: 3.0,
                    colour: [0.0; 3],
                };
                over(scene, Process::Isolines(lines), Blend::Normal);
            }),
        ),
        (
            "slope",
            with(planet, |scene| {
                let slope = Slope {
                    range_deg: [0.0, 2.0],
                    gentle: [1.0; 3],
                    steep: [0.5, 0.0, 0.0],
                };
                over(scene, Process::Slope(slope), Blend::Multiply);
            }),
        ),
        (
            "hillshade",
            with(planet, |scene| {
                let shade = Hillshade {
                    azimuth_deg: 315.0,
                    altitude_deg: 45.0,
                    exaggeration: 20.0,
                };
                over(scene, Process::Hillshade(shade), Blend::Multiply);
            }),
        ),
    ]
}

#[test]
fn a_change_shows_at_once_and_whole_and_as_if_nothing_else_had_ever_been() {
    let Some(planet) = Planet::new() else { return };
    let view = &views()[0];
    let mut renderer = planet.renderer(&[output(whole())], 64 << 20);
    settle_on(&mut renderer, view, 1);
    let mut before = picture(&renderer);
    let mut shown = 1;
    for (name, scene) in changes(&planet) {
        let revision = shown + 1;
        renderer.prepare_scene(revision, scene.clone()).unwrap();
        prepare(&mut renderer, view, shown, revision, &before);
        let statistics = renderer.draw(view, revision).unwrap();
        assert!(
            statistics.redrawn && statistics.converged,
            "{name}: {statistics:?}"
        );
        assert_eq!(
            (statistics.processed_tiles, statistics.meshes_built),
            (0, 0),
            "{name}: all was there"
        );
        let after = picture(&renderer);
        assert!(after.rgba != before.rgba, "{name} changes the picture");
        assert!(
            after.rgba == fresh(&planet, scene, view).rgba,
            "{name} depends on what was before"
        );
        (before, shown) = (after, revision);
    }
}

#[test]
fn what_was_made_once_is_found_again() {
    let Some(planet) = Planet::new() else { return };
    let view = &views()[1];
    let mut renderer = planet.renderer(&[output(whole())], 64 << 20);
    settle_on(&mut renderer, view, 1);
    let before = picture(&renderer);
    let brighter = changes(&planet).remove(0).1;
    renderer.prepare_scene(2, brighter).unwrap();
    assert!(prepare(&mut renderer, view, 1, 2, &before) > 0);
    settle_on(&mut renderer, view, 2);
    renderer.prepare_scene(3, planet.scene()).unwrap();
    let statistics = renderer.draw(view, 2).unwrap();
    assert_eq!(
        (statistics.prepared, statistics.processed_tiles),
        (Some(3), 0)
    );
    renderer.draw(view, 3).unwrap();
    assert!(picture(&renderer).rgba == before.rgba);
}

#[test]
fn a_scene_that_cannot_be_shown_changes_nothing() {
    let Some(planet) = Planet::new() else { return };
    let view = &views()[0];
    let mut renderer = planet.renderer(&[output(whole())], 64 << 20);
    settle_on(&mut renderer, view, 1);
    let before = picture(&renderer);
    let missing = with(&planet, |scene| {
        scene.layers[0].repository = Some("/nowhere/at/all".into());
    });
    let error = renderer.prepare_scene(2, missing).unwrap_err().to_string();
    assert!(
        error.contains("colours") && error.contains("/nowhere/at/all"),
        "{error}"
    );
    let channels = with(&planet, |scene| {
        scene.layers[0].parameters.process = Process::Imagery(Imagery {
            channels: [0, 1, 7],
            ..COLOURS
        });
    });
    let error = renderer.prepare_scene(2, channels).unwrap_err().to_string();
    assert!(error.contains("no channel 7"), "{error}");
    assert!(
        renderer.draw(view, 2).is_err(),
        "revision 2 was never taken"
    );
    renderer.draw(view, 1).unwrap();
    assert!(picture(&renderer).rgba == before.rgba);
}

fn lens(radius_m: f64, parameters: Vec<(usize, crate::layer::LayerParameters)>) -> LensData {
    LensData {
        name: "lens".to_owned(),
        latitude_deg: 20.0,
        longitude_deg: 10.0,
        radius_m,
        layers: parameters,
    }
}

/// Pixels of two pictures that are equal: everything inside a circle on the ground, and everything outside.
fn compare_by_ground(
    renderer: &Renderer,
    picture: &Picture,
    inside: &Picture,
    outside: &Picture,
    radius_m: f64,
    margin_m: f64,
) -> [usize; 3] {
    let planet = geodesy::Ellipsoid::EARTH;
    let centre = planet.point(geodesy::Ellipsoid::normal(20.0, 10.0), 0.0);
    let mut counts = [0; 3];
    for y in 0..CANVAS[1] {
        for x in 0..CANVAS[0] {
            let ground = renderer.ground_under(0, [f64::from(x) + 0.5, f64::from(y) + 0.5]);
            let distance = ground.map_or(f64::INFINITY, |[latitude, longitude]| {
                let at: DVec3 = planet.point(geodesy::Ellipsoid::normal(latitude, longitude), 0.0);
                at.distance(centre)
            });
            let first = ((y * CANVAS[0] + x) * 4) as usize;
            let pixel = |picture: &Picture| picture.rgba[first..first + 4].to_vec();
            let shown = pixel(picture);
            if distance < radius_m - margin_m {
                assert_eq!(shown, pixel(inside), "pixel {x},{y} lies inside");
                counts[0] += 1;
            } else if distance > radius_m + margin_m {
                assert_eq!(shown, pixel(outside), "pixel {x},{y} lies outside");
                counts[1] += 1;
            } else {
                counts[2] += 1;
            }
        }
    }
    counts
}

#[test]
fn a_lens_shows_its_parameters_inside_and_the_scene_s_outside() {
    let Some(planet) = Planet::new() else { return };
    let view = &views()[0];
    let (radius_m, margin_m) = (2.5e6, 1.5e5);
    for (name, changed) in changes(&planet)
        .into_iter()
        .filter(|(name, _)| *name != "scale")
    {
        // All layers stand in both scenes; outside the lens the added one has no weight.
        let mut scene = changed.clone();
        let within: Vec<_> = changed
            .layers
            .iter()
            .map(|l| l.parameters.clone())
            .enumerate()
            .collect();
        for (layer, own) in scene.layers.iter_mut().zip(planet.scene().layers) {
            layer.parameters = own.parameters;
        }
        if let Some(added) = scene.layers.get_mut(2) {
            added.parameters.fusion.weight = 0.0;
        }
        scene.lenses.push(lens(radius_m, within));
        let mut renderer = planet.renderer(&[output(whole())], 64 << 20);
        renderer.prepare_scene(2, scene).unwrap();
        settle_on(&mut renderer, view, 2);
        let shown = picture(&renderer);
        // The circle of ground on the straight line; the rim itself is as wide as samples and meshes make it.
        let counts = compare_by_ground(
            &renderer,
            &shown,
            &fresh(&planet, changed, view),
            &fresh(&planet, planet.scene(), view),
            radius_m,
            margin_m,
        );
        assert!(
            counts.iter().all(|count| *count > 500),
            "{name}: {counts:?}"
        );
    }
}

#[test]
fn equal_layers_in_any_order_and_layers_without_weight_make_the_same_picture() {
    let Some(planet) = Planet::new() else { return };
    let view = &views()[0];
    let grey = Process::Imagery(Imagery {
        saturation: 0.0,
        ..COLOURS
    });
    let scene = |order: [usize; 3]| {
        let mut scene = planet.scene();
        let repository = scene.layers[COLOUR_LAYER].repository.clone();
        let mut layers = [
            plain("a", repository.as_ref(), Process::Imagery(COLOURS)),
            plain("b", repository.as_ref(), grey.clone()),
            plain("c", repository.as_ref(), grey.clone()),
        ];
        layers[1].parameters.fusion.weight = 2.0;
        layers[2].parameters.fusion.weight = 0.0;
        layers[2].parameters.fusion.priority = 9;
        scene
            .layers
            .extend(order.map(|index| layers[index].clone()));
        scene
    };
    let first = fresh(&planet, scene([0, 1, 2]), view);
    let second = fresh(&planet, scene([2, 1, 0]), view);
    let difference = |a: &Picture, b: &Picture| {
        let pairs = a.rgba.iter().zip(&b.rgba);
        pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    };
    assert!(difference(&first, &second) <= 1);
    assert!(
        difference(&first, &fresh(&planet, planet.scene(), view)) > 8,
        "b shows"
    );
}

#[test]
fn data_of_an_added_layer_is_opened_beside_the_frames() {
    let Some(planet) = Planet::new() else { return };
    let view = &views()[0];
    let (_folder, path) = repository(tiles::Kind::Imagery);
    let mut renderer = planet.renderer(&[output(whole())], 64 << 20);
    settle_on(&mut renderer, view, 1);
    let before = picture(&renderer);
    let scene = with(&planet, |scene| {
        let process = Process::Imagery(Imagery {
            tint: [1.0, 0.5, 0.5],
            ..COLOURS
        });
        let mut added = plain("added", Some(&path), process);
        added.parameters.fusion.priority = 1;
        scene.layers.push(added);
    });
    let start = Instant::now();
    let mut asked = 0;
    while !renderer.open_ahead(&scene) {
        asked += 1;
        renderer.draw(view, 1).unwrap();
        assert!(start.elapsed() < Duration::from_secs(60), "never opened");
    }
    assert!(asked > 0, "it is opened by another thread");
    assert!(renderer.open_ahead(&scene), "what is open stays open");
    renderer.prepare_scene(2, scene.clone()).unwrap();
    prepare(&mut renderer, view, 1, 2, &before);
    settle_on(&mut renderer, view, 2);
    assert!(picture(&renderer).rgba == fresh(&planet, scene, view).rgba);
}
