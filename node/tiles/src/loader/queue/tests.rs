//! The queue's promises: order, patience, single flight, nothing lost.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
use super::*;
use geodesy::Tile;
use proptest::prelude::*;

fn key(n: u32) -> Key {
    static ID: std::sync::OnceLock<DatasetId> = std::sync::OnceLock::new();
    (
        *ID.get_or_init(DatasetId::random),
        Tile::new(1, 9, n, 0).unwrap(),
    )
}

fn wish(queue: &mut Queue, caller: u64, wants: &[(u32, f32)]) {
    queue.replace(
        (caller, false),
        wants.iter().map(|(n, priority)| (key(*n), *priority)),
        |_| false,
    );
}

#[test]
fn by_priority_each_once_and_cancelled_when_no_longer_wished() {
    let (mut queue, now) = (Queue::default(), Instant::now());
    wish(
        &mut queue,
        0,
        &[(1, 1.0), (2, 3.0), (3, 2.0), (4, f32::NAN), (2, 0.5)],
    );
    assert_eq!(queue.next(true, now), Next::Load(key(2)));
    assert_eq!(queue.next(true, now), Next::Load(key(3)));
    wish(&mut queue, 0, &[(2, 9.0), (4, f32::NAN), (5, 0.0)]);
    wish(&mut queue, 1, &[(4, 7.0)]);
    // 2 is in flight, 1 is cancelled, and 4 counts as the second caller wants it.
    assert_eq!(queue.next(true, now), Next::Load(key(4)));
    assert_eq!(queue.next(true, now), Next::Load(key(5)));
    assert_eq!(queue.next(true, now), Next::Wait(None));
    assert!(!queue.is_idle());
    for n in 2..=5 {
        queue.done(key(n));
    }
    assert!(queue.is_idle());
}

#[test]
fn patience_grows_then_gives_up_then_tries_rarely() {
    let (mut queue, mut now) = (Queue::default(), Instant::now());
    wish(&mut queue, 0, &[(1, 1.0)]);
    for attempt in 1..=ATTEMPTS {
        assert_eq!(queue.next(true, now), Next::Load(key(1)));
        assert!(queue.failure(&key(1)).is_none());
        let setback = Setback::Failed("why".into());
        assert_eq!(queue.set_back(key(1), setback, now), attempt);
        let Next::Wait(Some(again)) = queue.next(true, now) else {
            panic!("it must rest")
        };
        let pause = if attempt < ATTEMPTS {
            FIRST_PAUSE * 4_u32.pow(attempt - 1)
        } else {
            LONG_PAUSE
        };
        assert_eq!(again, now + pause);
        now = again;
    }
    assert_eq!(&*queue.failure(&key(1)).unwrap(), "why");
    assert!(queue.is_idle() && queue.failures() == 1);
    assert_eq!(queue.next(true, now), Next::Load(key(1)));
    assert!(queue.done(key(1)).0 && !queue.done(key(1)).0);
    assert_eq!(queue.failures(), 0);
}

#[test]
fn a_resting_tile_does_not_hold_others_up() {
    let (mut queue, now) = (Queue::default(), Instant::now());
    wish(&mut queue, 0, &[(1, 9.0)]);
    assert_eq!(queue.next(true, now), Next::Load(key(1)));
    queue.set_back(key(1), Setback::Failed("why".into()), now);
    wish(&mut queue, 0, &[(1, 9.0), (2, 1.0)]);
    assert_eq!(queue.next(true, now), Next::Load(key(2)));
    let Next::Wait(Some(again)) = queue.next(true, now) else {
        panic!("it must rest")
    };
    // It came up and rests; its data set changes meanwhile, and nothing is held against it any more.
    queue.forget(key(1).0);
    assert_eq!(queue.next(true, now), Next::Load(key(1)));
    queue.set_back(key(1), Setback::Failed("why".into()), now);
    assert_eq!(queue.next(true, now), Next::Wait(Some(again)));
    // When it is due again, it comes before what matters less.
    wish(&mut queue, 0, &[(1, 9.0), (3, 1.0)]);
    assert_eq!(queue.next(true, again), Next::Load(key(1)));
    assert_eq!(queue.next(true, again), Next::Load(key(3)));
    queue.set_back(key(3), Setback::Failed("why".into()), again);
    assert!(matches!(queue.next(true, again), Next::Wait(Some(_))));
    queue.withdraw();
    assert_eq!(queue.next(true, again + LONG_PAUSE), Next::Wait(None));
}

#[test]
fn what_may_be_wanted_soon_comes_last_and_only_if_there_is_room() {
    let (mut queue, now) = (Queue::default(), Instant::now());
    wish(&mut queue, 0, &[(1, 0.0), (2, 1.0)]);
    let soon = [(key(2), 9.0), (key(3), 8.0), (key(4), 9.0)];
    queue.replace((0, true), soon.into_iter(), |_| false);
    for due in [2, 1] {
        assert_eq!(queue.next(false, now), Next::Load(key(due)));
    }
    assert_eq!(queue.next(false, now), Next::Wait(None));
    assert_eq!(queue.next(true, now), Next::Load(key(4)));
    assert_eq!((queue.in_flight(), queue.in_flight_soon()), (3, 1));
    assert!(!queue.is_wished(&key(4)));
    assert_eq!(
        (queue.done(key(4)), queue.done(key(2))),
        ((true, true), (true, false))
    );
    queue.done(key(1));
    // Tile 3 is wished for by nobody yet: nothing is missing.
    assert!(queue.is_idle());
    wish(&mut queue, 0, &[(3, 0.0)]);
    assert!(!queue.is_idle());
    assert_eq!(queue.next(false, now), Next::Load(key(3)));
}

#[test]
fn others_work_is_waited_for_without_being_held_against_a_tile() {
    let (mut queue, mut now) = (Queue::default(), Instant::now());
    wish(&mut queue, 0, &[(1, 1.0)]);
    for _ in 0..3 * ATTEMPTS {
        assert_eq!(queue.next(false, now), Next::Load(key(1)));
        let pause = Duration::from_millis(20);
        assert_eq!(queue.set_back(key(1), Setback::Elsewhere(pause), now), 0);
        assert_eq!(queue.next(false, now), Next::Wait(Some(now + pause)));
        assert!(queue.failure(&key(1)).is_none() && !queue.is_idle());
        now += pause;
    }
    // A repository that is away is asked again soon, however often it was not there, and its tiles stay due.
    assert!(queue.away(&key(1)).is_none());
    for _ in 0..3 * ATTEMPTS {
        assert_eq!(queue.next(false, now), Next::Load(key(1)));
        let setback = Setback::Unreachable("gone".into());
        assert_eq!(queue.set_back(key(1), setback, now), 0);
        let Next::Wait(Some(again)) = queue.next(false, now) else {
            panic!("it must rest")
        };
        assert!(again <= now + UNREACHABLE_PAUSE);
        assert!(queue.failure(&key(1)).is_none() && !queue.is_idle());
        assert_eq!(&*queue.away(&key(1)).unwrap(), "gone");
        now = again;
    }
    // Once it answers, its tiles are like any other.
    assert_eq!(queue.next(false, now), Next::Load(key(1)));
    assert_eq!(
        queue.set_back(key(1), Setback::Failed("why".into()), now),
        1
    );
    assert!(queue.away(&key(1)).is_none());
}

proptest! {
    #[test]
    fn nothing_is_lost_or_loaded_twice(lists in prop::collection::vec(prop::collection::vec((0_u32..20, 0.0_f32..9.0), 0..10), 1..20)) {
        let (mut queue, now) = (Queue::default(), Instant::now());
        let mut flying: Vec<Key> = Vec::new();
        for (round, list) in lists.iter().enumerate() {
            wish(&mut queue, (round % 3) as u64, list);
            if let Next::Load(next) = queue.next(true, now) {
                prop_assert!(queue.is_wished(&next) && !flying.contains(&next));
                flying.push(next);
            }
            if round % 4 == 3 && let Some(key) = flying.pop() {
                queue.done(key);
            }
        }
        while let Next::Load(next) = queue.next(true, now) {
            prop_assert!(!flying.contains(&next));
            flying.push(next);
        }
        for key in flying {
            queue.done(key);
        }
        prop_assert!(queue.is_idle());
    }
}
