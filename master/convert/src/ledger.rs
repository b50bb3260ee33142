//! The list of what is not carried over, and of what was assumed.
//! In: entries with a reason and a remedy; at last, everything that nobody has used. Out: the list.

use std::collections::HashMap;
use std::fmt;

use crate::source::{At, Tree};

/// Something that a wall file cannot say as the source says it, or that the source does not say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lost {
    /// Where it is in the source: line and path, or a path.
    pub place: String,
    /// What the source says there, or what it leaves open.
    pub what: String,
    /// Why it is not carried over, or what was assumed.
    pub why: String,
    /// What to do about it.
    pub remedy: String,
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            place,
            what,
            why,
            remedy,
        } = self;
        write!(f, "{place}: {what}: {why}; {remedy}")
    }
}

/// Why an entry that nobody uses is not carried over, and what to do.
pub(crate) type Reason = (&'static str, &'static str);

const STATED_AGAIN: Reason = (
    "the same key stands again further down, and the last one holds",
    "nothing, unless the first one was meant",
);

/// Collects [`Lost`].
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    /// With the entry's place among all.
    lost: Vec<(usize, Lost)>,
}

impl Ledger {
    /// Lists an entry with all that is in it.
    pub(crate) fn list(&mut self, at: At<'_>, why: impl Into<String>, remedy: impl Into<String>) {
        at.mark_listed();
        self.note(at, at.source(), why, remedy);
    }

    /// Lists something about an entry that is itself carried over, or left open.
    pub(crate) fn note(
        &mut self,
        at: At<'_>,
        what: impl Into<String>,
        why: impl Into<String>,
        remedy: impl Into<String>,
    ) {
        let place = match at.parent() {
            Some(_) => at.place(),
            None => "the whole file".to_owned(),
        };
        let lost = Lost {
            place,
            what: what.into(),
            why: why.into(),
            remedy: remedy.into(),
        };
        self.lost.push((at.order(), lost));
    }

    /// Lists everything that is neither carried over nor listed.
    pub(crate) fn sweep(&mut self, tree: &Tree, reason: fn(At<'_>) -> Reason) {
        self.sweep_children(tree.root(), reason);
    }

    fn sweep_children(&mut self, parent: At<'_>, reason: fn(At<'_>) -> Reason) {
        let mut last = HashMap::new();
        for (index, at) in parent.children().enumerate() {
            last.insert(at.key(), index);
        }
        for (index, at) in parent.children().enumerate() {
            let again = at.has_value() && last.get(at.key()).is_some_and(|last| *last > index);
            let (why, remedy) = if again { STATED_AGAIN } else { reason(at) };
            if at.is_wholly_untouched() {
                self.list(at, why, remedy);
                continue;
            }
            if at.has_value() && at.is_untouched() {
                let words: Vec<&str> = at.words().iter().map(|w| w.text.as_str()).collect();
                let what = format!("{} {}", at.carry().key(), words.join(" "));
                self.note(at, what, why, remedy);
            }
            self.sweep_children(at, reason);
        }
    }

    /// The list, in the order of the source.
    pub(crate) fn into_lost(mut self) -> Vec<Lost> {
        self.lost.sort_by_key(|(order, _)| *order);
        self.lost.into_iter().map(|(_, lost)| lost).collect()
    }
}
