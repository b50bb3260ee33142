//! `terrawall serve`: the address on standard output, files while it runs, a clean end by Ctrl-C.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

fn terrawall(directory: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrawall"));
    command
        .arg("serve")
        .arg(directory)
        .args(["--listen", "127.0.0.1:0"])
        .args(more);
    command
}

/// Ends by the signal of Ctrl-C; kills what does not end.
fn interrupt(mut child: Child) -> (Option<i32>, String) {
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begin.elapsed() > Duration::from_secs(10) {
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), text)
}

fn get(address: &str, path: &str) -> String {
    let host = address.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host.split('/').next().unwrap()).unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn serves_until_it_is_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["relief", "photo"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
        std::fs::write(folder.path().join(name).join("dataset.toml"), name).unwrap();
    }
    let mut child = terrawall(folder.path(), &[])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let addresses = [
        lines.next().unwrap().unwrap(),
        lines.next().unwrap().unwrap(),
    ];
    assert!(addresses[0].ends_with("/photo"), "{addresses:?}");
    assert!(addresses[1].ends_with("/relief"), "{addresses:?}");
    let answer = get(&addresses[1], "/relief/dataset.toml");
    assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with("relief"));
    assert!(get(&addresses[1], "/../relief/dataset.toml").starts_with("HTTP/1.1 404"));
    let (status, text) = interrupt(child);
    assert_eq!(status, Some(0), "{text}");
    assert!(text.contains("2 requests: 1 files (6 bytes)"), "{text}");
}

#[test]
fn what_cannot_be_served_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let complaint = |more: &[&str]| {
        let output = terrawall(folder.path(), more).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(complaint(&[]).contains("terrawall import"));
    assert!(complaint(&["--connections", "0"]).contains("--connections"));
    let output = Command::new(env!("CARGO_BIN_EXE_terrawall"))
        .args(["serve", "--help"])
        .output()
        .unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    // Lines break where the terminal ends.
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "no listing",
        "127.0.0.1:8480",
        "Examples:",
        "http://HOST:PORT/NAME",
    ] {
        assert!(help.contains(part), "{help}");
    }
}
