//! The command line of `terrawall serve`.
//!
//! In: the arguments of the process. Out: [`Serve`]. What is in the directory is the command's business.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args as ArgumentGroup;

/// What a glance at `terrawall serve --help` should teach.
const EXPLANATION: &str = "\
Only what a repository consists of can be had: dataset.toml, index.bin and the tiles. There is no listing, hidden \
files and links are not served, nothing can be written. Everybody who reaches the address may read: keep it within \
the building, or put a web server before it that asks for passwords and encrypts. Repositories may be imported into \
while they are served; clients notice it by the entity tags (every answer must be validated anew before a cache uses \
it, which costs a few bytes). Any other web server, and any S3-compatible store, serves repositories as well: copy \
the directory as it is.

Where DIR is a repository its address is http://HOST:PORT. Where DIR holds repositories their addresses are \
http://HOST:PORT/NAME, for names of letters, digits, dots, hyphens and underlines.

Examples:
  terrawall serve data/relief
  terrawall serve data --listen 0.0.0.0:8480";

/// `terrawall serve`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = EXPLANATION)]
pub(crate) struct Serve {
    /// A repository, or a directory of repositories
    #[arg(value_name = "DIR")]
    pub(crate) directory: PathBuf,
    /// Address and TCP port at which to listen; port 0 takes a free one. 0.0.0.0 is every network of this machine
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8480")]
    pub(crate) listen: SocketAddr,
    /// Connections at the same time; further clients wait
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) connections: u32,
}
