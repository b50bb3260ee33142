//! The real `terrawall` program, run as an operator runs it.
//!
//! In: arguments. Out: exit status and what it wrote. Nothing here waits without an end: a program that
//! does not stop is killed, and the test that started it fails.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::sources;

/// How long a command may take, on a busy machine with two cores and a software driver.
pub const PATIENCE: Duration = Duration::from_secs(240);

/// A program that ended.
#[derive(Debug)]
pub struct Ran {
    /// Exit status; none when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

/// A program that runs. Dropping it kills it.
#[derive(Debug)]
pub struct Running {
    child: Child,
    stdout: Option<JoinHandle<String>>,
    stderr: Option<JoinHandle<String>>,
    words: String,
}

/// Path of the program: the one that the variable `TERRAWALL` names, for tests of an installed program, or else the
/// workspace's own, built with the profile of this test where it is missing or old.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        if let Some(installed) = std::env::var_os("TERRAWALL") {
            return installed.into();
        }
        // The test stands in TARGET/PROFILE/deps, the program in TARGET/PROFILE.
        let test = std::env::current_exe().expect("a test knows where it is");
        let profile = test
            .parent()
            .and_then(Path::parent)
            .expect("a profile's folder");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut build = Command::new(cargo);
        build.args([
            "build",
            "--workspace",
            "--locked",
            "--quiet",
            "--target-dir",
        ]);
        build
            .arg(profile.parent().expect("a target folder"))
            .current_dir(sources::root());
        if profile.ends_with("release") {
            build.arg("--release");
        }
        forget_package(&mut build);
        assert!(
            build.status().expect("cargo runs").success(),
            "terrawall does not build"
        );
        profile.join("terrawall")
    })
}

/// Takes from a command what cargo tells tests of their own package. Build scripts that look at these variables would be
/// run again for them, and half of the workspace built anew.
pub fn forget_package(command: &mut Command) {
    const OF_PACKAGE: [&str; 5] = ["PKG", "MANIFEST", "CRATE", "BIN", "PRIMARY"];
    for (name, _) in std::env::vars_os() {
        let after = name.to_str().and_then(|name| name.strip_prefix("CARGO_"));
        if after.is_some_and(|after| OF_PACKAGE.iter().any(|of| after.starts_with(of))) {
            command.env_remove(&name);
        }
    }
}

/// Starts `terrawall` with these arguments in the root of the workspace.
pub fn start<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Running {
    start_with(arguments, &[])
}

/// The same with additions to the environment.
pub fn start_with<S: AsRef<OsStr>>(
    arguments: impl IntoIterator<Item = S>,
    environment: &[(&str, &str)],
) -> Running {
    let mut command = Command::new(program());
    command.args(arguments).current_dir(sources::root());
    command
        .env_remove("RUST_LOG")
        .envs(environment.iter().copied());
    let words = command
        .get_args()
        .map(|word| word.to_string_lossy())
        .collect::<Vec<_>>()
        .join(" ");
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().expect("terrawall starts");
    let stdout = child.stdout.take().map(read_all);
    let stderr = child.stderr.take().map(read_all);
    Running {
        child,
        stdout,
        stderr,
        words,
    }
}

/// Runs `terrawall` with these arguments to its end.
pub fn run<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Ran {
    start(arguments).wait()
}

/// Runs `terrawall` with the words of a line, which must succeed. Returns what it printed.
pub fn succeed(line: &str) -> String {
    let ran = run(line.split_whitespace());
    assert_eq!(ran.code, Some(0), "terrawall {line}\n{}", ran.stderr);
    ran.stdout
}

impl Running {
    /// Process number.
    pub fn process_id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has ended.
    pub fn has_ended(&mut self) -> bool {
        self.child
            .try_wait()
            .expect("a child can be asked")
            .is_some()
    }

    /// Waits for the end.
    pub fn wait(self) -> Ran {
        self.wait_within(PATIENCE)
    }

    /// Waits for the end of what may take longer.
    pub fn wait_within(mut self, patience: Duration) -> Ran {
        let deadline = Instant::now() + patience;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child can be asked") {
                break Some(status);
            }
            if Instant::now() > deadline {
                let _ = self.child.kill();
                break None;
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let text = |reader: Option<JoinHandle<String>>| {
            reader.map(|r| r.join().unwrap()).unwrap_or_default()
        };
        let (stdout, stderr) = (text(self.stdout.take()), text(self.stderr.take()));
        let status = status.unwrap_or_else(|| {
            panic!(
                "terrawall {} did not end within {patience:?}\n{stderr}",
                self.words
            );
        });
        Ran {
            code: status.code(),
            stdout,
            stderr,
        }
    }

    /// Sends it a signal by name, as `kill -NAME` does.
    pub fn signal(&self, name: &str) {
        signal(self.process_id(), name);
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A test that starts a wall holds this: walls side by side would measure each other.
pub fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    // A failed test before this one is no reason to fail.
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sends a signal to one process, as `kill -NAME` does. A process that has ended is no failure.
pub fn signal(process: u32, name: &str) {
    let _ = Command::new("kill")
        .arg(format!("-{name}"))
        .arg(process.to_string())
        .stderr(Stdio::null())
        .status();
}

/// Process numbers of the running children of a process.
pub fn children_of(process: u32) -> Vec<u32> {
    let mut children = Vec::new();
    for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Ok(child) = entry.file_name().to_string_lossy().parse::<u32>() else {
            continue;
        };
        let Ok(stat) = std::fs::read_to_string(entry.path().join("stat")) else {
            continue;
        };
        // "number (name) state parent …": the name may hold anything but ends at the last parenthesis.
        let fields = stat.rsplit(')').next().unwrap_or_default();
        let mut fields = fields.split_whitespace();
        if fields.next() != Some("Z") && fields.next() == Some(process.to_string().as_str()) {
            children.push(child);
        }
    }
    children
}

/// Waits until `condition` holds; fails the test when it does not within [`PATIENCE`].
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !condition() {
        assert!(Instant::now() < deadline, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn read_all(mut stream: impl std::io::Read + Send + 'static) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        String::from_utf8_lossy(&bytes).into_owned()
    })
}
