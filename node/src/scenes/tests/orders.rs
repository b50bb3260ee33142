//! Random orders of scenes, views, refusals and reconnections, with a master and a picture that keep to their
//! contracts.
//! In: seeds. Out: nothing; a broken promise panics and names its seed. Time is a counter: nothing waits.

use std::collections::{BTreeMap, VecDeque};

use protocol::ToMaster;

use crate::scenes::{SceneQueue, Scenes, Verdict};

/// `SplitMix64`: Steele et al., "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }

    fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }
}

/// A master as `protocol::change` describes it: one revision in preparation, decided before the next is sent.
struct Master {
    shown: u64,
    preparing: Option<u64>,
    latest: u64,
    frame: u64,
}

/// A view on its way.
#[derive(Clone, Copy, Debug)]
struct SentView {
    frame: u64,
    revision: u64,
    sent_us: i64,
}

/// A picture that insists on its contract.
#[derive(Default)]
struct StrictPicture {
    shown: Option<u64>,
    preparing: Option<u64>,
    drawings_left: u32,
}

impl StrictPicture {
    fn prepare(&mut self, scene: u64, drawings: u32) {
        if self.shown.is_none() {
            self.shown = Some(scene);
        } else {
            self.preparing = Some(scene);
            self.drawings_left = drawings;
        }
    }

    fn draw(&mut self, scene: u64) -> Option<u64> {
        if self.preparing == Some(scene) {
            self.shown = self.preparing.take();
        }
        assert_eq!(
            self.shown,
            Some(scene),
            "a view of a scene that the picture does not hold"
        );
        self.drawings_left = self.drawings_left.saturating_sub(1);
        self.preparing.filter(|_| self.drawings_left == 0)
    }
}

/// One node, its master, the ways between them, and what has been promised.
struct World {
    random: Random,
    now_us: i64,
    run: u64,
    master: Master,
    stream: VecDeque<u64>,
    datagrams: Vec<SentView>,
    /// What the network's thread has put into the mailbox.
    inbox: SceneQueue<u64>,
    inbox_view: Option<SentView>,
    scenes: Scenes<u64>,
    picture: StrictPicture,
    /// The newest revision of a view that the node has seen.
    newest_seen: u64,
    early: Option<SentView>,
    accepted: Option<SentView>,
    drawn: Option<SentView>,
    /// Revisions of which the node has said that they are prepared, or that they cannot be.
    said: BTreeMap<u64, bool>,
    faults: Vec<String>,
    /// How often, out of 8, the picture refuses a scene.
    refusals: u64,
    counts: Counts,
}

#[derive(Debug, Default)]
struct Counts {
    shown: u32,
    shown_unprepared: u32,
    prepared: u32,
    refused: u32,
    held_back: u32,
    reconnections: u32,
    drawn: u32,
}

impl World {
    fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        let refusals = if random.one_in(2) { 0 } else { random.below(4) };
        let mut world = Self {
            random,
            now_us: 0,
            run: 0,
            master: Master {
                shown: 1,
                preparing: None,
                latest: 1,
                frame: 0,
            },
            stream: VecDeque::new(),
            datagrams: Vec::new(),
            inbox: SceneQueue::default(),
            inbox_view: None,
            scenes: Scenes::new(),
            picture: StrictPicture::default(),
            newest_seen: 0,
            early: None,
            accepted: None,
            drawn: None,
            said: BTreeMap::new(),
            faults: Vec::new(),
            refusals,
            counts: Counts::default(),
        };
        world.connect();
        world
    }

    /// Scenes of different masters differ though their revisions are the same.
    fn scene(&self, revision: u64) -> u64 {
        self.run * 1_000_000 + revision
    }

    fn connect(&mut self) {
        self.run += 1;
        let same_master = self.random.one_in(2);
        if !same_master {
            self.master = Master {
                shown: 1,
                preparing: None,
                latest: 1,
                frame: 0,
            };
        }
        self.stream.clear();
        self.datagrams.clear();
        self.inbox = SceneQueue::default();
        self.inbox_view = None;
        self.scenes = Scenes::new();
        self.newest_seen = 0;
        self.early = None;
        self.accepted = None;
        self.drawn = None;
        self.said.clear();
        self.faults.clear();
        self.stream.push_back(self.master.shown);
        self.stream.extend(self.master.preparing);
    }

    fn submit(&mut self) {
        if self.master.preparing.is_none() {
            self.master.latest += 1;
            self.master.preparing = Some(self.master.latest);
            self.stream.push_back(self.master.latest);
        }
    }

    /// The master decides on the revision in preparation, for whatever other nodes have said, and most
    /// often sends the next one at once.
    fn decide(&mut self) {
        let Some(revision) = self.master.preparing else {
            return;
        };
        let said = self.said.get(&revision).copied();
        if said.is_none() && !self.random.one_in(8) {
            return;
        }
        self.master.preparing = None;
        if said != Some(false) && !self.random.one_in(4) {
            self.counts.shown += 1;
            self.counts.shown_unprepared += u32::from(said.is_none());
            self.master.shown = revision;
        }
        if !self.random.one_in(4) {
            self.submit();
        }
    }

    fn send_view(&mut self) {
        self.master.frame += 1;
        self.datagrams.push(SentView {
            frame: self.master.frame,
            revision: self.master.shown,
            sent_us: self.now_us,
        });
    }

    fn deliver_scene(&mut self) {
        if let Some(revision) = self.stream.pop_front() {
            self.inbox
                .push(revision, self.now_us, self.run * 1_000_000 + revision);
        }
    }

    /// Any view that is on its way, or none: datagrams are lost and overtake each other.
    fn deliver_view(&mut self) {
        if self.datagrams.is_empty() {
            return;
        }
        let index = self.random.below(self.datagrams.len() as u64) as usize;
        let view = self.datagrams.remove(index);
        if self.random.one_in(6) {
            return;
        }
        self.inbox.forget_before(view.revision);
        self.inbox_view = Some(view);
    }

    fn receive(&mut self) {
        self.scenes.arrived(std::mem::take(&mut self.inbox));
        if let Some(view) = self.inbox_view.take() {
            self.view(view);
        }
    }

    fn view(&mut self, view: SentView) {
        let verdict = self.scenes.view(view.revision, view.sent_us);
        self.newest_seen = self.newest_seen.max(view.revision);
        if self.said.get(&view.revision) == Some(&true) {
            let past = self.newest_seen > view.revision;
            assert!(
                past || verdict == Verdict::Draw,
                "revision {} was prepared, and now: {verdict:?}",
                view.revision
            );
        }
        match verdict {
            Verdict::Draw => {
                if self
                    .accepted
                    .is_none_or(|accepted| accepted.frame < view.frame)
                    && self.drawn.is_none_or(|drawn| drawn.frame < view.frame)
                {
                    self.accepted = Some(view);
                }
            }
            Verdict::Wait => {
                self.counts.held_back += 1;
                if self.early.is_none_or(|early| early.frame < view.frame) {
                    self.early = Some(view);
                }
            }
            Verdict::Never(word) => {
                if let Some(ToMaster::Fault { message }) = word {
                    let revision = view.revision.to_string();
                    assert!(message.contains(&revision), "{message}");
                    assert!(!self.faults.contains(&message), "said twice: {message}");
                    self.faults.push(message);
                }
            }
        }
    }

    fn prepare(&mut self) {
        let Some((revision, scene)) = self.scenes.next_scene() else {
            return;
        };
        assert_eq!(scene, self.scene(revision), "a scene of another connection");
        if self.random.below(8) < self.refusals {
            match self.scenes.refused(revision, "no repository") {
                ToMaster::CannotPrepare { revision: of, .. } => {
                    assert_eq!(of, revision);
                    assert_eq!(self.said.insert(revision, false), None, "said twice");
                    self.counts.refused += 1;
                }
                ToMaster::Fault { .. } => {}
                other => panic!("{other:?}"),
            }
        } else {
            let drawings = self.random.below(4) as u32 + 1;
            self.picture.prepare(scene, drawings);
            self.scenes.taken(revision);
        }
        if let Some(view) = self.early.take() {
            self.view(view);
        }
    }

    fn draw(&mut self) {
        let Some(view) = self.accepted.take() else {
            return;
        };
        if !self.scenes.holds(view.revision) {
            assert!(
                self.scenes
                    .current
                    .is_some_and(|current| current.revision > view.revision),
                "the wall waits for a view that this node has taken and cannot draw"
            );
            return;
        }
        let scene = self.scene(view.revision);
        let prepared = self.picture.draw(scene);
        // What the last master asked for may still be in preparation; its number means nothing to this one.
        let prepared = prepared.filter(|scene| scene / 1_000_000 == self.run);
        let prepared = prepared.map(|scene| scene % 1_000_000);
        self.counts.drawn += 1;
        let before = self.drawn.replace(view);
        assert!(before.is_none_or(|before| before.revision <= view.revision));
        match self.scenes.drawn(view.revision, prepared) {
            None => {}
            Some(ToMaster::Prepared { revision }) => {
                assert_eq!(Some(revision), prepared);
                assert_eq!(self.said.insert(revision, true), None, "said twice");
                self.counts.prepared += 1;
            }
            Some(other) => panic!("{other:?}"),
        }
    }

    fn step(&mut self) {
        self.now_us += 1;
        match self.random.below(20) {
            0 | 1 => self.submit(),
            2 | 3 => self.decide(),
            4..=6 => self.send_view(),
            7..=9 => self.deliver_scene(),
            10..=12 => self.deliver_view(),
            13..=15 => self.receive(),
            16 | 17 => self.prepare(),
            18 => self.draw(),
            _ if self.random.one_in(60) => {
                self.counts.reconnections += 1;
                self.connect();
            }
            _ => self.draw(),
        }
    }

    /// The master changes nothing more, and everything arrives.
    fn settle(&mut self) {
        self.refusals = 0;
        while !self.stream.is_empty() {
            self.deliver_scene();
        }
        self.datagrams.clear();
        for _ in 0..20 {
            self.now_us += 1;
            self.send_view();
            let view = self.datagrams.pop().unwrap();
            self.inbox.forget_before(view.revision);
            self.inbox_view = Some(view);
            self.receive();
            self.prepare();
            self.draw();
        }
    }
}

#[test]
fn no_order_of_events_loses_a_scene_or_draws_a_view_with_another_ones() {
    let mut sum = Counts::default();
    for seed in 0..20_000 {
        let outcome = std::panic::catch_unwind(|| {
            let mut world = World::new(seed);
            (0..400).for_each(|_| world.step());
            world.settle();
            let shown = world.master.shown;
            let unable =
                world.said.get(&shown) == Some(&false) || world.scenes.complained == Some(shown);
            let latest = world.drawn.map(|view| (view.revision, view.frame));
            if unable {
                assert!(latest.is_none_or(|(revision, _)| revision < shown));
                // A change that can be shown brings the node back.
                world.master.preparing = None;
                world.submit();
                world.master.shown = world.master.latest;
                world.master.preparing = None;
                world.settle();
                let latest = world.drawn.map(|view| (view.revision, view.frame));
                assert_eq!(latest, Some((world.master.shown, world.master.frame)));
            } else {
                assert_eq!(latest, Some((shown, world.master.frame)), "it stands still");
                if let Some(preparing) = world.master.preparing
                    && !world.said.contains_key(&preparing)
                {
                    panic!("revision {preparing} is waited for in vain");
                }
            }
            world.counts
        });
        let counts = outcome.unwrap_or_else(|_| panic!("seed {seed}"));
        sum.shown += counts.shown;
        sum.shown_unprepared += counts.shown_unprepared;
        sum.prepared += counts.prepared;
        sum.refused += counts.refused;
        sum.held_back += counts.held_back;
        sum.reconnections += counts.reconnections;
        sum.drawn += counts.drawn;
    }
    // Every kind of event has happened often.
    for often in [
        sum.shown,
        sum.shown_unprepared,
        sum.prepared,
        sum.refused,
        sum.held_back,
        sum.reconnections,
        sum.drawn,
    ] {
        assert!(often > 5_000, "{sum:?}");
    }
}
