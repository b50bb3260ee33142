//! Which scene the picture shows, which it prepares, which must wait, and what the master is to hear of it.
//! In: scenes and views as they arrive, and what became of them. Out: the scene to prepare next, whether a
//! view can be drawn, words for the master. It opens no scene, draws nothing, sends nothing, reads no clock.
//!
//! A picture holds two scenes: the shown one and the one in preparation, which a newer one replaces. The
//! master sends a scene only when it has decided on the one before, but that one's first view may come
//! later than the next scene, since views travel on another way. So a scene is held back until the one in
//! preparation is shown, or until a view that was sent later than the new scene bears another revision.

mod queue;
#[cfg(test)]
mod tests;

use protocol::ToMaster;

pub(crate) use queue::SceneQueue;

/// What becomes of a view.
#[derive(Debug, PartialEq)]
pub(crate) enum Verdict {
    /// The picture has its scene.
    Draw,
    /// Its scene is on its way to the picture.
    Wait,
    /// It can never be drawn: a later view has another scene, or its own is not to be had. The latter is told
    /// to the master, once per revision.
    Never(Option<ToMaster>),
}

/// The scene in preparation.
#[derive(Debug)]
struct Preparation {
    revision: u64,
    /// The master knows that it is prepared.
    told: bool,
}

/// What the newest view says: the master showed this revision at this moment.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Current {
    revision: u64,
    sent_us: i64,
}

/// The scenes of one connection with a master. Revisions are numbers of that connection's master.
#[derive(Debug)]
pub(crate) struct Scenes<S> {
    /// The revision of the view that was drawn last.
    shown: Option<u64>,
    preparing: Option<Preparation>,
    /// Scenes that the picture has not been given.
    queue: SceneQueue<S>,
    /// The newest revision whose scene has arrived.
    newest: Option<u64>,
    current: Option<Current>,
    /// The picture has been given a scene.
    begun: bool,
    /// The scene that the picture refused last, and why.
    refused: Option<(u64, String)>,
    /// A scene that was handed out, and whose data is being opened.
    opening: Option<u64>,
    /// The newest revision of which the master knows that this node does not show it.
    complained: Option<u64>,
}

impl<S> Scenes<S> {
    /// Nothing has arrived.
    pub(crate) fn new() -> Self {
        Self {
            shown: None,
            preparing: None,
            queue: SceneQueue::default(),
            newest: None,
            current: None,
            begun: false,
            refused: None,
            opening: None,
            complained: None,
        }
    }

    /// Scenes have arrived. One that is not newer than all before is ignored: revisions rise.
    pub(crate) fn arrived(&mut self, mut scenes: SceneQueue<S>) {
        if let Some(newest) = self.newest {
            scenes.forget_before(newest.saturating_add(1));
        }
        self.newest = self.newest.max(scenes.newest());
        self.queue.append(scenes);
        if let Some(current) = self.current {
            self.queue.forget_before(current.revision);
        }
    }

    /// A view has arrived, or is looked at again. `sent_us`: when the master sent it, not later, on the
    /// clock by which scenes arrive.
    pub(crate) fn view(&mut self, revision: u64, sent_us: i64) -> Verdict {
        let seen = Current { revision, sent_us };
        if self.current.is_none_or(|current| seen > current) {
            self.current = Some(seen);
            self.queue.forget_before(revision);
        }
        if self.holds(revision) {
            return Verdict::Draw;
        }
        if self
            .current
            .is_some_and(|current| revision < current.revision)
        {
            return Verdict::Never(None);
        }
        let comes = self.queue.contains(revision) || self.opening == Some(revision);
        if comes || self.newest.is_none_or(|newest| newest < revision) {
            return Verdict::Wait;
        }
        Verdict::Never(self.complaint(revision))
    }

    /// Whether the picture can draw views of this revision.
    pub(crate) fn holds(&self, revision: u64) -> bool {
        let preparing = self.preparing.as_ref();
        self.shown == Some(revision) || preparing.is_some_and(|scene| scene.revision == revision)
    }

    /// The scene that the picture is to prepare now, if there is one. What becomes of it is to be told with
    /// [`Self::taken`] or [`Self::refused`].
    pub(crate) fn next_scene(&mut self) -> Option<(u64, S)> {
        while let Some((revision, next_at_us)) = self.queue.first_and_next() {
            if !self.is_over(revision, next_at_us) {
                break;
            }
            self.queue.pop();
        }
        let next_at_us = self.queue.first_at_us()?;
        match &self.preparing {
            Some(scene) if !self.is_over(scene.revision, next_at_us) => None,
            _ => self.queue.pop(),
        }
    }

    /// The scene that was handed out waits for its data; views of it wait with it.
    pub(crate) fn opens(&mut self, revision: u64) {
        self.opening = Some(revision);
    }

    /// The picture prepares this scene, or shows it if it is its first.
    pub(crate) fn taken(&mut self, revision: u64) {
        self.opening = None;
        self.begun = true;
        self.preparing = Some(Preparation {
            revision,
            told: false,
        });
    }

    /// The picture cannot show this scene and goes on as it was. Returns what to tell the master.
    pub(crate) fn refused(&mut self, revision: u64, reason: &str) -> ToMaster {
        self.opening = None;
        let first = !std::mem::replace(&mut self.begun, true);
        self.refused = Some((revision, reason.to_owned()));
        let is_shown = self
            .current
            .is_some_and(|current| current.revision >= revision);
        if first || is_shown {
            // The wall shows it already: nothing can be refused any longer, but people must know.
            self.complained = Some(revision);
            return ToMaster::Fault {
                message: reason.to_owned(),
            };
        }
        ToMaster::cannot_prepare(revision, reason)
    }

    /// A view of this revision was drawn, which the picture shows from now on; `prepared` is the revision
    /// that the picture calls prepared. Returns what to tell the master.
    pub(crate) fn drawn(&mut self, revision: u64, prepared: Option<u64>) -> Option<ToMaster> {
        if self
            .preparing
            .as_ref()
            .is_some_and(|scene| scene.revision == revision)
        {
            self.preparing = None;
        }
        self.shown = Some(revision);
        let scene = self.preparing.as_mut()?;
        if prepared != Some(scene.revision) || std::mem::replace(&mut scene.told, true) {
            return None;
        }
        Some(ToMaster::Prepared {
            revision: scene.revision,
        })
    }

    /// Whether a revision that is not shown yet never will be, given that a scene after it arrived at
    /// `next_at_us`. The master had decided by then.
    fn is_over(&self, revision: u64, next_at_us: i64) -> bool {
        self.current.is_some_and(|current| {
            current.revision > revision
                || (current.revision < revision && current.sent_us > next_at_us)
        })
    }

    /// Why the wall shows a revision and this node does not, unless the master knows.
    fn complaint(&mut self, revision: u64) -> Option<ToMaster> {
        if self.complained.is_some_and(|known| known >= revision) {
            return None;
        }
        self.complained = Some(revision);
        let reason = match &self.refused {
            Some((refused, reason)) if *refused == revision => reason.clone(),
            _ => "more scenes came than this node could take, and that one was left; the next change is \
                  shown again"
                .to_owned(),
        };
        let message =
            format!("the wall shows revision {revision} of the scene without this node: {reason}");
        Some(ToMaster::Fault { message })
    }
}
