//! Changes of the scene in the frame loop: taken in, sent to be prepared, shown, refused.
//! In: proposals, what nodes say of revisions, lenses that are dragged. Out: scenes to the nodes, notices. Which
//! revision is due, `protocol::change` decides. It must not parse or validate: proposals are valid.

use std::collections::BTreeSet;
use std::sync::Arc;

use protocol::Scene;
use protocol::barrier::NodeId;
use protocol::change::ChangeAction;
use protocol::message::MoveLens;

use super::{FrameLoop, Phase};
use crate::change::{Declined, Proposal, RefusedChange, Snapshot};
use crate::lens;
use crate::notice::Notice;

impl FrameLoop {
    /// How the scene stands.
    pub(super) fn snapshot(&self) -> Snapshot {
        let newest = self.changes.newest();
        Snapshot {
            newest,
            revision: Arc::clone(self.director.revision(newest)),
            shown: self.changes.shown(),
            next: self.latest_revision + 1,
            refused: self.refused.clone(),
        }
    }

    /// Takes a change that was made of the newest revision; returns its number.
    pub(super) fn propose(&mut self, proposal: Proposal) -> Result<u64, Declined> {
        let open = match &self.phase {
            Phase::Gathering | Phase::WarmingUp | Phase::Running { .. } => true,
            // All pictures must show the same scene.
            Phase::Settling { capture, .. } => !capture.has_begun(),
            Phase::LastReports { .. } | Phase::Measuring(_) | Phase::Leaving { .. } => false,
        };
        if !open {
            return Err(Declined::Over);
        }
        let snapshot = self.snapshot();
        if (proposal.base, proposal.number) != (snapshot.newest, snapshot.next) {
            return Err(Declined::Raced(snapshot));
        }
        let now_us = link::now_us();
        let (number, actions) = self.changes.submit(&self.members(), now_us);
        debug_assert_eq!(number, proposal.number, "numbers rise by one");
        self.latest_revision = number;
        self.recorder.change_submitted(number, now_us);
        self.director.expect(number, proposal.revision);
        self.change(actions);
        Ok(number)
    }

    /// Shows another scene, whatever the present one is.
    pub(super) fn set_scene(&mut self, scene: Scene) {
        match Proposal::new(&self.snapshot(), scene) {
            Ok(proposal) => {
                // Made of the snapshot of this moment, it can only come after the last frame.
                let _too_late = self.propose(proposal);
            }
            Err(error) => self.recorder.error(error.to_string()),
        }
    }

    /// A lens is dragged in a node's window.
    pub(super) fn move_lens(&mut self, node: NodeId, place: &MoveLens) {
        let newest = Arc::clone(self.director.revision(self.changes.newest()));
        let Some(dragged) = self.dragged.get_mut(node) else {
            return;
        };
        if place.grab || dragged.is_none() {
            *dragged = lens::under(&newest.scene, place);
        }
        let moved = dragged.as_deref();
        let moved = moved.and_then(|name| lens::moved(&newest.scene, name, place));
        if let Some(scene) = moved {
            self.set_scene(scene);
        }
    }

    /// A node has prepared a revision.
    pub(super) fn prepared(&mut self, node: NodeId, revision: u64) {
        let actions = self.changes.prepared(node, revision, link::now_us());
        self.change(actions);
    }

    /// A node cannot prepare a revision.
    pub(super) fn cannot_prepare(&mut self, node: NodeId, revision: u64, reason: String) {
        if revision == self.changes.shown() {
            // It was shown without this node, which now lacks it.
            self.fault(
                node,
                format!("it cannot show revision {revision}: {reason}"),
            );
        }
        let now_us = link::now_us();
        let actions = self.changes.cannot_prepare(node, revision, reason, now_us);
        self.change(actions);
    }

    /// Time has passed, or who is waited for may have changed.
    pub(super) fn look_after_changes(&mut self, now_us: i64) {
        if self.changes.preparing().is_none() {
            // The next submission names the members.
            return;
        }
        let mut actions = self.changes.members(&self.members(), now_us);
        actions.extend(self.changes.tick(now_us));
        self.change(actions);
    }

    /// Nodes that are waited for.
    fn members(&self) -> BTreeSet<NodeId> {
        let records = self.membership.nodes().iter().enumerate();
        records
            .filter_map(|(node, record)| record.member.then_some(node))
            .collect()
    }

    fn change(&mut self, actions: Vec<ChangeAction>) {
        for action in actions {
            match action {
                ChangeAction::Send { revision } => {
                    let scene = Arc::clone(&self.director.revision(revision).encoded);
                    for node in 0..self.links.len() {
                        self.tell(node, &scene);
                    }
                }
                ChangeAction::Show {
                    revision,
                    unprepared,
                } => {
                    self.director.show(revision);
                    self.recorder.scene(self.director.encoded_scene().len());
                    // One that no frame has shown was overtaken, although nobody had to wait for it.
                    if let Some((overtaken, _)) = self.unseen.replace((revision, unprepared.len()))
                    {
                        self.recorder.change_superseded(overtaken);
                    }
                    let unprepared = unprepared.into_iter().map(|node| self.name(node));
                    let unprepared = unprepared.collect();
                    self.notices.send(Notice::ChangeShown {
                        revision,
                        unprepared,
                    });
                }
                ChangeAction::Superseded { revision } => {
                    self.director.forget(revision);
                    self.recorder.change_superseded(revision);
                }
                ChangeAction::Refused {
                    revision,
                    node,
                    reason,
                } => {
                    self.director.forget(revision);
                    self.recorder.change_refused(revision);
                    let node = self.name(node);
                    self.recorder.error(format!(
                        "revision {revision} of the scene was refused by node \"{node}\": {reason}"
                    ));
                    self.refused = Some(RefusedChange {
                        revision,
                        node: node.clone(),
                        reason: reason.clone(),
                    });
                    self.notices.send(Notice::ChangeRefused {
                        revision,
                        node,
                        reason,
                    });
                }
            }
        }
    }
}
