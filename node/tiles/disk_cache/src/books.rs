//! What all processes together have put into the cache: one ledger of each process, and the janitor's baseline.
//!
//! In: the directory `.ledger`. Out: an upper bound of the bytes of published files, at any moment, whoever dies.
//! It must not decide who may write.
//!
//! A ledger `HOST-PID-RANDOM.ledger` says what its process has published since it began (P, only growing) and what it
//! has reserved (R): a file's bytes are in R before it appears, and move to P after. A baseline `NUMBER.baseline` says
//! what a janitor counted in the tree, and which P of each ledger it had read before it counted. So
//! `total + Σ (P − P included) + Σ R` is never less than the tree holds. Baselines are numbered and made by a link, so
//! that a janitor that overslept cannot replace a newer one; a ledger is removed only after a baseline includes it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::PathBuf;

use crate::layout::{Layout, is_missing, read_record};

/// Most ledgers that are read: more processes than any cluster has.
const MAX_LEDGERS: usize = 4096;
const LEDGER_ENDING: &str = ".ledger";
const BASELINE_ENDING: &str = ".baseline";

/// One process's account as it stands on the disk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ledger {
    /// The budget of the process in bytes: the smallest of all holds.
    pub(crate) budget: u64,
    /// P: bytes of files that it has published.
    pub(crate) published: u64,
    /// R: bytes that it may publish without asking.
    pub(crate) reserved: u64,
    /// Changes while the process lives.
    pub(crate) beat: u64,
    /// Whether the process ended in order.
    pub(crate) closed: bool,
}

impl Ledger {
    /// The file's content.
    pub(crate) fn encode(&self) -> Vec<u8> {
        let Self {
            budget,
            published,
            reserved,
            beat,
            closed,
        } = self;
        sealed(format!(
            "terrawall ledger 1\nbudget {budget}\npublished {published}\nreserved {reserved}\nbeat {beat}\nclosed {}\n",
            u8::from(*closed)
        ))
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let mut lines = unsealed(bytes)?.lines();
        (lines.next()? == "terrawall ledger 1").then_some(())?;
        let mut number = |key: &str| -> Option<u64> {
            lines
                .next()?
                .strip_prefix(key)?
                .strip_prefix(' ')?
                .parse()
                .ok()
        };
        Some(Self {
            budget: number("budget")?,
            published: number("published")?,
            reserved: number("reserved")?,
            beat: number("beat")?,
            closed: number("closed")? == 1,
        })
    }
}

/// What a janitor found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Baseline {
    /// Bytes of all published files.
    pub(crate) total: u64,
    /// P of each ledger, as read before the counting began.
    pub(crate) included: BTreeMap<String, u64>,
}

impl Baseline {
    /// The file's content.
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut text = format!("terrawall baseline 1\ntotal {}\n", self.total);
        for (ledger, published) in &self.included {
            // Writing to a text cannot fail.
            let _ = writeln!(text, "includes {published} {ledger}");
        }
        sealed(text)
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let mut lines = unsealed(bytes)?.lines();
        (lines.next()? == "terrawall baseline 1").then_some(())?;
        let total = lines.next()?.strip_prefix("total ")?.parse().ok()?;
        let included = lines
            .map(|line| {
                let (published, ledger) = line.strip_prefix("includes ")?.split_once(' ')?;
                Some((ledger.to_owned(), published.parse().ok()?))
            })
            .collect::<Option<_>>()?;
        Some(Self { total, included })
    }
}

/// A power cut may leave any file empty or torn, and a torn number is worse than none.
fn sealed(text: String) -> Vec<u8> {
    let checksum = crc32fast::hash(text.as_bytes());
    format!("{text}crc {checksum:08x}\n").into_bytes()
}

fn unsealed(bytes: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(bytes).ok()?;
    let at = text.len().checked_sub("crc 00000000\n".len())?;
    let (body, seal) = (text.get(..at)?, text.get(at..)?);
    let stated = seal.strip_prefix("crc ")?.strip_suffix('\n')?;
    (u32::from_str_radix(stated, 16).ok()? == crc32fast::hash(body.as_bytes())).then_some(body)
}

/// Everything that stood in `.ledger` at one time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Books {
    /// By file name: raw content, and what it says; nothing where it is torn.
    pub(crate) ledgers: BTreeMap<String, (Vec<u8>, Option<Ledger>)>,
    /// The newest baseline, unless it is torn or there is none.
    pub(crate) baseline: Option<Baseline>,
    /// The number of the newest baseline, torn or not; 0 where there is none.
    pub(crate) number: u64,
}

impl Books {
    /// Reads all ledgers, then the newest baseline: a ledger that is gone by then is included in it.
    pub(crate) fn read(layout: &Layout) -> io::Result<Self> {
        let mut books = Self::default();
        for name in names(layout)? {
            if !name.ends_with(LEDGER_ENDING) {
                continue;
            }
            if books.ledgers.len() >= MAX_LEDGERS {
                return Err(io::Error::other(format!(
                    "{} holds more than {MAX_LEDGERS} ledgers; run `terrawall cache clear`",
                    layout.ledgers.display()
                )));
            }
            if let Some(content) = read_record(&layout.ledgers.join(&name))? {
                let ledger = Ledger::decode(&content);
                books.ledgers.insert(name, (content, ledger));
            }
        }
        // A newer janitor may remove the baseline between the listing and the reading.
        for _ in 0..8 {
            books.number = names(layout)?
                .iter()
                .filter_map(|name| baseline_number(name))
                .max()
                .unwrap_or(0);
            if books.number == 0 {
                break;
            }
            if let Some(content) = read_record(&baseline_path(layout, books.number))? {
                books.baseline = Baseline::decode(&content);
                break;
            }
        }
        Ok(books)
    }

    /// At least as many bytes as published files have and may get from what is reserved. None without a baseline.
    pub(crate) fn used(&self) -> Option<u64> {
        let baseline = self.baseline.as_ref()?;
        let mut used = baseline.total;
        for (name, (_, ledger)) in &self.ledgers {
            // A torn ledger is of a process that died in a power cut; the next janitor counts what it left.
            let ledger = (*ledger)?;
            let included = baseline.included.get(name).copied().unwrap_or(0);
            used = used
                .saturating_add(ledger.published.saturating_sub(included))
                .saturating_add(ledger.reserved);
        }
        Some(used)
    }

    /// Bytes that processes have reserved.
    pub(crate) fn reserved(&self) -> u64 {
        self.living()
            .fold(0_u64, |sum, ledger| sum.saturating_add(ledger.reserved))
    }

    /// The smallest budget of all processes that have not ended, and `own`.
    pub(crate) fn budget(&self, own: u64) -> u64 {
        self.living()
            .fold(own, |least, ledger| least.min(ledger.budget))
    }

    /// Ledgers of processes that have not ended in order.
    pub(crate) fn living(&self) -> impl Iterator<Item = &Ledger> {
        self.ledgers
            .values()
            .filter_map(|(_, ledger)| ledger.as_ref())
            .filter(|ledger| !ledger.closed)
    }
}

/// The file of a process's ledger.
pub(crate) fn ledger_name(holder: &str) -> String {
    format!("{holder}{LEDGER_ENDING}")
}

/// The process whose ledger has this name.
pub(crate) fn holder_of(ledger: &str) -> Option<&str> {
    ledger.strip_suffix(LEDGER_ENDING)
}

/// The file of a baseline.
pub(crate) fn baseline_path(layout: &Layout, number: u64) -> PathBuf {
    layout
        .ledgers
        .join(format!("{number:020}{BASELINE_ENDING}"))
}

/// Removes the baselines older than number `before`.
pub(crate) fn remove_baselines(layout: &Layout, before: u64) {
    for name in names(layout).unwrap_or_default() {
        if baseline_number(&name).is_some_and(|number| number < before) {
            let _ = fs::remove_file(layout.ledgers.join(name));
        }
    }
}

fn baseline_number(name: &str) -> Option<u64> {
    let digits = name.strip_suffix(BASELINE_ENDING)?;
    // The last number is never used, so that a forged one cannot end the counting.
    digits
        .parse()
        .ok()
        .filter(|number| digits.len() == 20 && *number < u64::MAX)
}

/// Names of the files in `.ledger`; the directory is made where it is missing.
fn names(layout: &Layout) -> io::Result<Vec<String>> {
    let entries = match fs::read_dir(&layout.ledgers) {
        Err(error) if is_missing(&error) => return Ok(Vec::new()),
        other => other?,
    };
    let mut names = Vec::new();
    for entry in entries {
        match entry {
            Ok(entry) => names.extend(entry.file_name().into_string().ok()),
            Err(error) if is_missing(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_not_included_counts_and_what_is_reserved_too() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        layout.make().unwrap();
        let put = |path: PathBuf, content: Vec<u8>| fs::write(path, content).unwrap();
        let ledger = |name: &str, published, reserved| {
            let ledger = Ledger {
                budget: 1000,
                published,
                reserved,
                beat: 3,
                closed: false,
            };
            put(layout.ledgers.join(ledger_name(name)), ledger.encode());
        };
        ledger("a", 100, 7);
        ledger("b", 50, 0);
        assert_eq!(Books::read(&layout).unwrap().used(), None);
        let baseline = Baseline {
            total: 500,
            included: [("a.ledger".to_owned(), 60)].into(),
        };
        put(baseline_path(&layout, 9), baseline.encode());
        put(baseline_path(&layout, 8), Baseline::default().encode());
        let books = Books::read(&layout).unwrap();
        assert_eq!((books.number, books.baseline.clone()), (9, Some(baseline)));
        assert_eq!(books.used(), Some(500 + 40 + 7 + 50));
        assert_eq!(
            (books.reserved(), books.budget(2000), books.budget(10)),
            (7, 1000, 10)
        );
        // Torn: nothing is known.
        put(layout.ledgers.join("c.ledger"), Vec::new());
        assert_eq!(Books::read(&layout).unwrap().used(), None);
        remove_baselines(&layout, 9);
        assert!(!baseline_path(&layout, 8).exists() && baseline_path(&layout, 9).exists());
    }

    proptest! {
        #[test]
        fn records_survive_and_noise_is_told(published: u64, reserved: u64, closed: bool, at: prop::sample::Index, noise in proptest::collection::vec(any::<u8>(), 0..80)) {
            let ledger = Ledger { budget: 5, published, reserved, beat: 1, closed };
            let mut bytes = ledger.encode();
            prop_assert_eq!(Ledger::decode(&bytes), Some(ledger));
            let at = at.index(bytes.len() - 1);
            bytes[at] ^= 1;
            prop_assert_eq!(Ledger::decode(&bytes), None);
            let baseline = Baseline { total: published, included: [("x".to_owned(), reserved)].into() };
            prop_assert_eq!(Baseline::decode(&baseline.encode()), Some(baseline));
            prop_assert_eq!(Baseline::decode(&noise), None);
        }
    }
}
