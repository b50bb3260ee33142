//! `terrawall serve DIR`: repositories over HTTP until Ctrl-C.
//!
//! In: a directory, an address. Out: the addresses of its repositories on standard output, one a line, as soon as
//! they can be asked for; what was answered, on standard error at the end. It must not touch the data.

use std::time::Duration;

use serve::{Config, ServeError, Server};

use crate::args::Serve;
use crate::failure::Failure;
use crate::{interrupt, output};

/// How often Ctrl-C is looked for.
const GLANCE: Duration = Duration::from_millis(100);

/// Serves until the operator has had enough.
pub(crate) fn run(args: &Serve) -> Result<(), Failure> {
    let config = Config {
        connections: args.connections as usize,
        ..Config::new(&args.directory, args.listen)
    };
    let server = Server::start(&config).map_err(|error| match error {
        ServeError::System(_) => Failure::failed(error),
        _ => Failure::configuration(error),
    })?;
    for repository in server.repositories() {
        output::line(address(&server, repository))?;
    }
    eprintln!("terrawall: serving until Ctrl-C");
    while !interrupt::requested() {
        if !server.is_running() {
            return Err(Failure::failed(
                "the server has ended by itself; RUST_LOG=info shows why",
            ));
        }
        std::thread::sleep(GLANCE);
    }
    let counters = server.counters();
    drop(server);
    eprintln!(
        "terrawall: {} requests: {} files ({} bytes), {} unchanged, {} missing, {} refused, {} unreadable",
        counters.requests,
        counters.files,
        counters.bytes,
        counters.not_modified,
        counters.missing,
        counters.refused,
        counters.failed
    );
    Ok(())
}

/// The address of a repository, as scenes name it.
fn address(server: &Server, repository: &str) -> String {
    let address = format!("http://{}/{repository}", server.address());
    address.trim_end_matches('/').to_owned()
}
