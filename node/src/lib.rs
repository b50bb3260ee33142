//! The render node: receive, prepare, draw, ready, swap.
//!
//! In: a master's address, the cluster's identity, something that makes pictures. Out: pictures in step with
//! all other nodes of the wall. Two threads: the calling one draws and presents, the network's one listens
//! and speaks. The node outlives its master: it keeps the last picture and looks for the next one.

mod addresses;
pub mod cache;
mod device;
mod digests;
mod displays;
mod frame_loop;
mod known_scenes;
mod mail;
mod patterns;
mod picture;
mod presentation;
mod priority;
mod renderer;
mod scene_data;
mod scenes;
mod session;
mod speaker;
mod steering;
mod troubles;
mod window;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use link::Identity;
use protocol::Wall;
use protocol::wall::{Surfaces, Viewers};
use winit::event_loop::{EventLoop, OwnedDisplayHandle};

use digests::DigestFile;
use frame_loop::{FrameLoop, Next};
use mail::Mail;
use session::Session;

pub use digests::DigestError;
pub use patterns::{FoundIdentity, identity, read_identities, read_identity};
pub use picture::{Drawn, OutputImage, Picture, PictureError, PictureMaker, PictureRequest};
pub use render::{
    DiskRate, ErrorMeasure, Fetched, FetchedTile, Level, PassTime, StageTiming, Unfetched,
    count_on_disk, measure_disk,
};
pub use renderer::WallPictureMaker;
pub use session::SessionError;

/// What a node needs to know.
pub struct NodeOptions {
    /// Where the master listens: `HOST:PORT`.
    pub master: String,
    /// Name of this host in the wall.
    pub name: String,
    /// The cluster's identity.
    pub identity: Identity,
    /// No windows, even for outputs that have a place on a desktop.
    pub headless: bool,
    /// Where to write the digest of every output after every presentation: tab-separated lines of frame, revision of
    /// the scene, output, first 16 bytes of the SHA-256 of its RGBA pixels, redrawn and converged (0 or 1). An older
    /// file is replaced. It costs a read-back a frame.
    pub digests: Option<PathBuf>,
    /// Asked ten times a second whether the node is to end.
    pub stop: Arc<dyn Fn() -> bool + Send + Sync>,
    /// Told when the node finds or loses its master, on the network's thread.
    pub status: Arc<dyn Fn(&NodeStatus) + Send + Sync>,
}

/// The surfaces of a wall's screens and its calibrated channels, out of all the files that it names.
///
/// # Errors
/// The first file that cannot be read, or is not what it should be. The text names it.
pub fn surfaces(wall: &Wall) -> Result<Surfaces, PictureError> {
    displays::surfaces(wall)
}

/// Who looks at a wall while nothing tracks anybody.
///
/// # Errors
/// As [`surfaces`].
pub fn viewers(wall: &Wall) -> Result<Viewers, PictureError> {
    Ok(surfaces(wall)?.viewers(wall, wall.heads()))
}

/// How a node stands with its master.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NodeStatus {
    /// It looks for the master; the last try failed for this reason.
    Searching {
        /// A sentence.
        reason: String,
    },
    /// It belongs to a wall.
    Joined {
        /// The wall's name.
        wall: String,
    },
    /// The connection is lost. The last picture stays.
    Lost {
        /// A sentence.
        reason: String,
    },
}

pub(crate) type StatusHook = Arc<dyn Fn(&NodeStatus) + Send + Sync>;

/// What a node has done when it leaves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeOutcome {
    /// Frames presented.
    pub frames: u64,
}

/// Why a node ended other than by being told to.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// It can never join the master it was given.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// It has nothing to draw with.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// It cannot write down what it shows.
    #[error(transparent)]
    Digests(#[from] DigestError),
    /// There is no display for its windows.
    #[error(
        "no display for windows: {0}; start the node inside a graphical session, set DISPLAY, or add \
         --headless"
    )]
    NoDisplay(String),
    /// The window system failed.
    #[error("the window system failed: {0}")]
    WindowSystem(String),
    /// The network's thread could not be started.
    #[error("cannot start the network's thread: {0}")]
    Thread(#[from] io::Error),
}

/// Whether this process can open windows.
#[must_use]
pub fn display_available() -> bool {
    std::env::var_os("DISPLAY").is_some_and(|display| !display.is_empty())
}

/// Runs a node on the calling thread, which must be the main one if it has windows, until the master ends the run,
/// [`NodeOptions::stop`] says so, or the node cannot work. `open` opens the graphics device, for the
/// windows' display if there is to be one; it is called before the master is looked for.
///
/// # Errors
/// [`NodeError`]. A lost master is none: the node looks for it for ever.
pub fn run(
    options: NodeOptions,
    open: impl FnOnce(Option<OwnedDisplayHandle>) -> Result<Box<dyn PictureMaker>, PictureError>,
) -> Result<NodeOutcome, NodeError> {
    link::use_precise_timers();
    let digests = options.digests.as_deref();
    let digests = digests.map(DigestFile::create).transpose()?;
    if options.headless {
        let maker = open(None)?;
        let (mail, network) = start_network(options, maker.adapter(), None)?;
        let result = run_headless(FrameLoop::new(Arc::clone(&mail), maker, digests), &mail);
        let _panicked = network.join();
        return result;
    }
    let event_loop = EventLoop::<window::Wake>::with_user_event()
        .build()
        .map_err(|error| NodeError::NoDisplay(error.to_string()))?;
    let maker = open(Some(event_loop.owned_display_handle()))?;
    let proxy = event_loop.create_proxy();
    let waker: mail::Waker = Arc::new(move || {
        // It fails only when the event loop is over, and then nobody waits.
        let _over = proxy.send_event(window::Wake);
    });
    let (mail, network) = start_network(options, maker.adapter(), Some(waker))?;
    let result = window::run(
        event_loop,
        FrameLoop::new(Arc::clone(&mail), maker, digests),
    );
    mail.request_stop();
    let _panicked = network.join();
    result
}

fn start_network(
    options: NodeOptions,
    adapter: String,
    waker: Option<mail::Waker>,
) -> Result<(Arc<Mail>, std::thread::JoinHandle<()>), NodeError> {
    let mail = Arc::new(Mail::new(waker));
    let session = Session {
        master: options.master,
        node: options.name,
        adapter,
        identity: options.identity,
        mail: Arc::clone(&mail),
        stop: options.stop,
        status: options.status,
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let thread = std::thread::Builder::new()
        .name("network".to_owned())
        .spawn(move || {
            link::go_before_others();
            runtime.block_on(session.run());
        })?;
    Ok((mail, thread))
}

fn run_headless(mut frame_loop: FrameLoop, mail: &Mail) -> Result<NodeOutcome, NodeError> {
    loop {
        match frame_loop.step() {
            Next::Again => {}
            Next::Wait { until_us } => mail.wait(until_us),
            Next::OpenWindows { wall, host } => {
                let outputs = wall.hosts.get(host).map_or(0, |host| host.outputs.len());
                frame_loop.use_windows(vec![None; outputs]);
            }
            Next::Finished(result) => return result,
        }
    }
}
