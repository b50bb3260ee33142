//! The master as a library: start it, hear what happens, stop it, and take what it has measured.
//! In: a wall, a scene, an identity. Out: notices while it runs, then a report and pictures. Behind it work the
//! network's thread, the control API's, and the frame loop's, which never waits for anybody.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

use link::{BindError, CloseCode, Identity, Server};
use protocol::report::Report;
use protocol::wall::Surfaces;
use protocol::{Scene, Wall};
use tokio::sync::oneshot;

use crate::capture::CapturedOutput;
use crate::control::{Control, ControlContext, ControlError, ControlOptions};
use crate::director::Director;
use crate::events::{self, Event, EventSender};
use crate::frame_loop::FrameLoop;
use crate::heads::Heads;
use crate::notice::{self, Notice};
use crate::server;
use crate::session::Context;
use crate::wall_file::WallFile;

/// Reads the files that a wall names. Why it cannot is said in a sentence that names the file.
pub type OpenSurfaces = Arc<dyn Fn(&Wall) -> Result<Surfaces, String> + Send + Sync>;

/// What to run.
pub struct MasterOptions {
    /// The wall.
    pub wall: Wall,
    /// Finds its surfaces, at the start and whenever it is measured anew.
    pub open_surfaces: OpenSurfaces,
    /// The scene, with resolved repositories.
    pub scene: Scene,
    /// The cluster's identity.
    pub identity: Identity,
    /// Where to listen; port 0 takes a free one.
    pub bind: SocketAddr,
    /// Frames a second, 1…240; `None`: the wall's.
    pub fps: Option<f64>,
    /// End after this many frames, counted from the first of the complete wall; `None`: run until
    /// stopped. With a number, every frame is one step of the camera's time, however long it takes.
    pub frames: Option<u64>,
    /// At the end, hold the camera, wait until every node has converged, and take the pictures.
    pub capture: bool,
    /// At the end, let every node measure the error of its last picture for the report.
    pub measure_error: bool,
    /// Start with whoever is there after this time; `None`: wait for the whole wall.
    pub start_after: Option<Duration>,
    /// Give up if the wall has not started by then; `None`: never.
    pub start_timeout: Option<Duration>,
    /// Give up if the pictures are not complete this long after the last frame.
    pub capture_timeout: Duration,
    /// Go without the errors that are not measured this long after the last frame; the report names those nodes.
    pub measure_timeout: Duration,
    /// Where the scene can be read and changed while it is shown; `None`: nowhere.
    pub control: Option<ControlOptions>,
    /// Whether the control API takes a free port where the asked one is taken.
    pub any_control_port: bool,
    /// Where relative repositories of layers are taken from that the control API adds, usually the directory
    /// of the scene file; `None`: they must be absolute.
    pub scene_directory: Option<PathBuf>,
    /// The wall's file, if the control API may change and save it.
    pub wall_file: Option<WallFile>,
}

impl MasterOptions {
    /// The usual options: the whole wall within a minute, frames without end, no capture, captures
    /// within a minute, no measuring, no control API.
    #[must_use]
    pub fn new(
        wall: Wall,
        open_surfaces: OpenSurfaces,
        scene: Scene,
        identity: Identity,
        bind: SocketAddr,
    ) -> Self {
        Self {
            wall,
            open_surfaces,
            scene,
            identity,
            bind,
            fps: None,
            frames: None,
            capture: false,
            measure_error: false,
            start_after: None,
            start_timeout: Some(Duration::from_secs(60)),
            capture_timeout: Duration::from_secs(60),
            measure_timeout: Duration::from_secs(20),
            control: None,
            any_control_port: false,
            scene_directory: None,
            wall_file: None,
        }
    }
}

/// What a run has given.
#[derive(Clone, Debug)]
pub struct MasterOutcome {
    /// What was measured.
    pub report: Report,
    /// The pictures, if they were asked for; every output of the wall in its order.
    pub captures: Vec<CapturedOutput>,
    /// Whether the run was stopped before its end.
    pub stopped: bool,
}

/// Why a master could not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A file that the wall names cannot be read, or is not what it should be.
    #[error("{0}")]
    Surfaces(String),
    /// The address cannot be listened on.
    #[error(transparent)]
    Bind(#[from] BindError),
    /// The wall or the scene is too large to be sent.
    #[error(transparent)]
    Encode(#[from] protocol::codec::EncodeError),
    /// The control API cannot be opened.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// The trackers cannot be followed.
    #[error(transparent)]
    Tracking(#[from] tracking::ConfigError),
    /// A thread or a socket could not be had.
    #[error("cannot start the master: {0}")]
    System(#[from] std::io::Error),
}

/// Why a run failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MasterError {
    /// The wall was not complete in time.
    #[error("the wall was not complete after {waited_s} seconds: {}", .waits_for.join("; "))]
    NotComplete {
        /// How long it was waited for.
        waited_s: u64,
        /// Whom it waited for and why.
        waits_for: Vec<String>,
    },
    /// The pictures were not complete in time.
    #[error("the picture was not complete after {waited_s} seconds: {}", .waits_for.join("; "))]
    NotConverged {
        /// How long it was waited for.
        waited_s: u64,
        /// Whom it waited for and why.
        waits_for: Vec<String>,
    },
    /// A node could not send its pictures.
    #[error("the pictures of node \"{node}\" cannot be had: {reason}")]
    Capture {
        /// The node.
        node: String,
        /// Why.
        reason: String,
    },
    /// A view or scene cannot be sent.
    #[error("{0}")]
    Encode(String),
    /// The frame loop ended by a defect of the program.
    #[error(
        "the master's frame loop has ended by a defect of the program; its last words are above"
    )]
    Defect,
}

/// A running master. Dropping it stops the run.
pub struct Master {
    address: SocketAddr,
    events: EventSender,
    notices: Receiver<Notice>,
    control: Option<Control>,
    frame_loop: Option<JoinHandle<Result<MasterOutcome, MasterError>>>,
    network: Option<JoinHandle<()>>,
    close_network: Option<oneshot::Sender<()>>,
}

impl Master {
    /// Starts to listen, and returns at once.
    ///
    /// # Errors
    /// [`StartError`]; nothing is left running.
    pub fn start(options: MasterOptions) -> Result<Self, StartError> {
        let MasterOptions {
            mut wall,
            open_surfaces,
            scene,
            identity,
            bind,
            ..
        } = options;
        if let Some(fps) = options.fps {
            wall.fps = fps;
        }
        let surfaces = open_surfaces(&wall).map_err(StartError::Surfaces)?;
        let wall = Arc::new(wall);
        let director = Director::new(&wall, surfaces, scene)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let server = {
            let _inside = runtime.enter();
            Arc::new(Server::bind(bind, &identity)?)
        };
        let address = server.local_address()?;
        let (events, queue) = events::queue();
        let context = ControlContext {
            any_port: options.any_control_port,
            scene_directory: options.scene_directory,
            wall_file: options.wall_file,
            open_surfaces,
            events: events.clone(),
        };
        let control = options
            .control
            .map(|control| Control::open(control, context))
            .transpose()?;
        let (notices, notices_out) = notice::queue();
        let session = new_session();
        let plan = Plan {
            frames: options.frames,
            capture: options.capture,
            measure_error: options.measure_error,
            start_after: options.start_after,
            start_timeout: options.start_timeout,
            capture_timeout: options.capture_timeout,
            measure_timeout: options.measure_timeout,
        };
        let heads = Heads::start(&wall, runtime.handle())?;
        let frame_loop =
            FrameLoop::new(Arc::clone(&wall), director, heads, session, plan, notices)?;
        let frame_loop = std::thread::Builder::new()
            .name("frame loop".to_owned())
            .spawn(move || frame_loop.run(&queue))?;
        let context = Context {
            wall,
            session,
            events: events.clone(),
        };
        let (close_network, closed) = oneshot::channel();
        let network = std::thread::Builder::new()
            .name("network".to_owned())
            .spawn(move || {
                link::go_before_others();
                runtime.block_on(async {
                    tokio::select! {
                        () = server::accept(Arc::clone(&server), context) => {}
                        // A dropped master closes as well.
                        _ = closed => {}
                    }
                    server.close(CloseCode::Finished, "the run is over").await;
                });
            })?;
        Ok(Self {
            address,
            events,
            notices: notices_out,
            control,
            frame_loop: Some(frame_loop),
            network: Some(network),
            close_network: Some(close_network),
        })
    }

    /// Where nodes find it.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where the control API listens, if it was asked for.
    #[must_use]
    pub fn control_address(&self) -> Option<SocketAddr> {
        self.control.as_ref().map(Control::address)
    }

    /// The next notice, waited for at most this long. `None` also after the end of the run.
    pub fn next_notice(&self, wait: Duration) -> Option<Notice> {
        match self.notices.recv_timeout(wait) {
            Ok(notice) => Some(notice),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                // A loop of waits must not become a busy one.
                std::thread::sleep(wait.min(Duration::from_millis(10)));
                None
            }
        }
    }

    /// Whether the run is over, so that [`Self::finish`] returns soon.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.frame_loop.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Shows another scene, which must be valid, as soon as every node has prepared it. Its camera begins then, if
    /// it is another one. After the last frame nothing happens.
    pub fn set_scene(&self, scene: Scene) {
        self.events.send(Event::SetScene(Box::new(scene)));
    }

    /// Ends the run as if its last frame had been shown, but without a capture. Nodes are sent home.
    pub fn stop(&self) {
        self.events.send(Event::Stop);
    }

    /// Waits for the end of the run.
    ///
    /// # Errors
    /// [`MasterError`]. The nodes have been sent home all the same.
    pub fn finish(mut self) -> Result<MasterOutcome, MasterError> {
        let outcome = self.frame_loop.take().map(JoinHandle::join);
        self.close();
        match outcome {
            Some(Ok(outcome)) => outcome,
            Some(Err(_)) | None => Err(MasterError::Defect),
        }
    }

    fn close(&mut self) {
        // Requests that wait for the frame loop have their answer, or hear that it is gone.
        self.control = None;
        if let Some(close) = self.close_network.take() {
            let _already_closed = close.send(());
        }
        if let Some(network) = self.network.take() {
            let _panicked = network.join();
        }
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        if let Some(frame_loop) = self.frame_loop.take() {
            self.stop();
            let _panicked = frame_loop.join();
        }
        self.close();
    }
}

/// What a run is to do, as the frame loop needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    pub(crate) frames: Option<u64>,
    pub(crate) capture: bool,
    pub(crate) measure_error: bool,
    pub(crate) start_after: Option<Duration>,
    pub(crate) start_timeout: Option<Duration>,
    pub(crate) capture_timeout: Duration,
    pub(crate) measure_timeout: Duration,
}

/// A number that no other run of a master has had: nodes give it back in their hello.
fn new_session() -> u64 {
    use std::hash::{BuildHasher, Hasher};
    // The standard library seeds each hasher's keys from the system's randomness.
    std::collections::hash_map::RandomState::new()
        .build_hasher()
        .finish()
}
