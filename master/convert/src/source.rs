//! A configuration as a tree of keys and words, each of which knows whether somebody has used it.
//! In: entries from the parsers of the three formats. Out: values by key; reading one marks it as carried over.
//! What stays unmarked is listed in the end, so that nothing can be dropped silently.

use std::cell::Cell;

use crate::error::{Trouble, shown};

/// Most keys of a configuration: ten times what the largest walls need.
const MAX_ENTRIES: usize = 65_536;

/// What became of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Untouched,
    Carried,
    Listed,
}

/// One word of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Word {
    pub(crate) text: String,
    /// Whether it stood in quotes.
    pub(crate) quoted: bool,
}

#[derive(Debug)]
struct Entry {
    key: String,
    /// From 1; 0 where the format gives paths instead.
    line: usize,
    parent: Option<usize>,
    children: Vec<usize>,
    words: Vec<Word>,
    fate: Cell<Fate>,
}

/// A configuration.
#[derive(Debug)]
pub(crate) struct Tree {
    entries: Vec<Entry>,
}

/// An entry of a tree: a key with words, a block of further entries, or both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At<'t> {
    tree: &'t Tree,
    index: usize,
}

impl Tree {
    /// A tree with a root and nothing else.
    pub(crate) fn new() -> Self {
        let root = Entry {
            key: String::new(),
            line: 0,
            parent: None,
            children: Vec::new(),
            words: Vec::new(),
            fate: Cell::new(Fate::Carried),
        };
        Self {
            entries: vec![root],
        }
    }

    /// Number of the root, for [`Self::add`].
    pub(crate) const ROOT: usize = 0;

    /// Appends an entry to another one, and returns its number.
    pub(crate) fn add(
        &mut self,
        parent: usize,
        key: &str,
        words: Vec<Word>,
        line: usize,
    ) -> Result<usize, Trouble> {
        let index = self.entries.len();
        if index > MAX_ENTRIES {
            return Err(Trouble::TooMany {
                what: "keys",
                most: MAX_ENTRIES,
            });
        }
        self.entries.push(Entry {
            key: key.to_owned(),
            line,
            parent: Some(parent),
            children: Vec::new(),
            words,
            fate: Cell::new(Fate::Untouched),
        });
        if let Some(parent) = self.entries.get_mut(parent) {
            parent.children.push(index);
        }
        Ok(index)
    }

    pub(crate) fn root(&self) -> At<'_> {
        At {
            tree: self,
            index: Self::ROOT,
        }
    }
}

impl<'t> At<'t> {
    fn entry(self) -> &'t Entry {
        // Numbers come from `add` alone, so they are in range.
        &self.tree.entries[self.index]
    }

    /// Where it stands among all entries.
    pub(crate) fn order(self) -> usize {
        self.index
    }

    /// Whether both are the same entry of the same tree.
    pub(crate) fn is_same(self, other: At<'_>) -> bool {
        self.index == other.index
    }

    pub(crate) fn key(self) -> &'t str {
        &self.entry().key
    }

    pub(crate) fn children(self) -> impl Iterator<Item = At<'t>> {
        let tree = self.tree;
        let at = move |index: &usize| At {
            tree,
            index: *index,
        };
        self.entry().children.iter().map(at)
    }

    /// The entries with this key.
    pub(crate) fn all(self, key: &'t str) -> impl Iterator<Item = At<'t>> {
        self.children().filter(move |child| child.key() == key)
    }

    /// The entry with this key; of several, the last one, which is the one that holds in all three systems.
    pub(crate) fn get(self, key: &'t str) -> Option<Self> {
        self.all(key).last()
    }

    pub(crate) fn parent(self) -> Option<Self> {
        let tree = self.tree;
        self.entry().parent.map(|index| At { tree, index })
    }

    /// The words after the key. Does not count as carrying them over; see [`Self::carry`].
    pub(crate) fn words(self) -> &'t [Word] {
        &self.entry().words
    }

    /// Marks the entry itself, not what is in it, as carried over.
    pub(crate) fn carry(self) -> Self {
        self.entry().fate.set(Fate::Carried);
        self
    }

    /// Marks the entry and all that is in it as listed.
    pub(crate) fn mark_listed(self) {
        self.entry().fate.set(Fate::Listed);
        for child in self.children() {
            child.mark_listed();
        }
    }

    /// Whether it says something itself: a key with words, or an empty block.
    pub(crate) fn has_value(self) -> bool {
        let entry = self.entry();
        !entry.words.is_empty() || entry.children.is_empty()
    }

    pub(crate) fn is_untouched(self) -> bool {
        self.entry().fate.get() == Fate::Untouched
    }

    /// Whether nobody has used it or anything in it.
    pub(crate) fn is_wholly_untouched(self) -> bool {
        (self.is_untouched() || !self.has_value()) && self.children().all(Self::is_wholly_untouched)
    }

    /// The only word, carried over.
    pub(crate) fn text(self) -> Result<&'t str, Trouble> {
        match self.words() {
            [word] if self.entry().children.is_empty() => {
                self.carry();
                Ok(&word.text)
            }
            _ => Err(self.expected("one word")),
        }
    }

    /// The only word, one of `known`, carried over.
    pub(crate) fn one_of<T: Copy>(self, known: &[(&str, T)]) -> Result<T, Trouble> {
        let text = self.text()?;
        let found = known.iter().find(|(name, _)| *name == text);
        found.map(|(_, value)| *value).ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            self.expected(&format!("one of {}", names.join(", ")))
        })
    }

    /// `true` or `false`, carried over.
    pub(crate) fn flag(self) -> Result<bool, Trouble> {
        self.one_of(&[("true", true), ("false", false)])
    }

    /// A finite number, carried over.
    pub(crate) fn number(self) -> Result<f64, Trouble> {
        self.numbers::<1>().map(|[number]| number)
    }

    /// As many finite numbers, carried over.
    pub(crate) fn numbers<const N: usize>(self) -> Result<[f64; N], Trouble> {
        let expected = || match N {
            1 => self.expected("a number"),
            _ => self.expected(&format!("{N} numbers")),
        };
        let words = self.words();
        if words.len() != N {
            return Err(expected());
        }
        let mut numbers = [0.0; N];
        for (number, word) in numbers.iter_mut().zip(words) {
            *number = parse_number(word).ok_or_else(expected)?;
        }
        self.carry();
        Ok(numbers)
    }

    /// A whole number within the range, carried over.
    pub(crate) fn integer(self, least: i64, most: i64) -> Result<i64, Trouble> {
        self.integers::<1>(least, most).map(|[number]| number)
    }

    /// As many whole numbers within the range, carried over.
    pub(crate) fn integers<const N: usize>(
        self,
        least: i64,
        most: i64,
    ) -> Result<[i64; N], Trouble> {
        let expected = || {
            let what = if N == 1 {
                "a whole number"
            } else {
                "whole numbers"
            };
            self.expected(&format!("{what} within {least}…{most}"))
        };
        let numbers = self.numbers::<N>().map_err(|_| expected())?;
        let fits = |n: &f64| n.fract() == 0.0 && (least as f64..=most as f64).contains(n);
        if numbers.iter().all(fits) {
            return Ok(numbers.map(|n| n as i64));
        }
        Err(expected())
    }

    /// The error that something else should stand here.
    pub(crate) fn expected(self, expected: &str) -> Trouble {
        let words: Vec<&str> = self.words().iter().map(|w| w.text.as_str()).collect();
        let found = match (words.is_empty(), self.entry().children.is_empty()) {
            (false, _) => shown(&words.join(" ")),
            (true, true) => "nothing".to_owned(),
            (true, false) => "a block".to_owned(),
        };
        Trouble::Value {
            place: self.place(),
            expected: expected.to_owned(),
            found,
        }
    }

    /// Line and path, or the path alone where the format has no lines.
    pub(crate) fn place(self) -> String {
        let path = self.path();
        match self.entry().line {
            0 => path,
            line => format!("line {line} ({path})"),
        }
    }

    fn path(self) -> String {
        let mut steps = Vec::new();
        let mut next = Some(self);
        while let Some(at) = next {
            if at.parent().is_some() {
                let name = match at.words() {
                    [word] if !at.entry().children.is_empty() => format!(" {}", word.text),
                    _ => String::new(),
                };
                steps.push(format!("{}{name}", at.key()));
            }
            next = at.parent();
        }
        steps.reverse();
        if self.entry().line == 0 {
            steps.join(".").replace(".[", "[")
        } else {
            steps.join(" › ")
        }
    }

    /// The entry with all that is in it, on one line.
    pub(crate) fn source(self) -> String {
        let mut text = self.key().to_owned();
        for word in self.words() {
            let quote = if word.quoted { "\"" } else { "" };
            text.push_str(&format!(" {quote}{}{quote}", word.text));
        }
        let inner: Vec<String> = self.children().map(Self::source).collect();
        if !inner.is_empty() {
            text.push_str(&format!(" {{ {} }}", inner.join("; ")));
        } else if self.words().is_empty() {
            text.push_str(" { }");
        }
        text
    }
}

/// A finite number that stands without quotes.
pub(crate) fn parse_number(word: &Word) -> Option<f64> {
    if word.quoted {
        return None;
    }
    let number: f64 = word.text.parse().ok()?;
    number.is_finite().then_some(number)
}
