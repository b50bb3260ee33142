//! A door for so many at a time: many threads wait for data, few decode it, since a processor does one thing at once.
//! In: how many. Out: passes, given back when dropped.

use parking_lot::{Condvar, Mutex};

/// The door.
pub(super) struct Gate {
    free: Mutex<usize>,
    left: Condvar,
}

/// A pass through it.
pub(super) struct Pass<'a>(&'a Gate);

impl Gate {
    /// For at least one.
    pub(super) fn new(passes: usize) -> Self {
        Self {
            free: Mutex::new(passes.max(1)),
            left: Condvar::new(),
        }
    }

    /// Waits for a pass.
    pub(super) fn pass(&self) -> Pass<'_> {
        let mut free = self.free.lock();
        while *free == 0 {
            self.left.wait(&mut free);
        }
        *free -= 1;
        Pass(self)
    }
}

impl Drop for Pass<'_> {
    fn drop(&mut self) {
        *self.0.free.lock() += 1;
        self.0.left.notify_one();
    }
}
