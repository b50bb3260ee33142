//! The node processes of this machine: started, watched, and ended with the wall.
//!
//! In: what to start. Out: who ended, how, and the last lines it wrote to standard error.
//! A child never outlives its parent: its standard input is a pipe that the parent holds, and a node started
//! with `--leave-with-parent` ends when that pipe closes, even if the parent was killed with signal 9.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Lines of standard error that are kept of each child.
const KEPT_LINES: usize = 12;

/// How often a wait for children looks at them.
const POLL: Duration = Duration::from_millis(5);

/// A child could not be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start node \"{name}\" as {program}: {source}", program = program.display())]
pub struct LaunchError {
    /// Node that was to be started.
    pub name: String,
    /// Program that was to run.
    pub program: PathBuf,
    /// What the operating system said.
    pub source: std::io::Error,
}

/// What to start: `PROGRAM node --master ADDRESS --name NAME --identity DIR --leave-with-parent …`.
#[derive(Debug, Clone)]
pub struct NodeLaunch {
    /// The `terrawall` program; normally the running one.
    pub program: PathBuf,
    /// Where the master listens.
    pub master: SocketAddr,
    /// Node name: a host of the wall.
    pub name: String,
    /// Directory of the cluster identity.
    pub identity: PathBuf,
    /// Render without windows.
    pub headless: bool,
    /// Further arguments of `terrawall node`.
    pub arguments: Vec<OsString>,
    /// Environment added to the parent's.
    pub environment: Vec<(OsString, OsString)>,
}

/// A child that ended.
#[derive(Debug, Clone)]
pub struct Ended {
    /// Node name.
    pub name: String,
    /// How it ended.
    pub status: ExitStatus,
    /// Its last lines on standard error, oldest first, joined by newlines; may be empty.
    pub last_lines: String,
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "node \"{}\" ended ({})", self.name, self.status)?;
        if !self.last_lines.is_empty() {
            write!(f, ", last saying: {}", self.last_lines.replace('\n', " "))?;
        }
        Ok(())
    }
}

struct Running {
    name: String,
    child: Child,
    lines: Arc<Mutex<VecDeque<String>>>,
    reader: Option<JoinHandle<()>>,
}

/// Node processes that this process started. Dropping it ends them all.
#[derive(Default)]
pub struct Children {
    running: Vec<Running>,
}

impl Children {
    /// Nobody yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Starts one node.
    ///
    /// # Errors
    /// The operating system refused to run the program.
    pub fn start(&mut self, launch: &NodeLaunch) -> Result<(), LaunchError> {
        let mut command = Command::new(&launch.program);
        command
            .arg("node")
            .arg("--master")
            .arg(launch.master.to_string())
            .arg("--name")
            .arg(&launch.name)
            .arg("--identity")
            .arg(&launch.identity)
            .arg("--leave-with-parent");
        if launch.headless {
            command.arg("--headless");
        }
        command
            .args(&launch.arguments)
            .envs(launch.environment.iter().map(|(key, value)| (key, value)))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            // Ctrl-C in a terminal reaches this process alone, which ends the run and then the nodes.
            .process_group(0);
        let mut child = command.spawn().map_err(|source| LaunchError {
            name: launch.name.clone(),
            program: launch.program.clone(),
            source,
        })?;
        let lines = Arc::new(Mutex::new(VecDeque::with_capacity(KEPT_LINES)));
        let reader = child.stderr.take().map(|stderr| {
            let (name, lines) = (launch.name.clone(), Arc::clone(&lines));
            std::thread::spawn(move || keep_lines(&name, stderr, &lines))
        });
        self.running.push(Running {
            name: launch.name.clone(),
            child,
            lines,
            reader,
        });
        Ok(())
    }

    /// Children still running.
    pub fn len(&self) -> usize {
        self.running.len()
    }

    /// Whether no child is running.
    pub fn is_empty(&self) -> bool {
        self.running.is_empty()
    }

    /// Process number of a running child.
    pub fn process_id(&self, name: &str) -> Option<u32> {
        self.running
            .iter()
            .find(|running| running.name == name)
            .map(|running| running.child.id())
    }

    /// Reaps and returns the children that have ended since the last call. Never waits.
    pub fn ended(&mut self) -> Vec<Ended> {
        let mut ended = Vec::new();
        let mut index = 0;
        while let Some(running) = self.running.get_mut(index) {
            match running.child.try_wait() {
                Ok(Some(status)) => ended.push(self.running.remove(index).into_ended(status)),
                Ok(None) | Err(_) => index += 1,
            }
        }
        ended
    }

    /// Waits up to `grace` for all children to end by themselves, then ends the rest. Returns all of them.
    pub fn finish(&mut self, grace: Duration) -> Vec<Ended> {
        let deadline = Instant::now() + grace;
        let mut ended = self.ended();
        while !self.is_empty() && Instant::now() < deadline {
            std::thread::sleep(POLL);
            ended.extend(self.ended());
        }
        ended.extend(self.kill());
        ended
    }

    /// Ends all children at once and returns them.
    pub fn kill(&mut self) -> Vec<Ended> {
        for running in &mut self.running {
            // It may have ended in this moment: the wait below tells.
            let _ = running.child.kill();
        }
        self.running
            .drain(..)
            .filter_map(|mut running| {
                let status = running.child.wait().ok()?;
                Some(running.into_ended(status))
            })
            .collect()
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.kill();
    }
}

impl Running {
    fn into_ended(mut self, status: ExitStatus) -> Ended {
        if let Some(reader) = self.reader.take() {
            // The pipe is closed, so the reader has ended or is about to; it cannot fail.
            let _ = reader.join();
        }
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        let last_lines = lines
            .iter()
            .map(String::as_str)
            .collect::<Vec<_>>()
            .join("\n");
        Ended {
            name: self.name,
            status,
            last_lines,
        }
    }
}

/// Keeps the last lines of a child, and passes all on where the operator asked for logs.
fn keep_lines(name: &str, stderr: ChildStderr, lines: &Mutex<VecDeque<String>>) {
    let pass_on = std::env::var_os("RUST_LOG").is_some();
    for line in BufReader::new(stderr).split(b'\n') {
        let Ok(line) = line else { return };
        let line = String::from_utf8_lossy(&line).trim_end().to_owned();
        if pass_on {
            eprintln!("[{name}] {line}");
        }
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == KEPT_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }
}

#[cfg(all(test, unix))]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::expect_used,
        reason = "a test that panics has failed"
    )]
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    /// A program that ignores its arguments and runs `script`.
    fn launch(directory: &std::path::Path, name: &str, script: &str) -> NodeLaunch {
        let program = directory.join(name);
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        NodeLaunch {
            program,
            master: "127.0.0.1:1".parse().unwrap(),
            name: name.to_owned(),
            identity: directory.to_owned(),
            headless: true,
            arguments: vec![],
            environment: vec![("TERRAWALL_TEST".into(), "7".into())],
        }
    }

    #[test]
    fn a_dead_child_is_reported_with_its_last_words() {
        let directory = tempfile::tempdir().unwrap();
        let mut children = Children::new();
        let script = "for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14; do echo line $i $TERRAWALL_TEST >&2; done; exit 3";
        children
            .start(&launch(directory.path(), "west", script))
            .unwrap();
        let ended = children.finish(Duration::from_secs(20));
        assert_eq!(ended.len(), 1);
        assert_eq!(ended[0].status.code(), Some(3));
        assert!(
            ended[0].last_lines.starts_with("line 3 7\n"),
            "{}",
            ended[0].last_lines
        );
        assert!(
            ended[0].to_string().contains("node \"west\" ended")
                && ended[0].to_string().ends_with("line 14 7")
        );
        assert!(children.is_empty());
    }

    #[test]
    fn children_end_with_their_owner() {
        let directory = tempfile::tempdir().unwrap();
        let mut children = Children::new();
        children
            .start(&launch(directory.path(), "east", "exec sleep 600"))
            .unwrap();
        let process = children.process_id("east").unwrap();
        assert!(children.ended().is_empty());
        drop(children);
        assert!(!std::path::Path::new(&format!("/proc/{process}")).exists());
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let directory = tempfile::tempdir().unwrap();
        let mut missing = launch(directory.path(), "north", "");
        missing.program = directory.path().join("absent");
        let error = Children::new().start(&missing).unwrap_err().to_string();
        assert!(
            error.contains("north") && error.contains("absent"),
            "{error}"
        );
    }
}
