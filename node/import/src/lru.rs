//! A map with a byte budget that forgets what was not used for longest.
//! In: keys, values, their sizes. Out: values still held. It never computes a value and never blocks for one.

use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;

use std::sync::{Mutex, PoisonError};

/// Values by key, at most `budget` bytes of them (a single larger one is held alone).
pub(crate) struct Lru<K, V> {
    budget: u64,
    held: Mutex<Held<K, V>>,
}

struct Held<K, V> {
    entries: HashMap<K, Entry<V>>,
    by_age: BTreeMap<u64, K>,
    clock: u64,
    bytes: u64,
}

struct Entry<V> {
    value: V,
    bytes: u64,
    used: u64,
}

impl<K: Copy + Eq + Hash, V: Clone> Lru<K, V> {
    pub(crate) fn new(budget: u64) -> Self {
        let held = Held {
            entries: HashMap::new(),
            by_age: BTreeMap::new(),
            clock: 0,
            bytes: 0,
        };
        Self {
            budget,
            held: Mutex::new(held),
        }
    }

    /// The value of a key, marked as used.
    pub(crate) fn get(&self, key: K) -> Option<V> {
        self.held
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .touch(key)
    }

    /// The value of a key, or the one that `make` gives, which must be cheap: others wait meanwhile.
    pub(crate) fn get_or(&self, key: K, bytes: u64, make: impl FnOnce() -> V) -> V {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = held.touch(key) {
            return value;
        }
        let value = make();
        held.put(key, value.clone(), bytes, self.budget);
        value
    }

    /// Adds or replaces a value.
    pub(crate) fn insert(&self, key: K, value: V, bytes: u64) {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.put(key, value, bytes, self.budget);
    }

    /// Forgets everything.
    pub(crate) fn clear(&self) {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.entries.clear();
        held.by_age.clear();
        held.bytes = 0;
    }
}

impl<K: Copy + Eq + Hash, V: Clone> Held<K, V> {
    fn touch(&mut self, key: K) -> Option<V> {
        self.clock += 1;
        let entry = self.entries.get_mut(&key)?;
        self.by_age.remove(&entry.used);
        entry.used = self.clock;
        self.by_age.insert(self.clock, key);
        Some(entry.value.clone())
    }

    fn put(&mut self, key: K, value: V, bytes: u64, budget: u64) {
        self.remove(key);
        while self.bytes + bytes > budget {
            let Some((_, oldest)) = self.by_age.pop_first() else {
                break;
            };
            if let Some(entry) = self.entries.remove(&oldest) {
                self.bytes -= entry.bytes;
            }
        }
        self.clock += 1;
        self.by_age.insert(self.clock, key);
        self.entries.insert(
            key,
            Entry {
                value,
                bytes,
                used: self.clock,
            },
        );
        self.bytes += bytes;
    }

    fn remove(&mut self, key: K) {
        if let Some(entry) = self.entries.remove(&key) {
            self.by_age.remove(&entry.used);
            self.bytes -= entry.bytes;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_unused_goes_first() {
        let lru = Lru::new(30);
        for key in 0..3 {
            lru.insert(key, key * 10, 10);
        }
        assert_eq!(lru.get(0), Some(0));
        lru.insert(3, 30, 10);
        assert_eq!(lru.get(1), None);
        assert_eq!(lru.get(0), Some(0));
        assert_eq!(lru.get_or(3, 10, || 99), 30);
        lru.insert(4, 40, 100);
        assert_eq!((lru.get(4), lru.get(0)), (Some(40), None));
    }
}
