//! Between the network thread and the frame loop: slots of which the newest content counts, and short queues.
//! In: what the master said, from the network; what the frame loop has to say. Out: the same, on the other
//! side. Neither side ever waits for the other, and nothing here grows without bound.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use protocol::clock::ClockEstimate;
use protocol::message::Swap;
use protocol::pattern::Pattern;
use protocol::{Scene, ToMaster, View, Wall};
use tokio::sync::Notify;

use crate::picture::OutputImage;
use crate::scenes::SceneQueue;
use crate::session::SessionError;

/// Most messages that wait for the network. A master that takes none for so long is about to be given up.
const LONGEST_QUEUE: usize = 512;

/// Wakes whoever drives the frame loop, for example a window system's event loop.
pub(crate) type Waker = Arc<dyn Fn() + Send + Sync>;

/// Something that arrived, and when on this host's clock.
#[derive(Clone, Debug)]
pub(crate) struct Arrived<T> {
    pub(crate) content: T,
    pub(crate) at_us: i64,
}

/// What the master has said since the frame loop last looked.
#[derive(Debug, Default)]
pub(crate) struct Inbox {
    /// A master has welcomed this node: its wall, and this node's index into the hosts. Whatever came
    /// before from another connection is gone.
    pub(crate) welcome: Option<(Arc<Wall>, usize)>,
    /// Scenes that the master may still show, in the order in which they arrived.
    pub(crate) scenes: SceneQueue<Box<Scene>>,
    /// The newest measures of the wall, and their revision.
    pub(crate) wall: Option<(u32, Arc<Wall>)>,
    /// What outputs are to show instead of the scene.
    pub(crate) patterns: Option<Vec<Option<Pattern>>>,
    /// The newest view.
    pub(crate) view: Option<Arrived<View>>,
    /// Swaps in the order in which they arrived; the network keeps the newest few.
    pub(crate) swaps: VecDeque<Arrived<Swap>>,
    /// Send the pictures.
    pub(crate) capture: Option<u32>,
    /// Measure the error of the picture that stands.
    pub(crate) measure_error: bool,
    /// Say good-bye and leave.
    pub(crate) leave: bool,
    /// The connection is over; the session looks for a master again.
    pub(crate) disconnected: bool,
    /// There will be no further connection.
    pub(crate) ended: Option<End>,
}

impl Inbox {
    /// A view takes the place of the one before, and scenes that its own has replaced are forgotten.
    pub(crate) fn put_view(&mut self, view: Arrived<View>) {
        self.scenes.forget_before(view.content.scene_revision);
        self.view = Some(view);
    }
}

/// Why a session is over for good.
#[derive(Debug)]
pub(crate) enum End {
    /// The node has left.
    Left,
    /// It can never join this master.
    Failed(SessionError),
}

/// What the frame loop has to say.
#[derive(Debug)]
pub(crate) enum Outgoing {
    /// Small, and said again if it is lost: leaves as a datagram.
    Datagram(ToMaster),
    /// Arrives in any case.
    Message(ToMaster),
    /// Captured pictures: number of the capture, one image per output.
    Pictures(u32, Vec<OutputImage>),
}

#[derive(Default)]
struct State {
    inbox: Inbox,
    filled: bool,
    outgoing: VecDeque<Outgoing>,
    stop: bool,
}

/// The two-way mailbox of a node.
pub(crate) struct Mail {
    state: Mutex<State>,
    arrived: Condvar,
    to_send: Notify,
    clock: Mutex<ClockEstimate>,
    waker: Option<Waker>,
}

impl Mail {
    /// `waker` is called after each arrival; `None` if the frame loop waits in [`Self::wait`].
    pub(crate) fn new(waker: Option<Waker>) -> Self {
        Self {
            state: Mutex::default(),
            arrived: Condvar::new(),
            to_send: Notify::new(),
            clock: Mutex::default(),
            waker,
        }
    }

    /// The network's side: puts something into the inbox and wakes the frame loop.
    pub(crate) fn deliver(&self, put: impl FnOnce(&mut Inbox)) {
        let mut state = self.lock();
        put(&mut state.inbox);
        state.filled = true;
        drop(state);
        match &self.waker {
            Some(waker) => waker(),
            None => self.arrived.notify_one(),
        }
    }

    /// The network's side: everything that waits to be sent, and whether this node is to leave.
    pub(crate) fn take_outgoing(&self) -> (VecDeque<Outgoing>, bool) {
        let mut state = self.lock();
        (std::mem::take(&mut state.outgoing), state.stop)
    }

    /// The network's side: waits until there is something to send. A wake-up is never lost.
    pub(crate) async fn to_send(&self) {
        self.to_send.notified().await;
    }

    /// Works on this node's estimate of the master's clock.
    pub(crate) fn clock<T>(&self, work: impl FnOnce(&mut ClockEstimate) -> T) -> T {
        work(&mut self.clock.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The frame loop's side: what has arrived since the last call.
    pub(crate) fn take_inbox(&self) -> Option<Inbox> {
        let mut state = self.lock();
        std::mem::take(&mut state.filled).then(|| std::mem::take(&mut state.inbox))
    }

    /// The frame loop's side: waits until something has arrived, or until `deadline_us` on this host's
    /// clock.
    pub(crate) fn wait(&self, deadline_us: Option<i64>) {
        let mut state = self.lock();
        while !state.filled {
            state = match deadline_us {
                None => self
                    .arrived
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner),
                Some(deadline_us) => {
                    let left_us = deadline_us.saturating_sub(link::now_us());
                    if left_us <= 0 {
                        return;
                    }
                    let left = Duration::from_micros(left_us.unsigned_abs());
                    self.arrived
                        .wait_timeout(state, left)
                        .unwrap_or_else(PoisonError::into_inner)
                        .0
                }
            };
        }
    }

    /// The frame loop's side: says something. What is not urgent leaves with the next urgent word or the
    /// network's next own activity, so that it does not wake the network in the moment of presentation.
    pub(crate) fn send(&self, outgoing: Outgoing, urgent: bool) {
        let mut state = self.lock();
        if state.outgoing.len() == LONGEST_QUEUE {
            state.outgoing.pop_front();
        }
        state.outgoing.push_back(outgoing);
        drop(state);
        if urgent {
            self.to_send.notify_one();
        }
    }

    /// The frame loop's side: this node is to leave.
    pub(crate) fn request_stop(&self) {
        self.lock().stop = true;
        self.to_send.notify_one();
    }

    /// A panic on the other side leaves the slots in order: each change is one assignment.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]

    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    fn bye(number: usize) -> Outgoing {
        Outgoing::Message(ToMaster::Bye {
            reason: number.to_string(),
        })
    }

    #[test]
    fn what_has_arrived_is_taken_once_and_ends_a_wait() {
        let mail = Arc::new(Mail::new(None));
        assert!(mail.take_inbox().is_none());
        let start_us = link::now_us();
        mail.wait(Some(start_us + 3_000));
        assert!(link::now_us() >= start_us + 3_000);
        let network = Arc::clone(&mail);
        let thread = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(5));
            network.deliver(|inbox| inbox.capture = Some(1));
            network.deliver(|inbox| inbox.leave = true);
        });
        mail.wait(None);
        thread.join().unwrap();
        let inbox = mail.take_inbox().unwrap();
        assert_eq!((inbox.capture, inbox.leave), (Some(1), true));
        assert!(mail.take_inbox().is_none());
    }

    #[test]
    fn a_network_that_takes_nothing_costs_the_oldest_words_and_no_memory() {
        let mail = Mail::new(None);
        (0..LONGEST_QUEUE + 3).for_each(|number| mail.send(bye(number), false));
        let (outgoing, stop) = mail.take_outgoing();
        assert_eq!((outgoing.len(), stop), (LONGEST_QUEUE, false));
        let first = format!("{:?}", outgoing.front().unwrap());
        assert!(first.contains("\"3\""), "{first}");
        mail.request_stop();
        assert!(mail.take_outgoing().1);
    }

    #[test]
    fn a_driver_that_waits_elsewhere_is_woken_by_every_delivery() {
        let calls = Arc::new(AtomicU32::new(0));
        let counter = Arc::clone(&calls);
        let mail = Mail::new(Some(Arc::new(move || {
            counter.fetch_add(1, Ordering::SeqCst);
        })));
        mail.deliver(|inbox| inbox.leave = true);
        mail.deliver(|inbox| inbox.disconnected = true);
        assert_eq!(calls.load(Ordering::SeqCst), 2);
    }
}
