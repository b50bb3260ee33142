//! What a running wall tells its operator, on standard error.
//!
//! In: the master's notices. Out: a progress bar where there is a terminal, and lines for what needs attention.

use std::collections::HashSet;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use master::Notice;

/// Lines about strangers that are remembered, so that one who knocks for ever is told of once.
const REMEMBERED: usize = 256;

/// Tells notices.
pub(crate) struct Teller {
    bar: ProgressBar,
    said: HashSet<String>,
}

impl Teller {
    /// For a run of so many frames, or without end.
    pub(crate) fn new(frames: Option<u64>) -> Self {
        let bar = frames.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
        let template = if frames.is_some() {
            "frames [{bar:40}] {pos}/{len} {eta} left {msg}"
        } else {
            "{spinner} frame {pos} {msg}"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(250));
        Self {
            bar,
            said: HashSet::new(),
        }
    }

    /// Says a line.
    pub(crate) fn say(&self, line: &str) {
        self.bar.suspend(|| eprintln!("terrawall: {line}"));
    }

    /// Says a line, and never again the same.
    fn say_once(&mut self, line: String) {
        if self.said.len() < REMEMBERED && !self.said.contains(&line) {
            self.say(&line);
            self.said.insert(line);
        }
    }

    /// Tells what has happened.
    pub(crate) fn tell(&mut self, notice: &Notice) {
        match notice {
            Notice::Joined {
                node,
                adapter,
                address,
            } => {
                tracing::info!(node, adapter, %address, "a node joined");
            }
            Notice::Entered { node } => tracing::info!(node, "a node keeps step"),
            Notice::Left { node, reason } => {
                tracing::warn!(node, reason, "a node keeps step no longer");
            }
            Notice::Disconnected { node, reason } => {
                tracing::info!(node, reason, "the connection of a node is over");
            }
            Notice::Refused {
                node,
                address,
                reason,
            } => {
                self.say_once(format!("refused \"{node}\" at {}: {reason}", address.ip()));
            }
            Notice::Stranger { address, reason } => {
                self.say_once(format!(
                    "turned away a stranger at {}: {reason}",
                    address.ip()
                ));
            }
            Notice::Fault { node, message } => self.say_once(format!("node \"{node}\": {message}")),
            // A node tells each once, and again when it comes back.
            Notice::Trouble { node, message } => self.say(&format!("node \"{node}\": {message}")),
            Notice::Tracker { event } => self.say_once(event.clone()),
            Notice::Started { nodes, hosts } if nodes < hosts => {
                self.say(&format!(
                    "begins with {nodes} of {hosts} nodes; the others may come later"
                ));
            }
            Notice::Started { nodes, .. } => tracing::info!(nodes, "the wall is complete"),
            Notice::Progress { frame, .. } => self.bar.set_position(*frame),
            Notice::ChangeShown {
                revision,
                unprepared,
            } if unprepared.is_empty() => {
                tracing::info!(revision, "a change is shown");
            }
            Notice::ChangeShown { unprepared, .. } => self.say_once(format!(
                "a change of the scene is shown, although it is not ready on {}",
                unprepared.join(", ")
            )),
            Notice::ChangeRefused { node, reason, .. } => self.say_once(format!(
                "a change of the scene was refused: node \"{node}\": {reason}"
            )),
            Notice::Settling { waits_for } => {
                self.bar
                    .set_message(format!("waits for the picture: {}", waits_for.join("; ")));
                tracing::info!(?waits_for, "waits for the picture to converge");
            }
            Notice::Measuring { waits_for } => {
                let message = format!(
                    "measures the error of the picture: {}",
                    waits_for.join(", ")
                );
                self.bar.set_message(message);
                tracing::info!(?waits_for, "waits for the error to be measured");
            }
        }
    }
}

impl Drop for Teller {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
