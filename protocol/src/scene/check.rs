//! What makes a scene one that can be shown: ranges, names, and paths that can be flown.
//! In: a scene from a file or from the wire. Out: nothing, or the first problem and what to do about it.

use geodesy::Ellipsoid;

use super::fields;
use super::slot::check_range;
use super::{
    Blend, Layer, LayerParameters, Lens, LensLayer, MAX_COLOUR_LAYERS, MAX_ELEVATION_LAYERS,
    MAX_KEYFRAMES, MAX_LENSES, Scene,
};
use crate::camera::{Camera, Path};
use crate::config::{Fault, Problem};

/// Longest name of a layer or lens in bytes.
const MAX_NAME_BYTES: usize = 64;
/// Longest path of a repository in bytes.
const MAX_REPOSITORY_BYTES: usize = 4096;
/// Longest time of a camera path: one year.
const MAX_TIME_S: f64 = 31_557_600.0;
/// Fastest orbit: ten turns a second.
const MAX_DEGREES_PER_SECOND: f64 = 3600.0;
/// Widest arc between neighbouring keyframes. Nearer to 180° the great circle is not determined.
const MAX_ARC_DEG: f64 = 150.0;

impl Scene {
    /// The first problem of the scene.
    pub(super) fn check(&self) -> Result<(), Problem> {
        Ellipsoid::new(self.planet.semi_major_m, self.planet.semi_minor_m)
            .map_err(|error| Problem::new(Fault::OutOfRange, "planet", error.to_string()))?;
        check_camera(&self.camera)?;
        self.check_layers()?;
        self.check_lenses()?;
        fields::check("light.sun", &self.light.sun)?;
        fields::check("light", &self.light)?;
        fields::check("atmosphere", &self.atmosphere)?;
        fields::check("mesh", &self.mesh)
    }

    fn check_layers(&self) -> Result<(), Problem> {
        let heights = |layer: &&Layer| layer.kind().makes_heights();
        let of_elevation = self.layers.iter().filter(heights).count();
        let others = self.layers.len() - of_elevation;
        for (what, count, most) in [
            ("of kind \"elevation\"", of_elevation, MAX_ELEVATION_LAYERS),
            (
                "of other kinds than \"elevation\"",
                others,
                MAX_COLOUR_LAYERS,
            ),
        ] {
            if count > most {
                let advice = format!("there are {count} layers {what}; write at most {most}");
                return Err(Problem::new(Fault::OutOfRange, "layers", advice));
            }
        }
        check_names("layers", self.layers.iter().map(|layer| &layer.name))?;
        self.layers.iter().try_for_each(check_layer)
    }

    fn check_lenses(&self) -> Result<(), Problem> {
        let count = self.lenses.len();
        if count > MAX_LENSES {
            let advice = format!("there are {count}; write at most {MAX_LENSES}");
            return Err(Problem::new(Fault::OutOfRange, "lenses", advice));
        }
        check_names("lenses", self.lenses.iter().map(|lens| &lens.name))?;
        self.lenses.iter().try_for_each(|lens| {
            fields::check(&format!("lenses.{}", lens.name), lens)?;
            self.check_lens_layers(lens)
        })
    }

    /// What a lens says of layers fits the layers. A scene that was read always does.
    fn check_lens_layers(&self, lens: &Lens) -> Result<(), Problem> {
        let key = format!("lenses.{}.layers", lens.name);
        let mut before = None;
        for inside in &lens.layers {
            let Some(layer) = self.layers.get(inside.layer) else {
                let advice = format!(
                    "there is no layer {}, the scene has {}; name a layer of the scene",
                    inside.layer,
                    self.layers.len()
                );
                return Err(Problem::new(Fault::Name, key, advice));
            };
            if before.is_some_and(|before| before >= inside.layer) {
                let advice = "the layers must be in the order of the scene, each at most once";
                return Err(Problem::new(Fault::Name, key, advice));
            }
            before = Some(inside.layer);
            let key = format!("{key}.{}", layer.name);
            check_parameters(&key, &inside.parameters)?;
            check_given(&key, layer, inside)?;
        }
        Ok(())
    }
}

/// Whether a layer or lens can be called so. Names are parts of paths, such as `layers.relief.scale`.
///
/// # Errors
/// What to write instead.
pub(super) fn usable_name(name: &str) -> Result<(), String> {
    let usable = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
    if (1..=MAX_NAME_BYTES).contains(&name.len()) && name.chars().all(usable) {
        return Ok(());
    }
    Err(format!(
        "this cannot be a name; write a name of 1…{MAX_NAME_BYTES} letters a–z or A–Z, digits, - and _"
    ))
}

/// Checks that names are usable, sorted, and that none appears twice.
fn check_names<'n>(key: &str, names: impl Iterator<Item = &'n String>) -> Result<(), Problem> {
    let mut before: Option<&str> = None;
    for name in names {
        usable_name(name).map_err(|advice| Problem::new(Fault::Name, key, advice))?;
        if before.is_some_and(|before| before >= name.as_str()) {
            let advice = format!(
                "\"{name}\" is not in the order of names; sort them and use each name once"
            );
            return Err(Problem::new(Fault::Name, key, advice));
        }
        before = Some(name);
    }
    Ok(())
}

fn check_layer(layer: &Layer) -> Result<(), Problem> {
    let key = format!("layers.{}", layer.name);
    let usable = match &layer.repository {
        Some(path) => {
            let length = 1..=MAX_REPOSITORY_BYTES;
            layer.kind().has_repository() && length.contains(&path.len()) && !path.contains('\0')
        }
        None => !layer.kind().has_repository(),
    };
    if !usable {
        let advice = if layer.kind().has_repository() {
            "write the directory or the address (http://, https://, s3://) of a repository, made by `terrawall import`"
        } else {
            "layers of this kind are made from the elevation of the scene; remove it"
        };
        let key = format!("{key}.repository");
        return Err(Problem::new(Fault::OutOfRange, key, advice));
    }
    check_parameters(&key, &layer.parameters)
}

fn check_parameters(key: &str, parameters: &LayerParameters) -> Result<(), Problem> {
    fields::check(key, parameters)?;
    if parameters.process.kind().makes_heights() && parameters.fusion.blend == Blend::Screen {
        let key = format!("{key}.blend");
        let advice = "heights have no white to approach; write \"normal\", \"multiply\" or \"add\"";
        return Err(Problem::new(Fault::OutOfRange, key, advice));
    }
    Ok(())
}

/// Inside a lens, exactly the given values differ from the layer's.
fn check_given(key: &str, layer: &Layer, inside: &LensLayer) -> Result<(), Problem> {
    let refuse = |advice: &str| Err(Problem::new(Fault::Name, key, advice));
    if inside.parameters.process.kind() != layer.kind() {
        return refuse("the kind differs from the layer's; a lens changes parameters only");
    }
    let mut within = fields::to_map(&inside.parameters);
    let mut outside = fields::to_map(&layer.parameters);
    let is_given = |known: &&str| inside.given.iter().any(|given| given == known);
    let keys = fields::keys(&inside.parameters).into_iter();
    let known: Vec<&str> = keys.filter(is_given).collect();
    if known != inside.given || !known.iter().all(|given| within.contains_key(*given)) {
        return refuse("the keys that the lens gives must be keys of the layer, in their order");
    }
    for given in &inside.given {
        for key in fields::keys_beside(&inside.parameters, given) {
            within.remove(key);
            outside.remove(key);
        }
    }
    if within != outside {
        return refuse("values differ from the layer's, but the lens does not give their keys");
    }
    Ok(())
}

fn check_camera(camera: &Camera) -> Result<(), Problem> {
    match camera {
        Camera::Fixed(place) => fields::check("camera.place", place),
        Camera::Orbit(orbit) => {
            fields::check("camera.place", &orbit.place)?;
            fields::check("camera.centre", orbit)?;
            let speeds = -MAX_DEGREES_PER_SECOND..=MAX_DEGREES_PER_SECOND;
            check_range(
                "camera.degrees_per_second",
                orbit.degrees_per_second,
                &speeds,
            )
        }
        Camera::Path(path) => check_path(path),
    }
}

fn check_path(path: &Path) -> Result<(), Problem> {
    let keyframes = &path.keyframes;
    if !(2..=MAX_KEYFRAMES).contains(&keyframes.len()) {
        let advice = format!(
            "there are {}; write at least 2 and at most {MAX_KEYFRAMES}, or mode = \"fixed\" for one place",
            keyframes.len()
        );
        return Err(Problem::new(Fault::OutOfRange, "camera.keyframes", advice));
    }
    for (index, keyframe) in keyframes.iter().enumerate() {
        let key = format!("camera.keyframes[{index}]");
        check_range(
            &format!("{key}.time_s"),
            keyframe.time_s,
            &(0.0..=MAX_TIME_S),
        )?;
        fields::check(&format!("{key}.place"), &keyframe.place)?;
    }
    for (index, pair) in keyframes.windows(2).enumerate() {
        let [before, after] = pair else { continue };
        let key = format!("camera.keyframes[{}]", index + 1);
        // A millisecond keeps speeds finite.
        if after.time_s - before.time_s < 0.001 {
            let advice = format!(
                "keyframes must be in order of time; write more than {} s",
                before.time_s
            );
            return Err(Problem::new(
                Fault::OutOfRange,
                format!("{key}.time_s"),
                advice,
            ));
        }
        let arc_deg = before
            .place
            .normal()
            .angle_between(after.place.normal())
            .to_degrees();
        if arc_deg > MAX_ARC_DEG {
            let advice = format!(
                "this is {arc_deg:.0}° from the keyframe before, and the way between them is not determined; write a keyframe in between"
            );
            return Err(Problem::new(
                Fault::Geometry,
                format!("{key}.place"),
                advice,
            ));
        }
    }
    let (first, last) = (keyframes.first(), keyframes.last());
    if path.looped && first.map(|keyframe| keyframe.place) != last.map(|keyframe| keyframe.place) {
        let key = format!("camera.keyframes[{}].place", keyframes.len() - 1);
        let advice = "a looped path must end where it starts; repeat the first place here, or write looped = false";
        return Err(Problem::new(Fault::Geometry, key, advice));
    }
    Ok(())
}
