//! The rim of what a map shows: pixels that matter where a cell between samples is only partly there.
//! In: a map and a rectangle of pixels. Out: the few pixels that span all that are there. It keeps nothing.

/// The corners of the convex hull of the pixels of a rectangle (first and one past the last column and row) for which
/// `shows` holds. What lies between them is spanned by them, as far as the map is straight there.
pub(crate) fn rim(
    [left, right]: [u32; 2],
    [top, bottom]: [u32; 2],
    shows: impl Fn(u32, u32) -> bool,
) -> Vec<[u32; 2]> {
    let mut ends = Vec::new();
    for y in top..bottom {
        let Some(first) = (left..right).find(|x| shows(*x, y)) else {
            continue;
        };
        ends.push([first, y]);
        if let Some(last) = (first + 1..right).rev().find(|x| shows(*x, y)) {
            ends.push([last, y]);
        }
    }
    hull(ends)
}

/// Andrew's monotone chain (1979): the corners of the convex hull, without those on its edges.
fn hull(mut places: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    places.sort_unstable();
    if places.len() < 3 {
        return places;
    }
    let mut corners = half_hull(places.iter());
    corners.pop();
    corners.extend(half_hull(places.iter().rev()));
    corners.pop();
    corners
}

fn half_hull<'a>(places: impl Iterator<Item = &'a [u32; 2]>) -> Vec<[u32; 2]> {
    let mut chain: Vec<[u32; 2]> = Vec::new();
    for place in places {
        while let [.., before, last] = chain.as_slice() {
            if turns_left(*before, *last, *place) {
                break;
            }
            chain.pop();
        }
        chain.push(*place);
    }
    chain
}

fn turns_left(first: [u32; 2], second: [u32; 2], third: [u32; 2]) -> bool {
    let step = |to: u32, from: u32| i64::from(to) - i64::from(from);
    let (x, y) = (step(second[0], first[0]), step(second[1], first[1]));
    x * step(third[1], first[1]) - y * step(third[0], first[0]) > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rim_spans_all_that_is_shown() {
        // The part of a circle of radius 40 in a rectangle, and a diamond with a hole.
        let circle = |x: u32, y: u32| (x * x + y * y) < 1600;
        let diamond = |x: u32, y: u32| (1..=7).contains(&x.abs_diff(8).wrapping_add(y.abs_diff(8)));
        type Shows = fn(u32, u32) -> bool;
        let cases: [([u32; 2], [u32; 2], Shows); 2] =
            [([20, 36], [20, 36], circle), ([0, 16], [0, 16], diamond)];
        for (columns, rows, shows) in cases {
            let corners = rim(columns, rows, shows);
            assert!((3..=12).contains(&corners.len()), "{corners:?}");
            for turn in 0..64 {
                let (sine, cosine) = (f64::from(turn) * 0.1).sin_cos();
                let along = |[x, y]: [u32; 2]| f64::from(x) * cosine + f64::from(y) * sine;
                let reach = corners
                    .iter()
                    .map(|place| along(*place))
                    .fold(f64::MIN, f64::max);
                for y in rows[0]..rows[1] {
                    for x in (columns[0]..columns[1]).filter(|x| shows(*x, y)) {
                        assert!(along([x, y]) <= reach + 1e-9, "{x} {y} beyond the rim");
                    }
                }
            }
        }
    }

    #[test]
    fn rims_of_little_are_all_of_it() {
        assert!(rim([0, 9], [0, 9], |_, _| false).is_empty());
        assert_eq!(rim([0, 9], [0, 9], |x, y| (x, y) == (3, 4)), [[3, 4]]);
        assert_eq!(
            rim([0, 9], [0, 9], |x, y| y == 4 && x > 3),
            [[4, 4], [8, 4]]
        );
    }
}
