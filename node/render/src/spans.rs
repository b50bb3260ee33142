//! Room in a buffer, lent out in spans: first fit, and what comes back joins what is free beside it.
//! In: lengths. Out: places. Bookkeeping only; it owns no buffer and counts in whatever its user counts in.

/// The free spans of a buffer.
#[derive(Debug)]
pub(crate) struct Spans {
    /// Start and length, by start; no two touch.
    free: Vec<(u32, u32)>,
    capacity: u32,
}

impl Spans {
    /// All of a buffer is free.
    pub(crate) fn new(capacity: u32) -> Self {
        Self {
            free: vec![(0, capacity)],
            capacity,
        }
    }

    /// What the buffer holds in all.
    pub(crate) fn capacity(&self) -> u32 {
        self.capacity
    }

    /// The first free span that is long enough; `None` where there is none.
    pub(crate) fn lend(&mut self, length: u32) -> Option<u32> {
        let index = self.free.iter().position(|(_, free)| *free >= length)?;
        let (start, free) = self.free.get_mut(index)?;
        let lent = *start;
        *start += length;
        *free -= length;
        if *free == 0 {
            self.free.remove(index);
        }
        Some(lent)
    }

    /// Takes back what was lent.
    pub(crate) fn take_back(&mut self, start: u32, length: u32) {
        if length == 0 {
            return;
        }
        let next = self.free.partition_point(|(free, _)| *free < start);
        self.free.insert(next, (start, length));
        let joins = |spans: &[(u32, u32)], first: usize| {
            let pair = spans.get(first).zip(spans.get(first + 1));
            pair.is_some_and(|((start, length), (next, _))| start + length == *next)
        };
        if joins(&self.free, next) {
            self.free[next].1 += self.free[next + 1].1;
            self.free.remove(next + 1);
        }
        if next > 0 && joins(&self.free, next - 1) {
            self.free[next - 1].1 += self.free[next].1;
            self.free.remove(next);
        }
    }

    /// The buffer holds more.
    pub(crate) fn grow(&mut self, capacity: u32) {
        if capacity > self.capacity {
            let added = capacity - self.capacity;
            self.take_back(self.capacity, added);
            self.capacity = capacity;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;

    #[test]
    fn what_comes_back_in_any_order_is_one_span_again() {
        let orders = [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ];
        for order in orders {
            let mut spans = Spans::new(60);
            let lent: Vec<u32> = (0..3).map(|_| spans.lend(20).unwrap()).collect();
            assert_eq!((lent.as_slice(), spans.lend(1)), (&[0, 20, 40][..], None));
            for index in order {
                spans.take_back(lent[index], 20);
            }
            assert_eq!(spans.free, [(0, 60)]);
        }
    }

    #[test]
    fn spans_never_overlap_and_growth_adds_to_the_end() {
        let mut spans = Spans::new(100);
        let mut lent: Vec<(u32, u32)> = Vec::new();
        let mut state = 7_u32;
        for round in 0..2000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let length = state >> 28;
            if round == 1000 {
                spans.grow(150);
            }
            match spans.lend(length) {
                Some(start) if length > 0 => {
                    let apart = |(other, size): &(u32, u32)| {
                        start + length <= *other || other + size <= start
                    };
                    assert!(lent.iter().all(apart) && start + length <= spans.capacity());
                    lent.push((start, length));
                }
                _ => {
                    if !lent.is_empty() {
                        let (start, length) = lent.swap_remove(state as usize % lent.len());
                        spans.take_back(start, length);
                    }
                }
            }
        }
        let free: u32 = spans.free.iter().map(|(_, length)| length).sum();
        let held: u32 = lent.iter().map(|(_, length)| length).sum();
        assert_eq!(free + held, 150);
    }
}
