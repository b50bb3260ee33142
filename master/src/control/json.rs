//! JSON from clients, read so that every complaint names the path of the value it is about.
//! In: bytes. Out: a value, or what is wrong and where. Names that stand twice in an object are an error: which of
//! the two values is meant, nobody knows.

use std::cell::RefCell;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

/// Why bytes are no JSON that can be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum JsonError {
    /// The text is not JSON.
    #[error("this is not JSON: {reason}")]
    Syntax {
        /// What is wrong, with line and column.
        reason: String,
        /// The innermost value in which it is wrong; empty: the whole.
        path: String,
    },
    /// A number that is too large to be one.
    #[error("{path}: the number is too large: {reason}")]
    Number {
        /// What is wrong, with line and column.
        reason: String,
        /// Where it stands.
        path: String,
    },
}

/// Reads a value.
pub(super) fn parse(bytes: &[u8]) -> Result<Value, JsonError> {
    let path = RefCell::new(Vec::new());
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let read = Reader(&path)
        .deserialize(&mut deserializer)
        .and_then(|value| deserializer.end().map(|()| value));
    read.map_err(|error| {
        let (reason, path) = (error.to_string(), path.into_inner().concat());
        let path = path.strip_prefix('.').unwrap_or(&path).to_owned();
        // JSON knows no infinity and no NaN. What comes nearest is a number beyond all that f64 can hold, and
        // only the words of the error tell it from other faults.
        if reason.starts_with("number out of range") {
            JsonError::Number { reason, path }
        } else {
            JsonError::Syntax { reason, path }
        }
    })
}

/// Reads one value. The steps are the path from the root to it, and stay where they are on an error.
#[derive(Clone, Copy)]
struct Reader<'p>(&'p RefCell<Vec<String>>);

impl<'p> Reader<'p> {
    fn inside<T, E>(self, step: String, read: impl FnOnce(Self) -> Result<T, E>) -> Result<T, E> {
        self.0.borrow_mut().push(step);
        let value = read(self)?;
        self.0.borrow_mut().pop();
        Ok(value)
    }
}

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Value, E> {
        let number = Number::from_f64(value).ok_or_else(|| E::custom("number out of range"))?;
        Ok(Value::Number(number))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        loop {
            let step = format!("[{}]", values.len());
            match self.inside(step, |reader| elements.next_element_seed(reader))? {
                Some(value) => values.push(value),
                None => return Ok(values.into()),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            let value = self.inside(format!(".{key}"), |reader| {
                if map.contains_key(&key) {
                    return Err(A::Error::custom("this name stands twice in its object"));
                }
                entries.next_value_seed(reader)
            })?;
            map.insert(key, value);
        }
        Ok(map.into())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    #[test]
    fn good_json_is_read_as_serde_json_reads_it() {
        let text = r#" {"a": {"b": [1, -2, 3.5e3, null, true, "ä\n", {}]}, "": []} "#;
        let expected: Value = serde_json::from_str(text).unwrap();
        assert_eq!(parse(text.as_bytes()).unwrap(), expected);
    }

    #[test]
    fn faults_are_told_with_their_path() {
        for (text, number, path) in [
            ("", false, ""),
            ("{", false, ""),
            ("scale=1", false, ""),
            ("{} {}", false, ""),
            (
                r#"{"layers": {"relief": {"scale": NaN}}}"#,
                false,
                "layers.relief.scale",
            ),
            (
                r#"{"layers": {"relief": {"scale": -Infinity}}}"#,
                false,
                "layers.relief.scale",
            ),
            (
                r#"{"layers": {"relief": {"scale": 1e999}}}"#,
                true,
                "layers.relief.scale",
            ),
            (
                r#"{"layers": {"relief": {"clamp_m": [0, -1e999]}}}"#,
                true,
                "layers.relief.clamp_m[1]",
            ),
            (r#"{"a": 1, "b": {"c": 1, "c": 2}}"#, false, "b.c"),
            (r#"{"a": [{"b": 1}, {"b": }]}"#, false, "a[1].b"),
            (r#"{"a": "open"#, false, "a"),
        ] {
            let (found, given) = match parse(text.as_bytes()).unwrap_err() {
                JsonError::Number { path, .. } => (true, path),
                JsonError::Syntax { path, .. } => (false, path),
            };
            assert_eq!((found, &*given), (number, path), "{text}");
        }
        parse(b"{\"a\": \"\xff\"}").unwrap_err();
        parse("[".repeat(100_000).as_bytes()).unwrap_err();
    }
}
