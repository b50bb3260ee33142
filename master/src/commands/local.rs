//! A wall whose nodes are all processes of this machine, from start to end.
//!
//! In: a wall, a scene, what is asked of the run. Out: the master's outcome. Whatever happens, no process and no
//! identity is left: children end with this process, the identity with the run.

use std::ffi::OsString;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::time::Duration;

use anyhow::Context as _;
use link::Identity;
use master::launch::{Children, Ended, NodeLaunch};
use master::{Master, MasterOptions, MasterOutcome, Notice, WallFile};
use protocol::{Scene, Wall};

use crate::failure::{Failure, OrConfiguration as _};
use crate::interrupt;

use super::control::Opening;
use super::files;
use super::notices::Teller;
use super::pictures;

/// How long nodes may take to leave when the run is over.
const LEAVE: Duration = Duration::from_secs(5);
/// How often children and Ctrl-C are looked at.
const LOOK: Duration = Duration::from_millis(50);

/// What is asked of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run<'p> {
    /// Without windows.
    pub(crate) headless: bool,
    /// Frames a second; none: the wall's.
    pub(crate) fps: Option<f64>,
    /// Frames; none: until Ctrl-C.
    pub(crate) frames: Option<u64>,
    /// Pictures at the end.
    pub(crate) capture: bool,
    /// The error of the last picture, for the report.
    pub(crate) measure_error: bool,
    /// Directory for the digests of what each node shows.
    pub(crate) digests: Option<&'p Path>,
}

/// Who may change the scene while it is shown.
pub(crate) struct Control<'p> {
    /// Where.
    pub(crate) opening: Opening,
    /// The scene's file, beside which relative repositories lie.
    pub(crate) scene_file: &'p Path,
    /// The wall's file, if it may be changed.
    pub(crate) wall_file: Option<WallFile>,
}

/// What a run has given.
pub(crate) struct Shown {
    /// The master's report and pictures.
    pub(crate) outcome: MasterOutcome,
    /// The first node that ended by a failure after the wall had started.
    pub(crate) lost: Option<Ended>,
}

/// Runs a wall: this process is the master, and every host becomes a process `terrawall node`. Without `control`
/// nobody changes the scene.
pub(crate) fn run(
    wall: &Wall,
    scene: &Scene,
    run: Run<'_>,
    control: Option<Control<'_>>,
) -> Result<Shown, Failure> {
    check_repositories(scene)?;
    if let Some(directory) = run.digests {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("cannot make the directory {}", directory.display()))
            .or_configuration()?;
    }
    let program = std::env::current_exe().context("cannot find this program")?;
    let folder = tempfile::Builder::new()
        .prefix("terrawall-")
        .tempdir()
        .context("cannot make a temporary folder for the identity")?;
    let identity_folder = folder.path().join("identity");
    let identity = Identity::create(&identity_folder)?;
    let bind = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let mut options = MasterOptions::new(
        wall.clone(),
        files::open_surfaces(),
        scene.clone(),
        identity,
        bind,
    );
    options.fps = run.fps;
    options.frames = run.frames;
    options.capture = run.capture;
    options.measure_error = run.measure_error;
    if let Some(control) = &control {
        let wall_file = control.wall_file.clone();
        control
            .opening
            .put_into(&mut options, control.scene_file, wall_file)?;
    }
    let master = Master::start(options).map_err(Failure::of_start)?;
    if let Some(control) = &control {
        control.opening.announce(&master);
    }
    let mut children = Children::new();
    for host in &wall.hosts {
        children.start(&NodeLaunch {
            program: program.clone(),
            master: master.address(),
            name: host.name.clone(),
            identity: identity_folder.clone(),
            headless: run.headless,
            arguments: arguments(run, &host.name),
            environment: environment(wall.hosts.len(), folder.path()),
        })?;
    }
    let watched = watch(&master, &mut children, run.frames);
    // A run that failed early is stopped; one that is over does not hear it.
    if watched.is_err() {
        master.stop();
    }
    let outcome = master.finish();
    let mut dead = children.finish(LEAVE);
    dead.retain(|ended| !ended.status.success());
    let mut dead_before = watched?;
    dead_before.append(&mut dead);
    let lost = dead_before.into_iter().next();
    match (outcome, lost) {
        (Ok(outcome), lost) => Ok(Shown { outcome, lost }),
        (Err(error), None) => Err(error.into()),
        (Err(error), Some(lost)) => Err(Failure::failed(format!("{error}; {lost}"))),
    }
}

/// Watches a run to its end. Returns the children that died after the wall had started.
fn watch(
    master: &Master,
    children: &mut Children,
    frames: Option<u64>,
) -> Result<Vec<Ended>, Failure> {
    let mut teller = Teller::new(frames);
    let mut dead = Vec::new();
    let (mut started, mut stopping) = (false, false);
    while !master.is_over() {
        if interrupt::requested() && !stopping {
            stopping = true;
            master.stop();
        }
        if let Some(notice) = master.next_notice(LOOK) {
            started |= matches!(notice, Notice::Started { .. });
            if let Notice::Fault { node, message } = &notice
                && !started
            {
                return Err(Failure::failed(format!(
                    "node \"{node}\" cannot show the scene: {message}"
                )));
            }
            teller.tell(&notice);
        }
        for ended in children.ended() {
            if stopping || ended.status.success() {
                continue;
            }
            if !started {
                return Err(Failure::failed(ended));
            }
            teller.say(&format!("{ended}; the wall goes on without it"));
            dead.push(ended);
        }
        if children.is_empty() && !stopping {
            // Every window was closed, or every node has died: there is nobody left to show anything.
            stopping = true;
            master.stop();
        }
    }
    Ok(dead)
}

/// What a node is told beside its place in the wall.
fn arguments(run: Run<'_>, name: &str) -> Vec<OsString> {
    let Some(directory) = run.digests else {
        return Vec::new();
    };
    let file = directory.join(pictures::file_name(name, "tsv"));
    vec!["--digests".into(), file.into()]
}

/// What nodes of one machine need to know of each other.
fn environment(nodes: usize, folder: &Path) -> Vec<(OsString, OsString)> {
    const THREADS: &str = "LP_NUM_THREADS";
    const RUNTIME: &str = "XDG_RUNTIME_DIR";
    let mut environment = Vec::new();
    // A software driver starts as many threads as there are cores, in every node: together they would only take
    // the cores from each other. Other drivers do not know the variable.
    if std::env::var_os(THREADS).is_none() {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = (cores / nodes.max(1)).max(1);
        environment.push((THREADS.into(), threads.to_string().into()));
    }
    // Without a private folder the driver complains in every process.
    if std::env::var_os(RUNTIME).is_none() {
        environment.push((RUNTIME.into(), folder.into()));
    }
    environment
}

/// On this machine all repositories can be looked at before anything starts.
pub(crate) fn check_repositories(scene: &Scene) -> Result<(), Failure> {
    for layer in &scene.layers {
        // What is elsewhere is looked at by the nodes, which have the right to read it.
        let here = |place: &&String| !place.contains("://");
        if let Some(repository) = layer.repository.as_ref().filter(here) {
            import::Dataset::load(Path::new(repository))
                .with_context(|| format!("layer \"{}\"", layer.name))?;
        }
    }
    Ok(())
}
