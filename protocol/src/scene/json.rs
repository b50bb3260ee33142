//! Scenes as JSON, in the same shape as their files, and changes of them.
//! In: a scene, JSON, merge patches. Out: JSON, or a validated scene, or an error with the path of the value.
//! It reads nothing by itself: JSON goes through the reader of scene files.

use geodesy::Ellipsoid;
use serde_json::{Map, Value, json};

use super::fields::to_map;
use super::slot::Named;
use super::{Layer, Lens, Scene, SceneError, Sun};
use crate::camera::{Camera, Keyframe, Place};
use crate::config::{self, Document};

impl Scene {
    /// The scene in the shape of a scene file, everything written out; of lenses, only what they give. The scene is
    /// one that was read or that [`Scene::validate`] accepts.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let layers = self.layers.iter();
        let lenses = self.lenses.iter();
        json!({
            "planet": planet(&self.planet),
            "camera": camera(&self.camera),
            "layers": layers.map(|layer| (layer.name.clone(), self::layer(layer))).collect::<Map<_, _>>(),
            "lenses": lenses.map(|lens| (lens.name.clone(), self.lens(lens))).collect::<Map<_, _>>(),
            "light": with(to_map(&self.light), [("sun", sun(&self.light.sun))]),
            "atmosphere": to_map(&self.atmosphere),
            "mesh": to_map(&self.mesh),
        })
    }

    /// Reads and validates a scene in the shape of [`Scene::to_json`]; what has a default may be left out.
    /// `origin` names the JSON in errors.
    ///
    /// # Errors
    /// The first thing that is wrong, with the path of its key and what to write instead.
    pub fn from_json(value: &Value, origin: &str) -> Result<Self, SceneError> {
        Self::of_json(value, Some(origin))
    }

    /// The scene after a JSON merge patch (RFC 7396) of [`Scene::to_json`]: objects are merged, `null` removes a
    /// key, which then has its default, and everything else, lists too, is replaced as a whole.
    ///
    /// # Errors
    /// The first thing that is wrong with the patched scene; its key is the path of the value, for example
    /// `layers.relief.scale`.
    pub fn patched(&self, patch: &Value) -> Result<Self, SceneError> {
        config::check_depth(patch)?;
        let mut value = self.to_json();
        merge(&mut value, patch);
        Self::of_json(&value, None)
    }

    fn of_json(value: &Value, origin: Option<&str>) -> Result<Self, SceneError> {
        let text = config::toml_of_json(value, origin)?;
        Self::read(&Document::parse_rewritten(&text, origin)?)
    }

    fn lens(&self, lens: &Lens) -> Value {
        let mut layers = Map::new();
        for inside in &lens.layers {
            let Some(layer) = self.layers.get(inside.layer) else {
                continue;
            };
            let mut map = to_map(&inside.parameters);
            map.retain(|key, _| inside.given.contains(key));
            layers.insert(layer.name.clone(), Value::Object(map));
        }
        with(to_map(lens), [("layers", Value::Object(layers))])
    }
}

/// MergePatch of RFC 7396, §2. As deep as the patch, whose depth was checked.
fn merge(target: &mut Value, patch: &Value) {
    let Value::Object(changes) = patch else {
        target.clone_from(patch);
        return;
    };
    if !target.is_object() {
        *target = Value::Object(Map::new());
    }
    let Value::Object(object) = target else {
        return;
    };
    for (key, change) in changes {
        if change.is_null() {
            object.remove(key);
        } else {
            merge(object.entry(key).or_insert(Value::Null), change);
        }
    }
}

fn with<const N: usize>(mut map: Map<String, Value>, further: [(&str, Value); N]) -> Value {
    let further = further.into_iter();
    map.extend(further.map(|(key, value)| (key.to_owned(), value)));
    Value::Object(map)
}

fn planet(planet: &Ellipsoid) -> Value {
    let known = ["earth", "moon", "mars"].into_iter();
    let mut named = known.filter(|name| Ellipsoid::by_name(name).ok().as_ref() == Some(planet));
    named.next().map_or_else(
        || json!({ "semi_major_m": planet.semi_major_m, "semi_minor_m": planet.semi_minor_m }),
        |name| json!(name),
    )
}

fn camera(camera: &Camera) -> Value {
    match camera {
        Camera::Fixed(place) => json!({ "mode": "fixed", "place": self::place(place) }),
        Camera::Orbit(orbit) => json!({
            "mode": "orbit",
            "place": place(&orbit.place),
            "centre": to_map(orbit),
            "degrees_per_second": orbit.degrees_per_second,
        }),
        Camera::Path(path) => json!({
            "mode": "path",
            "keyframes": path.keyframes.iter().map(keyframe).collect::<Vec<_>>(),
            "looped": path.looped,
        }),
    }
}

fn keyframe(keyframe: &Keyframe) -> Value {
    json!({ "time_s": keyframe.time_s, "place": place(&keyframe.place) })
}

fn place(place: &Place) -> Value {
    Value::Object(to_map(place))
}

fn layer(layer: &Layer) -> Value {
    let map = to_map(&layer.parameters);
    let mut map = with(map, [("kind", json!(layer.kind().as_name()))]);
    if let (Value::Object(map), Some(repository)) = (&mut map, &layer.repository) {
        map.insert("repository".to_owned(), json!(repository));
    }
    map
}

fn sun(sun: &Sun) -> Value {
    match sun {
        Sun::Camera => json!("camera"),
        Sun::Fixed { .. } => Value::Object(to_map(sun)),
    }
}
