//! What `Changes` may do, written from the rules alone: every action of the simulated wall is checked when
//! it happens, and the state after every event.
//! In: actions, and the world that they happen in. Out: a failed test, or the revisions' fates. It knows
//! nothing of how `Changes` works inside.

use protocol::change::{ChangeAction, PATIENCE_US};

use super::world::{Fate, World};

impl World {
    /// Every action must be allowed at this very moment.
    pub(super) fn act(&mut self, action: ChangeAction, leaving: bool) {
        let (seed, now_us) = (self.seed, self.now_us);
        let in_preparation = self.in_preparation();
        match action {
            ChangeAction::Send { revision } => {
                assert_eq!(in_preparation, None, "seed {seed}: two in preparation");
                assert_eq!(
                    self.fates[&revision],
                    Fate::Waiting,
                    "seed {seed}: {revision}"
                );
                let overtaking = self.fates.range(revision + 1..).next();
                assert_eq!(
                    overtaking, None,
                    "seed {seed}: {revision} is not the latest"
                );
                self.fates
                    .insert(revision, Fate::InPreparation { sent_us: now_us });
                self.answers.clear();
                for node in 0..self.conditions.nodes {
                    self.send(node, revision);
                }
            }
            ChangeAction::Show {
                revision,
                unprepared,
            } => {
                let (preparing, sent_us) = in_preparation.unwrap();
                assert_eq!(preparing, revision, "seed {seed}");
                let missing: Vec<usize> = self.missing().collect();
                assert_eq!(unprepared, missing, "seed {seed}: {revision}");
                assert!(
                    missing.is_empty() || now_us >= sent_us + PATIENCE_US,
                    "seed {seed}: {revision} is shown too early"
                );
                let later = self.fates.range(revision + 1..);
                for (other, fate) in later {
                    assert!(
                        !matches!(fate, Fate::Shown { .. }),
                        "seed {seed}: {other} came first"
                    );
                }
                self.fates.insert(revision, Fate::Shown { at_us: now_us });
                self.tallies.shown += 1;
                self.tallies.unprepared += u64::from(!missing.is_empty());
                self.tallies.without_members += u64::from(self.members.is_empty());
                self.tallies.by_leaving += u64::from(leaving && !self.members.is_empty());
            }
            ChangeAction::Superseded { revision } => {
                assert_eq!(
                    self.fates[&revision],
                    Fate::Waiting,
                    "seed {seed}: {revision}"
                );
                self.fates.insert(revision, Fate::Superseded);
                self.tallies.superseded += 1;
            }
            ChangeAction::Refused {
                revision,
                node,
                reason,
            } => {
                assert_eq!(in_preparation.unwrap().0, revision, "seed {seed}");
                assert!(
                    self.members.contains(&node),
                    "seed {seed}: {node} is no member"
                );
                assert_eq!(self.answers.get(&node), Some(&false), "seed {seed}");
                assert_eq!(reason, format!("{node}"), "seed {seed}");
                self.fates.insert(revision, Fate::Refused);
                self.tallies.refused += 1;
            }
        }
    }

    /// What must hold after every event.
    pub(super) fn check_state(&self) {
        let seed = self.seed;
        let in_preparation = self.in_preparation();
        assert_eq!(
            self.changes.preparing(),
            in_preparation.map(|(revision, _)| revision)
        );
        let waiting = self
            .fates
            .iter()
            .filter(|(_, fate)| **fate == Fate::Waiting);
        let waiting: Vec<u64> = waiting.map(|(revision, _)| *revision).collect();
        assert!(
            waiting.len() <= 1,
            "seed {seed}: {waiting:?} are all queued"
        );
        assert_eq!(
            self.changes.queued(),
            waiting.first().copied(),
            "seed {seed}"
        );
        let shown = |fate: &Fate| matches!(fate, Fate::Shown { .. });
        let alive = |fate: &Fate| !matches!(fate, Fate::Superseded | Fate::Refused);
        let newest_of = |is: &dyn Fn(&Fate) -> bool| {
            let mut found = self.fates.iter().rev().filter(|(_, fate)| is(fate));
            found.next().map(|(revision, _)| *revision)
        };
        assert_eq!(Some(self.changes.shown()), newest_of(&shown), "seed {seed}");
        assert_eq!(
            Some(self.changes.newest()),
            newest_of(&alive),
            "seed {seed}"
        );
        // Nothing is waited for in vain: someone is to answer, nobody has refused, time is not over.
        match in_preparation {
            Some((revision, sent_us)) => {
                let refused = |node: &usize| self.answers.get(node) == Some(&false);
                assert!(
                    self.missing().next().is_some(),
                    "seed {seed}: {revision} waits for nobody"
                );
                assert!(
                    !self.members.iter().any(refused),
                    "seed {seed}: {revision} was refused"
                );
                assert_eq!(
                    self.changes.next_wake_us(),
                    Some(sent_us + PATIENCE_US),
                    "seed {seed}"
                );
                assert!(
                    self.now_us <= sent_us + PATIENCE_US,
                    "seed {seed}: {revision} is overdue"
                );
            }
            None => {
                assert!(
                    waiting.is_empty(),
                    "seed {seed}: {waiting:?} wait for nothing"
                );
                assert_eq!(self.changes.next_wake_us(), None, "seed {seed}");
            }
        }
    }

    /// Members that have not said that they have prepared.
    fn missing(&self) -> impl Iterator<Item = usize> + '_ {
        let prepared = |node: &usize| self.answers.get(node) == Some(&true);
        self.members
            .iter()
            .copied()
            .filter(move |node| !prepared(node))
    }

    fn in_preparation(&self) -> Option<(u64, i64)> {
        let mut found = self.fates.iter().filter_map(|(revision, fate)| match fate {
            Fate::InPreparation { sent_us } => Some((*revision, *sent_us)),
            _ => None,
        });
        let first = found.next();
        assert_eq!(found.next(), None, "seed {}: two in preparation", self.seed);
        first
    }
}
