//! JSON into a tree.
//! In: text. Out: entries for members and items, in their order, every one of a repeated key included. What the keys
//! mean is read elsewhere.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use crate::MAX_DEPTH;
use crate::error::Trouble;
use crate::source::{Tree, Word};

/// Parses a configuration: one object.
pub(crate) fn parse(text: &str) -> Result<Tree, Trouble> {
    let mut tree = Tree::new();
    let mut reader = serde_json::Deserializer::from_str(text);
    let mut full = None;
    let root = Element {
        tree: &mut tree,
        parent: Tree::ROOT,
        key: None,
        depth: 0,
        full: &mut full,
    };
    let read = root.deserialize(&mut reader).and_then(|()| reader.end());
    match (read, full) {
        (Ok(()), _) => Ok(tree),
        (Err(_), Some(trouble)) => Err(trouble),
        (Err(error), None) => {
            let message = error.to_string();
            let words = message.split(" at line ").next().unwrap_or_default();
            let (expected, found) = match words.rsplit_once(", expected ") {
                Some((found, expected)) => (expected.to_owned(), found.to_owned()),
                None => ("JSON".to_owned(), words.to_owned()),
            };
            Err(Trouble::Syntax {
                line: error.line().max(1),
                column: error.column().max(1),
                expected,
                found,
            })
        }
    }
}

/// A value that is about to be read, and where it goes.
struct Element<'a> {
    tree: &'a mut Tree,
    parent: usize,
    /// `None`: the root itself.
    key: Option<String>,
    depth: usize,
    /// Why the tree takes no more.
    full: &'a mut Option<Trouble>,
}

impl Element<'_> {
    fn add<E: Error>(&mut self, words: Vec<Word>) -> Result<usize, E> {
        let Some(key) = &self.key else {
            return match words.is_empty() {
                true => Ok(Tree::ROOT),
                false => Err(E::custom("a value, expected an object")),
            };
        };
        self.tree
            .add(self.parent, key, words, 0)
            .map_err(|trouble| {
                *self.full = Some(trouble);
                E::custom("too many keys")
            })
    }

    fn leaf<E: Error>(&mut self, text: &str, quoted: bool) -> Result<(), E> {
        let word = Word {
            text: text.to_owned(),
            quoted,
        };
        self.add(vec![word]).map(|_| ())
    }

    fn check_depth<E: Error>(&self) -> Result<(), E> {
        if self.depth < MAX_DEPTH {
            return Ok(());
        }
        Err(E::custom(format!(
            "deeper nesting, expected at most {MAX_DEPTH} levels"
        )))
    }
}

impl<'de> DeserializeSeed<'de> for Element<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<(), D::Error> {
        if self.key.is_none() {
            return reader.deserialize_map(self);
        }
        reader.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Element<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.key.is_none() {
            "an object"
        } else {
            "a value"
        })
    }

    fn visit_unit<E: Error>(mut self) -> Result<(), E> {
        self.leaf("null", false)
    }

    fn visit_bool<E: Error>(mut self, value: bool) -> Result<(), E> {
        self.leaf(&value.to_string(), false)
    }

    fn visit_i64<E: Error>(mut self, value: i64) -> Result<(), E> {
        self.leaf(&value.to_string(), false)
    }

    fn visit_u64<E: Error>(mut self, value: u64) -> Result<(), E> {
        self.leaf(&value.to_string(), false)
    }

    fn visit_f64<E: Error>(mut self, value: f64) -> Result<(), E> {
        self.leaf(&value.to_string(), false)
    }

    fn visit_str<E: Error>(mut self, value: &str) -> Result<(), E> {
        self.leaf(value, true)
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut items: A) -> Result<(), A::Error> {
        self.check_depth()?;
        let parent = self.add(Vec::new())?;
        let mut index = 0_usize;
        loop {
            let item = Element {
                tree: &mut *self.tree,
                parent,
                key: Some(format!("[{index}]")),
                depth: self.depth + 1,
                full: &mut *self.full,
            };
            if items.next_element_seed(item)?.is_none() {
                return Ok(());
            }
            index += 1;
        }
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut members: A) -> Result<(), A::Error> {
        self.check_depth()?;
        let parent = self.add(Vec::new())?;
        while let Some(key) = members.next_key::<String>()? {
            members.next_value_seed(Element {
                tree: &mut *self.tree,
                parent,
                key: Some(key),
                depth: self.depth + 1,
                full: &mut *self.full,
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_keep_their_order_and_repeats() {
        let tree = parse(r#"{ "b": [1, {"x": 2.5}], "a": "t", "b": null }"#).unwrap();
        let keys: Vec<_> = tree
            .root()
            .children()
            .map(|at| at.key().to_owned())
            .collect();
        assert_eq!(keys, ["b", "a", "b"]);
        let list = tree.root().all("b").next().unwrap();
        let item = list.children().nth(1).unwrap().get("x").unwrap();
        assert_eq!(item.place(), "b[1].x");
        assert_eq!(item.number(), Ok(2.5));
    }

    #[test]
    fn errors_name_line_and_column() {
        let deep = format!("{{\"a\":{}", "[".repeat(100));
        let cases = [
            ("{\n \"a\": }", 2),
            ("[1]", 1),
            ("{}x", 1),
            ("", 1),
            ("7", 1),
            (deep.as_str(), 1),
            ("{\"a\": 1e999}", 1),
        ];
        for (text, expected_line) in cases {
            match parse(text) {
                Err(Trouble::Syntax { line, column, .. }) => {
                    assert_eq!(line, expected_line, "{text}");
                    assert!(column >= 1);
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
