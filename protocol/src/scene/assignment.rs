//! Changes as an operator writes them: `relief.scale=2`.
//! In: words. Out: a JSON merge patch. Whether the scene has such a key is found when the patch is applied.

use serde_json::{Map, Value};
use thiserror::Error;

use super::Scene;
use super::raw::KEYS;

/// Most words of a path. No key of a scene lies deeper.
const MAX_WORDS: usize = 8;

/// Why a text is no assignment.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AssignmentError {
    /// It has no `=`.
    #[error("\"{0}\" assigns nothing; write for example relief.scale=2")]
    NoValue(String),
    /// The part before `=` is no path.
    #[error(
        "\"{0}\" is no path of a key; write LAYER.PARAMETER, for example relief.scale, or a path that starts with one \
         of {keys}, for example light.ambient", keys = KEYS.join(", ")
    )]
    NoPath(String),
}

impl Scene {
    /// Turns an assignment into a merge patch for [`Scene::patched`]. Before the first `=` is the path of a key: where
    /// its first word is a top-level key of scenes (`light.ambient`, `lenses.loupe.radius_m`, `planet`), from there,
    /// else within the layer of that name (`relief.scale`). After it is the value: JSON where it is JSON (`2`,
    /// `[0, 1]`, `null`), else a text (`screen`).
    ///
    /// # Errors
    /// A text without `=`, or without a path before it.
    pub fn assignment(text: &str) -> Result<Value, AssignmentError> {
        Self::assignments([text])
    }

    /// Turns several assignments into one merge patch; of two for one key, the later one holds.
    ///
    /// # Errors
    /// As [`Scene::assignment`], for the first text that is none.
    pub fn assignments<'t>(
        texts: impl IntoIterator<Item = &'t str>,
    ) -> Result<Value, AssignmentError> {
        let mut patch = Value::Object(Map::new());
        for text in texts {
            let (path, value) = text
                .split_once('=')
                .ok_or_else(|| AssignmentError::NoValue(text.to_owned()))?;
            let words =
                words(path.trim()).ok_or_else(|| AssignmentError::NoPath(path.to_owned()))?;
            let value = value.trim();
            let value = serde_json::from_str(value)
                .unwrap_or_else(|_no_json| Value::String(value.to_owned()));
            put(&mut patch, &words, value);
        }
        Ok(patch)
    }
}

/// The words of a path from the root of a scene.
fn words(path: &str) -> Option<Vec<&str>> {
    let mut words: Vec<&str> = path.split('.').map(str::trim).collect();
    if !words.first().is_some_and(|first| KEYS.contains(first)) {
        if words.len() < 2 {
            return None;
        }
        words.insert(0, "layers");
    }
    let usable = |word: &&str| super::check::usable_name(word).is_ok();
    (words.len() <= MAX_WORDS && words.iter().all(usable)).then_some(words)
}

/// Puts a value at a path, in place of whatever is there and is no object on the way.
fn put(target: &mut Value, words: &[&str], value: Value) {
    let Some((first, rest)) = words.split_first() else {
        *target = value;
        return;
    };
    if !target.is_object() {
        *target = Value::Object(Map::new());
    }
    if let Value::Object(object) = target {
        put(object.entry(*first).or_insert(Value::Null), rest, value);
    }
}
