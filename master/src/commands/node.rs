//! `terrawall node`: one render node, until its master ends the run.
//!
//! In: where the master is, who this host is, its identity. Out: pictures on its screens. A lost master is no
//! failure: the last picture stays and the node looks for it.

use std::io::Read as _;
use std::sync::{Arc, Mutex, PoisonError};

use link::Identity;
use node::{NodeError, NodeOptions, NodeStatus, SessionError, WallPictureMaker};

use crate::args::Node;
use crate::failure::{Failure, OrConfiguration as _};
use crate::interrupt;

/// Runs a node on the calling thread.
pub(crate) fn run(args: Node) -> Result<(), Failure> {
    let identity = Identity::load(&args.identity).or_configuration()?;
    if args.leave_with_parent {
        leave_with_parent();
    }
    let headless = args.headless || !node::display_available();
    if headless && !args.headless {
        tracing::warn!("there is no display: this node renders without windows");
    }
    let options = NodeOptions {
        master: args.master,
        name: args.name,
        identity,
        headless,
        digests: args.digests,
        stop: Arc::new(interrupt::requested),
        status: Arc::new(teller()),
    };
    let outcome = node::run(options, |display| {
        Ok(Box::new(WallPictureMaker::open(display)?))
    })
    .map_err(explain)?;
    tracing::info!(frames = outcome.frames, "the node has left");
    Ok(())
}

/// Says on standard error how the node stands with its master, whenever that changes.
fn teller() -> impl Fn(&NodeStatus) + Send + Sync {
    let said = Mutex::new(String::new());
    move |status| {
        let line = match status {
            NodeStatus::Searching { reason } => format!("looks for its master: {reason}"),
            NodeStatus::Joined { wall } => format!("has joined the wall \"{wall}\""),
            NodeStatus::Lost { reason } => {
                format!("has lost its master and looks for it: {reason}")
            }
        };
        let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
        if *said != line {
            eprintln!("terrawall: the node {line}");
            *said = line;
        }
    }
}

/// What the operator set up wrongly has another exit status than what failed.
fn explain(error: NodeError) -> Failure {
    match error {
        NodeError::Session(SessionError::Refused { .. } | SessionError::Connect(_))
        | NodeError::Digests(_) => Failure::Configuration(error.into()),
        error => Failure::Failed(error.into()),
    }
}

/// Ends this process when its standard input closes, which happens when its parent ends, however it ends.
fn leave_with_parent() {
    std::thread::spawn(|| {
        let mut rest = [0; 64];
        while std::io::stdin().read(&mut rest).is_ok_and(|read| read > 0) {}
        interrupt::request();
        // The node says good-bye if its master is still there, but it must not linger.
        std::thread::sleep(std::time::Duration::from_secs(2));
        std::process::exit(1);
    });
}
