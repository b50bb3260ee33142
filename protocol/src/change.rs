//! How a change of the scene reaches the wall: which revision is shown, which one nodes prepare, and which
//! one waits. In: submissions, what nodes say, who is waited for, time. Out: [`ChangeAction`]s. It holds no
//! scene, sends nothing and reads no clock: the caller keeps the scene of each revision that is still alive.
//!
//! Rules:
//! - At most one revision is in preparation and at most one is queued behind it. A later submission takes
//!   the queued one's place, so of sixty changes a second only those are prepared that the wall can follow.
//! - The revision in preparation is shown when every member has prepared it, or when it has been in
//!   preparation for [`PATIENCE_US`]; without members it is shown at once. Then the queued one is sent.
//! - A node may prepare before it is a member: what it said counts from the moment it is one. What a node
//!   had prepared is lost with its link ([`Changes::disconnected`]), not with its membership.
//! - A revision that a member cannot prepare is refused and never shown; the wall stays as it is and the
//!   queued one is sent. A connected node that is no member cannot hold the wall up: its refusal counts once
//!   it becomes a member, if the revision is then still in preparation.
//!
//! What a refusal means for later changes: each revision is a whole scene, made by changing the newest one
//! ([`Changes::newest`]). A revision that was queued behind a refused one therefore holds the refused change
//! too. It is prepared all the same, because it may have set right what was wrong; if it has not, a node
//! refuses it as well. Once nothing is left in preparation, the newest revision is the shown one again: a
//! change that was made on top of a refused revision does not fit any longer, and its author, who named
//! that revision as base, is told so. Numbers are never used twice.

use std::collections::{BTreeMap, BTreeSet};

use crate::barrier::NodeId;

/// How long members may prepare a revision before it is shown without them, in microseconds. A wall on a software driver
/// takes a second or two for a change of every tile; what is shown unprepared is coarse for as long.
pub const PATIENCE_US: i64 = 5_000_000;

/// What the master has to do, in this order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ChangeAction {
    /// Send the scene of this revision to every connected node, to be prepared. Nodes that connect later
    /// are sent the shown scene and then this one. Comes exactly once for each revision that was not
    /// superseded, and before all that is said of it here.
    Send {
        /// The revision.
        revision: u64,
    },
    /// Put this revision into the next view.
    Show {
        /// The revision.
        revision: u64,
        /// Members that have not prepared it; not empty only if patience was over.
        unprepared: Vec<NodeId>,
    },
    /// A queued revision was overtaken by a later one. It was sent to nobody.
    Superseded {
        /// The revision.
        revision: u64,
    },
    /// A member cannot prepare the revision in preparation. It will never be shown.
    Refused {
        /// The revision.
        revision: u64,
        /// The first member that cannot prepare it.
        node: NodeId,
        /// Why, in the node's words.
        reason: String,
    },
}

/// The revisions of a running wall's scene.
#[derive(Clone, Debug)]
pub struct Changes {
    shown: u64,
    /// The number given out last.
    latest: u64,
    preparing: Option<Preparation>,
    queued: Option<u64>,
    members: BTreeSet<NodeId>,
}

/// The revision in preparation.
#[derive(Clone, Debug)]
struct Preparation {
    revision: u64,
    since_us: i64,
    /// What connected nodes have said of it, members or not.
    answers: BTreeMap<NodeId, Answer>,
}

#[derive(Clone, Debug)]
enum Answer {
    Prepared,
    Cannot { reason: String },
}

impl Changes {
    /// A wall that shows its first scene, and has no members yet.
    #[must_use]
    pub fn new(first_revision: u64) -> Self {
        Self {
            shown: first_revision,
            latest: first_revision,
            preparing: None,
            queued: None,
            members: BTreeSet::new(),
        }
    }

    /// A valid change of the newest scene was accepted; `members` are waited for from now on. Returns the
    /// new revision's number, larger than all before.
    #[must_use = "the actions are to be performed"]
    pub fn submit(&mut self, members: &BTreeSet<NodeId>, now_us: i64) -> (u64, Vec<ChangeAction>) {
        self.members.clone_from(members);
        self.latest += 1;
        let mut actions = Vec::new();
        if let Some(revision) = self.queued.replace(self.latest) {
            actions.push(ChangeAction::Superseded { revision });
        }
        self.advance(false, now_us, &mut actions);
        (self.latest, actions)
    }

    /// A connected node has prepared a revision. What is said of another one than that in preparation comes
    /// late and changes nothing.
    #[must_use = "the actions are to be performed"]
    pub fn prepared(&mut self, node: NodeId, revision: u64, now_us: i64) -> Vec<ChangeAction> {
        self.answer(node, revision, Answer::Prepared, now_us)
    }

    /// A connected node cannot prepare a revision. If it is not in preparation any longer, nothing happens:
    /// one that was shown because patience was over stays shown, and the node falls behind by its own
    /// fault.
    #[must_use = "the actions are to be performed"]
    pub fn cannot_prepare(
        &mut self,
        node: NodeId,
        revision: u64,
        reason: String,
        now_us: i64,
    ) -> Vec<ChangeAction> {
        self.answer(node, revision, Answer::Cannot { reason }, now_us)
    }

    /// A node's link is gone, and with it what it had prepared. To be called before the node's next link
    /// says anything; whether it was a member is told by [`Changes::members`].
    pub fn disconnected(&mut self, node: NodeId) {
        if let Some(preparation) = &mut self.preparing {
            preparation.answers.remove(&node);
        }
    }

    /// Who is waited for has changed, or may have.
    #[must_use = "the actions are to be performed"]
    pub fn members(&mut self, members: &BTreeSet<NodeId>, now_us: i64) -> Vec<ChangeAction> {
        self.members.clone_from(members);
        let mut actions = Vec::new();
        self.advance(false, now_us, &mut actions);
        actions
    }

    /// Time has passed. To be called at [`Changes::next_wake_us`], after all messages that have arrived: a
    /// master that was itself held up shall not blame nodes whose answers it has not read.
    #[must_use = "the actions are to be performed"]
    pub fn tick(&mut self, now_us: i64) -> Vec<ChangeAction> {
        let mut actions = Vec::new();
        let patience_over = self.next_wake_us().is_some_and(|wake_us| now_us >= wake_us);
        self.advance(patience_over, now_us, &mut actions);
        actions
    }

    /// When [`Changes::tick`] is due next: when patience with the revision in preparation is over.
    #[must_use]
    pub fn next_wake_us(&self) -> Option<i64> {
        let since_us = self.preparing.as_ref()?.since_us;
        Some(since_us.saturating_add(PATIENCE_US))
    }

    /// The revision that views bear.
    #[must_use]
    pub fn shown(&self) -> u64 {
        self.shown
    }

    /// The newest revision that is, or may still be, shown: the one to make the next change on. Goes back
    /// when it is refused.
    #[must_use]
    pub fn newest(&self) -> u64 {
        self.queued.or(self.preparing()).unwrap_or(self.shown)
    }

    /// The revision in preparation. Without one nothing is queued either: the wall shows the newest.
    #[must_use]
    pub fn preparing(&self) -> Option<u64> {
        self.preparing
            .as_ref()
            .map(|preparation| preparation.revision)
    }

    /// The revision that is sent next.
    #[must_use]
    pub fn queued(&self) -> Option<u64> {
        self.queued
    }

    fn answer(
        &mut self,
        node: NodeId,
        revision: u64,
        answer: Answer,
        now_us: i64,
    ) -> Vec<ChangeAction> {
        let mut actions = Vec::new();
        if let Some(preparation) = &mut self.preparing
            && preparation.revision == revision
        {
            preparation.answers.insert(node, answer);
            self.advance(false, now_us, &mut actions);
        }
        actions
    }

    /// Does all that can be done at this moment. Patience may be over only with the revision that is in
    /// preparation at the beginning: those sent here have all of it before them.
    fn advance(&mut self, patience_over: bool, now_us: i64, actions: &mut Vec<ChangeAction>) {
        let mut patience_over = patience_over;
        loop {
            let Some(preparation) = self.preparing.take() else {
                let Some(revision) = self.queued.take() else {
                    return;
                };
                actions.push(ChangeAction::Send { revision });
                self.preparing = Some(Preparation {
                    revision,
                    since_us: now_us,
                    answers: BTreeMap::new(),
                });
                continue;
            };
            match preparation.verdict(&self.members, patience_over) {
                Some(action) => {
                    if let ChangeAction::Show { revision, .. } = action {
                        self.shown = revision;
                    }
                    actions.push(action);
                    patience_over = false;
                }
                None => {
                    self.preparing = Some(preparation);
                    return;
                }
            }
        }
    }
}

impl Preparation {
    /// What becomes of the revision; `None`: it is waited for.
    fn verdict(&self, members: &BTreeSet<NodeId>, patience_over: bool) -> Option<ChangeAction> {
        let revision = self.revision;
        let mut unprepared = Vec::new();
        for node in members {
            match self.answers.get(node) {
                Some(Answer::Prepared) => {}
                Some(Answer::Cannot { reason }) => {
                    return Some(ChangeAction::Refused {
                        revision,
                        node: *node,
                        reason: reason.clone(),
                    });
                }
                None => unprepared.push(*node),
            }
        }
        (unprepared.is_empty() || patience_over).then_some(ChangeAction::Show {
            revision,
            unprepared,
        })
    }
}
