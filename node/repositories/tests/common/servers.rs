//! Servers that others made, and the network before them: nginx, and moto's S3 server.
//! In: folders. Out: processes that end with the test, or word that they are not installed.
#![allow(
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; not all tests use all of it"
)]

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::front::{Action, Front, reply, unlucky};

/// A server of others; it ends with the test.
pub struct Server {
    child: Child,
    pub address: SocketAddr,
}

impl Server {
    /// Starts a command and waits until it listens. `None`, and why on standard error, where there is none.
    pub fn start(command: &mut Command, address: SocketAddr, switch: &str) -> Option<Self> {
        let name = command.get_program().to_string_lossy().into_owned();
        let child = match command.stdin(Stdio::null()).spawn() {
            Ok(child) => child,
            Err(error) => {
                assert!(
                    std::env::var(switch).is_err(),
                    "{switch} is set, but {name} cannot be started: {error}"
                );
                eprintln!(
                    "SKIPPED: {name} cannot be started ({error}); {switch}=1 makes this a failure"
                );
                return None;
            }
        };
        let mut server = Self { child, address };
        let begin = Instant::now();
        while TcpStream::connect(address).is_err() {
            let ended = server.child.try_wait().unwrap();
            assert!(ended.is_none(), "{name} has ended: {ended:?}");
            assert!(
                begin.elapsed() < Duration::from_secs(60),
                "{name} does not listen"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(server)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap()
}

pub fn outage() -> Duration {
    let seconds = std::env::var("TERRAWALL_OUTAGE_SECONDS");
    Duration::from_secs_f64(seconds.map_or(3.0, |seconds| seconds.parse().unwrap()))
}

/// Debian puts it where only root looks.
fn nginx_program() -> PathBuf {
    let usual = Path::new("/usr/sbin/nginx");
    if usual.is_file() {
        usual.to_owned()
    } else {
        PathBuf::from("nginx")
    }
}

pub fn nginx(folder: &Path) -> Option<Server> {
    let address = free_address();
    let place = folder.display();
    let configuration = format!(
        "daemon off;\nmaster_process off;\npid {place}/pid;\nerror_log {place}/errors;\n\
         events {{ worker_connections 64; }}\n\
         http {{\n access_log off;\n client_body_temp_path {place}/t1;\n proxy_temp_path {place}/t2;\n \
         fastcgi_temp_path {place}/t3;\n uwsgi_temp_path {place}/t4;\n scgi_temp_path {place}/t5;\n \
         server {{ listen {address}; root {place}/www; }}\n}}\n"
    );
    let file = folder.join("nginx.conf");
    fs::write(&file, configuration).unwrap();
    let mut command = Command::new(nginx_program());
    command
        .arg("-e")
        .arg(folder.join("errors"))
        .arg("-c")
        .arg(&file)
        .arg("-p")
        .arg(folder);
    if folder.metadata().unwrap().uid() == 0 {
        // As nobody, who may write here and nowhere else.
        fs::set_permissions(folder, fs::Permissions::from_mode(0o777)).unwrap();
        command.uid(65_534).gid(65_534);
    }
    Server::start(&mut command, address, "TERRAWALL_REQUIRE_NGINX")
}

pub fn moto() -> Option<Server> {
    let address = free_address();
    let mut command = Command::new("moto_server");
    command
        .args(["-H", "127.0.0.1", "-p", &address.port().to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    Server::start(&mut command, address, "TERRAWALL_REQUIRE_MOTO")
}

/// A plain PUT with an authorisation that moto does not verify.
pub fn put(server: SocketAddr, path: &str, body: &[u8]) {
    let mut stream = TcpStream::connect(server).unwrap();
    write!(
        stream,
        "PUT {path} HTTP/1.1\r\nHost: {server}\r\nConnection: close\r\nContent-Length: {}\r\nAuthorization: \
         AWS4-HMAC-SHA256 Credential=test/20260101/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=0\r\n\r\n",
        body.len()
    )
    .unwrap();
    stream.write_all(body).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let status = answer.lines().next().unwrap_or_default();
    assert!(status.contains(" 200 "), "PUT {path}: {answer}");
}

pub fn upload(server: SocketAddr, root: &Path, folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            upload(server, root, &path, prefix);
        } else {
            let key = path.strip_prefix(root).unwrap().display();
            put(
                server,
                &format!("{prefix}/{key}"),
                &fs::read(&path).unwrap(),
            );
        }
    }
}

/// What the network does: latency always, single failures now and then, and outages.
pub fn front(server: SocketAddr, down: &'static AtomicBool, outage: fn() -> Action) -> Front {
    Front::new(Some(server), move |head| {
        if down.load(Ordering::SeqCst) {
            return outage();
        }
        std::thread::sleep(Duration::from_millis(50));
        if unlucky(head.number, 1, 1) {
            reply("503 Service Unavailable", "", b"<Code>SlowDown</Code>")
        } else if unlucky(head.number, 2, 1) {
            Action::Reset
        } else {
            Action::Forward
        }
    })
}
