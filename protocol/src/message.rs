//! Everything that master and nodes say to each other, and when.
//!
//! A node connects over mutual TLS. The master answers [`ToNode::Challenge`]: only then does the node
//! know that its certificate was accepted. The node says [`ToMaster::Hello`]; the master answers
//! [`ToNode::Welcome`] with the wall, then [`ToNode::Scene`], or [`ToNode::Refused`] with a reason.
//! Then, frame by frame: [`View`] → draw → [`ToMaster::Ready`] → [`ToNode::Swap`] → present at the
//! same moment → [`ToMaster::Presented`]. Any view is complete: the shown scene and the next view are all
//! that a late node needs. A further scene is prepared beside the shown one ([`ToMaster::Prepared`]) and
//! shown from the first view on that bears its revision. All times are microseconds; for bytes see `codec`.

use serde::{Deserialize, Serialize};

use crate::camera::Pose;
use crate::pattern::Pattern;
use crate::scene::Scene;
use crate::wall::{Viewers, Wall};

/// Changes whenever a message changes. Master and nodes must have the same.
pub const PROTOCOL_VERSION: u32 = 5;

/// Most new tiles that one [`ToMaster::Counters`] may name.
pub const MAX_NEW_TILES: usize = 2048;

/// Most bytes of the reason in a [`ToMaster::CannotPrepare`] or [`ToMaster::CannotMeasure`]: the master shows it to
/// people and keeps it.
pub const MAX_REASON_BYTES: usize = 2048;

/// The render state of one frame. Encoded, it never exceeds 1,100 bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Which set of members the master waits for.
    pub epoch: u32,
    /// Number of the frame, rising by one.
    pub frame: u64,
    /// The scene that this frame shows.
    pub scene_revision: u64,
    /// The measures of the wall that this frame is drawn for: 0 for those of the welcome.
    pub wall_revision: u32,
    /// When the master sent it, on the master's clock. A repeated view keeps its first time.
    pub sent_us: i64,
    /// Where the viewer is.
    pub pose: Pose,
    /// Who looks at the wall.
    pub viewers: Viewers,
    /// The camera holds still for a capture: a frame counts once its picture has converged.
    pub settle: bool,
    /// The swap of the frame before, for a node that its own message did not reach.
    pub previous_swap: Option<Swap>,
}

/// The moment at which all nodes present a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Swap {
    /// The epoch of the frame's view.
    pub epoch: u32,
    /// The frame to present.
    pub frame: u64,
    /// When to present, on the master's clock.
    pub present_at_us: i64,
}

/// What the master says to a node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToNode {
    /// First words: the node's certificate was accepted.
    Challenge {
        /// The master's [`PROTOCOL_VERSION`].
        protocol_version: u32,
        /// The master's program version, for people.
        program_version: String,
        /// A number of this run of the master, to be given back in the hello.
        session: u64,
    },
    /// The node belongs to the wall.
    Welcome {
        /// The node's own index into the wall's hosts.
        host: u32,
        /// The whole wall, already validated.
        wall: Box<Wall>,
    },
    /// The node does not belong to the wall, or not now. The master closes the connection.
    Refused {
        /// A sentence for the person who started the node.
        reason: String,
        /// When another try may succeed; `None`: never without a change.
        retry_after_ms: Option<u32>,
    },
    /// What to show from the first view of this revision on. Until then the node prepares it while it goes
    /// on drawing the shown one. A newer one takes the place of one that is in preparation.
    Scene {
        /// Rises with every scene.
        revision: u64,
        /// The scene, with resolved repositories.
        scene: Box<Scene>,
    },
    /// Present a frame.
    Swap(Swap),
    /// Answer to [`ToMaster::ClockPing`].
    ClockPong {
        /// As in the ping.
        sequence: u32,
        /// As in the ping: the node's clock when it sent it.
        node_sent_us: i64,
        /// The master's clock when it read the ping.
        master_received_us: i64,
        /// The master's clock when it wrote this answer.
        master_sent_us: i64,
    },
    /// Send the pictures of the frame last presented.
    Capture {
        /// Number of the capture, repeated in the answer.
        id: u32,
    },
    /// The run is over: say [`ToMaster::Bye`] and exit.
    Shutdown,
    /// No frame follows: measure the error of the picture that stands, and say [`ToMaster::ErrorMeasured`] or
    /// [`ToMaster::CannotMeasure`].
    MeasureError,
    /// The measures of the wall from the first view of this revision on.
    Wall {
        /// Rises with every change.
        revision: u32,
        /// The wall, valid, with the outputs and canvases of the welcome.
        wall: Box<Wall>,
    },
    /// What each of this node's outputs shows instead of the scene, in their order, from the next view on.
    Patterns(Vec<Option<Pattern>>),
}

/// What a node says to the master.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToMaster {
    /// Who the node is; the answer to the challenge.
    Hello(Hello),
    /// Asks for the master's clock.
    ClockPing {
        /// Number of the ping.
        sequence: u32,
        /// The node's clock when it sent it.
        node_sent_us: i64,
    },
    /// A frame is drawn and waits for its swap.
    Ready {
        /// The epoch of the frame's view.
        epoch: u32,
        /// The frame.
        frame: u64,
        /// Nothing is missing: another drawing would give the same picture.
        converged: bool,
        /// Tiles that are on their way.
        pending_tiles: u32,
    },
    /// A frame was presented.
    Presented(Presented),
    /// Some rows of a captured picture.
    CaptureRows(crate::capture::CaptureRows),
    /// All pictures of a capture were sent.
    CaptureDone {
        /// Number of the capture.
        id: u32,
        /// How many outputs it holds.
        outputs: u32,
    },
    /// A capture failed.
    CaptureFailed {
        /// Number of the capture.
        id: u32,
        /// What went wrong.
        reason: String,
    },
    /// What the node's tile caches have done so far.
    Counters {
        /// Totals since the node started.
        tiles: TileCounters,
        /// Since the last counters.
        news: TileNews,
    },
    /// The node cannot draw what it should, or not show it; it goes on.
    Fault {
        /// A sentence that names the thing, where it stands and what to do.
        message: String,
    },
    /// Mouse and keys from one of the node's windows.
    Steer(Steer),
    /// The node leaves on its own accord.
    Bye {
        /// A sentence for the operator.
        reason: String,
    },
    /// All that the node's present view needs of a scene is there: it can be shown with the next view.
    /// Said once per revision and connection.
    Prepared {
        /// The scene's revision.
        revision: u64,
    },
    /// The node cannot show a scene and goes on with the one that it shows. See
    /// [`ToMaster::cannot_prepare`].
    CannotPrepare {
        /// The scene's revision.
        revision: u64,
        /// A sentence that names the thing and the remedy, at most [`MAX_REASON_BYTES`] bytes.
        reason: String,
    },
    /// A lens is dragged in one of the node's windows.
    MoveLens(MoveLens),
    /// The error of the picture that stands.
    ErrorMeasured(ErrorMeasured),
    /// The error of the picture that stands cannot be measured. See [`ToMaster::cannot_measure`].
    CannotMeasure {
        /// A sentence that names the thing and the remedy, at most [`MAX_REASON_BYTES`] bytes.
        reason: String,
    },
    /// Something lowers the quality of what the node draws, or does so no longer: the operator should know.
    Trouble {
        /// A sentence that names the thing and what to do.
        message: String,
    },
}

impl ToMaster {
    /// That a scene cannot be prepared. A longer reason than the message holds is cut between two
    /// characters and ends in "…".
    #[must_use]
    pub fn cannot_prepare(revision: u64, reason: &str) -> Self {
        let reason = shortened(reason);
        Self::CannotPrepare { revision, reason }
    }

    /// That the error of the picture cannot be measured. The reason is cut in the same way.
    #[must_use]
    pub fn cannot_measure(reason: &str) -> Self {
        let reason = shortened(reason);
        Self::CannotMeasure { reason }
    }
}

/// At most [`MAX_REASON_BYTES`] bytes of a reason.
fn shortened(reason: &str) -> String {
    const CUT: &str = "…";
    if reason.len() <= MAX_REASON_BYTES {
        return reason.to_owned();
    }
    let room = MAX_REASON_BYTES - CUT.len();
    let kept = reason
        .char_indices()
        .map(|(start, character)| start + character.len_utf8());
    let end = kept.take_while(|end| *end <= room).last().unwrap_or(0);
    let mut short = reason.get(..end).unwrap_or_default().to_owned();
    short.push_str(CUT);
    short
}

/// Who a node is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The node's [`PROTOCOL_VERSION`].
    pub protocol_version: u32,
    /// The node's program version, for people.
    pub program_version: String,
    /// From the challenge.
    pub session: u64,
    /// The host of the wall that it is.
    pub node: String,
    /// Name of the graphics adapter.
    pub adapter: String,
    /// Process number on its own machine.
    pub process_id: u32,
}

/// How a frame was presented.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Presented {
    /// The epoch of the frame's view.
    pub epoch: u32,
    /// The frame.
    pub frame: u64,
    /// When it was presented, on the master's clock as the node estimates it.
    pub presented_us: i64,
    /// Bound of the error of that estimate.
    pub clock_error_us: u32,
    /// Time from the view's sending to its arrival, on the master's clock; below 0 only by clock error.
    pub view_latency_us: i32,
    /// Time from the view's sending to its picture's presentation.
    pub view_to_present_us: u32,
    /// How long before the moment of presentation the swap message arrived; below 0: too late.
    pub swap_slack_us: i32,
    /// Time spent drawing, including the wait for the GPU.
    pub draw_us: u32,
    /// Whether anything had to be drawn at all.
    pub redrawn: bool,
    /// Triangles drawn.
    pub triangles: u64,
    /// Whether nothing was missing from the picture.
    pub converged: bool,
    /// Tiles whose mesh was made for this frame.
    pub refined_leaves: u32,
    /// The τ that the meshes keep, in wall pixels: the scene's, or more where the memory for meshes forbids it. 0 where
    /// none is kept.
    pub achieved_tau_px: f64,
    /// The side of a tile in wall pixels above which it was split: the scene's, or more where the memory for tiles does
    /// not hold what is seen.
    pub achieved_tile_px: f64,
}

/// The error of a node's picture: over all samples in view, the distance in wall pixels between the sample's true place
/// and the drawn surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorMeasured {
    /// The largest, ≥ 0.
    pub max_px: f64,
    /// Samples that were looked at; 0 where no ground is in view.
    pub samples: u64,
    /// Of them, those that no triangle covers. There must be none.
    pub uncovered: u64,
    /// The τ that the meshes keep, as [`Presented::achieved_tau_px`].
    pub tau_px: f64,
}

/// What the tile caches of a node have done since it started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TileCounters {
    /// Different tiles that came into main memory.
    pub distinct: u64,
    /// Tiles read from a repository.
    pub repository_reads: u64,
    /// Their compressed bytes.
    pub repository_bytes: u64,
    /// Tiles found in the disk cache.
    pub disk_hits: u64,
    /// Tiles found in main memory.
    pub ram_hits: u64,
    /// Tiles whose checksum was wrong.
    pub corrupt: u64,
    /// Tiles that are given up for the time being.
    pub failed: u64,
    /// Bytes of tiles in main memory that were loaded before anybody wanted them.
    pub early_bytes: u64,
    /// Of these, the bytes of tiles that nobody has wanted since.
    pub vain_bytes: u64,
}

/// What happened to tiles on a node. A number of a tile must mean the same data set and tile on every node.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TileNews {
    /// Numbers of tiles that came into main memory for the first time, at most [`MAX_NEW_TILES`].
    pub loaded: Vec<u64>,
    /// Numbers of tiles that were shown for the first time, at most [`MAX_NEW_TILES`].
    pub used: Vec<u64>,
    /// Tiles that could be drawn since, at most [`MAX_NEW_TILES`].
    pub drawable: Vec<Drawable>,
}

/// A tile that can be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drawable {
    /// Where it was found when it was wanted.
    pub level: CacheLevel,
    /// Microseconds from the first frame that wanted it to the one that could draw it.
    pub after_us: u32,
}

/// The levels of the tile cache below the graphics device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CacheLevel {
    /// Compressed, wherever it lies.
    Repository,
    /// Plain, in the directory that the cluster shares.
    Disk,
    /// In the host's main memory.
    Ram,
}

impl TileNews {
    /// Whether any list is as long as it may be, so that more may be left to tell.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.longest() >= MAX_NEW_TILES
    }

    /// Entries of the longest list.
    #[must_use]
    pub fn longest(&self) -> usize {
        self.loaded
            .len()
            .max(self.used.len())
            .max(self.drawable.len())
    }
}

/// Movements since the last such message. Angles are as seen by the eye, in radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Steer {
    /// The ground was dragged this far to the right and up.
    pub drag: [f64; 2],
    /// The gaze was turned this far to the right and up.
    pub look: [f64; 2],
    /// The head was tilted this far to the right.
    pub roll: f64,
    /// Steps of the wheel; positive goes nearer.
    pub zoom: f64,
    /// Keys that are held down. A window repeats them at least every 100 ms as long as there are any.
    pub held: HeldKeys,
}

/// Where the pointer has dragged a lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MoveLens {
    /// Geodetic latitude of the ground under the pointer, −90…90.
    pub latitude_deg: f64,
    /// Its longitude, −180…180.
    pub longitude_deg: f64,
    /// The first message of a drag: it chooses the lens that the following ones move.
    pub grab: bool,
}

/// A set of steering keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HeldKeys(pub u16);

impl HeldKeys {
    /// Over the ground in the direction of view.
    pub const FORWARD: Self = Self(1);
    /// Over the ground against the direction of view.
    pub const BACKWARD: Self = Self(1 << 1);
    /// Over the ground to the left.
    pub const LEFT: Self = Self(1 << 2);
    /// Over the ground to the right.
    pub const RIGHT: Self = Self(1 << 3);
    /// Away from the ground.
    pub const RISE: Self = Self(1 << 4);
    /// Towards the ground.
    pub const SINK: Self = Self(1 << 5);
    /// Turns the gaze left.
    pub const LOOK_LEFT: Self = Self(1 << 6);
    /// Turns the gaze right.
    pub const LOOK_RIGHT: Self = Self(1 << 7);
    /// Turns the gaze up.
    pub const LOOK_UP: Self = Self(1 << 8);
    /// Turns the gaze down.
    pub const LOOK_DOWN: Self = Self(1 << 9);
    /// Tilts the head left.
    pub const ROLL_LEFT: Self = Self(1 << 10);
    /// Tilts the head right.
    pub const ROLL_RIGHT: Self = Self(1 << 11);
    /// Four times as fast.
    pub const FAST: Self = Self(1 << 12);

    /// Whether all of `keys` are in the set.
    #[must_use]
    pub const fn holds(self, keys: Self) -> bool {
        self.0 & keys.0 == keys.0
    }

    /// The set with `keys` added or removed.
    #[must_use]
    pub const fn with(self, keys: Self, held: bool) -> Self {
        if held {
            Self(self.0 | keys.0)
        } else {
            Self(self.0 & !keys.0)
        }
    }

    /// Whether no key is held.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}
