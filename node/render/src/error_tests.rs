//! The guarantee: no sample of any leaf in view is drawn more than τ pixels from where it belongs, measured by the
//! oracle on what the device drew. Every method, while parameters change, and where memory is short.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use crate::layer::Process;
use crate::renderer::{Renderer, ViewPoint};
use crate::scene::{Refine, SceneData};
use crate::test_planet::{CANVAS, Planet, output, picture, settle, settle_on, view, views};
use crate::{ErrorMeasure, PixelRect};

const WHOLE: PixelRect = PixelRect {
    x: 0,
    y: 0,
    width: CANVAS[0],
    height: CANVAS[1],
};

fn scene(planet: &Planet, refine: Refine, tau_px: f64) -> SceneData {
    SceneData {
        refine,
        tau_px,
        ..planet.scene()
    }
}

/// A renderer that shows this scene as revision 2.
fn renderer(planet: &Planet, data: SceneData, gpu_bytes: u64) -> Renderer {
    let mut renderer = planet.renderer(&[output(WHOLE)], gpu_bytes);
    settle(&mut renderer, &views()[0]);
    show(&mut renderer, &views()[0], data, 2);
    renderer
}

fn show(renderer: &mut Renderer, view: &ViewPoint, data: SceneData, revision: u64) {
    renderer.prepare_scene(revision, data).unwrap();
    renderer.show(revision).unwrap();
    settle_on(renderer, view, revision);
}

fn assert_within(measure: &ErrorMeasure, tau_px: f64, what: &str) {
    assert!(
        measure.samples >= 66_049,
        "{what}: nothing measured, {measure:?}"
    );
    assert_eq!(measure.uncovered, 0, "{what}: {measure:?}");
    assert!(measure.max_px <= tau_px, "{what}: {measure:?}");
}

#[test]
fn no_sample_is_further_off_than_tau() {
    let Some(planet) = Planet::new() else { return };
    for tau_px in [0.5, 1.0, 4.0] {
        let mut renderer = renderer(&planet, scene(&planet, Refine::TopDown, tau_px), 1024 << 20);
        for (index, view) in views().iter().enumerate() {
            let statistics = settle_on(&mut renderer, view, 2);
            let measure = renderer.measure_error().unwrap();
            assert_within(&measure, tau_px, &format!("view {index} at τ = {tau_px}"));
            assert_eq!(measure.tau_px, tau_px);
            assert_eq!(statistics.achieved_tau_px, tau_px);
            eprintln!(
                "τ {tau_px}, view {index}: {:.3} px, {} triangles",
                measure.max_px, measure.triangles
            );
        }
    }
}

#[test]
fn both_ways_give_one_mesh_and_all_marks_give_no_error() {
    let Some(planet) = Planet::new() else { return };
    let mut renderer = renderer(&planet, scene(&planet, Refine::TopDown, 1.0), 2048 << 20);
    let view = &views()[1];
    settle_on(&mut renderer, view, 2);
    let down = renderer.measure_error().unwrap();
    let by_down = picture(&renderer);
    show(
        &mut renderer,
        view,
        scene(&planet, Refine::BottomUp, 1.0),
        3,
    );
    let up = renderer.measure_error().unwrap();
    assert_eq!((down.triangles, down.max_px), (up.triangles, up.max_px));
    assert_eq!(by_down.rgba, picture(&renderer).rgba);
    show(&mut renderer, view, scene(&planet, Refine::Fine, 1.0), 4);
    let fine = renderer.measure_error().unwrap();
    assert_within(&fine, 0.02, "every sample is a vertex");
    assert!(fine.triangles > 4 * down.triangles);
    let mut coarse = scene(&planet, Refine::Off, 1.0);
    coarse.refinement = 0;
    // Or it would be divided until its patches are as fine as the data.
    coarse.deepest_level = 2;
    show(&mut renderer, view, coarse, 5);
    let off = renderer.measure_error().unwrap();
    assert_eq!(off.uncovered, 0);
    assert!(
        off.max_px > 1.0,
        "the base patch happens to be as good: {off:?}"
    );
}

#[test]
fn a_mesh_serves_while_the_view_barely_moves() {
    let Some(planet) = Planet::new() else { return };
    let mut renderer = renderer(&planet, scene(&planet, Refine::TopDown, 1.0), 1024 << 20);
    let mut refined = 0;
    for step in 0..50 {
        let moved = view(-5.0 + f64::from(step) * 1e-5, 44.0, 4e5, -12.0);
        settle_on(&mut renderer, &moved, 2);
        let statistics = renderer.draw_shown(&moved, 2).unwrap();
        if step > 0 {
            refined += statistics.refined_leaves;
        }
        assert_within(&renderer.measure_error().unwrap(), 1.0, "moved");
    }
    assert!(refined < 50, "{refined} meshes made anew in 50 frames");
}

#[test]
fn the_bound_holds_in_every_frame_while_heights_change() {
    let Some(planet) = Planet::new() else { return };
    let mut renderer = renderer(&planet, scene(&planet, Refine::TopDown, 1.0), 1024 << 20);
    for (index, view) in views().iter().enumerate() {
        settle_on(&mut renderer, view, 2 + index as u64 * 10);
        for change in 1..10_u64 {
            let mut data = scene(&planet, Refine::TopDown, 1.0);
            for layer in &mut data.layers {
                if let Process::Elevation(elevation) = &mut layer.parameters.process {
                    elevation.scale = 0.3 + change as f64 * 0.4;
                    elevation.offset_m = change as f64 * 100.0;
                }
            }
            let revision = 2 + index as u64 * 10 + change;
            renderer.prepare_scene(revision, data).unwrap();
            // Shown at once: most of it is not there yet.
            renderer.draw(view, revision).unwrap();
            let measure = renderer.measure_error().unwrap();
            assert_within(&measure, 1.0, &format!("view {index}, change {change}"));
        }
        let next = 2 + (index as u64 + 1) * 10;
        show(
            &mut renderer,
            view,
            scene(&planet, Refine::TopDown, 1.0),
            next,
        );
    }
}

#[test]
fn where_meshes_do_not_fit_tau_grows_by_whole_steps_and_says_so() {
    let Some(planet) = Planet::new() else { return };
    let tau_px = 0.05;
    let mut renderer = renderer(&planet, scene(&planet, Refine::TopDown, tau_px), 16 << 20);
    let view = &views()[4];
    let statistics = settle_on(&mut renderer, view, 2);
    let measure = renderer.measure_error().unwrap();
    let steps = statistics.achieved_tau_px / tau_px;
    assert!(steps > 1.5, "everything fitted: {statistics:?}");
    assert!((steps - steps.round()).abs() < 1e-9, "{steps}");
    assert_within(&measure, statistics.achieved_tau_px, "over budget");
}
