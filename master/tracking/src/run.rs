//! The one task of all trackers. In: configurations, sockets, the clock. Out: snapshots. Every source is a future
//! of its own, polled in turn, so that none that floods or hangs keeps the others waiting. It decides nothing
//! about poses.

mod backoff;
mod board;
mod dtrack_source;
mod vrpn_connect;
mod vrpn_source;

use std::collections::BTreeMap;
use std::future::poll_fn;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use crate::config::{ConfigError, Source, TrackerConfig};
use crate::tracking::{Clock, Snapshot};
use board::Board;

/// How often heads are looked at whether they are lost.
const TICK: Duration = Duration::from_millis(50);

/// After this many reads in a row a source lets the others read.
const READS_IN_A_TURN: u32 = 32;

type Work = Pin<Box<dyn Future<Output = ()> + Send>>;

/// The board, and the clock by which everything is written on it. Locked only between two waits.
#[derive(Clone)]
struct Shared {
    board: Arc<Mutex<Board>>,
    clock: Clock,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_us(&self) -> i64 {
        (self.clock)()
    }
}

/// Counts the reads of a source: one that is flooded never waits, so it must give way.
#[derive(Default)]
struct Turn(u32);

impl Turn {
    async fn read_one(&mut self) {
        self.0 += 1;
        if self.0 >= READS_IN_A_TURN {
            self.0 = 0;
            tokio::task::yield_now().await;
        }
    }
}

/// The task's future, which never ends.
pub(crate) fn work(
    trackers: &[TrackerConfig],
    clock: Clock,
    publisher: watch::Sender<Arc<Snapshot>>,
) -> Result<impl Future<Output = ()> + Send + use<>, ConfigError> {
    let shared = Shared {
        board: Arc::new(Mutex::new(Board::new(trackers, publisher)?)),
        clock,
    };
    shared.lock().publish(shared.now_us());
    // One connection for all devices of a server, one socket for all bodies of a port.
    let mut servers: BTreeMap<(String, u16), Vec<Arc<str>>> = BTreeMap::new();
    let mut ports: Vec<String> = Vec::new();
    for tracker in trackers {
        match &tracker.source {
            Source::Vrpn { device, host, port } => {
                let devices = servers.entry((host.clone(), *port)).or_default();
                if !devices.iter().any(|known| **known == **device) {
                    devices.push(device.as_str().into());
                }
            }
            Source::Dtrack { listen } => {
                if !ports.contains(listen) {
                    ports.push(listen.clone());
                }
            }
        }
    }
    let mut sources: Vec<Work> = vec![Box::pin(tick(shared.clone()))];
    for ((host, port), devices) in servers {
        sources.push(Box::pin(vrpn_source::follow(
            host,
            port,
            devices,
            shared.clone(),
        )));
    }
    for listen in ports {
        sources.push(Box::pin(dtrack_source::follow(listen, shared.clone())));
    }
    Ok(in_turn(sources))
}

/// Polls all, and begins each time with another: tokio lets a task read only so much before other tasks run, and
/// the first must not always take it all.
async fn in_turn(mut sources: Vec<Work>) {
    let mut first = 0;
    poll_fn(move |context| {
        let count = sources.len();
        first = (first + 1) % count.max(1);
        let (early, late) = sources.split_at_mut(first.min(count));
        for source in late.iter_mut().chain(early) {
            // None of them ends.
            let _: Poll<()> = source.as_mut().poll(context);
        }
        Poll::<()>::Pending
    })
    .await;
}

async fn tick(shared: Shared) {
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        interval.tick().await;
        let now_us = shared.now_us();
        shared.lock().advance(now_us);
    }
}
