//! The `terrawall` command: arguments in, exit status out.
//!
//! Exit status: 0 fine, 1 a failure, 2 wrong usage or configuration. Standard output belongs to results,
//! standard error to progress, logs and the one paragraph that says what went wrong.

mod args;
mod commands;
mod compare;
mod failure;
mod interrupt;
mod output;
mod plan;
mod plot;

use std::process::ExitCode;

use clap::Parser as _;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(error) => {
            // Help and version go to standard output, complaints to standard error; a closed pipe is fine.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() {
                failure::USAGE
            } else {
                0
            });
        }
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("error"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .init();
    let outcome = interrupt::install().and_then(|()| commands::run(args.command));
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("terrawall: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}
