//! What a client of the server may rely on, over real sockets: ranges, validators, methods, refusals, and a
//! repository that is imported into while it is served. HTTP is spelt out here, so that no client library hides
//! what is on the wire.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::collections::HashMap;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};

use geodesy::Tile;
use serve::{Config, ServeError, Server};
use tiles::{Dataset, Index, Kind, Repository, SampleType};

/// A repository with the roots; each tile file is 1000 bytes of its own. The server does not look into them.
fn repository(root: &Path) -> Repository {
    let dataset = Dataset::new("test", Kind::Sar, SampleType::U8, 1);
    let mut repository = Repository::create(root, dataset).unwrap();
    let mut index = Index::new();
    for tile in Tile::ROOTS {
        repository.write_atomic(tile, &content(tile)).unwrap();
        index.insert(tile, 0.0, 1.0);
    }
    repository.store_index(&index).unwrap();
    repository.update(|_| {}).unwrap();
    repository
}

fn content(tile: Tile) -> Vec<u8> {
    (0..1_000_u32)
        .map(|k| (k + tile.id() as u32) as u8)
        .collect()
}

fn start(directory: &Path) -> Server {
    Server::start(&Config::new(directory, "127.0.0.1:0".parse().unwrap())).unwrap()
}

struct Answer {
    status: u16,
    headers: HashMap<String, String>,
    body: Vec<u8>,
}

impl Answer {
    fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", String::as_str)
    }
}

/// Sends one request on a connection of its own.
fn ask(address: SocketAddr, method: &str, path: &str, headers: &str) -> Answer {
    let mut stream = TcpStream::connect(address).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: here\r\nConnection: close\r\n{headers}\r\n"
    )
    .unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
    let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let mut lines = head.lines();
    let status = lines.next().unwrap().split(' ').nth(1).unwrap();
    Answer {
        status: status.parse().unwrap(),
        headers: lines
            .filter_map(|line| line.split_once(": "))
            .map(|(name, value)| (name.to_ascii_lowercase(), value.to_owned()))
            .collect(),
        body: bytes[end + 4..].to_vec(),
    }
}

fn get(address: SocketAddr, path: &str, headers: &str) -> Answer {
    ask(address, "GET", path, headers)
}

#[test]
fn files_come_whole_with_what_caches_need() {
    let folder = tempfile::tempdir().unwrap();
    repository(folder.path());
    let server = start(folder.path());
    assert_eq!(server.repositories(), [String::new()]);
    let address = server.address();
    let tile = get(address, "/0/003.tile", "");
    assert_eq!((tile.status, &tile.body), (200, &content(Tile::ROOTS[3])));
    assert_eq!(tile.header("content-length"), "1000");
    assert_eq!(tile.header("cache-control"), "no-cache");
    assert_eq!(tile.header("accept-ranges"), "bytes");
    assert_eq!(tile.header("x-content-type-options"), "nosniff");
    let tag = tile.header("etag");
    assert!(
        tag.starts_with('"') && tag.ends_with('"'),
        "{tag} is not strong"
    );
    assert!(tile.header("last-modified").ends_with(" GMT"));
    for name in ["dataset.toml", "index.bin"] {
        let answer = get(address, &format!("/{name}"), "");
        assert_eq!(answer.status, 200);
        assert_eq!(answer.body, fs::read(folder.path().join(name)).unwrap());
    }
    // HEAD says the same without the body.
    let head = ask(address, "HEAD", "/0/003.tile", "");
    assert_eq!((head.status, head.body.len()), (200, 0));
    for name in ["content-length", "etag", "last-modified", "cache-control"] {
        assert_eq!(head.header(name), tile.header(name), "{name}");
    }
    let counters = server.counters();
    assert_eq!((counters.requests, counters.files), (4, 4));
    let sizes = ["0/003.tile", "dataset.toml", "index.bin"]
        .map(|name| folder.path().join(name).metadata().unwrap().len());
    assert_eq!(counters.bytes, sizes.iter().sum::<u64>());
}

#[test]
fn conditions_save_the_body() {
    let folder = tempfile::tempdir().unwrap();
    let mut repository = repository(folder.path());
    let server = start(folder.path());
    let address = server.address();
    let first = get(address, "/dataset.toml", "");
    let (tag, moment) = (first.header("etag"), first.header("last-modified"));
    for condition in [
        format!("If-None-Match: {tag}\r\n"),
        format!("If-None-Match: \"other\", {tag}\r\n"),
        "If-None-Match: *\r\n".to_owned(),
        format!("If-Modified-Since: {moment}\r\n"),
        // The tag decides where both are given.
        format!("If-None-Match: {tag}\r\nIf-Modified-Since: Sun, 06 Nov 1994 08:49:37 GMT\r\n"),
    ] {
        for method in ["GET", "HEAD"] {
            let answer = ask(address, method, "/dataset.toml", &condition);
            assert_eq!((answer.status, answer.body.len()), (304, 0), "{condition}");
            assert_eq!(answer.header("etag"), tag);
            assert_eq!(answer.header("cache-control"), "no-cache");
        }
    }
    for condition in [
        "If-None-Match: \"other\"\r\n",
        "If-Modified-Since: Sun, 06 Nov 1994 08:49:37 GMT\r\n",
        "If-Modified-Since: yesterday\r\n",
    ] {
        assert_eq!(get(address, "/dataset.toml", condition).status, 200);
    }
    assert_eq!(
        get(address, "/dataset.toml", "If-Match: \"other\"\r\n").status,
        412
    );
    assert_eq!(server.counters().not_modified, 10);
    // An import: the same condition no longer holds, however soon it came.
    repository
        .update(|dataset| dataset.deepest_level = 1)
        .unwrap();
    let again = get(
        address,
        "/dataset.toml",
        &format!("If-None-Match: {tag}\r\n"),
    );
    assert_eq!(again.status, 200);
    assert_ne!(again.header("etag"), tag);
}

#[test]
fn every_publication_has_a_tag_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let repository = repository(folder.path());
    let server = start(folder.path());
    let tile = Tile::ROOTS[0];
    // As fast as it goes: many within one tick of the file system's clock, all of the same size.
    let mut last = (Vec::new(), String::new());
    for round in 0..300_u32 {
        let bytes = vec![round as u8; 100];
        repository.write_atomic(tile, &bytes).unwrap();
        let answer = get(server.address(), "/0/000.tile", "");
        assert_eq!(answer.body, bytes);
        assert_ne!(answer.header("etag"), last.1, "round {round}");
        last = (bytes, answer.header("etag").to_owned());
    }
}

#[test]
fn ranges_are_single_and_possible() {
    let folder = tempfile::tempdir().unwrap();
    repository(folder.path());
    let server = start(folder.path());
    let whole = content(Tile::ROOTS[1]);
    let range = |range: &str| {
        get(
            server.address(),
            "/0/001.tile",
            &format!("Range: bytes={range}\r\n"),
        )
    };
    for (asked, due) in [
        ("0-0", 0..1),
        ("10-19", 10..20),
        ("990-", 990..1_000),
        ("-7", 993..1_000),
        ("990-5000", 990..1_000),
        ("0-999", 0..1_000),
    ] {
        let answer = range(asked);
        assert_eq!(answer.status, 206, "{asked}");
        assert_eq!(answer.body, whole[due.clone()], "{asked}");
        let said = format!("bytes {}-{}/1000", due.start, due.end - 1);
        assert_eq!(answer.header("content-range"), said);
        assert_eq!(answer.header("content-length"), due.len().to_string());
    }
    for asked in ["1000-", "5000-6000"] {
        let answer = range(asked);
        assert_eq!((answer.status, answer.body.len()), (416, 0), "{asked}");
        assert_eq!(answer.header("content-range"), "bytes */1000");
    }
    // Several at once are not served; whoever asks for them learns it.
    assert_eq!(range("0-1,5-6").status, 416);
    // A part for who already has another: the whole is always right.
    let headers = "Range: bytes=10-19\r\nIf-Range: \"other\"\r\n";
    let answer = get(server.address(), "/0/001.tile", headers);
    assert_eq!((answer.status, &answer.body), (200, &whole));
}

#[test]
fn nothing_else_can_be_had() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("served");
    repository(&root);
    fs::write(folder.path().join("dataset.toml"), "hush").unwrap();
    fs::write(folder.path().join("secret.tile"), "hush").unwrap();
    fs::write(root.join("notes.txt"), "hush").unwrap();
    fs::write(root.join(".dataset.toml.tmp"), "hush").unwrap();
    fs::create_dir_all(root.join("1")).unwrap();
    std::os::unix::fs::symlink("../../secret.tile", root.join("1/000.tile")).unwrap();
    std::os::unix::fs::symlink(folder.path(), root.join("2")).unwrap();
    fs::write(folder.path().join("000.tile"), "hush").unwrap();
    let server = start(&root);
    for path in [
        "/",
        "/0",
        "/0/",
        "/notes.txt",
        "/.dataset.toml.tmp",
        "/../dataset.toml",
        "/../secret.tile",
        "/0/../../dataset.toml",
        "/%2e%2e/dataset.toml",
        "/..%2fdataset.toml",
        "/0/..%2f..%2fdataset.toml",
        "/..%5cdataset.toml",
        "//etc/passwd",
        "/etc/passwd",
        "/0/003.tile%00",
        "/0/006.tile",
        "/22/000/000/000/000.tile",
        "/1/000.tile",
        "/2/000.tile",
        "/2/secret.tile",
        "http://elsewhere/../dataset.toml",
        "/served/dataset.toml",
    ] {
        let answer = get(server.address(), path, "");
        assert!(
            matches!(answer.status, 400 | 403 | 404),
            "{path}: {}",
            answer.status
        );
        assert!(!String::from_utf8_lossy(&answer.body).contains("hush"));
    }
    assert_eq!(get(server.address(), "/0/003.tile?x=../y", "").status, 200);
    for method in ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "PROPFIND"] {
        let answer = ask(
            server.address(),
            method,
            "/0/003.tile",
            "Content-Length: 0\r\n",
        );
        assert_eq!((answer.status, answer.header("allow")), (405, "GET, HEAD"));
    }
    assert!(root.join("0/003.tile").is_file());
    let counters = server.counters();
    assert_eq!((counters.files, counters.bytes), (1, 1_000));
    // The other methods, and the link.
    assert_eq!(counters.refused, 7);
}

#[test]
fn a_directory_of_repositories_has_one_at_each_name() {
    let folder = tempfile::tempdir().unwrap();
    let listen = "127.0.0.1:0".parse().unwrap();
    let error = Server::start(&Config::new(folder.path(), listen))
        .err()
        .unwrap();
    assert!(matches!(error, ServeError::NoRepository { .. }), "{error}");
    repository(&folder.path().join("relief"));
    repository(&folder.path().join("photo-2"));
    repository(&folder.path().join("not served"));
    std::os::unix::fs::symlink("relief", folder.path().join("alias")).unwrap();
    let server = start(folder.path());
    assert_eq!(server.repositories(), ["photo-2", "relief"]);
    let status = |path: &str| get(server.address(), path, "").status;
    assert_eq!(status("/relief/dataset.toml"), 200);
    assert_eq!(status("/photo-2/0/003.tile"), 200);
    for path in [
        "/dataset.toml",
        "/other/dataset.toml",
        "/not%20served/dataset.toml",
        "/alias/dataset.toml",
    ] {
        assert_eq!(status(path), 404, "{path}");
    }
    repository(&folder.path().join("later"));
    assert_eq!(status("/later/dataset.toml"), 200);
}

#[test]
fn an_import_under_the_server_never_shows_half_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let repository = repository(folder.path());
    let server = start(folder.path());
    let tile = Tile::ROOTS[2];
    let write = |round: u8| {
        let bytes = vec![round; 200_000 + usize::from(round)];
        repository.write_atomic(tile, &bytes).unwrap();
    };
    write(0);
    let deadline = Instant::now() + Duration::from_secs(2);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut round = 0_u8;
            while Instant::now() < deadline {
                round = round.wrapping_add(1);
                write(round);
            }
        });
        for _ in 0..2 {
            scope.spawn(|| {
                let mut seen = 0;
                while Instant::now() < deadline {
                    let answer = get(server.address(), "/0/002.tile", "");
                    assert_eq!(answer.status, 200);
                    let round = answer.body[0];
                    assert_eq!(answer.body.len(), 200_000 + usize::from(round));
                    assert!(answer.body.iter().all(|byte| *byte == round));
                    seen += 1;
                }
                assert!(seen > 10, "only {seen} reads");
            });
        }
    });
}

#[test]
fn unreadable_is_not_absent() {
    let folder = tempfile::tempdir().unwrap();
    repository(folder.path());
    let server = start(folder.path());
    let path = folder.path().join("0/004.tile");
    fs::remove_file(&path).unwrap();
    // A socket cannot be opened, not even by who may do everything; it stands for a disk that fails.
    let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
    let answer = get(server.address(), "/0/004.tile", "");
    assert_eq!((answer.status, answer.header("retry-after")), (503, "1"));
    assert_eq!(server.counters().failed, 1);
}

#[test]
fn the_silent_are_cut_off_and_the_end_is_prompt() {
    let folder = tempfile::tempdir().unwrap();
    repository(folder.path());
    let config = Config {
        connections: 4,
        stillness: Duration::from_millis(300),
        ..Config::new(folder.path(), "127.0.0.1:0".parse().unwrap())
    };
    let server = Server::start(&config).unwrap();
    let address = server.address();
    let mut silent: Vec<TcpStream> = (0..8)
        .map(|_| TcpStream::connect(address).unwrap())
        .collect();
    silent[0].write_all(b"GET /0/00").unwrap();
    let begin = Instant::now();
    assert_eq!(get(address, "/0/003.tile", "").status, 200);
    let waited = begin.elapsed();
    assert!(waited > Duration::from_millis(250), "{waited:?}");
    assert!(waited < Duration::from_secs(5), "{waited:?}");
    // An idle connection does not hold up the end.
    let _idle = TcpStream::connect(address).unwrap();
    let begin = Instant::now();
    assert!(server.is_running());
    drop(server);
    assert!(begin.elapsed() < Duration::from_secs(4));
    assert!(TcpStream::connect(address).is_err());
}

#[test]
fn a_taken_address_is_named() {
    let folder = tempfile::tempdir().unwrap();
    repository(folder.path());
    let server = start(folder.path());
    let again = Server::start(&Config::new(folder.path(), server.address()));
    let message = again.err().unwrap().to_string();
    assert!(message.contains(&server.address().to_string()), "{message}");
    let none = Config {
        connections: 0,
        ..Config::new(folder.path(), "127.0.0.1:0".parse().unwrap())
    };
    assert!(matches!(
        Server::start(&none),
        Err(ServeError::Connections { connections: 0 })
    ));
}
