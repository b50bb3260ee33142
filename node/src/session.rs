//! The node's side of the conversation with the master, on the network thread.
//! In: a master's address, what the frame loop says. Out: what the master says, into the mailbox. It looks
//! for the master again and again after each loss, and gives up only when told or when refused for good.
//! It draws nothing and keeps no picture: every connection starts from nothing.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use link::{Channel, CloseCode, Closed, ConnectError, Identity, MessageError, Peer};
use protocol::clock::{ClockEstimate, ClockSample};
use protocol::codec::{
    DecodeError, MAX_LARGE_BYTES, decode_to_node, decode_view, encode_to_master,
};
use protocol::message::Hello;
use protocol::{PROTOCOL_VERSION, ToMaster, ToNode, View};
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until, timeout};

use crate::mail::{Arrived, End, Mail};
use crate::speaker::{Pings, Speaker};
use crate::{NodeStatus, StatusHook};

/// First and longest wait between two tries to reach a master.
const FIRST_BACKOFF: Duration = Duration::from_millis(100);
const LONGEST_BACKOFF: Duration = Duration::from_secs(1);
/// A master that has accepted the connection must speak within this time.
const GREETING_TIMEOUT: Duration = Duration::from_secs(5);
/// How often the session looks whether the operator wants the node to end.
const STOP_POLL: Duration = Duration::from_millis(100);
/// What is not urgent leaves after this long at the latest.
const FLUSH: Duration = Duration::from_millis(50);
/// Swaps that are kept for the frame loop: the newest two are all that can matter.
const KEPT_SWAPS: usize = 2;
/// Control messages that may wait for a master that does not read.
const CONTROL_QUEUE: usize = 256;

/// Why a node can never join the master it was given.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The address cannot be one, or this host cannot use the network.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// The master and this node are of different clusters.
    #[error("the master at {master} does not know this node: {reason}")]
    NotAMember {
        /// The master's address.
        master: String,
        /// What TLS said.
        reason: Closed,
    },
    /// The master has another version of terrawall.
    #[error(
        "the master at {master} speaks protocol version {theirs} (terrawall {their_program}), this node \
         {ours} (terrawall {our_program}); install the same version of terrawall on both hosts"
    )]
    Version {
        /// The master's address.
        master: String,
        /// The master's protocol.
        theirs: u32,
        /// The master's program.
        their_program: String,
        /// This node's protocol.
        ours: u32,
        /// This node's program.
        our_program: &'static str,
    },
    /// The master does not want this node.
    #[error("the master at {master} refuses node \"{node}\": {reason}")]
    Refused {
        /// The master's address.
        master: String,
        /// This node's name.
        node: String,
        /// The master's words.
        reason: String,
    },
    /// The master says what this version cannot read.
    #[error("the master at {master} cannot be understood: {source}")]
    Protocol {
        /// The master's address.
        master: String,
        /// What is wrong with its words.
        source: DecodeError,
    },
}

/// How a connection ended, if it did not end for good.
struct Lost {
    reason: String,
    welcomed: bool,
    retry_after: Option<Duration>,
}

/// What is known of the present connection.
struct Connection {
    /// The master has let this node in.
    welcomed: bool,
    /// A view that came before the master's clock was known.
    early_view: Option<Arrived<View>>,
    /// The master is a process of this host.
    shares_clock: bool,
}

/// Ends of a connection that the session does not survive, or that it tries to repair.
enum Over {
    ForGood(End),
    Lost(Lost),
}

/// The network half of a node.
pub(crate) struct Session {
    pub(crate) master: String,
    pub(crate) node: String,
    pub(crate) adapter: String,
    pub(crate) identity: Identity,
    pub(crate) mail: Arc<Mail>,
    pub(crate) stop: Arc<dyn Fn() -> bool + Send + Sync>,
    pub(crate) status: StatusHook,
}

impl Session {
    /// Looks for the master and serves it, until the node has left or cannot join.
    pub(crate) async fn run(self) {
        let mut backoff = FIRST_BACKOFF;
        let end = loop {
            if (self.stop)() {
                break End::Left;
            }
            let lost = match self.connect_once().await {
                Over::ForGood(end) => break end,
                Over::Lost(lost) => lost,
            };
            if lost.welcomed {
                backoff = FIRST_BACKOFF;
                (self.status)(&NodeStatus::Lost {
                    reason: lost.reason,
                });
                self.mail.deliver(|inbox| {
                    *inbox = Default::default();
                    inbox.disconnected = true;
                });
            } else {
                (self.status)(&NodeStatus::Searching {
                    reason: lost.reason,
                });
            }
            let wait = lost.retry_after.unwrap_or(backoff);
            backoff = (backoff * 2).min(LONGEST_BACKOFF);
            if self.stopped_within(wait).await {
                break End::Left;
            }
        };
        self.mail.deliver(|inbox| inbox.ended = Some(end));
    }

    /// Waits, and says whether the node is to leave instead.
    async fn stopped_within(&self, wait: Duration) -> bool {
        let deadline = Instant::now() + wait;
        loop {
            let (_unsent, leave) = self.mail.take_outgoing();
            if leave || (self.stop)() {
                return true;
            }
            let now = Instant::now();
            if now >= deadline {
                return false;
            }
            tokio::select! {
                () = self.mail.to_send() => {}
                () = sleep_until(deadline.min(now + STOP_POLL)) => {}
            }
        }
    }

    async fn connect_once(&self) -> Over {
        let peer = match link::connect(&self.master, &self.identity).await {
            Ok(peer) => peer,
            Err(error) => return self.not_connected(error),
        };
        let mut connection = Connection {
            welcomed: false,
            early_view: None,
            shares_clock: peer.is_on_this_host(),
        };
        let over = self.converse(&peer, &mut connection).await;
        let (code, text) = match &over {
            Over::ForGood(End::Failed(SessionError::Protocol { .. })) => {
                (CloseCode::Protocol, "cannot be understood")
            }
            _ => (CloseCode::Finished, "the node leaves"),
        };
        peer.close(code, text);
        peer.flush_close().await;
        over
    }

    fn not_connected(&self, error: ConnectError) -> Over {
        let for_good = match &error {
            ConnectError::Closed {
                reason: Closed::CertificateRefused { .. },
                ..
            } => true,
            ConnectError::Resolve { source, .. } => source.kind() == io::ErrorKind::InvalidInput,
            ConnectError::Identity(_) => true,
            _ => false,
        };
        if for_good {
            return Over::ForGood(End::Failed(error.into()));
        }
        lost(error.to_string(), false)
    }

    /// One connection, from the challenge to its end.
    async fn converse(&self, peer: &Peer, connection: &mut Connection) -> Over {
        let greeting = timeout(GREETING_TIMEOUT, async {
            let (sender, mut receiver) = peer
                .accept_control(MAX_LARGE_BYTES, MAX_LARGE_BYTES)
                .await?;
            let challenge = receiver.receive().await?;
            Ok::<_, MessageError>((sender, receiver, challenge))
        });
        let (mut sender, mut receiver, challenge) = match greeting.await {
            Ok(Ok(greeting)) => greeting,
            Ok(Err(error)) => return self.over(error, false),
            Err(_elapsed) => return lost("the master does not speak".to_owned(), false),
        };
        let hello = match self.answer(&challenge) {
            Ok(hello) => hello,
            Err(error) => return Over::ForGood(End::Failed(error)),
        };
        if let Err(error) = sender.send(&hello).await {
            return self.over(error, false);
        }

        // What must arrive passes through a queue, so that a master that does not read cannot keep this
        // task from listening.
        let (control, mut queue) = mpsc::channel::<Vec<u8>>(CONTROL_QUEUE);
        let writer = tokio::spawn(async move {
            while let Some(message) = queue.recv().await {
                if sender.send(&message).await.is_err() {
                    return;
                }
            }
            sender.finish().await;
        });
        let mut speaker = Speaker {
            peer,
            control: Some(control),
        };
        let mut pings = Pings {
            next: Instant::now(),
            sequence: 0,
        };
        self.mail.clock(|clock| *clock = ClockEstimate::new());
        let mut flush = Instant::now() + FLUSH;
        loop {
            tokio::select! {
                message = receiver.receive() => {
                    let handled = match message {
                        Ok(bytes) => self.on_message(&bytes, connection),
                        Err(error) => return self.over(error, connection.welcomed),
                    };
                    if let Err(over) = handled {
                        return over;
                    }
                }
                datagram = peer.receive_datagram() => {
                    let handled = match datagram {
                        Ok((Channel::State, bytes)) => self.on_view(&bytes, connection),
                        Ok((Channel::Message, bytes)) => {
                            self.on_message(&bytes, connection)
                        }
                        Err(closed) => return self.over(closed.into(), connection.welcomed),
                    };
                    if let Err(over) = handled {
                        return over;
                    }
                }
                () = self.mail.to_send() => {}
                () = sleep_until(pings.next), if connection.welcomed => {
                    let wait_us = self.mail.clock(|clock| clock.ping_interval_us());
                    speaker.datagram(&pings.ping(wait_us));
                }
                () = sleep_until(flush) => {
                    flush = Instant::now() + FLUSH;
                    if (self.stop)() {
                        self.mail.deliver(|inbox| inbox.leave = true);
                    }
                }
            }
            let (outgoing, leave) = self.mail.take_outgoing();
            for outgoing in outgoing {
                if !speaker.say(outgoing, &self.mail) {
                    return lost(
                        "the master takes no messages".to_owned(),
                        connection.welcomed,
                    );
                }
            }
            if leave {
                speaker.control = None;
                let _late = timeout(Duration::from_millis(500), writer).await;
                return Over::ForGood(End::Left);
            }
        }
    }

    /// The hello that answers a challenge.
    fn answer(&self, challenge: &[u8]) -> Result<Vec<u8>, SessionError> {
        let unreadable = |source| SessionError::Protocol {
            master: self.master.clone(),
            source,
        };
        let our_program = env!("CARGO_PKG_VERSION");
        let (theirs, their_program, session) = match decode_to_node(challenge) {
            Ok(ToNode::Challenge {
                protocol_version,
                program_version,
                session,
            }) => (protocol_version, program_version, session),
            Ok(_) => return Err(unreadable(DecodeError::Senseless("no challenge at first"))),
            Err(error) => return Err(unreadable(error)),
        };
        if theirs != PROTOCOL_VERSION {
            return Err(SessionError::Version {
                master: self.master.clone(),
                theirs,
                their_program,
                ours: PROTOCOL_VERSION,
                our_program,
            });
        }
        let hello = ToMaster::Hello(Hello {
            protocol_version: PROTOCOL_VERSION,
            program_version: our_program.to_owned(),
            session,
            node: self.node.clone(),
            adapter: self.adapter.clone(),
            process_id: std::process::id(),
        });
        // A name so long that it does not fit into a message is no name of a wall either.
        encode_to_master(&hello).map_err(|_too_long| SessionError::Refused {
            master: self.master.clone(),
            node: self.node.chars().take(80).collect(),
            reason: "the node's name is too long".to_owned(),
        })
    }

    fn on_view(&self, bytes: &[u8], connection: &mut Connection) -> Result<(), Over> {
        let at_us = link::now_us();
        let content = decode_view(bytes).map_err(|error| self.misunderstood(error))?;
        let view = Arrived { content, at_us };
        if self.mail.clock(|clock| clock.is_ready()) {
            self.mail.deliver(|inbox| inbox.put_view(view));
        } else {
            // Until the master's clock is known, no picture can be presented in step.
            connection.early_view = Some(view);
        }
        Ok(())
    }

    fn on_message(&self, bytes: &[u8], connection: &mut Connection) -> Result<(), Over> {
        let at_us = link::now_us();
        match decode_to_node(bytes).map_err(|error| self.misunderstood(error))? {
            ToNode::Welcome { host, wall } => {
                connection.welcomed = true;
                (self.status)(&NodeStatus::Joined {
                    wall: wall.name.clone(),
                });
                let welcome = (Arc::new(*wall), host as usize);
                self.mail.deliver(|inbox| {
                    *inbox = Default::default();
                    inbox.welcome = Some(welcome);
                });
            }
            ToNode::Refused {
                reason,
                retry_after_ms: None,
            } => {
                return Err(Over::ForGood(End::Failed(SessionError::Refused {
                    master: self.master.clone(),
                    node: self.node.clone(),
                    reason,
                })));
            }
            ToNode::Refused {
                reason,
                retry_after_ms: Some(milliseconds),
            } => {
                let retry_after = Some(Duration::from_millis(u64::from(milliseconds.min(10_000))));
                return Err(Over::Lost(Lost {
                    reason,
                    welcomed: connection.welcomed,
                    retry_after,
                }));
            }
            ToNode::Scene { revision, scene } => {
                self.mail
                    .deliver(|inbox| inbox.scenes.push(revision, at_us, scene));
            }
            ToNode::Swap(swap) => self.mail.deliver(|inbox| {
                inbox.swaps.push_back(Arrived {
                    content: swap,
                    at_us,
                });
                if inbox.swaps.len() > KEPT_SWAPS {
                    inbox.swaps.pop_front();
                }
            }),
            ToNode::ClockPong {
                node_sent_us,
                master_received_us,
                master_sent_us,
                ..
            } => {
                // On the master's own host there is nothing to estimate: both read the same clock.
                let sample = if connection.shares_clock {
                    ClockSample {
                        node_sent_us: at_us,
                        master_received_us: at_us,
                        master_sent_us: at_us,
                        node_received_us: at_us,
                    }
                } else {
                    ClockSample {
                        node_sent_us,
                        master_received_us,
                        master_sent_us,
                        node_received_us: at_us,
                    }
                };
                let ready = self.mail.clock(|clock| {
                    clock.add(sample);
                    clock.is_ready()
                });
                if ready && let Some(view) = connection.early_view.take() {
                    self.mail.deliver(|inbox| inbox.put_view(view));
                }
            }
            ToNode::Capture { id } => self.mail.deliver(|inbox| inbox.capture = Some(id)),
            ToNode::Wall { revision, wall } => {
                let measured = (revision, Arc::new(*wall));
                self.mail.deliver(|inbox| inbox.wall = Some(measured));
            }
            ToNode::Patterns(patterns) => {
                self.mail.deliver(|inbox| inbox.patterns = Some(patterns));
            }
            ToNode::MeasureError => self.mail.deliver(|inbox| inbox.measure_error = true),
            ToNode::Shutdown => self.mail.deliver(|inbox| inbox.leave = true),
            ToNode::Challenge { .. } => {
                return Err(self.misunderstood(DecodeError::Senseless("a second challenge")));
            }
        }
        Ok(())
    }

    /// Another version can never be understood; anything else may be better in the next connection.
    fn misunderstood(&self, source: DecodeError) -> Over {
        let master = self.master.clone();
        match source {
            DecodeError::Version { .. } => {
                Over::ForGood(End::Failed(SessionError::Protocol { master, source }))
            }
            source => lost(SessionError::Protocol { master, source }.to_string(), true),
        }
    }

    fn over(&self, error: MessageError, welcomed: bool) -> Over {
        match error {
            MessageError::Closed(reason @ Closed::CertificateRefused { .. }) => {
                let master = self.master.clone();
                Over::ForGood(End::Failed(SessionError::NotAMember { master, reason }))
            }
            error => lost(error.to_string(), welcomed),
        }
    }
}

fn lost(reason: String, welcomed: bool) -> Over {
    Over::Lost(Lost {
        reason,
        welcomed,
        retry_after: None,
    })
}
