//! The program `cfpose`: poses and other transformations between point sets without correspondences.
//!
//! It reads arguments and files, calls the libraries and prints; it holds no mathematics. The contract of commands, JSON
//! fields and exit codes is `docs/program.md`.

mod args;
mod commands;
mod failure;
mod inputs;
mod output;
mod progress;
mod report;
mod starts;

use std::process::ExitCode;

use clap::Parser;

use failure::Failure;

fn main() -> ExitCode {
    let arguments = match args::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no error; a closed pipe while they are printed is none either.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    match commands::run(&arguments.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report(&failure),
    }
}

/// Print the one line of a failure and return its exit code.
fn report(failure: &Failure) -> ExitCode {
    if failure.is_broken_pipe() {
        return ExitCode::SUCCESS;
    }
    output::note(&format!("error: {}", failure.message()));
    ExitCode::from(failure.kind.exit_code())
}
