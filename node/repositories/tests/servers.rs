//! The client of repositories against servers that others made: nginx, and moto's S3 server, both behind a network
//! with 50 ms latency, 2 % of the requests failing, and an outage (3 s; `TERRAWALL_OUTAGE_SECONDS` sets another).
//!
//! Where a server is not installed its test says so on standard error and passes, unless `TERRAWALL_REQUIRE_NGINX=1`
//! or `TERRAWALL_REQUIRE_MOTO=1` is set.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod common;

use std::fs;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use common::{Action, Front, pyramid, quick, reply, tile_data, unlucky, write_repository};
use geodesy::Tile;
use repositories::{Address, Options, Repositories};
use tiles::{DATASET_FILE, OpenDataset, ReadError};

/// Requests in flight.
const LIMIT: usize = 8;
/// No thread that wants a tile may be held up for longer: an attempt that is given up and its pauses.
const LONGEST_FETCH: Duration = Duration::from_secs(6);
/// The return of a server must be noticed within this.
const RECOVERY: Duration = Duration::from_secs(4);

/// A server of others; it ends with the test.
struct Server {
    child: Child,
    address: SocketAddr,
}

impl Server {
    /// Starts a command and waits until it listens. `None`, and why on standard error, where there is none.
    fn start(command: &mut Command, address: SocketAddr, switch: &str) -> Option<Self> {
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

fn free_address() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap()
}

fn outage() -> Duration {
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

fn nginx(folder: &Path) -> Option<Server> {
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

fn moto() -> Option<Server> {
    let address = free_address();
    let mut command = Command::new("moto_server");
    command
        .args(["-H", "127.0.0.1", "-p", &address.port().to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    Server::start(&mut command, address, "TERRAWALL_REQUIRE_MOTO")
}

/// A plain PUT with an authorisation that moto does not verify.
fn put(server: SocketAddr, path: &str, body: &[u8]) {
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

fn upload(server: SocketAddr, root: &Path, folder: &Path, prefix: &str) {
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
fn front(server: SocketAddr, down: &'static AtomicBool, outage: fn() -> Action) -> Front {
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

/// Reads one tile until it is there, as a cache does; notes how long the longest call took.
fn insist(open: &OpenDataset, tile: Tile, longest: &Mutex<Duration>) {
    loop {
        let begin = Instant::now();
        let read = open.read_now(tile);
        let mut longest = longest.lock().unwrap();
        *longest = begin.elapsed().max(*longest);
        drop(longest);
        match read {
            Ok(read) => return assert_eq!(read.unwrap(), tile_data(tile)),
            Err(ReadError::Source(error)) => {
                let due = matches!(
                    error.source.kind(),
                    ErrorKind::NotConnected
                        | ErrorKind::TimedOut
                        | ErrorKind::ConnectionReset
                        | ErrorKind::ConnectionRefused
                        | ErrorKind::Other
                );
                assert!(due, "{error}");
            }
            Err(error) => panic!("{error}"),
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A flight: all tiles, by more threads than may ask, with an outage in the middle.
fn fly(repositories: &Repositories, open: &OpenDataset, front: &Front, down: &AtomicBool) {
    let tiles = pyramid(3);
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let longest = Mutex::new(Duration::ZERO);
    let during = AtomicU64::new(0);
    let recovery = Mutex::new(Duration::ZERO);
    std::thread::scope(|scope| {
        for _ in 0..2 * LIMIT {
            scope.spawn(|| {
                while let Some(tile) = tiles.get(next.fetch_add(1, Ordering::SeqCst)) {
                    insist(open, *tile, &longest);
                    done.fetch_add(1, Ordering::SeqCst);
                }
            });
        }
        while done.load(Ordering::SeqCst) < tiles.len() / 3 {
            std::thread::sleep(Duration::from_millis(5));
        }
        let before = front.requests();
        down.store(true, Ordering::SeqCst);
        std::thread::sleep(outage());
        during.store(front.requests() - before, Ordering::SeqCst);
        assert!(!repositories.states()[0].reachable);
        down.store(false, Ordering::SeqCst);
        let (begin, at_end) = (Instant::now(), done.load(Ordering::SeqCst));
        while done.load(Ordering::SeqCst) == at_end {
            std::thread::sleep(Duration::from_millis(5));
            assert!(begin.elapsed() < Duration::from_secs(30), "no recovery");
        }
        *recovery.lock().unwrap() = begin.elapsed();
    });
    let (longest, recovery) = (
        longest.into_inner().unwrap(),
        recovery.into_inner().unwrap(),
    );
    let during = during.into_inner();
    let state = &repositories.states()[0];
    eprintln!(
        "outage: {during} requests; longest call {longest:?}; recovery {recovery:?}; {state:?}"
    );
    assert!(state.reachable);
    assert!(longest < LONGEST_FETCH, "{longest:?}");
    assert!(recovery < RECOVERY, "{recovery:?}");
    // What was under way, what opened the breaker, and probes.
    let most = 40 + (outage().as_secs_f64() * 4.0) as u64;
    assert!(during < most, "{during} requests in the outage");
    assert!(front.most_in_flight() <= LIMIT as u64);
    assert!(state.failures > 0 && state.requests > tiles.len() as u64);
}

fn options() -> Options {
    Options {
        requests_in_flight: LIMIT,
        ..quick()
    }
}

#[test]
fn nginx_behind_a_bad_network() {
    static DOWN: AtomicBool = AtomicBool::new(false);
    let folder = tempfile::tempdir().unwrap();
    let mut repository = write_repository(&folder.path().join("www/earth"), 3);
    let Some(server) = nginx(folder.path()) else {
        return;
    };
    let front = front(server.address, &DOWN, || Action::Reset);
    let repositories = Repositories::new(&options()).unwrap();
    let address = front.url("/earth");
    let open = repositories.open(&address).unwrap();
    assert_eq!(open.dataset, *repository.dataset());
    fly(&repositories, &open, &front, &DOWN);
    let absent = Tile::ROOTS[0].children().unwrap()[0];
    repository.remove(absent).unwrap();
    assert!(open.read_now(absent).unwrap().is_none());
    assert!(repositories.revalidate(&address).unwrap().is_none());
    repository.update(|_| {}).unwrap();
    let again = repositories.revalidate(&address).unwrap().unwrap();
    assert_eq!(again.dataset, *repository.dataset());
    let none: Address = front.url("/mars");
    let error = repositories.open(&none).err().unwrap();
    assert!(error.to_string().contains("is no repository"), "{error}");
}

#[test]
fn an_s3_server_behind_a_bad_network() {
    static DOWN: AtomicBool = AtomicBool::new(false);
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("earth");
    let mut repository = write_repository(&root, 3);
    let Some(server) = moto() else {
        return;
    };
    put(server.address, "/globe", b"");
    upload(server.address, &root, &root, "/globe/maps/earth");
    let front = front(server.address, &DOWN, || Action::Silence);
    let file = folder.path().join("keys.toml");
    let keys = format!(
        "access_key_id = \"test\"\nsecret_access_key = \"hush\"\nregion = \"us-east-1\"\n\
         endpoint_url = \"http://{}\"\nallow_http = true\n",
        front.address
    );
    fs::write(&file, keys).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
    let repositories = Repositories::new(&Options {
        credentials_file: Some(file),
        ..options()
    })
    .unwrap();
    let address: Address = "s3://globe/maps/earth".parse().unwrap();
    let open = repositories.open(&address).unwrap();
    assert_eq!(open.dataset, *repository.dataset());
    fly(&repositories, &open, &front, &DOWN);
    // One that the repository never had.
    let absent = pyramid(3).last().unwrap().children().unwrap()[0];
    assert!(open.read_now(absent).unwrap().is_none());
    assert!(repositories.revalidate(&address).unwrap().is_none());
    repository.update(|_| {}).unwrap();
    let description = fs::read(root.join(DATASET_FILE)).unwrap();
    let key = format!("/globe/maps/earth/{DATASET_FILE}");
    put(server.address, &key, &description);
    let again = repositories.revalidate(&address).unwrap().unwrap();
    assert_eq!(again.dataset, *repository.dataset());
    let none: Address = "s3://nobody/maps".parse().unwrap();
    let error = repositories.open(&none).err().unwrap();
    assert!(error.to_string().contains("is no repository"), "{error}");
    assert!(!format!("{:?}", repositories.states()).contains("hush"));
}
