//! What `verify --error` has found: the largest error, figures by height and moment, and the view to look at.
//!
//! In: measured pictures. Out: the JSON report, a table, and the sentence that says whether the bound holds. It measures
//! nothing.

use protocol::message::ErrorMeasured;
use protocol::report::{ErrorReport, Max};
use protocol::{Place, Scene};
use serde::Serialize;
use serde_json::Value;

use crate::failure::Failure;
use crate::output;

use super::survey::{Measured, Moment};

/// Names of classes of views, and the height above ground in metres from which on a view belongs to the class.
const CLASSES: [(&str, f64); 4] = [
    ("from space, 1000 km and more", 1e6),
    ("10 km to 1000 km", 1e4),
    ("100 m to 10 km", 100.0),
    ("below 100 m", f64::NEG_INFINITY),
];
/// The class of the scene's own views.
const OWN: &str = "the scene's own";

/// The report.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Findings {
    pub(super) wall: String,
    pub(super) scene: String,
    pub(super) seed: u64,
    /// Views that were looked from, ground in view or not.
    pub(super) looked_from: u32,
    /// Pictures that were measured: several of each view, and of each host.
    pub(super) pictures: u64,
    pub(super) error_px: ErrorReport,
    /// The largest τ that the meshes of any picture kept; none where meshes keep none.
    pub(super) achieved_tau: Option<f64>,
    pub(super) refined_leaves: u64,
    pub(super) triangles: Max,
    pub(super) classes: Vec<Class>,
    /// The picture with the largest error; one with holes before all others.
    pub(super) worst: Option<Worst>,
}

/// Views of one class.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Class {
    name: &'static str,
    views: u32,
    pictures: u64,
    samples: u64,
    uncovered: u64,
    triangles_max: u64,
    changing_max: Option<f64>,
    arriving_max: Option<f64>,
    settled_max: Option<f64>,
}

/// A picture, and how to see it again.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Worst {
    measured_max: f64,
    uncovered: u64,
    /// The τ that its meshes kept.
    achieved_tau: f64,
    host: String,
    moment: &'static str,
    /// Tile and node of the sample.
    at: String,
    /// The line of a scene's camera.
    place: String,
    /// What differs from the scene, as a merge patch.
    patch: Value,
}

/// A view, as far as findings tell of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Looked<'a> {
    /// Height above ground; none for the scene's own views.
    pub(super) height_m: Option<f64>,
    pub(super) host: &'a str,
    pub(super) patch: &'a Value,
}

impl Findings {
    pub(super) fn new(wall: String, scene_file: String, seed: u64, scene: &Scene) -> Self {
        let names = [OWN].into_iter().chain(CLASSES.map(|(name, _)| name));
        let class = |name| Class {
            name,
            ..Class::default()
        };
        Self {
            wall,
            scene: scene_file,
            seed,
            looked_from: 0,
            pictures: 0,
            error_px: ErrorReport::new(scene.mesh.tau),
            achieved_tau: None,
            refined_leaves: 0,
            triangles: Max::default(),
            classes: names.map(class).collect(),
            worst: None,
        }
    }

    /// Counts a view once, whatever the number of hosts. `seen` tells whether ground was in view on any of them.
    pub(super) fn view(&mut self, height_m: Option<f64>, seen: bool) {
        self.looked_from += 1;
        self.error_px.views += u64::from(seen);
        if let Some(class) = self.class(height_m) {
            class.views += 1;
        }
    }

    /// Adds a picture of a view.
    pub(super) fn add(&mut self, looked: Looked<'_>, measured: &Measured) {
        let measure = &measured.measure;
        let views = self.error_px.views;
        self.error_px.add(&ErrorMeasured {
            max_px: measure.max_px,
            samples: measure.samples,
            uncovered: measure.uncovered,
            tau_px: measure.tau_px,
        });
        self.error_px.views = views;
        self.pictures += 1;
        self.refined_leaves += u64::from(measured.drawn.refined_leaves);
        self.triangles.max = self.triangles.max.max(measured.drawn.triangles);
        let tau_px = measure.tau_px.max(measured.drawn.achieved_tau_px);
        if tau_px > 0.0 {
            self.achieved_tau = Some(self.achieved_tau.unwrap_or(0.0).max(tau_px));
        }
        if let Some(class) = self.class(looked.height_m) {
            class.add(measured);
        }
        let rank = |uncovered: u64, max_px: f64| (uncovered > 0, max_px);
        let this = rank(measure.uncovered, measure.max_px);
        let is_worse = self
            .worst
            .as_ref()
            .is_none_or(|worst| this > rank(worst.uncovered, worst.measured_max));
        if (measure.samples > 0 || measure.uncovered > 0) && is_worse {
            self.worst = Some(Worst::new(looked, measured));
        }
    }

    fn class(&mut self, height_m: Option<f64>) -> Option<&mut Class> {
        let name = height_m.map_or(OWN, |height_m| {
            let mut classes = CLASSES.iter();
            let found = classes.find(|(_, lowest_m)| height_m >= *lowest_m);
            found.map_or(OWN, |(name, _)| name)
        });
        self.classes.iter_mut().find(|class| class.name == name)
    }

    /// Prints the table.
    pub(super) fn print(&self) -> Result<(), Failure> {
        let pixels = |max_px: Option<f64>| max_px.map_or("–".to_owned(), |px| format!("{px:.3}"));
        let rows = self.classes.iter().filter(|class| class.views > 0);
        let rows: Vec<Vec<String>> = rows
            .map(|class| {
                vec![
                    class.name.to_owned(),
                    class.views.to_string(),
                    class.pictures.to_string(),
                    pixels(class.changing_max),
                    pixels(class.arriving_max),
                    pixels(class.settled_max),
                    class.samples.to_string(),
                    class.uncovered.to_string(),
                    class.triangles_max.to_string(),
                ]
            })
            .collect();
        let head = [
            "largest error in pixels",
            "views",
            "pictures",
            "changing",
            "arriving",
            "settled",
            "samples",
            "uncovered",
            "triangles",
        ];
        output::table(&head, &rows)?;
        let error = &self.error_px;
        output::line(format!(
            "τ = {}: the largest error of {} samples in {} pictures is {} pixels; {} samples lie under no triangle",
            error.tau,
            error.samples,
            self.pictures,
            pixels(error.measured_max),
            error.uncovered
        ))?;
        if let Some(achieved) = self.achieved_tau.filter(|achieved| *achieved > error.tau) {
            output::line(format!(
                "The memory for meshes allowed no less than τ = {achieved} in some pictures: raise cache.gpu_mib"
            ))?;
        }
        Ok(())
    }

    /// Whether the bound holds.
    ///
    /// # Errors
    /// It does not, or nothing was measured: what to look at.
    pub(super) fn judge(&self, scene: &Scene) -> Result<(), Failure> {
        let error = &self.error_px;
        if error.holds() {
            return Ok(());
        }
        let Some(worst) = &self.worst else {
            return Err(Failure::failed(format!(
                "nothing was measured: no ground is in view from any of {} views; ask for more --views, or let the \
                 scene's camera look at the planet",
                self.looked_from
            )));
        };
        let what = if error.uncovered > 0 {
            format!(
                "{} samples lie under no triangle: the mesh has holes",
                error.uncovered
            )
        } else {
            format!(
                "the drawn surface is off by {} pixels where τ is {}",
                worst.measured_max, error.tau
            )
        };
        let why = if !scene.mesh.refine.is_bounded() {
            "; the scene's mesh.refine bounds no error: write \"top-down\""
        } else if error.uncovered == 0 && worst.measured_max <= worst.achieved_tau {
            "; the memory for meshes allowed no less: raise cache.gpu_mib, or write a larger mesh.tau"
        } else {
            ""
        };
        let again = worst.sentence();
        Err(Failure::failed(format!("{what}{why}. {again}")))
    }
}

impl Class {
    fn add(&mut self, measured: &Measured) {
        let measure = &measured.measure;
        self.pictures += 1;
        self.samples += measure.samples;
        self.uncovered += measure.uncovered;
        self.triangles_max = self.triangles_max.max(measured.drawn.triangles);
        let largest = match measured.moment {
            Moment::Changing => &mut self.changing_max,
            Moment::Arriving => &mut self.arriving_max,
            Moment::Settled => &mut self.settled_max,
        };
        if measure.samples > 0 {
            *largest = Some(largest.unwrap_or(0.0).max(measure.max_px));
        }
    }
}

impl Worst {
    fn new(looked: Looked<'_>, measured: &Measured) -> Self {
        let measure = &measured.measure;
        Self {
            measured_max: measure.max_px,
            uncovered: measure.uncovered,
            achieved_tau: measure.tau_px,
            host: looked.host.to_owned(),
            moment: measured.moment.name(),
            at: measure.worst.map_or(String::new(), |(tile, [x, y])| {
                format!("tile {tile}, node {x}, {y}")
            }),
            place: place_line(&measured.place),
            patch: looked.patch.clone(),
        }
    }

    /// How to see it again.
    fn sentence(&self) -> String {
        let patch = if self.patch.is_null() {
            String::new()
        } else {
            format!(", the scene changed by {}", self.patch)
        };
        let at = if self.at.is_empty() {
            String::new()
        } else {
            format!(", at {}", self.at)
        };
        format!(
            "Seen on host \"{}\", {}{at}, from {}{patch}",
            self.host, self.moment, self.place
        )
    }
}

/// The line of a scene's camera, to the last digit.
fn place_line(place: &Place) -> String {
    let Place {
        latitude_deg,
        longitude_deg,
        altitude_m,
        heading_deg,
        pitch_deg,
        roll_deg,
    } = *place;
    format!(
        "place = {{ latitude_deg = {latitude_deg:?}, longitude_deg = {longitude_deg:?}, altitude_m = {altitude_m:?}, \
         heading_deg = {heading_deg:?}, pitch_deg = {pitch_deg:?}, roll_deg = {roll_deg:?} }}"
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use node::{Drawn, ErrorMeasure};
    use serde_json::json;

    const PLACE: Place = Place {
        latitude_deg: 45.1,
        longitude_deg: -7.0,
        altitude_m: 1_234.567_890_123,
        heading_deg: 0.0,
        pitch_deg: -12.5,
        roll_deg: 0.0,
    };

    fn scene(mesh: &str) -> Scene {
        let text = format!(
            "layers = {{}}\n[camera]\nmode = \"fixed\"\n{}\n[mesh]\n{mesh}\n",
            place_line(&PLACE)
        );
        Scene::parse(&text, "test").unwrap()
    }

    fn measured(max_px: f64, tau_px: f64, samples: u64, uncovered: u64) -> Measured {
        Measured {
            moment: Moment::Arriving,
            place: PLACE,
            drawn: Drawn::default(),
            measure: ErrorMeasure {
                max_px,
                tau_px,
                samples,
                uncovered,
                ..ErrorMeasure::default()
            },
        }
    }

    /// The verdict on pictures of one view.
    fn verdict(scene: &Scene, pictures: &[Measured]) -> Result<Findings, String> {
        let mut findings = Findings::new("wall".into(), "scene".into(), 1, scene);
        let patch = json!({ "layers": { "relief": { "scale": 2.5 } } });
        for measured in pictures {
            let looked = Looked {
                height_m: Some(50.0),
                host: "left",
                patch: &patch,
            };
            findings.add(looked, measured);
        }
        let seen = pictures.iter().any(|measured| measured.measure.samples > 0);
        findings.view(Some(50.0), seen);
        let judged = findings.judge(scene);
        judged
            .map(|()| findings)
            .map_err(|failure| failure.to_string())
    }

    #[test]
    fn a_place_survives_as_a_line_of_a_scene() {
        assert_eq!(scene("").camera, protocol::Camera::Fixed(PLACE));
    }

    #[test]
    fn a_bound_that_holds_is_no_failure() {
        let scene = scene("tau = 0.5");
        let pictures = [measured(0.5, 0.5, 10, 0), measured(0.25, 0.5, 20, 0)];
        let findings = verdict(&scene, &pictures).unwrap();
        assert_eq!(findings.error_px.measured_max, Some(0.5));
        assert_eq!(
            (findings.error_px.views, findings.error_px.samples),
            (1, 30)
        );
        assert_eq!((findings.pictures, findings.looked_from), (2, 1));
        assert_eq!(findings.achieved_tau, Some(0.5));
        let class = findings.classes.last().unwrap();
        assert_eq!((class.views, class.pictures, class.samples), (1, 2, 30));
        assert_eq!((class.arriving_max, class.settled_max), (Some(0.5), None));
    }

    #[test]
    fn a_view_that_breaks_the_bound_is_named() {
        let bounded = scene("tau = 0.5");
        let broken = [measured(0.25, 0.5, 10, 0), measured(0.51, 0.5, 10, 0)];
        let why = verdict(&bounded, &broken).unwrap_err();
        for part in [
            "0.51 pixels",
            "τ is 0.5",
            "place = { latitude_deg = 45.1",
            "altitude_m = 1234.567890123",
            "\"scale\":2.5",
            "host \"left\"",
            "arriving",
        ] {
            assert!(why.contains(part), "{part}: {why}");
        }
        assert!(
            !why.contains("gpu_mib") && !why.contains("top-down"),
            "{why}"
        );
        // A hole is worse than any distance.
        let holes = [measured(0.4, 0.5, 10, 3), measured(9.0, 0.5, 10, 0)];
        let why = verdict(&bounded, &holes).unwrap_err();
        assert!(why.contains("3 samples lie under no triangle"), "{why}");
        // Too little memory, and meshes that promise nothing, are told apart from a broken bound.
        let why = verdict(&bounded, &[measured(0.9, 1.0, 10, 0)]).unwrap_err();
        assert!(why.contains("cache.gpu_mib"), "{why}");
        let coarse = scene("refine = \"off\"");
        let why = verdict(&coarse, &[measured(7.0, 0.0, 10, 0)]).unwrap_err();
        assert!(why.contains("top-down"), "{why}");
        // Sky proves nothing.
        let why = verdict(&bounded, &[measured(0.0, 0.5, 0, 0)]).unwrap_err();
        assert!(why.contains("nothing was measured"), "{why}");
    }
}
