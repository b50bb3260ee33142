//! Ctrl-C: a wish that long work looks at, so that children, temporary files and identities are cleaned up.
//!
//! In: SIGINT, SIGTERM and SIGHUP. Out: a flag. A second signal ends the process at once.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context as _;

use crate::failure::Failure;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Exit status of a process that SIGINT ended.
const INTERRUPTED: i32 = 130;

/// Starts to listen. Called once, at the start.
pub(crate) fn install() -> Result<(), Failure> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(INTERRUPTED);
        }
    })
    .context("cannot listen to Ctrl-C")?;
    Ok(())
}

/// Whether the operator wants the work to end.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// The wish itself, for work that looks at it often.
pub(crate) fn flag() -> &'static AtomicBool {
    &REQUESTED
}

/// Asks for the end of the work as Ctrl-C does.
pub(crate) fn request() {
    REQUESTED.store(true, Ordering::SeqCst);
}
