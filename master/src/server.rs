//! The listening side: takes peers that prove membership and gives each a task of its own.
//! In: a listening endpoint. Out: events. A flood of strangers costs a bounded number of handshakes and
//! never touches the frame loop.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use link::Server;
use tokio::sync::Semaphore;

use crate::events::Event;
use crate::session::{Context, serve};

/// Handshakes at the same time; a wall's worth of nodes may start at once.
const HANDSHAKES: usize = 256;

/// Accepts peers until the server is closed.
pub(crate) async fn accept(server: Arc<Server>, context: Context) {
    let handshakes = Arc::new(Semaphore::new(HANDSHAKES));
    let next_id = Arc::new(AtomicU64::new(1));
    while let Some(incoming) = server.accept().await {
        let Ok(permit) = Arc::clone(&handshakes).try_acquire_owned() else {
            // Dropping an incoming connection refuses it; a node tries again.
            tracing::warn!(address = %incoming.address(), "too many handshakes at once");
            continue;
        };
        let context = context.clone();
        let next_id = Arc::clone(&next_id);
        tokio::spawn(async move {
            let peer = match incoming.handshake().await {
                Ok(peer) => peer,
                Err(error) => {
                    let reason = error.reason.to_string();
                    return context.events.send(Event::Stranger {
                        address: error.address,
                        reason,
                    });
                }
            };
            drop(permit);
            serve(peer, next_id.fetch_add(1, Ordering::Relaxed), context).await;
        });
    }
}
