//! `terrawall adjust THING.KEY=VALUE…` and `terrawall pattern NAME`: a running wall is measured anew, or shows test
//! patterns.
//!
//! In: assignments, names. Out: requests to the master's control API. All assignments are one request: the wall takes all
//! of them or none. It judges no measure: the master does.

use serde_json::{Map, Value, json};

use crate::args::{Adjust, ShowPattern};
use crate::failure::Failure;
use crate::output;

use super::client::{Client, Method};

/// Changes measures of the wall, and saves them if asked.
pub(crate) fn adjust(args: &Adjust) -> Result<(), Failure> {
    if args.assignments.is_empty() && !args.save {
        return Err(Failure::configuration(
            "nothing to do: write THING.KEY=VALUE, for example observers.viewer.head_m=[0,1.7,3], or --save",
        ));
    }
    let client = Client::new(&args.master)?;
    if !args.assignments.is_empty() {
        let mut patch = Value::Object(Map::new());
        for assignment in &args.assignments {
            put_assignment(&mut patch, assignment)?;
        }
        let answer = client.ask(Method::Patch, "/api/wall", &patch)?;
        let revision = answer.get("wall_revision").and_then(Value::as_u64);
        let revision = revision.ok_or_else(|| client.not_ours("it told no revision"))?;
        output::line(format!("measures {revision}"))?;
    }
    if args.save {
        let answer = client.ask(Method::Post, "/api/wall/save", &json!({}))?;
        let path = answer.get("saved").and_then(Value::as_str);
        let path = path.ok_or_else(|| client.not_ours("it did not say where it saved"))?;
        output::line(format!("saved {path}"))?;
    }
    Ok(())
}

/// Shows a pattern, or the scene again.
pub(crate) fn pattern(args: &ShowPattern) -> Result<(), Failure> {
    let client = Client::new(&args.master)?;
    let pattern = args.pattern.0.map(protocol::pattern::Pattern::name);
    let outputs = if args.outputs.is_empty() {
        vec!["*".to_owned()]
    } else {
        args.outputs.clone()
    };
    let wishes: Map<String, Value> = outputs
        .into_iter()
        .map(|output| (output, json!(pattern)))
        .collect();
    let shown = client.ask(Method::Patch, "/api/patterns", &Value::Object(wishes))?;
    for (output, shown) in shown.as_object().into_iter().flatten() {
        output::line(format!("{output} {}", shown.as_str().unwrap_or("scene")))?;
    }
    Ok(())
}

/// Puts `THING.KEY=VALUE` into a merge patch. Names of outputs are `HOST/OUTPUT`.
fn put_assignment(patch: &mut Value, assignment: &str) -> Result<(), Failure> {
    let refuse = |why: &str| Failure::configuration(format!("\"{assignment}\" {why}"));
    let (path, value) = assignment.split_once('=').ok_or_else(|| {
        refuse("assigns nothing; write for example observers.viewer.head_m=[0,1.7,3]")
    })?;
    let value: Value = serde_json::from_str(value.trim())
        .map_err(|error| refuse(&format!("has a value that is no JSON: {error}")))?;
    let mut target = patch;
    for word in path.trim().split('.') {
        if word.is_empty() {
            return Err(refuse("has an empty word in its path"));
        }
        if !target.is_object() {
            *target = Value::Object(Map::new());
        }
        let Value::Object(object) = target else {
            return Err(refuse("has no path"));
        };
        target = object.entry(word).or_insert(Value::Null);
    }
    *target = value;
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    #[test]
    fn assignments_become_one_patch() {
        let mut patch = json!({});
        for assignment in [
            "observers.viewer.head_m=[0, 1.7, 3]",
            "outputs.left/projector.gamma = 2.2",
            "outputs.left/projector.channels.0.black_level=0.01",
        ] {
            put_assignment(&mut patch, assignment).unwrap();
        }
        let due = json!({
            "observers": { "viewer": { "head_m": [0, 1.7, 3] } },
            "outputs": { "left/projector": { "gamma": 2.2, "channels": { "0": { "black_level": 0.01 } } } }
        });
        assert_eq!(patch, due);
        for (bad, words) in [
            ("observers.viewer.head_m", "assigns nothing"),
            ("observers..head_m=1", "empty word"),
            ("observers.viewer.head_m=[0", "no JSON"),
        ] {
            let failure = put_assignment(&mut json!({}), bad).unwrap_err().to_string();
            assert!(failure.contains(words), "{failure}");
        }
    }
}
