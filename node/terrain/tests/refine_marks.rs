//! Proof of the geometry of marks, against the source's worked examples and by counting; and of codes.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;
mod refined;

use std::collections::{HashMap, HashSet};

use common::Random;
use refined::nodes;
use terrain::{DEEPEST_MARK, MARK_WORDS, Marks, code_down, code_up, decode, pair, triangles};

#[test]
fn the_worked_examples_of_the_source() {
    // Lambers 2011, §3.3.3, for a quad of 8 × 8.
    let odd = pair(3, 5, 3).unwrap();
    assert_eq!((odd.level, odd.size, odd.ends), (3, 2, [[4, 4], [6, 2]]));
    assert_eq!(odd.apexes, [Some([4, 2]), Some([6, 4])]);
    let even = pair(3, 2, 8).unwrap();
    assert_eq!((even.level, even.size, even.ends), (2, 4, [[0, 8], [4, 8]]));
    assert_eq!(even.apexes, [Some([2, 6]), None]);
    // Fig. 3.5: marks of levels 0 to 4 and their distances.
    let mut levels: HashMap<u8, (usize, HashSet<u16>)> = HashMap::new();
    for (x, y) in (0..=8).flat_map(|y| (0..=8).map(move |x| (x, y))) {
        if let Some(own) = pair(3, x, y) {
            let (count, sizes) = levels.entry(own.level).or_default();
            *count += 1;
            sizes.insert(own.size);
        }
    }
    let table: Vec<_> = (0..=4)
        .map(|level| {
            (
                levels[&level].0,
                levels[&level].1.iter().copied().collect::<Vec<_>>(),
            )
        })
        .collect();
    assert_eq!(
        table,
        [
            (4, vec![8]),
            (4, vec![4]),
            (12, vec![4]),
            (16, vec![2]),
            (40, vec![2])
        ]
    );
    // The example draws no other marks: corners and centre halve nothing.
    for (x, y) in [(0, 0), (8, 0), (0, 8), (8, 8), (4, 4), (9, 0), (3, 9)] {
        assert_eq!(pair(3, x, y), None);
    }
    assert_eq!((pair(0, 0, 0), pair(16, 1, 1)), (None, None));
}

/// The source's own expressions for d and the orientation, and its level for k = 3; apexes by turning.
#[test]
fn the_expressions_of_the_source() {
    for k in 1..=8 {
        let last = 1_u16 << k;
        for (x, y) in (0..=last).flat_map(|y| (0..=last).map(move |x| (x, y))) {
            let Some(own) = pair(k, x, y) else { continue };
            let level = u32::from(own.level);
            let d = 1_u16 << (u32::from(k) - level.div_ceil(2));
            assert_eq!(own.size, d);
            let h = d / 2;
            let ends = if level % 2 == 0 {
                if y % d == 0 {
                    [[x - h, y], [x + h, y]]
                } else {
                    [[x, y - h], [x, y + h]]
                }
            } else if (x / d) % 2 == (y / d) % 2 {
                [[x - h, y - h], [x + h, y + h]]
            } else {
                [[x - h, y + h], [x + h, y - h]]
            };
            assert_eq!(own.ends, ends);
            if k == 3 {
                let lowest_bit = |c: u16| if c == 0 { 0 } else { c.trailing_zeros() + 1 };
                let (bx, by) = (lowest_bit(x), lowest_bit(y));
                let b = if bx == 0 || by == 0 {
                    bx.max(by)
                } else {
                    bx.min(by)
                };
                assert_eq!(level, if bx == by { 3 - 2 * (b - 1) } else { 6 - 2 * b });
            }
            // The apexes are the ends, turned by a right angle about the mark: below or left comes first.
            let [[ax, ay], _] = own.ends.map(|end| end.map(i32::from));
            let (mx, my) = (i32::from(x), i32::from(y));
            let mut turned = [
                [mx - (ay - my), my + (ax - mx)],
                [mx + (ay - my), my - (ax - mx)],
            ];
            turned.sort_by_key(|[x, y]| (*y, *x));
            let inside = |c: &i32| (0..=i32::from(last)).contains(c);
            let expected =
                turned.map(|apex| apex.iter().all(inside).then(|| apex.map(|c| c as u16)));
            assert_eq!(own.apexes, expected, "{k}: {x} {y}");
        }
    }
}

#[test]
fn every_other_node_is_the_midpoint_of_exactly_one_hypotenuse() {
    for k in 1..=8_u8 {
        let last = 1_u16 << k;
        let mut halved: HashMap<[u16; 2], Vec<(u8, u16)>> = HashMap::new();
        // All hypotenuses there are, from bisecting the four triangles around the centre again and again.
        let mut wave: HashSet<[[u16; 2]; 3]> = HashSet::new();
        let corners = [[0, 0], [last, 0], [last, last], [0, last]];
        for n in 0..4 {
            wave.insert([corners[n], corners[(n + 1) % 4], [last / 2, last / 2]]);
        }
        for level in 0..=2 * (k - 1) {
            let mut next = HashSet::new();
            let mut hypotenuses: HashSet<[[u16; 2]; 2]> = HashSet::new();
            for [from, to, apex] in wave {
                hypotenuses.insert([from.min(to), from.max(to)]);
                let middle = [u16::midpoint(from[0], to[0]), u16::midpoint(from[1], to[1])];
                next.extend([[apex, from, middle], [apex, to, middle]]);
                let own = pair(k, middle[0], middle[1]).expect("a mark");
                assert_eq!(own.ends, [from.min(to), from.max(to)]);
                assert!(own.apexes.contains(&Some(apex)));
            }
            for [from, to] in hypotenuses {
                let middle = [u16::midpoint(from[0], to[0]), u16::midpoint(from[1], to[1])];
                let size = from[0].abs_diff(to[0]).max(from[1].abs_diff(to[1]));
                halved.entry(middle).or_default().push((level, size));
            }
            wave = next;
        }
        for (x, y) in (0..=last).flat_map(|y| (0..=last).map(move |x| (x, y))) {
            let found = halved.remove(&[x, y]).unwrap_or_default();
            match pair(k, x, y) {
                Some(own) => assert_eq!(found, [(own.level, own.size)]),
                None => assert!(
                    found.is_empty() && (x % last, y % last) == (0, 0)
                        || (x, y) == (last / 2, last / 2)
                ),
            }
        }
        assert!(halved.is_empty());
    }
}

#[test]
fn marks_are_bits_in_rows_of_nine_words() {
    let mut marks = Marks::new();
    assert_eq!((marks.count(), marks.words().len()), (5, MARK_WORDS));
    assert!(marks.set(37, 4) && !marks.set(37, 4) && marks.is_set(37, 4));
    assert_eq!(marks.words()[4 * 9 + 1], 1 << 5);
    for (x, y) in [(257, 3), (3, 257), (287, 0), (u16::MAX, u16::MAX)] {
        assert!(!marks.set(x, y) && !marks.is_set(x, y));
    }
    let set: Vec<_> = marks.positions().collect();
    assert_eq!(
        set,
        [[0, 0], [256, 0], [37, 4], [128, 128], [0, 256], [256, 256]]
    );
    let words = marks.words().to_vec();
    assert_eq!(Marks::from_words(words.clone()), Some(marks));
    assert_eq!(Marks::from_words(words[1..].to_vec()), None);
    let mut beyond = words;
    beyond[8] |= 2;
    assert_eq!(Marks::from_words(beyond), None);
}

#[test]
fn triangles_come_in_order_and_counter_clockwise() {
    let mut marks = Marks::new();
    let left = [[0, 256], [0, 0], [128, 128]];
    let right = [[256, 0], [256, 256], [128, 128]];
    let down = [[0, 0], [256, 0], [128, 128]];
    let up = [[256, 256], [0, 256], [128, 128]];
    assert_eq!(triangles(&marks), [left, right, down, up]);
    marks.set(128, 0);
    // Mark (128, 0) comes first; its one side's legs go to the first end and then to the second.
    let halves = [
        [[128, 128], [0, 0], [128, 0]],
        [[256, 0], [128, 128], [128, 0]],
    ];
    assert_eq!(triangles(&marks), [halves[0], halves[1], left, right, up]);
    let all: Vec<u32> = {
        let mut all = Marks::new();
        for [x, y] in nodes() {
            all.set(x, y);
        }
        all.words().to_vec()
    };
    let all = Marks::from_words(all).unwrap();
    let finest = triangles(&all);
    assert_eq!(finest.len(), 2 * 256 * 256);
    for [_, _, apex] in finest {
        let deepest = pair(8, apex[0], apex[1]).unwrap().level;
        assert_eq!(deepest, DEEPEST_MARK);
    }
}

#[test]
fn codes_are_monotone_and_near() {
    let mut random = Random(5);
    let mut samples: Vec<u32> = (0..5000).collect();
    for bit in 0..31 {
        for near in 0..2000_u32 {
            samples.extend([
                (1_u32 << bit).saturating_sub(near),
                (1_u32 << bit).saturating_add(near),
            ]);
        }
    }
    samples.extend((0..200_000).map(|_| (random.next() >> (33 + random.below(20))) as u32));
    samples.extend([u32::MAX, u32::MAX - 1, 1 << 31]);
    samples.sort_unstable();
    let mut before = (0, 0);
    for v in samples {
        let (up, down) = (code_up(v), code_down(v));
        assert!(up >= before.0 && down >= before.1 && down <= up && up <= down + 1);
        before = (up, down);
        assert!(decode(up) >= v && decode(down) <= v, "{v}");
        // Less than 2^-10 off, and no code lies between.
        let room = f64::from(v) / 1024.0;
        if v <= 1 << 31 {
            assert!(
                v < 2048 || f64::from(decode(up) - v) < room && f64::from(v - decode(down)) < room
            );
            assert_eq!((code_up(decode(up)), code_down(decode(up))), (up, up));
            assert_eq!(
                (code_up(decode(down)), code_down(decode(down))),
                (down, down)
            );
        }
        if v < 2048 {
            assert_eq!((u32::from(up), u32::from(down)), (v, v));
        }
    }
    // Every code up to the largest in use is some number's, and decoding is strictly monotone.
    let largest = code_up(1 << 31);
    assert_eq!(largest, 22_528);
    assert!((0..largest).all(|code| decode(code) < decode(code + 1)));
    assert_eq!(decode(u16::MAX), u32::MAX);
}
