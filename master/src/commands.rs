//! The commands of `terrawall`: each takes its arguments and returns an outcome.

mod adjust;
mod bench;
mod bench_cache;
mod bench_frame;
mod bench_import;
mod bench_process;
mod bench_refine;
mod bench_starts;
mod cache;
mod check;
mod client;
mod control;
mod convert;
mod files;
mod identity;
mod import;
mod inspect;
mod local;
mod node;
mod notices;
mod pictures;
mod serve;
mod set;
mod show;
mod synthetic;
mod verify;

use crate::args::Command;
use crate::failure::Failure;

/// Does what was asked for.
pub(crate) fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Up(args) => show::up(&args),
        Command::Master(args) => show::master(&args),
        Command::Set(args) => set::run(&args),
        Command::Adjust(args) => adjust::adjust(&args),
        Command::Pattern(args) => adjust::pattern(&args),
        Command::Node(args) => node::run(args),
        Command::Import(args) => import::run(args),
        Command::Check(args) => check::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Serve(args) => serve::run(&args),
        Command::Cache(args) => cache::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Identity(args) => identity::run(args),
    }
}
