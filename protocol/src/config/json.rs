//! JSON rewritten as TOML, so that one reader serves both.
//! In: a JSON value. Out: TOML text of the same shape, or an error where JSON says what TOML cannot. Numbers keep all
//! their bits.

use std::fmt::Write as _;

use serde_json::Value;

use super::{ConfigError, Fault, Problem, key_text, quoted};

/// Deepest nesting that is read: twice what any file has.
const MAX_DEPTH: usize = 16;

/// Refuses values that nest deeper than any file, so that functions that walk them may recurse.
pub(crate) fn check_depth(value: &Value) -> Result<(), ConfigError> {
    let mut level = vec![value];
    for _ in 0..MAX_DEPTH {
        let mut deeper = Vec::new();
        for value in level {
            match value {
                Value::Array(elements) => deeper.extend(elements),
                Value::Object(members) => deeper.extend(members.values()),
                _ => {}
            }
        }
        level = deeper;
        if level.is_empty() {
            return Ok(());
        }
    }
    let advice = format!("this is nested more than {MAX_DEPTH} deep; no key of a scene is");
    Err(Problem::new(Fault::WrongType, "", advice).without_origin())
}

/// The TOML text of a JSON object. `origin` names the JSON in errors.
pub(crate) fn toml_of_json(value: &Value, origin: Option<&str>) -> Result<String, ConfigError> {
    check_depth(value)?;
    let Value::Object(members) = value else {
        let advice = "this is no JSON object; write {\"layers\": {…}, …}";
        return Err(Problem::new(Fault::WrongType, "", advice).into_error(origin));
    };
    let mut text = String::new();
    for (key, member) in members {
        let path = key_text(key);
        let _ = write!(text, "{} = ", quoted(key));
        let written = write_value(&mut text, member, &path);
        written.map_err(|problem| problem.into_error(origin))?;
        text.push('\n');
    }
    Ok(text)
}

fn write_value(text: &mut String, value: &Value, path: &str) -> Result<(), Problem> {
    match value {
        Value::Null => {
            let advice = "null is no value; leave the key out, or write a value";
            return Err(Problem::new(Fault::WrongType, path, advice));
        }
        Value::Bool(flag) => text.push_str(if *flag { "true" } else { "false" }),
        Value::Number(number) => text.push_str(&number_text(number)),
        Value::String(string) => text.push_str(&quoted(string)),
        Value::Array(elements) => {
            text.push('[');
            for (index, element) in elements.iter().enumerate() {
                if index > 0 {
                    text.push_str(", ");
                }
                write_value(text, element, &format!("{path}[{index}]"))?;
            }
            text.push(']');
        }
        Value::Object(members) => {
            text.push('{');
            for (index, (key, member)) in members.iter().enumerate() {
                let separator = if index > 0 { ", " } else { " " };
                let _ = write!(text, "{separator}{} = ", quoted(key));
                write_value(text, member, &format!("{path}.{}", key_text(key)))?;
            }
            text.push_str(" }");
        }
    }
    Ok(())
}

/// A number with all its bits: whole numbers as such, others as the shortest text that reads back the same.
fn number_text(number: &serde_json::Number) -> String {
    match (number.as_i64(), number.as_f64()) {
        (Some(whole), _) => whole.to_string(),
        (None, Some(other)) => format!("{other:?}"),
        (None, None) => "nan".to_owned(),
    }
}
