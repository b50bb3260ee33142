//! Who belongs to the wall: hellos, refusals, links that come and go, and what is counted per node.
//! In: hellos, lost links, events of the barrier, time. Out: admissions and refusals with a reason that
//! the person who started the node can act on. It closes no connection itself.

use std::collections::HashMap;

use thiserror::Error;

use crate::barrier::NodeId;
use crate::message::{Hello, PROTOCOL_VERSION};
use crate::wall::Wall;

/// A link that has been silent for this long gives way to a new node of the same name. Nodes ping
/// the master's clock several times in this span.
pub const SILENCE_US: i64 = 500_000;

/// Why a node was refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// It speaks another protocol.
    #[error(
        "node \"{node}\" runs terrawall {node_version} (protocol {node_protocol}), the master runs {master_version} (protocol {master_protocol}); install the same version on both hosts"
    )]
    Version {
        /// The node's name.
        node: String,
        /// Its program version.
        node_version: String,
        /// Its protocol version.
        node_protocol: u32,
        /// The master's program version.
        master_version: String,
        /// The master's protocol version.
        master_protocol: u32,
    },
    /// The wall has no such host.
    #[error(
        "wall \"{wall}\" has no host \"{node}\"; start the node with --name and one of {known}"
    )]
    UnknownName {
        /// The wall's name.
        wall: String,
        /// The node's name.
        node: String,
        /// The names that there are.
        known: String,
    },
    /// A node of this name is connected and alive.
    #[error(
        "a node \"{node}\" is already connected (process {process_id}, adapter {adapter}); stop it first, or give this one another name of the wall"
    )]
    Duplicate {
        /// The name.
        node: String,
        /// The connected node's process.
        process_id: u32,
        /// The connected node's adapter.
        adapter: String,
    },
    /// The hello answers another run of the master.
    #[error("node \"{node}\" answered an earlier run of the master; connect again")]
    OtherSession {
        /// The node's name.
        node: String,
    },
}

impl Refusal {
    /// When another try may succeed; `None`: never without a change.
    #[must_use]
    pub fn retry_after_ms(&self) -> Option<u32> {
        match self {
            Self::Duplicate { .. } => Some((SILENCE_US / 1000) as u32),
            Self::OtherSession { .. } => Some(10),
            Self::Version { .. } | Self::UnknownName { .. } => None,
        }
    }
}

/// One stay of a node. What arrives from an earlier stay's link is to be ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Seat {
    /// The node.
    pub node: NodeId,
    /// Number of the stay, from 1.
    pub stay: u32,
}

/// A node that was let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Admission {
    /// Its seat.
    pub seat: Seat,
    /// The seat whose silent link is to be closed, if one gave way.
    pub replaced: Option<Seat>,
}

/// What is known of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeRecord {
    /// Name of its host.
    pub name: String,
    /// Adapter of the last stay; empty if it never was there.
    pub adapter: String,
    /// Process of the last stay.
    pub process_id: u32,
    /// Whether it is connected.
    pub connected: bool,
    /// Whether the barrier waits for it.
    pub member: bool,
    /// Frames presented.
    pub frames: u64,
    /// Deadlines missed.
    pub missed_deadlines: u64,
    /// Times that it entered the barrier.
    pub joins: u32,
    /// From the last stay's hello to the first frame presented in step, in microseconds.
    pub join_us: Option<i64>,
    stay: u32,
    hello_us: i64,
    heard_us: i64,
    joining: bool,
}

/// The nodes of a wall.
#[derive(Clone, Debug)]
pub struct Membership {
    wall: String,
    session: u64,
    program_version: String,
    nodes: Vec<NodeRecord>,
    index: HashMap<String, NodeId>,
}

impl Membership {
    /// Nobody is there yet. `session` is the number of this run that challenges carry.
    #[must_use]
    pub fn new(wall: &Wall, session: u64, program_version: &str) -> Self {
        let record = |name: &String| NodeRecord {
            name: name.clone(),
            adapter: String::new(),
            process_id: 0,
            connected: false,
            member: false,
            frames: 0,
            missed_deadlines: 0,
            joins: 0,
            join_us: None,
            stay: 0,
            hello_us: 0,
            heard_us: 0,
            joining: false,
        };
        let names = wall.hosts.iter().map(|host| &host.name);
        Self {
            wall: wall.name.clone(),
            session,
            program_version: program_version.to_owned(),
            nodes: names.clone().map(record).collect(),
            index: names
                .cloned()
                .enumerate()
                .map(|(node, name)| (name, node))
                .collect(),
        }
    }

    /// A node introduces itself.
    ///
    /// # Errors
    /// The reason to refuse it. A running wall is not disturbed.
    pub fn hello(&mut self, hello: &Hello, now_us: i64) -> Result<Admission, Refusal> {
        if hello.protocol_version != PROTOCOL_VERSION {
            return Err(Refusal::Version {
                node: hello.node.clone(),
                node_version: hello.program_version.clone(),
                node_protocol: hello.protocol_version,
                master_version: self.program_version.clone(),
                master_protocol: PROTOCOL_VERSION,
            });
        }
        if hello.session != self.session {
            return Err(Refusal::OtherSession {
                node: hello.node.clone(),
            });
        }
        let known = self.index.get(&hello.node).copied();
        let Some((node, record)) = known.and_then(|node| Some((node, self.nodes.get_mut(node)?)))
        else {
            let names: Vec<&str> = self.nodes.iter().map(|node| node.name.as_str()).collect();
            return Err(Refusal::UnknownName {
                wall: self.wall.clone(),
                node: hello.node.clone(),
                known: names.join(", "),
            });
        };
        let alive = record.connected && now_us.saturating_sub(record.heard_us) < SILENCE_US;
        if alive {
            return Err(Refusal::Duplicate {
                node: hello.node.clone(),
                process_id: record.process_id,
                adapter: record.adapter.clone(),
            });
        }
        let replaced = record.connected.then_some(Seat {
            node,
            stay: record.stay,
        });
        record.adapter.clone_from(&hello.adapter);
        record.process_id = hello.process_id;
        record.connected = true;
        record.member = false;
        record.stay += 1;
        record.hello_us = now_us;
        record.heard_us = now_us;
        record.joining = true;
        Ok(Admission {
            seat: Seat {
                node,
                stay: record.stay,
            },
            replaced,
        })
    }

    /// Whether this seat is the node's present one.
    #[must_use]
    pub fn is_current(&self, seat: Seat) -> bool {
        self.nodes
            .get(seat.node)
            .is_some_and(|node| node.connected && node.stay == seat.stay)
    }

    /// Something arrived over a seat's link. False if the seat is not current: ignore the message.
    pub fn heard(&mut self, seat: Seat, now_us: i64) -> bool {
        match self.current(seat) {
            Some(record) => {
                record.heard_us = now_us;
                true
            }
            None => false,
        }
    }

    /// A seat's link is lost. False if the seat was not current: nothing else is to be done.
    pub fn lost(&mut self, seat: Seat) -> bool {
        match self.current(seat) {
            Some(record) => {
                record.connected = false;
                record.member = false;
                true
            }
            None => false,
        }
    }

    /// The barrier waits for the node from now on.
    pub fn entered(&mut self, node: NodeId) {
        if let Some(record) = self.nodes.get_mut(node) {
            record.member = true;
            record.joins += 1;
        }
    }

    /// The barrier does not wait for the node any longer.
    pub fn left(&mut self, node: NodeId) {
        if let Some(record) = self.nodes.get_mut(node) {
            record.member = false;
        }
    }

    /// The node missed a deadline.
    pub fn missed(&mut self, node: NodeId) {
        if let Some(record) = self.nodes.get_mut(node) {
            record.missed_deadlines += 1;
        }
    }

    /// The node presented a frame; `presented_us` is on the master's clock. The first one after a hello
    /// ends the node's joining.
    pub fn presented(&mut self, node: NodeId, presented_us: i64) {
        if let Some(record) = self.nodes.get_mut(node) {
            record.frames += 1;
            if record.joining {
                record.joining = false;
                record.join_us = Some(presented_us.saturating_sub(record.hello_us).max(0));
            }
        }
    }

    /// What is known of each node, in the order of the wall's hosts.
    #[must_use]
    pub fn nodes(&self) -> &[NodeRecord] {
        &self.nodes
    }

    /// Whether the barrier waits for every host of the wall.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.nodes.iter().all(|node| node.member)
    }

    fn current(&mut self, seat: Seat) -> Option<&mut NodeRecord> {
        let record = self.nodes.get_mut(seat.node)?;
        (record.connected && record.stay == seat.stay).then_some(record)
    }
}
